//! Report of an evaluation for programs.

use eval::{Metrics, OriginMetrics, Overlap, cumulative, histogram};
use serde_json::{Map, Value, json};

use super::numbers::is_count;
use super::report::EvaluationReport;

/// Generator that identifies our files.
const GENERATOR: &str = concat!("skysweep eval ", env!("CARGO_PKG_VERSION"));

impl EvaluationReport<'_> {
    /// Returns every number by name.
    pub fn json(&self) -> Value {
        let (found, protocol) = (self.found, self.protocol);
        let classes: Map<String, Value> =
            found.classes.iter().map(|c| (c.class.to_string(), metrics_json(&c.metrics))).collect();
        let slopes = found.slopes.iter().map(
            |bin| json!({ "from_deg": bin.from_deg, "to_deg": bin.to_deg, "metrics": metrics_json(&bin.metrics) }),
        );
        let coverages = found.coverages.iter().map(
            |c| json!({ "coverage": c.coverage, "confidence": c.confidence, "metrics": metrics_json(&c.metrics) }),
        );
        json!({
            "generator": GENERATOR,
            "test": protocol.test,
            "reference": protocol.reference,
            "protocol": protocol.json(found),
            "shift": found.shift,
            "metrics": metrics_json(&found.overall),
            "classes": classes,
            "slopes": slopes.collect::<Vec<_>>(),
            "coverages": coverages.collect::<Vec<_>>(),
            "origins": found.origins.as_ref().map(|split| json!({
                "observed": origin_json(&split.observed),
                "filled": origin_json(&split.filled),
                "unknown_cells": split.unknown_cells,
            })),
            "sigma": found.sigma,
            "reliability": found.reliability,
            "objects": found.objects,
            "outlines": found.outlines,
            "edges": { "edge": metrics_json(&found.edges.edge), "rest": metrics_json(&found.edges.rest) },
            "sharpness": found.sharpness,
            "standing": {
                "threshold_m": found.standing.threshold_m,
                "footprint_m2": overlap_json(&found.standing.footprint),
                "volume_m3": overlap_json(&found.standing.volume),
            },
            "histogram": histogram(&found.errors, self.plot_range_m()),
            "cumulative": cumulative(&found.errors, self.plot_range_m()),
            "notes": protocol.notes,
            "requirements_missed": protocol.missed,
        })
    }

    /// Returns whether a JSON text was written by an evaluation.
    pub fn is_ours(json: &str) -> bool {
        let generator = serde_json::from_str::<Value>(json).ok();
        let generator = generator.as_ref().and_then(|value| value.get("generator")?.as_str());
        generator.is_some_and(|name| name.starts_with("skysweep eval "))
    }
}

/// Returns metrics by name. Numbers of cells are integers. Metrics that cannot be computed are
/// null.
fn metrics_json(metrics: &Metrics) -> Value {
    let value = |name: &str, value: Option<f64>| match value {
        Some(count) if is_count(name) => json!(count as u64),
        other => json!(other),
    };
    Value::Object(metrics.named().into_iter().map(|(name, v)| (name.clone(), value(&name, v))).collect())
}

/// Returns the metrics of one origin, over all cells, at edges and per class.
fn origin_json(origin: &OriginMetrics) -> Value {
    let classes: Map<String, Value> =
        origin.classes.iter().map(|c| (c.class.to_string(), metrics_json(&c.metrics))).collect();
    json!({
        "metrics": metrics_json(&origin.overall),
        "edges": { "edge": metrics_json(&origin.edges.edge), "rest": metrics_json(&origin.edges.rest) },
        "classes": classes,
    })
}

fn overlap_json(overlap: &Overlap) -> Value {
    json!({
        "reference": overlap.reference,
        "test": overlap.test,
        "shared": overlap.shared,
        "recall": overlap.recall(),
        "precision": overlap.precision(),
        "iou": overlap.iou(),
    })
}
