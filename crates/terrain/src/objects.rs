//! Finds the objects of a surface by openings with growing windows: narrow ones as they vanish, and
//! of the wider candidates those that the surface drops away from on most of their border.

use numeric::{Cancelled, Progress};
use raster::{Grid, opened};

use crate::coarse::difference;
use crate::config::GroundConfig;
use crate::heights::Heights;
use crate::membrane::filled;
use crate::narrow::{NARROW_M, Vanishing};
use crate::regions::{Regions, quantile};

/// Growth of the half-width from one window to the next.
const GROWTH: f64 = 1.33;
/// Share of the height of a candidate that the surface must drop along its border.
pub(crate) const DROP_SHARE: f32 = 0.45;
/// Share of the border of an object along which the surface need not drop: slopes, and houses and
/// trees that adjoin.
pub(crate) const FREE_SHARE: f64 = 0.35;
/// The same for a smooth part of an object: the other parts around it may all be higher.
const FREE_SHARE_OF_PARTS: f64 = 0.8;
/// Largest height from one cell to the next within a smooth part, metres: a slope of 45° and noise.
pub(crate) const STEP_M: f32 = 1.5;
/// Smallest clearing, square metres. Smaller parts of an object are steps of roofs and gaps between
/// crowns that do not reach down to the ground.
pub(crate) const CLEARING_MIN_M2: f64 = 25.0;
/// Height from which what has only voids beside it stands on the ground, metres: a storey.
pub(crate) const STOREY_M: f32 = 3.0;

/// Returns the cells of objects: narrow ones by how fast they vanish, wider ones by their borders,
/// on the surface relative to `trend`. `slope` is that of the ground as far as it is known.
///
/// # Errors
/// [`Cancelled`].
pub(crate) fn objects(
    heights: &Heights<'_>,
    vanishing: &Vanishing,
    (trend, slope): (&Grid<f32>, &Grid<f32>),
    config: &GroundConfig,
    progress: &dyn Progress,
) -> Result<Grid<bool>, Cancelled> {
    let cell_m = heights.cell_m;
    let (surface, whole) = (&difference(heights.clear, trend), &difference(heights.whole, trend));
    let mut found = vanishing.objects(slope, config);
    let mut doubtful = found.map(|_| false);
    for radius in radii(config.widest_object_m / cell_m) {
        progress.check_cancelled()?;
        progress.step();
        if radius as f64 * cell_m <= NARROW_M {
            continue;
        }
        let left = without(surface, &found, &doubtful);
        let mut around = left.clone();
        for (cell, whole) in around.data_mut().iter_mut().zip(whole.data()).filter(|(cell, _)| cell.is_nan()) {
            *cell = *whole;
        }
        let low = opened(&left, radius);
        let candidates = above(&left, &low, config.threshold_m(radius as f64 * cell_m, heights.noise_m));
        doubtful =
            judge(&Candidates { left: &left, low: &low, around: &around, cells: &candidates, cell_m }, &mut found);
    }
    Ok(found)
}

/// Returns a surface with the ground around them in the place of objects; doubtful cells are not
/// taken for ground. The opened surface would be too low on ridges, whose ground then stands out as
/// objects do.
fn without(surface: &Grid<f32>, objects: &Grid<bool>, doubtful: &Grid<bool>) -> Grid<f32> {
    let ground = filled(&surface.without(|at| objects.data()[at] || doubtful.data()[at]));
    let mut out = surface.clone();
    for ((cell, &ground), &is_object) in out.data_mut().iter_mut().zip(ground.data()).zip(objects.data()) {
        if is_object && !cell.is_nan() {
            *cell = ground;
        }
    }
    out
}

/// What an opening removes.
struct Candidates<'a> {
    /// The surface, without the objects that are known.
    left: &'a Grid<f32>,
    /// The opened surface.
    low: &'a Grid<f32>,
    /// The cells that stand out.
    cells: &'a Grid<bool>,
    /// The surface with the forests that give no candidates.
    around: &'a Grid<f32>,
    cell_m: f64,
}

/// Marks the objects among the candidates. Candidates that touch are judged together: trees and
/// houses hide the borders of each other. Smooth parts of an object that lie lower than everything
/// around them are ground that an opening has cut off, such as a clearing on a ridge. Smooth parts
/// of what is no object as a whole may be objects of their own.
///
/// Returns the parts that are no objects, although the surface drops along some of their border:
/// houses whose neighbours are larger.
fn judge(candidates: &Candidates<'_>, found: &mut Grid<bool>) -> Grid<bool> {
    let mut doubtful = candidates.cells.map(|_| false);
    let step_m = STEP_M.max(candidates.cell_m as f32);
    let wholes = Regions::of(candidates.cells);
    let parts = Regions::smooth(candidates.cells, candidates.left, step_m);
    let is_whole: Vec<bool> = (0..wholes.len()).map(|whole| candidates.drops(&wholes, whole, FREE_SHARE)).collect();
    for part in 0..parts.len() {
        let cells = parts.cells(part);
        let is_of_object = is_whole[wholes.at(cells[0])];
        let is_small = cells.len() as f64 * candidates.cell_m.powi(2) < CLEARING_MIN_M2;
        if !(is_of_object && is_small || candidates.drops(&parts, part, FREE_SHARE_OF_PARTS)) {
            continue;
        }
        let is_object = is_of_object || candidates.drops(&parts, part, FREE_SHARE);
        let marks = if is_object { &mut *found } else { &mut doubtful };
        cells.iter().for_each(|&cell| marks.data_mut()[cell as usize] = true);
    }
    doubtful
}

impl Candidates<'_> {
    /// Whether the surface drops by the height of a region along its border, except for a share.
    fn drops(&self, regions: &Regions, region: usize, free_share: f64) -> bool {
        let height = regions.median(region, |cell| self.left.data()[cell] - self.low.data()[cell]).unwrap_or(0.0);
        let drops = regions.drops_m(region, self.around, self.cell_m).into_iter();
        match quantile(&mut drops.map(|(_, drop)| drop).collect::<Vec<f32>>(), free_share) {
            Some(drop) => drop >= DROP_SHARE * height,
            // Between voids alone, a low candidate cannot be told from ground.
            None => regions.median(region, |cell| self.left.data()[cell]).is_some_and(|above| above > STOREY_M),
        }
    }
}

/// Half-widths of the windows, cells, for the widest object in cells.
pub(crate) fn radii(widest: f64) -> Vec<usize> {
    let mut radii = Vec::new();
    let mut half = 1.0;
    let last = (widest / 2.0).max(1.0).ceil();
    while half < last {
        radii.push(half.round() as usize);
        half = (half * GROWTH).max(half + 1.0);
    }
    radii.push(last as usize);
    radii
}

/// Cells at which one surface stands above another by more than `threshold_m`.
fn above(upper: &Grid<f32>, lower: &Grid<f32>, threshold_m: f32) -> Grid<bool> {
    upper.zip_map(lower, |upper, lower| upper - lower > threshold_m)
}
