//! The area of a scene: the rectangle around a polygon on the map of the surface model.

use crs::MapProjection;
use geodesy::utm_epsg;
use io::areas::AreaName;

use crate::batch::batch_file::SceneArea;
use crate::dsm::{DsmConfig, MapBounds};
use crate::error_text::with_causes;

/// Sets the area of a surface model to the rectangle around a polygon. Where no CRS is given, it is
/// the UTM zone of the polygon's middle.
///
/// # Errors
/// A text for a polygon that cannot be read or has no place on the map.
pub(super) fn set_area(config: &mut DsmConfig, area: &SceneArea, scene: &str) -> Result<(), String> {
    let name = area.name.as_deref().unwrap_or(scene);
    let wanted = AreaName { layer: area.layer.as_deref(), field: &area.field, name };
    let found = io::areas::read(&area.file, wanted).map_err(|e| with_causes(&e))?;
    let source = MapProjection::from_definition(&found.crs).map_err(|e| with_causes(&e))?;
    let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = found.corners.into_iter().unzip();
    let lost = source.lonlat_from_map_slices(&mut lon, &mut lat).map_err(|e| with_causes(&e))?;
    if lost > 0 {
        return Err(format!("{lost} corners of the area {name:?} have no place on the Earth"));
    }
    let middle = |values: &[f64]| {
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
        0.5 * (low + high)
    };
    let epsg = match config.crs_epsg {
        Some(epsg) => epsg,
        None => utm_epsg(middle(&lon), middle(&lat)).map_err(|e| with_causes(&e))?,
    };
    let map = MapProjection::from_epsg(epsg).map_err(|e| with_causes(&e))?;
    let mut bounds = MapBounds::EMPTY;
    for (lon, lat) in lon.into_iter().zip(lat) {
        let corner = map.map_from_lonlat(lon, lat).map_err(|e| with_causes(&e))?;
        bounds = bounds.including(corner.x, corner.y);
    }
    config.crs_epsg = Some(epsg);
    config.bounds = Some(bounds);
    Ok(())
}
