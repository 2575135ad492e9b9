//! Satellite splats: the Gaussians G = {μ, S, R, C, α} of a surface model and its images
//! (SkySplat), as few as an error bound allows.
//!
//! - [`SplatSurface`] gives the cells of a surface model positions in metres from a local origin
//!   (map axes: easting, northing, height).
//! - [`divide`] cuts the surface into rectangular blocks of cells. A block becomes one splat when
//!   every height in it is within a bound of its plane, its colours are within a bound of their
//!   mean, and its Gaussian does not hang over lower ground beside it. A flat roof becomes a few
//!   dozen blocks, a tree many.
//! - [`splat_of_block`] makes the Gaussian: centre on the plane, tangents along the block, normal
//!   of the plane.
//! - Walls stand where the crate `occlusion` puts them between the cells: upright splats between
//!   the upper and the lower surface, with the colours of the oblique images that see them.
//! - [`render`] composites splats front to back through any [`SplatCamera`]: RPC, perspective, or
//!   straight from above. Splats of one surface are mixed, whichever of them is in front.
//!   [`render_labels`] makes the map of the labels that splats have.
//! - [`fit_colours`] finds the colours that render back to the images, robustly and over all views
//!   that see a splat.
//! - [`make_splats`] does all of this and measures the result. [`picture_splats`] does it for a
//!   picture on the grid of the surface.

mod affine;
mod block;
mod camera;
mod central;
mod colour;
mod division;
mod facade;
mod gaussian;
mod graded;
mod hits;
mod multi_scale;
mod overhang;
mod pass;
mod picture;
mod quality;
mod render;
mod scene;
mod sight;
mod surface;
mod wall_light;
mod walls;

pub use block::{Plane, SplatBlock};
pub use camera::{AffineCamera, LensSplatCamera, MapSplatCamera, Projection, RayModel, RpcSplatCamera, SplatCamera};
pub use colour::{ColourFit, FitView, fit_colours};
pub use division::{DivisionConfig, divide, uniform};
pub use gaussian::{GaussianConfig, splat_of_block};
pub use multi_scale::ms_ssim;
pub use picture::{picture_splats, stretched};
pub use quality::{HeightErrors, height_errors, psnr_db, ssim};
pub use render::{Rendering, render, render_labels};
pub use scene::{CurvePoint, SplatConfig, SplatError, SplatReport, SplatScene, SplatView, ViewReport, make_splats};
pub use sight::{visible_cells, visible_pixels};
pub use surface::SplatSurface;
