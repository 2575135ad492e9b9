//! Flat Gaussians to start a training with: one per point, in its tangent plane, as wide as the
//! spacing of the points.
//!
//! The standard deviation is half of the spacing. Gaussians on a square lattice then add up to a
//! constant within 3 %. The disk of two standard deviations has the spacing as radius, which an
//! adaptive sample keeps within its error. The thickness is a hundredth of the standard deviation
//! (2DGS has no third scale). The opacity is 0.1, the initial value of 3DGS, which training raises.

use gaussian::Splat;

use crate::Sample;
use numeric::vector::{Vector, cross, unit};

/// Opacity before the training.
const OPACITY: f32 = 0.1;
/// Ratio of thickness to width.
const FLATNESS: f32 = 0.01;
/// Smallest standard deviation, metres. Only samples that were not made by
/// [`sample`](crate::sample) have a spacing of 0.
const LEAST: f32 = 1e-6;

/// Makes splats from points and their colours (red, green, blue from 0 to 1).
///
/// Their positions are relative to the same origin as the points.
pub fn initial_splats<'a>(points: impl IntoIterator<Item = (&'a Sample, [f32; 3])>) -> Vec<Splat> {
    points.into_iter().map(|(point, colour)| splat(point, colour)).collect()
}

fn splat(point: &Sample, colour: [f32; 3]) -> Splat {
    let normal = unit(point.normal.map(f64::from)).unwrap_or([0.0, 0.0, 1.0]);
    let sigma = (0.5 * point.spacing_m).max(LEAST);
    Splat {
        position: point.position.map(|c| c as f32),
        scale_m: [sigma, sigma, FLATNESS * sigma],
        rotation: from_up(normal).map(|c| c as f32),
        colour,
        opacity: OPACITY,
    }
}

/// Returns the shortest rotation from (0, 0, 1) to a unit vector, as a quaternion (w, x, y, z) with
/// w ≥ 0.
fn from_up(normal: Vector) -> [f64; 4] {
    const UP: Vector = [0.0, 0.0, 1.0];
    // The rotation to straight down is half a turn about any horizontal axis.
    if normal[2] < -1.0 + 1e-12 {
        return [0.0, 1.0, 0.0, 0.0];
    }
    let axis = cross(UP, normal);
    let whole = [1.0 + normal[2], axis[0], axis[1], axis[2]];
    let length = whole.iter().map(|c| c * c).sum::<f64>().sqrt();
    whole.map(|c| c / length)
}

#[cfg(test)]
mod tests {
    use city::SurfaceClass;
    use proptest::prelude::*;

    use super::*;
    use numeric::vector::{norm, sub};

    fn point(normal: Vector) -> Sample {
        Sample {
            position: [1.0, 2.0, 3.0],
            normal: normal.map(|c| c as f32),
            spacing_m: 0.4,
            triangle: 0,
            object: 0,
            class: SurfaceClass::Roof,
        }
    }

    proptest! {
        #[test]
        fn a_splat_lies_in_the_surface(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64) {
            prop_assume!(norm([x, y, z]) > 1e-3);
            let normal = unit([x, y, z]).unwrap();
            let made = splat(&point(normal), [0.5; 3]);
            prop_assert_eq!(made.validate(), Ok(()));
            prop_assert!(norm(sub(made.normal(), normal)) < 1e-5);
            prop_assert!(made.rotation[0] >= 0.0);
        }
    }

    #[test]
    fn straight_up_and_down() {
        for normal in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]] {
            let made = initial_splats([(&point(normal), [0.1, 0.2, 0.3])]);
            assert_eq!((made[0].normal(), made[0].scale_m), (normal, [0.2, 0.2, 0.002]));
        }
        let bare = Sample { spacing_m: 0.0, normal: [0.0; 3], ..point([0.0, 0.0, 1.0]) };
        assert_eq!(initial_splats([(&bare, [0.5; 3])])[0].validate(), Ok(()));
    }
}
