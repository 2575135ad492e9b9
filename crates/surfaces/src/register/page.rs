//! The page of a registration: the correction, and the residuals at their places in the image.

use report::{JobPage, JobTable, PointResidual, residual_map};

use super::report::RegisterReport;
use job::files::FileError;

/// Returns the page of a report.
pub(super) fn of(report: &RegisterReport) -> Result<JobPage, FileError> {
    let mut value = serde_json::to_value(report)?;
    // Shown as a map, and as a table.
    for shown in ["residuals_px", "images"] {
        value.as_object_mut().map(|fields| fields.remove(shown));
    }
    let name = report.images.first().map_or(String::new(), |image| image.path.display().to_string());
    let lead = format!("Pointing of {name}, corrected against an existing model.");
    let [sample, line] = report.shift_px;
    let mut page = JobPage {
        cards: vec![
            (format!("{sample:+.2}, {line:+.2} px"), "shift along the sample and the line"),
            (format!("{} of {}", report.agree, report.found), "of the points found agree"),
            (format!("{:.2} px", report.rms_px), "RMS of the residuals of those"),
        ],
        ..JobPage::of_report("Registration", &lead, &value)
    };
    let point =
        |&[sample, line, along, across]: &[f64; 4]| PointResidual { at: [sample, line], residual_px: [along, across] };
    let points: Vec<PointResidual> = report.residuals_px.iter().map(point).collect();
    page.plots = residual_map("Residuals", report.size, &points)
        .map(|(chart, magnification)| {
            let caption = format!("Points of the model, drawn {magnification} times as long as their residuals are.");
            (chart, "Residuals in the image".to_owned(), caption)
        })
        .into_iter()
        .collect();
    page.tables = vec![JobTable {
        title: "Images".to_owned(),
        heads: vec!["image".to_owned(), "correction".to_owned()],
        rows: report
            .images
            .iter()
            .enumerate()
            .map(|(i, image)| {
                let path = image.path.display().to_string();
                vec![path, if i == 0 { "found here" } else { "as the model has it" }.to_owned()]
            })
            .collect(),
    }];
    Ok(page)
}
