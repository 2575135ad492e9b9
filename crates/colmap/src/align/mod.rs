//! Camera models brought to the world: the similarity between positions known in both, robust against outliers.
//!
//! - [`fit_similarity`] is the least-squares similarity of pairs (Umeyama 1991).
//! - [`align`] finds it among outliers: RANSAC on triples, then the fit to what agrees, again until nothing changes.
//! - [`sensitivity`] says what noise in the positions or in the heading does to the alignment.
//!
//! Positions are f64 in any unit; the world's are metres from a local origin.

mod noise;
mod robust;
mod umeyama;

pub use noise::{Disturbance, MeanStd, NoiseConfig, NoiseLevel, disturbed, sensitivity};
pub use robust::{AlignConfig, Alignment, align};
pub use umeyama::{PointPair, fit_similarity, spread_ratio};

/// Why positions do not tell a similarity.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignError {
    /// Fewer pairs than a similarity needs.
    #[error("{found} positions are known in both frames, a similarity needs at least {needed}")]
    TooFew {
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// A position that is NaN or infinite.
    #[error("pair {index} has a position that is not finite")]
    NotFinite {
        /// Index of the pair.
        index: usize,
    },
    /// Positions in one point or on one line: the turn about it is free.
    #[error(
        "the positions lie on a line (their spread across it is {ratio:e} of that along it), so the turn about it is not determined: \
         add positions beside it"
    )]
    Degenerate {
        /// Spread across over spread along.
        ratio: f64,
    },
    /// No triple of pairs agrees with enough others.
    #[error("no similarity agrees with more than {inliers} of {pairs} pairs: are the positions those of these images?")]
    NoConsensus {
        /// The most that agreed.
        inliers: usize,
        /// How many pairs there are.
        pairs: usize,
    },
}
