//! The occlusion envelope: how high something may stand in a cell without two views seeing it.
//!
//! A point of height h in cell x is hidden from a view if the known surface z rises above its line
//! of sight. With d the cells that the line moves per metre up, towards the sensor, the greatest
//! hidden height is `H(x) = max over t > 0 of z(x + t·d) − t`. Cells without a height hide nothing.
//! A view that does not image the cell sees nothing of it: H = +∞. The bound of a cell is the
//! second smallest H over the views: anything higher is seen by two views past the known surface.
//!
//! H is found by a recurrence along lines of cells in direction d, whose places are rounded to
//! whole cells: a silhouette is off by at most half a cell. One direction serves a whole grid.
//! Across 10 km it turns by about 1°, which moves the shadow of a tower of 100 m by less than 2 m.

use raster::Grid;
use rayon::prelude::*;

/// A line of sight flatter than this many cells per metre up hides nothing: a view from above.
const VERTICAL: f64 = 1e-6;

/// What a view sees of the grid.
#[derive(Debug, Clone)]
pub struct GridSight {
    /// Columns and rows that a line of sight moves per metre up.
    pub cells_per_m: [f64; 2],
    /// Whether the view images the cell.
    pub images: Grid<bool>,
    /// Whether the view has a gap there, inside of its image. A gap says nothing of what hides the
    /// cell.
    pub gaps: Grid<bool>,
}

/// Computes the bound of each cell of `cells`, metres like `height_m`: +∞ where fewer than two
/// views image it, −∞ where two views see everything.
///
/// A view with a gap at a cell counts as one that sees it, where two others image the cell: that
/// the image is missing is as likely the reason why nothing matches as that something hides it.
///
/// All grids have the size of `height_m`, which is NaN in voids.
pub fn occlusion_bounds(height_m: &Grid<f32>, views: &[GridSight], cells: &[usize]) -> Vec<f32> {
    let unseen = || vec![[f32::INFINITY; 2]; cells.len()];
    let two_smallest = |mut all: Vec<[f32; 2]>, view: &GridSight| {
        let hidden = hidden_heights(height_m, view.cells_per_m);
        for (two, &i) in all.iter_mut().zip(cells).filter(|(_, i)| view.images.data()[**i]) {
            *two = with(*two, hidden.data()[i]);
        }
        all
    };
    let merged = |mut all: Vec<[f32; 2]>, other: Vec<[f32; 2]>| {
        all.iter_mut().zip(other).for_each(|(two, [a, b])| *two = with(with(*two, a), b));
        all
    };
    let all = views.par_iter().fold(unseen, two_smallest).reduce(unseen, merged);
    let has_gap = |cell: &usize| views.iter().any(|view| view.gaps.data()[*cell]);
    let bound = |([first, second], cell): ([f32; 2], &usize)| {
        if second < f32::INFINITY && has_gap(cell) { first } else { second }
    };
    all.into_iter().zip(cells).map(bound).collect()
}

/// Returns the two smallest of three heights, of which the first two are in order.
fn with([first, second]: [f32; 2], height: f32) -> [f32; 2] {
    [first.min(height), second.min(first.max(height))]
}

/// Computes the greatest height that the surface hides from one view in each cell; −∞ where it
/// hides nothing.
fn hidden_heights(height_m: &Grid<f32>, [dx, dy]: [f64; 2]) -> Grid<f32> {
    let (width, height) = (height_m.width(), height_m.height());
    let mut out = Grid::filled(width, height, f32::NEG_INFINITY);
    let along = dx.abs().max(dy.abs());
    if along < VERTICAL {
        return out;
    }
    // Steps run along columns or rows, whichever the line crosses faster, away from the sensor.
    let by_columns = dx.abs() >= dy.abs();
    let (steps, lanes) = if by_columns { (width, height) } else { (height, width) };
    let (ahead, aside) = if by_columns { (dx, dy) } else { (dy, dx) };
    let (slope, fall_m) = (aside / ahead, (1.0 / along) as f32);
    let shift_at = |step: usize| (step as f64 * slope).round() as i64;
    let at = |step: usize, lane: usize| if by_columns { (step, lane) } else { (lane, step) };
    // Greatest hidden height by lane of the current step, and of the step before it.
    let (mut own, mut before) = (vec![f32::NEG_INFINITY; lanes], vec![f32::NEG_INFINITY; lanes]);
    for k in 1..steps {
        let (from, to) = if ahead > 0.0 { (steps - k, steps - k - 1) } else { (k - 1, k) };
        std::mem::swap(&mut own, &mut before);
        let moved = shift_at(from) - shift_at(to);
        for (lane, value) in own.iter_mut().enumerate() {
            *value = f32::NEG_INFINITY;
            let Ok(source) = usize::try_from(lane as i64 + moved) else { continue };
            if source < lanes {
                let h = height_m[at(from, source)];
                // `max` ignores the NaN of a void.
                *value = before[source].max(h) - fall_m;
                out[at(to, lane)] = *value;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tower() -> Grid<f32> {
        let mut height_m = Grid::filled(60, 60, 0.0f32);
        (28..32).for_each(|y| (28..32).for_each(|x| height_m[(x, y)] = 20.0));
        height_m
    }

    fn sight(cells_per_m: [f64; 2]) -> GridSight {
        let [images, gaps] = [true, false].map(|value| Grid::filled(60, 60, value));
        GridSight { cells_per_m, images, gaps }
    }

    /// The definition of the envelope, by trial of all distances.
    fn by_trial(z: &Grid<f32>, [dx, dy]: [f64; 2], x: usize, y: usize) -> f64 {
        let height = |k: usize| {
            let t = f64::from(k as u32) * 0.02;
            let (u, v) = ((x as f64 + t * dx).round(), (y as f64 + t * dy).round());
            let is_inside = u >= 0.0 && v >= 0.0 && (u, v) != (x as f64, y as f64);
            let h = is_inside.then(|| z.get(u as usize, v as usize)).flatten()?;
            (!h.is_nan()).then(|| f64::from(*h) - t)
        };
        (1..3000).filter_map(height).fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn hidden_heights_are_those_of_the_definition_in_every_direction() {
        let z = tower();
        for d in [[0.8, 0.3], [-0.5, 0.9], [0.2, -1.1], [-1.0, -1.0], [1.3, 0.0], [0.0, 0.7]] {
            let found = hidden_heights(&z, d);
            // A rounded place moves the silhouette by up to a cell: the envelope by its fall there.
            let off = 2.0 / d[0].abs().max(d[1].abs());
            let near = |x: usize, y: usize| {
                let around = (y - 1..=y + 1).flat_map(|v| (x - 1..=x + 1).map(move |u| (u, v)));
                let all: Vec<f64> = around.map(|(u, v)| by_trial(&z, d, u, v)).collect();
                let (low, high) = all.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
                let h = f64::from(found[(x, y)]);
                low - off <= h && h <= high + off
            };
            assert!((4..56).all(|y| (4..56).all(|x| near(x, y))), "{d:?}");
        }
    }

    #[test]
    fn a_tower_hides_its_far_side_from_one_view_and_the_bound_needs_two() {
        let z = tower();
        let cell = |x: usize, y: usize| y * 60 + x;
        // Both sensors stand in the east, one further away from the vertical.
        let views = [sight([0.5, 0.0]), sight([1.0, 0.0]), sight([-1.0, 0.0])];
        let bound = |views: &[GridSight], x: usize| occlusion_bounds(&z, views, &[cell(x, 30)])[0];
        // Two cells west of the tower: 2 m up per cell, or 1 m.
        assert_eq!((bound(&views[..2], 26), bound(&views[..2], 20)), (18.0, 12.0));
        // The third view sees the west side, so that the lower of the other two bounds it.
        assert_eq!((bound(&views, 26), bound(&views, 20)), (16.0, 4.0));
        assert_eq!(bound(&views[..1], 26), f32::INFINITY);
    }

    #[test]
    fn a_gap_of_a_view_is_not_taken_for_what_a_tower_hides() {
        let (z, cell) = (tower(), 30 * 60 + 26);
        let bound = |views: &[GridSight]| occlusion_bounds(&z, views, &[cell])[0];
        let mut views = [sight([0.5, 0.0]), sight([0.0, 0.0]), sight([-1.0, 0.0])];
        // Two see the cell, and one of them is lost: the tower seems to hide it from the other two.
        views[1].images[(26, 30)] = false;
        assert!(bound(&views) > 0.0);
        views[1].gaps[(26, 30)] = true;
        assert!(bound(&views) < 0.0, "{}", bound(&views));
        // What one view alone images is outside all the same.
        assert_eq!(bound(&views[..2]), f32::INFINITY);
    }

    #[test]
    fn a_view_that_does_not_image_a_cell_bounds_nothing_there_and_one_from_above_sees_everything() {
        let z = tower();
        let mut views = [sight([0.0, 0.0]), sight([0.0, 0.0]), sight([1.0, 0.0])];
        assert_eq!(occlusion_bounds(&z, &views, &[5]), [f32::NEG_INFINITY]);
        views[0].images[(5, 0)] = false;
        assert!(occlusion_bounds(&z, &views, &[5])[0] > -2.0);
        views[1].images[(5, 0)] = false;
        assert_eq!(occlusion_bounds(&z, &views, &[5, 6]), [f32::INFINITY, f32::NEG_INFINITY]);
    }
}
