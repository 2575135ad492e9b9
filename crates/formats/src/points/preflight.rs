//! Checks the numbers of a LAS or LAZ file that decide how much memory the decoder allocates.
//!
//! They are compared with the length of the file before the decoder uses them, because an
//! allocation that fails ends the process without an error.
//!
//! The offsets are from the LAS 1.4 R15 specification: table 3 (public header block) and section
//! 2.7 (extended records). Compressed points are in LASzip's layout: the offset of the chunk table,
//! the chunks, the chunk table.

use std::io::{Read, Seek, SeekFrom};

use las::Header;
use las::laz::is_laszip_vlr;
use laz::LazVlr;
use laz::laszip::{ChunkTable, LazItemType};

/// Size of the largest header, bytes.
const HEADER: usize = 375;
/// Size of an extended record before its data, bytes.
const EXTENDED_RECORD: u64 = 60;
/// Largest number of points. More do not fit into a file shorter than 2⁶³ bytes.
const POINTS_MAX: u64 = 1 << 40;
/// LASzip's oldest compressor, point-wise: it has neither chunks nor a chunk table.
const POINT_WISE: [u8; 2] = 1u16.to_le_bytes();

/// Checks the header of a file of `length` bytes, and returns what is wrong with it. Leaves the
/// reader at the start.
pub(super) fn check(read: &mut (impl Read + Seek), length: u64) -> Result<(), String> {
    let mut header = Vec::with_capacity(HEADER);
    let failed = |error: std::io::Error| error.to_string();
    read.by_ref().take(HEADER as u64).read_to_end(&mut header).map_err(failed)?;
    if header.get(..4) != Some(b"LASF") {
        return Err("the file does not begin with LASF".to_owned());
    }
    let minor = header.get(25).copied().unwrap_or(0);
    let data = u64::from(u32_at(&header, 96).ok_or("the header is cut off")?);
    if data > length {
        return Err(format!("the header puts the first point at byte {data}, the file has {length} bytes"));
    }
    let records = u64::from(u32_at(&header, 100).unwrap_or(0));
    if records.saturating_mul(54) > data {
        return Err(format!(
            "the header announces {records} variable length records, they do not fit before byte {data}"
        ));
    }
    if minor >= 4 {
        check_extended(read, &header, length)?;
    }
    read.seek(SeekFrom::Start(0)).map(|_| ()).map_err(failed)
}

fn check_extended(read: &mut (impl Read + Seek), header: &[u8], length: u64) -> Result<(), String> {
    let points = u64_at(header, 247).unwrap_or(0);
    if points > POINTS_MAX {
        return Err(format!("the header announces {points} points in a file of {length} bytes"));
    }
    let (start, count) = (u64_at(header, 235).unwrap_or(0), u32_at(header, 243).unwrap_or(0));
    if count == 0 {
        return Ok(());
    }
    let past_end = || format!("an extended record at byte {start} ends after byte {length}, the end of the file");
    if start.saturating_add(EXTENDED_RECORD) > length {
        return Err(past_end());
    }
    let data = bytes_at(read, SeekFrom::Start(start + 20)).map_or(u64::MAX, u64::from_le_bytes);
    if data > length - start - EXTENDED_RECORD { Err(past_end()) } else { Ok(()) }
}

/// Checks the chunk table and the chunks of compressed points of a file of `length` bytes, and
/// returns what is wrong.
///
/// The reader must be at the first byte of the points. The decoder reads the chunk table here, and
/// may panic on damaged numbers.
pub(super) fn check_chunks(read: &mut (impl Read + Seek), header: &Header, length: u64) -> Result<(), String> {
    let record = header.vlrs().iter().find(|record| is_laszip_vlr(record));
    let Some(record) = record.filter(|_| header.point_format().is_compressed) else { return Ok(()) };
    let form = LazVlr::from_buffer(&record.data).map_err(|error| error.to_string())?;
    let layout = Layout::of(&form)?;
    let stated = u64::from(header.point_format().len());
    if layout.point_bytes != stated {
        return Err(format!("compressed points have {} bytes, the header announces {stated}", layout.point_bytes));
    }
    if record.data.starts_with(&POINT_WISE) {
        return layout.check_layers(read, |_| u64::MAX, header.number_of_points(), length);
    }
    let failed = |error: std::io::Error| error.to_string();
    let data = read.stream_position().map_err(failed)?;
    check_chunk_count(read, data, stated, length)?;
    read.seek(SeekFrom::Start(data)).map_err(failed)?;
    let table = ChunkTable::read_from(&mut *read, &form);
    let table = table.map_err(|error| format!("the chunk table cannot be read: {error}"))?;
    let points_of = |chunk: usize| {
        let of_variable = || table.as_ref().get(chunk).map_or(0, |entry| entry.point_count);
        if form.uses_variable_size_chunks() { of_variable() } else { u64::from(form.chunk_size()) }
    };
    layout.check_layers(read, points_of, header.number_of_points(), length)
}

/// Checks the number of chunks. Each chunk begins with an uncompressed point, which limits their
/// number.
fn check_chunk_count(read: &mut (impl Read + Seek), data: u64, point_bytes: u64, length: u64) -> Result<(), String> {
    let mut place = |from| Some(i64::from_le_bytes(bytes_at(read, from)?)).filter(|&at| at > data as i64);
    // A writer that cannot seek puts the offset of the table at the end of the file.
    let table = place(SeekFrom::Start(data)).or_else(|| place(SeekFrom::End(-8)));
    let chunks =
        table.and_then(|table| bytes_at(read, SeekFrom::Start(table as u64 + 4))).map_or(0, u32::from_le_bytes);
    if u64::from(chunks).saturating_mul(point_bytes) > length {
        return Err(format!("the chunk table announces {chunks} chunks in a file of {length} bytes"));
    }
    Ok(())
}

/// Layout of compressed points.
struct Layout {
    /// Size of an uncompressed point, bytes.
    point_bytes: u64,
    /// Number of layers of a chunk; 0 when the points of a chunk follow one another.
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
                return Err(format!(
                    "compressed points have an item {1:?} of {0} bytes, which is not its size",
                    item.size(),
                    item.item_type()
                ));
            }
            out.point_bytes += u64::from(bytes);
            out.layers += layers;
        }
        Ok(out)
    }

    /// Checks that the layers of each chunk fit into the file, and returns what is wrong. `read` is
    /// at the first chunk.
    ///
    /// A chunk in layers (point formats 6 to 10) begins with a point, the number of its points, and
    /// the size of each layer in bytes. The next chunk follows its last layer. The decoder reads
    /// `points_of(chunk)` points from a chunk, whatever number the chunk itself holds.
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
                return Err(format!("the file ends at byte {length}, {left} points are missing"));
            }
            let held: u64 = sizes.chunks_exact(4).filter_map(|size| u32_at(size, 0)).map(u64::from).sum();
            at += self.point_bytes + 4 + sizes.len() as u64;
            if held > length.saturating_sub(at) {
                return Err(format!(
                    "a chunk has {held} bytes of points from byte {at} on, the file has {length} bytes"
                ));
            }
            at += held;
            left = left.saturating_sub(points_of(chunk).max(1));
            chunk += 1;
        }
        Ok(())
    }
}

/// Reads the bytes at an offset, if the file holds them.
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
