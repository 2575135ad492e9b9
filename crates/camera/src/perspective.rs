//! Central perspective cameras: a pose, and a lens with or without distortion.
//!
//! The lens models have COLMAP's names and order of parameters. The radial and tangential ones
//! follow Brown (1971), the fisheyes Kannala and Brandt (2006). The centre of the upper-left pixel
//! is (0, 0). COLMAP has it at (0.5, 0.5), and the readers convert it. Camera axes: x right, y
//! down, z forward.

use crate::ImagePoint;

/// Tolerance when a distortion is inverted, in units of the image plane at distance 1.
const TOLERANCE: f64 = 1e-12;
const MAX_ITERATIONS: usize = 50;
/// Largest angle of a fisheye, radians. Directions at a right angle have no place in the image
/// plane.
const MAX_THETA: f64 = 1.55;

/// A lens model, with its parameters in COLMAP's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LensModel {
    /// f, cx, cy.
    SimplePinhole,
    /// fx, fy, cx, cy.
    Pinhole,
    /// f, cx, cy, k.
    SimpleRadial,
    /// f, cx, cy, k1, k2.
    Radial,
    /// fx, fy, cx, cy, k1, k2, p1, p2.
    OpenCv,
    /// fx, fy, cx, cy, k1 to k4.
    OpenCvFisheye,
    /// fx, fy, cx, cy, k1, k2, p1, p2, k3 to k6.
    FullOpenCv,
    /// fx, fy, cx, cy, ω.
    Fov,
    /// f, cx, cy, k.
    SimpleRadialFisheye,
    /// f, cx, cy, k1, k2.
    RadialFisheye,
    /// fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1.
    ThinPrismFisheye,
}

/// Models in the order of COLMAP's numbers: name, and number of parameters.
const MODELS: [(LensModel, &str, usize); 11] = [
    (LensModel::SimplePinhole, "SIMPLE_PINHOLE", 3),
    (LensModel::Pinhole, "PINHOLE", 4),
    (LensModel::SimpleRadial, "SIMPLE_RADIAL", 4),
    (LensModel::Radial, "RADIAL", 5),
    (LensModel::OpenCv, "OPENCV", 8),
    (LensModel::OpenCvFisheye, "OPENCV_FISHEYE", 8),
    (LensModel::FullOpenCv, "FULL_OPENCV", 12),
    (LensModel::Fov, "FOV", 5),
    (LensModel::SimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4),
    (LensModel::RadialFisheye, "RADIAL_FISHEYE", 5),
    (LensModel::ThinPrismFisheye, "THIN_PRISM_FISHEYE", 12),
];

impl LensModel {
    /// Returns the model with a COLMAP name.
    pub fn from_name(name: &str) -> Option<Self> {
        MODELS.iter().find(|(_, known, _)| *known == name).map(|&(model, ..)| model)
    }

    /// Returns the model with a COLMAP number.
    pub fn from_number(number: u32) -> Option<Self> {
        MODELS.get(usize::try_from(number).ok()?).map(|&(model, ..)| model)
    }

    /// Returns COLMAP's number.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// Returns COLMAP's name.
    pub fn name(self) -> &'static str {
        MODELS[self as usize].1
    }

    /// Returns the number of parameters.
    pub fn parameter_count(self) -> usize {
        MODELS[self as usize].2
    }

    /// Returns whether the lens has no distortion.
    pub fn is_pinhole(self) -> bool {
        matches!(self, Self::SimplePinhole | Self::Pinhole)
    }

    /// Returns whether both axes share one focal length.
    fn has_one_focal_length(self) -> bool {
        matches!(
            self,
            Self::SimplePinhole | Self::SimpleRadial | Self::Radial | Self::SimpleRadialFisheye | Self::RadialFisheye
        )
    }
}

/// Parameters that do not form a lens.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct LensError(#[from] Reason);

/// Why parameters do not form a lens.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Reason {
    /// Too few or too many parameters.
    #[error("the lens model {model} has {expected} parameters, found {found}")]
    Count {
        /// The model.
        model: &'static str,
        /// Number of parameters of the model.
        expected: usize,
        /// Number of parameters found.
        found: usize,
    },
    /// A parameter that is not finite, or a focal length that is not positive.
    #[error(
        "parameter {index} of the lens model {model} is {value}: expected finite numbers, and positive focal lengths"
    )]
    Parameter {
        /// The model.
        model: &'static str,
        /// Index of the parameter.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// An image without pixels.
    #[error("the image of the camera has {width} × {height} pixels, expected 1 to 16777216 along each side")]
    Size {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
}

/// The lens of a perspective camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    width: usize,
    height: usize,
    model: LensModel,
    /// Focal lengths and the principal point, pixels.
    focal: [f64; 2],
    centre: ImagePoint,
    /// Distortion parameters, which follow the focal lengths and the principal point.
    distortion: Vec<f64>,
}

/// Position and orientation of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation from the world to the camera, row by row: the camera's axes in the world.
    pub rotation: [[f64; 3]; 3],
    /// The camera's centre in the world.
    pub centre: [f64; 3],
}

impl Lens {
    /// Makes a lens from COLMAP's parameters, with the principal point in this toolkit's pixels.
    ///
    /// # Errors
    /// A wrong number of parameters, one that is not finite, a focal length that is not positive,
    /// an empty image.
    pub fn new(width: usize, height: usize, model: LensModel, parameters: &[f64]) -> Result<Self, LensError> {
        let name = model.name();
        if width == 0 || height == 0 || width > 1 << 24 || height > 1 << 24 {
            return Err(Reason::Size { width: width as u64, height: height as u64 }.into());
        }
        if parameters.len() != model.parameter_count() {
            let (expected, found) = (model.parameter_count(), parameters.len());
            return Err(Reason::Count { model: name, expected, found }.into());
        }
        let focal_count = if model.has_one_focal_length() { 1 } else { 2 };
        let bad = |(index, value): &(usize, &f64)| !value.is_finite() || (*index < focal_count && **value <= 0.0);
        if let Some((index, &value)) = parameters.iter().enumerate().find(bad) {
            return Err(Reason::Parameter { model: name, index, value }.into());
        }
        let (focal, rest) = parameters.split_at(focal_count);
        Ok(Self {
            width,
            height,
            model,
            focal: [focal[0], focal[focal_count - 1]],
            centre: ImagePoint { sample: rest[0], line: rest[1] },
            distortion: rest[2..].to_vec(),
        })
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the lens model.
    pub fn model(&self) -> LensModel {
        self.model
    }

    /// Returns the focal lengths along rows and columns, pixels.
    pub fn focal_px(&self) -> [f64; 2] {
        self.focal
    }

    /// Returns the principal point.
    pub fn principal_point(&self) -> ImagePoint {
        self.centre
    }

    /// Returns the parameters as [`Lens::new`] takes them.
    pub fn parameters(&self) -> Vec<f64> {
        let focal_count = if self.model.has_one_focal_length() { 1 } else { 2 };
        let focal = self.focal[..focal_count].iter().copied();
        focal.chain([self.centre.sample, self.centre.line]).chain(self.distortion.iter().copied()).collect()
    }

    /// Returns the pixel of a point (x, y) of the image plane at distance 1. `None` where a fisheye
    /// has none.
    pub fn project(&self, x: f64, y: f64) -> Option<ImagePoint> {
        let [x, y] = self.distort(x, y)?;
        Some(ImagePoint { sample: self.focal[0] * x + self.centre.sample, line: self.focal[1] * y + self.centre.line })
    }

    /// Returns the point (x, y) of the image plane at distance 1 through which the ray of a pixel
    /// goes.
    ///
    /// `None` if the pixel has no ray: beyond the fold of a distortion, or outside the circle of a
    /// fisheye.
    pub fn direction(&self, pixel: ImagePoint) -> Option<[f64; 2]> {
        let distorted =
            [(pixel.sample - self.centre.sample) / self.focal[0], (pixel.line - self.centre.line) / self.focal[1]];
        if self.model.is_pinhole() { Some(distorted) } else { self.undistort(distorted) }
    }

    /// Inverts the distortion by Newton's method with a numerical Jacobian.
    fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        let mut at = self.first_guess(target);
        for _ in 0..MAX_ITERATIONS {
            let here = self.distort(at[0], at[1])?;
            let miss = [target[0] - here[0], target[1] - here[1]];
            if miss[0].abs().max(miss[1].abs()) < TOLERANCE * (1.0 + target[0].abs() + target[1].abs()) {
                return Some(at);
            }
            let step = 1e-7 * (1.0 + at[0].abs() + at[1].abs());
            let (right, left) = (self.distort(at[0] + step, at[1])?, self.distort(at[0] - step, at[1])?);
            let (below, above) = (self.distort(at[0], at[1] + step)?, self.distort(at[0], at[1] - step)?);
            let slope = |a: f64, b: f64| (a - b) / (2.0 * step);
            let (a, b) = (slope(right[0], left[0]), slope(below[0], above[0]));
            let (c, d) = (slope(right[1], left[1]), slope(below[1], above[1]));
            let det = a * d - b * c;
            // A distortion that folds the image back has no ray beyond the fold.
            if !(det > 1e-6 && det.is_finite()) {
                return None;
            }
            at = [at[0] + (d * miss[0] - b * miss[1]) / det, at[1] + (a * miss[1] - c * miss[0]) / det];
        }
        None
    }

    /// Returns the start of the inversion: the distorted point, for fisheyes with the angle
    /// replaced by its tangent.
    fn first_guess(&self, target: [f64; 2]) -> [f64; 2] {
        let theta = target[0].hypot(target[1]);
        let fisheye = matches!(
            self.model,
            LensModel::OpenCvFisheye
                | LensModel::SimpleRadialFisheye
                | LensModel::RadialFisheye
                | LensModel::ThinPrismFisheye
        );
        if fisheye && theta > 0.0 { target.map(|c| c * theta.min(MAX_THETA - 0.05).tan() / theta) } else { target }
    }

    fn distort(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        let k = |i: usize| self.distortion.get(i).copied().unwrap_or(0.0);
        let r2 = x * x + y * y;
        let out = match self.model {
            LensModel::SimplePinhole | LensModel::Pinhole => [x, y],
            LensModel::SimpleRadial | LensModel::Radial => {
                let factor = 1.0 + r2 * (k(0) + r2 * k(1));
                [x * factor, y * factor]
            }
            LensModel::OpenCv => {
                let factor = 1.0 + r2 * (k(0) + r2 * k(1));
                tangential(x, y, factor, k(2), k(3))
            }
            LensModel::FullOpenCv => {
                let factor =
                    (1.0 + r2 * (k(0) + r2 * (k(1) + r2 * k(4)))) / (1.0 + r2 * (k(5) + r2 * (k(6) + r2 * k(7))));
                tangential(x, y, factor, k(2), k(3))
            }
            LensModel::Fov => {
                let (omega, r) = (k(0), r2.sqrt());
                let small = omega.abs() < 1e-6 || r < 1e-9;
                let factor = if small { 1.0 } else { (2.0 * r * (0.5 * omega).tan()).atan() / (r * omega) };
                [x * factor, y * factor]
            }
            LensModel::OpenCvFisheye | LensModel::SimpleRadialFisheye | LensModel::RadialFisheye => {
                let factor = fisheye(r2.sqrt(), [k(0), k(1), k(2), k(3)])?;
                [x * factor, y * factor]
            }
            LensModel::ThinPrismFisheye => {
                let equidistant = fisheye(r2.sqrt(), [0.0; 4])?;
                let (x, y) = (x * equidistant, y * equidistant);
                let t2 = x * x + y * y;
                let factor = 1.0 + t2 * (k(0) + t2 * (k(1) + t2 * (k(4) + t2 * k(5))));
                let [u, v] = tangential(x, y, factor, k(2), k(3));
                [u + k(6) * t2, v + k(7) * t2]
            }
        };
        out.iter().all(|c| c.is_finite()).then_some(out)
    }
}

/// Applies a radial factor and Brown's tangential terms.
fn tangential(x: f64, y: f64, factor: f64, p1: f64, p2: f64) -> [f64; 2] {
    let r2 = x * x + y * y;
    [x * factor + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * factor + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y)]
}

/// Returns θ(1 + k₁θ² + k₂θ⁴ + …) / tan θ for r = tan θ.
fn fisheye(r: f64, k: [f64; 4]) -> Option<f64> {
    let theta = r.atan();
    if theta > MAX_THETA {
        return None;
    }
    let t2 = theta * theta;
    let bent = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
    Some(if r < 1e-9 { 1.0 } else { bent / r })
}

impl Pose {
    /// Makes a pose from a unit quaternion (w, x, y, z) and a translation, both from the world to
    /// the camera, as in COLMAP.
    ///
    /// The quaternion is normalised. `None` if its length is zero or a number is not finite.
    pub fn from_quaternion(quaternion: [f64; 4], translation: [f64; 3]) -> Option<Self> {
        let length = quaternion.iter().map(|c| c * c).sum::<f64>().sqrt();
        if !(length > 1e-9 && length.is_finite() && translation.iter().all(|c| c.is_finite())) {
            return None;
        }
        let [w, x, y, z] = quaternion.map(|c| c / length);
        let rotation = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let centre = [0, 1, 2].map(|i| -(0..3).map(|j| rotation[j][i] * translation[j]).sum::<f64>());
        Some(Self { rotation, centre })
    }

    /// Returns the unit quaternion (w, x, y, z) of the rotation from the world to the camera, with
    /// w ≥ 0.
    pub fn quaternion(&self) -> [f64; 4] {
        quaternion_from_rotation(&self.rotation)
    }

    /// Returns the translation from the world to the camera: the position of the world's origin in
    /// the camera.
    pub fn translation(&self) -> [f64; 3] {
        self.rotation.map(|row| -(0..3).map(|i| row[i] * self.centre[i]).sum::<f64>())
    }

    /// Returns a position of the world in the camera.
    pub fn camera_from_world(&self, position: [f64; 3]) -> [f64; 3] {
        self.rotation.map(|row| (0..3).map(|i| row[i] * (position[i] - self.centre[i])).sum())
    }
}

/// Returns the unit quaternion (w, x, y, z), w ≥ 0, of a rotation matrix.
///
/// The largest component is computed first, which avoids a loss of digits (Shepperd 1978).
pub(crate) fn quaternion_from_rotation(r: &[[f64; 3]; 3]) -> [f64; 4] {
    let trace = r[0][0] + r[1][1] + r[2][2];
    let squares = [trace, r[0][0], r[1][1], r[2][2]];
    let largest = (0..4).max_by(|&a, &b| squares[a].total_cmp(&squares[b])).unwrap_or(0);
    let unscaled = match largest {
        0 => [1.0 + trace, r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]],
        1 => [r[2][1] - r[1][2], 1.0 + 2.0 * r[0][0] - trace, r[0][1] + r[1][0], r[0][2] + r[2][0]],
        2 => [r[0][2] - r[2][0], r[0][1] + r[1][0], 1.0 + 2.0 * r[1][1] - trace, r[1][2] + r[2][1]],
        _ => [r[1][0] - r[0][1], r[0][2] + r[2][0], r[1][2] + r[2][1], 1.0 + 2.0 * r[2][2] - trace],
    };
    let length = unscaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    let sign = if unscaled[0] < 0.0 { -1.0 } else { 1.0 };
    unscaled.map(|c| sign * c / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(model: LensModel, distortion: &[f64]) -> Lens {
        let mut parameters = if model.has_one_focal_length() { vec![800.0] } else { vec![800.0, 790.0] };
        parameters.extend([511.5, 383.5]);
        parameters.extend(distortion);
        Lens::new(1024, 768, model, &parameters).unwrap()
    }

    #[test]
    fn every_pixel_leads_back_to_itself() {
        let lenses = [
            lens(LensModel::SimplePinhole, &[]),
            lens(LensModel::Pinhole, &[]),
            lens(LensModel::SimpleRadial, &[-0.13]),
            lens(LensModel::Radial, &[-0.2, 0.05]),
            lens(LensModel::OpenCv, &[-0.2, 0.05, 1e-3, -2e-3]),
            lens(LensModel::OpenCvFisheye, &[0.02, -0.01, 0.003, -0.001]),
            lens(LensModel::FullOpenCv, &[0.1, 0.02, 1e-3, -2e-3, 0.01, 0.3, 0.05, 0.002]),
            lens(LensModel::Fov, &[0.9]),
            lens(LensModel::SimpleRadialFisheye, &[0.05]),
            lens(LensModel::RadialFisheye, &[0.05, -0.02]),
            lens(LensModel::ThinPrismFisheye, &[0.02, -0.01, 1e-3, -1e-3, 0.002, -0.001, 1e-3, -1e-3]),
        ];
        for lens in lenses {
            for pixel in [(0.0, 0.0), (1023.0, 767.0), (511.5, 383.5), (700.0, 3.0)] {
                let pixel = ImagePoint { sample: pixel.0, line: pixel.1 };
                let [x, y] = lens.direction(pixel).unwrap_or_else(|| panic!("{lens:?} {pixel:?}"));
                let back = lens.project(x, y).unwrap();
                let off = (back.sample - pixel.sample).hypot(back.line - pixel.line);
                assert!(off < 1e-7, "{:?} {pixel:?}: {off}", lens.model());
            }
        }
    }

    #[test]
    fn parameters_make_the_lens_again() {
        for lens in [lens(LensModel::SimpleRadial, &[-0.13]), lens(LensModel::OpenCv, &[-0.2, 0.05, 1e-3, -2e-3])] {
            let again = Lens::new(lens.width(), lens.height(), lens.model(), &lens.parameters()).unwrap();
            assert_eq!(again, lens);
        }
    }

    #[test]
    fn quaternions_lead_back() {
        // Each component is the largest once, and half turns have w = 0.
        for q in [[0.9, 0.1, -0.3, 0.2], [0.1, 0.9, 0.2, -0.3], [0.1, -0.2, 0.9, 0.3], [0.2, 0.1, 0.3, -0.9]] {
            let length = q.iter().map(|c: &f64| c * c).sum::<f64>().sqrt();
            let found = Pose::from_quaternion(q, [0.0; 3]).unwrap().quaternion();
            assert!((0..4).all(|i| (found[i] - q[i] / length).abs() < 1e-15), "{found:?}");
        }
        let half = Pose::from_quaternion([0.0, 0.0, 1.0, 0.0], [0.0; 3]).unwrap().quaternion();
        assert_eq!(half.map(f64::abs), [0.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn pixels_beyond_the_fold_have_no_ray() {
        let lens = lens(LensModel::SimpleRadial, &[-1.5]);
        assert!(lens.direction(ImagePoint { sample: 0.0, line: 0.0 }).is_none());
        assert!(lens.direction(lens.principal_point()).is_some());
    }

    #[test]
    fn names_and_numbers_lead_back() {
        for (number, (model, name, _)) in MODELS.into_iter().enumerate() {
            assert_eq!(LensModel::from_number(number as u32), Some(model));
            assert_eq!((LensModel::from_name(name), model.number(), model.name()), (Some(model), number as u32, name));
        }
        assert_eq!((LensModel::from_number(11), LensModel::from_name("pinhole")), (None, None));
    }

    #[test]
    fn numbers_that_make_no_lens() {
        let made = |width, parameters: &[f64]| Lens::new(width, 8, LensModel::Pinhole, parameters);
        assert!(matches!(made(8, &[1.0, 1.0, 4.0]), Err(LensError(Reason::Count { expected: 4, found: 3, .. }))));
        assert!(matches!(made(8, &[1.0, 0.0, 4.0, 4.0]), Err(LensError(Reason::Parameter { index: 1, .. }))));
        assert!(matches!(made(8, &[1.0, 1.0, f64::NAN, 4.0]), Err(LensError(Reason::Parameter { index: 2, .. }))));
        assert!(matches!(made(0, &[1.0, 1.0, 4.0, 4.0]), Err(LensError(Reason::Size { .. }))));
    }

    #[test]
    fn poses_from_quaternions() {
        let quarter = std::f64::consts::FRAC_1_SQRT_2;
        // A quarter turn about the camera's y axis, and a step.
        let pose = Pose::from_quaternion([quarter, 0.0, quarter, 0.0], [1.0, 2.0, 3.0]).unwrap();
        let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12);
        assert!(close(pose.translation(), [1.0, 2.0, 3.0]));
        assert!(close(pose.camera_from_world([0.0; 3]), [1.0, 2.0, 3.0]));
        assert!(close(pose.camera_from_world([1.0, 0.0, 0.0]), [1.0, 2.0, 2.0]));
        assert!(Pose::from_quaternion([0.0; 4], [0.0; 3]).is_none());
        assert!(Pose::from_quaternion([1.0, 0.0, 0.0, 0.0], [f64::NAN; 3]).is_none());
    }
}
