//! Points of a model, searched for in an image.

use camera::ImagePoint;
use geodesy::LonLatHeight;
use numeric::Progress;
use occlusion::OcclusionSurface;
use ortho::Sight;
use raster::{Grid, bicubic};
use rayon::prelude::*;
use sweep::pointing::{Chip, ChipConfig, ChipPlace, ChipSearch, ControlPoint, find_chip};

use super::error::RegisterError;
use super::evidence::sharing;
use super::model::{Looks, Model, NewImage};
use super::spots::best_spot;
use crate::ortho::{Cell, OrthoImage, look};

/// Points of a lattice along the longer side of the model.
const POINTS_ALONG: usize = 16;
/// Where the lattices begin, spacings: one after the other is searched until enough points hold.
const LATTICES: [[f64; 2]; 4] = [[0.5, 0.5], [0.0, 0.0], [0.5, 0.0], [0.0, 0.5]];
/// Points that share a shift and are enough: with places to 0.2 pixels, six parameters of a
/// correction are then known to 0.05 pixels.
const ENOUGH: usize = 100;
/// Farthest that a point moves from its lattice to where more is seen, cells of a frame.
const SLACK: usize = 24;
/// Distance within which images of the model agree on a place, cells of a frame: the mean of those
/// that do is taken, because each sees the surface's errors from another side.
const SAME_PLACE: f64 = 1.0;
/// Pixels around a chip, for the derivatives and for slopes of the ground.
const AROUND: usize = 6;
/// Height by which the surface must stand above a line of sight to hide what is behind it, metres.
/// Noise of a measured surface hides nothing.
const TOLERANCE_M: f64 = 1.0;
/// Standard deviation of a place found by least-squares matching, pixels.
const PLACE_PX: f64 = 0.2;
/// Standard deviation of the position of a point of the model, metres. The surface is what the
/// image is registered to, so its points hardly move.
const GROUND_M: f64 = 0.01;

/// Points of the model that were found in the image.
pub(super) struct Found {
    pub(super) points: Vec<ControlPoint>,
    /// Number of points searched for.
    pub(super) tried: usize,
}

/// Searches for points of the model in the image, up to `reach_px` pixels from where its camera
/// expects them.
pub(super) fn search(
    model: &Model,
    new: &NewImage,
    reach_px: f64,
    progress: &dyn Progress,
) -> Result<Found, RegisterError> {
    let config = ChipConfig::default();
    let surface = OcclusionSurface::new(&model.heights, model.cell_m);
    let frames = Frames {
        model,
        surface: &surface,
        step: new.gsd_m / model.cell_m,
        chip_half: config.radius_max + AROUND,
        image_half: config.radius_max + AROUND + reach_px.ceil() as usize,
    };
    let mut found = Found { points: Vec::new(), tried: 0 };
    for from in LATTICES {
        for centre in frames.centres(from) {
            progress.check_cancelled()?;
            let Some((chips, spot, centre)) = frames.chips(centre)? else { continue };
            let cells = frames.cells(centre, frames.image_half);
            let image = picture(frames.image_half, grey(&surface, &new.image, &cells)?);
            let expected = [frames.image_half as f64; 2];
            let search = ChipSearch { image: &image, expected, reach_px, image_from_chip: [[1.0, 0.0], [0.0, 1.0]] };
            let places =
                chips.par_iter().map(|chip| find_chip(Chip { picture: chip, point: spot }, &search, &config).ok());
            let places: Vec<ChipPlace> = places.collect::<Vec<_>>().into_iter().flatten().collect();
            found.tried += 1;
            let Some(place) = common(&places) else { continue };
            let away = [0, 1].map(|axis| (place[axis] - expected[axis]) * frames.step);
            found.points.extend(frames.observed(centre, away, &new.image));
        }
        if sharing(&new.image.camera, &found.points).len() >= ENOUGH {
            break;
        }
    }
    Ok(found)
}

/// Returns the mean of the best place and of those that agree with it.
fn common(places: &[ChipPlace]) -> Option<[f64; 2]> {
    let best = places.iter().reduce(|best, other| if other.score > best.score { other } else { best })?.place;
    let is_near = |place: &[f64; 2]| (place[0] - best[0]).hypot(place[1] - best[1]) <= SAME_PLACE;
    let near: Vec<[f64; 2]> = places.iter().map(|place| place.place).filter(is_near).collect();
    Some([0, 1].map(|axis| near.iter().map(|place| place[axis]).sum::<f64>() / near.len() as f64))
}

/// The frames in which the model and the image are compared: cells of the image's pixel size around
/// points of the model.
struct Frames<'a> {
    model: &'a Model,
    surface: &'a OcclusionSurface<'a>,
    /// Cells of the model per cell of a frame.
    step: f64,
    /// Half widths of the frames of the model and of the image.
    chip_half: usize,
    image_half: usize,
}

/// Pictures of the surroundings of a point by image, its place in them, and its cell of the model.
type Spot = (Vec<Grid<f32>>, [f64; 2], [f64; 2]);

impl Frames<'_> {
    /// Returns cells with heights on a lattice over the model that begins so many spacings from its
    /// corner.
    fn centres(&self, from: [f64; 2]) -> Vec<[f64; 2]> {
        let (width, height) = (self.model.heights.width(), self.model.heights.height());
        let spacing = width.max(height) as f64 / POINTS_ALONG as f64;
        let along = |cells: usize, from: f64| {
            let count = (cells as f64 / spacing).floor().max(1.0);
            (0..count as usize).map(move |i| ((i as f64 + from) * cells as f64 / count).floor())
        };
        let lattice = along(height, from[1]).flat_map(|row| along(width, from[0]).map(move |column| [column, row]));
        lattice.filter(|[column, row]| self.surface.height_at(*column, *row).is_finite()).collect()
    }

    /// Returns the cells of a frame, row by row.
    fn cells(&self, [column, row]: [f64; 2], half: usize) -> Vec<Option<Cell>> {
        let side = 2 * half + 1;
        let at = |i: usize| (i as f64 - half as f64) * self.step;
        (0..side * side).map(|k| self.cell(column + at(k % side), row + at(k / side))).collect()
    }

    fn cell(&self, column: f64, row: f64) -> Option<Cell> {
        let nearest = (column.round().max(0.0) as usize, row.round().max(0.0) as usize);
        let is_marked = |mask: &Grid<bool>| mask.get(nearest.0, nearest.1).is_some_and(|marked| *marked);
        if self.model.unobserved.as_ref().is_some_and(is_marked) || is_marked(&self.model.beside_jumps) {
            return None;
        }
        let height = self.surface.height_at(column, row);
        let [lon, lat] = self.model.ground.lonlat(column, row);
        let ground = LonLatHeight::new(lon, lat, f64::from(height));
        height.is_finite().then_some(Cell { in_dsm: [column, row], ground })
    }

    /// Returns what the model looks like around a point of a lattice, the place in these pictures
    /// around which they show most, and that place on the model; `None` where they show nothing.
    fn chips(&self, [column, row]: [f64; 2]) -> Result<Option<Spot>, RegisterError> {
        let half = self.chip_half + SLACK;
        let cells = self.cells([column, row], half);
        let chips = match &self.model.looks {
            Looks::Picture(seen) => {
                let value = |cell: &Option<Cell>| match cell {
                    Some(cell) => bicubic(seen, cell.in_dsm[0], cell.in_dsm[1]),
                    None => f32::NAN,
                };
                vec![picture(half, cells.iter().map(value).collect())]
            }
            Looks::Images(images) => {
                let one = |(_, image): &(_, OrthoImage)| Ok(picture(half, grey(self.surface, image, &cells)?));
                images.iter().map(one).collect::<Result<_, RegisterError>>()?
            }
        };
        let Some(spot) = best_spot(&chips, SLACK) else { return Ok(None) };
        let moved = spot.map(|at| (at as f64 - half as f64) * self.step);
        let centre = [column + moved[0], row + moved[1]];
        let is_known = self.surface.height_at(centre[0], centre[1]).is_finite();
        Ok(is_known.then(|| (chips, spot.map(|at| at as f64), centre)))
    }

    /// Returns a point of the model with its place in the image: what the image shows `away` from
    /// it, in cells of the model, is the point.
    fn observed(&self, [column, row]: [f64; 2], away: [f64; 2], image: &OrthoImage) -> Option<ControlPoint> {
        let height_m = f64::from(self.surface.height_at(column, row));
        let [lon, lat] = self.model.ground.lonlat(column, row);
        let own = LonLatHeight::new(lon, lat, height_m);
        let [lon, lat] = self.model.ground.lonlat(column + away[0], row + away[1]);
        let place = image.camera.project(LonLatHeight::new(lon, lat, own.height_m)).ok()?;
        let (width, height) = (image.source.info().width as f64, image.source.info().height as f64);
        let inside = (0.0..width).contains(&place.sample) && (0.0..height).contains(&place.line);
        inside.then(|| ControlPoint {
            ground: own,
            horizontal_m: GROUND_M,
            vertical_m: GROUND_M,
            pixel_px: PLACE_PX,
            seen: vec![(0, ImagePoint::new(place.sample, place.line))],
        })
    }
}

/// Returns the mean over the bands of an image at cells; NaN where the image does not see them.
fn grey(surface: &OcclusionSurface<'_>, image: &OrthoImage, cells: &[Option<Cell>]) -> Result<Vec<f32>, RegisterError> {
    let seen = look(surface, image, cells, TOLERANCE_M)?;
    let bands = seen.values.len().max(1) as f32;
    let value = |(k, sight): (usize, &Sight)| match sight {
        Sight::Seen { .. } => seen.values.iter().map(|band| band[k]).sum::<f32>() / bands,
        _ => f32::NAN,
    };
    Ok(seen.sights.iter().enumerate().map(value).collect())
}

fn picture(half: usize, values: Vec<f32>) -> Grid<f32> {
    let side = 2 * half + 1;
    Grid::from_vec(side, side, values).unwrap_or_else(|| Grid::filled(0, 0, f32::NAN))
}
