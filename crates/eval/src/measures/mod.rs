//! Measures of accuracy and completeness.

pub(super) mod breakdown;
pub(super) mod calibration;
pub(super) mod distance;
pub(super) mod distribution;
pub(super) mod edges;
pub(super) mod gradient;
pub(super) mod metrics;
pub(super) mod objects;
pub(super) mod origin;
pub(super) mod sharpness;
pub(super) mod standing;
pub(super) mod statistics;
pub(super) mod terrain;
