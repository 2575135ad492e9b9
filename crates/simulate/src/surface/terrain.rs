//! The bare ground: bilinear patches between the posts of a lattice, which rays meet exactly.
//!
//! The lattice samples a sum of value noises (undulation), a pit, benches and water. With posts
//! every metre, the creases between patches are too small for a matcher to see, and steep faces
//! keep their slope. A patch is `a + bu + cv + duv`, so that a ray meets it at the root of a
//! quadratic equation.
//!
//! Scene frame: x east, y north (grid metres from the scene's centre), z metres above the
//! ellipsoid.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::SceneRay;
use crate::config::{SimulationConfig, TerrainConfig};
use crate::random::derived;
use crate::surface::index::BUCKET_M;
use crate::surface::noise::value_noise;

/// Distance between posts, metres.
pub(crate) const POST_M: f64 = 1.0;
/// Shortest wavelength of an octave, metres.
const SHORTEST_WAVE_M: f64 = 16.0;
/// Smallest height of land above the water, metres, so that the height alone separates the two.
const FREEBOARD_M: f64 = 0.3;
/// Half the width of the pier that reaches into the water, metres.
const PIER_HALF_M: f64 = 16.0;

/// Ground with a known height everywhere.
#[derive(Debug, Clone)]
pub struct Terrain {
    corner_m: f64,
    posts: usize,
    base_m: f64,
    heights: Vec<f32>,
    range_m: (f64, f64),
    water_m: Option<f64>,
}

/// The height function that the lattice samples.
struct Relief<'a> {
    config: &'a TerrainConfig,
    seed: u64,
    half_m: f64,
    turn: (f64, f64),
}

impl Terrain {
    /// Makes the ground of a scene out to `reach_m` from its centre along both axes. Beyond, the
    /// height at the edge continues.
    pub(crate) fn new(config: &SimulationConfig, reach_m: f64) -> Self {
        let turn = config.buildings.turn_deg.to_radians().sin_cos();
        let relief =
            Relief { config: &config.terrain, seed: derived(config.seed, 1), half_m: config.size_m / 2.0, turn };
        // The buckets of the scene end at multiples of their side. The lattice reaches as far, so
        // no ray leaves it earlier.
        let half = ((reach_m / BUCKET_M).ceil() * BUCKET_M / POST_M).ceil() + 2.0;
        let (posts, corner_m) = (2 * half as usize + 1, -half * POST_M);
        let at = |k: usize| corner_m + k as f64 * POST_M;
        let heights: Vec<f32> =
            (0..posts * posts).into_par_iter().map(|i| relief.height(at(i % posts), at(i / posts)) as f32).collect();
        let base_m = config.ground_height_m;
        let low = heights.iter().copied().fold(f32::INFINITY, f32::min);
        let high = heights.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let range_m = (base_m + f64::from(low), base_m + f64::from(high));
        let water_m = (config.terrain.water_share > 0.0).then_some(base_m - config.terrain.quay_height_m);
        Self { corner_m, posts, base_m, heights, range_m, water_m }
    }

    /// Returns the height above the ellipsoid, metres.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let ((i, u), (j, v)) = (self.cell(x), self.cell(y));
        let [a, b, c, d] = self.patch(i, j);
        self.base_m + a + b * u + c * v + d * u * v
    }

    /// Returns the lowest and the highest ground, metres above the ellipsoid.
    pub fn height_range_m(&self) -> (f64, f64) {
        self.range_m
    }

    /// Returns whether the ground is a water surface.
    pub fn is_water(&self, x: f64, y: f64) -> bool {
        self.water_m.is_some_and(|level| self.height(x, y) < level + 0.5 * FREEBOARD_M)
    }

    /// Returns the upward unit normal, smoothed over the neighbouring patches.
    pub(crate) fn normal(&self, x: f64, y: f64) -> Vector3<f64> {
        let by_x = self.height(x + POST_M, y) - self.height(x - POST_M, y);
        let by_y = self.height(x, y + POST_M) - self.height(x, y - POST_M);
        Vector3::new(-by_x, -by_y, 2.0 * POST_M).normalize()
    }

    /// Returns the highest ground of a rectangle.
    pub(crate) fn top(&self, low: [f64; 2], high: [f64; 2]) -> f64 {
        let ((i0, _), (i1, _)) = (self.cell(low[0]), self.cell(high[0]));
        let ((j0, _), (j1, _)) = (self.cell(low[1]), self.cell(high[1]));
        let row = |j: usize| &self.heights[j * self.posts + i0..=j * self.posts + i1 + 1];
        let top = (j0..=j1 + 1).flat_map(row).copied().fold(f32::NEG_INFINITY, f32::max);
        self.base_m + f64::from(top)
    }

    /// Returns the first parameter in [`t_in`, `t_out`] at which a ray over the lattice goes below
    /// the ground.
    pub(crate) fn intersect(&self, ray: &SceneRay, t_in: f64, t_out: f64) -> Option<f64> {
        let mut t = t_in;
        // Each step crosses one patch. A ray along an edge may need more steps because of rounding,
        // hence the bound.
        for _ in 0..4 * self.posts {
            let start = ray.at(t);
            let (i, j) = (self.cell(start.x).0, self.cell(start.y).0);
            let leave = self.leaves(ray, i, j, t).min(t_out);
            if let Some(hit) = self.meet(ray, i, j, t, leave) {
                return Some(hit);
            }
            if leave >= t_out {
                return None;
            }
            t = leave;
        }
        None
    }

    /// Returns where a ray leaves the patch (i, j) that it is in at `t`, just beyond the edge, so
    /// that the next patch is found.
    fn leaves(&self, ray: &SceneRay, i: usize, j: usize, t: f64) -> f64 {
        let along = |index: usize, origin: f64, direction: f64| {
            let edge = self.corner_m + (index + usize::from(direction > 0.0)) as f64 * POST_M;
            if direction == 0.0 { f64::INFINITY } else { (edge - origin) / direction }
        };
        let edge = along(i, ray.origin.x, ray.direction.x).min(along(j, ray.origin.y, ray.direction.y));
        edge.max(t) + 1e-9 / ray.direction.norm()
    }

    fn meet(&self, ray: &SceneRay, i: usize, j: usize, t_in: f64, t_out: f64) -> Option<f64> {
        let [a, b, c, d] = self.patch(i, j);
        let (z_in, z_out) = (ray.at(t_in).z - self.base_m, ray.at(t_out).z - self.base_m);
        let top = a.max(a + b).max(a + c).max(a + b + c + d);
        if z_in.min(z_out) > top {
            return None;
        }
        let point = ray.at(t_in);
        let u = (point.x - self.corner_m) / POST_M - i as f64;
        let v = (point.y - self.corner_m) / POST_M - j as f64;
        let (du, dv) = (ray.direction.x / POST_M, ray.direction.y / POST_M);
        // Height of the ray above the patch at t + s: q0 + q1 s + q2 s².
        let q0 = z_in - (a + b * u + c * v + d * u * v);
        let q1 = ray.direction.z - b * du - c * dv - d * (u * dv + v * du);
        let q2 = -d * du * dv;
        falls_to_zero(q0, q1, q2, t_out - t_in).map(|s| t_in + s)
    }

    /// Returns the patch index along one axis and the position in it, clamped to the lattice.
    fn cell(&self, coordinate: f64) -> (usize, f64) {
        let u = ((coordinate - self.corner_m) / POST_M).clamp(0.0, (self.posts - 1) as f64);
        let index = (u as usize).min(self.posts - 2);
        (index, u - index as f64)
    }

    /// Returns the coefficients of 1, u, v, uv relative to the base height.
    fn patch(&self, i: usize, j: usize) -> [f64; 4] {
        let k = j * self.posts + i;
        let [h00, h10] = [self.heights[k], self.heights[k + 1]].map(f64::from);
        let [h01, h11] = [self.heights[k + self.posts], self.heights[k + self.posts + 1]].map(f64::from);
        [h00, h10 - h00, h01 - h00, h00 - h10 - h01 + h11]
    }
}

/// Returns the first s in [0, `s_max`] at which q0 + q1 s + q2 s² is no longer positive.
fn falls_to_zero(q0: f64, q1: f64, q2: f64, s_max: f64) -> Option<f64> {
    if q0 <= 0.0 {
        return Some(0.0);
    }
    let discriminant = q1 * q1 - 4.0 * q2 * q0;
    if discriminant < 0.0 {
        return None;
    }
    // This form of the smaller positive root avoids cancellation: with q0 > 0 it is 2 q0 / (−q1 +
    // √Δ).
    let s = 2.0 * q0 / (discriminant.sqrt() - q1);
    (s >= 0.0 && s <= s_max).then_some(s)
}

impl Relief<'_> {
    /// Returns the height relative to the mean ground, metres.
    fn height(&self, x: f64, y: f64) -> f64 {
        let land = self.benched(self.undulation(x, y) - self.pit(x, y));
        if self.config.water_share == 0.0 {
            return land;
        }
        let water = -self.config.quay_height_m;
        if self.in_water(x, y) { water } else { land.max(water + FREEBOARD_M) }
    }

    fn undulation(&self, x: f64, y: f64) -> f64 {
        let (mut wave, mut amplitude, mut sum, mut octave) =
            (self.config.wavelength_m, self.config.relief_m, 0.0, 0u64);
        while wave >= SHORTEST_WAVE_M && amplitude > 1e-3 {
            sum += amplitude * value_noise(self.seed ^ octave, 0.5 * wave, x, y);
            (wave, amplitude, octave) = (0.5 * wave, amplitude * self.config.roughness, octave + 1);
        }
        sum
    }

    /// Returns the depth below the surroundings, metres: 0 at the rim, the full depth at the floor.
    fn pit(&self, x: f64, y: f64) -> f64 {
        if self.config.pit_depth_m == 0.0 {
            return 0.0;
        }
        let rim = self.half_m * (0.85 + 0.1 * value_noise(self.seed ^ 0x71, self.half_m, x, y));
        let inwards = ((rim - x.hypot(y)) / (0.65 * rim)).clamp(0.0, 1.0);
        self.config.pit_depth_m * inwards
    }

    /// Cuts a height into benches. Three quarters of each step are almost level (they keep 6 % of
    /// the slope), the rest is its face.
    fn benched(&self, height: f64) -> f64 {
        let bench = self.config.bench_height_m;
        if bench == 0.0 {
            return height;
        }
        let step = (height / bench).floor();
        let face = ((height / bench - step - 0.75) / 0.25).clamp(0.0, 1.0);
        // A part of the slope is kept, so that the level parts are not exactly flat.
        bench * (step + face) + 0.06 * (height - bench * (step + face))
    }

    fn in_water(&self, x: f64, y: f64) -> bool {
        let (sin, cos) = self.turn;
        let (u, v) = (cos * x + sin * y, cos * y - sin * x);
        let shore = self.half_m * (1.0 - 2.0 * self.config.water_share);
        let pier_end = shore + 0.6 * (self.half_m - shore);
        u > shore && (v.abs() > PIER_HALF_M || u > pier_end)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn terrain(preset: &str) -> Terrain {
        Terrain::new(&SimulationConfig::preset(preset).unwrap(), 400.0)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn rays_meet_the_ground_where_a_fine_march_does(
            which in 0usize..4, x in -150.0..150.0f64, y in -150.0..150.0f64, dx in -1.5..1.5f64, dy in -1.5..1.5f64,
        ) {
            let terrain = terrain(["town", "hills", "quarry", "harbour"][which]);
            let (low, high) = terrain.height_range_m();
            let ray = SceneRay { origin: Vector3::new(x, y, high + 1.0), direction: Vector3::new(dx, dy, -1.0) };
            let t_max = high + 2.0 - low;
            let step = 2e-3;
            let below = |t: f64| { let p = ray.at(t); p.z < terrain.height(p.x, p.y) };
            let marched = (0..).map(|i| f64::from(i) * step).take_while(|t| *t < t_max).find(|t| below(*t));
            match (terrain.intersect(&ray, 0.0, t_max), marched) {
                // The march misses crests that are thinner than its step.
                (Some(t), Some(m)) => prop_assert!(m - t < 1.01 * step && t <= m || below(t + 1e-6), "{t}, marched {m}"),
                (Some(t), None) => prop_assert!(below(t + 1e-6) || t > t_max - 2.0 * step),
                (None, m) => prop_assert!(m.is_none(), "missed at {m:?}"),
            }
        }
    }

    #[test]
    fn heights_stay_in_the_stated_range_and_presets_are_as_steep_as_they_say() {
        for (preset, steepest_low, steepest_high) in
            [("town", 0.1, 0.6), ("hills", 0.6, 3.0), ("quarry", 1.0, 6.0), ("fields", 0.0, 0.1)]
        {
            let terrain = terrain(preset);
            let (low, high) = terrain.height_range_m();
            let mut steepest: f64 = 0.0;
            for k in 0..40_000 {
                let (x, y) = (f64::from(k % 200) * 1.7 - 170.0, f64::from(k / 200) * 1.7 - 170.0);
                assert!((low - 1e-9..=high + 1e-9).contains(&terrain.height(x, y)));
                let n = terrain.normal(x, y);
                steepest = steepest.max(n.x.hypot(n.y) / n.z);
            }
            assert!((steepest_low..steepest_high).contains(&steepest), "{preset}: slope {steepest}");
        }
    }

    #[test]
    fn water_is_level_and_has_its_share() {
        let terrain = terrain("harbour");
        let cells: Vec<(f64, f64)> =
            (0..6400).map(|k| (f64::from(k % 80) * 4.0 - 158.0, f64::from(k / 80) * 4.0 - 158.0)).collect();
        let wet: Vec<f64> =
            cells.iter().filter(|(x, y)| terrain.is_water(*x, *y)).map(|(x, y)| terrain.height(*x, *y)).collect();
        let share = wet.len() as f64 / cells.len() as f64;
        assert!((0.3..0.45).contains(&share), "{share}");
        assert!(wet.iter().filter(|z| (*z - 47.5).abs() < 1e-4).count() > wet.len() * 98 / 100);
    }
}
