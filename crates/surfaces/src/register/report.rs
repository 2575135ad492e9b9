//! What a registration found.

use std::path::PathBuf;

use camera::ImageCorrection;
use serde::Serialize;

use super::config::RegisterOrder;

/// The correction of an image, and how well it is known.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RegisterReport {
    /// The new image first, then the images of the model.
    pub images: Vec<RegisteredImage>,
    /// Order of the correction: shift, drift or affine.
    pub order: RegisterOrder,
    /// Points of the model that were searched for.
    pub tried: usize,
    /// Points that were found.
    pub found: usize,
    /// Points that agree with the correction.
    pub agree: usize,
    /// Root mean square residual of those, pixels.
    pub rms_px: f64,
    /// Median length of the residuals of all points found, pixels.
    pub median_px: f64,
    /// Shift of the pixel in the middle of the image, pixels (sample, line).
    pub shift_px: [f64; 2],
    /// Ground sampling distance of the image, metres.
    pub gsd_m: f64,
    /// Rounds of matching.
    pub rounds: usize,
    /// Columns and rows of the image.
    pub size: (usize, usize),
    /// Points that were found: sample, line, and residual along both after the correction, pixels.
    pub residuals_px: Vec<[f64; 4]>,
}

/// An image with its correction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegisteredImage {
    /// The image.
    pub path: PathBuf,
    /// Its correction, to be applied after the RPC.
    pub applied_correction: Option<ImageCorrection>,
}

impl RegisterReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let [sample, line] = self.shift_px;
        format!(
            "shift      {sample:+.3} px along the sample, {line:+.3} px along the line{}\n\
             points     {} of {} found, {} agree: RMS {:.3} px, median {:.3} px\n",
            match self.order {
                RegisterOrder::Drift => ", and a drift",
                RegisterOrder::Affine => ", and an affine map",
                RegisterOrder::Evidence | RegisterOrder::Shift => "",
            },
            self.found,
            self.tried,
            self.agree,
            self.rms_px,
            self.median_px
        )
    }
}
