//! The priors job: depth, normal and mask priors of a city model for the cameras of a scene.
//!
//! Perspective cameras give a dataset for Gaussian splatting trainers: the points that enough
//! cameras see (COLMAP's `sparse/0` as text and binary, `points3D.ply`), per image the depth, the
//! normals, the mask, the surface class and the object, flat Gaussians to begin with, and a report.
//! Everything stays in the frame of the cameras; `origin.json` describes how the model lies in it.
//! Satellite images give maps in the pixels of each image.
//!
//! The folder is made beside its place and moved there when it is complete.

mod cameras;
mod config;
mod dataset;
mod error;
mod folder;
mod frame;
mod images;
mod labels;
mod made;
mod maps;
mod model;
mod notes;
mod outcome;
mod perspective;
mod points;
mod previews;
mod satellite;
mod size;
mod trainer;

pub(crate) use labels::with_table;

pub use config::{PriorsClassWeight, PriorsConfig, PriorsImages, PriorsMiss, PriorsMode, PriorsTrainer};
pub use outcome::{PriorsJobReport, PriorsProduct};
pub use trainer::ImageCrop;

use numeric::Progress;

use error::PriorsJobError;
use job::error::JobError;
use job::threads::install;

/// Makes the priors of a city model for perspective cameras or satellite images.
///
/// # Errors
/// [`JobError`]: an input that cannot be used, no building in any image, an output that
/// exists.
///
/// ```
/// use scenes::priors::{PriorsConfig, run};
/// let town = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
/// let folder = tempfile::tempdir()?;
/// let images = vec![town.join("view_1.tif")];
/// let model = town.join("truth/buildings.city.json");
/// let mut config = PriorsConfig::new(model, images, folder.path().join("priors"));
/// config.previews = 0;
/// let report = run(&config, &numeric::Silent)?;
/// assert!(config.output.join("height/view_1.tif").is_file() && report.unusable_objects == 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &PriorsConfig, progress: &dyn Progress) -> Result<PriorsJobReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &PriorsConfig, progress: &dyn Progress) -> Result<PriorsJobReport, PriorsJobError> {
    config.validate()?;
    install(config.threads, || match cameras::satellite_images(&config.cameras)? {
        Some(images) => satellite::make(config, &images, progress),
        None => perspective::make(config, progress),
    })?
}
