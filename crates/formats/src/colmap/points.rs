//! The points of a COLMAP model and the images that see them.

use std::collections::HashMap;
use std::path::Path;

use super::convention::pixel_from_colmap;
use super::files::load;
use super::model::{ColmapModel, ColmapObservation, ColmapPoint};
use super::raw::{ImagePoints, RawObservation, RawPoint};
use super::read::read_views;
use super::{binary, text};
use crate::camera_file::Fault;
use crate::format_error::FormatError;

/// Reads the model in a folder with its points.
///
/// # Errors
/// The errors of [`read`](super::read), for `points3D` too; [`FormatError`] also when a position is
/// not finite, or a track names an image or an image point that does not exist.
pub fn read_with_points(folder: &Path) -> Result<(ColmapModel, Vec<ColmapPoint>), FormatError> {
    let (model, pixels) = read_views(folder, ImagePoints::Keep)?;
    let view_of: HashMap<u32, usize> = model.views.iter().enumerate().map(|(index, view)| (view.id, index)).collect();
    let (path, points) = load(folder, "points3D", binary::points, text::points)?;
    let points = points.into_iter().map(|raw| point(raw, &view_of, &pixels)).collect::<Result<_, _>>();
    Ok((model, points.map_err(|fault: Fault| fault.at(&path))?))
}

fn point(raw: RawPoint, view_of: &HashMap<u32, usize>, pixels: &[Vec<[f64; 2]>]) -> Result<ColmapPoint, Fault> {
    let RawPoint { position, color, error_px, track, place } = raw;
    if !position.iter().all(|c| c.is_finite()) {
        return Err(Fault { what: "the position of a point is not finite".to_owned(), place });
    }
    let observation = |seen: RawObservation| {
        let view = *view_of.get(&seen.image)?;
        let pixel = *pixels.get(view)?.get(usize::try_from(seen.index).ok()?)?;
        Some(ColmapObservation { view: u32::try_from(view).ok()?, pixel: pixel_from_colmap(pixel) })
    };
    let found: Result<_, RawObservation> = track.into_iter().map(|seen| observation(seen).ok_or(seen)).collect();
    let missing = |RawObservation { image, index }| Fault {
        what: format!("a track names point {index} of image {image}, and there is no point with this number"),
        place,
    };
    Ok(ColmapPoint { position, color, error_px, track: found.map_err(missing)? })
}
