//! Simulated acquisitions: a seeded town with its exact surface, seen through RPC cameras.
//!
//! A [`Scene`] is a height function (smooth terrain, buildings with flat and gabled roofs) that rays meet exactly. A
//! [`Simulation`] renders it through linear pushbroom cameras that are RPCs by construction, adds what a sensor adds (pixel
//! box, photon and read noise, 11 bits, a pointing error in the RPC) and samples the truth on a map grid. What an algorithm
//! gets wrong on it is the algorithm's error: geometry is exact to 0.1 mm.
//!
//! Scene frame: x east, y north in metres of the map grid from the scene's centre, z metres above the WGS 84 ellipsoid.

mod block;
mod config;
mod date;
mod error;
mod frame;
mod index;
mod noise;
mod parameters;
mod presets;
mod pushbroom;
mod random;
mod ray;
mod render;
mod scene;
mod sensor;
mod sight;
mod simulation;
mod terrain;
mod texture;
mod town;

pub use block::{Block, Roof};
pub use config::{
    AcquisitionConfig, BuildingsConfig, CameraModel, CloudsConfig, GroundCover, QuarterWeights, SensorConfig,
    SimulationConfig, SurfaceConfig, TerrainConfig, VegetationConfig, VehiclesConfig, ViewDirection,
};
pub use date::Date;
pub use error::SimulateError;
pub use frame::SceneFrame;
pub use presets::PRESETS;
pub use pushbroom::Look;
pub use ray::Ray;
pub use render::Sun;
pub use scene::{Scene, SurfaceClass};
pub use sensor::{DN_MAX, Sensor};
pub use sight::Sight;
pub use simulation::{SceneRecord, Simulation, Truth, View, ViewRecord};
pub use terrain::Terrain;
