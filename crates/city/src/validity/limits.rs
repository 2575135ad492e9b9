//! Tolerances and limits of the checks.

/// Surfaces nearer than this touch, metres.
pub(super) const SHELL_TOLERANCE_M: f64 = 5e-6;
/// Overlap below which solids are neighbours, metres.
///
/// Coordinates rounded to millimetres make neighbours overlap by less.
pub(super) const OVERLAP_M: f64 = 1e-3;
/// Limit of the comparisons of triangles for one shell, the shells of one solid, the solids of one
/// geometry, and the solids of one building.
pub(super) const MAX_COMPARISONS: usize = 30_000_000;
