//! How the views see the scene: directions, intersection angles, overlaps, parallax.

use camera::{CameraError, ImagePoint, RpcCamera};
use geo::{Area, BooleanOps, ConvexHull, MultiPoint, Point, Polygon};
use geodesy::{EnuFrame, LonLatHeight};
use sweep::source_from_reference;

/// What two views have to do with each other.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PairGeometry {
    /// Angle between the two lines of sight at the scene's centre, degrees.
    pub angle_deg: f64,
    /// Ground both see, as a share of the smaller footprint.
    pub overlap: f64,
    /// Pixels that the second view moves against the first per metre of height.
    pub parallax_px_per_m: f64,
}

/// An image's footprint at one height: longitude and latitude of its outline, degrees.
///
/// # Errors
/// Those of localisation.
pub(crate) fn footprint(
    camera: &RpcCamera,
    (width, height): (usize, usize),
    height_m: f64,
) -> Result<Vec<LonLatHeight>, CameraError> {
    let (w, h) = (width as f64 - 1.0, height as f64 - 1.0);
    // Corners and the middles of the sides: outlines of pushbroom images are slightly bent.
    let outline = [[0.0, 0.0], [0.5 * w, 0.0], [w, 0.0], [w, 0.5 * h], [w, h], [0.5 * w, h], [0.0, h], [0.0, 0.5 * h]];
    outline.iter().map(|[x, y]| camera.localize(ImagePoint::new(*x, *y), height_m)).collect()
}

/// A footprint as a polygon in metres of a local frame.
pub(crate) fn local_polygon(footprint: &[LonLatHeight], frame: &EnuFrame) -> Polygon<f64> {
    let points: MultiPoint<f64> = footprint
        .iter()
        .map(|p| {
            let q = frame.enu_from_ground(*p);
            Point::new(q.east, q.north)
        })
        .collect();
    points.convex_hull()
}

/// Common ground of two outlines as a share of the smaller one.
pub(crate) fn overlap_share(a: &Polygon<f64>, b: &Polygon<f64>) -> f64 {
    let smaller = a.unsigned_area().min(b.unsigned_area());
    if smaller > 0.0 { a.intersection(b).unsigned_area() / smaller } else { 0.0 }
}

/// The ground that at least two of the outlines share, as one hull.
pub(crate) fn shared_ground(outlines: &[Polygon<f64>]) -> Option<Polygon<f64>> {
    let mut points: Vec<Point<f64>> = Vec::new();
    for (i, a) in outlines.iter().enumerate() {
        for b in &outlines[..i] {
            let both = a.intersection(b);
            points.extend(both.iter().flat_map(|p| p.exterior().points().collect::<Vec<_>>()));
        }
    }
    let hull = MultiPoint::from(points).convex_hull();
    (hull.unsigned_area() > 0.0).then_some(hull)
}

/// Geometry of a pair of views at a ground point.
///
/// # Errors
/// Those of the cameras at that point.
pub(crate) fn pair_geometry(
    a: &RpcCamera,
    b: &RpcCamera,
    centre: LonLatHeight,
    overlap: f64,
) -> Result<PairGeometry, CameraError> {
    let (p, q) = (a.project(centre)?, b.project(centre)?);
    let angle_deg = a.view_direction(centre)?.intersection_angle_deg(&b.view_direction(centre)?);
    let (lo, hi) = (centre.height_m - 5.0, centre.height_m + 5.0);
    let move_px = |r: &RpcCamera, s: &RpcCamera, at: ImagePoint| {
        let place = |h| source_from_reference(r, s, 0, at, h);
        let (from, to) = (place(lo)?, place(hi)?);
        Ok::<f64, CameraError>((to.sample - from.sample).hypot(to.line - from.line) / (hi - lo))
    };
    let parallax_px_per_m = move_px(a, b, p)?.max(move_px(b, a, q)?);
    Ok(PairGeometry { angle_deg, overlap, parallax_px_per_m })
}
