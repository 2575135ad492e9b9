//! Checks a box in UTM zone 31 under an affine RPC that views it from the west.

use camera::{ImageCorrection, ImagePoint, Rpc, RpcCamera};
use city::{ModelPoint, SurfaceClass, TriangleMesh};
use crs::MapProjection;
use geodesy::LonLatHeight;

use super::*;
use crate::model::tests::cuboid;
use numeric::vector::sub;

const PLACE: LonLatHeight = LonLatHeight { lon_deg: 5.4, lat_deg: 43.53, height_m: 200.0 };
const SIZE: (usize, usize) = (150, 120);

/// Makes an RPC with pixels of about half a metre. Higher points move east in the image by a third
/// of their height.
fn camera() -> RpcCamera {
    let (mut samp_num, mut line_num, mut den) = ([0.0; 20], [0.0; 20], [0.0; 20]);
    (samp_num[1], samp_num[3], line_num[2], den[0]) = (1.0, 0.35, -1.0, 1.0);
    // Second-order terms that are large enough for the rays not to be parallel.
    (samp_num[4], line_num[7]) = (0.02, 0.03);
    let rpc = Rpc {
        line_off: 60.0,
        samp_off: 75.0,
        lat_off: PLACE.lat_deg,
        long_off: PLACE.lon_deg,
        height_off: PLACE.height_m,
        line_scale: 400.0,
        samp_scale: 400.0,
        lat_scale: 200.0 / 111_100.0,
        long_scale: 200.0 / 80_700.0,
        height_scale: 200.0,
        line_num,
        line_den: den,
        samp_num,
        samp_den: den,
        err_bias_m: None,
        err_rand_m: None,
    };
    let correction = ImageCorrection { translation_px: [1.5, -0.75], ..ImageCorrection::IDENTITY };
    RpcCamera { rpc, correction }
}

fn scene() -> (PriorModel, MapProjection) {
    let projection = MapProjection::from_epsg(32631).unwrap();
    let at = projection.map_from_lonlat(PLACE.lon_deg, PLACE.lat_deg).unwrap();
    let origin = ModelPoint::new(at.x.round(), at.y.round(), 190.0);
    let mesh = TriangleMesh { origin, ..cuboid([-10.0, -8.0, 5.0], [20.0, 16.0, 12.0]) };
    (PriorModel::new(mesh, &[true]).unwrap(), projection)
}

#[test]
fn what_is_seen_projects_to_its_pixel() {
    let ((model, projection), camera) = (scene(), camera());
    let lines = LinesOfSight::new(&camera, SIZE, &model, &projection).unwrap();
    assert!(lines.error_m() <= 1e-3, "{}", lines.error_m());
    let maps = SatelliteMaps::render(&model, &lines).unwrap();
    let (mut roofs, mut walls) = (0, 0);
    for row in 0..SIZE.1 {
        for column in 0..SIZE.0 {
            let at = (column, row);
            let (height, seen) = (maps.height_m[at], maps.mask()[at]);
            assert_eq!(seen, height.is_finite() && maps.distance_m[at].is_finite());
            if !seen {
                assert_eq!((maps.class[at], maps.normal[at]), (MISSING_CLASS, [0.0; 3]));
                continue;
            }
            let ray = lines.ray(column, row).unwrap();
            let t = f64::from(maps.distance_m[at]) / norm(ray.direction);
            let [x, y, z] = along(ray.origin, t, ray.direction);
            assert!((z + 190.0 - f64::from(height)).abs() < 1e-4);
            let (lon, lat) = projection.lonlat_from_map(x + model.mesh().origin.x, y + model.mesh().origin.y).unwrap();
            let back = camera.project(LonLatHeight::new(lon, lat, f64::from(height))).unwrap();
            let off = (back.sample - column as f64).hypot(back.line - row as f64);
            assert!(off < 5e-3, "{at:?} comes back {off} px away");
            let [east, north, up] = maps.normal[at];
            if maps.class[at] == SurfaceClass::Roof as u8 {
                assert!((height - 207.0).abs() < 1e-3 && up > 0.999_999, "{at:?}");
                roofs += 1;
            } else {
                // The meridian convergence is sin(43.53°) · 2.4° = 0.02885 rad here, so that a
                // narrow strip of the south wall is visible.
                let expected = if east.abs() > 0.5 { [-0.99958, 0.02885] } else { [-0.02885, -0.99958] };
                let off = (f64::from(east) - expected[0]).hypot(f64::from(north) - expected[1]);
                assert!(off < 1e-4 && up == 0.0, "{:?}", maps.normal[at]);
                walls += 1;
            }
        }
    }
    // 20 × 16 m of roof and 12 m of wall under 0.35, in pixels of half a metre.
    assert!((roofs as f64 / 1_280.0 - 1.0).abs() < 0.05, "{roofs}");
    assert!((walls as f64 / 269.0 - 1.0).abs() < 0.10, "{walls}");
    assert_eq!(maps.hits(), roofs + walls);
}

#[test]
fn an_image_of_another_place_sees_nothing() {
    let ((model, projection), mut camera) = (scene(), camera());
    camera.rpc.long_off += 0.2;
    let lines = LinesOfSight::new(&camera, (33, 1), &model, &projection).unwrap();
    assert_eq!(SatelliteMaps::render(&model, &lines).unwrap().hits(), 0);
    assert!(lines.ray(33, 0).is_none() && lines.ray(0, 1).is_none());
    let empty = PriorModel::new(TriangleMesh::default(), &[]).unwrap();
    assert_eq!(LinesOfSight::new(&camera, SIZE, &empty, &projection).unwrap_err(), PriorsError::NothingToSee);
}

#[test]
fn lines_between_the_nodes_are_those_of_the_rpc() {
    let ((model, projection), camera) = (scene(), camera());
    let lines = LinesOfSight::new(&camera, SIZE, &model, &projection).unwrap();
    for (column, row) in [(0, 0), (149, 119), (31, 77), (64, 64), (100, 3)] {
        let ray = lines.ray(column, row).unwrap();
        let pixel = ImagePoint { sample: column as f64, line: row as f64 };
        let ground = camera.localize(pixel, lines.from_height_m()).unwrap();
        let map = projection.map_from_lonlat(ground.lon_deg, ground.lat_deg).unwrap();
        let exact = [map.x - model.mesh().origin.x, map.y - model.mesh().origin.y, lines.from_height_m() - 190.0];
        assert!(norm(sub(ray.origin, exact)) < 1e-3, "{column}, {row}");
    }
}
