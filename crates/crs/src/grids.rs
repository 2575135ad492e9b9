//! The geoid grids that a transformation needs, the folders in which PROJ looks for them, and how
//! a missing one is fetched where the user allows it.
#![allow(unsafe_code)]

use std::ffi::c_char;
use std::path::{Path, PathBuf};
use std::ptr;
use std::sync::{Mutex, OnceLock, PoisonError};

use proj_sys::{
    PJ, PROJ_GRID_AVAILABILITY_USE_PROJ_GRID_AVAILABILITY_IGNORED,
    PROJ_SPATIAL_CRITERION_PROJ_SPATIAL_CRITERION_PARTIAL_INTERSECTION, proj_context_get_database_path,
    proj_context_get_user_writable_directory, proj_coordoperation_get_grid_used,
    proj_coordoperation_get_grid_used_count, proj_create_operation_factory_context, proj_create_operations,
    proj_list_destroy, proj_list_get, proj_list_get_count, proj_operation_factory_context_destroy,
    proj_operation_factory_context_set_grid_availability_use, proj_operation_factory_context_set_spatial_criterion,
};

use crate::CrsError;
use crate::proj_handle::{Context, text_of};

/// Most grids that are named: a datum of a continent has one for each region.
pub(crate) const NAMED_MAX: usize = 3;

/// Puts the grid of a name into a folder, which may not exist yet, or says why it cannot.
pub type GridSource = fn(name: &str, folder: &Path) -> Result<(), String>;

static SOURCE: OnceLock<GridSource> = OnceLock::new();

/// Lets converters of heights get grids that PROJ does not find from a source, for the rest of the
/// process. The source that was set first stays. Without one, a missing grid is an error.
pub fn get_missing_grids_from(source: GridSource) {
    SOURCE.get_or_init(|| source);
}

/// Gets a grid from the source that the process allows; `false` where it allows none.
///
/// # Errors
/// [`CrsError::GridNotFetched`].
pub(crate) fn fetch(name: &str) -> Result<bool, CrsError> {
    /// One thread fetches, and the others wait and find the grid.
    static FETCHING: Mutex<()> = Mutex::new(());
    let Some(source) = SOURCE.get() else { return Ok(false) };
    let failed = |reason: String| CrsError::GridNotFetched { name: name.to_owned(), reason };
    // The first folder is the user's own, the only one that can be written to without more rights.
    let folder = folders().into_iter().next().ok_or_else(|| failed("PROJ has no folder for grids".to_owned()))?;
    let _guard = FETCHING.lock().unwrap_or_else(PoisonError::into_inner);
    if !folder.join(name).exists() {
        source(name, &folder).map_err(failed)?;
    }
    Ok(true)
}

/// Returns the folders in which PROJ looks for grids, in its order: that of the user, those of
/// `PROJ_DATA` (in older releases `PROJ_LIB`), and that of its database.
pub(crate) fn folders() -> Vec<PathBuf> {
    let context = Context::new();
    // SAFETY: the context is alive; both texts belong to it and are copied at once. The folder is
    // not created.
    let (own, database) = unsafe {
        let own = text_of(proj_context_get_user_writable_directory(context.raw(), 0));
        (own, text_of(proj_context_get_database_path(context.raw())))
    };
    let named = ["PROJ_DATA", "PROJ_LIB"].into_iter().find_map(std::env::var_os);
    let named = named.iter().flat_map(std::env::split_paths);
    let beside = database.as_deref().and_then(|file| Path::new(file).parent().map(Path::to_owned));
    let mut folders: Vec<PathBuf> = Vec::new();
    for folder in own.map(PathBuf::from).into_iter().chain(named).chain(beside) {
        if !folder.as_os_str().is_empty() && !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders
}

/// Returns the names of grids that are not installed and that a transformation between two CRSs
/// would use, those of the best transformation first. Empty where PROJ knows none.
pub(crate) fn missing_between(source: &str, target: &str) -> Vec<String> {
    let context = Context::new();
    let (Ok(source), Ok(target)) = (context.create(source), context.create(target)) else { return Vec::new() };
    let mut names: Vec<String> = Vec::new();
    // SAFETY: all objects belong to the context and are alive. The factory and the list are
    // destroyed below, after their last use; the operations of the list are owned by `Object`.
    unsafe {
        let factory = proj_create_operation_factory_context(context.raw(), ptr::null());
        let use_of_grids = PROJ_GRID_AVAILABILITY_USE_PROJ_GRID_AVAILABILITY_IGNORED;
        proj_operation_factory_context_set_grid_availability_use(context.raw(), factory, use_of_grids);
        // Grids of a part of the datum's area count, too.
        let anywhere = PROJ_SPATIAL_CRITERION_PROJ_SPATIAL_CRITERION_PARTIAL_INTERSECTION;
        proj_operation_factory_context_set_spatial_criterion(context.raw(), factory, anywhere);
        let list = proj_create_operations(context.raw(), source.raw(), target.raw(), factory);
        let count = if list.is_null() { 0 } else { proj_list_get_count(list) };
        for index in 0..count {
            if let Ok(operation) = context.own(proj_list_get(context.raw(), list, index)) {
                missing_of(&context, operation.raw(), &mut names);
            }
        }
        proj_list_destroy(list);
        proj_operation_factory_context_destroy(factory);
    }
    names.truncate(NAMED_MAX);
    names
}

/// Adds the grids of an operation that are not installed.
///
/// # Safety
/// `operation` must be a coordinate operation made in the context.
unsafe fn missing_of(context: &Context, operation: *const PJ, names: &mut Vec<String>) {
    // SAFETY: the caller guarantees that the operation belongs to the context. PROJ ignores
    // outputs that are null; the name belongs to the operation and is copied at once.
    unsafe {
        for index in 0..proj_coordoperation_get_grid_used_count(context.raw(), operation) {
            let (mut name, mut available): (*const c_char, _) = (ptr::null(), 0);
            let null = ptr::null_mut();
            let found = proj_coordoperation_get_grid_used(
                context.raw(),
                operation,
                index,
                &mut name,
                null,
                null,
                null,
                ptr::null_mut(),
                ptr::null_mut(),
                &mut available,
            );
            let name = if found != 0 && available == 0 { text_of(name) } else { None };
            names.extend(name.filter(|name| !name.is_empty() && !names.contains(name)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folders_are_those_of_the_user_and_of_the_database() {
        let folders = folders();
        assert!(folders.iter().any(|folder| folder.join("proj.db").is_file()), "{folders:?}");
        assert!(folders.iter().all(|folder| folder.is_absolute()), "{folders:?}");
    }

    /// PROJ's database knows the grids of NAVD 88, in US survey feet too, whether they are
    /// installed or not.
    #[test]
    fn the_grids_of_a_datum_are_named() {
        for code in [5703, 6360] {
            let names = missing_between("EPSG:4979", &format!("EPSG:4326+{code}"));
            let installed = crate::HeightConverter::new(crate::VerticalDatum::Epsg(code)).is_ok();
            assert!(installed || names.iter().any(|name| name.starts_with("us_noaa_g")), "EPSG:{code}: {names:?}");
            assert!(names.len() <= NAMED_MAX);
        }
        assert_eq!(missing_between("EPSG:4979", "nonsense"), Vec::<String>::new());
    }
}
