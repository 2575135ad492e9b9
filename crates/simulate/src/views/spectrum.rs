//! How bright materials are in blue, green, red and near infrared, relative to their panchromatic
//! reflectance.
//!
//! A [`Tint`] has a factor for each band. The factors follow measured spectra of the materials, as
//! libraries such as ECOSTRESS hold them, averaged over the bands: healthy leaves are bright in the
//! near infrared and dark in red, water swallows the near infrared, soil and clay rise from blue to
//! the near infrared, and asphalt, concrete and metal are nearly grey. Lawns of a town are patches
//! of the ground. Some trees are autumnal, and some flat roofs are planted.

use nalgebra::Vector3;

use crate::config::{GroundCover, MultispectralConfig};
use crate::random::lattice;
use crate::surface::noise::value_noise;
use crate::surface::prism::{Face, Prism, Roof};
use crate::surface::scene::{Hit, Material, Part, Scene, Shape, Solid};

/// Number of bands: blue, green, red, near infrared.
pub(crate) const BANDS: usize = 4;

/// Brightness of a material in each band, relative to its panchromatic reflectance.
pub(crate) type Tint = [f64; BANDS];

const GRASS: Tint = [0.28, 0.52, 0.34, 2.3];
const DRY_GRASS: Tint = [0.50, 0.75, 0.90, 1.75];
const UNDERGROWTH: Tint = [0.40, 0.65, 0.55, 2.1];
const SOIL: Tint = [0.62, 0.82, 1.10, 1.42];
const PAVING: Tint = [0.86, 0.96, 1.05, 1.12];
const ASPHALT: Tint = [0.92, 0.97, 1.02, 1.08];
const ROCK: Tint = [0.80, 0.95, 1.05, 1.15];
const WATER: Tint = [1.60, 1.40, 0.75, 0.25];
const LEAVES: Tint = [0.36, 0.68, 0.38, 3.5];
const CONIFER: Tint = [0.42, 0.72, 0.48, 2.8];
const YELLOW_LEAVES: Tint = [0.38, 0.95, 1.15, 2.9];
const BROWN_LEAVES: Tint = [0.45, 0.75, 1.20, 2.2];
const CLAY_TILES: Tint = [0.42, 0.60, 1.25, 1.50];
const SLATE: Tint = [1.00, 1.00, 0.99, 1.04];
const BITUMEN: Tint = [0.92, 0.97, 1.02, 1.10];
const CONCRETE: Tint = [0.85, 0.95, 1.05, 1.12];
const BRIGHT_METAL: Tint = [1.06, 1.02, 0.98, 0.92];
const GREEN_PAINT: Tint = [0.75, 1.30, 0.72, 1.00];
const SEDUM: Tint = [0.50, 0.80, 0.72, 1.90];
const PLASTER: Tint = [0.82, 0.96, 1.06, 1.16];
const BODYWORK: [Tint; 4] = [[1.0; BANDS], [0.55, 0.60, 1.40, 1.30], [1.45, 0.95, 0.60, 0.90], [1.05, 1.0, 0.97, 0.95]];

/// Materials of pitched and of flat roofs with their shares.
const PITCHED: [(f64, Tint); 4] = [(0.58, CLAY_TILES), (0.30, SLATE), (0.06, GREEN_PAINT), (0.06, CONCRETE)];
const FLAT: [(f64, Tint); 3] = [(0.45, BITUMEN), (0.30, CONCRETE), (0.25, BRIGHT_METAL)];

/// Width of lawns and other patches of ground, and of their ragged edges, metres.
const PATCH_M: [f64; 2] = [34.0, 8.0];
/// Level of the noise above which ground is a lawn: about half of it.
const LAWN_LEVEL: f64 = -0.05;
/// Half the range of the noise over which a lawn changes into what is beside it.
const LAWN_EDGE: f64 = 0.06;
/// Width of the patches in which a lawn is more or less dry, metres.
const DRY_M: f64 = 55.0;
/// Share of deciduous trees among those that are not autumnal.
const DECIDUOUS: f64 = 0.75;
/// Half the range of the near infrared of single trees around that of their kind.
const TREE_SPREAD: f64 = 0.15;
/// Length and width of a field, metres, as in the panchromatic pattern.
const PARCEL_M: [f64; 2] = [110.0, 64.0];

/// The spectra of the materials of a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spectrum {
    seed: u64,
    cover: GroundCover,
    config: MultispectralConfig,
}

impl Spectrum {
    pub(crate) fn new(seed: u64, cover: GroundCover, config: MultispectralConfig) -> Self {
        Self { seed: crate::random::derived(seed, 8), cover, config }
    }

    /// Returns the tint of the surface at a hit.
    pub(crate) fn tint(&self, scene: &Scene, hit: &Hit) -> Tint {
        match hit.part {
            Part::Ground => self.ground(scene, &hit.point),
            Part::Crown(index) => self.leaves(scene.solid(index).paint),
            Part::Prism(index, face) => self.block(scene.solid(index), face),
        }
    }

    fn ground(&self, scene: &Scene, point: &Vector3<f64>) -> Tint {
        let (x, y) = (point.x, point.y);
        if scene.terrain().is_water(x, y) {
            return WATER;
        }
        if scene.streets.half_width_m > 0.0 {
            let beside_m = scene.streets.nearest(x, y).across_m.abs() - scene.streets.half_width_m;
            if beside_m < 0.0 {
                return ASPHALT;
            }
            if beside_m < 1.8 {
                return PAVING;
            }
        }
        let patch = |k: u64| {
            0.75 * value_noise(self.seed ^ k, PATCH_M[0], x, y) + 0.25 * value_noise(self.seed ^ !k, PATCH_M[1], x, y)
        };
        match self.cover {
            GroundCover::Town => {
                let bare = if patch(2) > 0.0 { SOIL } else { PAVING };
                let dryness = (0.3 + 0.7 * value_noise(self.seed ^ 3, DRY_M, x, y)).clamp(0.0, 0.8);
                let lawn = mixed(&GRASS, &DRY_GRASS, dryness);
                mixed(&bare, &lawn, (0.5 + 0.5 * (patch(1) - LAWN_LEVEL) / LAWN_EDGE).clamp(0.0, 1.0))
            }
            GroundCover::Fields => self.field(x, y),
            GroundCover::Rock => mixed(&ROCK, &DRY_GRASS, (2.0 * patch(1) - 0.6).clamp(0.0, 0.5)),
            GroundCover::Forest => mixed(&SOIL, &UNDERGROWTH, (0.7 + patch(1)).clamp(0.0, 1.0)),
        }
    }

    /// Returns the tint of a parcel: a crop, stubble or bare soil, with tracks between them.
    fn field(&self, x: f64, y: f64) -> Tint {
        let [u, v] = [x + 0.12 * y, y - 0.09 * x];
        let (i, j) = ((u / PARCEL_M[0]).floor(), (v / PARCEL_M[1]).floor());
        if u - i * PARCEL_M[0] < 2.5 || v - j * PARCEL_M[1] < 2.0 {
            return SOIL;
        }
        match lattice(self.seed ^ 4, i as i64, j as i64) {
            kind if kind < 0.55 => GRASS,
            kind if kind < 0.8 => DRY_GRASS,
            _ => SOIL,
        }
    }

    fn leaves(&self, paint: u64) -> Tint {
        let kind = lattice(paint, 21, 0);
        let share = self.config.autumn_share;
        let leaves = match (kind < share, kind < 0.6 * share) {
            (true, true) => YELLOW_LEAVES,
            (true, false) => BROWN_LEAVES,
            _ if (kind - share) < DECIDUOUS * (1.0 - share) => LEAVES,
            _ => CONIFER,
        };
        let [blue, green, red, nir] = leaves;
        [blue, green, red, nir * (1.0 + TREE_SPREAD * (2.0 * lattice(paint, 22, 0) - 1.0))]
    }

    fn block(&self, solid: &Solid, face: Face) -> Tint {
        let kind = lattice(solid.paint, 31, 0);
        if solid.material == Material::Vehicle {
            return BODYWORK[(kind * BODYWORK.len() as f64) as usize % BODYWORK.len()];
        }
        let Shape::Prism(prism) = &solid.shape else { return PLASTER };
        match face {
            Face::Roof(_) if solid.material == Material::BlankRoof => BRIGHT_METAL,
            Face::Roof(_) => self.roof(prism, kind, lattice(solid.paint, 32, 0)),
            Face::End(_) | Face::Side(_) => PLASTER,
        }
    }

    fn roof(&self, prism: &Prism, kind: f64, planted: f64) -> Tint {
        if !matches!(prism.block.roof, Roof::Flat { .. }) {
            return drawn(&PITCHED, kind);
        }
        if planted < self.config.planted_roof_share { SEDUM } else { drawn(&FLAT, kind) }
    }
}

/// Returns the tint that a number in [0, 1) selects.
fn drawn(tints: &[(f64, Tint)], mut at: f64) -> Tint {
    for (share, tint) in tints {
        at -= share;
        if at < 0.0 {
            return *tint;
        }
    }
    PLASTER
}

fn mixed(a: &Tint, b: &Tint, share: f64) -> Tint {
    std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(tint: &Tint) -> f64 {
        (tint[3] - tint[2]) / (tint[3] + tint[2])
    }

    #[test]
    fn leaves_are_green_roofs_are_grey_and_water_is_dark() {
        for green in [GRASS, DRY_GRASS, UNDERGROWTH, LEAVES, CONIFER, YELLOW_LEAVES, BROWN_LEAVES, SEDUM] {
            assert!(index(&green) > 0.28, "{green:?}");
        }
        for grey in PITCHED.iter().chain(&FLAT).map(|(_, tint)| tint).chain(&[ASPHALT, PAVING, PLASTER, SOIL, ROCK]) {
            assert!((-0.1..0.2).contains(&index(grey)), "{grey:?}");
        }
        assert!(index(&WATER) < -0.4);
    }

    #[test]
    fn shares_are_what_they_say() {
        for tints in [&PITCHED[..], &FLAT] {
            assert!((tints.iter().map(|(share, _)| share).sum::<f64>() - 1.0).abs() < 1e-9);
        }
        let config = MultispectralConfig { autumn_share: 0.2, ..MultispectralConfig::default() };
        let spectrum = Spectrum::new(1, GroundCover::Town, config);
        let autumnal = (0..4000).filter(|paint| index(&spectrum.leaves(crate::random::derived(7, *paint))) < 0.55);
        assert!((700..900).contains(&autumnal.count()));
    }
}
