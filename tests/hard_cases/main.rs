//! The hard cases of satellite stereo, with the result that a photogrammetrist expects of each.
//!
//! Shares are of the cells within 50 m of the scene's centre. *Right* means within 1 m of the true
//! surface. *Wrong* means off by more than 2 m, which is worse than void. The stage ([`stage`])
//! photographs a village through exact RPC cameras. No case is ignored or skipped. Each entry names
//! the case, its tests and the expectation.
//!
//! - none (`geometry::an_easy_village_…`): ≥ 95 % right, ≤ 3 % wrong, bias < 0.1 m, NMAD < 0.15 m
//! - zero baseline (`geometry::views_from_one_direction_…`): refused: no parallax, with the angle
//! - tiny baseline (1°) (`geometry::a_tiny_baseline_…`): heights within metres, σ says so, a
//!   warning names the angle
//! - identical images: one picture under two RPCs (`geometry::one_picture_under_two_rpcs_…`) is
//!   refused for want of parallax; an image and its copy (`dsm_command::copies_of_one_image_…`) as
//!   the same image given twice
//! - constant images (`radiometry::blank_images_…`, `one_blank_view_…`; `sweep:
//!   blank_and_missing_images_…`): refused, or the view set aside by name
//! - saturated image (`radiometry::a_saturated_roof_…`): right or void, the rest untouched
//! - no-data images (`radiometry::voids_in_a_view_…`, `where_all_views_are_void_…`): other views'
//!   heights; void where nobody sees, declared or not
//! - repetitive texture (`radiometry::repeated_texture_…`, `simulated::sheds_that_repeat_…`): not a
//!   period too high, with two views too
//! - striped roof (`radiometry::a_striped_roof_…`): ≥ 80 % right with two views
//! - low texture (`simulated::a_town_under_a_veil_…`): ≥ 85 % of the ground, ≥ 75 % of the roofs
//!   right
//! - water (`radiometry::glittering_water_…`, `simulated::a_harbour_…`): void or level; land
//!   untouched
//! - high-rise (`relief::a_tower_of_130_m_…`, `simulated::a_slim_tower_…`): ≥ 90 % (slim: 70 %) of
//!   the roof right, range found by itself
//! - steep slopes (`relief::steep_slopes_…`): ≥ 95 % right at up to 51°
//! - multi-date (`radiometry::four_dates_…`): ≥ 85 % right under other suns, contrast, cars and
//!   crops
//! - pointing off by 5 px (`geometry::pointing_errors_of_five_…`): as without, after a shift
//! - one view off by 40 px (`geometry::one_view_that_is_off_…`, `two_views_…`): recovered and named
//! - denominators zero inside the cube (`cameras::denominators_…` (3), `a_camera_that_fails_…`;
//!   `camera: a_model_with_a_pole_…`): the same DSM
//! - normalised coordinates ≫ 1 (`cameras::offsets_far_…`, `ground_far_outside_…`; `camera:
//!   points_far_outside_…`): the same DSM, refused beyond 8 half-widths
//! - heights far from HEIGHT_OFF (`cameras::heights_far_from_height_off_…`): the same DSM
//! - antimeridian (`geometry::the_antimeridian_…`; `camera`, `geodesy: …antimeridian…`): as
//!   elsewhere
//! - latitude 85° (`geometry::a_scene_at_85_degrees_…`; `geodesy: zones_follow_…`): as elsewhere,
//!   in EPSG:5041
//! - wrong inputs that look right (`evidence`): a negative, another scene, a mirrored or
//!   shifted RPC, other heights in the elevation model: named or refused
//! - unlike inputs (`inputs`): floats of any scale, a crop or strip, a quarter of the
//!   resolution: tie points where both see
//! - sliver of overlap (`geometry::a_sliver_…`): right in the sliver; refused with the share below
//!   5 %
//! - wrong height range (`relief::a_range_…` (3); `dsm_command::a_height_range_…`): refused when it
//!   misses, told when it cuts, no false heights, no cost when kilometres wide
//! - soft-argmin: equal, huge, infinite, NaN costs (`sweep: readout`, `cost::kernels`): no height,
//!   finite heights, a cost of 1
//! - f32 against f64 at 5e6 m (`sweep: fusion::mesh`): the same heights to 0.1 mm as at the origin
//! - two surfaces in a cell (`sweep: fusion::cells`): the better supported, the upper in a tie
//! - RPC files: coefficients missing or too many, NaN, zero scales, decimal comma (`io:
//!   rpc_hostile`, `camera: validation_names_the_entry`, `rpc_files`): an error that names entry
//!   and line
//! - view order, gain and offset, whole-pixel translation ([`invariance`]; `sweep: cost`): the same
//!   heights

mod cameras;
mod evidence;
mod geometry;
mod inputs;
mod invariance;
mod radiometry;
mod relief;
mod simulated;
mod stage;
