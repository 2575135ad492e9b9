//! What was compared and how: published numbers differ more by protocol than by method, so no result goes without it.

use eval::{AlignmentMethod, EvalConfig, Evaluation, OUTLIER_NMADS, TerrainSource};
use serde_json::{Value, json};

/// The protocol of an evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// The evaluated surface, by name.
    pub test: String,
    /// The reference, by name.
    pub reference: String,
    /// Columns and rows of the reference grid.
    pub size: (usize, usize),
    /// Sides of its cells, metres.
    pub cell_m: (f64, f64),
    /// Its coordinate system in words.
    pub crs: String,
    /// … and by EPSG code.
    pub horizontal_epsg: Option<u32>,
    /// What the heights of both are above.
    pub vertical: String,
    /// Alignment, thresholds, skipped classes, least height of what stands.
    pub config: EvalConfig,
    /// Where the classes come from.
    pub classes: Option<String>,
    /// Where the mask comes from.
    pub mask: Option<String>,
    /// Where a terrain model comes from.
    pub terrain: Option<String>,
    /// Decisions and doubts that a reader must know.
    pub notes: Vec<String>,
    /// Requirements that are not met.
    pub missed: Vec<String>,
}

impl Protocol {
    /// The protocol as labels and texts.
    pub(crate) fn lines(&self, found: &Evaluation) -> Vec<(&'static str, String)> {
        let shift = found.shift;
        let ((columns, rows), (cell_x, cell_y)) = (self.size, self.cell_m);
        let mut lines = vec![
            ("test", self.test.clone()),
            ("reference", self.reference.clone()),
            ("grid", format!("{columns} x {rows} cells of {cell_x:.4} x {cell_y:.4} m, {}; bilinear", self.crs)),
            ("heights", format!("above: {}", self.vertical)),
            ("alignment", self.alignment(found)),
            (
                "shift",
                format!("dx {:+.3} m, dy {:+.3} m, dz {:+.3} m (added to test)", shift.dx_m, shift.dy_m, shift.dz_m),
            ),
        ];
        if let Some(classes) = &self.classes {
            let skip: Vec<String> = self.config.skip.iter().map(i32::to_string).collect();
            lines.push((
                "classes",
                format!("{classes}; skipped: {}", if skip.is_empty() { "none".into() } else { skip.join(", ") }),
            ));
        }
        if let Some(mask) = &self.mask {
            lines.push(("mask", format!("cells that are not zero in {mask}")));
        }
        if found.skipped_cells > 0 {
            lines.push(("left out", format!("{} valid cells of the reference, by class or mask", found.skipped_cells)));
        }
        lines.push(("outliers", format!("in the rows robust_*: farther than {OUTLIER_NMADS} NMAD from the median")));
        lines.push(("edges", self.edges(found)));
        lines.push(("terrain", self.terrain(found)));
        lines
    }

    fn alignment(&self, found: &Evaluation) -> String {
        match (self.config.alignment, found.search, found.nuth_kaab) {
            (_, Some(search), _) => {
                format!("xyz: least NMAD of all translations within {} m, then the median", search.radius_m)
            }
            (_, _, Some(nk)) => format!(
                "nuth-kaab: slope and aspect, {} corrections from cells of {:.1} m down, then the median",
                nk.iterations,
                self.cell_m.0.max(self.cell_m.1) * (nk.levels as f64).exp2()
            ),
            (AlignmentMethod::Z, ..) => "z: the median".into(),
            _ => "none".into(),
        }
    }

    fn edges(&self, found: &Evaluation) -> String {
        let rule = found.edge_rule;
        let (jump, zone) = (rule.jump_m.0.max(rule.jump_m.1), rule.zone_m);
        format!("within {zone} m of neighbours that differ by more than {jump} m in the reference")
    }

    fn terrain(&self, found: &Evaluation) -> String {
        let source = match found.standing.terrain {
            TerrainSource::GroundClass { cells } => {
                format!("from the reference's {cells} cells of class 2, filled between")
            }
            TerrainSource::Estimated { window_m, slope } => format!(
                "estimated from the reference (progressive opening up to {window_m:.0} m, slope {:.0} %)",
                100.0 * slope
            ),
            _ => self.terrain.clone().unwrap_or_else(|| "given".into()),
        };
        format!("{source}; what is more than {} m above it stands", found.standing.threshold_m)
    }

    pub(crate) fn json(&self, found: &Evaluation) -> Value {
        json!({
            "alignment": self.config.alignment,
            "shift_sign": "added to test",
            "search": found.search,
            "nuth_kaab": found.nuth_kaab,
            "grid": {
                "columns": self.size.0,
                "rows": self.size.1,
                "cell_m": [self.cell_m.0, self.cell_m.1],
                "horizontal_epsg": self.horizontal_epsg,
            },
            "resampling": "bilinear",
            "vertical": self.vertical,
            "class_raster": self.classes,
            "skipped_classes": self.config.skip,
            "mask": self.mask,
            "skipped_cells": found.skipped_cells,
            "outlier_nmads": OUTLIER_NMADS,
            "edges": found.edge_rule,
            "terrain": found.standing.terrain,
            "terrain_file": self.terrain,
        })
    }
}
