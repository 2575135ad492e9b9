//! Reads a cloud, as points or as a grid.

use std::fmt;
use std::io::{BufReader, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use crs::VerticalDatum;
use geodesy::MapPoint;
use las::{Header, PointDataBuilder, Reader};
use numeric::Failure;
use raster::{GeoTransform, Grid};

use super::crs::{Stated, stated};
use super::preflight;
use crate::format_error::FormatError;
use crate::raster::{Dem, Provenance};
use crate::regular;

/// Largest number of points in a batch.
const BATCH: u64 = 1 << 16;
/// Largest size of a batch, bytes. A point may take up to 64 KiB.
const BATCH_BYTES: u64 = 1 << 24;
/// Classes of points that do not belong to a surface: low noise, high noise.
const NOISE: [u8; 2] = [7, 18];
/// Largest number of cells of a grid.
const CELLS_MAX: u64 = 1 << 27;
/// Largest number of cells per point.
const CELLS_PER_POINT: u64 = 64;
/// Number of cells that is allowed for any number of points.
const CELLS_ALWAYS: u64 = 1 << 20;

/// Returns whether a file is LAS or LAZ, by its first four bytes.
pub fn is_point_cloud(path: impl AsRef<Path>) -> bool {
    use std::io::Read;
    let mut magic = [0u8; 4];
    regular::open(path.as_ref()).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == *b"LASF"
}

/// An open LAS or LAZ file.
pub struct PointCloud {
    path: PathBuf,
    reader: Reader,
    stated: Stated,
}

/// Point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Easting (or longitude), map units.
    pub x: f64,
    /// Northing (or latitude), map units.
    pub y: f64,
    /// Height above the file's datum, metres.
    pub height_m: f64,
    /// Class of the point in LAS.
    pub class: u8,
}

/// Cells of a grid, before its extent is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellLattice {
    /// Size of a cell along x, map units.
    pub cell_x: f64,
    /// Size of a cell along y, map units.
    pub cell_y: f64,
    /// A corner of a cell.
    pub anchor: MapPoint,
}

/// Numbers of points that were read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointCounts {
    /// Number of points read.
    pub read: u64,
    /// Number of those points that were left out: noise, withheld, or without a finite height.
    pub left_out: u64,
}

/// A grid made from a cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct GriddedPoints {
    /// Height of the highest point of every cell, metres.
    pub dem: Dem,
    /// Class of that point.
    pub classes: Grid<Option<i32>>,
    /// Number of points read.
    pub points: u64,
    /// Number of points left out: noise, withheld, or outside the extent in the header.
    pub left_out: u64,
}

impl PointCloud {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// [`FormatError`] when the system cannot read the file, the file is not LAS or LAZ, its header
    /// does not fit its length, or PROJ cannot read the reference system.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FormatError> {
        let path = path.as_ref().to_owned();
        let unreadable = |source: std::io::Error| {
            let what = format!("cannot read the file ({source}), check its name and permissions");
            FormatError::because(&path, what, source)
        };
        let file = regular::open(&path).map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        let mut file = BufReader::new(file);
        preflight::check(&mut file, length).map_err(|reason| damaged(&path, reason))?;
        let header = guarded(&path, || Header::new(&mut file))?;
        guarded(&path, || preflight::check_chunks(&mut file, &header, length))?;
        file.rewind().map_err(unreadable)?;
        let reader = guarded(&path, || Reader::new(file))?;
        let stated = stated(reader.header()).map_err(|source| {
            let (what, kind) = (format!("the coordinate reference system cannot be read ({source})"), source.kind());
            FormatError::because(&path, what, source).of_kind(kind)
        })?;
        Ok(Self { path, reader, stated })
    }

    /// Returns the definition of the reference system for PROJ, if the file names one.
    pub fn crs_definition(&self) -> Option<&str> {
        self.stated.definition.as_deref()
    }

    /// Returns the middle of the extent in the header.
    pub fn centre(&self) -> MapPoint {
        let bounds = self.reader.header().bounds();
        MapPoint { x: 0.5 * (bounds.min.x + bounds.max.x), y: 0.5 * (bounds.min.y + bounds.max.y) }
    }

    /// Returns the EPSG code of the horizontal reference system, if the file names it.
    pub fn horizontal_epsg(&self) -> Option<u32> {
        self.stated.horizontal_epsg
    }

    /// Returns the vertical datum of the heights, if the file names it.
    pub fn vertical(&self) -> Option<VerticalDatum> {
        self.stated.vertical
    }

    /// Reads all points except noise and withheld ones: x and y in map units, heights in metres.
    ///
    /// # Errors
    /// [`FormatError`] when the file announces more than `most` points, the points cannot be
    /// decoded, or no point is left.
    ///
    /// # Examples
    /// ```no_run
    /// use formats::points::PointCloud;
    ///
    /// let cloud = PointCloud::open("lidar.laz")?;
    /// println!("{:?}", cloud.horizontal_epsg());
    /// let points = cloud.positions(10_000_000)?;
    /// # Ok::<(), formats::FormatError>(())
    /// ```
    pub fn positions(mut self, most: u64) -> Result<Vec<[f64; 3]>, FormatError> {
        let announced = self.reader.header().number_of_points();
        if announced > most {
            let what = format!("the cloud has {announced} points, at most {most} are read, thin it or cut it");
            return Err(FormatError::new(&self.path, what));
        }
        let mut found = Vec::new();
        let PointCounts { read: points, .. } = self.each(|point| {
            if point.x.is_finite() && point.y.is_finite() {
                found.push([point.x, point.y, point.height_m]);
            }
        })?;
        if found.is_empty() { Err(no_points(&self.path, points)) } else { Ok(found) }
    }

    /// Makes a grid with the highest point of every cell of a lattice.
    ///
    /// # Errors
    /// [`FormatError`] when the extent is invalid or has too many cells for the number of points,
    /// the points cannot be decoded, or no point is left.
    pub fn highest(mut self, lattice: CellLattice) -> Result<GriddedPoints, FormatError> {
        let (geotransform, width, height) = self.grid(lattice)?;
        let mut heights = Grid::filled(width, height, f32::NAN);
        let mut classes = Grid::filled(width, height, None);
        let mut outside = 0u64;
        let PointCounts { read: points, left_out: unusable } = self.each(|point| {
            match place(&geotransform, point.x, point.y).filter(|&(c, r)| c < width && r < height) {
                Some(cell) => {
                    let z = point.height_m as f32;
                    if heights[cell].is_nan() || z > heights[cell] {
                        heights[cell] = z;
                        classes[cell] = Some(i32::from(point.class));
                    }
                }
                None => outside += 1,
            }
        })?;
        let left_out = unusable + outside;
        if points == left_out {
            return Err(no_points(&self.path, points));
        }
        let dem = Dem {
            path: self.path,
            heights,
            geotransform,
            crs_wkt: self.stated.definition,
            horizontal_epsg: self.stated.horizontal_epsg,
            vertical: self.stated.vertical,
            no_data: None,
            provenance: Provenance::default(),
        };
        Ok(GriddedPoints { dem, classes, points, left_out })
    }

    /// Returns the middle of the heights in the header, metres, or 0 when they are not finite.
    pub fn middle_height_m(&self) -> f64 {
        let bounds = self.reader.header().bounds();
        let middle = 0.5 * (bounds.min.z + bounds.max.z) * self.stated.height_unit_m;
        if middle.is_finite() { middle } else { 0.0 }
    }

    /// Passes each point of the surface to `take`, in the order of the file.
    ///
    /// # Errors
    /// [`FormatError`] when the points cannot be decoded.
    pub fn visit(mut self, take: impl FnMut(SurfacePoint)) -> Result<PointCounts, FormatError> {
        self.each(take)
    }

    fn each(&mut self, mut take: impl FnMut(SurfacePoint)) -> Result<PointCounts, FormatError> {
        let mut batch = PointDataBuilder::new().for_header(self.reader.header()).build();
        let at_once = (BATCH_BYTES / u64::from(self.reader.header().point_format().len().max(1))).min(BATCH);
        let mut counts = PointCounts { read: 0, left_out: 0 };
        loop {
            let read = guarded(&self.path, || self.reader.fill_points(at_once, &mut batch))?;
            if read == 0 {
                return Ok(counts);
            }
            for point in batch.points() {
                let point = point.map_err(|error| damaged(&self.path, error))?;
                counts.read += 1;
                let class = u8::from(point.classification);
                if point.is_withheld || NOISE.contains(&class) || !point.z.is_finite() {
                    counts.left_out += 1;
                    continue;
                }
                let height_m = point.z * self.stated.height_unit_m;
                take(SurfacePoint { x: point.x, y: point.y, height_m, class });
            }
        }
    }

    /// Returns the geotransform, the width and the height of the grid that covers the extent in the
    /// header.
    fn grid(&self, lattice: CellLattice) -> Result<(GeoTransform, usize, usize), FormatError> {
        let (bounds, points) = (self.reader.header().bounds(), self.reader.header().number_of_points());
        let extent = [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y];
        let ordered = bounds.min.x <= bounds.max.x && bounds.min.y <= bounds.max.y;
        if !(ordered && extent.iter().all(|v| v.is_finite() && v.abs() < 1e12)) {
            return Err(damaged(
                &self.path,
                format!("the extent in the header is {extent:?}, expected finite numbers in ascending order"),
            ));
        }
        let CellLattice { cell_x, cell_y, anchor } = lattice;
        let left = anchor.x + ((bounds.min.x - anchor.x) / cell_x).floor() * cell_x;
        let top = anchor.y + ((bounds.max.y - anchor.y) / cell_y).ceil() * cell_y;
        let columns = ((bounds.max.x - left) / cell_x).floor() + 1.0;
        let rows = ((top - bounds.min.y) / cell_y).floor() + 1.0;
        let (cells, most) = (columns * rows, points.saturating_mul(CELLS_PER_POINT).clamp(CELLS_ALWAYS, CELLS_MAX));
        if !(cells.is_finite() && cells > 0.0 && cells <= most as f64) {
            return Err(FormatError::new(
                &self.path,
                format_args!(
                    "the extent of the cloud has {cells:.0} cells of {cell_x} map units for {points} points, the limit \
                     is {most} cells, use larger cells"
                ),
            ));
        }
        Ok((GeoTransform([left, cell_x, 0.0, top, 0.0, -cell_y]), columns as usize, rows as usize))
    }
}

/// Returns the cell (column, row) that contains a place of the map.
fn place(geotransform: &GeoTransform, x: f64, y: f64) -> Option<(usize, usize)> {
    let (column, row) = geotransform.cell_from_map(x, y)?;
    let whole = |value: f64| {
        let value = (value + 0.5).floor();
        (0.0..9e15).contains(&value).then_some(value as usize)
    };
    Some((whole(column)?, whole(row)?))
}

/// The error of a file that is damaged, truncated, or of a kind that is not supported.
fn damaged(path: &Path, reason: impl fmt::Display) -> FormatError {
    FormatError::new(path, format_args!("the file is not a readable LAS or LAZ file ({reason})"))
}

/// The error of a cloud of which no point is left.
fn no_points(path: &Path, points: u64) -> FormatError {
    let what = format!("none of the {points} points can be used (noise and withheld points do not count)");
    FormatError::new(path, what)
}

/// Runs the decoder. It uses numbers of the file as indices without checks, so a panic means that
/// the file is damaged.
fn guarded<T, E: fmt::Display>(path: &Path, decode: impl FnOnce() -> Result<T, E>) -> Result<T, FormatError> {
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(damaged(path, error)),
        Err(_) => Err(damaged(path, "the points cannot be decoded")),
    }
}
