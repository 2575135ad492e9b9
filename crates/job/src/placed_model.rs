//! A COLMAP model placed on a map. The alignment job and the ground views write `origin.json`
//! beside such a model; a dataset of the priors job has one of its own form beside `sparse`.

use std::path::{Path, PathBuf};

use formats::colmap::ColmapModel;
use formats::splat_ply::LocalOrigin;
use numeric::{Kind, failures};

use crate::dataset_folder::{UNKNOWN_DATUM, UNKNOWN_FRAME, dataset_folder, dataset_origin, sparse_folder};
use crate::error::{JobError, from_failures};

/// A COLMAP model that cannot be placed on the map.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlacedModelError {
    /// There is no readable `origin.json`.
    #[error("the model has no origin on a map ({source}); align it to a map first: {}", path.display())]
    NoOrigin {
        /// The file that was looked for.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The file is not an origin.
    #[error("the file is not an origin as skysweep writes it ({source}): {}", path.display())]
    NotAnOrigin {
        /// The file.
        path: PathBuf,
        /// What the JSON reader found.
        source: serde_json::Error,
    },
    /// The cameras and the surface are on different maps.
    #[error(
        "the cameras are in {} above the {}, the surface is in {} above the {}; align the cameras to the surface's map",
        cameras.crs, cameras.vertical, surface.crs, surface.vertical
    )]
    OtherMap {
        /// The origin of the cameras.
        cameras: Box<LocalOrigin>,
        /// The origin of the surface.
        surface: Box<LocalOrigin>,
    },
}

failures!(PlacedModelError: File { Self::OtherMap { .. } => Kind::Other });

from_failures!(PlacedModelError);

/// Reads the cameras of a model, or of a dataset with a model in `sparse/0`, and shifts them so
/// that their positions are relative to `origin`.
///
/// # Errors
/// [`JobError`] if the model or its origin cannot be read, or if it lies on another map.
pub fn read(folder: &Path, origin: &LocalOrigin) -> Result<ColmapModel, JobError> {
    let sparse = sparse_folder(folder);
    let mut model = formats::colmap::read(&sparse)?;
    let path = sparse.join("origin.json");
    let of_dataset = dataset_origin(&dataset_folder(&sparse))?;
    // A model that is given by itself has a place on a map.
    let own: LocalOrigin = if path.is_file() || (sparse == folder && of_dataset.crs == UNKNOWN_FRAME) {
        let text = formats::read_regular_text(&path, crate::files::TEXT_LIMIT)
            .map_err(|source| PlacedModelError::NoOrigin { path: path.clone(), source })?;
        serde_json::from_str(&text).map_err(|source| PlacedModelError::NotAnOrigin { path, source })?
    } else {
        of_dataset
    };
    let same_datum = own.vertical == origin.vertical || [&own, origin].iter().any(|o| o.vertical == UNKNOWN_DATUM);
    if own.crs != origin.crs || !same_datum {
        let (cameras, surface) = (Box::new(own), Box::new(origin.clone()));
        return Err(PlacedModelError::OtherMap { cameras, surface }.into());
    }
    let shift = [0, 1, 2].map(|i| own.origin[i] - origin.origin[i]);
    for view in &mut model.views {
        view.pose.centre = [0, 1, 2].map(|i| view.pose.centre[i] + shift[i]);
    }
    Ok(model)
}
