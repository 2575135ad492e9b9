//! Clean-up of a fused surface: speckle is removed, voids are filled, and the confidence is
//! computed.
//!
//! Lengths are in metres, so that a result does not depend on the cell size more than it must.

use numeric::Silent;
use raster::{Grid, Window};
use sweep::fusion::{
    CellSource, FillConfig, FillRule, FusedSurface, GridSight, KnownVoids, TrendConfig, Trust, TrustConfig, TrustModel,
    fill_voids, ground_trend, occlusion_bounds, remove_speckle, surroundings,
};
use terrain::{
    BareGround, GroundConfig, TerrainError, bare_ground_by_openings, bare_ground_of_observed, goes_through_roofs,
    shows_hardly_but_roofs, supported_ground,
};

use crate::surface::fill::Fill;
use crate::surface::hidden::{TRUSTED, drop_hidden};

/// Isolated patches of less ground than a square of this side are speckle, metres: smaller than the
/// crown of a single tree or a car port.
const SPECKLE_SIDE_M: f64 = 2.5;
/// A cell on whose height the views agree less than this has no height: less than half of what a
/// single view's height inside a surface has that another height fits as well. Below are heights at
/// borders and lone pixels.
const AGREEMENT_MIN: f32 = 0.05;
/// A height that is right with a smaller probability than this is dropped where those around it are
/// not much better, as on water. A tree stands among heights that are right.
const RIGHT_MIN: f32 = 0.25;
const RIGHT_MIN_AROUND: f32 = 0.4;
/// Distance over which the heights around are judged, metres: half the width of a canal.
const WATER_M: f64 = 10.0;
/// Patches of at least this many cells are never speckle, whatever the cell size.
const SPECKLE_CELLS_MIN: usize = 9;
/// Distance of known heights between which a void is filled, metres: a wide street or a house.
const FILL_REACH_M: f64 = 40.0;
/// Distance of known heights where every void is to be closed, and of the ground with which a
/// hidden void is filled, metres: the middle of a pond or of a hall; a view that leans by 30° does
/// not see so much ground behind a tower of 100 m.
const FILL_REACH_FAR_M: f64 = 60.0;
/// Voids up to this wide are closed, whatever the images show there, metres: the shadow side of a
/// house.
const FILL_NARROW_M: f64 = 10.0;
/// Side of the smallest island of trusted heights from which voids are filled, metres: a small
/// house. On glittering water a few cells are trusted by chance.
const FILL_HOUSE_M: f64 = 5.0;
/// Heights around a void that differ by more than this per metre between them are two surfaces:
/// steeper than streets.
const FILL_SLOPE: f64 = 0.05;
/// Distance in a void over which blank pixels are the reason for it, metres: the patches that are
/// compared reach two pixels of up to 2 m into what is blank, and blank pixels are marked at
/// heights that are off.
const FILL_BLIND_M: f64 = 5.0;
/// Distance to each side over which heights tell whether the ground around a void is known, metres:
/// from the middle of a street over the houses beside it.
const FILL_GROUND_M: f64 = 10.0;
/// Distance to each side over which the share of voids, and of heights that are right, is judged,
/// metres: a few houses.
const FILL_QUARTER_M: f64 = 30.0;
/// Growth of the standard deviation of a filled height per metre to the nearest known one: ground
/// rises and falls, and something small may stand there.
const FILL_SIGMA_SLOPE: f64 = 0.1;

/// Side of the blocks of which each has one height of the ground, metres: as wide as a street with
/// its walls.
const TREND_BLOCK_M: f64 = 10.0;

/// A height is right if its error is below this, or below two cells where those are larger, metres:
/// the usual threshold of completeness.
const RIGHT_M: f64 = 1.0;

/// Width of the ground around a cell that decides its content, metres: speckle is
/// judged, then voids are filled from this far. What hides a void stands nearer, unless it is a
/// tower of more than 100 m: in a chunk the void then counts as seen at the far end of its shadow.
pub const SURROUNDINGS_M: f64 = FILL_REACH_FAR_M + 2.0 * SPECKLE_SIDE_M;

/// Returns the error below which a height counts as right, metres.
pub fn right_within_m(gsd_m: f64) -> f64 {
    (2.0 * gsd_m).max(RIGHT_M)
}

/// What is known about the voids of a surface.
#[derive(Clone, Copy)]
pub(crate) struct Voids<'a> {
    /// Cells where the images have no texture.
    pub(crate) blind: &'a Grid<bool>,
    /// What each view sees of the grid.
    pub(crate) sights: &'a [GridSight],
    pub(crate) fill: Fill,
}

/// Lengths on which the clean-up depends, metres.
#[derive(Clone, Copy)]
pub(crate) struct Lengths {
    /// Side of a cell.
    pub(crate) gsd_m: f64,
    /// Distance of two hypotheses.
    pub(crate) step_m: f64,
    /// Deviation of heights that the cameras leave.
    pub(crate) camera_m: f64,
}

/// Cleans a surface; returns the source of each cell and the number of cells of `core` that were
/// removed as speckle.
pub(crate) fn clean_up(
    fused: &mut FusedSurface,
    voids: Voids<'_>,
    lengths: Lengths,
    core: Window,
) -> (Grid<CellSource>, usize) {
    let Lengths { gsd_m, step_m, camera_m } = lengths;
    let reach_cells = (0.5 * SPECKLE_SIDE_M / gsd_m).round().max(1.0) as usize;
    let tolerance_m = right_within_m(gsd_m);
    let config = TrustConfig {
        step_m,
        tolerance_m,
        reach_cells,
        filled_reach_cells: (FILL_QUARTER_M / gsd_m).ceil() as usize,
        camera_m,
    };
    let trust = TrustModel::new(fused, config);
    let completed = take_unseen(fused);
    let before = known(&fused.height_m, core);
    let mut all_m = fused.height_m.clone();
    drop_weak(fused, &trust, gsd_m);
    let right = trust.probability(fused);
    drop_hidden(&mut fused.height_m, &right, voids.sights, tolerance_m as f32);
    let speckle_cells = ((SPECKLE_SIDE_M / gsd_m).powi(2) as usize).max(SPECKLE_CELLS_MIN);
    let same_surface_m = (2.0 * step_m).max(2.0 * gsd_m) as f32;
    remove_speckle(&mut fused.height_m, same_surface_m, speckle_cells);
    forget_agreement_of_voids(fused);
    let observed = known(&fused.height_m, core);
    let trusted = trust.probability(fused).map(|p| *p >= TRUSTED);
    let trend = ground_trend(&fused.height_m, &trusted, &trend_config(gsd_m));
    let bounds = |above_m: &Grid<f32>, cells: &[usize]| {
        let height_m = above_m.zip_map(&trend, |above_m, ground_m| above_m + ground_m);
        let bounds = occlusion_bounds(&height_m, voids.sights, cells);
        bounds.into_iter().zip(cells).map(|(bound_m, cell)| bound_m - trend.data()[*cell]).collect()
    };
    let above = |height_m: &Grid<f32>| height_m.zip_map(&trend, |height_m, ground_m| height_m - ground_m);
    let (mut above_m, completed) = (above(&fused.height_m), above(&completed));
    let (ground_m, only_roofs) = match voids.fill {
        Fill::None => (trusted.map(|_| f32::NAN), trusted.map(|_| false)),
        _ => {
            remove_speckle(&mut all_m, same_surface_m, speckle_cells);
            ground_under((&fused.height_m, &all_m), &trusted, &trend, gsd_m)
        }
    };
    let ground = above(&ground_m);
    let known = KnownVoids {
        trusted: &trusted,
        blind: voids.blind,
        completed_m: &completed,
        ground_m: &ground,
        only_roofs: &only_roofs,
    };
    let filled = fill_voids(&mut above_m, known, bounds, &fill_config(voids.fill, gsd_m));
    for i in (0..above_m.data().len()).filter(|i| filled.source.data()[*i].is_filled()) {
        fused.height_m.data_mut()[i] = above_m.data()[i] + trend.data()[i];
        fused.sigma_m.data_mut()[i] = filled.sigma_m.data()[i];
    }
    let is_observed = |i: usize| !filled.source.data()[i].is_filled();
    let Trust { sigma_m, probability } = trust.calibrate(fused, is_observed);
    (fused.sigma_m, fused.confidence) = (sigma_m, probability);
    (filled.source, before - observed)
}

/// Returns the ground under the trusted heights, metres, NaN far from any, and the quarters of
/// which hardly any ground is known. Where clearly more heights of `all_m` support a lower ground,
/// that is the ground; elsewhere the trend is, where the ground goes through roofs. `all_m` has all
/// heights that agree with their neighbours, weak ones included, because streets show few others.
///
/// The ground tells how low a void may be. Voids are filled relative to the trend all the same:
/// that is even, and the ground repeats the noise of the heights that it goes through.
fn ground_under(
    (height_m, all_m): (&Grid<f32>, &Grid<f32>),
    trusted: &Grid<bool>,
    trend: &Grid<f32>,
    gsd_m: f64,
) -> (Grid<f32>, Grid<bool>) {
    let seen = height_m.without(|i| !trusted.data()[i]);
    let unobserved = seen.map(|h| h.is_nan());
    let config = GroundConfig::default();
    let heights = |found: Result<BareGround, TerrainError>| {
        found.expect("the cells and the default settings are valid, and nothing cancels").heights
    };
    // Each of the two is too high in places of its own: on roofs of slopes, and over hollows.
    let (by_planes_m, by_openings_m) = rayon::join(
        || heights(bare_ground_of_observed(&seen, Some(&unobserved), gsd_m, &config, &Silent)),
        || heights(bare_ground_by_openings(&seen, &unobserved, gsd_m, &config, &Silent)),
    );
    let lower_m = by_planes_m.zip_map(&by_openings_m, |a, b| a.min(*b));
    let is_through = goes_through_roofs(&by_planes_m, height_m, trend, gsd_m);
    let mut otherwise_m = lower_m.clone();
    let cells = otherwise_m.data_mut().iter_mut().zip(trend.data()).zip(is_through.data());
    cells.filter(|(_, is_through)| **is_through).for_each(|((ground_m, trend_m), _)| *ground_m = *trend_m);
    let ground_m = supported_ground(all_m, &lower_m, &otherwise_m, gsd_m);
    let only_roofs = shows_hardly_but_roofs(height_m, &ground_m, gsd_m);
    (ground_m, only_roofs)
}

/// Takes the heights that no view has seen out of a surface.
fn take_unseen(fused: &mut FusedSurface) -> Grid<f32> {
    let unseen = fused.height_m.without(|i| fused.seen.data()[i]);
    fused.height_m.void_where(|i| !fused.seen.data()[i]);
    forget_agreement_of_voids(fused);
    unseen
}

/// Drops the heights whose evidence is too weak.
fn drop_weak(fused: &mut FusedSurface, trust: &TrustModel, gsd_m: f64) {
    fused.height_m.void_where(|i| fused.confidence.data()[i] < AGREEMENT_MIN);
    let right = trust.probability(fused);
    let around = surroundings(&right, (WATER_M / gsd_m).ceil() as usize);
    fused.height_m.void_where(|i| right.data()[i] < RIGHT_MIN && around.data()[i] < RIGHT_MIN_AROUND);
    forget_agreement_of_voids(fused);
}

fn forget_agreement_of_voids(fused: &mut FusedSurface) {
    let agreement = fused.confidence.data_mut().iter_mut().zip(fused.height_m.data());
    agreement.filter(|(_, h)| h.is_nan()).for_each(|(agreement, _)| *agreement = 0.0);
}

/// Returns the parameters of the ground's trend on cells of `gsd_m`.
fn trend_config(gsd_m: f64) -> TrendConfig {
    let block_cells = (TREND_BLOCK_M / gsd_m).round().max(1.0) as usize;
    TrendConfig { block_cells, reach_blocks: (FILL_REACH_FAR_M / TREND_BLOCK_M) as usize }
}

/// Returns the parameters of filling on cells of `gsd_m`.
fn fill_config(fill: Fill, gsd_m: f64) -> FillConfig {
    let (rule, reach_m) = match fill {
        Fill::None => (FillRule::Nothing, FILL_REACH_M),
        Fill::Justified => (FillRule::Justified, FILL_REACH_M),
        Fill::All => (FillRule::Everything, FILL_REACH_FAR_M),
    };
    FillConfig {
        rule,
        reach_cells: (reach_m / gsd_m).ceil() as usize,
        hidden_reach_cells: (FILL_REACH_FAR_M / gsd_m).ceil() as usize,
        narrow_cells: (FILL_NARROW_M / gsd_m) as f32,
        blind_reach_cells: (FILL_BLIND_M / gsd_m).ceil() as usize,
        ground_reach_cells: (FILL_GROUND_M / gsd_m).ceil() as usize,
        quarter_reach_cells: (FILL_QUARTER_M / gsd_m).ceil() as usize,
        island_cells: (FILL_NARROW_M / gsd_m).powi(2) as usize,
        trusted_island_cells: (FILL_HOUSE_M / gsd_m).powi(2) as usize,
        same_surface_m: (2.0 * gsd_m) as f32,
        slope_m: (FILL_SLOPE * gsd_m) as f32,
        sigma_slope_m: (FILL_SIGMA_SLOPE * gsd_m) as f32,
    }
}

/// Returns the number of cells of a window that have a height.
fn known(height_m: &Grid<f32>, core: Window) -> usize {
    let columns = core.x as usize..core.x as usize + core.width;
    let row = |y: usize| height_m.row(core.y as usize + y)[columns.clone()].iter().filter(|h| !h.is_nan()).count();
    (0..core.height).map(row).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of 240 × 240 m: houses of 9 × 9 m in squares of 15 m, whose roofs stand 8 to 20 m
    /// above the ground. `is_ground_seen` tells by column and row of a square whether its street is
    /// observed.
    fn quarter(is_ground_seen: impl Fn(usize, usize) -> bool) -> FusedSurface {
        let mut height_m = Grid::filled(240, 240, f32::NAN);
        for row in 0..240 {
            for (column, height) in height_m.row_mut(row).iter_mut().enumerate() {
                let (x, y) = (column / 15, row / 15);
                if column % 15 < 9 && row % 15 < 9 {
                    *height = 8.0 + ((x * 73_856 + y * 19_349) % 97 % 13) as f32;
                } else if is_ground_seen(x, y) {
                    *height = 0.0;
                }
            }
        }
        let known = |value: f32| height_m.map(|h| if h.is_nan() { 0.0 } else { value });
        FusedSurface {
            single_m: height_m.clone(),
            sigma_m: height_m.map(|h| if h.is_nan() { f32::NAN } else { 0.05 }),
            views: known(3.0).map(|views| *views as u8),
            confidence: known(0.8),
            seen: height_m.map(|h| !h.is_nan()),
            height_m,
        }
    }

    /// Cleans the surface as two views see it, and returns the sources and heights of all cells
    /// between houses that had none.
    fn streets(mut fused: FusedSurface) -> Vec<(CellSource, f32)> {
        let is_void = fused.height_m.map(|h| h.is_nan());
        let blind = is_void.map(|_| false);
        let (images, gaps) = (is_void.map(|_| true), blind.clone());
        let sight = |lean: f64| GridSight { cells_per_m: [lean, 0.0], images: images.clone(), gaps: gaps.clone() };
        let voids = Voids { blind: &blind, sights: &[sight(0.1), sight(-0.1)], fill: Fill::Justified };
        let lengths = Lengths { gsd_m: 1.0, step_m: 0.4, camera_m: 0.1 };
        let (source, _) = clean_up(&mut fused, voids, lengths, Window::whole(240, 240));
        let cells = source.data().iter().copied().zip(fused.height_m.data().iter().copied());
        cells.zip(is_void.data()).filter(|(_, is_void)| **is_void).map(|(cell, _)| cell).collect()
    }

    #[test]
    fn streets_of_which_hardly_any_is_seen_get_the_ground_and_say_so() {
        let found = streets(quarter(|x, y| x % 6 < 2 && y % 6 < 2));
        let right = found.iter().filter(|(_, height_m)| height_m.abs() < 1.5).count();
        assert!(right * 10 > found.len() * 6, "{right} of {}", found.len());
        let marked = found.iter().filter(|(source, _)| *source == CellSource::FilledStreet).count();
        assert!(marked * 10 > found.len() * 7, "{marked} of {}", found.len());
    }

    #[test]
    fn streets_beside_known_ones_are_filled_by_the_other_rules() {
        let found = streets(quarter(|x, y| x % 8 != 2 || y % 8 != 2));
        assert!(found.iter().all(|(source, _)| *source != CellSource::FilledStreet));
    }
}
