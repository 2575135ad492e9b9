//! Gaussians as the PLY that viewers and trainers of 3D Gaussian Splatting (Kerbl et al. 2023) and 2DGS (Huang et al.
//! 2024) read, with their origin beside it.
//!
//! One `vertex` per splat, binary little-endian, all `float`: x y z, nx ny nz, `f_dc_0..2` (colour = ½ + C₀ f, C₀ = ½ √(1/π)),
//! `f_rest_*` (zero; present where a loader insists on a degree of harmonics), `opacity` (logit), `scale_0..2` (natural
//! logarithm of metres; 2DGS has two), `rot_0..3` (quaternion, w first). Positions are metres from a local origin, which
//! `NAME.origin.json` keeps: PLY has no room for it that all loaders pass over.
//!
//! Counts are checked against the length of the file before anything is allocated.

mod origin;
mod read;
mod write;

use std::path::{Path, PathBuf};

use gaussian::{Splat, SplatDefect};

use crate::atomic::SaveError;

pub use origin::{LocalOrigin, origin_path};
pub use read::read;
pub use write::write;

/// C₀, the constant spherical harmonic.
const SH_C0: f64 = 0.282_094_791_773_878_14;
/// The highest degree of harmonics that trainers know.
pub const SH_DEGREE_MAX: u8 = 3;

/// How many scales a splat has in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SplatForm {
    /// Ellipsoids: 3D Gaussian Splatting.
    #[default]
    Ellipsoids,
    /// Flat discs: 2DGS.
    Discs,
}

impl SplatForm {
    fn scales(self) -> usize {
        match self {
            Self::Ellipsoids => 3,
            Self::Discs => 2,
        }
    }
}

/// What a file of splats is to look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplatLayout {
    /// Two or three scales.
    pub form: SplatForm,
    /// Degree of the harmonics, 0 to [`SH_DEGREE_MAX`]. The loaders of the original 3DGS and 2DGS code expect the degree of
    /// their model (3 unless changed); viewers and gsplat take any.
    pub sh_degree: u8,
}

impl SplatLayout {
    /// Number of `f_rest_*`: 3 ((d + 1)² − 1).
    fn rest(self) -> usize {
        let side = usize::from(self.sh_degree) + 1;
        3 * (side * side - 1)
    }

    /// The names of the properties, in their order.
    fn properties(self) -> Vec<String> {
        let numbered = |name: &str, count: usize| (0..count).map(|i| format!("{name}_{i}")).collect::<Vec<_>>();
        let plain = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).to_vec();
        [
            plain,
            numbered("f_dc", 3),
            numbered("f_rest", self.rest()),
            vec!["opacity".to_owned()],
            numbered("scale", self.form.scales()),
            numbered("rot", 4),
        ]
        .concat()
    }
}

/// Splats from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct SplatFile {
    /// The splats; discs have a third scale of a thousandth of their smaller one.
    pub splats: Vec<Splat>,
    /// How the file looks.
    pub layout: SplatLayout,
    /// The origin of the positions, where it lies beside the file.
    pub origin: Option<LocalOrigin>,
}

/// A file of splats that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplatPlyError {
    /// The file cannot be read.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A file that breaks its format, or another one.
    #[error("{what}: {}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was found and expected.
        what: String,
    },
    /// A splat that is none was to be written.
    #[error("splat {index} cannot be written ({source}): {}", .path.display())]
    Splat {
        /// The file.
        path: PathBuf,
        /// Index of the splat.
        index: usize,
        /// Its defect.
        source: SplatDefect,
    },
    /// The file was not written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

fn invalid(path: &Path, what: impl Into<String>) -> SplatPlyError {
    SplatPlyError::Invalid { path: path.to_owned(), what: what.into() }
}

#[cfg(test)]
mod tests;
