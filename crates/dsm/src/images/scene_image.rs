//! The images of a run with their cameras.

use std::path::PathBuf;

use camera::{ImagePoint, RpcCamera};
use formats::stac::SunPosition;
use raster::Window;
use reconstruct::{ImageGeometry, ReconstructError, ViewGeometry};
use serde::{Deserialize, Serialize};

use crate::error::DsmError;

/// An image file with its camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SceneImage {
    /// File of the image.
    pub path: PathBuf,
    /// Position at which the image was given, counted from 0.
    pub number: usize,
    /// Name of the format in which the RPC was found.
    pub rpc_format: String,
    /// Camera in the frame of the whole image.
    pub camera: RpcCamera,
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// When the image was taken, seconds of UTC since 1970; `None` where the file does not say.
    pub acquired_s: Option<i64>,
    /// Name of the satellite; `None` where neither the file nor its STAC item says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub satellite: Option<String>,
    /// Where the sun stood; `None` where neither the file nor its STAC item says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sun: Option<SunPosition>,
    /// Angle of the line of sight to the vertical that the STAC item states, degrees. It is
    /// compared with that of the RPC.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated_incidence_deg: Option<f64>,
    /// Factor of the grey values, a power of two: 1 unless a float image has a scale of its own,
    /// such as reflectances from 0 to 1. Noise and texture are then measured in numbers like those
    /// of sensors.
    pub gain: f32,
    /// Band that is matched, counted from 1; the luma of all bands when `None`.
    pub band: Option<usize>,
    /// Masks of pixels that are not matched: rasters in the frame of the image, polygons on the
    /// ground.
    pub masks: Vec<PathBuf>,
    /// What is doubtful about the image and its RPC by themselves, a sentence for each finding.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<String>,
}

impl SceneImage {
    /// Returns the window of the whole image.
    pub(crate) const fn whole(&self) -> Window {
        Window::whole(self.size.0, self.size.1)
    }

    /// Returns the camera in the frame of a window.
    pub(crate) fn camera_of(&self, window: Window) -> RpcCamera {
        self.camera.cropped(ImagePoint::new(window.x as f64, window.y as f64))
    }

    /// Computes how images see the scene at `height_m`, metres above the ellipsoid.
    ///
    /// # Errors
    /// [`DsmError::Camera`] for an image without a footprint, [`DsmError::Reconstruct`] when no two
    /// images share ground.
    pub(crate) fn geometry(images: &[Self], height_m: f64) -> Result<ViewGeometry, DsmError> {
        let described: Vec<ImageGeometry<'_>> =
            images.iter().map(|image| ImageGeometry { camera: &image.camera, size: image.size }).collect();
        ViewGeometry::at(&described, height_m).map_err(|error| match error {
            ReconstructError::Camera { view, source } => DsmError::Camera { path: images[view].path.clone(), source },
            other => other.into(),
        })
    }
}
