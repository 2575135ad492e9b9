//! The parameters of a 2D Gaussian (Huang et al., "2D Gaussian Splatting", SIGGRAPH 2024), in the
//! form in which they are learned: without bounds.
//!
//! Scales are logarithms and opacities are logits, as the PLY files of trainers store them.
//! Positions are metres from a local origin.

use gaussian::Splat;

/// Least and greatest opacity of an imported splat, so that its logit is finite.
const OPACITY_RANGE: [f32; 2] = [1e-4, 0.9999];

/// A flat Gaussian: an ellipse in a plane. Also the gradient of a loss by its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surfel {
    /// Centre, metres from the local origin.
    pub position: [f32; 3],
    /// Quaternion (w, x, y, z) of any length above 0; the first two axes lie in the plane.
    pub rotation: [f32; 4],
    /// Natural logarithms of the standard deviations along the first two axes, metres.
    pub log_scale: [f32; 2],
    /// Logit of the opacity at the centre.
    pub opacity_logit: f32,
    /// Red, green, blue; the displayed range is 0 to 1.
    pub colour: [f32; 3],
}

impl Surfel {
    /// Number of parameters.
    pub const PARAMETERS: usize = 13;
    /// Place of the opacity among the parameters.
    pub(crate) const OPACITY: usize = 9;

    /// Returns the parameters in the order of the fields.
    pub fn to_array(self) -> [f32; Self::PARAMETERS] {
        let ([x, y, z], [qw, qx, qy, qz], [su, sv], [r, g, b]) =
            (self.position, self.rotation, self.log_scale, self.colour);
        [x, y, z, qw, qx, qy, qz, su, sv, self.opacity_logit, r, g, b]
    }

    /// Returns the surfel with the parameters of [`Self::to_array`].
    pub fn from_array([x, y, z, qw, qx, qy, qz, su, sv, opacity_logit, r, g, b]: [f32; Self::PARAMETERS]) -> Self {
        Self { position: [x, y, z], rotation: [qw, qx, qy, qz], log_scale: [su, sv], opacity_logit, colour: [r, g, b] }
    }

    /// Returns the opacity at the centre.
    pub fn opacity(&self) -> f64 {
        1.0 / (1.0 + (-f64::from(self.opacity_logit)).exp())
    }

    /// Returns the standard deviations along the first two axes, metres.
    pub fn scale_m(&self) -> [f64; 2] {
        self.log_scale.map(|s| f64::from(s).exp())
    }

    /// Returns the unit quaternion and the length that was divided away.
    pub fn unit_rotation(&self) -> ([f64; 4], f64) {
        let q = self.rotation.map(f64::from);
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        (q.map(|c| c / length), length)
    }

    /// Returns the two axes of the plane and its normal, unit vectors.
    pub fn axes(&self) -> [[f64; 3]; 3] {
        let ([w, x, y, z], _) = self.unit_rotation();
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }

    /// Returns the surfel of a splat, whose scale along the normal is dropped.
    pub fn of_splat(splat: &Splat) -> Self {
        let [least, greatest] = OPACITY_RANGE;
        let opacity = splat.opacity.clamp(least, greatest);
        Self {
            position: splat.position,
            rotation: splat.rotation,
            log_scale: [splat.scale_m[0].ln(), splat.scale_m[1].ln()],
            opacity_logit: (opacity / (1.0 - opacity)).ln(),
            colour: splat.colour,
        }
    }

    /// Returns a splat of the given thickness.
    pub fn to_splat(&self, thickness_m: f32) -> Splat {
        let [su, sv] = self.scale_m().map(|s| s as f32);
        let [least, greatest] = OPACITY_RANGE;
        Splat {
            position: self.position,
            scale_m: [su, sv, thickness_m],
            rotation: self.unit_rotation().0.map(|c| c as f32),
            colour: self.colour,
            opacity: (self.opacity() as f32).clamp(least, greatest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splats_come_back() {
        let splat = Splat {
            position: [1.0, -2.0, 30.0],
            scale_m: [0.5, 0.25, 0.01],
            rotation: [0.5, -0.5, 0.5, 0.5],
            colour: [0.1, 0.5, 0.9],
            opacity: 0.75,
        };
        let surfel = Surfel::of_splat(&splat);
        let back = surfel.to_splat(0.01);
        assert_eq!(back.validate(), Ok(()));
        assert_eq!((back.position, back.rotation, back.colour), (splat.position, splat.rotation, splat.colour));
        assert!((back.opacity - 0.75).abs() < 1e-6 && (back.scale_m[1] - 0.25).abs() < 1e-6);
        assert_eq!(surfel.axes(), splat.axes());
        assert_eq!(Surfel::from_array(surfel.to_array()), surfel);
        assert_eq!(Surfel::of_splat(&Splat { opacity: 1.0, ..splat }).to_splat(0.01).validate(), Ok(()));
    }
}
