//! Configuration of GDAL, done once before anything is opened.
//!
//! By default GDAL prints errors to stderr and fetches what a file names (a VRT with a `/vsicurl/`
//! source, a WMS description). Here its messages are collected per thread for our errors, and
//! [`super::gdal_access`] leaves it only the drivers and file systems of local files.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use gdal::errors::GdalError;
use gdal::{Dataset, DatasetOptions, DriverManager, GdalOpenFlags, config};

use super::gdal_access::{is_local_file_system, restrict};
use super::named_files::refuse_named_devices;
use super::web_files::{WEB_FILES, with_leave};
use crate::raster::error::RasterError;

/// Beginnings of names that lead to a network or a service.
const REMOTE_SCHEMES: [&str; 8] = ["http", "https", "ftp", "ftps", "s3", "gs", "az", "hdfs"];

/// GDAL's cache of decoded blocks, megabytes; GDAL's default is a share of the machine's memory.
const CACHE_MB: &str = "128";
/// Messages kept per call: the cause, and what came of it. Further ones are other consequences.
const MESSAGES_MAX: usize = 2;

/// TIFFs that the error about a folder names.
const NAMED_TIFFS: usize = 8;

/// GDAL's option for looking at the files beside one that is opened.
const BESIDE: &str = "GDAL_DISABLE_READDIR_ON_OPEN";

/// Whether addresses that the user names may be opened.
static REMOTE_ALLOWED: AtomicBool = AtomicBool::new(false);

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
/// cannot be opened; [`RasterError::Folder`] for a folder that is no raster;
/// [`RasterError::NotAFile`] for a device or a pipe, also one that a VRT names;
/// [`RasterError::NotARaster`] for a file in no format that GDAL may read.
pub(crate) fn open_dataset(path: &Path) -> Result<Dataset, RasterError> {
    tracing::debug!("opens {}", path.display());
    let name = path.to_string_lossy();
    if !is_local_file_system(&name) {
        if let Some(opened) = open_address(path) {
            return opened;
        }
        let unreadable = |source| RasterError::Unreadable { path: path.to_owned(), source };
        let meta = std::fs::metadata(path).map_err(unreadable)?;
        // A folder may be a raster to GDAL (SAFE).
        if meta.is_dir() {
            let folder = |_| RasterError::Folder { path: path.to_owned(), found: tiffs_in(path) };
            return open_name(path, path).map_err(folder);
        }
        if !meta.is_file() {
            return Err(RasterError::NotAFile { path: path.to_owned() });
        }
        std::fs::File::open(path).map_err(unreadable)?;
        refuse_named_devices(path)?;
    }
    open_name(path, path)
}

/// Returns the names of the first TIFFs in a folder, in words.
fn tiffs_in(folder: &Path) -> String {
    let is_tiff = |name: &String| {
        let lower = name.to_ascii_lowercase();
        lower.ends_with(".tif") || lower.ends_with(".tiff")
    };
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).filter(is_tiff).collect();
    names.sort_unstable();
    names.truncate(NAMED_TIFFS);
    if names.is_empty() { "no TIFF".to_owned() } else { names.join(", ") }
}

/// Opens an address; `None` for the name of a local file.
///
/// # Errors
/// [`RasterError::NotLocal`] where addresses are not allowed, and for services other than the web;
/// [`RasterError::NotARaster`].
pub(crate) fn open_address(path: &Path) -> Option<Result<Dataset, RasterError>> {
    let name = path.to_string_lossy();
    if is_local_file_system(&name) || !leads_away(&name) || path.exists() {
        return None;
    }
    Some(match web_address(&name) {
        Some(address) if REMOTE_ALLOWED.load(Ordering::Relaxed) => open_remote(path, address),
        _ => Err(RasterError::NotLocal { path: path.to_owned() }),
    })
}

/// Opens the raster of a name of GDAL's; `path` is the name for errors.
fn open_name(path: &Path, name: &Path) -> Result<Dataset, RasterError> {
    let open_flags =
        GdalOpenFlags::GDAL_OF_RASTER | GdalOpenFlags::GDAL_OF_READONLY | GdalOpenFlags::GDAL_OF_VERBOSE_ERROR;
    with_gdal(|| Dataset::open_ex(name, DatasetOptions { open_flags, ..Default::default() }))
        .map_err(|reason| RasterError::NotARaster { path: path.to_owned(), reason })
}

/// Returns GDAL's names of the formats that can be read or written here.
pub fn raster_formats() -> Vec<String> {
    prepare_gdal();
    (0..DriverManager::count())
        .filter_map(|index| DriverManager::get_driver(index).ok())
        .map(|driver| driver.short_name())
        .collect()
}

/// Lets the readers of rasters open addresses (`https://…`) for the rest of the process. Only the
/// very name that it is given may be fetched, never one inside a file.
pub fn allow_remote() {
    REMOTE_ALLOWED.store(true, Ordering::Relaxed);
}

/// Returns the address of the web that a name means; `None` for other services, which are not read.
fn web_address(name: &str) -> Option<&str> {
    let address = name.strip_prefix(WEB_FILES).unwrap_or(name);
    let lower = address.to_ascii_lowercase();
    (lower.starts_with("http://") || lower.starts_with("https://")).then_some(address)
}

/// Opens an address that the user named: this name alone is allowed on this thread while it is
/// opened, and files beside it are not looked for.
fn open_remote(path: &Path, address: &str) -> Result<Dataset, RasterError> {
    prepare_gdal();
    // Setting and clearing fail only when the text has a NUL.
    let _ = config::set_thread_local_config_option(BESIDE, "EMPTY_DIR");
    let name = format!("{WEB_FILES}{address}");
    let opened = with_leave(address, || open_name(path, Path::new(&name)));
    let _ = config::clear_thread_local_config_option(BESIDE);
    opened
}

/// Whether a name begins with a scheme or with one of GDAL's file systems that are not local.
fn leads_away(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    lower.starts_with("/vsi")
        || lower.split_once(':').is_some_and(|(scheme, rest)| rest.starts_with('/') && REMOTE_SCHEMES.contains(&scheme))
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
    set("GDAL_VRT_ENABLE_PYTHON", "NO");
    if config::get_config_option("GDAL_CACHEMAX", "").is_ok_and(|value| value.is_empty()) {
        set("GDAL_CACHEMAX", CACHE_MB);
    }
    DriverManager::register_all();
    restrict();
}

/// Returns what GDAL reported in the latest call of [`with_gdal`] on this thread, although it
/// returned no error. Empty when there is nothing.
pub(in crate::raster) fn left_over_messages() -> String {
    MESSAGES.with_borrow_mut(std::mem::take).join("; ")
}

/// Returns the message inside an error of the crate `gdal`, without the name of the C function.
fn plain_words(error: &GdalError) -> String {
    match error {
        GdalError::CplError { msg, .. } | GdalError::NullPointer { msg, .. } if !msg.is_empty() => msg.clone(),
        GdalError::NullPointer { .. } => "no driver recognises the content".to_owned(),
        other => other.to_string(),
    }
}
