//! Cameras of the unit tests.

use geodesy::LonLatHeight;

use crate::camera_model::Look;

/// Centre of the scenes.
pub(crate) const CENTRE: LonLatHeight = LonLatHeight::new(5.4, 43.5, 200.0);

/// Returns a look with pixels of half a metre from a flight almost southwards.
pub(crate) fn look(incidence_deg: f64, azimuth_deg: f64) -> Look {
    Look { incidence_deg, azimuth_deg, heading_deg: 190.0, gsd_m: 0.5 }
}
