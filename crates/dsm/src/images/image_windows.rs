//! Windows of the images that show a part of the grid.

use camera::{CameraError, ImagePoint};
use crs::MapProjection;
use geo::Polygon;
use geodesy::{EnuFrame, LonLatHeight};
use raster::Window;
use reconstruct::{DsmGrid, HeightRange, local_polygon};

use crate::error::DsmError;
use crate::images::scene_image::SceneImage;

/// No image reaches further than this, pixels. Far outside its image a camera may return any
/// position.
const FARTHEST_PX: f64 = 1e9;

/// An RPC is made for its image, which fills its domain. Heights other than its own move what an
/// image shows by less than this many half-widths.
const DOMAIN_TIMES: f64 = 2.0;

/// Part of the grid on the ground: its corners in longitude and latitude, and the heights that it
/// may have.
///
/// The corners are projected once, because a part is looked at in every image.
pub(crate) struct GroundBox {
    /// Longitude and latitude of the corners, degrees.
    corners: [(f64, f64); 4],
    range: HeightRange,
}

impl GroundBox {
    /// Makes the box of a grid between two heights.
    ///
    /// # Errors
    /// [`DsmError::Crs`] for a corner outside the domain of the projection.
    pub(crate) fn new(grid: &DsmGrid, projection: &MapProjection, range: HeightRange) -> Result<Self, DsmError> {
        let (columns, rows) = (grid.size.0 as f64, grid.size.1 as f64);
        let mut corners = [(0.0, 0.0), (columns, 0.0), (0.0, rows), (columns, rows)];
        for corner in &mut corners {
            let (x, y) = grid.geotransform.map_from_cell(corner.0 - 0.5, corner.1 - 0.5);
            *corner = projection.lonlat_from_map(x, y)?;
        }
        Ok(Self { corners, range })
    }

    /// Returns the outline of the box at its middle height, in metres of a local frame.
    pub(crate) fn outline(&self, frame: &EnuFrame) -> Polygon<f64> {
        let height_m = self.range.middle_m();
        let corners = self.corners.map(|(lon_deg, lat_deg)| LonLatHeight::new(lon_deg, lat_deg, height_m));
        local_polygon(&corners, frame)
    }

    /// Returns the pixels that show the box, grown by `margin`. They may lie outside the image, and
    /// there are none where the image is of another place.
    ///
    /// # Errors
    /// [`DsmError::Camera`] where the camera has no pixel for a corner.
    pub(crate) fn span_in(&self, image: &SceneImage, margin: usize) -> Result<Window, DsmError> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (lon_deg, lat_deg) in self.corners {
            for height_m in [self.range.low_m, self.range.high_m] {
                let ground = LonLatHeight::new(lon_deg, lat_deg, height_m);
                let ImagePoint { sample, line } = match image.camera.project(ground) {
                    Err(CameraError::OutsideDomain { .. }) => return Ok(self.span_far_off(image, margin)),
                    found => found.map_err(|source| DsmError::Camera { path: image.path.clone(), source })?,
                };
                let at = [sample, line].map(|v| v.clamp(-FARTHEST_PX, FARTHEST_PX));
                low = [low[0].min(at[0]), low[1].min(at[1])];
                high = [high[0].max(at[0]), high[1].max(at[1])];
            }
        }
        let wanted = Window {
            x: low[0].floor() as i64,
            y: low[1].floor() as i64,
            width: (high[0] - low[0]).ceil() as usize + 1,
            height: (high[1] - low[1]).ceil() as usize + 1,
        };
        Ok(wanted.grown(margin))
    }

    /// Returns the pixels that show a box of which a corner is so far away that the RPC means
    /// nothing there: all, or none if the RPC is made for another place.
    fn span_far_off(&self, image: &SceneImage, margin: usize) -> Window {
        let rpc = &image.camera.rpc;
        let meets = |at: fn(&(f64, f64)) -> f64, offset: f64, scale: f64| {
            let reach = DOMAIN_TIMES * scale.abs();
            let all = || self.corners.iter().map(at);
            all().fold(f64::INFINITY, f64::min) <= offset + reach
                && all().fold(f64::NEG_INFINITY, f64::max) >= offset - reach
        };
        if meets(|c| c.0, rpc.long_off, rpc.long_scale) && meets(|c| c.1, rpc.lat_off, rpc.lat_scale) {
            image.whole().grown(margin)
        } else {
            Window { x: FARTHEST_PX as i64, y: FARTHEST_PX as i64, width: 0, height: 0 }
        }
    }

    /// Returns the part of [`GroundBox::span_in`] that lies inside the image; `None` when the image
    /// does not see the box.
    ///
    /// # Errors
    /// As [`GroundBox::span_in`].
    pub(crate) fn window_in(&self, image: &SceneImage, margin: usize) -> Result<Option<Window>, DsmError> {
        Ok(self.span_in(image, margin)?.intersection(&image.whole()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DsmConfig;
    use crate::images::open::open;
    use std::path::PathBuf;

    /// Returns the box of a square around a place of the sample town, `half_deg` to each side.
    fn around(image: &SceneImage, east_deg: f64, half_deg: f64) -> GroundBox {
        let rpc = &image.camera.rpc;
        let (lon, lat) = (rpc.long_off + east_deg, rpc.lat_off);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let corners = corners.map(|(x, y)| (lon + x * half_deg, lat + y * half_deg));
        GroundBox { corners, range: HeightRange::new(rpc.height_off - 20.0, rpc.height_off + 20.0) }
    }

    #[test]
    fn an_image_of_another_place_shows_nothing_and_one_inside_a_large_box_is_shown_whole() {
        let view = |i| format!("{}/../../data-samples/town/view_{i}.tif", env!("CARGO_MANIFEST_DIR"));
        let images =
            open(&DsmConfig::new([1, 2].map(|i| view(i).into()).to_vec(), PathBuf::from("out"))).unwrap().images;
        let image = &images[0];
        let seen = |ground: GroundBox| ground.window_in(image, 10).unwrap();
        assert_eq!(seen(around(image, 5.0, 0.001)), None);
        assert_eq!(seen(around(image, 0.0, 1.0)), Some(image.whole()));
        assert!(seen(around(image, 0.0, 0.0005)).is_some_and(|w| w.width < image.size.0), "a part of the image");
    }
}
