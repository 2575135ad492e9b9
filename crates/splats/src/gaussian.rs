//! The Gaussian of a block.
//!
//! The sides of the block become tangents T₁, T₂ on its plane, and the covariance is k² (T₁ T₁ᵀ +
//! T₂ T₂ᵀ) with k the spread. Seen from above, its standard deviations are k sides along columns
//! and rows whatever the slope. Tangents of a plane that slopes both ways are not at right angles,
//! so the axes of the Gaussian are the eigenvectors within the plane. The third axis is the normal,
//! with a small thickness.

use gaussian::{Splat, quaternion_of_axes};
use numeric::vector::{cross, dot, norm};

use super::{SplatBlock, SplatSurface};

/// Shape and opacity of the Gaussians of blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianConfig {
    /// Standard deviation in sides of the block.
    pub spread: f64,
    /// Standard deviation along the normal, metres.
    pub thickness_m: f64,
    /// Opacity of a splat with full confidence.
    pub opacity_max: f64,
    /// Opacity of a splat with zero confidence.
    pub opacity_min: f64,
}

impl Default for GaussianConfig {
    /// A spread of half a side: neighbours cross at 0.6 of their peak, and the corners between four
    /// are covered to 84 %.
    fn default() -> Self {
        Self { spread: 0.5, thickness_m: 0.02, opacity_max: 0.99, opacity_min: 0.3 }
    }
}

impl GaussianConfig {
    /// Returns the opacity of a confidence in 0 to 1; full opacity for NaN.
    pub fn opacity(&self, confidence: f64) -> f64 {
        let share = if confidence.is_finite() { confidence.clamp(0.0, 1.0) } else { 1.0 };
        self.opacity_min + (self.opacity_max - self.opacity_min) * share
    }
}

/// Returns the splat of a block.
pub fn splat_of_block(
    surface: &SplatSurface<'_>,
    block: &SplatBlock,
    colour: [f32; 3],
    confidence: f64,
    config: &GaussianConfig,
) -> Splat {
    let [by_column, by_row] = surface.steps();
    let side =
        |step: [f64; 2], rise: f64, cells: usize| [step[0], step[1], rise].map(|c| c * cells as f64 * config.spread);
    let first = side(by_column, block.plane.by_column_m, block.width);
    let second = side(by_row, block.plane.by_row_m, block.height);
    let [column, row] = block.middle();
    let position = surface.position(column, row, block.plane.middle_m);
    flat_splat(position, [first, second], [0.0, 0.0, 1.0], colour, confidence, config)
}

/// Returns the splat of a parallelogram on a wall, from its sides.
pub(super) fn upright_splat(
    position: [f64; 3],
    sides: [[f64; 3]; 2],
    outward: [f64; 2],
    colour: [f32; 3],
    confidence: f64,
    config: &GaussianConfig,
) -> Splat {
    let tangents = sides.map(|side| side.map(|c| c * config.spread));
    flat_splat(position, tangents, [outward[0], outward[1], 0.0], colour, confidence, config)
}

/// Returns a splat with the covariance of two tangents, whose normal is turned to `outside`.
fn flat_splat(
    position: [f64; 3],
    [first, second]: [[f64; 3]; 2],
    outside: [f64; 3],
    colour: [f32; 3],
    confidence: f64,
    config: &GaussianConfig,
) -> Splat {
    let (axes, scales) = own_axes(first, second, outside);
    let scale = |s: f64| s.max(1e-4) as f32;
    Splat {
        position: position.map(|c| c as f32),
        scale_m: [scale(scales[0]), scale(scales[1]), scale(config.thickness_m)],
        rotation: quaternion_of_axes(axes).map(|q| q as f32),
        colour,
        opacity: config.opacity(confidence).clamp(1e-3, 1.0 - 1e-3) as f32,
    }
}

/// Returns the axes of a Gaussian (the third is the normal, turned to `outside`) and the standard
/// deviations along the first two, from two tangents.
fn own_axes(first: [f64; 3], second: [f64; 3], outside: [f64; 3]) -> ([[f64; 3]; 3], [f64; 2]) {
    let unit = |a: [f64; 3]| {
        let length = norm(a).max(f64::MIN_POSITIVE);
        a.map(|c| c / length)
    };
    let mut normal = unit(cross(first, second));
    if dot(normal, outside) < 0.0 {
        normal = normal.map(|c| -c);
    }
    let e1 = unit(first);
    let e2 = cross(normal, e1);
    // The covariance within the plane, in the frame (e1, e2).
    let [a, b, d] = {
        let (u, v) = ([dot(first, e1), dot(second, e1)], [dot(first, e2), dot(second, e2)]);
        [u[0] * u[0] + u[1] * u[1], u[0] * v[0] + u[1] * v[1], v[0] * v[0] + v[1] * v[1]]
    };
    let angle = 0.5 * (2.0 * b).atan2(a - d);
    let (sin, cos) = angle.sin_cos();
    let t1 = [0, 1, 2].map(|i| cos * e1[i] + sin * e2[i]);
    let t2 = cross(normal, t1);
    let along = |s: f64, c: f64| (a * c * c + 2.0 * b * s * c + d * s * s).max(0.0).sqrt();
    ([t1, t2, normal], [along(sin, cos), along(cos, -sin)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;
    use proptest::prelude::*;
    use raster::{GeoTransform, Grid};

    proptest! {
        /// The covariance from above is that of the block, and the normal that of the plane, for
        /// turned grids too.
        #[test]
        fn the_gaussian_lies_on_its_block(
            slope in prop::array::uniform2(-1.0..1.0f64), width in 1..20usize, height in 1..20usize, turn in 0.0..6.3f64,
        ) {
            let heights = Grid::filled(32, 32, 0.0f32);
            let (s, c) = turn.sin_cos();
            let transform = GeoTransform([10.0, 0.5 * c, 0.5 * s, 20.0, 0.5 * s, -0.5 * c]);
            let surface = SplatSurface::new(&heights, transform, [10.0, 20.0, 0.0]);
            let plane = Plane { middle_m: 3.0, by_column_m: 0.5 * slope[0], by_row_m: 0.5 * slope[1] };
            let block = SplatBlock { column: 2, row: 3, width, height, plane };
            let config = GaussianConfig::default();
            let splat = splat_of_block(&surface, &block, [0.5; 3], 1.0, &config);
            prop_assert!(splat.validate().is_ok());
            let axes = splat.axes();
            let [step_c, step_r] = surface.steps();
            let covariance = |i: usize, j: usize| {
                (0..2).map(|k| f64::from(splat.scale_m[k]).powi(2) * axes[k][i] * axes[k][j]).sum::<f64>()
            };
            for (i, j) in [(0, 0), (0, 1), (1, 1)] {
                let expected = 0.25 * ((width * width) as f64 * step_c[i] * step_c[j] + (height * height) as f64 * step_r[i] * step_r[j]);
                prop_assert!((covariance(i, j) - expected).abs() < 1e-4 * (width * width + height * height) as f64);
            }
            let normal = splat.normal();
            let tangent = [step_c[0], step_c[1], plane.by_column_m];
            prop_assert!((0..3).map(|i| normal[i] * tangent[i]).sum::<f64>().abs() < 1e-5);
            prop_assert!(normal[2] > 0.0);
        }
    }

    #[test]
    fn confidence_becomes_opacity() {
        let config = GaussianConfig::default();
        assert_eq!((config.opacity(0.0), config.opacity(2.0), config.opacity(f64::NAN)), (0.3, 0.99, 0.99));
    }
}
