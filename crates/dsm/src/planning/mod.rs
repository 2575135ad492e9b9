//! Grid, height range, levels, sources and chunks of a run.

pub(super) mod chunk_plan;
pub(super) mod chunk_side;
pub(super) mod dem;
pub(super) mod grid;
pub(super) mod height_choice;
pub(super) mod plan;
pub(super) mod plan_check;
pub(super) mod sources;
pub(super) mod step_notes;
