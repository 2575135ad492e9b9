//! Masks of single images: clouds, their shadows, and what else must not be matched.
//!
//! A raster mask covers the whole image, at the resolution of the image or a coarser one. What is
//! neither 0 nor without data is masked. Polygons on the ground are seen at the mean height of the
//! image's RPC.

use std::path::{Path, PathBuf};

use camera::ImagePoint;
use formats::areas::AreaName;
use formats::raster::ImageSource;
use geodesy::LonLatHeight;
use raster::{Grid, Window, mark_inside};
use reconstruct::footprint;

use crate::error::{DsmError, DsmSetting};
use crate::images::scene_image::SceneImage;
use crate::masks::ground_polygons::{ground_around, holds_polygons, read_polygons, rings_in_cells};
use crate::notes::Notes;

/// Largest difference of the scales of a mask along columns and rows, as a share: one pixel of a
/// mask of a hundred.
const SCALE_DIFFERENCE: f64 = 0.01;
/// Positions on a side of the lattice on which the share of masked pixels is estimated.
const PROBES: usize = 48;
/// An image with more than this share of masked pixels may have a mask the other way round.
const NEARLY_ALL: f64 = 0.95;

/// Returns the masks of each image: those whose names begin with the name of its file. Among images
/// of the same name, the one in the mask's folder is meant.
///
/// # Errors
/// [`DsmError::Value`] for a mask that belongs to no image, or to several.
pub(crate) fn masks_of_images(masks: &[PathBuf], images: &[PathBuf]) -> Result<Vec<Vec<PathBuf>>, DsmError> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut out = vec![Vec::new(); images.len()];
    for mask in masks {
        let name = stem(mask);
        // "view_10_clouds" belongs to "view_10" and not to "view_1".
        let is_named =
            |own: &str| name.strip_prefix(own).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()));
        let named = || images.iter().enumerate().filter(|(_, image)| is_named(&stem(image)));
        let longest = named().map(|(_, image)| stem(image).len()).max();
        let mut owners: Vec<usize> =
            named().filter(|(_, image)| Some(stem(image).len()) == longest).map(|(i, _)| i).collect();
        if owners.len() > 1 {
            owners.retain(|i| images[*i].parent() == mask.parent());
        }
        let [owner] = owners.as_slice() else {
            let found =
                format!("a mask of {} images: {}", if longest.is_some() { "several" } else { "no" }, mask.display());
            let expected = "a name that begins with that of its image, as in view_1_clouds.tif for view_1.tif";
            return Err(DsmError::value(DsmSetting::ImageMasks, found, expected));
        };
        out[*owner].push(mask.clone());
    }
    Ok(out)
}

/// Sets the masked pixels of a window of an image to NaN.
///
/// # Errors
/// [`DsmError::Value`] for a raster of another shape than the image; [`DsmError::Area`],
/// [`DsmError::Image`], [`DsmError::Crs`], [`DsmError::Camera`].
pub(crate) fn void_masked(image: &SceneImage, window: Window, pixels: &mut Grid<f32>) -> Result<(), DsmError> {
    if image.masks.is_empty() {
        return Ok(());
    }
    let masked = Places { window, size: (window.width, window.height) }.masked(image)?;
    pixels.void_where(|i| masked.data()[i]);
    Ok(())
}

/// Notes the share of the masked pixels of each image.
///
/// # Errors
/// As [`void_masked`].
pub(crate) fn note_masks(images: &[SceneImage], notes: &mut Notes<'_>) -> Result<(), DsmError> {
    let mut shares = Vec::new();
    for image in images.iter().filter(|image| !image.masks.is_empty()) {
        let (share, name) = (masked_share(image)?, image.path.display());
        shares.push(format!("{name} {:.0} %", 100.0 * share));
        if share > NEARLY_ALL {
            notes.warn(format!(
                "the masks leave hardly a pixel of this image; what is neither 0 nor without data is masked: {name}"
            ));
        }
    }
    if !shares.is_empty() {
        notes.choose("masked pixels", shares.join(", "), "given");
    }
    Ok(())
}

/// Returns the share of an image's pixels that its masks void, 0 to 1, from a lattice of pixels.
fn masked_share(image: &SceneImage) -> Result<f64, DsmError> {
    let masked = Places { window: image.whole(), size: (PROBES, PROBES) }.masked(image)?;
    Ok(masked.data().iter().filter(|masked| **masked).count() as f64 / masked.data().len() as f64)
}

/// Places on a regular lattice over a window of an image.
#[derive(Clone, Copy)]
struct Places {
    window: Window,
    /// Columns and rows of the lattice.
    size: (usize, usize),
}

impl Places {
    /// Returns the distance of two places along columns and rows, pixels.
    fn spacing(&self) -> (f64, f64) {
        (self.window.width as f64 / self.size.0 as f64, self.window.height as f64 / self.size.1 as f64)
    }

    /// Returns the pixel of the image at a place.
    fn pixel(&self, column: usize, row: usize) -> (f64, f64) {
        let spacing = self.spacing();
        let at = |start: i64, i: usize, spacing: f64| start as f64 + (i as f64 + 0.5) * spacing - 0.5;
        (at(self.window.x, column, spacing.0), at(self.window.y, row, spacing.1))
    }

    /// Returns the place at a pixel of the image.
    fn place(&self, pixel: ImagePoint) -> (f64, f64) {
        let spacing = self.spacing();
        let at = |start: i64, v: f64, spacing: f64| (v - start as f64 + 0.5) / spacing - 0.5;
        (at(self.window.x, pixel.sample, spacing.0), at(self.window.y, pixel.line, spacing.1))
    }

    fn masked(&self, image: &SceneImage) -> Result<Grid<bool>, DsmError> {
        let mut out = Grid::filled(self.size.0, self.size.1, false);
        for mask in &image.masks {
            match holds_polygons(mask) {
                true => self.mark_polygons(mask, image, &mut out)?,
                false => self.mark_raster(mask, image, &mut out)?,
            }
        }
        Ok(out)
    }

    fn mark_raster(&self, mask: &Path, image: &SceneImage, out: &mut Grid<bool>) -> Result<(), DsmError> {
        let source = ImageSource::open(mask)?;
        let (width, height) = (source.info().width, source.info().height);
        let scale = (width as f64 / image.size.0 as f64, height as f64 / image.size.1 as f64);
        // The size of a coarse mask is rounded to a pixel.
        let rounding = 1.0 / width.min(height) as f64;
        if (scale.0 / scale.1 - 1.0).abs() > SCALE_DIFFERENCE.max(rounding) {
            let found = format!("a mask of {width} × {height} pixels: {}", mask.display());
            let expected = format!("the shape of its image, {} × {} pixels or fewer", image.size.0, image.size.1);
            return Err(DsmError::value(DsmSetting::ImageMasks, found, expected));
        }
        let at = |pixel: f64, scale: f64, size: usize| (((pixel + 0.5) * scale) as i64).clamp(0, size as i64 - 1);
        let column = |u: usize| at(self.pixel(u, 0).0, scale.0, width);
        let (first, last) = (column(0), column(self.size.0 - 1));
        let mut read = None;
        for v in 0..self.size.1 {
            let y = at(self.pixel(0, v).1, scale.1, height);
            let samples = match read.take().filter(|(row, _)| *row == y) {
                Some((_, samples)) => samples,
                None => {
                    source.read_samples(1, Window { x: first, y, width: (last - first + 1) as usize, height: 1 })?
                }
            };
            for (u, masked) in out.row_mut(v).iter_mut().enumerate() {
                let sample = samples[((column(u) - first) as usize, 0)];
                *masked |= sample.is_finite() && sample != 0.0;
            }
            read = Some((y, samples));
        }
        Ok(())
    }

    fn mark_polygons(&self, mask: &Path, image: &SceneImage, out: &mut Grid<bool>) -> Result<(), DsmError> {
        let height_m = image.camera.rpc.height_off;
        let failed = |source| DsmError::Camera { path: image.path.clone(), source };
        let outline = footprint(&image.camera, image.size, height_m).map_err(failed)?;
        let around = ground_around(outline.iter().map(|g| (g.lon_deg, g.lat_deg)));
        let place = |c: geo::Coord<f64>| {
            let seen = image.camera.project(LonLatHeight::new(c.x, c.y, height_m)).ok()?;
            Some(self.place(seen))
        };
        for rings in rings_in_cells(read_polygons(mask, AreaName::ALL, around)?, place) {
            mark_inside(&rings, out);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn owners(mask: &str, images: &[&str]) -> Result<Vec<usize>, String> {
        let images: Vec<PathBuf> = images.iter().map(PathBuf::from).collect();
        let found = masks_of_images(&[mask.into()], &images).map_err(|e| e.to_string())?;
        Ok(found.iter().enumerate().filter(|(_, masks)| !masks.is_empty()).map(|(i, _)| i).collect())
    }

    #[test]
    fn masks_belong_to_the_images_that_they_are_named_after() {
        let images = ["a/view_1.tif", "a/view_10.tif", "a/view.tif"];
        for (mask, owner) in [
            ("masks/view_1.tif", 0),
            ("masks/view_1_clouds.geojson", 0),
            ("view_10-cloud.tif", 1),
            ("view.mask.tif", 2),
        ] {
            assert_eq!(owners(mask, &images), Ok(vec![owner]), "{mask}");
        }
        assert_eq!(owners("b/p_mask.tif", &["a/p.tif", "b/p.tif"]), Ok(vec![1]));
        assert!(owners("clouds.tif", &images).unwrap_err().contains("a mask of no images: clouds.tif"));
        assert!(owners("c/p_mask.tif", &["a/p.tif", "b/p.tif"]).unwrap_err().contains("several images"));
    }
}
