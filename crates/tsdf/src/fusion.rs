//! Depth maps into a volume.
//!
//! At a voxel, a view with the depth D there says the distance (D − z) / truncation, at most 1; it
//! says nothing further than the truncation behind its surface. The distance of a voxel is the mean
//! over the views. Between four pixels whose depths differ by less than the truncation, depths are
//! interpolated; elsewhere the nearest counts.

use std::collections::BTreeSet;

use camera::{ImagePoint, Lens, Pose};
use raster::Grid;
use rayon::prelude::*;

use crate::mesh::FusedMesh;
use crate::volume::{BLOCK_BYTES, Block, BlockKey, SIDE, Voxel, surface};

/// A depth map with its camera.
#[derive(Debug, Clone, Copy)]
pub struct DepthView<'a> {
    /// Inner geometry of the camera.
    pub lens: &'a Lens,
    /// Pose of the camera.
    pub pose: &'a Pose,
    /// Depth along the optical axis, metres; NaN, 0 or less where there is none.
    pub depth_m: &'a Grid<f32>,
    /// Colours of the pixels, 0 to 1.
    pub colour: Option<&'a Grid<[f32; 3]>>,
}

/// How depth maps are fused.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TsdfConfig {
    /// Edge of a voxel, metres.
    pub voxel_m: f64,
    /// Distance from a surface beyond which nothing is said, metres.
    pub truncation_m: f64,
    /// Number of views that must have seen a place.
    pub least_views: u32,
    /// Greatest memory of the volume, bytes.
    pub memory_bytes: usize,
}

impl Default for TsdfConfig {
    fn default() -> Self {
        Self { voxel_m: 0.1, truncation_m: 0.4, least_views: 1, memory_bytes: 4 << 30 }
    }
}

/// Depth maps that cannot be fused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct FusionError(#[from] Reason);

/// Why depth maps cannot be fused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Reason {
    /// A length is not a positive number.
    #[error("the {name} is {found} m, expected more than 0")]
    Length {
        /// Name of the length.
        name: &'static str,
        /// Its value.
        found: f64,
    },
    /// A map does not have the size of its camera.
    #[error("the map of view {view} has {found:?} columns and rows, its camera {expected:?}")]
    Size {
        /// Number of the view from 0.
        view: usize,
        /// Columns and rows of the map.
        found: [usize; 2],
        /// Columns and rows of the camera.
        expected: [usize; 2],
    },
    /// No map has a depth.
    #[error("none of {views} maps has a depth")]
    NoDepth {
        /// Number of maps.
        views: usize,
    },
    /// The volume would take too much memory.
    #[error(
        "the volume around the surface takes more than {most} bytes at voxels of {voxel_m} m: use larger voxels or \
         fewer views"
    )]
    Memory {
        /// Bytes that are allowed.
        most: usize,
        /// Edge of a voxel, metres.
        voxel_m: f64,
    },
}

/// Fuses depth maps and returns the surface.
///
/// # Errors
/// [`FusionError`] for a length that is not positive, a map of another size than its camera, maps
/// without a depth, and a volume that takes too much memory.
pub fn fuse(views: &[DepthView<'_>], config: &TsdfConfig) -> Result<FusedMesh, FusionError> {
    for (name, found) in [("edge of a voxel", config.voxel_m), ("truncation", config.truncation_m)] {
        if !(found > 0.0 && found.is_finite()) {
            return Err(Reason::Length { name, found }.into());
        }
    }
    for (number, view) in views.iter().enumerate() {
        let expected = [view.lens.width(), view.lens.height()];
        let colour = view.colour.map(|colour| [colour.width(), colour.height()]);
        let sizes = [Some([view.depth_m.width(), view.depth_m.height()]), colour];
        if let Some(found) = sizes.into_iter().flatten().find(|found| *found != expected) {
            return Err(Reason::Size { view: number, found, expected }.into());
        }
    }
    let origin = origin(views).ok_or(Reason::NoDepth { views: views.len() })?;
    let fusion = Fusion { config, origin };
    let mut keys = BTreeSet::new();
    for view in views {
        fusion.add_blocks(view, &mut keys)?;
    }
    let mut blocks: Vec<Block> = keys.into_iter().map(Block::new).collect();
    blocks.par_iter_mut().for_each(|block| views.iter().for_each(|view| fusion.integrate(view, block)));
    Ok(surface(&blocks, origin, config.voxel_m, config.least_views.max(1) as f32))
}

/// Returns a position near the surface, in whole metres: that of the first depth.
fn origin(views: &[DepthView<'_>]) -> Option<[f64; 3]> {
    let first = |view: &DepthView<'_>| {
        let width = view.depth_m.width();
        let pixels = view.depth_m.data().iter().enumerate();
        let mut seen = pixels.filter_map(|(i, depth)| {
            known(*depth)?;
            point(view, [i % width, i / width], f64::from(*depth))
        });
        seen.next()
    };
    views.iter().find_map(first).map(|p| p.map(f64::floor))
}

fn known(depth: f32) -> Option<f64> {
    (depth > 0.0 && depth.is_finite()).then_some(f64::from(depth))
}

/// Returns the position at a depth of a pixel.
fn point(view: &DepthView<'_>, [x, y]: [usize; 2], depth: f64) -> Option<[f64; 3]> {
    let [u, v] = view.lens.direction(ImagePoint::new(x as f64, y as f64))?;
    let [right, down, forward] = view.pose.rotation;
    let along = |i: usize| depth * (u * right[i] + v * down[i] + forward[i]);
    Some([0, 1, 2].map(|i| view.pose.centre[i] + along(i)))
}

struct Fusion<'a> {
    config: &'a TsdfConfig,
    origin: [f64; 3],
}

impl Fusion<'_> {
    fn block_m(&self) -> f64 {
        SIDE as f64 * self.config.voxel_m
    }

    /// Adds the blocks within the truncation of the depths of a view.
    fn add_blocks(&self, view: &DepthView<'_>, keys: &mut BTreeSet<BlockKey>) -> Result<(), Reason> {
        let (width, truncation) = (view.depth_m.width(), self.config.truncation_m);
        // Half a block along the ray, also where the ray is slanted in the image.
        let steps = (4.0 * truncation / self.block_m()).ceil().max(1.0) as usize;
        let row = |(y, depths): (usize, &[f32])| {
            let mut found = BTreeSet::new();
            for (x, depth) in depths.iter().enumerate() {
                let Some(depth) = known(*depth) else { continue };
                for step in 0..=steps {
                    let at = depth + truncation * (2.0 * step as f64 / steps as f64 - 1.0);
                    let Some(p) = point(view, [x, y], at) else { continue };
                    found.insert([0, 1, 2].map(|i| ((p[i] - self.origin[i]) / self.block_m()).floor() as i32));
                }
            }
            found
        };
        let rows: Vec<BTreeSet<BlockKey>> = view.depth_m.data().par_chunks(width.max(1)).enumerate().map(row).collect();
        for found in rows {
            keys.extend(found);
            if keys.len() > self.config.memory_bytes / BLOCK_BYTES {
                return Err(Reason::Memory { most: self.config.memory_bytes, voxel_m: self.config.voxel_m });
            }
        }
        Ok(())
    }

    /// Adds what a view says to the voxels of a block.
    fn integrate(&self, view: &DepthView<'_>, block: &mut Block) {
        let half_m = 0.5 * self.block_m();
        let middle = [0, 1, 2].map(|i| self.origin[i] + f64::from(block.key[i]) * self.block_m() + half_m);
        // Three half edges are more than the half diagonal.
        let reach_m = 3.0 * half_m;
        let [x, y, z] = view.pose.camera_from_world(middle);
        let [fx, fy] = view.lens.focal_px();
        if z < -reach_m {
            return;
        }
        if z > 2.0 * reach_m
            && let Some(at) = view.lens.project(x / z, y / z)
        {
            // Lenses with distortion are bent by less than the reach at this distance is wide.
            let margin = 4.0 * reach_m / (z - reach_m) * fx.max(fy);
            let beyond = |at: f64, size: usize| !(-margin..=size as f64 + margin).contains(&at);
            if beyond(at.sample, view.lens.width()) || beyond(at.line, view.lens.height()) {
                return;
            }
        }
        for number in 0..block.voxels.len() {
            let place = block.place(number);
            let position = [0, 1, 2].map(|i| self.origin[i] + f64::from(place[i]) * self.config.voxel_m);
            self.add(view, position, &mut block.voxels[number]);
        }
    }

    fn add(&self, view: &DepthView<'_>, position: [f64; 3], voxel: &mut Voxel) {
        let [x, y, z] = view.pose.camera_from_world(position);
        if z <= 0.0 {
            return;
        }
        let Some(at) = view.lens.project(x / z, y / z) else { return };
        let Some((depth, pixel)) = self.depth(view.depth_m, at) else { return };
        let distance = (depth - z) / self.config.truncation_m;
        if distance < -1.0 {
            return;
        }
        voxel.distance += distance.min(1.0) as f32;
        voxel.weight += 1.0;
        if let Some(colour) = view.colour.filter(|_| distance < 1.0) {
            let seen = colour.data()[pixel];
            if seen.iter().all(|c| c.is_finite()) {
                (0..3).for_each(|i| voxel.colour[i] += seen[i]);
                voxel.coloured += 1.0;
            }
        }
    }

    /// Returns the depth at an image position, and the nearest pixel.
    fn depth(&self, depths: &Grid<f32>, at: ImagePoint) -> Option<(f64, usize)> {
        let (width, height) = (depths.width(), depths.height());
        let (column, row) = (at.sample.round(), at.line.round());
        if !(column >= 0.0 && row >= 0.0 && column < width as f64 && row < height as f64) {
            return None;
        }
        let pixel = row as usize * width + column as usize;
        let nearest = known(depths.data()[pixel])?;
        let (x0, y0) = (at.sample.floor(), at.line.floor());
        if x0 < 0.0 || y0 < 0.0 || x0 as usize + 1 >= width || y0 as usize + 1 >= height {
            return Some((nearest, pixel));
        }
        let first = y0 as usize * width + x0 as usize;
        let four = [first, first + 1, first + width, first + width + 1].map(|i| known(depths.data()[i]));
        let [Some(a), Some(b), Some(c), Some(d)] = four else { return Some((nearest, pixel)) };
        if a.max(b).max(c).max(d) - a.min(b).min(c).min(d) > self.config.truncation_m {
            return Some((nearest, pixel));
        }
        let (s, t) = (at.sample - x0, at.line - y0);
        Some(((a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t, pixel))
    }
}

#[cfg(test)]
mod tests {
    use camera::LensModel;

    use super::*;

    const CENTRE: [f64; 3] = [690_000.3, 4_820_000.7, 105.2];
    const RADIUS_M: f64 = 2.0;

    /// A camera that looks at the ball from a direction, and the depths that it sees, also of a
    /// floor below.
    fn ball(angle: f64, up: f64) -> (Lens, Pose, Grid<f32>) {
        let size = [160, 120];
        let lens = Lens::new(size[0], size[1], LensModel::Pinhole, &[140.0, 140.0, 79.5, 59.5]).unwrap();
        let away = [9.0 * angle.cos(), 9.0 * angle.sin(), up];
        let length = away.iter().map(|c| c * c).sum::<f64>().sqrt();
        let forward = away.map(|c| -c / length);
        let level = forward[0].hypot(forward[1]);
        let right = [forward[1] / level, -forward[0] / level, 0.0];
        let down = [-forward[2] * right[1], forward[2] * right[0], -level];
        let pose = Pose { rotation: [right, down, forward], centre: [0, 1, 2].map(|i| CENTRE[i] + away[i]) };
        let depth = |pixel: usize| {
            let at = ImagePoint::new((pixel % size[0]) as f64, (pixel / size[0]) as f64);
            let [u, v] = lens.direction(at).unwrap();
            let ray = [0, 1, 2].map(|i| u * right[i] + v * down[i] + forward[i]);
            let (a, b) = (ray.iter().map(|c| c * c).sum::<f64>(), (0..3).map(|i| ray[i] * away[i]).sum::<f64>());
            let c = away.iter().map(|c| c * c).sum::<f64>() - RADIUS_M * RADIUS_M;
            let within = b * b - a * c;
            if within > 0.0 { ((-b - within.sqrt()) / a) as f32 } else { f32::NAN }
        };
        let depths = Grid::from_vec(size[0], size[1], (0..size[0] * size[1]).map(depth).collect()).unwrap();
        (lens, pose, depths)
    }

    fn fused(config: &TsdfConfig) -> FusedMesh {
        let seen: Vec<_> = (0..8).map(|k| ball(f64::from(k) * 0.785, if k % 2 == 0 { 6.0 } else { -6.0 })).collect();
        let views: Vec<_> =
            seen.iter().map(|(lens, pose, depth_m)| DepthView { lens, pose, depth_m, colour: None }).collect();
        fuse(&views, config).unwrap()
    }

    #[test]
    fn a_ball_comes_back_closed_and_turned_outside() {
        let mesh = fused(&TsdfConfig::default());
        let out = |p: &[f32; 3]| [0, 1, 2].map(|i| f64::from(p[i]) + mesh.origin[i] - CENTRE[i]);
        let error = |p: &[f32; 3]| out(p).iter().map(|c| c * c).sum::<f64>().sqrt() - RADIUS_M;
        let mut errors: Vec<f64> = mesh.positions.iter().map(|p| error(p).abs()).collect();
        errors.sort_by(f64::total_cmp);
        assert!(errors[errors.len() / 2] < 0.01 && errors[errors.len() * 99 / 100] < 0.06, "{:?}", errors.last());
        let (mut outwards, mut area) = (0usize, 0.0f64);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| out(&mesh.positions[corner as usize]));
            let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            outwards += usize::from((0..3).map(|i| n[i] * a[i]).sum::<f64>() > 0.0);
            area += 0.5 * n.iter().map(|c| c * c).sum::<f64>().sqrt();
        }
        assert!(outwards * 1000 > 999 * mesh.triangles.len(), "{outwards} of {}", mesh.triangles.len());
        let expected = 4.0 * std::f64::consts::PI * RADIUS_M * RADIUS_M;
        // Closed and single. It is a little rough where views see it at its rim.
        assert!((area / expected - 1.0).abs() < 0.05, "{area} is not {expected} m²");
    }

    #[test]
    fn threads_change_nothing() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fused(&TsdfConfig { voxel_m: 0.3, truncation_m: 0.9, ..TsdfConfig::default() }))
        };
        assert_eq!(run(1), run(2));
    }

    #[test]
    fn what_cannot_be_fused_is_said() {
        let (lens, pose, depth_m) = ball(0.3, 4.0);
        let view = DepthView { lens: &lens, pose: &pose, depth_m: &depth_m, colour: None };
        let refused = |view, config: TsdfConfig| fuse(&[view], &config).unwrap_err().to_string();
        let plain = TsdfConfig::default();
        assert!(refused(view, TsdfConfig { voxel_m: 0.0, ..plain }).contains("edge of a voxel is 0"));
        assert!(refused(view, TsdfConfig { memory_bytes: 1 << 20, ..plain }).contains("larger voxels"));
        let small = Grid::filled(3, 2, 1.0f32);
        assert!(refused(DepthView { depth_m: &small, ..view }, plain).contains("[3, 2] columns"));
        let empty = Grid::filled(160, 120, f32::NAN);
        assert!(refused(DepthView { depth_m: &empty, ..view }, plain).contains("none of 1 maps"));
    }
}
