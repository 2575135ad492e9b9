//! Surfels learn a scene that is known: a textured wall before a textured floor, seen from above.

use train::{
    Drawing, PinholeView, Recipe, Registers, Surfel, SurfelImages, Trainer, TrainingConfig, TrainingState,
    TrainingView, ViewAppearance,
};

const SIZE: [usize; 2] = [96, 72];
/// Side of the scene, metres.
const EXTENT_M: f64 = 8.0;

/// A grid of opaque surfels in the plane through `corner` along two unit axes.
fn sheet(corner: [f32; 3], axes: [[f32; 3]; 2], rotation: [f32; 4], count: usize, step: f32) -> Vec<Surfel> {
    let one = |i: usize| {
        let (u, v) = ((i % count) as f32 * step, (i / count) as f32 * step);
        let tone = |k: usize| 0.5 + 0.4 * ((1.3 + k as f32 * 0.4) * u + 0.5 * v).sin() * (0.9 * v + k as f32).cos();
        Surfel {
            position: [0, 1, 2].map(|k| corner[k] + u * axes[0][k] + v * axes[1][k]),
            rotation,
            log_scale: [(0.6 * step).ln(); 2],
            opacity_logit: 4.0,
            colour: [0, 1, 2].map(tone),
        }
    };
    (0..count * count).map(one).collect()
}

fn truth() -> Vec<Surfel> {
    let floor = sheet([-4.0, -4.0, 0.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [1.0, 0.0, 0.0, 0.0], 40, 0.2);
    let half = 0.5f32.sqrt();
    let wall = sheet([-2.0, 1.0, 0.0], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [half, half, 0.0, 0.0], 20, 0.2);
    [floor, wall].concat()
}

/// A camera on an arc in the south, that looks at the middle of the scene.
fn camera(angle: f64, up: f64) -> PinholeView {
    let centre = [10.0 * angle.sin(), -10.0 * angle.cos(), up];
    let forward = centre.map(|c| -c / centre.iter().map(|c| c * c).sum::<f64>().sqrt());
    let level = forward[0].hypot(forward[1]);
    let right = [forward[1] / level, -forward[0] / level, 0.0];
    let down = [
        forward[1] * right[2] - forward[2] * right[1],
        forward[2] * right[0] - forward[0] * right[2],
        forward[0] * right[1] - forward[1] * right[0],
    ];
    PinholeView {
        rotation: [right, down, forward],
        centre,
        focal_px: [110.0; 2],
        principal_px: [47.5, 35.5],
        size: SIZE,
    }
}

/// What a camera sees of the truth: colours, depths and normals.
fn view(camera: PinholeView, with_priors: bool) -> TrainingView<PinholeView> {
    let drawing = Drawing::new(&truth(), &camera, Registers::Longest);
    let images = drawing.images();
    let where_covered = |plane: &[f32]| {
        let of = plane.iter().zip(&images.coverage);
        of.map(|(v, a)| if *a > 0.9 { v / a } else { f32::NAN }).collect::<Vec<f32>>()
    };
    TrainingView {
        prior_depth_m: with_priors.then(|| where_covered(&images.depth_m)),
        prior_normal: with_priors.then(|| images.normal.each_ref().map(|plane| where_covered(plane))),
        ..TrainingView::new(camera, images.colour.clone())
    }
}

fn views(with_priors: bool) -> Vec<TrainingView<PinholeView>> {
    (0..6).map(|i| view(camera(-0.5 + 0.2 * f64::from(i), 6.0), with_priors)).collect()
}

/// Few grey surfels beside the truth.
fn start() -> Vec<Surfel> {
    let moved = |(i, s): (usize, &Surfel)| Surfel {
        position: [0, 1, 2].map(|k| s.position[k] + 0.25 * ((i * 37 + k * 11) as f32).sin()),
        rotation: [0, 1, 2, 3].map(|k| s.rotation[k] + 0.25 * ((i * 53 + k * 17) as f32).sin()),
        log_scale: [0.3f32.ln(); 2],
        opacity_logit: 0.0,
        colour: [0.5; 3],
    };
    truth().iter().step_by(4).enumerate().map(moved).collect()
}

fn config(iterations: u32) -> TrainingConfig {
    let mut config = TrainingConfig::default();
    config.iterations = iterations;
    config
}

fn trained(views: &[TrainingView<PinholeView>], config: TrainingConfig) -> TrainingState {
    let mut trainer = Trainer::new(views, EXTENT_M, TrainingState::new(start(), views.len()), config);
    while !trainer.is_done() {
        trainer.step();
    }
    trainer.into_state()
}

/// A wall whose red fades from one end of the arc of cameras to the other.
#[test]
fn colours_that_depend_on_the_direction_are_learned() {
    let sheen = |angle: f64| {
        let mut seen = view(camera(angle, 6.0), false);
        seen.colour[0].iter_mut().for_each(|red| *red *= (1.0 + angle) as f32);
        seen
    };
    let views: Vec<_> = (0..6).map(|i| sheen(-0.5 + 0.2 * f64::from(i))).collect();
    let held_out = sheen(0.42);
    let error = |degree: u8| {
        let mut config = config(300);
        config.harmonics.degree = degree;
        // Steps that reach colours as different as these within 300 iterations.
        config.rates.harmonics = [0.02, 0.002];
        let state = trained(&views, config);
        assert_eq!(state.harmonics.degree(), degree);
        let mut memory = Vec::new();
        let seen = state.seen(&held_out.camera, &mut memory);
        let drawing = Drawing::new(seen, &held_out.camera, Registers::Longest);
        let pairs = drawing.images().colour[0].iter().zip(&held_out.colour[0]);
        pairs.map(|(shown, truth)| f64::from((shown - truth).powi(2))).sum::<f64>()
    };
    let [plain, by_direction] = [error(0), error(1)];
    assert!(by_direction < 0.7 * plain, "{plain} became {by_direction}");
}

/// Signal-to-noise ratio of a view that was not trained, dB, and median error of its depths,
/// metres.
fn judged(state: &TrainingState) -> (f64, f64) {
    let held_out = view(camera(0.02, 5.0), true);
    let views = [held_out];
    let state = TrainingState::new(state.surfels.clone(), 1);
    let mut trainer = Trainer::new(&views, EXTENT_M, state, config(1));
    let terms = trainer.judge(&views[0], ViewAppearance::PLAIN);
    let images: &SurfelImages = trainer.images();
    let prior = views[0].prior_depth_m.as_ref().expect("the view has depths");
    let errors = prior.iter().zip(images.depth_m.iter().zip(&images.coverage));
    let mut errors: Vec<f64> = errors
        .filter(|(p, (_, a))| p.is_finite() && **a > 0.1)
        .map(|(p, (d, a))| f64::from((d / a - p).abs()))
        .collect();
    errors.sort_by(f64::total_cmp);
    (-10.0 * terms.squared.log10(), errors[errors.len() / 2])
}

#[test]
fn surfels_learn_a_scene_and_priors_mend_its_shape() {
    let before = judged(&TrainingState::new(start(), 1));
    let plain = judged(&trained(&views(false), config(400)));
    let mut buildings = TrainingConfig::of(Recipe::BuildingEnhanced);
    buildings.iterations = 400;
    let guided = judged(&trained(&views(true), buildings));
    assert!(plain.0 > before.0 + 8.0, "{before:?} became {plain:?} dB, m");
    assert!(guided.0 > before.0 + 8.0, "{before:?} became {guided:?} dB, m");
    assert!(guided.1 < 0.7 * plain.1, "with priors {guided:?}, without {plain:?} dB, m");
}

#[test]
fn a_training_goes_on_from_its_checkpoint_with_the_same_bytes() {
    let views = views(true);
    let mut config = config(60);
    config.appearance = true;
    config.densify.as_mut().expect("surfels are added").every = 10;
    let run = |threads: usize, cut: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut trainer = Trainer::new(&views, EXTENT_M, TrainingState::new(start(), views.len()), config);
            while trainer.state().iteration < cut {
                trainer.step();
            }
            let state = TrainingState::from_bytes(&trainer.into_state().to_bytes()).expect("a checkpoint");
            let mut trainer = Trainer::new(&views, EXTENT_M, state, config);
            while !trainer.is_done() {
                trainer.step();
            }
            trainer.into_state().to_bytes()
        })
    };
    let whole = run(1, 0);
    assert!(whole == run(2, 0), "threads change the training");
    assert!(whole == run(2, 27), "a checkpoint changes the training");
}

#[test]
fn exposures_are_learned_and_the_budget_is_kept() {
    let mut views = views(false);
    for plane in &mut views[2].colour {
        plane.iter_mut().for_each(|c| *c *= 0.7);
    }
    let mut config = config(300);
    config.appearance = true;
    if let Some(densify) = &mut config.densify {
        densify.budget = 600;
        densify.every = 20;
    }
    let state = trained(&views, config);
    assert!(state.surfels.len() <= 600 && state.surfels.len() > start().len(), "{}", state.surfels.len());
    let gain = |view: usize| state.appearance[view].gain.iter().sum::<f32>() / 3.0;
    assert!(gain(2) < 0.9 * gain(1) && gain(2) < 0.9 * gain(3), "{:?}", state.appearance);
}

#[test]
fn what_is_not_masked_stays_empty() {
    let mut views = views(false);
    let mask = |view: &mut TrainingView<PinholeView>| {
        let half = |i: usize| i % SIZE[0] < SIZE[0] / 2;
        view.mask = Some((0..SIZE[0] * SIZE[1]).map(half).collect());
    };
    views.iter_mut().for_each(mask);
    let one = &views[..1];
    // Surfels are removed, but not split.
    let mut config = config(500);
    let densify = config.densify.as_mut().expect("surfels are removed");
    densify.gradient = f64::INFINITY;
    densify.every = 20;
    let everything = trained(&[view(one[0].camera, false)], config);
    let half = trained(one, config);
    let drawing = Drawing::new(&half.surfels, &one[0].camera, Registers::Longest);
    let mean = |left: bool| {
        let pixels = drawing.images().coverage.iter().enumerate();
        let chosen: Vec<f32> =
            pixels.filter(|(i, _)| (i % SIZE[0] < SIZE[0] / 2 - 4) == left).map(|(_, a)| *a).collect();
        chosen.iter().sum::<f32>() / chosen.len() as f32
    };
    assert!(mean(false) < 0.15 && mean(true) > 0.5, "{} {}", mean(true), mean(false));
    assert!(
        4 * half.surfels.len() < 3 * everything.surfels.len(),
        "{} {}",
        half.surfels.len(),
        everything.surfels.len()
    );
}
