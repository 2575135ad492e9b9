//! The splats that a training begins with: points of the dataset, coloured and turned as the views
//! that see them say. Views that are held out say nothing.

use ::train::{Surfel, SurfelCamera};
use formats::colmap::ColmapPoint;
use gaussian::quaternion_of_axes;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::dataset::TrainData;

/// Neighbours whose mean distance is the spacing of the points.
const NEIGHBOURS: usize = 3;
/// Standard deviation of a splat in spacings, so that neighbours overlap.
const SPREAD: f64 = 0.6;
/// Logit of the opacity at the beginning: one half.
const OPACITY_LOGIT: f32 = 0.0;

/// Returns at most `most` splats.
pub(super) fn surfels(data: &TrainData, most: usize) -> Vec<Surfel> {
    let every = data.points.len().div_ceil(most.max(1)).max(1);
    // Points of the same place follow each other along a curve, so that every n-th is spread well.
    let all: Vec<Surfel> = data.points.iter().map(|p| at(p.position)).collect();
    let order = ::train::spatial_order(&all);
    let chosen: Vec<&ColmapPoint> = order.iter().step_by(every).map(|&i| &data.points[i as usize]).collect();
    let place = |(number, point): (usize, &&ColmapPoint)| GeomWithData::new(point.position, number);
    let tree = RTree::bulk_load(chosen.iter().enumerate().map(place).collect());
    chosen.iter().map(|point| surfel(data, point, spacing(&tree, point.position))).collect()
}

fn at(position: [f64; 3]) -> Surfel {
    Surfel { position: position.map(|c| c as f32), ..Surfel::default() }
}

/// Returns the mean distance of the nearest points.
fn spacing(tree: &RTree<GeomWithData<[f64; 3], usize>>, position: [f64; 3]) -> f64 {
    let near = tree.nearest_neighbor_iter(&position).skip(1).take(NEIGHBOURS);
    let distance =
        |p: &GeomWithData<[f64; 3], usize>| (0..3).map(|i| (p.geom()[i] - position[i]).powi(2)).sum::<f64>().sqrt();
    let (sum, count) = near.fold((0.0, 0.0), |(sum, count), p| (sum + distance(p), count + 1.0));
    if count > 0.0 { (sum / count).max(1e-4) } else { 1.0 }
}

fn surfel(data: &TrainData, point: &ColmapPoint, spacing: f64) -> Surfel {
    let (mut colour, mut normal, mut seen) = ([0.0f32; 3], [0.0f64; 3], 0.0f32);
    let seeing = point.track.iter().filter_map(|o| data.view_of.get(o.view as usize).copied().flatten());
    for view in seeing.filter(|view| !data.held_out[*view]).map(|view| &data.views[view]) {
        let Some(local) = view.camera.local(0, point.position) else { continue };
        let [width, height] = view.camera.size;
        let [x, y] = local.pixel.map(f64::round);
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
            continue;
        }
        let pixel = y as usize * width + x as usize;
        let colours = view.colour.each_ref().map(|plane| plane[pixel]);
        if colours.iter().all(|c| c.is_finite()) {
            (0..3).for_each(|i| colour[i] += colours[i]);
            seen += 1.0;
        }
        // Without a prior, a splat looks at the cameras that see it.
        let prior = view.prior_normal.as_ref().map(|n| n.each_ref().map(|plane| f64::from(plane[pixel])));
        let towards = [0, 1, 2].map(|i| (view.camera.centre[i] - point.position[i]) * 1e-6);
        let known = prior.filter(|n| n.iter().all(|c| c.is_finite()));
        (0..3).for_each(|i| normal[i] += known.unwrap_or(towards)[i]);
    }
    let colour = if seen > 0.0 { colour.map(|c| c / seen) } else { point.color.map(|c| f32::from(c) / 255.0) };
    Surfel {
        rotation: quaternion_of_axes(axes(normal)).map(|c| c as f32),
        log_scale: [(SPREAD * spacing).ln() as f32; 2],
        opacity_logit: OPACITY_LOGIT,
        colour,
        ..at(point.position)
    }
}

/// Returns two axes across a direction, and the direction; upwards where it has no length.
fn axes(direction: [f64; 3]) -> [[f64; 3]; 3] {
    let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
    let n = if length > 0.0 { direction.map(|c| c / length) } else { [0.0, 0.0, 1.0] };
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let other = if n[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = cross(other, n);
    let size = u.iter().map(|c| c * c).sum::<f64>().sqrt();
    let u = u.map(|c| c / size);
    [u, cross(n, u), n]
}
