//! Looks at cells through one image: whether the image sees them, and the values of its bands
//! there.

use camera::ImagePoint;
use geodesy::LonLatHeight;
use occlusion::{Eyeline, OcclusionSurface};
use ortho::Sight;
use raster::{Grid, Window, bicubic};
use rayon::prelude::*;

use super::error::OrthoError;
use super::inputs::{OrthoImage, Pixels};

/// Margin around the needed pixels, for the bicubic interpolation, pixels.
const MARGIN: usize = 3;
/// Most pixels of an image that are read at once. An image much finer than the ortho is read for
/// fewer cells at a time.
const PIXELS_MAX: usize = 1 << 27;

/// A cell of the ortho.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    /// Column and row in the surface model.
    pub(crate) in_dsm: [f64; 2],
    pub(crate) ground: LonLatHeight,
}

/// Cells as one image sees them.
pub(crate) struct Seen {
    pub(crate) sights: Vec<Sight>,
    /// Values by band; NaN where the image has none.
    pub(crate) values: Vec<Vec<f32>>,
}

/// Looks at cells through an image. Hidden cells get the values of what hides them.
pub(crate) fn look<P: Pixels>(
    surface: &OcclusionSurface<'_>,
    image: &OrthoImage<P>,
    cells: &[Option<Cell>],
    tolerance_m: f64,
) -> Result<Seen, OrthoError> {
    let (width, height) = image.source.size();
    let (width, height) = (width as f64 - 1.0, height as f64 - 1.0);
    let inside = |p: &ImagePoint| (0.0..=width).contains(&p.sample) && (0.0..=height).contains(&p.line);
    // Threads can share the geometry of the image, but not its open file.
    let (camera, eyeline) = (&image.camera, &image.eyeline);
    let places: Vec<Option<ImagePoint>> =
        cells.par_iter().map(|cell| camera.project(cell.as_ref()?.ground).ok().filter(inside)).collect();
    let mut sights: Vec<Sight> = cells
        .par_iter()
        .zip(&places)
        .map(|(cell, place)| match (cell, place) {
            (Some(cell), Some(_)) => sight(surface, eyeline, cell, tolerance_m),
            _ => Sight::Outside,
        })
        .collect();
    let values = values(&image.source, &places)?;
    for (i, sight) in sights.iter_mut().enumerate() {
        if values.iter().any(|band| band[i].is_nan()) {
            *sight = Sight::Outside;
        }
    }
    Ok(Seen { sights, values })
}

/// Finds out whether the surface hides a cell from the image.
fn sight(surface: &OcclusionSurface<'_>, eyeline: &Eyeline, cell: &Cell, tolerance_m: f64) -> Sight {
    let [column, row] = cell.in_dsm;
    let towards = eyeline.per_metre(column, row);
    if surface.hides(column, row, cell.ground.height_m, towards, tolerance_m) {
        Sight::Hidden
    } else {
        Sight::Seen { incidence_deg: eyeline.incidence_deg(column, row) }
    }
}

/// Reads the values of all bands at image points.
fn values(source: &impl Pixels, places: &[Option<ImagePoint>]) -> Result<Vec<Vec<f32>>, OrthoError> {
    let bands = source.bands();
    let Some(window) = window_of(places) else { return Ok(vec![vec![f32::NAN; places.len()]; bands]) };
    let pixels = window.width.saturating_mul(window.height);
    if pixels > PIXELS_MAX && places.len() > 1 {
        return halves(source, places);
    }
    let sample = |pixels: &Grid<f32>, place: &Option<ImagePoint>| match place {
        Some(at) => bicubic(pixels, at.sample - window.x as f64, at.line - window.y as f64),
        None => f32::NAN,
    };
    let band = |number: usize| {
        let pixels = source.band(number, window)?;
        Ok(places.par_iter().map(|place| sample(&pixels, place)).collect())
    };
    (1..=bands).map(band).collect()
}

/// Reads the values in two halves.
fn halves(source: &impl Pixels, places: &[Option<ImagePoint>]) -> Result<Vec<Vec<f32>>, OrthoError> {
    let (first, second) = places.split_at(places.len() / 2);
    let (mut first, second) = (values(source, first)?, values(source, second)?);
    first.iter_mut().zip(second).for_each(|(all, rest)| all.extend(rest));
    Ok(first)
}

/// Returns the window of pixels that image points need; `None` without a point.
pub(crate) fn window_of(places: &[Option<ImagePoint>]) -> Option<Window> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for place in places.iter().flatten() {
        low = [low[0].min(place.sample), low[1].min(place.line)];
        high = [high[0].max(place.sample), high[1].max(place.line)];
    }
    let side = |i: usize| (high[i].ceil() - low[i].floor()) as usize + 1;
    let first = Window { x: low[0].floor() as i64, y: low[1].floor() as i64, width: 1, height: 1 };
    low[0].is_finite().then(|| Window { width: side(0), height: side(1), ..first }.grown(MARGIN))
}
