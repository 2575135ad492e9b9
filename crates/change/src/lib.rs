//! Change between two surface models of the same place: where it is significant, and its volume.
//!
//! Both surfaces lie on one grid, in metres above one vertical datum; NaN is a cell that was not
//! observed. A cell *decides* where it was observed on both dates, its heights are rather right
//! than wrong, and it lies clear of the borders of the surfaces. [`detect`] works in five steps:
//!
//! 1. The **difference** after − before, and its standard deviation from those of the surfaces.
//! 2. **Calibration**: the standardised differences of a scene that has mostly not changed must
//!    have a spread of at most 1. A larger one is a factor on all deviations.
//! 3. **Correlation**: how alike the errors of two cells are, by their distance, measured on the
//!    cells that do not stand out. The deviation of a regional mean follows from it, as in Hugonnet
//!    et al. (2022, <https://doi.org/10.1109/JSTARS.2022.3188922>).
//! 4. **Regions** of cells beyond the level of detection with one sign. Heights that the other
//!    surface has within the tolerance of position do not count as changed, so that walls do not.
//!    Most of a region must be observed on both dates, and most of that must decide.
//! 5. A **test** of each region's mean. The probability is multiplied by the number of connected
//!    shapes of its size that the scene holds (Bonferroni), so that all regions together contain an
//!    invented one with a probability of at most 1 − confidence.
//!
//! Volumes are sums of differences over cells. What walls reach beyond the real ones is taken off,
//! and the deviations hold the correlation of the errors and the uncertainty of the walls.

mod border;
mod config;
mod correlation;
mod detect;
mod error;
mod normal;
mod regions;
mod tolerance;
mod volume;
mod walls;

pub use config::ChangeConfig;
pub use correlation::ErrorCorrelation;
pub use detect::{Change, ChangeInput, ChangeRegion, detect};
pub use error::ChangeError;
pub use volume::{Volume, volume_of};
