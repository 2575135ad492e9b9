//! Images taken from the same place at the same time, such as the panchromatic and the
//! multispectral image of a pass. The pointing correction of one holds for the other.

use camera::{ImageCorrection, ImagePoint, Rpc};

/// Pixels on a side of the lattice on which two cameras are compared.
const SIDE: usize = 5;
/// Share of the domain of an RPC that the lattice covers, along lines, samples and heights.
const COVERED: f64 = 0.8;
/// Largest residual of two cameras that look from the same place, pixels. The detectors of one
/// instrument look at a spot within a second of each other; two passes differ by tens of pixels.
const RESIDUAL_MAX_PX: f64 = 0.5;

/// Returns the correction of an image that follows from that of another one, and the residual with
/// which the two look from the same place, pixels; `None` where they do not.
pub(crate) fn carried(correction: &ImageCorrection, of: &Rpc, to: &Rpc) -> Option<(ImageCorrection, f64)> {
    let (map, residual_px) = same_view(of, to)?;
    Some((map.inverse()?.then(correction).then(&map), residual_px))
}

/// Fits the affine map from the pixels of one image to those of another that show the same ground
/// at all heights.
fn same_view(of: &Rpc, to: &Rpc) -> Option<(ImageCorrection, f64)> {
    let mut pixels = Vec::with_capacity(SIDE.pow(3));
    let along = |i: usize| COVERED * (2.0 * i as f64 / (SIDE - 1) as f64 - 1.0);
    for i in 0..SIDE.pow(3) {
        let [u, v, w] = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE].map(along);
        let at = ImagePoint::new(to.samp_off + u * to.samp_scale, to.line_off + v * to.line_scale);
        let ground = to.localize(at, to.height_off + w * to.height_scale).ok()?;
        pixels.push((of.project(ground).ok()?, at));
    }
    let n = pixels.len() as f64;
    let mean = |pick: &dyn Fn(&(ImagePoint, ImagePoint)) -> f64| pixels.iter().map(pick).sum::<f64>() / n;
    let centre = ImagePoint::new(mean(&|p| p.0.sample), mean(&|p| p.0.line));
    let middle = ImagePoint::new(mean(&|p| p.1.sample), mean(&|p| p.1.line));
    // Normal equations of the linear part: the sums of products of the centred positions.
    let (mut own, mut cross) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
    for (from, at) in &pixels {
        let from = [from.sample - centre.sample, from.line - centre.line];
        let at = [at.sample - middle.sample, at.line - middle.line];
        for (row, at) in at.iter().enumerate() {
            (0..2).for_each(|column| cross[row][column] += at * from[column]);
        }
        for (row, value) in from.iter().enumerate() {
            (0..2).for_each(|column| own[row][column] += value * from[column]);
        }
    }
    let [[a, b], [c, d]] = own;
    let determinant = a * d - b * c;
    let inverse = [[d / determinant, -b / determinant], [-c / determinant, a / determinant]];
    let product = |row: usize, column: usize| (0..2).map(|k| cross[row][k] * inverse[k][column]).sum::<f64>();
    let map = ImageCorrection {
        translation_px: [middle.sample - centre.sample, middle.line - centre.line],
        linear: [[product(0, 0) - 1.0, product(0, 1)], [product(1, 0), product(1, 1) - 1.0]],
        centre,
    };
    let residual = |(from, at): &(ImagePoint, ImagePoint)| {
        let found = map.apply(*from);
        (found.sample - at.sample).hypot(found.line - at.line)
    };
    let largest_px =
        pixels.iter().map(residual).fold(0.0, |a: f64, b| if b.is_nan() { f64::INFINITY } else { a.max(b) });
    (largest_px <= RESIDUAL_MAX_PX).then_some((map, largest_px))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn rpc(view: usize) -> Rpc {
        let town = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
        formats::rpc::read_for_image(&town.join(format!("view_{view}.tif"))).unwrap().rpc
    }

    /// The multispectral image has a quarter of the resolution and begins elsewhere.
    #[test]
    fn the_coarse_image_of_a_pass_follows_the_fine_one() {
        let (fine, correction) = (rpc(1), ImageCorrection::translation(6.0, -4.0));
        let coarse = fine.cropped(ImagePoint::new(-13.0, 40.0)).rescaled(0.25);
        let (found, residual_px) = carried(&correction, &fine, &coarse).unwrap();
        let at = found.apply(ImagePoint::new(90.0, 70.0));
        assert!((at.sample - 91.5).abs() < 1e-6 && (at.line - 69.0).abs() < 1e-6, "{at:?}");
        assert!(residual_px < 1e-6, "{residual_px}");
        for other in [2, 3] {
            assert!(carried(&correction, &rpc(other), &coarse).is_none());
        }
    }
}
