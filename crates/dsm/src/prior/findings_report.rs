//! What a run tells of the buildings of a city model that it left out.

use std::path::PathBuf;

use reconstruct::PriorFindings;

use crate::notes::Notes;
use crate::report::{LeftOut, PriorReport};

/// Number of buildings that are named in the choice; the report names all.
const NAMED: usize = 3;

/// Reports the buildings that were left out, and why.
pub(crate) fn report_findings(findings: &PriorFindings, model: PathBuf, notes: &mut Notes<'_>) -> PriorReport {
    let left_out: Vec<LeftOut> = findings
        .buildings
        .values()
        .filter(|building| building.gone.views > 0)
        .map(|building| LeftOut {
            id: building.id.clone(),
            views: building.gone.views,
            of_views: building.gone.views + building.kept.views,
            agreeing_pixels: building.gone.agreeing_pixels,
            compared_pixels: building.gone.compared_pixels,
        })
        .collect();
    let names: Vec<&str> = left_out.iter().take(NAMED).map(|building| building.id.as_str()).collect();
    let more = if left_out.len() > NAMED { ", …" } else { "" };
    let value = match left_out.len() {
        0 if findings.disagreeing_views > 0 => format!(
            "none of {}; {} views agree with nothing of the model and do without",
            findings.buildings.len(),
            findings.disagreeing_views
        ),
        0 => format!("none of {}", findings.buildings.len()),
        count => format!("{count} of {}: {}{more}", findings.buildings.len(), names.join(", ")),
    };
    let reason = "the images alone show other heights there, or nothing where much of the model is wrong";
    notes.choose("buildings left out", value, reason);
    PriorReport {
        model,
        buildings_seen: findings.buildings.len(),
        disagreeing_views: findings.disagreeing_views,
        tolerance_m: f64::from(findings.tolerance_m),
        left_out,
    }
}
