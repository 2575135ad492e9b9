//! Points per second on one core: batch and scalar projection and localisation, and the interpolant.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use camera::{ImagePoint, RpcCamera, TileExtent, TileInterpolant};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

/// Points of one call: small enough for the second-level cache, as a tile's rows are.
const POINTS: usize = 4096;

/// Positions spread over the domain, deterministic: longitudes, latitudes, heights.
fn ground(rpc: &camera::Rpc) -> [Vec<f64>; 3] {
    let fraction = |i: usize, step: f64| 1.98 * (i as f64 * step).fract() - 0.99;
    let points: Vec<_> = (0..POINTS)
        .map(|i| rpc.domain().at([fraction(i, 0.618_034), fraction(i, 0.754_878), fraction(i, 0.569_840)]))
        .collect();
    [
        points.iter().map(|g| g.lon_deg).collect(),
        points.iter().map(|g| g.lat_deg).collect(),
        points.iter().map(|g| g.height_m).collect(),
    ]
}

fn batches(c: &mut Criterion) {
    let mut group = c.benchmark_group("rpc");
    group.throughput(Throughput::Elements(POINTS as u64));
    for (name, rpc) in [("whole", common::pushbroom()), ("crop", common::crop_far_from_offset())] {
        let [lon, lat, height] = ground(&rpc);
        let (mut s, mut l) = (vec![0.0; POINTS], vec![0.0; POINTS]);
        group.bench_function(BenchmarkId::new("project", name), |b| {
            b.iter(|| rpc.project_batch(black_box(&lon), &lat, &height, &mut s, &mut l));
        });
        let plane = rpc.plane(rpc.height_off);
        group.bench_function(BenchmarkId::new("project plane", name), |b| {
            b.iter(|| plane.project_batch(black_box(&lon), &lat, &mut s, &mut l));
        });
        let (mut x, mut y) = (vec![0.0; POINTS], vec![0.0; POINTS]);
        group.bench_function(BenchmarkId::new("localize", name), |b| {
            b.iter(|| rpc.localize_batch(black_box(&s), &l, &height, &mut x, &mut y));
        });
        group.bench_function(BenchmarkId::new("localize one by one", name), |b| {
            b.iter(|| {
                let one = |i: usize| rpc.localize(ImagePoint::new(s[i], l[i]), height[i]);
                (0..POINTS).filter(|&i| black_box(one(i)).is_ok()).count()
            });
        });
    }
    group.finish();
}

fn interpolant(c: &mut Criterion) {
    let reference = RpcCamera::new(common::pushbroom());
    let source = RpcCamera::new(common::crop_far_from_offset());
    let extent = TileExtent { u: (9000.0, 9000.0 + POINTS as f64), v: (40_000.0, 40_255.0), height_m: (0.0, 400.0) };
    let fit = || TileInterpolant::source_from_reference(&reference, &source, extent, 1.0);
    let mut group = c.benchmark_group("interpolant");
    group.bench_function("fit and check", |b| b.iter(fit));
    if let Ok(tile) = fit() {
        group.throughput(Throughput::Elements(POINTS as u64));
        let height: Vec<f64> = (0..POINTS).map(|i| (i % 400) as f64).collect();
        let (mut x, mut y) = (vec![0.0; POINTS], vec![0.0; POINTS]);
        group.bench_function("row", |b| {
            b.iter(|| tile.row(black_box(40_100.0)).eval_columns(9000.0, &height, &mut x, &mut y));
        });
    }
    group.finish();
}

criterion_group!(benches, batches, interpolant);
criterion_main!(benches);
