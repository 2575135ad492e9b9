//! Writes CityJSON 2.0.
//!
//! Coordinates are whole multiples of the scale (1 mm by default), counted from a corner of the
//! model. Vertices that get the same coordinates are merged. Classes that CityJSON has no name for
//! are written without semantics.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

use city::{
    Appearance, BuildingRole, CityModel, CityObject, Geometry, GeometryKind, ModelPoint, SurfaceAppearance,
    SurfaceClass, SurfacePolygon,
};
use serde_json::{Map, Value, json};

use super::schema::VERTICAL;
use crate::crs_name::{lone_vertical_url, ogc_url};
use crate::error::{CityError, CityFault};
use formats::atomic::write_stream;

/// Options for writing a CityJSON file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CityJsonOptions {
    /// Resolution of the coordinates, in their unit.
    pub scale: f64,
    /// Whether an existing file is replaced.
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
/// - [`CityError::Refused`] when the model fails [`CityModel::validate`], two objects share an
///   identifier, or the scale is not positive.
/// - [`CityError::NotWritten`] when the file exists and `overwrite` is false, or the system refuses
///   to write.
///
/// # Examples
/// ```
/// use cityfiles::{CityJsonOptions, read, write_cityjson};
///
/// let folder = tempfile::tempdir()?;
/// let (obj, json) = (folder.path().join("roof.obj"), folder.path().join("roof.city.json"));
/// std::fs::write(&obj, "v 0 0 3\nv 4 0 3\nv 0 4 3\no house\nusemtl RoofSurface\nf 1 2 3\n")?;
/// write_cityjson(&json, &read(&obj)?.model, &CityJsonOptions::default())?;
/// assert_eq!(read(&json)?.model.objects[0].id, "house");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
            let what = format!("two objects have the identifier {:?}, CityJSON allows only one", object.id);
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
    // CityJSON has one name for both, and software leaves out members that begin with a plus.
    if let Some(url) = lone_vertical_url(&model.crs) {
        document[VERTICAL] = json!(url);
    }
    if !model.appearance.is_empty() {
        document["appearance"] = appearance_value(&model.appearance);
    }
    document["CityObjects"] = Value::Object(objects);
    document["vertices"] = json!(lattice.cells);
    Ok(document)
}

/// The vertices of the file, on whole multiples of the scale.
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
    // CityJSON 2.0 does not allow a part without a parent, so a lone part is written as a building.
    let lone_part = object.parent.is_none() && object.kind.role() == BuildingRole::Part;
    let mut value = json!({ "type": if lone_part { "Building" } else { object.kind.name() } });
    if let Some(parent) = object.parent {
        value["parents"] = json!([model.objects[parent].id]);
    }
    if let Some(children) = children {
        value["children"] = json!(children);
    }
    if !object.attributes.is_empty() {
        value["attributes"] = Value::Object(object.attributes.clone());
    }
    if !object.addresses.is_empty() {
        value["address"] = Value::Array(object.addresses.clone());
    }
    let shapes = object.geometries.iter().filter(|geometry| !geometry.surfaces.is_empty());
    value["geometry"] = shapes.map(|geometry| geometry_value(model, geometry, lattice)).collect();
    value
}

fn geometry_value(model: &CityModel, geometry: &Geometry, lattice: &mut Lattice) -> Value {
    let described = Described::of(geometry);
    let boundary = |surface: &SurfacePolygon, lattice: &mut Lattice| -> Value {
        let vertex = |&i: &u32| model.vertices[i as usize];
        surface.rings.iter().map(|ring| ring.iter().map(|i| lattice.index(vertex(i))).collect::<Value>()).collect()
    };
    let semantic = |surface: &SurfacePolygon| json!(described.index(surface));
    let boundaries = nest(geometry, |surface| boundary(surface, lattice));
    let lod = geometry.lod.map_or_else(|| "2".to_owned(), |lod| lod.to_string());
    let mut value = json!({ "type": geometry.kind.name(), "lod": lod, "boundaries": boundaries });
    if !described.surfaces.is_empty() {
        value["semantics"] = json!({ "surfaces": described.surfaces, "values": nest(geometry, semantic) });
    }
    let materials = themes(model, geometry, |found| found.materials.iter().map(|m| m.theme).collect());
    for &(theme, name) in &materials {
        let material = |surface: &SurfacePolygon| json!(surface.appearance.as_ref().and_then(|a| a.material(theme)));
        value["material"][name] = json!({ "values": nest(geometry, material) });
    }
    let textures = themes(model, geometry, |found| found.textures.iter().map(|t| t.theme).collect());
    for &(theme, name) in &textures {
        value["texture"][name] = json!({ "values": nest(geometry, |surface| texture_value(surface, theme)) });
    }
    value
}

/// Returns the themes that the surfaces of a geometry have, with their names, in the order of the
/// model.
fn themes<'a>(
    model: &'a CityModel,
    geometry: &Geometry,
    of: impl Fn(&SurfaceAppearance) -> Vec<u32>,
) -> Vec<(u32, &'a str)> {
    let found: BTreeSet<u32> = geometry.surfaces.iter().flat_map(|s| &s.appearance).flat_map(|a| of(a)).collect();
    found.into_iter().map(|theme| (theme, model.appearance.themes[theme as usize].as_str())).collect()
}

/// Returns the textures of the rings of a surface: the number of the texture, then of its
/// coordinates; `null` alone for a ring without one.
fn texture_value(surface: &SurfacePolygon, theme: u32) -> Value {
    let rings = surface.appearance.as_ref().and_then(|found| found.texture(theme));
    let ring = |number: usize| match rings.and_then(|found| found.rings[number].as_ref()) {
        Some(ring) => json!(std::iter::once(ring.texture).chain(ring.vertices.iter().copied()).collect::<Vec<u32>>()),
        None => json!([null]),
    };
    (0..surface.rings.len()).map(ring).collect()
}

/// Returns the member `appearance` of the document.
fn appearance_value(appearance: &Appearance) -> Value {
    let mut value = Map::new();
    let lists = [("materials", &appearance.materials), ("textures", &appearance.textures)];
    for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
        value.insert(name.to_owned(), json!(list));
    }
    if !appearance.vertices.is_empty() {
        value.insert("vertices-texture".to_owned(), json!(appearance.vertices));
    }
    let defaults = [
        ("default-theme-texture", &appearance.default_texture_theme),
        ("default-theme-material", &appearance.default_material_theme),
    ];
    for (name, theme) in defaults {
        value.extend(theme.iter().map(|theme| (name.to_owned(), json!(theme))));
    }
    Value::Object(value)
}

/// The descriptions of the surfaces of a geometry: one for each class and set of attributes.
struct Described {
    index_of: HashMap<DescriptionKey, usize>,
    surfaces: Vec<Value>,
}

/// A class, and the place in memory of the attributes that surfaces share.
type DescriptionKey = (SurfaceClass, Option<*const Map<String, Value>>);

impl Described {
    /// Collects the descriptions, ordered by class and then by the first surface.
    fn of(geometry: &Geometry) -> Self {
        let mut first: HashMap<DescriptionKey, (usize, &SurfacePolygon)> = HashMap::new();
        for (number, surface) in geometry.surfaces.iter().enumerate().filter(|(_, s)| is_written(s.class)) {
            first.entry(Self::key(surface)).or_insert((number, surface));
        }
        let mut all: Vec<_> = first.into_iter().collect();
        all.sort_unstable_by_key(|((class, _), (number, _))| (*class, *number));
        let value = |surface: &SurfacePolygon| {
            let mut value = Map::from_iter([("type".to_owned(), json!(surface.class.name()))]);
            value.extend(surface.attributes.as_deref().cloned().unwrap_or_default());
            Value::Object(value)
        };
        let surfaces = all.iter().map(|(_, (_, surface))| value(surface)).collect();
        Self { index_of: all.into_iter().enumerate().map(|(index, (key, _))| (key, index)).collect(), surfaces }
    }

    fn key(surface: &SurfacePolygon) -> DescriptionKey {
        (surface.class, surface.attributes.as_ref().map(Arc::as_ptr))
    }

    fn index(&self, surface: &SurfacePolygon) -> Option<usize> {
        self.index_of.get(&Self::key(surface)).copied()
    }
}

/// Whether CityJSON has a name for a class; surfaces of others are written without a description.
pub(crate) fn is_written(class: SurfaceClass) -> bool {
    !matches!(class, SurfaceClass::Unclassified | SurfaceClass::Other)
}

/// Nests one value per surface in arrays of solids and shells, as the kind of the geometry
/// requires.
fn nest(geometry: &Geometry, mut each: impl FnMut(&SurfacePolygon) -> Value) -> Value {
    let groups = |surfaces: &[&SurfacePolygon], key: fn(&SurfacePolygon) -> u32| -> Vec<Vec<usize>> {
        let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, surface) in surfaces.iter().enumerate() {
            members.entry(key(surface)).or_default().push(i);
        }
        members.into_values().collect()
    };
    let all: Vec<&SurfacePolygon> = geometry.surfaces.iter().collect();
    let mut solid = |members: Vec<&SurfacePolygon>| -> Value {
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
