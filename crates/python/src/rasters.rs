//! Rasters between arrays and files, and on other maps and datums.

use std::path::PathBuf;

use crs::{Crs, CrsIdentity, HeightConverter, MapProjection, VerticalDatum, compound_wkt, horizontal_wkt};
use eval::{MetresFromCells, bilinear, nearest};
use formats::raster::{Band, BandData, CogCrs, CogRaster, ImageSource, undeclared_no_data, write_cog};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1};
use pyo3::prelude::*;
use raster::{GeoTransform, Grid, Window};

use crate::exception::{raise, raise_about};
use crate::fault::Fault;
use crate::forked::in_own_pool;

/// Most cells that are read at once: those of 4 GB.
const CELLS_MAX: usize = 1 << 30;

/// Cells, geotransform, CRS as WKT, vertical datum, no-data value of the file, unit of the band.
type Raster<'py> =
    (Bound<'py, PyArray2<f32>>, Option<[f64; 6]>, Option<String>, Option<String>, Option<f64>, Option<String>);

/// Name, EPSG code of the horizontal part, its WKT, vertical datum, and metres per unit of the map.
type Parts = (String, Option<u32>, String, Option<String>, Option<f64>);

fn grid_of(heights: &PyReadonlyArray2<'_, f32>) -> Result<Grid<f32>, Fault> {
    let array = heights.as_array();
    let (height, width) = array.dim();
    let grid = Grid::from_vec(width, height, array.iter().copied().collect()).filter(|_| width > 0 && height > 0);
    grid.ok_or_else(|| {
        Fault::setting(format!("heights have the shape ({height}, {width}), expected at least one cell"))
    })
}

/// Returns the parts of any CRS that PROJ reads.
#[pyfunction]
pub(crate) fn crs_parts(py: Python<'_>, definition: &str) -> PyResult<Parts> {
    let parts = || -> Result<Parts, Fault> {
        let CrsIdentity { name, horizontal, vertical } = CrsIdentity::of(definition)?;
        let metres = MapProjection::from_definition(definition)?.metres_per_unit();
        Ok((name, horizontal, horizontal_wkt(definition)?, vertical.map(|datum| datum.to_string()), metres))
    };
    parts().map_err(|fault| raise(py, &fault))
}

/// Returns the name of a vertical datum as files have it, and the metres in a unit of it.
#[pyfunction]
pub(crate) fn vertical_parts(py: Python<'_>, vertical: &str) -> PyResult<(String, f64)> {
    let parts = || -> Result<(String, f64), Fault> {
        let datum: VerticalDatum = vertical.parse()?;
        // Also what only a conversion would find: that the code is one of a map.
        Ok((datum.to_string(), datum.metres_per_unit()?))
    };
    parts().map_err(|fault| raise(py, &fault))
}

/// Brings map positions from one CRS to another, in place. What has no position becomes NaN.
#[pyfunction]
pub(crate) fn transform_points(
    py: Python<'_>,
    source: &str,
    target: &str,
    mut x: PyReadwriteArray1<'_, f64>,
    mut y: PyReadwriteArray1<'_, f64>,
) -> PyResult<()> {
    let (x, y) = (x.as_slice_mut()?, y.as_slice_mut()?);
    let transformed = py.detach(|| -> Result<(), Fault> {
        MapProjection::from_definition(source)?.lonlat_from_map_slices(x, y)?;
        MapProjection::from_definition(target)?.map_from_lonlat_slices(x, y)?;
        Ok(())
    });
    transformed.map_err(|fault| raise(py, &fault))
}

/// Writes the values at positions in cells (the centre of the first one is 0) over the columns.
/// Bilinear values take the valid ones of four neighbours; where the nearest cell is void or
/// outside, there is none.
#[pyfunction]
pub(crate) fn sample_cells(
    py: Python<'_>,
    values: PyReadonlyArray2<'_, f32>,
    mut columns: PyReadwriteArray1<'_, f64>,
    rows: PyReadonlyArray1<'_, f64>,
    is_bilinear: bool,
) -> PyResult<()> {
    let grid = grid_of(&values).map_err(|fault| raise(py, &fault))?;
    let (columns, rows) = (columns.as_slice_mut()?, rows.as_slice()?);
    py.detach(|| {
        for (column, row) in columns.iter_mut().zip(rows) {
            let value =
                if is_bilinear { bilinear(&grid, *column, *row) } else { nearest(&grid, *column, *row).map(f64::from) };
            *column = value.unwrap_or(f64::NAN);
        }
    });
    Ok(())
}

/// Returns heights, metres, above another datum; NaN where a geoid has no value.
#[pyfunction]
pub(crate) fn convert_heights<'py>(
    py: Python<'py>,
    heights: PyReadonlyArray2<'py, f32>,
    geotransform: [f64; 6],
    definition: &str,
    datums: (String, String),
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let mut grid = grid_of(&heights).map_err(|fault| raise(py, &fault))?;
    let converted = py.detach(|| -> Result<Grid<f32>, Fault> {
        let place = GeoTransform(geotransform);
        let projection = MapProjection::from_definition(definition)?;
        let middle = place.map_from_cell(grid.width() as f64 / 2.0, grid.height() as f64 / 2.0);
        let metres = projection.metres_per_unit_at(middle.1);
        let (along_columns, along_rows) = MetresFromCells::new(&place, metres).cell_size_m();
        let (from, to) = (HeightConverter::new(datums.0.parse()?)?, HeightConverter::new(datums.1.parse()?)?);
        eval::convert_heights(&mut grid, &place, along_columns.max(along_rows), &projection, &from, &to)?;
        Ok(grid)
    });
    let grid = converted.map_err(|fault| raise(py, &fault))?;
    let shape = [grid.height(), grid.width()];
    grid.into_vec().into_pyarray(py).reshape(shape)
}

/// Returns a value that looks like no-data among heights in metres, and the number of its cells.
#[pyfunction]
pub(crate) fn undeclared(heights: PyReadonlyArray2<'_, f32>) -> PyResult<Option<(f32, usize)>> {
    Ok(undeclared_no_data(heights.as_slice()?))
}

/// Writes heights, metres, as a Cloud-Optimised GeoTIFF; NaN is no-data. `crs` is the map and the
/// vertical datum. Without a datum the file states none.
#[pyfunction]
pub(crate) fn write_grid(
    py: Python<'_>,
    path: PathBuf,
    heights: PyReadonlyArray2<'_, f32>,
    geotransform: [f64; 6],
    crs: (String, Option<String>),
    overwrite: bool,
) -> PyResult<()> {
    let grid = grid_of(&heights).map_err(|fault| raise(py, &fault))?;
    let written = py.detach(|| {
        in_own_pool(|| {
            let (definition, vertical) = crs;
            let vertical: Option<VerticalDatum> = vertical.map(|text| text.parse()).transpose()?;
            let horizontal = CrsIdentity::of(&definition)?.horizontal;
            // A file of heights names their datum; others have the map alone.
            let wkt = match (horizontal, vertical) {
                (Some(_), _) => String::new(),
                (None, Some(datum)) if datum != VerticalDatum::Ellipsoid => compound_wkt(&definition, datum)?,
                (None, _) => horizontal_wkt(&definition)?,
            };
            let crs = match (horizontal, vertical) {
                (Some(horizontal), vertical) => Crs { horizontal, vertical: vertical.unwrap_or_default() }.into(),
                (None, Some(vertical)) if vertical != VerticalDatum::Ellipsoid => {
                    CogCrs::Compound { wkt: &wkt, vertical }
                }
                (None, _) => CogCrs::Wkt(&wkt),
            };
            let bands = [Band { description: "height_m", data: BandData::F32(&grid) }];
            let raster = CogRaster::new(&bands, GeoTransform(geotransform), crs);
            let raster = CogRaster { holds_heights: vertical.is_some(), ..raster };
            Ok(write_cog(&path, &raster, overwrite)?)
        })
    });
    written.map_err(|fault| raise_about(py, &fault, &[&path]))
}

/// Returns the CRS (WKT) and the vertical datum that a raster file states.
#[pyfunction]
pub(crate) fn file_crs(py: Python<'_>, path: PathBuf) -> PyResult<(Option<String>, Option<String>)> {
    let facts = || -> Result<_, Fault> {
        let source = ImageSource::open(&path)?;
        Ok((source.info().crs_wkt.clone(), source.vertical().map(|datum| datum.to_string())))
    };
    py.detach(facts).map_err(|fault| raise_about(py, &fault, &[&path]))
}

/// Reads a band, counted from 1, with its place. No-data is NaN.
#[pyfunction]
pub(crate) fn read_grid(py: Python<'_>, path: PathBuf, band: usize) -> PyResult<Raster<'_>> {
    let read = || -> Result<_, Fault> {
        let source = ImageSource::open(&path)?;
        let info = source.info();
        let (width, height) = (info.width, info.height);
        if band == 0 || band > info.bands {
            return Err(Fault::setting(format!("the band is {band}, expected 1 to {}", info.bands)));
        }
        if width.saturating_mul(height) > CELLS_MAX {
            return Err(Fault::setting(format!("found {width} x {height} cells, expected at most {CELLS_MAX}")));
        }
        let cells = source.read_samples(band, Window::whole(width, height))?;
        let vertical = source.vertical().map(|datum| datum.to_string());
        let place = (info.geotransform.map(|t| t.0), info.crs_wkt.clone(), vertical);
        Ok((cells, place, info.no_data, source.unit(band)))
    };
    let (cells, (geotransform, crs, vertical), no_data, unit) =
        py.detach(read).map_err(|fault| raise_about(py, &fault, &[&path]))?;
    let shape = [cells.height(), cells.width()];
    Ok((cells.into_vec().into_pyarray(py).reshape(shape)?, geotransform, crs, vertical, no_data, unit))
}
