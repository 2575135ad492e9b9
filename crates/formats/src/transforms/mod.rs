//! Reads the cameras of nerfstudio, instant-ngp and Blender: `transforms.json`.
//!
//! The `transform_matrix` of a frame maps from the camera to the world. Its camera axes are
//! OpenGL's (x right, y up, z back). The poses that this module returns have COLMAP's axes (x
//! right, y down, z forward). Intrinsics are in the frame, or else in the file:
//!
//! - focal length: `fl_x`, `fl_y`, or `camera_angle_x`, `camera_angle_y` with f = w / (2 tan(angle
//!   / 2))
//! - principal point: `cx`, `cy` from the upper-left corner of the image; the middle of the image
//!   by default
//! - distortion: `k1`, `k2`, `p1`, `p2` (OPENCV), also with `k3` (FULL_OPENCV), or `k1` to `k4` of
//!   a fisheye lens
//!
//! nerfstudio's `applied_transform` and `applied_scale` map the original world to the world of the
//! file (new = scale · transform · original). They are undone, so that the poses are in the
//! original world.
//!
//! Matrices that shear, mirror or are singular, numbers that are not finite, names that lead out of
//! the folder, and frames without a size or a focal length are refused with the number of the
//! frame. A file that is named inside is not opened.

mod lens;
mod schema;

use std::path::Path;

use camera::{Lens, Pose, Similarity};

use crate::camera_file::{Fault, read_bytes};
use crate::colmap::{ColmapModel, ColmapView, is_inside};
use crate::format_error::FormatError;
use schema::{File, Frame, Matrix};

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 512 << 20;
/// Largest number of frames.
const FRAMES_LIMIT: usize = 1 << 22;

/// Reads the cameras of a `transforms.json`. Views get the identifiers 1, 2, … in the order of the
/// frames.
///
/// `size` is the number of columns and rows of the images, for files without it, such as Blender's.
///
/// # Errors
/// [`FormatError`] when the system cannot read the file, and when it is too large or breaks the
/// format.
///
/// # Examples
/// ```
/// let text = r#"{"w": 640, "h": 480, "fl_x": 500, "frames": [{"file_path": "a.png",
///     "transform_matrix": [[1, 0, 0, 10], [0, 1, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]]}]}"#;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("transforms.json");
/// std::fs::write(&path, text)?;
/// let model = formats::transforms::read(&path, None)?;
/// assert_eq!(model.views[0].pose.centre, [10.0, 20.0, 30.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: impl AsRef<Path>, size: Option<[usize; 2]>) -> Result<ColmapModel, FormatError> {
    let path = path.as_ref();
    parse(&read_bytes(path, SIZE_LIMIT)?, size).map_err(|fault| fault.at(path))
}

fn parse(bytes: &[u8], size: Option<[usize; 2]>) -> Result<ColmapModel, Fault> {
    let file: File =
        serde_json::from_slice(bytes).map_err(|error| Fault { what: error.to_string(), place: "JSON".to_owned() })?;
    if file.frames.len() > FRAMES_LIMIT {
        let what = format!("the file has {} frames, at most {FRAMES_LIMIT} are read", file.frames.len());
        return Err(Fault { what, place: "frames".to_owned() });
    }
    let original_from_file =
        undo_applied(&file).map_err(|what| Fault { what, place: "applied_transform".to_owned() })?;
    let mut model = ColmapModel { lenses: Vec::new(), views: Vec::with_capacity(file.frames.len()) };
    for (number, frame) in file.frames.iter().enumerate() {
        let placed = |what: String| Fault { what, place: format!("frame {number}") };
        let lens = lens::of(&frame.intrinsics.or(&file.intrinsics), size).map_err(placed)?;
        let pose = original_from_file.move_pose(&pose(&frame.transform_matrix).map_err(placed)?);
        let lens = shared(&mut model.lenses, lens);
        model.views.push(ColmapView { id: number as u32 + 1, name: name(frame).map_err(placed)?, lens, pose });
    }
    Ok(model)
}

/// Returns the index of a lens, and adds it if it is new.
///
/// Frames of one camera follow each other, so only the last lenses are compared.
fn shared(lenses: &mut Vec<Lens>, lens: Lens) -> usize {
    const COMPARED: usize = 16;
    let first = lenses.len().saturating_sub(COMPARED);
    lenses[first..].iter().position(|known| *known == lens).map_or_else(
        || {
            lenses.push(lens);
            lenses.len() - 1
        },
        |at| first + at,
    )
}

/// Returns the name of the image of a frame, relative to the folder.
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

/// Returns the pose of a camera, with COLMAP's axes.
fn pose(matrix: &Matrix) -> Result<Pose, String> {
    let world_from_gl = matrix.similarity().map_err(|what| format!("transform_matrix: {what}"))?;
    if (world_from_gl.scale() - 1.0).abs() > 1e-3 {
        return Err(format!(
            "transform_matrix scales by {}, expected only a rotation and a position",
            world_from_gl.scale()
        ));
    }
    let r = world_from_gl.rotation();
    // The columns are the camera axes in the world. From OpenGL to COLMAP, y and z change their
    // sign.
    let axis = |i: usize, sign: f64| [sign * r[0][i], sign * r[1][i], sign * r[2][i]];
    Ok(Pose { rotation: [axis(0, 1.0), axis(1, -1.0), axis(2, -1.0)], centre: world_from_gl.translation() })
}

/// Returns the transform from the world of the file to the original world.
fn undo_applied(file: &File) -> Result<Similarity, String> {
    let applied = file.applied_transform.as_ref().map(Matrix::similarity).transpose()?.unwrap_or(Similarity::IDENTITY);
    let scale = Similarity::new(file.applied_scale.unwrap_or(1.0), Similarity::IDENTITY.rotation(), [0.0; 3]);
    Ok(scale.map_err(|error| error.to_string())?.after(&applied).inverse())
}

#[cfg(test)]
mod tests;
