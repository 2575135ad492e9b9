//! The height sweep and the surface of arrays.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use raster::Grid;
use reconstruct::{DsmGrid, Fill, HeightRange, MapBounds, Preset, SurfaceRasters, ViewHeights, ViewImage};

use crate::exception::raise;
use crate::fault::Fault;
use crate::rpc_camera::RpcCore;
use crate::watch::watched;

/// Level, sources, heights, standard deviations, confidences and confirming sources of a view.
type Found<'py> = (
    usize,
    Vec<usize>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<u8>>,
);

/// Geotransform, heights, standard deviations, probabilities, numbers of views and sources.
type Surface<'py> = (
    [f64; 6],
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<u8>>,
    Bound<'py, PyArray2<u8>>,
);

/// Pixels of a view (rows, columns) and its camera.
type View<'py> = (PyReadonlyArray2<'py, f32>, PyRef<'py, RpcCore>);

/// Computes the heights of views from one another.
#[pyfunction]
pub(crate) fn sweep_views<'py>(
    py: Python<'py>,
    views: Vec<View<'py>>,
    height_range: [f64; 2],
    preset: &str,
    watcher: &Bound<'py, PyAny>,
) -> PyResult<Vec<Found<'py>>> {
    let (views, preset, range) =
        (images(py, &views)?, chosen(py, "preset", preset, Preset::CHOICES)?, HeightRange::from(height_range));
    let found = watched(py, watcher, &[], |progress| Ok(reconstruct::sweep_views(views, range, preset, progress)?))?;
    found.into_iter().map(|heights| arrays(py, heights)).collect()
}

/// Computes the surface of views on the grid of cells of `cell_m` metres that holds the bounds.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the keywords of the Python function")]
pub(crate) fn surface_of_views<'py>(
    py: Python<'py>,
    views: Vec<View<'py>>,
    height_range: [f64; 2],
    preset: &str,
    bounds: [f64; 4],
    epsg: u32,
    cell_m: f64,
    fill: &str,
    watcher: &Bound<'py, PyAny>,
) -> PyResult<Surface<'py>> {
    let (views, preset, range) =
        (images(py, &views)?, chosen(py, "preset", preset, Preset::CHOICES)?, HeightRange::from(height_range));
    let fill = chosen(py, "fill", fill, Fill::CHOICES)?;
    let (grid, rasters) = watched(py, watcher, &[], |progress| {
        let grid = DsmGrid::over(MapBounds::from(bounds), epsg, cell_m)?;
        let (rasters, _) = reconstruct::surface_of_views(views, &grid, range, preset, fill, progress)?;
        Ok((grid, rasters))
    })?;
    let SurfaceRasters { origin_m, height_m, sigma_m, views, confidence, source, .. } = rasters;
    let shape = [height_m.height(), height_m.width()];
    let heights = height_m.map(|h| (origin_m + f64::from(*h)) as f32);
    let single = |grid: Grid<f32>| PyArray1::from_vec(py, grid.into_vec()).reshape(shape);
    let small = |grid: Grid<u8>| PyArray1::from_vec(py, grid.into_vec()).reshape(shape);
    Ok((grid.geotransform.0, single(heights)?, single(sigma_m)?, single(confidence)?, small(views)?, small(source)?))
}

/// Returns the value of a setting with a name.
fn chosen<T: Copy, const N: usize>(
    py: Python<'_>,
    setting: &str,
    found: &str,
    choices: [(&str, T, &str); N],
) -> PyResult<T> {
    let known = choices.iter().find(|(name, ..)| *name == found).map(|(_, value, _)| *value);
    known.ok_or_else(|| {
        let names = choices.map(|(name, ..)| name).join(", ");
        raise(py, &Fault::setting(format!("the {setting} is {found:?}, expected one of {names}")))
    })
}

/// Takes the views out of Python's arrays.
fn images(py: Python<'_>, views: &[View<'_>]) -> PyResult<Vec<ViewImage>> {
    let image = |(pixels, rpc): &View<'_>| {
        let array = pixels.as_array();
        let (height, width) = array.dim();
        // A row or column alone has no texture, and the pyramid none to halve.
        let pixels = Grid::from_vec(width, height, array.iter().copied().collect());
        let pixels = pixels.filter(|_| width >= 2 && height >= 2);
        let too_small = || {
            raise(py, &Fault::setting(format!("a view has the shape ({height}, {width}), expected 2 or more of both")))
        };
        Ok(ViewImage { camera: rpc.camera.clone(), pixels: pixels.ok_or_else(too_small)? })
    };
    views.iter().map(image).collect()
}

fn arrays(py: Python<'_>, found: ViewHeights) -> PyResult<Found<'_>> {
    let ViewHeights { level, sources, map, agreeing } = found;
    let shape = [agreeing.height(), agreeing.width()];
    // Heights are relative to an origin, and f32 would lose millimetres when it is added.
    let heights: Vec<f64> = map.height_m.data().iter().map(|h| map.origin_m + f64::from(*h)).collect();
    let single = |grid: Grid<f32>| PyArray1::from_vec(py, grid.into_vec()).reshape(shape);
    Ok((
        level,
        sources,
        heights.into_pyarray(py).reshape(shape)?,
        single(map.sigma_m)?,
        single(map.confidence)?,
        agreeing.into_vec().into_pyarray(py).reshape(shape)?,
    ))
}
