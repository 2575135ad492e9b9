//! The triangles of a city model, each with its surface, class and object.
//!
//! Positions are f64 metres from a recorded origin on whole metres, rounded to 1 µm. The same model
//! at other coordinates (another zone, another offset in whole metres) gives bit for bit the same
//! triangles. Triangles of solids are counter-clockwise seen from outside. The result does not
//! depend on the number of threads.

use rayon::prelude::*;

use crate::piece::Piece;
use crate::select::{self, Chosen, LodChoice, ObjectStatus, Scope};
use crate::{CityModel, Defect, DefectCode, Effect, Lod, ModelError, ModelPoint, SurfaceClass};
use numeric::vector::Vector;

/// Triangles of a city model with their surfaces.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Origin of the positions in the reference system of the model, on whole metres.
    pub origin: ModelPoint,
    /// Corners, metres from the origin.
    pub positions: Vec<[f64; 3]>,
    /// Corners of each triangle, as indices of positions.
    pub triangles: Vec<[u32; 3]>,
    /// Surface of each triangle, as index of `surfaces`.
    pub surface_of: Vec<u32>,
    /// Surfaces that have triangles.
    pub surfaces: Vec<MeshSurface>,
}

/// Object and class of a surface that triangles were made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshSurface {
    /// Index of the object in the model.
    pub object: u32,
    /// Class of the surface.
    pub class: SurfaceClass,
}

/// Choice of the geometries that are made into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshConfig {
    /// Level of detail of each object.
    pub lod: LodChoice,
    /// Objects.
    pub scope: Scope,
}

/// Triangles of a model, with a report on each object.
#[derive(Debug, Clone)]
pub struct MeshedModel {
    /// Triangles.
    pub mesh: TriangleMesh,
    /// Report on each object, in the order of the model.
    pub objects: Vec<ObjectReport>,
    /// Defects in the order of the objects.
    pub defects: Vec<Defect>,
}

/// Report on an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectReport {
    /// Level of detail that was used; `None` when the object was not used or the file names no
    /// level.
    pub lod: Option<Lod>,
    /// Whether it was used.
    pub status: ObjectStatus,
}

impl TriangleMesh {
    /// Makes triangles of the surfaces of a model.
    ///
    /// # Errors
    /// The errors of [`CityModel::validate`].
    ///
    /// # Examples
    /// ```
    /// use city::{
    ///     CityModel, CityObject, CrsReference, Geometry, GeometryKind, Lod, MeshConfig, ModelPoint, ObjectKind,
    ///     SurfaceClass, SurfacePolygon, TriangleMesh,
    /// };
    ///
    /// let mut model = CityModel::new(CrsReference::from_epsg(25832, Some(7837)));
    /// let corners = [[0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [4.0, 3.0, 5.0], [0.0, 3.0, 5.0]];
    /// model.vertices = corners.map(ModelPoint::from).to_vec();
    /// let mut roof = Geometry::new(Some(Lod::new(2, None)), GeometryKind::MultiSurface);
    /// roof.surfaces.push(SurfacePolygon::new(vec![vec![0, 1, 2, 3]], SurfaceClass::Roof));
    /// let mut house = CityObject::new("house", ObjectKind::BUILDING);
    /// house.geometries.push(roof);
    /// model.objects.push(house);
    ///
    /// let meshed = TriangleMesh::from_model(&model, &MeshConfig::default())?;
    /// assert_eq!(meshed.mesh.triangles.len(), 2);
    /// assert_eq!(meshed.mesh.surface(0).class, SurfaceClass::Roof);
    /// # Ok::<(), city::ModelError>(())
    /// ```
    pub fn from_model(model: &CityModel, config: &MeshConfig) -> Result<MeshedModel, ModelError> {
        model.validate()?;
        let chosen = select::choose(model, config.lod, config.scope);
        let origin = origin(model, &chosen);
        let position = positions(model, origin);
        let pieces: Vec<Option<Piece>> = chosen
            .par_iter()
            .enumerate()
            .map(|(object, chosen)| chosen.as_ref().ok().map(|&lod| Piece::new(model, object, lod, &position)))
            .collect();
        let mut merger =
            Merger { mesh: Self { origin, ..Self::default() }, corner_of: vec![u32::MAX; model.vertices.len()] };
        let mut has_parts = vec![false; model.objects.len()];
        model.objects.iter().filter_map(|object| object.parent).for_each(|parent| has_parts[parent] = true);
        let (mut objects, mut defects) = (Vec::with_capacity(chosen.len()), Vec::new());
        for (index, (chosen, piece)) in chosen.into_iter().zip(pieces).enumerate() {
            let lod = chosen.as_ref().ok().copied().flatten();
            let status = match (chosen, piece) {
                (Err(status), _) => status,
                (Ok(_), piece) => merger.add(index, piece.unwrap_or_default(), &position, &mut defects),
            };
            // A building without geometry is complete when its parts have some.
            if status == ObjectStatus::NoGeometry && !has_parts[index] {
                defects.push(Defect {
                    code: DefectCode::NoGeometry,
                    effect: Effect::Noted,
                    object: Some(index),
                    place: String::new(),
                    detail: String::new(),
                });
            }
            objects.push(ObjectReport { lod, status });
        }
        Ok(MeshedModel { mesh: merger.mesh, objects, defects })
    }

    /// Returns the corners of a triangle, metres from the origin.
    ///
    /// # Panics
    /// Panics when the triangle does not exist, or the mesh fails [`TriangleMesh::validate`].
    pub fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].map(|corner| self.positions[corner as usize])
    }

    /// Returns the surface of a triangle.
    ///
    /// # Panics
    /// Panics when the triangle does not exist, or the mesh fails [`TriangleMesh::validate`].
    pub fn surface(&self, triangle: usize) -> MeshSurface {
        self.surfaces[self.surface_of[triangle] as usize]
    }

    /// Checks the invariants of a mesh.
    ///
    /// # Errors
    /// [`ModelError::NotFinite`] for a position that is not finite, [`ModelError::Triangle`] for a
    /// triangle without a surface, or with an index of a corner or a surface that is out of range.
    pub fn validate(&self) -> Result<(), ModelError> {
        if let Some(vertex) = self.positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(ModelError::NotFinite { vertex });
        }
        let corner = |c: &u32| (*c as usize) < self.positions.len();
        let surface = |s: &u32| (*s as usize) < self.surfaces.len();
        let triangle = self.triangles.iter().position(|t| !t.iter().all(corner));
        let unclear = || self.surface_of.iter().position(|s| !surface(s));
        let uneven = (self.surface_of.len() != self.triangles.len()).then_some(self.surface_of.len());
        match triangle.or_else(unclear).or(uneven) {
            Some(triangle) => Err(ModelError::Triangle { triangle }),
            None => Ok(()),
        }
    }
}

/// Returns the middle of the geometries that are used, rounded down to whole metres; zero when none
/// is used.
fn origin(model: &CityModel, chosen: &[Chosen]) -> ModelPoint {
    let mut bounds: Option<(Vector, Vector)> = None;
    for (object, lod) in model.objects.iter().zip(chosen).filter_map(|(o, c)| Some((o, *c.as_ref().ok()?))) {
        let surfaces = select::geometries(object, lod).flat_map(|(_, geometry)| &geometry.surfaces);
        for &index in surfaces.flat_map(|surface| surface.rings.iter().flatten()) {
            let p = model.vertices[index as usize].from_origin(ModelPoint::default());
            let (low, high) = bounds.get_or_insert((p, p));
            for i in 0..3 {
                low[i] = low[i].min(p[i]);
                high[i] = high[i].max(p[i]);
            }
        }
    }
    bounds.map_or(ModelPoint::default(), |(low, high)| {
        // Rounding to a nanometre first keeps the rounding errors of an offset from deciding
        // between two origins.
        ModelPoint::from([0, 1, 2].map(|i| ((0.5e9 * (low[i] + high[i])).round() / 1e9).floor()))
    })
}

/// Returns the places of the vertices, metres from an origin, rounded to a micrometre.
fn positions(model: &CityModel, origin: ModelPoint) -> impl Fn(u32) -> Vector + '_ {
    move |i| micrometres(model.vertices[i as usize].from_origin(origin))
}

/// Returns the places of the vertices in the frame of the triangles that
/// [`TriangleMesh::from_model`] makes.
pub(crate) fn positions_of<'a>(model: &'a CityModel, chosen: &[Chosen]) -> impl Fn(u32) -> Vector + 'a {
    positions(model, origin(model, chosen))
}

fn micrometres(position: Vector) -> Vector {
    position.map(|c| (c * 1e6).round() / 1e6)
}

/// Joins the triangles of the objects into one mesh.
struct Merger {
    mesh: TriangleMesh,
    /// Per vertex of the model its corner in the mesh; `u32::MAX` while it has none.
    corner_of: Vec<u32>,
}

impl Merger {
    /// Adds the triangles of an object, and returns its status.
    fn add(
        &mut self,
        object: usize,
        piece: Piece,
        position: &impl Fn(u32) -> Vector,
        defects: &mut Vec<Defect>,
    ) -> ObjectStatus {
        let before = self.mesh.triangles.len();
        for (class, cut) in piece.polygons {
            if cut.triangles.is_empty() {
                continue;
            }
            let surface = self.mesh.surfaces.len() as u32;
            self.mesh.surfaces.push(MeshSurface { object: object as u32, class });
            let added = self.mesh.positions.len() as u32;
            self.mesh.positions.extend_from_slice(&cut.added);
            for triangle in cut.triangles {
                let corners = triangle.map(|corner| {
                    let extra = (u32::MAX - corner) as usize;
                    if extra < cut.added.len() { added + extra as u32 } else { self.corner(corner, position) }
                });
                self.mesh.triangles.push(corners);
                self.mesh.surface_of.push(surface);
            }
        }
        defects.extend(piece.defects);
        match self.mesh.triangles.len() - before {
            0 => ObjectStatus::Unusable,
            triangles => ObjectStatus::Used { triangles },
        }
    }

    /// Returns the corner of a vertex of the model, and adds it if it is new.
    fn corner(&mut self, vertex: u32, position: &impl Fn(u32) -> Vector) -> u32 {
        let corner = &mut self.corner_of[vertex as usize];
        if *corner == u32::MAX {
            *corner = self.mesh.positions.len() as u32;
            self.mesh.positions.push(position(vertex));
        }
        *corner
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CityObject, CrsReference, Geometry, GeometryKind, ObjectKind, SurfacePolygon};

    /// Makes a house with a ridge and a hole in its front wall. One face is turned, another one is
    /// repeated.
    fn house(offset: Vector) -> CityModel {
        let mut model = CityModel::new(CrsReference::default());
        let corners = [
            [0.0, 0.0, 0.0],
            [8.0, 0.0, 0.0],
            [8.0, 6.0, 0.0],
            [0.0, 6.0, 0.0],
            [0.0, 0.0, 3.0],
            [8.0, 0.0, 3.0],
            [8.0, 6.0, 3.0],
            [0.0, 6.0, 3.0],
            [0.0, 3.0, 5.0],
            [8.0, 3.0, 5.0],
            [3.0, 0.0, 1.0],
            [4.0, 0.0, 1.0],
            [4.0, 0.0, 2.0],
            [3.0, 0.0, 2.0],
        ];
        let shift = |c: Vector| [0, 1, 2].map(|i| c[i] + offset[i]);
        model.vertices = corners.map(|c| ModelPoint::from(shift(c))).to_vec();
        let faces: [(&[&[u32]], SurfaceClass); 9] = [
            (&[&[0, 3, 2, 1]], SurfaceClass::Ground),
            (&[&[0, 1, 5, 4], &[10, 13, 12, 11]], SurfaceClass::Wall),
            (&[&[10, 11, 12, 13]], SurfaceClass::Window),
            (&[&[1, 2, 6, 9, 5]], SurfaceClass::Wall),
            (&[&[2, 3, 7, 6]], SurfaceClass::Wall),
            (&[&[0, 8, 7, 3, 0]], SurfaceClass::Wall),
            (&[&[0, 4, 8]], SurfaceClass::Wall),
            (&[&[4, 5, 9, 8]], SurfaceClass::Roof),
            (&[&[6, 7, 8, 9]], SurfaceClass::Roof),
        ];
        let mut geometry = Geometry::new("2.2".parse().ok(), GeometryKind::Solid);
        for (rings, class) in faces {
            geometry.surfaces.push(SurfacePolygon::new(rings.iter().map(|ring| ring.to_vec()).collect(), class));
        }
        geometry.surfaces[8].rings[0].reverse();
        let mut object = CityObject::new("house", ObjectKind::BUILDING);
        let mut repeated = Geometry::new("2.2".parse().ok(), GeometryKind::MultiSurface);
        repeated.surfaces.push(SurfacePolygon::new(vec![vec![9, 8, 4, 5]], SurfaceClass::Unclassified));
        object.geometries = vec![geometry, repeated];
        model.objects.push(object);
        model
    }

    fn meshed(offset: Vector) -> MeshedModel {
        TriangleMesh::from_model(&house(offset), &MeshConfig::default()).unwrap()
    }

    /// Returns the enclosed volume, which is only right when every triangle faces outwards.
    fn volume(mesh: &TriangleMesh) -> f64 {
        let cone = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            numeric::vector::dot(a, numeric::vector::cross(b, c)) / 6.0
        };
        (0..mesh.triangles.len()).map(cone).sum()
    }

    #[test]
    fn a_house_becomes_a_closed_mesh_that_looks_outwards() {
        let out = meshed([85_000.0, 446_000.0, 0.0]);
        assert_eq!(out.mesh.validate(), Ok(()));
        assert!((volume(&out.mesh) - (8.0 * 6.0 * 3.0 + 8.0 * 6.0 * 2.0 / 2.0)).abs() < 1e-9);
        let codes: Vec<_> = out.defects.iter().map(|d| (d.code.number(), d.effect)).collect();
        assert_eq!(codes, [(307, Effect::Repaired), (102, Effect::Noted), (1004, Effect::Dropped)]);
        assert_eq!(out.objects[0].lod, "2.2".parse().ok());
        assert_eq!(out.objects[0].status, ObjectStatus::Used { triangles: out.mesh.triangles.len() });
        let roof = (0..out.mesh.triangles.len()).filter(|&t| out.mesh.surface(t).class == SurfaceClass::Roof);
        assert_eq!(roof.count(), 4);
    }

    #[test]
    fn an_offset_changes_nothing() {
        let near = meshed([0.0; 3]).mesh;
        for offset in [[458_000.0, 5_427_000.0, 112.0], [32_458_000.0, 5_427_000.0, -7.0]] {
            let far = meshed(offset).mesh;
            assert_eq!(far.origin.from_origin(near.origin), offset);
            assert_eq!(TriangleMesh { origin: near.origin, ..far }, near);
        }
    }

    #[test]
    fn every_object_is_accounted_for() {
        let mut model = house([0.0; 3]);
        model.objects.push(CityObject::new("empty", ObjectKind::BUILDING));
        let mut flat = model.objects[0].clone();
        flat.geometries.truncate(1);
        flat.geometries[0].surfaces = vec![SurfacePolygon::new(vec![vec![0, 1, 0]], SurfaceClass::Roof)];
        model.objects.push(flat);
        let out = TriangleMesh::from_model(&model, &MeshConfig::default()).unwrap();
        assert_eq!(out.objects[1].status, ObjectStatus::NoGeometry);
        assert_eq!(out.objects[2].status, ObjectStatus::Unusable);
        let of = |object| out.defects.iter().filter(move |d| d.object == Some(object)).map(|d| d.code.number());
        assert_eq!(of(1).collect::<Vec<_>>(), [609]);
        assert_eq!(of(2).collect::<Vec<_>>(), [301, 104, 101]);
        let nothing = TriangleMesh::from_model(&CityModel::default(), &MeshConfig::default()).unwrap();
        assert!(nothing.mesh.triangles.is_empty());
    }
}
