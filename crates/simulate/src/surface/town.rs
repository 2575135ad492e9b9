//! A town from a seed: quarters along a grid of streets, and one stepped tower in the middle.
//!
//! A quarter has houses, rows, halls, a courtyard, towers, sheds, a suburb or a warehouse.
//!
//! The seed of a quarter follows from its place, so that a larger town contains the smaller one.

use crate::config::{BuildingsConfig, SimulationConfig};
use crate::random::{derived, lattice};
use crate::surface::building::{Builder, Building, Lot};
use crate::surface::streets::Streets;
use crate::surface::terrain::Terrain;
use numeric::SplitMix64;

/// Distance between the carriageway and the lots, metres.
const SIDEWALK_M: f64 = 2.5;
/// Lowest and highest walls up to the eaves, metres.
const HALL_M: [f64; 2] = [6.0, 22.0];
const ROW_M: [f64; 2] = [8.0, 14.0];
const HOUSE_M: [f64; 2] = [4.0, 7.0];
const COURTYARD_M: [f64; 2] = [15.0, 22.0];
const SHED_M: f64 = 6.0;
const SMALL_HOUSE_M: [f64; 2] = [2.8, 5.8];
const CAR_PORT_M: [f64; 2] = [2.3, 2.9];
const WAREHOUSE_M: [f64; 2] = [7.0, 15.0];
/// Width of a plot in a suburb, metres.
const PLOT_M: f64 = 14.5;

/// The kind of a quarter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quarter {
    Park,
    Hall,
    Rows,
    Houses,
    Courtyard,
    HighRise,
    Sheds,
    Suburb,
    DenseTowers,
    Warehouse,
}

/// Returns the buildings of a scene out to `reach_m` from its centre.
pub(crate) fn build(config: &SimulationConfig, terrain: &Terrain, reach_m: f64) -> Vec<Building> {
    let streets = Streets::new(&config.buildings);
    let seed = derived(config.seed, 2);
    let spacing = streets.spacing_m;
    let count = (reach_m * std::f64::consts::SQRT_2 / spacing).ceil() as i64;
    let mut town =
        Town { config: &config.buildings, builder: Builder::new(terrain, streets, config.buildings.details) };
    for (i, j) in (-count..=count).flat_map(|j| (-count..=count).map(move |i| (i, j))) {
        let centre = [(i as f64 + 0.5) * spacing, (j as f64 + 0.5) * spacing];
        let [x, y] = streets.scene_from_street(centre[0], centre[1]);
        if x.abs().max(y.abs()) > reach_m {
            continue;
        }
        let place = if config.buildings.identical { (0, 1) } else { (i, j) };
        let mut stream = SplitMix64::new((lattice(seed, place.0, place.1) * (1u64 << 53) as f64) as u64);
        if (i, j) == (0, 0) && config.buildings.landmark_height_m > 0.0 {
            town.landmark(centre);
        } else if let Some(quarter) = drawn(&config.buildings, stream.uniform_in(0.0, 1.0)) {
            town.quarter(quarter, centre, &mut stream);
        }
    }
    town.builder.buildings
}

/// Returns the kind of quarter that a number in [0, 1) selects.
fn drawn(config: &BuildingsConfig, at: f64) -> Option<Quarter> {
    let q = &config.quarters;
    let weights = [
        (q.park, Quarter::Park),
        (q.hall, Quarter::Hall),
        (q.rows, Quarter::Rows),
        (q.houses, Quarter::Houses),
        (q.courtyard, Quarter::Courtyard),
        (q.high_rise, Quarter::HighRise),
        (q.sheds, Quarter::Sheds),
        (q.suburb, Quarter::Suburb),
        (q.dense_towers, Quarter::DenseTowers),
        (q.warehouse, Quarter::Warehouse),
    ];
    let mut left = at * weights.iter().map(|(w, _)| w).sum::<f64>();
    weights
        .into_iter()
        .find(|(weight, _)| {
            left -= weight;
            left < 0.0
        })
        .map(|(_, quarter)| quarter)
}

struct Town<'a> {
    config: &'a BuildingsConfig,
    builder: Builder<'a>,
}

impl Town<'_> {
    /// Returns half the side of the free ground between four streets.
    fn half_m(&self) -> f64 {
        0.5 * (self.config.street_spacing_m - self.config.street_width_m) - SIDEWALK_M
    }

    fn quarter(&mut self, quarter: Quarter, centre: [f64; 2], stream: &mut SplitMix64) {
        match quarter {
            Quarter::Park => {}
            Quarter::Hall => self.hall(centre, stream),
            Quarter::Rows => self.rows(centre, stream),
            Quarter::Houses => self.houses(centre, stream),
            Quarter::Courtyard => self.courtyard(centre, stream),
            Quarter::HighRise => self.towers(centre, stream),
            Quarter::Sheds => self.sheds(centre),
            Quarter::Suburb => self.suburb(centre, stream),
            Quarter::DenseTowers => self.dense_towers(centre, stream),
            Quarter::Warehouse => self.warehouse(centre, stream),
        }
    }

    /// Places a podium, a tower on it and a penthouse on the tower.
    fn landmark(&mut self, centre: [f64; 2]) {
        let height = self.config.landmark_height_m;
        let steps = [([20.0, 15.0], 9.0_f64.min(0.4 * height)), ([11.0, 9.0], 0.83 * height), ([5.0, 4.0], height)];
        let steps = steps.map(|(half_size, top)| (Lot { centre, half_size, turn_deg: 0.0 }, top));
        self.builder.stepped(&steps);
    }

    fn hall(&mut self, centre: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        let half_size = [stream.uniform_in(0.5, 0.85) * half, stream.uniform_in(0.35, 0.7) * half];
        let lot = Lot { centre, half_size, turn_deg: stream.uniform_in(-4.0, 4.0) };
        let walls = stream.uniform_in(HALL_M[0], HALL_M[1]);
        if stream.chance(0.3) {
            let upper = Lot { half_size: half_size.map(|h| 0.55 * h), ..lot };
            self.builder.stepped(&[(lot, walls), (upper, walls + stream.uniform_in(3.0, 8.0))]);
        } else {
            self.builder.flat(&lot, walls, stream);
        }
    }

    fn rows(&mut self, [u, v]: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        for side in [-1.0, 1.0] {
            let half_size = [stream.uniform_in(0.6, 0.85) * half, stream.uniform_in(5.0, 6.5)];
            let lot = Lot { centre: [u, v + side * 0.55 * half], half_size, turn_deg: 0.0 };
            let walls = stream.uniform_in(ROW_M[0], ROW_M[1]);
            self.builder.any_roof(&lot, walls, [0.3, 0.2], stream);
        }
    }

    fn houses(&mut self, [u, v]: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            if stream.chance(0.15) {
                continue;
            }
            let place = |side: f64, stream: &mut SplitMix64| side * half * stream.uniform_in(0.47, 0.57);
            let centre = [u + place(a, stream), v + place(b, stream)];
            let half_size = [stream.uniform_in(5.0, 8.0), stream.uniform_in(4.0, 5.0)];
            let lot = Lot { centre, half_size, turn_deg: stream.uniform_in(-8.0, 8.0) };
            let walls = stream.uniform_in(HOUSE_M[0], HOUSE_M[1]);
            self.builder.any_roof(&lot, walls, [0.2, 0.35], stream);
        }
    }

    /// Places four wings around a courtyard, directly at the street.
    fn courtyard(&mut self, [u, v]: [f64; 2], stream: &mut SplitMix64) {
        let (half, depth) = (self.half_m(), stream.uniform_in(5.0, 6.5));
        let walls = stream.uniform_in(COURTYARD_M[0], COURTYARD_M[1]);
        let turn_deg = 0.0;
        for side in [-1.0, 1.0] {
            let lot = Lot { centre: [u, v + side * (half - depth)], half_size: [half, depth], turn_deg };
            self.builder.any_roof(&lot, walls + stream.uniform_in(-1.5, 1.5), [0.4, 0.0], stream);
        }
        for side in [-1.0, 1.0] {
            let half_size = [half - 2.0 * depth, depth];
            let lot = Lot { centre: [u + side * (half - depth), v], half_size, turn_deg: 90.0 };
            self.builder.any_roof(&lot, walls + stream.uniform_in(-1.5, 1.5), [0.4, 0.0], stream);
        }
    }

    /// Places one tower on a podium, or two towers side by side.
    fn towers(&mut self, [u, v]: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        let [low, high] = self.config.high_rise_height_m;
        if stream.chance(0.5) {
            let lot = Lot { centre: [u, v], half_size: [0.8 * half, 0.6 * half], turn_deg: 0.0 };
            let tower = Lot { half_size: [stream.uniform_in(9.0, 14.0), stream.uniform_in(8.0, 11.0)], ..lot };
            let height = stream.uniform_in(low, high);
            return self.builder.stepped(&[(lot, stream.uniform_in(6.0, 12.0)), (tower, height)]);
        }
        for side in [-1.0, 1.0] {
            let half_size = [stream.uniform_in(6.5, 9.5), stream.uniform_in(6.5, 0.8 * half)];
            let lot = Lot { centre: [u + side * 0.52 * half, v], half_size, turn_deg: 0.0 };
            self.builder.flat(&lot, stream.uniform_in(low, high), stream);
        }
    }

    /// Places two rows of plots back to back, each with a small gabled house, and on most of them a
    /// car port beside the house or a shed in the garden.
    fn suburb(&mut self, [u, v]: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        let plots = (2.0 * half / PLOT_M).round().max(1.0) as usize;
        let width = 2.0 * half / plots as f64;
        for (side, plot) in [-1.0, 1.0].into_iter().flat_map(|side| (0..plots).map(move |plot| (side, plot))) {
            let middle = u - half + (plot as f64 + 0.5) * width;
            // Houses of 60 to 120 m² and 3 to 6 m apart, near the street.
            let length = stream.uniform_in(0.6, 0.78) * width;
            let area = stream.uniform_in(60.0, 120.0);
            let depth = (area / length).clamp(6.5, 0.52 * half);
            let house_u = middle + stream.uniform_in(-0.3, 0.3) * (width - length);
            let house_v = v + side * (half - stream.uniform_in(1.0, 3.0) - 0.5 * depth);
            let turn_deg = stream.uniform_in(-3.0, 3.0);
            let lot = Lot { centre: [house_u, house_v], half_size: [0.5 * length, 0.5 * depth], turn_deg };
            let (walls, pitch) = (stream.uniform_in(SMALL_HOUSE_M[0], SMALL_HOUSE_M[1]), stream.uniform_in(0.45, 0.95));
            self.builder.gabled(&lot, walls, pitch);
            let (kind, low) = (stream.uniform_in(0.0, 1.0), stream.uniform_in(CAR_PORT_M[0], CAR_PORT_M[1]));
            let garden = v + side * stream.uniform_in(0.14, 0.2) * half;
            let across = middle + stream.uniform_in(-0.25, 0.25) * width;
            if kind < 0.4 {
                // Beside the house, on the border of the plot.
                let at = [middle + 0.5 * width, house_v - side * 0.5 * depth];
                self.builder.plain(&Lot { centre: at, half_size: [1.5, 2.8], turn_deg }, low);
            } else if kind < 0.75 {
                let shed = Lot { centre: [across, garden], half_size: [2.2, 1.6], turn_deg };
                self.builder.gabled(&shed, low - 0.3, 0.5);
            }
        }
    }

    /// Places one tower, two slabs or four towers up to the streets. Towers of neighbouring
    /// quarters are 15 to 25 m apart.
    fn dense_towers(&mut self, [u, v]: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        let [low, high] = self.config.high_rise_height_m;
        // More towers are low than high.
        let height = |stream: &mut SplitMix64| low + (high - low) * stream.uniform_in(0.0, 1.0).powf(1.4);
        let places: &[[f64; 2]] = match stream.uniform_in(0.0, 1.0) {
            kind if kind < 0.3 => &[[0.0, 0.0]],
            kind if kind < 0.65 => &[[-1.0, 0.0], [1.0, 0.0]],
            _ => &[[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]],
        };
        for &[a, b] in places {
            let mut extent = |place: f64| {
                let setback = stream.uniform_in(0.0, 2.0);
                // From the street to the middle of the quarter, less half of an alley.
                let reach = if place == 0.0 { half - setback } else { 0.5 * (half - setback - 5.0) };
                (place * (half - setback - reach), reach)
            };
            let ((offset_u, half_u), (offset_v, half_v)) = (extent(a), extent(b));
            let lot = Lot { centre: [u + offset_u, v + offset_v], half_size: [half_u, half_v], turn_deg: 0.0 };
            let walls = height(stream);
            if walls > 45.0 && stream.chance(0.35) {
                let upper = Lot { half_size: lot.half_size.map(|half| 0.72 * half), ..lot };
                self.builder.stepped(&[(lot, 0.7 * walls), (upper, walls)]);
            } else {
                self.builder.flat(&lot, walls, stream);
            }
        }
    }

    /// Places a hall that fills the quarter, with few devices on its roof.
    fn warehouse(&mut self, centre: [f64; 2], stream: &mut SplitMix64) {
        let half = self.half_m();
        let half_size = [stream.uniform_in(0.7, 0.92) * half, stream.uniform_in(0.5, 0.85) * half];
        let lot = Lot { centre, half_size, turn_deg: stream.uniform_in(-2.0, 2.0) };
        let walls = stream.uniform_in(WAREHOUSE_M[0], WAREHOUSE_M[1]);
        let pitch = if stream.chance(0.4) { stream.uniform_in(0.02, 0.08) } else { 0.0 };
        let count = (stream.uniform_in(0.0, 1.0) * 4.0) as usize;
        let boxes: Vec<([f64; 2], f64)> = (0..count)
            .map(|_| ([stream.uniform_in(-0.8, 0.8), stream.uniform_in(-0.8, 0.8)], stream.uniform_in(1.2, 2.2)))
            .collect();
        self.builder.warehouse(&lot, walls, pitch, &boxes);
    }

    /// Places three long sheds with the same roof.
    fn sheds(&mut self, [u, v]: [f64; 2]) {
        let half = self.half_m();
        let width = 2.0 * half / 3.0;
        for k in [-1.0, 0.0, 1.0] {
            let lot = Lot { centre: [u, v + k * width], half_size: [0.9 * half, 0.44 * width], turn_deg: 0.0 };
            self.builder.gabled(&lot, SHED_M, 0.3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::prism::Roof;

    fn built(preset: &str, seed: u64, reach_m: f64) -> (Terrain, Vec<Building>) {
        let config = SimulationConfig { seed, ..SimulationConfig::preset(preset).unwrap() };
        let terrain = Terrain::new(&config, reach_m + 50.0);
        let buildings = build(&config, &terrain, reach_m);
        (terrain, buildings)
    }

    fn tallest(buildings: &[Building]) -> f64 {
        buildings.iter().map(|b| b.parts.last().unwrap().top_m() - b.parts[0].base_m).fold(0.0, f64::max)
    }

    #[test]
    fn a_town_has_what_a_dsm_must_cope_with() {
        for seed in 0..20 {
            let (_, buildings) = built("town", seed, 160.0);
            let roofs: Vec<Roof> = buildings.iter().flat_map(|b| &b.parts).map(|p| p.roof).collect();
            let count = |is: fn(&Roof) -> bool| roofs.iter().filter(|r| is(r)).count();
            let gabled = count(|r| matches!(r, Roof::Gabled { .. }));
            let hipped = count(|r| matches!(r, Roof::Hipped { .. }));
            assert!(
                buildings.len() >= 15 && gabled >= 3 && hipped >= 2,
                "{seed}: {gabled}, {hipped} of {}",
                roofs.len()
            );
            assert!(buildings.iter().any(|b| b.parts.len() == 3) && buildings.iter().any(|b| !b.details.is_empty()));
            assert!((30.0..42.0).contains(&tallest(&buildings)), "{seed}");
        }
    }

    #[test]
    fn presets_are_as_high_as_they_say() {
        assert!(tallest(&built("high-rise", 1, 160.0).1) >= 140.0);
        assert!(tallest(&built("dense-city", 1, 160.0).1) >= 15.0);
        assert!(built("hills", 1, 160.0).1.is_empty() && built("fields", 1, 160.0).1.is_empty());
    }

    fn area(building: &Building) -> f64 {
        let [u, v] = building.parts[0].half_size_m;
        4.0 * u * v
    }

    /// Distance between two blocks, sampled along their outlines.
    fn gap(a: &Building, b: &Building) -> f64 {
        let outline = |building: &Building| -> Vec<[f64; 2]> {
            let corners = building.parts[0].corners();
            (0..80)
                .map(|k| {
                    let ([x0, y0], [x1, y1]) = (corners[k / 20], corners[(k / 20 + 1) % 4]);
                    let t = (k % 20) as f64 / 20.0;
                    [x0 + t * (x1 - x0), y0 + t * (y1 - y0)]
                })
                .collect()
        };
        let (a, b) = (outline(a), outline(b));
        let distances = a.iter().flat_map(|p| b.iter().map(move |q| (p[0] - q[0]).hypot(p[1] - q[1])));
        distances.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_suburb_has_small_gabled_houses_close_to_one_another() {
        for seed in 0..5 {
            let (_, buildings) = built("suburb", seed, 160.0);
            let houses: Vec<&Building> = buildings.iter().filter(|b| area(b) > 40.0).collect();
            assert!(houses.len() > 120 && buildings.len() > houses.len() + 60, "{seed}: {}", houses.len());
            assert!(houses.iter().all(|b| (55.0..=125.0).contains(&area(b))), "{seed}");
            assert!(houses.iter().all(|b| matches!(b.parts[0].roof, Roof::Gabled { .. })), "{seed}");
            let mut gaps: Vec<f64> = houses[..40]
                .iter()
                .map(|a| houses.iter().filter(|b| b.parts != a.parts).map(|b| gap(a, b)).fold(f64::INFINITY, f64::min))
                .collect();
            gaps.sort_by(f64::total_cmp);
            assert!(gaps[0] > 0.5 && gaps[20] < 6.0, "{seed}: {gaps:?}");
        }
    }

    #[test]
    fn dense_towers_stand_along_narrow_streets() {
        let (_, buildings) = built("dense-towers", 2, 160.0);
        let heights: Vec<f64> = buildings.iter().map(|b| b.parts.last().unwrap().top_m() - b.parts[0].base_m).collect();
        assert!(heights.iter().all(|h| (19.0..134.0).contains(h)) && heights.iter().any(|h| *h > 90.0));
        assert!(heights.iter().any(|h| *h < 40.0) && buildings.len() > 40, "{}", buildings.len());
        // Streets of 15 to 25 m, and alleys of about 10 m inside a quarter.
        for a in &buildings {
            for b in buildings.iter().filter(|b| b.parts != a.parts) {
                assert!(gap(a, b) > 9.0, "{}", gap(a, b));
            }
        }
        let near = buildings.iter().flat_map(|a| buildings.iter().map(move |b| gap(a, b)));
        let streets = near.filter(|gap| (15.0..=25.0).contains(gap)).count();
        assert!(streets > buildings.len(), "{streets} of {}", buildings.len());
    }

    #[test]
    fn warehouses_are_large_and_blank() {
        let (_, buildings) = built("industrial", 1, 160.0);
        let halls: Vec<&Building> = buildings.iter().filter(|b| b.blank_roof).collect();
        assert!(halls.len() >= 5, "{}", halls.len());
        assert!(halls.iter().all(|b| area(b) > 2000.0 && b.details.len() < 5));
        assert!(built("town", 1, 160.0).1.iter().all(|b| !b.blank_roof));
    }

    #[test]
    fn a_larger_town_contains_the_smaller_one() {
        let ((_, small), (_, large)) = (built("town", 4, 100.0), built("town", 4, 250.0));
        let same = |a: &Building, b: &Building| {
            a.parts.len() == b.parts.len()
                && a.parts.iter().zip(&b.parts).all(|(a, b)| {
                    a.centre_m == b.centre_m && a.half_size_m == b.half_size_m && (a.top_m() - b.top_m()).abs() < 1e-9
                })
        };
        assert!(small.iter().all(|b| large.iter().any(|other| same(other, b))) && large.len() > small.len());
    }

    #[test]
    fn every_part_starts_on_the_ground_or_on_the_part_below_and_nothing_stands_in_water() {
        for preset in ["town", "dense-city", "high-rise", "harbour"] {
            let (terrain, buildings) = built(preset, 1, 200.0);
            for building in &buildings {
                for corner in building.parts[0].corners() {
                    let ground = terrain.height(corner[0], corner[1]);
                    assert!(building.parts[0].base_m <= ground && !terrain.is_water(corner[0], corner[1]), "{preset}");
                }
                for pair in building.parts.windows(2) {
                    assert_eq!(pair[0].top_m(), pair[1].base_m);
                }
                assert!(building.parts.iter().all(|p| p.eaves_m() > p.base_m + 1.0), "{preset}: {building:?}");
            }
        }
    }

    #[test]
    fn repetitive_roofs_repeat() {
        let (_, buildings) = built("repetitive-roofs", 3, 160.0);
        assert!(buildings.len() > 30);
        assert!(buildings.iter().all(|b| b.parts[0].half_size_m == buildings[0].parts[0].half_size_m));
    }
}
