//! The corrections that an adjustment can find: which parameters each order has, and the cameras
//! that follow from them.
//!
//! Every view has the same six parameters, of which lower orders leave some at zero. A correction
//! acts about the image's centre, in units of half its size, so that every parameter is in pixels.

use camera::{ImageCorrection, ImagePoint, RpcCamera};
use nalgebra::{SMatrix, SVector};

/// Number of parameters of a view, used or not.
pub(super) const PARAMETERS: usize = 6;
/// Parameters of a view: shift of samples and of lines, then samples by sample and by line, and
/// lines by sample and by line.
pub(super) type Parameters = SVector<f64, PARAMETERS>;
/// Derivatives of a position (sample, line) with respect to the parameters of its view.
pub(super) type OwnDesign = SMatrix<f64, 2, PARAMETERS>;

/// Order of the image-space corrections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ModelOrder {
    /// No correction.
    None,
    /// One shift per view.
    Translation,
    /// One shift per view that grows with the line: the drift of a sensor along its track.
    Drift,
    /// One affine map per view.
    Affine,
}

impl ModelOrder {
    /// All orders, the lowest first.
    pub(super) const ALL: [Self; 4] = [Self::None, Self::Translation, Self::Drift, Self::Affine];

    /// Returns the positions of the parameters that this order uses.
    const fn used(self) -> &'static [usize] {
        match self {
            Self::None => &[],
            Self::Translation => &[0, 1],
            Self::Drift => &[0, 1, 3, 5],
            Self::Affine => &[0, 1, 2, 3, 4, 5],
        }
    }

    /// Returns the number of parameters per view.
    pub const fn parameters(self) -> usize {
        self.used().len()
    }
}

/// Returns the cameras with the corrections of the parameters, which follow the ones that the
/// cameras have.
pub(super) fn corrected(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    x: &[Parameters],
    order: ModelOrder,
) -> Vec<RpcCamera> {
    let one = |((c, size), p): ((&RpcCamera, &(usize, usize)), &Parameters)| {
        let (centre, half) = frame(*size);
        let found = ImageCorrection {
            translation_px: [p[0], p[1]],
            linear: [[p[2] / half, p[3] / half], [p[4] / half, p[5] / half]],
            centre,
        };
        let correction = match order {
            ModelOrder::None => c.correction,
            _ if c.correction == ImageCorrection::IDENTITY => found,
            _ => c.correction.then(&found),
        };
        RpcCamera { rpc: c.rpc.clone(), correction }
    };
    cameras.iter().zip(sizes).zip(x).map(one).collect()
}

/// Returns the derivatives of a corrected position with respect to the parameters of its view.
/// Those of parameters that the order does not use are zero.
pub(super) fn own_design(p: ImagePoint, size: (usize, usize), order: ModelOrder) -> OwnDesign {
    let (centre, half) = frame(size);
    let (s, l) = ((p.sample - centre.sample) / half, (p.line - centre.line) / half);
    let all = [[1.0, 0.0], [0.0, 1.0], [s, 0.0], [l, 0.0], [0.0, s], [0.0, l]];
    let mut out = OwnDesign::zeros();
    for &k in order.used() {
        (out[(0, k)], out[(1, k)]) = (all[k][0], all[k][1]);
    }
    out
}

/// Returns the centre of an image and half its larger side, pixels.
fn frame((width, height): (usize, usize)) -> (ImagePoint, f64) {
    let centre = ImagePoint::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
    (centre, half_side((width, height)))
}

/// Returns half the larger side of an image, pixels.
pub(super) fn half_side((width, height): (usize, usize)) -> f64 {
    0.5 * width.max(height) as f64
}
