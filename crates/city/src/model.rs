//! The city model: objects, their geometries per level of detail, and the polygons of their surfaces.
//!
//! Vertices are held once for the whole model and rings are indices into them. A ring is open: its last vertex is not its
//! first. The first ring of a surface is its outer boundary, counter-clockwise seen from outside; the others are holes.

use crate::{CrsReference, Lod, ModelError, ModelPoint, ObjectKind, SurfaceClass};

/// A city model as a file holds it.
#[derive(Debug, Clone, Default)]
pub struct CityModel {
    /// Where the coordinates are.
    pub crs: CrsReference,
    /// The vertices of all surfaces.
    pub vertices: Vec<ModelPoint>,
    /// The objects, in the order of the file.
    pub objects: Vec<CityObject>,
}

/// An object of the city: a building, a part of one, a road.
#[derive(Debug, Clone)]
pub struct CityObject {
    /// Its identifier in the file.
    pub id: String,
    /// What it is.
    pub kind: ObjectKind,
    /// Index in [`CityModel::objects`] of the object it is a part of.
    pub parent: Option<usize>,
    /// Its shapes, at most a few: one per level of detail, or several of one level.
    pub geometries: Vec<Geometry>,
}

/// A shape of an object at one level of detail.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// Level of detail, where the file says.
    pub lod: Option<Lod>,
    /// Whether the surfaces bound a solid.
    pub kind: GeometryKind,
    /// The surfaces; those of a solid are ordered by [`Surface::solid`] and [`Surface::shell`].
    pub surfaces: Vec<Surface>,
}

/// How the surfaces of a geometry belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GeometryKind {
    /// Surfaces that claim no connection.
    MultiSurface,
    /// Surfaces that claim to be connected.
    CompositeSurface,
    /// One solid with an outer shell and possibly inner ones.
    Solid,
    /// Several solids.
    MultiSolid,
    /// Several solids that claim to touch.
    CompositeSolid,
}

/// A polygon with a class.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Surface {
    /// Outer ring and holes: indices of vertices, without the repeated last one.
    pub rings: Vec<Vec<u32>>,
    /// What the surface is.
    pub class: SurfaceClass,
    /// Which solid of the geometry it bounds, 0 for geometries that are no solids.
    pub solid: u32,
    /// Which shell of the solid it belongs to: 0 is the outer one.
    pub shell: u32,
}

impl CityModel {
    /// An empty model.
    pub fn new(crs: CrsReference) -> Self {
        Self { crs, ..Self::default() }
    }

    /// The smallest and the largest coordinates of the vertices that any surface uses.
    ///
    /// `None` without a finite vertex in use.
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

    /// Every surface of every geometry.
    pub fn surfaces(&self) -> impl Iterator<Item = &Surface> {
        self.objects.iter().flat_map(|object| &object.geometries).flat_map(|geometry| &geometry.surfaces)
    }

    /// Index of the building that an object belongs to: its topmost ancestor, or itself.
    pub fn root(&self, object: usize) -> usize {
        let mut at = object;
        // A chain longer than the number of objects is a circle, which `validate` reports.
        for _ in 0..self.objects.len() {
            match self.objects.get(at).and_then(|o| o.parent) {
                Some(parent) => at = parent,
                None => return at,
            }
        }
        object
    }

    /// Checks what every user of a model may rely on.
    ///
    /// # Errors
    /// A coordinate that is not finite, an index of a vertex or a parent that is out of range, a circle of parents, or a
    /// surface without an outer ring.
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

    /// An object that is its own ancestor, in time proportional to the number of objects.
    fn parent_circle(&self) -> Option<usize> {
        // 0 is unseen; any other number is the walk that came by first.
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

    fn validate_surface(&self, surface: &Surface, object: &str) -> Result<(), ModelError> {
        if surface.rings.is_empty() {
            return Err(ModelError::NoRing { object: object.to_owned() });
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
    /// An object without parent and geometry.
    pub fn new(id: impl Into<String>, kind: ObjectKind) -> Self {
        Self { id: id.into(), kind, parent: None, geometries: Vec::new() }
    }
}

impl Geometry {
    /// A geometry without surfaces.
    pub fn new(lod: Option<Lod>, kind: GeometryKind) -> Self {
        Self { lod, kind, surfaces: Vec::new() }
    }
}

impl GeometryKind {
    /// Whether the surfaces bound volumes.
    pub fn is_solid(self) -> bool {
        matches!(self, Self::Solid | Self::MultiSolid | Self::CompositeSolid)
    }

    /// The name in CityGML and CityJSON.
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

impl Surface {
    /// A surface of a geometry's first solid and outer shell.
    pub fn new(rings: Vec<Vec<u32>>, class: SurfaceClass) -> Self {
        Self { rings, class, solid: 0, shell: 0 }
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
        geometry.surfaces.push(Surface::new(vec![vec![0, 1, 2]], SurfaceClass::Roof));
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
