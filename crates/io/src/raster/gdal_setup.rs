//! One place that tells GDAL how to behave, before anything is opened.
//!
//! GDAL prints errors to stderr and can fetch what a file names (a VRT with a `/vsicurl/` source, a WMS description).
//! Here its messages are collected per thread for our errors, the drivers that speak to networks are taken out, and
//! the virtual network file systems accept no file name.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Once;

use gdal::errors::GdalError;
use gdal::{Dataset, DatasetOptions, DriverManager, GdalOpenFlags, config};

use super::RasterError;

/// Drivers that reach a network or a data base from a description or a connection string. NetCDF is among them: a VRT may
/// name `NETCDF:"http://…"`, which its library fetches by itself.
const NETWORK_DRIVERS: [&str; 31] = [
    "WMS",
    "WMTS",
    "WCS",
    "HTTP",
    "PLMOSAIC",
    "PLSCENES",
    "NGW",
    "DAAS",
    "EEDA",
    "EEDAI",
    "RDA",
    "OGCAPI",
    "STACIT",
    "STACTA",
    "WFS",
    "OAPIF",
    "CSW",
    "Carto",
    "Elastic",
    "AmigoCloud",
    "GMLAS",
    "CouchDB",
    "PostGISRaster",
    "PostgreSQL",
    "MySQL",
    "MongoDBv3",
    "GeoRaster",
    "netCDF",
    "DODS",
    "ECW",
    "JPIPKAK",
];

/// Beginnings of names that lead off this machine.
const NETWORK_PREFIXES: [&str; 11] = [
    "/vsicurl",
    "/vsis3",
    "/vsigs",
    "/vsiaz",
    "/vsiadls",
    "/vsioss",
    "/vsiswift",
    "/vsihdfs",
    "/vsiwebhdfs",
    "http",
    "ftp",
];

/// Megabytes of decoded blocks that GDAL keeps; its own default is a share of the machine's memory.
const CACHE_MB: &str = "128";
/// More messages than this about one call say nothing new.
const MESSAGES_MAX: usize = 8;

static READY: Once = Once::new();

thread_local! {
    static MESSAGES: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Makes GDAL quiet and local; every other use of GDAL in this crate comes after. Cheap when done already.
///
/// The handler is set once for the life of the process: replacing it would free the old one while another thread may be
/// inside it.
pub(crate) fn prepare_gdal() {
    READY.call_once(prepare);
}

/// Runs something that calls GDAL, and turns a failure into GDAL's own words.
pub(crate) fn with_gdal<T>(call: impl FnOnce() -> Result<T, GdalError>) -> Result<T, String> {
    prepare_gdal();
    MESSAGES.with_borrow_mut(Vec::clear);
    call().map_err(|error| {
        let messages = MESSAGES.with_borrow_mut(std::mem::take);
        if messages.is_empty() { plain_words(&error) } else { messages.join("; ") }
    })
}

/// Opens a local raster for reading.
///
/// # Errors
/// [`RasterError::NotLocal`], [`RasterError::Unreadable`], [`RasterError::NotARaster`].
pub(crate) fn open_dataset(path: &Path) -> Result<Dataset, RasterError> {
    let name = path.to_string_lossy();
    let inner = name.rsplit("/vsi").next().map(|tail| format!("/vsi{tail}")).unwrap_or_default();
    let leads_away = |text: &str| NETWORK_PREFIXES.iter().any(|prefix| starts_as_scheme(text, prefix));
    if leads_away(&name) || (name.contains("/vsi") && leads_away(&inner)) {
        return Err(RasterError::NotLocal { path: path.to_owned() });
    }
    if !name.starts_with("/vsi") {
        let readable = std::fs::metadata(path).and_then(|meta| {
            // A folder may be a raster to GDAL (SAFE, Zarr); a file must open.
            if meta.is_dir() { Ok(()) } else { std::fs::File::open(path).map(drop) }
        });
        readable.map_err(|source| RasterError::Unreadable { path: path.to_owned(), source })?;
    }
    let open_flags =
        GdalOpenFlags::GDAL_OF_RASTER | GdalOpenFlags::GDAL_OF_READONLY | GdalOpenFlags::GDAL_OF_VERBOSE_ERROR;
    with_gdal(|| Dataset::open_ex(path, DatasetOptions { open_flags, ..Default::default() }))
        .map_err(|reason| RasterError::NotARaster { path: path.to_owned(), reason })
}

/// `http:` and `/vsis3/` count, a local folder named `httpdata` does not.
fn starts_as_scheme(text: &str, prefix: &str) -> bool {
    let lower = text.get(..text.len().min(32)).unwrap_or_default().to_ascii_lowercase();
    lower.strip_prefix(prefix).is_some_and(|rest| {
        prefix.starts_with('/') || rest.starts_with("://") || rest.starts_with("s://") || rest.starts_with(':')
    })
}

fn prepare() {
    config::set_error_handler(|_, _, message| {
        tracing::debug!(target: "gdal", "{message}");
        MESSAGES.with_borrow_mut(|messages| {
            if messages.len() < MESSAGES_MAX && messages.last().is_none_or(|last| last != message) {
                messages.push(message.trim().to_owned());
            }
        });
    });
    // A failure to set an option is one of text conversion and cannot happen with these constants.
    let set = |key, value| drop(config::set_config_option(key, value));
    set("CPL_VSIL_CURL_ALLOWED_FILENAME", "/vsicurl/nothing");
    set("GDAL_VRT_ENABLE_PYTHON", "NO");
    if config::get_config_option("GDAL_CACHEMAX", "").is_ok_and(|value| value.is_empty()) {
        set("GDAL_CACHEMAX", CACHE_MB);
    }
    DriverManager::register_all();
    for name in NETWORK_DRIVERS {
        if let Ok(driver) = DriverManager::get_driver_by_name(name) {
            DriverManager::deregister_driver(&driver);
        }
    }
}

/// The message inside the crate's error, without the name of the C function.
fn plain_words(error: &GdalError) -> String {
    match error {
        GdalError::CplError { msg, .. } | GdalError::NullPointer { msg, .. } if !msg.is_empty() => msg.clone(),
        GdalError::NullPointer { .. } => "no driver recognises the content".to_owned(),
        other => other.to_string(),
    }
}
