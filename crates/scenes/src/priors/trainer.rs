//! Lenses that trainers can use.
//!
//! The COLMAP readers of 3DGS and 2DGS take PINHOLE and SIMPLE_PINHOLE. 2DGS puts the principal
//! point into the middle of the image whatever the file states, so an image with another principal
//! point would be learned shifted. Cropping the image moves the middle to the principal point,
//! within a quarter of a pixel.

use std::path::Path;

use camera::{Lens, LensModel};
use serde::Serialize;

use super::config::{PriorsConfig, PriorsTrainer};
use super::error::LensFault;

/// Distance of a principal point from the middle below which it is left there, pixels.
const MIDDLE_PX: f64 = 0.5;

/// The part of an image that is kept, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ImageCrop {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

/// Returns the lens of the dataset for a lens that was read, and the crop that it needs.
pub(super) fn usable(config: &PriorsConfig, lens: &Lens) -> Result<(Lens, Option<ImageCrop>), LensFault> {
    if config.maps_only {
        return Ok((lens.clone(), None));
    }
    if !lens.model().is_pinhole() {
        return Err(LensFault::Distorted { model: lens.model().name() });
    }
    let centre = [lens.principal_point().sample, lens.principal_point().line];
    let size = [lens.width(), lens.height()];
    let off = [0, 1].map(|i| centre[i] - (size[i] as f64 - 1.0) / 2.0);
    if config.trainer == PriorsTrainer::Gsplat || off.iter().all(|o| o.abs() <= MIDDLE_PX) {
        return Ok((pinhole(lens, size, centre)?, None));
    }
    let [x, y] = off;
    if !config.recrop {
        return Err(LensFault::OffMiddle { x, y });
    }
    let cut = off.map(|o| (2.0 * o).round());
    let kept = [0, 1].map(|i| size[i] as f64 - cut[i].abs());
    if (0..2).any(|i| kept[i] < size[i] as f64 / 2.0) {
        return Err(LensFault::TooFarOff { x, y });
    }
    let (first, kept) = (cut.map(|c| c.max(0.0) as usize), kept.map(|k| k as usize));
    let crop = ImageCrop { x: first[0], y: first[1], width: kept[0], height: kept[1] };
    let centre = [0, 1].map(|i| centre[i] - first[i] as f64);
    Ok((pinhole(lens, kept, centre)?, Some(crop)))
}

fn pinhole(lens: &Lens, size: [usize; 2], centre: [f64; 2]) -> Result<Lens, LensFault> {
    let [fx, fy] = lens.focal_px();
    Ok(Lens::new(size[0], size[1], LensModel::Pinhole, &[fx, fy, centre[0], centre[1]])?)
}

/// Returns the command lines that train on a dataset, with the options that its files need.
pub(super) fn commands(config: &PriorsConfig, depth_png_step: f64) -> Vec<String> {
    if config.maps_only {
        return Vec::new();
    }
    let dataset = quoted(&config.output, "");
    let result = |suffix: &str| quoted(&config.output, suffix);
    let own = format!("skysweep train {dataset} -o {}", result("_trained"));
    let others = match config.trainer {
        // Without -r 1 pictures of more than 1,600 columns are reduced, and no longer fit the maps.
        PriorsTrainer::TwoDgs => vec![format!("python train.py -s {dataset} -m {} -r 1", result("_2dgs"))],
        PriorsTrainer::Gsplat => vec![
            format!(
                "python examples/simple_trainer_2dgs.py --data_dir {dataset} --data_factor 1 --result_dir {}",
                result("_gsplat")
            ),
            format!(
                "ns-train splatfacto --output-dir {} colmap --data {dataset} --colmap-path sparse/0 --images-path images \
                 --masks-path masks --depths-path depth_png --depth-unit-scale-factor {depth_png_step} --downscale-factor 1",
                result("_nerfstudio")
            ),
        ],
    };
    // The trainer of skysweep reads depths along the optical axis only.
    let readable = config.maps == ::priors::MapConfig::default();
    others.into_iter().chain(readable.then_some(own)).collect()
}

/// Returns a path with something added to its name, as a POSIX shell takes it.
fn quoted(path: &Path, suffix: &str) -> String {
    let text = path.components().as_path().display().to_string() + suffix;
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_quoted_where_a_shell_needs_it() {
        assert_eq!(quoted(Path::new("out/town/"), "_2dgs"), "out/town_2dgs");
        assert_eq!(quoted(Path::new("my town's"), ""), r"'my town'\''s'");
    }
}
