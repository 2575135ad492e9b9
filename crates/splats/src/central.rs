//! Footprints of splats in images of perspective cameras: the rays of the pixels meet the Gaussians
//! in space.
//!
//! In the frame of a Gaussian's standard deviations a ray is o + t d, and its least distance from
//! the centre is |o × d| / |d|, at t = −o·d / |d|². For a flat splat this is where the ray meets
//! its plane. No derivative of the projection is involved, so a splat beside the camera, or one
//! that reaches behind it, keeps its shape. The low-pass is a sphere as large as the pixel is at
//! the distance of the splat. It widens the opacity; the depth is that of the splat itself, no
//! further from its centre than it reaches.

use camera::{ImagePoint, Lens, Pose};
use gaussian::Splat;
use numeric::vector::{cross, dot};
use rayon::prelude::*;

use super::affine::VARIANCE_MIN;
use super::hits::{ALPHA_MIN, Hit, TILE, reach};

/// Depth below which a perspective camera draws nothing, metres.
const NEAR_M: f64 = 0.1;

/// Directions of the pixels of a lens, scaled to a depth of 1.
pub(super) struct Rays {
    width: usize,
    directions: Vec<[f64; 2]>,
    /// Up in the axes of the camera, and the height of the camera.
    up: [f64; 3],
    height: f64,
}

/// A splat before the camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct CentralFootprint {
    pub(super) splat: u32,
    /// From directions in the camera to the frame of the standard deviations, row by row.
    frame: [[f64; 3]; 3],
    /// The camera in this frame.
    from: [f64; 3],
    opacity: f32,
    /// Variances with the low-pass, in those without.
    widened: [f64; 3],
    /// Greatest squared distance that counts.
    reach2: f64,
    /// Least and greatest x / z and y / z.
    bounds: [[f64; 2]; 2],
    depth: f64,
    /// Least and greatest depth of the splat.
    range: [f64; 2],
}

impl Rays {
    pub(super) fn new(lens: &Lens, pose: &Pose) -> Self {
        let width = lens.width();
        let direction = |k: usize| {
            let at = ImagePoint::new((k % width) as f64, (k / width) as f64);
            lens.direction(at).unwrap_or([f64::NAN; 2])
        };
        let directions = (0..width * lens.height()).into_par_iter().map(direction).collect();
        Self { width, directions, up: [0, 1, 2].map(|k| pose.rotation[k][2]), height: pose.centre[2] }
    }

    /// Least and greatest x / z and y / z of a rectangle of pixels; pixels without a ray have no
    /// part.
    fn bounds(&self, [left, top]: [usize; 2], [columns, rows]: [usize; 2]) -> [[f64; 2]; 2] {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for row in top..top + rows {
            for at in &self.directions[row * self.width + left..][..columns] {
                for (range, value) in bounds.iter_mut().zip(at) {
                    *range = [range[0].min(*value), range[1].max(*value)];
                }
            }
        }
        bounds
    }
}

/// Returns the footprints before a camera, front to back by their centres.
pub(super) fn footprints(splats: &[Splat], lens: &Lens, pose: &Pose, low_pass_px2: f64) -> Vec<CentralFootprint> {
    let focal = lens.focal_px();
    let pixel2 = low_pass_px2.max(VARIANCE_MIN) / (focal[0] * focal[1]);
    let made = splats.par_iter().enumerate().filter_map(|(index, splat)| footprint(index as u32, splat, pose, pixel2));
    let mut footprints: Vec<CentralFootprint> = made.collect();
    footprints.par_sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then(a.splat.cmp(&b.splat)));
    footprints
}

/// Returns the footprints that may touch each tile, row of tiles after row.
pub(super) fn tiles(footprints: &[CentralFootprint], rays: &Rays, (width, height): (usize, usize)) -> Vec<Vec<u32>> {
    let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let row_of_tiles = |row: usize| {
        let (top, rows) = (row * TILE, TILE.min(height - row * TILE));
        let near: Vec<u32> = {
            let bounds = rays.bounds([0, top], [width, rows]);
            (0..footprints.len() as u32).filter(|&k| footprints[k as usize].is_within(&bounds)).collect()
        };
        let tile = |column: usize| {
            let bounds = rays.bounds([column * TILE, top], [TILE.min(width - column * TILE), rows]);
            near.iter().copied().filter(|&k| footprints[k as usize].is_within(&bounds)).collect::<Vec<u32>>()
        };
        (0..across).map(tile).collect::<Vec<_>>()
    };
    (0..down).into_par_iter().map(row_of_tiles).collect::<Vec<_>>().concat()
}

/// Returns the footprint of a splat; `None` when all of it is behind the camera. `pixel2` is the
/// variance of the low-pass at a depth of 1.
fn footprint(index: u32, splat: &Splat, pose: &Pose, pixel2: f64) -> Option<CentralFootprint> {
    let centre = pose.camera_from_world(splat.position.map(f64::from));
    let low_pass = pixel2 * centre[2].abs().max(NEAR_M).powi(2);
    let own = splat.scale_m.map(|s| f64::from(s).powi(2));
    let scales = own.map(|variance| (variance + low_pass).sqrt());
    let axes = splat.axes().map(|axis| pose.rotation.map(|row| dot(row, axis)));
    let reach = reach(splat.opacity);
    // The covariance, as large as the splat reaches.
    let sum = |a: usize, b: usize| (0..3).map(|k| (reach * scales[k]).powi(2) * axes[k][a] * axes[k][b]).sum::<f64>();
    let (z, zz) = (centre[2], sum(2, 2));
    let behind = z - zz.sqrt() <= NEAR_M;
    if z + zz.sqrt() <= NEAR_M || !zz.is_finite() {
        return None;
    }
    // Planes x = u z that touch the ellipsoid: (x − u z)² is the variance of x − u z.
    let touching = |axis: usize| {
        let [a, b, c] = [z * z - zz, centre[axis] * z - sum(axis, 2), centre[axis].powi(2) - sum(axis, axis)];
        let root = (b * b - a * c).max(0.0).sqrt();
        [(b - root) / a, (b + root) / a]
    };
    let frame = [0, 1, 2].map(|k| axes[k].map(|c| c / scales[k]));
    Some(CentralFootprint {
        splat: index,
        frame,
        from: frame.map(|row| -dot(row, centre)),
        opacity: splat.opacity,
        widened: own.map(|variance| (variance + low_pass) / variance),
        reach2: reach * reach,
        bounds: if behind { [[f64::NEG_INFINITY, f64::INFINITY]; 2] } else { [touching(0), touching(1)] },
        depth: z,
        range: [(z - zz.sqrt()).max(NEAR_M), z + zz.sqrt()],
    })
}

impl CentralFootprint {
    fn is_within(&self, bounds: &[[f64; 2]; 2]) -> bool {
        self.bounds.iter().zip(bounds).all(|(own, other)| own[0] <= other[1] && other[0] <= own[1])
    }

    /// Calls `add` with each pixel of a tile (column and row in the tile) that the splat falls on.
    pub(super) fn hits(
        &self,
        rays: &Rays,
        slot: u32,
        [left, top]: [usize; 2],
        [columns, rows]: [usize; 2],
        mut add: impl FnMut(usize, usize, Hit),
    ) {
        let [[u0, u1], [v0, v1]] = self.bounds;
        for row in 0..rows {
            let along = &rays.directions[(top + row) * rays.width + left..][..columns];
            for (column, &[u, v]) in along.iter().enumerate() {
                // Not met by NaN either.
                if !(u >= u0 && u <= u1 && v >= v0 && v <= v1) {
                    continue;
                }
                let direction = [u, v, 1.0];
                let by = self.frame.map(|row| dot(row, direction));
                let length2 = dot(by, by);
                let across = cross(self.from, by);
                let (nearest, q) = (-dot(self.from, by) / length2, dot(across, across) / length2);
                if nearest > NEAR_M && q <= self.reach2 {
                    let alpha = self.opacity * (-0.5 * q as f32).exp();
                    if alpha >= ALPHA_MIN {
                        let own = [0, 1, 2].map(|k| self.widened[k] * by[k]);
                        let depth = (-dot(self.from, own) / dot(by, own)).clamp(self.range[0], self.range[1]);
                        let height = (rays.height + depth * dot(rays.up, direction)) as f32;
                        add(column, row, Hit { slot, alpha, depth: depth as f32, height });
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::NEAR_M;
    use crate::camera::LOW_PASS_PX2;
    use crate::{LensSplatCamera, render};
    use camera::{Lens, LensModel, Pose};
    use gaussian::{Splat, quaternion_of_axes};
    use numeric::vector::{cross, dot, normalized, sub};
    use proptest::prelude::*;

    /// A level camera at a height that looks north, with the horizon in row 60.
    fn level(height: f64) -> (Lens, Pose) {
        let lens = Lens::new(160, 121, LensModel::Pinhole, &[90.0, 90.0, 79.5, 60.0]).unwrap();
        let rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        (lens, Pose { rotation, centre: [0.0, 0.0, height] })
    }

    /// Level splats of any size, in a row under the camera and beside it, leave the sky clear, and
    /// the ground is where it is. By derivatives of the projection they would smear over both.
    #[test]
    fn ground_under_the_camera_does_not_reach_into_the_sky() {
        let (lens, pose) = level(1.6);
        for sigma in [0.5f32, 2.0, 8.0] {
            let at = |i: usize| [(i % 21) as f32 - 10.0, (i / 21) as f32 - 6.0].map(|c| c * sigma);
            let splat = |i: usize| Splat {
                position: [at(i)[0], at(i)[1], 0.0],
                scale_m: [sigma, sigma, 0.02],
                rotation: [1.0, 0.0, 0.0, 0.0],
                colour: [1.0; 3],
                opacity: 0.99,
            };
            let splats: Vec<Splat> = (0..21 * 40).map(splat).collect();
            let seen = render(&splats, &LensSplatCamera { lens: &lens, pose: &pose }).unwrap();
            assert!((0..57).all(|row| seen.coverage.row(row).iter().all(|&c| c < 0.01)), "{sigma}");
            for row in 70..121 {
                let expected = 1.6 * 90.0 / (row as f32 - 60.0);
                for column in [0, 40, 79, 159] {
                    let aside = (column as f32 - 79.5).abs() / 90.0 * expected;
                    if aside > 9.0 * sigma || expected > 30.0 * sigma {
                        continue;
                    }
                    let found = seen.median_depth_m[(column, row)];
                    assert!(seen.coverage[(column, row)] > 0.99, "{sigma}: {column} {row}");
                    assert!((found - expected).abs() < 0.02 * expected, "{sigma}: {column} {row} {found} {expected}");
                }
            }
        }
    }

    proptest! {
        /// A flat splat has, on the ray of each pixel, its opacity where the ray is nearest to it
        /// in standard deviations that the low-pass widens, and the depth at which the ray meets
        /// its plane.
        #[test]
        fn rays_meet_the_plane_of_a_splat(
            position in (-4.0..4.0f64, 2.0..12.0f64, -1.0..4.0f64), normal in prop::array::uniform3(-1.0..1.0f64),
            scales in prop::array::uniform2(0.3..3.0f64),
        ) {
            prop_assume!(dot(normal, normal) > 0.1);
            let normal = normalized(normal);
            let first = normalized(cross(normal, if normal[2].abs() < 0.7 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] }));
            let axes = [first, cross(normal, first), normal];
            let centre = [position.0, position.1, position.2];
            let splat = Splat {
                position: centre.map(|c| c as f32),
                scale_m: [scales[0] as f32, scales[1] as f32, 1e-4],
                rotation: quaternion_of_axes(axes).map(|c| c as f32),
                colour: [1.0; 3],
                opacity: 0.9,
            };
            let (lens, pose) = level(1.6);
            let seen = render(&[splat], &LensSplatCamera { lens: &lens, pose: &pose }).unwrap();
            let from = sub(pose.centre, centre);
            let low_pass = LOW_PASS_PX2 * (centre[1] / 90.0).powi(2);
            let variances = [scales[0], scales[1], 1e-4].map(|scale| scale * scale + low_pass);
            // The product of two vectors by the inverse covariance.
            let product = |a, b| (0..3).map(|k| dot(a, axes[k]) * dot(b, axes[k]) / variances[k]).sum::<f64>();
            for (column, row) in (0..160).step_by(9).flat_map(|c| (0..121).step_by(8).map(move |r| (c, r))) {
                let direction = [(column as f64 - 79.5) / 90.0, 1.0, -(row as f64 - 60.0) / 90.0];
                let slant = dot(direction, normal);
                if slant.abs() < 0.2 {
                    continue;
                }
                let t = -dot(from, normal) / slant;
                let nearest = -product(from, direction) / product(direction, direction);
                if (nearest - NEAR_M).abs() < 1e-3 {
                    continue;
                }
                let q = product(from, from) - nearest * nearest * product(direction, direction);
                let expected = if nearest > NEAR_M { 0.9 * (-0.5 * q).exp() } else { 0.0 };
                let found = f64::from(seen.coverage[(column, row)]);
                prop_assert!((found - expected).abs() < 0.005, "{column} {row}: {found} {expected}");
                if found > 0.5 {
                    let depth = f64::from(seen.median_depth_m[(column, row)]);
                    prop_assert!((depth - t).abs() < 0.02 * t + 0.02, "{column} {row}: {depth} {t}");
                }
            }
        }
    }
}
