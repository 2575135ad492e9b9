//! Heights that reach out over the edge of what stands high.
//!
//! Where the ground beside a roof has no match of its own, as in a shadow, the patches at the edge
//! of the roof carry its height on over a pixel or two. Views agree on that, as all of them see the
//! edge. The images show where the roof ends: the strongest change of grey lies further in than the
//! jump of the heights.
//!
//! The first pixel outside the edge is left alone. Patches blur the edge by it on sharp images,
//! too, where the surface on the grid is right.

use std::ops::RangeInclusive;

use raster::Grid;
use rayon::prelude::*;
use sweep::consistency::Heights;

use crate::surface::shadow_side::JUMP_STEPS;

/// Pixels on each side of a jump that are compared: patches of 3 × 3 pixels whose costs are blended
/// with those beside them reach two pixels over an edge.
const REACH: isize = 3;
/// Pixels between the edge in the image and the jump that heights may have.
const BLUR: isize = 1;
/// Least jump, metres: half a storey.
const JUMP_M: f32 = 2.0;
/// Change of grey at an edge, as a multiple of the largest one from the pixel to beyond the jump.
const RATIO: f32 = 1.5;
/// Change of grey at an edge, as a multiple of the noise.
const NOISES: f32 = 3.0;
/// Directions across a jump.
const DIRECTIONS: [[isize; 2]; 4] = [[1, 0], [-1, 0], [0, 1], [0, -1]];

/// The heights of a view's pixels and the image that they come from.
#[derive(Clone, Copy)]
pub(crate) struct ImagedHeights<'a> {
    image: &'a Grid<f32>,
    /// Standard deviation of the noise, grey values.
    noise: f32,
    /// Height of each pixel, metres.
    height_m: &'a Grid<f32>,
    /// Distance of two hypotheses, metres.
    step_m: f32,
}

impl<'a> ImagedHeights<'a> {
    /// Those of a view on a level with hypotheses `step_m` metres apart.
    pub(crate) fn of(heights: Heights<'a>, level: usize, step_m: f64) -> Self {
        let Heights { view, map, .. } = heights;
        Self { image: &view.levels[level], noise: view.noise_at(level), height_m: &map.height_m, step_m: step_m as f32 }
    }

    /// Takes the pixels that reach out over an edge from those that are kept.
    pub(crate) fn drop_overreach(&self, keep: &mut Grid<bool>) {
        let (width, height) = (keep.width(), keep.height());
        let margin = (2 * REACH + 1) as usize;
        if width <= 2 * margin || height <= 2 * margin {
            return;
        }
        keep.data_mut().par_chunks_mut(width).enumerate().skip(margin).take(height - 2 * margin).for_each(
            |(y, row)| {
                let columns = row.iter_mut().enumerate().take(width - margin).skip(margin);
                columns.filter(|(_, keep)| **keep).for_each(|(x, keep)| *keep = !self.reaches_out([x, y]));
            },
        );
    }

    /// Whether a pixel far enough from the border of the image reaches out over an edge.
    fn reaches_out(&self, [x, y]: [usize; 2]) -> bool {
        let place = |along: isize, across: isize, [dx, dy]: [isize; 2]| {
            let moved = |at: usize, by: isize| at.wrapping_add_signed(by);
            (moved(x, along * dx + across * dy), moved(y, along * dy + across * dx))
        };
        let own = self.height_m[(x, y)];
        let jump_m = JUMP_M.max(JUMP_STEPS * self.step_m);
        // Most pixels lie beside no jump.
        let reach = REACH as usize;
        let mut lowest = f32::INFINITY;
        for line in y - reach..=y + reach {
            let across = if line == y { reach } else { 0 };
            lowest = self.height_m.row(line)[x - across..=x + across].iter().copied().fold(lowest, f32::min);
        }
        if own - lowest <= jump_m {
            return false;
        }
        DIRECTIONS.into_iter().any(|direction| {
            let rise_from = |along: isize| own - self.height_m[place(along, 0, direction)];
            let Some(jump) = (1..=REACH).find(|along| rise_from(*along) > jump_m) else { return false };
            // Crowns have edges everywhere, and are not even.
            if !(1..=REACH).all(|inwards| rise_from(-inwards).abs() < 0.5 * jump_m) {
                return false;
            }
            // Between a pixel and the next one outwards, over three pixels side by side.
            let change = |along: isize| {
                let one = |across: isize| {
                    self.image[place(along + 1, across, direction)] - self.image[place(along, across, direction)]
                };
                ((-1..=1).map(one).sum::<f32>() / 3.0).abs()
            };
            let largest = |changes: RangeInclusive<isize>| changes.map(change).fold(0.0, f32::max);
            let inner = largest(jump - 1 - REACH..=-1 - BLUR);
            inner > NOISES * self.noise && inner > RATIO * largest(-BLUR..=jump)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kept pixels of the row through a roof whose heights end at column 20, in an image in which
    /// it ends at column `edge`.
    fn kept(edge: usize, contrast: f32, roof_m: impl Fn(usize) -> f32) -> Vec<usize> {
        let grid = |value: &dyn Fn(usize) -> f32| {
            Grid::from_vec(40, 40, (0..1600).map(|at| value(at % 40)).collect()).unwrap()
        };
        let image = grid(&|x| if x < edge { 100.0 + contrast } else { 100.0 });
        let height_m = grid(&|x| if x < 20 { roof_m(x) } else { 0.0 });
        let mut keep = Grid::filled(40, 40, true);
        ImagedHeights { image: &image, noise: 1.0, height_m: &height_m, step_m: 0.4 }.drop_overreach(&mut keep);
        (0..40).filter(|x| keep[(*x, 20)]).collect()
    }

    #[test]
    fn pixels_beyond_the_edge_of_a_roof_are_dropped_but_for_the_first() {
        let all: Vec<usize> = (0..40).collect();
        let without = |dropped: &[usize]| all.iter().copied().filter(|x| !dropped.contains(x)).collect::<Vec<_>>();
        let roof_m = |_| 9.0;
        assert_eq!(kept(20, 50.0, roof_m), all);
        assert_eq!(kept(19, 50.0, roof_m), all);
        assert_eq!(kept(18, 50.0, roof_m), without(&[19]));
        assert_eq!(kept(17, 50.0, roof_m), without(&[18, 19]));
        // An edge as weak as the noise, and a crown.
        assert_eq!(kept(18, 2.0, roof_m), all);
        assert_eq!(kept(18, 50.0, |x| 9.0 - 1.5 * (x % 2) as f32), all);
    }

    #[test]
    fn small_images_are_left_alone() {
        let grid = Grid::filled(9, 9, 1.0);
        let mut keep = Grid::filled(9, 9, true);
        ImagedHeights { image: &grid, noise: 1.0, height_m: &grid, step_m: 0.4 }.drop_overreach(&mut keep);
        assert!(keep.data().iter().all(|keep| *keep));
    }
}
