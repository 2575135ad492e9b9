//! Simulated acquisitions: seeded scenes with their exact surface, seen through RPC cameras.
//!
//! A [`Scene`] is terrain with buildings, trees and vehicles, and rays meet it analytically. A
//! [`Simulation`] renders it through physical cameras (pushbroom or frame) to which RPCs are
//! fitted. It adds shadows, clouds, point spread, noise, quantisation and a pointing error of the
//! RPC. It also samples the truth: surface, terrain, classes, visibility in each view, the height
//! of every pixel, the scene from above, the building in each cell, and the buildings as an LoD2
//! model.
//!
//! [`SimulationConfig`] is a parameter file with named presets ([`PRESETS`]). The same
//! configuration gives the same bytes for any number of threads.
//!
//! Scene frame: x east, y north in metres of the map grid from the scene's centre, z metres above
//! the WGS 84 ellipsoid.
//!
//! ```
//! use simulate::{Simulation, SimulationConfig};
//!
//! let config = SimulationConfig { size_m: 64.0, views: 2, ..SimulationConfig::preset("town")? };
//! let scene = Simulation::new(config)?;
//! assert_eq!(scene.views.len(), 2);
//! assert_eq!(scene.truth.dsm.width(), 128);
//! # Ok::<(), simulate::SimulateError>(())
//! ```

mod config;
mod error;
#[cfg(test)]
mod fixtures;
mod parameters;
mod preset_names;
mod presets;
mod random;
mod simulation;
mod surface;
mod truth;
mod views;

pub use config::{
    AcquisitionConfig, AppearanceConfig, BuildingsConfig, CameraModel, CloudsConfig, CrownForm, GroundCover,
    LookAngles, MultispectralConfig, QuarterWeights, SensorConfig, SimulationConfig, TerrainConfig, VegetationConfig,
    VehiclesConfig,
};
pub use error::SimulateError;
pub use preset_names::PRESETS;
pub use simulation::{SceneRecord, SimulatedView, Simulation, ViewRecord};
pub use surface::building::Building;
pub use surface::frame::SceneFrame;
pub use surface::prism::{BuildingBlock, Roof};
pub use surface::ray::SceneRay;
pub use surface::scene::{Scene, TREE_NUMBER, TruthClass};
pub use surface::terrain::Terrain;
pub use truth::{ORTHO_SCALE, Truth};
pub use views::camera_model::Look;
pub use views::date::Date;
pub use views::exact_view::{ExactPart, ExactView};
pub use views::flight::{ExactPoint, Flight, FlightPoint};
pub use views::seasons::{Season, SeasonsConfig};
pub use views::sensor::Sensor;
pub use views::sight::SightLines;
pub use views::spectral_image::{SPECTRAL_BANDS, SpectralBand, SpectralImage};
pub use views::sun::Sun;
