//! Satellite surface models from RPC images, and building priors from city models.
//!
//! [`prelude`] has the names that most programs need, and a promise of how they change. Below it
//! this crate is a facade: it re-exports the crates of the toolkit under one name. Each crate holds
//! one subject and documents its units, frames and sources; it may change in any version.
//!
//! # Jobs
//! [`jobs`] is what most programs need. Every job is a function from a configuration to a report,
//! and the command `skysweep` is a thin caller of these functions.
//!
//! | module | makes |
//! |---|---|
//! | [`jobs::dsm`] | a digital surface model (DSM) from satellite images with RPCs |
//! | [`jobs::dtm`] | the bare ground under a surface model, and heights above it |
//! | [`jobs::products`] | point clouds and what else people open beside a surface model |
//! | [`jobs::eval`] | errors of a surface model against a reference |
//! | [`jobs::buildings`] | an index of buildings in one image |
//! | [`jobs::classes`] | ground, buildings and vegetation of a surface model |
//! | [`jobs::diff`] | changes between two surface models, with volumes |
//! | [`jobs::register`] | the pointing of a new image, corrected against a surface model or splats |
//! | [`jobs::production`], [`jobs::batch`] | surface models in parts and in several processes; many scenes and tasks |
//! | [`jobs::tiles`] | training tiles around cameras |
//! | [`jobs::view`] | a local page that shows the rasters of a run |
//! | [`jobs::ortho`] | true orthophotos, with hidden cells marked |
//! | [`jobs::heightmap`] | bird's-eye height maps around a camera |
//! | [`jobs::groundview`] | depths, normals and sky of cameras on the ground |
//! | [`jobs::priors`] | depth, normal and mask maps of a city model for the cameras of a scene |
//! | [`jobs::splats`] | Gaussian splats of a surface model and its images |
//! | [`jobs::mesh`] | a mesh of trained splats or of depth maps |
//! | [`jobs::train`] | splats that learn from the images of a dataset, with building priors |
//! | [`jobs::align`], [`jobs::split`] | COLMAP models brought to the world, context and target views |
//! | [`jobs::city`], [`jobs::rpc`] | what city models and RPC files hold, and conversions of both |
//! | [`jobs::simulate`] | scenes with exact truth, seen through RPC cameras |
//!
//! # Building blocks
//! - Positions: [`geodesy`] (ellipsoid, local frames, UTM), [`crs`] (map projections and vertical
//!   datums through PROJ).
//! - Cameras: [`camera`] (the RPC00B model and perspective lenses), [`colmap`] (sets of posed
//!   cameras).
//! - Surfaces: [`raster`] (grids), [`city`] (city models), [`gaussian`] (splats), [`bvh`] (ray
//!   casting), [`occlusion`].
//! - Methods: [`sweep`] (the height sweep), [`reconstruct`] (from views in memory to a surface),
//!   [`eval`], [`priors`], [`heightmap`], [`groundview`], [`ortho`], [`splats`], [`terrain`],
//!   [`train`], [`tsdf`], [`change`], [`classes`], [`buildings`], [`simulate`].
//! - Files: [`formats`] reads and writes rasters, cameras, points and splats, [`cityfiles`] city
//!   models and meshes, and [`report`] makes pictures and pages.
//! - [`numeric`] has progress and cancellation, seeded random numbers and order statistics.
//!
//! # Example
//! A camera's ground sampling distance, from the RPC that an image carries:
//! ```
//! use skysweep::{camera::RpcCamera, formats, geodesy::LonLatHeight};
//!
//! let image = concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town/view_1.tif");
//! let camera = RpcCamera::new(formats::rpc::read(image.as_ref())?.rpc);
//! let centre = camera.rpc.domain().centre;
//! let pixel = camera.project(LonLatHeight { height_m: 100.0, ..centre })?;
//! assert!((camera.gsd_at(pixel, 100.0)?.mean_m() - 0.5).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod prelude;

pub use buildings;
pub use bvh;
pub use camera;
pub use change;
pub use city;
pub use cityfiles;
pub use classes;
pub use colmap;
pub use crs;
pub use eval;
pub use formats;
pub use gaussian;
pub use geodesy;
pub use groundview;
pub use heightmap;
pub use jobs;
pub use numeric;
pub use occlusion;
pub use ortho;
pub use priors;
pub use raster;
pub use reconstruct;
pub use report;
pub use simulate;
pub use splats;
pub use sweep;
pub use terrain;
pub use train;
pub use tsdf;
