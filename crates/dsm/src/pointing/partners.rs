//! The pairs in which tie points are searched for.
//!
//! The pairs of a block grow with the square of the number of its images, and most of them add
//! nothing: the adjustment needs each part of an image tied to a few others, and all images tied to
//! one another. For each image the best partners over each of its parts are taken, and then the
//! best pairs that connect what is not connected yet, several times over, so that no wrong pair
//! separates two parts of the block.

use geo::Polygon;
use reconstruct::{ImagePair, Places, ViewGeometry, angle_merit};

use crate::images::scene_image::SceneImage;

/// Up to this many pairs, those of eight images, all are searched.
pub(crate) const ALL_MAX: usize = 28;
/// Partners over each part of an image. With four, a point is seen by five images, and one of them
/// may be wrong.
const PARTNERS: usize = 4;
/// Times that the images are connected by pairs of their own. With three, a wrong pair is outvoted.
const CONNECTIONS: usize = 3;
/// A satellite passes in less than this, seconds.
const PASS_S: i64 = 600;
/// The sun moves by less than this in one pass, degrees: 15° in an hour.
const PASS_SUN_DEG: f64 = 15.0 * PASS_S as f64 / 3600.0;
/// Worth of a pair of two passes against a pair of one: shadows, vehicles and plants have changed.
const OTHER_PASS: f64 = 0.5;
/// Least rating of an angle: what connects two strips may have a bad one.
const MERIT_MIN: f64 = 0.05;

/// Returns the pairs in which tie points are searched for, in the order of `useful`.
pub(crate) fn tie_pairs(images: &[SceneImage], geometry: &ViewGeometry, useful: &[ImagePair]) -> Vec<ImagePair> {
    if useful.len() <= ALL_MAX {
        return useful.to_vec();
    }
    let mut by_merit: Vec<(f64, ImagePair)> = useful.iter().map(|&p| (merit(images, geometry, p), p)).collect();
    by_merit.sort_by(|a, b| b.0.total_cmp(&a.0));
    let by_merit: Vec<ImagePair> = by_merit.into_iter().map(|(_, pair)| pair).collect();
    let mut taken: Vec<bool> = vec![false; by_merit.len()];
    for (image, outline) in geometry.outlines.iter().enumerate() {
        let partners = partners(image, outline, &by_merit, &geometry.outlines);
        let is_chosen = |pair: &ImagePair| pair.has(image) && partners.iter().any(|p| pair.has(*p));
        taken.iter_mut().zip(&by_merit).for_each(|(taken, pair)| *taken |= is_chosen(pair));
    }
    connect(images.len(), &by_merit, &mut taken);
    let chosen: Vec<ImagePair> = by_merit.iter().zip(&taken).filter(|(_, t)| **t).map(|(p, _)| *p).collect();
    useful.iter().copied().filter(|pair| chosen.contains(pair)).collect()
}

fn merit(images: &[SceneImage], geometry: &ViewGeometry, pair: ImagePair) -> f64 {
    let (angle_deg, overlap) = geometry.pair(pair).map_or((0.0, 0.0), |p| (p.angle_deg, p.overlap));
    let (first, second) = (&images[pair.first], &images[pair.second]);
    let apart_s = first.acquired_s.zip(second.acquired_s).map(|(a, b)| (a - b).abs());
    let sun_deg = first.sun.zip(second.sun).map(|(a, b)| a.angle_deg(&b));
    let other = apart_s.is_some_and(|s| s > PASS_S) || sun_deg.is_some_and(|deg| deg > PASS_SUN_DEG);
    let pass = if other { OTHER_PASS } else { 1.0 };
    pass * overlap * angle_merit(angle_deg).max(MERIT_MIN)
}

fn partners(image: usize, outline: &Polygon<f64>, by_merit: &[ImagePair], outlines: &[Polygon<f64>]) -> Vec<usize> {
    let own = by_merit.iter().filter(|pair| pair.has(image));
    let other = own.map(|pair| if pair.first == image { pair.second } else { pair.first });
    Places::over(outline).choose(other.map(|other| (other, &outlines[other])), PARTNERS)
}

/// Takes the best pairs that connect the images, [`CONNECTIONS`] times with pairs of their own. Of
/// those that are taken already as many as possible are used.
fn connect(images: usize, by_merit: &[ImagePair], taken: &mut [bool]) {
    let mut used = vec![false; by_merit.len()];
    for _ in 0..CONNECTIONS {
        let mut group: Vec<usize> = (0..images).collect();
        for is_old in [true, false] {
            for (index, pair) in by_merit.iter().enumerate() {
                let (a, b) = (group[pair.first], group[pair.second]);
                if used[index] || taken[index] != is_old || a == b {
                    continue;
                }
                group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
                (used[index], taken[index]) = (true, true);
            }
        }
    }
}
