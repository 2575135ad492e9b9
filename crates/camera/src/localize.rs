//! Localisation: the ground point of a height plane that is seen at an image position.
//!
//! Newton's method works on normalised (L, P) with the analytic Jacobian. Each step is shortened
//! until the residual falls and the path crosses no pole and no fold of the model. The search
//! starts at the centre of the domain, from where real sensors converge in three or four steps,
//! whatever their image offsets: the step is affine-invariant in the image. If that fails because
//! of a pole or a fold inside the domain, the best positions of a lattice are tried.
//!
//! A result is accepted if it lies within [`EXTRAPOLATION_MAX`] half-widths of the centre on the
//! centre's side of every pole and fold, or else inside the validity domain itself. Everything else
//! is an error.

use geodesy::LonLatHeight;

use crate::limits::EXTRAPOLATION_MAX;
use crate::plane::{PlaneSample, RpcPlane};
use crate::{CameraError, ImagePoint, Rpc};

/// Residual at which localisation stops, pixels: far below any practical need.
const TOLERANCE_PX: f64 = 1e-9;
/// Residual that is still accepted, pixels. Rounding of huge pixel coordinates can keep it above
/// the tolerance.
const STALLED_PX: f64 = 1e-7;
/// Largest number of steps from one start. Quadratic convergence needs far fewer.
const STEPS: u32 = 40;
/// Largest number of halvings of one step.
const HALVINGS: u32 = 12;
/// Positions along each axis of the lattice of starts over [−1, 1]².
const LATTICE: usize = 9;
/// Number of starts that are followed.
const STARTS: usize = 8;

/// The end of a Newton search.
struct End {
    l: f64,
    p: f64,
    at: PlaneSample,
    residual_px: f64,
    steps: u32,
    /// Whether the last step was shortened because it left the accepted region.
    at_edge: bool,
}

impl Rpc {
    /// Returns the ground point at `height_m` (ellipsoidal) that is seen at an image position.
    ///
    /// # Errors
    /// A coordinate that is not finite, a point far outside the domain, a pole at the centre, or no
    /// convergence.
    pub fn localize(&self, image: ImagePoint, height_m: f64) -> Result<LonLatHeight, CameraError> {
        self.plane(height_m).localize(image)
    }
}

impl RpcPlane {
    /// Returns the ground point of this plane that is seen at an image position.
    ///
    /// # Errors
    /// The same as for [`Rpc::localize`].
    pub fn localize(&self, image: ImagePoint) -> Result<LonLatHeight, CameraError> {
        if !(image.sample.is_finite() && image.line.is_finite() && self.height_m.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let centre = self.sample(0.0, 0.0);
        let first = centre.and_then(|at| self.newton(image, 0.0, 0.0, at));
        let side = centre.ok().map(|at| at.orientation);
        match first {
            Ok(end) if end.accepted(side) => Ok(self.ground(end.l, end.p)),
            first => self.localize_from_lattice(image, side).ok_or_else(|| failure(first)),
        }
    }

    /// Returns the first acceptable end among the starts with the smallest residuals.
    fn localize_from_lattice(&self, image: ImagePoint, side: Option<[bool; 3]>) -> Option<LonLatHeight> {
        let at = |i: usize| 2.0 * i as f64 / (LATTICE - 1) as f64 - 1.0;
        let mut starts: Vec<(f64, f64, f64, PlaneSample)> = (0..LATTICE * LATTICE)
            .filter_map(|k| {
                let (l, p) = (at(k % LATTICE), at(k / LATTICE));
                let s = self.sample(l, p).ok()?;
                Some((residual(image, s.image), l, p, s))
            })
            .collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.iter().take(STARTS).find_map(|&(_, l, p, s)| {
            let end = self.newton(image, l, p, s).ok()?;
            end.accepted(side).then(|| self.ground(end.l, end.p))
        })
    }

    fn newton(&self, image: ImagePoint, l: f64, p: f64, start: PlaneSample) -> Result<End, CameraError> {
        let residual_px = residual(image, start.image);
        let mut end = End { l, p, at: start, residual_px, steps: 0, at_edge: false };
        while end.steps < STEPS && end.residual_px > 0.0 {
            let (ds, dn) = (image.sample - end.at.image.sample, image.line - end.at.image.line);
            let [[s_l, s_p], [n_l, n_p]] = end.at.jacobian;
            let det = end.at.determinant;
            let step = [(n_p * ds - s_p * dn) / det, (s_l * dn - n_l * ds) / det];
            if !(step[0].is_finite() && step[1].is_finite()) {
                break;
            }
            if end.residual_px < TOLERANCE_PX {
                end.l += step[0];
                end.p += step[1];
                break;
            }
            if !self.shortened_step(image, step, &mut end) {
                break;
            }
        }
        Ok(end)
    }

    /// Halves the step until it brings the image closer without crossing a pole or fold. Returns
    /// false if none does.
    fn shortened_step(&self, image: ImagePoint, step: [f64; 2], end: &mut End) -> bool {
        let mut t = 1.0;
        end.at_edge = false;
        for _ in 0..HALVINGS {
            let (l, p) = (end.l + t * step[0], end.p + t * step[1]);
            if l.abs().max(p.abs()) > EXTRAPOLATION_MAX {
                end.at_edge = true;
            } else if let Ok(at) = self.sample(l, p) {
                let r = residual(image, at.image);
                if r < end.residual_px && at.orientation == end.at.orientation {
                    *end = End { l, p, at, residual_px: r, steps: end.steps + 1, at_edge: false };
                    return true;
                }
            }
            t *= 0.5;
        }
        false
    }
}

impl End {
    fn accepted(&self, side: Option<[bool; 3]>) -> bool {
        let inside = self.l.abs().max(self.p.abs()) <= 1.0 + 1e-9;
        self.residual_px < STALLED_PX && (inside || side == Some(self.at.orientation))
    }
}

fn residual(a: ImagePoint, b: ImagePoint) -> f64 {
    (a.sample - b.sample).hypot(a.line - b.line)
}

/// Returns the error of the first start, for the case that no start succeeded.
fn failure(first: Result<End, CameraError>) -> CameraError {
    match first {
        Err(e) => e,
        Ok(end) if end.at_edge => {
            CameraError::OutsideDomain { normalised: end.l.abs().max(end.p.abs()), limit: EXTRAPOLATION_MAX }
        }
        Ok(end) => CameraError::NotConverged { residual_px: end.residual_px, iterations: end.steps },
    }
}
