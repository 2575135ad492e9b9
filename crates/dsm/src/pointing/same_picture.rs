//! One picture under two RPCs: two images whose pixels are those of one exposure, whatever was done
//! to them (compression, other grey values, noise, a border cut off).
//!
//! The pixels alone tell, whatever the RPCs say. Squares of one image are searched for in the other
//! around the same pixel, coarse to fine, by normalised correlation. Two exposures from different
//! directions differ in scale, in parallax and in what hides what, so that squares in the corners
//! and in the middle lie at different shifts. Copies have one shift everywhere.
//!
//! Where the detail is too fine for the coarse search, tie points tell the same.
//!
//! Only images that share most of their ground by their RPCs are compared. A copy that lies
//! elsewhere has no ties with the others and is set aside, and in a block most pairs share little.

use numeric::upper_median;
use raster::{Grid, Window, reduce};
use rayon::prelude::*;
use reconstruct::{ImagePair, ViewGeometry};
use sweep::SweepView;

use crate::error::DsmError;
use crate::images::image_pixels::read_view;
use crate::images::scene_image::SceneImage;
use crate::pointing::ties::{PairTies, TIES_MIN};

/// Side of the squares that are searched for, pixels: wide enough to hold detail of its own when it
/// is reduced to [`COARSE`].
const SIDE: usize = 192;
/// Largest shift that is searched for, pixels: what a cut border moves, or twice what bad pointing
/// does.
const REACH: usize = 256;
/// Number of times the sides are halved for the first search.
const COARSE: usize = 3;
/// Places of the first search that are looked at closer: a shift of half a coarse pixel lets the
/// true one lose to a similar one.
const CANDIDATES: usize = 6;
/// Places of the squares, as shares of the smallest image's sides: far enough apart to show a
/// difference of scale of one in three hundred.
const PLACES: [(f64, f64); 5] = [(0.5, 0.5), (0.22, 0.22), (0.78, 0.78), (0.78, 0.22), (0.22, 0.78)];
/// Places that must show the same, of those with texture.
const PLACES_MIN: usize = 3;
/// Least correlation of copies. A JPEG copy of a noisy image has 0.96, and one with noise of a
/// tenth of its contrast 0.99. Different exposures reach it too, on smooth ground and at one place.
const ALIKE: f32 = 0.9;
/// Least correlation of copies at half the resolution, where the true place lies up to half a pixel
/// beside the one found. Squares of a checkered pattern of three pixels, as fine as images resolve,
/// still have 0.6 then. Of less no other resolution is looked at.
const ALIKE_AT_HALF: f32 = 0.5;
/// Sums that are kept side by side, so that they fill the registers of vectors.
const LANES: usize = 8;
/// Least ground that two images share by their RPCs to be compared, as a share of the smaller
/// one's.
const SHARED_MIN: f64 = 0.5;
/// Shifts of one copy differ by no more than this, pixels. Those of the tests' good pairs, real and
/// simulated, differ by 7 to 60 pixels.
const SHIFT_SPREAD: i64 = 1;
/// Texture of a square that says anything, in standard deviations of the image's noise.
const TEXTURE_MIN: f32 = 3.0;

/// Ties of copies lie at one shift to this, pixels. Those of two exposures do so only where the
/// ground is flat to a few decimetres and both directions foreshorten it alike.
const TIE_SPREAD_PX: f64 = 0.1;
/// Share of the ties that must lie at one shift: of copies all but a few wrong ones do.
const TIE_SHARE: f64 = 0.9;

/// What one place says of two images.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Likeness {
    /// The square is there, at this shift.
    At([i64; 2]),
    /// The square is not there.
    Nowhere,
    /// There is nothing to compare.
    Blank,
}

/// The surroundings of a place in one image, and its coarser levels.
struct Place {
    levels: Vec<Grid<f32>>,
    /// First pixel of the surroundings in the image.
    origin: [i64; 2],
    noise: f32,
}

/// A pair that may be one picture, with the shifts found so far.
struct Suspect {
    pair: ImagePair,
    shifts: Vec<[i64; 2]>,
}

/// Finds two images that are one picture among those that share most of their ground; `views` are
/// the images where they were read as a whole.
///
/// # Errors
/// [`DsmError::Image`] for an image that cannot be read.
pub(crate) fn same_picture(
    images: &[SceneImage],
    geometry: &ViewGeometry,
    views: Option<&[SweepView]>,
) -> Result<Option<ImagePair>, DsmError> {
    let smallest = |of: fn(&SceneImage) -> usize| images.iter().map(of).min().unwrap_or(0);
    let (width, height) = (smallest(|image| image.size.0), smallest(|image| image.size.1));
    let side = SIDE.min(width.min(height) / 2);
    let pairs = (0..images.len()).flat_map(|i| (i + 1..images.len()).map(move |j| ImagePair::new(i, j)));
    let shares_ground = |pair: &ImagePair| geometry.pair(*pair).is_some_and(|p| p.overlap >= SHARED_MIN);
    let mut suspects: Vec<Suspect> =
        pairs.filter(shares_ground).map(|pair| Suspect { pair, shifts: Vec::new() }).collect();
    for (x, y) in PLACES {
        let start = |share: f64, size: usize| ((share * size as f64) as i64 - side as i64 / 2).max(0);
        let square = Window { x: start(x, width), y: start(y, height), width: side, height: side };
        let is_suspect = |i: usize| suspects.iter().any(|suspect| suspect.pair.has(i));
        let read = |(i, image): (usize, &SceneImage)| {
            if is_suspect(i) { Place::read(image, views.map(|all| &all[i]), square).map(Some) } else { Ok(None) }
        };
        let places: Vec<Option<Place>> = images.par_iter().enumerate().map(read).collect::<Result<_, _>>()?;
        let remains = |mut suspect: Suspect| {
            let (a, b) = (places[suspect.pair.first].as_ref()?, places[suspect.pair.second].as_ref()?);
            match likeness(a, b, square) {
                Likeness::Nowhere => return None,
                Likeness::Blank => {}
                Likeness::At(shift) => {
                    let first = *suspect.shifts.first().unwrap_or(&shift);
                    if (0..2).any(|axis| (first[axis] - shift[axis]).abs() > SHIFT_SPREAD) {
                        return None;
                    }
                    suspect.shifts.push(shift);
                }
            }
            Some(suspect)
        };
        suspects = suspects.into_par_iter().filter_map(remains).collect();
    }
    Ok(suspects.into_iter().find(|suspect| suspect.shifts.len() >= PLACES_MIN).map(|suspect| suspect.pair))
}

/// Finds a pair whose ties all lie at one shift, judged by its patches where it has some: there
/// are more of them, and they lie all over the ground.
pub(crate) fn at_one_shift(ties: &[PairTies]) -> Option<ImagePair> {
    let is_copy = |found: &&PairTies| {
        let ties = if found.patches.is_empty() { &found.ties } else { &found.patches };
        let shifts: Vec<[f64; 2]> = ties
            .iter()
            .map(|tie| [tie.source.sample - tie.reference.sample, tie.source.line - tie.reference.line])
            .collect();
        let middle = |axis: usize| upper_median(&mut shifts.iter().map(|shift| shift[axis]).collect::<Vec<f64>>());
        let (Some(x), Some(y)) = (middle(0), middle(1)) else { return false };
        let near = shifts.iter().filter(|shift| (shift[0] - x).hypot(shift[1] - y) < TIE_SPREAD_PX).count();
        shifts.len() >= TIES_MIN && near as f64 >= TIE_SHARE * shifts.len() as f64
    };
    ties.iter().find(is_copy).map(|found| found.pair)
}

impl Place {
    /// Reads what lies around a square, as far as the search goes.
    fn read(image: &SceneImage, view: Option<&SweepView>, square: Window) -> Result<Self, DsmError> {
        let reach = REACH as i64;
        let around = Window {
            x: square.x - reach,
            y: square.y - reach,
            width: square.width + 2 * REACH,
            height: square.height + 2 * REACH,
        };
        let Some(around) = around.intersection(&image.whole()) else {
            return Ok(Self { levels: Vec::new(), origin: [0; 2], noise: 0.0 });
        };
        let (finest, noise) = match view {
            Some(view) => (view.levels[0].window(around, f32::NAN), view.noise),
            None => {
                let mut view = read_view(image, around)?;
                (view.levels.swap_remove(0), view.noise)
            }
        };
        let mut levels = vec![finest];
        for level in 0..COARSE {
            levels.push(reduce(&levels[level]));
        }
        Ok(Self { levels, origin: [around.x, around.y], noise })
    }
}

/// Searches for the square of the first image in the second one.
fn likeness(first: &Place, second: &Place, square: Window) -> Likeness {
    let (Some(own), Some(other)) = (first.levels.last(), second.levels.last()) else { return Likeness::Blank };
    let of_square = |level: usize, place: &Place| {
        let scale = 1i64 << level;
        Window {
            x: (square.x - place.origin[0]) / scale,
            y: (square.y - place.origin[1]) / scale,
            width: square.width >> level,
            height: square.height >> level,
        }
    };
    let template = |level: usize| Template::of(&first.levels[level], of_square(level, first));
    let (Some(coarse), Some(fine)) = (template(COARSE), template(0)) else { return Likeness::Blank };
    if fine.deviation <= TEXTURE_MIN * first.noise || own.data().is_empty() || other.data().is_empty() {
        return Likeness::Blank;
    }
    let reach = (REACH >> COARSE) as i64;
    let at = of_square(COARSE, second);
    let places = coarse.places_near(other, [at.x, at.y], reach, CANDIDATES);
    if places.is_empty() {
        return Likeness::Blank;
    }
    let finer = |template: &Template, level: usize, place: [i64; 2]| {
        // A pixel of the coarser level is two here, and the square began on an odd one.
        let near = [2 * place[0], 2 * place[1]];
        template.places_near(&second.levels[level], near, 3, 1).pop()
    };
    let mut found = places;
    for level in (1..COARSE).rev() {
        let Some(template) = template(level) else { return Likeness::Nowhere };
        found = found.into_iter().filter_map(|(place, _)| finer(&template, level, place)).collect();
    }
    let is_alike = |(_, correlation): &([i64; 2], f32)| *correlation >= ALIKE_AT_HALF;
    let refined = found.into_iter().filter(is_alike).filter_map(|(place, _)| finer(&fine, 0, place));
    let best = refined.max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((place, correlation)) = best else { return Likeness::Nowhere };
    if correlation < ALIKE {
        return Likeness::Nowhere;
    }
    Likeness::At([place[0] + second.origin[0] - square.x, place[1] + second.origin[1] - square.y])
}

/// A square of pixels less their mean.
struct Template {
    width: usize,
    height: usize,
    pixels: Vec<f32>,
    /// Standard deviation, grey values.
    deviation: f32,
}

impl Template {
    /// Cuts a square out of an image; `None` where it has a hole or no texture at all.
    fn of(image: &Grid<f32>, square: Window) -> Option<Self> {
        let cut = image.window(square, f32::NAN);
        let count = cut.data().len() as f32;
        let mean = cut.data().iter().sum::<f32>() / count;
        let pixels: Vec<f32> = cut.data().iter().map(|value| value - mean).collect();
        let deviation = (pixels.iter().map(|value| value * value).sum::<f32>() / count).sqrt();
        (deviation > 0.0).then_some(Self { width: cut.width(), height: cut.height(), pixels, deviation })
    }

    /// Returns up to `count` places within `reach` of `near` at which the image is most alike, with
    /// the correlation there, the best first. None is beside a better one.
    fn places_near(&self, image: &Grid<f32>, near: [i64; 2], reach: i64, count: usize) -> Vec<([i64; 2], f32)> {
        let shifts = -reach..=reach;
        let places = shifts.clone().flat_map(|dy| shifts.clone().map(move |dx| [near[0] + dx, near[1] + dy]));
        let mut all: Vec<([i64; 2], f32)> =
            places.filter_map(|place| Some((place, self.correlation(image, place)?))).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut best: Vec<([i64; 2], f32)> = Vec::with_capacity(count);
        for (place, correlation) in all {
            let is_beside = |other: &([i64; 2], f32)| (0..2).all(|axis| (other.0[axis] - place[axis]).abs() <= 1);
            if best.len() < count && !best.iter().any(is_beside) {
                best.push((place, correlation));
            }
        }
        best
    }

    /// Returns the correlation with the square of an image that begins at a pixel.
    fn correlation(&self, image: &Grid<f32>, [x, y]: [i64; 2]) -> Option<f32> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        if x + self.width > image.width() || y + self.height > image.height() {
            return None;
        }
        let (mut sums, mut squares, mut products) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        // Sums about a value of the square itself keep the digits of images with a large offset.
        let offset = image[(x, y)];
        for (row, own) in self.pixels.chunks_exact(self.width).enumerate() {
            let values = &image.row(y + row)[x..x + self.width];
            for (values, own) in values.chunks(LANES).zip(own.chunks(LANES)) {
                for (lane, (value, own)) in values.iter().zip(own).enumerate() {
                    let value = value - offset;
                    sums[lane] += value;
                    squares[lane] += value * value;
                    products[lane] += value * own;
                }
            }
        }
        let [sum, squares, product] = [sums, squares, products].map(|lanes| lanes.iter().sum::<f32>());
        let count = self.pixels.len() as f32;
        let deviation = (squares / count - (sum / count).powi(2)).sqrt();
        let correlation = product / (count * deviation * self.deviation);
        correlation.is_finite().then_some(correlation)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use camera::ImagePoint;
    use sweep::pointing::Tie;

    use super::*;
    use crate::config::DsmConfig;
    use crate::images::image_pixels::read_views;
    use crate::images::open::open;

    /// The images and views of two views of the town.
    fn town() -> (Vec<SceneImage>, ViewGeometry, Vec<SweepView>) {
        let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town");
        let paths = ["view_1.tif", "view_3.tif"].map(|name| town.join(name));
        let images = open(&DsmConfig::new(paths.into(), "unused".into())).unwrap().images;
        let views = read_views(&images, &|| ()).unwrap();
        let geometry = SceneImage::geometry(&images, images[0].camera.rpc.height_off).unwrap();
        (images, geometry, views)
    }

    #[test]
    fn ties_at_one_shift_are_a_copy_and_ties_with_parallax_are_not() {
        let pair = |parallax: f64| {
            let tie = |i: usize| {
                let at = ImagePoint::new(i as f64 * 7.0, i as f64 * 3.0);
                let source = ImagePoint::new(at.sample - 12.0, at.line + 31.0 + parallax * (i % 5) as f64);
                Tie { reference: at, source, correlation: 0.9 }
            };
            PairTies::new(ImagePair::new(0, 1), (0..20).map(tie).collect())
        };
        assert_eq!(at_one_shift(&[pair(0.01)]), Some(ImagePair::new(0, 1)));
        assert_eq!(at_one_shift(&[pair(0.4)]), None);
    }

    #[test]
    fn copies_are_one_picture_and_two_exposures_are_not() {
        let (images, geometry, views) = town();
        assert_eq!(same_picture(&images, &geometry, Some(&views)).unwrap(), None);
        assert_eq!(same_picture(&images, &geometry, None).unwrap(), None);
        let original = &views[0].levels[0];
        let noise = |i: usize| (i.wrapping_mul(2_654_435_761) >> 7) % 41;
        let brighter = |change: &dyn Fn(usize, f32) -> f32| {
            let data = original.data().iter().enumerate().map(|(i, value)| change(i, *value)).collect();
            Grid::from_vec(original.width(), original.height(), data).unwrap()
        };
        // A copy under the RPC of another place shares no ground, and is not looked at.
        let mut elsewhere = images[0].clone();
        elsewhere.camera.rpc.long_off += 0.05;
        let apart = [images[0].clone(), elsewhere, images[1].clone()];
        let far = SceneImage::geometry(&apart, images[0].camera.rpc.height_off).unwrap();
        let pixels = [views[0].clone(), views[0].clone(), views[1].clone()];
        assert_eq!(same_picture(&apart, &far, Some(&pixels)).unwrap(), None);
        let cut = Window { x: 37, y: 21, width: original.width() - 37, height: original.height() - 21 };
        let copies = [
            brighter(&|_, value| value),
            brighter(&|i, value| value + (i % 3) as f32 - 1.0),
            brighter(&|i, value| 0.8 * value + 20.0 + noise(i) as f32),
            original.window(cut, f32::NAN),
        ];
        for (number, copy) in copies.into_iter().enumerate() {
            let mut images = images.clone();
            images[1].size = (copy.width(), copy.height());
            let views = [views[0].clone(), SweepView::new(views[1].camera.clone(), copy)];
            let found = same_picture(&images, &geometry, Some(&views)).unwrap();
            assert_eq!(found, Some(ImagePair::new(0, 1)), "copy {number}");
        }
    }
}
