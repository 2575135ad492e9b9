//! Meaning of the numbers in the class and object maps, and the colours of classes.

use city::{CityModel, SurfaceClass, TriangleMesh};
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
