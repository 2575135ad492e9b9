//! An RPC at one height: each cubic loses its height terms (20 → 10), exactly.
//!
//! The sweep projects many points of one height plane, and localisation searches on one. Both use
//! this form. Heights are metres above the ellipsoid. Points at a pole are errors, and so are
//! points whose normalised longitude or latitude exceeds
//! [`EXTRAPOLATION_MAX`](crate::EXTRAPOLATION_MAX).

use geodesy::LonLatHeight;

use crate::limits::{check_ratio, check_reach, short_way};
use crate::polynomial::{PlaneCubic, at_height, plane_gradient, plane_value};
use crate::{CameraError, ImagePoint, Rpc};

/// An RPC restricted to one height.
#[derive(Debug, Clone, PartialEq)]
pub struct RpcPlane {
    pub(crate) height_m: f64,
    pub(crate) longitude: AxisScale,
    pub(crate) latitude: AxisScale,
    pub(crate) samp: PlaneRatio,
    pub(crate) line: PlaneRatio,
}

/// Offset and scale of one coordinate: its value is `off + scale · normalised`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisScale {
    off: f64,
    scale: f64,
}

/// One image coordinate on a plane; its normalised value is `num / den`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlaneRatio {
    pub(crate) axis: AxisScale,
    pub(crate) num: PlaneCubic,
    pub(crate) den: PlaneCubic,
}

/// Image position with its derivatives by normalised (L, P), and the signs of denominators and
/// determinant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaneSample {
    pub(crate) image: ImagePoint,
    /// Rows sample, line; columns L, P; pixels.
    pub(crate) jacobian: [[f64; 2]; 2],
    /// Determinant of the Jacobian, pixels².
    pub(crate) determinant: f64,
    /// Signs of the sample denominator, the line denominator and the determinant. Two points of a
    /// plane between which one of them changes are separated by a pole or a fold of the model.
    pub(crate) orientation: [bool; 3],
}

impl Rpc {
    /// Returns the model at one height, metres above the ellipsoid.
    pub fn plane(&self, height_m: f64) -> RpcPlane {
        let h = (height_m - self.height_off) / self.height_scale;
        let ratio = |axis, num, den| PlaneRatio { axis, num: at_height(num, h), den: at_height(den, h) };
        let axis = |off, scale| AxisScale { off, scale };
        RpcPlane {
            height_m,
            longitude: axis(self.long_off, self.long_scale),
            latitude: axis(self.lat_off, self.lat_scale),
            samp: ratio(axis(self.samp_off, self.samp_scale), &self.samp_num, &self.samp_den),
            line: ratio(axis(self.line_off, self.line_scale), &self.line_num, &self.line_den),
        }
    }
}

impl RpcPlane {
    /// Returns the height of the plane, metres above the ellipsoid.
    pub fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Returns the image position of the point of the plane at a longitude and latitude, degrees.
    ///
    /// # Errors
    /// A coordinate that is not finite, a point far outside the domain, or one at a pole of the
    /// model.
    pub fn project(&self, lon_deg: f64, lat_deg: f64) -> Result<ImagePoint, CameraError> {
        let [l, p] = self.normalised(lon_deg, lat_deg);
        check_reach(l, p)?;
        Ok(ImagePoint { sample: self.samp.value(l, p)?, line: self.line.value(l, p)? })
    }

    /// Returns normalised longitude and latitude. The longitude difference is brought into ±180°.
    #[inline(always)]
    pub(crate) fn normalised(&self, lon_deg: f64, lat_deg: f64) -> [f64; 2] {
        let Self { longitude, latitude, .. } = self;
        [short_way(lon_deg - longitude.off) / longitude.scale, (lat_deg - latitude.off) / latitude.scale]
    }

    /// Returns the ground point at a normalised position.
    pub(crate) fn ground(&self, l: f64, p: f64) -> LonLatHeight {
        LonLatHeight::new(self.longitude.value(l), self.latitude.value(p), self.height_m)
    }

    /// Returns image position and derivatives at a normalised position.
    pub(crate) fn sample(&self, l: f64, p: f64) -> Result<PlaneSample, CameraError> {
        let (sample, row_s, den_s) = self.samp.gradient(l, p)?;
        let (line, row_l, den_l) = self.line.gradient(l, p)?;
        let determinant = row_s[0] * row_l[1] - row_s[1] * row_l[0];
        Ok(PlaneSample {
            image: ImagePoint { sample, line },
            jacobian: [row_s, row_l],
            determinant,
            orientation: [den_s > 0.0, den_l > 0.0, determinant > 0.0],
        })
    }
}

impl PlaneSample {
    /// Returns whether the Jacobian can be inverted: its rows are neither zero nor parallel, up to
    /// rounding.
    pub(crate) fn is_regular(&self) -> bool {
        let [s, l] = self.jacobian;
        self.determinant.abs() > 1e-9 * s[0].hypot(s[1]) * l[0].hypot(l[1])
    }
}

impl AxisScale {
    /// Returns offset and scale.
    pub(crate) fn numbers(self) -> [f64; 2] {
        [self.off, self.scale]
    }

    #[inline]
    fn value(self, normalised: f64) -> f64 {
        self.off + self.scale * normalised
    }
}

impl PlaneRatio {
    fn value(&self, l: f64, p: f64) -> Result<f64, CameraError> {
        let n = plane_value(&self.num, l, p);
        let d = plane_value(&self.den, l, p);
        check_ratio(n, d)?;
        Ok(self.axis.value(n / d))
    }

    /// Returns the value, its derivatives by L and P, and the denominator.
    fn gradient(&self, l: f64, p: f64) -> Result<(f64, [f64; 2], f64), CameraError> {
        let [n, n_l, n_p] = plane_gradient(&self.num, l, p);
        let [d, d_l, d_p] = plane_gradient(&self.den, l, p);
        check_ratio(n, d)?;
        let r = n / d;
        let scale = self.axis.scale;
        Ok((self.axis.value(r), [scale * (n_l - r * d_l) / d, scale * (n_p - r * d_p) / d], d))
    }
}
