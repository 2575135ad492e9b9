//! The order of the images inside a run, which follows from their content.
//!
//! Ties of equal merit, the first corner of a frame, and sums of floats depend on an order. With
//! that of the content the result has the same bytes in whatever order the images are given.
//! Messages and reports count the images as they were given.

use std::cmp::Ordering;

use reconstruct::ImagePair;

use crate::config::DsmConfig;
use crate::images::scene_image::SceneImage;

/// Sorts images by their RPCs and sizes, which no two images of a run share. Numbers are compared
/// in turn, so that the order survives the rounding of an RPC in another file format.
pub(crate) fn sort_by_content(images: &mut [SceneImage]) {
    images.sort_by(|a, b| by_camera(a, b).then(a.number.cmp(&b.number)));
}

/// Returns the configuration with the images, pairs and references in the order of `images`.
pub(crate) fn in_order_of(config: &DsmConfig, images: &[SceneImage]) -> DsmConfig {
    let place = |number: usize| images.iter().position(|image| image.number == number).unwrap_or(number);
    let moved = |pair: &ImagePair| ImagePair::new(place(pair.first), place(pair.second));
    DsmConfig {
        images: images.iter().map(|image| image.path.clone()).collect(),
        pairs: config.pairs.as_ref().map(|pairs| pairs.iter().map(moved).collect()),
        references: config.references.as_ref().map(|all| all.iter().map(|number| place(*number)).collect()),
        ..config.clone()
    }
}

/// Returns a pair with the positions at which its images were given, the lower one first.
pub(crate) fn as_given(pair: ImagePair, images: &[SceneImage]) -> ImagePair {
    ImagePair::new(images[pair.first].number, images[pair.second].number).ordered()
}

fn by_camera(a: &SceneImage, b: &SceneImage) -> Ordering {
    let (numbers, others) = (a.camera.rpc.numbers(), b.camera.rpc.numbers());
    let differing = numbers.zip(others).map(|(a, b)| a.total_cmp(&b)).find(|order| order.is_ne());
    differing.unwrap_or(Ordering::Equal).then(a.size.cmp(&b.size))
}
