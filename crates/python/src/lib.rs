//! The part of the Python package `skysweep` that is written in Rust.
//!
//! The package's Python sources (`python/skysweep`) check and describe arguments and call the
//! functions here. Settings and reports cross as JSON, arrays as NumPy arrays without a copy where
//! they are contiguous. Errors become the exceptions of `skysweep` with the same text.

#![allow(unsafe_code, reason = "the macros of pyo3 make the functions that the interpreter calls")]

mod catalogue;
mod city_scene;
mod exception;
mod fault;
mod forked;
mod height_sweep;
mod rasters;
mod rpc_camera;
mod watch;

use std::path::Path;

use numeric::Progress;
use pyo3::prelude::*;
use serde_json::Value;

use crate::exception::raise;
use crate::fault::Fault;

/// Runs the job called `name` with settings as JSON; returns its report as JSON.
#[pyfunction]
fn run_job(py: Python<'_>, name: &str, settings: &str, watcher: &Bound<'_, PyAny>) -> PyResult<String> {
    let unknown = || raise(py, &Fault::setting(format!("there is no job called {name:?}")));
    let entry = catalogue::job(name).ok_or_else(unknown)?;
    let settings = match serde_json::from_str(settings) {
        Ok(Value::Object(settings)) => settings,
        _ => return Err(raise(py, &Fault::setting("settings are a JSON object".to_owned()))),
    };
    let mut texts = Vec::new();
    settings.values().for_each(|value| texts_in(value, &mut texts));
    let paths: Vec<&Path> = texts.iter().map(Path::new).collect();
    let work = |progress: &dyn Progress| (entry.run)(settings, progress).map(|report| report.to_string());
    watch::watched(py, watcher, &paths, work)
}

/// Collects the texts among settings, of which some are paths.
fn texts_in(value: &Value, texts: &mut Vec<String>) {
    match value {
        Value::String(text) => texts.push(text.clone()),
        Value::Array(values) => values.iter().for_each(|value| texts_in(value, texts)),
        Value::Object(fields) => fields.values().for_each(|value| texts_in(value, texts)),
        _ => {}
    }
}

/// Lets rasters be read from addresses (`https://…`, `/vsis3/…`) that are given as inputs.
#[pyfunction]
fn allow_remote() {
    jobs::remote::allow_remote();
}

/// Lets geoid grids that PROJ does not find be fetched from <https://cdn.proj.org>, once, into
/// PROJ's folder of the user.
#[pyfunction]
fn fetch_grids() {
    jobs::remote::fetch_grids();
}

#[pymodule(gil_used = false)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    forked::note_process();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(run_job, module)?)?;
    module.add_function(wrap_pyfunction!(allow_remote, module)?)?;
    module.add_function(wrap_pyfunction!(fetch_grids, module)?)?;
    module.add_function(wrap_pyfunction!(height_sweep::sweep_views, module)?)?;
    module.add_function(wrap_pyfunction!(height_sweep::surface_of_views, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::write_grid, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::read_grid, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::file_crs, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::crs_parts, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::vertical_parts, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::transform_points, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::sample_cells, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::convert_heights, module)?)?;
    module.add_function(wrap_pyfunction!(rasters::undeclared, module)?)?;
    module.add_class::<rpc_camera::RpcCore>()?;
    module.add_class::<city_scene::CityCore>()
}
