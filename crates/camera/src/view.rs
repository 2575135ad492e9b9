//! The view of a ground point: direction, incidence, azimuth, intersection angle and GSD.
//!
//! The direction is the tangent of the curve of ground points with the same image position. The
//! steps dλ and dφ for a step dh follow from the Jacobian. They become metres east and north with
//! the radii of curvature: dE = (N + h) cos φ dλ, dN = (M + h) dφ. The direction is exact for the
//! RPC. It differs from the direction to the satellite by the residual of the RPC's fit.
//!
//! Vectors are unit vectors (east, north, up) at the ground point, from the ground towards the
//! sensor. Angles are degrees. Directions are undefined at the poles, where there is no east, and
//! where the Jacobian is singular.

use geodesy::{LonLatHeight, meridian_radius_m, prime_vertical_radius_m};

use crate::{CameraError, ImageFromGroundJacobian, ImagePoint, RpcCamera};

/// A unit vector from a ground point towards the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewDirection {
    /// East component.
    pub east: f64,
    /// North component.
    pub north: f64,
    /// Upward component, positive.
    pub up: f64,
}

/// Ground sampling distances on the horizontal plane through a ground point, metres per pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundSamplingDistance {
    /// Distance on the ground between neighbouring columns.
    pub sample_m: f64,
    /// Distance on the ground between neighbouring rows.
    pub line_m: f64,
}

impl ViewDirection {
    /// Returns the angle between the direction and the vertical at the ground point.
    pub fn incidence_deg(&self) -> f64 {
        self.east.hypot(self.north).atan2(self.up).to_degrees()
    }

    /// Returns the azimuth of the sensor as seen from the ground: clockwise from north, in [0,
    /// 360), 0 for a sensor overhead.
    pub fn azimuth_deg(&self) -> f64 {
        let a = self.east.atan2(self.north).to_degrees();
        // A tiny negative angle would round up to 360 itself.
        if a < 0.0 { (a + 360.0) % 360.0 } else { a }
    }

    /// Returns the angle between two views of the same ground point, in [0, 180].
    pub fn intersection_angle_deg(&self, other: &Self) -> f64 {
        let (a, b) = ([self.east, self.north, self.up], [other.east, other.north, other.up]);
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        // The arc tangent is accurate for the small angles of narrow baselines, unlike the arc
        // cosine.
        cross.iter().map(|c| c * c).sum::<f64>().sqrt().atan2(dot).to_degrees()
    }
}

impl GroundSamplingDistance {
    /// Returns the geometric mean of both distances, metres.
    pub fn mean_m(&self) -> f64 {
        (self.sample_m * self.line_m).sqrt()
    }
}

impl RpcCamera {
    /// Returns the direction from a ground point towards the sensor.
    ///
    /// # Errors
    /// The same as for [`crate::Rpc::project`], and [`CameraError::Singular`] where the direction
    /// is not defined.
    pub fn view_direction(&self, ground: LonLatHeight) -> Result<ViewDirection, CameraError> {
        let local = self.metric_jacobian(ground)?;
        let [east, north] = local.solve([-local.up[0], -local.up[1]]).ok_or(CameraError::Singular)?;
        let size = (east * east + north * north + 1.0).sqrt();
        Ok(ViewDirection { east: east / size, north: north / size, up: 1.0 / size })
    }

    /// Returns the ground sampling distances at a ground point, on its horizontal plane.
    ///
    /// # Errors
    /// The same as for [`RpcCamera::view_direction`].
    pub fn gsd(&self, ground: LonLatHeight) -> Result<GroundSamplingDistance, CameraError> {
        let local = self.metric_jacobian(ground)?;
        let step = |pixels| local.solve(pixels).map(|[e, n]| e.hypot(n)).ok_or(CameraError::Singular);
        Ok(GroundSamplingDistance { sample_m: step([1.0, 0.0])?, line_m: step([0.0, 1.0])? })
    }

    /// Returns the ground sampling distances at an image position, at a height in metres.
    ///
    /// # Errors
    /// The same as for [`RpcCamera::localize`] and [`RpcCamera::view_direction`].
    pub fn gsd_at(&self, image: ImagePoint, height_m: f64) -> Result<GroundSamplingDistance, CameraError> {
        self.gsd(self.localize(image, height_m)?)
    }

    fn metric_jacobian(&self, ground: LonLatHeight) -> Result<MetricJacobian, CameraError> {
        let ImageFromGroundJacobian { sample, line } = self.jacobian(ground)?;
        let lat = ground.lat_deg;
        let metres_per_radian = [
            (prime_vertical_radius_m(lat) + ground.height_m) * lat.to_radians().cos(),
            meridian_radius_m(lat) + ground.height_m,
        ];
        let per_metre = |j: [f64; 3], i: usize| (j[i] / metres_per_radian[i]).to_degrees();
        Ok(MetricJacobian {
            east: [per_metre(sample, 0), per_metre(line, 0)],
            north: [per_metre(sample, 1), per_metre(line, 1)],
            up: [sample[2], line[2]],
        })
    }
}

/// Pixels (sample, line) per metre east, north, up.
struct MetricJacobian {
    east: [f64; 2],
    north: [f64; 2],
    up: [f64; 2],
}

impl MetricJacobian {
    /// Returns the metres east and north that move the image by `pixels`. `None` if the Jacobian
    /// cannot be inverted.
    fn solve(&self, pixels: [f64; 2]) -> Option<[f64; 2]> {
        let (e, n) = (self.east, self.north);
        let det = e[0] * n[1] - n[0] * e[1];
        let regular = det.abs() > 1e-12 * e[0].hypot(e[1]) * n[0].hypot(n[1]);
        (regular && det.is_finite())
            .then(|| [(n[1] * pixels[0] - n[0] * pixels[1]) / det, (e[0] * pixels[1] - e[1] * pixels[0]) / det])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(incidence_deg: f64, azimuth_deg: f64) -> ViewDirection {
        let ((s, c), (sa, ca)) = (incidence_deg.to_radians().sin_cos(), azimuth_deg.to_radians().sin_cos());
        ViewDirection { east: s * sa, north: s * ca, up: c }
    }

    #[test]
    fn angles_of_a_direction_come_back() {
        for (incidence, azimuth) in [(12.5, 200.0), (0.001, 359.9), (45.0, 0.0), (80.0, 91.0)] {
            let d = direction(incidence, azimuth);
            assert!((d.incidence_deg() - incidence).abs() < 1e-10);
            assert!((d.azimuth_deg() - azimuth).abs() < 1e-7);
        }
        assert_eq!(direction(0.0, 0.0).azimuth_deg(), 0.0);
    }

    #[test]
    fn the_intersection_angle_of_opposite_looks_is_the_sum_of_their_incidences() {
        let angle = direction(7.0, 30.0).intersection_angle_deg(&direction(5.5, 210.0));
        assert!((angle - 12.5).abs() < 1e-10);
        assert_eq!(direction(7.0, 30.0).intersection_angle_deg(&direction(7.0, 30.0)), 0.0);
    }
}
