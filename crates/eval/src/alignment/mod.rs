//! Co-registration of surfaces.

pub(super) mod align;
pub(super) mod blocks;
pub(super) mod cell_map;
pub(super) mod nuth_kaab;
pub(super) mod registration;
pub(super) mod resample;
pub(super) mod search;
pub(super) mod smooth;
