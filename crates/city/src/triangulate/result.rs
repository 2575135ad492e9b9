//! The result of cutting a polygon into triangles.

use crate::DefectCode;

/// Triangles of a polygon.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangulation {
    /// Vertex indices as in the rings, in the orientation of the outer ring.
    ///
    /// `u32::MAX - i` stands for vertex `i` of [`Triangulation::added`].
    pub triangles: Vec<[u32; 3]>,
    /// Positions of vertices that were added where edges cross.
    pub added: Vec<[f64; 3]>,
    /// Defects of the polygon.
    pub findings: Vec<PolygonFinding>,
}

/// Defect of a polygon.
#[derive(Debug, Clone, PartialEq)]
pub struct PolygonFinding {
    /// Kind of the defect.
    pub code: DefectCode,
    /// Whether the polygon or the ring is left out because of the defect.
    pub dropped: bool,
    /// Details; may be empty.
    pub detail: String,
}

impl PolygonFinding {
    /// Creates a defect that leaves nothing out.
    pub(super) fn note(code: DefectCode, detail: impl Into<String>) -> Self {
        Self { code, dropped: false, detail: detail.into() }
    }

    /// Creates a defect because of which the polygon is left out.
    pub(super) fn fatal(code: DefectCode, detail: &str) -> Self {
        Self { code, dropped: true, detail: detail.to_owned() }
    }
}
