//! What a DSM run is asked for.

use std::path::PathBuf;

use crs::VerticalDatum;
use serde::{Deserialize, Serialize};
use sweep::LevelConfig;
use sweep::ranges::EDGE_REACH;

/// Speed against accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Half the images' resolution, in matching and in the DSM; two sources per view.
    Fast,
    /// The default.
    #[default]
    Balanced,
    /// Every useful source.
    Accurate,
}

/// Which voids are closed from what is known around them; closed cells are marked in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fill {
    /// None: what is written was observed.
    None,
    /// Narrow ones, those that a surface beside them hides, and those between known heights where the images show something.
    #[default]
    Justified,
    /// All within reach of known heights, whatever made them: water, saturated roofs, the border of what two views see.
    All,
}

/// A rectangle on the map: x_min, y_min, x_max, y_max.
pub type Bounds = [f64; 4];

/// A DSM run. Everything that is `None` is chosen from the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DsmConfig {
    /// The images, two or more.
    pub images: Vec<PathBuf>,
    /// The folder for the results.
    pub output: PathBuf,
    /// Cell size of the DSM, metres.
    pub gsd_m: Option<f64>,
    /// EPSG code of the horizontal CRS.
    pub crs_epsg: Option<u32>,
    /// The area, in the DSM's CRS.
    pub bounds: Option<Bounds>,
    /// Least and greatest height to search, metres above the ellipsoid.
    pub height_range_m: Option<(f64, f64)>,
    /// A coarse elevation model that tells the height range.
    pub dem: Option<PathBuf>,
    /// A city model that tells where roofs are expected.
    pub prior: Option<PathBuf>,
    /// What the DSM's heights are measured from.
    pub vertical: VerticalDatum,
    /// Speed against accuracy.
    pub preset: Preset,
    /// Which voids are closed.
    pub fill: Fill,
    /// The pairs of images to match, by position in `images`; all useful ones when `None`.
    pub pairs: Option<Vec<(usize, usize)>>,
    /// The images to compute heights for, by position; all when `None`.
    pub references: Option<Vec<usize>>,
    /// Whether the RPCs' pointing is corrected.
    pub pointing: bool,
    /// Worker threads; all cores when `None`.
    pub threads: Option<usize>,
    /// Memory to stay under, megabytes; 4000 when `None`. A scene that takes more is computed by chunks.
    pub memory_mb: Option<u64>,
    /// Side of the chunks that a scene is computed by, cells; as large as the memory allows when `None`.
    pub chunk: Option<usize>,
    /// Side of the output tiles that are fused at a time, cells.
    pub tile: usize,
    /// Whether existing results may be replaced.
    pub overwrite: bool,
}

impl DsmConfig {
    /// A run with every choice left to the program.
    pub fn new(images: Vec<PathBuf>, output: PathBuf) -> Self {
        Self {
            images,
            output,
            gsd_m: None,
            crs_epsg: None,
            bounds: None,
            height_range_m: None,
            dem: None,
            prior: None,
            vertical: VerticalDatum::Ellipsoid,
            preset: Preset::default(),
            fill: Fill::default(),
            pairs: None,
            references: None,
            pointing: true,
            threads: None,
            memory_mb: None,
            chunk: None,
            tile: 1024,
            overwrite: false,
        }
    }
}

/// The parameters that a preset stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tuning {
    /// Parallax between neighbouring hypotheses in the pair that sees most of it, pixels.
    pub(crate) step_px: f64,
    /// The finest pyramid level whose heights are computed.
    pub(crate) finest_level: usize,
    /// Sources per view, at most.
    pub(crate) sources: usize,
    /// How far around a coarse pixel the next level takes over heights to search, coarse pixels.
    pub(crate) reach: usize,
    /// Cost, penalties and read-out.
    pub(crate) level: LevelConfig,
}

impl Preset {
    /// Side of a cell that is not asked for, in pixels of the coarsest image: that of the pixels that are matched.
    pub(crate) fn pixels_per_cell(self) -> f64 {
        f64::from(1u32 << self.tuning().finest_level)
    }

    pub(crate) fn tuning(self) -> Tuning {
        let (finest_level, sources, reach) = match self {
            Self::Fast => (1, 2, EDGE_REACH),
            Self::Balanced => (0, 4, EDGE_REACH),
            Self::Accurate => (0, 8, 2 * EDGE_REACH),
        };
        Tuning { step_px: 0.5, finest_level, sources, reach, level: LevelConfig::default() }
    }
}
