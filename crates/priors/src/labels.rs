//! Class and object of a city model carried onto splats of any origin.
//!
//! A splat takes the label of the nearest surface of the model when it lies on that surface: when
//! the root mean square of the distances of its mass is within a tolerance, d² + σ² ≤ t². Here d is
//! the distance of its centre, and σ its standard deviation towards the surface. A flat splat in a
//! roof has no σ and may be t away; a splat that stands across a wall, reaches over it, or is a
//! cloud larger than the tolerance has no label, however near its centre is.

use camera::Similarity;
use city::SurfaceClass;
use gaussian::{Splat, SplatLabel};
use rayon::prelude::*;

use crate::{PriorModel, PriorsError};
use numeric::vector::{dot, sub, unit};

/// Distance from a surface below which its normal is the direction to it, metres: positions of
/// splats are rounded to more than that.
const ON_SURFACE_M: f64 = 1e-6;

/// Returns the labels of splats. `mesh_from_splats` takes their frame to that of the model's mesh;
/// the tolerance is in metres of the mesh.
///
/// # Errors
/// [`PriorsError::Config`] when the tolerance is not positive and finite.
pub fn splat_labels(
    model: &PriorModel,
    splats: &[Splat],
    mesh_from_splats: &Similarity,
    tolerance_m: f64,
) -> Result<Vec<SplatLabel>, PriorsError> {
    if !(tolerance_m > 0.0 && tolerance_m.is_finite()) {
        let (name, expected) = ("the tolerance of labels", "more than 0 m");
        return Err(PriorsError::Config { name, value: tolerance_m, expected });
    }
    Ok(splats.par_iter().map(|splat| label(model, splat, mesh_from_splats, tolerance_m)).collect())
}

fn label(model: &PriorModel, splat: &Splat, to_mesh: &Similarity, tolerance_m: f64) -> SplatLabel {
    let centre = to_mesh.apply(splat.position.map(f64::from));
    let Some(near) = model.bvh().nearest(centre, tolerance_m) else { return SplatLabel::NONE };
    let triangle = near.triangle as usize;
    if !model.is_building(triangle) {
        return SplatLabel::NONE;
    }
    let towards = unit(sub(near.point, centre)).filter(|_| near.distance_m > ON_SURFACE_M);
    let towards = towards.unwrap_or(model.normal(triangle));
    let variance: f64 = (splat.axes().into_iter().zip(splat.scale_m))
        .map(|(axis, scale)| (to_mesh.scale() * f64::from(scale) * dot(to_mesh.turn(axis), towards)).powi(2))
        .sum();
    if near.distance_m.powi(2) + variance > tolerance_m.powi(2) {
        return SplatLabel::NONE;
    }
    let surface = model.mesh().surface(triangle);
    surface_label(surface.class, surface.object)
}

/// Returns the label of a surface of a class that belongs to the object of an index in its model.
pub fn surface_label(class: SurfaceClass, object: u32) -> SplatLabel {
    SplatLabel { class: class as u8, object: object.saturating_add(1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::{cuboid, joined};

    fn disc(position: [f32; 3], rotation: [f32; 4], scale_m: [f32; 3]) -> Splat {
        Splat { position, scale_m, rotation, colour: [0.5; 3], opacity: 0.9 }
    }

    /// Two houses of 8 × 6 × 3 m, 4 m apart.
    fn town() -> PriorModel {
        let mesh = joined(cuboid([0.0; 3], [8.0, 6.0, 3.0]), &cuboid([12.0, 0.0, 0.0], [8.0, 6.0, 3.0]));
        PriorModel::new(mesh, &[true, true]).unwrap()
    }

    const LEVEL: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
    const ROOF: u8 = SurfaceClass::Roof as u8;
    const WALL: u8 = SurfaceClass::Wall as u8;

    #[track_caller]
    fn check(splat: Splat, expected: Option<(u8, u32)>) {
        let found = splat_labels(&town(), &[splat], &Similarity::IDENTITY, 0.5).unwrap()[0];
        let expected = expected.map_or(SplatLabel::NONE, |(class, object)| SplatLabel { class, object });
        assert_eq!(found, expected, "{splat:?}");
    }

    #[test]
    fn splats_take_the_surface_that_they_lie_on() {
        let flat = [2.0, 2.0, 0.001];
        check(disc([4.0, 3.0, 3.4], LEVEL, flat), Some((ROOF, 1)));
        check(disc([16.0, 3.0, 2.7], LEVEL, flat), Some((ROOF, 2)));
        check(disc([4.0, 3.0, 3.6], LEVEL, flat), None);
        // A disc beside a wall reaches through it, one that stands in it does not.
        check(disc([8.2, 3.0, 1.5], LEVEL, [1.0, 1.0, 0.001]), None);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        check(disc([8.2, 3.0, 1.5], [half, 0.0, half, 0.0], [1.0, 1.0, 0.001]), Some((WALL, 1)));
        check(disc([11.8, 3.0, 1.5], [half, 0.0, half, 0.0], [1.0, 1.0, 0.001]), Some((WALL, 2)));
        // The mass of a cloud is not on the roof, though its centre is.
        check(disc([4.0, 3.0, 3.0], LEVEL, [0.4; 3]), Some((ROOF, 1)));
        check(disc([4.0, 3.0, 3.0], LEVEL, [0.6; 3]), None);
        // 0.3² + 0.4² = 0.5².
        check(disc([4.0, 3.0, 3.299], LEVEL, [0.4; 3]), Some((ROOF, 1)));
        check(disc([4.0, 3.0, 3.301], LEVEL, [0.4; 3]), None);
    }

    /// Labels do not depend on the frame that the splats are counted in.
    #[test]
    fn splats_of_another_frame_are_brought_to_the_model() {
        let turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh_from_splats = Similarity::new(2.0, turn, [5.0, -7.0, 1.0]).unwrap();
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let model = town();
        for (position, rotation, scale_m) in [
            ([4.0, 3.0, 3.4], LEVEL, [2.0, 2.0, 0.001]),
            ([8.2, 3.0, 1.5], [half, 0.0, half, 0.0], [1.0, 1.0, 0.001]),
            ([8.2, 3.0, 1.5], LEVEL, [1.0, 0.1, 0.001]),
        ] {
            let inside = disc(position, rotation, scale_m);
            let back = mesh_from_splats.inverse();
            let axes = inside.axes().map(|axis| back.turn(axis));
            let moved = Splat {
                position: back.apply(position.map(f64::from)).map(|c| c as f32),
                scale_m: scale_m.map(|s| s / 2.0),
                rotation: gaussian::quaternion_of_axes(axes).map(|c| c as f32),
                ..inside
            };
            let own = splat_labels(&model, &[inside], &Similarity::IDENTITY, 0.5).unwrap();
            assert_eq!(splat_labels(&model, &[moved], &mesh_from_splats, 0.5).unwrap(), own);
        }
    }

    #[test]
    fn other_objects_and_virtual_surfaces_give_no_label() {
        let mut mesh = joined(cuboid([0.0; 3], [8.0, 6.0, 3.0]), &cuboid([12.0, 0.0, 0.0], [8.0, 6.0, 3.0]));
        mesh.surfaces
            .iter_mut()
            .filter(|s| s.class == SurfaceClass::Roof)
            .for_each(|s| s.class = SurfaceClass::Closure);
        let model = PriorModel::new(mesh, &[true, false]).unwrap();
        let splats = [[4.0, 3.0, 3.0], [4.0, 0.1, 1.5], [16.0, 0.1, 1.5]].map(|at| disc(at, LEVEL, [0.1; 3]));
        let found = splat_labels(&model, &splats, &Similarity::IDENTITY, 0.5).unwrap();
        assert_eq!(found.iter().map(|label| label.object).collect::<Vec<_>>(), [0, 1, 0]);
        assert!(splat_labels(&model, &splats, &Similarity::IDENTITY, 0.0).is_err());
    }
}
