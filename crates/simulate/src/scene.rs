//! The surface of a scene: terrain with building blocks on it, as a height function and as something rays meet.
//!
//! Scene frame: x east, y north (metres of the map grid, from the scene's centre), z metres above the WGS 84 ellipsoid.
//! The surface is the upper envelope, `max(terrain, roofs)`; there is nothing under it. Rays meet the blocks analytically and the
//! terrain to 0.1 mm.

use nalgebra::Vector3;

use crate::Ray;
use crate::block::{Block, Face, Solid};
use crate::index::BlockIndex;
use crate::terrain::Terrain;

/// What a point of the surface belongs to; the values are the ASPRS LAS classes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum SurfaceClass {
    /// Bare ground.
    Ground = 2,
    /// A building.
    Building = 6,
}

/// Terrain and buildings, known exactly.
#[derive(Debug, Clone)]
pub struct Scene {
    terrain: Terrain,
    solids: Vec<Solid>,
    index: BlockIndex,
    height_range_m: (f64, f64),
}

/// The part of the surface that a ray met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Ground,
    Building { solid: usize, face: Face },
}

/// Where a ray met the surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    pub(crate) point: Vector3<f64>,
    pub(crate) part: Part,
}

/// A ray towards the sun starts this far off the surface, metres: more than the terrain's tolerance, less than any detail.
const LIFT_M: f64 = 1e-3;

impl Scene {
    /// A scene of blocks on a terrain.
    pub(crate) fn new(terrain: Terrain, blocks: Vec<Block>) -> Self {
        let (low, ground_top) = terrain.height_range_m();
        let high = blocks.iter().map(Block::top_m).fold(ground_top, f64::max);
        let solids: Vec<Solid> = blocks.into_iter().map(Solid::new).collect();
        Self { terrain, index: BlockIndex::new(&solids), solids, height_range_m: (low, high) }
    }

    /// The bare ground.
    pub fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// The blocks of the buildings.
    pub fn blocks(&self) -> impl ExactSizeIterator<Item = &Block> {
        self.solids.iter().map(|solid| &solid.block)
    }

    /// Bounds of the surface's height, metres above the ellipsoid.
    pub fn height_range_m(&self) -> (f64, f64) {
        self.height_range_m
    }

    /// Height and class of the upper surface at a position.
    pub fn surface(&self, x: f64, y: f64) -> (f64, SurfaceClass) {
        let ground = self.terrain.height(x, y);
        let roofs = self.index.near([x, y], [x, y]).filter_map(|i| self.solids[i].roof_height(x, y));
        match roofs.reduce(f64::max) {
            Some(roof) if roof > ground => (roof, SurfaceClass::Building),
            _ => (ground, SurfaceClass::Ground),
        }
    }

    /// The first point of the surface on a ray that descends from above it, with t in (0, `t_max`).
    ///
    /// `None` when the ray does not come down to the surface before `t_max`, or starts below it.
    pub fn first_point(&self, ray: &Ray, t_max: f64) -> Option<Vector3<f64>> {
        self.first_hit(ray, t_max).map(|hit| hit.point)
    }

    pub(crate) fn first_hit(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        let ground = self.terrain.intersect(ray, t_max);
        let mut closest = ground.map(|t| (t, Part::Ground));
        let end = ray.at(ground.unwrap_or(t_max));
        for solid in self.index.between(&ray.origin, &end) {
            let limit = closest.map_or(t_max, |(t, _)| t);
            if let Some((t, face)) = self.solids[solid].enter(ray, limit) {
                closest = Some((t, Part::Building { solid, face }));
            }
        }
        closest.map(|(t, part)| Hit { point: ray.at(t), part })
    }

    /// Outward unit normal of the surface at a hit.
    pub(crate) fn normal(&self, hit: &Hit) -> Vector3<f64> {
        match hit.part {
            Part::Ground => self.terrain.normal(hit.point.x, hit.point.y),
            Part::Building { solid, face } => self.solids[solid].normal(face),
        }
    }

    pub(crate) fn solid(&self, index: usize) -> &Solid {
        &self.solids[index]
    }

    /// Whether a building stands between a point of the surface and the sun. The terrain is gentler than the sun's lowest
    /// permitted elevation (see [`crate::Sun`]), so that it throws no shadow.
    pub(crate) fn in_shadow(&self, point: &Vector3<f64>, normal: &Vector3<f64>, to_sun: &Vector3<f64>) -> bool {
        let ray = Ray { origin: point + normal * LIFT_M, direction: *to_sun };
        let t_max = ((self.height_range_m.1 - point.z) / to_sun.z).max(0.0) + LIFT_M;
        let end = ray.at(t_max);
        self.index.between(&ray.origin, &end).any(|i| self.solids[i].enter(&ray, t_max).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::town;

    /// The first point below the surface on a march with a small step, refined by bisection.
    fn marched(scene: &Scene, ray: &Ray, t_max: f64) -> Option<Vector3<f64>> {
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

    #[test]
    fn rays_meet_what_a_brute_force_march_meets() {
        let scene = town::build(11, 200.0, 120.0, 35.0);
        let (low, high) = scene.height_range_m();
        let mut on_buildings = 0;
        for k in 0..400 {
            let (x, y) = (f64::from(k % 20) * 9.7 - 95.0, f64::from(k / 20) * 9.3 - 95.0);
            let ray = Ray { origin: Vector3::new(x, y, high + 1.0), direction: Vector3::new(0.35, -0.2, -1.0) };
            let t_max = high + 2.0 - low;
            let hit = scene.first_hit(&ray, t_max).expect("the ray ends below the lowest ground");
            let reference = marched(&scene, &ray, t_max).expect("the march does too");
            let apart = (hit.point - reference).norm();
            // The march walks through a corner that is thinner than its step.
            assert!(apart < 0.01 || hit.point.z > reference.z, "{apart} m apart at {x}, {y}");
            assert!(apart < 0.01 || corner_is_thin(&scene, &ray, &hit.point));
            on_buildings += usize::from(hit.part != Part::Ground);
        }
        assert!(on_buildings > 50, "only {on_buildings} rays met a building");
    }

    fn corner_is_thin(scene: &Scene, ray: &Ray, point: &Vector3<f64>) -> bool {
        let p = point + ray.direction.normalize() * 0.02;
        p.z > scene.surface(p.x, p.y).0
    }

    #[test]
    fn a_wall_away_from_the_sun_is_in_its_own_shadow_and_the_roof_is_not() {
        let scene = town::build(11, 200.0, 120.0, 35.0);
        let to_sun = Vector3::new(0.4, -0.5, 0.77).normalize();
        let solid = scene.solids.iter().max_by(|a, b| a.block.top_m().total_cmp(&b.block.top_m())).expect("a tower");
        let [x, y] = solid.block.centre_m;
        let roof = Vector3::new(x, y, solid.block.top_m());
        assert!(!scene.in_shadow(&roof, &Vector3::z(), &to_sun));
        let behind = [x - to_sun.x * 30.0, y - to_sun.y * 30.0];
        let ground = Vector3::new(behind[0], behind[1], scene.terrain.height(behind[0], behind[1]));
        assert!(scene.in_shadow(&ground, &Vector3::z(), &to_sun));
    }
}
