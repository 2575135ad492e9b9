//! The properties of a splat in a PLY file.

/// C₀, the value of the constant spherical harmonic.
pub(crate) const SH_C0: f64 = 0.282_094_791_773_878_14;
/// Highest degree of spherical harmonics that trainers use.
pub const SH_DEGREE_MAX: u8 = 3;

/// Shape of the splats of a file, which decides how many scales each has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SplatForm {
    /// Ellipsoids with three scales: 3D Gaussian Splatting.
    #[default]
    Ellipsoids,
    /// Flat discs with two scales: 2DGS.
    Discs,
}

impl SplatForm {
    /// Returns the number of scales in the file.
    pub(super) fn scales(self) -> usize {
        match self {
            Self::Ellipsoids => 3,
            Self::Discs => 2,
        }
    }
}

/// Properties that a file of splats has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplatLayout {
    /// Shape of the splats.
    pub form: SplatForm,
    /// Degree of the spherical harmonics, 0 to [`SH_DEGREE_MAX`].
    ///
    /// The loaders of the original 3DGS and 2DGS code expect the degree of their model, which is 3
    /// by default. Viewers and gsplat accept any degree.
    pub sh_degree: u8,
}

impl SplatLayout {
    /// Returns the number of `f_rest_*` properties: 3 ((d + 1)² − 1).
    pub(crate) fn rest(self) -> usize {
        let side = usize::from(self.sh_degree) + 1;
        3 * (side * side - 1)
    }

    /// Returns the names of the properties in the order of the file.
    pub(super) fn properties(self) -> Vec<String> {
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
