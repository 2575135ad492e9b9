//! City models with ray casting.

use std::path::{Path, PathBuf};

use bvh::{Bvh, MISS, Ray};
use city::{Lod, LodChoice, MeshConfig, MeshSurface, ModelPoint, Scope, SurfaceClass, TriangleMesh};
use cityfiles::CityFile;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::exception::{raise, raise_about};
use crate::fault::Fault;
use crate::forked::in_own_pool;

/// Triangles of a city model in a tree for rays.
#[pyclass(frozen, module = "skysweep._native")]
pub(crate) struct CityCore {
    ids: Vec<String>,
    mesh: TriangleMesh,
    tree: Bvh,
    epsg: (Option<u32>, Option<u32>),
}

fn opened(path: &Path, lod: Option<&str>, all_objects: bool) -> Result<CityCore, Fault> {
    let lod: Option<Lod> = lod.map(|text| text.parse().map_err(|e| Fault::input(&e))).transpose()?;
    let CityFile { model, .. } = cityfiles::read(path)?;
    let config = MeshConfig {
        lod: lod.map_or_else(LodChoice::default, LodChoice::Only),
        scope: if all_objects { Scope::Everything } else { Scope::Buildings },
    };
    let mesh = TriangleMesh::from_model(&model, &config)?.mesh;
    let tree = Bvh::new(&mesh.positions, &mesh.triangles)?;
    let ids = model.objects.iter().map(|object| object.id.clone()).collect();
    Ok(CityCore { ids, mesh, tree, epsg: (model.crs.epsg, model.crs.vertical_epsg) })
}

#[pymethods]
impl CityCore {
    /// Reads a model.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, lod: Option<&str>, all_objects: bool) -> PyResult<Self> {
        py.detach(|| in_own_pool(|| opened(&path, lod, all_objects))).map_err(|fault| raise_about(py, &fault, &[&path]))
    }

    /// Makes a model of its parts: those of [`Self::parts`].
    #[staticmethod]
    fn from_parts(
        py: Python<'_>,
        ids: Vec<String>,
        epsg: (Option<u32>, Option<u32>),
        origin: [f64; 3],
        positions: PyReadonlyArray2<'_, f64>,
        indices: (PyReadonlyArray2<'_, u32>, Vec<u32>),
        surfaces: Vec<(u32, u8)>,
    ) -> PyResult<Self> {
        let (triangles, surface_of) = indices;
        let [x, y, z] = origin;
        let class = |number| SurfaceClass::from_number(number).unwrap_or_default();
        let mesh = TriangleMesh {
            origin: ModelPoint { x, y, z },
            positions: positions.as_slice()?.as_chunks::<3>().0.to_vec(),
            triangles: triangles.as_slice()?.as_chunks::<3>().0.to_vec(),
            surface_of,
            surfaces: surfaces
                .into_iter()
                .map(|(object, number)| MeshSurface { object, class: class(number) })
                .collect(),
        };
        let corner_is_known = |corner: &u32| (*corner as usize) < mesh.positions.len();
        let fits = mesh.triangles.iter().flatten().all(corner_is_known)
            && mesh.surface_of.len() == mesh.triangles.len()
            && mesh.surface_of.iter().all(|surface| (*surface as usize) < mesh.surfaces.len());
        if !fits {
            return Err(raise(py, &Fault::setting("the parts of the city model do not fit one another".to_owned())));
        }
        let grown = py.detach(|| in_own_pool(|| Ok(Bvh::new(&mesh.positions, &mesh.triangles)?)));
        let tree = grown.map_err(|fault| raise(py, &fault))?;
        Ok(Self { ids, mesh, tree, epsg })
    }

    /// What the model is made of, for pickles: origin, corners (n, 3) from there, triangles (m, 3),
    /// the surface of each, and the object and the number of the class of each surface.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<MeshParts<'py>> {
        let TriangleMesh { origin, positions, triangles, surface_of, surfaces } = &self.mesh;
        let corners: Vec<f64> = positions.iter().flatten().copied().collect();
        let indices: Vec<u32> = triangles.iter().flatten().copied().collect();
        Ok((
            [origin.x, origin.y, origin.z],
            corners.into_pyarray(py).reshape([positions.len(), 3])?,
            (indices.into_pyarray(py).reshape([triangles.len(), 3])?, surface_of.clone()),
            surfaces.iter().map(|surface| (surface.object, surface.class as u8)).collect(),
        ))
    }

    /// EPSG codes of the map and of the heights.
    fn epsg(&self) -> (Option<u32>, Option<u32>) {
        self.epsg
    }

    /// Identifiers of the objects in the order of the file.
    fn ids(&self) -> Vec<String> {
        self.ids.clone()
    }

    /// Corners (n, 3) on the map, metres; triangles (m, 3); object and name of the class of each
    /// triangle.
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Triangles<'py>> {
        let TriangleMesh { origin, positions, triangles, .. } = &self.mesh;
        let origin = [origin.x, origin.y, origin.z];
        let corners: Vec<f64> = positions.iter().flat_map(|p| [0, 1, 2].map(|i| origin[i] + p[i])).collect();
        let indices: Vec<u32> = triangles.iter().flatten().copied().collect();
        let surfaces = (0..triangles.len()).map(|triangle| self.mesh.surface(triangle));
        let (objects, classes): (Vec<u32>, Vec<String>) =
            surfaces.map(|surface| (surface.object, surface.class.to_string())).unzip();
        Ok((
            corners.into_pyarray(py).reshape([positions.len(), 3])?,
            indices.into_pyarray(py).reshape([triangles.len(), 3])?,
            objects.into_pyarray(py),
            classes,
        ))
    }

    /// Casts rays: the distance in lengths of the direction (infinite for none) and the triangle
    /// (−1 for none) of each.
    fn cast<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<'py, f64>,
        directions: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Hits<'py>> {
        let (origins, directions) = (origins.as_slice()?, directions.as_slice()?);
        let local = [self.mesh.origin.x, self.mesh.origin.y, self.mesh.origin.z];
        let (from, to) = (origins.as_chunks::<3>().0, directions.as_chunks::<3>().0);
        let cast = |(origin, direction): (&[f64; 3], &[f64; 3])| {
            let origin = [0, 1, 2].map(|i| origin[i] - local[i]);
            match self.tree.closest_hit(&Ray { origin, direction: *direction, end: f64::INFINITY }) {
                Some(hit) if hit.triangle != MISS => (hit.t, i64::from(hit.triangle)),
                _ => (f64::INFINITY, -1),
            }
        };
        let found = || in_own_pool(|| Ok(from.par_iter().zip(to.par_iter()).map(cast).unzip()));
        let (distance, triangle): (Vec<f64>, Vec<i64>) = py.detach(found).map_err(|fault| raise(py, &fault))?;
        Ok((distance.into_pyarray(py), triangle.into_pyarray(py)))
    }
}

/// Distances and triangles of rays.
type Hits<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<i64>>);

/// Corners, triangles, and object and class of each triangle.
type Triangles<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>, Bound<'py, PyArray1<u32>>, Vec<String>);

/// Origin, corners, triangles with their surfaces, and object and class of each surface.
type MeshParts<'py> = ([f64; 3], Bound<'py, PyArray2<f64>>, (Bound<'py, PyArray2<u32>>, Vec<u32>), Vec<(u32, u8)>);
