//! The parameters of the sweep that a preset stands for.

use serde::{Deserialize, Serialize};
use sweep::aggregation::Penalties;
use sweep::ranges::{EDGE_REACH, Reach};

/// Trade-off of speed and accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Half the resolution of the images in matching and in the DSM, and two sources per view.
    Fast,
    /// Full resolution, up to four sources per view, and two lattices of pixels.
    #[default]
    Balanced,
    /// Full resolution, up to eight sources per view, four lattices of pixels, and sharper edges of
    /// roofs.
    Accurate,
}

impl Preset {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("fast", Self::Fast, "half the resolution in matching and in the DSM, two sources per view"),
        ("balanced", Self::Balanced, "full resolution, up to four sources per view, matched on two lattices of pixels"),
        (
            "accurate",
            Self::Accurate,
            "full resolution, up to eight sources per view, matched on four lattices of pixels",
        ),
    ];
}

/// Parameters of the sweep. The remaining ones are the same for all presets: the defaults of
/// [`sweep::LevelConfig`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SweepTuning {
    /// Parallax between neighbouring hypotheses in the pair with the most parallax per metre,
    /// pixels.
    pub step_px: f64,
    /// Finest pyramid level whose heights are computed; 0 is the full resolution.
    pub finest_level: usize,
    /// Largest number of hypotheses on the coarsest level: the height range is at most this many
    /// of its steps.
    pub top_hypotheses: f64,
    /// Largest number of sources per view.
    pub sources: usize,
    /// Distance around a coarse pixel from which the next finer level takes over heights to search,
    /// coarse pixels.
    pub reach: usize,
    /// The same for lower heights, which begin farther away where streets are narrow, coarse
    /// pixels.
    pub reach_below: usize,
    /// Number of lattices of pixels on which the finest level is swept, at most four.
    pub lattices: usize,
    /// Penalty of a height jump across the strongest image edges on the finest level, of 112 for
    /// the worst cost.
    pub jump_at_edge: u8,
}

/// A search of the full range by this many hypotheses is cheap on a level of a quarter of the
/// pixels, which still has several pixels per building and a few per tree. With half as many
/// hypotheses that level would be coarser by one, and lose small trees and narrow streets.
const TOP_HYPOTHESES: f64 = 128.0;

/// Reach of the search for the ground below roofs. A street that a level loses is a pixel or two of
/// it wide, and the ground is known again across the houses beside it. Twice the reach found no
/// more on two dense quarters.
const GROUND_REACH: usize = 8;

/// Places of the lattices of pixels between the pixels of an image, columns and rows, beside the
/// image's own, the farthest from it first. Four more between these changed little on five scenes
/// and took half as long again.
const LATTICES_PX: [[f64; 2]; 3] = [[0.5, 0.5], [0.5, 0.0], [0.0, 0.5]];

impl Preset {
    /// Returns the side of a cell where none is given, in pixels of the coarsest image: that of the
    /// pixels matched.
    pub fn pixels_per_cell(self) -> f64 {
        f64::from(1u32 << self.tuning().finest_level)
    }

    /// Returns the parameters of the preset.
    pub fn tuning(self) -> SweepTuning {
        let usual = Penalties::default().jump_at_edge;
        let balanced = SweepTuning {
            step_px: 0.5,
            finest_level: 0,
            top_hypotheses: TOP_HYPOTHESES,
            sources: 4,
            reach: EDGE_REACH,
            reach_below: GROUND_REACH,
            lattices: 2,
            jump_at_edge: usual,
        };
        match self {
            Self::Fast => SweepTuning {
                finest_level: 1,
                top_hypotheses: TOP_HYPOTHESES / 2.0,
                sources: 2,
                lattices: 1,
                reach_below: GROUND_REACH / 2,
                ..balanced
            },
            Self::Balanced => balanced,
            // Roofs end at image edges. Cheaper jumps there bring lower errors and fewer heights. A
            // wider search upwards takes the ground of narrow streets for roofs.
            Self::Accurate => SweepTuning { sources: 8, lattices: 4, jump_at_edge: usual / 2, ..balanced },
        }
    }
}

impl SweepTuning {
    /// Returns the lattices of pixels beside the images' own, pixels of the finest level.
    pub fn lattices_px(&self) -> &'static [[f64; 2]] {
        &LATTICES_PX[..self.lattices.clamp(1, LATTICES_PX.len() + 1) - 1]
    }

    /// Returns from where heights to search are taken over.
    pub fn reaches(&self) -> Reach {
        Reach { above: self.reach, below: self.reach_below.max(self.reach) }
    }
}
