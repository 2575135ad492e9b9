//! Classes of the cells of a surface model: ground, building, vegetation.
//!
//! What stands above the ground is a building where it is made of planes, and vegetation where it
//! is rough:
//!
//! 1. A cell **stands** if the surface is more than the least height above the ground.
//! 2. The **roughness** of a cell is the least residual of a plane in any window that holds the
//!    cell and whose cells all stand. A roof is smooth up to its edge and its ridge, because one of
//!    the windows lies on one plane; a crown is rough in all of them.
//! 3. Planes grow over what rises above the ground. Where the area of the planes around a cell over
//!    their residual is that of a sphere as narrow as a crown, the surface is a **crown** that
//!    matching has smoothed, and no roof.
//! 4. Other smooth cells that touch and cover the area of a shed are **buildings**. Rough cells
//!    within a wall's ramp of them belong to them, and so do their planes down to where they come
//!    near the ground. Weak cells bound no building. A building has walls on all sides except one;
//!    steep ground has none.
//! 5. What else stands is **vegetation** if it is wide enough for a shrub, and belongs to its
//!    surroundings otherwise.
//!
//! A vegetation index of near-infrared light overrules the roughness where it is given, unless its
//! pixels are wider than the cells; what is rough and not green at all is no vegetation. Plants on
//! the ground are low vegetation. Crowns that the surface lacks are vegetation where the index is
//! green above uncertain heights. A building index, made of an image, decides only where heights
//! are weak: cells that were not observed, or whose height or roughness lies near its threshold.
//! Heights are in metres, NaN is a void. Values are the ASPRS LAS classes.

mod classify;
mod config;
mod error;
mod greenness;
mod planes;
mod regions;
mod roofs;
mod roughness;
mod walls;

pub use classify::{
    BUILDING, BuildingCue, Classes, ClassifyInput, CrownCue, GROUND, LOW_VEGETATION, UNKNOWN, VEGETATION, WATER,
    classify,
};
pub use config::ClassifyConfig;
pub use error::ClassifyError;
pub use greenness::{SpectralCells, black_level, nir_gain, vegetation_index};
