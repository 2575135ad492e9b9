//! Derivatives of the image position by the ground position.

use geodesy::LonLatHeight;

use crate::limits::{check_ratio, check_reach};
use crate::polynomial::{at_height, derivative_by_height, plane_gradient};
use crate::{CameraError, Rpc, RpcCamera};

/// Derivatives of sample and line: pixels per degree of longitude, per degree of latitude, per
/// metre of height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageFromGroundJacobian {
    /// Derivatives of the sample by longitude, latitude and height.
    pub sample: [f64; 3],
    /// Derivatives of the line by longitude, latitude and height.
    pub line: [f64; 3],
}

impl Rpc {
    /// Returns the Jacobian of [`Rpc::project`].
    ///
    /// # Errors
    /// As [`Rpc::project`].
    pub fn jacobian(&self, ground: LonLatHeight) -> Result<ImageFromGroundJacobian, CameraError> {
        let [l, p, h] = self.normalised(ground);
        check_reach(l, p)?;
        let by_unit = [1.0 / self.long_scale, 1.0 / self.lat_scale, 1.0 / self.height_scale];
        let row = |num: &[f64; 20], den: &[f64; 20], scale: f64| {
            let [n, n_l, n_p] = plane_gradient(&at_height(num, h), l, p);
            let [d, d_l, d_p] = plane_gradient(&at_height(den, h), l, p);
            check_ratio(n, d)?;
            let (n_h, d_h) = (derivative_by_height(num, l, p, h), derivative_by_height(den, l, p, h));
            let by = |n_x: f64, d_x: f64, unit: f64| scale * (n_x - n / d * d_x) / d * unit;
            Ok([by(n_l, d_l, by_unit[0]), by(n_p, d_p, by_unit[1]), by(n_h, d_h, by_unit[2])])
        };
        Ok(ImageFromGroundJacobian {
            sample: row(&self.samp_num, &self.samp_den, self.samp_scale)?,
            line: row(&self.line_num, &self.line_den, self.line_scale)?,
        })
    }
}

impl RpcCamera {
    /// Returns the Jacobian of [`RpcCamera::project`].
    ///
    /// # Errors
    /// As [`Rpc::project`].
    pub fn jacobian(&self, ground: LonLatHeight) -> Result<ImageFromGroundJacobian, CameraError> {
        let j = self.rpc.jacobian(ground)?;
        let [[a, b], [c, d]] = self.correction.linear;
        let mixed = |s: f64, l: f64| std::array::from_fn(|i| s * j.sample[i] + l * j.line[i]);
        Ok(ImageFromGroundJacobian { sample: mixed(1.0 + a, b), line: mixed(c, 1.0 + d) })
    }
}
