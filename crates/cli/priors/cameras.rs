//! The cameras of a scene, checked for what pairs images with maps: one file stem per image.
//!
//! Trainers find the map of an image by the part of its name before the first dot, folders left out. A name with more than one
//! dot, or two images with one stem, would be paired wrongly and are refused.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use ::priors::{MAX_PIXELS, View};
use anyhow::{Context, bail};
use io::colmap::{self, ColmapModel, ColmapPoint};

use super::frame::Frame;
use super::options::{Args, Mode};
use super::trainer::{self, Crop};

/// Cameras as the dataset has them.
#[derive(Debug)]
pub(super) struct Cameras {
    /// Lenses in use, and poses in the frame of the cameras as read.
    pub(super) model: ColmapModel,
    /// Points of the structure from motion, taken along when the whole scene is trained.
    pub(super) points: Vec<ColmapPoint>,
    /// Per view the name of its maps.
    pub(super) stems: Vec<String>,
    /// Per lens the part of its image that is kept, where it is not the whole.
    pub(super) crops: Vec<Option<Crop>>,
    /// Where they were read.
    pub(super) source: PathBuf,
}

impl Cameras {
    pub(super) fn read(args: &Args) -> anyhow::Result<Self> {
        let [path] = args.cameras.as_slice() else {
            bail!(
                "{} cameras are named, expected satellite images, or one COLMAP folder or transforms.json",
                args.cameras.len()
            );
        };
        let source = find(path)?;
        let (mut model, points) = load(args, &source)?;
        if model.views.is_empty() {
            bail!("the cameras have no image: {}", source.display());
        }
        let stems = stems(&model)?;
        let crops = prepare_lenses(args, &mut model)?;
        Ok(Self { model, points, stems, crops, source })
    }

    /// The views in the frame of the mesh.
    pub(super) fn views(&self, frame: &Frame) -> Vec<View> {
        let view = |v: &colmap::ColmapView| View {
            lens: self.model.lenses[v.lens].clone(),
            pose: frame.mesh_from_camera().move_pose(&v.pose),
        };
        self.model.views.iter().map(view).collect()
    }
}

/// The folder of a COLMAP model or the file of a transforms.json, from a path that may be above either.
fn find(path: &Path) -> anyhow::Result<PathBuf> {
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
    bail!(
        "found no cameras: expected cameras.bin or cameras.txt of a COLMAP model, sparse/0 with them, transforms.json, or satellite \
         images: {}",
        path.display()
    )
}

/// The satellite images among what `--cameras` names: image files, or those in a folder without other cameras.
pub(super) fn satellite_images(paths: &[PathBuf]) -> anyhow::Result<Option<Vec<PathBuf>>> {
    if let [folder] = paths
        && folder.is_dir()
    {
        if find(folder).is_ok() {
            return Ok(None);
        }
        let failed = || format!("cannot read the folder: {}", folder.display());
        let entries = fs::read_dir(folder).with_context(failed)?.collect::<Result<Vec<_>, _>>().with_context(failed)?;
        let mut images: Vec<PathBuf> = entries.into_iter().map(|e| e.path()).filter(|path| is_image(path)).collect();
        images.sort_unstable();
        return Ok(Some(images).filter(|images| !images.is_empty()));
    }
    if !paths.iter().any(|path| is_image(path)) {
        return Ok(None);
    }
    match paths.iter().find(|path| !is_image(path)) {
        Some(other) => bail!("among satellite images there is something else: {}", other.display()),
        None => Ok(Some(paths.to_vec())),
    }
}

/// Whether a file is a satellite image by its ending.
fn is_image(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["tif", "tiff", "ntf", "nitf", "jp2", "img", "vrt"].contains(&ending.as_str())
}

fn load(args: &Args, source: &Path) -> anyhow::Result<(ColmapModel, Vec<ColmapPoint>)> {
    if source.is_file() {
        let ending = source.extension().map(|e| e.to_string_lossy().to_lowercase());
        if ending.as_deref() != Some("json") {
            bail!(
                "cameras are read from a COLMAP folder or a transforms.json, found another file: {}",
                source.display()
            );
        }
        let size = args.image_size.as_ref().and_then(|size| <[usize; 2]>::try_from(size.as_slice()).ok());
        return Ok((io::transforms::read(source, size)?, Vec::new()));
    }
    let has_points = ["points3D.bin", "points3D.txt"].iter().any(|name| source.join(name).is_file());
    if args.mode == Mode::BuildingEnhanced && !args.maps_only && has_points {
        return Ok(colmap::read_with_points(source)?);
    }
    Ok((colmap::read(source)?, Vec::new()))
}

/// The stem of every view.
fn stems(model: &ColmapModel) -> anyhow::Result<Vec<String>> {
    let mut known: HashMap<String, &str> = HashMap::new();
    let mut stems = Vec::with_capacity(model.views.len());
    for view in &model.views {
        let stem = stem(&view.name)?;
        // Where upper and lower case are one, so are their files.
        if let Some(other) = known.insert(stem.to_lowercase(), &view.name) {
            bail!(
                "two images have the same file stem, by which trainers pair them with their maps: {:?} and {:?}",
                shown(other),
                shown(&view.name)
            );
        }
        stems.push(stem);
    }
    Ok(stems)
}

fn stem(name: &str) -> anyhow::Result<String> {
    let file = name.rsplit('/').next().unwrap_or(name);
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    if stem.contains('.') {
        bail!(
            "the image name {:?} has a dot before its ending: trainers cut it there and pair it with the maps of another image; rename it",
            shown(name)
        );
    }
    if stem.is_empty() || stem.len() > 200 || stem.chars().any(|c| c.is_control() || "<>:\"|?*\\".contains(c)) {
        bail!("the image name {:?} gives no file name for its maps: rename it", shown(name));
    }
    Ok(stem.to_owned())
}

pub(super) fn shown(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Leaves out lenses that no view has, and makes the others such as the trainer can use.
fn prepare_lenses(args: &Args, model: &mut ColmapModel) -> anyhow::Result<Vec<Option<Crop>>> {
    let mut place = vec![None; model.lenses.len()];
    let (mut lenses, mut crops) = (Vec::new(), Vec::new());
    for view in &mut model.views {
        let lens = &model.lenses[view.lens];
        let slot = &mut place[view.lens];
        if slot.is_none() {
            if lens.width().saturating_mul(lens.height()) > MAX_PIXELS {
                bail!(
                    "the image {:?} has {} × {} pixels, up to {MAX_PIXELS} are rendered",
                    shown(&view.name),
                    lens.width(),
                    lens.height()
                );
            }
            let (lens, crop) = trainer::usable(args, lens)
                .with_context(|| format!("the camera of the image {:?} cannot be used", shown(&view.name)))?;
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
    use super::stem;

    #[test]
    fn stems_pair_images_with_maps() {
        assert_eq!(stem("uav_001.png").unwrap(), "uav_001");
        assert_eq!(stem("left/uav_001.JPG").unwrap(), "uav_001");
        assert_eq!(stem("train/r_0").unwrap(), "r_0");
        for bad in ["a.b.png", "x/.png", "", "a\nb.png", "c:d.png", &"x".repeat(300)] {
            assert!(stem(bad).is_err(), "{bad:?}");
        }
    }
}
