//! A height field that rays follow exactly.
//!
//! Between four neighbouring centres the surface is two triangles: upper left, upper right, lower
//! left; and the rest. A ray goes from square to square (Amanatides and Woo 1987); in each it is
//! compared with the planes of both triangles, on which the height is linear along the ray. A
//! triangle that has a corner without a height is left out.

use bvh::Ray;
use raster::{GeoTransform, Grid};

use super::{Ground, Met};
use numeric::vector::{cross, normalized};

/// Tolerance around a square within which its triangles are met, cells: a ray along an edge must
/// not slip through.
const EDGE: f64 = 1e-9;

/// Heights on a map grid.
#[derive(Debug, Clone)]
pub struct HeightField {
    /// Heights above the origin, metres; NaN is no height.
    heights: Grid<f32>,
    geotransform: GeoTransform,
    origin: [f64; 3],
    /// Least and greatest height.
    range: [f64; 2],
    /// Steps of a column and of a row on the map, metres.
    steps: [[f64; 2]; 2],
}

/// A ray in columns, rows and metres of height.
struct Course {
    from: [f64; 3],
    by: [f64; 3],
}

impl HeightField {
    /// Makes a field from heights above `origin[2]` on a map in metres; `None` if the geotransform
    /// has no inverse or the grid has no square of cells.
    pub fn new(heights: Grid<f32>, geotransform: GeoTransform, origin: [f64; 3]) -> Option<Self> {
        geotransform.cell_from_map(origin[0], origin[1])?;
        let known = || heights.data().iter().copied().filter(|h| h.is_finite()).map(f64::from);
        let range = [known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max)];
        let c = geotransform.0;
        let is_usable = heights.width() > 1 && heights.height() > 1 && range[0].is_finite();
        let steps = [[c[1], c[4]], [c[2], c[5]]];
        is_usable.then_some(Self { heights, geotransform, origin, range, steps })
    }

    /// Returns the heights above the origin, metres.
    pub fn heights(&self) -> &Grid<f32> {
        &self.heights
    }

    /// Returns the local position of a cell, at its height.
    pub fn position(&self, column: usize, row: usize) -> [f64; 3] {
        let (x, y) = self.geotransform.map_from_cell(column as f64, row as f64);
        [x - self.origin[0], y - self.origin[1], f64::from(self.heights[(column, row)])]
    }

    /// Returns the height of the triangles at a local position; `None` if there is none.
    pub fn height_at(&self, x: f64, y: f64) -> Option<f64> {
        let down = Ray { origin: [x, y, self.range[1] + 1.0], direction: [0.0, 0.0, -1.0], end: f64::INFINITY };
        self.meet(&down).map(|met| self.range[1] + 1.0 - met.t)
    }

    /// Returns the triangles as positions and corners, without triangles that lack a height.
    pub fn triangles(&self) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let (width, height) = (self.heights.width(), self.heights.height());
        let positions = (0..width * height).map(|k| self.position(k % width, k / width));
        let positions: Vec<[f64; 3]> = positions.map(|p| if p[2].is_finite() { p } else { [0.0; 3] }).collect();
        let mut triangles = Vec::new();
        for row in 0..height - 1 {
            for column in 0..width - 1 {
                let corner = |c: usize, r: usize| ((row + r) * width + column + c) as u32;
                let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
                let known = |triangle: &[u32; 3]| triangle.iter().all(|&k| self.heights.data()[k as usize].is_finite());
                triangles.extend([[a, c, b], [d, b, c]].into_iter().filter(known));
            }
        }
        (positions, triangles)
    }

    fn course(&self, ray: &Ray) -> Option<Course> {
        let map = |p: [f64; 3]| self.geotransform.cell_from_map(p[0] + self.origin[0], p[1] + self.origin[1]);
        let (c, r) = map(ray.origin)?;
        let det = self.steps[0][0] * self.steps[1][1] - self.steps[0][1] * self.steps[1][0];
        let [dx, dy, dz] = ray.direction;
        let by = [
            (dx * self.steps[1][1] - dy * self.steps[1][0]) / det,
            (dy * self.steps[0][0] - dx * self.steps[0][1]) / det,
            dz,
        ];
        let from = [c, r, ray.origin[2]];
        from.iter().chain(&by).all(|v| v.is_finite()).then_some(Course { from, by })
    }

    /// The part of a ray that is over the grid and between the lowest and the highest height.
    fn span(&self, course: &Course, end: f64) -> Option<[f64; 2]> {
        let last = [self.heights.width(), self.heights.height()].map(|cells| cells as f64 - 1.0);
        let sides = [[0.0, last[0]], [0.0, last[1]], self.range];
        let (mut first, mut until) = (0.0f64, end);
        for ((from, by), [low, high]) in course.from.iter().zip(course.by).zip(sides) {
            if by == 0.0 {
                if *from < low - EDGE || *from > high + EDGE {
                    return None;
                }
            } else {
                let (a, b) = ((low - EDGE - from) / by, (high + EDGE - from) / by);
                first = first.max(a.min(b));
                until = until.min(a.max(b));
            }
        }
        (first <= until).then_some([first, until])
    }

    /// What the ray meets in a square, between two places on it.
    fn in_square(&self, course: &Course, [i, j]: [usize; 2], [first, until]: [f64; 2]) -> Option<(f64, [f64; 2])> {
        let (top, low) = (self.heights.row(j), self.heights.row(j + 1));
        let [a, b, c, d] = [top[i], top[i + 1], low[i], low[i + 1]].map(f64::from);
        let (z0, z1) = (course.from[2] + first * course.by[2], course.from[2] + until * course.by[2]);
        // f64::max ignores NaN.
        if z0.min(z1) > a.max(b).max(c.max(d)) + EDGE || z0.max(z1) < a.min(b).min(c.min(d)) - EDGE {
            return None;
        }
        let (u, v) = (course.from[0] - i as f64, course.from[1] - j as f64);
        let mut best: Option<(f64, [f64; 2])> = None;
        for (base, by_column, by_row, upper) in [(a, b - a, c - a, true), (b + c - d, d - c, d - b, false)] {
            // The height above the plane is linear along the ray.
            let above = course.from[2] - (base + by_column * u + by_row * v);
            let rate = course.by[2] - by_column * course.by[0] - by_row * course.by[1];
            let t = -above / rate;
            // Negated, so that NaN heights are not met.
            if !(t > 0.0 && t >= first - EDGE * (1.0 + first) && t <= until + EDGE * (1.0 + until)) {
                continue;
            }
            let along = u + t * course.by[0] + v + t * course.by[1];
            let is_inside = if upper { along <= 1.0 + EDGE } else { along >= 1.0 - EDGE };
            if is_inside && best.is_none_or(|(known, _)| t < known) {
                best = Some((t, [by_column, by_row]));
            }
        }
        best
    }
}

impl Ground for HeightField {
    fn meet(&self, ray: &Ray) -> Option<Met> {
        let course = self.course(ray)?;
        let [mut at, until] = self.span(&course, ray.end)?;
        let last = [self.heights.width(), self.heights.height()].map(|cells| cells - 2);
        let place = |k: usize, t: f64| course.from[k] + t * course.by[k];
        let mut square = [0, 1].map(|k| (place(k, at).max(0.0) as usize).min(last[k]));
        loop {
            // Where the ray leaves the square along each axis.
            let leaves = [0, 1].map(|k| {
                let side = square[k] as f64 + if course.by[k] > 0.0 { 1.0 } else { 0.0 };
                if course.by[k] == 0.0 { f64::INFINITY } else { (side - course.from[k]) / course.by[k] }
            });
            let axis = usize::from(leaves[1] < leaves[0]);
            let next = leaves[axis].min(until).max(at);
            if let Some((t, [by_column, by_row])) = self.in_square(&course, square, [at, next]) {
                let [column, row] = self.steps;
                let normal = normalized(cross([column[0], column[1], by_column], [row[0], row[1], by_row]));
                let up = if normal[2] < 0.0 { normal.map(|c| -c) } else { normal };
                return (t <= ray.end).then_some(Met { t, normal: up });
            }
            if leaves[axis] >= until {
                return None;
            }
            at = next;
            let forward = course.by[axis] > 0.0;
            square[axis] = match square[axis] {
                k if forward && k < last[axis] => k + 1,
                k if !forward && k > 0 => k - 1,
                _ => return None,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh::Bvh;
    use proptest::prelude::*;

    fn field(cells: &[f32], turn: f64) -> HeightField {
        let (s, c) = turn.sin_cos();
        let transform = GeoTransform([500.0, 0.5 * c, 0.5 * s, 900.0, 0.5 * s, -0.5 * c]);
        HeightField::new(Grid::from_vec(13, 9, cells.to_vec()).unwrap(), transform, [502.0, 898.0, 0.0]).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// What a ray meets is what it meets among the triangles, voids and turned grids included.
        #[test]
        fn a_field_is_its_triangles(
            cells in prop::collection::vec(prop_oneof![8 => 0.0..4.0f32, 1 => Just(f32::NAN)], 13 * 9), turn in 0.0..6.3f64,
            rays in prop::collection::vec((prop::array::uniform3(-4.0..6.0f64), prop::array::uniform3(-1.0..1.0f64)), 40),
        ) {
            let field = field(&cells, turn);
            let (positions, triangles) = field.triangles();
            let bvh = Bvh::new(&positions, &triangles).unwrap();
            for (origin, direction) in rays {
                let ray = Ray { origin, direction, end: f64::INFINITY };
                match (field.meet(&ray), bvh.closest_hit(&ray)) {
                    (Some(a), Some(b)) => {
                        prop_assert!((a.t - b.t).abs() < 1e-6 * (1.0 + b.t), "{a:?} {b:?}");
                        prop_assert!(a.normal[2] > 0.0);
                    }
                    (a, b) => prop_assert!(a.is_none() && b.is_none(), "{a:?} {b:?}"),
                }
            }
        }
    }

    #[test]
    fn heights_are_those_of_the_cells_and_end_with_them() {
        let cells: Vec<f32> = (0..117).map(|k| (k % 7) as f32).collect();
        let field = field(&cells, 0.4);
        for (c, r) in [(0, 0), (5, 4), (12, 8), (11, 0)] {
            let [x, y, z] = field.position(c, r);
            assert!((field.height_at(x, y).unwrap() - z).abs() < 1e-6, "{c} {r}");
        }
        assert_eq!(field.height_at(-50.0, 0.0), None);
        let short = Ray { origin: [0.0, 0.0, 100.0], direction: [0.0, 0.0, -1.0], end: 10.0 };
        assert_eq!(field.meet(&short), None);
        let flat = Grid::filled(1, 5, 2.0f32);
        assert!(HeightField::new(flat, GeoTransform::north_up(0.0, 0.0, 1.0), [0.0; 3]).is_none());
    }
}
