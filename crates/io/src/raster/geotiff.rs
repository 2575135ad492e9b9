//! GeoTIFF out: Cloud-Optimised rasters of results, and plain tiled images with an RPC.
//!
//! The raster is built in GDAL's MEM driver and copied by the COG (or GTiff) driver: tiles of 512 (256), deflate with
//! the predictor of the sample type, overviews in the file. NaN becomes the no-data value. The CRS is compound where
//! heights have a vertical datum. Ellipsoidal heights have no vertical CRS, and a three-dimensional projected CRS written
//! by GDAL 3.6 reads back as none at all, so the CRS stays the horizontal one. The metadata item `VERTICAL_DATUM`
//! (`ellipsoid`, `egm96`, …) says in every case what heights are measured from, and [`super::read_dem`] reads it. The
//! same input gives the same bytes whatever the number of threads.

use std::path::Path;

use camera::Rpc;
use crs::Crs;
use gdal::raster::{Buffer, GdalType, RasterCreationOptions};
use gdal::spatial_ref::SpatialRef;
use gdal::{Dataset, DriverManager, Metadata};
use raster::{GeoTransform, Grid, NO_DATA};

use super::{RasterError, with_gdal};
use crate::atomic::write_path;

/// Metadata item that names what heights are measured from.
pub(super) const VERTICAL_DATUM: &str = "VERTICAL_DATUM";
/// Side of a COG's tiles, cells.
const BLOCK: usize = 512;
/// Rows converted at a time between our memory and GDAL's.
const CHUNK_ROWS: usize = 256;

/// The cells of one band.
#[derive(Debug, Clone, Copy)]
pub enum BandData<'a> {
    /// Heights and other quantities; NaN is no-data.
    F32(&'a Grid<f32>),
    /// Masks, classes, pictures.
    U8(&'a Grid<u8>),
    /// Image samples, counts.
    U16(&'a Grid<u16>),
    /// Numbers of objects.
    U32(&'a Grid<u32>),
}

/// One band of an output.
#[derive(Debug, Clone, Copy)]
pub struct Band<'a> {
    /// What a reader sees as the band's name, with its unit: `height_m`.
    pub description: &'a str,
    /// The cells; all bands of a file have one type and size.
    pub data: BandData<'a>,
}

/// How overviews are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampling {
    /// Mean of the valid cells: heights and other quantities.
    #[default]
    Average,
    /// One of the cells: classes and masks.
    Nearest,
}

/// Where a raster lies, and what its file says of it.
#[derive(Debug, Clone, Copy)]
pub struct CogPlace<'a> {
    /// Position of the grid.
    pub geotransform: GeoTransform,
    /// Horizontal CRS and vertical datum.
    pub crs: Crs,
    /// Further items of the default metadata domain.
    pub metadata: &'a [(&'a str, &'a str)],
    /// Threads that compress.
    pub threads: usize,
}

/// A raster to write.
#[derive(Debug, Clone, Copy)]
pub struct CogRaster<'a> {
    /// The bands, one or more.
    pub bands: &'a [Band<'a>],
    /// Position of the grid.
    pub geotransform: GeoTransform,
    /// Horizontal CRS and vertical datum.
    pub crs: Crs,
    /// No-data value; NaN cells take it. `None` leaves the file without (only sensible for integer bands).
    pub no_data: Option<f64>,
    /// How overviews are made.
    pub overviews: Sampling,
    /// Further items of the default metadata domain (`AREA_OR_POINT` is set by GDAL).
    pub metadata: &'a [(&'a str, &'a str)],
    /// Threads that compress.
    pub threads: usize,
}

impl<'a> CogRaster<'a> {
    /// A raster with the toolkit's defaults: no-data −32768 for float bands, averaged overviews, one thread.
    pub fn new(bands: &'a [Band<'a>], geotransform: GeoTransform, crs: Crs) -> Self {
        let float = matches!(bands.first(), Some(Band { data: BandData::F32(_), .. }));
        let no_data = float.then_some(f64::from(NO_DATA));
        let overviews = if float { Sampling::Average } else { Sampling::Nearest };
        Self { bands, geotransform, crs, no_data, overviews, metadata: &[], threads: 1 }
    }
}

/// Writes a Cloud-Optimised GeoTIFF.
///
/// # Errors
/// [`RasterError::NotWritten`] without `overwrite`; [`RasterError::InconsistentBands`] when there is no band or bands differ
/// in size or type; [`RasterError::Crs`] for codes that PROJ does not know; [`RasterError::NotWritten`].
pub fn write_cog(path: impl AsRef<Path>, raster: &CogRaster<'_>, overwrite: bool) -> Result<(), RasterError> {
    let path = path.as_ref();
    raster.crs.wkt().map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, raster.bands, raster.no_data)?;
        // Left to the COG driver, they would take a way through a file.
        let factors = overview_factors(memory.raster_size());
        with_gdal(|| memory.build_overviews(resampling(raster.overviews), &factors, &[]))
            .map_err(|reason| RasterError::unwritable(path, reason))?;
        let CogRaster { geotransform, crs, metadata, threads, .. } = *raster;
        let place = CogPlace { geotransform, crs, metadata, threads };
        finish_cog(&mut memory, place, raster.overviews, made).map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Each overview's reduction: halves, until one block holds all.
fn overview_factors((width, height): (usize, usize)) -> Vec<i32> {
    let halvings = width.max(height).div_ceil(BLOCK).next_power_of_two().ilog2();
    (1..=halvings).map(|k| 1 << k).collect()
}

/// GDAL's name.
fn resampling(sampling: Sampling) -> &'static str {
    match sampling {
        Sampling::Average => "AVERAGE",
        Sampling::Nearest => "NEAREST",
    }
}

/// Gives a dataset its place on the Earth and copies it into a Cloud-Optimised GeoTIFF.
pub(super) fn finish_cog(
    dataset: &mut Dataset,
    place: CogPlace<'_>,
    overviews: Sampling,
    made: &Path,
) -> Result<(), String> {
    let (threads, block) = (place.threads.max(1).to_string(), BLOCK.to_string());
    let options = [
        ("COMPRESS", "DEFLATE"),
        // Measured heights end in noise: higher levels take several times longer for a hundredth of the size.
        ("LEVEL", "1"),
        ("PREDICTOR", "YES"),
        ("BLOCKSIZE", block.as_str()),
        ("BIGTIFF", "IF_SAFER"),
        ("OVERVIEW_RESAMPLING", resampling(overviews)),
        ("NUM_THREADS", threads.as_str()),
    ];
    with_gdal(|| {
        dataset.set_spatial_ref(&SpatialRef::from_definition(&place.crs.to_string())?)?;
        dataset.set_geo_transform(&place.geotransform.0)?;
        dataset.set_metadata_item(VERTICAL_DATUM, &place.crs.vertical.to_string(), "")?;
        for (key, value) in place.metadata {
            dataset.set_metadata_item(key, value, "")?;
        }
        copy(dataset, "COG", made, &options)
    })
}

/// Writes an image with its RPC in TIFF tag 50844 (GDAL's `RPC` metadata): tiled, deflate, no georeference.
///
/// # Errors
/// As [`write_cog`], without those of the CRS.
pub fn write_image_with_rpc(
    path: impl AsRef<Path>,
    bands: &[Band<'_>],
    rpc: &Rpc,
    no_data: Option<f64>,
    overwrite: bool,
) -> Result<(), RasterError> {
    let path = path.as_ref();
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, bands, no_data)?;
        let options = plain_options(bands);
        with_gdal(|| {
            for (key, value) in rpc_items(rpc) {
                memory.set_metadata_item(key, &value, "RPC")?;
            }
            copy(&memory, "GTiff", made, &options)
        })
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Writes a map in the pixels of an image: tiled, deflate, no georeference. As in every float raster NaN becomes `no_data`.
///
/// # Errors
/// As [`write_cog`], without those of the CRS.
pub fn write_map(
    path: impl AsRef<Path>,
    bands: &[Band<'_>],
    no_data: Option<f64>,
    metadata: &[(&str, &str)],
    overwrite: bool,
) -> Result<(), RasterError> {
    let path = path.as_ref();
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, bands, no_data)?;
        let options = plain_options(bands);
        with_gdal(|| {
            for (key, value) in metadata {
                memory.set_metadata_item(key, value, "")?;
            }
            copy(&memory, "GTiff", made, &options)
        })
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Tiles with deflate and the predictor of the samples.
fn plain_options(bands: &[Band<'_>]) -> [(&'static str, &'static str); 4] {
    let float = matches!(bands.first(), Some(Band { data: BandData::F32(_), .. }));
    [("COMPRESS", "DEFLATE"), ("PREDICTOR", if float { "3" } else { "2" }), ("TILED", "YES"), ("BIGTIFF", "IF_SAFER")]
}

/// The RPC in GDAL's keys. Numbers are written so that they read back to the same bits.
fn rpc_items(rpc: &Rpc) -> Vec<(&'static str, String)> {
    let list = |c: &[f64; 20]| c.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    vec![
        // GDAL takes −1 as "unknown".
        ("ERR_BIAS", rpc.err_bias_m.unwrap_or(-1.0).to_string()),
        ("ERR_RAND", rpc.err_rand_m.unwrap_or(-1.0).to_string()),
        ("LINE_OFF", rpc.line_off.to_string()),
        ("SAMP_OFF", rpc.samp_off.to_string()),
        ("LAT_OFF", rpc.lat_off.to_string()),
        ("LONG_OFF", rpc.long_off.to_string()),
        ("HEIGHT_OFF", rpc.height_off.to_string()),
        ("LINE_SCALE", rpc.line_scale.to_string()),
        ("SAMP_SCALE", rpc.samp_scale.to_string()),
        ("LAT_SCALE", rpc.lat_scale.to_string()),
        ("LONG_SCALE", rpc.long_scale.to_string()),
        ("HEIGHT_SCALE", rpc.height_scale.to_string()),
        ("LINE_NUM_COEFF", list(&rpc.line_num)),
        ("LINE_DEN_COEFF", list(&rpc.line_den)),
        ("SAMP_NUM_COEFF", list(&rpc.samp_num)),
        ("SAMP_DEN_COEFF", list(&rpc.samp_den)),
    ]
}

/// Copies a dataset into a file and closes it, which is when GDAL writes the last bytes.
pub(super) fn copy(memory: &Dataset, driver: &str, made: &Path, options: &[(&str, &str)]) -> gdal::errors::Result<()> {
    let options = RasterCreationOptions::from_iter(options.iter().map(|(key, value)| format!("{key}={value}")));
    let driver = DriverManager::get_driver_by_name(driver)?;
    memory.create_copy(&driver, made, &options)?.close()
}

/// The bands as a MEM dataset.
pub(super) fn in_memory(path: &Path, bands: &[Band<'_>], no_data: Option<f64>) -> Result<Dataset, RasterError> {
    let first = bands.first().ok_or_else(|| inconsistent(path, "there is no band"))?;
    match first.data {
        BandData::F32(_) => fill(path, bands, no_data, as_f32, |v: f32| match no_data {
            Some(void) if v.is_nan() => void as f32,
            _ => v,
        }),
        BandData::U8(_) => fill(path, bands, no_data, as_u8, |v| v),
        BandData::U16(_) => fill(path, bands, no_data, as_u16, |v| v),
        BandData::U32(_) => fill(path, bands, no_data, as_u32, |v| v),
    }
}

fn as_f32<'a>(band: &Band<'a>) -> Option<&'a Grid<f32>> {
    if let BandData::F32(grid) = band.data { Some(grid) } else { None }
}

fn as_u8<'a>(band: &Band<'a>) -> Option<&'a Grid<u8>> {
    if let BandData::U8(grid) = band.data { Some(grid) } else { None }
}

fn as_u16<'a>(band: &Band<'a>) -> Option<&'a Grid<u16>> {
    if let BandData::U16(grid) = band.data { Some(grid) } else { None }
}

fn as_u32<'a>(band: &Band<'a>) -> Option<&'a Grid<u32>> {
    if let BandData::U32(grid) = band.data { Some(grid) } else { None }
}

fn fill<'a, T: GdalType + Copy + 'a>(
    path: &Path,
    bands: &[Band<'a>],
    no_data: Option<f64>,
    typed: impl Fn(&Band<'a>) -> Option<&'a Grid<T>>,
    convert: impl Fn(T) -> T,
) -> Result<Dataset, RasterError> {
    let grids: Option<Vec<&Grid<T>>> = bands.iter().map(typed).collect();
    let grids = grids.ok_or_else(|| inconsistent(path, "the bands differ in type"))?;
    let (width, height) = (grids[0].width(), grids[0].height());
    if grids.iter().any(|g| (g.width(), g.height()) != (width, height)) {
        return Err(inconsistent(path, "the bands differ in size"));
    }
    if width == 0 || height == 0 {
        return Err(inconsistent(path, "the raster has no cells"));
    }
    with_gdal(|| {
        let driver = DriverManager::get_driver_by_name("MEM")?;
        let dataset = driver.create_with_band_type::<T, _>("", width, height, grids.len())?;
        for (index, (grid, band)) in grids.iter().zip(bands).enumerate() {
            let mut target = dataset.rasterband(index + 1)?;
            target.set_description(band.description)?;
            target.set_no_data_value(no_data)?;
            for top in (0..height).step_by(CHUNK_ROWS) {
                let rows = CHUNK_ROWS.min(height - top);
                let cells = grid.data()[top * width..(top + rows) * width].iter().map(|&v| convert(v)).collect();
                target.write((0, top as isize), (width, rows), &mut Buffer::new((width, rows), cells))?;
            }
        }
        Ok(dataset)
    })
    .map_err(|reason| RasterError::unwritable(path, reason))
}

fn inconsistent(path: &Path, reason: &str) -> RasterError {
    RasterError::InconsistentBands { path: path.to_owned(), reason: reason.to_owned() }
}
