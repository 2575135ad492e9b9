//! Images of unlike kinds: floats of any scale, a large image beside a crop, a strip of overlap,
//! and a sharp image beside a coarse one. Tie points are found in each.

use camera::ImagePoint;
use formats::raster::{Band, BandData, write_image_with_rpc};
use jobs::dsm::{DsmConfig, DsmReport};
use numeric::Silent;
use raster::{Grid, Window};

use crate::stage::{EASY, Shot, Stage, look};

/// Makes a DSM of float images.
fn run_floats(images: &[(Grid<f32>, camera::Rpc)]) -> DsmReport {
    let folder = tempfile::tempdir().unwrap();
    let mut paths = Vec::new();
    for (number, (image, rpc)) in images.iter().enumerate() {
        let path = folder.path().join(format!("view_{number}.tif"));
        let bands = [Band { description: "reflectance", data: BandData::F32(image) }];
        write_image_with_rpc(&path, &bands, rpc, None, false).unwrap();
        paths.push(path);
    }
    let config = DsmConfig::new(paths, folder.path().join("out"));
    jobs::dsm::run(&config, &Silent).unwrap()
}

#[test]
fn float_images_of_any_scale_are_matched() {
    let observed = |report: &DsmReport| report.surface.counts.observed as f64 / report.surface.cells as f64;
    let expected = observed(&EASY.outcome.report);
    for [first, second] in [[1.0 / 2047.0, 1.0 / 2047.0], [1e-6, 3.7e8], [1.0, 1e-4]] {
        let scaled = |shot: &Shot, by: f32| (shot.image.map(|v| f32::from(*v) * by), shot.rpc.clone());
        let shots = &EASY.shots;
        let images = [scaled(&shots[0], first), scaled(&shots[1], second), scaled(&shots[2], first)];
        let report = run_floats(&images);
        assert!(report.pointing.inliers > 300, "scales {first} {second}: {:?}", report.pointing);
        assert!(observed(&report) > expected - 0.03, "scales {first} {second}: {:?}", report.surface);
    }
}

fn crop(shot: &Shot, [x, y]: [usize; 2], [width, height]: [usize; 2]) -> Shot {
    let window = Window { x: x as i64, y: y as i64, width, height };
    let rpc = shot.rpc.cropped(ImagePoint::new(x as f64, y as f64));
    Shot { image: shot.image.window(window, 0), rpc, ..shot.clone() }
}

fn ties(stage: &Stage, shots: &[Shot]) -> usize {
    let outcome = stage.run(shots, |_| {}).unwrap();
    assert!(outcome.report.warnings.is_empty(), "{:?}", outcome.report.warnings);
    outcome.report.pairs[0].ties
}

/// Spread over the whole image, a twelfth of the points would lie where the other one sees them.
#[test]
fn a_large_image_beside_a_crop_or_a_strip_has_tie_points_where_both_see() {
    let stage = Stage { size_px: 480, ..Stage::default() };
    let shots = stage.shots(&[look(12.0, 12.0, 0.5), look(12.0, 195.0, 0.5)]);
    let small = crop(&shots[1], [170, 190], [140, 140]);
    assert!(ties(&stage, &[shots[0].clone(), small.clone()]) > 150);
    assert!(ties(&stage, &[small, shots[0].clone()]) > 150);
    let strip = [crop(&shots[0], [0, 0], [480, 270]), crop(&shots[1], [0, 215], [480, 265])];
    assert!(ties(&stage, &strip) > 60);
}

#[test]
fn a_sharp_image_beside_one_of_a_quarter_of_its_resolution_has_tie_points() {
    let stage = Stage { size_px: 480, ..Stage::default() };
    let sharp = stage.shots(&[look(12.0, 12.0, 0.5), look(12.0, 195.0, 0.5)]);
    let mut coarse = sharp[1].clone();
    coarse.image = reduced(&reduced(&sharp[1].image));
    coarse.rpc = sharp[1].rpc.rescaled(0.25);
    let outcome = stage.run(&[sharp[0].clone(), coarse], |_| {}).unwrap();
    let pointing = &outcome.report.pointing;
    assert!(pointing.inliers > 80 && pointing.rms_px < 0.6, "{pointing:?}");
    assert!(outcome.report.warnings.is_empty(), "{:?}", outcome.report.warnings);
}

/// Means of squares of four pixels.
fn reduced(image: &Grid<u16>) -> Grid<u16> {
    let (w, h) = (image.width() / 2, image.height() / 2);
    let at = |x: usize, y: usize| u32::from(image[(x, y)]);
    let mean = |i: usize| {
        let (x, y) = (2 * (i % w), 2 * (i / w));
        ((at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1) + 2) / 4) as u16
    };
    Grid::from_vec(w, h, (0..w * h).map(mean).collect()).unwrap()
}
