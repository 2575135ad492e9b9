//! Times the tree on a real mesh: `cargo run --release -p skysweep-bvh --example yardsticks -- PEER_REFERENCE [THREADS]`.
//!
//! Reads `mesh_local.ply`, the cameras of `sparse/0/images.txt` and `points_f64.npy` of the yardsticks; prints the sums that the
//! reference files hold, and Mray/s of the casting, wall and CPU (Linux). `benches/peers/open3d_cast.py` does the same with
//! Open3D, for a run side by side. A depth map is timed with its normals.

#![allow(clippy::print_stdout)]

use std::time::{Duration, Instant};

use rayon::prelude::*;

use bvh::{Bvh, Eye, MISS, Target};

const WIDTH: usize = 1024;
const HEIGHT: usize = 768;
const FOCAL: f64 = 886.810_013_475_265_2;
const CENTRE: [f64; 2] = [512.0, 384.0];
const EPSILON_M: f64 = 0.05;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().expect("the folder peer_reference");
    if let Some(threads) = arguments.next().and_then(|t| t.parse().ok()) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().expect("a pool");
    }
    let (positions, triangles) = mesh(&std::fs::read(format!("{folder}/mesh_local.ply")).expect("mesh"));
    let eyes = eyes(&std::fs::read_to_string(format!("{folder}/sparse/0/images.txt")).expect("images"));
    let points = points(&std::fs::read(format!("{folder}/points_f64.npy")).expect("points"));
    let start = Instant::now();
    let bvh = Bvh::new(&positions, &triangles).expect("a mesh");
    println!("build {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    let normals: Vec<[f32; 3]> = triangles.iter().map(|t| normal(t.map(|i| positions[i as usize]))).collect();
    let subset: Vec<Eye> = (0..16).map(|i| 2 + 5 * i).chain([80, 85, 90, 95]).map(|i| eyes[i]).collect();
    for cameras in [&subset[..], &eyes[..]] {
        depth(&bvh, cameras, &normals);
        visibility(&bvh, cameras, &points);
    }
}

fn depth(bvh: &Bvh, eyes: &[Eye], normals: &[[f32; 3]]) {
    let (mut hits, mut sum) = (0usize, 0.0);
    let mut clock = Clock::default();
    for eye in eyes {
        let image = clock.time(|| {
            let image = bvh.cast_image(eye, WIDTH, HEIGHT, |column, row| {
                Some([(column as f64 + 0.5 - CENTRE[0]) / FOCAL, (row as f64 + 0.5 - CENTRE[1]) / FOCAL])
            });
            let normal = |&t: &u32| normals.get(t as usize).copied().unwrap_or_default();
            let map: Vec<[f32; 3]> = image.triangle.par_iter().map(normal).collect();
            std::hint::black_box(map);
            image
        });
        hits += image.triangle.iter().filter(|&&t| t != MISS).count();
        sum += image.depth.iter().filter(|d| d.is_finite()).map(|&d| f64::from(d)).sum::<f64>();
    }
    println!("{} maps: {hits} hits, sum z {sum:.2}, {}", eyes.len(), clock.speed(eyes.len() * WIDTH * HEIGHT));
}

fn visibility(bvh: &Bvh, eyes: &[Eye], points: &[[f64; 3]]) {
    let mut views = vec![0u32; points.len()];
    let mut rays = 0;
    let mut clock = Clock::default();
    for eye in eyes {
        let mut numbers = Vec::new();
        let mut targets = Vec::new();
        for (number, &point) in points.iter().enumerate() {
            let [x, y, z] = eye.eye_from_world(point);
            let (u, v) = (FOCAL * x / z + CENTRE[0], FOCAL * y / z + CENTRE[1]);
            let inside = |at: f64, size: usize| (0.0..size as f64).contains(&at);
            if z > 0.0 && inside(u, WIDTH) && inside(v, HEIGHT) {
                let distance = (x * x + y * y + z * z).sqrt();
                numbers.push(number);
                targets.push(Target { x: x / z, y: y / z, depth: z * (1.0 - EPSILON_M / distance) });
            }
        }
        rays += targets.len();
        let hidden = clock.time(|| bvh.occluded(eye, &targets));
        for (&number, hidden) in numbers.iter().zip(hidden) {
            views[number] += u32::from(!hidden);
        }
    }
    let pairs: u64 = views.iter().map(|&v| u64::from(v)).sum();
    let at_least = |k: u32| views.iter().filter(|&&v| v >= k).count();
    let (one, two, count) = (at_least(1), at_least(2), eyes.len());
    println!("{count} cameras: {pairs} pairs, {one} in one view, {two} in two, {rays} rays, {}", clock.speed(rays));
}

/// Wall and CPU time of parts of the program.
#[derive(Default)]
struct Clock {
    wall: Duration,
    ticks: u64,
}

impl Clock {
    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (start, ticks) = (Instant::now(), cpu_ticks());
        let out = work();
        self.wall += start.elapsed();
        self.ticks += cpu_ticks() - ticks;
        out
    }

    fn speed(&self, rays: usize) -> String {
        let speed = rays as f64 / self.wall.as_secs_f64() / 1e6;
        format!("{speed:.1} Mray/s, {:.2} s CPU", self.ticks as f64 / 100.0)
    }
}

/// User and system time of the process in hundredths of a second; 0 where the system does not say.
fn cpu_ticks() -> u64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    text.split(' ').skip(13).take(2).filter_map(|t| t.parse::<u64>().ok()).sum()
}

/// The unit normal of a triangle; zero where it has no area.
fn normal([a, b, c]: [[f64; 3]; 3]) -> [f32; 3] {
    let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 0.0 { n.map(|c| (c / length) as f32) } else { [0.0; 3] }
}

fn mesh(bytes: &[u8]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let head = b"end_header\n";
    let end = bytes.windows(head.len()).position(|w| w == head).expect("a header") + head.len();
    let text = String::from_utf8_lossy(&bytes[..end]);
    let count = |what: &str| -> usize {
        let line = text.lines().find(|l| l.starts_with(&format!("element {what}"))).expect("a count");
        line.rsplit(' ').next().expect("a number").parse().expect("a number")
    };
    let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes")));
    let index = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
    let positions = (0..count("vertex")).map(|i| [0, 4, 8].map(|o| float(end + 12 * i + o))).collect();
    let faces = end + 12 * count("vertex");
    (positions, (0..count("face")).map(|i| [1, 5, 9].map(|o| index(faces + 13 * i + o))).collect())
}

fn eyes(text: &str) -> Vec<Eye> {
    let lines = text.lines().filter(|l| l.ends_with(".png") && !l.starts_with('#'));
    lines
        .map(|line| {
            let n: Vec<f64> = line.split(' ').take(8).map(|v| v.parse().expect("a number")).collect();
            let (w, x, y, z) = (n[1], n[2], n[3], n[4]);
            let rotation = [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
            ];
            let centre = [0, 1, 2].map(|i| -(0..3).map(|j| rotation[j][i] * n[5 + j]).sum::<f64>());
            Eye::new(centre, rotation)
        })
        .collect()
}

fn points(bytes: &[u8]) -> Vec<[f64; 3]> {
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let float = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"));
    (0..(bytes.len() - data) / 24).map(|i| [0, 8, 16].map(|o| float(data + 24 * i + o))).collect()
}
