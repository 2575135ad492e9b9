//! Reads the surface model and the images with their cameras, and lays out the grid of the ortho.

use std::path::Path;

use camera::{ImageCorrection, RpcCamera};
use crs::{HeightConverter, MapProjection, VerticalDatum};
use io::raster::{Dem, ImageSource, read_dem};
use occlusion::{Eyeline, GridGround};
use raster::{GeoTransform, Window};

use numeric::Progress;

use super::config::OrthoConfig;
use super::error::OrthoError;
use crate::map_crs::MapCrs;
use job::corrections::Corrections;
use job::error::SettingError;

/// Most cells of all bands of an ortho: they are held in memory as f32.
const CELLS_MAX: usize = 1 << 28;

/// Inputs of an ortho.
pub(super) struct OrthoInputs {
    /// Surface model; heights in metres above the ellipsoid.
    pub(super) dsm: Dem,
    /// Side of the cells of the surface model, metres.
    pub(super) cell_m: f64,
    /// Its map.
    pub(super) map: MapCrs,
    pub(super) images: Vec<OrthoImage>,
    pub(super) grid: OrthoGrid,
}

/// An image with its camera.
pub(crate) struct OrthoImage {
    pub(crate) source: ImageSource,
    pub(crate) camera: RpcCamera,
    /// Whether a correction of the pointing was found.
    pub(crate) corrected: bool,
    /// Directions towards the sensor over the cells of the surface model.
    pub(crate) eyeline: Eyeline,
}

/// The cells of the ortho.
pub(super) struct OrthoGrid {
    pub(super) geotransform: GeoTransform,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) ground: GridGround,
    /// Whether the grid is the grid of the surface model.
    pub(super) is_dsm: bool,
}

impl OrthoInputs {
    /// Opens all inputs of a configuration. `window` are the cells of the surface model that the
    /// ortho has, in place of what the configuration says.
    pub(super) fn open(
        config: &OrthoConfig,
        window: Option<Window>,
        corrections: &Corrections,
        progress: &dyn Progress,
    ) -> Result<Self, OrthoError> {
        let path = config.surface_file();
        let mut dsm = read_dem(&path)?;
        let map = MapCrs::of(&dsm).ok_or_else(|| OrthoError::NoCrs { path: path.clone() })?;
        let projection = map.projection()?;
        let metres = projection.metres_per_unit().ok_or_else(|| OrthoError::InDegrees { path: path.clone() })?;
        let (along_columns, along_rows) = dsm.geotransform.cell_size();
        let cell_m = metres * (along_columns * along_rows).sqrt();
        to_ellipsoid(&mut dsm, config.surface_vertical, &projection, cell_m, progress)?;
        let known: Vec<f64> = dsm.heights.data().iter().filter(|h| h.is_finite()).map(|&h| f64::from(h)).collect();
        if known.is_empty() {
            return Err(OrthoError::NoHeights { path });
        }
        let middle_m = known.iter().sum::<f64>() / known.len() as f64;
        let grid = match window {
            Some(window) => OrthoGrid::within(&dsm, window, &projection)?,
            None => OrthoGrid::new(config, &dsm, &projection)?,
        };
        let scene = Scene { dsm: &dsm, projection: &projection, middle_m, corrections };
        let open = |path| OrthoImage::open(path, &scene, progress);
        let images = config.images.iter().map(|path| open(path)).collect::<Result<Vec<_>, _>>()?;
        let bands = images.first().map_or(0, |image| image.source.info().bands);
        if let Some(other) = images.iter().find(|image| image.source.info().bands != bands) {
            let (path, found) = (other.source.path().to_owned(), other.source.info().bands);
            return Err(OrthoError::Bands { path, found, expected: bands });
        }
        let cells = grid.width.saturating_mul(grid.height);
        if cells.saturating_mul(bands) > CELLS_MAX {
            return Err(OrthoError::TooLarge { width: grid.width, height: grid.height, bands });
        }
        Ok(Self { dsm, cell_m, map, images, grid })
    }
}

/// What the opening of an image needs to know of the surface.
struct Scene<'a> {
    dsm: &'a Dem,
    projection: &'a MapProjection,
    /// Mean height of the surface, metres above the ellipsoid.
    middle_m: f64,
    corrections: &'a Corrections,
}

/// Converts the heights to heights above the ellipsoid.
fn to_ellipsoid(
    dsm: &mut Dem,
    stated: Option<VerticalDatum>,
    projection: &MapProjection,
    cell_m: f64,
    progress: &dyn Progress,
) -> Result<(), OrthoError> {
    let datum = stated.or(dsm.vertical).unwrap_or_else(|| {
        progress.warn(&format!(
            "the file does not name the vertical datum of its heights, so they are taken as above the ellipsoid: {}",
            dsm.path.display()
        ));
        VerticalDatum::Ellipsoid
    });
    if datum != VerticalDatum::Ellipsoid {
        let (from, to) = (HeightConverter::new(datum)?, HeightConverter::new(VerticalDatum::Ellipsoid)?);
        eval::convert_heights(&mut dsm.heights, &dsm.geotransform, cell_m, projection, &from, &to)?;
    }
    Ok(())
}

impl OrthoImage {
    fn open(path: &Path, scene: &Scene<'_>, progress: &dyn Progress) -> Result<Self, OrthoError> {
        let Scene { dsm, projection, middle_m, corrections } = scene;
        let source = ImageSource::open(path)?;
        let camera = corrections.camera(path, progress)?;
        let corrected = camera.correction != ImageCorrection::IDENTITY;
        let size = (dsm.heights.width(), dsm.heights.height());
        let eyeline = Eyeline::new(&camera, projection, &dsm.geotransform, size, *middle_m)
            .map_err(|source| OrthoError::NotSeen { path: path.to_owned(), source })?;
        Ok(Self { source, camera, corrected, eyeline })
    }
}

impl OrthoGrid {
    /// A window of the cells of the surface model.
    fn within(dsm: &Dem, window: Window, projection: &MapProjection) -> Result<Self, OrthoError> {
        let geotransform = dsm.geotransform.shifted(window.x as f64, window.y as f64);
        let (width, height) = (window.width, window.height);
        let ground = GridGround::new(projection, &geotransform, (width, height))?;
        Ok(Self { geotransform, width, height, ground, is_dsm: false })
    }

    fn new(config: &OrthoConfig, dsm: &Dem, projection: &MapProjection) -> Result<Self, OrthoError> {
        let (width, height) = (dsm.heights.width(), dsm.heights.height());
        if config.cell_m.is_none() && config.bounds.is_none() {
            let ground = GridGround::new(projection, &dsm.geotransform, (width, height))?;
            return Ok(Self { geotransform: dsm.geotransform, width, height, ground, is_dsm: true });
        }
        let cell = config.cell_m.unwrap_or_else(|| dsm.geotransform.cell_size().0);
        if !(cell > 0.0 && cell.is_finite()) {
            return Err(SettingError::new("the cell size", cell, "a positive number of metres").into());
        }
        let [x_min, y_min, x_max, y_max] = config.bounds.unwrap_or_else(|| extent(&dsm.geotransform, width, height));
        let count = |low: f64, high: f64| {
            let cells = ((high - low) / cell - 1e-6).ceil();
            if cells >= 1.0 && cells <= CELLS_MAX as f64 {
                return Ok(cells as usize);
            }
            Err(OrthoError::Extent { low, high, cells, cell_m: cell })
        };
        let (columns, rows) = (count(x_min, x_max)?, count(y_min, y_max)?);
        if columns.saturating_mul(rows) > CELLS_MAX {
            return Err(OrthoError::TooLarge { width: columns, height: rows, bands: 1 });
        }
        let geotransform = GeoTransform::north_up(x_min, y_max, cell);
        let ground = GridGround::new(projection, &geotransform, (columns, rows))?;
        Ok(Self { geotransform, width: columns, height: rows, ground, is_dsm: false })
    }
}

/// Returns the least x and y, then the greatest x and y, of the corners of a grid.
fn extent(geotransform: &GeoTransform, width: usize, height: usize) -> [f64; 4] {
    let (w, h) = (width as f64 - 0.5, height as f64 - 0.5);
    let corners = [(-0.5, -0.5), (w, -0.5), (-0.5, h), (w, h)].map(|(c, r)| geotransform.map_from_cell(c, r));
    let fold = |pick: fn(&(f64, f64)) -> f64, best: fn(f64, f64) -> f64| {
        corners.iter().map(pick).reduce(best).unwrap_or_default()
    };
    [fold(|c| c.0, f64::min), fold(|c| c.1, f64::min), fold(|c| c.0, f64::max), fold(|c| c.1, f64::max)]
}
