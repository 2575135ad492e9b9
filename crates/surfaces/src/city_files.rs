//! City model files among the inputs of a job, and the triangles of a model that serves as surface.

use std::path::{Path, PathBuf};

use city::{CrsReference, MeshConfig, ModelError, TriangleMesh};
use cityfiles::CityError;
use numeric::failures;

/// A city model that cannot serve as surface.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CitySurfaceError {
    /// The city model cannot be read.
    #[error(transparent)]
    Unreadable(#[from] CityError),
    /// The triangles of the city model cannot be made.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The city model has no usable surface.
    #[error("no surface of the model can be used: {}", path.display())]
    NoSurface {
        /// The model.
        path: PathBuf,
    },
    /// The triangles cannot be searched.
    #[error(transparent)]
    Triangles(#[from] bvh::BvhError),
}

failures!(CitySurfaceError: Other { Self::Unreadable(error) => error.kind() });

/// Returns whether a file is a city model, by its ending. The readers look at the content.
pub(crate) fn is_city_model(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["json", "jsonl", "gml", "xml", "obj", "ply", "cityjson", "citygml"].contains(&ending.as_str())
}

/// Reads a city model and makes the triangles of the selected surfaces, of which there is at least
/// one. Returns them with the coordinate reference system that the file states.
///
/// # Errors
/// [`CitySurfaceError`], except for its `Triangles`.
pub(crate) fn read_triangles(
    path: &Path,
    selection: &MeshConfig,
) -> Result<(TriangleMesh, CrsReference), CitySurfaceError> {
    let model = cityfiles::read(path)?.model;
    let mesh = TriangleMesh::from_model(&model, selection)?.mesh;
    if mesh.triangles.is_empty() {
        return Err(CitySurfaceError::NoSurface { path: path.to_owned() });
    }
    Ok((mesh, model.crs))
}
