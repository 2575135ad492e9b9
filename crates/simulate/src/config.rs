//! What to simulate: a parameter file (TOML) in types, with the default of every number and the range it may have.
//!
//! Lengths are metres, angles degrees, heights above the WGS 84 ellipsoid. Everything random follows from `seed`. Unknown
//! keys are refused; a missing key has the value of the preset that the file names (see [`crate::PRESETS`]).

use serde::{Deserialize, Serialize};

use crate::sun::Sun;

/// A scene, its views and its sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulationConfig {
    /// Everything random follows from it.
    pub seed: u64,
    /// Side of the square area whose truth is known, metres.
    pub size_m: f64,
    /// Sampling distance of the images and cell of the truth, metres.
    pub gsd_m: f64,
    /// Number of views.
    pub views: usize,
    /// Longitude of the centre, degrees.
    pub lon_deg: f64,
    /// Latitude of the centre, degrees.
    pub lat_deg: f64,
    /// Mean height of the ground above the ellipsoid, metres.
    pub ground_height_m: f64,
    /// The bare ground.
    pub terrain: TerrainConfig,
    /// What is built on it.
    pub buildings: BuildingsConfig,
    /// What grows on it.
    pub vegetation: VegetationConfig,
    /// What drives and parks on it.
    pub vehicles: VehiclesConfig,
    /// What it looks like.
    pub surface: AppearanceConfig,
    /// From where and when the views are taken.
    pub acquisition: AcquisitionConfig,
    /// With what.
    pub sensor: SensorConfig,
    /// Through what.
    pub clouds: CloudsConfig,
}

/// The shape of the bare ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainConfig {
    /// Largest departure of the widest undulation from the mean height, metres.
    pub relief_m: f64,
    /// Wavelength of the widest undulation, metres; each next octave has half of it.
    pub wavelength_m: f64,
    /// Amplitude of each octave relative to the one before.
    pub roughness: f64,
    /// Depth of a pit in the middle of the scene, metres; 0 for none.
    pub pit_depth_m: f64,
    /// Height of the benches that the ground is cut into, metres; 0 leaves it smooth.
    pub bench_height_m: f64,
    /// Share of the area that is water, at the side away from the land; 0 for none.
    pub water_share: f64,
    /// Height of the land's edge above the water, metres.
    pub quay_height_m: f64,
}

/// A town along a grid of streets. Between four streets lies a quarter; its kind is drawn by the weights.
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
    /// Heights that towers of `high_rise` quarters may have, metres.
    pub high_rise_height_m: [f64; 2],
    /// Parapets, chimneys and plant rooms on the roofs.
    pub details: bool,
    /// Every quarter is built, painted and planted alike: a repetitive scene.
    pub identical: bool,
    /// Weight of each kind of quarter.
    pub quarters: QuarterWeights,
}

/// Relative frequency of what stands between four streets; all zero builds nothing.
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
}

/// Trees: opaque crowns on free ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VegetationConfig {
    /// Trees per hectare of free ground.
    pub trees_per_ha: f64,
    /// Heights that they may have, metres.
    pub height_m: [f64; 2],
}

/// Vehicles along the streets: other ones on every date.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehiclesConfig {
    /// Share of the parking places along the streets that are taken.
    pub parked_share: f64,
}

/// What the ground is covered with where nothing else is.
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
    /// What the ground is covered with.
    pub cover: GroundCover,
    /// Contrast of all patterns: 1 for a usual scene, near 0 for one without texture.
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

/// A direction to the sensor, as seen from the scene.
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
    /// The camera.
    pub camera: CameraModel,
    /// Direction of flight, degrees clockwise from north; image lines follow it.
    pub heading_deg: f64,
    /// Steepest view ahead and behind, degrees: the views of a pass run from the one to the other.
    pub along_track_deg: f64,
    /// Largest view to the side, degrees: the views of a pass weave between both sides.
    pub across_track_deg: f64,
    /// The views one by one, instead of the pass: as many as `views`, or empty.
    pub looks: Vec<LookAngles>,
    /// Smallest and largest length of the translation by which each view's RPC points wrong, pixels.
    pub pointing_error_px: [f64; 2],
    /// How much that error changes from the first to the last line, pixels.
    pub pointing_drift_px: f64,
    /// Number of dates. The views are shared out in order; each date has its own light, vehicles and radiometry.
    pub dates: usize,
    /// Where the light comes from on the first date.
    pub sun: Sun,
    /// How far the sun of another date may be from it, degrees: elevation, azimuth.
    pub sun_spread_deg: [f64; 2],
    /// How much the gain of another date may differ, relative to 1.
    pub gain_spread: f64,
    /// How much the offset of another date may differ, as a share of the sensor's range.
    pub offset_spread: f64,
    /// How much the gamma of another date may differ from 1.
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
    /// Lines of sight along each side of a pixel.
    pub subpixels: usize,
    /// Electrons of a white surface under full light: the photon noise is the square root of the signal.
    pub electrons_at_white: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_electrons: f64,
    /// Share of the sensor's range between black and a white surface under full light; above 1 clips.
    pub white_share: f64,
    /// Share of the sensor's range that a black surface has: path radiance and dark current.
    pub offset_share: f64,
}

/// Clouds: every view has its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloudsConfig {
    /// Share of each image that they hide.
    pub share: f64,
    /// Their typical extent, metres.
    pub extent_m: f64,
    /// Whether the hidden pixels are no-data (0) in the image, as after a cloud mask, and not white.
    pub masked: bool,
}
