//! Errors of raster files.

use std::path::{Path, PathBuf};

use numeric::{Kind, failures};

use super::read::luma_rule::BandChoice;
use crate::atomic::SaveError;

/// A raster file that cannot be read or written. The text ends with the path, and `reason` is
/// GDAL's message.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The file does not exist or may not be read.
    #[error("cannot read the file ({source}): check the name and the permissions: {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The name leads to a network or a service.
    #[error("the name leads to a network or a service, expected a local file: download it first, or allow addresses: {}", path.display())]
    NotLocal {
        /// The name as given.
        path: PathBuf,
    },
    /// The name is that of a pipe or a device, which cannot be read as a file.
    #[error("a pipe or a device, expected a file: {}", path.display())]
    NotAFile {
        /// The name as given.
        path: PathBuf,
    },
    /// A folder is given, and it is no raster itself.
    #[error("a folder is given in the place of a raster (it holds {found}); give a raster in it: {}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Names of the first TIFFs in it, or that there are none.
        found: String,
    },
    /// GDAL cannot open the file as a raster.
    #[error("not a raster that GDAL can open ({reason}): {}", path.display())]
    NotARaster {
        /// The file.
        path: PathBuf,
        /// GDAL's message.
        reason: String,
    },
    /// A STAC item does not lead to an image.
    #[error("{source}: {}", path.display())]
    Item {
        /// The item.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// GDAL opened the file but cannot decode its content.
    #[error("the raster is damaged or truncated ({reason}): {}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// GDAL's message.
        reason: String,
    },
    /// The raster is of a kind that is not supported.
    #[error("{found}, expected {expected}: {}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The property found.
        found: String,
        /// The property required.
        expected: &'static str,
    },
    /// The image does not have the band that is asked for.
    #[error("the image has no band {wanted}; its bands are {bands}: {}", path.display())]
    NoBand {
        /// The file.
        path: PathBuf,
        /// The band.
        wanted: BandChoice,
        /// Numbers and names of the bands that the image has.
        bands: String,
    },
    /// A value that looks like no-data is not declared as such. As a height it would spoil every
    /// result.
    #[error(
        "{cells} cells have exactly the value {value}, far from all others, which looks like a no-data value that the \
         file does not declare: declare it (gdal_edit.py -a_nodata {value}), or set the cells to another value: {}",
        path.display()
    )]
    UndeclaredNoData {
        /// The file.
        path: PathBuf,
        /// The value.
        value: f32,
        /// Number of cells that have it.
        cells: usize,
    },
    /// The file was not written: it exists, or the system or GDAL refused.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
    /// The given bands cannot make a raster.
    #[error("the bands do not make one raster ({reason}): {}", path.display())]
    InconsistentBands {
        /// The output.
        path: PathBuf,
        /// The property that does not fit.
        reason: String,
    },
    /// The coordinate reference system cannot be written or read.
    #[error("coordinate reference system ({source}): {}", path.display())]
    Crs {
        /// The file.
        path: PathBuf,
        /// The error of PROJ.
        source: crs::CrsError,
    },
}

failures!(RasterError: File {
    Self::NotLocal { .. } => Kind::RemoteRefused,
    Self::NotWritten(error) => error.kind(),
    Self::Crs { source, .. } => source.kind(),
});

impl RasterError {
    pub(crate) fn unwritable(path: &Path, reason: impl ToString) -> Self {
        Self::NotWritten(SaveError::unwritable(path, reason))
    }

    /// A band that is asked for and not among those of a file, whose names are given.
    pub(super) fn no_band(path: &Path, wanted: &BandChoice, names: &[Vec<String>]) -> Self {
        let bands = names.iter().enumerate().map(|(i, names)| format!("{} {}", i + 1, names.join(", ")));
        let bands: Vec<String> = bands.map(|band| band.trim_end().to_owned()).collect();
        Self::NoBand { path: path.to_owned(), wanted: wanted.clone(), bands: bands.join("; ") }
    }

    pub(crate) fn damaged(path: &Path, reason: impl ToString) -> Self {
        Self::Damaged { path: path.to_owned(), reason: reason.to_string() }
    }
}
