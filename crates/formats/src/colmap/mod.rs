//! COLMAP models: cameras, poses, points and tracks, from and to text or binary files.
//!
//! [`read`] takes the folder of a model: `cameras` and `images`, each as `.bin` or `.txt`. It reads
//! the binary file where both are there, and keeps what a renderer needs: the lenses and the poses.
//! [`read_with_points`] adds the points (`points3D`) and their tracks. [`write()`] writes all three
//! files.
//!
//! Newer versions of COLMAP add `rigs` and `frames`. They still write the pose of every image,
//! which this module reads. They also read models without those files, so this module writes none.
//!
//! COLMAP puts the centre of the upper-left pixel at (0.5, 0.5), this toolkit puts it at (0, 0).
//! Principal points and observations are converted here.
//!
//! Counts in binary files are checked against the size of the file before anything is allocated. An
//! image name that leads out of the folder of the images is refused.

mod binary;
mod convention;
mod files;
mod model;
mod points;
mod raw;
mod read;
mod text;
mod write;

pub use model::{ColmapModel, ColmapObservation, ColmapPoint, ColmapView};
pub use points::read_with_points;
pub use read::read;
pub use write::{ColmapEncoding, write};

pub(crate) use convention::is_inside;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod write_tests;
