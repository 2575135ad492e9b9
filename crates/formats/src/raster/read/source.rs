//! An image opened through GDAL, read by windows.
//!
//! An [`ImageSource`] is `Send` but not `Sync`, like GDAL's datasets: each thread needs its own,
//! from [`ImageSource::reopen`].

use std::path::{Path, PathBuf};

use crs::{CrsIdentity, VerticalDatum};
use gdal::raster::{GdalDataType, RasterBand};
use gdal::{Dataset, Metadata};
use raster::{GeoTransform, Grid, Window};

use super::luma_rule::{BandChoice, LumaRule, band_names};
use crate::raster::access::gdal_access::files_of;
use crate::raster::access::gdal_setup::{open_dataset, with_gdal};
use crate::raster::error::RasterError;
use crate::raster::write::geotiff::stated_datum;
use crate::stac::{StacItem, is_item_name, read_item};

/// Type of the stored samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SampleType {
    /// 8 bits, unsigned.
    U8,
    /// 16 bits, unsigned.
    U16,
    /// 16 bits, signed.
    I16,
    /// 32 bits, unsigned.
    U32,
    /// 32 bits, signed.
    I32,
    /// Single precision.
    F32,
    /// Double precision, read as single.
    F64,
}

impl SampleType {
    /// Returns the value of a saturated detector with `bits` significant bits; `None` for samples
    /// that are not counts.
    pub(crate) fn maximum(self, bits: Option<u32>) -> Option<f32> {
        let full = match self {
            Self::U8 => 8,
            Self::U16 => 16,
            Self::I16 => 15,
            // 32-bit samples hold computed values, not counts of a detector.
            Self::U32 | Self::I32 | Self::F32 | Self::F64 => return None,
        };
        let used = bits.filter(|&b| b > 0 && b < full).unwrap_or(full);
        Some(((1_u32 << used) - 1) as f32)
    }
}

/// Properties of an image that are known without reading pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageInfo {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Number of bands, alpha included.
    pub bands: usize,
    /// Sample type of the first band.
    pub sample: SampleType,
    /// Significant bits per sample, if declared (11 for most satellite images).
    pub bits: Option<u32>,
    /// GDAL's name for the format.
    pub driver: String,
    /// CRS as WKT, if the file has one.
    pub crs_wkt: Option<String>,
    /// Affine georeference, if the file has one.
    pub geotransform: Option<GeoTransform>,
    /// No-data value of the first band, if declared.
    pub no_data: Option<f64>,
    /// The bands that make the luma.
    pub luma: LumaRule,
}

/// An open image.
pub struct ImageSource {
    path: PathBuf,
    dataset: Dataset,
    /// What `dataset` reads from, where it is laid into another system. It is dropped after it.
    base: Option<Dataset>,
    info: ImageInfo,
    item: Option<StacItem>,
}

impl ImageSource {
    /// Opens a local raster of any format that GDAL reads, or the one that a STAC item names.
    ///
    /// # Errors
    /// [`RasterError::Item`]; [`RasterError::Unreadable`]; [`RasterError::NotLocal`];
    /// [`RasterError::NotARaster`]; [`RasterError::Unsupported`] for a raster without bands and for
    /// complex or 64-bit integer samples.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RasterError> {
        let path = path.as_ref().to_owned();
        let item = item_at(&path)?;
        let dataset = open_dataset(item.as_ref().map_or(&path, |item| &item.image))?;
        let info = describe(&path, &dataset)?;
        Ok(Self { path, dataset, base: None, info, item })
    }

    /// Returns the same file read through another dataset, which rests on that of `self`.
    pub(super) fn in_place_of(self, laid: Dataset) -> Result<Self, RasterError> {
        let info = describe(&self.path, &laid)?;
        let Self { path, dataset, base, item, .. } = self;
        // One dataset is laid once: what `self` itself rests on would have to be kept as well.
        debug_assert!(base.is_none());
        Ok(Self { path, dataset: laid, base: Some(dataset), info, item })
    }

    /// Returns the image with one band as its luma and as its colour.
    ///
    /// # Errors
    /// [`RasterError::NoBand`] with the bands that the image has.
    pub fn with_band(mut self, choice: &BandChoice) -> Result<Self, RasterError> {
        let names = band_names(&self.dataset);
        let Some(position) = choice.position(&names) else {
            return Err(RasterError::no_band(&self.path, choice, &names));
        };
        self.info.luma = LumaRule::Single(position);
        Ok(self)
    }

    /// Opens the same file again, for another thread, with the luma of the file.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn reopen(&self) -> Result<Self, RasterError> {
        Self::open(&self.path)
    }

    /// The file, or the STAC item that names it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the STAC item says that names the image; `None` for an image that is given itself.
    pub fn item(&self) -> Option<&StacItem> {
        self.item.as_ref()
    }

    /// Returns the files that the image consists of: its own, those beside it, and those that a
    /// virtual raster or a STAC item names.
    pub fn files(&self) -> Vec<PathBuf> {
        let named = self.item.iter().flat_map(|item| [Some(self.path.clone()), item.rpc.clone()]).flatten();
        files_of(&self.dataset).into_iter().map(PathBuf::from).chain(named).collect()
    }

    /// Size, sample type, georeference.
    pub fn info(&self) -> &ImageInfo {
        &self.info
    }

    /// The window of the whole image.
    pub fn window(&self) -> Window {
        Window::whole(self.info.width, self.info.height)
    }

    /// Returns the metadata of a GDAL domain (`""`, `"RPC"`, `"IMD"`, …) as keys and values.
    pub fn metadata(&self, domain: &str) -> Vec<(String, String)> {
        let items = self.dataset.metadata_domain(domain).unwrap_or_default();
        items.iter().filter_map(|item| item.split_once('=')).map(|(k, v)| (k.to_owned(), v.to_owned())).collect()
    }

    /// Returns the unit of a band, counted from 1, as the file names it (`m`, `US survey foot`);
    /// `None` when it names none.
    pub fn unit(&self, band: usize) -> Option<String> {
        let unit = with_gdal(|| Ok(self.dataset.rasterband(band)?.unit())).ok()?;
        Some(unit.trim().to_owned()).filter(|unit| !unit.is_empty())
    }

    /// Returns the vertical datum that the file states, in its CRS or in the metadata item that
    /// [`crate::raster::write_cog`] writes; `None` when it states none.
    pub fn vertical(&self) -> Option<VerticalDatum> {
        let identity = self.info.crs_wkt.as_deref().and_then(|wkt| CrsIdentity::of(wkt).ok());
        identity.and_then(|identity| identity.vertical).or_else(|| stated_datum(&self.dataset))
    }

    /// Reads one band, counted from 1, over a window, in the stored values. NaN marks no-data and
    /// the outside of the image.
    ///
    /// # Errors
    /// [`RasterError::Unsupported`] for a band that the image does not have;
    /// [`RasterError::Damaged`] when GDAL cannot decode the pixels.
    pub fn read_samples(&self, band: usize, window: Window) -> Result<Grid<f32>, RasterError> {
        if !(1..=self.info.bands).contains(&band) {
            let found = format!("band {band} of {}", self.info.bands);
            return Err(RasterError::Unsupported {
                path: self.path.clone(),
                found,
                expected: "a band of the image, counted from 1",
            });
        }
        let Some(inside) = self.window().intersection(&window) else {
            return Ok(Grid::filled(window.width, window.height, f32::NAN));
        };
        let mut samples = self.read_band(band, inside)?;
        if let Some(mask) = self.read_mask(band, inside)? {
            samples.void_where(|i| mask.data()[i] == 0);
        }
        let (x, y) = (window.x - inside.x, window.y - inside.y);
        Ok(samples.window(Window { x, y, ..window }, f32::NAN))
    }

    /// The open dataset.
    pub(in crate::raster) fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    /// Reads the stored values of one band, counted from 1, over a window inside the image.
    pub(crate) fn read_band(&self, band: usize, inside: Window) -> Result<Grid<f32>, RasterError> {
        read_as(&self.path, &self.dataset, band, inside)
    }

    /// Reads GDAL's mask of a band, counted from 1, over a window inside the image: 0 is no-data.
    /// `None` when all is data.
    pub(crate) fn read_mask(&self, band: usize, inside: Window) -> Result<Option<Grid<u8>>, RasterError> {
        let fails = |reason: String| RasterError::damaged(&self.path, reason);
        let flags = with_gdal(|| self.dataset.rasterband(band)?.mask_flags()).map_err(fails)?;
        if flags.is_all_valid() {
            return Ok(None);
        }
        let buffer =
            with_gdal(|| read_buffer(&self.dataset.rasterband(band)?.open_mask_band()?, inside)).map_err(fails)?;
        grid_of(&self.path, inside, buffer).map(Some)
    }
}

/// Reads one band, counted from 1, over a window inside a dataset.
pub(in crate::raster) fn read_as<T: Copy + gdal::raster::GdalType>(
    path: &Path,
    dataset: &Dataset,
    band: usize,
    inside: Window,
) -> Result<Grid<T>, RasterError> {
    let buffer = with_gdal(|| read_buffer(&dataset.rasterband(band)?, inside))
        .map_err(|reason| RasterError::damaged(path, reason))?;
    grid_of(path, inside, buffer)
}

fn read_buffer<T: Copy + gdal::raster::GdalType>(
    band: &RasterBand<'_>,
    inside: Window,
) -> Result<Vec<T>, gdal::errors::GdalError> {
    let size = (inside.width, inside.height);
    let buffer = band.read_as::<T>((inside.x as isize, inside.y as isize), size, size, None)?;
    Ok(buffer.into_shape_and_vec().1)
}

fn grid_of<T>(path: &Path, inside: Window, data: Vec<T>) -> Result<Grid<T>, RasterError> {
    Grid::from_vec(inside.width, inside.height, data)
        .ok_or_else(|| RasterError::damaged(path, "GDAL returned another number of pixels than requested"))
}

/// Reads the item at a path; `None` where the name is not that of one.
fn item_at(path: &Path) -> Result<Option<StacItem>, RasterError> {
    let read = is_item_name(path).then(|| read_item(path)).transpose();
    read.map_err(|source| RasterError::Item { path: path.to_owned(), source: source.into() })
}

fn describe(path: &Path, dataset: &Dataset) -> Result<ImageInfo, RasterError> {
    let unsupported = |found: String, expected| RasterError::Unsupported { path: path.to_owned(), found, expected };
    let (width, height) = dataset.raster_size();
    let bands = dataset.raster_count();
    if bands == 0 || width == 0 || height == 0 {
        return Err(unsupported(
            format!("{width} x {height} pixels in {bands} bands"),
            "at least one band with pixels",
        ));
    }
    let first = with_gdal(|| dataset.rasterband(1)).map_err(|reason| RasterError::damaged(path, reason))?;
    let sample = sample_type(first.band_type()).ok_or_else(|| {
        unsupported("complex or 64-bit integer samples".to_owned(), "8 to 32-bit integer or float samples")
    })?;
    let geotransform = with_gdal(|| dataset.geo_transform()).ok().map(GeoTransform);
    let crs_wkt = Some(dataset.projection()).filter(|wkt| !wkt.is_empty());
    let bits = first.metadata_item("NBITS", "IMAGE_STRUCTURE").and_then(|text| text.trim().parse().ok());
    let info = ImageInfo {
        width,
        height,
        bands,
        sample,
        bits,
        driver: dataset.driver().short_name(),
        crs_wkt,
        geotransform,
        no_data: first.no_data_value(),
        luma: LumaRule::of(dataset),
    };
    Ok(info)
}

fn sample_type(gdal: GdalDataType) -> Option<SampleType> {
    Some(match gdal {
        GdalDataType::UInt8 => SampleType::U8,
        GdalDataType::UInt16 => SampleType::U16,
        GdalDataType::Int16 => SampleType::I16,
        GdalDataType::UInt32 => SampleType::U32,
        GdalDataType::Int32 => SampleType::I32,
        GdalDataType::Float32 => SampleType::F32,
        GdalDataType::Float64 => SampleType::F64,
        _ => return None,
    })
}
