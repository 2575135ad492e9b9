//! A geometric index of buildings in one image, after GeoSay (Xia et al. 2018).
//!
//! Buildings have corners. From the corners of an image follows where its buildings are:
//!
//! 1. **Junctions**: where two straight edges meet in an L, each as long as it is unlikely to come
//!    about by chance (anisotropic-scale junctions, Xue et al. 2018).
//! 2. **First-order saliency**: a junction speaks for the parallelogram between its branches, more
//!    if its angle is near a right one, and within the areas of buildings.
//! 3. **Second-order saliency**: more still if edges close the parallelogram, and if another
//!    junction is one of its other corners.
//! 4. **Shadows**: the sun's direction follows from the image. Shapes that are dark behind, and
//!    lit pixels with a shadow behind them, are more salient.
//! 5. **Index**: the saliencies that cover a pixel add up to `s`. Shadows, which have corners too,
//!    are attenuated by the black top-hat `b` of the image: `s' = s exp(−b / contrast)`. The index
//!    is `s' / (s' + half)`, 0 to 1.
//!
//! Lengths are metres on the ground; pixels follow from the ground sampling distance. The result
//! is the same for any number of threads. It fails where roofs are as dark as their shadows, where
//! their edges have no contrast, and on what has the corners and the size of a building without
//! being one, such as sports grounds and parking lots.

mod chance;
mod config;
mod error;
mod gradient;
mod index;
mod junctions;
mod shadow;
mod shapes;
mod sunlight;

pub use config::BuildingIndexConfig;
pub use error::BuildingIndexError;
pub use index::{BuildingIndex, building_index};
