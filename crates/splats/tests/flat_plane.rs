//! A flat, textured plane seen by two opposite oblique satellites: its splats, rendered through the
//! cameras of both, lie where the images have them.
//!
//! Splats of one plane overlap. Where the order of depth decided which of them is in front, every
//! seam would move away from the sensor, in opposite directions for opposite views.

use camera::{ImageCorrection, ImagePoint, Rpc, RpcCamera};
use crs::MapProjection;
use raster::{GeoTransform, Grid};
use splats::{MapSplatCamera, RpcSplatCamera, SplatConfig, SplatSurface, SplatView, make_splats, render};

const LON_LAT: [f64; 2] = [5.4, 43.53];
const HEIGHT_M: f64 = 50.0;
const GSD_M: f64 = 0.5;
const SIZE: usize = 160;

/// An image whose lines of sight lean `lean` metres east per metre of height.
fn satellite(lean: f64) -> RpcCamera {
    let half_m = GSD_M * SIZE as f64 / 2.0;
    let degree_m = 111_320.0;
    let term = |index: usize, value: f64| {
        let mut terms = [0.0; 20];
        terms[index] = value;
        terms
    };
    let mut samp_num = term(1, 1.0);
    samp_num[3] = -lean * 100.0 / half_m;
    let rpc = Rpc {
        line_off: 0.5 * SIZE as f64,
        samp_off: 0.5 * SIZE as f64,
        lat_off: LON_LAT[1],
        long_off: LON_LAT[0],
        height_off: HEIGHT_M,
        line_scale: 0.5 * SIZE as f64,
        samp_scale: 0.5 * SIZE as f64,
        lat_scale: half_m / degree_m,
        long_scale: half_m / degree_m / LON_LAT[1].to_radians().cos(),
        height_scale: 100.0,
        line_num: term(2, -1.0),
        line_den: term(0, 1.0),
        samp_num,
        samp_den: term(0, 1.0),
        err_bias_m: None,
        err_rand_m: None,
    };
    RpcCamera { rpc, correction: ImageCorrection::IDENTITY }
}

/// Brightness of the ground: slow waves under stripes of a few metres, as of a pavement.
fn texture(x: f64, y: f64) -> f32 {
    let waves = (0.31 * x + 0.17 * y).sin() * (0.23 * y - 0.11 * x).cos() + (0.71 * x - 0.53 * y).sin() * 0.5;
    let fine = (1.9 * x + 0.6 * y).sin() * (1.7 * y - 0.4 * x).sin();
    (500.0 + 120.0 * waves + 30.0 * fine) as f32
}

fn picture(camera: &RpcCamera, projection: &MapProjection, middle: [f64; 2]) -> Grid<[f32; 3]> {
    let value = |k: usize| {
        let at = ImagePoint::new((k % SIZE) as f64, (k / SIZE) as f64);
        let ground = camera.localize(at, HEIGHT_M).unwrap();
        let map = projection.map_from_lonlat(ground.lon_deg, ground.lat_deg).unwrap();
        [texture(map.x - middle[0], map.y - middle[1]); 3]
    };
    Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(value).collect()).unwrap()
}

/// Shift of a rendering against its image, columns and rows: least squares of the differences on
/// the gradients of the image, with a gain and an offset, until the steps are small.
fn shift(rendering: &Grid<[f32; 3]>, image: &Grid<[f32; 3]>) -> [f64; 2] {
    let mut shift = [0.0; 2];
    for _ in 0..12 {
        let mut normal = [[0.0; 5]; 4];
        for row in 20..SIZE - 20 {
            for column in 20..SIZE - 20 {
                let at = |dc: f64, dr: f64| {
                    let grid = |c: usize, r: usize| f64::from(rendering[(c, r)][0]);
                    let (x, y) = (column as f64 + shift[0] + dc, row as f64 + shift[1] + dr);
                    let (c, r) = (x.floor() as usize, y.floor() as usize);
                    let (u, v) = (x - x.floor(), y - y.floor());
                    (grid(c, r) * (1.0 - u) + grid(c + 1, r) * u) * (1.0 - v)
                        + (grid(c, r + 1) * (1.0 - u) + grid(c + 1, r + 1) * u) * v
                };
                let here = at(0.0, 0.0);
                let slopes = [0.5 * (at(1.0, 0.0) - at(-1.0, 0.0)), 0.5 * (at(0.0, 1.0) - at(0.0, -1.0))];
                // image = gain · rendering(x + shift) + offset, linear in the last two.
                let terms = [slopes[0], slopes[1], here, 1.0, f64::from(image[(column, row)][0])];
                for i in 0..4 {
                    for j in 0..5 {
                        normal[i][j] += terms[i] * terms[j];
                    }
                }
            }
        }
        for pivot in 0..4 {
            for other in (0..4).filter(|&other| other != pivot) {
                let factor = normal[other][pivot] / normal[pivot][pivot];
                let line = normal[pivot];
                normal[other].iter_mut().zip(line).for_each(|(value, above)| *value -= factor * above);
            }
        }
        let solution = [0, 1, 2].map(|i| normal[i][4] / normal[i][i]);
        (0..2).for_each(|axis| shift[axis] += solution[axis] / solution[2]);
    }
    shift
}

#[test]
fn opposite_views_of_a_plane_show_no_shift() {
    let projection = MapProjection::from_epsg(32631).unwrap();
    let middle = projection.map_from_lonlat(LON_LAT[0], LON_LAT[1]).unwrap();
    let middle = [middle.x, middle.y];
    let heights = Grid::filled(220, 220, HEIGHT_M as f32);
    let geotransform = GeoTransform::north_up(middle[0] - 55.0, middle[1] + 55.0, 0.5);
    let origin = [middle[0].round(), middle[1].round(), HEIGHT_M - 10.0];
    let surface = SplatSurface::new(&heights, geotransform, origin);
    let cameras = [-0.6, 0.6].map(satellite);
    let images = [0, 1].map(|i| picture(&cameras[i], &projection, middle));
    let views = [0, 1].map(|i| SplatView {
        camera: RpcSplatCamera::new(&cameras[i], &projection, origin, (SIZE, SIZE)).unwrap().unwrap(),
        image: &images[i],
    });
    // Of the image itself no shift is measured.
    assert!(shift(&images[0], &images[0]).iter().all(|s| s.abs() < 1e-6));
    for uniform_side in [None, Some(6)] {
        let scene =
            make_splats(&surface, None, &views, &SplatConfig { uniform_side, ..SplatConfig::default() }).unwrap();
        let shifts: Vec<[f64; 2]> = scene.renderings.iter().zip(&images).map(|(r, i)| shift(r, i)).collect();
        assert!(
            shifts.as_flattened().iter().all(|s| s.abs() < 0.05),
            "{uniform_side:?}: {shifts:?}, {} splats",
            scene.splats.len()
        );
    }
}

/// The seams between the blocks of a plane are covered like the blocks: no dark lattice.
#[test]
fn seams_of_large_blocks_are_covered() {
    let projection = MapProjection::from_epsg(32631).unwrap();
    let middle = projection.map_from_lonlat(LON_LAT[0], LON_LAT[1]).unwrap();
    let heights = Grid::filled(220, 220, HEIGHT_M as f32);
    let geotransform = GeoTransform::north_up(middle.x - 55.0, middle.y + 55.0, 0.5);
    let origin = [middle.x.round(), middle.y.round(), HEIGHT_M - 10.0];
    let surface = SplatSurface::new(&heights, geotransform, origin);
    let scene = make_splats(&surface, None, &[], &SplatConfig { walls: true, ..SplatConfig::default() }).unwrap();
    assert_eq!((scene.splats.len(), scene.report.walls), (49, 0));
    let above = render(&scene.splats, &MapSplatCamera::new(&surface).unwrap()).unwrap().coverage;
    let camera = satellite(0.6);
    let oblique = RpcSplatCamera::new(&camera, &projection, origin, (SIZE, SIZE)).unwrap().unwrap();
    let oblique = render(&scene.splats, &oblique).unwrap().coverage;
    for (coverage, size) in [(above, 220), (oblique, SIZE)] {
        let inner = (20..size - 20).flat_map(|row| &coverage.row(row)[20..size - 20]);
        let least = inner.copied().fold(1.0, f32::min);
        assert!(least > 0.92, "{least}");
    }
}
