//! Compares our results with the stored results of Open3D and with brute force over all triangles.

use numeric::vector::{cross, dot, sub};
use std::path::Path;

use anyhow::{Context, bail};
use formats::npy::{self, NpyData};
use priors::{MapConfig, PriorMaps, PriorModel, Rays, View, Visibility};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::VISIBILITY;
use super::scene::Scene;

/// A ray is tested by brute force at every n-th pixel of an image.
const EVERY: usize = 4_001;
/// Largest difference at which depths count as equal to the stored ones, metres.
const SAME_DEPTH_M: f32 = 1e-3;

/// Runs all checks. The rays with their exact depths (camera, column, row, z) go to a file.
pub(crate) fn all(city: &Path, rays: &Path) -> anyhow::Result<Value> {
    let reference = Scene::of_reference(city)?;
    Ok(json!({
        "tile": yardsticks(&Scene::of_tile(city)?)?,
        "reference_triangles": yardsticks(&reference)?,
        "brute_force": brute_force(&reference, rays)?,
    }))
}

/// Compares counts and sums of a scene with the stored ones.
fn yardsticks(scene: &Scene) -> anyhow::Result<Value> {
    let stats = scene.json("depth_o3d_100_stats.json")?;
    let rays = Rays::new(scene.lens())?;
    let (mut hits_off, mut sum_off, mut upwards_off) = (Vec::new(), Vec::new(), Vec::new());
    let (mut hits, mut sum) = (0, 0.0);
    for (index, view) in scene.views().enumerate() {
        let maps = PriorMaps::render(&scene.model, &view, &rays, MapConfig::default());
        let number = |i: usize| stats[index][i].as_f64().context("a number is missing in the statistics");
        let z: f64 = maps.depth_m.data().iter().filter(|d| d.is_finite()).map(|&d| f64::from(d)).sum();
        let upwards: f64 = maps.normal.data().iter().map(|n| f64::from(n[2].abs())).sum();
        hits_off.push((maps.hits() as f64 - number(0)?).abs());
        sum_off.push((z / number(1)? - 1.0).abs());
        upwards_off.push((upwards / number(2)? - 1.0).abs());
        hits += maps.hits();
        sum += z;
    }
    let subset: Vec<usize> = scene.json("cams.json")?["idx20"]
        .as_array()
        .context("no idx20")?
        .iter()
        .filter_map(|v| v.as_u64().map(|v| v as usize))
        .collect();
    let most = |numbers: &[f64]| numbers.iter().copied().fold(0.0, f64::max);
    Ok(json!({
        "triangles": scene.model.mesh().triangles.len(),
        "hits": hits,
        "sum_z_m": sum,
        "hits_off_per_camera": hits_off,
        "sum_z_off_at_most": most(&sum_off),
        "sum_nz_off_at_most": most(&upwards_off),
        "pixels_off_in_stored_maps": [stored_map(scene, &rays, "uav_002")?, stored_map(scene, &rays, "street_000")?],
        "visible_20": visible(scene, &subset)?,
        "visible_100": visible(scene, &(0..scene.cameras.views.len()).collect::<Vec<_>>())?,
    }))
}

/// Counts the pixels of a stored map that differ by more than a millimetre. Misses are stored as 0.
fn stored_map(scene: &Scene, rays: &Rays, name: &str) -> anyhow::Result<usize> {
    let index = scene.cameras.views.iter().position(|v| v.name.starts_with(name)).context("no such camera")?;
    let view = scene.views().nth(index).context("no such camera")?;
    let maps = PriorMaps::render(&scene.model, &view, rays, MapConfig::default());
    let path = scene.folder.join(format!("{name}_z.npy"));
    let NpyData::F32(stored) = npy::read(&path)?.data else { bail!("expected float32: {}", path.display()) };
    let differs = |(found, stored): (&f32, &f32)| match *stored {
        0.0 => found.is_finite(),
        depth => (found - depth).abs() > SAME_DEPTH_M || !found.is_finite(),
    };
    Ok(maps.depth_m.data().iter().zip(&stored).filter(|&pair| differs(pair)).count())
}

/// Returns the number of pairs, of points in at least one view and of points in at least two views.
fn visible(scene: &Scene, cameras: &[usize]) -> anyhow::Result<[u64; 3]> {
    let mut visibility = Visibility::new(&scene.model, &scene.points, VISIBILITY)?;
    let views: Vec<View> = scene.views().collect();
    cameras.iter().for_each(|&camera| {
        visibility.add(&views[camera]);
    });
    let found = visibility.finish();
    Ok([found.pairs, (scene.points.len() - found.histogram[0]) as u64, found.points.len() as u64])
}

/// Compares some rays of every camera with brute force over all triangles.
fn brute_force(scene: &Scene, out: &Path) -> anyhow::Result<Value> {
    let rays = Rays::new(scene.lens())?;
    let (mut rows, mut errors, mut other) = (Vec::new(), Vec::new(), 0);
    for (index, view) in scene.views().enumerate() {
        let maps = PriorMaps::render(&scene.model, &view, &rays, MapConfig::default());
        let pixels: Vec<usize> = ((37 * index) % EVERY..rays.width() * rays.height()).step_by(EVERY).collect();
        let exact: Vec<f64> = pixels.par_iter().map(|&pixel| nearest(&scene.model, &view, &rays, pixel)).collect();
        for (&pixel, &z) in pixels.iter().zip(&exact) {
            let found = f64::from(maps.depth_m.data()[pixel]);
            match z.is_finite() && found.is_finite() {
                true => errors.push((found - z).abs()),
                false => other += usize::from(z.is_finite() != found.is_finite()),
            }
            rows.extend([index as f64, (pixel % rays.width()) as f64, (pixel / rays.width()) as f64, z]);
        }
    }
    npy::write(out, &[rows.len() / 4, 4], &rows, true)?;
    let most = errors.iter().copied().fold(0.0, f64::max);
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    Ok(json!({ "rays": rows.len() / 4, "hits": errors.len(), "hit_by_one_only": other, "mean_m": mean, "max_m": most }))
}

/// Returns the z-depth of the nearest triangle (Möller and Trumbore 1997, f64), or infinity when
/// the ray meets none.
fn nearest(model: &PriorModel, view: &View, rays: &Rays, pixel: usize) -> f64 {
    let Some([x, y]) = rays.direction(pixel % rays.width(), pixel / rays.width()) else { return f64::INFINITY };
    let axes = view.pose.rotation;
    let direction = [0, 1, 2].map(|k| x * axes[0][k] + y * axes[1][k] + axes[2][k]);
    let depths = (0..model.mesh().triangles.len()).filter_map(|triangle| {
        let [a, b, c] = model.mesh().corners(triangle);
        let (ab, ac, to) = (sub(b, a), sub(c, a), sub(view.pose.centre, a));
        let p = cross(direction, ac);
        let inverse = 1.0 / dot(ab, p);
        let (u, q) = (dot(to, p) * inverse, cross(to, ab));
        let (v, z) = (dot(direction, q) * inverse, dot(ac, q) * inverse);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && z > 0.0).then_some(z)
    });
    depths.fold(f64::INFINITY, f64::min)
}
