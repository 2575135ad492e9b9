//! An RPC with a correction of its pointing.

use geodesy::LonLatHeight;
use serde::{Deserialize, Serialize};

use crate::{CameraError, ImageCorrection, ImagePoint, Rpc};

/// An RPC with an image-space correction behind it: what the pipeline projects with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RpcCamera {
    /// The provider's model.
    pub rpc: Rpc,
    /// The correction of its pointing.
    pub correction: ImageCorrection,
}

impl RpcCamera {
    /// A camera without correction.
    pub const fn new(rpc: Rpc) -> Self {
        Self { rpc, correction: ImageCorrection::IDENTITY }
    }

    /// The image position of a ground point, corrected.
    ///
    /// # Errors
    /// As [`Rpc::project`].
    pub fn project(&self, ground: LonLatHeight) -> Result<ImagePoint, CameraError> {
        self.rpc.project(ground).map(|p| self.correction.apply(p))
    }

    /// The ground point at `height_m` seen at a position of the image.
    ///
    /// # Errors
    /// As [`Rpc::localize`]; a correction that cannot be inverted is [`CameraError::Singular`].
    pub fn localize(&self, image: ImagePoint, height_m: f64) -> Result<LonLatHeight, CameraError> {
        let p = self.correction.invert(image).ok_or(CameraError::Singular)?;
        self.rpc.localize(p, height_m)
    }

    /// The camera of the image cut at `origin`, the crop's upper-left pixel.
    #[must_use]
    pub fn cropped(&self, origin: ImagePoint) -> Self {
        Self { rpc: self.rpc.cropped(origin), correction: self.correction.cropped(origin) }
    }

    /// The camera of the image resampled by `factor`; see [`Rpc::rescaled`].
    #[must_use]
    pub fn rescaled(&self, factor: f64) -> Self {
        Self { rpc: self.rpc.rescaled(factor), correction: self.correction.rescaled(factor) }
    }
}
