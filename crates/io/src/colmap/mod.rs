//! COLMAP models: the cameras and poses of images, from text or binary files.
//!
//! [`read`] takes the folder of a model (`cameras` and `images`, `.bin` or `.txt`; binary wins where both are there) and keeps
//! what a renderer needs: lenses and poses; [`read_with_points`] adds the points and their tracks, [`write()`] is the way back.
//! Newer versions add `rigs` and `frames` and still write the pose of every image, which is what is read; they read models
//! without those files, so none are written. COLMAP's pixels have the centre of the upper-left one at (0.5, 0.5);
//! principal points and observations are moved between that and this toolkit's convention here.
//!
//! Counts in binary files are checked against the size of the file before anything is allocated. An image name that leads
//! out of its folder is refused.

mod binary;
mod points;
mod text;
mod write;

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

use camera::{Lens, LensError, LensModel, Pose};

pub use points::{ColmapObservation, ColmapPoint, read_with_points};
pub use write::{ColmapEncoding, write};

use crate::atomic::SaveError;

/// Files are read up to this size, bytes: images come with all their points.
const SIZE_LIMIT: u64 = 4 << 30;

/// Cameras with their poses.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapModel {
    /// The lenses.
    pub lenses: Vec<Lens>,
    /// The images, in the order of the file.
    pub views: Vec<ColmapView>,
}

/// An image of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapView {
    /// Number in the file.
    pub id: u32,
    /// Name relative to the folder of the images.
    pub name: String,
    /// Index of its lens in [`ColmapModel::lenses`].
    pub lens: usize,
    /// Where it was taken from.
    pub pose: Pose,
}

/// Why a COLMAP model was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColmapError {
    /// A file is not there.
    #[error("the folder holds neither {name}.bin nor {name}.txt: give the folder of a COLMAP model: {}", .folder.display())]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// Which file.
        name: &'static str,
    },
    /// A file cannot be read.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A file that breaks its format.
    #[error("{what} ({place}): {}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was found and expected.
        what: String,
        /// The line, or the byte.
        place: String,
    },
    /// A model that no file can hold.
    #[error("the model cannot be written ({what}): {}", .folder.display())]
    Inconsistent {
        /// The folder.
        folder: PathBuf,
        /// What does not fit.
        what: String,
    },
    /// A file was not written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

/// What is wrong and where, before the file is known.
#[derive(Debug)]
struct Fault {
    what: String,
    place: String,
}

/// A camera as it stands in a file.
#[derive(Debug)]
struct RawCamera {
    id: u32,
    model: LensModel,
    width: u64,
    height: u64,
    parameters: Vec<f64>,
    place: String,
}

/// An image as it stands in a file.
#[derive(Debug)]
struct RawImage {
    id: u32,
    quaternion: [f64; 4],
    translation: [f64; 3],
    camera: u32,
    name: String,
    /// Where its points are in COLMAP's pixels; empty where they are passed over.
    points: Vec<[f64; 2]>,
    place: String,
}

/// Per view where its points are, in COLMAP's pixels.
type PixelsOfViews = Vec<Vec<[f64; 2]>>;

/// Whether the points of images are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ImagePoints {
    Keep,
    PassOver,
}

/// Reads the model in a folder.
///
/// # Errors
/// A file that is missing, cannot be read or breaks its format; a camera with impossible numbers; an image without its camera,
/// with a pose that is none, or whose name leads out of its folder; two of either with one number.
pub fn read(folder: &Path) -> Result<ColmapModel, ColmapError> {
    Ok(read_views(folder, ImagePoints::PassOver)?.0)
}

/// The model, and per view where its points are.
fn read_views(folder: &Path, keep: ImagePoints) -> Result<(ColmapModel, PixelsOfViews), ColmapError> {
    let (cameras_path, cameras) = load(folder, "cameras", binary::cameras, text::cameras)?;
    let images = |bytes: &[u8]| binary::images(bytes, keep);
    let (images_path, images) = load(folder, "images", images, |text| text::images(text, keep))?;
    let (mut lenses, mut lens_of) = (Vec::with_capacity(cameras.len()), HashMap::new());
    for camera in cameras {
        let fault = |what: String| invalid(&cameras_path, Fault { what, place: camera.place.clone() });
        if lens_of.insert(camera.id, lenses.len()).is_some() {
            return Err(fault(format!("camera {} occurs a second time", camera.id)));
        }
        lenses.push(lens(&camera).map_err(|error| fault(error.to_string()))?);
    }
    let mut seen = std::collections::HashSet::new();
    let (mut views, mut points) = (Vec::with_capacity(images.len()), Vec::with_capacity(images.len()));
    for mut image in images {
        if !seen.insert(image.id) {
            let what = format!("image {} occurs a second time", image.id);
            return Err(invalid(&images_path, Fault { what, place: image.place }));
        }
        points.push(std::mem::take(&mut image.points));
        views.push(view(image, &lens_of).map_err(|fault| invalid(&images_path, fault))?);
    }
    Ok((ColmapModel { lenses, views }, points))
}

fn lens(camera: &RawCamera) -> Result<Lens, LensError> {
    let size = |pixels: u64| usize::try_from(pixels).unwrap_or(usize::MAX);
    let mut parameters = camera.parameters.clone();
    let count = parameters.len();
    if count == camera.model.parameter_count() {
        let first = principal_point_index(camera.model);
        parameters[first..first + 2].iter_mut().for_each(|c| *c -= 0.5);
    }
    Lens::new(size(camera.width), size(camera.height), camera.model, &parameters)
}

/// Where the principal point begins among the parameters: after one or two focal lengths.
fn principal_point_index(model: LensModel) -> usize {
    use LensModel::{Radial, RadialFisheye, SimplePinhole, SimpleRadial, SimpleRadialFisheye};
    match model {
        SimplePinhole | SimpleRadial | Radial | SimpleRadialFisheye | RadialFisheye => 1,
        _ => 2,
    }
}

fn view(image: RawImage, lens_of: &HashMap<u32, usize>) -> Result<ColmapView, Fault> {
    let RawImage { id, quaternion, translation, camera, name, place, .. } = image;
    if !is_inside(&name) {
        let what = format!("the image name {:?} is empty or leads out of its folder", shorten(&name));
        return Err(Fault { what, place });
    }
    let Some(&lens) = lens_of.get(&camera) else {
        return Err(Fault { what: format!("image {id} has camera {camera}, which is not in the model"), place });
    };
    match Pose::from_quaternion(quaternion, translation) {
        Some(pose) => Ok(ColmapView { id, name, lens, pose }),
        None => Err(Fault { what: format!("the pose of image {id} is not finite or has no rotation"), place }),
    }
}

/// Whether the name of an image stays in the folder of the images.
pub(crate) fn is_inside(name: &str) -> bool {
    let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    !name.is_empty() && inside && !name.contains(['\\', '\0'])
}

fn shorten(text: &str) -> String {
    text.chars().take(60).collect()
}

fn invalid(path: &Path, fault: Fault) -> ColmapError {
    ColmapError::Invalid { path: path.to_owned(), what: fault.what, place: fault.place }
}

fn load<T>(
    folder: &Path,
    name: &'static str,
    from_binary: impl Fn(&[u8]) -> Result<Vec<T>, Fault>,
    from_text: impl Fn(&str) -> Result<Vec<T>, Fault>,
) -> Result<(PathBuf, Vec<T>), ColmapError> {
    let [binary, text] = ["bin", "txt"].map(|extension| folder.join(format!("{name}.{extension}")));
    let path = [&binary, &text].into_iter().find(|path| path.is_file());
    let path = path.ok_or_else(|| ColmapError::Missing { folder: folder.to_owned(), name })?.clone();
    let unreadable = |source| ColmapError::Unreadable { path: path.clone(), source };
    let size = std::fs::metadata(&path).map_err(unreadable)?.len();
    if size > SIZE_LIMIT {
        let what = format!("the file has {size} bytes, up to {SIZE_LIMIT} are read");
        return Err(invalid(&path, Fault { what, place: "size".to_owned() }));
    }
    let bytes = std::fs::read(&path).map_err(unreadable)?;
    let parsed = if path == binary { from_binary(&bytes) } else { from_text(&String::from_utf8_lossy(&bytes)) };
    match parsed {
        Ok(parsed) => Ok((path, parsed)),
        Err(fault) => Err(invalid(&path, fault)),
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod write_tests;
