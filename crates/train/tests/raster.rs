//! The rasteriser against a slow reference in f64, and its gradients against central differences.

mod reference;

use gaussian::{SplatHarmonics, harmonic_values};
use numeric::SplitMix64;
use proptest::prelude::*;
use reference::{Eye, Parameters, draw};
use train::{
    AffineView, DepthSpread, Drawing, LearnedHarmonics, LocalView, PinholeView, Registers, Surfel, SurfelCamera,
    SurfelGradients, SurfelImages,
};

const SIZE: [usize; 2] = [37, 29];
/// Step of the central differences.
const STEP: f64 = 1e-6;

/// A random scene before a camera at the origin that looks along the third axis.
fn surfel() -> impl Strategy<Value = Surfel> {
    let range = |low: f32, high: f32| (0..=10_000u32).prop_map(move |t| low + (high - low) * t as f32 / 10_000.0);
    let around = range(-1.0, 1.0);
    (
        [range(-2.0, 2.0), range(-1.5, 1.5), range(4.0, 8.0)],
        [around.clone(), around.clone(), around.clone(), around],
        [range(-3.0, 0.0), range(-3.0, 0.0)],
        range(-3.0, 6.0),
        [range(0.0, 1.0), range(0.0, 1.0), range(0.0, 1.0)],
    )
        .prop_filter("the quaternion has a length", |(_, q, ..)| q.iter().map(|c| c * c).sum::<f32>() > 0.05)
        .prop_map(|(position, rotation, log_scale, opacity_logit, colour)| Surfel {
            position,
            rotation,
            log_scale,
            opacity_logit,
            colour,
        })
}

fn pinhole() -> (PinholeView, Eye) {
    let (rotation, centre) = ([[0.96, 0.0, -0.28], [0.0, 1.0, 0.0], [0.28, 0.0, 0.96]], [-1.0, 0.1, 0.2]);
    let (focal, principal) = ([35.0, 33.0], [17.3, 14.2]);
    let view = PinholeView { rotation, centre, focal_px: focal, principal_px: principal, size: SIZE };
    (view, Eye::Pinhole { rotation, centre, focal, principal })
}

fn affine(surfels: &[Surfel]) -> (AffineView, Eye) {
    let jacobian = [[6.5, 0.7, 1.9], [-0.5, 7.1, 0.8]];
    let (pixel, axis) = ([6.0, 9.5], [-0.1, 0.2, 0.97]);
    let along = |a: [f64; 3], p: [f64; 3]| a[0] * p[0] + a[1] * p[1] + a[2] * p[2];
    // Anchors lie beside the centres, as they do after a while of training.
    let anchors: Vec<[f64; 3]> = surfels.iter().map(|s| s.position.map(|c| f64::from(c) + 0.3)).collect();
    let view = |p: &[f64; 3]| {
        Some(LocalView {
            pixel: [0, 1].map(|i| pixel[i] + along(jacobian[i], *p)),
            jacobian,
            depth_m: along(axis, *p),
            depth_axis: axis,
        })
    };
    let views = anchors.iter().map(view).collect();
    (AffineView { size: SIZE, anchors, views }, Eye::Affine { pixel, jacobian, axis })
}

fn exact(surfels: &[Surfel]) -> Vec<Parameters> {
    surfels.iter().map(|s| s.to_array().map(f64::from)).collect()
}

/// Values between −1 and 1 that look random.
fn weight(plane: usize, place: usize) -> f32 {
    ((plane * 7919 + place * 104_729 + 13) % 2003) as f32 / 1001.0 - 1.0
}

fn drawing<C: SurfelCamera>(surfels: &[Surfel], camera: &C, spread: DepthSpread) -> Drawing {
    let mut drawing = Drawing::new(&[], camera, Registers::Longest);
    drawing.set_spread(spread);
    drawing.redraw(surfels, camera);
    drawing
}

fn check_image<C: SurfelCamera>(
    surfels: &[Surfel],
    camera: &C,
    eye: &Eye,
    spread: DepthSpread,
) -> Result<(), TestCaseError> {
    let found = drawing(surfels, camera, spread);
    let truth = draw(&exact(surfels), eye, SIZE, spread);
    let sure = truth.unsure.iter().filter(|u| !**u).count();
    // A surfel that is almost seen from the edge makes the whole image unsure.
    prop_assume!(sure > SIZE[0] * SIZE[1] / 2);
    for (number, (found, plane)) in found.images().planes().into_iter().zip(&truth.planes).enumerate() {
        // Depths are metres at up to 10 m, so that they are compared relative to 10.
        let is_inverse = number == 8 && spread == DepthSpread::InverseDepths;
        let unit = if number >= 7 && !is_inverse { 10.0 } else { 1.0 };
        for place in (0..found.len()).filter(|&p| !truth.unsure[p]) {
            let error = (f64::from(found[place]) - plane[place]).abs() / unit;
            prop_assert!(error < 1e-5, "image {number}, pixel {place}: {} is not {}", found[place], plane[place]);
        }
    }
    Ok(())
}

fn check_gradients<C: SurfelCamera>(
    surfels: &[Surfel],
    camera: &C,
    eye: &Eye,
    spread: DepthSpread,
) -> Result<(), TestCaseError> {
    let parameters = exact(surfels);
    let unsure = draw(&parameters, eye, SIZE, spread).unsure;
    // Inverse depths differ by less than depths, so that their gradient is enlarged to be seen.
    let of_spread = if spread == DepthSpread::InverseDepths { 200.0 } else { 1.0 };
    let mut by_images = SurfelImages::zeros(SIZE);
    for (number, plane) in by_images.planes_mut().into_iter().enumerate() {
        for (place, value) in plane.iter_mut().enumerate() {
            let size = if number == 8 { of_spread } else { 1.0 };
            *value = if unsure[place] { 0.0 } else { size * weight(number, place) };
        }
    }
    let mut found = SurfelGradients::default();
    drawing(surfels, camera, spread).gradients(surfels, camera, &by_images, &mut found);
    // The slope of the loss, and the sum of its absolute parts: what rounding is relative to where
    // the parts cancel.
    let slope = |number: usize, parameter: usize| {
        let moved = |by: f64| {
            let mut moved = parameters.clone();
            moved[number][parameter] += by;
            draw(&moved, eye, SIZE, spread).planes
        };
        let (ahead, behind, weights) = (moved(STEP), moved(-STEP), by_images.planes());
        let parts = (0..9).flat_map(|k| (0..weights[k].len()).map(move |p| (k, p)));
        parts.fold([0.0; 2], |[sum, size], (k, p)| {
            let part = f64::from(weights[k][p]) * (ahead[k][p] - behind[k][p]) / (2.0 * STEP);
            [sum + part, size + part.abs()]
        })
    };
    for (number, found) in found.surfels.iter().enumerate() {
        let truth: [[f64; 2]; 13] = std::array::from_fn(|parameter| slope(number, parameter));
        for group in [0..3, 3..7, 7..9, 9..10, 10..13] {
            let length = |v: &mut dyn Iterator<Item = f64>| v.map(|c| c * c).sum::<f64>().sqrt();
            let (truth, found) = (&truth[group.clone()], &found.to_array()[group.clone()]);
            let difference = length(&mut truth.iter().zip(found).map(|(t, f)| t[0] - f64::from(*f)));
            let [slope, size] = [0, 1].map(|i| length(&mut truth.iter().map(|t| t[i])));
            let error = difference / slope.max(0.1 * size).max(1e-6);
            prop_assert!(error < 1e-4, "surfel {number}, {group:?}: {found:?} is not {truth:?} ({error:.1e})");
        }
    }
    Ok(())
}

/// Coefficients of a surfel at degree 3.
const COEFFICIENTS: usize = 45;

/// The colours that an eye sees of surfels with harmonics, by plain sums in f64.
fn coloured(surfels: &[Parameters], coefficients: &[f64], eye: &Eye) -> Vec<Parameters> {
    let one = |(surfel, own): (&Parameters, &[f64])| {
        let direction = match *eye {
            Eye::Pinhole { centre, .. } => [0, 1, 2].map(|i| surfel[i] - centre[i]),
            Eye::Affine { axis, .. } => axis,
        };
        let (values, mut seen) = (harmonic_values(direction), *surfel);
        for channel in 0..3 {
            let sum: f64 = own[15 * channel..].iter().zip(values).map(|(c, value)| c * value).sum();
            seen[10 + channel] = (surfel[10 + channel] + sum).max(0.0);
        }
        seen
    };
    surfels.iter().zip(coefficients.chunks_exact(COEFFICIENTS)).map(one).collect()
}

/// Harmonics of degree 3: the image against the reference, and the gradients by positions, colours
/// and coefficients against central differences.
fn check_harmonics<C: SurfelCamera>(
    surfels: &[Surfel],
    coefficients: &[f32],
    camera: &C,
    eye: &Eye,
) -> Result<(), TestCaseError> {
    let harmonics = SplatHarmonics::new(3, coefficients.to_vec()).expect("degree 3");
    let harmonics = LearnedHarmonics::of(&harmonics, surfels.len());
    let parameters = exact(surfels);
    let exact_coefficients: Vec<f64> = coefficients.iter().map(|c| f64::from(*c)).collect();
    let seen_truth = coloured(&parameters, &exact_coefficients, eye);
    // At 0 a colour has no derivative.
    prop_assume!(seen_truth.iter().all(|s| s[10..].iter().all(|c| *c == 0.0 || *c > 1e-3)));
    let truth = draw(&seen_truth, eye, SIZE, DepthSpread::Depths);
    let mut memory = Vec::new();
    let seen = harmonics.seen(surfels, camera, 3, &mut memory);
    let mut drawing = drawing(seen, camera, DepthSpread::Depths);
    let mut by_images = SurfelImages::zeros(SIZE);
    for (number, plane) in by_images.planes_mut().into_iter().enumerate().take(3) {
        for place in (0..plane.len()).filter(|&p| !truth.unsure[p]) {
            let error = f64::from(drawing.images().colour[number][place]) - truth.planes[number][place];
            prop_assert!(error.abs() < 1e-5, "image {number}, pixel {place}: off by {error}");
            plane[place] = weight(number, place);
        }
    }
    let (mut found, mut by_coefficients) = (SurfelGradients::default(), Vec::new());
    drawing.gradients(seen, camera, &by_images, &mut found);
    harmonics.spread((surfels, seen), camera, 3, &mut found, &mut by_coefficients);
    let slope = |moved: &dyn Fn(f64) -> Vec<Parameters>| {
        let of = |by: f64| draw(&moved(by), eye, SIZE, DepthSpread::Depths).planes;
        let (ahead, behind, weights) = (of(STEP), of(-STEP), by_images.planes());
        let parts = (0..3).flat_map(|k| (0..weights[k].len()).map(move |p| (k, p)));
        parts.fold([0.0; 2], |[sum, size], (k, p)| {
            let part = f64::from(weights[k][p]) * (ahead[k][p] - behind[k][p]) / (2.0 * STEP);
            [sum + part, size + part.abs()]
        })
    };
    let by_parameter = |number: usize, parameter: usize| {
        slope(&|by| {
            let mut moved = parameters.clone();
            moved[number][parameter] += by;
            coloured(&moved, &exact_coefficients, eye)
        })
    };
    let by_coefficient = |place: usize| {
        slope(&|by| {
            let mut moved = exact_coefficients.clone();
            moved[place] += by;
            coloured(&parameters, &moved, eye)
        })
    };
    let check = |what: String, found: &[f32], truth: &[[f64; 2]]| {
        let length = |v: &mut dyn Iterator<Item = f64>| v.map(|c| c * c).sum::<f64>().sqrt();
        let difference = length(&mut truth.iter().zip(found).map(|(t, f)| t[0] - f64::from(*f)));
        let [slope, size] = [0, 1].map(|i| length(&mut truth.iter().map(|t| t[i])));
        let error = difference / slope.max(0.1 * size).max(1e-6);
        prop_assert!(error < 1e-4, "{what}: {found:?} is not {truth:?} ({error:.1e})");
        Ok(())
    };
    for number in 0..surfels.len() {
        let own = found.surfels[number].to_array();
        for group in [0..3, 10..13] {
            let truth: Vec<[f64; 2]> = group.clone().map(|parameter| by_parameter(number, parameter)).collect();
            check(format!("surfel {number}, {group:?}"), &own[group], &truth)?;
        }
        let group = COEFFICIENTS * number..COEFFICIENTS * (number + 1);
        let truth: Vec<[f64; 2]> = group.clone().map(by_coefficient).collect();
        check(format!("harmonics of surfel {number}"), &by_coefficients[group], &truth)?;
    }
    Ok(())
}

/// Images and gradients of a scene with a tile that is cut by the border.
fn whole<C: SurfelCamera>(
    surfels: &[Surfel],
    camera: &C,
    (registers, spread): (Registers, DepthSpread),
    threads: usize,
) -> Vec<u32> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut drawing = Drawing::new(&[], camera, registers);
        drawing.set_spread(spread);
        drawing.redraw(surfels, camera);
        let mut by_images = SurfelImages::zeros(camera.size());
        for (number, plane) in by_images.planes_mut().into_iter().enumerate() {
            plane.iter_mut().enumerate().for_each(|(place, value)| *value = weight(number, place));
        }
        let mut gradients = SurfelGradients::default();
        drawing.gradients(surfels, camera, &by_images, &mut gradients);
        let planes = drawing.images().planes().into_iter().flatten().copied();
        let slopes = gradients.surfels.iter().flat_map(|s| s.to_array()).chain(gradients.by_pixel.iter().copied());
        planes.chain(slopes).map(f32::to_bits).collect()
    })
}

#[test]
fn threads_and_registers_change_no_bit() {
    let mut random = SplitMix64::new(3);
    let mut between = |low: f64, high: f64| random.uniform_in(low, high) as f32;
    let surfels: Vec<Surfel> = (0..3000)
        .map(|_| Surfel {
            position: [between(-4.0, 4.0), between(-3.0, 3.0), between(3.0, 9.0)],
            rotation: [1.0, between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)],
            log_scale: [between(-5.0, -1.0), between(-5.0, -1.0)],
            opacity_logit: between(-3.0, 6.0),
            colour: [0.0; 3].map(|_| between(0.0, 1.0)),
        })
        .collect();
    let pinhole = PinholeView { focal_px: [150.0; 2], principal_px: [89.0, 61.0], size: [181, 125], ..pinhole().0 };
    let (affine, _) = affine(&surfels);
    let (depths, inverse) = (DepthSpread::Depths, DepthSpread::InverseDepths);
    let of = |registers: Registers, threads: usize| {
        let pinhole = [depths, inverse].map(|spread| whole(&surfels, &pinhole, (registers, spread), threads));
        let [by_depth, by_inverse] = pinhole;
        [by_depth, by_inverse, whole(&surfels, &affine, (registers, depths), threads)]
    };
    let plain = of(Registers::Plain, 1);
    assert!(plain[0] != plain[1] && plain[0].iter().filter(|bits| **bits != 0).count() > 200_000);
    for registers in [Registers::Plain, Registers::AtMost256, Registers::Longest] {
        for threads in [1, 2, 5] {
            assert!(of(registers, threads) == plain, "{registers:?}, {threads} threads");
        }
    }
}

#[test]
fn a_surfel_beside_the_camera_covers_what_its_plane_covers() {
    // The floor of a street, of which a part lies behind the camera.
    let (camera, eye) = pinhole();
    let camera = PinholeView { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ..camera };
    let Eye::Pinhole { centre, focal, principal, .. } = eye else { unreachable!("the camera is a pinhole") };
    let eye = Eye::Pinhole { rotation: camera.rotation, centre, focal, principal };
    let floor = Surfel {
        position: [-1.0, 1.6, 1.5],
        rotation: [0.5f32.sqrt(), 0.5f32.sqrt(), 0.0, 0.0],
        log_scale: [0.7, 1.2],
        opacity_logit: 3.0,
        colour: [1.0, 0.5, 0.25],
    };
    check_image(&[floor], &camera, &eye, DepthSpread::InverseDepths).expect("the images agree");
    let drawing = Drawing::new(&[floor], &camera, Registers::Longest);
    let coverage = |row: usize| drawing.images().coverage[row * SIZE[0] + SIZE[0] / 2];
    assert!(coverage(28) > 0.5 && coverage(5) == 0.0, "{} {}", coverage(28), coverage(5));
}

#[test]
fn gradients_hold_for_a_thin_surfel_that_is_almost_seen_from_the_edge() {
    // The line of sight of the pinhole meets its plane at 1.7 degrees.
    let needle = Surfel {
        position: [1.3768001, -0.6684, 5.5355997],
        rotation: [0.566, -0.38779998, 0.6428, 0.56939995],
        log_scale: [-2.9016, -0.22110009],
        opacity_logit: 1.9014001,
        colour: [0.348, 0.6344, 0.6095],
    };
    let (camera, eye) = pinhole();
    check_gradients(&[needle], &camera, &eye, DepthSpread::Depths).expect("the gradients agree");
}

#[test]
fn a_splat_covers_its_area_however_fine_the_pixels_are() {
    // Facing the camera, and turned by 60 degrees.
    for (rotation, facing) in [([1.0, 0.0, 0.0, 0.0], 1.0), ([0.75f32.sqrt(), 0.5, 0.0, 0.0], 0.5)] {
        for finer in [1.0, 2.0, 4.0] {
            let camera = PinholeView {
                rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                centre: [0.0; 3],
                focal_px: [20.0 * finer; 2],
                principal_px: [10.0 * finer - 0.5; 2],
                size: [20 * finer as usize; 2],
            };
            // The mean over places within a pixel, about the axis of the camera.
            let covered = |place: u8| {
                let surfel = Surfel {
                    position: [0.0625 * (f32::from(place % 4) - 1.5), 0.0625 * (f32::from(place / 4) - 1.5), 5.0],
                    rotation,
                    log_scale: [0.05f32.ln(); 2],
                    opacity_logit: 0.0,
                    colour: [1.0; 3],
                };
                let drawing = Drawing::new(&[surfel], &camera, Registers::Longest);
                drawing.images().coverage.iter().map(|c| f64::from(*c)).sum::<f64>() / 16.0
            };
            let mean: f64 = (0..16).map(covered).sum();
            // Pixels of a standard deviation; what is fainter than 1 in 255 is not drawn.
            let sigma = 0.05 * 20.0 * finer / 5.0;
            let whole = 0.5 * std::f64::consts::TAU * sigma * sigma * facing;
            assert!((0.93..1.01).contains(&(mean / whole)), "{finer} {facing}: {mean} is not {whole}");
        }
    }
}

#[test]
fn nothing_is_drawn_of_nothing() {
    let (camera, _) = pinhole();
    let empty = Drawing::new(&[], &camera, Registers::Longest);
    assert!(empty.images().planes().iter().all(|plane| plane.iter().all(|v| *v == 0.0)));
    let none = PinholeView { size: [0, 7], ..camera };
    assert_eq!(Drawing::new(&[Surfel::default()], &none, Registers::Longest).pairs(), 0);
    let broken = Surfel { position: [f32::NAN; 3], log_scale: [f32::INFINITY; 2], ..Surfel::default() };
    let hidden = [broken, Surfel { position: [0.0, 0.0, f32::INFINITY], ..broken }, Surfel::default()];
    let mut drawing = Drawing::new(&hidden, &camera, Registers::Longest);
    assert_eq!(drawing.pairs(), 0);
    let mut gradients = SurfelGradients::default();
    drawing.gradients(&hidden, &camera, &SurfelImages::zeros(SIZE), &mut gradients);
    assert_eq!(gradients.surfels, [Surfel::default(); 3]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn images_are_those_of_the_reference(surfels in prop::collection::vec(surfel(), 1..25)) {
        let (camera, eye) = pinhole();
        check_image(&surfels, &camera, &eye, DepthSpread::Depths)?;
        check_image(&surfels, &camera, &eye, DepthSpread::InverseDepths)?;
        let (camera, eye) = affine(&surfels);
        check_image(&surfels, &camera, &eye, DepthSpread::Depths)?;
    }

    #[test]
    fn colours_by_direction_have_the_reference_and_gradients_of_central_differences(
        (surfels, coefficients) in prop::collection::vec(surfel(), 1..4).prop_flat_map(|surfels| {
            let coefficient = (-1000..=1000i32).prop_map(|c| 3e-4 * c as f32);
            let count = COEFFICIENTS * surfels.len();
            (Just(surfels), prop::collection::vec(coefficient, count))
        })
    ) {
        let (camera, eye) = pinhole();
        check_harmonics(&surfels, &coefficients, &camera, &eye)?;
        let (camera, eye) = affine(&surfels);
        check_harmonics(&surfels, &coefficients, &camera, &eye)?;
    }

    #[test]
    fn gradients_are_central_differences(surfels in prop::collection::vec(surfel(), 1..9)) {
        let (camera, eye) = pinhole();
        check_gradients(&surfels, &camera, &eye, DepthSpread::Depths)?;
        check_gradients(&surfels, &camera, &eye, DepthSpread::InverseDepths)?;
        let (camera, eye) = affine(&surfels);
        check_gradients(&surfels, &camera, &eye, DepthSpread::Depths)?;
    }
}
