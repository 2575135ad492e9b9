//! Least-squares matching of a chip (Gruen 1985).
//!
//! With chip values `g(i, j)` around its point and image values `f`, the place `t`, the affine map
//! `A` and the grey values' gain and offset minimise Σ (gain · g(i, j) + offset − f(t + J A (i,
//! j)))², where `J` is the map from the chip to the image that is known beforehand.

use nalgebra::{SMatrix, SVector};
use raster::{Grid, bicubic, bicubic_along};

use super::masked_patch::needed;

/// Most steps. Matches that are right settle in a few.
const STEPS_MAX: usize = 20;
/// A step shorter than this, pixels of the chip, ends the adjustment.
const SETTLED_PX: f64 = 0.005;
/// Greatest distance from the start, pixels of the chip.
const AWAY_PX: f64 = 2.0;
/// Greatest entry of the affine map beyond identity. Steep ground in a wide pair stays below it.
const STRETCH_MAX: f64 = 0.4;

/// An image of the surroundings of a ground point.
#[derive(Debug, Clone, Copy)]
pub struct Chip<'a> {
    /// Grey values; NaN where invalid.
    pub image: &'a Grid<f32>,
    /// Column and row of the point.
    pub point: [f64; 2],
}

/// The part of an image in which a chip is searched for.
#[derive(Debug, Clone, Copy)]
pub struct ChipSearch<'a> {
    /// Grey values; NaN where invalid.
    pub image: &'a Grid<f32>,
    /// Column and row at which the point is expected.
    pub expected: [f64; 2],
    /// Largest distance from there, pixels of the image.
    pub reach_px: f64,
    /// Columns and rows of the image per column and row of the chip: `[[x/x, x/y], [y/x, y/y]]`.
    pub image_from_chip: [[f64; 2]; 2],
}

impl ChipSearch<'_> {
    /// Returns a place in the image moved by columns and rows of the chip.
    pub(super) fn moved(&self, [x, y]: [f64; 2], [i, j]: [f64; 2]) -> [f64; 2] {
        let [[a, b], [c, d]] = self.image_from_chip;
        [x + a * i + b * j, y + c * i + d * j]
    }
}

/// A shift and an affine map in the frame of the chip.
#[derive(Debug, Clone, Copy, Default)]
struct Warp {
    shift: [f64; 2],
    /// Derivatives beyond identity: `[[x by i, x by j], [y by i, y by j]]`.
    stretch: [[f64; 2]; 2],
}

impl Warp {
    /// Returns where a place of the chip, from its point, comes to lie.
    fn at(&self, [i, j]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis: usize| {
            let [by_i, by_j] = self.stretch[axis];
            [i, j][axis] + self.shift[axis] + by_i * i + by_j * j
        })
    }

    fn is_near(&self) -> bool {
        self.shift[0].hypot(self.shift[1]) < AWAY_PX && self.stretch.iter().flatten().all(|v| v.abs() < STRETCH_MAX)
    }
}

/// Returns the place of the chip's point in the image; `None` where the adjustment leaves the start
/// or does not settle. Pixels up to `radius` from the point are compared.
pub(super) fn fit(chip: Chip<'_>, search: &ChipSearch<'_>, start: [f64; 2], radius: i32) -> Option<[f64; 2]> {
    let mut warp = Warp::default();
    for _ in 0..STEPS_MAX {
        let step = step(chip, search, start, radius, &warp)?;
        for axis in 0..2 {
            warp.shift[axis] += step[3 * axis];
            warp.stretch[axis][0] += step[3 * axis + 1];
            warp.stretch[axis][1] += step[3 * axis + 2];
        }
        if !warp.is_near() {
            return None;
        }
        if step[0].hypot(step[3]) < SETTLED_PX {
            return Some(search.moved(start, warp.shift));
        }
    }
    None
}

/// Returns what must be added to a warp: shift, then derivatives by column and row, for x and y.
fn step(chip: Chip<'_>, search: &ChipSearch<'_>, start: [f64; 2], radius: i32, warp: &Warp) -> Option<[f64; 6]> {
    let seen = resampled(search, start, radius + 1, warp);
    let (mut normal, mut right) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
    let (mut clear, mut compared) = (0, 0);
    for j in -radius..=radius {
        for i in -radius..=radius {
            let at =
                |di: i32, dj: i32| f64::from(seen[((i + di + radius + 1) as usize, (j + dj + radius + 1) as usize)]);
            let own = f64::from(bicubic(chip.image, chip.point[0] + f64::from(i), chip.point[1] + f64::from(j)));
            let (value, dx, dy) = (at(0, 0), 0.5 * (at(1, 0) - at(-1, 0)), 0.5 * (at(0, 1) - at(0, -1)));
            clear += usize::from(own.is_finite());
            if !(value + own + dx + dy).is_finite() {
                continue;
            }
            compared += 1;
            let (x, y) = (f64::from(i), f64::from(j));
            let row = SVector::<f64, 8>::from([-dx, -dx * x, -dx * y, -dy, -dy * x, -dy * y, own, 1.0]);
            normal += row * row.transpose();
            right += row * value;
        }
    }
    if compared < needed(clear) {
        return None;
    }
    let found = normal.cholesky()?.solve(&right);
    // A negative image is another one.
    (found[6] > 0.0).then(|| std::array::from_fn(|k| found[k]))
}

/// Returns the image in the frame of the chip, up to `reach` around its point.
fn resampled(search: &ChipSearch<'_>, start: [f64; 2], reach: i32, warp: &Warp) -> Grid<f32> {
    let side = 2 * reach as usize + 1;
    let mut out = Grid::filled(side, side, f32::NAN);
    for (row, j) in (-reach..=reach).enumerate() {
        let at = |i: i32| search.moved(start, warp.at([f64::from(i), f64::from(j)]));
        let (first, second) = (at(-reach), at(1 - reach));
        bicubic_along(search.image, first, [second[0] - first[0], second[1] - first[1]], out.row_mut(row));
    }
    out
}
