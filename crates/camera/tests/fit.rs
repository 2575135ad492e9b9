//! Fitting RPCs to a physical pushbroom camera and to corrected RPCs.

mod common;

use camera::{
    CameraError, Correspondence, FitError, ImageCorrection, ImagePoint, Rpc, RpcCamera, RpcFit, ValidityDomain,
};
use common::{crop_far_from_offset, pushbroom};
use geodesy::{EnuFrame, LonLatHeight};

/// A pushbroom on a curved track 620 km up whose yaw drifts: no rational function describes it
/// exactly.
struct Orbit {
    frame: EnuFrame,
}

/// Track speed, metres per line.
const METRES_PER_LINE: f64 = 0.5;
const ALTITUDE_M: f64 = 620_000.0;
const FOCAL_PX: f64 = ALTITUDE_M / 0.5;

impl Orbit {
    fn image(&self, ground: LonLatHeight) -> ImagePoint {
        let g = self.frame.enu_from_ground(ground);
        let mut line = 0.0;
        let mut sample = 0.0;
        // The line whose viewing plane holds the point; the drift is slow, so that the iteration
        // contracts quickly.
        for _ in 0..60 {
            let along = METRES_PER_LINE * line;
            // The track bends down with the Earth; the sensor stands 160 km to the west of the
            // scene.
            let up = ALTITUDE_M - along * along / (2.0 * 7.0e6);
            let [e, n, u] = [g.east + 160_000.0, g.north - along, g.up - up];
            let yaw = 2e-9 * line * line / 1e4 + 1e-8 * line;
            let (s, c) = yaw.sin_cos();
            let (across, forward) = (c * e + s * n, c * n - s * e);
            line += forward / METRES_PER_LINE;
            sample = FOCAL_PX * (across / -u - 160_000.0 / ALTITUDE_M);
        }
        ImagePoint::new(sample, line)
    }
}

fn domain(lon_deg: f64, lat_deg: f64) -> ValidityDomain {
    // 5 km × 5 km × 500 m.
    ValidityDomain {
        centre: LonLatHeight::new(lon_deg, lat_deg, 200.0),
        half_lon_deg: 2500.0 / (111_320.0 * lat_deg.to_radians().cos()),
        half_lat_deg: 2500.0 / 111_320.0,
        half_height_m: 250.0,
    }
}

/// Largest distance between a model and a camera on a lattice that shares no point with the fit's
/// own.
fn largest_difference(rpc: &Rpc, domain: &ValidityDomain, camera: impl Fn(LonLatHeight) -> ImagePoint) -> f64 {
    let at = |i: usize| (i as f64 + 0.5) / 5.0 - 1.0;
    (0..1000)
        .map(|m| domain.at([at(m % 10), at(m / 10 % 10), at(m / 100)]))
        .map(|g| (rpc.project(g).unwrap(), camera(g)))
        .map(|(a, b)| (a.sample - b.sample).hypot(a.line - b.line))
        .fold(0.0, f64::max)
}

#[test]
fn a_pushbroom_camera_is_fitted_to_a_thousandth_of_a_pixel() {
    for (lon, lat) in [(2.3, 48.8), (-179.99, 64.0), (30.0, 85.0)] {
        let domain = domain(lon, lat);
        let orbit = Orbit { frame: EnuFrame::new(domain.centre) };
        let fit = RpcFit::to_camera(&domain, |g| Ok(orbit.image(g))).unwrap();
        assert_eq!(fit.rpc.validate(), Ok(()));
        assert!(fit.rms_px <= fit.max_px && fit.max_px < 1e-3, "{} {}", fit.rms_px, fit.max_px);
        let elsewhere = largest_difference(&fit.rpc, &domain, |g| orbit.image(g));
        assert!(elsewhere < 1e-3, "{elsewhere}");
        // The fitted model localises like any other.
        let g = domain.at([0.7, -0.3, 0.9]);
        let back = fit.rpc.localize(fit.rpc.project(g).unwrap(), g.height_m).unwrap();
        assert!((back.lon_deg - g.lon_deg).abs().max((back.lat_deg - g.lat_deg).abs()) < 1e-11);
    }
}

fn corrected(rpc: Rpc, linear: [[f64; 2]; 2]) -> RpcCamera {
    let centre = ImagePoint::new(18_000.0, 21_000.0);
    RpcCamera { rpc, correction: ImageCorrection { translation_px: [2.5, -1.25], linear, centre } }
}

#[test]
fn a_correction_folds_into_the_rpc() {
    let mut shared = pushbroom();
    shared.line_den = shared.samp_den;
    let cases = [
        (corrected(crop_far_from_offset(), [[0.0; 2]; 2]), 0.0),
        (corrected(pushbroom(), [[1e-4, 0.0], [0.0, -2e-4]]), 0.0),
        (corrected(shared, [[1e-4, 3e-4], [-4e-4, -2e-4]]), 0.0),
        (corrected(pushbroom(), [[1e-4, 3e-4], [-4e-4, -2e-4]]), 1e-3),
    ];
    for (camera, bound) in cases {
        let folded = camera.folded().unwrap();
        assert!(folded.max_px <= bound, "{}", folded.max_px);
        let domain = camera.rpc.domain();
        let difference = largest_difference(&folded.rpc, &domain, |g| camera.project(g).unwrap());
        assert!(difference <= bound.max(1e-8), "{difference}");
    }
}

#[test]
fn correspondences_that_determine_nothing_are_refused() {
    let rpc = pushbroom();
    let point = |i: usize| {
        let f = |step: f64| 2.0 * (i as f64 * step).fract() - 1.0;
        let ground = rpc.domain().at([f(0.618_034), f(0.754_878), f(0.569_840)]);
        Correspondence { ground, image: rpc.project(ground).unwrap() }
    };
    let points: Vec<_> = (0..200).map(point).collect();
    assert!(RpcFit::to_correspondences(&points).unwrap().max_px < 1e-3);
    assert_eq!(RpcFit::to_correspondences(&points[..38]), Err(FitError::TooFew { found: 38 }));
    let mut bad = points.clone();
    bad[5].image.line = f64::NAN;
    assert_eq!(RpcFit::to_correspondences(&bad), Err(FitError::NotFinite { index: 5 }));
    let flat: Vec<_> =
        points.iter().map(|c| Correspondence { image: ImagePoint::new(1.0, c.image.line), ..*c }).collect();
    assert_eq!(RpcFit::to_correspondences(&flat), Err(FitError::Degenerate { coordinate: "sample" }));
    let fails = RpcFit::to_camera(&rpc.domain(), |_| Err(CameraError::Singular));
    assert_eq!(fails, Err(FitError::Camera(CameraError::Singular)));
}
