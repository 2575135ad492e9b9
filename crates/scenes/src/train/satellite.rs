//! Training on satellite images: splats of a surface model learn from the images that see them.
//!
//! Each image is seen through its RPC with its correction, taken at the nodes of a lattice in space
//! and checked against the exact RPC. Colours are those of the splats: a gain and an offset bring
//! every image to them before the training, and are learned further on. A surface model holds the
//! heights: it is one more view, from above, that has depths and no colours.

use std::path::{Path, PathBuf};

use ::splats::RpcSplatCamera;
use ::train::{Drawing, LatticeBox, LatticeView, MAX_SIDE, Registers, Surfel, SurfelImages, TrainingView};
use camera::RpcCamera;
use crs::MapProjection;
use formats::raster::{Dem, ImageSource};
use formats::splat_ply::LocalOrigin;
use numeric::{Progress, upper_median};
use raster::{GeoTransform, Grid, Window};

use super::error::TrainError;
use super::exposure::line;
use crate::splats::pointing_path;
use job::corrections::{CorrectionSource, Corrections};
use job::map_surface::MapSurface;

/// Distance of the nodes of a lattice, metres.
const NODES_M: f64 = 32.0;
/// Room around the splats, metres.
const MARGIN_M: f64 = 20.0;
/// Most splats at which the lattice is compared with the exact RPC.
const CHECKED: usize = 5000;
/// Largest difference from the exact RPC, pixels.
const ERROR_MAX_PX: f64 = 0.02;
/// Coverage above which a pixel belongs to the model.
const COVERED: f32 = 0.5;
/// Places along each side of a cell whose median height is the height of the cell.
const PLACES: usize = 3;
/// Rows of cells that are drawn at once, which bounds the memory.
const BAND_ROWS: usize = 256;

/// Splats with their place on the map.
#[derive(Debug, Clone)]
pub(super) struct PlacedSurfels {
    pub(super) surfels: Vec<Surfel>,
    pub(super) origin: LocalOrigin,
    projection: MapProjection,
}

/// An image as the splats are compared with it.
#[derive(Debug, Clone)]
pub(super) struct SatelliteImage {
    pub(super) name: String,
    pub(super) view: TrainingView<LatticeView>,
    /// Largest difference of the camera from the exact RPC at splats, pixels.
    pub(super) camera_error_px: f64,
}

/// Greatest opacity at the beginning. Opaque splats would not learn.
const OPACITY_LOGIT_MAX: f32 = 3.0;

impl PlacedSurfels {
    /// Reads splats whose heights are above the ellipsoid.
    pub(super) fn read(path: &Path) -> Result<Self, TrainError> {
        let file = formats::splat_files::read(path)?;
        let invalid = |what: String| TrainError::Dataset { path: path.to_owned(), what };
        let origin = file.origin.ok_or_else(|| {
            invalid(format!(
                "no origin beside the splats: expected {}",
                formats::splat_ply::origin_path(path).display()
            ))
        })?;
        if origin.vertical != "ellipsoid" {
            return Err(invalid(format!(
                "the heights of the splats are above {}, expected the ellipsoid",
                origin.vertical
            )));
        }
        if file.splats.len() < 4 {
            return Err(TrainError::NoPoints { count: file.splats.len(), path: path.to_owned() });
        }
        let projection = MapProjection::from_definition(&origin.crs).map_err(|e| invalid(e.to_string()))?;
        let surfel = |splat: &gaussian::Splat| {
            let surfel = Surfel::of_splat(splat);
            Surfel { opacity_logit: surfel.opacity_logit.min(OPACITY_LOGIT_MAX), ..surfel }
        };
        Ok(Self { surfels: file.splats.iter().map(surfel).collect(), origin, projection })
    }

    /// Returns the box around the splats.
    fn bounds(&self) -> [[f64; 3]; 2] {
        let along = |axis: usize| self.surfels.iter().map(move |surfel| f64::from(surfel.position[axis]));
        let low = [0, 1, 2].map(|axis| along(axis).fold(f64::INFINITY, f64::min) - MARGIN_M);
        let high = [0, 1, 2].map(|axis| along(axis).fold(f64::NEG_INFINITY, f64::max) + MARGIN_M);
        [low, high]
    }

    /// Reads the images that see the splats.
    pub(super) fn images(
        &self,
        paths: &[PathBuf],
        corrections: &Corrections,
        progress: &dyn Progress,
    ) -> Result<Vec<SatelliteImage>, TrainError> {
        progress.begin("images", paths.len());
        let one = |path: &PathBuf| {
            progress.check_cancelled()?;
            let image = self.image(path, &corrections.camera(path, progress)?)?;
            progress.step();
            Ok(image)
        };
        paths.iter().map(one).collect()
    }

    fn image(&self, path: &Path, camera: &RpcCamera) -> Result<SatelliteImage, TrainError> {
        let invalid = |what: String| TrainError::Dataset { path: path.to_owned(), what };
        let unseen = || invalid("the image does not see the splats".to_owned());
        let source = ImageSource::open(path)?;
        let whole = source.window();
        let exact = RpcSplatCamera::new(camera, &self.projection, self.origin.origin, (whole.width, whole.height))?
            .ok_or_else(unseen)?;
        let every = self.surfels.len().div_ceil(CHECKED);
        let sample: Vec<[f64; 3]> = self.surfels.iter().step_by(every).map(|s| s.position.map(f64::from)).collect();
        let pixels = exact.pixels(sample.iter().copied())?;
        let window = around(&pixels, whole).ok_or_else(unseen)?;
        let start = [window.x as f64, window.y as f64];
        let moved = |p: &[f64; 2]| [p[0] - start[0], p[1] - start[1]];
        let [low, high] = self.bounds();
        let lattice = LatticeBox::new(low, high, NODES_M);
        let nodes = exact.pixels(lattice.nodes())?.iter().map(moved).collect();
        let sight = exact.towards_sensor().map(|c| -c);
        let camera = LatticeView::new(lattice, nodes, sight, [window.width, window.height]).ok_or_else(unseen)?;
        let apart = |(p, pixel): (&[f64; 3], &[f64; 2])| {
            let (found, exact) = (camera.pixel(*p), moved(pixel));
            (found[0] - exact[0]).hypot(found[1] - exact[1])
        };
        let camera_error_px = sample.iter().zip(&pixels).map(apart).fold(0.0, f64::max);
        if camera_error_px > ERROR_MAX_PX {
            return Err(invalid(format!(
                "the RPC bends by {camera_error_px:.3} px between places {NODES_M} m apart, expected less than \
                 {ERROR_MAX_PX} px"
            )));
        }
        let grid = source.read_colour(window)?;
        let colour = [0, 1, 2].map(|c| grid.data().iter().map(|p| p[c]).collect());
        let mut view = TrainingView::new(camera, colour);
        let drawing = Drawing::new(&self.surfels, &view.camera, Registers::Longest);
        toned(&mut view, drawing.images());
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(SatelliteImage { name, view, camera_error_px })
    }

    /// Returns the view of a surface model from above.
    pub(super) fn above(&self, surface: &MapSurface) -> Option<TrainingView<LatticeView>> {
        let heights = surface.dem.heights.data();
        let depth = |z: &f32| (self.origin.origin[2] - f64::from(*z)) as f32;
        Some(TrainingView {
            // The surface has no holes where its height is known.
            mask: Some(heights.iter().map(|z| z.is_finite()).collect()),
            prior_depth_m: Some(heights.iter().map(depth).collect()),
            ..self.blank_from_above(&surface.dem)?
        })
    }

    /// Returns the view from above of heights in any unit and from any zero.
    pub(super) fn above_relative(&self, heights: &Dem) -> Option<TrainingView<LatticeView>> {
        let depths = heights.heights.data().iter().map(|z| -z).collect();
        Some(TrainingView { relative_depth: Some(depths), ..self.blank_from_above(heights)? })
    }

    /// Returns a view of the cells of a grid from above that shows nothing.
    fn blank_from_above(&self, grid: &Dem) -> Option<TrainingView<LatticeView>> {
        let size = [grid.heights.width(), grid.heights.height()];
        let nothing = || vec![f32::NAN; size[0] * size[1]];
        let camera = self.view_from_above(&grid.geotransform, size, 1)?;
        Some(TrainingView::new(camera, [nothing(), nothing(), nothing()]))
    }

    /// Checks that a raster lies on the map of the splats.
    pub(super) fn check_map(&self, path: &Path, raster: &Dem) -> Result<(), TrainError> {
        let found = raster.horizontal_epsg.map(|code| format!("EPSG:{code}"));
        match found.filter(|found| *found != self.origin.crs && self.origin.crs.starts_with("EPSG:")) {
            None => Ok(()),
            Some(found) => Err(TrainError::Dataset {
                path: path.to_owned(),
                what: format!("the raster is in {found}, the splats in {}: warp it first", self.origin.crs),
            }),
        }
    }

    /// Returns the camera that sees the cells of a grid from above, each as `side` × `side` pixels.
    fn view_from_above(&self, grid: &GeoTransform, size: [usize; 2], side: usize) -> Option<LatticeView> {
        let [low, high] = self.bounds();
        let lattice = LatticeBox::new(low, high, f64::INFINITY);
        let [x0, y0, _] = self.origin.origin;
        let half = (side as f64 - 1.0) / 2.0;
        let pixel = |p: [f64; 3]| {
            let cell = grid.cell_from_map(p[0] + x0, p[1] + y0);
            cell.map_or([f64::NAN; 2], |(column, row)| [column, row].map(|c| c * side as f64 + half))
        };
        let pixels = lattice.nodes().map(pixel).collect();
        LatticeView::new(lattice, pixels, [0.0, 0.0, -1.0], size.map(|s| s * side))
    }

    /// Returns the heights of splats at the cells of a grid, metres above the ellipsoid: the
    /// medians of places within each cell. A cell where splats cover no place by half is NaN.
    ///
    /// The depth of a pixel is a mean over splats, which lies between roof and ground at a wall.
    pub(super) fn heights(&self, surfels: &[Surfel], surface: &MapSurface) -> Option<Grid<f32>> {
        let (width, height) = (surface.dem.heights.width(), surface.dem.heights.height());
        let mut out = Grid::filled(width, height, f32::NAN);
        let places = if width * PLACES <= MAX_SIDE { PLACES } else { 1 };
        let mut drawing = None;
        for first in (0..height).step_by(BAND_ROWS) {
            let rows = BAND_ROWS.min(height - first);
            let band = surface.dem.geotransform.shifted(0.0, first as f64);
            let camera = self.view_from_above(&band, [width, rows], places)?;
            let drawing = drawing.get_or_insert_with(|| Drawing::new(&[], &camera, Registers::Longest));
            drawing.redraw(surfels, &camera);
            let images = drawing.images();
            for (cell, to) in out.data_mut()[first * width..(first + rows) * width].iter_mut().enumerate() {
                *to = self.median_height(images, [cell % width * places, cell / width * places], places);
            }
        }
        Some(out)
    }

    /// Returns the median height of the pixels of a cell, given its first pixel.
    fn median_height(&self, images: &SurfelImages, [x, y]: [usize; 2], side: usize) -> f32 {
        let seen = |k: usize| {
            let pixel = (y + k / side) * images.size[0] + x + k % side;
            let (coverage, depth_m) = (images.coverage[pixel], images.depth_m[pixel]);
            (coverage > COVERED).then(|| self.origin.origin[2] - f64::from(depth_m / coverage))
        };
        let mut heights: Vec<f64> = (0..side * side).filter_map(seen).collect();
        upper_median(&mut heights).map_or(f32::NAN, |height| height as f32)
    }
}

/// Returns the corrections of the images: those that the splats were made with, unless another
/// source is given.
pub(super) fn corrections(splats: &Path, source: &CorrectionSource) -> Result<Corrections, TrainError> {
    let beside = pointing_path(splats);
    Ok(match source {
        CorrectionSource::Report(path) => Corrections::read(path)?,
        CorrectionSource::SurfaceRun if beside.is_file() => Corrections::read(&beside)?,
        _ => Corrections::default(),
    })
}

/// Returns the part of an image around pixels.
fn around(pixels: &[[f64; 2]], whole: Window) -> Option<Window> {
    let within = |i: usize, size: usize| {
        let values = pixels.iter().map(|p| p[i]).filter(|v| v.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let from = (low - 8.0).floor().max(0.0);
        let to = (high + 9.0).ceil().min(size as f64);
        (to >= from + 16.0).then_some((from as usize, (to - from) as usize))
    };
    let ((x, width), (y, height)) = (within(0, whole.width)?, within(1, whole.height)?);
    Some(Window { x: x as i64, y: y as i64, width, height })
}

/// Brings the colours of a view to those that splats show, by a gain and an offset for each
/// channel. Pixels that splats do not cover have none.
fn toned(view: &mut TrainingView<LatticeView>, images: &SurfelImages) {
    for k in 0..3 {
        let shown = |pixel: usize| images.colour[k][pixel] / images.coverage[pixel];
        let counts = |pixel: usize| images.coverage[pixel] > COVERED;
        let (gain, offset) = line(&view.colour[k], shown, counts);
        for (pixel, value) in view.colour[k].iter_mut().enumerate() {
            *value = if counts(pixel) { gain * *value + offset } else { f32::NAN };
        }
    }
}
