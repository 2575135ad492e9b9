//! Registration of one surface with another on the same cells: the translation with the least NMAD,
//! found from coarse to fine, and how well the relief tells it.
//!
//! Both surfaces are averaged by two until the search spans a few cells only. All whole-cell shifts
//! are tried there, and on each finer level those around the best few. The end is refined as in
//! [`crate::evaluate`]. This takes a small part of the time of an exhaustive search.
//!
//! How well the relief tells the shift follows from the data: the parts of the scene find their own
//! shifts, and the standard error of their mean is that of the whole. Where the relief of both
//! surfaces is not the same, the parts find shifts all over their search.

use std::ops::Range;

use numeric::{upper_median, upper_nmad};
use raster::{Grid, reduce};
use rayon::prelude::*;

use crate::alignment::align::{MetresFromCells, Shift};
use crate::alignment::cell_map::CellMap;
use crate::alignment::resample::bilinear;
use crate::alignment::search::{Candidate, FINALISTS, Measure, Search, at_edge, contrast};
use crate::error::EvalError;

/// Surfaces are averaged until the search has a radius of at most this many cells.
const RADIUS_CELLS: f64 = 8.0;
/// Smallest side of a surface that is averaged once more, cells: enough relief for a shift.
const SIDE_MIN: usize = 64;
/// Whole-cell shifts around each of the best ones that are tried on the next finer level, cells to
/// each side: the best of a coarse level is right to half a coarse cell, which is one fine one.
const AROUND: i32 = 2;
/// Cells at which whole-cell shifts are compared: the NMAD of so many is known to two percent, and
/// shifts by a cell differ by more.
const CELLS: usize = 8_000;
/// Positions at which the last refinement compares the surfaces. The NMAD of so many is known to
/// half a percent.
const POSITIONS: usize = 60_000;
/// The scene is divided into this many parts along each side. The spread of nine is known to a
/// quarter.
const PARTS: usize = 3;
/// Cells and positions at which the surfaces are compared in a part.
const PART_CELLS: usize = 3_000;
const PART_POSITIONS: usize = 6_000;
/// Radius within which a part looks for its own shift, cells. Shifts that are scattered over it
/// have a standard error of two cells along each axis.
const PART_RADIUS_CELLS: usize = 12;
/// Cells of the test that are kept around a part, so that every shift has the same cells of the
/// reference.
const RIM: usize = PART_RADIUS_CELLS + 2;

/// The shift of a surface onto another one.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// Translation to add to the test surface.
    pub shift: Shift,
    /// Standard errors of the shift along x, y and z, metres, from the shifts that the parts of the
    /// scene find; `None` where fewer than three parts hold heights of both surfaces.
    pub deviation_m: Option<[f64; 3]>,
    /// NMAD of the differences without and with the shift, metres.
    pub nmad_m: (f64, f64),
    /// Median NMAD of all coarse shifts divided by the least: near 1 there is no relief that both
    /// surfaces share.
    pub contrast: f64,
    /// Whether the best shift lies at the edge of the search.
    pub is_at_edge: bool,
    /// Test − reference with the shift, metres; NaN where either is void.
    pub errors: Grid<f32>,
}

/// Finds the translation that brings `test` onto `reference`, two surfaces on the same cells.
///
/// ```
/// use eval::{MetresFromCells, register_surfaces};
/// use raster::{GeoTransform, Grid};
///
/// let relief = |c: f64, r: f64| (20.0 * (0.05 * c).sin() + 15.0 * (0.07 * r).cos()) as f32;
/// let surface = |dx: f64| {
///     let cells = (0..160 * 160).map(|i| relief(f64::from(i % 160) - dx, f64::from(i / 160)));
///     Grid::from_vec(160, 160, cells.collect()).unwrap()
/// };
/// let metres = MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 0.5), (1.0, 1.0));
/// let found = register_surfaces(&surface(0.0), &surface(12.0), metres, 15.0)?;
/// assert!((found.shift.dx_m - 6.0).abs() < 0.1 && found.shift.dy_m.abs() < 0.1);
/// # Ok::<(), eval::EvalError>(())
/// ```
///
/// # Errors
/// [`EvalError`] if the surfaces share too few cells, or the search is too wide.
pub fn register_surfaces(
    test: &Grid<f32>,
    reference: &Grid<f32>,
    metres_from_cells: MetresFromCells,
    search_m: f64,
) -> Result<Registration, EvalError> {
    let levels = Levels::new(test, reference, metres_from_cells, search_m, Measure::Nmad);
    let (start, coarse) = levels.search(search_m, CELLS)?;
    let finest = levels.at(0);
    let steps = around(&[start]);
    let (_, best) = finest.finest(&steps, &[start], POSITIONS);
    let cells = [best.columns, best.rows];
    let mut errors = differences(test, reference, |_, _| cells);
    let offset = upper_median(&mut finite(&errors)).ok_or(EvalError::NoOverlap {
        reference_cells: reference.data().iter().filter(|height| height.is_finite()).count(),
    })?;
    errors.data_mut().iter_mut().for_each(|error| *error -= offset as f32);
    let nmad = |errors: &Grid<f32>| upper_nmad(&mut finite(errors)).unwrap_or(f64::NAN);
    let nmad_m = (nmad(&differences(test, reference, |_, _| [0.0; 2])), nmad(&errors));
    let (dx_m, dy_m) = metres_from_cells.apply(cells[0], cells[1]);
    Ok(Registration {
        shift: Shift { dx_m, dy_m, dz_m: -offset },
        deviation_m: Parts::of(&errors).deviation_m(test, reference, metres_from_cells, cells),
        nmad_m,
        contrast: coarse.contrast,
        is_at_edge: coarse.is_at_edge || dx_m.hypot(dy_m) > search_m,
        errors,
    })
}

/// What the coarsest level shows.
struct Coarse {
    contrast: f64,
    is_at_edge: bool,
}

/// Both surfaces, averaged by two from level to level.
struct Levels {
    surfaces: Vec<[Grid<f32>; 2]>,
    cells: CellMap,
    metres: MetresFromCells,
    measure: Measure,
}

impl Levels {
    fn new(test: &Grid<f32>, reference: &Grid<f32>, metres: MetresFromCells, search_m: f64, measure: Measure) -> Self {
        let mut surfaces = vec![[test.clone(), reference.clone()]];
        let (along_columns, along_rows) = metres.cell_size_m();
        let mut radius = search_m / along_columns.min(along_rows);
        while let Some(last) = surfaces.last().filter(|last| last[0].width().min(last[0].height()) >= 2 * SIDE_MIN)
            && radius > RADIUS_CELLS
        {
            let next = last.each_ref().map(reduce);
            surfaces.push(next);
            radius *= 0.5;
        }
        Self { surfaces, cells: CellMap::identity(), metres, measure }
    }

    fn at(&self, level: usize) -> Search<'_> {
        let [test, reference] = &self.surfaces[level];
        let metres_from_cells = self.metres.scaled((level as f64).exp2());
        Search { reference, test, test_from_reference: &self.cells, metres_from_cells, measure: self.measure }
    }

    /// Returns the best whole-cell shift of the finest level.
    fn search(&self, search_m: f64, count: usize) -> Result<(Candidate, Coarse), EvalError> {
        let coarsest = self.surfaces.len() - 1;
        let search = self.at(coarsest);
        let steps = search.steps(search_m)?;
        let mut ranked = search.try_steps(&steps, count)?;
        let coarse = Coarse { contrast: contrast(&ranked), is_at_edge: at_edge(&steps, ranked[0]) };
        for level in (0..coarsest).rev() {
            ranked.truncate(FINALISTS);
            let doubled = |best: &Candidate| Candidate { columns: 2.0 * best.columns, rows: 2.0 * best.rows, ..*best };
            let best: Vec<Candidate> = ranked.iter().map(doubled).collect();
            ranked = self.at(level).try_steps(&around(&best), count)?;
        }
        Ok((ranked[0], coarse))
    }
}

/// Returns the whole-cell shifts around some, each once.
fn around(best: &[Candidate]) -> Vec<(i32, i32)> {
    let beside = |best: &Candidate| {
        let (columns, rows) = (best.columns.round() as i32, best.rows.round() as i32);
        (-AROUND..=AROUND).flat_map(move |r| (-AROUND..=AROUND).map(move |c| (columns + c, rows + r)))
    };
    let all: std::collections::BTreeSet<(i32, i32)> = best.iter().flat_map(beside).collect();
    all.into_iter().collect()
}

/// The parts of a scene, over the cells that both surfaces have.
struct Parts<'a> {
    errors: &'a Grid<f32>,
    /// First and last cell but one of the columns and of the rows.
    span: [[usize; 2]; 2],
}

impl<'a> Parts<'a> {
    fn of(errors: &'a Grid<f32>) -> Self {
        let mut span = [[usize::MAX, 0]; 2];
        for (i, _) in errors.data().iter().enumerate().filter(|(_, error)| error.is_finite()) {
            for (span, at) in span.iter_mut().zip([i % errors.width(), i / errors.width()]) {
                *span = [span[0].min(at), span[1].max(at + 1)];
            }
        }
        Self { errors, span }
    }

    /// Returns the columns and the rows of a part.
    fn bounds(&self, part: usize) -> [Range<usize>; 2] {
        let bound = |[first, end]: [usize; 2], k: usize| first + k * end.saturating_sub(first) / PARTS;
        [(self.span[0], part % PARTS), (self.span[1], part / PARTS)].map(|(span, k)| bound(span, k)..bound(span, k + 1))
    }

    /// Returns the standard errors of the shift that brings the surfaces together.
    fn deviation_m(
        &self,
        test: &Grid<f32>,
        reference: &Grid<f32>,
        metres: MetresFromCells,
        shift: [f64; 2],
    ) -> Option<[f64; 3]> {
        let moved = shift.map(|cells| -cells.round() as isize);
        let part = |k: usize| {
            let bounds = self.bounds(k);
            let inside = cut(self.errors, &bounds, [0; 2], 0);
            let up = upper_median(&mut finite(&inside))?;
            let reference = cut(reference, &bounds, [0; 2], RIM);
            let test = cut(test, &grown(&bounds, RIM), moved.map(|cells| cells - RIM as isize), 0);
            let [columns, rows] = own_shift(&test, &reference, metres, PART_RADIUS_CELLS, Measure::Nmad)?;
            let (x, y) = metres.apply(columns, rows);
            Some([x, y, up])
        };
        let found: Vec<[f64; 3]> = (0..PARTS * PARTS).into_par_iter().filter_map(part).collect();
        let along = |axis: usize| standard_error(&found.iter().map(|shift| shift[axis]).collect::<Vec<f64>>());
        (found.len() >= PARTS).then(|| [0, 1, 2].map(along))
    }
}

/// Returns the shift of a small surface within some cells, columns and rows.
pub(super) fn own_shift(
    test: &Grid<f32>,
    reference: &Grid<f32>,
    metres: MetresFromCells,
    radius_cells: usize,
    measure: Measure,
) -> Option<[f64; 2]> {
    let (along_columns, along_rows) = metres.cell_size_m();
    let radius_m = radius_cells as f64 * along_columns.max(along_rows);
    let own = Levels::new(test, reference, metres, radius_m, measure);
    let (start, _) = own.search(radius_m, PART_CELLS).ok()?;
    let (_, best) = own.at(0).finest(&around(&[start]), &[start], PART_POSITIONS);
    Some([best.columns, best.rows])
}

/// Returns the standard error of the mean of some values.
fn standard_error(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (variance / count).sqrt()
}

/// Returns bounds that reach further by a rim to each side, counted from the rim's corner.
pub(super) fn grown(bounds: &[Range<usize>; 2], rim: usize) -> [Range<usize>; 2] {
    bounds.each_ref().map(|bound| bound.start..bound.end + 2 * rim)
}

/// Cuts the cells that lie `moved` columns and rows from a part out of a grid, and puts a rim
/// without values around them.
pub(super) fn cut(grid: &Grid<f32>, [columns, rows]: &[Range<usize>; 2], moved: [isize; 2], rim: usize) -> Grid<f32> {
    let mut out = Grid::filled(columns.len() + 2 * rim, rows.len() + 2 * rim, f32::NAN);
    for (row, from) in rows.clone().enumerate() {
        let at =
            |column: usize| grid.get(column.checked_add_signed(moved[0])?, from.checked_add_signed(moved[1])?).copied();
        for (out, column) in out.row_mut(rim + row)[rim..].iter_mut().zip(columns.clone()) {
            *out = at(column).unwrap_or(f32::NAN);
        }
    }
    out
}

/// Returns test − reference, the test moved by the columns and rows that `shift` gives for a column
/// and a row; NaN where either is void.
pub(super) fn differences(
    test: &Grid<f32>,
    reference: &Grid<f32>,
    shift: impl Fn(f64, f64) -> [f64; 2] + Sync,
) -> Grid<f32> {
    let mut out = Grid::filled(reference.width(), reference.height(), f32::NAN);
    let width = reference.width().max(1);
    out.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for ((column, out), height) in out.iter_mut().enumerate().zip(reference.row(row)) {
            let (column, row) = (column as f64, row as f64);
            let [columns, rows] = shift(column, row);
            let moved = bilinear(test, column - columns, row - rows);
            *out = moved.map_or(f32::NAN, |moved| (moved - f64::from(*height)) as f32);
        }
    });
    out
}

pub(super) fn finite(errors: &Grid<f32>) -> Vec<f64> {
    errors.data().iter().filter(|error| error.is_finite()).map(|error| f64::from(*error)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::random::{hash64, unit_interval};
    use raster::GeoTransform;

    fn metres() -> MetresFromCells {
        MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 0.5), (1.0, 1.0))
    }

    /// Blocks of random heights, each `side` cells wide, moved by some cells, with noise.
    fn blocks(seed: u64, side: f64, [dx, dy]: [f64; 2]) -> Grid<f32> {
        const SIZE: usize = 180;
        let height = |i: usize| {
            let [x, y] = [(i % SIZE) as f64 - dx, (i / SIZE) as f64 - dy].map(|at| (at / side).floor() as i64 as u64);
            let noise = unit_interval(hash64((i as u64) << 8 ^ seed ^ (dx.to_bits() >> 40)));
            (noise + 12.0 * unit_interval(hash64(seed ^ hash64(x.wrapping_mul(8191) ^ hash64(y))))) as f32
        };
        Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(height).collect()).unwrap()
    }

    #[test]
    fn a_shift_is_found_with_its_error_and_another_place_has_none() {
        let (reference, moved) = (blocks(1, 17.0, [0.0; 2]), blocks(1, 17.0, [30.0, -22.0]));
        let found = register_surfaces(&moved, &reference, metres(), 25.0).unwrap();
        // A row down is a step south.
        let off = [found.shift.dx_m + 15.0, found.shift.dy_m + 11.0];
        assert!(off.iter().all(|off| off.abs() < 0.1), "{:?}", found.shift);
        let [dx, dy, dz] = found.deviation_m.unwrap();
        assert!(dx.max(dy).max(dz) < 0.1 && found.contrast > 2.0 && !found.is_at_edge, "{found:?}");
        let foreign = register_surfaces(&blocks(2, 17.0, [0.0; 2]), &reference, metres(), 25.0).unwrap();
        let [dx, dy, _] = foreign.deviation_m.unwrap();
        assert!(dx.hypot(dy) > 0.5 && foreign.contrast < 1.5, "{dx} {dy} {}", foreign.contrast);
    }

    #[test]
    fn a_shift_beyond_the_search_is_at_its_edge() {
        let (reference, moved) = (blocks(1, 90.0, [0.0; 2]), blocks(1, 90.0, [60.0, 0.0]));
        assert!(register_surfaces(&moved, &reference, metres(), 20.0).unwrap().is_at_edge);
        let void = reference.map(|_| f32::NAN);
        assert!(matches!(register_surfaces(&void, &reference, metres(), 5.0), Err(EvalError::NoOverlap { .. })));
    }
}
