//! Heights of a model above the ellipsoid, where RPCs count from.

use geodesy::{HeightConverter, MapProjection, VerticalDatum};
use mesh::TriangleMesh;

use crate::PriorsError;

/// Heights above `datum` become heights above the WGS 84 ellipsoid; the mesh is in the map of `projection`, metres.
///
/// # Errors
/// A datum whose grid cannot be had; [`PriorsError::BeyondDatum`] outside its area, the mesh is then as it was.
pub fn mesh_to_ellipsoid(
    mesh: &mut TriangleMesh,
    projection: &MapProjection,
    datum: VerticalDatum,
) -> Result<(), PriorsError> {
    if datum == VerticalDatum::Ellipsoid {
        return Ok(());
    }
    let origin = mesh.origin;
    let (mut x, mut y): (Vec<f64>, Vec<f64>) =
        mesh.positions.iter().map(|p| (p[0] + origin.x, p[1] + origin.y)).unzip();
    projection.lonlat_from_map_slices(&mut x, &mut y)?;
    let mut heights: Vec<f64> = mesh.positions.iter().map(|p| p[2] + origin.z).collect();
    HeightConverter::new(datum)?.ellipsoid_from_datum_slices(&x, &y, &mut heights)?;
    if heights.iter().any(|height| !height.is_finite()) {
        return Err(PriorsError::BeyondDatum { datum });
    }
    mesh.positions.iter_mut().zip(heights).for_each(|(p, height)| p[2] = height - origin.z);
    Ok(())
}
