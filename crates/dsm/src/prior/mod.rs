//! City models as a prior of the height sweep.

pub(super) mod city_prior;
pub(super) mod findings_report;
