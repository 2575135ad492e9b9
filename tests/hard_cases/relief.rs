//! Surfaces that rise fast, and height ranges that do not hold them.

use eval::AlignmentMethod;
use jobs::dsm::{DsmError, HeightRange};

use crate::stage::{EASY, Stage, rolling, triplet, village};

/// A tower of 30 × 30 m and 130 m. The parallax of its roof against the ground is 70 px.
#[test]
fn a_tower_of_130_m_survives() {
    let tower = |x: f64, y: f64| x.abs() < 15.0 && (y - 5.0).abs() < 15.0;
    let stage = Stage {
        size_px: 400,
        surface: Box::new(move |x, y| if tower(x, y) { 130.0 } else { rolling(x, y) }),
        span_m: (-4.0, 132.0),
        ..Stage::default()
    };
    let outcome = stage.run(&stage.shots(&triplet(0.5)), |_| {}).unwrap();
    let errors = stage.errors(&outcome, 70.0, AlignmentMethod::None);
    let roof = errors.over(|x, y| x.abs() < 14.0 && (y - 5.0).abs() < 14.0);
    let beside = errors.over(|x, _| x.abs() > 25.0);
    roof.expect("the roof", 0.9, 0.06);
    beside.expect("the ground beside", 0.95, 0.03);
}

/// A valley and a ridge whose sides fall at 45° to 55°.
#[test]
fn steep_slopes_are_smooth_and_right() {
    let stage = Stage {
        size_px: 320,
        surface: Box::new(|x, y| 22.0 * (x / 18.0).sin() + 4.0 * (y / 15.0).sin()),
        span_m: (-27.0, 27.0),
        ..Stage::default()
    };
    let outcome = stage.run(&stage.shots(&triplet(0.5)), |_| {}).unwrap();
    let score = stage.score(&outcome);
    score.expect("slopes of up to 51°", 0.95, 0.01);
    assert!(score.nmad_m < 0.25, "{score:?}");
}

#[test]
fn a_range_far_above_the_scene_is_refused_with_the_heights_seen() {
    let refused = EASY.stage.run(&EASY.shots, |c| c.height_range_m = Some(HeightRange::new(480.0, 700.0))).err();
    let Some(DsmError::RangeMissesScene { seen, .. }) = refused else { panic!("{refused:?}") };
    assert!(seen.low_m > 170.0 && seen.high_m < 210.0, "{seen:?}");
}

/// The range ends at 8 m: the roofs at 9 to 20 m are outside. They are void, and a warning says so.
#[test]
fn a_range_that_cuts_the_roofs_off_is_told_and_gives_no_false_roofs() {
    let outcome = EASY.stage.run(&EASY.shots, |c| c.height_range_m = Some(HeightRange::new(170.0, 188.0))).unwrap();
    let errors = EASY.stage.errors(&outcome, 50.0, AlignmentMethod::None);
    let (above, ground) = (errors.over(|x, y| village(x, y) > 12.0), errors.over(|x, y| village(x, y) < 3.0));
    ground.expect("the ground", 0.9, 0.06);
    assert!(above.covered < 0.25, "{above:?}");
    assert!(outcome.warns("height range"), "{:?}", outcome.report.warnings);
}

#[test]
fn a_range_of_kilometres_gives_the_same_surface() {
    let outcome = EASY.stage.run(&EASY.shots, |c| c.height_range_m = Some(HeightRange::new(-400.0, 5000.0))).unwrap();
    let share = EASY.outcome.agreement(&outcome, 0.1);
    assert!(share > 0.97, "only {share} of the cells are the same");
}
