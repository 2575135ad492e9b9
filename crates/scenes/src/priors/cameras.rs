//! The cameras of a scene, checked for what pairs images with maps: one file stem per image.
//!
//! Trainers find the map of an image by the part of its name before the first dot; 2DGS without the
//! folders of the name, gsplat and nerfstudio with them. A name with more than one dot, or two
//! images with one stem, would be paired wrongly and are refused.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use ::priors::MAX_PIXELS;
use formats::colmap::{self, ColmapModel, ColmapPoint};

use super::config::{PriorsConfig, PriorsMode, PriorsTrainer};
use super::error::PriorsJobError;
use super::trainer::{self, ImageCrop};

/// Cameras as the dataset has them.
#[derive(Debug)]
pub(super) struct SceneCameras {
    /// Lenses in use, and poses in the frame of the cameras as read.
    pub(super) model: ColmapModel,
    /// Points of the structure from motion, added when the whole scene is trained.
    pub(super) points: Vec<ColmapPoint>,
    /// Name of the maps of each view.
    pub(super) stems: Vec<String>,
    /// Part of the image that is kept, per lens, where it is not the whole image.
    pub(super) crops: Vec<Option<ImageCrop>>,
    /// Folder or file that they were read from.
    pub(super) source: PathBuf,
}

impl SceneCameras {
    pub(super) fn read(config: &PriorsConfig) -> Result<Self, PriorsJobError> {
        let [path] = config.cameras.as_slice() else {
            return Err(PriorsJobError::CameraCount { count: config.cameras.len() });
        };
        let source = find(path)?;
        let (mut model, points) = load(config, &source)?;
        if model.views.is_empty() {
            return Err(PriorsJobError::NoImages { path: source });
        }
        let stems = stems(&model, config.trainer)?;
        let crops = prepare_lenses(config, &mut model)?;
        Ok(Self { model, points, stems, crops, source })
    }
}

/// Returns the folder of a COLMAP model or the file of a transforms.json, from a path that may be
/// above either.
fn find(path: &Path) -> Result<PathBuf, PriorsJobError> {
    if path.is_file() {
        return Ok(path.to_owned());
    }
    let has_cameras = |folder: &Path| ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file());
    let folders = [path.to_owned(), path.join("sparse/0"), path.join("sparse")];
    if let Some(folder) = folders.into_iter().find(|folder| has_cameras(folder)) {
        return Ok(folder);
    }
    let file = path.join("transforms.json");
    if file.is_file() {
        return Ok(file);
    }
    Err(PriorsJobError::NoCameras { path: path.to_owned() })
}

/// Returns the satellite images among the cameras: image files, or the images of a folder without
/// other cameras.
pub(super) fn satellite_images(paths: &[PathBuf]) -> Result<Option<Vec<PathBuf>>, PriorsJobError> {
    if let [folder] = paths
        && folder.is_dir()
    {
        if find(folder).is_ok() {
            return Ok(None);
        }
        let failed = |source| PriorsJobError::Unlisted { path: folder.clone(), source };
        let entries = fs::read_dir(folder).map_err(failed)?.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let mut images: Vec<PathBuf> = entries.into_iter().map(|e| e.path()).filter(|path| is_image(path)).collect();
        images.sort_unstable();
        return Ok(Some(images).filter(|images| !images.is_empty()));
    }
    if !paths.iter().any(|path| is_image(path)) {
        return Ok(None);
    }
    match paths.iter().find(|path| !is_image(path)) {
        Some(other) => Err(PriorsJobError::MixedCameras { path: other.clone() }),
        None => Ok(Some(paths.to_vec())),
    }
}

/// Returns whether the ending of a file is that of a satellite image.
fn is_image(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["tif", "tiff", "ntf", "nitf", "jp2", "img", "vrt"].contains(&ending.as_str())
}

fn load(config: &PriorsConfig, source: &Path) -> Result<(ColmapModel, Vec<ColmapPoint>), PriorsJobError> {
    if source.is_file() {
        let ending = source.extension().map(|e| e.to_string_lossy().to_lowercase());
        if ending.as_deref() != Some("json") {
            return Err(PriorsJobError::NotCameras { path: source.to_owned() });
        }
        return Ok((formats::transforms::read(source, config.image_size)?, Vec::new()));
    }
    let has_points = ["points3D.bin", "points3D.txt"].iter().any(|name| source.join(name).is_file());
    if config.mode == PriorsMode::BuildingEnhanced && !config.maps_only && has_points {
        return Ok(colmap::read_with_points(source)?);
    }
    Ok((colmap::read(source)?, Vec::new()))
}

/// Returns the stem of every view.
fn stems(model: &ColmapModel, trainer: PriorsTrainer) -> Result<Vec<String>, PriorsJobError> {
    let mut known: HashMap<String, &str> = HashMap::new();
    let mut stems = Vec::with_capacity(model.views.len());
    for view in &model.views {
        let stem = stem(&view.name, trainer)?;
        // File systems that ignore case would give both the same file.
        if let Some(other) = known.insert(stem.to_lowercase(), &view.name) {
            return Err(PriorsJobError::SameStem { first: shown(other), second: shown(&view.name) });
        }
        stems.push(stem);
    }
    Ok(stems)
}

/// Returns the name without ending, and for trainers that know no folders without these.
fn stem(name: &str, trainer: PriorsTrainer) -> Result<String, PriorsJobError> {
    let (folder, file) = name.rsplit_once('/').map_or((None, name), |(folder, file)| (Some(folder), file));
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    if stem.contains('.') {
        return Err(PriorsJobError::DotInName { name: shown(name) });
    }
    if stem.is_empty() || stem.len() > 200 || stem.chars().any(|c| c.is_control() || "<>:\"|?*\\".contains(c)) {
        return Err(PriorsJobError::BadName { name: shown(name) });
    }
    let Some(folder) = folder.filter(|_| trainer != PriorsTrainer::TwoDgs) else {
        return Ok(stem.to_owned());
    };
    let plain = |part: &str| !matches!(part, "" | "." | "..") && !part.chars().any(|c| c.is_control() || c == '\\');
    if !folder.split('/').all(plain) || folder.len() > 200 {
        return Err(PriorsJobError::BadName { name: shown(name) });
    }
    Ok(format!("{folder}/{stem}"))
}

/// Shortens a name for an error message.
fn shown(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Removes lenses that no view has, and changes the others so that the trainer can use them.
fn prepare_lenses(config: &PriorsConfig, model: &mut ColmapModel) -> Result<Vec<Option<ImageCrop>>, PriorsJobError> {
    let mut place = vec![None; model.lenses.len()];
    let (mut lenses, mut crops) = (Vec::new(), Vec::new());
    for view in &mut model.views {
        let lens = &model.lenses[view.lens];
        let slot = &mut place[view.lens];
        if slot.is_none() {
            let (width, height) = (lens.width(), lens.height());
            if width.saturating_mul(height) > MAX_PIXELS {
                return Err(PriorsJobError::TooLarge { name: shown(&view.name), width, height, limit: MAX_PIXELS });
            }
            let (lens, crop) = trainer::usable(config, lens)
                .map_err(|source| PriorsJobError::Lens { name: shown(&view.name), source })?;
            *slot = Some(lenses.len());
            lenses.push(lens);
            crops.push(crop);
        }
        view.lens = slot.unwrap_or_default();
    }
    model.lenses = lenses;
    Ok(crops)
}

#[cfg(test)]
mod tests {
    use super::{PriorsTrainer, stem};

    #[test]
    fn stems_pair_images_with_maps() {
        let flat = |name: &str| stem(name, PriorsTrainer::TwoDgs);
        assert_eq!(flat("uav_001.png").unwrap(), "uav_001");
        assert_eq!(flat("left/uav_001.JPG").unwrap(), "uav_001");
        assert_eq!(flat("train/r_0").unwrap(), "r_0");
        let nested = |name: &str| stem(name, PriorsTrainer::Gsplat);
        assert_eq!(nested("left/day/uav_001.JPG").unwrap(), "left/day/uav_001");
        for bad in ["../a.png", "/a.png", "x//a.png", "./a.png"] {
            assert!(nested(bad).is_err(), "{bad:?}");
        }
        for bad in ["a.b.png", "x/.png", "", "a\nb.png", "c:d.png", &"x".repeat(300)] {
            assert!(flat(bad).is_err() && nested(bad).is_err(), "{bad:?}");
        }
    }
}
