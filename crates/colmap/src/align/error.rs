//! Why positions determine no similarity.

/// Positions that determine no similarity.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignError {
    /// Fewer pairs than a similarity needs.
    #[error("{found} positions are known in both frames, a similarity needs at least {needed}")]
    TooFew {
        /// Number of pairs.
        found: usize,
        /// Least number of pairs.
        needed: usize,
    },
    /// A position that is NaN or infinite.
    #[error("pair {index} has a position that is not finite")]
    NotFinite {
        /// Index of the pair.
        index: usize,
    },
    /// Positions in one point or on one line, so that the rotation about the line is free.
    #[error(
        "the positions lie on a line (the ratio of their spread across it to that along it is {ratio:e}), so the rotation \
         about it is not determined: add positions beside it"
    )]
    Degenerate {
        /// Spread across the line over spread along it.
        ratio: f64,
    },
    /// No triple of pairs agrees with enough others.
    #[error("no similarity agrees with more than {inliers} of {pairs} pairs: do the positions belong to these images?")]
    NoConsensus {
        /// Largest number of pairs that agreed.
        inliers: usize,
        /// Number of pairs.
        pairs: usize,
    },
}
