//! The names that most programs need: `use skysweep::prelude::*`.
//!
//! A version that changes or removes one of these names, or a field of one of these
//! configurations, raises the second number of the version (the first one from 1.0 on) and says so
//! in the changelog. Configurations and reports may gain fields. The crates behind them may change
//! in any version.
//!
//! Jobs are modules with a function `run`, as in [`dsm::run`]:
//! ```
//! use skysweep::prelude::*;
//!
//! let images = ["view_1", "view_3"].map(|name| format!("data-samples/town/{name}.tif").into());
//! let mut config = DsmConfig::new(images.into(), "out".into());
//! config.preset = Preset::Fast;
//! assert!(config.validate().is_ok());
//! // let report = dsm::run(&config, &Silent)?;
//! ```

pub use camera::{ImagePoint, Rpc, RpcCamera};
pub use crs::VerticalDatum;
pub use formats::raster::{Dem, read_dem};
pub use formats::rpc::read as read_rpc;
pub use geodesy::LonLatHeight;
pub use numeric::{CancelFlag, Cancellable, Progress, Silent};
pub use raster::{GeoTransform, Grid};

pub use jobs::{
    align, batch, buildings, city, classes, diff, dsm, dtm, eval, groundview, heightmap, mesh, ortho, priors,
    production, products, register, rpc, simulate, splats, split, tiles, train,
};

pub use jobs::batch::{BatchConfig, BatchReport, read_batch};
pub use jobs::classes::{ClassesConfig, ClassesReport};
pub use jobs::diff::{DiffConfig, DiffReport};
pub use jobs::dsm::{DsmConfig, DsmReport, Fill, Preset};
pub use jobs::dtm::{DtmConfig, DtmReport};
pub use jobs::eval::{GridEvalConfig, GridEvalReport, compare_grids};
pub use jobs::heightmap::{HeightMapConfig, HeightMapReport};
pub use jobs::ortho::{OrthoConfig, OrthoReport};
pub use jobs::priors::{PriorsConfig, PriorsJobReport};
pub use jobs::products::{ProductKind, ProductsConfig, ProductsReport};
pub use jobs::register::{RegisterConfig, RegisterReport};
pub use jobs::train::{TrainConfig, TrainReport};
