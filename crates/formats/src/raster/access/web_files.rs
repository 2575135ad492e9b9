//! Addresses of the web as files of GDAL, read by [`WebFile`] in the place of GDAL's own reader.
//!
//! Only the address that is allowed on the thread is opened: the one that the user gave, while it
//! is opened. Nothing that a file names gets here.

#![allow(unsafe_code)]

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::null_mut;

use super::web_file::WebFile;

/// The prefix of GDAL's names of addresses.
pub(in crate::raster) const WEB_FILES: &str = "/vsicurl/";

/// Bytes that GDAL keeps together. Headers and tiles of 256 × 256 values fit in one request.
const BLOCK: usize = 128 << 10;
/// Blocks that GDAL keeps of each open file, bytes.
const CACHE: usize = 16 << 20;

/// GDAL's number of errors without a number of their own.
const APPLICATION: gdal_sys::CPLErrorNum = 1;

thread_local! {
    static ALLOWED: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Runs `call` with leave to open one address on this thread.
pub(in crate::raster) fn with_leave<T>(address: &str, call: impl FnOnce() -> T) -> T {
    ALLOWED.set(Some(address.to_owned()));
    let result = call();
    ALLOWED.set(None);
    result
}

/// Installs the file system.
pub(in crate::raster) fn install() {
    // GDAL keeps the pointer to the prefix, not a copy.
    let prefix: &'static CStr = c"/vsicurl/";
    // SAFETY: the function takes nothing, and returns a struct of null pointers or null.
    let callbacks = unsafe { gdal_sys::VSIAllocFilesystemPluginCallbacksStruct() };
    if callbacks.is_null() {
        return;
    }
    // SAFETY: the struct is allocated and ours. GDAL copies it together with the functions, which
    // live as long as the process, and calls them with the files that `open` returned only. What
    // stays null GDAL answers with failure. The prefix lives as long as the process. The struct is
    // freed once, after its last use.
    unsafe {
        (*callbacks).open = Some(open);
        (*callbacks).tell = Some(tell);
        (*callbacks).seek = Some(seek);
        (*callbacks).read = Some(read);
        (*callbacks).eof = Some(eof);
        (*callbacks).close = Some(close);
        (*callbacks).nBufferSize = BLOCK;
        (*callbacks).nCacheSize = CACHE;
        gdal_sys::VSIInstallPluginHandler(prefix.as_ptr(), callbacks);
        gdal_sys::VSIFreeFilesystemPluginCallbacksStruct(callbacks);
    }
}

/// Tells GDAL's handler of errors what is wrong.
fn report(message: &str) {
    let Ok(text) = CString::new(message.replace('\0', " ")) else { return };
    // SAFETY: the format takes one text that ends with NUL, and both live during the call.
    unsafe { gdal_sys::CPLError(gdal_sys::CPLErr::CE_Failure, APPLICATION, c"%s".as_ptr(), text.as_ptr()) };
}

/// Opens the allowed address for reading.
///
/// # Safety
/// `name` must be a text that ends with NUL.
unsafe extern "C" fn open(_: *mut c_void, name: *const c_char, _: *const c_char) -> *mut c_void {
    // SAFETY: by the contract of this function.
    let name = unsafe { CStr::from_ptr(name) }.to_string_lossy();
    if ALLOWED.with_borrow(|allowed| allowed.as_deref() != Some(&*name)) {
        return null_mut();
    }
    match WebFile::open(&name) {
        Ok(file) => Box::into_raw(Box::new(file)).cast(),
        Err(reason) => {
            report(&reason);
            // GDAL's drivers would try again, and a server that stalls would be waited for each
            // time.
            ALLOWED.set(None);
            null_mut()
        }
    }
}

/// # Safety
/// `file` must come from [`open`] and be closed by nobody, and be used by no other thread.
unsafe extern "C" fn tell(file: *mut c_void) -> gdal_sys::vsi_l_offset {
    // SAFETY: by the contract of this function.
    unsafe { &*file.cast::<WebFile>() }.position()
}

/// Moves to a position from the start (0), the present one (1) or the end (2).
///
/// # Safety
/// As [`tell`].
unsafe extern "C" fn seek(file: *mut c_void, offset: gdal_sys::vsi_l_offset, whence: c_int) -> c_int {
    // SAFETY: by the contract of this function.
    let file = unsafe { &mut *file.cast::<WebFile>() };
    let base = match whence {
        0 => 0,
        1 => file.position(),
        _ => file.size(),
    };
    file.seek(base.saturating_add(offset));
    0
}

/// Reads records, and returns the number of whole ones.
///
/// # Safety
/// As [`tell`]; `buffer` must have room for `size × count` bytes.
unsafe extern "C" fn read(file: *mut c_void, buffer: *mut c_void, size: usize, count: usize) -> usize {
    let bytes = size.saturating_mul(count);
    if bytes == 0 || buffer.is_null() {
        return 0;
    }
    // SAFETY: by the contract of this function.
    let file = unsafe { &mut *file.cast::<WebFile>() };
    // SAFETY: by the contract of this function there are so many bytes, which nobody else uses
    // during the call. They are cleared, so that all of them have a value.
    let buffer = unsafe {
        std::ptr::write_bytes(buffer.cast::<u8>(), 0, bytes);
        std::slice::from_raw_parts_mut(buffer.cast::<u8>(), bytes)
    };
    match file.read(buffer) {
        Ok(done) => done / size,
        Err(reason) => {
            report(&reason);
            0
        }
    }
}

/// # Safety
/// As [`tell`].
unsafe extern "C" fn eof(file: *mut c_void) -> c_int {
    // SAFETY: by the contract of this function.
    c_int::from(unsafe { &*file.cast::<WebFile>() }.is_at_end)
}

/// # Safety
/// As [`tell`]; the file is not used afterwards.
unsafe extern "C" fn close(file: *mut c_void) -> c_int {
    // SAFETY: by the contract of this function the pointer is that of the box that `open` made.
    drop(unsafe { Box::from_raw(file.cast::<WebFile>()) });
    0
}
