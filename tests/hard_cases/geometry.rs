//! Baselines, overlaps, places and cameras.

use jobs::dsm::{CorrectionOrder, DsmError, ReconstructError};

use crate::stage::{EASY, Shot, Stage, look, median, triplet};

#[test]
fn an_easy_village_is_found_where_it_is() {
    let score = EASY.stage.score(&EASY.outcome);
    score.expect("no difficulty", 0.95, 0.03);
    assert!(score.bias_m.abs() < 0.1 && score.nmad_m < 0.15, "{score:?}");
}

#[test]
fn views_from_one_direction_have_no_parallax() {
    let stage = Stage::default();
    let refused = stage.run(&stage.shots(&[look(10.0, 12.0, 0.5), look(10.2, 12.0, 0.5)]), |_| {}).err();
    let Some(DsmError::Reconstruct(ReconstructError::NoParallax { angle_deg, .. })) = refused else {
        panic!("{refused:?}")
    };
    assert!((angle_deg - 0.2).abs() < 0.05, "{angle_deg}");
}

/// One degree moves the image by 0.035 px per metre: heights are a few metres off, and a warning
/// says so.
#[test]
fn a_tiny_baseline_gives_heights_with_an_honest_deviation_and_a_warning() {
    let stage = Stage::default();
    let outcome = stage.run(&stage.shots(&[look(10.0, 12.0, 0.5), look(11.0, 12.0, 0.5)]), |_| {}).unwrap();
    let score = stage.score(&outcome);
    assert!(score.bias_m.abs() < 3.0 && score.nmad_m < 5.0, "{score:?}");
    let mut sigma: Vec<f64> =
        outcome.sigma.heights.data().iter().filter(|s| s.is_finite()).map(|s| f64::from(*s)).collect();
    let sigma = median(&mut sigma);
    assert!(sigma > 0.3 * score.nmad_m && sigma < 5.0 * score.nmad_m, "stated deviation {sigma} m, {score:?}");
    assert!(outcome.warns("1.0°"), "{:?}", outcome.report.warnings);
}

/// One picture with two RPCs: every point lies at the same pixel of both, so that no height follows
/// from it.
#[test]
fn one_picture_under_two_rpcs_has_no_parallax() {
    let mut shots = EASY.shots.clone();
    shots[2].image = shots[0].image.clone();
    shots.remove(1);
    let refused = EASY.stage.run(&shots, |_| {}).err();
    assert!(matches!(refused, Some(DsmError::SamePixels { .. })), "{refused:?}");
}

#[test]
fn the_antimeridian_is_no_edge() {
    let stage = Stage { lon_deg: 180.0, lat_deg: -17.0, ..Stage::default() };
    let outcome = stage.run(&stage.shots(&triplet(0.5)), |_| {}).unwrap();
    assert!(matches!(outcome.dem.horizontal_epsg, Some(32701 | 32760)), "{:?}", outcome.dem.horizontal_epsg);
    stage.score(&outcome).expect("antimeridian", 0.95, 0.03);
}

#[test]
fn a_scene_at_85_degrees_north_is_mapped_in_the_polar_zone() {
    let stage = Stage { lon_deg: 31.0, lat_deg: 85.0, ..Stage::default() };
    let outcome = stage.run(&stage.shots(&triplet(0.5)), |_| {}).unwrap();
    assert_eq!(outcome.dem.horizontal_epsg, Some(5041));
    stage.score(&outcome).expect("85° N", 0.95, 0.03);
}

/// Two images that share a strip: the second camera looks beside the ground of the first one.
fn strip(share: f64) -> (Stage, Vec<Shot>, f64) {
    let stage = Stage::default();
    let side_m = stage.size_px as f64 * stage.gsd_m;
    let shift_m = (1.0 - share) * side_m;
    let shots = [look(12.0, 12.0, 0.5), look(12.0, 195.0, 0.5)]
        .iter()
        .zip([-0.5, 0.5])
        .enumerate()
        .map(|(view, (l, sign))| stage.shot(l.rpc(&stage, [sign * shift_m, 0.0]), view))
        .collect();
    (stage, shots, share * side_m)
}

#[test]
fn a_sliver_of_overlap_has_heights_and_less_is_refused() {
    let (stage, shots, width_m) = strip(0.2);
    let outcome = stage.run(&shots, |_| {}).unwrap();
    let inside = |x: f64, _: f64| x.abs() < 0.5 * width_m - 5.0;
    let score = stage.errors(&outcome, 45.0, eval::AlignmentMethod::None).over(inside);
    score.expect("a fifth of the images", 0.85, 0.06);
    let (stage, shots, _) = strip(0.03);
    let refused = stage.run(&shots, |_| {}).err();
    let Some(DsmError::Reconstruct(ReconstructError::NoOverlap { share_percent })) = refused else {
        panic!("{refused:?}")
    };
    assert!((1.0..5.0).contains(&share_percent), "{share_percent}");
}

fn shifted(shots: &[Shot], by_px: &[[f64; 2]]) -> Vec<Shot> {
    let mut out = shots.to_vec();
    for (shot, [sample, line]) in out.iter_mut().zip(by_px) {
        shot.rpc.samp_off += sample;
        shot.rpc.line_off += line;
    }
    out
}

#[test]
fn pointing_errors_of_five_pixels_are_taken_out() {
    let shots = shifted(&EASY.shots, &[[3.5, -3.5], [-5.0, 0.5], [1.0, 4.9]]);
    let outcome = EASY.stage.run(&shots, |_| {}).unwrap();
    assert_eq!(outcome.report.pointing.order, CorrectionOrder::Translation);
    assert!(outcome.report.pointing.rms_px < 0.2, "{:?}", outcome.report.pointing);
    EASY.stage.aligned_score(&outcome).expect("5 px", 0.95, 0.04);
}

#[test]
fn one_view_that_is_off_by_forty_pixels_does_not_harm_the_rest() {
    let shots = shifted(&EASY.shots, &[[0.0, 0.0], [31.0, -27.0], [0.0, 0.0]]);
    let outcome = EASY.stage.run(&shots, |_| {}).unwrap();
    let score = EASY.stage.aligned_score(&outcome);
    score.expect("one of three", 0.95, 0.04);
    assert!(outcome.warns("view_2.tif"), "{:?}", outcome.report.warnings);
}

#[test]
fn two_views_that_are_off_by_forty_pixels_are_brought_together() {
    let shots = shifted(&EASY.shots, &[[0.0, 0.0], [0.0, 0.0], [35.0, -22.0]]);
    let outcome = EASY.stage.run(&[shots[0].clone(), shots[2].clone()], |_| {}).unwrap();
    let score = EASY.stage.aligned_score(&outcome);
    score.expect("one of two", 0.93, 0.04);
    assert!(outcome.warns("view_2.tif"), "{:?}", outcome.report.warnings);
}
