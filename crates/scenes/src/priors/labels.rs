//! Meaning of the numbers in the class and object maps and of the labels of splats, and the colours
//! of classes.

use std::collections::BTreeSet;

use city::{CityModel, SurfaceClass, TriangleMesh};
use formats::splat_ply::{LabelTable, LabelledObject, SplatLabels};
use gaussian::SplatLabel;
use serde_json::{Value, json};

/// Returns the content of `labels.json`: names of classes, and identifiers of the objects in use.
pub(super) fn labels(model: &CityModel, mesh: &TriangleMesh) -> Value {
    let classes: serde_json::Map<String, Value> =
        SurfaceClass::all().map(|class| ((class as u8).to_string(), json!(class.name()))).collect();
    let mut used: Vec<u32> = mesh.surfaces.iter().map(|surface| surface.object).collect();
    used.sort_unstable();
    used.dedup();
    let object = |&index: &u32| {
        let object = &model.objects[index as usize];
        let building = &model.objects[model.root(index as usize)];
        json!({ "number": index + 1, "id": object.id, "kind": object.kind.name(), "building": building.id })
    };
    json!({
        "classes": classes,
        "missing_class": ::priors::MISSING_CLASS,
        "missing_object": ::priors::NO_OBJECT,
        "objects": used.iter().map(object).collect::<Vec<_>>(),
    })
}

/// Adds the table of what the numbers mean to labels of splats: the objects that they name and the
/// buildings that these belong to, with all attributes.
pub(crate) fn with_table(of: Vec<SplatLabel>, model: &CityModel) -> SplatLabels {
    let used: BTreeSet<usize> =
        of.iter().filter(|label| !label.is_none()).map(|label| label.object as usize - 1).collect();
    let listed: BTreeSet<usize> = used.iter().flat_map(|&index| [index, model.root(index)]).collect();
    let object = |index: usize| {
        let object = &model.objects[index];
        LabelledObject {
            number: index as u32 + 1,
            id: object.id.clone(),
            kind: object.kind.name().to_owned(),
            building: model.objects[model.root(index)].id.clone(),
            attributes: object.attributes.clone(),
        }
    };
    let classes = SurfaceClass::all().map(|class| (class as u8, class.name().to_owned())).collect();
    let objects = listed.into_iter().map(object).collect();
    SplatLabels { of, table: LabelTable { classes, objects, ..LabelTable::default() } }
}

/// Returns the first colour of the points of a class (red, green, blue), so that roofs differ from
/// walls before training.
pub(super) fn colour(class: SurfaceClass) -> [u8; 3] {
    match class {
        SurfaceClass::Roof => [178, 84, 66],
        SurfaceClass::Wall => [208, 196, 172],
        SurfaceClass::Ground => [120, 114, 104],
        SurfaceClass::Window | SurfaceClass::Door => [96, 128, 152],
        _ => [160, 160, 160],
    }
}
