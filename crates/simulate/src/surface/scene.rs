//! The surface of a scene: terrain with buildings, trees and vehicles, as a height function and for
//! ray casting.
//!
//! Scene frame: x east, y north (metres of the map grid, from the scene's centre), z metres above
//! the WGS 84 ellipsoid. The surface is the upper envelope of all solids and the ground, with
//! nothing below it. Rays meet everything analytically, so that occlusions and shadows are exact.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::SceneRay;
use crate::config::SimulationConfig;
use crate::random::derived;
use crate::surface::building::Building;
use crate::surface::index::{Buckets, Extent, Stretch};
use crate::surface::planting;
use crate::surface::prism::{BuildingBlock, Face, Prism};
use crate::surface::streets::Streets;
use crate::surface::terrain::Terrain;
use crate::surface::town;
use crate::surface::tree::Tree;

/// The class of a point of the surface. The values are the ASPRS LAS classes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum TruthClass {
    /// Bare ground.
    Ground = 2,
    /// A tree.
    Vegetation = 5,
    /// A building's roof.
    Building = 6,
    /// Water.
    Water = 9,
    /// A raster cell through which a façade goes, at the edge of a footprint. LAS leaves classes
    /// from 64 on to users.
    FootprintEdge = 64,
}

/// The kind of a solid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Material {
    Building,
    /// A building whose roof has almost no texture.
    BlankRoof,
    Tree,
    Vehicle,
}

/// The shape of a solid.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    Prism(Box<Prism>),
    Crown(Tree),
}

/// An object on the ground.
#[derive(Debug, Clone)]
pub(crate) struct Solid {
    pub(crate) shape: Shape,
    pub(crate) material: Material,
    /// Seed of its colours.
    pub(crate) paint: u64,
    /// Number of the building from 1, [`TREE_NUMBER`] for a tree, 0 for a vehicle.
    number: i32,
}

/// Terrain with everything on it, known exactly.
#[derive(Debug, Clone)]
pub struct Scene {
    terrain: Arc<Terrain>,
    pub(crate) streets: Streets,
    buildings: Arc<[Building]>,
    solids: Vec<Solid>,
    buckets: Buckets,
    height_range_m: (f64, f64),
    reach_m: f64,
}

/// The part of the surface that a ray met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Ground,
    Crown(usize),
    Prism(usize, Face),
}

/// Where a ray met the surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    pub(crate) point: Vector3<f64>,
    pub(crate) normal: Vector3<f64>,
    pub(crate) part: Part,
}

/// The parameter at which a ray meets something. The normal is missing for the ground, where it is
/// computed later.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    t: f64,
    normal: Option<Vector3<f64>>,
    part: Part,
}

/// Number of a tree among the numbers of buildings.
pub const TREE_NUMBER: i32 = -1;
/// Largest distance by which a building may extend beyond the reach of the scene, metres.
const OVERHANG_M: f64 = 50.0;
/// Distance from the surface at which a ray towards the sun starts, metres: above rounding, below
/// any detail.
const LIFT_M: f64 = 1e-3;

impl Scene {
    /// Makes the permanent scene (without vehicles) of a configuration, out to `reach_m` from its
    /// centre.
    pub(crate) fn new(config: &SimulationConfig, reach_m: f64) -> Self {
        let terrain = Terrain::new(config, reach_m + OVERHANG_M);
        let buildings = town::build(config, &terrain, reach_m);
        let paint =
            |index: usize| derived(config.seed, 100 + if config.buildings.identical { 0 } else { index as u64 });
        let solid = |block: &BuildingBlock, index: usize, building: &Building| {
            let material = if building.blank_roof { Material::BlankRoof } else { Material::Building };
            // A scene is at most 3 km wide, far too small for the billions of buildings that would
            // exceed the numbers.
            Solid { number: index as i32 + 1, ..Solid::block(*block, material, paint(index)) }
        };
        let solids: Vec<Solid> = buildings
            .iter()
            .enumerate()
            .flat_map(|(index, b)| b.parts.iter().chain(&b.details).map(move |block| solid(block, index, b)))
            .collect();
        let mut scene = Self::of(terrain, Streets::new(&config.buildings), buildings, solids, reach_m);
        let is_free =
            |x: f64, y: f64| scene.surface(x, y).1 == TruthClass::Ground && !scene.streets.is_carriageway(x, y);
        let crowns = planting::trees(config, &scene.terrain, reach_m, is_free);
        scene.add((0u64..).zip(crowns).map(|(index, crown)| Solid {
            shape: Shape::Crown(crown),
            material: Material::Tree,
            paint: derived(config.seed ^ 0x7ee, index),
            number: TREE_NUMBER,
        }));
        scene.without(&config.absent_buildings)
    }

    /// Returns this scene without some of its buildings, given by their numbers. Trees keep their
    /// places, and the other buildings their numbers.
    fn without(self, absent: &[u32]) -> Self {
        if absent.is_empty() {
            return self;
        }
        let Self { terrain, streets, buildings, solids, reach_m, .. } = self;
        let buckets = Buckets::new(reach_m, |low, high| terrain.top(low, high), &[]);
        let height_range_m = terrain.height_range_m();
        let mut scene = Self { terrain, streets, buildings, solids: Vec::new(), buckets, height_range_m, reach_m };
        let stands = |solid: &Solid| u32::try_from(solid.number).map_or(true, |number| !absent.contains(&number));
        scene.add(solids.into_iter().filter(stands));
        scene
    }

    fn of(terrain: Terrain, streets: Streets, buildings: Vec<Building>, solids: Vec<Solid>, reach_m: f64) -> Self {
        let buckets = Buckets::new(reach_m, |low, high| terrain.top(low, high), &[]);
        let height_range_m = terrain.height_range_m();
        let (terrain, buildings) = (Arc::new(terrain), buildings.into());
        let mut scene = Self { terrain, streets, buildings, solids: Vec::new(), buckets, height_range_m, reach_m };
        scene.add(solids);
        scene
    }

    fn add(&mut self, solids: impl IntoIterator<Item = Solid>) {
        for solid in solids {
            let extent = solid.extent();
            self.height_range_m.1 = self.height_range_m.1.max(extent.top_m);
            self.buckets.insert(self.solids.len() as u32, &extent);
            self.solids.push(solid);
        }
    }

    /// Returns this scene with the vehicles of a date.
    pub(crate) fn on_date(&self, config: &SimulationConfig, date: usize) -> Self {
        let seed = derived(config.campaign_seed(), 5000 + date as u64);
        let vehicles = planting::vehicles(&config.vehicles, &self.streets, &self.terrain, seed, self.reach_m);
        let mut scene = self.clone();
        scene.add((0u64..).zip(vehicles).map(|(k, block)| Solid::block(block, Material::Vehicle, derived(seed, k))));
        scene
    }

    /// Returns the bare ground.
    pub fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Returns the buildings.
    pub fn buildings(&self) -> &[Building] {
        &self.buildings
    }

    /// Returns the number of trees.
    pub fn tree_count(&self) -> usize {
        self.solids.iter().filter(|s| s.material == Material::Tree).count()
    }

    /// Returns the lowest and highest point of the surface, metres above the ellipsoid.
    pub fn height_range_m(&self) -> (f64, f64) {
        self.height_range_m
    }

    /// Returns height and class of the upper surface at a position.
    pub fn surface(&self, x: f64, y: f64) -> (f64, TruthClass) {
        let mut height = self.terrain.height(x, y);
        let mut class = if self.terrain.is_water(x, y) { TruthClass::Water } else { TruthClass::Ground };
        for solid in self.buckets.members(self.buckets.at(x, y)).iter().map(|i| &self.solids[*i as usize]) {
            if let Some(top) = solid.height(x, y).filter(|top| *top > height) {
                (height, class) = (top, solid.class());
            }
        }
        (height, class)
    }

    /// Returns the number of the building whose roof is the upper surface at a position: from 1, in
    /// the order of [`Scene::buildings`]. [`TREE_NUMBER`] stands for a tree, 0 for anything else.
    pub fn object_number(&self, x: f64, y: f64) -> i32 {
        let mut top = (self.terrain.height(x, y), 0);
        for solid in self.buckets.members(self.buckets.at(x, y)).iter().map(|i| &self.solids[*i as usize]) {
            if let Some(height) = solid.height(x, y).filter(|height| *height > top.0) {
                top = (height, solid.number);
            }
        }
        top.1
    }

    /// Returns the first point of the surface on a ray that starts above it, with t in (0,
    /// `t_max`).
    ///
    /// `None` if the ray does not reach the surface before `t_max`, or leaves the scene.
    pub fn first_point(&self, ray: &SceneRay, t_max: f64) -> Option<Vector3<f64>> {
        self.first(ray, t_max).map(|meeting| ray.at(meeting.t))
    }

    pub(crate) fn first_hit(&self, ray: &SceneRay, t_max: f64) -> Option<Hit> {
        let meeting = self.first(ray, t_max)?;
        let point = ray.at(meeting.t);
        let normal = meeting.normal.unwrap_or_else(|| self.terrain.normal(point.x, point.y));
        Some(Hit { point, normal, part: meeting.part })
    }

    fn first(&self, ray: &SceneRay, t_max: f64) -> Option<Meeting> {
        let mut closest: Option<Meeting> = None;
        self.buckets.walk(ray, t_max, |stretch| {
            for &index in self.buckets.members(stretch.bucket) {
                let limit = closest.map_or(t_max, |meeting| meeting.t);
                closest = self.solids[index as usize].meet(index as usize, ray, limit).or(closest);
            }
            if let Some(t) = self.ground_on(ray, stretch, closest.map_or(t_max, |meeting| meeting.t)) {
                closest = Some(Meeting { t, normal: None, part: Part::Ground });
            }
            closest.filter(|meeting| meeting.t <= stretch.t_out).map(|_| ())
        });
        closest
    }

    /// Returns where a ray meets the ground of a bucket before `limit`.
    fn ground_on(&self, ray: &SceneRay, stretch: Stretch, limit: f64) -> Option<f64> {
        let (t_in, t_out) = self.buckets.near_ground(ray, stretch)?;
        let t_out = t_out.min(limit);
        if t_in <= t_out { self.terrain.intersect(ray, t_in, t_out) } else { None }
    }

    pub(crate) fn solid(&self, index: usize) -> &Solid {
        &self.solids[index]
    }

    /// Returns whether something stands between a point of the surface and the sun.
    pub(crate) fn in_shadow(&self, point: &Vector3<f64>, normal: &Vector3<f64>, to_sun: &Vector3<f64>) -> bool {
        let ray = SceneRay { origin: point + normal * LIFT_M, direction: *to_sun };
        let t_max = ((self.height_range_m.1 - point.z) / to_sun.z).max(0.0) + LIFT_M;
        let blocked = |&index: &u32| self.solids[index as usize].meet(index as usize, &ray, t_max).is_some();
        self.buckets
            .walk(&ray, t_max, |stretch| {
                let hidden = self.buckets.members(stretch.bucket).iter().any(blocked)
                    || self.ground_on(&ray, stretch, t_max).is_some();
                hidden.then_some(())
            })
            .is_some()
    }
}

impl Solid {
    fn block(block: BuildingBlock, material: Material, paint: u64) -> Self {
        Self { shape: Shape::Prism(Box::new(Prism::new(block))), material, paint, number: 0 }
    }

    fn class(&self) -> TruthClass {
        match self.material {
            Material::Building | Material::BlankRoof => TruthClass::Building,
            Material::Tree => TruthClass::Vegetation,
            Material::Vehicle => TruthClass::Ground,
        }
    }

    fn height(&self, x: f64, y: f64) -> Option<f64> {
        match &self.shape {
            Shape::Prism(prism) => prism.roof_height(x, y),
            Shape::Crown(crown) => crown.height(x, y),
        }
    }

    fn extent(&self) -> Extent {
        let (centre, half, top_m) = match &self.shape {
            Shape::Prism(prism) => (prism.block.centre_m, prism.half_extent(), prism.block.top_m()),
            Shape::Crown(crown) => (crown.centre_m(), [crown.radius_m(); 2], crown.top_m()),
        };
        let [low, high] = [-1.0, 1.0].map(|side| std::array::from_fn(|axis| centre[axis] + side * half[axis]));
        Extent { low, high, top_m }
    }

    fn meet(&self, index: usize, ray: &SceneRay, t_max: f64) -> Option<Meeting> {
        let meeting = |t, normal, part| Meeting { t, normal: Some(normal), part };
        match &self.shape {
            Shape::Prism(prism) => {
                prism.enter(ray, t_max).map(|(t, normal, face)| meeting(t, normal, Part::Prism(index, face)))
            }
            Shape::Crown(crown) => crown.enter(ray, t_max).map(|(t, normal)| meeting(t, normal, Part::Crown(index))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(preset: &str) -> Scene {
        let config = SimulationConfig::preset(preset).unwrap();
        Scene::new(&config, 200.0).on_date(&config, 0)
    }

    /// Returns the first point below the surface on a march with a small step, refined by
    /// bisection.
    fn marched(scene: &Scene, ray: &SceneRay, t_max: f64) -> Option<Vector3<f64>> {
        let below = |t: f64| {
            let p = ray.at(t);
            p.z < scene.surface(p.x, p.y).0
        };
        let step = 0.01 / ray.direction.norm();
        let mut t = 0.0;
        while !below(t) {
            t += step;
            if t > t_max {
                return None;
            }
        }
        let (mut above, mut under) = (t - step, t);
        for _ in 0..30 {
            let middle = 0.5 * (above + under);
            if below(middle) { under = middle } else { above = middle }
        }
        Some(ray.at(under))
    }

    fn corner_is_thin(scene: &Scene, ray: &SceneRay, point: &Vector3<f64>) -> bool {
        let p = point + ray.direction.normalize() * 0.02;
        p.z > scene.surface(p.x, p.y).0
    }

    #[test]
    fn rays_meet_what_a_brute_force_march_meets() {
        for (preset, on_solids) in [("town", 30), ("hills", 200), ("high-rise", 30), ("quarry", 0), ("harbour", 20)] {
            let scene = scene(preset);
            let (low, high) = scene.height_range_m();
            let mut solid = 0;
            for k in 0..400 {
                let (x, y) = (f64::from(k % 20) * 9.7 - 95.0, f64::from(k / 20) * 9.3 - 95.0);
                let direction = Vector3::new(0.35, -0.2, -1.0);
                let ray =
                    SceneRay { origin: Vector3::new(x, y, high + 1.0) - direction * 0.5 * (high - low), direction };
                let ray = SceneRay { origin: Vector3::new(ray.origin.x, ray.origin.y, high + 1.0), ..ray };
                let t_max = high + 2.0 - low;
                let hit = scene.first_hit(&ray, t_max).expect("the ray ends below the lowest ground");
                let reference = marched(&scene, &ray, t_max).expect("the march does too");
                let apart = (hit.point - reference).norm();
                // The march misses corners that are thinner than its step.
                assert!(apart < 0.01 || hit.point.z > reference.z, "{preset}: {apart} m apart at {x}, {y}");
                assert!(apart < 0.01 || corner_is_thin(&scene, &ray, &hit.point), "{preset}: {apart} m at {x}, {y}");
                assert!(hit.normal.dot(&ray.direction) < 1e-6 || hit.part == Part::Ground);
                solid += usize::from(hit.part != Part::Ground);
            }
            assert!(solid > on_solids, "{preset}: only {solid} rays met a solid");
        }
    }

    #[test]
    fn shadows_are_where_a_march_to_the_sun_meets_the_surface() {
        for preset in ["town", "hills", "quarry"] {
            let scene = scene(preset);
            let to_sun = Vector3::new(0.6, -0.5, 0.4).normalize();
            let (mut counts, mut wrong) = ([0; 2], 0);
            for k in 0..900 {
                let (x, y) = (f64::from(k % 30) * 5.1 - 75.0, f64::from(k / 30) * 4.9 - 75.0);
                let down =
                    SceneRay { origin: Vector3::new(x, y, scene.height_range_m().1 + 1.0), direction: -Vector3::z() };
                let hit = scene.first_hit(&down, 1e3).unwrap();
                let shadow = hit.normal.dot(&to_sun) <= 0.0 || scene.in_shadow(&hit.point, &hit.normal, &to_sun);
                let from = hit.point + hit.normal * 0.001;
                let depth = |t: f64| {
                    let p = from + to_sun * t;
                    scene.surface(p.x, p.y).0 - p.z
                };
                let deepest = (10..15_000).map(|i| depth(f64::from(i) * 0.02)).fold(f64::NEG_INFINITY, f64::max);
                // Rays that graze an edge are left out.
                if deepest.abs() > 0.03 {
                    wrong += usize::from(shadow != (deepest > 0.0));
                    counts[usize::from(shadow)] += 1;
                }
            }
            assert!(counts[0] > 150 && counts[1] > 40, "{preset}: {counts:?}");
            // Where the sun grazes the ground, the smooth normal and the patch disagree about which
            // side is lit.
            assert!(wrong * 200 < 900, "{preset}: {wrong} of {counts:?} differ");
        }
    }

    #[test]
    fn an_absent_building_leaves_all_else_in_place() {
        let config = SimulationConfig::default();
        let full = Scene::new(&config, 150.0);
        let places = || (0..22_500).map(|k| (f64::from(k % 150) * 2.0 - 150.0, f64::from(k / 150) * 2.0 - 150.0));
        let gone = places().map(|(x, y)| full.object_number(x, y)).find(|number| *number > 0).unwrap();
        let without = Scene::new(&SimulationConfig { absent_buildings: vec![gone as u32], ..config }, 150.0);
        assert_eq!(full.tree_count(), without.tree_count());
        let mut lower = 0;
        for (x, y) in places() {
            let (before, after) = (full.surface(x, y).0, without.surface(x, y).0);
            if full.object_number(x, y) == gone {
                assert!(after < before && without.object_number(x, y) != gone);
                lower += 1;
            } else {
                assert_eq!((before, full.object_number(x, y)), (after, without.object_number(x, y)));
            }
        }
        assert!(lower > 0);
    }

    #[test]
    fn vehicles_are_no_part_of_the_permanent_scene() {
        let config = SimulationConfig::default();
        let permanent = Scene::new(&config, 150.0);
        let (first, second) = (permanent.on_date(&config, 0), permanent.on_date(&config, 1));
        let heights = |scene: &Scene| -> Vec<f64> {
            (0..10_000)
                .map(|k| scene.surface(f64::from(k % 100) * 2.0 - 100.0, f64::from(k / 100) * 2.0 - 100.0).0)
                .collect()
        };
        let (none, a, b) = (heights(&permanent), heights(&first), heights(&second));
        let differing = |u: &[f64], v: &[f64]| u.iter().zip(v).filter(|(u, v)| u != v).count();
        assert!(differing(&none, &a) > 20 && differing(&none, &b) > 20 && differing(&a, &b) > 30);
        assert!(none.iter().zip(&a).all(|(n, a)| a >= n && *a < n + 2.5));
    }
}
