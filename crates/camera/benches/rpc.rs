//! Points per second on one core: projection and localisation, point by point and on a plane of one
//! height.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use camera::{ImagePoint, RpcCamera};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use geodesy::LonLatHeight;

/// Points of one measured call.
const POINTS: usize = 4096;

/// Positions spread over the validity domain, the same in every run.
fn ground(rpc: &camera::Rpc) -> Vec<LonLatHeight> {
    let fraction = |i: usize, step: f64| 1.98 * (i as f64 * step).fract() - 0.99;
    (0..POINTS)
        .map(|i| rpc.domain().at([fraction(i, 0.618_034), fraction(i, 0.754_878), fraction(i, 0.569_840)]))
        .collect()
}

fn projection_and_localisation(c: &mut Criterion) {
    let mut group = c.benchmark_group("rpc");
    group.throughput(Throughput::Elements(POINTS as u64));
    for (name, rpc) in [("whole", common::pushbroom()), ("crop", common::crop_far_from_offset())] {
        let points = ground(&rpc);
        group.bench_function(BenchmarkId::new("project", name), |b| {
            b.iter(|| points.iter().filter(|&&g| rpc.project(black_box(g)).is_ok()).count());
        });
        let plane = rpc.plane(rpc.height_off);
        group.bench_function(BenchmarkId::new("project on a plane", name), |b| {
            b.iter(|| points.iter().filter(|g| plane.project(black_box(g.lon_deg), g.lat_deg).is_ok()).count());
        });
        let camera = RpcCamera::new(rpc.clone());
        let column = |of: fn(&LonLatHeight) -> f64| points.iter().map(of).collect::<Vec<f64>>();
        let [lon, lat, height] = [column(|g| g.lon_deg), column(|g| g.lat_deg), column(|g| g.height_m)];
        let (mut sample, mut line) = (vec![0.0; POINTS], vec![0.0; POINTS]);
        group.bench_function(BenchmarkId::new("project many", name), |b| {
            b.iter(|| camera.project_many(black_box([&lon, &lat, &height]), [&mut sample, &mut line]));
        });
        group.bench_function(BenchmarkId::new("project many on a plane", name), |b| {
            b.iter(|| plane.project_many(&camera.correction, black_box([&lon, &lat]), [&mut sample, &mut line]));
        });
        let images: Vec<ImagePoint> = points.iter().filter_map(|&g| rpc.project(g).ok()).collect();
        group.bench_function(BenchmarkId::new("localize", name), |b| {
            let found = |(p, g): (&ImagePoint, &LonLatHeight)| rpc.localize(black_box(*p), g.height_m).is_ok();
            b.iter(|| images.iter().zip(&points).filter(|&pair| found(pair)).count());
        });
    }
    group.finish();
}

criterion_group!(benches, projection_and_localisation);
criterion_main!(benches);
