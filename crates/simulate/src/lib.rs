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

mod acquisition;
mod building;
mod camera_model;
mod clouds;
mod config;
mod crown;
mod date;
mod error;
mod exact_view;
#[cfg(test)]
mod fixtures;
mod flight;
mod frame;
mod index;
#[cfg(test)]
mod linear;
mod lod2;
mod natural_crown;
mod noise;
mod parameters;
mod planting;
mod preset_names;
mod presets;
mod prism;
mod random;
mod ray;
mod render;
mod scene;
mod seasons;
mod sensor;
mod sight;
mod simulation;
mod spectral_image;
mod spectrum;
mod streets;
mod sun;
mod terrain;
mod texture;
mod town;
mod tree;
mod truth;

pub use building::Building;
pub use camera_model::Look;
pub use config::{
    AcquisitionConfig, AppearanceConfig, BuildingsConfig, CameraModel, CloudsConfig, CrownForm, GroundCover,
    LookAngles, MultispectralConfig, QuarterWeights, SensorConfig, SimulationConfig, TerrainConfig, VegetationConfig,
    VehiclesConfig,
};
pub use date::Date;
pub use error::SimulateError;
pub use exact_view::{ExactPart, ExactView};
pub use flight::{ExactPoint, Flight, FlightPoint};
pub use frame::SceneFrame;
pub use preset_names::PRESETS;
pub use prism::{BuildingBlock, Roof};
pub use ray::SceneRay;
pub use scene::{Scene, TREE_NUMBER, TruthClass};
pub use seasons::{Season, SeasonsConfig};
pub use sensor::Sensor;
pub use sight::SightLines;
pub use simulation::{SceneRecord, SimulatedView, Simulation, ViewRecord};
pub use spectral_image::{SPECTRAL_BANDS, SpectralBand, SpectralImage};
pub use sun::Sun;
pub use terrain::Terrain;
pub use truth::{ORTHO_SCALE, Truth};
