//! COLMAP's conventions for pixels, parameters and names.

use std::path::{Component, Path};

use camera::{ImagePoint, Lens, LensModel};

/// COLMAP puts the centre of the upper-left pixel at (0.5, 0.5), this toolkit puts it at (0, 0).
pub(super) const PIXEL_SHIFT: f64 = 0.5;

/// Converts a pixel from COLMAP's convention to this toolkit's.
pub(super) fn pixel_from_colmap([x, y]: [f64; 2]) -> ImagePoint {
    ImagePoint { sample: x - PIXEL_SHIFT, line: y - PIXEL_SHIFT }
}

/// Converts a pixel from this toolkit's convention to COLMAP's.
pub(super) fn colmap_from_pixel(pixel: ImagePoint) -> ImagePoint {
    ImagePoint { sample: pixel.sample + PIXEL_SHIFT, line: pixel.line + PIXEL_SHIFT }
}

/// Returns COLMAP's parameters of a lens, with the principal point in COLMAP's pixels.
pub(super) fn colmap_parameters(lens: &Lens) -> Vec<f64> {
    let mut parameters = lens.parameters();
    let first = principal_point_index(lens.model());
    parameters[first..first + 2].iter_mut().for_each(|c| *c += PIXEL_SHIFT);
    parameters
}

/// Returns the index of the principal point among the parameters: it follows one or two focal
/// lengths.
pub(super) fn principal_point_index(model: LensModel) -> usize {
    use LensModel::{Radial, RadialFisheye, SimplePinhole, SimpleRadial, SimpleRadialFisheye};
    match model {
        SimplePinhole | SimpleRadial | Radial | SimpleRadialFisheye | RadialFisheye => 1,
        _ => 2,
    }
}

/// Returns whether an image name stays inside the folder of the images.
pub(crate) fn is_inside(name: &str) -> bool {
    let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    !name.is_empty() && inside && !name.contains(['\\', '\0'])
}

/// Returns the beginning of a text, for an error message.
pub(super) fn shorten(text: &str) -> String {
    text.chars().take(60).collect()
}
