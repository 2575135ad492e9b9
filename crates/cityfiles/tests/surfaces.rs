//! Surfaces to measure: meshes that `io` writes are read back in their place, devices are refused.

use std::path::Path;

use city::MeshConfig;
use cityfiles::surfaces;
use formats::coloured_mesh::{ColouredMesh, write_mesh_ply};

#[test]
fn a_mesh_is_read_back_in_its_place() {
    let mesh = ColouredMesh {
        positions: &[[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 2.0, 0.5]],
        colours: &[[1.0, 0.0, 0.5]; 3],
        triangles: &[[0, 1, 2]],
        origin: [690_000.0, 4_820_000.0, 100.0],
        crs: Some("EPSG:32631"),
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    write_mesh_ply(&path, &mesh, false).unwrap();
    let read = surfaces::read(&path, &MeshConfig::default()).unwrap();
    assert_eq!((read.triangles.len(), read.horizontal_epsg), (1, Some(32631)));
    assert!(read.positions.contains(&[690_000.0, 4_820_002.0, 100.5]), "{:?}", read.positions);
}

#[cfg(unix)]
#[test]
fn devices_are_refused() {
    let zero = Path::new("/dev/zero");
    assert!(cityfiles::read(zero).is_err());
    assert!(!surfaces::is_surface(zero));
}
