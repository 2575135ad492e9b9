//! Footprints of splats in images whose projection is affine over a splat (EWA splatting, Zwicker
//! et al. 2001).
//!
//! With the Jacobian J of the projection, the covariance in the image is C = J Σ Jᵀ + the low-pass.
//! What is known of the depth at a pixel (u, v) is its mean under the Gaussian, d + gᵀ Σ Jᵀ (J Σ
//! Jᵀ)⁻¹ (u, v), with g the change of the depth in space. For a flat splat this is the depth of its
//! plane.

use crs::CrsError;
use gaussian::Splat;
use rayon::prelude::*;

use super::camera::{AffineCamera, Projection};
use super::hits::{ALPHA_MIN, Hit, TILE, reach};

/// Least variance in the image, px², so that a splat much smaller than a pixel still falls on one.
pub(super) const VARIANCE_MIN: f64 = 1e-3;
/// Number of splats projected at a time.
const CHUNK: usize = 4096;

/// A splat in the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct AffineFootprint {
    pub(super) splat: u32,
    centre: [f32; 2],
    /// Inverse covariance: xx, xy, yy.
    conic: [f32; 3],
    /// Half of the size of its bounding box, pixels.
    half: [f32; 2],
    opacity: f32,
    /// Local height of the centre, and its change per column and row on the plane of the splat,
    /// metres.
    height: f32,
    height_slope: [f32; 2],
    /// Depth of the centre, and its change per column and row.
    depth: f64,
    depth_slope: [f32; 2],
}

/// Returns the footprints that touch an image, front to back by their centres.
pub(super) fn footprints(
    splats: &[Splat],
    camera: &dyn AffineCamera,
    (width, height): (usize, usize),
    low_pass_px2: f64,
) -> Result<Vec<AffineFootprint>, CrsError> {
    let low_pass = low_pass_px2.max(VARIANCE_MIN);
    let chunks: Result<Vec<Vec<AffineFootprint>>, CrsError> = splats
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, part)| {
            let positions: Vec<[f64; 3]> = part.iter().map(|s| s.position.map(f64::from)).collect();
            let seen = camera.project(&positions)?;
            let numbered = (chunk * CHUNK..).zip(part).zip(seen);
            let made = numbered.filter_map(|((index, splat), seen)| footprint(index as u32, splat, &seen?, low_pass));
            Ok(made.filter(|f| f.touches(width, height)).collect())
        })
        .collect();
    let mut footprints = chunks?.concat();
    footprints.par_sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then(a.splat.cmp(&b.splat)));
    Ok(footprints)
}

/// Returns the footprints that touch each tile, row of tiles after row.
pub(super) fn tiles(footprints: &[AffineFootprint], (width, height): (usize, usize)) -> Vec<Vec<u32>> {
    let across = width.div_ceil(TILE);
    let mut tiles = vec![Vec::new(); across * height.div_ceil(TILE)];
    for (index, footprint) in footprints.iter().enumerate() {
        let [columns, rows] = footprint.tiles(width, height);
        for row in rows {
            for column in columns.clone() {
                tiles[row * across + column].push(index as u32);
            }
        }
    }
    tiles
}

impl AffineFootprint {
    /// Calls `add` with each pixel of a tile (column and row in the tile) that the splat falls on.
    pub(super) fn hits(
        &self,
        slot: u32,
        [left, top]: [usize; 2],
        [columns, rows]: [usize; 2],
        mut add: impl FnMut(usize, usize, Hit),
    ) {
        let range = |i: usize, first: usize, count: usize| {
            let low = (self.centre[i] - self.half[i] - first as f32).ceil().max(0.0) as usize;
            let high = (self.centre[i] + self.half[i] - first as f32).floor() + 1.0;
            low..(high.max(0.0) as usize).min(count)
        };
        for row in range(1, top, rows) {
            let dv = (top + row) as f32 - self.centre[1];
            for column in range(0, left, columns) {
                let du = (left + column) as f32 - self.centre[0];
                let q = self.conic[0] * du * du + 2.0 * self.conic[1] * du * dv + self.conic[2] * dv * dv;
                let alpha = self.opacity * (-0.5 * q).exp();
                if alpha >= ALPHA_MIN {
                    let depth = self.depth as f32 + self.depth_slope[0] * du + self.depth_slope[1] * dv;
                    let height = self.height + self.height_slope[0] * du + self.height_slope[1] * dv;
                    add(column, row, Hit { slot, alpha, depth, height });
                }
            }
        }
    }

    fn touches(&self, width: usize, height: usize) -> bool {
        let inside = |i: usize, size: usize| {
            self.centre[i] + self.half[i] >= 0.0 && self.centre[i] - self.half[i] <= size as f32 - 1.0
        };
        inside(0, width) && inside(1, height)
    }

    fn tiles(&self, width: usize, height: usize) -> [std::ops::Range<usize>; 2] {
        let range = |i: usize, size: usize| {
            let low = (self.centre[i] - self.half[i]).max(0.0) as usize / TILE;
            let high = (self.centre[i] + self.half[i]).clamp(0.0, size as f32 - 1.0) as usize / TILE;
            low..high + 1
        };
        [range(0, width), range(1, height)]
    }
}

/// Returns the footprint of a splat in the image; `None` when it has no extent there.
fn footprint(index: u32, splat: &Splat, seen: &Projection, low_pass: f64) -> Option<AffineFootprint> {
    let axes = splat.axes();
    let scales = splat.scale_m.map(f64::from);
    // The axes of the splat in the image, each as long as its standard deviation.
    let image =
        [0, 1, 2].map(|k| [0, 1].map(|i| scales[k] * (0..3).map(|a| seen.jacobian[i][a] * axes[k][a]).sum::<f64>()));
    let sum = |a: usize, b: usize| image.iter().map(|axis| axis[a] * axis[b]).sum::<f64>();
    let (xx, xy, yy) = (sum(0, 0) + low_pass, sum(0, 1), sum(1, 1) + low_pass);
    let det = xx * yy - xy * xy;
    if !(det > 0.0 && det.is_finite()) {
        return None;
    }
    let slope_of = |gradient: [f64; 3]| {
        let rise = [0, 1, 2].map(|k| scales[k] * (0..3).map(|a| gradient[a] * axes[k][a]).sum::<f64>());
        let [x, y] = [0, 1].map(|i| (0..3).map(|k| image[k][i] * rise[k]).sum::<f64>());
        let (xx, xy, yy) = (sum(0, 0) + VARIANCE_MIN, sum(0, 1), sum(1, 1) + VARIANCE_MIN);
        let det = xx * yy - xy * xy;
        [((yy * x - xy * y) / det) as f32, ((xx * y - xy * x) / det) as f32]
    };
    let reach = reach(splat.opacity);
    Some(AffineFootprint {
        splat: index,
        centre: seen.pixel.map(|c| c as f32),
        conic: [yy / det, -xy / det, xx / det].map(|c| c as f32),
        half: [(reach * xx.sqrt()) as f32, (reach * yy.sqrt()) as f32],
        opacity: splat.opacity,
        height: splat.position[2],
        height_slope: slope_of([0.0, 0.0, 1.0]),
        depth: seen.depth,
        depth_slope: slope_of(seen.depth_gradient),
    })
}
