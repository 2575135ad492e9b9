//! Points of a model, searched for in an image.

use camera::ImagePoint;
use geodesy::LonLatHeight;
use numeric::Progress;
use occlusion::OcclusionSurface;
use raster::{Grid, bicubic};
use rayon::prelude::*;
use sweep::pointing::{Chip, ChipConfig, ChipPlace, ChipSearch, ControlPoint, find_chip};

use super::error::RegisterError;
use super::evidence::sharing;
use super::frames::{Frame, Frames, Laid};
use super::model::{Looks, Model, NewImage};
use super::spots::best_spot;
use super::vote::{self, Voter};
use crate::ortho::OrthoImage;

/// Points of a lattice along the longer side of the model.
const POINTS_ALONG: usize = 16;
/// Where the lattices begin, spacings: one after the other is searched until enough points hold.
const LATTICES: [[f64; 2]; 4] = [[0.5, 0.5], [0.0, 0.0], [0.5, 0.0], [0.0, 0.5]];
/// Points that share a shift and are enough: with places to 0.2 pixels, six parameters of a
/// correction are then known to 0.05 pixels.
pub(super) const ENOUGH: usize = 100;
/// Farthest that a point moves from its lattice to where more is seen, cells of a frame.
const SLACK: usize = 24;
/// Distance within which images of the model agree on a place, cells of a frame: the mean of those
/// that do is taken, because each sees the surface's errors from another side.
const SAME_PLACE: f64 = 1.0;
/// Pixels around a chip, for the derivatives and for slopes of the ground.
const AROUND: usize = 6;
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

/// What is shown of the image that is searched.
#[derive(Debug, Clone, Copy)]
enum Shows {
    /// Where it sees the model.
    Model,
    /// All of it.
    All,
}

/// The model, as far as it was looked at.
pub(super) struct Searched<'a> {
    frames: Frames<'a>,
    /// The images that the model was made from, with what is laid of each on the frames.
    images: Vec<(&'a OrthoImage, Laid)>,
    /// The picture on the model's cells that is compared where there are no such images.
    picture: Option<&'a Grid<f32>>,
    /// What is searched for, by lattice, as far as it is known.
    spots: [Option<Vec<Spot>>; LATTICES.len()],
}

/// A place of the model that is worth comparing.
struct Spot {
    /// Column and row on the grid of the frames.
    centre: [usize; 2],
    /// Its surroundings in every picture of the model.
    chips: Vec<Grid<f32>>,
}

impl<'a> Searched<'a> {
    pub(super) fn new(model: &'a Model, surface: &'a OcclusionSurface<'a>, gsd_m: f64) -> Self {
        let (images, picture) = match &model.looks {
            Looks::Images(images) => (images.iter().map(|(_, image)| (image, Laid::default())).collect(), None),
            Looks::Picture(picture) => (Vec::new(), Some(picture)),
        };
        Self { frames: Frames::new(model, surface, gsd_m), images, picture, spots: Default::default() }
    }

    /// Returns the shifts of the image on which the spots of the first lattice agree, up to
    /// `reach_px` pixels; the likeliest first.
    pub(super) fn common_shifts(
        &mut self,
        new: &NewImage,
        reach_px: f64,
        progress: &dyn Progress,
    ) -> Result<Vec<[f64; 2]>, RegisterError> {
        let reach = reach_px.ceil() as usize;
        let spots = self.taken_spots(0, progress)?;
        let mut laid = Laid::default();
        let mut voters = Vec::with_capacity(spots.len());
        for spot in &spots {
            progress.check_cancelled()?;
            let frame = Frame { centre: spot.centre, half: half() };
            laid.lay(&new.image, &self.frames, frame)?;
            let shows = laid.picture(&self.frames, frame);
            let places = self.frames.places(&new.image.camera, frame, |cell| {
                let is_in_step = [cell % shows.width(), cell / shows.width()].iter().all(|at| at % vote::STEP == 0);
                is_in_step && shows.data()[cell].is_finite()
            });
            voters.extend(Voter::read(&spot.chips, &places, &new.image, reach)?);
        }
        let shifts = vote::common_shifts(&voters, reach);
        self.spots[0] = Some(spots);
        Ok(shifts)
    }

    /// Searches for points of the model in the image, up to `reach_px` pixels from where its camera
    /// expects them.
    ///
    /// First the image is shown where it sees the model. The interpolation and the derivatives lose
    /// some pixels along every border of such a picture, which is most of a small roof. If too few
    /// points are found, the whole image is shown, and what is not the model is left out of the
    /// chips alone. Those points see a little of what lies beside the model.
    pub(super) fn search(
        &mut self,
        new: &NewImage,
        reach_px: f64,
        progress: &dyn Progress,
    ) -> Result<Found, RegisterError> {
        let mut laid = Laid::default();
        let of_model = self.search_on(&mut laid, Shows::Model, new, reach_px, progress)?;
        let count = |found: &Found| sharing(&new.image.camera, &found.points).len();
        if count(&of_model) >= ENOUGH {
            return Ok(of_model);
        }
        let of_all = self.search_on(&mut laid, Shows::All, new, reach_px, progress)?;
        Ok(if count(&of_all) > count(&of_model) { of_all } else { of_model })
    }

    fn search_on(
        &mut self,
        laid: &mut Laid,
        shows: Shows,
        new: &NewImage,
        reach_px: f64,
        progress: &dyn Progress,
    ) -> Result<Found, RegisterError> {
        let config = ChipConfig::default();
        let mut found = Found { points: Vec::new(), tried: 0 };
        for lattice in 0..LATTICES.len() {
            let spots = self.taken_spots(lattice, progress)?;
            let around = |spot: &Spot| Frame { centre: spot.centre, half: half() + reach_px.ceil() as usize };
            for spot in &spots {
                progress.check_cancelled()?;
                laid.lay(&new.image, &self.frames, around(spot))?;
            }
            let (frames, laid) = (&self.frames, &*laid);
            let away = |spot: &Spot| {
                let away = match shows {
                    Shows::Model => displacement(&spot.chips, &laid.picture(frames, around(spot)), reach_px, &config),
                    Shows::All => {
                        let seen = laid.picture(frames, Frame { centre: spot.centre, half: half() });
                        let chips: Vec<Grid<f32>> = spot.chips.iter().map(|chip| where_seen(chip, &seen)).collect();
                        displacement(&chips, &laid.whole_picture(frames, around(spot)), reach_px, &config)
                    }
                };
                Some((spot.centre, away?))
            };
            let away: Vec<_> = spots.par_iter().filter_map(away).collect();
            found.tried += spots.len();
            found.points.extend(away.into_iter().filter_map(|(centre, away)| self.observed(centre, away, &new.image)));
            self.spots[lattice] = Some(spots);
            if sharing(&new.image.camera, &found.points).len() >= ENOUGH {
                break;
            }
        }
        Ok(found)
    }

    /// Takes the spots of a lattice, which are looked for where they are not known yet.
    fn taken_spots(&mut self, lattice: usize, progress: &dyn Progress) -> Result<Vec<Spot>, RegisterError> {
        match self.spots[lattice].take() {
            Some(spots) => Ok(spots),
            None => self.spots(LATTICES[lattice], progress),
        }
    }

    /// Returns the places near those of a lattice around which the model shows most, with the
    /// model's pictures of them.
    fn spots(&mut self, from: [f64; 2], progress: &dyn Progress) -> Result<Vec<Spot>, RegisterError> {
        let wide = half() + SLACK;
        let centres = self.frames.centres(POINTS_ALONG, from);
        for centre in &centres {
            progress.check_cancelled()?;
            for (image, laid) in &mut self.images {
                laid.lay(image, &self.frames, Frame { centre: *centre, half: wide })?;
            }
        }
        let laid: Vec<&Laid> = self.images.iter().map(|(_, laid)| laid).collect();
        let (frames, picture) = (&self.frames, self.picture);
        let pictures = |frame: Frame| match picture {
            Some(picture) => vec![frames.picture(frame, |[column, row]| bicubic(picture, column, row))],
            None => laid.iter().map(|laid| laid.picture(frames, frame)).collect(),
        };
        let spot = |&[column, row]: &[usize; 2]| {
            let [x, y] = best_spot(&pictures(Frame { centre: [column, row], half: wide }), SLACK)?;
            let centre = [(column + x).checked_sub(wide)?, (row + y).checked_sub(wide)?];
            let is_known = frames.height_at(centre.map(|at| at as f64)).is_finite();
            is_known.then(|| Spot { centre, chips: pictures(Frame { centre, half: half() }) })
        };
        Ok(centres.par_iter().filter_map(spot).collect())
    }

    /// Returns a point of the model with its place in the image: what the image shows `away` from
    /// it, in cells of the grid, is the point.
    fn observed(&self, centre: [usize; 2], away: [f64; 2], image: &OrthoImage) -> Option<ControlPoint> {
        let centre = centre.map(|at| at as f64);
        let at_height = |[lon, lat]: [f64; 2]| LonLatHeight::new(lon, lat, f64::from(self.frames.height_at(centre)));
        let seen = at_height(self.frames.lonlat([centre[0] + away[0], centre[1] + away[1]]));
        let place = image.camera.project(seen).ok()?;
        let (width, height) = (image.source.info().width as f64, image.source.info().height as f64);
        let inside = (0.0..width).contains(&place.sample) && (0.0..height).contains(&place.line);
        inside.then(|| ControlPoint {
            ground: at_height(self.frames.lonlat(centre)),
            horizontal_m: GROUND_M,
            vertical_m: GROUND_M,
            pixel_px: PLACE_PX,
            seen: vec![(0, ImagePoint::new(place.sample, place.line))],
        })
    }
}

/// Returns the cells of a picture of a spot on every side of its middle.
fn half() -> usize {
    ChipConfig::default().radius_max + AROUND
}

/// Returns a chip without the cells that a picture of the same cells does not show.
fn where_seen(chip: &Grid<f32>, seen: &Grid<f32>) -> Grid<f32> {
    chip.without(|i| !seen.data()[i].is_finite())
}

/// Returns how far from the middle of chips, in cells of the grid, the picture of the image shows
/// the same; `None` where nothing is trusted.
fn displacement(chips: &[Grid<f32>], picture: &Grid<f32>, reach_px: f64, config: &ChipConfig) -> Option<[f64; 2]> {
    let middle = |picture: &Grid<f32>| [picture.width(), picture.height()].map(|side| (side / 2) as f64);
    let expected = middle(picture);
    let search = ChipSearch { image: picture, expected, reach_px, image_from_chip: [[1.0, 0.0], [0.0, 1.0]] };
    let find = |chip: &Grid<f32>| find_chip(Chip { image: chip, point: middle(chip) }, &search, config).ok();
    let places: Vec<ChipPlace> = chips.iter().filter_map(find).collect();
    let place = common(&places)?;
    Some([0, 1].map(|axis| place[axis] - expected[axis]))
}

/// Returns the mean of the best place and of those that agree with it.
fn common(places: &[ChipPlace]) -> Option<[f64; 2]> {
    let best = places.iter().reduce(|best, other| if other.score > best.score { other } else { best })?.place;
    let is_near = |place: &[f64; 2]| (place[0] - best[0]).hypot(place[1] - best[1]) <= SAME_PLACE;
    let near: Vec<[f64; 2]> = places.iter().map(|place| place.place).filter(is_near).collect();
    Some([0, 1].map(|axis| near.iter().map(|place| place[axis]).sum::<f64>() / near.len() as f64))
}
