//! The surface, the images with their cameras, and the grid of an ortho.

use std::path::{Path, PathBuf};

use camera::{ImageCorrection, RpcCamera};
use crs::{HeightConverter, MapProjection, VerticalDatum};
use formats::raster::{Dem, ImageSource, RasterError, read_dem};
use occlusion::{Eyeline, GridGround};
use raster::{GeoTransform, Grid, Window};

use numeric::Progress;

use super::config::OrthoConfig;
use super::error::OrthoError;
use crate::map_crs::MapCrs;
use job::corrections::Corrections;
use job::error::SettingError;

/// Most cells of all bands of an ortho: they are held in memory as f32.
const CELLS_MAX: usize = 1 << 28;

/// The pixels of an image: an open file, or one band in memory.
pub(crate) trait Pixels {
    /// Columns and rows.
    fn size(&self) -> (usize, usize);
    /// Number of bands.
    fn bands(&self) -> usize;
    /// Returns a band, counted from 1, over a window. NaN marks no-data and the outside.
    fn band(&self, number: usize, window: Window) -> Result<Grid<f32>, RasterError>;
}

impl Pixels for ImageSource {
    fn size(&self) -> (usize, usize) {
        (self.info().width, self.info().height)
    }

    fn bands(&self) -> usize {
        self.info().bands
    }

    fn band(&self, number: usize, window: Window) -> Result<Grid<f32>, RasterError> {
        self.read_samples(number, window)
    }
}

impl Pixels for &Grid<f32> {
    fn size(&self) -> (usize, usize) {
        (self.width(), self.height())
    }

    fn bands(&self) -> usize {
        1
    }

    fn band(&self, _: usize, window: Window) -> Result<Grid<f32>, RasterError> {
        Ok(self.window(window, f32::NAN))
    }
}

/// A surface that images are laid on.
pub(crate) struct OrthoSurface {
    /// Surface model; heights in metres above the ellipsoid.
    pub(crate) dsm: Dem,
    /// Its map.
    pub(crate) map: MapCrs,
    projection: MapProjection,
    /// Side of its cells, metres.
    pub(super) cell_m: f64,
    /// Mean height, metres above the ellipsoid.
    middle_m: f64,
}

/// Inputs of an ortho.
pub(super) struct OrthoInputs<'a, P> {
    pub(super) surface: &'a OrthoSurface,
    pub(super) images: Vec<OrthoImage<P>>,
    pub(super) grid: OrthoGrid,
}

/// An image with its camera.
pub(crate) struct OrthoImage<P = ImageSource> {
    pub(crate) source: P,
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

impl OrthoSurface {
    /// Reads a surface model. `stated` is the datum of its heights, where the file names none or a
    /// wrong one.
    pub(crate) fn read(
        path: &Path,
        stated: Option<VerticalDatum>,
        progress: &dyn Progress,
    ) -> Result<Self, OrthoError> {
        Self::of(read_dem(path)?, stated, progress)
    }

    /// Takes a surface model in memory, as [`OrthoSurface::read`] takes a file.
    pub(crate) fn of(mut dsm: Dem, stated: Option<VerticalDatum>, progress: &dyn Progress) -> Result<Self, OrthoError> {
        let map = MapCrs::of(&dsm).ok_or_else(|| OrthoError::NoCrs { path: dsm.path.clone() })?;
        let projection = map.projection()?;
        let (along_columns_m, along_rows_m) = dsm.cell_size_m(&projection);
        let cell_m = (along_columns_m * along_rows_m).sqrt();
        to_ellipsoid(&mut dsm, stated, &projection, cell_m, progress)?;
        let known: Vec<f64> = dsm.heights.data().iter().filter(|h| h.is_finite()).map(|&h| f64::from(h)).collect();
        if known.is_empty() {
            return Err(OrthoError::NoHeights { path: dsm.path });
        }
        let middle_m = known.iter().sum::<f64>() / known.len() as f64;
        Ok(Self { dsm, map, projection, cell_m, middle_m })
    }

    /// Returns the surface raised by a height, metres.
    pub(crate) fn raised(&self, by_m: f32) -> Result<Self, OrthoError> {
        let heights = self.dsm.heights.map(|height| height + by_m);
        let dsm = Dem { heights, vertical: Some(VerticalDatum::Ellipsoid), ..self.dsm.clone() };
        Self::of(dsm, None, &numeric::Silent)
    }

    /// Looks at the surface through a camera. `path` names the image in errors.
    pub(crate) fn image<P>(&self, path: &Path, source: P, camera: RpcCamera) -> Result<OrthoImage<P>, OrthoError> {
        let corrected = camera.correction != ImageCorrection::IDENTITY;
        let size = (self.dsm.heights.width(), self.dsm.heights.height());
        let eyeline = Eyeline::new(&camera, &self.projection, &self.dsm.geotransform, size, self.middle_m)
            .map_err(|source| OrthoError::NotSeen { path: path.to_owned(), source })?;
        Ok(OrthoImage { source, camera, corrected, eyeline })
    }
}

impl<'a> OrthoInputs<'a, ImageSource> {
    /// Opens the images of a configuration. `window` are the cells of the surface model that the
    /// ortho has, in place of what the configuration says.
    pub(super) fn open(
        config: &OrthoConfig,
        surface: &'a OrthoSurface,
        window: Option<Window>,
        corrections: &Corrections,
        progress: &dyn Progress,
    ) -> Result<Self, OrthoError> {
        let grid = match window {
            Some(window) => OrthoGrid::within(&surface.dsm, window, &surface.projection)?,
            None => OrthoGrid::new(config, &surface.dsm, &surface.projection)?,
        };
        let open = |path: &PathBuf| {
            let source = ImageSource::open(path)?;
            surface.image(path, source, corrections.camera(path, progress)?)
        };
        let images = config.images.iter().map(open).collect::<Result<Vec<_>, _>>()?;
        let bands = images.first().map_or(0, |image| image.source.info().bands);
        if let Some(other) = images.iter().find(|image| image.source.info().bands != bands) {
            let (path, found) = (other.source.path().to_owned(), other.source.info().bands);
            return Err(OrthoError::Bands { path, found, expected: bands });
        }
        Self { surface, images, grid }.checked()
    }
}

impl<'a, P: Pixels> OrthoInputs<'a, P> {
    /// One image on the cells of the surface.
    pub(super) fn of_image(surface: &'a OrthoSurface, image: OrthoImage<P>) -> Result<Self, OrthoError> {
        let grid = OrthoGrid::of_surface(&surface.dsm, &surface.projection)?;
        Self { surface, images: vec![image], grid }.checked()
    }

    /// Refuses an ortho that memory does not hold.
    fn checked(self) -> Result<Self, OrthoError> {
        let bands = self.images.first().map_or(0, |image| image.source.bands());
        let cells = self.grid.width.saturating_mul(self.grid.height);
        if cells.saturating_mul(bands) > CELLS_MAX {
            return Err(OrthoError::TooLarge { width: self.grid.width, height: self.grid.height, bands });
        }
        Ok(self)
    }
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

impl OrthoGrid {
    /// A window of the cells of the surface model.
    fn within(dsm: &Dem, window: Window, projection: &MapProjection) -> Result<Self, OrthoError> {
        let geotransform = dsm.geotransform.shifted(window.x as f64, window.y as f64);
        let (width, height) = (window.width, window.height);
        let ground = GridGround::new(projection, &geotransform, (width, height))?;
        Ok(Self { geotransform, width, height, ground, is_dsm: false })
    }

    /// The cells of the surface model.
    fn of_surface(dsm: &Dem, projection: &MapProjection) -> Result<Self, OrthoError> {
        let (width, height) = (dsm.heights.width(), dsm.heights.height());
        let ground = GridGround::new(projection, &dsm.geotransform, (width, height))?;
        Ok(Self { geotransform: dsm.geotransform, width, height, ground, is_dsm: true })
    }

    fn new(config: &OrthoConfig, dsm: &Dem, projection: &MapProjection) -> Result<Self, OrthoError> {
        if config.cell_m.is_none() && config.bounds.is_none() {
            return Self::of_surface(dsm, projection);
        }
        let (width, height) = (dsm.heights.width(), dsm.heights.height());
        let [x_min, y_min, x_max, y_max] = config.bounds.unwrap_or_else(|| extent(&dsm.geotransform, width, height));
        let (metres_x, metres_y) = projection.metres_per_unit_at(0.5 * (y_min + y_max));
        let (cell_x, cell_y) =
            config.cell_m.map_or_else(|| dsm.geotransform.cell_size(), |metres| (metres / metres_x, metres / metres_y));
        if ![cell_x, cell_y].iter().all(|cell| *cell > 0.0 && cell.is_finite()) {
            return Err(SettingError::new("the cell size", cell_x, "a positive number of metres").into());
        }
        let count = |low: f64, high: f64, cell: f64| {
            let cells = ((high - low) / cell - 1e-6).ceil();
            if cells >= 1.0 && cells <= CELLS_MAX as f64 {
                return Ok(cells as usize);
            }
            Err(OrthoError::Extent { low, high, cells, cell })
        };
        let (columns, rows) = (count(x_min, x_max, cell_x)?, count(y_min, y_max, cell_y)?);
        if columns.saturating_mul(rows) > CELLS_MAX {
            return Err(OrthoError::TooLarge { width: columns, height: rows, bands: 1 });
        }
        let geotransform = GeoTransform([x_min, cell_x, 0.0, y_max, 0.0, -cell_y]);
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
