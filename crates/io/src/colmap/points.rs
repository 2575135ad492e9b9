//! The points of a COLMAP model and where images see them.

use std::collections::HashMap;
use std::path::Path;

use camera::ImagePoint;

use super::{ColmapError, ColmapModel, Fault, ImagePoints, binary, invalid, load, read_views, text};

/// A point of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapPoint {
    /// Where it is in the world of the poses.
    pub position: [f64; 3],
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Mean reprojection error, pixels; negative where it is not known.
    pub error_px: f64,
    /// The images that see it.
    pub track: Vec<ColmapObservation>,
}

/// A point in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColmapObservation {
    /// Index of the image in [`ColmapModel::views`].
    pub view: u32,
    /// Where the image sees the point.
    pub pixel: ImagePoint,
}

/// A point as it stands in a file: its track names images by number, and points by their index in the image.
#[derive(Debug)]
pub(super) struct RawPoint {
    pub(super) position: [f64; 3],
    pub(super) color: [u8; 3],
    pub(super) error_px: f64,
    pub(super) track: Vec<(u32, u32)>,
    pub(super) place: String,
}

/// Reads the model in a folder with its points.
///
/// # Errors
/// As [`super::read`]; a point that is not finite, or whose track names an image or a point of it that is not there.
pub fn read_with_points(folder: &Path) -> Result<(ColmapModel, Vec<ColmapPoint>), ColmapError> {
    let (model, pixels) = read_views(folder, ImagePoints::Keep)?;
    let view_of: HashMap<u32, usize> = model.views.iter().enumerate().map(|(index, view)| (view.id, index)).collect();
    let (path, points) = load(folder, "points3D", binary::points, text::points)?;
    let points = points.into_iter().map(|raw| point(raw, &view_of, &pixels)).collect::<Result<_, _>>();
    Ok((model, points.map_err(|fault| invalid(&path, fault))?))
}

fn point(raw: RawPoint, view_of: &HashMap<u32, usize>, pixels: &[Vec<[f64; 2]>]) -> Result<ColmapPoint, Fault> {
    let RawPoint { position, color, error_px, track, place } = raw;
    if !position.iter().all(|c| c.is_finite()) {
        return Err(Fault { what: "the position of a point is not finite".to_owned(), place });
    }
    let observation = |(image, index): (u32, u32)| {
        let view = *view_of.get(&image)?;
        let [x, y] = *pixels.get(view)?.get(usize::try_from(index).ok()?)?;
        Some(ColmapObservation {
            view: u32::try_from(view).ok()?,
            pixel: ImagePoint { sample: x - 0.5, line: y - 0.5 },
        })
    };
    let found: Result<_, (u32, u32)> = track.into_iter().map(|seen| observation(seen).ok_or(seen)).collect();
    let missing =
        |(image, index)| Fault { what: format!("image {image} has no point {index}, which a track names"), place };
    Ok(ColmapPoint { position, color, error_px, track: found.map_err(missing)? })
}
