//! What a raster says about itself: the unit and statistics of its bands, the program, and the
//! images that it was made of.

use std::ffi::CString;

use chrono::{DateTime, NaiveDateTime};
use gdal::raster::RasterBand;
use gdal::{Dataset, Metadata};

use crate::raster::access::gdal_setup::with_gdal;

/// TIFF tag 305, which GDAL shows under this name.
const SOFTWARE: &str = "TIFFTAG_SOFTWARE";
/// Value of [`SOFTWARE`].
const PROGRAM: &str = concat!("skysweep ", env!("CARGO_PKG_VERSION"));
/// Metadata item of GDAL with the share of the cells of a band that are not no-data.
const VALID_PERCENT: &str = "STATISTICS_VALID_PERCENT";
/// Endings of band names and the unit that they stand for, as GDAL and QGIS write it. Longer
/// endings come first.
const UNITS: [(&str, &str); 5] =
    [("_ft_us", "US survey foot"), ("_ft", "ft"), ("_deg", "degree"), ("_px", "pixel"), ("_m", "m")];

/// The images that a raster was made of. The time of writing is not part of it, so that the same
/// input gives the same bytes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Names of the files of the images, without their folders.
    pub sources: Vec<String>,
    /// When they were taken, as [`iso_time`] writes it; images without a time are missing.
    pub acquired: Vec<String>,
}

/// Metadata item with the names of the images, and the separator of all lists.
const SOURCES: &str = "SOURCES";
const ACQUIRED: &str = "ACQUIRED";
const SEPARATOR: &str = ";";
/// Form of [`iso_time`], and that of TIFF's date.
const ISO_FORM: &str = "%Y-%m-%dT%H:%M:%SZ";
const TIFF_FORM: &str = "%Y:%m:%d %H:%M:%S";

impl Provenance {
    /// Returns the items of metadata: `SOURCES`, `ACQUIRED`, and TIFF's date, which is that of the
    /// last image. Lists have semicolons between their parts.
    pub fn items(&self) -> Vec<(&'static str, String)> {
        let mut items = Vec::new();
        // In the order of their names, because the order in which they are given means nothing.
        let mut sources = self.sources.clone();
        sources.sort_unstable();
        if !sources.is_empty() {
            items.push((SOURCES, sources.join(SEPARATOR)));
        }
        let mut times = self.acquired.clone();
        times.sort_unstable();
        times.dedup();
        if let Some(last) = times.last().and_then(|last| NaiveDateTime::parse_from_str(last, ISO_FORM).ok()) {
            items.push((ACQUIRED, times.join(SEPARATOR)));
            items.push(("TIFFTAG_DATETIME", last.format(TIFF_FORM).to_string()));
        }
        items
    }

    /// Returns the images of both, each once.
    pub fn with(&self, other: &Self) -> Self {
        let both = |a: &[String], b: &[String]| {
            let mut all = [a, b].concat();
            all.sort_unstable();
            all.dedup();
            all
        };
        Self { sources: both(&self.sources, &other.sources), acquired: both(&self.acquired, &other.acquired) }
    }

    /// Returns what a file says of the images that it was made of.
    pub(in crate::raster) fn of(dataset: &Dataset) -> Self {
        let list = |name: &str| -> Vec<String> {
            let text = dataset.metadata_item(name, "").unwrap_or_default();
            text.split(SEPARATOR).filter(|part| !part.is_empty()).map(str::to_owned).collect()
        };
        Self { sources: list(SOURCES), acquired: list(ACQUIRED) }
    }
}

/// Returns a time in the form of ISO 8601, such as `2014-10-05T16:01:49Z`; `None` for a year that
/// it cannot express.
pub fn iso_time(seconds_utc: i64) -> Option<String> {
    Some(DateTime::from_timestamp(seconds_utc, 0)?.format(ISO_FORM).to_string())
}

/// Returns the unit that the ending of a band's name stands for.
fn unit_of(description: &str) -> Option<&'static str> {
    UNITS.iter().find(|(ending, _)| description.ends_with(ending)).map(|(_, unit)| *unit)
}

/// Writes the unit and the statistics of each band and the name of the program into the metadata.
/// The statistics are of all cells; a band without a valid cell gets none.
pub(in crate::raster) fn label(dataset: &mut Dataset) -> Result<(), String> {
    with_gdal(|| {
        dataset.set_metadata_item(SOFTWARE, PROGRAM, "")?;
        for index in 1..=dataset.raster_count() {
            let mut band = dataset.rasterband(index)?;
            if let Some(unit) = band.description().ok().as_deref().and_then(unit_of) {
                set_unit(&mut band, unit);
            }
            // GDAL reports an error for a band without valid cells.
            if band.get_statistics(true, false).is_err() {
                band.set_metadata_item(VALID_PERCENT, "0", "")?;
            }
        }
        Ok(())
    })
}

/// Sets the unit of a band. A driver that keeps no units ignores it.
#[allow(unsafe_code)]
fn set_unit(band: &mut RasterBand<'_>, unit: &str) {
    let Ok(unit) = CString::new(unit) else { return };
    // SAFETY: the band belongs to a dataset that is open and borrowed during the call, and the text
    // ends with NUL and is copied by GDAL.
    unsafe { gdal_sys::GDALSetRasterUnitType(band.c_rasterband(), unit.as_ptr()) };
}

#[cfg(test)]
mod tests {
    use crs::Crs;
    use raster::{GeoTransform, Grid};

    use super::*;
    use crate::raster::{Band, BandData, CogRaster, write_cog};

    #[test]
    fn the_ending_of_a_name_is_its_unit() {
        for (name, unit) in [
            ("height_m", Some("m")),
            ("height_ft_us", Some("US survey foot")),
            ("height_ft", Some("ft")),
            ("slope_deg", Some("degree")),
            ("m", None),
            ("class", None),
        ] {
            assert_eq!(unit_of(name), unit, "{name}");
        }
    }

    #[test]
    fn dates_are_sorted_and_in_iso_form() {
        let provenance = Provenance {
            sources: vec!["b.tif".to_owned(), "a.tif".to_owned()],
            acquired: [1_412_524_909, 0, 1_412_524_909].into_iter().filter_map(iso_time).collect(),
        };
        let items = provenance.items();
        assert_eq!(items[0], ("SOURCES", "a.tif;b.tif".to_owned()));
        assert_eq!(items[1], ("ACQUIRED", "1970-01-01T00:00:00Z;2014-10-05T16:01:49Z".to_owned()));
        assert_eq!(items[2], ("TIFFTAG_DATETIME", "2014:10:05 16:01:49".to_owned()));
        assert!(Provenance::default().items().is_empty());
    }

    #[test]
    fn a_raster_says_its_unit_statistics_and_sources() {
        let folder = tempfile::tempdir().unwrap();
        let heights = Grid::from_vec(2, 2, vec![1.0f32, f32::NAN, 2.0, 6.0]).unwrap();
        let void = Grid::filled(2, 2, f32::NAN);
        let bands = [("height_m", &heights), ("confidence_0_to_1", &void)]
            .map(|(description, grid)| Band { description, data: BandData::F32(grid) });
        let provenance =
            Provenance { sources: vec!["a.tif".to_owned()], acquired: iso_time(1_412_524_909).into_iter().collect() };
        let place = GeoTransform::north_up(436_000.0, 3_358_000.0, 0.5);
        let raster =
            CogRaster { provenance: Some(&provenance), ..CogRaster::new(&bands, place, Crs::ellipsoidal(32617)) };
        let path = folder.path().join("dsm.tif");
        write_cog(&path, &raster, false).unwrap();

        let found = Dataset::open(&path).unwrap();
        assert!(found.metadata_item(SOFTWARE, "").unwrap().starts_with("skysweep "));
        assert_eq!(found.metadata_item("TIFFTAG_DATETIME", "").as_deref(), Some("2014:10:05 16:01:49"));
        assert_eq!(Provenance::of(&found), provenance);
        let first = found.rasterband(1).unwrap();
        assert_eq!((first.unit().as_str(), first.description().unwrap().as_str()), ("m", "height_m"));
        for (name, value) in [("MINIMUM", 1.0), ("MAXIMUM", 6.0), ("MEAN", 3.0), ("VALID_PERCENT", 75.0)] {
            let text = first.metadata_item(&format!("STATISTICS_{name}"), "").unwrap();
            assert_eq!(text.parse::<f64>().unwrap(), value, "{name}");
        }
        let second = found.rasterband(2).unwrap();
        assert_eq!((second.unit().as_str(), second.metadata_item(VALID_PERCENT, "").as_deref()), ("", Some("0")));
    }
}
