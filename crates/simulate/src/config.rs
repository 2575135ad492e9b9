//! The configuration of a simulation: the types of a parameter file (TOML).
//!
//! Lengths are metres, angles degrees, heights above the WGS 84 ellipsoid. All random numbers
//! follow from `seed`. Unknown keys are errors. A missing key takes the value of the preset that
//! the file names (see [`crate::PRESETS`]).

use serde::{Deserialize, Serialize};

use crate::random::derived;
use crate::views::seasons::SeasonsConfig;
use crate::views::sun::Sun;

/// A scene, its views and its sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulationConfig {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Side of the square area whose truth is known, metres.
    pub size_m: f64,
    /// Sampling distance of the images and cell size of the truth, metres.
    pub gsd_m: f64,
    /// Number of views.
    pub views: usize,
    /// Longitude of the centre, degrees.
    pub lon_deg: f64,
    /// Latitude of the centre, degrees.
    pub lat_deg: f64,
    /// Mean height of the ground above the ellipsoid, metres.
    pub ground_height_m: f64,
    /// Numbers of the buildings that do not stand, from 1 as in the truth's `buildings.tif`. All
    /// else stays as it was with them, which makes a second date of the same scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub absent_buildings: Vec<u32>,
    /// Bare ground.
    pub terrain: TerrainConfig,
    /// Streets and buildings.
    pub buildings: BuildingsConfig,
    /// Trees.
    pub vegetation: VegetationConfig,
    /// Vehicles.
    pub vehicles: VehiclesConfig,
    /// Ground cover and contrast.
    pub surface: AppearanceConfig,
    /// Directions, dates and light of the views.
    pub acquisition: AcquisitionConfig,
    /// Optics and detector.
    pub sensor: SensorConfig,
    /// Clouds.
    pub clouds: CloudsConfig,
    /// Change of the scene and of the sharpness from date to date.
    #[serde(default, skip_serializing_if = "SeasonsConfig::is_none")]
    pub seasons: SeasonsConfig,
    /// A multispectral image of each view beside the panchromatic one. `None` makes none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multispectral: Option<MultispectralConfig>,
}

/// Multispectral images: blue, green, red and near infrared, taken with the panchromatic images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MultispectralConfig {
    /// Side of a multispectral pixel, in panchromatic pixels.
    pub ratio: usize,
    /// Share of the trees whose leaves are yellow or brown, 0 to 1.
    pub autumn_share: f64,
    /// Share of the flat roofs that are planted, 0 to 1.
    pub planted_roof_share: f64,
}

/// The shape of the bare ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainConfig {
    /// Amplitude of the widest undulation, metres.
    pub relief_m: f64,
    /// Wavelength of the widest undulation, metres. Each further octave has half of it.
    pub wavelength_m: f64,
    /// Amplitude of each octave relative to the one before.
    pub roughness: f64,
    /// Depth of a pit in the middle of the scene, metres; 0 for none.
    pub pit_depth_m: f64,
    /// Height of the benches into which the ground is cut, metres; 0 for smooth ground.
    pub bench_height_m: f64,
    /// Share of the area that is water, on one side of the scene; 0 for none.
    pub water_share: f64,
    /// Height of the quay above the water, metres.
    pub quay_height_m: f64,
}

/// A town along a grid of streets. The kind of each quarter between four streets is drawn by the
/// weights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuildingsConfig {
    /// Direction of the first family of streets, degrees counter-clockwise from east.
    pub turn_deg: f64,
    /// Distance between the centre lines of parallel streets, metres.
    pub street_spacing_m: f64,
    /// Width of the carriageway, metres; 0 for no streets.
    pub street_width_m: f64,
    /// Height of a stepped tower in the middle of the scene, metres; 0 for none.
    pub landmark_height_m: f64,
    /// Lowest and highest tower of `high_rise` and `dense_towers` quarters, metres.
    pub high_rise_height_m: [f64; 2],
    /// Whether roofs have parapets, chimneys and plant rooms.
    pub details: bool,
    /// Whether every quarter is built, painted and planted alike, which makes a repetitive scene.
    pub identical: bool,
    /// Weight of each kind of quarter.
    pub quarters: QuarterWeights,
}

/// Relative frequency of the kinds of quarters. If all are zero, nothing is built.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuarterWeights {
    /// Nothing.
    pub park: f64,
    /// One flat-roofed hall.
    pub hall: f64,
    /// Two rows of terraced houses.
    pub rows: f64,
    /// Up to four detached houses.
    pub houses: f64,
    /// A closed block of five to seven storeys around a courtyard.
    pub courtyard: f64,
    /// One or two towers.
    pub high_rise: f64,
    /// Long low sheds side by side.
    pub sheds: f64,
    /// Small gabled houses close to one another, with sheds and car ports.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub suburb: f64,
    /// Towers that fill their block up to the street.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub dense_towers: f64,
    /// One large hall under an almost blank roof.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub warehouse: f64,
}

/// Whether a weight is missing from a parameter file that states only what is used.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(weight: &f64) -> bool {
    *weight == 0.0
}

/// Whether a campaign is missing from a parameter file that states only what is used.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_first(campaign: &u64) -> bool {
    *campaign == 0
}

impl SimulationConfig {
    /// Returns the seed of what differs from campaign to campaign.
    pub(crate) fn campaign_seed(&self) -> u64 {
        match self.acquisition.campaign {
            0 => self.seed,
            campaign => derived(self.seed ^ 0xca3, campaign),
        }
    }
}

/// Trees: opaque crowns on free ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VegetationConfig {
    /// Trees per hectare of free ground.
    pub trees_per_ha: f64,
    /// Lowest and highest tree, metres.
    pub height_m: [f64; 2],
    /// Shape of the crowns.
    #[serde(default, skip_serializing_if = "CrownForm::is_dome")]
    pub crowns: CrownForm,
}

/// The shape of tree crowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CrownForm {
    /// Smooth domes on upright cylinders that reach the ground.
    #[default]
    Dome,
    /// Rough ellipsoids and cones above the ground.
    Natural,
}

impl CrownForm {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    fn is_dome(&self) -> bool {
        *self == Self::Dome
    }
}

/// Vehicles along the streets, different ones on every date.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehiclesConfig {
    /// Share of the parking places that are taken.
    pub parked_share: f64,
}

/// Cover of the bare ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum GroundCover {
    /// Lawns, beaten earth and paving.
    Town,
    /// Parcels of crops with their rows.
    Fields,
    /// Rock and scree.
    Rock,
    /// Undergrowth.
    Forest,
}

/// Patterns and their contrast.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AppearanceConfig {
    /// Cover of the bare ground.
    pub cover: GroundCover,
    /// Contrast of all patterns: 1 for a usual scene, near 0 for a scene without texture.
    pub contrast: f64,
}

/// How the sensor gathers an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CameraModel {
    /// Line by line from a moving orbit.
    Pushbroom,
    /// All pixels at once.
    Frame,
}

/// The direction from the scene to the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookAngles {
    /// Angle between the line of sight and the vertical at the scene, degrees.
    pub incidence_deg: f64,
    /// Direction from the scene to the sensor, degrees clockwise from north.
    pub azimuth_deg: f64,
}

/// Geometry, dates and light of the views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AcquisitionConfig {
    /// Kind of camera.
    pub camera: CameraModel,
    /// Direction of flight, degrees clockwise from north; image lines follow it.
    pub heading_deg: f64,
    /// Largest angle ahead and behind, degrees. The views of a pass run from the one to the other.
    pub along_track_deg: f64,
    /// Largest angle to the side, degrees. The views of a pass alternate between both sides.
    pub across_track_deg: f64,
    /// Lines of sight of the single views in place of a pass. Either empty or as many as `views`.
    pub looks: Vec<LookAngles>,
    /// Smallest and largest pointing error of the delivered RPCs, pixels.
    pub pointing_error_px: [f64; 2],
    /// Change of the pointing error from the first to the last line, pixels.
    pub pointing_drift_px: f64,
    /// Number of the campaign. Another number gives the same scene other light, vehicles, pointing
    /// errors and noise.
    #[serde(default, skip_serializing_if = "is_first")]
    pub campaign: u64,
    /// Number of dates. Views are distributed over them in order. Each date has its own light,
    /// vehicles and radiometry.
    pub dates: usize,
    /// Direction of the sunlight on the first date.
    pub sun: Sun,
    /// Largest difference of the sun on other dates: elevation and azimuth, degrees.
    pub sun_spread_deg: [f64; 2],
    /// Largest relative difference of the gain on other dates.
    pub gain_spread: f64,
    /// Largest difference of the offset on other dates, as a share of the sensor's range.
    pub offset_spread: f64,
    /// Largest difference of gamma from 1 on other dates.
    pub gamma_spread: f64,
}

/// Optics, detector and quantisation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Bits of a digital number.
    pub bits: u32,
    /// Modulation transfer at the Nyquist frequency, pixel box included.
    pub mtf_at_nyquist: f64,
    /// Number of samples along each side of a pixel.
    pub subpixels: usize,
    /// Electrons of a white surface under full light. The photon noise is the square root of the
    /// signal.
    pub electrons_at_white: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_electrons: f64,
    /// Share of the sensor's range that a white surface under full light reaches. Values above 1
    /// saturate.
    pub white_share: f64,
    /// Value of a black surface as a share of the sensor's range: path radiance and dark current.
    pub offset_share: f64,
}

/// Clouds, different ones in every view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloudsConfig {
    /// Share of each image that is hidden.
    pub share: f64,
    /// Typical extent of a cloud, metres.
    pub extent_m: f64,
    /// Whether hidden pixels are no-data (0), as after a cloud mask. Otherwise they are white.
    pub masked: bool,
}
