//! Compares the maps of a box on a road with values computed by hand.

use camera::{Lens, LensModel};
use city::SurfaceClass;

use super::*;
use crate::model::tests::{cuboid, joined};
use crate::view::tests::{nadir, pinhole};
use numeric::vector::norm;

/// Makes a box of 8 × 6 × 3 m that is a building, on a large slab that is not.
fn model() -> PriorModel {
    let slab = cuboid([-50.0, -50.0, -1.0], [100.0, 100.0, 1.0]);
    PriorModel::new(joined(cuboid([0.0; 3], [8.0, 6.0, 3.0]), &slab), &[true, false]).unwrap()
}

fn render(view: &View, config: MapConfig) -> PriorMaps {
    PriorMaps::render(&model(), view, &Rays::new(&view.lens).unwrap(), config)
}

#[test]
fn a_roof_from_above() {
    let view = nadir([4.0, 3.0, 23.0], pinhole(41, 31, 20.0));
    let maps = render(&view, MapConfig::default());
    assert_eq!(maps.depth_m[(20, 15)], 20.0);
    assert_eq!(maps.normal[(20, 15)], [0.0, 0.0, 1.0]);
    assert_eq!((maps.class[(20, 15)], maps.object[(20, 15)]), (SurfaceClass::Roof as u8, 1));
    // 8 m by 6 m at 20 m distance with a focal length of 20 px: 4 px and 3 px around the middle.
    // Nothing else is a building.
    assert_eq!(maps.hits(), 9 * 7);
    for (column, row) in [(0, 0), (15, 15), (20, 19)] {
        assert_eq!(maps.depth_m[(column, row)], f32::INFINITY);
        assert_eq!(maps.normal[(column, row)], [0.0; 3]);
        assert_eq!((maps.class[(column, row)], maps.object[(column, row)]), (MISSING_CLASS, NO_OBJECT));
        assert!(!maps.mask()[(column, row)]);
    }
}

#[test]
fn ray_lengths_and_camera_normals() {
    let view = nadir([4.0, 3.0, 23.0], pinhole(41, 31, 20.0));
    let length = MapConfig { depth: DepthKind::RayLength, normals: NormalFrame::Camera };
    let (z, length) = (render(&view, MapConfig::default()), render(&view, length));
    let expected = 20.0 * (1.0f64 + 0.2 * 0.2 + 0.15 * 0.15).sqrt();
    assert_eq!(z.depth_m[(24, 12)], 20.0);
    assert!((f64::from(length.depth_m[(24, 12)]) - expected).abs() < 1e-5);
    assert_eq!(length.normal[(24, 12)], [0.0, 0.0, -1.0]);
}

#[test]
fn normals_are_turned_to_the_camera() {
    // The camera is inside the box, so every normal must face inwards.
    let view = nadir([4.0, 3.0, 2.0], pinhole(61, 61, 10.0));
    let maps = render(&view, MapConfig::default());
    assert_eq!(maps.hits(), 61 * 61);
    assert_eq!(maps.normal[(30, 30)], [0.0, 0.0, 1.0]);
    assert_eq!(maps.normal[(0, 30)], [1.0, 0.0, 0.0]);
    assert!(maps.normal.data().iter().all(|n| (norm(n.map(f64::from)) - 1.0).abs() < 1e-6));
}

#[test]
fn a_distorted_lens_sees_along_its_own_rays() {
    let lens = Lens::new(41, 31, LensModel::SimpleRadial, &[20.0, 20.0, 15.0, 6.0]).unwrap();
    let straight = render(&nadir([4.0, 3.0, 23.0], pinhole(41, 31, 20.0)), MapConfig::default());
    let bent = render(&nadir([4.0, 3.0, 23.0], lens), MapConfig::default());
    // A pincushion distortion moves the corners of the roof outwards, and not its middle.
    assert_eq!(bent.depth_m[(20, 15)], 20.0);
    assert!(bent.hits() > straight.hits(), "{} {}", bent.hits(), straight.hits());
    let fisheye = Lens::new(40, 40, LensModel::OpenCvFisheye, &[8.0, 8.0, 19.5, 19.5, 0.0, 0.0, 0.0, 0.0]).unwrap();
    let maps = render(&nadir([4.0, 3.0, 2.5], fisheye), MapConfig::default());
    // A corner lies 27.6 px off the axis, at 3.4 rad: behind the camera, where this lens sees
    // nothing.
    assert_eq!(maps.depth_m[(0, 0)], f32::INFINITY);
    assert_eq!(maps.depth_m[(19, 19)], 2.5);
}
