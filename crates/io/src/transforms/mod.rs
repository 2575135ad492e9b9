//! Cameras of nerfstudio, instant-ngp and Blender: `transforms.json`.
//!
//! A frame's `transform_matrix` is world from camera, with OpenGL's axes (x right, y up, z back); poses come out with
//! COLMAP's (y down, z forward). Intrinsics stand in the frame or else in the file: `fl_x`, `fl_y`, or `camera_angle_x`,
//! `camera_angle_y` with f = w / (2 tan(angle / 2)); `cx`, `cy` from the upper-left corner of the image, its middle where they
//! are missing. Distortion: `k1`, `k2`, `p1`, `p2` (OPENCV), with `k3` as FULL_OPENCV, `k1` … `k4` of fisheyes.
//!
//! nerfstudio's `applied_transform` and `applied_scale` say how its world was made from the original one
//! (new = scale · transform · original); they are undone, so that poses are in the world that a city model can be in.
//!
//! Matrices that shear, mirror or are singular, NaN, names that lead out of the folder, frames without a size or a focal
//! length are refused with the number of the frame. No file that is named inside is opened.

mod lens;
mod schema;

use std::path::{Path, PathBuf};

use camera::{Lens, Pose, Similarity};

use crate::colmap::{ColmapModel, ColmapView, is_inside};
use schema::{File, Frame, Matrix};

/// Files are read up to this size, bytes, and this many frames of them.
const SIZE_LIMIT: u64 = 512 << 20;
const FRAMES_LIMIT: usize = 1 << 22;

/// Why a `transforms.json` was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TransformsError {
    /// The file cannot be read.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The content is refused.
    #[error("{what} ({place}): {}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was found and expected.
        what: String,
        /// The frame, counted from 0, or the line.
        place: String,
    },
}

/// Reads the cameras of a `transforms.json`; frames are numbered from 1, equal lenses are shared.
///
/// `size` is columns and rows of the images, for files that do not say (Blender's).
///
/// # Errors
/// A file that cannot be read or is too large, and what is wrong in it, with its place.
pub fn read(path: impl AsRef<Path>, size: Option<[usize; 2]>) -> Result<ColmapModel, TransformsError> {
    let path = path.as_ref();
    let unreadable = |source| TransformsError::Unreadable { path: path.to_owned(), source };
    let bytes = std::fs::metadata(path).map_err(unreadable)?.len();
    let invalid = |(what, place): Fault| TransformsError::Invalid { path: path.to_owned(), what, place };
    if bytes > SIZE_LIMIT {
        return Err(invalid((format!("{bytes} bytes, up to {SIZE_LIMIT} are read"), "size".to_owned())));
    }
    parse(&std::fs::read(path).map_err(unreadable)?, size).map_err(invalid)
}

/// What is wrong, and where.
type Fault = (String, String);

fn parse(bytes: &[u8], size: Option<[usize; 2]>) -> Result<ColmapModel, Fault> {
    let file: File = serde_json::from_slice(bytes).map_err(|error| (error.to_string(), "JSON".to_owned()))?;
    if file.frames.len() > FRAMES_LIMIT {
        return Err((format!("{} frames, up to {FRAMES_LIMIT} are read", file.frames.len()), "frames".to_owned()));
    }
    let original_from_file = undo_applied(&file).map_err(|what| (what, "applied_transform".to_owned()))?;
    let mut model = ColmapModel { lenses: Vec::new(), views: Vec::with_capacity(file.frames.len()) };
    for (number, frame) in file.frames.iter().enumerate() {
        let placed = |what: String| (what, format!("frame {number}"));
        let lens = lens::of(&frame.intrinsics.or(&file.intrinsics), size).map_err(placed)?;
        let pose = original_from_file.move_pose(&pose(&frame.transform_matrix).map_err(placed)?);
        let lens = shared(&mut model.lenses, lens);
        model.views.push(ColmapView { id: number as u32 + 1, name: name(frame).map_err(placed)?, lens, pose });
    }
    Ok(model)
}

/// The index of a lens; frames with one camera follow each other, so only the last ones are looked at.
fn shared(lenses: &mut Vec<Lens>, lens: Lens) -> usize {
    const LOOKED_AT: usize = 16;
    let first = lenses.len().saturating_sub(LOOKED_AT);
    lenses[first..].iter().position(|known| *known == lens).map_or_else(
        || {
            lenses.push(lens);
            lenses.len() - 1
        },
        |at| first + at,
    )
}

fn name(frame: &Frame) -> Result<String, String> {
    let mut name = frame.file_path.as_str();
    while let Some(rest) = name.strip_prefix("./") {
        name = rest;
    }
    if is_inside(name) {
        return Ok(name.to_owned());
    }
    let shown: String = frame.file_path.chars().take(60).collect();
    Err(format!("the image name {shown:?} is empty or leads out of the folder"))
}

fn pose(matrix: &Matrix) -> Result<Pose, String> {
    let world_from_gl = matrix.similarity().map_err(|what| format!("transform_matrix: {what}"))?;
    if (world_from_gl.scale() - 1.0).abs() > 1e-3 {
        return Err(format!(
            "transform_matrix scales by {}, expected a rotation and a position",
            world_from_gl.scale()
        ));
    }
    let r = world_from_gl.rotation();
    // The camera's axes in the world are the columns; y and z change their sign from OpenGL to COLMAP.
    let axis = |i: usize, sign: f64| [sign * r[0][i], sign * r[1][i], sign * r[2][i]];
    Ok(Pose { rotation: [axis(0, 1.0), axis(1, -1.0), axis(2, -1.0)], centre: world_from_gl.translation() })
}

/// From the world of the file to the one before nerfstudio moved it.
fn undo_applied(file: &File) -> Result<Similarity, String> {
    let applied = file.applied_transform.as_ref().map(Matrix::similarity).transpose()?.unwrap_or(Similarity::IDENTITY);
    let scale = Similarity::new(file.applied_scale.unwrap_or(1.0), Similarity::IDENTITY.rotation(), [0.0; 3]);
    Ok(scale.map_err(|error| error.to_string())?.after(&applied).inverse())
}

#[cfg(test)]
mod tests;
