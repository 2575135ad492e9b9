//! Reads surfaces for comparison: city models and meshes (CityJSON, CityGML, OBJ, PLY) and clouds
//! (PLY, LAS, LAZ).
//!
//! Positions are f64 in the reference system of the file. A PLY file may hold positions relative to
//! an origin, which is in a comment `origin x y z` (with `crs …`), or beside it in
//! `NAME.origin.json`. The origin is added to the positions.

use std::io::Read;
use std::path::{Path, PathBuf};

use city::{MeshConfig, ObjectStatus, TriangleMesh};
use crs::{CrsIdentity, VerticalDatum};

use formats::ply::looks_like_ply;
use formats::points::{PointCloud, is_point_cloud};
use formats::splat_ply::LocalOrigin;
use formats::{FormatError, open_regular};

/// Largest number of points of a cloud.
const POINTS_MAX: u64 = 200_000_000;

/// A surface from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Name of the format: `CityJSON 2.0`, `LAS point cloud`, …
    pub format: String,
    /// Points, or corners of the triangles, in the reference system of the file.
    pub positions: Vec<[f64; 3]>,
    /// Corners of each triangle, as indices of positions; empty for a cloud.
    pub triangles: Vec<[u32; 3]>,
    /// Definition of the reference system for PROJ, if the file names one.
    pub crs: Option<String>,
    /// EPSG code of the horizontal CRS, if known.
    pub horizontal_epsg: Option<u32>,
    /// Vertical datum of the heights, if the file names it.
    pub vertical: Option<VerticalDatum>,
    /// Notes that a report on the surface must show.
    pub notes: Vec<String>,
}

/// Returns whether a file holds a surface that is not a raster.
///
/// The first bytes decide; OBJ and XML are also recognised by the extension.
pub fn is_surface(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    if is_point_cloud(path) {
        return true;
    }
    let mut first = [0u8; 16];
    let read = open_regular(path).and_then(|mut file| file.read(&mut first)).unwrap_or(0);
    let first = first.get(..read).unwrap_or_default();
    let text = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first).trim_ascii_start();
    let extension = path.extension().and_then(|name| name.to_str()).unwrap_or_default().to_ascii_lowercase();
    match text.first() {
        Some(b'{') => true,
        // A raster may be XML too (VRT).
        Some(b'<') => matches!(&*extension, "gml" | "xml" | "citygml"),
        Some(_) => extension == "obj" || looks_like_ply(first),
        None => false,
    }
}

/// Reads a surface. `config` selects the objects and the levels of detail of a city model.
///
/// # Errors
/// [`FormatError`] when the file cannot be read, the origin beside it is invalid, no object has
/// triangles, or a cloud has no points.
pub fn read(path: impl AsRef<Path>, config: &MeshConfig) -> Result<SurfaceFile, FormatError> {
    let path = path.as_ref();
    if is_point_cloud(path) {
        return cloud(path);
    }
    let bytes = crate::content(path)?;
    if looks_like_ply(&bytes) {
        return ply(path, &bytes, config);
    }
    drop(bytes);
    city_model(path, config)
}

/// Reads a LAS or LAZ cloud.
fn cloud(path: &Path) -> Result<SurfaceFile, FormatError> {
    let cloud = PointCloud::open(path)?;
    let (crs, horizontal_epsg, vertical) =
        (cloud.crs_definition().map(str::to_owned), cloud.horizontal_epsg(), cloud.vertical());
    let positions = cloud.positions(POINTS_MAX)?;
    Ok(SurfaceFile {
        path: path.to_owned(),
        format: "LAS point cloud".to_owned(),
        positions,
        triangles: Vec::new(),
        crs,
        horizontal_epsg,
        vertical,
        notes: Vec::new(),
    })
}

/// Reads a PLY file as mesh or cloud, and adds its origin.
fn ply(path: &Path, bytes: &[u8], config: &MeshConfig) -> Result<SurfaceFile, FormatError> {
    let points = crate::ply_points(bytes).map_err(|fault| fault.at(path))?;
    let mut surface = if points.has_faces {
        city_model(path, config)?
    } else {
        nothing_if(points.positions.is_empty(), path, "the file has neither points nor polygons")?;
        let format = "PLY point cloud".to_owned();
        SurfaceFile { path: path.to_owned(), format, positions: points.positions, ..SurfaceFile::empty() }
    };
    let crs = || points.header.crs().map(str::to_owned);
    let commented = points.header.origin().map(|origin| (origin, crs(), None));
    let beside = || -> Result<_, FormatError> {
        let found = LocalOrigin::read_beside(path)?;
        Ok(found.map(|found| (found.origin, Some(found.crs), found.vertical.parse().ok())))
    };
    let is_commented = commented.is_some();
    let placed = match commented {
        Some(origin) => Some(origin),
        None => beside()?,
    };
    if let Some((origin, crs, vertical)) = placed {
        // The reader of meshes has added an origin in the comments already.
        let by = if points.has_faces && is_commented { [0.0; 3] } else { origin };
        surface.positions.iter_mut().for_each(|p| (0..3).for_each(|i| p[i] += by[i]));
        surface.name_crs(crs.filter(|name| name != "unknown"));
        surface.vertical = vertical.or(surface.vertical);
        surface.notes.push(format!("the origin {origin:?} was added to its positions: {}", path.display()));
    }
    Ok(surface)
}

/// Reads a city model or mesh as triangles.
fn city_model(path: &Path, config: &MeshConfig) -> Result<SurfaceFile, FormatError> {
    let file = crate::read(path)?;
    let wrong = |error: city::ModelError| FormatError::new(path, error);
    let meshed = TriangleMesh::from_model(&file.model, config).map_err(wrong)?;
    let used = meshed.objects.iter().filter(|object| matches!(object.status, ObjectStatus::Used { .. })).count();
    let what = format!("none of the {} objects has triangles at the selected level of detail", meshed.objects.len());
    nothing_if(meshed.mesh.triangles.is_empty(), path, &what)?;
    let o = meshed.mesh.origin;
    let positions = meshed.mesh.positions.iter().map(|p| [p[0] + o.x, p[1] + o.y, p[2] + o.z]).collect();
    let mut surface = SurfaceFile {
        path: path.to_owned(),
        format: file.format.to_string(),
        positions,
        triangles: meshed.mesh.triangles,
        ..SurfaceFile::empty()
    };
    if meshed.objects.len() > 1 {
        surface.notes.push(format!("{used} of {} objects are used: {}", meshed.objects.len(), path.display()));
    }
    let crs = &file.model.crs;
    surface.name_crs(crs.epsg.map(|code| format!("EPSG:{code}")));
    surface.vertical = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(surface.vertical);
    Ok(surface)
}

fn nothing_if(is_empty: bool, path: &Path, what: &str) -> Result<(), FormatError> {
    if is_empty { Err(FormatError::new(path, what)) } else { Ok(()) }
}

impl SurfaceFile {
    /// A mesh in memory. `path` names it in reports and errors, `crs` defines its reference system.
    pub fn of_mesh(path: &Path, positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>, crs: Option<&str>) -> Self {
        let format = "mesh".to_owned();
        let mut surface = Self { path: path.to_owned(), format, positions, triangles, ..Self::empty() };
        surface.name_crs(crs.map(str::to_owned));
        surface
    }

    fn empty() -> Self {
        Self {
            path: PathBuf::new(),
            format: String::new(),
            positions: Vec::new(),
            triangles: Vec::new(),
            crs: None,
            horizontal_epsg: None,
            vertical: None,
            notes: Vec::new(),
        }
    }

    /// Sets the reference system, or adds a note when PROJ does not know it.
    fn name_crs(&mut self, definition: Option<String>) {
        let Some(definition) = definition else { return };
        match CrsIdentity::of(&definition) {
            Ok(identity) => {
                self.horizontal_epsg = identity.horizontal;
                self.vertical = identity.vertical;
                self.crs = Some(identity.horizontal.map_or(definition, |code| format!("EPSG:{code}")));
            }
            Err(_) => self.notes.push(format!("PROJ does not know its reference system {definition:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(name: &str, content: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        (folder, path)
    }

    #[test]
    fn clouds_and_meshes_in_ply() {
        let header = "ply\nformat ascii 1.0\ncomment origin 100 200 3\ncomment crs EPSG:25832\nelement vertex 3\n\
            property float x\nproperty float y\nproperty float z\n";
        let points = "0 0 0\n1 0 0\n0 1 0.5\n";
        let (_kept, path) = write("a.ply", &format!("{header}end_header\n{points}"));
        let found = read(&path, &MeshConfig::default()).unwrap();
        assert_eq!((found.format.as_str(), found.horizontal_epsg), ("PLY point cloud", Some(25832)));
        assert_eq!((found.positions[2], found.triangles.len()), ([100.0, 201.0, 3.5], 0));
        let face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let (_kept, path) = write("b.ply", &format!("{header}{face}{points}3 0 1 2\n"));
        let found = read(&path, &MeshConfig::default()).unwrap();
        assert_eq!((found.format.as_str(), found.triangles.len()), ("PLY", 1));
        assert!(found.positions.contains(&[100.0, 201.0, 3.5]), "{:?}", found.positions);
        let (_kept, path) = write("c.ply", &format!("{header}end_header\n0 0 0\n1 nan 0\n0 0 0\n"));
        let error = read(&path, &MeshConfig::default()).unwrap_err().to_string();
        assert!(error.contains("901") && error.contains("vertex 1"), "{error}");
        let (_kept, path) = write("d.ply", "ply\nformat ascii 1.0\nend_header\n");
        let error = read(&path, &MeshConfig::default()).unwrap_err().to_string();
        assert!(error.starts_with("the file has neither points nor polygons: "), "{error}");
    }

    #[test]
    fn the_origin_may_stand_beside() {
        let (_kept, path) = write(
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n",
        );
        LocalOrigin::new("EPSG:32631", "ellipsoid", [500_000.0, 4_000_000.0, 50.0]).write_beside(&path, false).unwrap();
        let found = read(&path, &MeshConfig::default()).unwrap();
        assert_eq!(found.positions, [[500_001.0, 4_000_002.0, 53.0]]);
        assert_eq!((found.horizontal_epsg, found.vertical), (Some(32631), Some(VerticalDatum::Ellipsoid)));
    }

    #[test]
    fn surfaces_are_told_from_rasters() {
        let is = |name: &str, content: &str| {
            let (_kept, path) = write(name, content);
            is_surface(path)
        };
        assert!(is("a.json", " {\"type\": \"CityJSON\"}") && is("a.gml", "<?xml") && is("a.obj", "v 0 0 0"));
        assert!(is("a.anything", "ply\nformat") && is("a.las", "LASF"));
        assert!(!is("a.vrt", "<VRTDataset") && !is("a.tif", "II*\0") && !is("a.npy", "\u{93}NUMPY") && !is("a", ""));
        assert!(!is_surface("/nowhere"));
    }
}
