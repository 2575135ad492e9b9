//! The search for the ground on synthetic surfaces with a known answer.

use numeric::{Silent, SplitMix64};
use raster::Grid;
use terrain::{
    BareGround, GROUND, GroundConfig, TerrainError, UNDER_OBJECT, UNKNOWN, VOID_FILLED, bare_ground,
    bare_ground_of_observed,
};

/// Side of the cells of most surfaces, metres.
const CELL_M: f64 = 1.0;

/// A surface of `side × side` cells from its height at (column, row).
fn surface(side: usize, height: impl Fn(f32, f32) -> f32) -> Grid<f32> {
    let cells = (0..side * side).map(|at| height((at % side) as f32, (at / side) as f32));
    Grid::from_vec(side, side, cells.collect()).unwrap()
}

fn ground(surface: &Grid<f32>) -> BareGround {
    bare_ground(surface, CELL_M, &GroundConfig::default(), &Silent).unwrap()
}

/// The root mean square error against the true ground.
fn rmse(found: &BareGround, truth: &Grid<f32>) -> f64 {
    let squares = found.heights.data().iter().zip(truth.data()).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / truth.data().len() as f64).sqrt()
}

/// The share of the cells of a mask with a state.
fn share(found: &BareGround, state: u8, within: impl Fn(f32, f32) -> bool) -> f64 {
    let side = found.states.width();
    let cells: Vec<bool> = (0..found.states.data().len())
        .filter(|at| within((at % side) as f32, (at / side) as f32))
        .map(|at| found.states.data()[at] == state)
        .collect();
    cells.iter().filter(|hit| **hit).count() as f64 / cells.len() as f64
}

/// Noise of about normal distribution, by position.
fn noise(x: f32, y: f32, sigma: f32) -> f32 {
    sigma * SplitMix64::new(((y as u64) << 32) | x as u64).normal() as f32
}

fn in_box(x: f32, y: f32) -> bool {
    (60.0..80.0).contains(&x) && (50.0..85.0).contains(&y)
}

#[test]
fn a_box_on_flat_ground_is_removed() {
    let found = ground(&surface(150, |x, y| if in_box(x, y) { 15.0 } else { 8.0 }));
    assert_eq!(share(&found, UNDER_OBJECT, in_box), 1.0);
    assert_eq!(share(&found, GROUND, |x, y| !in_box(x, y)), 1.0);
    assert!(found.heights.data().iter().all(|h| (h - 8.0).abs() < 1e-3));
}

#[test]
fn a_box_on_a_slope_is_removed_and_the_slope_stays() {
    for slope in [0.05, 0.2, 0.4] {
        let truth = surface(200, |x, _| slope * x);
        let found = ground(&surface(200, |x, y| slope * x + if in_box(x, y) { 7.0 } else { 0.0 }));
        assert!(share(&found, UNDER_OBJECT, in_box) > 0.98, "{slope}");
        let error = rmse(&found, &truth);
        assert!(error < 0.3, "slope {slope}: {error}");
    }
}

#[test]
fn a_steep_hill_stays() {
    let hill = surface(300, |x, y| 60.0 * (-((x - 150.0).powi(2) + (y - 150.0).powi(2)) / 5000.0).exp());
    let found = ground(&hill);
    assert!(share(&found, GROUND, |_, _| true) > 0.97);
    assert!(rmse(&found, &hill) < 0.3);
}

/// A ridge whose ground shows in the gaps and clearings of a forest. An opening cuts the crest off
/// together with the trees on it.
#[test]
fn a_ridge_under_a_forest_stays() {
    let ridge = surface(300, |x, y| 60.0 - 0.5 * (x - 150.0).abs() + 5.0 * (y / 40.0).sin());
    let is_tree = |x: f32, y: f32| {
        let is_clearing = ((x / 45.0) as u32 + 2 * (y / 45.0) as u32).is_multiple_of(5);
        !is_clearing && x % 15.0 < 11.0 && y % 15.0 < 11.0
    };
    let forest = surface(300, |x, y| ridge[(x as usize, y as usize)] + if is_tree(x, y) { 12.0 } else { 0.0 });
    let found = ground(&forest);
    assert!(share(&found, UNDER_OBJECT, is_tree) > 0.97);
    let error_at = |at: usize| (found.heights.data()[at] - ridge.data()[at]).abs();
    let is_flank = |at: &usize| (at % 300).abs_diff(150) > 30;
    assert!((0..90_000).filter(is_flank).all(|at| error_at(at) < 2.5));
    // A crest as sharp as this is cut.
    assert!(rmse(&found, &ridge) < 4.0);
}

#[test]
fn a_forest_without_any_clearing_has_some_ground() {
    let found = ground(&surface(120, |x, y| 10.0 + noise(x, y, 3.0)));
    assert_eq!(share(&found, UNKNOWN, |_, _| true), 0.0);
}

#[test]
fn a_quay_and_a_terrace_stay() {
    // A quay along a bent line, and a terrace that only one side of the raster shows whole.
    let quay = surface(250, |x, y| if x + 20.0 * (y / 40.0).sin() > 120.0 { 4.0 } else { 0.0 });
    let terrace = surface(250, |x, y| if x > 150.0 && y > 120.0 { 6.0 } else { 0.0 });
    for steps in [quay, terrace] {
        let found = ground(&steps);
        assert!(rmse(&found, &steps) < 0.2, "{}", rmse(&found, &steps));
        assert!(share(&found, GROUND, |_, _| true) > 0.95);
    }
}

#[test]
fn a_large_low_hall_is_removed() {
    let within = |x: f32, y: f32| (100.0..220.0).contains(&x) && (90.0..210.0).contains(&y);
    let truth = surface(320, |x, y| 0.03 * x + 0.02 * y);
    let found = ground(&surface(320, |x, y| 0.03 * x + 0.02 * y + if within(x, y) { 6.0 } else { 0.0 }));
    let share = share(&found, UNDER_OBJECT, within);
    assert!(share > 0.99, "{share}");
    assert!(rmse(&found, &truth) < 0.3);
}

#[test]
fn noise_and_outliers_below_the_ground_do_no_harm() {
    let truth = surface(200, |x, y| 0.1 * x - 0.05 * y);
    let noisy = surface(200, |x, y| {
        let deep = if (x as usize * 31 + y as usize * 17) % 1999 < 3 { -6.0 } else { 0.0 };
        0.1 * x - 0.05 * y + if in_box(x, y) { 5.0 } else { 0.0 } + noise(x, y, 0.4) + deep
    });
    let found = ground(&noisy);
    assert!(share(&found, UNDER_OBJECT, in_box) > 0.97);
    assert!(rmse(&found, &truth) < 0.5, "{}", rmse(&found, &truth));
}

#[test]
fn voids_are_filled_near_ground_only() {
    let hole = |x: f32, y: f32| (30.0..60.0).contains(&x) && (40.0..90.0).contains(&y);
    let plane = surface(150, |x, y| 0.1 * x + 0.1 * y);
    let found = ground(&surface(150, |x, y| if hole(x, y) { f32::NAN } else { 0.1 * x + 0.1 * y }));
    assert_eq!(share(&found, VOID_FILLED, hole), 1.0);
    assert!(rmse(&found, &plane) < 0.1);
    // Ground in one corner tells nothing of cells half a kilometre away.
    let far = ground(&surface(500, |x, y| if x < 20.0 && y < 20.0 { 3.0 } else { f32::NAN }));
    assert_eq!(share(&far, UNKNOWN, |x, _| x > 200.0), 1.0);
    assert!(far.heights[(400, 400)].is_nan() && !far.heights[(100, 100)].is_nan());
}

#[test]
fn empty_and_tiny_surfaces_are_taken() {
    let empty = ground(&surface(40, |_, _| f32::NAN));
    assert_eq!(share(&empty, UNKNOWN, |_, _| true), 1.0);
    assert!(empty.heights.data().iter().all(|h| h.is_nan()));
    let one = ground(&surface(1, |_, _| 12.0));
    assert_eq!((one.heights[(0, 0)], one.states[(0, 0)]), (12.0, GROUND));
    let infinite = ground(&surface(30, |x, _| if x == 3.0 { f32::INFINITY } else { 1.0 }));
    assert!(infinite.heights.data().iter().all(|h| (h - 1.0).abs() < 1e-3));
    assert!(ground(&Grid::filled(0, 0, 0.0)).heights.data().is_empty());
}

#[test]
fn fine_and_coarse_cells_give_the_same_ground() {
    for (cell_m, side) in [(0.3, 400), (0.5, 300), (2.0, 150), (10.0, 60)] {
        let house = |x: f32, y: f32| (x * cell_m as f32 - 60.0).abs() < 11.0 && (y * cell_m as f32 - 60.0).abs() < 15.0;
        let cells = surface(side, |x, y| if house(x, y) { 12.0 } else { 4.0 });
        let found = bare_ground(&cells, cell_m, &GroundConfig::default(), &Silent).unwrap();
        let worst = found.heights.data().iter().map(|h| (h - 4.0).abs()).fold(0.0, f32::max);
        assert!(worst < 0.01, "{cell_m} m: {worst}");
    }
}

#[test]
fn values_outside_of_their_range_are_refused() {
    let flat = Grid::filled(4, 4, 1.0);
    for cell_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = bare_ground(&flat, cell_m, &GroundConfig::default(), &Silent).unwrap_err();
        assert!(matches!(error, TerrainError::CellSize { .. }), "{error}");
    }
    let mut config = GroundConfig::default();
    config.slope = f64::NAN;
    let error = bare_ground(&flat, 1.0, &config, &Silent).unwrap_err();
    assert!(error.to_string().contains("slope"), "{error}");
}

/// Ground between the crowns of a wood that stands on a plain, two cells wide.
fn in_gap(x: f32, y: f32) -> bool {
    x % 9.0 < 2.0 && y % 7.0 < 2.0
}

fn in_wood(x: f32, y: f32) -> bool {
    (40.0..160.0).contains(&x) && (50.0..150.0).contains(&y)
}

#[test]
fn a_gap_between_crowns_stays_and_a_pit_goes() {
    let is_pit = |x: f32, y: f32| (20.0..24.0).contains(&x) && (100.0..104.0).contains(&y);
    let height = |x: f32, y: f32| match (in_wood(x, y) && !in_gap(x, y), is_pit(x, y)) {
        (true, _) => 15.0 + noise(x, y, 2.0),
        (false, true) => -7.0,
        (false, false) => 0.05 * x,
    };
    let truth = surface(200, |x, _| 0.05 * x);
    let found = ground(&surface(200, height));
    assert!(share(&found, GROUND, |x, y| in_wood(x, y) && in_gap(x, y)) > 0.95);
    assert_eq!(share(&found, GROUND, is_pit), 0.0);
    assert!(rmse(&found, &truth) < 0.3, "{}", rmse(&found, &truth));
}

#[test]
fn blunders_below_a_plain_do_not_make_it_an_object() {
    let is_blunder = |x: f32, y: f32| {
        let number = (x / 12.0) as u64 * 100 + (y / 12.0) as u64;
        SplitMix64::new(number).normal() > 1.9 && x % 12.0 < 9.0 && y % 12.0 < 9.0
    };
    let depth = |x: f32, y: f32| 4.0 + ((x / 12.0) as u32 * 7 + (y / 12.0) as u32 * 3) as f32 % 9.0;
    let found = ground(&surface(250, |x, y| noise(x, y, 0.1) - if is_blunder(x, y) { depth(x, y) } else { 0.0 }));
    assert!(share(&found, GROUND, |x, y| !is_blunder(x, y)) > 0.97);
    assert!(rmse(&found, &surface(250, |_, _| 0.0)) < 0.3);
}

#[test]
fn noise_of_a_metre_leaves_a_plain_and_its_house() {
    let truth = surface(200, |x, y| 0.1 * x - 0.05 * y);
    let noisy = |x: f32, y: f32| 0.1 * x - 0.05 * y + if in_box(x, y) { 12.0 } else { 0.0 } + noise(x, y, 1.0);
    let found = ground(&surface(200, noisy));
    assert!(share(&found, GROUND, |x, y| !in_box(x, y)) > 0.9);
    assert!(share(&found, UNDER_OBJECT, in_box) > 0.97);
    assert!(rmse(&found, &truth) < 1.2, "{}", rmse(&found, &truth));
}

#[test]
fn trees_on_a_steep_slope_go_and_the_slope_stays() {
    let is_tree = |x: f32, y: f32| x % 17.0 < 5.0 && y % 13.0 < 5.0;
    let truth = surface(200, |x, _| 0.7 * x);
    let found = ground(&surface(200, |x, y| 0.7 * x + if is_tree(x, y) { 9.0 } else { 0.0 }));
    assert!(share(&found, UNDER_OBJECT, is_tree) > 0.95);
    assert!(share(&found, GROUND, |x, y| !is_tree(x, y)) > 0.95);
    assert!(rmse(&found, &truth) < 0.5, "{}", rmse(&found, &truth));
}

#[test]
fn heights_that_nothing_has_measured_are_no_ground() {
    let is_filled = |x: f32, y: f32| (100.0..140.0).contains(&x) && (30.0..110.0).contains(&y);
    let cells = surface(160, |x, y| if is_filled(x, y) { -9.0 } else { 2.0 });
    let mask = cells.map(|h| *h < 0.0);
    let found = bare_ground_of_observed(&cells, Some(&mask), CELL_M, &GroundConfig::default(), &Silent).unwrap();
    assert_eq!(share(&found, VOID_FILLED, is_filled), 1.0);
    assert!(found.heights.data().iter().all(|h| (h - 2.0).abs() < 1e-3));
    let small = Grid::filled(3, 3, true);
    let error = bare_ground_of_observed(&cells, Some(&small), CELL_M, &GroundConfig::default(), &Silent).unwrap_err();
    assert!(error.to_string().contains("3 × 3"), "{error}");
}

/// A dense quarter on a slope as images show it: ground in some streets, roofs, and between them
/// voids with a few wrong matches.
#[test]
fn wrong_matches_and_roofs_between_voids_do_not_bend_a_slope() {
    let truth = surface(200, |x, y| 0.2 * x + 0.1 * y);
    let is_street = |x: f32, y: f32| x < 30.0 || (y - 5.0).rem_euclid(80.0) < 10.0;
    let is_roof = |x: f32, y: f32| (x - 85.0).rem_euclid(40.0) < 22.0 && (y - 15.0).rem_euclid(40.0) < 22.0;
    let is_wrong = |x: f32, y: f32| x > 110.0 && (x * 7.0 + y * 3.0) % 149.0 < 1.0;
    let cells = surface(200, |x, y| {
        let offset = if is_street(x, y) {
            noise(x, y, 0.1)
        } else if is_roof(x, y) {
            9.0
        } else {
            -12.0
        };
        0.2 * x + 0.1 * y + offset
    });
    let unseen =
        surface(200, |x, y| f32::from(!(is_street(x, y) || is_roof(x, y) || is_wrong(x, y)))).map(|is| *is > 0.0);
    let found = bare_ground_of_observed(&cells, Some(&unseen), CELL_M, &GroundConfig::default(), &Silent).unwrap();
    assert!(rmse(&found, &truth) < 0.5, "{}", rmse(&found, &truth));
    let roofs = share(&found, GROUND, |x, y| x > 30.0 && is_roof(x, y) && !is_street(x, y));
    assert!(roofs < 0.02, "{roofs}");
}

/// Flat halls on a slope as images show them: flush with the ground uphill, and carried on into it
/// by the matching.
#[test]
fn flat_roofs_that_are_flush_with_a_slope_and_sink_into_it_are_no_ground() {
    let truth = surface(240, |x, y| 0.4 * x + 0.05 * y);
    let hall = |x: f32, y: f32| ((y - 20.0).rem_euclid(75.0) < 45.0).then_some((x - 20.0).rem_euclid(80.0));
    let cells = surface(240, |x, y| {
        let ground = 0.4 * x + 0.05 * y + noise(x, y, 0.1);
        // Roofs are level with the ground 45 m uphill of their lower wall, and go on for 6 m.
        hall(x, y).filter(|along| *along < 51.0).map_or(ground, |along| ground + 0.4 * (45.0 - along))
    });
    let is_void = |x: f32, y: f32| hall(x, y).is_none() && (x * 5.0 + y * 3.0) % 61.0 < 6.0;
    let unseen = surface(240, |x, y| f32::from(is_void(x, y))).map(|is| *is > 0.0);
    let found = bare_ground_of_observed(&cells, Some(&unseen), CELL_M, &GroundConfig::default(), &Silent).unwrap();
    assert!(rmse(&found, &truth) < 1.3, "{}", rmse(&found, &truth));
}
