//! A surface model on a metric map, its heights above the ellipsoid: what commands that leave the raster need.

use std::path::Path;

use anyhow::{Context, bail};
use crs::{HeightConverter, MapProjection, VerticalDatum};
use io::raster::{Dem, read_dem};

/// A surface model that has been read.
pub(crate) struct MapSurface {
    /// The raster; heights in metres above the WGS 84 ellipsoid.
    pub(crate) dem: Dem,
    /// Its map.
    pub(crate) projection: MapProjection,
}

/// Reads a surface model in a projected CRS in metres; `stated` overrides what the file says of its heights.
pub(crate) fn read(path: &Path, stated: Option<VerticalDatum>) -> anyhow::Result<MapSurface> {
    let mut dem = read_dem(path)?;
    let definition = dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or_else(|| dem.crs_wkt.clone());
    let Some(definition) = definition else {
        bail!("the surface model has no coordinate reference system: {}", path.display());
    };
    let projection = MapProjection::from_definition(&definition)
        .with_context(|| format!("its coordinate system: {}", path.display()))?;
    match projection.metres_per_unit() {
        Some(1.0) => {}
        unit => {
            let unit = unit.map_or("degrees".to_owned(), |metres| format!("units of {metres} m"));
            bail!(
                "the surface model is in {unit}, expected a projected reference system in metres: warp it first: {}",
                path.display()
            );
        }
    }
    match stated.or(dem.vertical) {
        None => {
            tracing::warn!("the file does not say what its heights are above: taken as the ellipsoid, see --vertical")
        }
        Some(VerticalDatum::Ellipsoid) => {}
        Some(datum) => to_ellipsoid(&mut dem, &projection, datum)?,
    }
    Ok(MapSurface { dem, projection })
}

fn to_ellipsoid(dem: &mut Dem, projection: &MapProjection, datum: VerticalDatum) -> anyhow::Result<()> {
    let converter = HeightConverter::new(datum)?;
    let (width, transform) = (dem.heights.width(), dem.geotransform);
    for row in 0..dem.heights.height() {
        let columns: Vec<usize> = (0..width).filter(|&column| dem.heights[(column, row)].is_finite()).collect();
        let map = |&column: &usize| transform.map_from_cell(column as f64, row as f64);
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = columns.iter().map(map).unzip();
        let mut heights: Vec<f64> = columns.iter().map(|&column| f64::from(dem.heights[(column, row)])).collect();
        projection.lonlat_from_map_slices(&mut x, &mut y)?;
        converter.ellipsoid_from_datum_slices(&x, &y, &mut heights)?;
        columns.iter().zip(heights).for_each(|(&column, height)| dem.heights[(column, row)] = height as f32);
    }
    Ok(())
}
