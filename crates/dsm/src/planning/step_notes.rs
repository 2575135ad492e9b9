//! What a run tells of the height step and the pyramid levels of its sweep.

use reconstruct::{HeightRange, SweepLevels, SweepTuning, height_step_m};

use crate::notes::Notes;

/// Notes the choice of [`height_step_m`].
pub(crate) fn note_step(widest: f64, tuning: &SweepTuning, notes: &mut Notes<'_>) {
    notes.choose(
        "height step",
        format!("{:.3} m", height_step_m(widest, tuning)),
        format!("{} px of parallax in the pair that sees most of it ({widest:.3} px/m)", tuning.step_px),
    );
}

/// Notes the choice of [`choose_levels`].
pub(crate) fn note_levels(levels: SweepLevels, range: HeightRange, step_m: f64, notes: &mut Notes<'_>) {
    let hypotheses = range.span_m() / (step_m * f64::from(1u32 << levels.coarsest));
    notes.choose(
        "pyramid",
        format!("{} levels", levels.count()),
        format!("{hypotheses:.0} hypotheses over the whole range on the coarsest"),
    );
}
