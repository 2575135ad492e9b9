//! The height of the ground under the camera.
//!
//! Where the camera stands is known from the outside, how high is not: by convention it stands 2 m above what is under it. That is
//! the surface at the middle of the tile, between its pixels; where the surface has a hole there, the lowest of
//! the nearest pixels within [`GROUND_REACH_M`].

use raster::{Grid, bilinear};

/// How far from the camera ground is looked for, metres.
pub const GROUND_REACH_M: f64 = 5.0;

/// The height at the middle of a tile of `resolution_px_per_m`, in the heights' own measure; `None` where there is none near.
pub fn ground_height(heights: &Grid<f32>, resolution_px_per_m: f64) -> Option<f64> {
    let middle = |pixels: usize| (pixels as f64 - 1.0) / 2.0;
    let (column, row) = (middle(heights.width()), middle(heights.height()));
    let under = bilinear(heights, column, row);
    if under.is_finite() {
        return Some(f64::from(under));
    }
    let reach = (GROUND_REACH_M * resolution_px_per_m).ceil();
    let span = |at: f64, pixels: usize| (at - reach).max(0.0) as usize..((at + reach) as usize + 1).min(pixels);
    let mut best: Option<(f64, f32)> = None;
    for r in span(row, heights.height()) {
        for c in span(column, heights.width()) {
            let (height, apart) = (heights[(c, r)], (c as f64 - column).hypot(r as f64 - row));
            let closer = |&(known, lowest): &(f64, f32)| apart < known || (apart == known && height < lowest);
            if height.is_finite() && apart <= reach && best.as_ref().is_none_or(closer) {
                best = Some((apart, height));
            }
        }
    }
    best.map(|(_, height)| f64::from(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_middle_or_the_lowest_of_the_nearest() {
        let mut heights = Grid::from_vec(4, 4, (0..16).map(|i| i as f32).collect()).unwrap();
        assert_eq!(ground_height(&heights, 2.0), Some(7.5));
        heights[(1, 1)] = f32::NAN;
        assert_eq!(ground_height(&heights, 2.0), Some(6.0));
        heights.data_mut().fill(f32::NAN);
        heights[(3, 0)] = 4.0;
        assert_eq!(ground_height(&heights, 2.0), Some(4.0));
        assert_eq!(ground_height(&heights, 0.01), None);
        assert_eq!(ground_height(&Grid::filled(5, 5, f32::NAN), 2.0), None);
    }
}
