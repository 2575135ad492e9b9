//! The splats that fill gaps: where photographs show a surface that no point lies on, such as lawn,
//! gravel or a plain wall.
//!
//! A reconstruction has few points where a surface has little to be recognised, and a training that
//! begins there with nothing puts splats of the background in front of each photograph instead.
//! What the points know of such a surface is its plane: the planes of the scene are found in them
//! (RANSAC), and each block of a photograph that no point lies in gets a splat on the nearest plane
//! along its ray that holds against the other photographs (as piecewise planar stereo, Sinha et al.
//! 2009, chooses among planes). To hold, the place must lie within the reach of the plane's points,
//! must not stand before what other photographs see, and must have its colour in one of them. Where
//! no plane does, the inverse depths of the nearest points in the photograph are interpolated; such
//! a place must also lie among the depths of the points around it in another photograph.

use ::train::{PinholeView, Surfel, SurfelCamera, TrainingView};
use gaussian::quaternion_of_axes;
use numeric::SplitMix64;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::initial::{OPACITY_LOGIT, SPREAD};

/// Blocks along the longer side of a photograph.
const BLOCKS: usize = 64;
/// Least side of a block, pixels.
const LEAST_SIDE: usize = 4;
/// Most planes of a scene.
const PLANES: usize = 12;
/// Triples of points that are tried for a plane.
const TRIPLES: usize = 400;
/// Points among which the other two of a triple are drawn.
const NEIGHBOURS: usize = 24;
/// A plane has one of this number of the points, or more.
const LEAST_SHARE: usize = 100;
/// Points that triples are judged by.
const JUDGES: usize = 4000;
/// Difference of colours from 0 to 1 up to which two photographs show the same place: several times
/// the noise of a block's mean, and room for exposures.
const SAME_COLOUR: f32 = 0.1;
/// Least sine between plane and ray: beyond it, a block is drawn out along a surface that it
/// hardly shows.
const LEAST_SINE: f64 = 0.05;
/// Points of a plane whose distances from it are followed.
const FOLLOWED: usize = 4;
/// Blocks with points whose inverse depths are interpolated where no plane is known.
const INTERPOLATED: usize = 8;

type Point = [f64; 3];

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: Point) -> Option<Point> {
    let length = dot(a, a).sqrt();
    (length > 0.0).then(|| a.map(|c| c / length))
}

/// A plane of the scene with its points.
struct Plane {
    normal: Point,
    /// Distance from the origin along the normal.
    offset: f64,
    points: RTree<Point>,
    /// How far from its points the plane is believed: the median of their distances from their
    /// middle. A surface goes on no further than it is known.
    reach: f64,
}

impl Plane {
    /// Returns the place at which a ray meets the surface: the plane, moved to its points nearby.
    fn met(&self, from: Point, along: Point) -> Option<Point> {
        let slope = dot(self.normal, along);
        if slope.abs() < LEAST_SINE * dot(along, along).sqrt() {
            return None;
        }
        let at = |offset: f64| {
            let times = (offset - dot(self.normal, from)) / slope;
            (times > 0.0).then(|| [0, 1, 2].map(|i| from[i] + times * along[i]))
        };
        let place = at(self.offset)?;
        let (mut sum, mut weights) = (0.0, 0.0);
        for point in self.points.nearest_neighbor_iter(&place).take(FOLLOWED) {
            let apart = minus(*point, place);
            let distance = dot(apart, apart).sqrt();
            if weights == 0.0 && distance > self.reach {
                return None;
            }
            let weight = 1.0 / distance.max(1e-9);
            sum += weight * dot(self.normal, apart);
            weights += weight;
        }
        at(self.offset + sum / weights)
    }
}

/// Finds the planes of points, those of most points first. Points lie on a plane within
/// `tolerance`, metres.
fn planes(points: &[Point], tolerance: f64, random: &mut SplitMix64) -> Vec<Plane> {
    let least = points.len() / LEAST_SHARE;
    let (mut left, mut found) = (points.to_vec(), Vec::new());
    while found.len() < PLANES && left.len() > least.max(NEIGHBOURS) {
        let Some((normal, offset)) = plane(&left, tolerance, random) else { break };
        let is_on = |p: &Point| (dot(normal, *p) - offset).abs() < tolerance;
        let (on, off): (Vec<Point>, Vec<Point>) = left.iter().partition(|p| is_on(p));
        if on.len() < least.max(3) {
            break;
        }
        let median = |mut values: Vec<f64>| {
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        let middle = [0, 1, 2].map(|axis| median(on.iter().map(|p| p[axis]).collect()));
        let distance = |p: &Point| dot(minus(*p, middle), minus(*p, middle)).sqrt();
        let reach = median(on.iter().map(distance).collect());
        found.push(Plane { normal, offset, points: RTree::bulk_load(on), reach });
        left = off;
    }
    found
}

/// Returns the plane of three neighbours that most points lie on.
fn plane(points: &[Point], tolerance: f64, random: &mut SplitMix64) -> Option<(Point, f64)> {
    let tree = RTree::bulk_load(points.to_vec());
    let judges: Vec<Point> = points.iter().step_by(points.len().div_ceil(JUDGES)).copied().collect();
    let mut best: Option<(usize, Point, f64)> = None;
    for _ in 0..TRIPLES {
        let first = points[random.below(points.len())];
        let near: Vec<&Point> = tree.nearest_neighbor_iter(&first).skip(1).take(NEIGHBOURS).collect();
        let [second, third] = [0; 2].map(|_| *near[random.below(near.len())]);
        let Some(normal) = unit(cross(minus(second, first), minus(third, first))) else { continue };
        let offset = dot(normal, first);
        let count = judges.iter().filter(|p| (dot(normal, **p) - offset).abs() < tolerance).count();
        if best.is_none_or(|(most, ..)| count > most) {
            best = Some((count, normal, offset));
        }
    }
    best.map(|(_, normal, offset)| (normal, offset))
}

/// A photograph in blocks, with the depths of the points in each.
struct Blocks {
    /// Columns and rows.
    count: [usize; 2],
    /// Pixels of a side.
    side: usize,
    /// Least depth of the points in each block, metres; infinite where there is none.
    nearest_m: Vec<f64>,
    /// Inverse of these depths, per metre, at the first pixels of the blocks.
    inverse: RTree<GeomWithData<[f64; 2], f64>>,
}

/// The inverse depths around a pixel, per metre.
struct Around {
    /// Interpolated: what is a plane in space has inverse depths that are linear in the image.
    guess: f64,
    least: f64,
    greatest: f64,
}

impl Blocks {
    fn new(camera: &PinholeView, places: impl Iterator<Item = Point>) -> Self {
        let size = camera.size;
        let side = (size[0].max(size[1]) / BLOCKS).max(LEAST_SIDE);
        let count = size.map(|s| s / side);
        let nearest_m = vec![f64::INFINITY; count[0] * count[1]];
        let mut blocks = Self { count, side, nearest_m, inverse: RTree::new() };
        for local in places.filter_map(|place| camera.local(0, place)) {
            if let Some(block) = blocks.at(local.pixel) {
                blocks.nearest_m[block] = blocks.nearest_m[block].min(local.depth_m);
            }
        }
        let known = blocks.nearest_m.iter().enumerate().filter(|(_, depth)| depth.is_finite());
        let first = |block: usize| [block % count[0], block / count[0]].map(|c| (c * side) as f64);
        let inverse = known.map(|(block, depth)| GeomWithData::new(first(block), 1.0 / depth)).collect();
        blocks.inverse = RTree::bulk_load(inverse);
        blocks
    }

    /// Returns the inverse depths of the nearest points in the image.
    fn around(&self, pixel: [f64; 2]) -> Option<Around> {
        let (mut sum, mut weights) = (0.0, 0.0);
        let (mut least, mut greatest) = (f64::INFINITY, 0.0f64);
        for near in self.inverse.nearest_neighbor_iter(&pixel).take(INTERPOLATED) {
            let apart = [0, 1].map(|i| near.geom()[i] - pixel[i]);
            let weight = 1.0 / apart[0].hypot(apart[1]).max(1.0);
            sum += weight * near.data;
            weights += weight;
            (least, greatest) = (least.min(near.data), greatest.max(near.data));
        }
        (weights > 0.0).then(|| Around { guess: sum / weights, least, greatest })
    }

    /// Returns the number of the block of a pixel.
    fn at(&self, pixel: [f64; 2]) -> Option<usize> {
        let place = pixel.map(|c| ((c + 0.5) / self.side as f64).floor());
        let is_in = (0..2).all(|i| place[i] >= 0.0 && place[i] < self.count[i] as f64);
        is_in.then(|| place[1] as usize * self.count[0] + place[0] as usize)
    }

    /// Returns the first pixels of the blocks that have no point, nor have their neighbours.
    fn open(&self) -> Vec<[usize; 2]> {
        let places = (0..self.nearest_m.len()).map(|block| [block % self.count[0], block / self.count[0]]);
        let around = |i: usize, at: usize| at.saturating_sub(1)..(at + 2).min(self.count[i]);
        let is_open = |[column, row]: &[usize; 2]| {
            let mut near = around(1, *row).flat_map(|y| around(0, *column).map(move |x| y * self.count[0] + x));
            near.all(|block| self.nearest_m[block].is_infinite())
        };
        places.filter(is_open).map(|place| place.map(|c| c * self.side)).collect()
    }
}

type View = TrainingView<PinholeView>;

/// Returns at most `most` splats for the gaps that splats leave in views.
pub(super) fn fill(splats: &[Surfel], views: &[View], most: usize, seed: u64) -> Vec<Surfel> {
    let points: Vec<Point> = splats.iter().map(|s| s.position.map(f64::from)).collect();
    let mut spacings: Vec<f64> = splats.iter().map(|s| s.scale_m()[0] / SPREAD).collect();
    spacings.sort_unstable_by(f64::total_cmp);
    let Some(&spacing) = spacings.get(spacings.len() / 2) else { return Vec::new() };
    let planes = planes(&points, spacing, &mut SplitMix64::new(seed));
    let blocks = |view: &View| Blocks::new(&view.camera, points.iter().copied());
    let scene = Scene { views, blocks: views.iter().map(blocks).collect(), planes, spacing };
    let mut made: Vec<Surfel> = Vec::new();
    for (number, view) in views.iter().enumerate() {
        // What was filled for the photographs before is there by now.
        let there = points.iter().copied().chain(made.iter().map(|s| s.position.map(f64::from)));
        let blocks = Blocks::new(&view.camera, there);
        let open = blocks.open();
        made.extend(open.into_iter().filter_map(|first| scene.splat(number, first, blocks.side)));
    }
    made.truncate(most);
    made
}

struct Scene<'a> {
    views: &'a [View],
    /// With the points alone.
    blocks: Vec<Blocks>,
    planes: Vec<Plane>,
    /// Median distance between neighbouring points, metres.
    spacing: f64,
}

impl Scene<'_> {
    /// Returns the splat of a block of a view, whose first pixel is given.
    fn splat(&self, view: usize, [left, top]: [usize; 2], side: usize) -> Option<Surfel> {
        let TrainingView { camera, colour, mask, .. } = &self.views[view];
        let width = camera.size[0];
        let pixels = || (0..side * side).map(|i| (top + i / side) * width + left + i % side);
        if mask.as_ref().is_some_and(|mask| !pixels().all(|pixel| mask[pixel])) {
            return None;
        }
        let mean = colour.each_ref().map(|plane| pixels().map(|p| plane[p]).sum::<f32>() / (side * side) as f32);
        if !mean.iter().all(|c| c.is_finite()) {
            return None;
        }
        let middle = (side as f64 - 1.0) / 2.0;
        let pixel = [left as f64 + middle, top as f64 + middle];
        let along = minus(camera.point(pixel, 1.0)?, camera.centre);
        let sight = unit(along)?;
        let depth_of = |place: Point| dot(minus(place, camera.centre), sight);
        let met = |plane: &Plane| Some((plane.met(camera.centre, along)?, plane.normal));
        let mut places: Vec<(Point, Point)> = self.planes.iter().filter_map(met).collect();
        places.sort_by(|a, b| depth_of(a.0).total_cmp(&depth_of(b.0)));
        let on_plane = places.into_iter().find(|(place, _)| self.holds(view, *place, mean, false));
        let (place, normal) = on_plane.or_else(|| {
            // Where no plane is known, the surface lies between the points around it.
            let place = camera.point(pixel, 1.0 / self.blocks[view].around(pixel)?.guess)?;
            self.holds(view, place, mean, true).then(|| (place, sight.map(|c| -c)))
        })?;
        let depth = camera.local(0, place)?.depth_m;
        let across = unit(cross(normal, sight)).or_else(|| unit(cross(normal, camera.rotation[1])))?;
        let away = cross(normal, across);
        let width_m = side as f64 * depth / camera.focal_px[0];
        let lengths = [width_m, width_m / dot(normal, sight).abs().max(LEAST_SINE)];
        Some(Surfel {
            position: place.map(|c| c as f32),
            rotation: quaternion_of_axes([across, away, normal]).map(|c| c as f32),
            log_scale: lengths.map(|length| (SPREAD * length).ln() as f32),
            opacity_logit: OPACITY_LOGIT,
            colour: mean,
        })
    }

    /// Returns whether the views allow a surface of a colour at a place: most of those that know
    /// points there have none behind it, and another than the given one has the colour; where
    /// `among` is set, that one also has to know it to lie among the depths of the points nearby.
    fn holds(&self, view: usize, place: Point, colour: [f32; 3], among: bool) -> bool {
        let (mut before, mut known, mut is_seen) = (0, 0, false);
        for (number, (other, blocks)) in self.views.iter().zip(&self.blocks).enumerate() {
            let Some(local) = other.camera.local(0, place) else { continue };
            let Some(block) = blocks.at(local.pixel) else { continue };
            let [column, row] = local.pixel.map(|c| c.round() as usize);
            let pixel = row * other.camera.size[0] + column;
            let farther_m = blocks.nearest_m[block] - local.depth_m;
            known += usize::from(farther_m.is_finite());
            before += usize::from(farther_m.is_finite() && farther_m > self.spacing);
            let is_hidden = farther_m < -self.spacing;
            let apart = |c: usize| (other.colour[c][pixel] - colour[c]).abs();
            let is_alike = number != view && !is_hidden && (0..3).all(|c| apart(c) <= SAME_COLOUR);
            let is_among = |around: Around| (around.least..=around.greatest).contains(&(1.0 / local.depth_m));
            is_seen |= is_alike && (!among || blocks.around(local.pixel).is_some_and(is_among));
        }
        is_seen && 2 * before <= known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACING: f64 = 0.25;

    /// Height of a slope without bounds.
    fn slope(x: f64, y: f64) -> f64 {
        0.2 * x - 0.1 * y
    }

    fn tone(x: f64, y: f64) -> [f32; 3] {
        [0.5 + 0.4 * (0.6 * x).sin(), 0.5 + 0.4 * (0.5 * y).cos(), 0.3 + 0.02 * (x - y)].map(|c| c as f32)
    }

    /// Splats on the slope, but for a hole.
    fn with_hole() -> Vec<Surfel> {
        let places = (-32..=32).flat_map(|i| (-32..=32).map(move |k| [i, k].map(|c| SPACING * f64::from(c))));
        let seen = places.filter(|[x, y]| x.hypot(*y) > 3.0);
        let axis = |a: Point| unit(a).unwrap();
        let normal = axis([-0.2, 0.1, 1.0]);
        let along = axis([1.0, 0.0, 0.2]);
        let rotation = quaternion_of_axes([along, cross(normal, along), normal]).map(|c| c as f32);
        let one = |[x, y]: [f64; 2]| Surfel {
            position: [x, y, slope(x, y)].map(|c| c as f32),
            rotation,
            log_scale: [(SPREAD * SPACING).ln() as f32; 2],
            opacity_logit: OPACITY_LOGIT,
            colour: tone(x, y),
        };
        seen.map(one).collect()
    }

    /// A view from above that shows the slope, and black beyond `width` of it on either side.
    fn view(centre: Point, width: f64) -> View {
        let camera = PinholeView {
            rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
            centre,
            focal_px: [150.0; 2],
            principal_px: [63.5, 47.5],
            size: [128, 96],
        };
        let mut colour: [Vec<f32>; 3] = Default::default();
        for pixel in 0..128 * 96 {
            let along = minus(camera.point([(pixel % 128) as f64, (pixel / 128) as f64], 1.0).unwrap(), centre);
            let times = (slope(centre[0], centre[1]) - centre[2]) / (along[2] - slope(along[0], along[1]));
            let [x, y] = [0, 1].map(|i| centre[i] + times * along[i]);
            let shown = if x.abs().max(y.abs()) < width { tone(x, y) } else { [0.0; 3] };
            (0..3).for_each(|c| colour[c].push(shown[c]));
        }
        View::new(camera, colour)
    }

    #[test]
    fn a_hole_in_a_plane_gets_splats_of_the_plane() {
        let splats = with_hole();
        let views = [[-2.0, 0.0, 12.0], [2.0, 1.0, 12.0], [0.0, -2.0, 13.0]].map(|centre| view(centre, 8.0));
        let made = fill(&splats, &views, usize::MAX / 2, 1);
        for splat in &made {
            let [x, y, z] = splat.position.map(f64::from);
            assert!((z - slope(x, y)).abs() < 0.01 && x.hypot(y) < 3.2, "{splat:?}");
            assert!(splat.axes()[2][2].abs() > 0.97, "{splat:?}");
            assert!(
                splat.colour.iter().zip(tone(x, y)).all(|(found, truth)| (found - truth).abs() < 0.05),
                "{splat:?}"
            );
        }
        let near = |x: f64, y: f64| {
            let apart = |s: &Surfel| (f64::from(s.position[0]) - x).hypot(f64::from(s.position[1]) - y);
            made.iter().map(apart).fold(f64::INFINITY, f64::min)
        };
        let within = [[0.0, 0.0], [1.5, 0.0], [-1.0, 1.5], [0.0, -2.0], [-1.4, -1.4]];
        assert!(within.iter().all(|[x, y]| near(*x, *y) < 0.5), "{} splats", made.len());
        assert_eq!(fill(&splats, &views, 7, 1), made[..7]);
    }

    #[test]
    fn nothing_is_filled_where_other_views_disagree() {
        let splats = with_hole();
        // A single view has no other that agrees.
        assert_eq!(fill(&splats, &[view([0.0, 0.0, 12.0], 8.0)], 1000, 1), []);
        // Another colour in each view.
        let mut views = [view([-2.0, 0.0, 12.0], 8.0), view([2.0, 0.0, 12.0], 8.0)];
        views[1].colour.iter_mut().flatten().for_each(|c| *c = 1.0 - *c / 4.0);
        assert_eq!(fill(&splats, &views, 1000, 1), []);
        // Points below the hole that both views see: nothing may stand before them.
        let views = [view([-2.0, 0.0, 12.0], 8.0), view([2.0, 0.0, 12.0], 8.0)];
        let holds = |points: &[Point]| {
            let blocks = |view: &View| Blocks::new(&view.camera, points.iter().copied());
            let scene = Scene {
                views: &views,
                blocks: views.iter().map(blocks).collect(),
                planes: Vec::new(),
                spacing: SPACING,
            };
            scene.holds(0, [0.0; 3], tone(0.0, 0.0), false)
        };
        let around: Vec<Point> = splats.iter().map(|s| s.position.map(f64::from)).collect();
        let below = |i: i32| [0.2 * f64::from(i % 9 - 4), 0.2 * f64::from(i / 9 - 4), -3.0];
        let with_below: Vec<Point> = around.iter().copied().chain((0..81).map(below)).collect();
        assert_eq!([holds(&around), holds(&with_below)], [true, false]);
    }
}
