//! The parallelograms that junctions span, and how salient they are as buildings.
//!
//! The **first-order saliency** of a junction is that of the parallelogram between its branches:
//!
//! ```text
//! first = exp(−(angle − 90°)² / 2 s²) · 1 / (1 + area / half area)
//! ```
//!
//! within the limits of the area of buildings. The **second-order saliency** asks for support by
//! what else is in the image: the edges along the two far sides of the parallelogram, as their
//! mean agreement `closure`, and a second junction at one of its other corners whose branches run
//! along the same sides, as its closeness `pair`, 0 to 1:
//!
//! ```text
//! second = first · closure² · (3 + pair) / 4
//! ```
//!
//! Xia et al. (2018) let the nearest junctions support each other by distance only. Here they must
//! be corners of the same shape.

use raster::Grid;
use rayon::prelude::*;

use crate::chance::STEPS;
use crate::gradient::Gradients;
use crate::junctions::{Junction, agreement_at};

/// Least cosine between sides of two junctions of one shape.
const PARALLEL: f32 = 0.94;
/// Share of the saliency of a shape without a second junction.
const UNPAIRED: f32 = 0.75;
/// Rows that are added up at once.
const BAND: usize = 64;

/// Limits of shapes, in pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShapeLimits {
    /// Smallest area, square pixels.
    pub(crate) least_px2: f32,
    /// Largest area, square pixels.
    pub(crate) most_px2: f32,
    /// Area that counts half, square pixels.
    pub(crate) half_px2: f32,
    /// Standard deviation of angles from the right angle, degrees.
    pub(crate) spread_deg: f32,
    /// How far a far side or a corner may be off, pixels.
    pub(crate) tolerance_px: f32,
}

/// A parallelogram.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    corner: [f32; 2],
    sides: [[f32; 2]; 2],
    area: f32,
    /// Saliency.
    pub(crate) weight: f32,
}

/// Returns the shapes of junctions with their second-order saliency, and the number of pairs.
pub(crate) fn shapes(junctions: &[Junction], gradients: &Gradients, limits: &ShapeLimits) -> (Vec<Shape>, usize) {
    let first: Vec<Shape> = junctions.iter().filter_map(|junction| Shape::first_order(junction, limits)).collect();
    let corners = Corners::new(&first, gradients.unit.height());
    let pairs: Vec<f32> = first.par_iter().map(|shape| corners.support(shape, limits.tolerance_px)).collect();
    let second = first.par_iter().zip(&pairs).map(|(shape, pair)| {
        let closure = shape.closure(gradients, limits.tolerance_px);
        Shape { weight: shape.weight * closure * closure * (UNPAIRED + (1.0 - UNPAIRED) * pair), ..*shape }
    });
    (second.collect(), pairs.iter().filter(|pair| **pair > 0.0).count())
}

/// Adds up the weights of the shapes that cover each pixel.
pub(crate) fn coverage(shapes: &[Shape], width: usize, height: usize) -> Grid<f32> {
    let mut sums = Grid::filled(width, height, 0.0f32);
    sums.data_mut().par_chunks_mut((width * BAND).max(1)).enumerate().for_each(|(band, rows)| {
        let top = band * BAND;
        for shape in shapes {
            let (low, high) = shape.rows();
            let (first, last) = (low.ceil().max(top as f32), high.floor().min((top + BAND - 1) as f32));
            let mut y = first;
            while y <= last {
                let start = (y as usize - top) * width;
                if let Some(row) = rows.get_mut(start..start + width) {
                    shape.columns(y, width).for_each(|x| row[x] += shape.weight);
                }
                y += 1.0;
            }
        }
    });
    sums
}

impl Shape {
    fn first_order(junction: &Junction, limits: &ShapeLimits) -> Option<Self> {
        let [a, b] = junction.directions;
        let [m, n] = junction.lengths;
        let sides = [[a[0] * m, a[1] * m], [b[0] * n, b[1] * n]];
        let area = cross(sides[0], sides[1]).abs();
        if !(limits.least_px2..=limits.most_px2).contains(&area) {
            return None;
        }
        let off_deg = (a[0] * b[0] + a[1] * b[1]).asin().to_degrees();
        let angle = (-0.5 * (off_deg / limits.spread_deg).powi(2)).exp();
        Some(Self { corner: junction.at, sides, area, weight: angle / (1.0 + area / limits.half_px2) })
    }

    /// Returns the geometric mean of the agreements along the two far sides, 0 to 1. Each side is
    /// the best of its parallels within the tolerance.
    fn closure(&self, gradients: &Gradients, tolerance_px: f32) -> f32 {
        let [a, b] = self.sides;
        (side_agreement(gradients, plus(self.corner, b), a, tolerance_px)
            * side_agreement(gradients, plus(self.corner, a), b, tolerance_px))
        .sqrt()
    }

    /// Returns the three corners away from the junction, each with the directions that its branches
    /// have: 1 along the sides of the junction, −1 against them.
    fn other_corners(&self) -> [([f32; 2], [f32; 2]); 3] {
        let [a, b] = self.sides;
        let corner = self.corner;
        [(plus(corner, a), [-1.0, 1.0]), (plus(corner, b), [1.0, -1.0]), (plus(plus(corner, a), b), [-1.0, -1.0])]
    }

    /// Returns the four sides, each with its start, its vector and its unit normal away from the
    /// middle.
    pub(crate) fn outer_sides(&self) -> [([f32; 2], [f32; 2], [f32; 2]); 4] {
        let [a, b] = self.sides;
        let corner = self.corner;
        let outer = |start: [f32; 2], side: [f32; 2], across: [f32; 2]| {
            let length = side[0].hypot(side[1]);
            let normal = [-side[1] / length, side[0] / length];
            let sign = if normal[0] * across[0] + normal[1] * across[1] < 0.0 { -1.0 } else { 1.0 };
            (start, side, normal.map(|part| sign * part))
        };
        let back = |v: [f32; 2]| v.map(|part| -part);
        [
            outer(corner, a, back(b)),
            outer(plus(corner, b), a, b),
            outer(corner, b, back(a)),
            outer(plus(corner, a), b, a),
        ]
    }

    fn rows(&self) -> (f32, f32) {
        let [a, b] = self.sides.map(|side| side[1]);
        (self.corner[1] + a.min(0.0) + b.min(0.0), self.corner[1] + a.max(0.0) + b.max(0.0))
    }

    /// Returns the columns of a row whose centres lie inside.
    fn columns(&self, y: f32, width: usize) -> std::ops::Range<usize> {
        let [a, b] = self.sides;
        let whole = cross(a, b);
        let dy = y - self.corner[1];
        let (mut low, mut high) = (0.0f32, width as f32 - 1.0);
        // Shares of the way along both sides: offset + slope · x, each between 0 and 1.
        for (slope, offset) in [(b[1] / whole, -dy * b[0] / whole), (-a[1] / whole, dy * a[0] / whole)] {
            if slope.abs() < 1e-9 {
                if !(0.0..=1.0).contains(&offset) {
                    return 0..0;
                }
                continue;
            }
            let (p, q) = (self.corner[0] - offset / slope, self.corner[0] + (1.0 - offset) / slope);
            (low, high) = (low.max(p.min(q)), high.min(p.max(q)));
        }
        if low > high { 0..0 } else { low.ceil() as usize..high.floor() as usize + 1 }
    }
}

/// Returns the mean agreement along a side, for the best of its parallels.
fn side_agreement(gradients: &Gradients, start: [f32; 2], side: [f32; 2], tolerance_px: f32) -> f32 {
    let length = side[0].hypot(side[1]);
    let along = [side[0] / length, side[1] / length];
    let (width, height) = (gradients.unit.width() as f32, gradients.unit.height() as f32);
    let steps = length.round().max(1.0) as usize;
    let reach = tolerance_px.round() as i32;
    let mean = |shift: i32| {
        let mut sum = 0;
        for step in 0..steps {
            let (r, d) = (step as f32 + 0.5, shift as f32);
            let at = [start[0] + r * along[0] - d * along[1], start[1] + r * along[1] + d * along[0]].map(f32::round);
            if at[0] >= 0.0 && at[1] >= 0.0 && at[0] < width && at[1] < height {
                sum += u32::from(agreement_at(gradients, at, along));
            }
        }
        sum as f32 / (steps * STEPS) as f32
    };
    (-reach..=reach).map(mean).fold(0.0, f32::max)
}

/// Shapes by the row of their junction.
struct Corners<'a> {
    shapes: &'a [Shape],
    /// For each row, the first shape whose junction lies in it or below.
    first: Vec<usize>,
}

impl<'a> Corners<'a> {
    /// `shapes` are in the order of the rows of their junctions, which are whole numbers.
    fn new(shapes: &'a [Shape], height: usize) -> Self {
        let first = (0..=height).map(|row| shapes.partition_point(|shape| shape.corner[1] < row as f32)).collect();
        Self { shapes, first }
    }

    /// Returns how close the closest junction is that is another corner of the shape, 0 to 1.
    fn support(&self, shape: &Shape, tolerance_px: f32) -> f32 {
        let reach = 0.15 * shape.area.sqrt() + tolerance_px;
        let mut best = 0.0f32;
        for (place, turns) in shape.other_corners() {
            let row = |y: f32| (y.max(0.0) as usize).min(self.first.len() - 1);
            let (from, to) =
                (self.first[row((place[1] - reach).ceil())], self.first[row((place[1] + reach).floor() + 1.0)]);
            for other in self.shapes.get(from..to).unwrap_or_default() {
                let off = [other.corner[0] - place[0], other.corner[1] - place[1]];
                let far = off[0].hypot(off[1]);
                if far <= reach && shape.is_along(other, turns) {
                    let alike = shape.area.min(other.area) / shape.area.max(other.area);
                    best = best.max(alike * (1.0 - far / reach));
                }
            }
        }
        best
    }
}

impl Shape {
    /// Returns whether the branches of another junction run along the sides of this one, in the
    /// same direction or against it as `turns` says.
    fn is_along(&self, other: &Self, turns: [f32; 2]) -> bool {
        let cosine = |i: usize, j: usize| {
            let (a, b) = (self.sides[i], other.sides[j]);
            turns[i] * (a[0] * b[0] + a[1] * b[1]) / (a[0].hypot(a[1]) * b[0].hypot(b[1]))
        };
        let both = |j: usize, k: usize| cosine(0, j) >= PARALLEL && cosine(1, k) >= PARALLEL;
        both(0, 1) || both(1, 0)
    }
}

fn cross(a: [f32; 2], b: [f32; 2]) -> f32 {
    a[0] * b[1] - a[1] * b[0]
}

fn plus(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] + b[0], a[1] + b[1]]
}
