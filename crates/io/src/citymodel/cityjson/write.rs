//! CityJSON 2.0 out of a city model.
//!
//! Coordinates are whole multiples of the scale (1 mm unless asked otherwise), counted from a corner of the model; vertices
//! that fall on the same place become one. The classes that CityJSON has no name for are written without semantics.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use city::{CityModel, CityObject, Geometry, GeometryKind, ModelPoint, Role, Surface, SurfaceClass};
use serde_json::{Map, Value, json};

use crate::atomic::write_stream;
use crate::citymodel::crs_name::ogc_url;
use crate::citymodel::{CityError, CityFault};

/// How a CityJSON file is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CityJsonOptions {
    /// Resolution of the coordinates in their own unit.
    pub scale: f64,
    /// Replace a file that is there.
    pub overwrite: bool,
}

impl Default for CityJsonOptions {
    fn default() -> Self {
        Self { scale: 0.001, overwrite: false }
    }
}

/// Writes a model as CityJSON 2.0.
///
/// # Errors
/// A model that fails [`CityModel::validate`] or whose objects share an id, a scale that is not positive, and what the
/// file system refuses. Nothing is left behind.
pub fn write_cityjson(path: &Path, model: &CityModel, options: &CityJsonOptions) -> Result<(), CityError> {
    let document = document(model, options.scale).map_err(|fault| fault.at(path))?;
    Ok(write_stream(path, options.overwrite, |out| {
        serde_json::to_writer(&mut *out, &document)?;
        out.write_all(b"\n")
    })?)
}

fn document(model: &CityModel, scale: f64) -> Result<Value, CityFault> {
    model.validate().map_err(|error| CityFault::invalid(error.to_string(), "model"))?;
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(CityFault::invalid(format!("the scale is {scale}, expected a positive number"), "options"));
    }
    let origin = model.bounds().map_or(ModelPoint::default(), |(low, _)| low);
    let translate = [origin.x, origin.y, origin.z].map(|c| (c / scale).floor() * scale);
    let mut lattice = Lattice { scale, translate, index_of: HashMap::new(), cells: Vec::new() };
    let mut children: HashMap<usize, Vec<&str>> = HashMap::new();
    for object in &model.objects {
        if let Some(parent) = object.parent {
            children.entry(parent).or_default().push(&object.id);
        }
    }
    let mut objects = Map::new();
    for (index, object) in model.objects.iter().enumerate() {
        let value = object_value(model, object, children.get(&index), &mut lattice);
        if objects.insert(object.id.clone(), value).is_some() {
            let what = format!("two objects have the id {:?}, and CityJSON allows one", object.id);
            return Err(CityFault::new(city::DefectCode::DuplicateId, what, "model"));
        }
    }
    let mut document = json!({
        "type": "CityJSON",
        "version": "2.0",
        "transform": { "scale": [scale, scale, scale], "translate": translate },
    });
    if let Some(url) = ogc_url(&model.crs) {
        document["metadata"] = json!({ "referenceSystem": url });
    }
    document["CityObjects"] = Value::Object(objects);
    document["vertices"] = json!(lattice.cells);
    Ok(document)
}

/// Vertices on whole multiples of the scale.
struct Lattice {
    scale: f64,
    translate: [f64; 3],
    index_of: HashMap<[i64; 3], usize>,
    cells: Vec<[i64; 3]>,
}

impl Lattice {
    fn index(&mut self, point: ModelPoint) -> usize {
        let from_corner = point.from_origin(ModelPoint::from(self.translate));
        let cell = from_corner.map(|c| (c / self.scale).round() as i64);
        *self.index_of.entry(cell).or_insert_with(|| {
            self.cells.push(cell);
            self.cells.len() - 1
        })
    }
}

fn object_value(model: &CityModel, object: &CityObject, children: Option<&Vec<&str>>, lattice: &mut Lattice) -> Value {
    // CityJSON 2.0 knows no room outside of a building and no part without a parent: a lone part is a building.
    let lone_part = object.parent.is_none() && object.kind.role() == Role::Part;
    let mut value = json!({ "type": if lone_part { "Building" } else { object.kind.name() } });
    if let Some(parent) = object.parent {
        value["parents"] = json!([model.objects[parent].id]);
    }
    if let Some(children) = children {
        value["children"] = json!(children);
    }
    let shapes = object.geometries.iter().filter(|geometry| !geometry.surfaces.is_empty());
    value["geometry"] = shapes.map(|geometry| geometry_value(model, geometry, lattice)).collect();
    value
}

fn geometry_value(model: &CityModel, geometry: &Geometry, lattice: &mut Lattice) -> Value {
    let mut classes: Vec<SurfaceClass> = geometry.surfaces.iter().map(|surface| surface.class).collect();
    classes.sort_unstable();
    classes.dedup();
    classes.retain(|class| !matches!(class, SurfaceClass::Unclassified | SurfaceClass::Other));
    let boundary = |surface: &Surface, lattice: &mut Lattice| -> Value {
        let vertex = |&i: &u32| model.vertices[i as usize];
        surface.rings.iter().map(|ring| ring.iter().map(|i| lattice.index(vertex(i))).collect::<Value>()).collect()
    };
    let semantic = |surface: &Surface| json!(classes.binary_search(&surface.class).ok());
    let boundaries = nest(geometry, |surface| boundary(surface, lattice));
    let lod = geometry.lod.map_or_else(|| "2".to_owned(), |lod| lod.to_string());
    let mut value = json!({ "type": geometry.kind.name(), "lod": lod, "boundaries": boundaries });
    if !classes.is_empty() {
        let surfaces: Vec<Value> = classes.iter().map(|class| json!({ "type": class.name() })).collect();
        value["semantics"] = json!({ "surfaces": surfaces, "values": nest(geometry, semantic) });
    }
    value
}

/// One value per surface, in the arrays of solids and shells that the kind of the geometry asks for.
fn nest(geometry: &Geometry, mut each: impl FnMut(&Surface) -> Value) -> Value {
    let groups = |surfaces: &[&Surface], key: fn(&Surface) -> u32| -> Vec<Vec<usize>> {
        let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, surface) in surfaces.iter().enumerate() {
            members.entry(key(surface)).or_default().push(i);
        }
        members.into_values().collect()
    };
    let all: Vec<&Surface> = geometry.surfaces.iter().collect();
    let mut solid = |members: Vec<&Surface>| -> Value {
        let shells = groups(&members, |surface| surface.shell);
        shells.into_iter().map(|shell| shell.into_iter().map(|i| each(members[i])).collect::<Value>()).collect()
    };
    match geometry.kind {
        GeometryKind::MultiSurface | GeometryKind::CompositeSurface => all.into_iter().map(each).collect(),
        GeometryKind::Solid => solid(all),
        GeometryKind::MultiSolid | GeometryKind::CompositeSolid => {
            let solids = groups(&all, |surface| surface.solid);
            solids.into_iter().map(|members| solid(members.into_iter().map(|i| all[i]).collect())).collect()
        }
    }
}
