//! The buildings as an LoD2 city model: one solid per block, with surfaces classed as roof, wall
//! and ground.
//!
//! Coordinates are those of the map (east, north) and ellipsoidal heights, rounded to the
//! millimetre that CityJSON will hold, so that equal corners are equal vertices. Rings run
//! counter-clockwise seen from outside. A building of one block is a `Building`; of several, a
//! `Building` without geometry whose blocks are its `BuildingPart`s, each on top of the other or
//! wall to wall. Parapets, chimneys and plant rooms are left out, as LoD2 does.

use city::{
    CityModel, CityObject, CrsReference, Geometry, GeometryKind, Lod, ModelPoint, ObjectKind, SurfaceClass,
    SurfacePolygon, VertexPool,
};

use crate::surface::building::Building;
use crate::surface::frame::SceneFrame;
use crate::surface::prism::{BuildingBlock, Roof};

/// Makes the model of buildings, without those whose numbers are `absent`.
pub(crate) fn model(buildings: &[Building], absent: &[u32], frame: &SceneFrame) -> CityModel {
    let mut model = CityModel::new(CrsReference::from_epsg(frame.epsg(), None));
    let mut pool = VertexPool::new();
    for (number, building) in (1..).zip(buildings).filter(|(number, _)| !absent.contains(number)) {
        let id = format!("building-{number}");
        let parent = model.objects.len();
        model.objects.push(CityObject::new(&id, ObjectKind::BUILDING));
        if let [block] = building.parts.as_slice() {
            model.objects[parent].geometries.push(solid(block, frame, &mut pool));
            continue;
        }
        for (part, block) in (1..).zip(&building.parts) {
            let mut object = CityObject::new(format!("{id}-{part}"), ObjectKind::BUILDING_PART);
            object.parent = Some(parent);
            object.geometries.push(solid(block, frame, &mut pool));
            model.objects.push(object);
        }
    }
    model.vertices = pool.into_vertices();
    model
}

/// Makes the outer shell of a block.
fn solid(block: &BuildingBlock, frame: &SceneFrame, pool: &mut VertexPool) -> Geometry {
    let mut geometry = Geometry::new(Some(Lod::new(2, None)), GeometryKind::Solid);
    for (class, ring) in faces(block) {
        let corners = ring.into_iter().map(|[u, v, z]| {
            let [x, y] = block.position(u, v);
            let [east, north] = frame.origin_m();
            let millimetres = |c: f64| (c * 1e3).round() / 1e3;
            ModelPoint::new(millimetres(x + east), millimetres(y + north), millimetres(z))
        });
        // A scene is at most 3 km wide, far too small for the millions of blocks that would exceed
        // the indices.
        let ring = corners.filter_map(|corner| pool.index(corner)).collect();
        geometry.surfaces.push(SurfacePolygon::new(vec![ring], class));
    }
    geometry
}

/// Returns the faces of a block as rings of (along, across, height).
fn faces(block: &BuildingBlock) -> Vec<(SurfaceClass, Vec<[f64; 3]>)> {
    let [u, v] = block.half_size_m;
    let (base, eaves, top) = (block.base_m, block.eaves_m(), block.top_m());
    let plan = [[-u, -v], [u, -v], [u, v], [-u, v]];
    let at = |k: usize, z: f64| [plan[k % 4][0], plan[k % 4][1], z];
    let quad = |k: usize| vec![at(k, base), at(k + 1, base), at(k + 1, eaves), at(k, eaves)];
    let mut faces = vec![(SurfaceClass::Ground, (0..4).rev().map(|k| at(k, base)).collect())];
    let mut walls: Vec<_> = (0..4).map(quad).collect();
    // The two ends of the ridge, and the roof planes between them and the eaves.
    let ridge = match block.roof {
        Roof::Flat { .. } => None,
        Roof::Gabled { .. } => Some(u),
        Roof::Hipped { .. } => Some(u - v),
    };
    let roofs = match ridge {
        None => vec![(0..4).map(|k| at(k, top)).collect()],
        Some(half) => {
            let (start, end) = ([-half, 0.0, top], [half, 0.0, top]);
            let mut planes =
                vec![vec![at(0, eaves), at(1, eaves), end, start], vec![at(2, eaves), at(3, eaves), start, end]];
            if matches!(block.roof, Roof::Gabled { .. }) {
                // A gable rises above the eaves: after the wall's second upper corner comes the
                // ridge.
                walls[1].insert(3, end);
                walls[3].insert(3, start);
            } else {
                planes.push(vec![at(1, eaves), at(2, eaves), end]);
                planes.push(vec![at(3, eaves), at(0, eaves), start]);
            }
            planes
        }
    };
    faces.extend(walls.into_iter().map(|ring| (SurfaceClass::Wall, ring)));
    faces.extend(roofs.into_iter().map(|ring| (SurfaceClass::Roof, without_repeats(ring))));
    faces
}

/// Returns a ring without repeated corners. A hipped roof over a square has a ridge of length zero.
fn without_repeats(mut ring: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    ring.dedup();
    if ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    ring
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::Vector3;

    use super::*;
    use crate::config::SimulationConfig;
    use crate::surface::scene::Scene;

    fn ring_points(model: &CityModel, surface: &SurfacePolygon) -> Vec<Vector3<f64>> {
        surface.rings[0].iter().map(|i| model.vertices[*i as usize]).map(|p| Vector3::new(p.x, p.y, p.z)).collect()
    }

    /// Newell's normal, twice the area long.
    fn normal(ring: &[Vector3<f64>]) -> Vector3<f64> {
        let origin = ring[0];
        (0..ring.len()).map(|k| (ring[k] - origin).cross(&(ring[(k + 1) % ring.len()] - origin))).sum()
    }

    #[test]
    fn every_solid_is_closed_planar_and_faces_outwards() {
        for preset in ["town", "dense-city", "high-rise", "repetitive-roofs"] {
            let config = SimulationConfig::preset(preset).unwrap();
            let frame = SceneFrame::new(config.lon_deg, config.lat_deg, config.gsd_m).unwrap();
            let model = model(Scene::new(&config, 150.0).buildings(), &[], &frame);
            model.validate().unwrap();
            let solids: Vec<&Geometry> = model.objects.iter().flat_map(|o| &o.geometries).collect();
            assert!(solids.len() > 15, "{preset}: {}", solids.len());
            for solid in solids {
                let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
                let mut volume = 0.0;
                let inside = ring_points(&model, &solid.surfaces[0])[0];
                for surface in &solid.surfaces {
                    let (indices, ring) = (&surface.rings[0], ring_points(&model, surface));
                    for k in 0..indices.len() {
                        let (a, b) = (indices[k], indices[(k + 1) % indices.len()]);
                        *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
                    }
                    let n = normal(&ring);
                    let unit = n.normalize();
                    assert!(ring.iter().all(|p| (p - ring[0]).dot(&unit).abs() < 3e-3), "{preset}: not planar");
                    volume += (ring[0] - inside).dot(&n) / 6.0;
                    match surface.class {
                        SurfaceClass::Roof => assert!(unit.z > 0.1),
                        SurfaceClass::Wall => assert!(unit.z.abs() < 1e-3),
                        _ => assert!(unit.z < -0.999),
                    }
                }
                assert!(edges.values().all(|balance| *balance == 0), "{preset}: an edge is not shared by two faces");
                assert!(volume > 50.0, "{preset}: volume {volume}");
            }
        }
    }

    #[test]
    fn roofs_of_the_model_are_the_roofs_of_the_scene() {
        let config = SimulationConfig::default();
        let frame = SceneFrame::new(config.lon_deg, config.lat_deg, config.gsd_m).unwrap();
        let scene = Scene::new(&config, 150.0);
        let model = model(scene.buildings(), &[], &frame);
        let [east, north] = frame.origin_m();
        let mut compared = 0;
        for surface in model.surfaces().filter(|s| s.class == SurfaceClass::Roof) {
            let ring = ring_points(&model, surface);
            let centre = ring.iter().sum::<Vector3<f64>>() / ring.len() as f64;
            let (height, _) = scene.surface(centre.x - east, centre.y - north);
            // Chimneys, parapets and steps stand over some centres.
            assert!(height > centre.z - 0.01, "{height} under {}", centre.z);
            compared += usize::from((height - centre.z).abs() < 0.01);
        }
        assert!(compared > 40, "{compared}");
    }
}
