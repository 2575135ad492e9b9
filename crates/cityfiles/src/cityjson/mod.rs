//! Reads CityJSON 1.0, 1.1 and 2.0 and CityJSON text sequences (CityJSONSeq), and writes CityJSON
//! 2.0.
//!
//! A text that is not JSON, or whose geometry has members of the wrong type, is refused with its
//! line and column. Any other defect costs only the surface that has it. Attributes, addresses and
//! appearances are kept; what refers to nothing or has the wrong type is counted. Extensions are
//! skipped.

mod appearance;
mod geometry;
mod schema;
mod template;
mod write;

use city::{ModelPoint, ObjectKind, SurfaceClass};
use serde_json::Value;

use super::builder::Builder;
use super::crs_name::crs_reference;
use super::error::CityFault;
use super::format::{CityFormat, Parsed};
use super::placement::Instances;
use appearance::Numbers;
use schema::{Document, Object, Pairs, Transform};
use template::Library;

pub(super) use write::is_written;
pub use write::{CityJsonOptions, write_cityjson};

/// Versions that are read. A patch number may follow.
const VERSIONS: [&str; 3] = ["1.0", "1.1", "2.0"];

/// Reads a document, or the lines of a sequence.
pub(super) fn parse(text: &[u8]) -> Result<Parsed, CityFault> {
    let mut documents = serde_json::Deserializer::from_slice(text).into_iter::<Document>();
    let first = match documents.next() {
        Some(document) => document.map_err(syntax)?,
        None => return Err(CityFault::invalid("the file is empty", "line 1")),
    };
    let version = check_head(&first)?;
    let crs = first.metadata.and_then(|metadata| metadata.reference_system).unwrap_or_default();
    let mut reader =
        Reader { builder: Builder::default(), transform: first.transform, instances: Instances::default() };
    let mut crs = crs_reference(&crs);
    if let Some(vertical) = &first.vertical {
        crs.vertical_epsg = crs.vertical_epsg.or(crs_reference(vertical).epsg);
    }
    reader.builder.set_crs(crs);
    let numbers = Numbers::register(&mut reader.builder, first.appearance);
    let library = Library { templates: first.templates.as_ref(), numbers: &numbers };
    reader.document(first.vertices, first.objects, library, &numbers)?;
    let mut features = 0;
    for document in documents {
        let place = format!("feature {}", features + 1);
        reader.feature(document.map_err(syntax)?, library, &place)?;
        features += 1;
    }
    let format = if features == 0 { CityFormat::CityJson(version) } else { CityFormat::CityJsonSeq(version) };
    let (model, defects) = reader.builder.finish();
    Ok(Parsed { model, format, defects })
}

/// Converts an error of serde_json to a fault with a place.
fn syntax(error: serde_json::Error) -> CityFault {
    let place = format!("line {}, column {}", error.line(), error.column());
    let text = error.to_string();
    let what = text.split(" at line ").next().unwrap_or_default();
    CityFault::invalid(what, place)
}

/// Checks type and version of the first document, and returns the version.
fn check_head(document: &Document) -> Result<String, CityFault> {
    match document.kind.as_deref() {
        Some("CityJSON") => {}
        Some("CityJSONFeature") => {
            let what = "a CityJSONFeature alone has no coordinates, put the CityJSON line of its sequence before it";
            return Err(CityFault::unsupported(what, "type"));
        }
        Some(other) => {
            let what = format!("the type is {:?}, expected CityJSON", shorten(other));
            return Err(CityFault::unsupported(what, "type"));
        }
        None => return Err(CityFault::invalid("the type is missing, expected CityJSON", "type")),
    }
    let version = document.version.as_deref().unwrap_or_default();
    if !VERSIONS.iter().any(|known| version == *known || version.starts_with(&format!("{known}."))) {
        let what = format!(
            "the version of CityJSON is {:?}, expected 1.0 to 2.0, upgrade the file with cjio",
            shorten(version)
        );
        return Err(CityFault::unsupported(what, "version"));
    }
    Ok(version.to_owned())
}

fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}

struct Reader {
    builder: Builder,
    transform: Option<Transform>,
    instances: Instances,
}

impl Reader {
    /// Adds the objects of a line of a sequence.
    fn feature(&mut self, feature: Document, library: Library<'_>, place: &str) -> Result<(), CityFault> {
        if feature.kind.as_deref() != Some("CityJSONFeature") {
            return Err(CityFault::invalid("the line is not a CityJSONFeature", place));
        }
        if self.transform.is_none() {
            let what = "the first line of the sequence has no transform, so its features have no coordinates";
            return Err(CityFault::invalid(what, "line 1"));
        }
        let numbers = Numbers::register(&mut self.builder, feature.appearance);
        self.document(feature.vertices, feature.objects, library, &numbers)
    }

    /// Adds the objects of a document. Its boundaries are indices of `vertices`.
    fn document(
        &mut self,
        vertices: Vec<[f64; 3]>,
        objects: Option<Pairs<Object>>,
        library: Library<'_>,
        numbers: &Numbers,
    ) -> Result<(), CityFault> {
        let first = self.builder.vertex_count();
        let count = vertices.len();
        for vertex in vertices {
            let point = self.transform.map_or(vertex, |t| apply(t, vertex));
            let added = self.builder.vertex(ModelPoint::from(point));
            added.ok_or_else(|| {
                CityFault::unsupported("the model has more than 2^32 vertices, cut it into tiles", "vertices")
            })?;
        }
        for (id, object) in objects.into_iter().flat_map(|pairs| pairs.0) {
            let kind = object.kind.unwrap_or_else(|| "Unknown".to_owned());
            let index = self.builder.object(id, ObjectKind::new(kind));
            let mut malformed = 0;
            let attributes = object.attributes.counted(&mut malformed).unwrap_or_default();
            self.builder.left_out("malformed attributes of objects", malformed);
            let addresses = addresses(object.address);
            let made = self.builder.object_mut(index);
            (made.attributes, made.addresses) = (attributes, addresses);
            self.count_left_out(object.geometry.iter().flatten());
            if let Some(parent) = object.parents.as_ref().and_then(|parents| parents.first()) {
                self.builder.parent(index, parent.as_str());
            }
            for (number, shape) in object.geometry.iter().flatten().enumerate() {
                let place = geometry::Place { object: index, geometry: number };
                if shape.kind.as_deref() == Some("GeometryInstance") {
                    let (builder, vertices) = (&mut self.builder, first..first + count);
                    template::add_instance(builder, &mut self.instances, shape, library, vertices, place)?;
                } else {
                    let vertex_at = |i: u64| usize::try_from(i).ok().filter(|&i| i < count).map(|i| (first + i) as u32);
                    geometry::add(&mut self.builder, shape, numbers, vertex_at, place);
                }
            }
        }
        Ok(())
    }

    /// Counts what the model does not hold of the shapes of an object.
    fn count_left_out<'a>(&mut self, shapes: impl Iterator<Item = &'a schema::Shape>) {
        for shape in shapes {
            let surfaces = || shape.semantics.iter().flat_map(|semantics| &semantics.surfaces);
            let relations = |surface: &schema::SemanticSurface| {
                usize::from(surface.parent.is_some()) + usize::from(surface.children.is_some())
            };
            self.builder.left_out("relations of surfaces", surfaces().map(relations).sum());
            // CityJSON describes only surfaces whose class has a name of its own.
            let is_unnamed = |surface: &&schema::SemanticSurface| {
                surface.kind.as_deref().is_none_or(|name| !is_written(SurfaceClass::from_name(name)))
            };
            let unnamed = surfaces().filter(is_unnamed).map(|surface| surface.attributes.len()).sum();
            self.builder.left_out("attributes of surfaces", unnamed);
        }
    }
}

/// Returns the addresses of an object, which were one object before version 1.1.
fn addresses(address: Option<Value>) -> Vec<Value> {
    match address {
        None | Some(Value::Null) => Vec::new(),
        Some(Value::Array(list)) => list,
        Some(one) => vec![one],
    }
}

fn apply(transform: Transform, vertex: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| vertex[i] * transform.scale[i] + transform.translate[i])
}
