//! COLMAP models out: `cameras`, `images` and `points3D` as text or binary.
//!
//! Cameras are numbered by their place in the model and points by theirs, both from 1; images keep their numbers. Tracks are
//! filled in on both sides: the points of an image are in the order of the points of the model. Binary files hold the f64 as they
//! are, text files the shortest decimals that read back to them. A pose is written as quaternion and translation, which
//! moves its matrix by rounding only. Each file appears when it is complete, and `images` last: a folder that has it is whole.

mod binary;
mod text;

use std::collections::HashSet;
use std::io::Write;
use std::path::Path;

use camera::{ImagePoint, Lens};

use super::{ColmapError, ColmapModel, ColmapPoint, is_inside, principal_point_index};
use crate::atomic::{refuse_existing, write_stream};

/// How the files are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColmapEncoding {
    /// `.bin`.
    Binary,
    /// `.txt`.
    Text,
}

/// Writes a model with its points into an existing folder.
///
/// # Errors
/// Files that exist without `overwrite`, or `rigs` and `frames` of another model; a model that no file can hold: a view without
/// lens, two views with one number or a name that leads out of the folder or has control characters, a point that is not
/// finite or that a view which is not there sees; what the system refuses.
pub fn write(
    folder: &Path,
    model: &ColmapModel,
    points: &[ColmapPoint],
    encoding: ColmapEncoding,
    overwrite: bool,
) -> Result<(), ColmapError> {
    check(model, points)
        .and_then(|()| no_rigs(folder))
        .map_err(|what| ColmapError::Inconsistent { folder: folder.to_owned(), what })?;
    let seen = Seen::of(model.views.len(), points);
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
            return Err(format!("image {} has lens {} of {}", view.id, view.lens, model.lenses.len()));
        }
        if view.id == u32::MAX || !numbers.insert(view.id) {
            return Err(format!("the number {} is taken by two images, or reserved", view.id));
        }
        let name = &view.name;
        if !is_inside(name) || name.trim() != name || name.chars().any(char::is_control) {
            return Err(format!("the image name {name:?} leads out of its folder, or text cannot hold it"));
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
            return Err(format!("point {number} is seen by view {} of {views}, or at no finite pixel", seen.view));
        }
    }
    Ok(())
}

fn finite(pixel: ImagePoint) -> bool {
    pixel.sample.is_finite() && pixel.line.is_finite()
}

/// Rigs and frames of another model would be read with this one.
fn no_rigs(folder: &Path) -> Result<(), String> {
    let names = ["rigs.bin", "rigs.txt", "frames.bin", "frames.txt"];
    match names.iter().find(|name| folder.join(name).symlink_metadata().is_ok()) {
        Some(name) => Err(format!("the folder holds {name} of another model: choose an empty one")),
        None => Ok(()),
    }
}

/// COLMAP's parameters of a lens, in COLMAP's pixels.
fn parameters(lens: &Lens) -> Vec<f64> {
    let mut parameters = lens.parameters();
    let first = principal_point_index(lens.model());
    parameters[first..first + 2].iter_mut().for_each(|c| *c += 0.5);
    parameters
}

/// What each view sees: pixels and the numbers of points, view after view.
struct Seen {
    ends: Vec<usize>,
    observations: Vec<(ImagePoint, u64)>,
}

impl Seen {
    fn of(views: usize, points: &[ColmapPoint]) -> Self {
        let mut next = vec![0usize; views];
        points.iter().flat_map(|p| &p.track).for_each(|seen| next[seen.view as usize] += 1);
        let mut total = 0;
        for count in &mut next {
            total += std::mem::replace(count, total);
        }
        let mut observations = vec![(ImagePoint { sample: 0.0, line: 0.0 }, 0); total];
        for (number, point) in (1u64..).zip(points) {
            for seen in &point.track {
                let at = &mut next[seen.view as usize];
                observations[*at] = (in_colmap(seen.pixel), number);
                *at += 1;
            }
        }
        Self { ends: next, observations }
    }

    fn by_view(&self, view: usize) -> &[(ImagePoint, u64)] {
        let start = view.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.observations[start..self.ends[view]]
    }
}

/// Numbers the observations of every view in the order of the points, as [`Seen`] lays them out.
struct Numbering(Vec<u32>);

impl Numbering {
    fn new(views: usize) -> Self {
        Self(vec![0; views])
    }

    fn next(&mut self, view: u32) -> u32 {
        let next = &mut self.0[view as usize];
        *next += 1;
        *next - 1
    }
}

/// A pixel with COLMAP's origin at the upper-left corner.
fn in_colmap(pixel: ImagePoint) -> ImagePoint {
    ImagePoint { sample: pixel.sample + 0.5, line: pixel.line + 0.5 }
}
