//! The findings of an evaluation as a table for people and as JSON for programs. Both carry the protocol.

use std::fmt::Write;

use eval::{Alignment, EvalConfig, Evaluation, Metrics};
use serde_json::{Map, Value, json};

use super::Args;
use super::inputs::Inputs;

/// All that is told.
pub(super) struct Run<'a> {
    pub(super) args: &'a Args,
    pub(super) config: &'a EvalConfig,
    pub(super) inputs: &'a Inputs,
    pub(super) found: &'a Evaluation,
    /// The requirements that are not met.
    pub(super) missed: &'a [String],
}

impl Run<'_> {
    /// The protocol, then one row per metric with one column per set of cells.
    pub(super) fn table(&self) -> String {
        let mut lines = self.protocol();
        lines.push(String::new());
        lines.extend(self.metric_lines());
        lines.extend(self.inputs.notes.iter().map(|note| format!("note: {note}")));
        lines.join("\n") + "\n"
    }

    fn protocol(&self) -> Vec<String> {
        let (reference, found) = (&self.inputs.reference, self.found);
        let (cell_x, cell_y) = self.inputs.metres_from_cells.cell_size_m();
        let (width, height) = (reference.heights.width(), reference.heights.height());
        let shift = found.shift;
        let mut lines = vec![
            format!("test       {}", self.args.test.display()),
            format!("reference  {}", self.args.reference.display()),
            format!("grid       {width} x {height} cells of {cell_x:.4} x {cell_y:.4} m, {}; bilinear", self.crs()),
            format!("heights    above: {}", self.inputs.vertical),
            format!("alignment  {}", self.alignment()),
            format!(
                "shift      dx {:+.3} m, dy {:+.3} m, dz {:+.3} m (added to test)",
                shift.dx_m, shift.dy_m, shift.dz_m
            ),
        ];
        if let Some(path) = &self.args.classes {
            let skip: Vec<String> = self.config.skip.iter().map(i32::to_string).collect();
            let skipped = if skip.is_empty() { "none".to_owned() } else { skip.join(", ") };
            lines.push(format!("classes    {}; skipped: {skipped} ({} cells)", path.display(), found.skipped_cells));
        }
        lines
    }

    fn alignment(&self) -> String {
        match (self.config.alignment, self.found.search) {
            (Alignment::Xyz, Some(search)) => {
                format!("xyz: least NMAD of all translations within {} m, then the median", search.radius_m)
            }
            (Alignment::Z, _) => "z: the median".into(),
            _ => "none".into(),
        }
    }

    fn crs(&self) -> String {
        match (self.inputs.reference.horizontal_epsg, &self.inputs.reference.crs_wkt) {
            (Some(code), _) => format!("EPSG:{code}"),
            (None, Some(_)) => "a coordinate system without an EPSG code".into(),
            (None, None) => "no coordinate system".into(),
        }
    }

    fn metric_lines(&self) -> Vec<String> {
        let mut columns = vec![("all".to_owned(), self.found.overall.named())];
        columns.extend(self.found.classes.iter().map(|c| (class_title(c.class), c.metrics.named())));
        let mut lines = vec![row("metric", columns.iter().map(|(title, _)| title.clone()))];
        for (i, (name, _)) in self.found.overall.named().iter().enumerate() {
            let value = |(_, metrics): &(String, Vec<(String, Option<f64>)>)| {
                metrics.get(i).map_or_else(String::new, |(name, value)| cell(name, *value))
            };
            lines.push(row(&label(name), columns.iter().map(value)));
        }
        lines
    }

    /// The same for programs.
    pub(super) fn json(&self) -> anyhow::Result<String> {
        let (inputs, found) = (self.inputs, self.found);
        let (cell_x, cell_y) = inputs.metres_from_cells.cell_size_m();
        let classes: Map<String, Value> =
            found.classes.iter().map(|c| (c.class.to_string(), metrics_json(&c.metrics))).collect();
        let value = json!({
            "test": self.args.test.display().to_string(),
            "reference": self.args.reference.display().to_string(),
            "protocol": {
                "alignment": self.config.alignment,
                "shift_sign": "added to test",
                "search": found.search,
                "grid": {
                    "columns": inputs.reference.heights.width(),
                    "rows": inputs.reference.heights.height(),
                    "cell_m": [cell_x, cell_y],
                    "horizontal_epsg": inputs.reference.horizontal_epsg,
                },
                "resampling": "bilinear",
                "vertical": inputs.vertical,
                "class_raster": self.args.classes.as_ref().map(|path| path.display().to_string()),
                "skipped_classes": self.config.skip,
                "skipped_cells": found.skipped_cells,
            },
            "shift": found.shift,
            "metrics": metrics_json(&found.overall),
            "classes": classes,
            "notes": inputs.notes,
            "requirements_missed": self.missed,
        });
        Ok(serde_json::to_string_pretty(&value)? + "\n")
    }
}

/// Metrics by name; numbers of cells are whole, what cannot be computed is null.
fn metrics_json(metrics: &Metrics) -> Value {
    let value = |name: &str, value: Option<f64>| match value {
        Some(count) if is_count(name) => json!(count as u64),
        other => json!(other),
    };
    Value::Object(metrics.named().into_iter().map(|(name, v)| (name.clone(), value(&name, v))).collect())
}

fn is_count(name: &str) -> bool {
    matches!(name, "n" | "reference_cells")
}

fn is_share(name: &str) -> bool {
    name == "valid_ratio" || name.starts_with("completeness_") || name.starts_with("pag_")
}

fn label(name: &str) -> String {
    let unit = match name {
        _ if is_count(name) => "",
        _ if is_share(name) => " %",
        _ => " m",
    };
    format!("{name}{unit}")
}

fn cell(name: &str, value: Option<f64>) -> String {
    match value {
        None => "-".into(),
        Some(count) if is_count(name) => format!("{count:.0}"),
        Some(share) if is_share(name) => format!("{:.2}", 100.0 * share),
        Some(metres) => format!("{metres:.3}"),
    }
}

/// The class with its name in the LAS specification, where that is common.
fn class_title(class: i32) -> String {
    let name = match class {
        2 => " ground",
        3..=5 => " vegetation",
        6 => " building",
        9 => " water",
        17 => " bridge",
        _ => "",
    };
    format!("{class}{name}")
}

fn row(label: &str, cells: impl Iterator<Item = String>) -> String {
    let mut line = format!("{label:<18}");
    for cell in cells {
        // Writing to a string cannot fail.
        let _ = write!(line, " {cell:>13}");
    }
    line
}
