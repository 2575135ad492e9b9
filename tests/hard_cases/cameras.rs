//! RPCs with extreme numbers: the same cameras with other coefficients, and cameras that fail
//! somewhere.

use camera::Rpc;
use jobs::dsm::DsmError;

use crate::stage::{EASY, Look, Shot, Stage, triplet};

/// Positions of the linear terms in the list of coefficients.
const LINEAR: [usize; 4] = [0, 1, 2, 3];

fn polynomials(rpc: &mut Rpc) -> [&mut [f64; 20]; 4] {
    [&mut rpc.line_num, &mut rpc.line_den, &mut rpc.samp_num, &mut rpc.samp_den]
}

/// Multiplies numerators and denominators by `1 − x / at`, x one of the normalised coordinates L,
/// P, H (1 to 3): the same camera, whose denominators are zero where `x = at`.
fn with_pole(mut rpc: Rpc, x: usize, at: f64) -> Rpc {
    // Position of the product of two linear terms in the list of coefficients.
    const PRODUCT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 7, 4, 5], [2, 4, 8, 6], [3, 5, 6, 9]];
    for c in polynomials(&mut rpc) {
        let linear: [f64; 4] = std::array::from_fn(|i| c[i]);
        for i in LINEAR {
            c[PRODUCT[i][x]] -= linear[i] / at;
        }
    }
    rpc
}

/// Makes the ground scales smaller by a factor without a change of the camera.
fn with_small_domain(mut rpc: Rpc, factor: f64) -> Rpc {
    rpc.long_scale /= factor;
    rpc.lat_scale /= factor;
    for c in polynomials(&mut rpc) {
        c[1] /= factor;
        c[2] /= factor;
    }
    rpc
}

/// Sets other image offsets and scales without a change of the camera.
fn with_far_offsets(mut rpc: Rpc, offset: f64, scale: f64) -> Rpc {
    for i in LINEAR {
        rpc.samp_num[i] = (rpc.samp_den[i] * (rpc.samp_off - offset) + rpc.samp_scale * rpc.samp_num[i]) / scale;
        rpc.line_num[i] = (rpc.line_den[i] * (rpc.line_off - offset) + rpc.line_scale * rpc.line_num[i]) / scale;
    }
    (rpc.samp_off, rpc.line_off, rpc.samp_scale, rpc.line_scale) = (offset, offset, scale, scale);
    rpc
}

/// Sets another HEIGHT_OFF and HEIGHT_SCALE without a change of the camera.
pub(crate) fn with_heights_about(mut rpc: Rpc, offset_m: f64, scale_m: f64) -> Rpc {
    let (shift, factor) = ((offset_m - rpc.height_off) / rpc.height_scale, scale_m / rpc.height_scale);
    for c in polynomials(&mut rpc) {
        c[0] += c[3] * shift;
        c[3] *= factor;
    }
    (rpc.height_off, rpc.height_scale) = (offset_m, scale_m);
    rpc
}

fn rewritten(change: impl Fn(Rpc) -> Rpc) -> Vec<Shot> {
    EASY.shots.iter().map(|s| Shot { rpc: change(s.rpc.clone()), ..s.clone() }).collect()
}

/// Other coefficients of the same cameras give the same DSM.
fn expect_the_same(case: &str, change: impl Fn(Rpc) -> Rpc) {
    expect_near(case, 0.05, change);
}

fn expect_near(case: &str, tolerance_m: f32, change: impl Fn(Rpc) -> Rpc) {
    let outcome = EASY.stage.run(&rewritten(change), |_| {}).unwrap();
    let share = EASY.outcome.agreement(&outcome, tolerance_m);
    assert!(share > 0.98, "{case}: only {share} of the cells are the same");
}

#[test]
fn denominators_that_are_zero_inside_the_cube_beside_the_image_change_nothing() {
    expect_the_same("a pole east of the image", |rpc| with_pole(rpc, 1, 0.9));
}

#[test]
fn denominators_that_are_zero_across_the_image_cost_a_line_at_most() {
    expect_the_same("a pole through the image", |rpc| with_pole(rpc, 2, 0.21));
}

#[test]
fn denominators_that_are_zero_above_the_scene_change_nothing() {
    expect_the_same("a pole in the air", |rpc| with_pole(rpc, 3, 0.7));
}

/// A camera that fails at a height: its samples go to infinity towards H = 0.9, 450 m above the
/// scene.
#[test]
fn a_camera_that_fails_high_above_the_scene_is_good_at_the_scene() {
    let stage = Stage::default();
    let failing = |l: &Look| {
        let mut rpc = stage.rpc(l);
        rpc.samp_den[3] -= 1.0 / 0.9;
        rpc
    };
    let shots: Vec<Shot> = triplet(0.5).iter().enumerate().map(|(i, l)| stage.shot(failing(l), i)).collect();
    let outcome = stage.run(&shots, |_| {}).unwrap();
    let score = stage.score(&outcome);
    score.expect("a real pole", 0.93, 0.04);
}

#[test]
fn offsets_far_outside_a_crop_with_small_scales_change_nothing() {
    expect_the_same("SAMP_OFF 19999, SAMP_SCALE 512", |rpc| with_far_offsets(rpc, 19_999.0, 512.0));
}

#[test]
fn ground_far_outside_the_domain_is_found_where_the_model_holds_and_refused_beyond() {
    expect_the_same("|L|, |P| up to 4", |rpc| with_small_domain(rpc, 7.0));
    let refused = EASY.stage.run(&rewritten(|rpc| with_small_domain(rpc, 60.0)), |_| {}).err();
    let Some(DsmError::Camera { source, .. }) = refused else { panic!("{refused:?}") };
    assert!(source.to_string().contains("half-widths"), "{source}");
}

#[test]
fn heights_far_from_height_off_are_found() {
    // Ties are searched over other heights and end a few hundredths of a pixel elsewhere.
    expect_near("HEIGHT_OFF 1500 m too high", 0.1, |rpc| with_heights_about(rpc, 1680.0, 500.0));
    expect_near("HEIGHT_SCALE of 2 m", 0.1, |rpc| with_heights_about(rpc, 240.0, 2.0));
}
