//! Rasters between arrays and files.

use std::path::PathBuf;

use crs::{Crs, VerticalDatum};
use io::raster::{Band, BandData, CogRaster, ImageSource, write_cog};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use raster::{GeoTransform, Grid, Window};

use crate::exception::raise;
use crate::fault::Fault;

/// Most cells that are read at once: those of 4 GB.
const CELLS_MAX: usize = 1 << 30;

/// Cells, geotransform, and CRS as WKT.
type Raster<'py> = (Bound<'py, PyArray2<f32>>, Option<[f64; 6]>, Option<String>);

/// Writes heights, metres, as a Cloud-Optimised GeoTIFF; NaN is no-data.
#[pyfunction]
pub(crate) fn write_grid(
    py: Python<'_>,
    path: PathBuf,
    heights: PyReadonlyArray2<'_, f32>,
    geotransform: [f64; 6],
    crs: (u32, String),
    overwrite: bool,
) -> PyResult<()> {
    let array = heights.as_array();
    let (height, width) = array.dim();
    let grid = Grid::from_vec(width, height, array.iter().copied().collect()).filter(|_| width > 0 && height > 0);
    let empty = || Fault::setting(format!("heights have the shape ({height}, {width}), expected at least one cell"));
    let grid = grid.ok_or_else(|| raise(py, &empty()))?;
    let (horizontal, vertical) = crs;
    let vertical = VerticalDatum::try_from(vertical).map_err(|e| raise(py, &e.into()))?;
    let crs = Crs { horizontal, vertical };
    let written = py.detach(|| {
        let bands = [Band { description: "height_m", data: BandData::F32(&grid) }];
        write_cog(&path, &CogRaster::new(&bands, GeoTransform(geotransform), crs), overwrite)
    });
    written.map_err(|e| raise(py, &e.into()))
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
        Ok((cells, info.geotransform.map(|t| t.0), info.crs_wkt.clone()))
    };
    let (cells, geotransform, crs) = py.detach(read).map_err(|fault| raise(py, &fault))?;
    let shape = [cells.height(), cells.width()];
    Ok((cells.into_vec().into_pyarray(py).reshape(shape)?, geotransform, crs))
}
