//! The numbers of a LAS or LAZ file that decide how much is allocated, checked against its length before the decoder believes
//! them: an allocation that fails ends the process, no error comes of it.
//!
//! Offsets are those of the LAS 1.4 R15 specification, table 3 (public header block) and section 2.7 (extended records); those of
//! compressed points are LASzip's: where the table of chunks stands, the chunks, the table.

use std::io::{Read, Seek, SeekFrom};

use las::Header;
use las::laz::is_laszip_vlr;
use laz::LazVlr;
use laz::laszip::{ChunkTable, LazItemType};

/// Bytes of the largest header.
const HEADER: usize = 375;
/// Bytes of an extended record before its data.
const EXTENDED_RECORD: u64 = 60;
/// More points than this do not fit into any file's length below 2⁶³ bytes.
const POINTS_MAX: u64 = 1 << 40;

/// LASzip's oldest way of compressing: no chunks, no table of them.
const POINT_WISE: [u8; 2] = 1u16.to_le_bytes();

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
    let data = bytes_at(read, SeekFrom::Start(start + 20)).map_or(u64::MAX, u64::from_le_bytes);
    if data > length - start - EXTENDED_RECORD { Err(past_end()) } else { Ok(()) }
}

/// Says what is wrong with the table of compressed points' chunks or with a chunk of a file of `length` bytes; `read` stands where the
/// points begin.
pub(super) fn check_chunks(read: &mut (impl Read + Seek), header: &Header, length: u64) -> Result<(), String> {
    let Some(record) = header.vlrs().iter().find(|record| is_laszip_vlr(record)) else { return Ok(()) };
    let form = LazVlr::from_buffer(&record.data).map_err(|error| error.to_string())?;
    let (point_bytes, stated) = (form.items_size(), u64::from(header.point_format().len()));
    if point_bytes != stated {
        return Err(format!("compressed points of {point_bytes} bytes, the header says {stated}"));
    }
    let failed = |error: std::io::Error| error.to_string();
    if !record.data.starts_with(&POINT_WISE) {
        let data = read.stream_position().map_err(failed)?;
        check_chunk_count(read, data, point_bytes, length)?;
        read.seek(SeekFrom::Start(data)).map_err(failed)?;
        ChunkTable::read_from(&mut *read, &form)
            .map_err(|error| format!("the table of the points' chunks: {error}"))?;
    }
    check_layers(read, &form, header.number_of_points(), length)
}

/// Every chunk begins with a point that is not compressed.
fn check_chunk_count(read: &mut (impl Read + Seek), data: u64, point_bytes: u64, length: u64) -> Result<(), String> {
    let mut place = |from| Some(i64::from_le_bytes(bytes_at(read, from)?)).filter(|&at| at > data as i64);
    // A writer that could not go back put the place of the table behind it.
    let table = place(SeekFrom::Start(data)).or_else(|| place(SeekFrom::End(-8)));
    let chunks =
        table.and_then(|table| bytes_at(read, SeekFrom::Start(table as u64 + 4))).map_or(0, u32::from_le_bytes);
    if u64::from(chunks).saturating_mul(point_bytes) > length {
        return Err(format!("{chunks} chunks of points in a file of {length} bytes"));
    }
    Ok(())
}

/// Says where a chunk's layers do not fit; `read` stands at the first chunk. Chunks in layers (point formats 6 to 10) begin with a point,
/// how many there are, and how many bytes each layer has; the next chunk follows the last layer.
fn check_layers(read: &mut (impl Read + Seek), form: &LazVlr, points: u64, length: u64) -> Result<(), String> {
    let mut layers = 0;
    for item in form.items() {
        layers += match item.item_type() {
            LazItemType::Point14 => 9,
            LazItemType::RGB14 | LazItemType::WavePacket14 => 1,
            LazItemType::RGBNIR14 => 2,
            LazItemType::Byte14(count) => usize::from(count),
            _ => return Ok(()),
        };
    }
    let mut at = read.stream_position().map_err(|error| error.to_string())?;
    let (mut left, mut sizes) = (points, vec![0u8; 4 * layers]);
    while left > 0 {
        let count = bytes_at(read, SeekFrom::Start(at + form.items_size())).map(u32::from_le_bytes);
        let Some(count) = count.filter(|_| read.read_exact(&mut sizes).is_ok()) else {
            return Err(format!("it ends at byte {length}, {left} points before the last"));
        };
        let held: u64 = sizes.chunks_exact(4).filter_map(|size| u32_at(size, 0)).map(u64::from).sum();
        at += form.items_size() + 4 + sizes.len() as u64;
        if held > length - at {
            return Err(format!("{held} bytes of points from byte {at} on, the file has {length}"));
        }
        at += held;
        let count = if form.uses_variable_size_chunks() { count } else { form.chunk_size() };
        left = left.saturating_sub(u64::from(count.max(1)));
    }
    Ok(())
}

/// The bytes at a place, if it is in the file.
fn bytes_at<const N: usize>(read: &mut (impl Read + Seek), from: SeekFrom) -> Option<[u8; N]> {
    let mut bytes = [0; N];
    read.seek(from).and_then(|_| read.read_exact(&mut bytes)).ok().map(|()| bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}
