//! The images of a run with their cameras, and what their geometry says.

use std::path::{Path, PathBuf};

use camera::{CameraError, ImagePoint, RpcCamera};
use geodesy::{EnuFrame, LonLatHeight};
use raster::{Grid, Window};
use rayon::prelude::*;
use sweep::SweepView;

use crate::dsm::geometry::{PairGeometry, footprint, local_polygon, overlap_share, pair_geometry};
use crate::error::PipelineError;

/// An image before its pixels are read.
#[derive(Debug, Clone)]
pub(crate) struct Opened {
    pub(crate) path: PathBuf,
    pub(crate) rpc_format: String,
    pub(crate) camera: RpcCamera,
    /// Width and height, pixels.
    pub(crate) size: (usize, usize),
}

/// Two lines of sight closer than this give no height: at the noise of matching (a fifth of a pixel) it is off by
/// more than 20 pixels' worth of ground.
pub(crate) const ANGLE_MIN_DEG: f64 = 0.5;
/// Beyond this, walls and roofs look too different to be matched.
pub(crate) const ANGLE_MAX_DEG: f64 = 50.0;
/// Images that share less of their ground are not matched.
pub(crate) const OVERLAP_MIN: f64 = 0.05;

/// Opens all images and finds their RPCs.
pub(crate) fn open(paths: &[PathBuf]) -> Result<Vec<Opened>, PipelineError> {
    paths.iter().map(|p| open_one(p)).collect()
}

fn open_one(path: &Path) -> Result<Opened, PipelineError> {
    let source = io::raster::ImageSource::open(path)?;
    let file = io::rpc::read_for_image(path)?;
    Ok(Opened {
        path: path.to_owned(),
        rpc_format: file.format.to_string(),
        size: (source.info().width, source.info().height),
        camera: RpcCamera::new(file.rpc),
    })
}

/// Reads a window of an image (all of it for `None`), with its pyramid; the camera is moved to the window.
pub(crate) fn read_view(image: &Opened, window: Option<Window>) -> Result<SweepView, PipelineError> {
    let source = io::raster::ImageSource::open(&image.path)?;
    let window = window.unwrap_or(Window::whole(image.size.0, image.size.1));
    let mut image_grid = source.read_luma(window)?.luma;
    mask_black(&mut image_grid);
    let camera = image.camera.cropped(ImagePoint::new(window.x as f64, window.y as f64));
    Ok(SweepView::new(camera, image_grid))
}

/// Reads one pyramid level of a window, whose first pixel is one of the level's too; the camera is moved to the window.
pub(crate) fn read_coarse_view(image: &Opened, window: Window, level: usize) -> Result<SweepView, PipelineError> {
    let source = io::raster::ImageSource::open(&image.path)?;
    let mut picture = source.read_luma(window)?.luma;
    mask_black(&mut picture);
    for _ in 0..level {
        picture = raster::reduce(&picture);
    }
    let camera = image.camera.cropped(ImagePoint::new(window.x as f64, window.y as f64));
    Ok(SweepView::from_level(camera, level, picture))
}

/// Side of a square of nothing but zeros that no sensor's dark noise leaves, pixels.
const BLACK_SIDE: usize = 5;

/// Makes undeclared voids, squares of nothing but zeros, invalid: they would be compared with what the other views see.
fn mask_black(image: &mut Grid<f32>) {
    let (w, h) = (image.width(), image.height());
    let mut runs = vec![0usize; w];
    let mut squares = Vec::new();
    for y in 0..h {
        let mut columns = 0;
        for (x, run) in runs.iter_mut().enumerate() {
            *run = if image[(x, y)] == 0.0 { *run + 1 } else { 0 };
            columns = if *run >= BLACK_SIDE { columns + 1 } else { 0 };
            if columns >= BLACK_SIDE {
                squares.push((x + 1 - BLACK_SIDE, y + 1 - BLACK_SIDE));
            }
        }
    }
    for (x, y) in squares {
        (y..y + BLACK_SIDE).for_each(|v| image.row_mut(v)[x..x + BLACK_SIDE].fill(f32::NAN));
    }
}

/// Reads all views, in parallel.
pub(crate) fn read_views(
    images: &[Opened],
    windows: &[Option<Window>],
    done: &(dyn Fn() + Sync),
) -> Result<Vec<SweepView>, PipelineError> {
    let read = |(image, window): (&Opened, &Option<Window>)| {
        let view = read_view(image, *window);
        done();
        view
    };
    images.par_iter().zip(windows).map(read).collect()
}

/// Geometry of all pairs of images at a height; `None` for a pair that shares no ground.
pub(crate) struct Geometry {
    /// Middle of the ground that the first overlapping pair shares: a place that is surely in the scene.
    pub(crate) centre: LonLatHeight,
    /// A local frame there.
    pub(crate) frame: EnuFrame,
    /// The images' footprints in that frame.
    pub(crate) outlines: Vec<geo::Polygon<f64>>,
    pairs: Grid<Option<PairGeometry>>,
}

impl Geometry {
    /// Looks at the scene at `height_m`.
    pub(crate) fn at(images: &[Opened], height_m: f64) -> Result<Self, PipelineError> {
        let failed =
            |i: usize| move |source: CameraError| PipelineError::Camera { path: images[i].path.clone(), source };
        let prints: Vec<Vec<LonLatHeight>> = images
            .iter()
            .enumerate()
            .map(|(i, o)| footprint(&o.camera, o.size, height_m).map_err(failed(i)))
            .collect::<Result<_, _>>()?;
        let frame = EnuFrame::new(prints[0][0]);
        let outlines: Vec<geo::Polygon<f64>> = prints.iter().map(|p| local_polygon(p, &frame)).collect();
        let n = images.len();
        let mut pairs = Grid::filled(n, n, None);
        let mut centre = None;
        for i in 0..n {
            for j in i + 1..n {
                let share = overlap_share(&outlines[i], &outlines[j]);
                let Some(middle) = middle_of_both(&outlines[i], &outlines[j]) else { continue };
                let ground = LonLatHeight { height_m, ..frame.ground_from_enu(middle) };
                centre.get_or_insert(ground);
                // A camera that fails there belongs to a pair that cannot be matched.
                if let Ok(pair) = pair_geometry(&images[i].camera, &images[j].camera, ground, share) {
                    pairs[(i, j)] = Some(pair);
                    pairs[(j, i)] = Some(pair);
                }
            }
        }
        let Some(centre) = centre else { return Err(PipelineError::NoOverlap { share_percent: 0.0 }) };
        Ok(Self { centre, frame, outlines, pairs })
    }

    pub(crate) fn pair(&self, i: usize, j: usize) -> Option<&PairGeometry> {
        self.pairs.get(i, j).and_then(Option::as_ref)
    }

    /// Pairs that can give heights, the best angles first.
    pub(crate) fn useful_pairs(&self) -> Result<Vec<(usize, usize)>, PipelineError> {
        let n = self.outlines.len();
        let all: Vec<(usize, usize, PairGeometry)> = (0..n)
            .flat_map(|i| (i + 1..n).map(move |j| (i, j)))
            .filter_map(|(i, j)| self.pair(i, j).map(|p| (i, j, *p)))
            .collect();
        let largest = |f: fn(&PairGeometry) -> f64| all.iter().map(|p| f(&p.2)).fold(0.0, f64::max);
        let overlap = largest(|p| p.overlap);
        if overlap < OVERLAP_MIN {
            return Err(PipelineError::NoOverlap { share_percent: 100.0 * overlap });
        }
        let mut useful: Vec<_> = all
            .iter()
            .filter(|(_, _, p)| p.overlap >= OVERLAP_MIN && (ANGLE_MIN_DEG..=ANGLE_MAX_DEG).contains(&p.angle_deg))
            .collect();
        if useful.is_empty() {
            let angle_deg = largest(|p| p.angle_deg);
            return Err(PipelineError::NoParallax { angle_deg, needed_deg: ANGLE_MIN_DEG });
        }
        useful.sort_by(|a, b| angle_merit(b.2.angle_deg).total_cmp(&angle_merit(a.2.angle_deg)));
        Ok(useful.into_iter().map(|(i, j, _)| (*i, *j)).collect())
    }
}

/// How useful an intersection angle is, 0 to 1: small ones give imprecise heights, large ones different pictures.
/// The best published pairs lie between 5° and 25°.
pub(crate) fn angle_merit(angle_deg: f64) -> f64 {
    (-((angle_deg - 15.0) / 15.0).powi(2)).exp()
}

fn middle_of_both(a: &geo::Polygon<f64>, b: &geo::Polygon<f64>) -> Option<geodesy::EnuPoint> {
    use geo::{BooleanOps, Centroid};
    let middle = a.intersection(b).centroid()?;
    Some(geodesy::EnuPoint { east: middle.x(), north: middle.y(), up: 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_squares_are_voids_and_dark_pixels_are_not() {
        let mut image = Grid::filled(30, 20, 0.0f32);
        for (i, v) in image.data_mut().iter_mut().enumerate().filter(|(i, _)| i % 30 >= 12) {
            *v = if i % 3 == 1 { 0.0 } else { 4.0 };
        }
        mask_black(&mut image);
        let voids = |from: usize, to: usize| {
            (0..20).flat_map(|y| (from..to).map(move |x| (x, y))).filter(|p| image[*p].is_nan()).count()
        };
        assert_eq!((voids(0, 12), voids(12, 30)), (240, 0));
    }
}
