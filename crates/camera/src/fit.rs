//! Fitting an RPC to ground ↔ image correspondences.
//!
//! Each image coordinate is fitted on its own. Let r be the normalised coordinate, and fix the
//! first coefficient of D at 1. Then the residual N(x) − r D(x) is linear in the other 39
//! coefficients. Dividing it by D of the previous round makes the sum of squares the one of the
//! image residuals (Tao & Hu, Photogrammetric Engineering & Remote Sensing 67, 2001). A small ridge
//! regularises the problem, because real geometry leaves several coefficients undetermined. Each
//! round is a least-squares problem solved by QR, which is more accurate than normal equations.
//!
//! Offsets and scales are the middle and half the range of the correspondences: these become the
//! validity domain.

use geodesy::LonLatHeight;
use nalgebra::{DMatrix, DVector};
use numeric::failures;

use crate::limits::short_way;
use crate::polynomial::terms;
use crate::{CameraError, ImagePoint, Rpc, RpcCamera, ValidityDomain};

/// Unknowns of one image coordinate: 20 of the numerator, 19 of the denominator.
const UNKNOWNS: usize = 39;
/// Weight of the ridge relative to one correspondence.
const RIDGE: f64 = 1e-9;
/// Rounds of reweighting. Denominators stay within a few percent of 1, so the second round already
/// changes little.
const ROUNDS: usize = 4;
/// Numbers of lattice positions along longitude, latitude and height. They determine all
/// coefficients well.
const LATTICE: [usize; 3] = [13, 13, 7];

/// A ground point and its image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// Ground position.
    pub ground: LonLatHeight,
    /// Image position.
    pub image: ImagePoint,
}

/// A fitted model with its residuals at the correspondences.
#[derive(Debug, Clone, PartialEq)]
pub struct RpcFit {
    /// The fitted model.
    pub rpc: Rpc,
    /// Root mean square distance in the image, pixels.
    pub rms_px: f64,
    /// Largest distance in the image, pixels.
    pub max_px: f64,
}

/// Correspondences to which no RPC can be fitted.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Too few correspondences to determine the coefficients.
    #[error("{found} correspondences found; an RPC needs at least {UNKNOWNS}, spread over its domain")]
    TooFew {
        /// Number of correspondences.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("correspondence {index} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the correspondence.
        index: usize,
    },
    /// All correspondences have the same longitude, latitude, sample or line.
    #[error("all correspondences have the same {coordinate}: expected points spread over the image and the ground")]
    Degenerate {
        /// Name of the coordinate.
        coordinate: &'static str,
    },
    /// The least squares problem has no solution, or the fitted model fails at its own points.
    #[error(
        "the fitted model does not form a camera: check that ground and image coordinates belong to the same points"
    )]
    Unsolvable,
    /// The camera to be fitted fails inside its domain.
    #[error("the camera to be fitted fails inside its domain: {0}")]
    Camera(#[from] CameraError),
}

failures!(FitError: Input);

impl RpcFit {
    /// Fits a model to correspondences.
    ///
    /// # Errors
    /// See [`FitError`].
    pub fn to_correspondences(points: &[Correspondence]) -> Result<Self, FitError> {
        let mut rpc = normalisation(points)?;
        let normalised: Vec<[f64; 20]> =
            points.iter().map(|c| rpc.normalised(c.ground)).map(|[l, p, h]| terms(l, p, h)).collect();
        let samples = points.iter().map(|c| (c.image.sample - rpc.samp_off) / rpc.samp_scale);
        let lines = points.iter().map(|c| (c.image.line - rpc.line_off) / rpc.line_scale);
        (rpc.samp_num, rpc.samp_den) = ratio(&normalised, &samples.collect::<Vec<_>>())?;
        (rpc.line_num, rpc.line_den) = ratio(&normalised, &lines.collect::<Vec<_>>())?;
        Self::measured(rpc, points)
    }

    /// Fits a model to a camera given as a function, on a lattice over a domain.
    ///
    /// # Errors
    /// See [`FitError`].
    pub fn to_camera(
        domain: &ValidityDomain,
        image_from_ground: impl Fn(LonLatHeight) -> Result<ImagePoint, CameraError>,
    ) -> Result<Self, FitError> {
        let [nl, np, nh] = LATTICE;
        let at = |i: usize, n: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
        let points: Result<Vec<_>, CameraError> = (0..nl * np * nh)
            .map(|m| domain.at([at(m % nl, nl), at(m / nl % np, np), at(m / (nl * np), nh)]))
            .map(|ground| Ok(Correspondence { ground, image: image_from_ground(ground)? }))
            .collect();
        Self::to_correspondences(&points?)
    }

    /// Measures the residuals of a model at correspondences.
    ///
    /// # Errors
    /// [`FitError::Unsolvable`] when the model has no image for one of them.
    fn measured(rpc: Rpc, points: &[Correspondence]) -> Result<Self, FitError> {
        let (mut sum, mut max_px) = (0.0, 0.0_f64);
        for c in points {
            let p = rpc.project(c.ground).map_err(|_| FitError::Unsolvable)?;
            let (ds, dl) = (p.sample - c.image.sample, p.line - c.image.line);
            sum += ds * ds + dl * dl;
            max_px = max_px.max(ds.hypot(dl));
        }
        Ok(Self { rpc, rms_px: (sum / points.len() as f64).sqrt(), max_px })
    }
}

impl RpcCamera {
    /// Returns one RPC that includes the correction, for formats without corrections.
    ///
    /// Translations and changes of scale go into offsets and scales. Shears between equal
    /// denominators go into the numerators. Both are exact, with residuals of 0. Any other
    /// correction is fitted over the validity domain.
    ///
    /// # Errors
    /// The same as for [`RpcFit::to_camera`].
    pub fn folded(&self) -> Result<RpcFit, FitError> {
        let rpc = &self.rpc;
        let [[a, b], [c, d]] = self.correction.linear;
        let sheared = b != 0.0 || c != 0.0;
        if sheared && rpc.samp_den != rpc.line_den {
            return RpcFit::to_camera(&rpc.domain(), |g| self.project(g)).map(|fit| Self::with_errors_of(rpc, fit));
        }
        let off = self.correction.apply(ImagePoint::new(rpc.samp_off, rpc.line_off));
        let mixed = |own: &[f64; 20], other: &[f64; 20], own_scale: f64, shear: f64, other_scale: f64| {
            std::array::from_fn(|i| own[i] + shear * other_scale / own_scale * other[i])
        };
        let (samp_scale, line_scale) = (rpc.samp_scale * (1.0 + a), rpc.line_scale * (1.0 + d));
        let folded = Rpc {
            samp_off: off.sample,
            line_off: off.line,
            samp_scale,
            line_scale,
            samp_num: mixed(&rpc.samp_num, &rpc.line_num, samp_scale, b, rpc.line_scale),
            line_num: mixed(&rpc.line_num, &rpc.samp_num, line_scale, c, rpc.samp_scale),
            ..rpc.clone()
        };
        Ok(RpcFit { rpc: folded, rms_px: 0.0, max_px: 0.0 })
    }

    /// Copies the provider's error estimates, which a fit does not know.
    fn with_errors_of(rpc: &Rpc, fit: RpcFit) -> RpcFit {
        let refitted = Rpc { err_bias_m: rpc.err_bias_m, err_rand_m: rpc.err_rand_m, ..fit.rpc };
        RpcFit { rpc: refitted, ..fit }
    }
}

/// Returns a model with offsets and scales but without coefficients.
fn normalisation(points: &[Correspondence]) -> Result<Rpc, FitError> {
    let first = match points {
        [first, ..] if points.len() >= UNKNOWNS => first.ground.lon_deg,
        _ => return Err(FitError::TooFew { found: points.len() }),
    };
    let coordinates = |c: &Correspondence| {
        let lon = first + short_way(c.ground.lon_deg - first);
        [lon, c.ground.lat_deg, c.ground.height_m, c.image.sample, c.image.line]
    };
    let (mut low, mut high) = ([f64::INFINITY; 5], [f64::NEG_INFINITY; 5]);
    for (index, c) in points.iter().map(coordinates).enumerate() {
        if c.iter().any(|v| !v.is_finite()) {
            return Err(FitError::NotFinite { index });
        }
        for i in 0..5 {
            low[i] = low[i].min(c[i]);
            high[i] = high[i].max(c[i]);
        }
    }
    let off: [f64; 5] = std::array::from_fn(|i| 0.5 * (low[i] + high[i]));
    let mut scale: [f64; 5] = std::array::from_fn(|i| 0.5 * (high[i] - low[i]));
    // Points at a single height are allowed: they give a model of one plane.
    if scale[2] == 0.0 {
        scale[2] = 1.0;
    }
    for (value, coordinate) in scale.into_iter().zip(["longitude", "latitude", "height", "sample", "line"]) {
        if value == 0.0 {
            return Err(FitError::Degenerate { coordinate });
        }
    }
    Ok(Rpc {
        line_off: off[4],
        samp_off: off[3],
        lat_off: off[1],
        long_off: short_way(off[0]),
        height_off: off[2],
        line_scale: scale[4],
        samp_scale: scale[3],
        lat_scale: scale[1],
        long_scale: scale[0],
        height_scale: scale[2],
        line_num: [0.0; 20],
        line_den: [0.0; 20],
        samp_num: [0.0; 20],
        samp_den: [0.0; 20],
        err_bias_m: None,
        err_rand_m: None,
    })
}

/// Returns the numerator and denominator whose quotient fits the values `r` at points with the
/// given terms.
fn ratio(points: &[[f64; 20]], r: &[f64]) -> Result<([f64; 20], [f64; 20]), FitError> {
    let mut den = [0.0; 20];
    den[0] = 1.0;
    let mut num = [0.0; 20];
    for _ in 0..ROUNDS {
        let weights = points.iter().map(|t| 1.0 / t.iter().zip(&den).map(|(t, c)| t * c).sum::<f64>());
        let x = weighted_solution(points, r, &weights.collect::<Vec<_>>())?;
        num.copy_from_slice(&x.as_slice()[..20]);
        den[1..].copy_from_slice(&x.as_slice()[20..]);
    }
    Ok((num, den))
}

/// Returns the ridge-regularised least-squares solution of w (N − r (D − 1)) = w r.
fn weighted_solution(points: &[[f64; 20]], r: &[f64], weights: &[f64]) -> Result<DVector<f64>, FitError> {
    let n = points.len();
    let ridge = RIDGE * (n as f64).sqrt();
    let matrix = DMatrix::from_fn(n + UNKNOWNS, UNKNOWNS, |i, j| match (i < n, j < 20) {
        (true, true) => weights[i] * points[i][j],
        (true, false) => -weights[i] * r[i] * points[i][j - 19],
        (false, _) => f64::from(u8::from(i - n == j)) * ridge,
    });
    let mut right = DVector::from_fn(n + UNKNOWNS, |i, _| if i < n { weights[i] * r[i] } else { 0.0 });
    let qr = matrix.qr();
    qr.q_tr_mul(&mut right);
    let x = qr.r().solve_upper_triangular(&right.rows(0, UNKNOWNS)).ok_or(FitError::Unsolvable)?;
    if x.iter().all(|v| v.is_finite()) { Ok(x) } else { Err(FitError::Unsolvable) }
}
