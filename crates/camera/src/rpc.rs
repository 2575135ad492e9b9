//! The RPC00B rational polynomial camera (NIMA STDI-0002, appendix E).
//!
//! With normalised longitude L, latitude P and height H,
//! `line = LINE_OFF + LINE_SCALE · Num_l(P, L, H) / Den_l(P, L, H)`, likewise for the sample, each polynomial with
//! the terms 1, L, P, H, LP, LH, PH, L², P², H², PLH, L³, LP², LH², L²P, P³, PH², L²H, P²H, H³.
//! Localisation at a height inverts this by Newton's method with the analytic Jacobian.

use geodesy::LonLatHeight;
use serde::{Deserialize, Serialize};

use crate::{ImageCorrection, ImagePoint};

/// Why a point has no image or no ground position.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A coordinate is NaN or infinite.
    #[error("the coordinate is not a finite number")]
    NotFinite,
    /// A denominator of the RPC vanishes at this point.
    #[error("the RPC's denominator vanishes at this point (|denominator| = {denominator:e})")]
    Denominator {
        /// The value of the offending denominator.
        denominator: f64,
    },
    /// Newton's method did not reach the tolerance.
    #[error("localisation did not converge: {residual_px:.3} px left after {iterations} iterations")]
    NotConverged {
        /// What was left, pixels.
        residual_px: f64,
        /// Iterations done.
        iterations: u32,
    },
}

/// The RPC00B coefficients of one image, in this toolkit's image coordinates (upper-left pixel centre at 0, 0).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rpc {
    /// LINE_OFF, pixels.
    pub line_off: f64,
    /// SAMP_OFF, pixels.
    pub samp_off: f64,
    /// LAT_OFF, degrees.
    pub lat_off: f64,
    /// LONG_OFF, degrees.
    pub long_off: f64,
    /// HEIGHT_OFF, metres above the ellipsoid.
    pub height_off: f64,
    /// LINE_SCALE, pixels.
    pub line_scale: f64,
    /// SAMP_SCALE, pixels.
    pub samp_scale: f64,
    /// LAT_SCALE, degrees.
    pub lat_scale: f64,
    /// LONG_SCALE, degrees.
    pub long_scale: f64,
    /// HEIGHT_SCALE, metres.
    pub height_scale: f64,
    /// LINE_NUM_COEFF.
    pub line_num: [f64; 20],
    /// LINE_DEN_COEFF.
    pub line_den: [f64; 20],
    /// SAMP_NUM_COEFF.
    pub samp_num: [f64; 20],
    /// SAMP_DEN_COEFF.
    pub samp_den: [f64; 20],
    /// ERR_BIAS, metres, where the provider gave it.
    pub err_bias_m: Option<f64>,
    /// ERR_RAND, metres, where the provider gave it.
    pub err_rand_m: Option<f64>,
}

/// An RPC with an image-space correction behind it: what the pipeline projects with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RpcCamera {
    /// The provider's model.
    pub rpc: Rpc,
    /// The correction of its pointing.
    pub correction: ImageCorrection,
}

/// Denominators smaller than this are poles: real sensors keep them within a few percent of 1.
const DENOMINATOR_MIN: f64 = 1e-6;
/// Localisation stops when the image residual is below this, well under any use of it.
const NEWTON_TOLERANCE_PX: f64 = 1e-9;
/// Newton converges quadratically from the centre; real RPCs take three to six steps.
const NEWTON_STEPS: u32 = 25;

/// The value of a cubic polynomial and its derivatives with respect to normalised longitude and latitude.
fn cubic(c: &[f64; 20], l: f64, p: f64, h: f64) -> (f64, f64, f64) {
    let value = c[0]
        + l * (c[1] + l * (c[7] + l * c[11]) + p * (c[4] + p * c[12]) + h * (c[5] + h * c[13]))
        + p * (c[2] + p * (c[8] + p * c[15]) + l * l * c[14] + h * (c[6] + h * c[16] + l * c[10]))
        + h * (c[3] + h * (c[9] + h * c[19]) + l * l * c[17] + p * p * c[18]);
    let d_l = c[1]
        + p * (c[4] + p * c[12] + h * c[10])
        + h * (c[5] + h * c[13])
        + 2.0 * l * (c[7] + p * c[14] + h * c[17])
        + 3.0 * l * l * c[11];
    let d_p = c[2]
        + l * (c[4] + l * c[14] + h * c[10])
        + h * (c[6] + h * c[16])
        + 2.0 * p * (c[8] + l * c[12] + h * c[18])
        + 3.0 * p * p * c[15];
    (value, d_l, d_p)
}

impl Rpc {
    /// The image position of a ground point.
    ///
    /// # Errors
    /// A coordinate that is not finite, or a point at a pole of the model.
    pub fn project(&self, ground: LonLatHeight) -> Result<ImagePoint, CameraError> {
        let [l, p, h] = self.normalised(ground);
        self.image_and_jacobian(l, p, h).map(|(image, _)| image)
    }

    /// The ground point at `height_m` (ellipsoidal) that is seen at an image position.
    ///
    /// # Errors
    /// A coordinate that is not finite, a pole on the way, or no convergence.
    pub fn localize(&self, image: ImagePoint, height_m: f64) -> Result<LonLatHeight, CameraError> {
        if !(image.sample.is_finite() && image.line.is_finite() && height_m.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let h = (height_m - self.height_off) / self.height_scale;
        let (mut l, mut p) = (0.0, 0.0);
        let mut residual_px = f64::INFINITY;
        for _ in 0..NEWTON_STEPS {
            let (at, [[s_l, s_p], [n_l, n_p]]) = self.image_and_jacobian(l, p, h)?;
            let (ds, dn) = (image.sample - at.sample, image.line - at.line);
            let det = s_l * n_p - s_p * n_l;
            let (step_l, step_p) = ((n_p * ds - s_p * dn) / det, (s_l * dn - n_l * ds) / det);
            if !(step_l.is_finite() && step_p.is_finite()) {
                break;
            }
            l += step_l;
            p += step_p;
            residual_px = ds.hypot(dn);
            if residual_px < NEWTON_TOLERANCE_PX {
                return Ok(LonLatHeight::new(
                    self.long_off + self.long_scale * l,
                    self.lat_off + self.lat_scale * p,
                    height_m,
                ));
            }
        }
        Err(CameraError::NotConverged { residual_px, iterations: NEWTON_STEPS })
    }

    /// Normalised longitude, latitude and height; the longitude difference is taken the short way round.
    fn normalised(&self, g: LonLatHeight) -> [f64; 3] {
        let mut d_lon = g.lon_deg - self.long_off;
        if d_lon.abs() > 180.0 {
            d_lon -= 360.0 * (d_lon / 360.0).round();
        }
        [
            d_lon / self.long_scale,
            (g.lat_deg - self.lat_off) / self.lat_scale,
            (g.height_m - self.height_off) / self.height_scale,
        ]
    }

    /// Image position and its derivatives with respect to normalised (L, P): rows sample, line.
    fn image_and_jacobian(&self, l: f64, p: f64, h: f64) -> Result<(ImagePoint, [[f64; 2]; 2]), CameraError> {
        let axis = |num: &[f64; 20], den: &[f64; 20], off: f64, scale: f64| {
            let (n, n_l, n_p) = cubic(num, l, p, h);
            let (d, d_l, d_p) = cubic(den, l, p, h);
            if !(n.is_finite() && d.is_finite()) {
                return Err(CameraError::NotFinite);
            }
            if d.abs() < DENOMINATOR_MIN {
                return Err(CameraError::Denominator { denominator: d.abs() });
            }
            let r = n / d;
            Ok((off + scale * r, [scale * (n_l - r * d_l) / d, scale * (n_p - r * d_p) / d]))
        };
        let (sample, row_s) = axis(&self.samp_num, &self.samp_den, self.samp_off, self.samp_scale)?;
        let (line, row_l) = axis(&self.line_num, &self.line_den, self.line_off, self.line_scale)?;
        Ok((ImagePoint { sample, line }, [row_s, row_l]))
    }
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
    /// As [`Rpc::localize`]; a singular correction is reported as a coordinate that is not finite.
    pub fn localize(&self, image: ImagePoint, height_m: f64) -> Result<LonLatHeight, CameraError> {
        let p = self.correction.invert(image).ok_or(CameraError::NotFinite)?;
        self.rpc.localize(p, height_m)
    }
}
