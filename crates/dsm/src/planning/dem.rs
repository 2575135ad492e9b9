//! The heights of a coarse elevation model over the scene.

use std::path::Path;

use crs::{HeightConverter, MapProjection, VerticalDatum};
use reconstruct::{HeightRange, MapBounds, ReconstructError, ViewGeometry, shared_ground};

use crate::error::{DsmError, DsmSetting};
use crate::notes::Notes;

/// Returns the least and greatest height of an elevation model over the ground that the images
/// share.
///
/// The vertical datum is `stated`, or that of the file. A file without one is taken as EGM96, as
/// SRTM and most others are.
///
/// # Errors
/// [`DsmError::Value`] for a file without CRS or without heights under the scene,
/// [`DsmError::Image`], [`DsmError::Crs`].
pub(crate) fn dem_heights(
    path: &Path,
    stated: Option<VerticalDatum>,
    geometry: &ViewGeometry,
    notes: &mut Notes<'_>,
) -> Result<HeightRange, DsmError> {
    let dem = formats::raster::read_dem(path)?;
    warn_of_datum(path, stated, dem.vertical, notes);
    let no_crs = || {
        let found = format!("a file without coordinate reference system: {}", path.display());
        DsmError::value(DsmSetting::Dem, found, "a georeferenced elevation model")
    };
    let projection = MapProjection::from_definition(dem.crs_wkt.as_deref().ok_or_else(no_crs)?)?;
    let converter = HeightConverter::new(stated.or(dem.vertical).unwrap_or(VerticalDatum::Egm96))?;
    let hull = shared_ground(&geometry.outlines).ok_or(ReconstructError::NoOverlap { share_percent: 0.0 })?;
    // The rectangle of cells over the scene, in columns and rows.
    let mut cells = MapBounds::EMPTY;
    for p in hull.exterior().points() {
        let g = geometry.frame.ground_from_enu(geodesy::EnuPoint { east: p.x(), north: p.y(), up: 0.0 });
        let m = projection.map_from_lonlat(g.lon_deg, g.lat_deg)?;
        if let Some((c, r)) = dem.geotransform.cell_from_map(m.x, m.y) {
            cells = cells.including(c, r);
        }
    }
    let clamp = |v: f64, n: usize| v.clamp(0.0, n as f64 - 1.0) as usize;
    let (w, h) = (dem.heights.width(), dem.heights.height());
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in clamp(cells.y_min.floor(), h)..=clamp(cells.y_max.ceil(), h) {
        for column in clamp(cells.x_min.floor(), w)..=clamp(cells.x_max.ceil(), w) {
            let v = f64::from(dem.heights[(column, row)]);
            if v.is_finite() {
                (lo, hi) = (lo.min(v), hi.max(v));
            }
        }
    }
    if lo > hi || cells.x_max < 0.0 || cells.y_max < 0.0 || cells.x_min > w as f64 || cells.y_min > h as f64 {
        let found = format!("a file without heights under the scene: {}", path.display());
        let expected = "an elevation model that covers the images; or leave it out";
        return Err(DsmError::value(DsmSetting::Dem, found, expected));
    }
    // One undulation serves both ends, because it changes by centimetres over a scene.
    let centre = geometry.centre;
    let up = |v: f64| converter.ellipsoid_from_datum(centre.lon_deg, centre.lat_deg, v);
    Ok(HeightRange::new(up(lo)?, up(hi)?))
}

/// Warns when the datum that is given for an elevation model is not the one that its file names.
pub(crate) fn warn_of_datum(
    path: &Path,
    stated: Option<VerticalDatum>,
    named: Option<VerticalDatum>,
    notes: &mut Notes<'_>,
) {
    if let (Some(stated), Some(named)) = (stated, named)
        && stated != named
    {
        notes.warn(format!(
            "the heights of an elevation model are taken as above {stated}, as given, but the file names {named}; check \
             which is right: {}",
            path.display()
        ));
    }
}
