//! The triangles of a city model, each with its surface, class and object.
//!
//! Positions are f64 metres from a recorded origin on whole metres, laid on a lattice of 1 µm: the same model at other
//! coordinates (another zone, another offset in whole metres) gives bit for bit the same triangles. Triangles are
//! counter-clockwise seen from outside where the solids allow to tell. The result is the same for any number of threads.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::select::{self, Chosen, LodChoice, ObjectStatus, Scope};
use crate::shell;
use crate::triangulate::{Triangulation, triangulate};
use crate::{CityModel, Defect, DefectCode, Effect, Geometry, Lod, ModelError, ModelPoint, Surface, SurfaceClass};
use numeric::vector::Vector;

/// Triangles with their surfaces.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Position in the model's reference system that the others are relative to; whole metres.
    pub origin: ModelPoint,
    /// Corners, metres from the origin.
    pub positions: Vec<[f64; 3]>,
    /// Indices of corners.
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle the index of its surface.
    pub surface_of: Vec<u32>,
    /// The surfaces.
    pub surfaces: Vec<MeshSurface>,
}

/// A surface that triangles were made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshSurface {
    /// Index of the object in the model.
    pub object: u32,
    /// Its class.
    pub class: SurfaceClass,
}

/// What is made into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshConfig {
    /// Level of detail.
    pub lod: LodChoice,
    /// Which objects.
    pub scope: Scope,
}

/// The triangles of a model, with an account of every object.
#[derive(Debug, Clone)]
pub struct Meshed {
    /// The triangles.
    pub mesh: TriangleMesh,
    /// Per object of the model the level that was used, and whether it was.
    pub objects: Vec<ObjectReport>,
    /// What was wrong, in the order of the objects.
    pub defects: Vec<Defect>,
}

/// What became of an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectReport {
    /// The level of detail that was used; `None` where none was, or where the file names none.
    pub lod: Option<Lod>,
    /// Whether it was used.
    pub status: ObjectStatus,
}

impl TriangleMesh {
    /// Makes triangles of a model's surfaces.
    ///
    /// # Errors
    /// A model that fails [`CityModel::validate`].
    pub fn from_model(model: &CityModel, config: &MeshConfig) -> Result<Meshed, ModelError> {
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
            // A building may leave the geometry to its parts.
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
        Ok(Meshed { mesh: merger.mesh, objects, defects })
    }

    /// The corners of a triangle.
    ///
    /// # Panics
    /// When there is no such triangle, or the mesh fails [`TriangleMesh::validate`].
    pub fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].map(|corner| self.positions[corner as usize])
    }

    /// The surface of a triangle.
    ///
    /// # Panics
    /// As [`TriangleMesh::corners`].
    pub fn surface(&self, triangle: usize) -> MeshSurface {
        self.surfaces[self.surface_of[triangle] as usize]
    }

    /// Checks what every user of a mesh may rely on.
    ///
    /// # Errors
    /// A position that is not finite, an index of a corner or a surface that is out of range, or a triangle without a
    /// surface.
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

/// The middle of what is used, on whole metres; of the model where nothing is.
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
        // Coordinates that carry the noise of an offset must not decide between two origins: round on a nanometre first.
        ModelPoint::from([0, 1, 2].map(|i| ((0.5e9 * (low[i] + high[i])).round() / 1e9).floor()))
    })
}

/// Where the vertices of a model are, metres from an origin, on the lattice of micrometres.
fn positions(model: &CityModel, origin: ModelPoint) -> impl Fn(u32) -> Vector + '_ {
    move |i| micrometres(model.vertices[i as usize].from_origin(origin))
}

/// Where the vertices of a model are in the frame that its triangles have.
pub(crate) fn positions_of<'a>(model: &'a CityModel, chosen: &[Chosen]) -> impl Fn(u32) -> Vector + 'a {
    positions(model, origin(model, chosen))
}

fn micrometres(position: Vector) -> Vector {
    position.map(|c| (c * 1e6).round() / 1e6)
}

/// The triangles of one object, with the vertices of the model as corners.
#[derive(Debug, Default)]
struct Piece {
    polygons: Vec<(SurfaceClass, Triangulation)>,
    defects: Vec<(DefectCode, Effect, String, String)>,
}

impl Piece {
    fn new(model: &CityModel, object: usize, lod: Option<Lod>, position: &impl Fn(u32) -> Vector) -> Self {
        let mut piece = Self::default();
        let mut known: HashMap<Vec<u32>, usize> = HashMap::new();
        for (number, geometry) in select::geometries(&model.objects[object], lod) {
            let turn = piece.check_shells(geometry, number, position);
            for (index, surface) in geometry.surfaces.iter().enumerate() {
                let place = || format!("geometry {number}, surface {index}");
                match known.entry(sorted_corners(surface)) {
                    std::collections::hash_map::Entry::Occupied(first) => {
                        piece.merge_class(*first.get(), surface.class);
                        piece.defects.push((DefectCode::DuplicatePolygon, Effect::Dropped, place(), String::new()));
                    }
                    std::collections::hash_map::Entry::Vacant(entry) => {
                        entry.insert(piece.polygons.len());
                        piece.add(surface, turn[index], position, &place);
                    }
                }
            }
        }
        piece
    }

    /// The same polygon may come with a class in one geometry and without in another.
    fn merge_class(&mut self, polygon: usize, class: SurfaceClass) {
        if let Some((known, _)) = self.polygons.get_mut(polygon).filter(|(c, _)| *c == SurfaceClass::Unclassified) {
            *known = class;
        }
    }

    fn add(&mut self, surface: &Surface, turn: bool, position: &impl Fn(u32) -> Vector, place: &impl Fn() -> String) {
        let mut cut = triangulate(&surface.rings, position);
        for finding in std::mem::take(&mut cut.findings) {
            let effect = if finding.dropped { Effect::Dropped } else { Effect::Noted };
            self.defects.push((finding.code, effect, place(), finding.detail));
        }
        if turn {
            cut.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self.polygons.push((surface.class, cut));
    }

    /// Per surface of a geometry whether it must be turned; only solids can tell.
    fn check_shells(&mut self, geometry: &Geometry, number: usize, position: &impl Fn(u32) -> Vector) -> Vec<bool> {
        let mut turn = vec![false; geometry.surfaces.len()];
        if !geometry.kind.is_solid() {
            return turn;
        }
        let mut start = 0;
        for members in geometry.surfaces.chunk_by(|a, b| (a.solid, a.shell) == (b.solid, b.shell)) {
            let (solid, number_of_shell) = (members[0].solid, members[0].shell);
            let check = shell::check(&members.iter().collect::<Vec<_>>(), number_of_shell == 0, position);
            turn[start..start + members.len()].copy_from_slice(&check.turn);
            start += members.len();
            for (code, detail) in check.found {
                let turned = matches!(code, DefectCode::WrongOrientation | DefectCode::WrongOrientationShell);
                let effect = if turned { Effect::Repaired } else { Effect::Noted };
                let place = format!("geometry {number}, solid {solid}, shell {number_of_shell}");
                self.defects.push((code, effect, place, detail));
            }
        }
        turn
    }
}

/// What two polygons with the same corners share, whatever their order.
fn sorted_corners(surface: &Surface) -> Vec<u32> {
    let mut corners: Vec<u32> = surface.rings.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners
}

/// Puts the pieces together, each vertex of the model once.
struct Merger {
    mesh: TriangleMesh,
    corner_of: Vec<u32>,
}

impl Merger {
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
        defects.extend(piece.defects.into_iter().map(|(code, effect, place, detail)| Defect {
            code,
            effect,
            object: Some(object),
            place,
            detail,
        }));
        match self.mesh.triangles.len() - before {
            0 => ObjectStatus::Unusable,
            triangles => ObjectStatus::Used { triangles },
        }
    }

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
    use crate::{CityObject, CrsReference, GeometryKind, ObjectKind};

    /// A house with a ridge (triangles, quadrilaterals), its front wall with a hole, one face turned and one repeated.
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
            geometry.surfaces.push(Surface::new(rings.iter().map(|ring| ring.to_vec()).collect(), class));
        }
        geometry.surfaces[8].rings[0].reverse();
        let mut object = CityObject::new("house", ObjectKind::BUILDING);
        let mut repeated = Geometry::new("2.2".parse().ok(), GeometryKind::MultiSurface);
        repeated.surfaces.push(Surface::new(vec![vec![9, 8, 4, 5]], SurfaceClass::Unclassified));
        object.geometries = vec![geometry, repeated];
        model.objects.push(object);
        model
    }

    fn meshed(offset: Vector) -> Meshed {
        TriangleMesh::from_model(&house(offset), &MeshConfig::default()).unwrap()
    }

    /// Six times the enclosed volume: right only if every triangle looks outwards.
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
        flat.geometries[0].surfaces = vec![Surface::new(vec![vec![0, 1, 0]], SurfaceClass::Roof)];
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
