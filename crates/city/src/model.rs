//! The city model: objects, their geometries per level of detail, and the polygons of their
//! surfaces.
//!
//! All surfaces share one list of vertices, and rings are indices into it. A ring is open: it does
//! not repeat its first vertex at the end. The first ring of a surface is its outer boundary,
//! counter-clockwise seen from outside. The other rings are holes.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Map, Value};

use crate::{Appearance, CrsReference, Lod, ModelError, ModelPoint, ObjectKind, SurfaceAppearance, SurfaceClass};

/// Content of a city model file.
#[derive(Debug, Clone, Default)]
pub struct CityModel {
    /// Reference system of the coordinates.
    pub crs: CrsReference,
    /// Vertices of all surfaces.
    pub vertices: Vec<ModelPoint>,
    /// Objects in the order of the file.
    pub objects: Vec<CityObject>,
    /// Materials and textures that surfaces refer to.
    pub appearance: Appearance,
    /// Things of the file that the model does not hold, such as georeferenced textures, by their
    /// kind with their number.
    pub left_out: BTreeMap<String, usize>,
}

/// An object of the city: a building, a part of one, a road.
#[derive(Debug, Clone)]
pub struct CityObject {
    /// Identifier in the file.
    pub id: String,
    /// Kind of the object.
    pub kind: ObjectKind,
    /// Index in [`CityModel::objects`] of the object that this one is a part of.
    pub parent: Option<usize>,
    /// Attributes, also generic ones, by their names in the file.
    pub attributes: Map<String, Value>,
    /// Addresses as CityJSON has them.
    pub addresses: Vec<Value>,
    /// Shapes of the object. A level of detail may have several.
    pub geometries: Vec<Geometry>,
}

/// A shape of an object at one level of detail.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// Level of detail, if the file names it.
    pub lod: Option<Lod>,
    /// How the surfaces belong together.
    pub kind: GeometryKind,
    /// Surfaces; in a solid they are ordered by [`SurfacePolygon::solid`] and
    /// [`SurfacePolygon::shell`].
    pub surfaces: Vec<SurfacePolygon>,
}

/// How the surfaces of a geometry belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GeometryKind {
    /// Surfaces that need not be connected.
    MultiSurface,
    /// Connected surfaces.
    CompositeSurface,
    /// One solid with an outer shell and any number of cavities.
    Solid,
    /// Several solids.
    MultiSolid,
    /// Several solids that share faces.
    CompositeSolid,
}

/// Polygon of a surface, with its class.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SurfacePolygon {
    /// Outer ring and holes: indices of vertices; the first one is not repeated at the end.
    pub rings: Vec<Vec<u32>>,
    /// Class of the surface.
    pub class: SurfaceClass,
    /// Number of the solid that it bounds within the geometry; 0 when the geometry is not a solid.
    pub solid: u32,
    /// Number of its shell within the solid; 0 is the outer shell.
    pub shell: u32,
    /// Attributes of the surface by their names in the file, if it has any. Surfaces that the file
    /// describes together share them.
    pub attributes: Option<Arc<Map<String, Value>>>,
    /// Materials and textures of the surface, if it has any. Instances of a surface share them.
    pub appearance: Option<Arc<SurfaceAppearance>>,
}

impl CityModel {
    /// Creates an empty model.
    pub fn new(crs: CrsReference) -> Self {
        Self { crs, ..Self::default() }
    }

    /// Returns the lowest and the highest coordinates of the vertices that a surface uses.
    ///
    /// Returns `None` when no surface uses a finite vertex.
    pub fn bounds(&self) -> Option<(ModelPoint, ModelPoint)> {
        let rings = self.surfaces().flat_map(|surface| surface.rings.iter().flatten());
        let used = rings.filter_map(|&i| self.vertices.get(i as usize)).filter(|p| p.is_finite());
        used.fold(None, |bounds, p| {
            let (low, high) = bounds.unwrap_or((*p, *p));
            Some((
                ModelPoint::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z)),
                ModelPoint::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z)),
            ))
        })
    }

    /// Iterates over the surfaces of all geometries.
    pub fn surfaces(&self) -> impl Iterator<Item = &SurfacePolygon> {
        self.objects.iter().flat_map(|object| &object.geometries).flat_map(|geometry| &geometry.surfaces)
    }

    /// Returns the index of the topmost ancestor of an object, or `object` itself when it has no
    /// parent.
    pub fn root(&self, object: usize) -> usize {
        let mut at = object;
        // A longer chain than this is a circle, which `validate` reports.
        for _ in 0..self.objects.len() {
            match self.objects.get(at).and_then(|o| o.parent) {
                Some(parent) => at = parent,
                None => return at,
            }
        }
        object
    }

    /// Checks the invariants of a model: coordinates are finite, indices are in range, each surface
    /// has an outer ring, textures have a coordinate per vertex, and no object is its own ancestor.
    ///
    /// # Errors
    /// [`ModelError`] with the first violation.
    pub fn validate(&self) -> Result<(), ModelError> {
        if let Some(vertex) = self.vertices.iter().position(|p| !p.is_finite()) {
            return Err(ModelError::NotFinite { vertex });
        }
        for object in &self.objects {
            if object.parent.is_some_and(|parent| parent >= self.objects.len()) {
                return Err(ModelError::ParentIndex { object: object.id.clone() });
            }
            for surface in object.geometries.iter().flat_map(|geometry| &geometry.surfaces) {
                self.validate_surface(surface, &object.id)?;
            }
        }
        match self.parent_circle() {
            Some(object) => Err(ModelError::ParentCircle { object: self.objects[object].id.clone() }),
            None => Ok(()),
        }
    }

    /// Finds an object that is its own ancestor, in time proportional to the number of objects.
    fn parent_circle(&self) -> Option<usize> {
        // 0 means unseen; any other number is the walk that reached the object first, plus one.
        let mut seen = vec![0usize; self.objects.len()];
        for start in 0..self.objects.len() {
            let mut at = Some(start);
            while let Some(object) = at.filter(|&object| seen[object] == 0) {
                seen[object] = start + 1;
                at = self.objects[object].parent;
            }
            if let Some(object) = at.filter(|&object| seen[object] == start + 1) {
                return Some(object);
            }
        }
        None
    }

    fn validate_surface(&self, surface: &SurfacePolygon, object: &str) -> Result<(), ModelError> {
        if surface.rings.is_empty() {
            return Err(ModelError::NoRing { object: object.to_owned() });
        }
        if surface.appearance.as_ref().is_some_and(|found| !found.fits(&self.appearance, &surface.rings)) {
            return Err(ModelError::Appearance { object: object.to_owned() });
        }
        match surface.rings.iter().flatten().find(|&&i| i as usize >= self.vertices.len()) {
            Some(&index) => {
                Err(ModelError::VertexIndex { object: object.to_owned(), index, vertices: self.vertices.len() })
            }
            None => Ok(()),
        }
    }
}

impl CityObject {
    /// Creates an object without parent and geometry.
    pub fn new(id: impl Into<String>, kind: ObjectKind) -> Self {
        Self {
            id: id.into(),
            kind,
            parent: None,
            attributes: Map::new(),
            addresses: Vec::new(),
            geometries: Vec::new(),
        }
    }
}

impl Geometry {
    /// Creates a geometry without surfaces.
    pub fn new(lod: Option<Lod>, kind: GeometryKind) -> Self {
        Self { lod, kind, surfaces: Vec::new() }
    }
}

impl GeometryKind {
    /// Returns whether the surfaces bound volumes.
    pub fn is_solid(self) -> bool {
        matches!(self, Self::Solid | Self::MultiSolid | Self::CompositeSolid)
    }

    /// Returns the name in CityGML and CityJSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::MultiSurface => "MultiSurface",
            Self::CompositeSurface => "CompositeSurface",
            Self::Solid => "Solid",
            Self::MultiSolid => "MultiSolid",
            Self::CompositeSolid => "CompositeSolid",
        }
    }
}

impl SurfacePolygon {
    /// Creates a surface of the first solid and its outer shell.
    pub fn new(rings: Vec<Vec<u32>>, class: SurfaceClass) -> Self {
        Self { rings, class, solid: 0, shell: 0, attributes: None, appearance: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one_triangle() -> CityModel {
        let mut model = CityModel::new(CrsReference::from_epsg(25832, None));
        model.vertices = vec![
            ModelPoint::new(0.0, 0.0, 1.0),
            ModelPoint::new(4.0, 0.0, 1.0),
            ModelPoint::new(0.0, 3.0, 2.0),
            ModelPoint::new(99.0, 99.0, 99.0),
        ];
        let mut object = CityObject::new("a", ObjectKind::BUILDING);
        let mut geometry = Geometry::new(Some(Lod::new(2, None)), GeometryKind::MultiSurface);
        geometry.surfaces.push(SurfacePolygon::new(vec![vec![0, 1, 2]], SurfaceClass::Roof));
        object.geometries.push(geometry);
        model.objects.push(object);
        model
    }

    #[test]
    fn bounds_leave_out_unused_vertices() {
        let (low, high) = one_triangle().bounds().unwrap();
        assert_eq!((low, high), (ModelPoint::new(0.0, 0.0, 1.0), ModelPoint::new(4.0, 3.0, 2.0)));
        assert!(CityModel::default().bounds().is_none());
    }

    #[test]
    fn broken_models_are_found() {
        assert_eq!(one_triangle().validate(), Ok(()));
        let broken = |change: fn(&mut CityModel)| {
            let mut model = one_triangle();
            change(&mut model);
            model.validate().unwrap_err()
        };
        assert!(matches!(broken(|m| m.vertices[3].z = f64::NAN), ModelError::NotFinite { vertex: 3 }));
        assert!(matches!(broken(|m| m.vertices.truncate(2)), ModelError::VertexIndex { index: 2, vertices: 2, .. }));
        assert!(matches!(broken(|m| m.objects[0].parent = Some(1)), ModelError::ParentIndex { .. }));
        assert!(matches!(broken(|m| m.objects[0].parent = Some(0)), ModelError::ParentCircle { .. }));
        assert!(matches!(broken(|m| m.objects[0].geometries[0].surfaces[0].rings.clear()), ModelError::NoRing { .. }));
        let painted = |m: &mut CityModel| {
            let mut appearance = SurfaceAppearance::default();
            appearance.set_material(0, 0);
            m.objects[0].geometries[0].surfaces[0].appearance = Some(Arc::new(appearance));
        };
        assert!(matches!(broken(painted), ModelError::Appearance { .. }));
    }

    #[test]
    fn the_root_is_the_topmost_ancestor() {
        let mut model = one_triangle();
        for parent in [0, 1] {
            let mut part = CityObject::new(format!("part of {parent}"), ObjectKind::BUILDING_PART);
            part.parent = Some(parent);
            model.objects.push(part);
        }
        assert_eq!([0, 1, 2].map(|i| model.root(i)), [0, 0, 0]);
        assert_eq!(model.validate(), Ok(()));
    }
}
