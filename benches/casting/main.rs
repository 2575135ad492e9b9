//! Ray casting on a real city model, for a comparison with Open3D: `cargo bench --bench casting --
//! CITY time THREADS` and `cargo bench --bench casting -- CITY check RAYS.npy`.
//! `benches/peers/priors.py` calls both and writes the results.
//!
//! CITY is `../shared/data/city`. `time` makes the maps of the hundred cameras of `peer_reference`,
//! and looks for its million points in them, on the triangles that the reference was computed with;
//! `check` compares our triangles of the tile with the stored results, and both with rays that were
//! tested against every triangle in f64. A line of JSON is printed.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

mod check;
mod scene;

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use bvh::Target;
use city::{MeshConfig, TriangleMesh};
use priors::{MapConfig, PriorMaps, PriorModel, Rays, View, Visibility, VisibilityConfig};
use scene::Scene;
use serde_json::{Value, json};

/// Parameters that the reference was computed with. They use the images up to their borders.
const VISIBILITY: VisibilityConfig = VisibilityConfig {
    margin_px: 0.0,
    near_m: 0.0,
    epsilon_m: 0.05,
    max_incidence_deg: None,
    min_views: 2,
    max_observations: 10,
};

fn main() -> anyhow::Result<()> {
    // Cargo passes `--bench` to every bench.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let found = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [city, "time", threads] => {
            rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?).build_global()?;
            time(Path::new(city))?
        }
        [city, "check", rays] => check::all(Path::new(city), Path::new(rays))?,
        // Without arguments there is nothing to compare, for example in a run of all benches.
        [] => return Ok(()),
        _ => bail!("expected CITY time THREADS, or CITY check RAYS.npy"),
    };
    println!("{found}");
    Ok(())
}

fn time(city: &Path) -> anyhow::Result<Value> {
    let mut clock = Clock::default();
    let file = clock.time(|| cityfiles::read(&city.join("3dbag_5910.city.json")))?;
    clock.time(|| TriangleMesh::from_model(&file.model, &MeshConfig::default()))?;
    drop(file);
    let load = clock.json();
    let scene = Scene::of_reference(city)?;
    let mut clock = Clock::default();
    clock.time(|| bvh::Bvh::new(&scene.model.mesh().positions, &scene.model.mesh().triangles))?;
    Ok(json!({
        "load_and_triangulate": load,
        "build": clock.json(),
        "maps": maps(&scene)?,
        "visibility": visibility(&scene)?,
        "peak_mib": peak_mib()?,
    }))
}

/// Makes depth, normals, class and object of every pixel of every camera.
fn maps(scene: &Scene) -> anyhow::Result<Value> {
    let rays = Rays::new(scene.lens())?;
    let mut clock = Clock::default();
    let (mut hits, mut sum) = (0, 0.0);
    for view in scene.views() {
        let maps = clock.time(|| PriorMaps::render(&scene.model, &view, &rays, MapConfig::default()));
        hits += maps.hits();
        sum += maps.depth_m.data().iter().filter(|d| d.is_finite()).map(|&d| f64::from(d)).sum::<f64>();
    }
    let mut told = clock.json();
    told["rays"] = json!(scene.views().count() * rays.width() * rays.height());
    told["hits"] = json!(hits);
    told["sum_z_m"] = json!(sum);
    Ok(told)
}

/// Finds the points in all cameras. Measures the rays alone, and everything from the points to the
/// list of observations.
fn visibility(scene: &Scene) -> anyhow::Result<Value> {
    let mut cast = Clock::default();
    let mut rays = 0;
    for view in scene.views() {
        let targets = targets(scene, &view);
        rays += targets.len();
        cast.time(|| scene.model.bvh().occluded(&view.eye(), &targets));
    }
    let mut whole = Clock::default();
    let visible = whole.time(|| -> anyhow::Result<_> {
        let mut visibility = Visibility::new(&scene.model, &scene.points, VISIBILITY)?;
        scene.views().for_each(|view| {
            visibility.add(&view);
        });
        Ok(visibility.finish())
    })?;
    let mut told = cast.json();
    told["rays"] = json!(rays);
    told["whole"] = whole.json();
    told["pairs"] = json!(visible.pairs);
    told["in_one_view"] = json!(scene.points.len() - visible.histogram[0]);
    told["in_two_views"] = json!(visible.points.len());
    Ok(told)
}

fn targets(scene: &Scene, view: &View) -> Vec<Target> {
    let eye = view.eye();
    let target = |sample: &priors::Sample| {
        let [x, y, z] = eye.eye_from_world(sample.position);
        let distance = (x * x + y * y + z * z).sqrt();
        view.pixel(x / z, y / z, VISIBILITY.margin_px).filter(|_| z > 0.0)?;
        Some(Target { x: x / z, y: y / z, depth: z * (1.0 - VISIBILITY.epsilon_m / distance) })
    };
    scene.points.iter().filter_map(target).collect()
}

/// Makes a model whose objects are all buildings.
fn arranged(path: &Path) -> anyhow::Result<PriorModel> {
    let model = cityfiles::read(path)?.model;
    let meshed = TriangleMesh::from_model(&model, &MeshConfig::default())?;
    Ok(PriorModel::new(meshed.mesh, &vec![true; model.objects.len()])?)
}

/// Measures wall and CPU time of parts of the program.
#[derive(Default)]
struct Clock {
    wall: Duration,
    cpu_s: f64,
}

impl Clock {
    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (start, cpu) = (Instant::now(), cpu_s());
        let out = work();
        self.wall += start.elapsed();
        self.cpu_s += cpu_s() - cpu;
        out
    }

    fn json(&self) -> Value {
        json!({ "wall_s": self.wall.as_secs_f64(), "cpu_s": self.cpu_s })
    }
}

/// Returns the time that the threads of the process have been running, seconds. Linux counts it in
/// nanoseconds in `schedstat`.
fn cpu_s() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let running = |task: std::fs::DirEntry| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    tasks.filter_map(running).sum::<f64>() * 1e-9
}

/// Returns the largest resident memory of the process, MiB.
fn peak_mib() -> anyhow::Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status").context("the peak memory is read from /proc")?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).context("no VmHWM in /proc/self/status")?;
    Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? / 1024.0)
}
