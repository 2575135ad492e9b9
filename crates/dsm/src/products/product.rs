//! What can be made of a surface model.

use serde::{Deserialize, Serialize};

/// A product of a surface model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ProductKind {
    /// Coloured points as LAZ and COPC.
    Cloud,
    /// The bare ground, and heights above it.
    Dtm,
    /// Ground, buildings and vegetation.
    Classes,
    /// Contour lines of the ground.
    Contours,
    /// A textured mesh as GLB and 3D Tiles.
    Mesh,
}

impl ProductKind {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 5] = [
        ("cloud", Self::Cloud, "coloured points as LAZ and COPC"),
        ("dtm", Self::Dtm, "the bare ground, and heights above it"),
        ("classes", Self::Classes, "ground, buildings and vegetation"),
        ("contours", Self::Contours, "contour lines of the ground"),
        ("mesh", Self::Mesh, "a textured mesh as GLB and 3D Tiles"),
    ];
}
