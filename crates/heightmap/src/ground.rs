//! The height of the ground under the camera.
//!
//! The position of the camera is given, its height often is not: by convention it is 2 m above the
//! ground. The ground is the surface at the middle of the tile, interpolated between its pixels. If
//! the surface has a hole there, it is the lowest of the nearest pixels within [`GROUND_REACH_M`].

use raster::{Grid, bilinear};

/// Radius around the camera in which ground is searched, metres.
pub const GROUND_REACH_M: f64 = 5.0;

/// Returns the height at the middle of a tile, in the unit of the heights; `None` if there is none
/// near.
///
/// ```
/// let heights = raster::Grid::filled(4, 4, 12.5_f32);
/// assert_eq!(heightmap::ground_height(&heights, 2.0), Some(12.5));
/// ```
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
