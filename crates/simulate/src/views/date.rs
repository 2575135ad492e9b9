//! A date of acquisition with its light and radiometry.
//!
//! The first date of the first campaign is as configured. The others differ from it within the
//! configured spreads.

use serde::{Deserialize, Serialize};

use crate::config::SimulationConfig;
use crate::random::derived;
use crate::views::seasons::Season;
use crate::views::sun::Sun;
use numeric::SplitMix64;

/// Properties that all views of a date share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Date {
    /// Index of the date, from 0.
    pub index: usize,
    /// Direction of the sunlight.
    pub sun: Sun,
    /// Factor on the gain of the sensor.
    pub gain: f64,
    /// Offset added to the sensor's, as a share of its range.
    pub offset: f64,
    /// Exponent applied to the radiance.
    pub gamma: f64,
    /// Season, where the scene has seasons and this is not the first date.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub season: Option<Season>,
}

impl Date {
    /// Makes the date of an index.
    pub(crate) fn new(config: &SimulationConfig, index: usize) -> Self {
        let a = &config.acquisition;
        if index == 0 && a.campaign == 0 {
            return Self { index, sun: a.sun, gain: 1.0, offset: 0.0, gamma: 1.0, season: None };
        }
        let mut stream = SplitMix64::new(derived(config.campaign_seed(), 3000 + index as u64));
        let mut differing = |spread: f64| stream.uniform_in(-spread, spread);
        let [elevation, azimuth] = a.sun_spread_deg;
        let elevation_deg = (a.sun.elevation_deg + differing(elevation)).clamp(Sun::LOWEST_DEG, 90.0);
        let azimuth_deg = (a.sun.azimuth_deg + differing(azimuth)).rem_euclid(360.0);
        let sun = Sun { elevation_deg, azimuth_deg };
        let gain = 1.0 + differing(a.gain_spread);
        let offset = differing(a.offset_spread).abs();
        let season = Season::of_date(&config.seasons, config.seed, index, config.sensor.mtf_at_nyquist);
        Self { index, sun, gain, offset, gamma: 1.0 + differing(a.gamma_spread), season }
    }
}
