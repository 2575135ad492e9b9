//! A town that repeats itself every kilometre, in x and in y, and cameras that see it repeat in
//! whole pixels.
//!
//! Frame: x east, y north in metres, each proportional to longitude and latitude; z metres above
//! the scene's ground height. The cameras are affine, `sample = (x + a z) / g`, `line = (b z − y) /
//! g`, which an RPC holds exactly: a step of [`PERIOD_M`] on the ground is a step of whole pixels
//! in all images, so one rendered tile per view makes images of any size.

use std::sync::LazyLock;

use camera::{ImagePoint, Rpc};
use numeric::random::{hash64, unit_interval};
use raster::Grid;
use rayon::prelude::*;

/// Side of the town that repeats, metres.
pub(crate) const PERIOD_M: f64 = 1024.0;
/// Height of z = 0 above the ellipsoid, metres.
pub(crate) const GROUND_M: f64 = 180.0;
/// Least and greatest z of the surface, metres.
const SPAN_M: (f64, f64) = (-6.0, 62.0);
/// Longitude and latitude of x = y = 0, the upper left of the images, degrees.
pub(crate) const ORIGIN: (f64, f64) = (5.4, 43.55);
/// Metres per degree of longitude and latitude, rounded. They define the frame.
pub(crate) const METRES_PER_DEGREE: [f64; 2] = [80_800.0, 111_110.0];
/// Buildings stand on a lattice of this spacing, metres.
const BLOCK_M: f64 = 64.0;
/// Blocks along a side of the town that repeats.
const BLOCKS_ACROSS: usize = (PERIOD_M / BLOCK_M) as usize;

/// What a view sees, and how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    /// `a` and `b` of the camera.
    pub(crate) slant: [f64; 2],
    /// Side of a pixel, metres; a whole number of pixels makes a period.
    pub(crate) gsd_m: f64,
    /// Fine texture that other dates do not show, as a share of the whole contrast, and its seed.
    pub(crate) passing: (f64, u64),
    /// Seed of the noise of the sensor.
    pub(crate) noise: u64,
}

impl Look {
    /// Returns the side of the tile that repeats, pixels.
    pub(crate) fn period(&self) -> usize {
        (PERIOD_M / self.gsd_m) as usize
    }
}

/// A building in the middle of its block, metres.
#[derive(Debug, Clone, Copy)]
struct Building {
    half: [f64; 2],
    eaves: f64,
    /// Height of the ridge above the eaves; zero for a flat roof.
    ridge: f64,
}

/// The blocks of a period, row by row; `None` for a block without a building.
static BLOCKS: LazyLock<Vec<Option<Building>>> = LazyLock::new(|| {
    let building = |at: usize| {
        let key = |k: u64| uniform([k, (at % BLOCKS_ACROSS) as u64, (at / BLOCKS_ACROSS) as u64, 0]);
        (key(0) >= 0.15).then(|| Building {
            half: [8.0 + 14.0 * key(1), 7.0 + 12.0 * key(2)],
            eaves: if key(3) > 0.96 { 52.0 } else { 5.0 + 17.0 * key(3) },
            ridge: if key(4) > 0.5 { 4.0 } else { 0.0 },
        })
    };
    (0..BLOCKS_ACROSS * BLOCKS_ACROSS).map(building).collect()
});

/// Returns the height of the surface above the ground height, metres.
pub(crate) fn height(x: f64, y: f64) -> f64 {
    roof(x, y).unwrap_or_else(|| rolling(x, y))
}

/// Returns whether a point lies above the surface. The ground is computed only where it decides.
fn is_above([x, y, z]: [f64; 3]) -> bool {
    match roof(x, y) {
        Some(roof) => z > roof,
        None => z > MOST_GROUND_M || z > rolling(x, y),
    }
}

fn roof(x: f64, y: f64) -> Option<f64> {
    let (i, j) = ((x / BLOCK_M).floor(), (y / BLOCK_M).floor());
    let [column, row] = [i, j].map(|at| (at as i64).rem_euclid(BLOCKS_ACROSS as i64) as usize);
    let building = BLOCKS[row * BLOCKS_ACROSS + column]?;
    let (u, v) = (x - (i + 0.5) * BLOCK_M, y - (j + 0.5) * BLOCK_M);
    let is_inside = u.abs() <= building.half[0] && v.abs() <= building.half[1];
    is_inside.then(|| building.eaves + building.ridge * (1.0 - v.abs() / building.half[1]))
}

/// Greatest height of the ground, metres: the sum of the waves' amplitudes.
const MOST_GROUND_M: f64 = 5.5;

fn rolling(x: f64, y: f64) -> f64 {
    let wave = |n: f64, v: f64| (std::f64::consts::TAU * n * v / PERIOD_M).sin();
    2.5 * wave(2.0, x) + 2.0 * wave(3.0, y) + wave(5.0, x + y)
}

/// Returns the reflectance, 0 to 1, with detail from two pixels to a block on every surface and
/// wall.
fn paint([x, y, z]: [f64; 3], gsd_m: f64) -> f64 {
    const OCTAVES: [(f64, f64); 4] = [(2.0, 0.34), (8.0, 0.28), (16.0, 0.22), (64.0, 0.16)];
    let sum: f64 = (0..)
        .zip(OCTAVES.map(|(px, share)| (px * gsd_m, share)))
        .map(|(k, (cell, share))| share * noise(k, [x, y, z].map(|v| v / cell), cell))
        .sum();
    (0.45 + 0.75 * sum).clamp(0.0, 1.0)
}

/// Returns smooth noise in [−1, 1] whose lattice repeats with the town.
fn noise(seed: u64, p: [f64; 3], cell: f64) -> f64 {
    let period = (PERIOD_M / cell) as i64;
    testing::lattice_noise(p, |[x, y, z]| {
        let key = [seed, x.rem_euclid(period) as u64, y.rem_euclid(period) as u64, z as u64];
        2.0 * uniform(key) - 1.0
    })
}

/// Returns a number in [0, 1) that depends on the key alone.
fn uniform(key: [u64; 4]) -> f64 {
    unit_interval(key.into_iter().fold(0, |state, part| hash64(state ^ part)))
}

/// Renders the first columns and lines of a view, with noise of four digital numbers. A tile of a
/// whole period can be laid beside itself without a seam.
pub(crate) fn tile(look: &Look, [columns, lines]: [usize; 2]) -> Grid<u16> {
    let ([a, b], gsd_m, (share, seed)) = (look.slant, look.gsd_m, look.passing);
    let mut tile = Grid::filled(columns, lines, 0);
    tile.data_mut().par_chunks_mut(columns).enumerate().for_each(|(line, row)| {
        for (sample, pixel) in row.iter_mut().enumerate() {
            let at = |z: f64| [gsd_m * sample as f64 - a * z, b * z - gsd_m * line as f64, z];
            let place = at(hit(at));
            let passing =
                if share > 0.0 { share * noise(seed, place.map(|v| v / (4.0 * gsd_m)), 4.0 * gsd_m) } else { 0.0 };
            let random: f64 = (0..4).map(|k| uniform([look.noise, sample as u64, line as u64, k]) - 0.5).sum();
            let value = 100.0 + 1000.0 * (paint(place, gsd_m) + passing) + 4.0 * 3f64.sqrt() * random;
            *pixel = value.round().clamp(1.0, 2047.0) as u16;
        }
    });
    tile
}

/// Returns the z at which a ray from above first meets the surface, by marching and bisection.
fn hit(at: impl Fn(f64) -> [f64; 3]) -> f64 {
    const STEP_M: f64 = 0.5;
    let is_above = |z: f64| is_above(at(z));
    let mut above = SPAN_M.1;
    while above > SPAN_M.0 && is_above(above - STEP_M) {
        above -= STEP_M;
    }
    let mut below = above - STEP_M;
    for _ in 0..10 {
        let middle = 0.5 * (above + below);
        if is_above(middle) { above = middle } else { below = middle }
    }
    above
}

/// Part of the plane of a view that an image shows, pixels, and the error of its pointing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    /// First column and row.
    pub(crate) first: [usize; 2],
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    /// Shift of the sample and the line that the RPC gives, pixels.
    pub(crate) shift_px: [f64; 2],
    /// Growth of that shift from the middle of the image to its last line, pixels.
    pub(crate) drift_px: [f64; 2],
}

impl Frame {
    /// Returns a square image from the origin with an exact RPC.
    pub(crate) const fn square(side: usize) -> Self {
        Self { first: [0; 2], size: [side; 2], shift_px: [0.0; 2], drift_px: [0.0; 2] }
    }
}

/// Returns the RPC of an image.
pub(crate) fn rpc(look: &Look, frame: &Frame) -> Rpc {
    const HEIGHT_SCALE_M: f64 = 200.0;
    let [a, b] = look.slant;
    let half_px = frame.size.map(|side| side as f64 / 2.0);
    let half_m = half_px.map(|half| half * look.gsd_m);
    let middle_m: [f64; 2] = std::array::from_fn(|k| frame.first[k] as f64 * look.gsd_m + half_m[k]);
    // Terms 1, L, P, H; x = middle + half L, y = half P − middle.
    let linear = |c: [f64; 4]| std::array::from_fn(|i| c.get(i).copied().unwrap_or(0.0));
    let one = linear([1.0, 0.0, 0.0, 0.0]);
    let line = [0.0, 0.0, -1.0, b * HEIGHT_SCALE_M / half_m[1]];
    // The drift follows the line, which is the other image coordinate from −1 to 1.
    let drifting = |own: [f64; 4], k: usize| {
        let term = |i: usize| own[i] + frame.drift_px[k] / half_px[k] * line[i];
        linear(std::array::from_fn(term))
    };
    Rpc {
        line_off: half_px[1] + frame.shift_px[1],
        samp_off: half_px[0] + frame.shift_px[0],
        lat_off: ORIGIN.1 - middle_m[1] / METRES_PER_DEGREE[1],
        long_off: ORIGIN.0 + middle_m[0] / METRES_PER_DEGREE[0],
        height_off: GROUND_M,
        line_scale: half_px[1],
        samp_scale: half_px[0],
        lat_scale: half_m[1] / METRES_PER_DEGREE[1],
        long_scale: half_m[0] / METRES_PER_DEGREE[0],
        height_scale: HEIGHT_SCALE_M,
        line_num: drifting(line, 1),
        line_den: one,
        samp_num: drifting([0.0, 1.0, 0.0, a * HEIGHT_SCALE_M / half_m[0]], 0),
        samp_den: one,
        err_bias_m: None,
        err_rand_m: None,
    }
}

/// Returns the height of a place above the ellipsoid, or `None` less than 40 m from the border of
/// an area of `area_m` metres, to the east and to the south, from the origin.
pub(crate) fn truth(lon_deg: f64, lat_deg: f64, area_m: [f64; 2]) -> Option<f64> {
    let x = (lon_deg - ORIGIN.0) * METRES_PER_DEGREE[0];
    let y = (lat_deg - ORIGIN.1) * METRES_PER_DEGREE[1];
    let inside = |v: f64, length: f64| (40.0..length - 40.0).contains(&v);
    (inside(x, area_m[0]) && inside(-y, area_m[1])).then(|| GROUND_M + height(x, y))
}

/// Returns the image position of a ground point by the RPC, to check the tile.
pub(crate) fn project(rpc: &Rpc, [x, y, z]: [f64; 3]) -> anyhow::Result<ImagePoint> {
    let (lon, lat) = (ORIGIN.0 + x / METRES_PER_DEGREE[0], ORIGIN.1 + y / METRES_PER_DEGREE[1]);
    Ok(camera::RpcCamera::new(rpc.clone()).project(geodesy::LonLatHeight::new(lon, lat, GROUND_M + z))?)
}
