//! How each view is taken: its line of sight, size, date and the pointing error of its RPC.

use camera::{ImageCorrection, ImagePoint};
use nalgebra::Vector3;

use crate::config::{LookAngles, SimulationConfig};
use crate::error::SimulateError;
use crate::random::derived;
use crate::surface::frame::SceneFrame;
use crate::views::camera_model::{Look, PhysicalCamera};
use crate::views::date::Date;
use numeric::SplitMix64;

/// Margin around the area of the truth, pixels. It holds leaning buildings and the pointing error.
const MARGIN_PX: f64 = 12.0;

/// Returns the date of a view. Views are distributed over the dates in order.
pub(crate) fn date(config: &SimulationConfig, index: usize) -> Date {
    Date::new(config, index * config.acquisition.dates / config.views)
}

/// Returns the line of sight of a view.
///
/// It is the configured one, or one of a pass from the forward to the backward view that alternates
/// between both sides.
pub(crate) fn look(config: &SimulationConfig, index: usize) -> Look {
    let a = &config.acquisition;
    let direction = a.looks.get(index).copied().unwrap_or_else(|| on_pass(config, index));
    Look {
        incidence_deg: direction.incidence_deg,
        azimuth_deg: direction.azimuth_deg,
        heading_deg: a.heading_deg,
        gsd_m: config.gsd_m,
    }
}

fn on_pass(config: &SimulationConfig, index: usize) -> LookAngles {
    let a = &config.acquisition;
    let along = a.along_track_deg.to_radians().tan() * (1.0 - 2.0 * index as f64 / (config.views - 1) as f64);
    let across = a.across_track_deg.to_radians().tan() * (std::f64::consts::FRAC_PI_2 * index as f64).sin();
    let incidence_deg = along.hypot(across).atan().to_degrees();
    // The first view is taken before the sensor has passed, so the sensor looks ahead and stands
    // behind the scene.
    let azimuth_deg = (a.heading_deg + 180.0 + across.atan2(along).to_degrees()).rem_euclid(360.0);
    LookAngles { incidence_deg, azimuth_deg }
}

/// Returns the camera and the size of an image that holds the whole area at both heights (low,
/// high).
pub(crate) fn camera(
    config: &SimulationConfig,
    frame: &SceneFrame,
    look: &Look,
    (low_m, high_m): (f64, f64),
) -> Result<(PhysicalCamera, (usize, usize)), SimulateError> {
    let (half, model) = (config.size_m / 2.0, config.acquisition.camera);
    let centre = frame.ground_from_scene(Vector3::new(0.0, 0.0, config.ground_height_m))?;
    // The scale does not depend on the size of the image, so any camera that holds the area can
    // measure the corners.
    let roughly = (1.5 * config.size_m / config.gsd_m) as usize;
    let measuring =
        PhysicalCamera::new(model, look, centre, (roughly, roughly)).fitted((low_m - 1.0, high_m + 1.0))?.rpc;
    let middle = (roughly as f64 - 1.0) / 2.0;
    let mut reach = ImagePoint::default();
    for (x, y) in [(-half, -half), (half, -half), (-half, half), (half, half)] {
        for z in [low_m, high_m] {
            let corner = measuring.project(frame.ground_from_scene(Vector3::new(x, y, z))?)?;
            let (sample, line) = ((corner.sample - middle).abs(), (corner.line - middle).abs());
            reach = ImagePoint::new(reach.sample.max(sample), reach.line.max(line));
        }
    }
    let pixels = |reach: f64| 2 * (reach + MARGIN_PX).ceil() as usize;
    let size = (pixels(reach.sample), pixels(reach.line));
    Ok((PhysicalCamera::new(model, look, centre, size), size))
}

/// Returns the pointing error of the delivered RPC: a translation at the middle of the image and a
/// drift along its lines.
pub(crate) fn pointing(config: &SimulationConfig, index: usize, (width, height): (usize, usize)) -> ImageCorrection {
    let a = &config.acquisition;
    let mut stream = SplitMix64::new(derived(config.campaign_seed(), 1000 + index as u64));
    let [shortest, longest] = a.pointing_error_px;
    let length = stream.uniform_in(shortest, longest);
    let mut vector = |length: f64| {
        let direction = stream.uniform_in(0.0, std::f64::consts::TAU);
        [length * direction.cos(), length * direction.sin()]
    };
    let translation_px = vector(length);
    let [by_sample, by_line] = vector(a.pointing_drift_px / (height as f64 - 1.0));
    ImageCorrection {
        translation_px,
        linear: [[0.0, by_sample], [0.0, by_line]],
        centre: ImagePoint::new((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0),
    }
}
