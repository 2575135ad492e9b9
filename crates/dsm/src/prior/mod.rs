//! City models as a prior of the height sweep.

pub(super) mod city_prior;
pub(super) mod prior_findings;
pub(super) mod prior_verdict;
pub(super) mod prior_view;
