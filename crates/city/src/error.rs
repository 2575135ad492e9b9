//! Inconsistencies in a model.

use numeric::failures;

/// An inconsistent model or mesh, or the text of a level of detail that is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The text of a level of detail is not a number with at most one decimal.
    #[error(
        "{text:?} is not a level of detail, expected one digit, or two with a point between them, such as 2 or 2.2"
    )]
    Lod {
        /// Beginning of the text.
        text: String,
    },
    /// A vertex has a coordinate that is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A ring names a vertex that does not exist.
    #[error("a ring of object {object:?} names vertex {index}, the model has {vertices} vertices")]
    VertexIndex {
        /// Identifier of the object.
        object: String,
        /// Index of the vertex.
        index: u32,
        /// Number of vertices in the model.
        vertices: usize,
    },
    /// An object names a parent that does not exist.
    #[error("the parent of object {object:?} is not in the model")]
    ParentIndex {
        /// Identifier of the object.
        object: String,
    },
    /// An object is its own ancestor.
    #[error("object {object:?} is a part of itself")]
    ParentCircle {
        /// Identifier of the object.
        object: String,
    },
    /// A surface has no rings.
    #[error("a surface of object {object:?} has no outer ring")]
    NoRing {
        /// Identifier of the object.
        object: String,
    },
    /// The materials and textures of a surface do not fit its rings or the model.
    #[error(
        "a surface of object {object:?} names a material, texture or texture coordinate that does not exist, or not \
         one coordinate per vertex"
    )]
    Appearance {
        /// Identifier of the object.
        object: String,
    },
    /// A triangle names a corner or a surface that does not exist.
    #[error("triangle {triangle} names a corner or a surface that does not exist")]
    Triangle {
        /// Index of the triangle.
        triangle: usize,
    },
}

failures!(ModelError: Input);
