//! Parameter files: TOML in, TOML out, and the range of every number.
//!
//! A file may name a `preset`, which supplies every missing key. The default preset is `town`. An
//! unknown key is an error that lists the known keys.

use crate::config::SimulationConfig;
use crate::error::{Reason, SimulateError};
use crate::views::sun::Sun;

/// The key of a parameter file that names the preset it starts from.
const PRESET_KEY: &str = "preset";
/// Largest number of views. A cell of the truth has a bit for each view.
const MAX_VIEWS: f64 = 16.0;
/// Largest number of pixels. Each takes about 6 bytes, 2 GB in all.
const MAX_PIXELS: f64 = 3e8;

impl SimulationConfig {
    /// Reads the text of a parameter file.
    ///
    /// # Errors
    /// Text that is no TOML, an unknown preset, an unknown key, a value of the wrong type or out of
    /// range.
    pub fn from_toml(text: &str) -> Result<Self, SimulateError> {
        let refused = |error: toml::de::Error| Reason::Parameters { text: error.to_string().trim().to_owned() };
        let mut given: toml::Table = toml::from_str(text).map_err(refused)?;
        let preset = match given.remove(PRESET_KEY) {
            None => Self::default(),
            Some(toml::Value::String(name)) => Self::preset(&name)?,
            Some(other) => return Err(Reason::UnknownPreset { found: other.to_string() }.into()),
        };
        let mut merged = preset.to_table()?;
        overlay(&mut merged, given);
        let config: Self = merged.try_into().map_err(refused)?;
        config.validate()?;
        Ok(config)
    }

    /// Writes the parameter file of this configuration with every key.
    ///
    /// # Errors
    /// A seed beyond what TOML can hold (2⁶³ − 1).
    pub fn to_toml(&self) -> Result<String, SimulateError> {
        let refused = |error: toml::ser::Error| Reason::Parameters { text: error.to_string() };
        Ok(toml::to_string(&self.to_table()?).map_err(refused)?)
    }

    fn to_table(&self) -> Result<toml::Table, SimulateError> {
        toml::Table::try_from(self).map_err(|error| Reason::Parameters { text: error.to_string() }.into())
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first number outside its range.
    pub fn validate(&self) -> Result<(), SimulateError> {
        within("the size in metres (size_m)", self.size_m, 50.0, 3000.0)?;
        within("the ground sampling distance in metres (gsd_m)", self.gsd_m, 0.2, 5.0)?;
        within("the number of views", self.views as f64, 2.0, MAX_VIEWS)?;
        let side = self.size_m / self.gsd_m;
        within("the number of pixels of all views together", side * side * self.views as f64, 1.0, MAX_PIXELS)?;
        within("the longitude", self.lon_deg, -180.0, 180.0)?;
        within("the latitude", self.lat_deg, -89.0, 89.0)?;
        within("the height of the ground in metres (ground_height_m)", self.ground_height_m, -400.0, 6000.0)?;
        self.validate_scene()?;
        self.validate_acquisition()?;
        self.validate_seasons()?;
        self.validate_sensor()
    }

    fn validate_scene(&self) -> Result<(), SimulateError> {
        let (terrain, buildings) = (&self.terrain, &self.buildings);
        within("terrain.relief_m", terrain.relief_m, 0.0, 500.0)?;
        within("terrain.wavelength_m", terrain.wavelength_m, 20.0, 10_000.0)?;
        within("terrain.roughness", terrain.roughness, 0.0, 0.7)?;
        within("terrain.pit_depth_m", terrain.pit_depth_m, 0.0, 300.0)?;
        within("terrain.bench_height_m", terrain.bench_height_m, 0.0, 50.0)?;
        within("terrain.water_share", terrain.water_share, 0.0, 0.9)?;
        within("terrain.quay_height_m", terrain.quay_height_m, 0.0, 20.0)?;
        within("buildings.turn_deg", buildings.turn_deg, -360.0, 360.0)?;
        within("buildings.street_spacing_m", buildings.street_spacing_m, 40.0, 500.0)?;
        within("buildings.street_width_m", buildings.street_width_m, 0.0, 20.0)?;
        within("buildings.landmark_height_m", buildings.landmark_height_m, 0.0, 400.0)?;
        let [low, high] = buildings.high_rise_height_m;
        within("the lower of buildings.high_rise_height_m", low, 10.0, 400.0)?;
        within("the upper of buildings.high_rise_height_m", high, low, 400.0)?;
        let q = &buildings.quarters;
        let usual = [q.park, q.hall, q.rows, q.houses, q.courtyard, q.high_rise, q.sheds];
        for weight in usual.into_iter().chain([q.suburb, q.dense_towers, q.warehouse]) {
            within("a weight of buildings.quarters", weight, 0.0, 1e6)?;
        }
        within("vegetation.trees_per_ha", self.vegetation.trees_per_ha, 0.0, 600.0)?;
        let [low, high] = self.vegetation.height_m;
        within("the lower of vegetation.height_m", low, 1.0, 60.0)?;
        within("the upper of vegetation.height_m", high, low, 60.0)?;
        within("vehicles.parked_share", self.vehicles.parked_share, 0.0, 1.0)?;
        within("surface.contrast", self.surface.contrast, 0.0, 3.0)
    }

    fn validate_acquisition(&self) -> Result<(), SimulateError> {
        let a = &self.acquisition;
        within("acquisition.heading_deg", a.heading_deg, 0.0, 360.0)?;
        within("acquisition.along_track_deg", a.along_track_deg, 0.0, 45.0)?;
        within("acquisition.across_track_deg", a.across_track_deg, 0.0, 45.0)?;
        for look in &a.looks {
            within("the incidence of a look in degrees", look.incidence_deg, 0.0, 50.0)?;
            within("the azimuth of a look in degrees", look.azimuth_deg, 0.0, 360.0)?;
        }
        if !a.looks.is_empty() {
            let views = self.views as f64;
            within("the number of acquisition.looks (one per view)", a.looks.len() as f64, views, views)?;
        }
        let [low, high] = a.pointing_error_px;
        within("the lower of acquisition.pointing_error_px", low, 0.0, 100.0)?;
        within("the upper of acquisition.pointing_error_px", high, low, 100.0)?;
        within("acquisition.pointing_drift_px", a.pointing_drift_px, 0.0, 20.0)?;
        within("acquisition.dates", a.dates as f64, 1.0, self.views as f64)?;
        within("the sun's elevation in degrees", a.sun.elevation_deg, Sun::LOWEST_DEG, 90.0)?;
        within("the sun's azimuth in degrees", a.sun.azimuth_deg, 0.0, 360.0)?;
        within("the elevation of acquisition.sun_spread_deg", a.sun_spread_deg[0], 0.0, 60.0)?;
        within("the azimuth of acquisition.sun_spread_deg", a.sun_spread_deg[1], 0.0, 180.0)?;
        within("acquisition.gain_spread", a.gain_spread, 0.0, 0.8)?;
        within("acquisition.offset_spread", a.offset_spread, 0.0, 0.3)?;
        within("acquisition.gamma_spread", a.gamma_spread, 0.0, 0.6)
    }

    fn validate_seasons(&self) -> Result<(), SimulateError> {
        let s = &self.seasons;
        within("seasons.ground_spread", s.ground_spread, 0.0, 1.5)?;
        within("seasons.tree_spread", s.tree_spread, 0.0, 1.5)?;
        within("seasons.roof_spread", s.roof_spread, 0.0, 1.5)?;
        within("seasons.texture_share", s.texture_share, 0.0, 1.0)?;
        within("seasons.sharpness_spread", s.sharpness_spread, 0.0, 1.5)
    }

    fn validate_sensor(&self) -> Result<(), SimulateError> {
        let s = &self.sensor;
        within("sensor.bits", f64::from(s.bits), 8.0, 12.0)?;
        within("sensor.mtf_at_nyquist", s.mtf_at_nyquist, 0.05, 0.6)?;
        within("sensor.subpixels", s.subpixels as f64, 1.0, 8.0)?;
        within("sensor.electrons_at_white", s.electrons_at_white, 100.0, 1e9)?;
        within("sensor.read_noise_electrons", s.read_noise_electrons, 0.0, 1e6)?;
        within("sensor.white_share", s.white_share, 0.05, 5.0)?;
        within("sensor.offset_share", s.offset_share, 0.0, 0.5)?;
        if let Some(multispectral) = &self.multispectral {
            within("multispectral.ratio", multispectral.ratio as f64, 1.0, 8.0)?;
            within("multispectral.autumn_share", multispectral.autumn_share, 0.0, 1.0)?;
            within("multispectral.planted_roof_share", multispectral.planted_roof_share, 0.0, 1.0)?;
        }
        within("clouds.share", self.clouds.share, 0.0, 1.0)?;
        within("clouds.extent_m", self.clouds.extent_m, 10.0, 5000.0)
    }
}

fn within(name: &'static str, found: f64, low: f64, high: f64) -> Result<(), SimulateError> {
    match (low..=high).contains(&found) {
        true => Ok(()),
        false => Err(Reason::OutOfRange { name, found, low, high }.into()),
    }
}

/// Replaces values of `base` by the values of `over`, table by table.
fn overlay(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(over)) => overlay(inner, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset_names::PRESETS;

    #[test]
    fn every_preset_is_valid_and_survives_its_own_parameter_file() {
        for (name, _) in PRESETS {
            let config = SimulationConfig::preset(name).unwrap();
            config.validate().unwrap();
            assert_eq!(SimulationConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config, "{name}");
        }
    }

    #[test]
    fn a_file_states_only_what_differs_from_its_preset() {
        let text = "preset = \"hills\"\nsize_m = 200.0\n[acquisition]\ndates = 2\n";
        let config = SimulationConfig::from_toml(text).unwrap();
        let hills = SimulationConfig::preset("hills").unwrap();
        assert_eq!((config.size_m, config.acquisition.dates), (200.0, 2));
        assert_eq!((config.terrain, config.acquisition.sun), (hills.terrain, hills.acquisition.sun));
    }

    #[test]
    fn what_is_not_used_is_not_written() {
        let text = SimulationConfig::default().to_toml().unwrap();
        for key in ["seasons", "crowns", "suburb", "dense_towers", "warehouse"] {
            assert!(!text.contains(key), "{key}");
        }
        let config = SimulationConfig::from_toml("[seasons]\ntexture_share = 0.25\n").unwrap();
        assert_eq!((config.seasons.texture_share, config.seasons.ground_spread), (0.25, 0.0));
        assert_eq!(SimulationConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config);
    }

    #[test]
    fn what_a_file_gets_wrong_is_named() {
        for (text, named) in [
            ("sise_m = 200.0", "sise_m"),
            ("[terrain]\nrelief = 3.0", "relief"),
            ("preset = \"tonw\"", "high-rise"),
            ("preset = 3", "3"),
            ("size_m = \"big\"", "big"),
            ("size_m = 1e9", "size"),
            ("size_m = 3000.0\ngsd_m = 0.2", "pixels"),
            ("views = 2\n[[acquisition.looks]]\nincidence_deg = 3.0\nazimuth_deg = 4.0", "looks"),
            ("size_m = ", "line 1"),
            ("[sensor]\nbits = 16", "bits"),
            ("[seasons]\ntexture_share = 1.5", "texture_share"),
            ("[seasons]\nsnow = 1", "snow"),
            ("[vegetation]\ncrowns = \"square\"", "natural"),
        ] {
            let error = SimulationConfig::from_toml(text).unwrap_err().to_string();
            assert!(error.contains(named), "{text}: {error}");
        }
    }
}
