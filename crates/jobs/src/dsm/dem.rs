//! The height span of a coarse elevation model over the scene.

use std::path::Path;

use crs::{HeightConverter, MapProjection, VerticalDatum};

use crate::dsm::geometry::shared_ground;
use crate::dsm::scene::Geometry;
use crate::error::PipelineError;

/// Least and greatest height of the DEM over the ground that the images share, metres above the ellipsoid.
///
/// The DEM's vertical datum is that of its file; one without is taken as EGM96, as SRTM and most others are.
pub(crate) fn height_span(path: &Path, geometry: &Geometry) -> Result<(f64, f64), PipelineError> {
    let dem = io::raster::read_dem(path)?;
    let no_crs = || PipelineError::Value {
        name: "--dem",
        found: format!("no coordinate reference system in {}", path.display()),
        expected: "a georeferenced elevation model".to_owned(),
    };
    let projection = MapProjection::from_definition(dem.crs_wkt.as_deref().ok_or_else(no_crs)?)?;
    let converter = HeightConverter::new(dem.vertical.unwrap_or(VerticalDatum::Egm96))?;
    let hull = shared_ground(&geometry.outlines).ok_or(PipelineError::NoOverlap { share_percent: 0.0 })?;
    let mut cells = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for p in hull.exterior().points() {
        let g = geometry.frame.ground_from_enu(geodesy::EnuPoint { east: p.x(), north: p.y(), up: 0.0 });
        let m = projection.map_from_lonlat(g.lon_deg, g.lat_deg)?;
        if let Some((c, r)) = dem.geotransform.cell_from_map(m.x, m.y) {
            cells = [cells[0].min(c), cells[1].min(r), cells[2].max(c), cells[3].max(r)];
        }
    }
    let clamp = |v: f64, n: usize| v.clamp(0.0, n as f64 - 1.0) as usize;
    let (w, h) = (dem.heights.width(), dem.heights.height());
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in clamp(cells[1].floor(), h)..=clamp(cells[3].ceil(), h) {
        for column in clamp(cells[0].floor(), w)..=clamp(cells[2].ceil(), w) {
            let v = f64::from(dem.heights[(column, row)]);
            if v.is_finite() {
                (lo, hi) = (lo.min(v), hi.max(v));
            }
        }
    }
    if lo > hi || cells[2] < 0.0 || cells[3] < 0.0 || cells[0] > w as f64 || cells[1] > h as f64 {
        return Err(PipelineError::Value {
            name: "--dem",
            found: format!("no height under the scene in {}", path.display()),
            expected: "an elevation model that covers the images; or leave it out".to_owned(),
        });
    }
    // The undulation changes by centimetres over a scene: one value serves both ends.
    let centre = geometry.centre;
    let up = |v: f64| converter.ellipsoid_from_datum(centre.lon_deg, centre.lat_deg, v);
    Ok((up(lo)?, up(hi)?))
}
