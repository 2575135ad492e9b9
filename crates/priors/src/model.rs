//! The triangles of a city model with their areas, normals and an index for ray casting.

use bvh::Bvh;
use city::{BuildingRole, CityModel, SurfaceClass, TriangleMesh};
use rayon::prelude::*;

use crate::PriorsError;
use numeric::vector::{Vector, cross, norm, sub, unit};

/// Height of a triangle over its longest edge below which it takes the normal of its surface,
/// metres. The rounding of the corners decides the normal of such a triangle.
const SLIVER_M: f64 = 1e-3;

/// A city model prepared for priors.
#[derive(Debug, Clone)]
pub struct PriorModel {
    mesh: TriangleMesh,
    bvh: Bvh,
    areas: Vec<f64>,
    normals: Vec<Vector>,
    building: Vec<bool>,
}

impl PriorModel {
    /// Prepares a mesh. `is_building` holds per object of the model whether it belongs to a
    /// building. Other objects occlude what is behind them, and give no priors.
    ///
    /// # Errors
    /// - [`PriorsError::Mesh`] when the mesh fails [`TriangleMesh::validate`].
    /// - [`PriorsError::Bvh`] when no index for ray casting can be built.
    /// - [`PriorsError::Objects`] when `is_building` is shorter than the list of objects.
    pub fn new(mesh: TriangleMesh, is_building: &[bool]) -> Result<Self, PriorsError> {
        mesh.validate()?;
        let bvh = Bvh::new(&mesh.positions, &visible_triangles(&mesh))?;
        let known = |surface: &city::MeshSurface| is_building.get(surface.object as usize).copied();
        if let Some(surface) = mesh.surfaces.iter().find(|surface| known(surface).is_none()) {
            return Err(PriorsError::Objects { flags: is_building.len(), object: surface.object });
        }
        let count = mesh.triangles.len();
        let building = (0..count).map(|t| known(&mesh.surface(t)).unwrap_or(false)).collect();
        let areas = (0..count).into_par_iter().map(|t| 0.5 * norm(doubled_area(mesh.corners(t)))).collect();
        let normals = normals(&mesh);
        Ok(Self { mesh, bvh, areas, normals, building })
    }

    /// Returns the triangles.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Returns the index for ray casting.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Returns the area of a triangle, m².
    ///
    /// # Panics
    /// Panics when the triangle does not exist.
    pub fn area_m2(&self, triangle: usize) -> f64 {
        self.areas[triangle]
    }

    /// Returns the unit normal of a triangle, which faces outwards on solids. It is zero when the
    /// triangle and its surface have no area.
    ///
    /// # Panics
    /// Panics when the triangle does not exist.
    pub fn normal(&self, triangle: usize) -> [f64; 3] {
        self.normals[triangle]
    }

    /// Returns whether a triangle belongs to a building.
    ///
    /// # Panics
    /// Panics when the triangle does not exist.
    pub fn is_building(&self, triangle: usize) -> bool {
        self.building[triangle]
    }
}

/// Returns per object whether it belongs to a building, as [`PriorModel::new`] expects.
pub fn buildings_of(model: &CityModel) -> Vec<bool> {
    let roles = || model.objects.iter().map(|object| object.kind.role());
    // OBJ and PLY have no kinds of objects, so all their objects count as buildings.
    let is_named = roles().any(|role| role != BuildingRole::Other);
    roles().map(|role| !is_named || !matches!(role, BuildingRole::Other | BuildingRole::Interior)).collect()
}

/// Returns the triangles for ray casting. Closure surfaces close a solid and do not exist in
/// reality, so nothing sees them and they hide nothing: each becomes a point, which no ray hits.
fn visible_triangles(mesh: &TriangleMesh) -> Vec<[u32; 3]> {
    let is_virtual = |triangle: usize| mesh.surface(triangle).class == SurfaceClass::Closure;
    let one = |(number, &corners): (usize, &[u32; 3])| if is_virtual(number) { [corners[0]; 3] } else { corners };
    mesh.triangles.iter().enumerate().map(one).collect()
}

/// Returns a vector along the normal whose length is twice the area.
fn doubled_area([a, b, c]: [Vector; 3]) -> Vector {
    cross(sub(b, a), sub(c, a))
}

/// Returns the normal of each triangle; slivers take the normal of their surface.
fn normals(mesh: &TriangleMesh) -> Vec<Vector> {
    let mut of_surface = vec![[0.0; 3]; mesh.surfaces.len()];
    for (triangle, &surface) in mesh.surface_of.iter().enumerate() {
        let doubled = doubled_area(mesh.corners(triangle));
        of_surface[surface as usize].iter_mut().zip(doubled).for_each(|(sum, c)| *sum += c);
    }
    let normal = |triangle: usize| {
        let corners = mesh.corners(triangle);
        let doubled = doubled_area(corners);
        let longest = (0..3).map(|i| norm(sub(corners[(i + 1) % 3], corners[i]))).fold(0.0, f64::max);
        let own = unit(doubled).filter(|_| norm(doubled) >= SLIVER_M * longest);
        let surface = unit(of_surface[mesh.surface_of[triangle] as usize]);
        own.or(surface).or(unit(doubled)).unwrap_or_default()
    };
    (0..mesh.triangles.len()).into_par_iter().map(normal).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use bvh::Ray;
    use city::{MeshSurface, ModelPoint, SurfaceClass};

    use super::*;

    /// Makes a box with its corner at `low`: ground, roof and four walls of two triangles each,
    /// facing outwards; object 0.
    pub(crate) fn cuboid(low: Vector, size: Vector) -> TriangleMesh {
        let corner = |i: usize| [0, 1, 2].map(|axis| low[axis] + if i >> axis & 1 == 1 { size[axis] } else { 0.0 });
        let faces: [([u32; 4], SurfaceClass); 6] = [
            ([0, 2, 3, 1], SurfaceClass::Ground),
            ([4, 5, 7, 6], SurfaceClass::Roof),
            ([0, 1, 5, 4], SurfaceClass::Wall),
            ([1, 3, 7, 5], SurfaceClass::Wall),
            ([3, 2, 6, 7], SurfaceClass::Wall),
            ([2, 0, 4, 6], SurfaceClass::Wall),
        ];
        let mut mesh = TriangleMesh { origin: ModelPoint::default(), ..TriangleMesh::default() };
        mesh.positions = (0..8).map(corner).collect();
        for (number, ([a, b, c, d], class)) in faces.into_iter().enumerate() {
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
            mesh.surface_of.extend([number as u32; 2]);
            mesh.surfaces.push(MeshSurface { object: 0, class });
        }
        mesh
    }

    /// Joins two meshes. The objects of the second mesh follow those of the first.
    pub(crate) fn joined(mut first: TriangleMesh, second: &TriangleMesh) -> TriangleMesh {
        let (corners, surfaces) = (first.positions.len() as u32, first.surfaces.len() as u32);
        let object = first.surfaces.iter().map(|s| s.object + 1).max().unwrap_or(0);
        first.positions.extend(&second.positions);
        first.triangles.extend(second.triangles.iter().map(|t| t.map(|c| c + corners)));
        first.surface_of.extend(second.surface_of.iter().map(|s| s + surfaces));
        let shifted = second.surfaces.iter().map(|s| MeshSurface { object: s.object + object, ..*s });
        first.surfaces.extend(shifted);
        first
    }

    #[test]
    fn areas_and_normals_of_a_box() {
        let model = PriorModel::new(cuboid([1.0, 2.0, 3.0], [8.0, 6.0, 3.0]), &[true]).unwrap();
        let total: f64 = (0..12).map(|t| model.area_m2(t)).sum();
        assert!((total - 2.0 * (48.0 + 24.0 + 18.0)).abs() < 1e-12);
        assert_eq!(
            [model.normal(0), model.normal(3), model.normal(4)],
            [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
        );
        let missing = PriorModel::new(cuboid([0.0; 3], [1.0; 3]), &[]).unwrap_err();
        assert_eq!(missing, PriorsError::Objects { flags: 0, object: 0 });
    }

    /// A ray from above passes the closure over a box and meets its ground.
    #[test]
    fn closure_surfaces_are_not_there() {
        let mut mesh = cuboid([0.0; 3], [8.0, 6.0, 3.0]);
        mesh.surfaces[1].class = SurfaceClass::Closure;
        let model = PriorModel::new(mesh, &[true]).unwrap();
        let ray = Ray { origin: [1.0, 1.5, 10.0], direction: [0.0, 0.0, -1.0], end: f64::INFINITY };
        let hit = model.bvh().closest_hit(&ray).unwrap();
        assert_eq!(model.mesh().surface(hit.triangle as usize).class, SurfaceClass::Ground);
    }

    #[test]
    fn a_sliver_takes_the_normal_of_its_surface() {
        let mut mesh = cuboid([0.0; 3], [8.0, 6.0, 3.0]);
        // A sliver along an edge of the roof, tilted by the rounding of its corners.
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([[0.0, 0.0, 3.0], [8.0, 0.0, 3.0], [4.0, 1e-6, 3.000_001]]);
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.surface_of.push(1);
        let model = PriorModel::new(mesh, &[true]).unwrap();
        let normal = model.normal(12);
        assert!(normal[2] > 0.999_999, "{normal:?}");
    }
}
