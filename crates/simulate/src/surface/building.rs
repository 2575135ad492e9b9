//! Buildings: blocks that stand on the ground or on each other, and details on their roofs.
//!
//! An LoD2 model holds the blocks. Parapets, chimneys and plant rooms are details that it leaves
//! out.

use serde::{Deserialize, Serialize};

use crate::surface::prism::{BuildingBlock, Roof};
use crate::surface::streets::Streets;
use crate::surface::terrain::Terrain;
use numeric::SplitMix64;

/// Height and thickness of a parapet, metres.
const PARAPET_M: [f64; 2] = [0.9, 0.4];
/// Height of a chimney over the ridge and half its side, metres.
const CHIMNEY_M: [f64; 2] = [1.2, 0.45];

/// A building.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Building {
    /// Blocks. Each stands on the ground or on the one before.
    pub parts: Vec<BuildingBlock>,
    /// Parapets, chimneys, plant rooms.
    pub details: Vec<BuildingBlock>,
    /// Whether the roof has almost no texture.
    pub blank_roof: bool,
}

/// A rectangle to build on, in street coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lot {
    pub(crate) centre: [f64; 2],
    pub(crate) half_size: [f64; 2],
    pub(crate) turn_deg: f64,
}

/// Places buildings on lots.
pub(crate) struct Builder<'a> {
    terrain: &'a Terrain,
    streets: Streets,
    with_details: bool,
    pub(crate) buildings: Vec<Building>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(terrain: &'a Terrain, streets: Streets, with_details: bool) -> Self {
        Self { terrain, streets, with_details, buildings: Vec::new() }
    }

    /// Places a building with a flat (first probability), hipped (second) or gabled roof.
    pub(crate) fn any_roof(&mut self, lot: &Lot, walls_m: f64, [flat, hipped]: [f64; 2], stream: &mut SplitMix64) {
        let (kind, pitch) = (stream.uniform_in(0.0, 1.0), stream.uniform_in(0.35, 0.75));
        if kind < flat {
            self.flat(lot, walls_m, stream);
        } else if kind < flat + hipped {
            self.hipped(lot, walls_m, pitch);
        } else {
            self.gabled(lot, walls_m, pitch);
        }
    }

    /// Places a building with a flat roof, a parapet and a plant room.
    pub(crate) fn flat(&mut self, lot: &Lot, walls_m: f64, stream: &mut SplitMix64) {
        let Some((ground, block)) = self.block(lot) else { return };
        let block = BuildingBlock { roof: Roof::Flat { height_m: ground + walls_m }, ..block };
        let mut details = parapets(&block);
        let [u, v] = block.half_size_m;
        let at = block.position(stream.uniform_in(-0.5, 0.5) * u, stream.uniform_in(-0.4, 0.4) * v);
        let half_size_m = [stream.uniform_in(1.2, 0.3 * u + 1.2), stream.uniform_in(1.0, 0.25 * v + 1.0)];
        details.push(on_roof(&block, at, half_size_m, block.top_m() + stream.uniform_in(1.8, 3.2)));
        self.push(vec![block], details);
    }

    /// Places a building with a gabled roof of a pitch (metres per metre) and a chimney.
    pub(crate) fn gabled(&mut self, lot: &Lot, walls_m: f64, pitch: f64) {
        self.pitched(lot, walls_m, pitch, |eaves_m, ridge_m| Roof::Gabled { eaves_m, ridge_m });
    }

    /// Places a building with a hipped roof of a pitch (metres per metre) and a chimney.
    pub(crate) fn hipped(&mut self, lot: &Lot, walls_m: f64, pitch: f64) {
        self.pitched(lot, walls_m, pitch, |eaves_m, ridge_m| Roof::Hipped { eaves_m, ridge_m });
    }

    /// Places flat blocks on top of each other. Each is (lot, height above the ground) and lies
    /// inside the one before.
    pub(crate) fn stepped(&mut self, steps: &[(Lot, f64)]) {
        let Some((ground, _)) = steps.first().and_then(|(lot, _)| self.block(lot)) else { return };
        let mut parts: Vec<BuildingBlock> = Vec::new();
        for (lot, height) in steps {
            let Some((_, block)) = self.block(lot) else { return };
            let base_m = parts.last().map_or(block.base_m, BuildingBlock::top_m);
            parts.push(BuildingBlock { base_m, roof: Roof::Flat { height_m: ground + height }, ..block });
        }
        let details = parts.iter().flat_map(parapets).collect();
        self.push(parts, details);
    }

    /// Places a building with a flat roof without parapet and plant room, such as a car port.
    pub(crate) fn plain(&mut self, lot: &Lot, walls_m: f64) {
        let Some((ground, block)) = self.block(lot) else { return };
        self.push(vec![BuildingBlock { roof: Roof::Flat { height_m: ground + walls_m }, ..block }], Vec::new());
    }

    /// Places a hall under a blank roof: flat, or gabled with a small pitch (metres per metre).
    /// Boxes on the roof are given by their position (shares of the half size) and their height.
    pub(crate) fn warehouse(&mut self, lot: &Lot, walls_m: f64, pitch: f64, boxes: &[([f64; 2], f64)]) {
        let Some((ground, block)) = self.block(lot) else { return };
        let [u, v] = block.half_size_m;
        let eaves_m = ground + walls_m;
        let roof = match pitch > 0.0 {
            true => Roof::Gabled { eaves_m, ridge_m: eaves_m + pitch * v },
            false => Roof::Flat { height_m: eaves_m },
        };
        let block = BuildingBlock { roof, ..block };
        let device = |([across, along], height): &([f64; 2], f64)| {
            on_roof(&block, block.position(across * u, along * v), [1.8, 1.2], block.top_m() + height)
        };
        let details = boxes.iter().map(device).collect();
        self.push(vec![block], details);
        if let Some(building) = self.buildings.last_mut() {
            building.blank_roof = true;
        }
    }

    fn pitched(&mut self, lot: &Lot, walls_m: f64, pitch: f64, roof: impl Fn(f64, f64) -> Roof) {
        // The ridge runs along the long axis.
        let [u, v] = lot.half_size;
        let lot = match u < v {
            true => Lot { half_size: [v, u], turn_deg: lot.turn_deg + 90.0, ..*lot },
            false => *lot,
        };
        let Some((ground, block)) = self.block(&lot) else { return };
        let eaves_m = ground + walls_m;
        let block = BuildingBlock { roof: roof(eaves_m, eaves_m + pitch * block.half_size_m[1]), ..block };
        let [u, v] = block.half_size_m;
        // On the ridge, a third of its length from the middle, a little down the slope.
        let at = block.position(0.33 * (u - v).max(0.3 * u), 0.12 * v);
        let chimney = on_roof(&block, at, [CHIMNEY_M[1]; 2], block.top_m() + CHIMNEY_M[0]);
        self.push(vec![block], vec![chimney]);
    }

    fn push(&mut self, parts: Vec<BuildingBlock>, details: Vec<BuildingBlock>) {
        let details = if self.with_details { details } else { Vec::new() };
        self.buildings.push(Building { parts, details, blank_roof: false });
    }

    /// Returns the ground height at the middle of a lot and a block without a roof. `None` if a
    /// corner lies in water.
    fn block(&self, lot: &Lot) -> Option<(f64, BuildingBlock)> {
        let centre_m = self.streets.scene_from_street(lot.centre[0], lot.centre[1]);
        let ground = self.terrain.height(centre_m[0], centre_m[1]);
        let direction_deg = self.streets.turn_deg + lot.turn_deg;
        let roof = Roof::Flat { height_m: ground };
        let block = BuildingBlock { centre_m, half_size_m: lot.half_size, direction_deg, base_m: ground, roof };
        let corners = block.corners();
        let dry = corners.iter().all(|[x, y]| !self.terrain.is_water(*x, *y));
        let base_m = corners.iter().map(|[x, y]| self.terrain.height(*x, *y)).fold(ground, f64::min);
        dry.then_some((ground, BuildingBlock { base_m, ..block }))
    }
}

/// Makes a box on a roof.
fn on_roof(below: &BuildingBlock, centre_m: [f64; 2], half_size_m: [f64; 2], top_m: f64) -> BuildingBlock {
    let (direction_deg, base_m) = (below.direction_deg, below.eaves_m());
    BuildingBlock { centre_m, half_size_m, direction_deg, base_m, roof: Roof::Flat { height_m: top_m } }
}

/// Makes the parapets along the four edges of a flat roof.
fn parapets(block: &BuildingBlock) -> Vec<BuildingBlock> {
    let ([u, v], [height, thickness]) = (block.half_size_m, PARAPET_M);
    let half = 0.5 * thickness;
    let edges = [
        (0.0, v - half, [u, half]),
        (0.0, half - v, [u, half]),
        (u - half, 0.0, [half, v - thickness]),
        (half - u, 0.0, [half, v - thickness]),
    ];
    edges.map(|(u, v, size)| on_roof(block, block.position(u, v), size, block.top_m() + height)).to_vec()
}
