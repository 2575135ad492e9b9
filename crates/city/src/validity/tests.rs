//! Checks one small model per code, and unusual models without a defect.

use super::*;
use crate::{CityObject, CrsReference, ModelPoint, SurfaceClass, VertexPool};

/// Corners of the faces of a box, facing outwards.
const FACES: [[usize; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];

/// The places of the corners of each face.
type Faces = Vec<Vec<Vector>>;

fn block(low: Vector, high: Vector) -> Faces {
    let corner = |i: usize| [[low[0], high[0]][i & 1], [low[1], high[1]][i >> 1 & 1], [low[2], high[2]][i >> 2]];
    FACES.iter().map(|face| face.iter().map(|&i| corner(i)).collect()).collect()
}

/// Makes a pyramid over a ring that is counter-clockwise seen from above.
fn pyramid(base: &[Vector], tip: Vector) -> Faces {
    let next = |i: usize| base[(i + 1) % base.len()];
    let sides = (0..base.len()).map(|i| vec![base[i], next(i), tip]);
    std::iter::once(base.iter().rev().copied().collect()).chain(sides).collect()
}

fn square(x: f64, y: f64, z: f64, size: f64) -> [Vector; 4] {
    [[x, y, z], [x + size, y, z], [x + size, y + size, z], [x, y + size, z]]
}

fn cube() -> Faces {
    block([0.0; 3], [1.0; 3])
}

/// Builds models of solids. The first shell of a solid is the outer one.
struct Builder {
    model: CityModel,
    pool: VertexPool,
}

impl Builder {
    fn new() -> Self {
        Self { model: CityModel::new(CrsReference::default()), pool: VertexPool::new() }
    }

    fn object(mut self, kind: ObjectKind, parent: Option<usize>, geometry: GeometryKind, solids: &[&[Faces]]) -> Self {
        let mut object = CityObject::new(format!("object {}", self.model.objects.len()), kind);
        object.parent = parent;
        let mut shape = Geometry::new("2".parse().ok(), geometry);
        for (solid, shells) in solids.iter().enumerate() {
            for (shell, faces) in shells.iter().enumerate() {
                for face in faces {
                    let far = |p: &Vector| ModelPoint::new(p[0] + 606_000.0, p[1] + 4_887_000.0, p[2] + 500.0);
                    let ring = face.iter().map(|p| self.pool.index(far(p)).unwrap()).collect();
                    let surface = SurfacePolygon::new(vec![ring], SurfaceClass::Wall);
                    shape.surfaces.push(SurfacePolygon { solid: solid as u32, shell: shell as u32, ..surface });
                }
            }
        }
        object.geometries.push(shape);
        self.model.objects.push(object);
        self
    }

    fn codes(mut self) -> Vec<u16> {
        self.model.vertices = self.pool.into_vertices();
        let found = check_solids(&self.model, &MeshConfig::default()).unwrap();
        found.iter().map(|defect| defect.code.number()).collect()
    }
}

/// Compares the codes found in one solid.
#[track_caller]
fn solid(shells: &[Faces], expected: &[u16]) {
    let building = Builder::new().object(ObjectKind::BUILDING, None, GeometryKind::Solid, &[shells]);
    assert_eq!(building.codes(), expected);
}

#[track_caller]
fn composite(solids: &[&[Faces]], expected: &[u16]) {
    let building = Builder::new().object(ObjectKind::BUILDING, None, GeometryKind::CompositeSolid, solids);
    assert_eq!(building.codes(), expected);
}

#[test]
fn sound_solids() {
    solid(&[cube()], &[]);
    solid(&[pyramid(&square(0.0, 0.0, 0.0, 4.0), [2.0, 2.0, 3.0])], &[]);
    // Cavities: alone, touching the lid with the tip, touching each other along an edge.
    let cavity = |x: f64, tip: f64| pyramid(&square(x, 0.4, 0.2, 0.2), [x + 0.1, 0.5, tip]);
    solid(&[cube(), cavity(0.2, 0.9)], &[]);
    solid(&[cube(), cavity(0.2, 1.0)], &[]);
    solid(&[cube(), block([0.2; 3], [0.4; 3]), block([0.4, 0.2, 0.4], [0.6, 0.4, 0.6])], &[]);
}

#[test]
fn shells_that_meet_themselves() {
    // The tip of a roof is above the floor, below it, and on it; then two cubes share one vertex.
    let roof = |tip: f64| {
        let mut faces = cube();
        faces.remove(1);
        let lid = square(0.0, 0.0, 1.0, 1.0);
        faces.extend((0..4).map(|i| vec![lid[i], lid[(i + 1) % 4], [0.5, 0.5, tip]]));
        faces
    };
    solid(&[roof(0.5)], &[]);
    solid(&[roof(-0.5)], &[306]);
    solid(&[roof(0.0)], &[306]);
    solid(&[[cube(), block([1.0; 3], [2.0; 3])].concat()], &[303]);
    // A second block reaches through a face of the cube.
    solid(&[[cube(), block([0.5, 0.5, 0.5], [1.5, 0.8, 0.8])].concat()], &[306]);
}

#[test]
fn shells_of_a_solid() {
    let base = |z: f64| square(0.2, 0.2, z, 0.6);
    solid(&[cube(), pyramid(&base(0.2), [0.5, 0.5, 1.1])], &[401]);
    solid(&[cube(), pyramid(&base(0.0), [0.5, 0.5, 0.9])], &[401]);
    solid(&[cube(), block([0.1; 3], [0.5; 3]), block([0.5, 0.1, 0.1], [0.9, 0.5, 0.5])], &[401]);
    solid(&[cube(), block([0.2; 3], [0.5; 3]), block([0.2; 3], [0.5; 3])], &[402]);
    solid(&[cube(), block([2.0; 3], [3.0; 3])], &[403]);
    solid(&[cube(), block([0.1; 3], [0.9; 3]), block([0.3; 3], [0.5; 3])], &[403]);
    solid(&[cube(), pyramid(&square(0.0, 0.0, 0.1, 1.0), [0.5, 0.5, 0.5])], &[404]);
}

#[test]
fn solids_of_a_composite() {
    let at = |x: f64| vec![block([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])];
    composite(&[&at(0.0), &at(1.0), &at(2.0)], &[]);
    composite(&[&at(0.0), &at(0.99), &at(1.99)], &[501]);
    composite(&[&at(0.0), &at(0.9999), &at(1.9999)], &[]);
    composite(&[&at(0.0), &at(0.0), &at(1.0)], &[502]);
    composite(&[&at(0.0), &at(1.5)], &[503]);
    composite(&[&at(0.0), &[block([1.0; 3], [2.0; 3])]], &[503]);
    // A solid that fills a cavity is a neighbour.
    let hollow = [cube(), block([0.2; 3], [0.8; 3])];
    composite(&[&hollow, &[block([0.2; 3], [0.8; 3])]], &[]);
    composite(&[&hollow, &[block([0.2; 3], [0.9; 3])]], &[501]);
    // The solids of a multi-solid may overlap.
    let many = Builder::new().object(ObjectKind::BUILDING, None, GeometryKind::MultiSolid, &[&at(0.0), &at(0.5)]);
    assert_eq!(many.codes(), [0u16; 0]);
}

#[test]
fn parts_of_a_building() {
    let with_part = |kind: ObjectKind, x: f64| {
        let at = |x: f64| vec![block([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])];
        Builder::new()
            .object(ObjectKind::BUILDING, None, GeometryKind::Solid, &[&at(0.0)])
            .object(ObjectKind::BUILDING_PART, Some(0), GeometryKind::Solid, &[&at(1.0)])
            .object(kind, Some(0), GeometryKind::Solid, &[&at(x)])
            .codes()
    };
    assert_eq!(with_part(ObjectKind::BUILDING_PART, 2.0), [0u16; 0]);
    assert_eq!(with_part(ObjectKind::BUILDING_PART, 1.5), [601]);
    assert_eq!(with_part(ObjectKind::BUILDING_PART, 0.5), [601, 601]);
    assert_eq!(with_part(ObjectKind::BUILDING_INSTALLATION, 0.5), [0u16; 0]);
}

#[test]
fn broken_shells_are_left_to_the_first_check() {
    let mut open = cube();
    open.pop();
    solid(&[open.clone()], &[]);
    composite(&[&[open], &[cube()]], &[]);
}

#[test]
fn what_is_too_large_is_told() {
    let many: Vec<Vec<Faces>> =
        (0..600).map(|i| vec![block([0.0; 3], [1.0 + 0.01 * f64::from(i), 1.0, 1.0])]).collect();
    let solids: Vec<&[Faces]> = many.iter().map(Vec::as_slice).collect();
    let building = Builder::new().object(ObjectKind::BUILDING, None, GeometryKind::CompositeSolid, &solids);
    let codes = building.codes();
    assert_eq!((codes.last(), codes.iter().filter(|&&code| code == 1013).count()), (Some(&1013), 1));
}
