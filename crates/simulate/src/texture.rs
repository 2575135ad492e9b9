//! Diffuse reflectance of the surface, [0, 1]: procedural, fixed to the surface, with detail down to half a metre.
//!
//! Each surface has its own pattern (streets with markings and parked cars, tiles, panels, windows) times multi-octave noise, so that
//! every pixel of an image carries something to match, as in a real town.

use nalgebra::Vector3;

use crate::block::{Face, Roof, Solid};
use crate::noise::detail;
use crate::random::{derived, lattice};
use crate::scene::{Hit, Part, Scene};
use crate::town::STREETS;

/// Reflectance of the town of a seed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Texture {
    seed: u64,
}

impl Texture {
    pub(crate) fn new(seed: u64) -> Self {
        Self { seed: derived(seed, 3) }
    }

    /// Reflectance at a hit.
    pub(crate) fn reflectance(&self, scene: &Scene, hit: &Hit) -> f64 {
        let value = match hit.part {
            Part::Ground => self.ground(hit.point.x, hit.point.y),
            Part::Building { solid, face } => self.building(scene.solid(solid), solid as u64, face, &hit.point),
        };
        value.clamp(0.02, 0.9)
    }

    fn ground(&self, x: f64, y: f64) -> f64 {
        let [u, v] = STREETS.street_from_scene(x, y);
        let (across_u, across_v) = (from_nearest_line(u), from_nearest_line(v));
        let grain = detail(self.seed, x, y);
        let street = across_u.abs().min(across_v.abs());
        if street < STREETS.half_width_m {
            let (across, along) = if across_u.abs() < across_v.abs() { (across_u, v) } else { (across_v, u) };
            return self.street(across, along) * (1.0 + 0.8 * grain);
        }
        if street < STREETS.half_width_m + 1.8 {
            return 0.34 * (1.0 + 0.5 * grain);
        }
        let soil = detail(self.seed ^ 0x50, x * 0.3, y * 0.3);
        (0.20 + 0.12 * soil) * (1.0 + 1.1 * grain)
    }

    /// A carriageway: a dashed centre line, and cars parked along the kerbs.
    fn street(&self, across: f64, along: f64) -> f64 {
        if across.abs() < 0.2 && along.rem_euclid(9.0) < 4.0 {
            return 0.55;
        }
        let slot = (along / 6.0).floor();
        let in_slot = along - 6.0 * slot;
        let side = if across > 0.0 { 1 } else { 0 };
        let parked = lattice(self.seed ^ 0xca, slot as i64, side);
        if (2.9..4.7).contains(&across.abs()) && (0.8..5.1).contains(&in_slot) && parked < 0.35 {
            return 0.05 + 1.8 * parked;
        }
        0.13
    }

    fn building(&self, solid: &Solid, id: u64, face: Face, point: &Vector3<f64>) -> f64 {
        let [u, v] = solid.local(point.x, point.y);
        let own = derived(self.seed, 100 + id);
        let tone = lattice(own, 0, 0);
        match (face, solid.block.roof) {
            (Face::Roof(_), Roof::Flat { .. }) => {
                let joint = if u.rem_euclid(4.0) < 0.3 || v.rem_euclid(5.0) < 0.3 { 0.75 } else { 1.0 };
                let plant = lattice(own, (u / 2.5).floor() as i64, (v / 2.5).floor() as i64);
                let equipment = if plant > 0.8 { 2.2 * plant - 1.1 } else { 1.0 };
                (0.22 + 0.22 * tone) * joint * equipment * (1.0 + 0.8 * detail(own, u, v))
            }
            (Face::Roof(_), _) => {
                let course = if v.rem_euclid(1.3) < 0.45 { 0.82 } else { 1.0 };
                (0.16 + 0.2 * tone) * course * (1.0 + 1.1 * detail(own, u, v))
            }
            (Face::End(side), _) => wall(own ^ u64::from(side > 0), tone, v, point.z - solid.block.ground_m),
            (Face::Side(side), _) => wall(own ^ (2 + u64::from(side > 0)), tone, u, point.z - solid.block.ground_m),
        }
    }
}

/// A façade with a window every 2.6 m on every storey of 3 m.
fn wall(seed: u64, tone: f64, along: f64, above_ground: f64) -> f64 {
    let window = (0.8..1.9).contains(&along.rem_euclid(2.6)) && (0.9..2.4).contains(&above_ground.rem_euclid(3.0));
    let plaster = if window { 0.08 } else { 0.3 + 0.2 * tone };
    plaster * (1.0 + 0.4 * detail(seed, along, above_ground))
}

/// Signed distance from the nearest centre line of a family of streets.
fn from_nearest_line(coordinate: f64) -> f64 {
    let s = STREETS.spacing_m;
    coordinate - s * (coordinate / s).round()
}
