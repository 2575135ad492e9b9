//! Footprints of images on the ground and the areas that they share.

use camera::{CameraError, ImagePoint, RpcCamera};
use geo::{Area, BooleanOps, BoundingRect, ConvexHull, Intersects, MultiPoint, Point, Polygon};
use geodesy::{EnuFrame, LonLatHeight};

/// Returns the ground points on the outline of an image of `width` × `height` pixels at one height.
///
/// # Errors
/// A failure of the camera to localise an outline point.
pub fn footprint(
    camera: &RpcCamera,
    (width, height): (usize, usize),
    height_m: f64,
) -> Result<Vec<LonLatHeight>, CameraError> {
    let (w, h) = (width as f64 - 1.0, height as f64 - 1.0);
    // Corners and middles of the sides, because outlines of pushbroom images are slightly bent.
    let outline = [[0.0, 0.0], [0.5 * w, 0.0], [w, 0.0], [w, 0.5 * h], [w, h], [0.5 * w, h], [0.0, h], [0.0, 0.5 * h]];
    outline.iter().map(|[x, y]| camera.localize(ImagePoint::new(*x, *y), height_m)).collect()
}

/// Returns the convex hull of a footprint, in metres of a local frame.
pub fn local_polygon(footprint: &[LonLatHeight], frame: &EnuFrame) -> Polygon<f64> {
    let points: MultiPoint<f64> = footprint
        .iter()
        .map(|p| {
            let q = frame.enu_from_ground(*p);
            Point::new(q.east, q.north)
        })
        .collect();
    points.convex_hull()
}

/// Returns the ground that two convex outlines share; `None` where they do not meet.
pub fn shared_part(a: &Polygon<f64>, b: &Polygon<f64>) -> Option<Polygon<f64>> {
    let meets = a.bounding_rect()?.intersects(&b.bounding_rect()?);
    let parts = if meets { a.intersection(b).0 } else { Vec::new() };
    parts.into_iter().max_by(|p, q| p.unsigned_area().total_cmp(&q.unsigned_area())).filter(|p| p.unsigned_area() > 0.0)
}

/// Returns the common area of two outlines as a share of the smaller one.
pub fn overlap_share(a: &Polygon<f64>, b: &Polygon<f64>) -> f64 {
    let smaller = a.unsigned_area().min(b.unsigned_area());
    if smaller > 0.0 { a.intersection(b).unsigned_area() / smaller } else { 0.0 }
}

/// Returns the convex hull of the ground that at least two of the outlines share; `None` where no
/// two meet.
pub fn shared_ground(outlines: &[Polygon<f64>]) -> Option<Polygon<f64>> {
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
