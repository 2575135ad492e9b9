//! The numbers in a LAS header that decide how much is allocated, checked against the file before the decoder believes them.
//!
//! Offsets are those of the LAS 1.4 R15 specification, table 3 (public header block) and section 2.7 (extended records).

use std::io::{Read, Seek, SeekFrom};

/// Bytes of the largest header.
const HEADER: usize = 375;
/// Bytes of an extended record before its data.
const EXTENDED_RECORD: u64 = 60;
/// More points than this do not fit into any file's length below 2⁶³ bytes.
const POINTS_MAX: u64 = 1 << 40;

/// Says what is wrong with the header of a file of `length` bytes; the reader is left at the start.
pub(super) fn check(read: &mut (impl Read + Seek), length: u64) -> Result<(), String> {
    let mut header = Vec::with_capacity(HEADER);
    let failed = |error: std::io::Error| error.to_string();
    read.by_ref().take(HEADER as u64).read_to_end(&mut header).map_err(failed)?;
    if header.get(..4) != Some(b"LASF") {
        return Err("it does not begin with LASF".to_owned());
    }
    let minor = header.get(25).copied().unwrap_or(0);
    let data = u64::from(u32_at(&header, 96).ok_or("the header is cut off")?);
    if data > length {
        return Err(format!("points are said to begin at byte {data} of {length}"));
    }
    let records = u64::from(u32_at(&header, 100).unwrap_or(0));
    if records.saturating_mul(54) > data {
        return Err(format!("{records} variable length records do not fit before byte {data}"));
    }
    if minor >= 4 {
        check_extended(read, &header, length)?;
    }
    read.seek(SeekFrom::Start(0)).map(|_| ()).map_err(failed)
}

fn check_extended(read: &mut (impl Read + Seek), header: &[u8], length: u64) -> Result<(), String> {
    let points = u64_at(header, 247).unwrap_or(0);
    if points > POINTS_MAX {
        return Err(format!("{points} points in a file of {length} bytes"));
    }
    let (start, count) = (u64_at(header, 235).unwrap_or(0), u32_at(header, 243).unwrap_or(0));
    if count == 0 {
        return Ok(());
    }
    let past_end = || format!("an extended record at byte {start} of {length} does not fit");
    if start.saturating_add(EXTENDED_RECORD) > length {
        return Err(past_end());
    }
    let mut record = [0u8; EXTENDED_RECORD as usize];
    read.seek(SeekFrom::Start(start)).map_err(|e| e.to_string())?;
    read.read_exact(&mut record).map_err(|e| e.to_string())?;
    let data = u64_at(&record, 20).unwrap_or(u64::MAX);
    if data > length - start - EXTENDED_RECORD { Err(past_end()) } else { Ok(()) }
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}
