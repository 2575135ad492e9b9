//! Whether the inputs of a run stay the same files while they are read.
//!
//! A run reads its images again for every chunk. A file that is replaced meanwhile would give a
//! surface of two versions.

use std::collections::BTreeSet;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use formats::ground_points::read_ground_points;
use formats::raster::ImageSource;

use crate::config::DsmConfig;
use crate::error::DsmError;

/// The inputs of a run as they were at its start.
#[derive(Debug)]
pub(crate) struct InputStamps(Vec<(PathBuf, Stamp)>);

/// What changes when a file is written or replaced.
#[derive(Debug, PartialEq, Eq)]
struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl InputStamps {
    /// Notes the files of a configuration, with those that they consist of. Addresses have no
    /// stamp.
    pub(crate) fn of(config: &DsmConfig) -> Self {
        // A file that cannot be opened is an error where it is read.
        let parts = files_of(config).unwrap_or_default();
        let given = config.images.iter().chain(config.side_inputs()).cloned();
        let files: BTreeSet<PathBuf> = given.chain(parts).collect();
        Self(files.into_iter().filter_map(|path| stamp(&path).map(|stamp| (path, stamp))).collect())
    }

    /// Compares the files with what they were. A file that is gone cannot be mixed with another,
    /// and is an error where it is read again.
    ///
    /// # Errors
    /// [`DsmError::InputChanged`].
    pub(crate) fn check(&self) -> Result<(), DsmError> {
        let changed = self.0.iter().find(|(path, before)| stamp(path).is_some_and(|now| now != *before));
        changed.map_or(Ok(()), |(path, _)| Err(DsmError::InputChanged { path: path.clone() }))
    }
}

/// Returns the files that a run reads: those of its configuration, the members of mosaics (VRT),
/// the files beside images that may hold their RPCs, and the chips of ground points. Addresses are
/// not among them.
///
/// # Errors
/// [`DsmError::Image`] for a raster that cannot be opened, [`DsmError::Control`].
pub fn files_of(config: &DsmConfig) -> Result<BTreeSet<PathBuf>, DsmError> {
    let mut files: BTreeSet<PathBuf> = config.side_inputs().chain(&config.images).cloned().collect();
    for raster in config.images.iter().chain(&config.dem).chain(&config.reference_dem) {
        files.extend(ImageSource::open(raster)?.files());
    }
    files.extend(config.images.iter().flat_map(|image| formats::rpc::side_files(image)));
    for points in config.control.iter().filter(|path| path.is_file()) {
        files.extend(
            read_ground_points(points)
                .map_err(DsmError::Control)?
                .into_iter()
                .filter_map(|point| point.chip)
                .map(|chip| chip.path),
        );
    }
    files.retain(|path| path.is_file());
    Ok(files)
}

fn stamp(path: &Path) -> Option<Stamp> {
    let found = fs::metadata(path).ok()?;
    Some(Stamp { bytes: found.len(), modified: found.modified().ok(), inode: inode(&found) })
}

#[cfg(unix)]
fn inode(found: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(found)
}

#[cfg(not(unix))]
fn inode(_: &Metadata) -> u64 {
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mosaic names its members, which may be replaced as any input.
    #[test]
    fn members_of_mosaics_have_stamps() {
        let town = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
        let folder = tempfile::tempdir().unwrap();
        let (member, mosaic) = (folder.path().join("a.tif"), folder.path().join("a.vrt"));
        fs::copy(town.join("view_1.tif"), &member).unwrap();
        let text = "<VRTDataset rasterXSize=\"64\" rasterYSize=\"64\"><VRTRasterBand dataType=\"UInt16\" band=\"1\">\
                    <SimpleSource><SourceFilename relativeToVRT=\"1\">a.tif</SourceFilename><SourceBand>1</SourceBand>\
                    </SimpleSource></VRTRasterBand></VRTDataset>";
        fs::write(&mosaic, text).unwrap();
        let mut config = DsmConfig::new(vec![town.join("view_2.tif"), mosaic.clone()], folder.path().join("out"));
        config.reference_dem = Some(mosaic);
        for images in [2, 1] {
            config.images.truncate(images);
            let stamps = InputStamps::of(&config);
            stamps.check().unwrap();
            fs::OpenOptions::new().append(true).open(&member).unwrap().set_len(1000 + images as u64).unwrap();
            let changed = stamps.check().unwrap_err();
            assert!(matches!(&changed, DsmError::InputChanged { path } if path.ends_with("a.tif")), "{changed}");
            fs::copy(town.join("view_1.tif"), &member).unwrap();
        }
    }
}
