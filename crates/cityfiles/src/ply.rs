//! Reads PLY meshes, text and binary: the positions of `vertex` and the polygons of `face`.
//!
//! Two comments are read: `origin x y z`, which the positions are relative to, and `crs EPSG:n`.
//! When a file has both, as the files of this toolkit do, the property `class` of a face is the
//! class of its surface. Everything else is skipped.
//!
//! Counts are checked against the size of the file before anything is allocated.

use city::{CrsReference, DefectCode, Geometry, GeometryKind, ModelPoint, ObjectKind, SurfaceClass, SurfacePolygon};
use formats::ply::{PlyBody, PlyElement, PlyFault, PlyHeader};

use super::builder::Builder;
use super::crs_name::crs_reference;
use super::error::CityFault;
use super::format::{CityFormat, Parsed};

impl From<PlyFault> for CityFault {
    fn from(PlyFault { what, place, is_unsupported }: PlyFault) -> Self {
        if is_unsupported { Self::unsupported(what, place) } else { Self::invalid(what, place) }
    }
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, CityFault> {
    let header = PlyHeader::parse(bytes)?;
    // The name `unknown` stands for none.
    let reference = |name| if name == "unknown" { CrsReference::default() } else { crs_reference(name) };
    let (origin, crs) = (header.origin(), header.crs().map(reference));
    let mut reader = Reader {
        body: PlyBody::new(bytes, &header),
        builder: Builder::default(),
        origin: origin.unwrap_or_default(),
        has_classes: origin.is_some() && crs.is_some(),
    };
    reader.builder.set_crs(crs.unwrap_or_default());
    let object = reader.builder.object("model", ObjectKind::BUILDING);
    reader.builder.object_mut(object).geometries.push(Geometry::new(None, GeometryKind::MultiSurface));
    for element in &header.elements {
        reader.element(element, object)?;
    }
    let (model, defects) = reader.builder.finish();
    Ok(Parsed { model, format: CityFormat::Ply, defects })
}

/// The points of a file, and its header.
#[derive(Debug)]
pub(crate) struct PlyPoints {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) header: PlyHeader,
    /// Whether the file has polygons too.
    pub(crate) has_faces: bool,
}

/// Reads the vertices of a cloud, without adding an origin. A position that is not finite is a
/// fault.
pub(crate) fn points(bytes: &[u8]) -> Result<PlyPoints, CityFault> {
    let header = PlyHeader::parse(bytes)?;
    let mut body = PlyBody::new(bytes, &header);
    let has_faces = header.elements.iter().any(|element| element.name == "face" && element.count > 0);
    let mut positions = Vec::new();
    for element in header.elements.iter().take_while(|element| element.name != "face") {
        let axes = axes(&body, element)?;
        let is_vertex = element.name == "vertex";
        for number in 0..element.count {
            let mut point = [0.0; 3];
            for (property, axis) in element.properties.iter().zip(&axes) {
                match axis {
                    Some(axis) => point[*axis] = body.number(property.value)?,
                    None => body.skip(property)?,
                }
            }
            if is_vertex && !point.iter().all(|c| c.is_finite()) {
                return Err(CityFault::invalid(
                    format!("the position {point:?} is not finite"),
                    format!("vertex {number}"),
                ));
            }
            if is_vertex {
                positions.push(point);
            }
        }
    }
    Ok(PlyPoints { positions, header, has_faces })
}

/// Checks that the rest of the file can hold all of an element, and returns per property the axis
/// that it is.
fn axes(body: &PlyBody<'_>, element: &PlyElement) -> Result<Vec<Option<usize>>, CityFault> {
    body.check(element)?;
    let axis = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
    let axes = element.properties.iter().map(|property| axis(&property.name).filter(|_| property.count.is_none()));
    let axes: Vec<Option<usize>> = axes.collect();
    if element.name == "vertex" && element.count > 0 && (0..3).any(|axis| !axes.contains(&Some(axis))) {
        return Err(CityFault::invalid("the vertices do not have the properties x, y and z", "header"));
    }
    Ok(axes)
}

/// Reads elements into a model.
struct Reader<'a> {
    body: PlyBody<'a>,
    builder: Builder,
    origin: [f64; 3],
    /// Whether the `class` of a face is the class of a surface.
    has_classes: bool,
}

impl Reader<'_> {
    fn element(&mut self, element: &PlyElement, object: usize) -> Result<(), CityFault> {
        let axes = axes(&self.body, element)?;
        let is_vertex = element.name == "vertex";
        for number in 0..element.count {
            let mut point = [0.0; 3];
            let (mut ring, mut class) = (None, SurfaceClass::Unclassified);
            for (property, axis) in element.properties.iter().zip(&axes) {
                let is_ring = element.name == "face" && matches!(&*property.name, "vertex_indices" | "vertex_index");
                match (property.count, axis) {
                    (Some(count), _) if is_ring => ring = Some(self.body.list(count, property.value)?),
                    (None, &Some(axis)) => point[axis] = self.body.number(property.value)?,
                    (None, None) if self.has_classes && property.name == "class" => {
                        let value = self.body.number(property.value)?;
                        class = SurfaceClass::from_number(value as u8).unwrap_or_default();
                    }
                    _ => self.body.skip(property)?,
                }
            }
            if let Some(ring) = ring {
                self.face(ring, class, number, object);
            }
            if is_vertex {
                let point = [0, 1, 2].map(|i| point[i] + self.origin[i]);
                let added = self.builder.vertex(ModelPoint::from(point));
                added.ok_or_else(|| {
                    CityFault::unsupported("the model has more than 2^32 vertices, cut it into tiles", "header")
                })?;
            }
        }
        Ok(())
    }

    fn face(&mut self, corners: Vec<f64>, class: SurfaceClass, number: u64, object: usize) {
        let count = self.builder.vertex_count();
        let place = || format!("face {number}");
        let index = |corner: f64| (corner >= 0.0 && corner < count as f64).then_some(corner as u32).ok_or(corner);
        match corners.into_iter().map(index).collect::<Result<Vec<u32>, f64>>() {
            Err(corner) => {
                let detail = format!("vertex {corner}, {count} vertices so far");
                self.builder.dropped(DefectCode::VertexOutOfRange, object, place(), detail);
            }
            Ok(ring) if !ring.iter().all(|&vertex| self.builder.is_usable(vertex)) => {
                self.builder.dropped(DefectCode::CoordinateOutOfRange, object, place(), "");
            }
            Ok(ring) => {
                let surface = SurfacePolygon::new(vec![ring], class);
                self.builder.object_mut(object).geometries[0].surfaces.push(surface);
            }
        }
    }
}
