//! Where the cameras of a dataset stand, in a frame that numbers of 32 bits are precise in.

use std::path::Path;

use formats::colmap::{ColmapModel, ColmapObservation, ColmapPoint, ColmapView, read_with_points};
use formats::splat_ply::LocalOrigin;

use super::error::TrainError;
use job::dataset_folder::{UNKNOWN_FRAME, dataset_origin};

/// Coordinates beyond this are counted from an origin of their own, metres: numbers of 32 bits have
/// steps of a millimetre there.
const FAR_M: f64 = 1e4;
/// Difference of the positions of a camera in two models of the same frame, metres.
const SAME_M: f64 = 1e-3;

/// Place of a dataset.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DatasetPlace {
    /// What was taken from the positions of the dataset, metres.
    pub(crate) shift: [f64; 3],
    /// The origin of the positions that are left.
    pub(crate) origin: LocalOrigin,
}

impl DatasetPlace {
    /// Returns whether the reference system of the positions is known.
    pub(crate) fn is_on_a_map(&self) -> bool {
        self.origin.crs != UNKNOWN_FRAME
    }

    /// Reads where a dataset lies, as far as its origin says so, and moves the cameras of its model
    /// near the origin where they are far from it.
    pub(crate) fn read(folder: &Path, model: &mut ColmapModel) -> Result<Self, TrainError> {
        let mut origin = dataset_origin(folder)?;
        let far = |view: &ColmapView| view.pose.centre.iter().any(|c| c.abs() > FAR_M);
        let shift = match model.views.iter().find(|view| far(view)) {
            Some(view) => view.pose.centre.map(f64::floor),
            None => [0.0; 3],
        };
        for view in &mut model.views {
            (0..3).for_each(|i| view.pose.centre[i] -= shift[i]);
        }
        (0..3).for_each(|i| origin.origin[i] += shift[i]);
        Ok(Self { shift, origin })
    }
}

/// Returns the points of another model of the same cameras, in the frame of the first. Frames may
/// differ by a translation.
pub(super) fn more_points(model: &ColmapModel, folder: &Path) -> Result<Vec<ColmapPoint>, TrainError> {
    let (other, points) = read_with_points(folder)?;
    let invalid = |what: String| TrainError::Dataset { path: folder.to_owned(), what };
    // One of the two may name the folder, too. That a camera is the same, its pose says.
    let within = |long: &str, short: &str| long.strip_suffix(short).is_some_and(|folder| folder.ends_with('/'));
    let number_of = |view: &ColmapView| {
        let exact = model.views.iter().position(|v| v.name == view.name);
        exact.or_else(|| model.views.iter().position(|v| within(&v.name, &view.name) || within(&view.name, &v.name)))
    };
    let numbers: Vec<Option<usize>> = other.views.iter().map(number_of).collect();
    let pairs: Vec<(&ColmapView, &ColmapView)> =
        other.views.iter().zip(&numbers).filter_map(|(view, n)| Some((view, &model.views[(*n)?]))).collect();
    let Some((first, same)) = pairs.first() else {
        return Err(invalid("no camera of these points has the name of a camera of the dataset".to_owned()));
    };
    let shift = [0, 1, 2].map(|i| same.pose.centre[i] - first.pose.centre[i]);
    let differs = |(a, b): &(&ColmapView, &ColmapView)| {
        let turned = (0..9).any(|k| (a.pose.rotation[k / 3][k % 3] - b.pose.rotation[k / 3][k % 3]).abs() > 1e-6);
        turned || (0..3).any(|i| (b.pose.centre[i] - a.pose.centre[i] - shift[i]).abs() > SAME_M)
    };
    if let Some((view, _)) = pairs.iter().find(|pair| differs(pair)) {
        return Err(invalid(format!("the camera of {} has another pose than in the dataset", view.name)));
    }
    let moved = |point: ColmapPoint| {
        let seen = |o: &ColmapObservation| {
            let view = numbers.get(o.view as usize).copied().flatten()?;
            Some(ColmapObservation { view: view as u32, ..*o })
        };
        ColmapPoint {
            position: [0, 1, 2].map(|i| point.position[i] + shift[i]),
            track: point.track.iter().filter_map(seen).collect(),
            ..point
        }
    };
    Ok(points.into_iter().map(moved).collect())
}
