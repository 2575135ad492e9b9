//! The page of a simulated scene: its true surface, its classes, and what was drawn for each view.

use std::path::Path;

use ::simulate::{SceneRecord, Truth, TruthClass};
use report::{JobPage, Legend, MapLayer};

use job::files::FileError;
use job::report_page;

/// Writes the page beside the record of a scene.
pub(crate) fn write(record_file: &Path, record: &SceneRecord, truth: &Truth) -> Result<(), FileError> {
    let value = serde_json::to_value(record)?;
    let lead = format!("{} views of {} buildings and {} trees.", record.views.len(), record.buildings, record.trees);
    let page = JobPage { layers: layers(record, truth), ..JobPage::of_report("Simulated scene", &lead, &value) };
    report_page::write_page(record_file, &page, record, true)
}

fn layers(record: &SceneRecord, truth: &Truth) -> Vec<MapLayer> {
    let classes = Legend::Codes(vec![
        (TruthClass::Ground as u8, [214, 200, 170], "ground"),
        (TruthClass::Vegetation as u8, [86, 150, 80], "vegetation"),
        (TruthClass::Building as u8, [200, 80, 60], "building"),
        (TruthClass::Water as u8, [86, 140, 200], "water"),
        (TruthClass::FootprintEdge as u8, [120, 110, 100], "edge of a building"),
    ]);
    let codes = truth.classes.map(|class| f32::from(*class));
    let cell_m = record.config.gsd_m;
    vec![
        report_page::relief_layer("Surface", "True heights of the upper surface, shaded.", &truth.dsm, cell_m),
        report_page::relief_layer("Ground", "True heights of the bare ground, shaded.", &truth.dtm, cell_m),
        report_page::legend_layer("Classes", "True classes of the cells.", &codes, classes),
    ]
}
