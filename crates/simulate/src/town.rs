//! A town from a seed: blocks of houses, halls and slabs along a street grid, and one stepped tower in the middle.
//!
//! The street grid is turned against the map grid, so that roof edges do not fall along the rows of a raster.

use crate::block::{Block, Roof};
use crate::random::{Stream, derived, lattice};
use crate::scene::Scene;
use crate::terrain::Terrain;

/// The street grid, which the ground's texture paints.
pub(crate) const STREETS: Streets = Streets { turn_deg: 17.0, spacing_m: 62.0, half_width_m: 5.0 };

/// Two families of parallel streets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Streets {
    /// Direction of the first family, degrees counter-clockwise from east.
    pub(crate) turn_deg: f64,
    /// Distance between centre lines.
    pub(crate) spacing_m: f64,
    /// Half the width of the carriageway.
    pub(crate) half_width_m: f64,
}

impl Streets {
    /// Street coordinates (along the first family, along the second) of a position, metres.
    pub(crate) fn street_from_scene(&self, x: f64, y: f64) -> [f64; 2] {
        let (sin, cos) = self.turn_deg.to_radians().sin_cos();
        [cos * x + sin * y, cos * y - sin * x]
    }

    fn scene_from_street(self, u: f64, v: f64) -> [f64; 2] {
        let (sin, cos) = self.turn_deg.to_radians().sin_cos();
        [cos * u - sin * v, sin * u + cos * v]
    }
}

/// A rectangle in street coordinates with a height to build.
struct Lot {
    centre: [f64; 2],
    half_size: [f64; 2],
    turn_deg: f64,
}

/// The town of a seed, out to `reach_m` from its centre, on ground around `mean_height_m` above the ellipsoid.
pub(crate) fn build(seed: u64, reach_m: f64, mean_height_m: f64, landmark_m: f64) -> Scene {
    let terrain = Terrain::new(seed, mean_height_m);
    let seed = derived(seed, 2);
    let count = (reach_m * std::f64::consts::SQRT_2 / STREETS.spacing_m).ceil() as i64;
    let mut blocks = Vec::new();
    for j in -count..=count {
        for i in -count..=count {
            let centre = [(i as f64 + 0.5) * STREETS.spacing_m, (j as f64 + 0.5) * STREETS.spacing_m];
            let [x, y] = STREETS.scene_from_street(centre[0], centre[1]);
            if x.abs().max(y.abs()) > reach_m {
                continue;
            }
            // A quarter's seed follows from its place, so that a larger town contains the smaller one.
            let mut stream = Stream::new((lattice(seed, i, j) * (1u64 << 53) as f64) as u64);
            match (i, j) {
                (0, 0) => tower(&terrain, centre, landmark_m, &mut blocks),
                _ => quarter(&terrain, centre, &mut stream, &mut blocks),
            }
        }
    }
    Scene::new(terrain, blocks)
}

/// A podium, a tower on it and a penthouse on the tower: 9, 29 and 35 m above the ground.
fn tower(terrain: &Terrain, centre: [f64; 2], height_m: f64, blocks: &mut Vec<Block>) {
    for (half_size, height) in [([20.0, 15.0], 9.0), ([11.0, 9.0], 0.83 * height_m), ([5.0, 4.0], height_m)] {
        let lot = Lot { centre, half_size, turn_deg: 0.0 };
        blocks.push(flat(terrain, &lot, height));
    }
}

/// What stands between four streets: nothing (a park), a hall, two rows or up to four houses.
fn quarter(terrain: &Terrain, centre: [f64; 2], stream: &mut Stream, blocks: &mut Vec<Block>) {
    let kind = stream.uniform(0.0, 1.0);
    if (0.12..0.40).contains(&kind) {
        let half_size = [stream.uniform(12.0, 20.0), stream.uniform(8.0, 16.0)];
        let lot = Lot { centre, half_size, turn_deg: stream.uniform(-4.0, 4.0) };
        blocks.push(flat(terrain, &lot, stream.uniform(6.0, 22.0)));
    } else if (0.40..0.60).contains(&kind) {
        rows(terrain, centre, stream, blocks);
    } else if kind >= 0.60 {
        houses(terrain, centre, stream, blocks);
    }
}

fn rows(terrain: &Terrain, [u, v]: [f64; 2], stream: &mut Stream, blocks: &mut Vec<Block>) {
    for side in [-1.0, 1.0] {
        let half_size = [stream.uniform(14.0, 20.0), stream.uniform(5.0, 6.5)];
        blocks.push(row(terrain, &Lot { centre: [u, v + side * 13.0], half_size, turn_deg: 0.0 }, stream));
    }
}

fn houses(terrain: &Terrain, [u, v]: [f64; 2], stream: &mut Stream, blocks: &mut Vec<Block>) {
    for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        if stream.chance(0.15) {
            continue;
        }
        let centre = [u + a * stream.uniform(11.0, 13.5), v + b * stream.uniform(11.0, 13.5)];
        let half_size = [stream.uniform(5.0, 8.0), stream.uniform(4.0, 5.5)];
        blocks.push(house(terrain, &Lot { centre, half_size, turn_deg: stream.uniform(-8.0, 8.0) }, stream));
    }
}

/// A long building of three to five storeys, mostly under a gabled roof.
fn row(terrain: &Terrain, lot: &Lot, stream: &mut Stream) -> Block {
    let walls = stream.uniform(8.0, 14.0);
    if stream.chance(0.3) { flat(terrain, lot, walls) } else { gabled(terrain, lot, walls, stream) }
}

/// A house of one or two storeys under a flat or a gabled roof.
fn house(terrain: &Terrain, lot: &Lot, stream: &mut Stream) -> Block {
    let walls = stream.uniform(4.0, 7.0);
    if stream.chance(0.25) { flat(terrain, lot, walls) } else { gabled(terrain, lot, walls, stream) }
}

fn flat(terrain: &Terrain, lot: &Lot, walls_m: f64) -> Block {
    block(terrain, lot, |ground| Roof::Flat { height_m: ground + walls_m })
}

fn gabled(terrain: &Terrain, lot: &Lot, walls_m: f64, stream: &mut Stream) -> Block {
    let pitch = stream.uniform(0.35, 0.75);
    block(terrain, lot, |ground| Roof::Gabled {
        eaves_m: ground + walls_m,
        ridge_m: ground + walls_m + pitch * lot.half_size[1],
    })
}

fn block(terrain: &Terrain, lot: &Lot, roof: impl Fn(f64) -> Roof) -> Block {
    let centre_m = STREETS.scene_from_street(lot.centre[0], lot.centre[1]);
    let ground_m = terrain.height(centre_m[0], centre_m[1]);
    let direction_deg = STREETS.turn_deg + lot.turn_deg;
    Block { centre_m, half_size_m: lot.half_size, direction_deg, ground_m, roof: roof(ground_m) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_town_has_what_a_dsm_must_cope_with() {
        for seed in 0..20 {
            let scene = build(seed, 160.0, 100.0, 35.0);
            let heights: Vec<f64> = scene.blocks().map(|b| b.top_m() - b.ground_m).collect();
            assert!(heights.len() >= 15, "seed {seed}: {} blocks", heights.len());
            assert!(heights.iter().all(|h| (4.0..=35.0 + 1e-9).contains(h)), "seed {seed}: {heights:?}");
            let gabled = scene.blocks().filter(|b| matches!(b.roof, Roof::Gabled { .. })).count();
            assert!(gabled >= 3 && gabled + 5 <= heights.len(), "seed {seed}: {gabled} gabled of {}", heights.len());
        }
    }

    #[test]
    fn a_larger_town_contains_the_smaller_one() {
        let (small, large) = (build(4, 100.0, 0.0, 35.0), build(4, 250.0, 0.0, 35.0));
        assert!(small.blocks().all(|b| large.blocks().any(|other| other == b)));
        assert!(large.blocks().len() > small.blocks().len());
    }

    #[test]
    fn no_wall_hangs_over_the_ground_and_no_roof_is_buried() {
        let scene = build(1, 200.0, 100.0, 35.0);
        for block in scene.blocks() {
            let [x, y] = block.centre_m;
            assert!((scene.terrain().height(x, y) - block.ground_m).abs() < 1e-9);
            assert!(scene.surface(x, y).0 >= block.top_m() - 1e-9);
        }
    }
}
