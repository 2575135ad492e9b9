//! A linear pushbroom camera, written as an RPC without any fit. Tests compare the physical camera
//! with it.
//!
//! A sensor that moves on a straight line at constant speed and attitude has `line = m₁·X`, `sample
//! = m₂·X / m₃·X` for homogeneous points X (Gupta and Hartley 1997, "Linear pushbroom cameras"): a
//! ratio of polynomials of degree one, which the RPC's terms 1, L, P, H hold exactly. X is (east,
//! north, up) in metres from the scene's centre, each proportional to the RPC's normalised
//! longitude, latitude and height. The curvature of the Earth is left out (1 cm over 350 m): the
//! physical camera has it.

use camera::{ImagePoint, Rpc};
use geodesy::{LonLatHeight, meridian_radius_m, prime_vertical_radius_m};
use nalgebra::Vector3;

use crate::views::camera_model::Look;

/// Height of the orbit, metres.
const ORBIT_M: f64 = 617_000.0;
/// Scales of the RPC: the half sizes of what it is used for, with some room.
const HEIGHT_SCALE_M: f64 = 500.0;

impl Look {
    /// The RPC of a linear pushbroom image of `width × height` pixels with the scene's `centre` in
    /// its middle.
    pub(crate) fn rpc(&self, centre: LonLatHeight, width: usize, height: usize) -> Rpc {
        let (width, height) = (width as f64, height as f64);
        let middle = ImagePoint::new((width - 1.0) / 2.0, (height - 1.0) / 2.0);
        let metres_per_degree = [
            (prime_vertical_radius_m(centre.lat_deg) + centre.height_m) * centre.lat_deg.to_radians().cos(),
            meridian_radius_m(centre.lat_deg) + centre.height_m,
        ]
        .map(|radius| radius.to_radians());
        let half_m = 0.6 * self.gsd_m * width.hypot(height) / self.incidence_deg.to_radians().cos();
        let unit_m = Vector3::new(half_m, half_m, HEIGHT_SCALE_M);
        let (line, sample) = self.planes();
        let linear = |constant: f64, gradient: Vector3<f64>, scale: f64| {
            let g = gradient.component_mul(&unit_m) / scale;
            let mut c = [0.0; 20];
            c[..4].copy_from_slice(&[constant / scale, g.x, g.y, g.z]);
            c
        };
        let (line_scale, samp_scale) = (height / 2.0, width / 2.0);
        Rpc {
            line_off: middle.line,
            samp_off: middle.sample,
            lat_off: centre.lat_deg,
            long_off: centre.lon_deg,
            height_off: centre.height_m,
            line_scale,
            samp_scale,
            lat_scale: half_m / metres_per_degree[1],
            long_scale: half_m / metres_per_degree[0],
            height_scale: HEIGHT_SCALE_M,
            line_num: linear(0.0, line, line_scale),
            line_den: linear(1.0, Vector3::zeros(), 1.0),
            samp_num: linear(0.0, sample.numerator, samp_scale),
            samp_den: linear(1.0, sample.denominator, 1.0),
            err_bias_m: None,
            err_rand_m: None,
        }
    }

    /// Gradients of the line and of the sample's numerator and denominator (1 at the centre), per
    /// metre.
    fn planes(&self) -> (Vector3<f64>, SamplePlanes) {
        let to_sensor = self.towards_sensor();
        let (east, north) = self.heading_deg.to_radians().sin_cos();
        let track = Vector3::new(east, north, 0.0);
        // Sample numbers grow to the left of the flight, so that an image flown southwards has
        // north up and east right.
        let left = Vector3::new(-north, east, 0.0);
        let scan_normal = left.cross(&to_sensor).normalize();
        let scan_normal = scan_normal * scan_normal.dot(&track).signum();
        let across = to_sensor.cross(&scan_normal);
        let across = across * across.dot(&left).signum();
        let range = ORBIT_M / to_sensor.z;
        // Ground distance flown until a point enters the scan plane.
        let flown = scan_normal / scan_normal.dot(&track);
        let numerator = (across - flown * across.dot(&track)) / self.gsd_m;
        let denominator = (flown * to_sensor.dot(&track) - to_sensor) / range;
        (scan_normal / self.gsd_m, SamplePlanes { numerator, denominator })
    }
}

struct SamplePlanes {
    numerator: Vector3<f64>,
    denominator: Vector3<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{CENTRE, look};

    #[test]
    fn the_line_of_sight_has_the_asked_incidence_and_azimuth() {
        for (incidence, azimuth) in [(17.0, 10.0), (6.0, 100.0), (25.0, 280.0)] {
            let rpc = look(incidence, azimuth).rpc(CENTRE, 700, 680);
            let middle = ImagePoint::new(349.5, 339.5);
            let low = rpc.localize(middle, 200.0).unwrap();
            let high = rpc.localize(middle, 300.0).unwrap();
            assert!((low.lon_deg - CENTRE.lon_deg).abs() < 1e-12 && (low.lat_deg - CENTRE.lat_deg).abs() < 1e-12);
            let east = (high.lon_deg - low.lon_deg) * 111_320.0 * CENTRE.lat_deg.to_radians().cos();
            let north = (high.lat_deg - low.lat_deg) * 111_090.0;
            assert!((east.hypot(north) / 100.0 - incidence.to_radians().tan()).abs() < 2e-3);
            assert!((east.atan2(north).to_degrees().rem_euclid(360.0) - azimuth).abs() < 0.5);
        }
    }

    #[test]
    fn pixels_are_square_across_the_line_of_sight_and_north_is_up() {
        let rpc = look(0.0, 0.0).rpc(CENTRE, 700, 700);
        let at = |lon: f64, lat: f64| {
            rpc.project(LonLatHeight::new(CENTRE.lon_deg + lon, CENTRE.lat_deg + lat, 200.0)).unwrap()
        };
        let (centre, north, east) = (at(0.0, 0.0), at(0.0, 1e-4), at(1e-4, 0.0));
        assert!(north.line < centre.line - 10.0 && east.sample > centre.sample + 10.0);
        let metres = |p: ImagePoint| 0.5 * (p.sample - centre.sample).hypot(p.line - centre.line);
        assert!((metres(north) - 11.11).abs() < 0.02, "{}", metres(north));
        assert!((metres(east) - 8.08).abs() < 0.02, "{}", metres(east));
    }
}
