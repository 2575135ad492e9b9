//! Trees on free ground and vehicles along the streets.
//!
//! Both are placed on lattices, cell by cell, so that a larger scene contains the smaller one.

use crate::config::{CrownForm, SimulationConfig, VehiclesConfig};
use crate::random::{derived, lattice};
use crate::surface::crown::Crown;
use crate::surface::natural_crown::{CrownProfile, NaturalCrown};
use crate::surface::noise::value_noise;
use crate::surface::prism::{BuildingBlock, Roof};
use crate::surface::streets::Streets;
use crate::surface::terrain::Terrain;
use crate::surface::tree::Tree;
use numeric::SplitMix64;

/// Width of the clumps in which trees stand, metres.
const CLUMP_M: f64 = 45.0;
/// Probability that a place in a clump of mean density has a tree.
const MEAN_CHANCE: f64 = 0.45;
/// Half length, half width and height of a vehicle, metres.
const CAR_M: [f64; 3] = [2.2, 0.9, 1.5];
/// Length of a parking place along the street, metres.
const PLACE_M: f64 = 6.0;
/// Share of the places in the lanes that hold a moving vehicle.
const MOVING_SHARE: f64 = 0.04;

/// Returns crowns on free ground out to `reach_m`, about as many per hectare as configured.
pub(crate) fn trees(
    config: &SimulationConfig,
    terrain: &Terrain,
    reach_m: f64,
    is_free: impl Fn(f64, f64) -> bool,
) -> Vec<Tree> {
    let density = config.vegetation.trees_per_ha / 1e4;
    if density == 0.0 {
        return Vec::new();
    }
    let seed = derived(config.seed, 4);
    let cell = (MEAN_CHANCE / density).sqrt();
    let count = (reach_m / cell).ceil() as i64;
    let tree = |i: i64, j: i64| {
        let mut stream = SplitMix64::new((lattice(seed, i, j) * (1u64 << 53) as f64) as u64);
        let [x, y] = [i, j].map(|k| (k as f64 + stream.uniform_in(0.0, 1.0)) * cell);
        let [low, high] = config.vegetation.height_m;
        let height = low + (high - low) * stream.uniform_in(0.0, 1.0);
        let radius_m = height * stream.uniform_in(0.2, 0.32);
        let chance = MEAN_CHANCE * (1.0 + 1.2 * value_noise(seed, CLUMP_M, x, y));
        let stands = stream.chance(chance) && is_free(x, y) && is_clear(x, y, radius_m, &is_free);
        stands.then(|| crown(config.vegetation.crowns, [x, y], terrain.height(x, y), [height, radius_m], &mut stream))
    };
    (-count..count).flat_map(|j| (-count..count).map(move |i| (i, j))).filter_map(|(i, j)| tree(i, j)).collect()
}

/// Probability that a natural crown is conical, and the radius of such a crown relative to that of
/// a broad one.
const CONICAL: [f64; 2] = [0.35, 0.75];
/// Height of the foot of a natural crown as a share of the tree's height: broad, conical.
const FOOT: [f64; 2] = [0.22, 0.08];

/// Makes the crown of a tree of a height and radius on ground of a height.
fn crown(
    form: CrownForm,
    centre_m: [f64; 2],
    ground_m: f64,
    [height, radius_m]: [f64; 2],
    stream: &mut SplitMix64,
) -> Tree {
    if form == CrownForm::Dome {
        let (shoulder_m, dome_m) = (ground_m + 0.35 * height, 0.65 * height);
        return Tree::Dome(Crown { centre_m, radius_m, shoulder_m, dome_m });
    }
    let (profile, foot, radius_m) = match stream.chance(CONICAL[0]) {
        true => (CrownProfile::Conical, FOOT[1], CONICAL[1] * radius_m),
        false => (CrownProfile::Broad, FOOT[0], 1.15 * radius_m),
    };
    let seed = (stream.uniform_in(0.0, 1.0) * (1u64 << 53) as f64) as u64;
    let (foot_m, top_m) = (ground_m + foot * height, ground_m + height);
    Tree::Natural(NaturalCrown { centre_m, radius_m, foot_m, top_m, profile, seed })
}

/// Returns whether a crown of a radius stands over free ground only.
fn is_clear(x: f64, y: f64, radius_m: f64, is_free: impl Fn(f64, f64) -> bool) -> bool {
    let r = 0.8 * radius_m;
    [(r, 0.0), (-r, 0.0), (0.0, r), (0.0, -r)].iter().all(|(dx, dy)| is_free(x + dx, y + dy))
}

/// Returns the vehicles of a date: parked along the kerbs, and some on the lanes.
pub(crate) fn vehicles(
    config: &VehiclesConfig,
    streets: &Streets,
    terrain: &Terrain,
    seed: u64,
    reach_m: f64,
) -> Vec<BuildingBlock> {
    if streets.half_width_m == 0.0 || config.parked_share == 0.0 {
        return Vec::new();
    }
    let lines = (reach_m * std::f64::consts::SQRT_2 / streets.spacing_m).ceil() as i64;
    let places = (reach_m * std::f64::consts::SQRT_2 / PLACE_M).ceil() as i64;
    let shares = [(0, config.parked_share), (1, config.parked_share), (2, MOVING_SHARE)];
    let streets_of = |family| (-lines..=lines).map(move |line| (family, line));
    let on_street = |(family, line): (i64, i64)| {
        let own = derived(seed, (2 * (line + lines) + family) as u64);
        (-places..=places)
            .flat_map(|place| shares.map(|(lane, share)| (place, lane, share)))
            .filter(|(place, lane, share)| lattice(own, *place, *lane) < *share)
            .filter_map(|(place, lane, _)| {
                vehicle(streets, terrain, (family, line, place, lane), derived(own, 7), reach_m)
            })
            .collect::<Vec<_>>()
    };
    (0..2).flat_map(streets_of).flat_map(on_street).collect()
}

fn vehicle(
    streets: &Streets,
    terrain: &Terrain,
    (family, line, place, lane): (i64, i64, i64, i64),
    seed: u64,
    reach_m: f64,
) -> Option<BuildingBlock> {
    let kerb = streets.half_width_m - 1.3 * CAR_M[1];
    let across = [kerb, -kerb, 0.35 * streets.half_width_m][lane as usize];
    let along = (place as f64 + 0.5 + 0.1 * (lattice(seed, place, lane) - 0.5)) * PLACE_M;
    let on_line = line as f64 * streets.spacing_m + across;
    let (u, v, turn) = if family == 0 { (along, on_line, 0.0) } else { (on_line, along, 90.0) };
    let [x, y] = streets.scene_from_street(u, v);
    let near_crossing = streets.nearest(x, y).to_crossing_m < streets.half_width_m + CAR_M[0] + 1.0;
    if near_crossing || x.abs().max(y.abs()) > reach_m || terrain.is_water(x, y) {
        return None;
    }
    let ground = terrain.height(x, y);
    let roof = Roof::Flat { height_m: ground + CAR_M[2] };
    Some(BuildingBlock {
        centre_m: [x, y],
        half_size_m: [CAR_M[0], CAR_M[1]],
        direction_deg: streets.turn_deg + turn,
        base_m: ground,
        roof,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_have_other_vehicles_on_the_same_streets() {
        let config = SimulationConfig::default();
        let terrain = Terrain::new(&config, 150.0);
        let streets = Streets::new(&config.buildings);
        let of = |seed| vehicles(&config.vehicles, &streets, &terrain, seed, 150.0);
        let (first, second) = (of(1), of(2));
        assert!((100..1500).contains(&first.len()), "{} vehicles", first.len());
        let common = first.iter().filter(|b| second.iter().any(|o| o.centre_m == b.centre_m)).count();
        assert!(common * 2 < first.len() && first == of(1));
        assert!(first.iter().all(|b| streets.is_carriageway(b.centre_m[0], b.centre_m[1])));
    }

    #[test]
    fn forests_are_as_dense_as_configured() {
        let config = SimulationConfig::preset("hills").unwrap();
        let terrain = Terrain::new(&config, 150.0);
        let count = trees(&config, &terrain, 150.0, |_, _| true).len() as f64 / 9.0;
        assert!((0.5..1.1).contains(&(count / config.vegetation.trees_per_ha)), "{count} per hectare");
    }
}
