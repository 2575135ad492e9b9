//! Walks over the elements of a document, and collects objects, polygons and geometries.

use city::{CityModel, Defect, DefectCode, GeometryKind, Lod, ModelPoint, ObjectKind, SurfaceClass, VertexPool};

use super::appearance::OpenAppearance;
use super::assemble::{Found, assemble};
use super::attributes::Attributes;
use super::boundary::Boundary;
use super::implicit::{Field, Implicit};
use super::links::{Group, Member, Named, Target};
use super::open_polygon::OpenPolygon;
use super::paint::Polygon;
use super::properties::{Ended, Property, add};
use crate::builder::Builder;
use crate::crs_name::crs_reference;
use crate::error::CityFault;

/// Properties whose child is a city object: properties of the model, and of buildings, bridges and
/// tunnels in CityGML 1 to 3.
const OBJECT_PROPERTIES: [&str; 22] = [
    "cityObjectMember",
    "featureMember",
    "consistsOfBuildingPart",
    "outerBuildingInstallation",
    "interiorBuildingInstallation",
    "interiorRoom",
    "interiorFurniture",
    "roomInstallation",
    "buildingPart",
    "buildingInstallation",
    "buildingRoom",
    "buildingFurniture",
    "buildingSubdivision",
    "buildingConstructiveElement",
    "consistsOfBridgePart",
    "outerBridgeInstallation",
    "outerBridgeConstruction",
    "bridgePart",
    "bridgeInstallation",
    "consistsOfTunnelPart",
    "outerTunnelInstallation",
    "tunnelPart",
];
/// Properties whose child is a surface with a class.
const SURFACE_PROPERTIES: [&str; 4] = ["boundedBy", "boundary", "opening", "fillingSurface"];
/// Elements of the outer boundary of a polygon or solid, GML 3 and 2.
const OUTER: [&str; 2] = ["exterior", "outerBoundaryIs"];
/// Elements of an inner boundary of a polygon or solid, GML 3 and 2.
const INNER: [&str; 2] = ["interior", "innerBoundaryIs"];

/// The state of the walk.
#[derive(Debug, Default)]
pub(super) struct Walker {
    builder: Builder,
    pool: VertexPool,
    stack: Vec<Frame>,
    /// Object that the walk is in.
    object: Option<usize>,
    /// Boundary surface that the walk is in.
    boundary: Boundary,
    srs_name: Option<String>,
    found: Found,
    /// State within a geometry property, while the walk is in one.
    geometry: Option<Progress>,
    /// Attribute or address of the object or the boundary surface, while the walk is in one.
    property: Option<Property>,
    /// Appearance that the walk is in.
    appearance: Option<OpenAppearance>,
}

/// An open element.
#[derive(Debug)]
struct Frame {
    name: String,
    id: Option<String>,
    /// Value of its `srsDimension`.
    dimension: Option<usize>,
    mark: Mark,
}

/// What the end of an element undoes or finishes.
#[derive(Debug)]
enum Mark {
    Nothing,
    /// Part of an attribute or an address.
    Property,
    /// An appearance or part of one.
    Appearance,
    Object {
        before: Option<usize>,
    },
    Boundary {
        before: Boundary,
    },
    Geometry,
    /// Surfaces that a link can lead to as a whole, from this member on.
    Members {
        first: usize,
    },
    Orientable {
        before: bool,
    },
    Polygon,
    Ring,
    Positions {
        text: String,
    },
    /// Text of an implicit geometry.
    Implicit {
        field: Field,
        text: String,
    },
}

/// State within a geometry property.
#[derive(Debug, Default)]
struct Progress {
    solids: u32,
    shell: u32,
    turned: bool,
    polygon: Option<OpenPolygon>,
    implicit: Option<Implicit>,
}

impl Walker {
    /// Returns the number of open elements.
    pub(super) fn depth(&self) -> usize {
        self.stack.len()
    }

    /// Begins an element.
    pub(super) fn start(&mut self, name: &str, attributes: &Attributes, line: usize) -> Result<(), CityFault> {
        if self.srs_name.is_none() {
            self.srs_name = attributes.get("srsName").map(str::to_owned);
        }
        let id = attributes.get("id").map(str::to_owned);
        let dimension = attributes.get("srsDimension").and_then(|text| text.parse().ok());
        let mark = if let Some(property) = &mut self.property {
            property.start(name, attributes);
            Mark::Property
        } else if let Some(appearance) = &mut self.appearance {
            appearance.start(name, attributes);
            Mark::Appearance
        } else if self.geometry.is_some() {
            self.start_in_geometry(name, attributes, line)
        } else {
            self.start_outside(name, id.as_deref(), attributes, line)
        };
        self.stack.push(Frame { name: name.to_owned(), id, dimension, mark });
        Ok(())
    }

    fn parent(&self) -> &str {
        self.stack.last().map_or("", |frame| &frame.name)
    }

    /// Begins an element outside a geometry: an object, a boundary surface, or a geometry property.
    fn start_outside(&mut self, name: &str, id: Option<&str>, attributes: &Attributes, line: usize) -> Mark {
        let link = attributes.get("href");
        if name == "Appearance" && self.parent().starts_with("appearance") {
            self.appearance = Some(OpenAppearance::default());
            return Mark::Appearance;
        }
        if OBJECT_PROPERTIES.contains(&self.parent()) {
            let id = id.map_or_else(|| format!("{name} in line {line}"), str::to_owned);
            let object = self.builder.object(id, ObjectKind::new(name.to_owned()));
            if let Some(parent) = self.object {
                let parent = self.builder.object_mut(parent).id.clone();
                self.builder.parent(object, parent);
            }
            return Mark::Object { before: self.object.replace(object) };
        }
        if SURFACE_PROPERTIES.contains(&self.parent()) && name != "Envelope" && name != "Null" {
            let boundary = self.found.surfaces.boundary(SurfaceClass::from_name(name));
            return Mark::Boundary { before: std::mem::replace(&mut self.boundary, boundary) };
        }
        match (self.object, lod_of_property(name)) {
            (Some(object), Some(lod)) => {
                let kind = GeometryKind::MultiSurface;
                let in_boundary = self.boundary.class != SurfaceClass::Unclassified;
                self.found.groups.push(Group {
                    object,
                    lod,
                    kind,
                    in_boundary,
                    members: Vec::new(),
                    implicit: None,
                    line,
                });
                let implicit = name.ends_with("ImplicitRepresentation").then(Implicit::default);
                let is_link_to_surfaces = implicit.is_none();
                self.geometry = Some(Progress { implicit, ..Progress::default() });
                if let Some(link) = link.filter(|_| is_link_to_surfaces) {
                    self.member(Target::Link(link.to_owned()), line);
                }
                Mark::Geometry
            }
            _ if self.is_attribute(name) => {
                self.property = Some(Property::new(name, attributes));
                Mark::Property
            }
            _ => Mark::Nothing,
        }
    }

    /// Returns whether an element is an attribute or an address of the object or the boundary
    /// surface that it is a child of.
    fn is_attribute(&self, name: &str) -> bool {
        let holds_more = OBJECT_PROPERTIES.contains(&name) || SURFACE_PROPERTIES.contains(&name);
        let of_owner =
            self.stack.last().is_some_and(|frame| matches!(frame.mark, Mark::Object { .. } | Mark::Boundary { .. }));
        of_owner && !holds_more && !name.starts_with("lod") && !name.starts_with("appearance")
    }

    /// Begins an element within a geometry property.
    fn start_in_geometry(&mut self, name: &str, attributes: &Attributes, line: usize) -> Mark {
        let in_polygon = self.geometry.as_ref().is_some_and(|g| g.polygon.is_some());
        let parent = self.parent().to_owned();
        let first = self.found.groups.last().map_or(0, |group| group.members.len());
        if let Some(field) = self.field(name).filter(|_| !in_polygon) {
            return Mark::Implicit { field, text: String::new() };
        }
        if ["SimpleTexture", "Material"].contains(&name) {
            self.builder.left_out("appearances of textured surfaces", 1);
        }
        let in_reference = name == "referencePoint" || parent == "referencePoint";
        if let (Some(link), false) = (attributes.get("href"), in_polygon || in_reference) {
            self.member(Target::Link(link.to_owned()), line);
        }
        let (Some(progress), Some(group)) = (&mut self.geometry, self.found.groups.last_mut()) else {
            return Mark::Nothing;
        };
        match name {
            "Solid" => {
                group.kind = if group.kind.is_solid() { group.kind } else { GeometryKind::Solid };
                (progress.solids, progress.shell) = (progress.solids + 1, 0);
                Mark::Members { first }
            }
            "MultiSolid" => {
                group.kind = GeometryKind::MultiSolid;
                Mark::Members { first }
            }
            "CompositeSolid" => {
                group.kind = GeometryKind::CompositeSolid;
                Mark::Members { first }
            }
            "ImplicitGeometry" => {
                progress.implicit.get_or_insert_default();
                Mark::Nothing
            }
            "OrientableSurface" => {
                let turned = attributes.get("orientation") == Some("-");
                let before = progress.turned;
                progress.turned ^= turned;
                Mark::Orientable { before }
            }
            "Polygon" | "Triangle" | "Rectangle" | "PolygonPatch" if !in_polygon => {
                progress.polygon = Some(OpenPolygon::new(line));
                Mark::Polygon
            }
            "LinearRing" => match &mut progress.polygon {
                Some(polygon) => {
                    polygon.ring = Some(Vec::new());
                    Mark::Ring
                }
                None => Mark::Nothing,
            },
            "posList" | "pos" | "coordinates" if in_polygon => Mark::Positions { text: String::new() },
            _ if !in_polygon && parent == "Solid" && INNER.contains(&name) => {
                progress.shell += 1;
                Mark::Members { first }
            }
            _ if !in_polygon && !OUTER.contains(&name) => Mark::Members { first },
            _ => Mark::Nothing,
        }
    }

    /// Returns the field of an implicit geometry that an element is.
    fn field(&self, name: &str) -> Option<Field> {
        self.geometry.as_ref()?.implicit.as_ref()?;
        Field::of(name, self.stack.iter().map(|frame| frame.name.as_str()))
    }

    /// Adds text to the open element, if its text is read.
    pub(super) fn text(&mut self, text: &str) {
        if let Some(property) = &mut self.property {
            return property.text(text);
        }
        if let Some(appearance) = &mut self.appearance {
            return appearance.text(text);
        }
        let frame = self.stack.last_mut();
        if let Some(Mark::Positions { text: so_far } | Mark::Implicit { text: so_far, .. }) = frame.map(|f| &mut f.mark)
        {
            so_far.push_str(text);
        }
    }

    /// Ends the open element.
    pub(super) fn end(&mut self) {
        let Some(frame) = self.stack.pop() else { return };
        match frame.mark {
            Mark::Nothing => {}
            Mark::Property => self.end_property(),
            Mark::Appearance => self.end_appearance(),
            Mark::Object { before } => self.object = before,
            Mark::Boundary { before } => self.boundary = before,
            Mark::Geometry => self.end_geometry(),
            Mark::Members { first } => self.name_members(frame.id, first),
            Mark::Orientable { before } => {
                if let Some(progress) = &mut self.geometry {
                    progress.turned = before;
                }
                let last = self.found.groups.last().map_or(0, |group| group.members.len());
                self.name_members(frame.id, last.saturating_sub(1));
            }
            Mark::Polygon => self.end_polygon(frame.id),
            Mark::Ring => self.end_ring(frame.id),
            Mark::Positions { text } => {
                let dimension = frame.dimension.or_else(|| self.stack.iter().rev().find_map(|frame| frame.dimension));
                self.positions(&text, &frame.name, dimension.unwrap_or(3));
            }
            Mark::Implicit { field, text } => {
                if let Some(implicit) = self.geometry.as_mut().and_then(|g| g.implicit.as_mut()) {
                    implicit.take(field, &text);
                }
            }
        }
    }

    /// Ends an element of an attribute or an address.
    fn end_property(&mut self) {
        let Some(ended) = self.property.as_mut().and_then(Property::end) else { return };
        self.property = None;
        let in_boundary = self.stack.last().is_some_and(|frame| matches!(frame.mark, Mark::Boundary { .. }));
        if in_boundary {
            self.found.surfaces.add(self.boundary, ended);
        } else if let Some(object) = self.object {
            let object = self.builder.object_mut(object);
            match ended {
                Ended::Attribute(name, value) => add(&mut object.attributes, &name, value),
                Ended::Address(parts) => object.addresses.push(parts),
                Ended::Nothing => {}
            }
        }
    }

    /// Ends an element of an appearance.
    fn end_appearance(&mut self) {
        let Some(appearance) = &mut self.appearance else { return };
        if appearance.end(&mut self.found.appearances, &mut self.builder.palette) {
            self.appearance = None;
        }
    }

    /// Adds a member to the open geometry.
    fn member(&mut self, target: Target, line: usize) {
        if let (Some(progress), Some(group)) = (&self.geometry, self.found.groups.last_mut()) {
            let (shell, turned, boundary) = (progress.shell, progress.turned, self.boundary);
            let solid = progress.solids.saturating_sub(1);
            group.members.push(Member { target, solid, shell, turned, boundary, line });
        }
    }

    /// Gives an identifier to the members of the open geometry from `first` on.
    fn name_members(&mut self, id: Option<String>, first: usize) {
        let last = self.found.groups.last().map_or(0, |group| group.members.len());
        if let (Some(id), true) = (id, first < last) {
            let group = self.found.groups.len() - 1;
            self.found.named.entry(id).or_insert(Named::Members { group, first, last });
        }
    }

    /// Ends a geometry property, and drops it when it has no surface.
    fn end_geometry(&mut self) {
        let Some(Progress { implicit, .. }) = self.geometry.take() else { return };
        let Some(group) = self.found.groups.last_mut() else { return };
        if !group.members.is_empty() {
            group.implicit = implicit;
            return;
        }
        let (code, detail) = match implicit {
            Some(implicit) => implicit.without_shape(),
            None => (DefectCode::EmptyPrimitive, "the property has no surface".to_owned()),
        };
        let (object, place) = (group.object, format!("line {}", group.line));
        self.builder.dropped(code, object, place, detail);
        self.found.groups.pop();
    }

    /// Adds the numbers of `pos`, `posList` or `coordinates` to the open ring.
    fn positions(&mut self, text: &str, element: &str, dimension: usize) {
        if let Some(polygon) = self.geometry.as_mut().and_then(|g| g.polygon.as_mut()) {
            polygon.take_positions(text, element, dimension);
        }
    }

    /// Ends a ring: makes vertices of its coordinates.
    fn end_ring(&mut self, id: Option<String>) {
        let Some(polygon) = self.geometry.as_mut().and_then(|g| g.polygon.as_mut()) else { return };
        let numbers = polygon.ring.take().unwrap_or_default();
        let (points, rest) = numbers.as_chunks::<3>();
        if !rest.is_empty() {
            let detail = format!("a ring has {} numbers, which is not a multiple of three", numbers.len());
            polygon.problem.get_or_insert((DefectCode::CoordinateOutOfRange, detail));
            return;
        }
        let open = match points {
            [first, between @ .., last] if first == last && !between.is_empty() => &points[..points.len() - 1],
            _ => {
                polygon.unclosed += 1;
                points
            }
        };
        let mut ring = Vec::with_capacity(open.len());
        for &point in open {
            let known = self.builder.vertex_count();
            let index = self.pool.index(ModelPoint::from(point));
            let index =
                index.filter(|&i| (i as usize) < known || self.builder.vertex(ModelPoint::from(point)).is_some());
            match index.filter(|&index| self.builder.is_usable(index)) {
                Some(index) => ring.push(index),
                None => {
                    polygon.problem.get_or_insert((DefectCode::CoordinateOutOfRange, format!("{point:?}")));
                    return;
                }
            }
        }
        polygon.ids.extend(id.map(|id| (id, polygon.rings.len())));
        polygon.rings.push(ring);
    }

    /// Ends a polygon, and reports it when it cannot be used.
    fn end_polygon(&mut self, id: Option<String>) {
        let Some(polygon) = self.geometry.as_mut().and_then(|g| g.polygon.take()) else { return };
        let object = self.found.groups.last().map_or(0, |group| group.object);
        let place = || match &id {
            Some(id) => format!("line {}, {id}", polygon.line),
            None => format!("line {}", polygon.line),
        };
        let nothing =
            polygon.rings.is_empty().then(|| (DefectCode::EmptyPrimitive, "a polygon without rings".to_owned()));
        let usable = match polygon.problem.or(nothing) {
            Some((code, detail)) => {
                self.builder.dropped(code, object, place(), detail);
                false
            }
            None => true,
        };
        if usable && polygon.unclosed > 0 {
            self.builder.note(DefectCode::RingNotClosed, Some(object), place(), "");
        }
        let rings = if usable { polygon.rings } else { Vec::new() };
        let number = self.found.polygons.len();
        self.found.polygons.push(Polygon { rings, boundary: self.boundary, attributes: None, appearance: None });
        for (id, ring) in polygon.ids.into_iter().filter(|_| usable) {
            self.found.rings.entry(id).or_insert((number, ring));
        }
        if let Some(id) = id.clone() {
            if self.found.named.contains_key(&id) {
                self.builder.note(DefectCode::DuplicateId, Some(object), place(), "a polygon");
            }
            self.found.named.entry(id).or_insert(Named::Polygon(number));
        }
        if usable {
            self.member(Target::Polygon(number), polygon.line);
        }
    }

    /// Assembles the geometries, and returns the model and its defects.
    pub(super) fn finish(mut self) -> Result<(CityModel, Vec<Defect>), CityFault> {
        self.builder.set_crs(crs_reference(self.srs_name.as_deref().unwrap_or_default()));
        assemble(&mut self.builder, self.found)?;
        Ok(self.builder.finish())
    }
}

/// Returns the level of a property such as `lod2MultiSurface`, or `None` for a property without
/// surfaces.
fn lod_of_property(name: &str) -> Option<Lod> {
    let rest = name.strip_prefix("lod")?;
    let digit = rest.bytes().next().filter(u8::is_ascii_digit)?;
    let curves = ["TerrainIntersection", "Curve", "Network", "Point", "RoofEdge"];
    let holds_surfaces = !curves.iter().any(|curve| rest.contains(curve)) || rest.contains("RoofEdge");
    holds_surfaces.then(|| Lod::new(digit - b'0', None))
}
