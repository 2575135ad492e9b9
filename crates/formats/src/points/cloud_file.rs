//! Writes the coloured cloud of a surface model as LAZ and as COPC.
//!
//! COPC 1.0 (<https://copc.io>) is LAZ with an octree: a node is one compressed chunk, and readers
//! fetch the nodes of the level of detail that they want. The cells of a surface lie on a lattice,
//! so the levels need no random choice: with D the deepest level, a node of level L holds the cells
//! whose column and row are multiples of 2^(D−L), and not of twice that. A node has at most
//! 256 × 256 cells of its own lattice; on a map in degrees it is a layer of the height, of any
//! size. Chunks are compressed in parallel and written in the order of their keys, so the bytes do
//! not depend on the threads.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Cursor, Seek, SeekFrom, Write};
use std::path::Path;

use laz::laszip::{ChunkTable, ChunkTableEntry, LazVlr, LazVlrBuilder};
use rayon::prelude::*;

use super::las_header::{Vlr, extended, extra_bytes, header};
use super::surface_cloud::{CloudExtent, Layout, RECORD, SurfaceCloud};
use crate::atomic::{SaveError, write_path};
use crate::raster::RasterError;

/// Points of a chunk of LAZ.
const CHUNK_POINTS: usize = 50_000;
/// Chunks that are compressed at a time.
const CHUNKS_AT_ONCE: usize = 32;
/// Columns and rows of the lattice of a node of COPC.
const NODE_CELLS: f64 = 256.0;
/// Deepest level of COPC. 2^24 cells along a side are more than a raster has.
const DEPTH_MAX: u32 = 24;
/// Length of the info record of COPC.
const INFO: usize = 160;
/// Length of the header of an extended record, behind which the hierarchy begins.
const EXTENDED_HEADER: u64 = 60;

/// Files that hold a cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudFormat {
    /// LAZ 1.4.
    Laz,
    /// LAZ 1.4 with the octree of COPC 1.0.
    Copc,
}

/// Writes a cloud, and returns the number and extent of its points.
///
/// # Errors
/// - [`RasterError::NotWritten`] when the file exists and `overwrite` is false, the system refuses
///   to write, the rasters differ in size, or no cell has a point.
/// - [`RasterError::Crs`] when the reference system has no WKT.
pub fn write_cloud(
    path: &Path,
    cloud: &SurfaceCloud<'_>,
    format: CloudFormat,
    overwrite: bool,
) -> Result<CloudExtent, RasterError> {
    let wkt = cloud.crs.wkt1().map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    let layout = Layout::new(cloud).map_err(|reason| RasterError::unwritable(path, reason))?;
    write_path(path, overwrite, |made| {
        let written = match format {
            CloudFormat::Laz => write_laz(made, &layout, &wkt),
            CloudFormat::Copc => write_copc(made, &layout, &wkt),
        };
        written.map_err(|error| SaveError::unwritable(path, error))
    })?;
    Ok(layout.extent)
}

fn write_laz(made: &Path, layout: &Layout<'_>, wkt: &str) -> std::io::Result<()> {
    let compression = compression(LazVlrBuilder::with_fixed_chunk_size, CHUNK_POINTS as u32)?;
    let records = [Vlr::wkt(wkt), Vlr::extra_bytes(), laszip(&compression)?];
    let head = header(layout, &records, None).map_err(std::io::Error::other)?;
    let mut file = ChunkedFile::begin(made, &head, &compression)?;
    let cells: Vec<u32> = layout.cells().map(|cell| cell as u32).collect();
    let chunks: Vec<&[u32]> = cells.chunks(CHUNK_POINTS).collect();
    file.put_all(layout, &chunks)?;
    file.finish()?.flush()
}

fn write_copc(made: &Path, layout: &Layout<'_>, wkt: &str) -> std::io::Result<()> {
    let octree = Octree::of(layout);
    let compression = compression(|builder, _| builder.with_variable_chunk_size(), 0)?;
    let records = |hierarchy: (u64, u64)| -> std::io::Result<[Vlr; 4]> {
        Ok([octree.info(hierarchy), laszip(&compression)?, Vlr::wkt(wkt), Vlr::extra_bytes()])
    };
    let head = |at: u64, hierarchy| header(layout, &records(hierarchy)?, Some(at)).map_err(std::io::Error::other);
    let mut file = ChunkedFile::begin(made, &head(0, (0, 0))?, &compression)?;
    let chunks: Vec<&[u32]> = octree.nodes.values().map(Vec::as_slice).filter(|cells| !cells.is_empty()).collect();
    let places = file.put_all(layout, &chunks)?;
    let mut out = file.finish()?;
    let extended_at = out.stream_position()?;
    let hierarchy = octree.hierarchy(&places);
    let place = (extended_at + EXTENDED_HEADER, hierarchy.len() as u64);
    let record = Vlr { user: "copc", id: 1000, description: "EPT hierarchy", content: hierarchy };
    out.write_all(&extended(&record))?;
    // Both places are known only now. The header has the same length as before.
    out.seek(SeekFrom::Start(0))?;
    out.write_all(&head(extended_at, place)?)?;
    out.flush()
}

/// Returns the description of the compression.
fn compression(sized: impl Fn(LazVlrBuilder, u32) -> LazVlrBuilder, points: u32) -> std::io::Result<LazVlr> {
    let builder = LazVlrBuilder::default().with_point_format(7, extra_bytes()).map_err(std::io::Error::other)?;
    Ok(sized(builder, points).build())
}

fn laszip(compression: &LazVlr) -> std::io::Result<Vlr> {
    let mut content = Vec::new();
    compression.write_to(&mut content).map_err(std::io::Error::other)?;
    Ok(Vlr { user: LazVlr::USER_ID, id: LazVlr::RECORD_ID, description: LazVlr::DESCRIPTION, content })
}

/// Place and size of a chunk.
#[derive(Debug, Clone, Copy)]
struct ChunkPlace {
    start: u64,
    bytes: u64,
    points: u64,
}

/// A file of compressed chunks behind a header.
struct ChunkedFile<'a> {
    out: BufWriter<File>,
    compression: &'a LazVlr,
    /// Place of the offset to the table of chunks.
    table_offset_at: u64,
    at: u64,
    table: ChunkTable,
}

impl<'a> ChunkedFile<'a> {
    fn begin(path: &Path, head: &[u8], compression: &'a LazVlr) -> std::io::Result<Self> {
        let mut out = BufWriter::new(File::create(path)?);
        out.write_all(head)?;
        out.write_all(&(-1i64).to_le_bytes())?;
        let table_offset_at = head.len() as u64;
        let at = table_offset_at + ChunkTable::OFFSET_SIZE as u64;
        Ok(Self { out, compression, table_offset_at, at, table: ChunkTable::default() })
    }

    /// Writes chunks of the points of cells.
    fn put_all(&mut self, layout: &Layout<'_>, chunks: &[&[u32]]) -> std::io::Result<Vec<ChunkPlace>> {
        let mut places = Vec::with_capacity(chunks.len());
        for group in chunks.chunks(CHUNKS_AT_ONCE) {
            let compression = self.compression;
            let made: Vec<std::io::Result<Vec<u8>>> =
                group.par_iter().map(|cells| compressed(layout, cells, compression)).collect();
            for (made, cells) in made.into_iter().zip(group) {
                let made = made?;
                let place = ChunkPlace { start: self.at, bytes: made.len() as u64, points: cells.len() as u64 };
                self.out.write_all(&made)?;
                self.at += place.bytes;
                self.table.push(ChunkTableEntry { point_count: place.points, byte_count: place.bytes });
                places.push(place);
            }
        }
        Ok(places)
    }

    /// Writes the table of the chunks, and returns the file at its end.
    fn finish(self) -> std::io::Result<BufWriter<File>> {
        let Self { mut out, compression, table_offset_at, at, table } = self;
        table.write_to(&mut out, compression)?;
        out.seek(SeekFrom::Start(table_offset_at))?;
        out.write_all(&at.to_le_bytes())?;
        out.seek(SeekFrom::End(0))?;
        Ok(out)
    }
}

/// Compresses the points of cells as one chunk.
fn compressed(layout: &Layout<'_>, cells: &[u32], compression: &LazVlr) -> std::io::Result<Vec<u8>> {
    let mut points = Vec::with_capacity(cells.len() * RECORD);
    cells.iter().for_each(|&cell| layout.put(cell as usize, &mut points));
    let mut stream = Vec::new();
    laz::laszip::compress_buffer(&mut Cursor::new(&mut stream), &points, compression.clone())
        .map_err(std::io::Error::other)?;
    // The stream is the offset of the table, the chunk, the table.
    let short = || std::io::Error::other("the compressor wrote no table of chunks");
    let table = stream.first_chunk().map(|bytes| u64::from_le_bytes(*bytes)).ok_or_else(short)?;
    let table = usize::try_from(table).map_err(std::io::Error::other)?;
    stream.get(ChunkTable::OFFSET_SIZE..table).map(<[u8]>::to_vec).ok_or_else(short)
}

/// Key of a node: level, and place in x, y and z.
type NodeKey = (u32, [u32; 3]);

/// The nodes of a cloud, with the cells of their points. Nodes above others exist, also without
/// points.
struct Octree {
    /// Least corner of the cube.
    low: [f64; 3],
    side: f64,
    /// Distance of neighbours in the root, map units.
    spacing: f64,
    nodes: BTreeMap<NodeKey, Vec<u32>>,
}

impl Octree {
    fn of(layout: &Layout<'_>) -> Self {
        let (width, low) = (layout.cloud.heights.width(), layout.extent.low);
        let (cell_x, cell_y) = layout.cloud.geotransform.cell_size();
        let cell = cell_x.min(cell_y);
        let extent = [0, 1, 2].map(|axis| layout.extent.high[axis] - low[axis]);
        // A little more than the extent, so that the last point lies inside.
        let reach =
            |axes: usize| extent[..axes].iter().copied().fold(cell, f64::max) * (1.0 + 1e-6) + layout.step[axes - 1];
        let side = reach(3);
        // Tens of metres of height beside a thousandth of a degree would make levels until each
        // point has a chunk of its own. There the places alone count, and nodes are layers of the
        // height.
        let widest = if layout.cloud.in_degrees { reach(2) } else { side };
        let depth = ((widest / (cell * NODE_CELLS)).log2().ceil().max(0.0) as u32).min(DEPTH_MAX);
        let mut nodes: BTreeMap<NodeKey, Vec<u32>> = BTreeMap::new();
        for index in layout.cells() {
            let halvings = ((index % width) | (index / width)).trailing_zeros().min(depth);
            let level = depth - halvings;
            let place = layout.coordinates(layout.cell_integers(index));
            let across = f64::from(1u32 << level);
            let key = [0, 1, 2].map(|axis| (((place[axis] - low[axis]) / side) * across) as u32);
            nodes.entry((level, key)).or_default().push(index as u32);
        }
        let made: Vec<NodeKey> = nodes.keys().copied().collect();
        for (level, key) in made {
            for up in 1..=level {
                nodes.entry((level - up, key.map(|k| k >> up))).or_default();
            }
        }
        Self { low, side, spacing: cell * f64::from(1u32 << depth), nodes }
    }

    /// Returns the info record; `hierarchy` is the place and the length of the hierarchy.
    fn info(&self, hierarchy: (u64, u64)) -> Vlr {
        let half = 0.5 * self.side;
        let mut content = Vec::with_capacity(INFO);
        for value in self.low.map(|low| low + half).into_iter().chain([half, self.spacing]) {
            content.extend(value.to_le_bytes());
        }
        content.extend(hierarchy.0.to_le_bytes());
        content.extend(hierarchy.1.to_le_bytes());
        // The points have no times.
        content.resize(INFO, 0);
        Vlr { user: "copc", id: 1, description: "COPC info", content }
    }

    /// Returns the entries of the nodes; `places` are those of the nodes with points.
    fn hierarchy(&self, places: &[ChunkPlace]) -> Vec<u8> {
        let mut places = places.iter();
        let mut out = Vec::with_capacity(32 * self.nodes.len());
        for ((level, key), cells) in &self.nodes {
            let place = if cells.is_empty() { None } else { places.next() };
            for number in [*level, key[0], key[1], key[2]] {
                out.extend(number.to_le_bytes());
            }
            out.extend(place.map_or(0, |place| place.start).to_le_bytes());
            out.extend(place.map_or(0, |place| place.bytes as u32).to_le_bytes());
            out.extend(place.map_or(0, |place| place.points as u32).to_le_bytes());
        }
        out
    }
}
