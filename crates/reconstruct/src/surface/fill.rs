//! The choice of the voids that are closed.

use serde::{Deserialize, Serialize};

/// Choice of the voids that are closed from the heights around them. Closed cells are always
/// marked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fill {
    /// No void: every written height was observed.
    None,
    /// Narrow voids, voids that a surface beside them hides, and voids between known heights where
    /// the images have texture.
    #[default]
    Justified,
    /// All voids within reach of known heights, whatever caused them: water, saturated roofs, the
    /// border of the area that two views see.
    All,
}

impl Fill {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("none", Self::None, "no void: every height was observed"),
        ("justified", Self::Justified, "narrow voids, voids behind buildings, voids between known heights on texture"),
        ("all", Self::All, "all within reach of known heights"),
    ];
}
