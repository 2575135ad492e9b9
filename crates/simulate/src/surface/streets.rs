//! The street grid: two families of parallel streets.

use crate::config::BuildingsConfig;

/// Two families of parallel streets with a common spacing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Streets {
    sin: f64,
    cos: f64,
    pub(crate) turn_deg: f64,
    /// Distance between centre lines.
    pub(crate) spacing_m: f64,
    /// Half the width of the carriageway, 0 without streets.
    pub(crate) half_width_m: f64,
}

/// A position relative to the nearest street.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OnStreet {
    /// Signed distance from the centre line.
    pub(crate) across_m: f64,
    /// Position along the street.
    pub(crate) along_m: f64,
    /// The same for the nearest street of the other family.
    pub(crate) to_crossing_m: f64,
}

impl Streets {
    pub(crate) fn new(config: &BuildingsConfig) -> Self {
        let (sin, cos) = config.turn_deg.to_radians().sin_cos();
        let (turn_deg, spacing_m) = (config.turn_deg, config.street_spacing_m);
        Self { sin, cos, turn_deg, spacing_m, half_width_m: 0.5 * config.street_width_m }
    }

    /// Returns street coordinates (along the first family, along the second) of a position, metres.
    pub(crate) fn street_from_scene(&self, x: f64, y: f64) -> [f64; 2] {
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x]
    }

    pub(crate) fn scene_from_street(&self, u: f64, v: f64) -> [f64; 2] {
        [self.cos * u - self.sin * v, self.sin * u + self.cos * v]
    }

    /// Returns the nearest street.
    pub(crate) fn nearest(&self, x: f64, y: f64) -> OnStreet {
        let [u, v] = self.street_from_scene(x, y);
        let across = |c: f64| c - self.spacing_m * (c / self.spacing_m).round();
        let (across_u, across_v) = (across(u), across(v));
        match across_u.abs() < across_v.abs() {
            true => OnStreet { across_m: across_u, along_m: v, to_crossing_m: across_v.abs() },
            false => OnStreet { across_m: across_v, along_m: u, to_crossing_m: across_u.abs() },
        }
    }

    /// Returns whether a position lies on a carriageway.
    pub(crate) fn is_carriageway(&self, x: f64, y: f64) -> bool {
        self.nearest(x, y).across_m.abs() < self.half_width_m
    }
}
