//! City models as a prior of the height sweep.

pub(super) mod findings;
pub(super) mod verdict;
pub(super) mod view_prior;
