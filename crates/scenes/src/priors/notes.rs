//! Notes of the reports: what the user should know about a dataset.

use city::SurfaceClass;
use report::counted;

use super::config::PriorsMode;
use super::dataset::Dataset;

/// Returns the notes of a dataset for perspective cameras.
pub(super) fn notes(dataset: &Dataset<'_>) -> Vec<String> {
    let mut notes = Vec::new();
    let samples = dataset.samples;
    let area = |class| samples.skipped_m2.iter().find(|(known, _)| *known == class).map(|(_, area)| *area);
    if let Some(area) = area(SurfaceClass::Ground) {
        let share = 100.0 * area / (area + samples.area_m2);
        notes.push(format!(
            "Ground surfaces ({share:.0} % of the area) carry no points: they are the bottoms of buildings. \
             --class-weight ground=1 samples them."
        ));
    }
    if dataset.unusable > 0 {
        notes.push(unusable_note(dataset.unusable));
    }
    let visible = dataset.visible;
    if visible.points.is_empty() {
        let views = dataset.config.visibility.min_views;
        notes.push(format!("No point is seen by {}: the dataset has no points.", counted(views as usize, "view")));
    }
    let blind = visible.per_view.iter().filter(|view| view.visible == 0).count();
    if blind > 0 {
        let see = if blind == 1 { "view sees" } else { "views see" };
        notes.push(format!("{blind} {see} no point of a building."));
    }
    if let Some(by) = dataset.frame.moved_by() {
        notes.push(format!(
            "Cameras were moved by ({}, {}, {}) to lie around zero, where f32 keeps millimetres; origin.json has the way back.",
            -by[0], -by[1], -by[2]
        ));
    }
    if dataset.file.model.crs.is_missing() {
        notes.push("The model does not say what its reference system is.".to_owned());
    }
    if dataset.cameras.crops.iter().any(Option::is_some) {
        notes.push("Cameras were cropped: crop the images by crops.json before training.".to_owned());
    }
    let config = dataset.config;
    if config.mode == PriorsMode::BuildingEnhanced && dataset.cameras.points.is_empty() && !config.maps_only {
        notes
            .push("The cameras came without points of the scene: only buildings have points to begin with.".to_owned());
    }
    notes
}

/// Returns the note about objects that could not be used.
pub(super) fn unusable_note(unusable: usize) -> String {
    let objects = counted(unusable, "object");
    format!(
        "{objects} of the model could not be used; skysweep city info --report names {}.",
        if unusable == 1 { "it" } else { "them" }
    )
}
