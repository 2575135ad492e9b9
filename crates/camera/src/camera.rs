//! An RPC with a correction of its pointing.

use geodesy::LonLatHeight;
use serde::{Deserialize, Serialize};

use crate::{CameraError, ImageCorrection, ImagePoint, Rpc};

/// An RPC followed by an image-space correction. All jobs project with this camera.
///
/// ```
/// use camera::{ImageCorrection, ImagePoint, Rpc, RpcCamera};
/// # use geodesy::LonLatHeight;
/// # fn corrected(rpc: Rpc, ground: LonLatHeight) -> Result<(), camera::CameraError> {
/// let raw = RpcCamera::new(rpc.clone());
/// let shifted = RpcCamera { rpc, correction: ImageCorrection::translation(1.5, -0.5) };
/// let (a, b) = (raw.project(ground)?, shifted.project(ground)?);
/// assert_eq!((b.sample - a.sample, b.line - a.line), (1.5, -0.5));
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RpcCamera {
    /// The provider's model.
    pub rpc: Rpc,
    /// The correction of its pointing.
    pub correction: ImageCorrection,
}

impl RpcCamera {
    /// Makes a camera without correction.
    pub const fn new(rpc: Rpc) -> Self {
        Self { rpc, correction: ImageCorrection::IDENTITY }
    }

    /// Returns the corrected image position of a ground point.
    ///
    /// # Errors
    /// The same as for [`Rpc::project`].
    pub fn project(&self, ground: LonLatHeight) -> Result<ImagePoint, CameraError> {
        self.rpc.project(ground).map(|p| self.correction.apply(p))
    }

    /// Returns the ground point at `height_m` that is seen at an image position.
    ///
    /// # Errors
    /// The same as for [`Rpc::localize`], and [`CameraError::Singular`] if the correction cannot be
    /// inverted.
    pub fn localize(&self, image: ImagePoint, height_m: f64) -> Result<LonLatHeight, CameraError> {
        let p = self.correction.invert(image).ok_or(CameraError::Singular)?;
        self.rpc.localize(p, height_m)
    }

    /// Returns the camera of a crop whose upper-left pixel is `origin`.
    #[must_use]
    pub fn cropped(&self, origin: ImagePoint) -> Self {
        Self { rpc: self.rpc.cropped(origin), correction: self.correction.cropped(origin) }
    }

    /// Returns the camera of the image resampled by `factor`. See [`Rpc::rescaled`].
    #[must_use]
    pub fn rescaled(&self, factor: f64) -> Self {
        Self { rpc: self.rpc.rescaled(factor), correction: self.correction.rescaled(factor) }
    }
}
