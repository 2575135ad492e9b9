//! Layers of the test follow the shift that the alignment finds, change no other number, and must
//! fit their grids.

use eval::{AlignmentMethod, CellMap, CellOrigin, EvalConfig, EvalError, EvalInput, MetresFromCells, evaluate};
use raster::{GeoTransform, Grid};

const SIZE: usize = 90;
/// Columns and rows by which the test lies off the reference.
const SHIFT: (i64, i64) = (3, -2);

fn surface(column: i64, row: i64) -> f32 {
    let is_house = column.rem_euclid(23) < 11 && row.rem_euclid(29) < 13;
    // Rolling ground, so that the best shift is the planted one.
    let rolling = (column as f32 / 5.0).sin() + 0.8 * (row as f32 / 4.0).cos();
    40.0 + 0.02 * column as f32 + rolling + if is_house { 7.0 } else { 0.0 }
}

fn grid<T>(cell: impl Fn(i64, i64) -> T) -> Grid<T> {
    let cells = (0..SIZE * SIZE).map(|i| cell((i % SIZE) as i64, (i / SIZE) as i64)).collect();
    Grid::from_vec(SIZE, SIZE, cells).unwrap()
}

/// Whether the reference cell that a cell of the test shows is filled.
fn is_filled(column: i64, row: i64) -> bool {
    column + SHIFT.0 < 20 && row + SHIFT.1 > 30
}

#[test]
fn layers_are_read_where_the_alignment_puts_the_test() {
    let geotransform = GeoTransform::north_up(0.0, 0.0, 0.5);
    let metres = MetresFromCells::new(&geotransform, (1.0, 1.0));
    let map = CellMap::identity();
    let reference = grid(surface);
    let error = |column, row| if is_filled(column, row) { 3.0 } else { 0.0 };
    let test = grid(|column, row| surface(column + SHIFT.0, row + SHIFT.1) + error(column, row));
    let origins = grid(|c, r| if is_filled(c, r) { CellOrigin::Filled } else { CellOrigin::Observed });
    let sigma = grid(|c, r| if is_filled(c, r) { 4.0 } else { 0.5 });
    let confidence = grid(|c, r| if is_filled(c, r) { 0.15 } else { 0.85 });
    let plain = EvalInput::new(&test, &reference, &map, metres);
    let input = EvalInput { origins: Some(&origins), sigma_m: Some(&sigma), confidence: Some(&confidence), ..plain };
    let config = EvalConfig { alignment: AlignmentMethod::Xyz, ..EvalConfig::default() };
    let (alone, found) = (evaluate(&plain, &config).unwrap(), evaluate(&input, &config).unwrap());
    assert!(alone.origins.is_none() && alone.sigma.is_none() && alone.reliability.is_none() && alone.objects.is_none());
    assert_eq!((&alone.overall, &alone.edges, alone.sharpness), (&found.overall, &found.edges, found.sharpness));
    let split = found.origins.unwrap();
    let mae = |metrics: &eval::Metrics| metrics.errors.unwrap().mae;
    assert!(mae(&split.observed.overall) < 0.01, "{:?}", split.observed.overall);
    assert!((mae(&split.filled.overall) - 3.0).abs() < 0.01, "{:?}", split.filled.overall);
    assert_eq!(split.observed.overall.n + split.filled.overall.n, found.overall.n);
    assert_eq!(split.unknown_cells, 0);
    let sigma = found.sigma.unwrap();
    assert_eq!((sigma.observed.unwrap().below_1_sigma, sigma.filled.unwrap().below_1_sigma), (1.0, 1.0));
    let tenths = found.reliability.unwrap().tenths;
    assert_eq!((tenths[1].right, tenths[8].right), (Some(0.0), Some(1.0)));
}

#[test]
fn layers_of_another_size_are_named() {
    let metres = MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 0.5), (1.0, 1.0));
    let (reference, map) = (grid(surface), CellMap::identity());
    let input = EvalInput::new(&reference, &reference, &map, metres);
    let config = EvalConfig { alignment: AlignmentMethod::None, ..EvalConfig::default() };
    let (sigma, origins, numbers) =
        (Grid::filled(3, 3, 1.0f32), Grid::filled(3, 3, CellOrigin::Observed), Grid::filled(3, 3, Some(1)));
    for (wrong, named) in [
        (EvalInput { sigma_m: Some(&sigma), ..input }, "standard deviation"),
        (EvalInput { origins: Some(&origins), ..input }, "origin"),
        (EvalInput { objects: Some(&numbers), ..input }, "building"),
    ] {
        let error = evaluate(&wrong, &config).unwrap_err();
        assert!(matches!(error, EvalError::Shape { what, .. } if what == named), "{error}");
    }
    let never = EvalConfig { right_below_m: 0.0, ..config };
    assert!(matches!(evaluate(&input, &never), Err(EvalError::NotPositive { .. })));
}
