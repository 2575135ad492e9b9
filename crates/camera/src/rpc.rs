//! The RPC00B rational polynomial camera (NIMA STDI-0002, appendix E).
//!
//! With normalised longitude L, latitude P and height H, `line = LINE_OFF + LINE_SCALE · Num_l(P,
//! L, H) / Den_l(P, L, H)`, likewise for the sample, each polynomial with the terms 1, L, P, H, LP,
//! LH, PH, L², P², H², PLH, L³, LP², LH², L²P, P³, PH², L²H, P²H, H³. Longitudes may be given
//! within ±360°. The difference to LONG_OFF is brought into ±180°.

use geodesy::LonLatHeight;
use serde::{Deserialize, Serialize};

use crate::limits::{DENOMINATOR_MIN, short_way};
use crate::{CameraError, ImagePoint, Key, RpcError};

/// The RPC00B coefficients of one image, in this toolkit's image coordinates (upper-left pixel
/// centre at 0, 0).
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

/// Validity of an entry that must be an angle, degrees.
const LATITUDE_MAX_DEG: f64 = 90.0;
const LONGITUDE_MAX_DEG: f64 = 360.0;
/// Limits of entries that no sensor exceeds, with which a wrong entry is told before memory is
/// taken for the ground it would cover: half of the longest strip, pixels; half of the Earth,
/// degrees; the height of a satellite, metres.
const PLAUSIBLE: [(&str, f64); 8] = [
    ("LINE_SCALE", 1e6),
    ("SAMP_SCALE", 1e6),
    ("LINE_OFF", 1e7),
    ("SAMP_OFF", 1e7),
    ("LAT_SCALE", 90.0),
    ("LONG_SCALE", 180.0),
    ("HEIGHT_OFF", 1e6),
    ("HEIGHT_SCALE", 1e6),
];
/// Largest distance of a corner of the domain from the image's offset, pixels. Crops keep the
/// domain of their scene, so this is the size of the longest strips and more.
const REACH_MAX_PX: f64 = 1e7;

impl Rpc {
    /// Returns the image position of a ground point.
    ///
    /// # Errors
    /// A coordinate that is not finite, a point far outside the domain (see
    /// [`crate::EXTRAPOLATION_MAX`]), or one at a pole of the model.
    pub fn project(&self, ground: LonLatHeight) -> Result<ImagePoint, CameraError> {
        self.plane(ground.height_m).project(ground.lon_deg, ground.lat_deg)
    }

    /// Checks that the coefficients form a camera.
    ///
    /// All entries must be finite, scales not zero, and angles valid, and scales and offsets such
    /// as a sensor can have. At the centre the model must have no pole, and the image must depend
    /// on longitude and latitude. The corners of the domain must not be far outside of the image.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn validate(&self) -> Result<(), RpcError> {
        let key = |name| Key { name, number: None };
        for (name, value) in self.offsets().into_iter().chain(self.scales()) {
            if !value.is_finite() {
                return Err(RpcError::NotFinite { key: key(name), value });
            }
        }
        for (name, c) in self.polynomials() {
            if let Some((i, &value)) = c.iter().enumerate().find(|(_, v)| !v.is_finite()) {
                return Err(RpcError::NotFinite { key: Key { name, number: Some(i + 1) }, value });
            }
        }
        if let Some((name, _)) = self.scales().into_iter().find(|&(_, v)| v == 0.0) {
            return Err(RpcError::ZeroScale { key: key(name) });
        }
        for (name, value, limit) in
            [("LAT_OFF", self.lat_off, LATITUDE_MAX_DEG), ("LONG_OFF", self.long_off, LONGITUDE_MAX_DEG)]
        {
            if value.abs() > limit {
                return Err(RpcError::Angle { key: key(name), value, limit });
            }
        }
        for (name, value) in self.offsets().into_iter().chain(self.scales()) {
            if let Some(&(_, limit)) = PLAUSIBLE.iter().find(|(known, limit)| *known == name && value.abs() > *limit) {
                return Err(RpcError::Implausible { key: key(name), value, limit });
            }
        }
        for (name, c) in [("LINE_DEN_COEFF", &self.line_den), ("SAMP_DEN_COEFF", &self.samp_den)] {
            if c[0].abs() < DENOMINATOR_MIN {
                return Err(RpcError::PoleAtCentre { key: Key { name, number: Some(1) } });
            }
        }
        match self.plane(self.height_off).sample(0.0, 0.0) {
            Ok(at) if at.is_regular() => {}
            _ => return Err(RpcError::Degenerate),
        }
        let reach_px = self.reach_px();
        if reach_px > REACH_MAX_PX { Err(RpcError::Stretched { reach_px }) } else { Ok(()) }
    }

    /// Returns the largest distance of a corner of the domain from the offsets, along the line or
    /// the sample, pixels. A corner at a pole does not count.
    fn reach_px(&self) -> f64 {
        let corners = (0..8u8).map(|corner| [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 }));
        let at = corners.filter_map(|[l, p, h]| {
            let height_m = self.height_off + h * self.height_scale;
            let point = self.plane(height_m).sample(l, p).ok()?.image;
            Some((point.sample - self.samp_off).abs().max((point.line - self.line_off).abs()))
        });
        at.filter(|size| size.is_finite()).fold(0.0, f64::max)
    }

    /// Returns the model of a crop whose upper-left pixel is `origin`.
    #[must_use]
    pub fn cropped(&self, origin: ImagePoint) -> Self {
        Self { samp_off: self.samp_off - origin.sample, line_off: self.line_off - origin.line, ..self.clone() }
    }

    /// Returns the model of the image resampled by `factor` (0.5 halves it). An offset o becomes (o
    /// + 0.5) · factor − 0.5.
    #[must_use]
    pub fn rescaled(&self, factor: f64) -> Self {
        Self {
            samp_off: (self.samp_off + 0.5) * factor - 0.5,
            line_off: (self.line_off + 0.5) * factor - 0.5,
            samp_scale: self.samp_scale * factor,
            line_scale: self.line_scale * factor,
            ..self.clone()
        }
    }

    /// Returns normalised longitude, latitude and height. The longitude difference is brought into
    /// ±180°.
    pub(crate) fn normalised(&self, g: LonLatHeight) -> [f64; 3] {
        [
            short_way(g.lon_deg - self.long_off) / self.long_scale,
            (g.lat_deg - self.lat_off) / self.lat_scale,
            (g.height_m - self.height_off) / self.height_scale,
        ]
    }

    /// Returns the ninety numbers of the projection in the order of RPC00B: offsets, scales and the
    /// coefficients of the four polynomials.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let scalars = self.offsets().into_iter().chain(self.scales()).map(|(_, value)| value);
        scalars.chain(self.polynomials().into_iter().flat_map(|(_, coefficients)| coefficients.iter().copied()))
    }

    fn offsets(&self) -> [(&'static str, f64); 5] {
        [
            ("LINE_OFF", self.line_off),
            ("SAMP_OFF", self.samp_off),
            ("LAT_OFF", self.lat_off),
            ("LONG_OFF", self.long_off),
            ("HEIGHT_OFF", self.height_off),
        ]
    }

    fn scales(&self) -> [(&'static str, f64); 5] {
        [
            ("LINE_SCALE", self.line_scale),
            ("SAMP_SCALE", self.samp_scale),
            ("LAT_SCALE", self.lat_scale),
            ("LONG_SCALE", self.long_scale),
            ("HEIGHT_SCALE", self.height_scale),
        ]
    }

    fn polynomials(&self) -> [(&'static str, &[f64; 20]); 4] {
        [
            ("LINE_NUM_COEFF", &self.line_num),
            ("LINE_DEN_COEFF", &self.line_den),
            ("SAMP_NUM_COEFF", &self.samp_num),
            ("SAMP_DEN_COEFF", &self.samp_den),
        ]
    }
}
