//! Configuration of GDAL, done once before anything is opened.
//!
//! By default GDAL prints errors to stderr and fetches what a file names (a VRT with a `/vsicurl/`
//! source, a WMS description). Here its messages are collected per thread for our errors, the
//! drivers that use a network are removed, and the virtual network file systems refuse every file
//! name.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Once;

use gdal::errors::GdalError;
use gdal::{Dataset, DatasetOptions, DriverManager, GdalOpenFlags, config};

use super::error::RasterError;

/// Drivers that reach a network or a database through a description or a connection string. NetCDF
/// is among them: a VRT may name `NETCDF:"http://…"`, which the NetCDF library fetches.
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

/// Prefixes of names that lead to a network.
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

/// GDAL's cache of decoded blocks, megabytes; GDAL's default is a share of the machine's memory.
const CACHE_MB: &str = "128";
/// Messages kept per call; further ones only repeat the cause.
const MESSAGES_MAX: usize = 8;

static READY: Once = Once::new();

thread_local! {
    static MESSAGES: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Makes GDAL quiet and local. Every use of GDAL in this crate must come after; repeated calls are
/// cheap.
///
/// The error handler is set once for the life of the process, because replacing it would free the
/// old one while another thread may be running it.
pub(crate) fn prepare_gdal() {
    READY.call_once(prepare);
}

/// Runs `call`, which calls GDAL. The error has GDAL's messages.
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
/// [`RasterError::NotLocal`] for a name on a network; [`RasterError::Unreadable`] for a file that
/// cannot be opened; [`RasterError::NotARaster`] for a file in no format that GDAL reads.
pub(crate) fn open_dataset(path: &Path) -> Result<Dataset, RasterError> {
    let name = path.to_string_lossy();
    let inner = name.rsplit("/vsi").next().map(|tail| format!("/vsi{tail}")).unwrap_or_default();
    let leads_away = |text: &str| NETWORK_PREFIXES.iter().any(|prefix| starts_as_scheme(text, prefix));
    if leads_away(&name) || (name.contains("/vsi") && leads_away(&inner)) {
        return Err(RasterError::NotLocal { path: path.to_owned() });
    }
    if !name.starts_with("/vsi") {
        let readable = std::fs::metadata(path).and_then(|meta| {
            // A folder may be a raster to GDAL (SAFE, Zarr).
            if meta.is_dir() { Ok(()) } else { std::fs::File::open(path).map(drop) }
        });
        readable.map_err(|source| RasterError::Unreadable { path: path.to_owned(), source })?;
    }
    let open_flags =
        GdalOpenFlags::GDAL_OF_RASTER | GdalOpenFlags::GDAL_OF_READONLY | GdalOpenFlags::GDAL_OF_VERBOSE_ERROR;
    with_gdal(|| Dataset::open_ex(path, DatasetOptions { open_flags, ..Default::default() }))
        .map_err(|reason| RasterError::NotARaster { path: path.to_owned(), reason })
}

/// Whether `text` starts with `prefix` as a scheme: `http:` and `/vsis3/` do, a local folder named
/// `httpdata` does not.
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
    // Setting an option fails only when the text has a NUL, which these constants have not.
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

/// Returns the message inside an error of the crate `gdal`, without the name of the C function.
fn plain_words(error: &GdalError) -> String {
    match error {
        GdalError::CplError { msg, .. } | GdalError::NullPointer { msg, .. } if !msg.is_empty() => msg.clone(),
        GdalError::NullPointer { .. } => "no driver recognises the content".to_owned(),
        other => other.to_string(),
    }
}
