//! Writes a COLMAP model: `cameras`, `images` and `points3D` as text or binary.
//!
//! Cameras and points are numbered from 1 in the order of the model. Images keep their identifiers.
//! The tracks are written on both sides: the points of an image are in the order of the points of
//! the model. Binary files hold the f64 values, text files the shortest decimals that read back to
//! the same f64. A pose is written as quaternion and translation, which changes its rotation matrix
//! by rounding only. Each file appears under its name when it is complete. `images` is written
//! last, so that a folder with `images` is complete.

mod binary;
mod observations;
mod text;

use std::collections::HashSet;
use std::io::Write;
use std::path::Path;

use camera::ImagePoint;

use super::convention::is_inside;
use super::model::{ColmapModel, ColmapPoint};
use crate::atomic::{refuse_existing, write_stream};
use crate::format_error::FormatError;
use observations::ImageObservations;

/// Encoding of the files of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColmapEncoding {
    /// Little-endian binary files, `.bin`.
    Binary,
    /// Text files, `.txt`.
    Text,
}

impl ColmapEncoding {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 2] =
        [("bin", Self::Binary, "COLMAP's binary files"), ("txt", Self::Text, "COLMAP's text files")];
}

/// Writes a model with its points into an existing folder.
///
/// # Errors
/// [`FormatError`]
/// - when a file exists and `overwrite` is false, or the system refuses to write;
/// - when the folder holds `rigs` or `frames` of another model, a view has no lens, two views share
///   an identifier, an image name leads out of its folder or has control characters, a pose or a
///   point is not finite, or a track names a view that does not exist. Nothing is written then.
pub fn write(
    folder: &Path,
    model: &ColmapModel,
    points: &[ColmapPoint],
    encoding: ColmapEncoding,
    overwrite: bool,
) -> Result<(), FormatError> {
    check(model, points)
        .and_then(|()| no_rigs(folder))
        .map_err(|what| FormatError::new(folder, format_args!("the model cannot be written ({what})")))?;
    let seen = ImageObservations::of(model.views.len(), points);
    let extension = match encoding {
        ColmapEncoding::Binary => "bin",
        ColmapEncoding::Text => "txt",
    };
    let file = |name: &str, make: &dyn Fn(&mut dyn Write) -> std::io::Result<()>| {
        write_stream(&folder.join(format!("{name}.{extension}")), overwrite, make)
    };
    // Nothing is written when one of the files exists.
    for name in ["points3D", "cameras", "images"] {
        refuse_existing(&folder.join(format!("{name}.{extension}")), overwrite)?;
    }
    match encoding {
        ColmapEncoding::Binary => {
            file("points3D", &|out| binary::points(out, model, points))?;
            file("cameras", &|out| binary::cameras(out, model))?;
            file("images", &|out| binary::images(out, model, &seen))?;
        }
        ColmapEncoding::Text => {
            file("points3D", &|out| text::points(out, model, points))?;
            file("cameras", &|out| text::cameras(out, model))?;
            file("images", &|out| text::images(out, model, &seen))?;
        }
    }
    Ok(())
}

fn check(model: &ColmapModel, points: &[ColmapPoint]) -> Result<(), String> {
    let mut numbers = HashSet::new();
    for view in &model.views {
        if view.lens >= model.lenses.len() {
            return Err(format!(
                "image {} names lens {}, the model has {} lenses",
                view.id,
                view.lens,
                model.lenses.len()
            ));
        }
        if view.id == u32::MAX || !numbers.insert(view.id) {
            return Err(format!("the identifier {} belongs to two images, or is reserved", view.id));
        }
        let name = &view.name;
        if !is_inside(name) || name.trim() != name || name.chars().any(char::is_control) {
            return Err(format!(
                "the image name {name:?} leads out of its folder, or has spaces around it or control characters"
            ));
        }
        let pose = view.pose.rotation.as_flattened().iter().chain(&view.pose.centre);
        if !pose.copied().all(f64::is_finite) {
            return Err(format!("the pose of image {} is not finite", view.id));
        }
    }
    for (number, point) in points.iter().enumerate() {
        if !point.position.iter().chain([&point.error_px]).all(|c| c.is_finite()) {
            return Err(format!("point {number} is not finite"));
        }
        let views = model.views.len();
        if let Some(seen) = point.track.iter().find(|seen| seen.view as usize >= views || !finite(seen.pixel)) {
            return Err(format!("point {number} names view {} of {views}, or a pixel that is not finite", seen.view));
        }
    }
    Ok(())
}

fn finite(pixel: ImagePoint) -> bool {
    pixel.sample.is_finite() && pixel.line.is_finite()
}

/// Refuses a folder with `rigs` or `frames`: COLMAP would read them with the new model, although
/// they belong to another.
fn no_rigs(folder: &Path) -> Result<(), String> {
    let names = ["rigs.bin", "rigs.txt", "frames.bin", "frames.txt"];
    match names.iter().find(|name| folder.join(name).symlink_metadata().is_ok()) {
        Some(name) => Err(format!("the folder holds {name} of another model, choose an empty folder")),
        None => Ok(()),
    }
}
