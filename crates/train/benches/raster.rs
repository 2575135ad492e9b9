//! Forward and backward pass over a megapixel with 100,000 splats on one thread, with registers of
//! AVX-512 and of AVX2.
//!
//! Criterion's `elem/s` is pairs of a splat and a pixel per second: those that are drawn, each
//! counted once for both passes.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use numeric::SplitMix64;
use train::{Drawing, PinholeView, Registers, Surfel, SurfelGradients, SurfelImages, spatial_order};

/// Columns and rows of the image.
const SIZE: [usize; 2] = [1024, 1024];
/// Number of splats.
const SPLATS: usize = 100_000;
/// Standard deviations of the splats in pixels: about 19 of them cover a pixel.
const SIGMA_PX: [f64; 2] = [2.2, 4.4];

/// Returns a camera, and splats of random places, directions and opacities before it.
fn scene() -> (PinholeView, Vec<Surfel>) {
    let camera = PinholeView {
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        centre: [0.0; 3],
        focal_px: [1000.0; 2],
        principal_px: [511.5; 2],
        size: SIZE,
    };
    let mut random = SplitMix64::new(7);
    let mut between = |low: f64, high: f64| random.uniform_in(low, high);
    let surfels = (0..SPLATS).map(|_| {
        let depth = between(50.0, 100.0);
        let [x, y] = [0, 1].map(|_| between(-0.515, 0.515) * depth);
        let scale = [0, 1].map(|_| (between(SIGMA_PX[0], SIGMA_PX[1]) * depth / 1000.0).ln() as f32);
        Surfel {
            position: [x, y, depth].map(|c| c as f32),
            rotation: [1.0, between(-0.6, 0.6) as f32, between(-0.6, 0.6) as f32, between(-1.0, 1.0) as f32],
            log_scale: scale,
            opacity_logit: between(-3.0, 0.5) as f32,
            colour: [0, 1, 2].map(|_| between(0.0, 1.0) as f32),
        }
    });
    let surfels: Vec<Surfel> = surfels.collect();
    // The trainer keeps surfels in this order.
    let order = spatial_order(&surfels);
    (camera, order.into_iter().map(|number| surfels[number as usize]).collect())
}

fn raster(c: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let (camera, surfels) = scene();
    let mut by_images = SurfelImages::zeros(SIZE);
    for plane in by_images.planes_mut() {
        plane.iter_mut().enumerate().for_each(|(i, g)| *g = (i % 7) as f32 - 3.0);
    }
    let pairs = Drawing::new(&surfels, &camera, Registers::Longest).pairs();
    let mut group = c.benchmark_group("raster");
    group.sample_size(10).throughput(Throughput::Elements(pairs));
    for (name, registers) in [("longest", Registers::Longest), ("at most 256 bits", Registers::AtMost256)] {
        let mut drawing = Drawing::new(&surfels, &camera, registers);
        let mut gradients = SurfelGradients::default();
        group.bench_function(format!("forward, {name}"), |b| {
            b.iter(|| pool.install(|| drawing.redraw(black_box(&surfels), &camera)));
        });
        group.bench_function(format!("forward and backward, {name}"), |b| {
            b.iter(|| {
                pool.install(|| {
                    drawing.redraw(black_box(&surfels), &camera);
                    drawing.gradients(&surfels, &camera, &by_images, &mut gradients);
                });
                black_box(&gradients);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, raster);
criterion_main!(benches);
