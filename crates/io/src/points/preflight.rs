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
/// points begin. What the decoder does with damaged numbers on the way may panic.
pub(super) fn check_chunks(read: &mut (impl Read + Seek), header: &Header, length: u64) -> Result<(), String> {
    let record = header.vlrs().iter().find(|record| is_laszip_vlr(record));
    let Some(record) = record.filter(|_| header.point_format().is_compressed) else { return Ok(()) };
    let form = LazVlr::from_buffer(&record.data).map_err(|error| error.to_string())?;
    let layout = Layout::of(&form)?;
    let stated = u64::from(header.point_format().len());
    if layout.point_bytes != stated {
        return Err(format!("compressed points of {} bytes, the header says {stated}", layout.point_bytes));
    }
    if record.data.starts_with(&POINT_WISE) {
        return layout.check_layers(read, |_| u64::MAX, header.number_of_points(), length);
    }
    let failed = |error: std::io::Error| error.to_string();
    let data = read.stream_position().map_err(failed)?;
    check_chunk_count(read, data, stated, length)?;
    read.seek(SeekFrom::Start(data)).map_err(failed)?;
    let table = ChunkTable::read_from(&mut *read, &form);
    let table = table.map_err(|error| format!("the table of the points' chunks: {error}"))?;
    let points_of = |chunk: usize| {
        let of_variable = || table.as_ref().get(chunk).map_or(0, |entry| entry.point_count);
        if form.uses_variable_size_chunks() { of_variable() } else { u64::from(form.chunk_size()) }
    };
    layout.check_layers(read, points_of, header.number_of_points(), length)
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

/// Bytes of a point, and of how many layers a chunk is: none where its points follow one another.
struct Layout {
    point_bytes: u64,
    layers: usize,
}

impl Layout {
    fn of(form: &LazVlr) -> Result<Self, String> {
        let mut out = Self { point_bytes: 0, layers: 0 };
        for item in form.items() {
            let (bytes, layers) = match item.item_type() {
                LazItemType::Byte(count) => (count, 0),
                LazItemType::Point10 => (20, 0),
                LazItemType::GpsTime => (8, 0),
                LazItemType::RGB12 => (6, 0),
                LazItemType::WavePacket13 => (29, 0),
                LazItemType::Point14 => (30, 9),
                LazItemType::RGB14 => (6, 1),
                LazItemType::RGBNIR14 => (8, 2),
                LazItemType::WavePacket14 => (29, 1),
                LazItemType::Byte14(count) => (count, usize::from(count)),
            };
            if item.size() != bytes {
                return Err(format!("compressed points with {} bytes of {:?}", item.size(), item.item_type()));
            }
            out.point_bytes += u64::from(bytes);
            out.layers += layers;
        }
        Ok(out)
    }

    /// Says where a chunk's layers do not fit; `read` stands at the first chunk. Chunks in layers (point formats 6 to 10) begin with a
    /// point, how many they hold, and how many bytes each layer has; the next chunk follows the last layer. The decoder takes
    /// `points_of` each from a chunk, whatever that says.
    fn check_layers(
        &self,
        read: &mut (impl Read + Seek),
        points_of: impl Fn(usize) -> u64,
        points: u64,
        length: u64,
    ) -> Result<(), String> {
        if self.layers == 0 {
            return Ok(());
        }
        let mut at = read.stream_position().map_err(|error| error.to_string())?;
        let (mut left, mut chunk, mut sizes) = (points, 0, vec![0u8; 4 * self.layers]);
        while left > 0 {
            let place = SeekFrom::Start(at + self.point_bytes + 4);
            if read.seek(place).and_then(|_| read.read_exact(&mut sizes)).is_err() {
                return Err(format!("it ends at byte {length}, {left} points before the last"));
            }
            let held: u64 = sizes.chunks_exact(4).filter_map(|size| u32_at(size, 0)).map(u64::from).sum();
            at += self.point_bytes + 4 + sizes.len() as u64;
            if held > length.saturating_sub(at) {
                return Err(format!("{held} bytes of points from byte {at} on, the file has {length}"));
            }
            at += held;
            left = left.saturating_sub(points_of(chunk).max(1));
            chunk += 1;
        }
        Ok(())
    }
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
