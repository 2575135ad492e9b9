//! Colours that depend on the direction of view: real spherical harmonics of degree 1 to 3, with
//! the signs and the order of 3D Gaussian Splatting (Kerbl et al. 2023).

/// Factors of the harmonics of each degree.
const C1: f64 = 0.488_602_511_902_919_9;
const C2: [f64; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
const C3: [f64; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// Coefficients of the harmonics of splats beyond the constant one, which is
/// [`crate::Splat::colour`].
#[derive(Debug, Clone, PartialEq)]
pub struct SplatHarmonics {
    degree: u8,
    /// Splat by splat: all of red, all of green, all of blue.
    coefficients: Vec<f32>,
}

impl SplatHarmonics {
    /// Highest degree.
    pub const DEGREE_MAX: u8 = 3;

    /// Returns the number of coefficients of a channel of a splat: (d + 1)² − 1.
    pub fn count(degree: u8) -> usize {
        let side = usize::from(degree) + 1;
        side * side - 1
    }

    /// Takes the coefficients of splats: for each all of red, all of green and all of blue.
    ///
    /// Returns `None` for a degree of 0 or above [`Self::DEGREE_MAX`], and for a number that is not
    /// that of whole splats.
    pub fn new(degree: u8, coefficients: Vec<f32>) -> Option<Self> {
        let is_known = (1..=Self::DEGREE_MAX).contains(&degree);
        let is_whole = is_known && coefficients.len().is_multiple_of(3 * Self::count(degree));
        is_whole.then_some(Self { degree, coefficients })
    }

    /// Returns the degree.
    pub fn degree(&self) -> u8 {
        self.degree
    }

    /// Returns the coefficients of a channel of a splat.
    ///
    /// # Panics
    /// If there is no such splat or channel.
    pub fn of(&self, splat: usize, channel: usize) -> &[f32] {
        let count = Self::count(self.degree);
        &self.coefficients[(3 * splat + channel) * count..][..count]
    }

    /// Returns the colour of a splat that is seen along a direction, from the camera to the splat,
    /// of any length above 0. Colours are not below 0, as in all viewers.
    ///
    /// # Panics
    /// If there is no such splat.
    ///
    /// # Examples
    /// ```
    /// use gaussian::SplatHarmonics;
    ///
    /// // Red grows upwards.
    /// let mut coefficients = vec![0.0; 9];
    /// coefficients[1] = 0.5;
    /// let harmonics = SplatHarmonics::new(1, coefficients).expect("degree 1");
    /// let up = harmonics.colour(0, [0.5; 3], [0.0, 0.0, 2.0]);
    /// assert!((up[0] - 0.7443).abs() < 1e-4 && up[1] == 0.5);
    /// ```
    pub fn colour(&self, splat: usize, constant: [f32; 3], direction: [f64; 3]) -> [f32; 3] {
        let values = harmonic_values(direction);
        let channel = |channel: usize| {
            let terms = self.of(splat, channel).iter().zip(&values);
            let sum: f64 = terms.map(|(coefficient, value)| f64::from(*coefficient) * value).sum();
            (f64::from(constant[channel]) + sum).max(0.0) as f32
        };
        [channel(0), channel(1), channel(2)]
    }
}

/// Returns the values of the harmonics of degree 1 to 3 in a direction of any length above 0, in
/// the order of the coefficients.
pub fn harmonic_values(direction: [f64; 3]) -> [f64; 15] {
    let [x, y, z] = unit(direction).0;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * x * y,
        C2[1] * y * z,
        C2[2] * (2.0 * zz - xx - yy),
        C2[3] * x * z,
        C2[4] * (xx - yy),
        C3[0] * y * (3.0 * xx - yy),
        C3[1] * x * y * z,
        C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        C3[4] * x * (4.0 * zz - xx - yy),
        C3[5] * z * (xx - yy),
        C3[6] * x * (xx - 3.0 * yy),
    ]
}

/// Returns the derivatives of [`harmonic_values`] by the direction, at a length above 0: they are
/// across it, because its length changes nothing.
pub fn harmonic_slopes(direction: [f64; 3]) -> [[f64; 3]; 15] {
    let ([x, y, z], length) = unit(direction);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let gradients = [
        [0.0, -C1, 0.0],
        [0.0, 0.0, C1],
        [-C1, 0.0, 0.0],
        [C2[0] * y, C2[0] * x, 0.0],
        [0.0, C2[1] * z, C2[1] * y],
        [-2.0 * C2[2] * x, -2.0 * C2[2] * y, 4.0 * C2[2] * z],
        [C2[3] * z, 0.0, C2[3] * x],
        [2.0 * C2[4] * x, -2.0 * C2[4] * y, 0.0],
        [6.0 * C3[0] * x * y, 3.0 * C3[0] * (xx - yy), 0.0],
        [C3[1] * y * z, C3[1] * x * z, C3[1] * x * y],
        [-2.0 * C3[2] * x * y, C3[2] * (4.0 * zz - xx - 3.0 * yy), 8.0 * C3[2] * y * z],
        [-6.0 * C3[3] * x * z, -6.0 * C3[3] * y * z, C3[3] * (6.0 * zz - 3.0 * xx - 3.0 * yy)],
        [C3[4] * (4.0 * zz - 3.0 * xx - yy), -2.0 * C3[4] * x * y, 8.0 * C3[4] * x * z],
        [2.0 * C3[5] * x * z, -2.0 * C3[5] * y * z, C3[5] * (xx - yy)],
        [3.0 * C3[6] * (xx - yy), -6.0 * C3[6] * x * y, 0.0],
    ];
    gradients.map(|[gx, gy, gz]| {
        let along = gx * x + gy * y + gz * z;
        [(gx - along * x) / length, (gy - along * y) / length, (gz - along * z) / length]
    })
}

/// Returns the unit vector and the length.
fn unit(direction: [f64; 3]) -> ([f64; 3], f64) {
    let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
    (direction.map(|c| c / length), length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Real harmonics are orthonormal over the sphere.
    #[test]
    fn harmonics_are_orthonormal() {
        let mut sums = [[0.0; 15]; 15];
        // Directions that are spread evenly along a spiral.
        let count = 20_000;
        for k in 0..count {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
            let (angle, radius) = (2.399_963_229_728_653 * f64::from(k), (1.0 - z * z).sqrt());
            let found = harmonic_values([radius * angle.cos(), radius * angle.sin(), z]);
            for (i, row) in sums.iter_mut().enumerate() {
                row.iter_mut().zip(found).for_each(|(sum, value)| *sum += found[i] * value);
            }
        }
        for (i, row) in sums.iter().enumerate() {
            for (j, sum) in row.iter().enumerate() {
                let mean = 4.0 * std::f64::consts::PI * sum / f64::from(count);
                assert!((mean - if i == j { 1.0 } else { 0.0 }).abs() < 1e-3, "{i} {j}: {mean}");
            }
        }
    }

    #[test]
    fn slopes_are_central_differences() {
        for direction in [[0.3, -1.7, 0.9], [-2.0, 0.4, -0.1], [0.0, 0.0, 3.0]] {
            let slopes = harmonic_slopes(direction);
            for axis in 0..3 {
                let moved = |by: f64| {
                    let mut moved = direction;
                    moved[axis] += by;
                    harmonic_values(moved)
                };
                let (ahead, behind) = (moved(1e-6), moved(-1e-6));
                for k in 0..15 {
                    let expected = (ahead[k] - behind[k]) / 2e-6;
                    assert!((slopes[k][axis] - expected).abs() < 1e-8, "{k} {axis}: {slopes:?}");
                }
            }
        }
    }

    #[test]
    fn coefficients_are_those_of_whole_splats() {
        assert_eq!([1, 2, 3].map(SplatHarmonics::count), [3, 8, 15]);
        assert!(SplatHarmonics::new(0, Vec::new()).is_none() && SplatHarmonics::new(4, Vec::new()).is_none());
        assert!(SplatHarmonics::new(1, vec![0.0; 10]).is_none());
        let harmonics = SplatHarmonics::new(1, (0..18).map(|i| i as f32).collect()).unwrap();
        assert_eq!((harmonics.of(1, 2), harmonics.degree()), (&[15.0, 16.0, 17.0][..], 1));
        assert_eq!(harmonics.colour(0, [0.0; 3], [0.0, 1.0, 0.0]), [0.0; 3]);
    }
}
