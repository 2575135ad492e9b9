//! What can be inconsistent in a model.

/// A model that no reader of this toolkit would return, or a name that is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A level of detail that is no number.
    #[error("{text:?} is no level of detail: expected 2, or refined 2.2")]
    Lod {
        /// What was found (its beginning).
        text: String,
    },
    /// A vertex at NaN or infinity.
    #[error("vertex {vertex} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A ring that names a vertex that is not there.
    #[error("a ring of object {object:?} names vertex {index}, and the model has {vertices}")]
    VertexIndex {
        /// The object's id.
        object: String,
        /// The index.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A parent that is not there.
    #[error("the parent of object {object:?} is not in the model")]
    ParentIndex {
        /// The object's id.
        object: String,
    },
    /// An object that is its own ancestor.
    #[error("object {object:?} is a part of itself")]
    ParentCircle {
        /// The object's id.
        object: String,
    },
    /// A surface without rings.
    #[error("a surface of object {object:?} has no outer ring")]
    NoRing {
        /// The object's id.
        object: String,
    },
    /// A triangle without corners or surface.
    #[error("triangle {triangle} names a corner or a surface that is not there")]
    Triangle {
        /// Index of the triangle.
        triangle: usize,
    },
}
