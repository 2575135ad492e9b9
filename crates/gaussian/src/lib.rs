//! A Gaussian on a surface: SkySplat's G = {μ, S, R, C, α}, in plain units.
//!
//! Positions are metres from a local origin, which is recorded beside them, so that f32 is precise
//! enough. The covariance is R S Sᵀ Rᵀ. The third principal axis is the surface normal. The crate
//! `io` converts to the logarithms, logits and harmonics that trainers store.

mod harmonics;
mod labels;

pub use harmonics::{SplatHarmonics, harmonic_slopes, harmonic_values};
pub use labels::{LabelVotes, SplatLabel};

/// An oriented Gaussian with a colour and an opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splat {
    /// Centre μ, metres from the local origin: east, north, up.
    pub position: [f32; 3],
    /// Standard deviations S along the principal axes, metres, all positive; the third is along the
    /// normal.
    pub scale_m: [f32; 3],
    /// Unit quaternion R (w, x, y, z), the rotation from the principal axes to the world.
    pub rotation: [f32; 4],
    /// Colour C: red, green, blue; the displayed range is 0 to 1.
    pub colour: [f32; 3],
    /// Opacity α at the centre, strictly between 0 and 1.
    pub opacity: f32,
}

/// Why a [`Splat`] is not a valid Gaussian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplatDefect {
    /// A value is NaN or infinite.
    #[error("a value of the splat is not finite")]
    NotFinite,
    /// A standard deviation is zero or negative.
    #[error("a scale of the splat is not positive")]
    Scale,
    /// The length of the quaternion differs from 1 by more than a thousandth.
    #[error("the length of the splat's quaternion is not 1")]
    Rotation,
    /// The opacity is not strictly between 0 and 1, so that it has no logit.
    #[error("the opacity of the splat is not strictly between 0 and 1")]
    Opacity,
}

impl Splat {
    /// Checks that the values describe a Gaussian.
    ///
    /// # Errors
    /// [`SplatDefect`] with the first defect found.
    ///
    /// # Examples
    /// ```
    /// use gaussian::{Splat, SplatDefect};
    ///
    /// let splat = Splat {
    ///     position: [0.0, 0.0, 10.0],
    ///     scale_m: [0.5, 0.5, 0.01],
    ///     rotation: [1.0, 0.0, 0.0, 0.0],
    ///     colour: [0.8, 0.3, 0.2],
    ///     opacity: 0.9,
    /// };
    /// assert_eq!(splat.validate(), Ok(()));
    /// assert_eq!(Splat { opacity: 1.0, ..splat }.validate(), Err(SplatDefect::Opacity));
    /// ```
    pub fn validate(&self) -> Result<(), SplatDefect> {
        let groups: [&[f32]; 5] = [&self.position, &self.scale_m, &self.rotation, &self.colour, &[self.opacity]];
        if !groups.concat().iter().all(|v| v.is_finite()) {
            return Err(SplatDefect::NotFinite);
        }
        if self.scale_m.iter().any(|&s| s <= 0.0) {
            return Err(SplatDefect::Scale);
        }
        let length = self.rotation.iter().map(|q| q * q).sum::<f32>().sqrt();
        if (length - 1.0).abs() > 1e-3 {
            return Err(SplatDefect::Rotation);
        }
        if !(self.opacity > 0.0 && self.opacity < 1.0) {
            return Err(SplatDefect::Opacity);
        }
        Ok(())
    }

    /// Returns the principal axes in the world: two tangents and the normal.
    pub fn axes(&self) -> [[f64; 3]; 3] {
        let [w, x, y, z] = self.rotation.map(f64::from);
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }

    /// Returns the surface normal, which is the third principal axis.
    pub fn normal(&self) -> [f64; 3] {
        self.axes()[2]
    }
}

/// Returns the unit quaternion (w, x, y, z) of the rotation whose columns are three orthonormal,
/// right-handed axes.
///
/// The method of Shepperd (J. Guidance and Control 1, 1978) computes the largest component first,
/// which keeps the others precise. The component w is not negative.
///
/// # Examples
/// ```
/// // A quarter turn about the vertical axis.
/// let q = gaussian::quaternion_of_axes([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
/// let half = 0.5f64.sqrt();
/// assert!((q[0] - half).abs() < 1e-15 && (q[3] - half).abs() < 1e-15);
/// ```
pub fn quaternion_of_axes(axes: [[f64; 3]; 3]) -> [f64; 4] {
    let [a, b, c] = axes;
    let squares =
        [1.0 + a[0] + b[1] + c[2], 1.0 + a[0] - b[1] - c[2], 1.0 - a[0] + b[1] - c[2], 1.0 - a[0] - b[1] + c[2]];
    let largest = (1..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let products = match largest {
        0 => [squares[0], b[2] - c[1], c[0] - a[2], a[1] - b[0]],
        1 => [b[2] - c[1], squares[1], a[1] + b[0], c[0] + a[2]],
        2 => [c[0] - a[2], a[1] + b[0], squares[2], b[2] + c[1]],
        _ => [a[1] - b[0], c[0] + a[2], b[2] + c[1], squares[3]],
    };
    let length = products.iter().map(|p| p * p).sum::<f64>().sqrt();
    let sign = if products[0] < 0.0 { -1.0 } else { 1.0 };
    products.map(|p| sign * p / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn splat() -> Splat {
        Splat {
            position: [1.0, 2.0, 3.0],
            scale_m: [0.5, 0.25, 0.01],
            rotation: [1.0, 0.0, 0.0, 0.0],
            colour: [0.1, 0.5, 0.9],
            opacity: 0.75,
        }
    }

    #[test]
    fn defects_are_named() {
        assert_eq!(splat().validate(), Ok(()));
        let changed = |change: fn(&mut Splat)| {
            let mut s = splat();
            change(&mut s);
            s.validate()
        };
        assert_eq!(changed(|s| s.position[1] = f32::NAN), Err(SplatDefect::NotFinite));
        assert_eq!(changed(|s| s.scale_m[2] = 0.0), Err(SplatDefect::Scale));
        assert_eq!(changed(|s| s.rotation[0] = 0.9), Err(SplatDefect::Rotation));
        assert_eq!(changed(|s| s.opacity = 1.0), Err(SplatDefect::Opacity));
    }

    proptest! {
        #[test]
        fn axes_and_quaternions_lead_to_one_another(q in prop::array::uniform4(-1.0..1.0f64)) {
            let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
            prop_assume!(length > 0.1);
            let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
            let unit = q.map(|c| (sign * c / length) as f32);
            let axes = Splat { rotation: unit, ..splat() }.axes();
            let back = quaternion_of_axes(axes);
            // Near w = 0 rounding decides the sign.
            let same: f64 = (0..4).map(|i| back[i] * f64::from(unit[i])).sum();
            prop_assert!((same.abs() - 1.0).abs() < 1e-6, "{unit:?} {back:?}");
            let cross = [
                axes[0][1] * axes[1][2] - axes[0][2] * axes[1][1],
                axes[0][2] * axes[1][0] - axes[0][0] * axes[1][2],
                axes[0][0] * axes[1][1] - axes[0][1] * axes[1][0],
            ];
            prop_assert!((0..3).all(|i| (cross[i] - axes[2][i]).abs() < 1e-5));
        }
    }
}
