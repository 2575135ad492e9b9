//! The shift between two surfaces is found, whatever their noise, gross errors and voids.

use eval::{AlignmentMethod, CellMap, EvalConfig, EvalError, EvalInput, Evaluation, MetresFromCells, evaluate};
use proptest::prelude::*;
use raster::{GeoTransform, Grid};

const CELL_M: f64 = 0.5;

/// Returns the height of a town: rolling ground, and a house with a pitched roof on every square of
/// 17 m. The town is askew to the axes, because edges along the cells would all be sampled at the
/// same phase.
fn town(x: f64, y: f64) -> f64 {
    let ground = 20.0 + 3.0 * (x / 31.0).sin() + 2.0 * (y / 23.0).cos();
    let (x, y) = (0.956 * x + 0.292 * y, 0.956 * y - 0.292 * x);
    let (i, j) = ((x / 17.0).floor(), (y / 17.0).floor());
    let (u, v) = (x - 17.0 * i, y - 17.0 * j);
    let kind = (i * 7.0 + j * 13.0).rem_euclid(5.0);
    let inside = u > 3.0 && u < 9.0 + kind && v > 4.0 && v < 13.0 - kind / 2.0;
    ground + if inside { 4.0 + 2.0 * kind + 0.3 * (u - 3.0) } else { 0.0 }
}

/// Returns deterministic noise in (−1, 1) for a cell.
fn noise(i: usize, salt: u64) -> f64 {
    let z = (i as u64 ^ (salt << 40)).wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn sampled(width: usize, height: usize, geotransform: &GeoTransform, f: impl Fn(f64, f64, usize) -> f64) -> Grid<f32> {
    let cell = |i: usize| {
        let (x, y) = geotransform.map_from_cell((i % width) as f64, (i / width) as f64);
        f(x, y, i) as f32
    };
    Grid::from_vec(width, height, (0..width * height).map(cell).collect()).unwrap()
}

fn run(
    reference: (&Grid<f32>, &GeoTransform),
    test: (&Grid<f32>, &GeoTransform),
    alignment: AlignmentMethod,
) -> Result<Evaluation, EvalError> {
    let map = CellMap::affine(reference.1, test.1)?;
    let input = EvalInput::new(test.0, reference.0, &map, MetresFromCells::new(reference.1, (1.0, 1.0)));
    evaluate(&input, &EvalConfig { alignment, ..EvalConfig::default() })
}

/// Returns the town as a test surface to which (3.3, −2.7, 4.1) m must be added, with noise, gross
/// errors and holes.
fn displaced_test(geotransform: &GeoTransform, size: (usize, usize), noise_m: f64, hole_share: f64) -> Grid<f32> {
    sampled(size.0, size.1, geotransform, |x, y, i| {
        let gross = if noise(i, 2) > 0.9 { 12.0 * noise(i, 3) } else { 0.0 };
        let hole = if noise(i / 40, 4) * 0.5 + 0.5 < hole_share { f64::NAN } else { 0.0 };
        town(x + 3.3, y - 2.7) - 4.1 + noise_m * noise(i, 1) + gross + hole
    })
}

fn assert_planted(found: &Evaluation, tolerance_m: f64) {
    let s = found.shift;
    let error = (s.dx_m - 3.3).abs().max((s.dy_m + 2.7).abs()).max((s.dz_m - 4.1).abs());
    assert!(error <= tolerance_m, "{s:?}, {:?}", found.search);
}

#[test]
fn a_planted_shift_is_found_on_one_grid() {
    let grid = GeoTransform::north_up(436_078.996, 3_357_752.0, CELL_M);
    let reference = sampled(400, 320, &grid, |x, y, _| town(x, y));
    for (noise_m, holes) in [(0.0, 0.0), (0.1, 0.0), (0.3, 0.3), (0.6, 0.2)] {
        let test = displaced_test(&grid, (400, 320), noise_m, holes);
        let found = run((&reference, &grid), (&test, &grid), AlignmentMethod::Xyz).unwrap();
        assert_planted(&found, 0.05);
        assert!(!found.search.unwrap().at_edge);
    }
}

#[test]
fn a_planted_shift_is_found_on_another_grid() {
    let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let other = GeoTransform::north_up(-9.13, 12.71, 0.61);
    let reference = sampled(400, 320, &grid, |x, y, _| town(x, y));
    let test = displaced_test(&other, (370, 320), 0.2, 0.2);
    let found = run((&reference, &grid), (&test, &other), AlignmentMethod::Xyz).unwrap();
    assert_planted(&found, 0.05);
}

#[test]
fn a_test_surface_much_smaller_than_the_reference_is_found_too() {
    let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let small = GeoTransform::north_up(100.0, -80.0, CELL_M);
    let reference = sampled(600, 500, &grid, |x, y, _| town(x, y));
    let test = displaced_test(&small, (110, 100), 0.1, 0.1);
    assert_planted(&run((&reference, &grid), (&test, &small), AlignmentMethod::Xyz).unwrap(), 0.05);
}

#[test]
fn nuth_and_kaab_find_the_planted_shift_too() {
    let geotransform = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let reference = sampled(400, 360, &geotransform, |x, y, _| town(x, y));
    for (noise_m, hole_share) in [(0.0, 0.0), (0.2, 0.1)] {
        let test = displaced_test(&geotransform, (400, 360), noise_m, hole_share);
        let found = run((&reference, &geotransform), (&test, &geotransform), AlignmentMethod::NuthKaab).unwrap();
        assert_planted(&found, 0.05);
        assert!(found.nuth_kaab.unwrap().converged, "{:?}", found.nuth_kaab);
    }
}

/// Returns the surfaces of `reference/nuth_kaab_xdem.py`.
fn hills(x: f64, y: f64) -> f64 {
    300.0 + 25.0 * (x / 61.0).sin() * (y / 47.0).cos() + 9.0 * (x / 23.0 + y / 31.0).sin() + 0.05 * x
}

#[test]
fn nuth_and_kaab_agree_with_xdem() {
    let geotransform = GeoTransform::north_up(0.0, 0.0, 2.0);
    let reference = sampled(240, 200, &geotransform, |x, y, _| hills(x, y));
    let lines = include_str!("reference/nuth_kaab_xdem.txt").lines().filter(|line| !line.starts_with('#'));
    for line in lines {
        let n: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
        let test = sampled(240, 200, &geotransform, |x, y, _| {
            hills(x + n[0], y + n[1]) - n[2] + n[3] * (x / 17.0 + 1.0).sin() * (y / 13.0).cos()
        });
        let found = run((&reference, &geotransform), (&test, &geotransform), AlignmentMethod::NuthKaab).unwrap().shift;
        for (value, xdem) in [(found.dx_m, n[4]), (found.dy_m, n[5]), (found.dz_m, n[6])] {
            assert!((value - xdem).abs() < 0.03, "{line}: {found:?}");
        }
    }
}

#[test]
fn flat_ground_is_refused_by_nuth_and_kaab_whatever_its_noise() {
    let geotransform = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let plain = |salt| sampled(300, 300, &geotransform, |x, _, i| 10.0 + 0.01 * x + 0.2 * noise(i, salt));
    let (reference, test) = (plain(1), plain(2));
    let refused = run((&reference, &geotransform), (&test, &geotransform), AlignmentMethod::NuthKaab).unwrap_err();
    assert!(matches!(refused, EvalError::TooFlat { .. }), "{refused}");
    assert!(refused.to_string().contains("too flat"), "{refused}");
    let ramp = sampled(300, 300, &geotransform, |x, _, _| 10.0 + 0.3 * x);
    let refused = run((&ramp, &geotransform), (&ramp, &geotransform), AlignmentMethod::NuthKaab).unwrap_err();
    assert!(matches!(refused, EvalError::OneWaySlopes), "{refused}");
}

#[test]
fn a_shift_beyond_the_radius_is_reported_at_the_edge() {
    let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let reference = sampled(300, 300, &grid, |x, y, _| town(x, y));
    let test = sampled(300, 300, &grid, |x, y, _| town(x + 6.0, y));
    let found = run((&reference, &grid), (&test, &grid), AlignmentMethod::Xyz).unwrap();
    assert!(found.search.unwrap().at_edge, "{:?}", found.shift);
}

#[test]
fn flat_ground_has_no_shift_and_no_contrast() {
    let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let reference = Grid::filled(100, 100, 3.0f32);
    let test = Grid::filled(100, 100, 5.0f32);
    let found = run((&reference, &grid), (&test, &grid), AlignmentMethod::Xyz).unwrap();
    assert_eq!((found.shift.dx_m, found.shift.dy_m, found.shift.dz_m), (0.0, 0.0, -2.0));
    assert_eq!(found.search.unwrap().contrast, 1.0);
}

#[test]
fn unusable_input_is_refused_with_a_reason() {
    let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
    let flat = Grid::filled(20, 20, 3.0f32);
    let void = Grid::filled(20, 20, f32::NAN);
    let far = GeoTransform::north_up(1e5, 0.0, CELL_M);
    for alignment in [AlignmentMethod::None, AlignmentMethod::Z, AlignmentMethod::Xyz, AlignmentMethod::NuthKaab] {
        let empty = run((&void, &grid), (&flat, &grid), alignment).unwrap_err();
        assert!(matches!(empty, EvalError::EmptyReference { skipped: 0 }), "{empty}");
        assert!(run((&flat, &grid), (&void, &grid), alignment).is_err());
        let apart = run((&flat, &grid), (&flat, &far), alignment).unwrap_err();
        assert!(matches!(apart, EvalError::NoOverlap { .. }), "{apart}");
        assert!(!apart.to_string().contains("align"), "nothing to align: {apart}");
    }
    let tiny = Grid::filled(5, 5, 1.0f32);
    let error = run((&tiny, &grid), (&tiny, &grid), AlignmentMethod::Xyz).unwrap_err();
    assert!(matches!(error, EvalError::TooFewCells { .. }), "{error}");
    let error = run((&tiny, &grid), (&tiny, &grid), AlignmentMethod::NuthKaab).unwrap_err();
    assert!(matches!(error, EvalError::TooFlat { .. }), "{error}");
    let nothing = Grid::filled(0, 0, 0.0f32);
    assert!(run((&nothing, &grid), (&flat, &grid), AlignmentMethod::Xyz).is_err());
    assert!(run((&flat, &grid), (&nothing, &grid), AlignmentMethod::Xyz).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_constant_shows_without_alignment_and_vanishes_with_it(constant in -30.0..30.0f32, salt in 0u64..1000) {
        let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
        let reference = sampled(60, 50, &grid, |x, y, _| town(x, y));
        let test = sampled(60, 50, &grid, |x, y, i| town(x, y) + noise(i, salt));
        let moved = test.map(|h| h + constant);
        let errors = |test: &Grid<f32>, alignment| {
            run((&reference, &grid), (test, &grid), alignment).unwrap().overall.errors.unwrap()
        };
        let (a, b) = (errors(&test, AlignmentMethod::None), errors(&moved, AlignmentMethod::None));
        prop_assert!((b.mean - a.mean - f64::from(constant)).abs() < 1e-4);
        prop_assert!((b.nmad - a.nmad).abs() < 1e-4);
        let (a, b) = (errors(&test, AlignmentMethod::Z), errors(&moved, AlignmentMethod::Z));
        for (a, b) in a.values().into_iter().zip(b.values()) {
            prop_assert!((a - b).abs() < 1e-4, "{} {}", a, b);
        }
    }

    #[test]
    fn a_whole_cell_shift_is_undone_exactly(columns in -6i32..=6, rows in -6i32..=6) {
        let grid = GeoTransform::north_up(0.0, 0.0, CELL_M);
        let (dx, dy) = (f64::from(columns) * CELL_M, f64::from(-rows) * CELL_M);
        let reference = sampled(160, 150, &grid, |x, y, _| town(x, y));
        let test = sampled(160, 150, &grid, |x, y, _| town(x + dx, y + dy));
        let found = run((&reference, &grid), (&test, &grid), AlignmentMethod::Xyz).unwrap();
        prop_assert_eq!((found.shift.dx_m, found.shift.dy_m), (dx, dy));
        prop_assert!(found.overall.errors.unwrap().mae < 1e-4);
    }
}

#[test]
fn what_is_believed_most_has_the_errors_of_those_cells() {
    let geotransform = GeoTransform::north_up(0.0, 0.0, 1.0);
    let reference = Grid::filled(20, 10, 5.0f32);
    // The error is 0.1 m per column. The confidence falls with it, and one column is void.
    let cell = |i: usize| if i % 20 == 19 { f32::NAN } else { 5.0 + 0.1 * (i % 20) as f32 };
    let test = Grid::from_vec(20, 10, (0..200).map(cell).collect()).unwrap();
    let confidence = Grid::from_vec(20, 10, (0..200).map(|i| 1.0 - 0.01 * (i % 20) as f32).collect()).unwrap();
    let map = CellMap::affine(&geotransform, &geotransform).unwrap();
    let input = EvalInput {
        confidence: Some(&confidence),
        ..EvalInput::new(&test, &reference, &map, MetresFromCells::new(&geotransform, (1.0, 1.0)))
    };
    let config = EvalConfig { alignment: AlignmentMethod::None, ..EvalConfig::default() };
    let kept = evaluate(&input, &config).unwrap().coverages;
    assert_eq!(kept.iter().map(|c| c.coverage).collect::<Vec<_>>(), eval::COVERAGES);
    for c in &kept {
        // The kept columns have errors of 0, 0.1, …
        let columns = (20.0 * c.coverage).round();
        let mae = c.metrics.errors.unwrap().mae;
        assert!((mae - 0.05 * (columns - 1.0)).abs() < 1e-6, "{c:?}");
        assert!((c.confidence - (1.0 - 0.01 * (columns - 1.0))).abs() < 1e-6);
        assert_eq!((c.metrics.n, c.metrics.reference_cells), (columns as usize * 10, 200));
    }
    let small = Grid::filled(3, 3, 1.0f32);
    let wrong = evaluate(&EvalInput { confidence: Some(&small), ..input }, &config);
    assert!(matches!(wrong, Err(EvalError::Shape { what: "confidence", .. })), "{wrong:?}");
}
