//! The colour of a band, as GDAL knows it, which is more than its binding does.

use std::ffi::CStr;

use gdal::raster::{ColorInterpretation, RasterBand};

/// Returns GDAL's number of the colour of a band.
#[allow(unsafe_code)]
fn colour_number(band: &RasterBand<'_>) -> gdal_sys::GDALColorInterp::Type {
    // SAFETY: the band belongs to a dataset that is open and borrowed during the call.
    unsafe { gdal_sys::GDALGetRasterColorInterpretation(band.c_rasterband()) }
}

/// Returns the colour of a band. Colours that the binding does not have are undefined: its own
/// function panics on them.
pub(in crate::raster) fn colour_of(band: &RasterBand<'_>) -> ColorInterpretation {
    ColorInterpretation::from_c_int(colour_number(band)).unwrap_or(ColorInterpretation::Undefined)
}

/// Returns GDAL's name of the colour of a band; `None` for an undefined one. Colours that GDAL has
/// and its binding does not, such as near infrared, have names, too.
#[allow(unsafe_code)]
pub(in crate::raster) fn colour_name(band: &RasterBand<'_>) -> Option<String> {
    let colour = colour_number(band);
    if colour == gdal_sys::GDALColorInterp::GCI_Undefined {
        return None;
    }
    // SAFETY: the function takes any number and returns a constant text that ends with NUL, or
    // null.
    let name = unsafe { gdal_sys::GDALGetColorInterpretationName(colour) };
    if name.is_null() {
        return None;
    }
    // SAFETY: the pointer is not null, and points to a constant text that ends with NUL.
    let name = unsafe { CStr::from_ptr(name) };
    Some(name.to_string_lossy().into_owned())
}
