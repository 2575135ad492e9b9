//! Map from the cells of the reference grid to the cells of another grid.
//!
//! In one coordinate system this is an affine map. Between two systems, the exact projection is
//! evaluated at the nodes of a lattice and interpolated bilinearly. The lattice is refined until
//! the interpolation at the centres of its meshes is within [`TOLERANCE_CELLS`] of the exact
//! projection.

use crate::error::EvalError;
use raster::{GeoTransform, Grid};

/// Largest interpolation error of a projected map, in cells of the other grid.
const TOLERANCE_CELLS: f64 = 1e-3;

/// First distance of the lattice nodes, in reference cells.
const WIDEST_SPACING: usize = 16;

/// Map from fractional cells of the reference to cells of another grid.
#[derive(Debug, Clone)]
pub struct CellMap(Kind);

#[derive(Debug, Clone)]
enum Kind {
    Affine([f64; 6]),
    Lattice(Lattice),
}

/// Lattice of positions in the other grid. Node (i, j) stands at the reference cell (i, j) ·
/// spacing − margin.
#[derive(Debug, Clone)]
struct Lattice {
    nodes: Grid<[f64; 2]>,
    spacing: f64,
    margin: f64,
}

impl CellMap {
    /// Returns the map of a grid onto itself.
    ///
    /// ```
    /// assert_eq!(eval::CellMap::identity().position(3.0, 4.5), (3.0, 4.5));
    /// ```
    pub const fn identity() -> Self {
        Self(Kind::Affine([0.0, 1.0, 0.0, 0.0, 0.0, 1.0]))
    }

    /// Returns the map between two grids in the same coordinate system.
    ///
    /// # Errors
    /// [`EvalError::SingularGeotransform`] if the cells of either grid have no area.
    pub fn affine(reference: &GeoTransform, other: &GeoTransform) -> Result<Self, EvalError> {
        check(reference)?;
        check(other)?;
        let (x, y) = reference.map_from_cell(0.0, 0.0);
        let origin = other.cell_from_map(x, y).ok_or(EvalError::SingularGeotransform(other.0))?;
        let (r, o) = (&reference.0, &other.0);
        let det = o[1] * o[5] - o[2] * o[4];
        // One step in the reference, in cells of the other grid. It avoids the rounding of large
        // map coordinates.
        let step = |dx: f64, dy: f64| ((dx * o[5] - dy * o[2]) / det, (dy * o[1] - dx * o[4]) / det);
        let (right, down) = (step(r[1], r[4]), step(r[2], r[5]));
        Ok(Self(Kind::Affine([origin.0, right.0, down.0, origin.1, right.1, down.1])))
    }

    /// Returns the map between grids in two coordinate systems. `other_from_reference` projects map
    /// coordinates.
    ///
    /// `size` is the reference's (columns, rows). The map also holds `margin` cells beyond the
    /// reference: set it to the radius of a later search, in cells. Positions where the projection
    /// returns `None` are NaN.
    ///
    /// # Errors
    /// [`EvalError::SingularGeotransform`] if the cells of either grid have no area.
    pub fn projected(
        reference: &GeoTransform,
        other: &GeoTransform,
        size: (usize, usize),
        margin: usize,
        mut other_from_reference: impl FnMut(f64, f64) -> Option<(f64, f64)>,
    ) -> Result<Self, EvalError> {
        check(reference)?;
        check(other)?;
        let mut exact = |column: f64, row: f64| {
            let (x, y) = reference.map_from_cell(column, row);
            let (x, y) = other_from_reference(x, y)?;
            other.cell_from_map(x, y)
        };
        let mut spacing = WIDEST_SPACING;
        loop {
            let lattice = Lattice::of(size, margin, spacing, &mut exact);
            if spacing == 1 || lattice.worst_error(&mut exact) < TOLERANCE_CELLS {
                return Ok(Self(Kind::Lattice(lattice)));
            }
            spacing /= 2;
        }
    }

    /// Returns the cell of the other grid under a cell of the reference, or NaN if there is none.
    pub fn position(&self, column: f64, row: f64) -> (f64, f64) {
        match &self.0 {
            Kind::Affine(c) => (c[0] + column * c[1] + row * c[2], c[3] + column * c[4] + row * c[5]),
            Kind::Lattice(lattice) => lattice.position(column, row),
        }
    }
}

impl Lattice {
    fn of(
        size: (usize, usize),
        margin: usize,
        spacing: usize,
        exact: &mut impl FnMut(f64, f64) -> Option<(f64, f64)>,
    ) -> Self {
        let count = |cells: usize| (cells + 2 * margin).div_ceil(spacing) + 1;
        let (columns, rows) = (count(size.0), count(size.1));
        let at = |i: usize| (i * spacing) as f64 - margin as f64;
        let mut nodes = Grid::filled(columns, rows, [f64::NAN; 2]);
        for j in 0..rows {
            for (i, node) in nodes.row_mut(j).iter_mut().enumerate() {
                *node = exact(at(i), at(j)).map_or([f64::NAN; 2], |(column, row)| [column, row]);
            }
        }
        Self { nodes, spacing: spacing as f64, margin: margin as f64 }
    }

    fn position(&self, column: f64, row: f64) -> (f64, f64) {
        let (x, y) = ((column + self.margin) / self.spacing, (row + self.margin) / self.spacing);
        let last = |count: usize| (count.max(2) - 2) as f64;
        // Outside the lattice, the nearest mesh is extrapolated.
        let (i, j) = (x.floor().clamp(0.0, last(self.nodes.width())), y.floor().clamp(0.0, last(self.nodes.height())));
        let (u, v) = (x - i, y - j);
        let node =
            |di: usize, dj: usize| self.nodes.get(i as usize + di, j as usize + dj).copied().unwrap_or([f64::NAN; 2]);
        let (n00, n10, n01, n11) = (node(0, 0), node(1, 0), node(0, 1), node(1, 1));
        let mix = |k: usize| {
            let (top, low) = (n00[k] + u * (n10[k] - n00[k]), n01[k] + u * (n11[k] - n01[k]));
            top + v * (low - top)
        };
        (mix(0), mix(1))
    }

    /// Returns the largest error at the centres of the meshes, where bilinear interpolation is
    /// worst.
    fn worst_error(&self, exact: &mut impl FnMut(f64, f64) -> Option<(f64, f64)>) -> f64 {
        let mut worst = 0.0f64;
        for j in 0..self.nodes.height() - 1 {
            for i in 0..self.nodes.width() - 1 {
                let centre = |k: usize| (k as f64 + 0.5) * self.spacing - self.margin;
                let (column, row) = (centre(i), centre(j));
                let (found, true_position) = (self.position(column, row), exact(column, row));
                if let Some((x, y)) = true_position {
                    let error = (found.0 - x).hypot(found.1 - y);
                    // One corner of the mesh has no projection although its centre has one. Only a
                    // finer lattice can separate them.
                    worst = worst.max(if error.is_nan() { f64::INFINITY } else { error });
                }
            }
        }
        worst
    }
}

fn check(geotransform: &GeoTransform) -> Result<(), EvalError> {
    let c = &geotransform.0;
    let det = c[1] * c[5] - c[2] * c[4];
    let usable = c.iter().all(|value| value.is_finite()) && det.is_finite() && det != 0.0;
    if usable { Ok(()) } else { Err(EvalError::SingularGeotransform(*c)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_grid_maps_onto_itself_exactly_at_utm_coordinates() {
        let grid = GeoTransform::north_up(436_078.995_946, 3_357_751.999_923, 0.5);
        let map = CellMap::affine(&grid, &grid).unwrap();
        let (column, row) = map.position(1999.0, 1500.0);
        assert!((column - 1999.0).abs() < 1e-8 && (row - 1500.0).abs() < 1e-8, "{column}, {row}");
    }

    #[test]
    fn a_geotransform_without_area_is_refused() {
        let good = GeoTransform::north_up(0.0, 0.0, 1.0);
        for bad in [[0.0; 6], [0.0, 1.0, 1.0, 0.0, 1.0, 1.0], [f64::NAN, 1.0, 0.0, 0.0, 0.0, -1.0]] {
            let error = CellMap::affine(&good, &GeoTransform(bad)).unwrap_err();
            assert!(error.to_string().contains("cannot be inverted"), "{error}");
            assert!(CellMap::projected(&GeoTransform(bad), &good, (4, 4), 1, |x, y| Some((x, y))).is_err());
        }
    }

    #[test]
    fn a_curved_projection_refines_the_lattice() {
        let grid = GeoTransform::north_up(0.0, 0.0, 1.0);
        let curved = |x: f64, y: f64| Some((x + 1e-3 * x * x, y + 2e-4 * x * y));
        let map = CellMap::projected(&grid, &grid, (100, 80), 5, curved).unwrap();
        for (column, row) in [(0.3, 0.7), (50.5, 41.2), (99.0, 79.0), (-4.0, 82.0)] {
            let (x, y) = grid.map_from_cell(column, row);
            let (x, y) = curved(x, y).unwrap();
            let expected = grid.cell_from_map(x, y).unwrap();
            let found = map.position(column, row);
            assert!(
                (found.0 - expected.0).hypot(found.1 - expected.1) < 2e-3,
                "at {column}, {row}: {found:?} {expected:?}"
            );
        }
    }

    #[test]
    fn a_place_without_a_projection_has_no_position() {
        let grid = GeoTransform::north_up(0.0, 0.0, 1.0);
        let map = CellMap::projected(&grid, &grid, (40, 40), 0, |x, y| (x < 20.0).then_some((x, y))).unwrap();
        assert!(map.position(5.0, 5.0).0.is_finite());
        assert!(map.position(35.0, 5.0).0.is_nan());
    }

    proptest! {
        #[test]
        fn the_lattice_agrees_with_the_affine_map(
            x in -50.0..50.0f64, y in -50.0..50.0f64, cell in 0.2..3.0f64,
            column in -10.0..70.0f64, row in -10.0..60.0f64,
        ) {
            let (a, b) = (GeoTransform::north_up(0.0, 0.0, 0.5), GeoTransform::north_up(x, y, cell));
            let affine = CellMap::affine(&a, &b).unwrap().position(column, row);
            let lattice = CellMap::projected(&a, &b, (60, 50), 10, |x, y| Some((x, y))).unwrap().position(column, row);
            prop_assert!((affine.0 - lattice.0).hypot(affine.1 - lattice.1) < 1e-7);
        }
    }
}
