//! Windows of the images that show a part of the grid.

use camera::ImagePoint;
use crs::MapProjection;
use geo::Polygon;
use geodesy::{EnuFrame, LonLatHeight};
use raster::Window;

use crate::dsm::error::DsmError;
use crate::dsm::footprints::local_polygon;
use crate::dsm::grid::DsmGrid;
use crate::dsm::images::SceneImage;
use crate::dsm::values::HeightRange;

/// No image reaches further than this, pixels. Far outside its image a camera may return any
/// position.
const FARTHEST_PX: f64 = 1e9;

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

    /// Returns the pixels that show the box, grown by `margin`. They may lie outside the image.
    ///
    /// # Errors
    /// [`DsmError::Camera`] where the camera has no pixel for a corner.
    pub(crate) fn span_in(&self, image: &SceneImage, margin: usize) -> Result<Window, DsmError> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (lon_deg, lat_deg) in self.corners {
            for height_m in [self.range.low_m, self.range.high_m] {
                let failed = |source| DsmError::Camera { path: image.path.clone(), source };
                let ImagePoint { sample, line } =
                    image.camera.project(LonLatHeight::new(lon_deg, lat_deg, height_m)).map_err(failed)?;
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

    /// Returns the part of [`GroundBox::span_in`] that lies inside the image; `None` when the image
    /// does not see the box.
    ///
    /// # Errors
    /// As [`GroundBox::span_in`].
    pub(crate) fn window_in(&self, image: &SceneImage, margin: usize) -> Result<Option<Window>, DsmError> {
        Ok(self.span_in(image, margin)?.intersection(&image.whole()))
    }
}
