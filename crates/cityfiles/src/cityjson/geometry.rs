//! The surfaces of a CityJSON geometry, from its nested boundaries and semantics.

use city::{DefectCode, Geometry, GeometryKind, Lod, SurfaceClass, SurfacePolygon};

use super::appearance::{Numbers, Themes};
use super::schema::{Nested, SemanticSurface, Semantics, Shape};
use crate::builder::Builder;

/// Object and number of a geometry, for its defects.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) object: usize,
    pub(super) geometry: usize,
}

impl Place {
    fn text(self) -> String {
        format!("geometry {}", self.geometry)
    }

    fn surface(self, surface: usize) -> String {
        format!("geometry {}, surface {surface}", self.geometry)
    }
}

/// Returns the kind of a geometry of surfaces, or `None` for points and lines.
pub(super) fn surface_kind(name: &str) -> Option<GeometryKind> {
    use GeometryKind::{CompositeSolid, CompositeSurface, MultiSolid, MultiSurface, Solid};
    [MultiSurface, CompositeSurface, Solid, MultiSolid, CompositeSolid].into_iter().find(|kind| kind.name() == name)
}

/// Adds a geometry to its object. Surfaces that cannot be used become defects. `numbers` are of the
/// document that holds the shape.
pub(super) fn add(
    builder: &mut Builder,
    shape: &Shape,
    numbers: &Numbers,
    vertex_at: impl FnMut(u64) -> Option<u32>,
    place: Place,
) {
    let name = shape.kind.as_deref().unwrap_or_default();
    let Some(kind) = surface_kind(name) else {
        let detail = if name.is_empty() { "the geometry has no type" } else { name };
        return builder.dropped(DefectCode::NotASurface, place.object, place.text(), detail);
    };
    let themes = Themes::of(builder, shape, numbers);
    let mut unroll = Unroll { builder, vertex_at, themes, place, path: Vec::new(), found: Vec::new() };
    let depth = match kind {
        GeometryKind::MultiSurface | GeometryKind::CompositeSurface => 0,
        GeometryKind::Solid => 1,
        GeometryKind::MultiSolid | GeometryKind::CompositeSolid => 2,
    };
    unroll.level(
        &shape.boundaries,
        depth,
        Member { solid: 0, shell: 0 },
        shape.semantics.as_ref().map(|s| (s, &s.values)),
    );
    let surfaces = unroll.found;
    if surfaces.is_empty() {
        return builder.dropped(DefectCode::EmptyPrimitive, place.object, place.text(), "");
    }
    let lod = lod_of(builder, shape, place);
    let mut geometry = Geometry::new(lod, kind);
    geometry.surfaces = surfaces;
    builder.object_mut(place.object).geometries.push(geometry);
}

fn lod_of(builder: &mut Builder, shape: &Shape, place: Place) -> Option<Lod> {
    let text = shape.lod.as_ref().map(ToString::to_string);
    let lod = text.as_deref().and_then(|text| text.parse().ok());
    if lod.is_none() {
        builder.note(DefectCode::LodUnknown, Some(place.object), place.text(), text.unwrap_or_default());
    }
    lod
}

/// Numbers of the solid and the shell that a surface belongs to.
#[derive(Clone, Copy)]
struct Member {
    solid: u32,
    shell: u32,
}

/// The walk over the boundaries of a geometry.
struct Unroll<'a, F> {
    builder: &'a mut Builder,
    vertex_at: F,
    themes: Themes<'a>,
    place: Place,
    /// Numbers of the solid, shell and surface, as deep as the boundaries are nested.
    path: Vec<usize>,
    found: Vec<SurfacePolygon>,
}

/// The semantics of a geometry, and their values at the level of the walk.
type Values<'a> = Option<(&'a Semantics, &'a Nested)>;

impl<F: FnMut(u64) -> Option<u32>> Unroll<'_, F> {
    /// Descends `depth` levels of solids and shells to the lists of surfaces.
    fn level(&mut self, boundaries: &Nested, depth: u8, member: Member, values: Values<'_>) {
        if matches!(boundaries, Nested::List(list) if list.is_empty()) && depth == 1 {
            let place = format!("{}, solid {}", self.place.text(), member.solid);
            self.builder.dropped(DefectCode::EmptyPrimitive, self.place.object, place, "");
        }
        for (i, below) in boundaries.list().iter().enumerate() {
            let number = i as u32;
            let value = values.and_then(|(semantics, nested)| Some((semantics, nested.list().get(i)?)));
            self.path.push(i);
            match depth {
                0 => self.surface(below, member, value),
                1 => self.level(below, 0, Member { shell: number, ..member }, value),
                _ => self.level(below, depth - 1, Member { solid: number, shell: 0 }, value),
            }
            self.path.pop();
        }
    }

    /// Adds a surface, or a defect when it cannot be used.
    fn surface(&mut self, rings: &Nested, Member { solid, shell }: Member, value: Values<'_>) {
        let number = self.found.len();
        match self.rings(rings) {
            Ok(rings) => {
                let described = value.and_then(|(semantics, value)| self.described(semantics, value, number));
                let class = described.and_then(|surface| surface.kind.as_deref()).map(SurfaceClass::from_name);
                let attributes = described.map(|surface| &surface.attributes).filter(|found| !found.is_empty());
                let appearance = self.themes.of_surface(self.builder, &self.path, &rings);
                self.found.push(SurfacePolygon {
                    rings,
                    class: class.unwrap_or(SurfaceClass::Unclassified),
                    solid,
                    shell,
                    attributes: attributes.cloned(),
                    appearance,
                });
            }
            Err((code, detail)) => {
                self.builder.dropped(code, self.place.object, self.place.surface(number), detail);
            }
        }
    }

    fn rings(&mut self, rings: &Nested) -> Result<Vec<Vec<u32>>, (DefectCode, String)> {
        let list = rings.list();
        if list.is_empty() {
            return Err((DefectCode::EmptyPrimitive, "a surface without rings".to_owned()));
        }
        list.iter().map(|ring| ring.list().iter().map(|index| self.vertex(index)).collect()).collect()
    }

    fn vertex(&mut self, index: &Nested) -> Result<u32, (DefectCode, String)> {
        let Nested::Index(index) = *index else {
            return Err((DefectCode::VertexOutOfRange, "a ring has an element that is not an index".to_owned()));
        };
        let vertex =
            (self.vertex_at)(index).ok_or_else(|| (DefectCode::VertexOutOfRange, format!("vertex {index}")))?;
        if !self.builder.is_usable(vertex) {
            return Err((DefectCode::CoordinateOutOfRange, format!("vertex {index}")));
        }
        Ok(vertex)
    }

    /// Returns the description of a surface, which names its class; a defect is noted for a number
    /// without one.
    fn described<'s>(
        &mut self,
        semantics: &'s Semantics,
        value: &Nested,
        surface: usize,
    ) -> Option<&'s SemanticSurface> {
        let found = match value {
            Nested::Null => return None,
            Nested::Index(index) => usize::try_from(*index).ok().and_then(|i| semantics.surfaces.get(i)),
            _ => None,
        };
        let found = found.filter(|surface| surface.kind.is_some());
        if found.is_none() {
            let place = self.place.surface(surface);
            self.builder.note(DefectCode::SemanticsMismatch, Some(self.place.object), place, "");
        }
        found
    }
}
