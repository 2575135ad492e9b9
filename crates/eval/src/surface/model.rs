//! A surface as points or triangles about a local origin.

use super::error::Reason;

/// Largest distance of a coordinate from the origin, metres.
const EXTENT_LIMIT: f64 = 1e9;

/// Surface as points or triangles, metres from a local origin.
#[derive(Debug, Clone, PartialEq)]
pub enum LocalSurface {
    /// Point cloud.
    Points(Vec<[f64; 3]>),
    /// Triangles, counter-clockwise seen from outside.
    Mesh {
        /// Corners of the triangles.
        positions: Vec<[f64; 3]>,
        /// Indices of three corners each.
        triangles: Vec<[u32; 3]>,
    },
}

impl LocalSurface {
    /// Checks that there is something to compare, and that positions and indices are in range.
    pub(super) fn check(&self, which: &'static str) -> Result<(), Reason> {
        let (positions, triangles): (_, &[[u32; 3]]) = match self {
            Self::Points(points) => (points, &[]),
            Self::Mesh { positions, triangles } => (positions, triangles),
        };
        let outside = |p: &[f64; 3]| !p.iter().all(|c| c.abs() <= EXTENT_LIMIT);
        if let Some(index) = positions.iter().position(outside) {
            return Err(Reason::Position { which, index });
        }
        let missing = |t: &[u32; 3]| t.iter().any(|&corner| corner as usize >= positions.len());
        if let Some(index) = triangles.iter().position(missing) {
            return Err(Reason::Corner { which, index });
        }
        match self {
            Self::Points(points) if points.is_empty() => Err(Reason::Empty { which, found: "no points" }),
            Self::Mesh { triangles, .. } if triangles.is_empty() => Err(Reason::Empty { which, found: "no triangles" }),
            _ => Ok(()),
        }
    }
}
