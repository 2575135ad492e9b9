//! A valid solid, and the findings of comparisons.

use super::patch::Patch;
use crate::DefectCode;

/// A valid solid. Its triangles face away from its interior.
pub(super) struct Body {
    pub(super) object: usize,
    pub(super) geometry: usize,
    pub(super) solid: u32,
    pub(super) surface: Patch,
}

/// A defect of a shell of a solid, or of a solid of a geometry.
pub(super) struct MemberDefect {
    pub(super) code: DefectCode,
    /// Number of the shell or solid.
    pub(super) member: u32,
    pub(super) detail: String,
}
