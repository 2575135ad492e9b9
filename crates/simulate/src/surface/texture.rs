//! Diffuse reflectance of the surface, 0 to 1. It is procedural, fixed to the surface, with detail
//! down to half a metre.
//!
//! Each kind of surface has its own pattern (streets with markings, parcels, strata, tiles, panels,
//! windows, foliage) times multi-octave noise. The waves of water differ between views,
//! and with seasons the albedo and the fine texture differ between dates.

use nalgebra::Vector3;

use crate::config::{AppearanceConfig, GroundCover};
use crate::random::{derived, lattice};
use crate::surface::noise::{detail, value_noise};
use crate::surface::prism::{Face, Prism, Roof};
use crate::surface::scene::{Hit, Material, Part, Scene, Shape, Solid};
use crate::views::seasons::SeasonLook;

/// Reflectance of a scene without contrast.
const MEAN: f64 = 0.22;
/// Contrast of the fine texture of a blank roof.
const BLANK_CONTRAST: f64 = 0.02;
/// Length and width of a field, metres.
const PARCEL_M: [f64; 2] = [110.0, 64.0];

/// The reflectance of a scene in one view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Texture {
    seed: u64,
    waves: u64,
    surface: AppearanceConfig,
    season: Option<SeasonLook>,
}

impl Texture {
    /// Makes the reflectance of a seed. `view` selects the waves.
    pub(crate) fn new(seed: u64, view: u64, surface: AppearanceConfig) -> Self {
        let seed = derived(seed, 3);
        Self { seed, waves: derived(seed, view), surface, season: None }
    }

    /// Returns this reflectance in the season of a date.
    pub(crate) fn on_date(self, season: Option<SeasonLook>) -> Self {
        Self { season, ..self }
    }

    /// Returns the reflectance at a hit.
    pub(crate) fn reflectance(&self, scene: &Scene, hit: &Hit) -> f64 {
        let value = match hit.part {
            Part::Ground => self.ground(scene, &hit.point),
            Part::Crown(index) => self.foliage(scene.solid(index), &hit.point),
            Part::Prism(index, face) => self.block(scene.solid(index), face, &hit.point),
        };
        let value = value.clamp(0.02, 0.9);
        match self.surface.contrast {
            1.0 => value,
            contrast => (MEAN * (value / MEAN).powf(contrast)).clamp(0.02, 0.9),
        }
    }

    fn ground(&self, scene: &Scene, point: &Vector3<f64>) -> f64 {
        let (x, y) = (point.x, point.y);
        if scene.terrain().is_water(x, y) {
            return 0.045 * (1.0 + 0.5 * value_noise(self.waves, 3.0, x, y) + 0.3 * value_noise(self.waves, 1.1, y, x));
        }
        let grain = self.grain(self.seed, x, y);
        let paved = self.season.map_or(1.0, |season| season.paved());
        if scene.streets.half_width_m > 0.0 {
            let street = scene.streets.nearest(x, y);
            let distance = street.across_m.abs();
            if distance < scene.streets.half_width_m {
                let marked = distance < 0.15 && street.along_m.rem_euclid(9.0) < 4.0;
                return paved * if marked { 0.5 } else { 0.12 * (1.0 + 0.6 * grain) };
            }
            if distance < scene.streets.half_width_m + 1.8 {
                return paved * 0.34 * (1.0 + 0.4 * grain);
            }
        }
        let open = match self.surface.cover {
            GroundCover::Town => (0.20 + 0.12 * detail(self.seed ^ 0x50, x * 0.3, y * 0.3)) * (1.0 + 0.9 * grain),
            GroundCover::Fields => self.field(x, y) * (1.0 + 0.35 * grain),
            GroundCover::Rock => {
                let strata = value_noise(self.seed ^ 0x57, 2.2, point.z, 0.1 * x);
                (0.34 + 0.06 * strata) * (1.0 + 0.8 * grain)
            }
            GroundCover::Forest => 0.11 * (1.0 + 0.9 * grain),
        };
        self.season.map_or(open, |season| open * season.ground(x, y))
    }

    /// Returns the fine texture at a place of a surface: the permanent one, or that of the date.
    fn grain(&self, seed: u64, x: f64, y: f64) -> f64 {
        let permanent = detail(seed, x, y);
        self.season.map_or(permanent, |season| season.grain(permanent, seed, x, y))
    }

    /// Returns the reflectance of parcels with their own tone and direction of rows, and tracks
    /// between them.
    fn field(&self, x: f64, y: f64) -> f64 {
        let [u, v] = [x + 0.12 * y, y - 0.09 * x];
        let (i, j) = ((u / PARCEL_M[0]).floor(), (v / PARCEL_M[1]).floor());
        let (in_u, in_v) = (u - i * PARCEL_M[0], v - j * PARCEL_M[1]);
        if in_u < 2.5 || in_v < 2.0 {
            return 0.32;
        }
        let own = |k: u64| lattice(self.seed ^ (0xf0 + k), i as i64, j as i64);
        let across = if own(1) < 0.5 { in_u } else { in_v };
        let rows = (std::f64::consts::TAU * across / (1.2 + 2.4 * own(2))).sin();
        (0.10 + 0.22 * own(0)) * (1.0 + 0.15 * rows)
    }

    fn foliage(&self, tree: &Solid, point: &Vector3<f64>) -> f64 {
        let tone = 0.07 + 0.08 * lattice(tree.paint, 0, 0);
        // The pattern of foliage depends on the height as well as on the position.
        let tufts = value_noise(tree.paint, 0.9, point.x + 0.7 * point.z, point.y - 0.6 * point.z);
        let value = tone * (1.0 + 0.6 * tufts + 0.7 * self.grain(self.seed, point.x, point.y));
        self.season.map_or(value, |season| value * season.tree(tree.paint))
    }

    fn block(&self, solid: &Solid, face: Face, point: &Vector3<f64>) -> f64 {
        let tone = lattice(solid.paint, 0, 0);
        let Shape::Prism(prism) = &solid.shape else { return MEAN };
        if solid.material == Material::Vehicle {
            return 0.04 + 0.66 * tone * tone;
        }
        let [u, v] = prism.local(point.x, point.y);
        let above_ground = point.z - prism.block.base_m;
        match face {
            Face::Roof(along) => {
                let at = if along { [v, u] } else { [u, v] };
                let grain = self.grain(solid.paint, at[0], at[1]);
                let value = match solid.material {
                    Material::BlankRoof => (0.22 + 0.3 * tone) * (1.0 + BLANK_CONTRAST * grain),
                    _ => roof(prism, solid.paint, tone, at, grain),
                };
                self.season.map_or(value, |season| value * season.roof(solid.paint))
            }
            Face::End(end) => wall(solid.paint ^ u64::from(end), tone, v, above_ground),
            Face::Side(left) => wall(solid.paint ^ (2 + u64::from(left)), tone, u, above_ground),
        }
    }
}

/// Returns the reflectance of a roof with a fine texture (`grain`).
fn roof(prism: &Prism, paint: u64, tone: f64, [u, v]: [f64; 2], grain: f64) -> f64 {
    if !matches!(prism.block.roof, Roof::Flat { .. }) {
        let course = if v.rem_euclid(1.3) < 0.45 { 0.85 } else { 1.0 };
        return (0.16 + 0.2 * tone) * course * (1.0 + 0.9 * grain);
    }
    let joint = if u.rem_euclid(4.0) < 0.3 || v.rem_euclid(5.0) < 0.3 { 0.78 } else { 1.0 };
    let patch = lattice(paint, (u / 2.5).floor() as i64, (v / 2.5).floor() as i64);
    let mended = if patch > 0.85 { 2.2 * patch - 1.1 } else { 1.0 };
    (0.2 + 0.22 * tone) * joint * mended * (1.0 + 0.7 * grain)
}

/// Returns the reflectance of a façade with a window every few metres on every storey of 3 m.
fn wall(paint: u64, tone: f64, along: f64, above_ground: f64) -> f64 {
    let pitch = 2.2 + 1.2 * lattice(paint, 1, 0);
    let (in_bay, in_storey) = (along.rem_euclid(pitch), above_ground.rem_euclid(3.0));
    let window = (0.3 * pitch..0.72 * pitch).contains(&in_bay) && (0.9..2.4).contains(&in_storey);
    // Panes reflect different parts of the sky, and some have a blind.
    let pane = 0.05 + 0.2 * lattice(paint, (along / pitch).floor() as i64, (above_ground / 3.0).floor() as i64).powi(3);
    let plaster = if window { pane } else { 0.28 + 0.2 * tone };
    plaster * (1.0 + 0.4 * detail(paint, along, above_ground))
}
