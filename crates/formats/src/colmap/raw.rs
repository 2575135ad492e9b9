//! The records of COLMAP's files as they stand there: identifiers are not resolved, pixels are
//! COLMAP's.

use camera::LensModel;

/// A camera record.
#[derive(Debug)]
pub(super) struct RawCamera {
    pub(super) id: u32,
    pub(super) model: LensModel,
    pub(super) width: u64,
    pub(super) height: u64,
    pub(super) parameters: Vec<f64>,
    /// Line number or byte offset, for error messages.
    pub(super) place: String,
}

/// An image record.
#[derive(Debug)]
pub(super) struct RawImage {
    pub(super) id: u32,
    /// Rotation from world to camera, w first.
    pub(super) quaternion: [f64; 4],
    pub(super) translation: [f64; 3],
    /// Identifier of the camera.
    pub(super) camera: u32,
    pub(super) name: String,
    /// Pixels of its points; empty when they are skipped.
    pub(super) points: Vec<[f64; 2]>,
    /// Line number or byte offset, for error messages.
    pub(super) place: String,
}

/// A point record.
#[derive(Debug)]
pub(super) struct RawPoint {
    pub(super) position: [f64; 3],
    pub(super) color: [u8; 3],
    pub(super) error_px: f64,
    pub(super) track: Vec<RawObservation>,
    /// Line number or byte offset, for error messages.
    pub(super) place: String,
}

/// An element of a track.
#[derive(Debug, Clone, Copy)]
pub(super) struct RawObservation {
    /// Identifier of the image.
    pub(super) image: u32,
    /// Index of the point among the points of that image.
    pub(super) index: u32,
}

/// Whether the reader keeps the points of the images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ImagePoints {
    Keep,
    Skip,
}
