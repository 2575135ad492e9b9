//! Errors of a surface model of the town.

use std::path::Path;

use anyhow::Context;
use formats::raster::{ImageSource, read_dem_window};
use raster::Window;

use super::town;

/// Calls `one` with each n-th cell of each n-th row and its error, metres (NaN for a void), at
/// least 40 m inside an area of `area_m` metres to the east and to the south.
pub(crate) fn each(
    dsm: &Path,
    area_m: [f64; 2],
    every: usize,
    mut one: impl FnMut((usize, usize), f64),
) -> anyhow::Result<()> {
    let info = ImageSource::open(dsm)?.info().clone();
    for top in (0..info.height).step_by(512) {
        let strip = Window { x: 0, y: top as i64, width: info.width, height: 512.min(info.height - top) };
        let dem = read_dem_window(dsm, strip)?;
        let projection = crs::MapProjection::from_epsg(dem.horizontal_epsg.context("the DSM has no CRS")?)?;
        for row in (0..dem.heights.height()).step_by(every) {
            let columns: Vec<usize> = (0..dem.heights.width()).step_by(every).collect();
            let places = columns.iter().map(|&c| dem.geotransform.map_from_cell(c as f64, row as f64));
            let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = places.unzip();
            projection.lonlat_from_map_slices(&mut lon, &mut lat)?;
            for ((&c, lon), lat) in columns.iter().zip(lon).zip(lat) {
                let Some(truth) = town::truth(lon, lat, area_m) else { continue };
                one((c, top + row), f64::from(dem.heights[(c, row)]) - truth);
            }
        }
    }
    Ok(())
}
