//! Similarities between two frames in space: target = s · R · source + t.
//!
//! A similarity takes the frame of a city model (a map projection with heights) to the frame of
//! cameras that were oriented without it. R has determinant 1, and s is positive. Invalid numbers
//! are a [`SimilarityError`].

use crate::Pose;
use crate::perspective::quaternion_from_rotation;

/// Largest deviation of R·Rᵀ from the identity, as rounding in text files causes it.
const ORTHOGONAL: f64 = 1e-4;

/// A rotation, a scale and a translation from a source frame to a target frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    scale: f64,
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
}

/// Numbers that do not form a similarity.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct SimilarityError(#[from] Reason);

/// Why numbers do not form a similarity.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Reason {
    /// A number is NaN or infinite.
    #[error("a number of the similarity is not finite")]
    NotFinite,
    /// The scale is not between 1e-9 and 1e9.
    #[error("the scale is {scale}, expected a value from 1e-9 to 1e9")]
    Scale {
        /// Scale found.
        scale: f64,
    },
    /// The matrix is not a rotation.
    #[error(
        "the matrix is no rotation (its axes are {off:e} from right angles and length 1): expected one without shear"
    )]
    NotARotation {
        /// Largest deviation of R·Rᵀ from the identity.
        off: f64,
    },
    /// The matrix has determinant −1.
    #[error("the matrix mirrors: expected a rotation, whose determinant is 1")]
    Mirror,
}

impl Similarity {
    /// The similarity that changes nothing.
    pub const IDENTITY: Self =
        Self { scale: 1.0, rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// Makes a similarity. The rotation is given row by row, and its rows are normalised.
    ///
    /// # Errors
    /// A number is not finite, the scale is outside 1e-9 to 1e9, or the matrix mirrors or deviates
    /// from a rotation by more than 1e-4.
    pub fn new(scale: f64, rotation: [[f64; 3]; 3], translation: [f64; 3]) -> Result<Self, SimilarityError> {
        if !scale.is_finite() || !rotation.as_flattened().iter().chain(&translation).all(|c| c.is_finite()) {
            return Err(Reason::NotFinite.into());
        }
        if !(1e-9..=1e9).contains(&scale) {
            return Err(Reason::Scale { scale }.into());
        }
        let rotation = proper_rotation(&rotation)?;
        Ok(Self { scale, rotation, translation })
    }

    /// Makes a similarity from the upper three rows of a 4 × 4 matrix: s · R beside t.
    ///
    /// # Errors
    /// The same as for [`Similarity::new`].
    pub fn from_matrix(rows: [[f64; 4]; 3]) -> Result<Self, SimilarityError> {
        if !rows.as_flattened().iter().all(|c| c.is_finite()) {
            return Err(Reason::NotFinite.into());
        }
        let linear = rows.map(|[a, b, c, _]| [a, b, c]);
        let det = determinant(&linear);
        let scale = det.abs().cbrt();
        if !(1e-9..=1e9).contains(&scale) {
            return Err(Reason::Scale { scale }.into());
        }
        Self::new(scale, linear.map(|row| row.map(|c| c / scale)), rows.map(|row| row[3]))
    }

    /// Returns the length in the target frame per length in the source frame.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns the rotation, row by row.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        self.rotation
    }

    /// Returns the position of the source's origin in the target frame.
    pub fn translation(&self) -> [f64; 3] {
        self.translation
    }

    /// Returns a position of the source in the target frame.
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        let turned = self.turn(p);
        [0, 1, 2].map(|i| self.scale * turned[i] + self.translation[i])
    }

    /// Returns a direction of the source in the target frame, with the same length.
    pub fn turn(&self, d: [f64; 3]) -> [f64; 3] {
        self.rotation.map(|row| row[0] * d[0] + row[1] * d[1] + row[2] * d[2])
    }

    /// Returns the similarity from the target to the source.
    pub fn inverse(&self) -> Self {
        let r = &self.rotation;
        let rotation = [0, 1, 2].map(|i| [r[0][i], r[1][i], r[2][i]]);
        let back = Self { scale: 1.0 / self.scale, rotation, translation: [0.0; 3] };
        Self { translation: back.apply(self.translation).map(|c| -c), ..back }
    }

    /// Returns the similarity that applies `first` and then `self`.
    pub fn after(&self, first: &Self) -> Self {
        let columns = [0, 1, 2].map(|j| self.turn([first.rotation[0][j], first.rotation[1][j], first.rotation[2][j]]));
        Self {
            scale: self.scale * first.scale,
            rotation: [0, 1, 2].map(|i| [columns[0][i], columns[1][i], columns[2][i]]),
            translation: self.apply(first.translation),
        }
    }

    /// Returns a camera of the source frame in the target frame.
    ///
    /// It sees the moved scene in the same pixels. Its depths are the depths in the source times
    /// [`Self::scale`].
    pub fn move_pose(&self, pose: &Pose) -> Pose {
        Pose { rotation: pose.rotation.map(|axis| self.turn(axis)), centre: self.apply(pose.centre) }
    }
}

/// Returns the rotation nearest to a matrix that is a rotation up to rounding.
fn proper_rotation(r: &[[f64; 3]; 3]) -> Result<[[f64; 3]; 3], Reason> {
    let dot = |i: usize, j: usize| (0..3).map(|k| r[i][k] * r[j][k]).sum::<f64>();
    let off = (0..9).map(|n| (dot(n / 3, n % 3) - if n / 3 == n % 3 { 1.0 } else { 0.0 }).abs()).fold(0.0, f64::max);
    // The entries are finite, but their squares may not be.
    if off.is_nan() || off > ORTHOGONAL {
        return Err(Reason::NotARotation { off });
    }
    if determinant(r) < 0.0 {
        return Err(Reason::Mirror);
    }
    // A matrix that is exact already keeps its bits.
    if off < 4.0 * f64::EPSILON {
        return Ok(*r);
    }
    let exact = Pose::from_quaternion(quaternion_from_rotation(r), [0.0; 3]);
    exact.map(|pose| pose.rotation).ok_or(Reason::NotARotation { off })
}

fn determinant(r: &[[f64; 3]; 3]) -> f64 {
    let minor = |i: usize, j: usize| r[1][i] * r[2][j] - r[1][j] * r[2][i];
    r[0][0] * minor(1, 2) - r[0][1] * minor(0, 2) + r[0][2] * minor(0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn similarity(q: [f64; 4], scale: f64, translation: [f64; 3]) -> Option<Similarity> {
        let rotation = Pose::from_quaternion(q, [0.0; 3])?.rotation;
        Some(Similarity::new(scale, rotation, translation).unwrap())
    }

    fn far(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
    }

    proptest! {
        #[test]
        fn inverse_composition_and_matrix_agree(
            q in prop::array::uniform4(-1.0..1.0f64), scale in 0.01..100.0f64,
            t in prop::array::uniform3(-1e3..1e3f64), p in prop::array::uniform3(-1e3..1e3f64),
        ) {
            let Some(s) = similarity(q, scale, t) else { return Ok(()) };
            prop_assert!(far(s.inverse().apply(s.apply(p)), p) < 1e-7);
            prop_assert!(far(s.inverse().after(&s).apply(p), p) < 1e-7);
            let rows = [0, 1, 2].map(|i| {
                let r = s.rotation()[i].map(|c| c * scale);
                [r[0], r[1], r[2], t[i]]
            });
            let again = Similarity::from_matrix(rows).unwrap();
            prop_assert!(far(again.apply(p), s.apply(p)) < 1e-6);
        }

        #[test]
        fn a_moved_camera_sees_the_moved_scene(
            q in prop::array::uniform4(-1.0..1.0f64), c in prop::array::uniform4(-1.0..1.0f64),
            scale in 0.1..10.0f64, t in prop::array::uniform3(-1e2..1e2f64), p in prop::array::uniform3(-1e2..1e2f64),
        ) {
            let (Some(s), Some(pose)) = (similarity(q, scale, t), Pose::from_quaternion(c, [1.0, -2.0, 3.0])) else {
                return Ok(());
            };
            let before = pose.camera_from_world(p).map(|c| c * scale);
            prop_assert!(far(s.move_pose(&pose).camera_from_world(s.apply(p)), before) < 1e-9);
        }
    }

    #[test]
    fn what_is_no_similarity_is_refused() {
        let unit = Similarity::IDENTITY.rotation();
        let mirror = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        let shear = [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(Similarity::new(1.0, mirror, [0.0; 3]), Err(SimilarityError(Reason::Mirror)));
        assert!(matches!(Similarity::new(1.0, shear, [0.0; 3]), Err(SimilarityError(Reason::NotARotation { .. }))));
        assert!(matches!(Similarity::new(0.0, unit, [0.0; 3]), Err(SimilarityError(Reason::Scale { .. }))));
        assert!(matches!(Similarity::new(-1.0, unit, [0.0; 3]), Err(SimilarityError(Reason::Scale { .. }))));
        assert_eq!(Similarity::new(1.0, unit, [f64::NAN, 0.0, 0.0]), Err(SimilarityError(Reason::NotFinite)));
        assert!(matches!(Similarity::from_matrix([[0.0; 4]; 3]), Err(SimilarityError(Reason::Scale { .. }))));
        assert_eq!(Similarity::new(1.0, unit, [0.0; 3]), Ok(Similarity::IDENTITY));
    }
}
