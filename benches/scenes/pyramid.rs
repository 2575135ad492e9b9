//! The pyramid of Khufu as truth: the slope of three faces, and the height of their common apex
//! over the base.
//!
//! Faces look to the cardinal directions. Cells between 25 and 95 m from the axis on a face's side,
//! not near its edges, are fitted with a plane (robustly); the three planes meet in the apex. The
//! base is the pavement just outside the east and west sides (118 to 125 m from the axis; the
//! base's half width is 115.15 m): the boat museum stands south.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use numeric::{NMAD_FACTOR, upper_median};

/// Longitude and latitude of the apex, degrees.
const APEX: (f64, f64) = (31.134_2, 29.979_2);
/// `z = p₀ + p₁ east + p₂ north`, metres from the apex's map position.
type Plane = Vector3<f64>;

/// Measures the slopes of three faces and the height of the pyramid in a DSM.
pub(crate) fn measure(dsm: &Path) -> anyhow::Result<Vec<(String, f64)>> {
    let dem = formats::raster::read_dem(dsm)?;
    let epsg = dem.horizontal_epsg.unwrap_or(32636);
    let apex = crs::MapProjection::from_epsg(epsg)?.map_from_lonlat(APEX.0, APEX.1)?;
    let mut points = Vec::new();
    for row in 0..dem.heights.height() {
        for column in 0..dem.heights.width() {
            let z = f64::from(dem.heights[(column, row)]);
            let (x, y) = dem.geotransform.map_from_cell(column as f64, row as f64);
            if z.is_finite() {
                points.push([x - apex.x, y - apex.y, z]);
            }
        }
    }
    let face = |east: f64, north: f64| fit_face(&points, east, north);
    let (east, south, west) = (face(1.0, 0.0), face(0.0, -1.0), face(-1.0, 0.0));
    let slope = |p: &Plane| p[1].hypot(p[2]).atan().to_degrees();
    // Three planes z − p₁ x − p₂ y = p₀ meet in one point.
    let rows = [east, south, west].map(|p| [-p[1], -p[2], 1.0]);
    let matrix = Matrix3::from_fn(|i, j| rows[i][j]);
    let top = matrix
        .try_inverse()
        .map_or(Vector3::repeat(f64::NAN), |inverse| inverse * Vector3::new(east[0], south[0], west[0]));
    let beside = |p: &&[f64; 3]| (118.0..125.0).contains(&(p[0] - top[0]).abs()) && (p[1] - top[1]).abs() < 60.0;
    let mut pavement: Vec<f64> = points.iter().filter(beside).map(|p| p[2]).collect();
    let level = upper_median(&mut pavement).unwrap_or(f64::NAN);
    Ok(vec![
        ("east_deg".to_owned(), slope(&east)),
        ("south_deg".to_owned(), slope(&south)),
        ("west_deg".to_owned(), slope(&west)),
        ("height_m".to_owned(), top[2] - level),
    ])
}

/// The plane of the face that looks to (`east`, `north`): least squares, cells beyond three robust
/// deviations left out.
fn fit_face(points: &[[f64; 3]], east: f64, north: f64) -> Plane {
    let on_face = |p: &&[f64; 3]| {
        let out = p[0] * east + p[1] * north;
        let side = (p[0] * north - p[1] * east).abs();
        (25.0..95.0).contains(&out) && side < 0.8 * out
    };
    let mut used: Vec<[f64; 3]> = points.iter().filter(on_face).copied().collect();
    let mut plane = Plane::zeros();
    for _ in 0..5 {
        plane = least_squares(&used);
        let error = |p: &[f64; 3]| (p[2] - plane[0] - plane[1] * p[0] - plane[2] * p[1]).abs();
        let mut sizes: Vec<f64> = used.iter().map(error).collect();
        let limit = 3.0 * NMAD_FACTOR * upper_median(&mut sizes).unwrap_or(f64::INFINITY);
        used.retain(|p| error(p) <= limit);
    }
    plane
}

fn least_squares(points: &[[f64; 3]]) -> Plane {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for p in points {
        let row = Vector3::new(1.0, p[0], p[1]);
        normal += row * row.transpose();
        right += row * p[2];
    }
    normal.try_inverse().map_or(Plane::repeat(f64::NAN), |inverse| inverse * right)
}
