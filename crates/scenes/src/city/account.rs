//! The account of a city model: numbers about the whole, and every object with its status and
//! defects.

use std::collections::BTreeMap;

use city::{CityModel, Defect, DefectCode, Effect, Lod, MeshedModel, ObjectStatus};
use serde::Serialize;

use super::config::CityInput;
use super::error::CityJobError;
use super::input::OpenedCity;
use job::files;

/// Numbers about a city model.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CitySummary {
    /// File that was read.
    pub source: String,
    /// Format of the file, with its version where it has several.
    pub format: String,
    /// Reference system.
    pub crs: CityCrsSummary,
    /// Least and greatest corner in the model's coordinates; `None` without surfaces.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Number of objects.
    pub objects: usize,
    /// Number of objects per status.
    pub statuses: BTreeMap<String, usize>,
    /// Number of geometries per level of detail.
    pub lods: BTreeMap<String, usize>,
    /// Number of used objects per level of detail.
    pub lods_used: BTreeMap<String, usize>,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of triangles per surface class.
    pub triangles_by_class: BTreeMap<String, usize>,
    /// Origin that the triangles are relative to, in the model's coordinates.
    pub origin: [f64; 3],
    /// Number of defects per code and effect.
    pub defects: Vec<CityDefectCount>,
    /// Things of the file that are not carried, such as georeferenced textures, by their kind.
    pub left_out: BTreeMap<String, usize>,
    /// Whether objects have no usable surface, or the reader dropped surfaces.
    pub incomplete: bool,
}

/// Reference system of a city model, as its file states it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CityCrsSummary {
    /// Name in the file.
    pub name: Option<String>,
    /// EPSG code of the horizontal or compound CRS.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical CRS where the file names it separately.
    pub vertical_epsg: Option<u32>,
}

/// How often a defect was found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CityDefectCount {
    /// Number of the defect in the catalogue of val3dity and its extension.
    pub code: u16,
    /// Meaning of the code.
    pub meaning: String,
    /// What was done about it.
    pub effect: String,
    /// Number of defects.
    pub count: usize,
}

/// The summary, and every object with its defects.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CityAccount {
    /// Numbers about the whole.
    #[serde(flatten)]
    pub summary: CitySummary,
    /// Defects that belong to no object.
    pub file_defects: Vec<CityDefectEntry>,
    /// One entry per object, in the order of the file.
    pub object_reports: Vec<CityObjectEntry>,
}

/// What became of one object.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CityObjectEntry {
    /// Identifier in the file.
    pub id: String,
    /// Kind, such as Building.
    pub kind: String,
    /// Identifier of the object that this one is a part of.
    pub parent: Option<String>,
    /// Level of detail that was used.
    pub lod: Option<String>,
    /// Whether the object is used.
    pub status: String,
    /// Why it is not used.
    pub reason: Option<String>,
    /// Number of its triangles.
    pub triangles: usize,
    /// Its defects.
    pub defects: Vec<CityDefectEntry>,
}

/// One defect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CityDefectEntry {
    /// Number in the catalogue.
    pub code: u16,
    /// Meaning of the code.
    pub meaning: String,
    /// What was done about it.
    pub effect: String,
    /// Place in the object or the file.
    pub place: String,
    /// Details, empty where the code says enough.
    pub detail: String,
}

impl CityAccount {
    /// Accounts for everything in a model.
    pub(super) fn of(opened: &OpenedCity) -> Self {
        let model = &opened.file.model;
        let mut defects: Vec<Vec<CityDefectEntry>> = vec![Vec::new(); model.objects.len()];
        let mut file_defects = Vec::new();
        for defect in all_defects(opened) {
            let list = defect.object.and_then(|object| defects.get_mut(object)).unwrap_or(&mut file_defects);
            list.push(CityDefectEntry::of(defect));
        }
        let object_reports = model
            .objects
            .iter()
            .zip(&opened.meshed.objects)
            .zip(defects)
            .map(|((object, report), defects)| CityObjectEntry {
                id: object.id.clone(),
                kind: object.kind.name().to_owned(),
                parent: object.parent.map(|parent| model.objects[parent].id.clone()),
                lod: report.lod.map(|lod| lod.to_string()),
                status: status_name(&report.status).to_owned(),
                reason: reason(&report.status),
                triangles: triangle_count(&report.status),
                defects,
            })
            .collect();
        Self { summary: summary(opened), file_defects, object_reports }
    }

    /// Writes the account where a file is named for it.
    pub(super) fn write(&self, input: &CityInput) -> Result<(), CityJobError> {
        match &input.account {
            Some(path) => Ok(files::write_json(path, self, input.overwrite)?),
            None => Ok(()),
        }
    }
}

impl CityDefectEntry {
    fn of(defect: &Defect) -> Self {
        Self {
            code: defect.code.number(),
            meaning: defect.code.meaning().to_owned(),
            effect: defect.effect.to_string(),
            place: defect.place.clone(),
            detail: defect.detail.clone(),
        }
    }
}

fn summary(opened: &OpenedCity) -> CitySummary {
    let OpenedCity { file, meshed } = opened;
    let (model, mesh) = (&file.model, &meshed.mesh);
    CitySummary {
        source: file.source.display().to_string(),
        format: file.format.to_string(),
        crs: CityCrsSummary {
            name: model.crs.name.clone(),
            epsg: model.crs.epsg,
            vertical_epsg: model.crs.vertical_epsg,
        },
        bounds: model.bounds().map(|(low, high)| [[low.x, low.y, low.z], [high.x, high.y, high.z]]),
        objects: model.objects.len(),
        statuses: count(meshed.objects.iter().map(|object| status_name(&object.status).to_owned())),
        lods: lods(model),
        lods_used: lods_used(meshed),
        triangles: mesh.triangles.len(),
        triangles_by_class: count((0..mesh.triangles.len()).map(|triangle| mesh.surface(triangle).class.to_string())),
        origin: [mesh.origin.x, mesh.origin.y, mesh.origin.z],
        defects: defect_counts(opened),
        left_out: model.left_out.clone(),
        incomplete: is_incomplete(opened),
    }
}

/// Whether anything of the model was lost.
fn is_incomplete(opened: &OpenedCity) -> bool {
    let dropped = |defect: &Defect| defect.effect == Effect::Dropped && defect.code != DefectCode::NotASurface;
    opened.meshed.objects.iter().any(|object| object.status == ObjectStatus::Unusable)
        || opened.file.defects.iter().any(dropped)
}

fn all_defects(opened: &OpenedCity) -> impl Iterator<Item = &Defect> {
    opened.file.defects.iter().chain(&opened.meshed.defects)
}

fn defect_counts(opened: &OpenedCity) -> Vec<CityDefectCount> {
    let counts = count(all_defects(opened).map(|defect| (defect.code, defect.effect.to_string())));
    let entry = |((code, effect), count): ((DefectCode, String), usize)| CityDefectCount {
        code: code.number(),
        meaning: code.meaning().to_owned(),
        effect,
        count,
    };
    counts.into_iter().map(entry).collect()
}

fn lods(model: &CityModel) -> BTreeMap<String, usize> {
    let geometries = model.objects.iter().flat_map(|object| &object.geometries);
    count(geometries.map(|geometry| lod_name(geometry.lod)))
}

fn lods_used(meshed: &MeshedModel) -> BTreeMap<String, usize> {
    let used = meshed.objects.iter().filter(|object| matches!(object.status, ObjectStatus::Used { .. }));
    count(used.map(|object| lod_name(object.lod)))
}

fn lod_name(lod: Option<Lod>) -> String {
    lod.map_or_else(|| "unstated".to_owned(), |lod| lod.to_string())
}

fn count<K: Ord>(keys: impl Iterator<Item = K>) -> BTreeMap<K, usize> {
    let mut counts = BTreeMap::new();
    for key in keys {
        *counts.entry(key).or_insert(0) += 1;
    }
    counts
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

/// Why an object is not used; `None` for used objects.
fn reason(status: &ObjectStatus) -> Option<String> {
    Some(match status {
        ObjectStatus::Used { .. } => return None,
        ObjectStatus::NoSuchLod { available } => {
            let levels: Vec<String> = available.iter().map(ToString::to_string).collect();
            let levels = if levels.is_empty() { "unstated".to_owned() } else { levels.join(", ") };
            format!("its levels of detail are {levels}")
        }
        ObjectStatus::ReplacedByParts => "its parts show it in more detail".to_owned(),
        ObjectStatus::OutOfScope => "it is not a building, and only buildings were asked for".to_owned(),
        ObjectStatus::NoGeometry => "it has no surfaces of its own".to_owned(),
        _ => "none of its surfaces could be used, see its defects".to_owned(),
    })
}

fn triangle_count(status: &ObjectStatus) -> usize {
    match status {
        ObjectStatus::Used { triangles } => *triangles,
        _ => 0,
    }
}
