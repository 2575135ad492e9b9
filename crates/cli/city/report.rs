//! The account of a city model: a summary as text or JSON, and every object with its status and defects.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use city::{Defect, Meshed, ObjectStatus};
use io::citymodel::CityFile;
use serde_json::{Value, json};

/// A model and what became of it.
pub(super) struct Report<'a> {
    file: &'a CityFile,
    meshed: &'a Meshed,
}

impl<'a> Report<'a> {
    pub(super) fn new(file: &'a CityFile, meshed: &'a Meshed) -> Self {
        Self { file, meshed }
    }

    /// Numbers about the whole.
    pub(super) fn summary(&self) -> Value {
        let (model, mesh) = (&self.file.model, &self.meshed.mesh);
        let bounds = model.bounds().map(|(low, high)| [[low.x, low.y, low.z], [high.x, high.y, high.z]]);
        json!({
            "source": self.file.source.display().to_string(),
            "format": self.file.format.to_string(),
            "crs": {
                "name": model.crs.name,
                "epsg": model.crs.epsg,
                "vertical_epsg": model.crs.vertical_epsg,
            },
            "bounds": bounds,
            "objects": model.objects.len(),
            "statuses": self.statuses(),
            "lods": self.lods(),
            "lods_used": self.lods_used(),
            "triangles": mesh.triangles.len(),
            "triangles_by_class": self.classes(),
            "origin": [mesh.origin.x, mesh.origin.y, mesh.origin.z],
            "defects": self.defect_counts().into_iter().map(|((code, effect), count)| {
                json!({ "code": code.number(), "meaning": code.meaning(), "effect": effect, "count": count })
            }).collect::<Value>(),
        })
    }

    /// The summary, and every object with its defects.
    pub(super) fn full(&self) -> Value {
        let model = &self.file.model;
        let mut defects: Vec<Vec<Value>> = vec![Vec::new(); model.objects.len()];
        let mut of_file = Vec::new();
        for defect in self.defects() {
            let list = defect.object.and_then(|object| defects.get_mut(object)).unwrap_or(&mut of_file);
            list.push(defect_value(defect));
        }
        let mut value = self.summary();
        value["file_defects"] = json!(of_file);
        let objects = model.objects.iter().zip(&self.meshed.objects).zip(defects);
        value["object_reports"] = objects
            .map(|((object, report), defects)| {
                json!({
                    "id": object.id,
                    "kind": object.kind.name(),
                    "parent": object.parent.map(|parent| model.objects[parent].id.as_str()),
                    "lod": report.lod.map(|lod| lod.to_string()),
                    "status": status_name(&report.status),
                    "reason": reason(&report.status),
                    "triangles": triangles(&report.status),
                    "defects": defects,
                })
            })
            .collect();
        value
    }

    pub(super) fn to_text(&self) -> String {
        let model = &self.file.model;
        let mut text = format!("{}: {}\n", self.file.source.display(), self.file.format);
        let mut row = |name: &str, value: String| {
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {name:<18}{value}");
        };
        let name = model.crs.name.as_deref().filter(|_| model.crs.epsg.is_some());
        row("reference system", format!("{}{}", model.crs, name.map(|n| format!(" ({n})")).unwrap_or_default()));
        match model.bounds() {
            Some((low, high)) => {
                row("from", format!("{:.3} {:.3} {:.3}", low.x, low.y, low.z));
                row("to", format!("{:.3} {:.3} {:.3}", high.x, high.y, high.z));
            }
            None => row("extent", "no surfaces".to_owned()),
        }
        row("objects", format!("{} ({})", model.objects.len(), listed(&self.statuses())));
        row("levels of detail", format!("{}; used: {}", listed(&self.lods()), listed(&self.lods_used())));
        row("triangles", format!("{} ({})", self.meshed.mesh.triangles.len(), listed(&self.classes())));
        let counts = self.defect_counts();
        row("defects", if counts.is_empty() { "none".to_owned() } else { String::new() });
        for ((code, effect), count) in counts {
            row("", format!("{count} × {code}, {effect}"));
        }
        text
    }

    fn defects(&self) -> impl Iterator<Item = &Defect> {
        self.file.defects.iter().chain(&self.meshed.defects)
    }

    fn defect_counts(&self) -> BTreeMap<(city::DefectCode, String), usize> {
        count(self.defects().map(|defect| (defect.code, defect.effect.to_string())))
    }

    fn statuses(&self) -> BTreeMap<String, usize> {
        count(self.meshed.objects.iter().map(|object| status_name(&object.status).to_owned()))
    }

    fn lods(&self) -> BTreeMap<String, usize> {
        let geometries = self.file.model.objects.iter().flat_map(|object| &object.geometries);
        count(geometries.map(|geometry| lod_name(geometry.lod)))
    }

    fn lods_used(&self) -> BTreeMap<String, usize> {
        let used = self.meshed.objects.iter().filter(|o| matches!(o.status, ObjectStatus::Used { .. }));
        count(used.map(|object| lod_name(object.lod)))
    }

    fn classes(&self) -> BTreeMap<String, usize> {
        let mesh = &self.meshed.mesh;
        count((0..mesh.triangles.len()).map(|triangle| mesh.surface(triangle).class.to_string()))
    }
}

fn lod_name(lod: Option<city::Lod>) -> String {
    lod.map_or_else(|| "unstated".to_owned(), |lod| lod.to_string())
}

fn count<K: Ord>(keys: impl Iterator<Item = K>) -> BTreeMap<K, usize> {
    let mut counts = BTreeMap::new();
    for key in keys {
        *counts.entry(key).or_insert(0) += 1;
    }
    counts
}

fn listed(counts: &BTreeMap<String, usize>) -> String {
    if counts.is_empty() {
        return "none".to_owned();
    }
    counts.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}

fn defect_value(defect: &Defect) -> Value {
    json!({
        "code": defect.code.number(),
        "meaning": defect.code.meaning(),
        "effect": defect.effect.to_string(),
        "place": defect.place,
        "detail": defect.detail,
    })
}

fn status_name(status: &ObjectStatus) -> &'static str {
    match status {
        ObjectStatus::Used { .. } => "used",
        ObjectStatus::NoGeometry => "no geometry",
        ObjectStatus::OutOfScope => "no building",
        ObjectStatus::NoSuchLod { .. } => "other level of detail",
        ObjectStatus::ReplacedByParts => "replaced by its parts",
        ObjectStatus::Unusable => "unusable",
        _ => "not used",
    }
}

/// Why an object is not used; `None` for those that are.
fn reason(status: &ObjectStatus) -> Option<String> {
    Some(match status {
        ObjectStatus::Used { .. } => return None,
        ObjectStatus::NoSuchLod { available } => {
            let levels: Vec<String> = available.iter().map(ToString::to_string).collect();
            format!(
                "its levels of detail are {}",
                if levels.is_empty() { "unstated".to_owned() } else { levels.join(", ") }
            )
        }
        ObjectStatus::ReplacedByParts => "its parts show it in more detail".to_owned(),
        ObjectStatus::OutOfScope => "it is no building: --all-objects takes it".to_owned(),
        ObjectStatus::NoGeometry => "it has no surfaces of its own".to_owned(),
        _ => "none of its surfaces could be used, see its defects".to_owned(),
    })
}

fn triangles(status: &ObjectStatus) -> usize {
    match status {
        ObjectStatus::Used { triangles } => *triangles,
        _ => 0,
    }
}
