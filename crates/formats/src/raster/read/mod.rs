//! Images and surface models read through GDAL.

pub(super) mod acquired;
pub(super) mod band_colour;
pub(super) mod colour;
pub(super) mod dem;
pub(super) mod luma;
pub(super) mod luma_rule;
pub(super) mod on_map;
pub(super) mod reduced;
pub(super) mod source;
pub(super) mod spectral;
pub(super) mod undeclared;
pub(super) mod vertical_unit;
