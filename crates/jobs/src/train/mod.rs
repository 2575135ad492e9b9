//! The training job: flat Gaussian splats learn from the images of a dataset, with the depth and
//! normal maps that the priors job writes where there are any.
//!
//! [`run`] writes a folder with these files:
//!
//! | file | content |
//! |---|---|
//! | `splats.ply` | the splats (2DGS), in the frame of the dataset; `splats.origin.json` beside |
//! | `renders/NAME.png` | the images that were not trained on, as the splats show them |
//! | `report.json` | settings, quality of every view, loss by iteration |
//! | `checkpoint.bin` | the state to go on from, until the training is done |

mod config;
mod dataset;
mod error;
mod initial;
mod report;
mod run;

pub use config::{TrainConfig, TrainPriors};
pub use error::TrainError;
pub use report::{LossPoint, TrainReport, TrainedViewRow};
pub use run::run;
