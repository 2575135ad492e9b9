//! The COLMAP model in memory, in this toolkit's pixel convention.

use camera::{ImagePoint, Lens, Pose};

/// Cameras and their poses.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapModel {
    /// The lenses.
    pub lenses: Vec<Lens>,
    /// The images, in the order of the file.
    pub views: Vec<ColmapView>,
}

/// An image of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapView {
    /// Identifier of the image in the file (`IMAGE_ID`).
    pub id: u32,
    /// File name relative to the folder of the images.
    pub name: String,
    /// Index of its lens in [`ColmapModel::lenses`].
    pub lens: usize,
    /// Position and orientation of the camera in the world of the model.
    pub pose: Pose,
}

/// A point of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapPoint {
    /// Position in the world of the poses.
    pub position: [f64; 3],
    /// Colour: red, green, blue.
    pub color: [u8; 3],
    /// Mean reprojection error, pixels; negative where it is unknown.
    pub error_px: f64,
    /// The images that see the point, and where.
    pub track: Vec<ColmapObservation>,
}

/// An observation of a point in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColmapObservation {
    /// Index of the image in [`ColmapModel::views`].
    pub view: u32,
    /// Pixel at which the image sees the point.
    pub pixel: ImagePoint,
}
