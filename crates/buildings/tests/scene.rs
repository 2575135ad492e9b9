//! Drawn scenes: a house is found and a street is not, whatever the scale, the contrast and the
//! number of threads; noise has no buildings; what is refused.

use buildings::{BuildingIndex, BuildingIndexConfig, building_index};
use numeric::{Silent, SplitMix64};
use raster::{Grid, gaussian};

/// Draws houses of 16 m by 10 m, turned by 20°, with noise, on ground with a street; returns the
/// image and where houses are.
fn village(gsd_m: f64, contrast: f32, seed: u64) -> (Grid<f32>, Grid<bool>) {
    let side = (120.0 / gsd_m) as usize;
    let mut stream = SplitMix64::new(seed);
    let (mut image, mut truth) = (Grid::filled(side, side, 100.0f32), Grid::filled(side, side, false));
    let (sine, cosine) = 20.0f64.to_radians().sin_cos();
    for y in 0..side {
        for x in 0..side {
            let (east, north) = (x as f64 * gsd_m, y as f64 * gsd_m);
            let house = [(30.0, 30.0), (80.0, 35.0), (40.0, 90.0), (90.0, 90.0)].iter().any(|(u, v)| {
                let (a, b) = (cosine * (east - u) + sine * (north - v), cosine * (north - v) - sine * (east - u));
                a.abs() < 8.0 && b.abs() < 5.0
            });
            let is_street = (north - 60.0).abs() < 4.0;
            image[(x, y)] += contrast * f32::from(u8::from(house)) - 0.5 * contrast * f32::from(u8::from(is_street));
            truth[(x, y)] = house;
        }
    }
    let noise: Vec<f32> = (0..side * side).map(|_| stream.normal() as f32).collect();
    let noise = gaussian(&Grid::from_vec(side, side, noise).unwrap(), 0.7);
    image.data_mut().iter_mut().zip(noise.data()).for_each(|(pixel, z)| *pixel += 10.0 * z);
    (image, truth)
}

fn index(image: &Grid<f32>, gsd_m: f64) -> BuildingIndex {
    building_index(image, gsd_m, &BuildingIndexConfig::default(), &Silent).unwrap()
}

/// Area under the curve of precision over recall of the pixels.
fn average_precision(index: &Grid<f32>, truth: &Grid<bool>) -> f64 {
    let mut pixels: Vec<(f32, bool)> = index.data().iter().copied().zip(truth.data().iter().copied()).collect();
    pixels.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut right, mut sum) = (0.0, 0.0);
    for (rank, (_, is_house)) in pixels.iter().enumerate() {
        if *is_house {
            right += 1.0;
            sum += right / (rank + 1) as f64;
        }
    }
    sum / right
}

#[test]
fn houses_are_found_at_every_scale_and_contrast() {
    for (gsd_m, contrast) in [(0.3, 60.0), (0.5, 60.0), (0.5, 120.0), (0.7, 60.0)] {
        let (image, truth) = village(gsd_m, contrast, 5);
        let found = index(&image, gsd_m);
        let ap = average_precision(&found.index, &truth);
        assert!(ap > 0.9 && found.pairs > 0, "{gsd_m} m, {contrast}: {ap:.3}, {} pairs", found.pairs);
        assert!(found.index.data().iter().all(|v| (0.0..=1.0).contains(v)));
    }
}

#[test]
fn brightness_does_not_change_the_index() {
    let (image, _) = village(0.5, 60.0, 7);
    let (plain, scaled) = (index(&image, 0.5).index, index(&image.map(|v| 4.0 * v - 64.0), 0.5).index);
    let apart = plain.data().iter().zip(scaled.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(apart < 1e-3, "{apart}");
}

#[test]
fn noise_and_empty_images_have_no_buildings() {
    let mut stream = SplitMix64::new(3);
    let noise: Vec<f32> = (0..300 * 300).map(|_| stream.normal() as f32).collect();
    let noise = Grid::from_vec(300, 300, noise).unwrap();
    for image in [noise, Grid::filled(50, 40, 7.0), Grid::filled(1, 1, 7.0), Grid::filled(0, 0, 7.0)] {
        let found = index(&image, 0.5);
        let high = found.index.data().iter().filter(|v| **v > 0.3).count();
        assert!(high * 1000 <= found.index.data().len(), "{high} of {}", found.index.data().len());
    }
}

#[test]
fn holes_stay_holes_and_do_not_hide_houses() {
    let (mut image, truth) = village(0.5, 60.0, 9);
    for row in 0..20 {
        image.row_mut(row).fill(f32::NAN);
    }
    let found = index(&image, 0.5).index;
    assert!(found[(50, 10)].is_nan() && found[(50, 30)].is_finite());
    let known = |grid: &Grid<f32>| grid.map(|v| if v.is_nan() { 0.0 } else { *v });
    assert!(average_precision(&known(&found), &truth) > 0.9);
}

#[test]
fn threads_change_nothing() {
    let (image, _) = village(0.5, 60.0, 11);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| index(&image, 0.5).index.into_vec())
    };
    let bits = |values: Vec<f32>| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(with(1)), bits(with(3)));
}

#[test]
fn unusable_scales_and_parameters_are_refused() {
    let image = Grid::filled(30, 30, 1.0f32);
    let told = |gsd_m: f64, config: &BuildingIndexConfig| {
        building_index(&image, gsd_m, config, &Silent).unwrap_err().to_string()
    };
    let usual = BuildingIndexConfig::default();
    for gsd_m in [0.0, -1.0, 0.01, 5.0, f64::NAN] {
        assert!(told(gsd_m, &usual).contains("a pixel measures"), "{gsd_m}");
    }
    let mut wrong = usual;
    wrong.most_side_m = 1.0;
    assert!(told(0.5, &wrong).contains("longest side"));
    wrong = usual;
    wrong.half_saliency = f64::NAN;
    assert!(told(0.5, &wrong).contains("saliency"));
}
