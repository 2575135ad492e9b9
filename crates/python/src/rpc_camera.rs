//! RPC cameras on arrays of points.
//!
//! Arrays are flat, contiguous and f64; the Python side brings them there. A point without an image
//! or ground position becomes NaN: it is a value, not an error.

use std::borrow::Cow;
use std::path::PathBuf;

use camera::{Correspondence, ImagePoint, Rpc, RpcCamera, RpcFit};
use formats::rpc::RpcFormat;
use geodesy::LonLatHeight;
use numpy::{PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::exception::{raise, raise_about};
use crate::fault::Fault;
use crate::forked::in_own_pool;

/// Points from which on the work is shared out over threads.
const PARALLEL: usize = 1 << 15;

/// An RPC with its correction.
#[pyclass(frozen, module = "skysweep._native")]
pub(crate) struct RpcCore {
    pub(crate) camera: RpcCamera,
}

fn json_error(error: &serde_json::Error) -> Fault {
    Fault::setting(error.to_string())
}

/// Lets `fill` write two columns, by parts that start at its first argument.
fn fill_columns(
    first: &mut [f64],
    second: &mut [f64],
    fill: impl Fn(usize, &mut [f64], &mut [f64]) + Send + Sync,
) -> Result<(), Fault> {
    if first.len() < PARALLEL {
        fill(0, first, second);
        return Ok(());
    }
    in_own_pool(|| {
        let parts = first.par_chunks_mut(PARALLEL).zip(second.par_chunks_mut(PARALLEL)).enumerate();
        parts.for_each(|(part, (first, second))| fill(part * PARALLEL, first, second));
        Ok(())
    })
}

/// A part of the numbers of the points, or so many times the one of all of them.
fn part(values: &[f64], start: usize, count: usize) -> Cow<'_, [f64]> {
    match values {
        [only] => Cow::Owned(vec![*only; count]),
        _ => Cow::Borrowed(&values[start..start + count]),
    }
}

/// A number for each point, or one for all of them.
fn at(values: &[f64], index: usize) -> f64 {
    if let [only] = values { *only } else { values[index] }
}

#[pymethods]
impl RpcCore {
    /// Reads the RPC of a file: the camera, the name of its format, the file that held it, and
    /// warnings.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<(Self, String, PathBuf, Vec<String>)> {
        let file = py.detach(|| formats::rpc::read(&path)).map_err(|e| raise_about(py, &e.into(), &[&path]))?;
        let format = serde_json::to_value(file.format).map(|v| v.as_str().unwrap_or_default().to_owned());
        let format = format.map_err(|e| raise(py, &json_error(&e)))?;
        Ok((Self { camera: RpcCamera::new(file.rpc) }, format, file.source, file.warnings))
    }

    /// The camera of an image as a run corrected it.
    #[staticmethod]
    fn from_run(py: Python<'_>, run: PathBuf, image: PathBuf) -> PyResult<Self> {
        let camera = py.detach(|| jobs::rpc::camera_of_run(&run, &image));
        Ok(Self { camera: camera.map_err(|e| raise_about(py, &e.into(), &[&run, &image]))? })
    }

    /// Makes a camera of its numbers as JSON: an RPC, and a correction.
    #[staticmethod]
    fn from_json(py: Python<'_>, rpc: &str, correction: Option<&str>) -> PyResult<Self> {
        let failed = |e| raise(py, &json_error(&e));
        let rpc: Rpc = serde_json::from_str(rpc).map_err(failed)?;
        rpc.validate().map_err(|e| raise(py, &e.into()))?;
        let mut camera = RpcCamera::new(rpc);
        if let Some(correction) = correction {
            camera.correction = serde_json::from_str(correction).map_err(failed)?;
        }
        Ok(Self { camera })
    }

    /// Fits a camera to points; also returns the root mean square and the largest residual, pixels.
    #[staticmethod]
    fn fit(
        py: Python<'_>,
        ground: [PyReadonlyArray1<'_, f64>; 3],
        image: [PyReadonlyArray1<'_, f64>; 2],
    ) -> PyResult<(Self, f64, f64)> {
        let [lon, lat, height] = &ground;
        let [sample, line] = &image;
        let (lon, lat, height) = (lon.as_slice()?, lat.as_slice()?, height.as_slice()?);
        let (sample, line) = (sample.as_slice()?, line.as_slice()?);
        let points: Vec<Correspondence> = (0..sample.len())
            .map(|i| Correspondence {
                ground: LonLatHeight { lon_deg: at(lon, i), lat_deg: at(lat, i), height_m: at(height, i) },
                image: ImagePoint::new(sample[i], at(line, i)),
            })
            .collect();
        let fit = py.detach(|| RpcFit::to_correspondences(&points)).map_err(|e| raise(py, &e.into()))?;
        Ok((Self { camera: RpcCamera::new(fit.rpc) }, fit.rms_px, fit.max_px))
    }

    /// The numbers of the RPC and of its correction as JSON.
    fn to_json(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let text = |value: serde_json::Result<String>| value.map_err(|e| raise(py, &json_error(&e)));
        let RpcCamera { rpc, correction } = &self.camera;
        Ok((text(serde_json::to_string(rpc))?, text(serde_json::to_string(correction))?))
    }

    /// Writes image positions of ground points into `sample` and `line`.
    fn project(
        &self,
        py: Python<'_>,
        ground: [PyReadonlyArray1<'_, f64>; 3],
        image: [PyReadwriteArray1<'_, f64>; 2],
    ) -> PyResult<()> {
        let ([lon, lat, height], [mut sample, mut line]) = (ground, image);
        let (lon, lat, height) = (lon.as_slice()?, lat.as_slice()?, height.as_slice()?);
        let (sample, line) = (sample.as_slice_mut()?, line.as_slice_mut()?);
        let camera = &self.camera;
        let filled = py.detach(|| {
            // The polynomials of one height have half as many terms.
            let plane = if let [height_m] = height { Some(camera.rpc.plane(*height_m)) } else { None };
            fill_columns(sample, line, |start, sample, line| {
                let [lon, lat] = [lon, lat].map(|values| part(values, start, sample.len()));
                if let Some(plane) = &plane {
                    plane.project_many(&camera.correction, [&lon, &lat], [sample, line]);
                } else {
                    let height = &height[start..start + sample.len()];
                    camera.project_many([&lon, &lat, height], [sample, line]);
                }
            })
        });
        filled.map_err(|fault| raise(py, &fault))
    }

    /// Writes ground points that are seen at image positions, at given heights, into `lon` and
    /// `lat`.
    fn localize(
        &self,
        py: Python<'_>,
        image: [PyReadonlyArray1<'_, f64>; 3],
        ground: [PyReadwriteArray1<'_, f64>; 2],
    ) -> PyResult<()> {
        let ([sample, line, height], [mut lon, mut lat]) = (image, ground);
        let (sample, line, height) = (sample.as_slice()?, line.as_slice()?, height.as_slice()?);
        let (lon, lat) = (lon.as_slice_mut()?, lat.as_slice_mut()?);
        let camera = &self.camera;
        let filled = py.detach(|| {
            fill_columns(lon, lat, |start, lon, lat| {
                for (i, (lon, lat)) in lon.iter_mut().zip(lat).enumerate() {
                    let [sample, line, height] = [sample, line, height].map(|values| at(values, start + i));
                    let ground = camera.localize(ImagePoint::new(sample, line), height);
                    [*lon, *lat] = ground.map_or([f64::NAN; 2], |g| [g.lon_deg, g.lat_deg]);
                }
            })
        });
        filled.map_err(|fault| raise(py, &fault))
    }

    /// Ground sampling distance along sample and line, metres, and the view direction (east, north,
    /// up) at a ground point.
    fn view(&self, py: Python<'_>, lon: f64, lat: f64, height: f64) -> PyResult<([f64; 2], [f64; 3])> {
        let ground = LonLatHeight { lon_deg: lon, lat_deg: lat, height_m: height };
        let gsd = self.camera.gsd(ground).map_err(|e| raise(py, &e.into()))?;
        let view = self.camera.view_direction(ground).map_err(|e| raise(py, &e.into()))?;
        Ok(([gsd.sample_m, gsd.line_m], [view.east, view.north, view.up]))
    }

    /// The camera of a crop whose upper-left pixel is (sample, line).
    fn cropped(&self, sample: f64, line: f64) -> Self {
        Self { camera: self.camera.cropped(ImagePoint::new(sample, line)) }
    }

    /// The camera of the image resampled by a factor.
    fn rescaled(&self, factor: f64) -> Self {
        Self { camera: self.camera.rescaled(factor) }
    }

    /// One RPC that includes the correction, with its largest residual, pixels.
    fn folded(&self, py: Python<'_>) -> PyResult<(Self, f64)> {
        let fit = self.camera.folded().map_err(|e| raise(py, &e.into()))?;
        Ok((Self { camera: RpcCamera::new(fit.rpc) }, fit.max_px))
    }

    /// The text of an RPC file.
    fn text(&self, py: Python<'_>, format: &str) -> PyResult<String> {
        let format = format_of(py, format)?;
        formats::rpc::to_text(&self.camera.rpc, format).map_err(|e| raise(py, &e.into()))
    }

    /// Writes an RPC file.
    fn write(&self, py: Python<'_>, path: PathBuf, format: &str, overwrite: bool) -> PyResult<()> {
        let format = format_of(py, format)?;
        let written = formats::rpc::write(&path, &self.camera.rpc, format, overwrite);
        written.map_err(|e| raise_about(py, &e.into(), &[&path]))
    }
}

fn format_of(py: Python<'_>, name: &str) -> PyResult<RpcFormat> {
    serde_json::from_value(name.into()).map_err(|e| raise(py, &json_error(&e)))
}
