//! Named scenes. Each is stated as its differences from the preset `town`.

use crate::config::{
    AcquisitionConfig, AppearanceConfig, BuildingsConfig, CameraModel, CloudsConfig, CrownForm, GroundCover,
    MultispectralConfig, QuarterWeights, SensorConfig, SimulationConfig, TerrainConfig, VegetationConfig,
    VehiclesConfig,
};
use crate::error::{Reason, SimulateError};
use crate::views::seasons::SeasonsConfig;
use crate::views::sun::Sun;

impl Default for SimulationConfig {
    /// The preset `town`.
    fn default() -> Self {
        Self {
            seed: 1,
            size_m: 320.0,
            gsd_m: 0.5,
            views: 3,
            lon_deg: 5.40,
            lat_deg: 43.53,
            ground_height_m: 180.0,
            absent_buildings: Vec::new(),
            terrain: TerrainConfig::default(),
            buildings: BuildingsConfig::default(),
            vegetation: VegetationConfig { trees_per_ha: 25.0, height_m: [4.0, 11.0], crowns: CrownForm::Dome },
            vehicles: VehiclesConfig { parked_share: 0.35 },
            surface: AppearanceConfig { cover: GroundCover::Town, contrast: 1.0 },
            acquisition: AcquisitionConfig::default(),
            sensor: SensorConfig::default(),
            clouds: CloudsConfig { share: 0.0, extent_m: 120.0, masked: true },
            seasons: SeasonsConfig::default(),
            multispectral: None,
        }
    }
}

impl Default for MultispectralConfig {
    /// Pixels four times as wide, as WorldView, Pléiades and SuperView have them; a few trees are
    /// autumnal, and few flat roofs are planted.
    fn default() -> Self {
        Self { ratio: 4, autumn_share: 0.12, planted_roof_share: 0.06 }
    }
}

impl Default for TerrainConfig {
    /// Gentle ground.
    fn default() -> Self {
        Self {
            relief_m: 6.5,
            wavelength_m: 300.0,
            roughness: 0.33,
            pit_depth_m: 0.0,
            bench_height_m: 0.0,
            water_share: 0.0,
            quay_height_m: 2.5,
        }
    }
}

impl Default for BuildingsConfig {
    /// A town whose street grid is rotated against the map grid, so that roof edges do not follow
    /// the rows of a raster.
    fn default() -> Self {
        Self {
            turn_deg: 17.0,
            street_spacing_m: 62.0,
            street_width_m: 10.0,
            landmark_height_m: 35.0,
            high_rise_height_m: [60.0, 150.0],
            details: true,
            identical: false,
            quarters: QuarterWeights { park: 0.12, hall: 0.22, rows: 0.24, houses: 0.42, ..QuarterWeights::default() },
        }
    }
}

impl Default for AcquisitionConfig {
    /// One pass of an agile satellite: a forward, a near-nadir and a backward view within a minute.
    fn default() -> Self {
        Self {
            camera: CameraModel::Pushbroom,
            heading_deg: 190.0,
            along_track_deg: 16.5,
            across_track_deg: 6.0,
            looks: Vec::new(),
            campaign: 0,
            pointing_error_px: [1.0, 3.0],
            pointing_drift_px: 0.0,
            dates: 1,
            sun: Sun { elevation_deg: 52.0, azimuth_deg: 152.0 },
            sun_spread_deg: [14.0, 30.0],
            gain_spread: 0.25,
            offset_spread: 0.03,
            gamma_spread: 0.15,
        }
    }
}

impl Default for SensorConfig {
    /// 11 bits at a signal-to-noise ratio of about 90 for a grey surface in the sun.
    fn default() -> Self {
        Self {
            bits: 11,
            mtf_at_nyquist: 0.2,
            subpixels: 3,
            electrons_at_white: 30_000.0,
            read_noise_electrons: 25.0,
            white_share: 1.2,
            offset_share: 0.05,
        }
    }
}

impl SimulationConfig {
    /// Returns the configuration of a name in [`PRESETS`](crate::PRESETS).
    ///
    /// # Errors
    /// A name that no preset has; the text lists the names.
    pub fn preset(name: &str) -> Result<Self, SimulateError> {
        let town = Self::default();
        Ok(match name {
            "town" => town,
            "dense-city" => dense_city(town),
            "high-rise" => high_rise(town),
            "hills" => hills(town),
            "quarry" => quarry(town),
            "fields" => fields(town),
            "harbour" => harbour(town),
            "repetitive-roofs" => repetitive_roofs(town),
            "suburb" => suburb(town),
            "dense-towers" => dense_towers(town),
            "industrial" => industrial(town),
            "low-texture" => Self { surface: AppearanceConfig { contrast: 0.12, ..town.surface }, ..town },
            _ => return Err(Reason::UnknownPreset { found: name.to_owned() }.into()),
        })
    }
}

fn dense_city(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { courtyard: 0.8, hall: 0.1, park: 0.05, high_rise: 0.05, ..Default::default() };
    let buildings = BuildingsConfig { street_spacing_m: 58.0, street_width_m: 9.0, quarters, ..town.buildings };
    let buildings = BuildingsConfig { high_rise_height_m: [35.0, 60.0], ..buildings };
    let vegetation = VegetationConfig { trees_per_ha: 15.0, ..town.vegetation };
    SimulationConfig { buildings, vegetation, ..town }
}

fn high_rise(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { high_rise: 0.4, hall: 0.2, park: 0.2, rows: 0.2, ..Default::default() };
    let buildings = BuildingsConfig {
        street_spacing_m: 80.0,
        street_width_m: 14.0,
        landmark_height_m: 150.0,
        quarters,
        ..town.buildings
    };
    let terrain = TerrainConfig { relief_m: 1.0, ..town.terrain };
    SimulationConfig { terrain, buildings, ..town }
}

fn hills(town: SimulationConfig) -> SimulationConfig {
    let terrain = TerrainConfig { relief_m: 60.0, wavelength_m: 380.0, roughness: 0.35, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 260.0, height_m: [6.0, 22.0], ..town.vegetation };
    let surface = AppearanceConfig { cover: GroundCover::Forest, ..town.surface };
    SimulationConfig {
        ground_height_m: 640.0,
        terrain,
        vegetation,
        surface,
        buildings: unbuilt(town.buildings),
        ..town
    }
}

fn quarry(town: SimulationConfig) -> SimulationConfig {
    let terrain = TerrainConfig { pit_depth_m: 60.0, bench_height_m: 12.0, roughness: 0.4, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 6.0, ..town.vegetation };
    let surface = AppearanceConfig { cover: GroundCover::Rock, ..town.surface };
    SimulationConfig { terrain, vegetation, surface, buildings: unbuilt(town.buildings), ..town }
}

fn fields(town: SimulationConfig) -> SimulationConfig {
    let terrain = TerrainConfig { relief_m: 0.6, roughness: 0.25, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 1.5, ..town.vegetation };
    let surface = AppearanceConfig { cover: GroundCover::Fields, ..town.surface };
    SimulationConfig { terrain, vegetation, surface, buildings: unbuilt(town.buildings), ..town }
}

fn harbour(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { sheds: 0.5, hall: 0.3, park: 0.2, ..Default::default() };
    let buildings = BuildingsConfig { landmark_height_m: 0.0, quarters, ..town.buildings };
    let terrain = TerrainConfig { relief_m: 0.3, water_share: 0.4, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 2.0, ..town.vegetation };
    SimulationConfig { ground_height_m: 50.0, terrain, buildings, vegetation, ..town }
}

fn repetitive_roofs(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { sheds: 1.0, ..Default::default() };
    let buildings = BuildingsConfig { landmark_height_m: 0.0, identical: true, quarters, ..town.buildings };
    let terrain = TerrainConfig { relief_m: 0.5, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 0.0, ..town.vegetation };
    SimulationConfig { terrain, buildings, vegetation, ..town }
}

fn suburb(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { suburb: 0.94, park: 0.06, ..Default::default() };
    let buildings = BuildingsConfig {
        street_spacing_m: 56.0,
        street_width_m: 7.0,
        landmark_height_m: 0.0,
        quarters,
        ..town.buildings
    };
    let vegetation = VegetationConfig { trees_per_ha: 45.0, height_m: [3.5, 14.0], crowns: CrownForm::Natural };
    SimulationConfig { buildings, vegetation, ..town }
}

fn dense_towers(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { dense_towers: 0.92, park: 0.08, ..Default::default() };
    let buildings = BuildingsConfig {
        street_spacing_m: 56.0,
        street_width_m: 11.0,
        landmark_height_m: 0.0,
        high_rise_height_m: [20.0, 130.0],
        quarters,
        ..town.buildings
    };
    let terrain = TerrainConfig { relief_m: 1.0, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 12.0, crowns: CrownForm::Natural, ..town.vegetation };
    SimulationConfig { terrain, buildings, vegetation, ..town }
}

fn industrial(town: SimulationConfig) -> SimulationConfig {
    let quarters = QuarterWeights { warehouse: 0.8, sheds: 0.1, park: 0.1, ..Default::default() };
    let buildings = BuildingsConfig { street_spacing_m: 110.0, landmark_height_m: 0.0, quarters, ..town.buildings };
    let terrain = TerrainConfig { relief_m: 1.0, ..town.terrain };
    let vegetation = VegetationConfig { trees_per_ha: 8.0, crowns: CrownForm::Natural, ..town.vegetation };
    SimulationConfig { terrain, buildings, vegetation, ..town }
}

/// Returns a configuration without streets and houses.
fn unbuilt(town: BuildingsConfig) -> BuildingsConfig {
    let quarters = QuarterWeights::default();
    BuildingsConfig { street_width_m: 0.0, landmark_height_m: 0.0, quarters, ..town }
}
