//! Bands by their part of the spectrum: which bands of an image are red and near infrared, and
//! images whose bands say what they are.
//!
//! A band is known, in this order, by
//!
//! 1. its name: the description, or GDAL's colour interpretation (near infrared from GDAL 3.10 on);
//! 2. its wavelength: GDAL's item `CENTRAL_WAVELENGTH_UM` of the domain `IMAGERY`, or the items
//!    `wavelength` and `wavelength_units` that GDAL makes of ENVI headers. GeoTIFFs of GDAL before
//!    3.10 cannot hold the former, so both are written;
//! 3. its place in the `IMD` metadata of a Maxar product, whose groups `BAND_B`, `BAND_G`, … stand
//!    in the order of the bands.
//!
//! Nothing is guessed from the number of bands: products in the order blue, green, red and in the
//! order red, green, blue are both common.

use std::ffi::CString;
use std::path::Path;

use camera::Rpc;
use gdal::raster::RasterBand;
use gdal::{Dataset, Metadata};

use super::luma_rule::{BandChoice, band_names};
use super::source::ImageSource;
use crate::atomic::write_path;
use crate::raster::access::gdal_setup::with_gdal;
use crate::raster::error::RasterError;
use crate::raster::write::band::{Band, in_memory};
use crate::raster::write::geotiff::write_samples_with_rpc;

/// Domain and items of GDAL for wavelengths, in micrometres.
const IMAGERY: &str = "IMAGERY";
const CENTRE: &str = "CENTRAL_WAVELENGTH_UM";
const WIDTH: &str = "FWHM_UM";
/// Items of GDAL for the wavelengths of ENVI headers.
const WAVELENGTH: &str = "wavelength";
const WAVELENGTH_UNITS: &str = "wavelength_units";
/// Wavelengths of red and of near infrared, micrometres: from one edge of the band of a usual
/// instrument to the other.
const RED_UM: [f64; 2] = [0.62, 0.69];
const NIR_UM: [f64; 2] = [0.76, 0.90];
/// Names of the bands in capitals, without blanks and signs.
const RED_NAMES: [&str; 3] = ["RED", "R", "REDBAND"];
const NIR_NAMES: [&str; 8] = ["NIR", "NIR1", "N", "NEARINFRARED", "NEARIR", "NEARINFRARED1", "NIRBAND", "INFRARED"];
/// Groups of the IMD metadata.
const RED_GROUP: &str = "BAND_R";
const NIR_GROUP: &str = "BAND_N";

/// What a band of an image to write says of itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandSpectrum<'a> {
    /// GDAL's name of the colour. A name that the installed GDAL does not know is left out.
    pub colour: &'a str,
    /// Wavelength at the centre of the band, micrometres.
    pub centre_um: f64,
    /// Width of the band at half of its maximum, micrometres.
    pub width_um: f64,
}

/// The bands of a vegetation index, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IndexBands {
    /// Red.
    pub red: usize,
    /// Near infrared.
    pub nir: usize,
}

impl ImageSource {
    /// Returns the red and the near-infrared band: those that are asked for, and otherwise those
    /// that the file names. `None` where one of them is not known, or both are the same.
    ///
    /// # Errors
    /// [`RasterError::NoBand`] for a band that is asked for and not there.
    pub fn index_bands(
        &self,
        red: Option<&BandChoice>,
        nir: Option<&BandChoice>,
    ) -> Result<Option<IndexBands>, RasterError> {
        let names = band_names(self.dataset());
        let asked = |choice: &BandChoice| {
            choice.position(&names).ok_or_else(|| RasterError::no_band(self.path(), choice, &names))
        };
        let found = |names_of: &[&str], wavelengths_um: [f64; 2], group: &str| {
            by_name(&names, names_of)
                .or_else(|| by_wavelength(self.dataset(), wavelengths_um))
                .or_else(|| self.by_group(group, names.len()))
        };
        let red = red.map(asked).transpose()?.or_else(|| found(&RED_NAMES, RED_UM, RED_GROUP));
        let nir = nir.map(asked).transpose()?.or_else(|| found(&NIR_NAMES, NIR_UM, NIR_GROUP));
        let bands = red.zip(nir).map(|(red, nir)| IndexBands { red, nir });
        Ok(bands.filter(|bands| bands.red != bands.nir))
    }

    /// Returns the place of a group among the groups of bands of the IMD metadata, if there are as
    /// many as bands.
    fn by_group(&self, group: &str, bands: usize) -> Option<usize> {
        let mut groups: Vec<String> = Vec::new();
        for (key, _) in self.metadata("IMD") {
            let name = key.split('.').next().unwrap_or_default();
            if name.starts_with("BAND_") && key.contains('.') && groups.last().is_none_or(|last| last != name) {
                groups.push(name.to_owned());
            }
        }
        let place = groups.iter().position(|name| name == group)?;
        (groups.len() == bands).then_some(place + 1)
    }
}

/// Returns the only band with one of some names.
fn by_name(bands: &[Vec<String>], names: &[&str]) -> Option<usize> {
    let plain = |name: &String| -> String {
        name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect()
    };
    let is_named = |own: &Vec<String>| own.iter().any(|name| names.contains(&plain(name).as_str()));
    let mut found = (1..).zip(bands).filter(|(_, own)| is_named(own)).map(|(number, _)| number);
    found.next().filter(|_| found.next().is_none())
}

/// Returns the first band whose centre lies between two wavelengths.
fn by_wavelength(dataset: &Dataset, [low, high]: [f64; 2]) -> Option<usize> {
    let centre_um = |number: usize| centre_um(&dataset.rasterband(number).ok()?);
    (1..=dataset.raster_count()).find(|number| centre_um(*number).is_some_and(|um| (low..=high).contains(&um)))
}

/// Returns the wavelength at the centre of a band, micrometres.
fn centre_um(band: &RasterBand<'_>) -> Option<f64> {
    let number = |text: String| text.trim().parse::<f64>().ok();
    if let Some(um) = band.metadata_item(CENTRE, IMAGERY).and_then(number) {
        return Some(um);
    }
    let per_um = match band.metadata_item(WAVELENGTH_UNITS, "")?.to_ascii_lowercase().as_str() {
        "micrometers" | "um" => 1.0,
        "nanometers" | "nm" => 1000.0,
        _ => return None,
    };
    Some(number(band.metadata_item(WAVELENGTH, "")?)? / per_um)
}

/// Writes an image with its RPC, as [`crate::raster::write_image_with_rpc`] does, whose bands name
/// their colours and wavelengths.
///
/// # Errors
/// [`RasterError::NotWritten`] and [`RasterError::InconsistentBands`], as for
/// [`crate::raster::write_cog`].
pub fn write_multispectral_with_rpc(
    path: impl AsRef<Path>,
    bands: &[(Band<'_>, BandSpectrum<'_>)],
    rpc: &Rpc,
    no_data: Option<f64>,
    overwrite: bool,
) -> Result<(), RasterError> {
    let path = path.as_ref();
    let plain: Vec<Band<'_>> = bands.iter().map(|(band, _)| *band).collect();
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, &plain, no_data)?;
        with_gdal(|| {
            for (number, (_, spectrum)) in (1..).zip(bands) {
                let mut band = memory.rasterband(number)?;
                set_colour(&mut band, spectrum.colour);
                let centre_um = spectrum.centre_um.to_string();
                band.set_metadata_item(CENTRE, &centre_um, IMAGERY)?;
                band.set_metadata_item(WIDTH, &spectrum.width_um.to_string(), IMAGERY)?;
                band.set_metadata_item(WAVELENGTH, &centre_um, "")?;
                band.set_metadata_item(WAVELENGTH_UNITS, "Micrometers", "")?;
            }
            Ok(())
        })
        .and_then(|()| write_samples_with_rpc(&mut memory, &plain, rpc, made))
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}

/// Names the colour of a band, if GDAL knows it.
#[allow(unsafe_code)]
fn set_colour(band: &mut RasterBand<'_>, name: &str) {
    let Ok(name) = CString::new(name) else { return };
    // SAFETY: the text ends with NUL and is only read.
    let colour = unsafe { gdal_sys::GDALGetColorInterpretationByName(name.as_ptr()) };
    if colour != gdal_sys::GDALColorInterp::GCI_Undefined {
        // SAFETY: the band belongs to a dataset that is open and borrowed during the call, and the
        // colour is one of GDAL's.
        unsafe { gdal_sys::GDALSetRasterColorInterpretation(band.c_rasterband(), colour) };
    }
}

#[cfg(test)]
mod tests {
    use raster::Grid;

    use super::*;
    use crate::raster::{BandData, LumaRule};

    fn rpc() -> Rpc {
        let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/view_1.tif");
        crate::rpc::read_for_image(Path::new(town)).unwrap().rpc
    }

    fn written(folder: &Path, names: [&str; 4], colours: [&str; 4], centres_um: [f64; 4]) -> ImageSource {
        let grids: Vec<Grid<u16>> = (1..5).map(|k| Grid::filled(3, 2, k)).collect();
        let band = |k: usize| {
            let spectrum = BandSpectrum { colour: colours[k], centre_um: centres_um[k], width_um: 0.06 };
            (Band { description: names[k], data: BandData::U16(&grids[k]) }, spectrum)
        };
        let path = folder.join("ms.tif");
        write_multispectral_with_rpc(&path, &[0, 1, 2, 3].map(band), &rpc(), Some(0.0), true).unwrap();
        ImageSource::open(&path).unwrap()
    }

    #[test]
    fn bands_are_known_by_name_colour_wavelength_or_choice() {
        let folder = tempfile::tempdir().unwrap();
        let (none, colours) = (["", "", "", ""], ["Blue", "Green", "Red", "NIR"]);
        let bands = |source: &ImageSource| source.index_bands(None, None).unwrap();
        let expected = Some(IndexBands { red: 3, nir: 4 });
        let named = written(folder.path(), ["blue", "green", "red", "Near infrared"], none, [0.0; 4]);
        assert_eq!(bands(&named), expected);
        let coloured = written(folder.path(), ["a", "b", "c", "nir"], colours, [0.0; 4]);
        assert_eq!((bands(&coloured), &coloured.info().luma), (expected, &LumaRule::Rgb([3, 2, 1])));
        assert_eq!(crate::rpc::read_for_image(coloured.path()).unwrap().rpc.line_num, rpc().line_num);
        let waves = written(folder.path(), none, none, [0.48, 0.55, 0.66, 0.83]);
        assert_eq!(bands(&waves), expected);
        let dark = written(folder.path(), none, none, [0.0; 4]);
        assert_eq!(bands(&dark), None);
        let (one, four) = (BandChoice::Number(1), BandChoice::Number(4));
        assert_eq!(dark.index_bands(Some(&one), Some(&four)).unwrap(), Some(IndexBands { red: 1, nir: 4 }));
        assert_eq!(dark.index_bands(Some(&four), Some(&four)).unwrap(), None);
        let error = dark.index_bands(Some(&BandChoice::Number(9)), None).unwrap_err();
        assert!(error.to_string().contains("no band 9"), "{error}");
    }
}
