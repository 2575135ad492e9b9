//! What GDAL may open: a list of drivers and of file systems, and nothing else.
//!
//! A raster can name other files: a VRT its sources, an `.aux.xml` its overviews. GDAL opens such a
//! name with any of its drivers and file systems, which fetch from networks, run programs and read
//! raw memory (`MEM:::DATAPOINTER=…`). So everything that is not listed here is removed from GDAL
//! before the first file is opened: a name that needs it leads nowhere, at any depth. Drivers and
//! file systems of later versions of GDAL are refused until they are listed.

#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::null_mut;
use std::sync::{Once, OnceLock};

use gdal::errors::GdalError;
use gdal::{Driver, DriverManager};

use super::web_files;

/// Drivers that read local raster files, and the writers of this crate.
const DRIVERS: &str = "VRT GTiff COG PNG JPEG JPEGXL WEBP BMP GIF BIGGIF JP2OpenJPEG JP2KAK JP2MrSID JPEG2000 NITF \
    RPFTOC HFA ENVI EHdr EIR ERS PCIDSK PAux MFF GenBin AAIGrid GRASSASCIIGrid AIG ISG XYZ \
    SRTMHGT DTED USGSDEM GTX BT GSAG GSBG GS7BG NWT_GRD NWT_GRC RST SAGA RRASTER Terragen \
    Leveller SIGDEM GXF SNODAS DIMAP SAFE SENTINEL2 TIL TSX RS2 RCM COSAR SAR_CEOS CEOS \
    JAXAPALSAR AirSAR FAST L1B ROI_PAC ISCE LAN CPG PDS PDS4 ISIS2 ISIS3 VICAR HDF5Image";

/// File systems of local files: plain memory, archives and parts of files.
const FILE_SYSTEMS: [&str; 6] = ["/vsimem/", "/vsizip/", "/vsitar/", "/vsigzip/", "/vsisubfile/", "/vsisparse/"];

/// File systems that [`VSIGetFileSystemsPrefixes`](gdal_sys::VSIGetFileSystemsPrefixes) leaves out.
const UNLISTED_FILE_SYSTEMS: [&str; 2] = ["/vsicurl?", "/vsicurl_streaming/"];

/// A driver of GDAL that is kept beside the registered ones. That of rasters in memory would open
/// names that hold an address in memory. Those of GeoPackages, which open databases, and of
/// shapefiles are registered when the user gives one.
struct KeptDriver(gdal_sys::GDALDriverH);

// SAFETY: the pointer is to a driver of GDAL, which lives until the end of the process (drivers are
// freed with the manager only, which this crate never destroys), and `Create` of the MEM driver
// touches no state of the driver.
unsafe impl Send for KeptDriver {}
// SAFETY: as for `Send`: all threads may read the pointer, and the driver behind it is not changed.
unsafe impl Sync for KeptDriver {}

static MEMORY: OnceLock<KeptDriver> = OnceLock::new();
static GEOPACKAGE: OnceLock<KeptDriver> = OnceLock::new();
static SHAPEFILE: OnceLock<KeptDriver> = OnceLock::new();

/// Formats of polygons whose drivers are registered when the user gives a file of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum VectorFormat {
    /// GeoPackages.
    GeoPackage,
    /// Shapefiles: `.shp` with its `.shx`, `.dbf` and `.prj`.
    Shapefile,
}

impl VectorFormat {
    /// GDAL's name of the driver.
    pub(crate) const fn driver(self) -> &'static str {
        match self {
            Self::GeoPackage => "GPKG",
            Self::Shapefile => "ESRI Shapefile",
        }
    }
}

/// Whether a path as the user wrote it is in one of GDAL's file systems for local files, and leads
/// through no other one.
pub(in crate::raster) fn is_local_file_system(name: &str) -> bool {
    let is_local = |(at, _): (usize, &str)| FILE_SYSTEMS.iter().any(|prefix| name[at..].starts_with(prefix));
    name.starts_with("/vsi") && name.match_indices("/vsi").all(is_local)
}

/// Removes all drivers and file systems that are not listed. To be called once, after the drivers
/// are registered.
pub(in crate::raster) fn restrict() {
    let [package, shapes] = [VectorFormat::GeoPackage, VectorFormat::Shapefile].map(VectorFormat::driver);
    for (name, place) in [("MEM", &MEMORY), (package, &GEOPACKAGE), (shapes, &SHAPEFILE)] {
        if let Ok(driver) = DriverManager::get_driver_by_name(name) {
            // SAFETY: the function only reads the pointer that the driver holds, and the driver is
            // one that GDAL registered.
            let handle = unsafe { driver.c_driver() };
            place.get_or_init(|| KeptDriver(handle));
        }
    }
    let drivers = (0..DriverManager::count()).filter_map(|index| DriverManager::get_driver(index).ok());
    let strange: Vec<Driver> =
        drivers.filter(|driver| !DRIVERS.split(' ').any(|name| name == driver.short_name())).collect();
    strange.iter().for_each(DriverManager::deregister_driver);
    for prefix in file_systems() {
        if !FILE_SYSTEMS.contains(&prefix.as_str()) {
            close_file_system(&prefix);
        }
    }
    web_files::install();
}

/// Registers GDAL's driver of a format of polygons, where there is one, for the rest of the
/// process. To be called for a file that the user names, after [`restrict`].
pub(crate) fn register_vector(format: VectorFormat) {
    static REGISTERED: [Once; 2] = [const { Once::new() }; 2];
    let (once, kept) = match format {
        VectorFormat::GeoPackage => (&REGISTERED[0], &GEOPACKAGE),
        VectorFormat::Shapefile => (&REGISTERED[1], &SHAPEFILE),
    };
    once.call_once(|| {
        if let Some(driver) = kept.get() {
            // SAFETY: the pointer came from a driver of GDAL, which is never freed.
            DriverManager::register_driver(&unsafe { Driver::from_c_driver(driver.0) });
        }
    });
}

/// Returns GDAL's driver of rasters in memory.
///
/// # Errors
/// The error of GDAL when it was built without the driver.
pub(in crate::raster) fn memory_driver() -> Result<Driver, GdalError> {
    match MEMORY.get() {
        // SAFETY: the pointer came from a driver of GDAL, which is never freed.
        Some(memory) => Ok(unsafe { Driver::from_c_driver(memory.0) }),
        None => DriverManager::get_driver_by_name("MEM"),
    }
}

/// Returns a dataset that lays another one into the reference system of a WKT, by the nearest cell.
/// It reads from `dataset`, which must be dropped after it.
///
/// # Errors
/// The error of GDAL for a system that it does not know, or to which it knows no way.
pub(in crate::raster) fn warped(dataset: &gdal::Dataset, wkt: &str) -> Result<gdal::Dataset, GdalError> {
    /// Largest error of the approximated transform, cells, as of `gdalwarp`.
    const ERROR_CELLS: f64 = 0.125;
    let wkt = CString::new(wkt)?;
    let nearest = gdal_sys::GDALResampleAlg::GRA_NearestNeighbour;
    // SAFETY: the handle is of a dataset that is open and borrowed during the call; both texts end
    // with NUL or are null, which stands for the system of the dataset; null stands for the usual
    // options.
    let made = unsafe {
        gdal_sys::GDALAutoCreateWarpedVRT(
            dataset.c_dataset(),
            std::ptr::null(),
            wkt.as_ptr(),
            nearest,
            ERROR_CELLS,
            std::ptr::null(),
        )
    };
    if made.is_null() {
        return Err(GdalError::NullPointer { method_name: "GDALAutoCreateWarpedVRT", msg: "no way".to_owned() });
    }
    // SAFETY: the function returned a dataset that belongs to us, and nobody else closes it. It
    // keeps a reference to `dataset`, whose owner drops it later (`ImageSource::base`).
    Ok(unsafe { gdal::Dataset::from_c_dataset(made) })
}

/// Returns the prefixes of GDAL's file systems.
fn file_systems() -> Vec<String> {
    let mut prefixes: Vec<String> = UNLISTED_FILE_SYSTEMS.map(str::to_owned).into();
    // SAFETY: the function takes nothing, and returns a list that belongs to the caller, or null.
    let list = unsafe { gdal_sys::VSIGetFileSystemsPrefixes() };
    let mut next = list;
    // SAFETY: the list is null or an array of pointers that ends with null, so every pointer up to
    // the null may be read, and each is to a text that ends with NUL.
    while !next.is_null() && !unsafe { *next }.is_null() {
        // SAFETY: as above: `*next` is a text that ends with NUL, and it is copied here.
        prefixes.push(unsafe { CStr::from_ptr(*next) }.to_string_lossy().into_owned());
        // SAFETY: the pointer just read was not the null at the end, so the next one exists.
        next = unsafe { next.add(1) };
    }
    // SAFETY: the list belongs to us and is not used any more; null is allowed.
    unsafe { gdal_sys::CSLDestroy(list) };
    prefixes
}

/// Returns the files that a raster consists of: its own, those beside it and those it names.
pub(in crate::raster) fn files_of(dataset: &gdal::Dataset) -> Vec<String> {
    // SAFETY: the handle is of a dataset that is open and borrowed during the call, which returns a
    // list that belongs to the caller, or null.
    let list = unsafe { gdal_sys::GDALGetFileList(dataset.c_dataset()) };
    let mut files = Vec::new();
    let mut next = list;
    // SAFETY: the list is null or an array of pointers that ends with null, so every pointer up to
    // the null may be read, and each is to a text that ends with NUL.
    while !next.is_null() && !unsafe { *next }.is_null() {
        // SAFETY: as above: `*next` is a text that ends with NUL, and it is copied here.
        files.push(unsafe { CStr::from_ptr(*next) }.to_string_lossy().into_owned());
        // SAFETY: the pointer just read was not the null at the end, so the next one exists.
        next = unsafe { next.add(1) };
    }
    // SAFETY: the list belongs to us and is not used any more; null is allowed.
    unsafe { gdal_sys::CSLDestroy(list) };
    files
}

/// Replaces a file system of GDAL by one that opens nothing.
fn close_file_system(prefix: &str) {
    // GDAL keeps the pointer to the prefix, not a copy: the text must live as long as the process.
    let Ok(prefix) = CString::new(prefix).map(CString::into_raw) else { return };
    // SAFETY: the function takes nothing, and returns a struct of null pointers or null.
    let callbacks = unsafe { gdal_sys::VSIAllocFilesystemPluginCallbacksStruct() };
    if callbacks.is_null() {
        return;
    }
    // SAFETY: the struct is allocated and ours. GDAL copies it together with the function, which
    // lives as long as the process, and every other operation stays null, which GDAL answers with
    // failure. The prefix was given up above and is never freed. The struct is freed once, after
    // its last use.
    unsafe {
        (*callbacks).open = Some(open_nothing);
        gdal_sys::VSIInstallPluginHandler(prefix, callbacks);
        gdal_sys::VSIFreeFilesystemPluginCallbacksStruct(callbacks);
    }
}

/// Opens no file: GDAL reports the name as one that does not exist.
///
/// # Safety
/// The function uses none of its arguments, so any are sound.
unsafe extern "C" fn open_nothing(_: *mut c_void, _: *const c_char, _: *const c_char) -> *mut c_void {
    null_mut()
}
