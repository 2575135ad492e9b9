//! The height sweep on arrays.

use jobs::dsm::{HeightRange, Preset, ViewHeights, ViewImage, sweep_views as sweep};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use raster::Grid;

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

/// Computes the heights of views from one another.
#[pyfunction]
pub(crate) fn sweep_views<'py>(
    py: Python<'py>,
    views: Vec<(PyReadonlyArray2<'py, f32>, PyRef<'py, RpcCore>)>,
    height_range: [f64; 2],
    preset: &str,
    watcher: &Bound<'py, PyAny>,
) -> PyResult<Vec<Found<'py>>> {
    let known = Preset::CHOICES.iter().find(|(name, ..)| *name == preset);
    let unknown = || {
        let names = Preset::CHOICES.map(|(name, ..)| name).join(", ");
        raise(py, &Fault::setting(format!("the preset is {preset:?}, expected one of {names}")))
    };
    let (_, preset, _) = known.ok_or_else(unknown)?;
    let views = views.iter().map(|(pixels, rpc)| {
        let array = pixels.as_array();
        let (height, width) = array.dim();
        // A row or column alone has no texture, and the pyramid none to halve.
        let pixels = Grid::from_vec(width, height, array.iter().copied().collect());
        let pixels = pixels.filter(|_| width >= 2 && height >= 2);
        let too_small = || {
            raise(py, &Fault::setting(format!("a view has the shape ({height}, {width}), expected 2 or more of both")))
        };
        Ok(ViewImage { camera: rpc.camera.clone(), pixels: pixels.ok_or_else(too_small)? })
    });
    let views: Vec<ViewImage> = views.collect::<PyResult<_>>()?;
    let range = HeightRange::from(height_range);
    let found = watched(py, watcher, &[], |progress| Ok(sweep(views, range, *preset, progress)?))?;
    found.into_iter().map(|heights| arrays(py, heights)).collect()
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
