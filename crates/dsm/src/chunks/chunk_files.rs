//! The result of a chunk as a folder: `result.json` with the counts, and one NumPy array per
//! raster.
//!
//! Arrays keep the heights as they are, relative to their origin and with NaN in voids, so that a
//! result that was written and read back gives the same DSM. The folder is made beside its place
//! and renamed, so that it is complete under its name.

use std::fs;
use std::path::Path;

use formats::npy::NpyData;
use raster::{Grid, Window};
use reconstruct::SurfaceRasters;
use serde::{Deserialize, Serialize};

use crate::chunks::chunk::{ChunkContent, ChunkResult, ChunkSummary, ChunkSurface};
use crate::error::DsmError;
use job::files::TEXT_LIMIT;

/// Name of the file with everything but the rasters.
const RECORD: &str = "result.json";
/// Names of the rasters.
const ARRAYS: [&str; 6] = ["height.npy", "sigma.npy", "confidence.npy", "views.npy", "filled.npy", "source.npy"];

/// Everything of a chunk's result but the rasters.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ChunkRecord {
    core: Window,
    status: Status,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Status {
    Surface { origin_m: f64, summary: ChunkSummary },
    Unseen,
    Failed { reason: String },
}

impl ChunkResult {
    /// Writes the result into a new folder.
    ///
    /// # Errors
    /// [`DsmError::Output`] for a folder that exists or cannot be written. Nothing stays behind.
    pub fn write(&self, folder: &Path) -> Result<(), DsmError> {
        let failed = |source| DsmError::Output { path: folder.to_owned(), source };
        if folder.symlink_metadata().is_ok() {
            return Err(failed(std::io::ErrorKind::AlreadyExists.into()));
        }
        // A name that nobody can foresee, so that nobody can put a link in its place.
        let beside = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(beside).map_err(failed)?;
        let work = tempfile::Builder::new().prefix(".skysweep-result-").tempdir_in(beside).map_err(failed)?;
        let partial = work.path().join("result");
        self.write_files(&partial).and_then(|()| fs::rename(&partial, folder)).map_err(failed)
    }

    /// Whether an entry of the folder of a result is ours.
    pub(crate) fn is_part(name: &str) -> bool {
        name == RECORD || ARRAYS.contains(&name)
    }

    fn write_files(&self, folder: &Path) -> std::io::Result<()> {
        fs::create_dir_all(folder)?;
        let status = match &self.content {
            ChunkContent::Unseen => Status::Unseen,
            ChunkContent::Failed { reason } => Status::Failed { reason: reason.clone() },
            ChunkContent::Surface(surface) => {
                write_rasters(folder, &surface.rasters).map_err(std::io::Error::other)?;
                Status::Surface { origin_m: surface.rasters.origin_m, summary: surface.summary.clone() }
            }
        };
        let json = serde_json::to_string_pretty(&ChunkRecord { core: self.core, status })?;
        formats::write_bytes(folder.join(RECORD), (json + "\n").as_bytes(), true).map_err(std::io::Error::other)
    }

    /// Reads a result that [`ChunkResult::write`] wrote.
    ///
    /// # Errors
    /// [`DsmError::ChunkFile`] for a folder without a result, and for a result whose parts do not
    /// fit together.
    pub fn read(folder: &Path) -> Result<Self, DsmError> {
        let path = folder.join(RECORD);
        let failed = |reason: String| DsmError::ChunkFile { path: path.clone(), reason };
        let json = formats::read_regular(&path, TEXT_LIMIT).map_err(|e| failed(e.to_string()))?;
        let ChunkRecord { core, status } = serde_json::from_slice(&json).map_err(|e| failed(e.to_string()))?;
        let content = match status {
            Status::Unseen => ChunkContent::Unseen,
            Status::Failed { reason } => ChunkContent::Failed { reason },
            Status::Surface { origin_m, summary } => {
                let rasters = read_rasters(folder, origin_m, core)?;
                ChunkContent::Surface(Box::new(ChunkSurface { rasters, summary }))
            }
        };
        Ok(Self { core, content })
    }
}

fn write_rasters(folder: &Path, rasters: &SurfaceRasters) -> Result<(), formats::FormatError> {
    let shape = [rasters.height_m.height(), rasters.height_m.width()];
    for (name, grid) in
        [("height.npy", &rasters.height_m), ("sigma.npy", &rasters.sigma_m), ("confidence.npy", &rasters.confidence)]
    {
        formats::npy::write(folder.join(name), &shape, grid.data(), true)?;
    }
    for (name, grid) in
        [("views.npy", &rasters.views), ("filled.npy", &rasters.filled), ("source.npy", &rasters.source)]
    {
        formats::npy::write(folder.join(name), &shape, grid.data(), true)?;
    }
    Ok(())
}

fn read_rasters(folder: &Path, origin_m: f64, core: Window) -> Result<SurfaceRasters, DsmError> {
    let size = (core.width, core.height);
    let floats = |name: &str| {
        read_grid(&folder.join(name), size, |data| match data {
            NpyData::F32(values) => Some(values),
            _ => None,
        })
    };
    let bytes = |name: &str| {
        read_grid(&folder.join(name), size, |data| match data {
            NpyData::U8(values) => Some(values),
            _ => None,
        })
    };
    Ok(SurfaceRasters {
        origin_m,
        height_m: floats("height.npy")?,
        sigma_m: floats("sigma.npy")?,
        views: bytes("views.npy")?,
        confidence: floats("confidence.npy")?,
        filled: bytes("filled.npy")?,
        source: bytes("source.npy")?,
    })
}

/// Reads an array of `size` (columns, rows), whose numbers `take` accepts.
fn read_grid<T>(
    path: &Path,
    size: (usize, usize),
    take: impl Fn(NpyData) -> Option<Vec<T>>,
) -> Result<Grid<T>, DsmError> {
    let failed = |reason: String| DsmError::ChunkFile { path: path.to_owned(), reason };
    let array = formats::npy::read(path).map_err(|e| failed(e.to_string()))?;
    if array.shape != [size.1, size.0] {
        return Err(failed(format!("rows and columns are {:?}, expected {:?}", array.shape, [size.1, size.0])));
    }
    let grid = take(array.data).and_then(|values| Grid::from_vec(size.0, size.1, values));
    grid.ok_or_else(|| failed("numbers of another type".to_owned()))
}
