//! Closing small holes, and only those of which the surroundings say how.
//!
//! The rim of a hole is triangulated (Delaunay) and interpolated. Where the rim holds two levels, the hole is ground
//! that a building hides from the views, so only the lower level is used.

use raster::Grid;
use spade::{DelaunayTriangulation, FloatTriangulation, HasPosition, Point2, Triangulation};

use super::speckle::neighbours;

/// Parameters of the filling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillConfig {
    /// Holes of more cells than this stay open.
    pub max_cells: usize,
    /// A rim that spreads over more than this has two levels, metres.
    pub same_surface_m: f32,
}

/// A rim cell.
struct Rim {
    position: Point2<f64>,
    height: f32,
}

impl HasPosition for Rim {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Fills holes of `height_m` in place; returns which cells were filled. Holes that touch the grid's border stay.
pub fn fill_holes(height_m: &mut Grid<f32>, config: &FillConfig) -> Grid<bool> {
    let (w, h) = (height_m.width(), height_m.height());
    let mut filled = Grid::filled(w, h, false);
    let mut seen = vec![false; w * h];
    for seed in 0..w * h {
        if seen[seed] || !height_m.data()[seed].is_nan() {
            continue;
        }
        let (hole, rim) = hole_and_rim(height_m, seed, &mut seen);
        let at_border = hole.iter().any(|p| p % w == 0 || p % w == w - 1 || p / w == 0 || p / w == h - 1);
        if at_border || hole.len() > config.max_cells {
            continue;
        }
        for (p, value) in interpolate(height_m, &hole, &rim, config.same_surface_m) {
            height_m.data_mut()[p] = value;
            filled.data_mut()[p] = true;
        }
    }
    filled
}

/// The connected cells without a height that hold `seed`, and the cells around them.
fn hole_and_rim(height_m: &Grid<f32>, seed: usize, seen: &mut [bool]) -> (Vec<usize>, Vec<usize>) {
    let (w, h) = (height_m.width(), height_m.height());
    let (mut hole, mut rim) = (vec![seed], Vec::new());
    seen[seed] = true;
    let mut next = 0;
    while let Some(&p) = hole.get(next) {
        next += 1;
        for q in neighbours(p, w, h) {
            if !height_m.data()[q].is_nan() {
                rim.push(q);
            } else if !seen[q] {
                seen[q] = true;
                hole.push(q);
            }
        }
    }
    rim.sort_unstable();
    rim.dedup();
    (hole, rim)
}

fn interpolate(height_m: &Grid<f32>, hole: &[usize], rim: &[usize], same_surface_m: f32) -> Vec<(usize, f32)> {
    let w = height_m.width();
    let place = |p: usize| Point2::new((p % w) as f64, (p / w) as f64);
    let used = lower_level(height_m, rim, same_surface_m);
    let points: Vec<Rim> = used.iter().map(|&p| Rim { position: place(p), height: height_m.data()[p] }).collect();
    let Ok(triangulation) = DelaunayTriangulation::<Rim>::bulk_load(points) else { return Vec::new() };
    let barycentric = triangulation.barycentric();
    let value = |p: usize| {
        let inside = barycentric.interpolate(|v| f64::from(v.data().height), place(p));
        // Outside the lower rim's hull the nearest of it is the best that is known.
        inside.map(|v| v as f32).or_else(|| triangulation.nearest_neighbor(place(p)).map(|v| v.data().height))
    };
    hole.iter().filter_map(|&p| value(p).map(|v| (p, v))).collect()
}

/// The rim cells of the lowest level that at least a quarter of the rim supports; all of them when there is one level.
fn lower_level(height_m: &Grid<f32>, rim: &[usize], same_surface_m: f32) -> Vec<usize> {
    let mut sorted: Vec<f32> = rim.iter().map(|&p| height_m.data()[p]).collect();
    sorted.sort_by(f32::total_cmp);
    let (Some(least), Some(greatest)) = (sorted.first(), sorted.last()) else { return Vec::new() };
    if greatest - least <= same_surface_m {
        return rim.to_vec();
    }
    let quarter = sorted[sorted.len() / 4];
    rim.iter().copied().filter(|&p| height_m.data()[p] <= quarter + same_surface_m).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_in_a_slope_gets_the_slope_and_one_beside_a_wall_the_ground() {
        let slope = |x: usize| 0.1 * x as f32;
        let mut g = Grid::from_vec(20, 20, (0..400).map(|i| slope(i % 20)).collect()).unwrap();
        g[(7, 7)] = f32::NAN;
        g[(8, 7)] = f32::NAN;
        let config = FillConfig { max_cells: 10, same_surface_m: 1.5 };
        let filled = fill_holes(&mut g, &config);
        assert!((g[(7, 7)] - 0.7).abs() < 1e-3 && (g[(8, 7)] - 0.8).abs() < 1e-3);
        assert_eq!(filled.data().iter().filter(|f| **f).count(), 2);
        let mut wall =
            Grid::from_vec(20, 20, (0..400).map(|i| if i % 20 < 10 { 30.0 } else { 2.0 }).collect()).unwrap();
        wall[(10, 5)] = f32::NAN;
        wall[(11, 5)] = f32::NAN;
        fill_holes(&mut wall, &config);
        assert_eq!((wall[(10, 5)], wall[(11, 5)]), (2.0, 2.0));
    }

    #[test]
    fn large_holes_and_holes_at_the_border_stay_open() {
        let mut g = Grid::filled(20, 20, 1.0f32);
        g[(0, 3)] = f32::NAN;
        (5..15).for_each(|x| (5..15).for_each(|y| g[(x, y)] = f32::NAN));
        let filled = fill_holes(&mut g, &FillConfig { max_cells: 50, same_surface_m: 1.0 });
        assert!(filled.data().iter().all(|f| !f));
    }
}
