//! The coloured cloud of a surface model: one point for each cell with a height.
//!
//! A record is point format 7 of LAS 1.4 (36 bytes) with the extra bytes `sigma_m` (f32),
//! `confidence` (f32), `views` (u8) and `source` (u8). Coordinates are integers of a step: 1 mm in
//! maps of metres and feet and for heights, 1e-8 degrees in geographic maps; ten, a hundred, …
//! times that where the extent asks for it.

use std::time::SystemTime;

use chrono::{DateTime, Datelike};
use crs::Crs;
use raster::{GeoTransform, Grid};

/// Length of a record, bytes.
pub(super) const RECORD: usize = POINT + EXTRA;
/// Length of a record of point format 7.
const POINT: usize = 36;
/// Length of the extra bytes of a record.
pub(super) const EXTRA: usize = 10;
/// Dimensions in the extra bytes: name, type of LAS (1 = u8, 9 = f32), description.
pub(super) const DIMENSIONS: [(&str, u8, &str); 4] = [
    ("sigma_m", 9, "standard deviation, metres"),
    ("confidence", 9, "probability that it is right"),
    ("views", 1, "number of views"),
    ("source", 1, "code of where it comes from"),
];
/// Step of coordinates in metres or feet.
const STEP: f64 = 0.001;
/// Step of coordinates in degrees, about a millimetre.
const STEP_DEGREES: f64 = 1e-8;
/// Code of observed heights in the raster of sources.
const OBSERVED: u8 = 1;
/// Flag of a point that no measurement made, in the class flags of LAS.
const SYNTHETIC: u8 = 1;
/// One return of one.
const SINGLE_RETURN: u8 = 0x11;

/// The rasters of a surface model, all of one size, that become a cloud.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceCloud<'a> {
    /// Position of the grid.
    pub geotransform: GeoTransform,
    /// Reference system, with the datum of the heights.
    pub crs: Crs,
    /// Whether the map is in degrees.
    pub in_degrees: bool,
    /// Heights; NaN where there is no point.
    pub heights: &'a Grid<f32>,
    /// Standard deviations of the heights, metres.
    pub sigma_m: &'a Grid<f32>,
    /// Confidence, 0 to 1.
    pub confidence: &'a Grid<f32>,
    /// Numbers of views.
    pub views: &'a Grid<u8>,
    /// Codes of the sources of the heights. Points with another code than 1 (observed) have the
    /// flag of synthetic points.
    pub source: &'a Grid<u8>,
    /// Red, green and blue.
    pub colours: &'a Grid<[u16; 3]>,
    /// Classes of LAS.
    pub classes: &'a Grid<u8>,
    /// Whether points that were not observed are left out.
    pub observed_only: bool,
    /// Time whose day the file names as that of its creation.
    pub created: SystemTime,
}

/// Number and extent of the points of a cloud.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct CloudExtent {
    /// Points.
    pub points: u64,
    /// Points that were filled and not observed.
    pub synthetic: u64,
    /// Least x, y and z.
    pub low: [f64; 3],
    /// Greatest x, y and z.
    pub high: [f64; 3],
}

/// A cloud with the integers of its coordinates.
pub(super) struct Layout<'a> {
    pub(super) cloud: &'a SurfaceCloud<'a>,
    pub(super) step: [f64; 3],
    pub(super) offset: [f64; 3],
    pub(super) extent: CloudExtent,
}

impl<'a> Layout<'a> {
    /// Chooses step and offset of a cloud, or returns what is wrong with it.
    pub(super) fn new(cloud: &'a SurfaceCloud<'a>) -> Result<Self, String> {
        let size = (cloud.heights.width(), cloud.heights.height());
        let sizes = [
            (cloud.sigma_m.width(), cloud.sigma_m.height()),
            (cloud.confidence.width(), cloud.confidence.height()),
            (cloud.views.width(), cloud.views.height()),
            (cloud.source.width(), cloud.source.height()),
            (cloud.colours.width(), cloud.colours.height()),
            (cloud.classes.width(), cloud.classes.height()),
        ];
        if let Some(other) = sizes.iter().find(|other| **other != size) {
            return Err(format!("the rasters of the cloud have {size:?} and {other:?} cells, expected one size"));
        }
        if u32::try_from(size.0 * size.1).is_err() {
            return Err(format!("the rasters of the cloud have {size:?} cells, expected at most 2^32"));
        }
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (mut points, mut synthetic) = (0, 0);
        for cell in cells(cloud) {
            points += 1;
            synthetic += u64::from(cloud.source.data()[cell] != OBSERVED);
            let place = position(cloud, cell);
            for axis in 0..3 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        if points == 0 {
            return Err("no cell has a height that may become a point".to_owned());
        }
        let plain = if cloud.in_degrees { [STEP_DEGREES, STEP_DEGREES, STEP] } else { [STEP; 3] };
        let step = [0, 1, 2].map(|axis| fitting(plain[axis], high[axis] - low[axis]));
        let mut layout =
            Self { cloud, step, offset: low.map(f64::floor), extent: CloudExtent { points, synthetic, low, high } };
        // The header holds the extent of the coordinates as they are written.
        let written = |layout: &Self, place| layout.coordinates(layout.integers(place));
        (layout.extent.low, layout.extent.high) = (written(&layout, low), written(&layout, high));
        Ok(layout)
    }

    /// Returns the year and the day of the year, from 1, of the file's creation; zeros where they
    /// are unknown.
    pub(super) fn date(&self) -> (u16, u16) {
        let since = self.cloud.created.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let day = i64::try_from(since.as_secs()).ok().and_then(|seconds| DateTime::from_timestamp(seconds, 0));
        day.map_or((0, 0), |day| (day.year() as u16, day.ordinal() as u16))
    }

    /// Iterates over the cells with a point, in the order of the rows.
    pub(super) fn cells(&self) -> impl Iterator<Item = usize> {
        cells(self.cloud)
    }

    /// Returns the coordinates of a cell in steps from the offset.
    pub(super) fn cell_integers(&self, cell: usize) -> [i32; 3] {
        self.integers(position(self.cloud, cell))
    }

    fn integers(&self, place: [f64; 3]) -> [i32; 3] {
        [0, 1, 2].map(|axis| ((place[axis] - self.offset[axis]) / self.step[axis]).round() as i32)
    }

    /// Returns the coordinates of integers.
    pub(super) fn coordinates(&self, integers: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| f64::from(integers[axis]) * self.step[axis] + self.offset[axis])
    }

    /// Appends the record of a cell.
    pub(super) fn put(&self, cell: usize, out: &mut Vec<u8>) {
        let cloud = self.cloud;
        for integer in self.cell_integers(cell) {
            out.extend(integer.to_le_bytes());
        }
        let source = cloud.source.data()[cell];
        let flags = if source == OBSERVED { 0 } else { SYNTHETIC };
        // Intensity, returns, flags, class, user data, angle, number of the source, time.
        out.extend([0, 0, SINGLE_RETURN, flags, cloud.classes.data()[cell], 0]);
        out.extend([0; 12]);
        for colour in cloud.colours.data()[cell] {
            out.extend(colour.to_le_bytes());
        }
        for value in [cloud.sigma_m.data()[cell], cloud.confidence.data()[cell]] {
            out.extend(value.to_le_bytes());
        }
        out.extend([cloud.views.data()[cell], source]);
    }
}

fn cells<'a>(cloud: &'a SurfaceCloud<'a>) -> impl Iterator<Item = usize> + 'a {
    let is_wanted = |cell: &usize| !cloud.observed_only || cloud.source.data()[*cell] == OBSERVED;
    (0..cloud.heights.data().len()).filter(|&cell| cloud.heights.data()[cell].is_finite()).filter(is_wanted)
}

/// Returns x, y and z of a cell.
fn position(cloud: &SurfaceCloud<'_>, cell: usize) -> [f64; 3] {
    let width = cloud.heights.width();
    let (x, y) = cloud.geotransform.map_from_cell((cell % width) as f64, (cell / width) as f64);
    [x, y, f64::from(cloud.heights.data()[cell])]
}

/// Returns the smallest power of ten times `step` whose integers hold an extent.
fn fitting(mut step: f64, extent: f64) -> f64 {
    while extent / step > f64::from(i32::MAX / 2) {
        step *= 10.0;
    }
    step
}
