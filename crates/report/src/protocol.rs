//! Protocol of an evaluation. Published numbers differ more by protocol than by method, so every
//! result includes it.

use eval::{AlignmentMethod, EvalConfig, Evaluation, OUTLIER_NMADS, TerrainSource};
use serde_json::{Value, json};

/// Protocol of an evaluation: inputs and conventions.
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// Name of the evaluated surface.
    pub test: String,
    /// Name of the reference.
    pub reference: String,
    /// Numbers of columns and rows of the reference grid.
    pub size: (usize, usize),
    /// Side lengths of its cells, metres.
    pub cell_m: (f64, f64),
    /// Coordinate system of the grid, in words.
    pub crs: String,
    /// EPSG code of the coordinate system.
    pub horizontal_epsg: Option<u32>,
    /// Vertical datum of both surfaces, in words.
    pub vertical: String,
    /// Settings: alignment, thresholds, skipped classes, lowest height of a standing object.
    pub config: EvalConfig,
    /// Source of the classes.
    pub classes: Option<String>,
    /// Source of the mask.
    pub mask: Option<String>,
    /// Source of the terrain model.
    pub terrain: Option<String>,
    /// Source of the buildings' numbers.
    pub objects: Option<String>,
    /// Sources of the origin, the standard deviation and the confidence of the heights.
    pub layers: Vec<String>,
    /// Decisions and doubts that a reader must know.
    pub notes: Vec<String>,
    /// Requirements that were not met.
    pub missed: Vec<String>,
}

impl Protocol {
    /// Returns the protocol as labels and texts.
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
        if let Some(objects) = &self.objects {
            lines.push(("buildings", format!("numbered in {objects}")));
        }
        if !self.layers.is_empty() {
            lines.push(("layers", self.layers.join(", ")));
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
            "objects_file": self.objects,
            "layers": self.layers,
        })
    }
}
