//! Compares depth maps and visible points of a CityJSON tile with the results of Open3D (Embree)
//! for the same input.
//!
//! The reference is in `city/peer_reference` of the shared data. Its points and maps are relative
//! to an offset on whole metres.
//!
//! Rays are cast at our triangles of the tile, and at the triangles of the reference
//! (`mesh_local.ply`). Both results must agree with the reference.

use std::path::{Path, PathBuf};

use bvh::{Bvh, DepthImage, Eye, MISS, Target};
use camera::{ImagePoint, Lens};
use city::{MeshConfig, ModelPoint, TriangleMesh};
use formats::colmap::{self, ColmapModel};

/// Offset of the reference from the coordinates of the tile.
const OFFSET: ModelPoint = ModelPoint::new(85_320.0, 446_656.0, 0.0);
const EPSILON_M: f64 = 0.05;

/// The triangles that rays are cast at.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Triangles {
    /// The triangles of the reference.
    Reference,
    /// Our triangles of the CityJSON tile.
    Tile,
}

/// Largest difference of depths, except at a few pixels.
const DEPTH_TOLERANCE_M: f32 = 1e-3;
/// Largest relative difference of counts.
const COUNT_TOLERANCE: f64 = 1e-4;

struct Scene {
    folder: PathBuf,
    bvh: Bvh,
    /// Shift from the coordinates of the reference to those of the mesh.
    shift: [f64; 3],
    cameras: ColmapModel,
}

impl Scene {
    fn load(triangles: Triangles) -> Option<Self> {
        let city = testing::shared_data("city")?;
        let (name, offset) = match triangles {
            Triangles::Reference => ("peer_reference/mesh_local.ply", ModelPoint::default()),
            Triangles::Tile => ("3dbag_5910.city.json", OFFSET),
        };
        let tile = cityfiles::read(&city.join(name)).unwrap();
        let meshed = TriangleMesh::from_model(&tile.model, &MeshConfig::default()).unwrap();
        let folder = city.join("peer_reference");
        Some(Self {
            bvh: Bvh::new(&meshed.mesh.positions, &meshed.mesh.triangles).unwrap(),
            shift: offset.from_origin(meshed.mesh.origin),
            cameras: colmap::read(&folder.join("sparse/0")).unwrap(),
            folder,
        })
    }

    fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(self.folder.join(name)).unwrap()).unwrap()
    }

    /// The twenty cameras of the smaller comparison.
    fn subset(&self) -> Vec<usize> {
        let cameras = self.json("cams.json");
        cameras["idx20"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap() as usize).collect()
    }

    fn eye(&self, view: usize) -> Eye {
        let pose = self.cameras.views[view].pose;
        Eye::new([0, 1, 2].map(|i| pose.centre[i] + self.shift[i]), pose.rotation)
    }

    fn lens(&self, view: usize) -> &Lens {
        &self.cameras.lenses[self.cameras.views[view].lens]
    }

    fn depth(&self, view: usize) -> DepthImage {
        let lens = self.lens(view);
        self.bvh.cast_image(&self.eye(view), lens.width(), lens.height(), |column, row| {
            lens.direction(ImagePoint { sample: column as f64, line: row as f64 })
        })
    }

    /// Returns the points that a view sees: in the image, in front of the camera, and not occluded
    /// by more than ε.
    fn visible(&self, view: usize, points: &[[f64; 3]]) -> Vec<u32> {
        let (eye, lens) = (self.eye(view), self.lens(view));
        let (mut numbers, mut targets) = (Vec::new(), Vec::new());
        for (number, point) in points.iter().enumerate() {
            let [x, y, z] = eye.eye_from_world([0, 1, 2].map(|i| point[i] + self.shift[i]));
            let Some(pixel) = lens.project(x / z, y / z).filter(|_| z > 0.0) else { continue };
            // The image begins half a pixel before the centre of its first pixel.
            let inside = |at: f64, size: usize| (-0.5..size as f64 - 0.5).contains(&at);
            if inside(pixel.sample, lens.width()) && inside(pixel.line, lens.height()) {
                let distance = (x * x + y * y + z * z).sqrt();
                numbers.push(number as u32);
                targets.push(Target { x: x / z, y: y / z, depth: z * (1.0 - EPSILON_M / distance) });
            }
        }
        let hidden = self.bvh.occluded(&eye, &targets);
        numbers.into_iter().zip(hidden).filter(|(_, hidden)| !hidden).map(|(number, _)| number).collect()
    }
}

/// Reads the data of a C-ordered array of little-endian numbers.
fn npy<const N: usize>(path: &Path) -> Vec<[u8; N]> {
    let bytes = std::fs::read(path).unwrap();
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[data..].chunks_exact(N).map(|chunk| chunk.try_into().unwrap()).collect()
}

fn index_of(scene: &Scene, name: &str) -> usize {
    scene.cameras.views.iter().position(|view| view.name.starts_with(name)).unwrap()
}

fn check_depth_maps(triangles: Triangles) {
    let Some(scene) = Scene::load(triangles) else { return };
    for name in ["uav_002", "street_000"] {
        let expected: Vec<f32> =
            npy::<4>(&scene.folder.join(format!("{name}_z.npy"))).into_iter().map(f32::from_le_bytes).collect();
        let image = scene.depth(index_of(&scene, name));
        assert_eq!(expected.len(), image.depth.len());
        // The stored maps are 0 where no ray hits.
        let differs = |(&found, &expected): (&f32, &f32)| {
            if expected == 0.0 {
                found.is_finite()
            } else {
                (found - expected).abs() > DEPTH_TOLERANCE_M || !found.is_finite()
            }
        };
        let off = image.depth.iter().zip(&expected).filter(|&pair| differs(pair)).count();
        assert!(off <= 20, "{triangles:?}, {name}: {off} pixels differ by more than {DEPTH_TOLERANCE_M} m");
    }
}

fn check_hits(triangles: Triangles) {
    let Some(scene) = Scene::load(triangles) else { return };
    let stats = scene.json("depth_o3d_100_stats.json");
    let (mut hits, mut sum) = (0, 0.0);
    for view in scene.subset() {
        let image = scene.depth(view);
        let found = image.triangle.iter().filter(|&&t| t != MISS).count();
        let depth: f64 = image.depth.iter().filter(|d| d.is_finite()).map(|&d| f64::from(d)).sum();
        let expected = stats[view][0].as_u64().unwrap();
        assert!(found.abs_diff(expected as usize) <= 5, "camera {view}: {found} hits, expected {expected}");
        let expected_sum = stats[view][1].as_f64().unwrap();
        assert!((depth - expected_sum).abs() < 2e-5 * expected_sum, "camera {view}: {depth}, expected {expected_sum}");
        hits += found;
        sum += depth;
    }
    assert!(hits.abs_diff(5_433_840) <= 100 && (sum - 570_520_691.52).abs() < 5e3, "{hits} hits, sum {sum}");
}

fn check_visibility(triangles: Triangles) {
    let Some(scene) = Scene::load(triangles) else { return };
    let flat: Vec<f64> = npy::<8>(&scene.folder.join("points_f64.npy")).into_iter().map(f64::from_le_bytes).collect();
    let points: Vec<[f64; 3]> = flat.as_chunks::<3>().0.to_vec();
    let per_camera = scene.json("reference_100_visible.json");
    let subset = scene.subset();
    let (mut twenty, mut hundred) = (vec![0u32; points.len()], vec![0u32; points.len()]);
    for view in 0..scene.cameras.views.len() {
        let visible = scene.visible(view, &points);
        let name = &scene.cameras.views[view].name;
        let expected = per_camera[name].as_u64().unwrap() as usize;
        let allowed = 5.0 + expected as f64 * COUNT_TOLERANCE;
        let off = visible.len().abs_diff(expected);
        assert!(off as f64 <= allowed, "{triangles:?}, {name}: {}, expected {expected}", visible.len());
        for point in visible {
            hundred[point as usize] += 1;
            twenty[point as usize] += u32::from(subset.contains(&view));
        }
    }
    let close = |counts: &[u32], expected: [usize; 3]| {
        let at_least = |k: u32| counts.iter().filter(|&&c| c >= k).count();
        let found = [counts.iter().map(|&c| c as usize).sum(), at_least(1), at_least(2)];
        let within = found.iter().zip(&expected).all(|(f, e)| f.abs_diff(*e) as f64 <= *e as f64 * COUNT_TOLERANCE);
        assert!(within, "{triangles:?}: pairs, in one view, in two: {found:?}, expected {expected:?}");
    };
    close(&twenty, [494_586, 316_280, 130_065]);
    close(&hundred, [2_039_718, 572_457, 472_904]);
}

#[test]
fn depth_maps_equal_the_stored_ones() {
    check_depth_maps(Triangles::Reference);
    check_depth_maps(Triangles::Tile);
}

#[test]
fn hits_and_depths_of_every_fifth_camera() {
    check_hits(Triangles::Reference);
    check_hits(Triangles::Tile);
}

#[test]
fn visible_points_of_a_hundred_cameras() {
    check_visibility(Triangles::Reference);
    check_visibility(Triangles::Tile);
}

#[test]
fn national_coordinates_change_nothing() {
    let Some(tile) = testing::shared_data("city/3dbag_5910.city.json") else { return };
    let near = cityfiles::read(&tile).unwrap().model;
    let config = MeshConfig::default();
    let expected = TriangleMesh::from_model(&near, &config).unwrap();
    // The tile is moved to Munich in EPSG:25832, and to the same place with the zone number before
    // the easting.
    for shift in [[606_000.0, 4_887_000.0, 500.0], [32_606_000.0, 4_887_000.0, 0.0]] {
        let mut far = near.clone();
        for vertex in &mut far.vertices {
            *vertex = ModelPoint::new(vertex.x + shift[0], vertex.y + shift[1], vertex.z + shift[2]);
        }
        let found = TriangleMesh::from_model(&far, &config).unwrap();
        assert_eq!(found.mesh.origin.from_origin(expected.mesh.origin), shift);
        assert_eq!(TriangleMesh { origin: expected.mesh.origin, ..found.mesh }, expected.mesh);
        assert_eq!(found.defects, expected.defects);
    }
}
