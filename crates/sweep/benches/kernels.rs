//! Hypotheses per second on one thread: the cost volume, its aggregation, and the whole chain of a
//! level.
//!
//! Criterion's `elem/s` is hypotheses of all pixels per second (Gde/s when divided by 10⁹). The
//! costs are counted per source, as each hypothesis is compared with every source.

#[path = "../src/testing/camera.rs"]
mod leaning;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use leaning::leaning_camera;
use raster::{Grid, Window};
use sweep::aggregation::Penalties;
use sweep::cost::CostConfig;
use sweep::ranges::Ranges;
use sweep::{CostVolume, LevelConfig, Reference, SweepView, ViewLevel, sweep_level};

/// Side of the images, pixels. A block of this size is larger than the caches.
const SIZE: usize = 512;
/// Hypotheses per pixel, in steps of a metre.
const HYPOTHESES: usize = 64;

/// Returns views of a textured plane at height 0, where all cameras agree.
fn views() -> Vec<SweepView> {
    let texture = |i: usize| {
        let (x, y) = ((i % SIZE) as f32, (i / SIZE) as f32);
        500.0 + 90.0 * ((0.9 * x).sin() + (1.1 * y + 0.3 * x).sin() + (0.13 * x * y / 40.0).sin())
    };
    let image = Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(texture).collect()).expect("a square image");
    [[0.0, 0.0], [0.5, 0.1], [-0.3, 0.4]].map(|p| SweepView::new(leaning_camera(SIZE, p), image.clone())).into()
}

fn kernels(c: &mut Criterion) {
    let views = views();
    let ranges = Ranges::uniform(SIZE, SIZE, 1.0, (-32.0, (HYPOTHESES - 33) as f64));
    let reference = Reference { view: views[0].on_level(0, 0), level: 0, ranges: &ranges, prior: None };
    let (whole, cost) = (Window::whole(SIZE, SIZE), CostConfig::default());
    let evaluations = ranges.evaluations();
    let mut group = c.benchmark_group("sweep");
    group.sample_size(20);
    for count in [1, 2] {
        let sources: Vec<ViewLevel<'_>> = (1..=count).map(|i| views[i].on_level(i, 0)).collect();
        group.throughput(Throughput::Elements(evaluations * count as u64));
        group.bench_function(BenchmarkId::new("cost per source", count), |b| {
            let mut buffer = Vec::new();
            b.iter(|| {
                let volume =
                    CostVolume::compute(reference, black_box(&sources), whole, &cost, std::mem::take(&mut buffer));
                buffer = black_box(volume).expect("linear cameras").into_buffer();
            });
        });
    }
    let sources = [views[1].on_level(1, 0)];
    let volume = CostVolume::compute(reference, &sources, whole, &cost, Vec::new()).expect("linear cameras");
    group.throughput(Throughput::Elements(volume.hypotheses() as u64));
    let mut forward = Vec::new();
    group.bench_function("aggregation", |b| {
        b.iter(|| black_box(&volume).aggregate(Penalties::default(), &mut forward, |_, row| _ = black_box(row)));
    });
    let config = LevelConfig::default();
    // A level of one block runs on one thread.
    group.bench_function("chain of a pair", |b| {
        b.iter(|| sweep_level(reference, black_box(&sources), 0.0, &config).expect("linear cameras"));
    });
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
