//! Lenses and poses from a folder.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use camera::{Lens, LensError, Pose};

use super::convention::{PIXEL_SHIFT, is_inside, principal_point_index, shorten};
use super::files::load;
use super::model::{ColmapModel, ColmapView};
use super::raw::{ImagePoints, RawCamera, RawImage};
use super::{binary, text};
use crate::camera_file::Fault;
use crate::format_error::FormatError;

/// Reads the lenses and poses of the model in a folder.
///
/// # Errors
/// [`FormatError`] when `cameras` or `images` is not there, the system cannot read a file, a file
/// breaks its format, a lens is impossible, an image has no camera or no finite pose, an image name
/// leads out of its folder, or an identifier occurs twice.
///
/// # Examples
/// ```
/// let folder = tempfile::tempdir()?;
/// std::fs::write(folder.path().join("cameras.txt"), "1 PINHOLE 640 480 500 500 320 240\n")?;
/// std::fs::write(folder.path().join("images.txt"), "1 1 0 0 0 -10 -20 -30 1 a.png\n\n")?;
/// let model = formats::colmap::read(folder.path())?;
/// assert_eq!(model.views[0].name, "a.png");
/// assert_eq!(model.views[0].pose.centre, [10.0, 20.0, 30.0]);
/// // The centre of the upper-left pixel is (0, 0).
/// assert_eq!(model.lenses[0].principal_point().sample, 319.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(folder: &Path) -> Result<ColmapModel, FormatError> {
    Ok(read_views(folder, ImagePoints::Skip)?.0)
}

/// Pixels of the points of one view, in COLMAP's convention.
pub(super) type ViewPixels = Vec<[f64; 2]>;

/// Reads the model, and the pixels of the points of each view.
pub(super) fn read_views(folder: &Path, keep: ImagePoints) -> Result<(ColmapModel, Vec<ViewPixels>), FormatError> {
    let (cameras_path, cameras) = load(folder, "cameras", binary::cameras, text::cameras)?;
    let images = |bytes: &[u8]| binary::images(bytes, keep);
    let (images_path, images) = load(folder, "images", images, |text| text::images(text, keep))?;
    let (mut lenses, mut lens_of) = (Vec::with_capacity(cameras.len()), HashMap::new());
    for camera in cameras {
        let fault = |what: String| Fault { what, place: camera.place.clone() }.at(&cameras_path);
        if lens_of.insert(camera.id, lenses.len()).is_some() {
            return Err(fault(format!("camera {} occurs a second time", camera.id)));
        }
        lenses.push(lens(&camera).map_err(|error| fault(error.to_string()))?);
    }
    let mut seen = HashSet::new();
    let (mut views, mut points) = (Vec::with_capacity(images.len()), Vec::with_capacity(images.len()));
    for mut image in images {
        if !seen.insert(image.id) {
            let what = format!("image {} occurs a second time", image.id);
            return Err(Fault { what, place: image.place }.at(&images_path));
        }
        points.push(std::mem::take(&mut image.points));
        views.push(view(image, &lens_of).map_err(|fault| fault.at(&images_path))?);
    }
    Ok((ColmapModel { lenses, views }, points))
}

fn lens(camera: &RawCamera) -> Result<Lens, LensError> {
    let size = |pixels: u64| usize::try_from(pixels).unwrap_or(usize::MAX);
    let mut parameters = camera.parameters.clone();
    if parameters.len() == camera.model.parameter_count() {
        let first = principal_point_index(camera.model);
        parameters[first..first + 2].iter_mut().for_each(|c| *c -= PIXEL_SHIFT);
    }
    Lens::new(size(camera.width), size(camera.height), camera.model, &parameters)
}

fn view(image: RawImage, lens_of: &HashMap<u32, usize>) -> Result<ColmapView, Fault> {
    let RawImage { id, quaternion, translation, camera, name, place, .. } = image;
    if !is_inside(&name) {
        let what = format!("the image name {:?} is empty or leads out of its folder", shorten(&name));
        return Err(Fault { what, place });
    }
    let Some(&lens) = lens_of.get(&camera) else {
        return Err(Fault { what: format!("image {id} names camera {camera}, which the model does not have"), place });
    };
    match Pose::from_quaternion(quaternion, translation) {
        Some(pose) => Ok(ColmapView { id, name, lens, pose }),
        None => Err(Fault { what: format!("the pose of image {id} is not finite or has a zero quaternion"), place }),
    }
}
