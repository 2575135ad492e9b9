//! Writing GeoTIFF: Cloud-Optimised rasters of results, and plain tiled images with an RPC.
//!
//! The raster is built with GDAL's MEM driver and copied by the COG driver (tiles of 512 cells) or
//! the GTiff driver (tiles of 256), with deflate, the predictor of the sample type, and for COGs
//! overviews. NaN becomes the no-data value. The same input gives the same bytes for any number of
//! threads.
//!
//! The CRS is compound where heights have a vertical datum. Ellipsoidal heights have no vertical
//! CRS, and GDAL 3.6 writes a three-dimensional projected CRS that reads back as no CRS, so for
//! them the CRS is the horizontal one. In every case the metadata item `VERTICAL_DATUM`
//! (`ellipsoid`, `egm96`, …) names the vertical datum, and [`crate::raster::read_dem`] reads it.

use std::path::Path;

use camera::Rpc;
use crs::{Crs, VerticalDatum};
use gdal::raster::{ColorInterpretation, RasterCreationOptions};
use gdal::spatial_ref::SpatialRef;
use gdal::{Dataset, DriverManager, Metadata};
use raster::{GeoTransform, NO_DATA};

use super::band::{Band, in_memory};
use super::labels::{Provenance, label};
use super::verify::verify;
use crate::atomic::write_path;
use crate::raster::access::gdal_setup::{left_over_messages, with_gdal};
use crate::raster::error::RasterError;
use crate::raster::read::vertical_unit::to_vertical_unit;

/// Metadata item that names the vertical datum.
pub(in crate::raster) const VERTICAL_DATUM: &str = "VERTICAL_DATUM";
/// Side of a COG's tiles, cells.
const BLOCK: usize = 512;

/// Resampling of overviews.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampling {
    /// Mean of the valid cells, for heights and other quantities.
    #[default]
    Average,
    /// One of the cells, for classes and masks.
    Nearest,
}

/// CRS of a COG.
#[derive(Debug, Clone, Copy)]
pub enum CogCrs<'a> {
    /// By codes.
    Codes(Crs),
    /// Horizontal, as WKT, for maps without a code. Heights are above the ellipsoid.
    Wkt(&'a str),
    /// With heights, as WKT, for maps without a code.
    Compound {
        /// The horizontal and the vertical part.
        wkt: &'a str,
        /// Datum of the heights.
        vertical: VerticalDatum,
    },
}

impl From<Crs> for CogCrs<'_> {
    fn from(crs: Crs) -> Self {
        Self::Codes(crs)
    }
}

impl CogCrs<'_> {
    /// Returns the vertical datum.
    pub(in crate::raster) fn vertical(&self) -> VerticalDatum {
        match self {
            Self::Codes(crs) => crs.vertical,
            Self::Wkt(_) => VerticalDatum::Ellipsoid,
            Self::Compound { vertical, .. } => *vertical,
        }
    }

    /// Returns the definition for GDAL, with the vertical part for heights.
    fn definition(&self, holds_heights: bool) -> String {
        match self {
            Self::Codes(crs) if holds_heights => crs.to_string(),
            Self::Codes(crs) => crs.horizontal_definition(),
            Self::Wkt(wkt) | Self::Compound { wkt, .. } => (*wkt).to_owned(),
        }
    }
}

/// Position, CRS and metadata of a COG.
#[derive(Debug, Clone, Copy)]
pub struct CogPlace<'a> {
    /// Position of the grid.
    pub geotransform: GeoTransform,
    /// Horizontal CRS and vertical datum.
    pub crs: CogCrs<'a>,
    /// Whether the cells are heights. The vertical datum is written for heights only: it would give
    /// counts and shares the unit metre. Heights are given in metres, and written in the unit of
    /// the vertical CRS.
    pub holds_heights: bool,
    /// Images that the raster was made of, where they are known.
    pub provenance: Option<&'a Provenance>,
    /// Further items of the default metadata domain, as key and value.
    pub metadata: &'a [(&'a str, &'a str)],
    /// Number of threads that compress.
    pub threads: usize,
}

/// A COG to write.
#[derive(Debug, Clone, Copy)]
pub struct CogRaster<'a> {
    /// The bands, at least one.
    pub bands: &'a [Band<'a>],
    /// Position of the grid.
    pub geotransform: GeoTransform,
    /// Horizontal CRS and vertical datum.
    pub crs: CogCrs<'a>,
    /// Whether the cells are heights, as in [`CogPlace`].
    pub holds_heights: bool,
    /// Bands that show red, green and blue, counted from 1, where the raster is a colour picture.
    pub colours: Option<[usize; 3]>,
    /// Band, counted from 1, whose cells are 0 where the others have no value.
    pub alpha: Option<usize>,
    /// No-data value, which replaces NaN. `None` declares none, which suits integer bands only.
    pub no_data: Option<f64>,
    /// Resampling of overviews.
    pub overviews: Sampling,
    /// Images that the raster was made of, as in [`CogPlace`].
    pub provenance: Option<&'a Provenance>,
    /// Further items of the default metadata domain, as key and value. GDAL sets `AREA_OR_POINT`.
    pub metadata: &'a [(&'a str, &'a str)],
    /// Number of threads that compress.
    pub threads: usize,
}

impl<'a> CogRaster<'a> {
    /// A raster of heights, or of a vertical datum without meaning (ellipsoid), with the defaults:
    /// no-data −32768 and averaged overviews for float bands, nearest overviews for others, one
    /// thread.
    pub fn new(bands: &'a [Band<'a>], geotransform: GeoTransform, crs: impl Into<CogCrs<'a>>) -> Self {
        let float = Band::first_is_float(bands);
        let no_data = float.then_some(f64::from(NO_DATA));
        let overviews = if float { Sampling::Average } else { Sampling::Nearest };
        Self {
            bands,
            geotransform,
            crs: crs.into(),
            holds_heights: true,
            colours: None,
            alpha: None,
            no_data,
            overviews,
            provenance: None,
            metadata: &[],
            threads: 1,
        }
    }
}

/// Writes a Cloud-Optimised GeoTIFF.
///
/// ```
/// use crs::Crs;
/// use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog};
/// use raster::{GeoTransform, Grid};
///
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("dsm.tif");
/// let heights = Grid::from_vec(2, 1, vec![12.5_f32, f32::NAN]).ok_or("2 x 1 cells")?;
/// let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
/// let place = GeoTransform::north_up(436_000.0, 3_358_000.0, 0.5);
/// write_cog(&path, &CogRaster::new(&bands, place, Crs::ellipsoidal(32617)), false)?;
///
/// let dem = read_dem(&path)?;
/// assert_eq!((dem.heights[(0, 0)], dem.horizontal_epsg), (12.5, Some(32617)));
/// assert!(dem.heights[(1, 0)].is_nan());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// - [`RasterError::NotWritten`] for a file that exists without `overwrite`, and when GDAL or the
///   system refuses.
/// - [`RasterError::InconsistentBands`] when there is no band, or the bands differ in size or type.
/// - [`RasterError::Crs`] for a code that PROJ does not know.
pub fn write_cog(path: impl AsRef<Path>, raster: &CogRaster<'_>, overwrite: bool) -> Result<(), RasterError> {
    let path = path.as_ref();
    if let CogCrs::Codes(crs) = raster.crs {
        crs.wkt().map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    }
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, raster.bands, raster.no_data)?;
        if raster.holds_heights {
            to_vertical_unit(&memory, raster.crs.vertical()).map_err(|reason| RasterError::unwritable(path, reason))?;
        }
        // Overviews leave out what the alpha band marks, so it is named first.
        set_colours(&memory, raster).map_err(|reason| RasterError::unwritable(path, reason))?;
        // The COG driver would build missing overviews in a temporary file.
        let factors = overview_factors(memory.raster_size(), BLOCK);
        with_gdal(|| memory.build_overviews(resampling(raster.overviews), &factors, &[]))
            .map_err(|reason| RasterError::unwritable(path, reason))?;
        let CogRaster { geotransform, crs, holds_heights, provenance, metadata, threads, .. } = *raster;
        let place = CogPlace { geotransform, crs, holds_heights, provenance, metadata, threads };
        finish_cog(&mut memory, place, raster.overviews, made).map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Returns the datum in the metadata item that [`write_cog`] writes.
pub(in crate::raster) fn stated_datum(dataset: &Dataset) -> Option<VerticalDatum> {
    dataset.metadata_item(VERTICAL_DATUM, "")?.parse().ok()
}

/// Names the bands that show red, green, blue and opacity.
fn set_colours(dataset: &Dataset, raster: &CogRaster<'_>) -> Result<(), String> {
    use ColorInterpretation::{AlphaBand, BlueBand, GreenBand, RedBand};
    let colours = raster.colours.into_iter().flat_map(|bands| bands.into_iter().zip([RedBand, GreenBand, BlueBand]));
    let named = colours.chain(raster.alpha.map(|band| (band, AlphaBand)));
    let known = named.filter(|(band, _)| (1..=dataset.raster_count()).contains(band));
    with_gdal(|| {
        known.into_iter().try_for_each(|(band, name)| dataset.rasterband(band)?.set_color_interpretation(name))
    })
}

/// Returns the reduction of each overview: halves, until one tile holds the whole raster.
pub(in crate::raster) fn overview_factors((width, height): (usize, usize), tile: usize) -> Vec<i32> {
    let halvings = width.max(height).div_ceil(tile).next_power_of_two().ilog2();
    (1..=halvings).map(|k| 1 << k).collect()
}

/// Returns GDAL's name of the resampling.
pub(in crate::raster) fn resampling(sampling: Sampling) -> &'static str {
    match sampling {
        Sampling::Average => "AVERAGE",
        Sampling::Nearest => "NEAREST",
    }
}

/// Sets the georeference and metadata of a dataset and copies it into a Cloud-Optimised GeoTIFF at
/// `made`.
pub(in crate::raster) fn finish_cog(
    dataset: &mut Dataset,
    place: CogPlace<'_>,
    overviews: Sampling,
    made: &Path,
) -> Result<(), String> {
    let (threads, block) = (place.threads.max(1).to_string(), BLOCK.to_string());
    let options = [
        ("COMPRESS", "DEFLATE"),
        // The last bits of measured heights are noise: higher levels take several times longer and
        // save about 1 %.
        ("LEVEL", "1"),
        ("PREDICTOR", "YES"),
        ("BLOCKSIZE", block.as_str()),
        ("BIGTIFF", "IF_SAFER"),
        ("OVERVIEW_RESAMPLING", resampling(overviews)),
        ("NUM_THREADS", threads.as_str()),
    ];
    with_gdal(|| {
        let crs = place.crs.definition(place.holds_heights);
        dataset.set_spatial_ref(&SpatialRef::from_definition(&crs)?)?;
        dataset.set_geo_transform(&place.geotransform.0)?;
        if place.holds_heights {
            dataset.set_metadata_item(VERTICAL_DATUM, &place.crs.vertical().to_string(), "")?;
        }
        for (key, value) in place.provenance.map(Provenance::items).unwrap_or_default() {
            dataset.set_metadata_item(key, &value, "")?;
        }
        for (key, value) in place.metadata {
            dataset.set_metadata_item(key, value, "")?;
        }
        Ok(())
    })?;
    label(dataset)?;
    copy(dataset, "COG", made, &options)
}

/// Writes an image with its RPC in TIFF tag 50844 (GDAL's `RPC` metadata): tiled, deflate, no
/// georeference.
///
/// # Errors
/// [`RasterError::NotWritten`] and [`RasterError::InconsistentBands`], as for [`write_cog`].
pub fn write_image_with_rpc(
    path: impl AsRef<Path>,
    bands: &[Band<'_>],
    rpc: &Rpc,
    no_data: Option<f64>,
    overwrite: bool,
) -> Result<(), RasterError> {
    let items = rpc_items(rpc);
    write_in_pixels(path.as_ref(), bands, no_data, ItemsOfDomain { domain: "RPC", items: &items }, false, overwrite)
}

/// Writes a map in the pixels of an image with the RPC of the image, as [`write_image_with_rpc`]
/// does, with units, statistics and the images that it was made of. NaN becomes `no_data`.
///
/// # Errors
/// [`RasterError::NotWritten`] and [`RasterError::InconsistentBands`], as for [`write_cog`].
pub fn write_map_with_rpc(
    path: impl AsRef<Path>,
    bands: &[Band<'_>],
    rpc: &Rpc,
    no_data: Option<f64>,
    provenance: &Provenance,
    overwrite: bool,
) -> Result<(), RasterError> {
    let path = path.as_ref();
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, bands, no_data)?;
        let options = plain_options(bands);
        let (rpc, sources) = (rpc_items(rpc), provenance.items());
        let items = rpc.iter().map(|item| (item, "RPC")).chain(sources.iter().map(|item| (item, "")));
        with_gdal(|| {
            items.into_iter().try_for_each(|((key, value), domain)| memory.set_metadata_item(key, value, domain))
        })
        .and_then(|()| label(&mut memory))
        .and_then(|()| copy(&memory, "GTiff", made, &options))
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Writes a map in the pixels of an image: tiled, deflate, no georeference. NaN becomes `no_data`.
///
/// # Errors
/// [`RasterError::NotWritten`] and [`RasterError::InconsistentBands`], as for [`write_cog`].
pub fn write_map(
    path: impl AsRef<Path>,
    bands: &[Band<'_>],
    no_data: Option<f64>,
    metadata: &[(&str, &str)],
    overwrite: bool,
) -> Result<(), RasterError> {
    write_in_pixels(path.as_ref(), bands, no_data, ItemsOfDomain { domain: "", items: metadata }, true, overwrite)
}

/// Metadata items of one of GDAL's domains.
struct ItemsOfDomain<'a, T> {
    domain: &'a str,
    items: &'a [(&'a str, T)],
}

/// Writes a file in the pixels of an image: tiled, deflate, no georeference. Results are labelled;
/// images are not, because their statistics would be those of a sensor.
fn write_in_pixels<T: AsRef<str>>(
    path: &Path,
    bands: &[Band<'_>],
    no_data: Option<f64>,
    metadata: ItemsOfDomain<'_, T>,
    labelled: bool,
    overwrite: bool,
) -> Result<(), RasterError> {
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, bands, no_data)?;
        let options = plain_options(bands);
        with_gdal(|| {
            for (key, value) in metadata.items {
                memory.set_metadata_item(key, value.as_ref(), metadata.domain)?;
            }
            Ok(())
        })
        .and_then(|()| if labelled { label(&mut memory) } else { Ok(()) })
        .and_then(|()| copy(&memory, "GTiff", made, &options))
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Copies the bands of a dataset in memory with an RPC into a file at `made`.
pub(in crate::raster) fn write_samples_with_rpc(
    memory: &mut Dataset,
    bands: &[Band<'_>],
    rpc: &Rpc,
    made: &Path,
) -> Result<(), String> {
    with_gdal(|| rpc_items(rpc).iter().try_for_each(|(key, value)| memory.set_metadata_item(key, value, "RPC")))?;
    copy(memory, "GTiff", made, &plain_options(bands))
}

/// Options of a tiled file with deflate and the predictor of the sample type.
fn plain_options(bands: &[Band<'_>]) -> [(&'static str, &'static str); 4] {
    let float = Band::first_is_float(bands);
    [("COMPRESS", "DEFLATE"), ("PREDICTOR", if float { "3" } else { "2" }), ("TILED", "YES"), ("BIGTIFF", "IF_SAFER")]
}

/// Returns the RPC under GDAL's keys. Numbers have as many digits as they need to read back to the
/// same bits.
pub(in crate::raster) fn rpc_items(rpc: &Rpc) -> Vec<(&'static str, String)> {
    let list = |c: &[f64; 20]| c.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    vec![
        // −1 means "unknown" to GDAL.
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

/// Copies a dataset into a file, closes it, because GDAL writes the last bytes on closing, and
/// reads it back.
///
/// # Errors
/// The message of GDAL, or the first difference between the file and the dataset.
pub(in crate::raster) fn copy(
    source: &Dataset,
    driver: &str,
    made: &Path,
    options: &[(&str, &str)],
) -> Result<(), String> {
    with_gdal(|| {
        let options = RasterCreationOptions::from_iter(options.iter().map(|(key, value)| format!("{key}={value}")));
        let driver = DriverManager::get_driver_by_name(driver)?;
        source.create_copy(&driver, made, &options)?.close()
    })?;
    let reported = left_over_messages();
    verify(source, made).map_err(|found| if reported.is_empty() { found } else { format!("{found}: {reported}") })
}
