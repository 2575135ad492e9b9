//! The training jobs. [`run`]: flat Gaussian splats learn from the images of a dataset, with the
//! depth and normal maps that the priors job writes where there are any.
//!
//! [`run_on_images`]: the splats of a surface model learn from satellite images.
//!
//! Both write a folder with these files:
//!
//! | file | content |
//! |---|---|
//! | `splats.ply` | the splats (2DGS), in the frame of the dataset; `splats.origin.json` beside |
//! | `renders/NAME.png` | the images that were not trained on, as the splats show them |
//! | `report.json`, `report.html` | settings, quality of every view, loss by iteration |
//! | `checkpoint.bin` | the state to go on from, until the training is done |
//! | `dsm.tif` | heights of the splats that learned from satellite images, on the grid of the model |

mod checkpoint;
mod config;
mod course;
mod dataset;
mod error;
mod exposure;
mod held_out;
mod initial;
mod iterate;
mod page;
mod picture;
mod place;
mod recipe;
mod report;
mod results;
mod run;
mod satellite;
mod satellite_run;
mod transforms;
mod transients;

pub(crate) use place::DatasetPlace;

pub use config::{CHECKPOINT_EVERY, PriorSchedule, TrainConfig, TrainPriors};
pub(crate) use error::TrainError;
pub use recipe::{TrainNumbers, TrainPreset, TrainSchedule, TrainSteps, TrainWeights};
pub use report::{LossPoint, TrainReport, TrainedViewRow};
pub use run::run;
pub use satellite_run::{SatelliteTrainConfig, SatelliteTrainReport, run_on_images};
