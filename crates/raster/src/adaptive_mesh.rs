//! Triangulates a height field with as few triangles as a vertical tolerance asks for.
//!
//! Right-triangulated irregular network (Evans, Kirkpatrick & Townsend 2001): the square of a tile
//! is two right triangles, and a triangle is split at the middle of its hypotenuse. A vertex
//! belongs to a diamond of two triangles with one hypotenuse. It is needed when a height of its
//! diamond lies farther than the tolerance from the two triangles, when a diamond is partly void,
//! or when one of the four vertices that hang on it is needed. So each triangle that is left is
//! within the tolerance of every cell it covers, tiles of one level fit without cracks, and voids
//! stay open.
//!
//! ```text
//!   a───────┐      squares: diagonal a–b, middle m, right angles c and d
//!   │ ╲   c │      edges: the same, turned by 45°, with legs of half the length
//!   │   m   │
//!   │ d   ╲ │
//!   └───────b
//! ```

use rayon::prelude::*;

use crate::Grid;

/// Vertices of a height field that a tolerance needs.
#[derive(Debug, Clone)]
pub struct AdaptiveMesh<'a> {
    heights: &'a Grid<f32>,
    /// Side of a tile, cells; a power of two.
    tile: usize,
    /// Whether each vertex of the lattice of whole tiles is needed.
    needed: Grid<bool>,
}

/// Triangles of a tile.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TileTriangles {
    /// Column and row of the cells that are vertices.
    pub vertices: Vec<(u32, u32)>,
    /// Indices of the vertices, counter-clockwise on a map whose rows go south.
    pub triangles: Vec<[u32; 3]>,
}

/// A vertex with its diamond: from the middle to an end of the hypotenuse, and to a right angle.
#[derive(Clone, Copy)]
struct Diamond {
    middle: (i64, i64),
    end: (i64, i64),
    apex: (i64, i64),
}

impl<'a> AdaptiveMesh<'a> {
    /// Finds the vertices that a field needs. NaN is void.
    ///
    /// # Panics
    /// If `tile` is no power of two of at least 2.
    pub fn new(heights: &'a Grid<f32>, tile: usize, tolerance: f32) -> Self {
        assert!(tile.is_power_of_two() && tile >= 2, "the side of a tile is {tile}, expected a power of two");
        let side = |cells: usize| cells.saturating_sub(1).div_ceil(tile).max(1) * tile + 1;
        let needed = Grid::filled(side(heights.width()), side(heights.height()), false);
        let mut mesh = Self { heights, tile, needed };
        let mut size = 2;
        while size <= tile {
            mesh.mark(size, tolerance, edge_diamond);
            mesh.mark(size, tolerance, square_diamond);
            size *= 2;
        }
        mesh
    }

    /// Columns and rows of tiles.
    pub fn tiles(&self) -> (usize, usize) {
        (self.needed.width() / self.tile, self.needed.height() / self.tile)
    }

    /// Returns the triangles of a tile.
    pub fn triangles(&self, column: usize, row: usize) -> TileTriangles {
        let (left, top) = ((column * self.tile) as i64, (row * self.tile) as i64);
        let tile = self.tile as i64;
        let (right, bottom) = (left + tile, top + tile);
        // The diagonal of the tile has the direction that its place gives it.
        let falls = (column + row).is_multiple_of(2);
        let [first, second] = if falls {
            [[(right, bottom), (left, top), (left, bottom)], [(left, top), (right, bottom), (right, top)]]
        } else {
            [[(right, top), (left, bottom), (right, bottom)], [(left, bottom), (right, top), (left, top)]]
        };
        let mut out = TileBuilder {
            mesh: self,
            numbers: vec![u32::MAX; (self.tile + 1).pow(2)],
            left,
            top,
            made: TileTriangles::default(),
        };
        for triangle in [first, second] {
            out.split(triangle);
        }
        out.made
    }

    /// Marks the vertices of the diamonds of one size that are needed.
    fn mark(&mut self, size: usize, tolerance: f32, diamond: fn(i64, i64, i64) -> Option<Diamond>) {
        let (half, width, this) = ((size / 2) as i64, self.needed.width(), &*self);
        let rows: Vec<Vec<usize>> = (0..this.needed.height())
            .into_par_iter()
            .step_by(size / 2)
            .map(|y| {
                let columns = (0..width as i64).step_by(size / 2);
                let found = columns.filter_map(|x| diamond(x, y as i64, half));
                let found =
                    found.filter(|diamond| this.has_needed_child(*diamond) || this.exceeds(*diamond, tolerance));
                found.map(|diamond| diamond.middle.1 as usize * width + diamond.middle.0 as usize).collect()
            })
            .collect();
        for cell in rows.into_iter().flatten() {
            self.needed.data_mut()[cell] = true;
        }
    }

    fn is_needed(&self, x: i64, y: i64) -> bool {
        let place = usize::try_from(x).ok().zip(usize::try_from(y).ok());
        place.and_then(|(x, y)| self.needed.get(x, y)).is_some_and(|needed| *needed)
    }

    /// Whether one of the vertices is needed that split the halves of a diamond.
    fn has_needed_child(&self, diamond: Diamond) -> bool {
        let Diamond { middle: (x, y), end: (ex, ey), apex: (ax, ay) } = diamond;
        // The hypotenuses of the halves run from the ends to the right angles.
        [(1, 1), (1, -1), (-1, 1), (-1, -1)].into_iter().any(|(end, apex)| {
            let (dx, dy) = (end * ex + apex * ax, end * ey + apex * ay);
            dx % 2 == 0 && dy % 2 == 0 && self.is_needed(x + dx / 2, y + dy / 2)
        })
    }

    /// Returns a height; `None` outside of the lattice of whole tiles, NaN in voids.
    fn height(&self, x: i64, y: i64) -> Option<f32> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        self.needed.get(x, y)?;
        Some(self.heights.get(x, y).copied().unwrap_or(f32::NAN))
    }

    /// Whether a triangle of a diamond is partly void, or farther than the tolerance from a height.
    fn exceeds(&self, diamond: Diamond, tolerance: f32) -> bool {
        let (ax, ay) = diamond.apex;
        [diamond.apex, (-ax, -ay)].into_iter().any(|apex| self.half_exceeds(Diamond { apex, ..diamond }, tolerance))
    }

    fn half_exceeds(&self, diamond: Diamond, tolerance: f32) -> bool {
        let Diamond { middle: (x, y), end: (ex, ey), apex: (ax, ay) } = diamond;
        let Some(top) = self.height(x + ax, y + ay) else { return false };
        let (Some(first), Some(last)) = (self.height(x - ex, y - ey), self.height(x + ex, y + ey)) else {
            return false;
        };
        let (mean, slope, rise) = (0.5 * (first + last), 0.5 * (last - first), top - 0.5 * (first + last));
        let norm = ex * ex + ey * ey;
        let reach = ex.abs().max(ey.abs()).max(ax.abs()).max(ay.abs());
        let is_void = top.is_nan();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (along, up) = (dx * ex + dy * ey, dx * ax + dy * ay);
                if up < 0 || along.abs() + up > norm {
                    continue;
                }
                let Some(height) = self.height(x + dx, y + dy) else { continue };
                if is_void {
                    // The hypotenuse belongs to the other triangle, too.
                    if up > 0 && !height.is_nan() {
                        return true;
                    }
                    continue;
                }
                let flat = mean + slope * (along as f32 / norm as f32) + rise * (up as f32 / norm as f32);
                let is_near = (height - flat).abs() <= tolerance;
                if !is_near {
                    return true;
                }
            }
        }
        false
    }
}

/// Returns the diamond of a vertex that lies in the middle of a side of a square of `2 * half`.
fn edge_diamond(x: i64, y: i64, half: i64) -> Option<Diamond> {
    match ((x / half) % 2, (y / half) % 2) {
        (1, 0) => Some(Diamond { middle: (x, y), end: (half, 0), apex: (0, half) }),
        (0, 1) => Some(Diamond { middle: (x, y), end: (0, half), apex: (half, 0) }),
        _ => None,
    }
}

/// Returns the diamond of a vertex in the middle of a square of `2 * half`.
fn square_diamond(x: i64, y: i64, half: i64) -> Option<Diamond> {
    let (column, row) = (x / half, y / half);
    if column % 2 == 0 || row % 2 == 0 {
        return None;
    }
    // Towards the middle of the square that is twice as large.
    let falls = (column / 2 + row / 2) % 2 == 0;
    let (end, apex) = if falls { ((half, half), (half, -half)) } else { ((half, -half), (half, half)) };
    Some(Diamond { middle: (x, y), end, apex })
}

/// The triangles of a tile as they are made.
struct TileBuilder<'a> {
    mesh: &'a AdaptiveMesh<'a>,
    /// Numbers of the vertices that have one, by their place in the tile.
    numbers: Vec<u32>,
    left: i64,
    top: i64,
    made: TileTriangles,
}

impl TileBuilder<'_> {
    /// Splits a triangle (both ends of the hypotenuse, right angle) as far as its vertices ask, and
    /// adds what is left.
    fn split(&mut self, triangle: [(i64, i64); 3]) {
        let [a, b, c] = triangle;
        let sum = (a.0 + b.0, a.1 + b.1);
        if sum.0 % 2 == 0 && sum.1 % 2 == 0 {
            let middle = (sum.0 / 2, sum.1 / 2);
            if self.mesh.is_needed(middle.0, middle.1) {
                self.split([c, a, middle]);
                self.split([b, c, middle]);
                return;
            }
        }
        if triangle.iter().all(|&(x, y)| self.mesh.height(x, y).is_some_and(|height| !height.is_nan())) {
            let corners = triangle.map(|place| self.number(place));
            self.made.triangles.push(corners);
        }
    }

    fn number(&mut self, (x, y): (i64, i64)) -> u32 {
        let place = ((y - self.top) * (self.mesh.tile as i64 + 1) + x - self.left) as usize;
        if self.numbers[place] == u32::MAX {
            self.numbers[place] = self.made.vertices.len() as u32;
            self.made.vertices.push((x as u32, y as u32));
        }
        self.numbers[place]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hills with a step, a void and noise, on a grid that is no whole number of tiles.
    fn field() -> Grid<f32> {
        let cell = |i: usize| {
            let (x, y) = ((i % 150) as f32, (i / 150) as f32);
            let hills = 5.0 * (x / 17.0).sin() + 3.0 * (y / 11.0).cos();
            let step = if x > 60.0 && x < 90.0 && y > 20.0 && y < 50.0 { 8.0 } else { 0.0 };
            if (x - 30.0).hypot(y - 60.0) < 9.0 { f32::NAN } else { hills + step }
        };
        Grid::from_vec(150, 90, (0..150 * 90).map(cell).collect()).unwrap()
    }

    /// Every cell is covered once, within the tolerance, and neighbouring triangles share edges.
    #[test]
    fn triangles_cover_all_cells_within_the_tolerance() {
        let field = field();
        let mut before = usize::MAX;
        for tolerance in [0.0, 0.1, 1.0] {
            let mesh = AdaptiveMesh::new(&field, 64, tolerance);
            assert_eq!(mesh.tiles(), (3, 2));
            let (mut count, mut area) = (0, 0);
            let mut sides = std::collections::BTreeMap::new();
            for tile in 0..6 {
                let TileTriangles { vertices, triangles } = mesh.triangles(tile % 3, tile / 3);
                count += triangles.len();
                for corners in triangles {
                    let at = corners.map(|i| vertices[i as usize]);
                    let [a, b, c] = at.map(|(x, y)| (f64::from(x), f64::from(y)));
                    let twice = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
                    assert!(twice < 0.0, "rows downwards: counter-clockwise is negative");
                    area += -twice as i64;
                    for k in 0..3 {
                        *sides.entry((at[k], at[(k + 1) % 3])).or_insert(0) += 1;
                    }
                    let z = at.map(|(x, y)| f64::from(field[(x as usize, y as usize)]));
                    check_inside([a, b, c], z, twice, &field, f64::from(tolerance) + 1e-4);
                }
            }
            // A side belongs to two triangles, once in each direction, or to the border.
            let open: Vec<_> = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).collect();
            assert!(sides.values().all(|n| *n == 1));
            let border = |p: (u32, u32)| p.0 == 0 || p.1 == 0 || p.0 == 149 || p.1 == 89;
            let rim = |p: (u32, u32)| (f64::from(p.0) - 30.0).hypot(f64::from(p.1) - 60.0) < 11.5;
            assert!(
                open.iter().all(|(a, b)| (border(*a) && border(*b)) || (rim(*a) && rim(*b))),
                "cracks at {tolerance}"
            );
            let whole = (0..149 * 89).filter(|i| {
                let (x, y) = (i % 149, i / 149);
                [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].iter().all(|&p| !field[p].is_nan())
            });
            assert!(area >= 2 * whole.count() as i64);
            assert!(count < before);
            before = count;
        }
        assert!(before < 4000, "{before} triangles");
    }

    fn check_inside(at: [(f64, f64); 3], z: [f64; 3], twice: f64, field: &Grid<f32>, tolerance: f64) {
        let bound = |pick: fn(&(f64, f64)) -> f64| {
            let all = at.iter().map(pick);
            (all.clone().fold(f64::INFINITY, f64::min) as usize, all.fold(0.0, f64::max) as usize)
        };
        let ((left, right), (top, bottom)) = (bound(|p| p.0), bound(|p| p.1));
        for y in top..=bottom {
            for x in left..=right {
                let p = (x as f64, y as f64);
                let part =
                    |a: (f64, f64), b: (f64, f64)| ((b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0)) / twice;
                let w = [part(at[1], at[2]), part(at[2], at[0]), part(at[0], at[1])];
                if w.iter().all(|w| *w >= -1e-9) {
                    let flat = w[0] * z[0] + w[1] * z[1] + w[2] * z[2];
                    assert!((flat - f64::from(field[(x, y)])).abs() <= tolerance, "{at:?} at {p:?}");
                }
            }
        }
    }

    #[test]
    fn a_plane_is_two_triangles_and_a_void_is_none() {
        let plane = Grid::from_vec(65, 65, (0..65 * 65).map(|i| (i % 65) as f32 * 0.5 - (i / 65) as f32).collect());
        let plane = plane.unwrap();
        let mesh = AdaptiveMesh::new(&plane, 64, 1e-3);
        assert_eq!((mesh.triangles(0, 0).triangles.len(), mesh.triangles(0, 0).vertices.len()), (2, 4));
        let void = Grid::filled(65, 65, f32::NAN);
        assert!(AdaptiveMesh::new(&void, 64, 1.0).triangles(0, 0).triangles.is_empty());
    }
}
