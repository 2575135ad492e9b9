//! What the images show of a wall.
//!
//! A place of a wall is seen when the wall faces the sensor and nothing of the surface stands in
//! the line of sight, which begins a little before the wall: the place of a wall between the cells
//! is not known better.

use crs::CrsError;
use occlusion::OcclusionSurface;
use raster::Grid;

use super::facade::Facade;
use super::sight::{TOLERANCE_M, cells_per_metre};
use super::{RpcSplatCamera, SplatSurface};

/// Least cosine between the direction to the sensor and the outside of a wall: at 6° a wall of 10 m
/// is a pixel or two wide.
const FACING_MIN: f64 = 0.1;
/// Distance before the wall at which the line of sight begins, cells.
const BEFORE_CELLS: f64 = 0.5;
/// Places per cell along and down a wall.
const PLACES_PER_CELL: f64 = 2.0;
/// Most places along or down one wall.
const PLACES_MAX: f64 = 4096.0;

/// An image with its camera.
pub(super) struct WallView<'a> {
    pub(super) camera: &'a RpcSplatCamera<'a>,
    /// Red, green and blue in the display range, NaN where unknown.
    pub(super) image: &'a Grid<[f32; 3]>,
}

/// Colours of places on a face, and the positions that each view sees.
pub(super) struct FaceLight {
    /// NaN where no view sees the place; columns along, rows down.
    colours: Grid<[f32; 3]>,
    /// Largest cosine between the direction to a sensor that sees the face and its outside.
    pub(super) facing: f64,
    /// For each view the positions that it sees.
    pub(super) shown: Vec<Vec<[f64; 3]>>,
}

/// Colours over a part of a face.
pub(super) struct PartColours {
    /// `None` where no place of it is seen.
    pub(super) mean: Option<[f32; 3]>,
    /// Standard deviation, averaged over the channels.
    pub(super) deviation: f64,
}

impl FaceLight {
    /// Looks at a face through all views.
    pub(super) fn new(
        surface: &SplatSurface<'_>,
        obstacle: &OcclusionSurface<'_>,
        views: &[WallView<'_>],
        face: &Facade,
        cell_m: f64,
    ) -> Result<Self, CrsError> {
        let places = |metres: f64| (PLACES_PER_CELL * metres / cell_m).ceil().clamp(1.0, PLACES_MAX) as usize;
        let (columns, rows) = (places(face.length()), places(face.mean_height()));
        let mut light =
            Self { colours: Grid::filled(columns, rows, [f32::NAN; 3]), facing: FACING_MIN, shown: Vec::new() };
        let mut best = Grid::filled(columns, rows, FACING_MIN);
        for view in views {
            light.shown.push(Vec::new());
            let towards = view.camera.towards_sensor();
            let facing = (0..2).map(|i| towards[i] * face.outward[i]).sum::<f64>();
            let Some(per_metre) = cells_per_metre(surface, towards).filter(|_| facing > FACING_MIN) else { continue };
            let place = |k: usize| {
                let share = |i: usize, count: usize| (i as f64 + 0.5) / count as f64;
                face.position(share(k % columns, columns), share(k / columns, rows))
            };
            let is_seen = |position: &[f64; 3]| {
                let (origin, before) = (surface.origin(), BEFORE_CELLS * cell_m);
                let [x, y] = [0, 1].map(|i| position[i] + before * face.outward[i] + origin[i]);
                let at = surface.geotransform().cell_from_map(x, y);
                at.is_some_and(|(c, r)| !obstacle.hides(c, r, position[2] + origin[2], per_metre, TOLERANCE_M))
            };
            let seen: Vec<(usize, [f64; 3])> =
                (0..columns * rows).map(|k| (k, place(k))).filter(|(_, position)| is_seen(position)).collect();
            let pixels = view.camera.pixels(seen.iter().map(|(_, position)| *position))?;
            let mut shown = Vec::with_capacity(seen.len());
            for ((k, position), [u, v]) in seen.into_iter().zip(pixels) {
                let colour = colour_at(view.image, u, v);
                if colour.iter().all(|c| c.is_finite()) {
                    shown.push(position);
                    if facing > best.data()[k] {
                        (best.data_mut()[k], light.colours.data_mut()[k]) = (facing, colour);
                    }
                }
            }
            if !shown.is_empty() {
                light.facing = light.facing.max(facing);
            }
            if let Some(last) = light.shown.last_mut() {
                *last = shown;
            }
        }
        Ok(light)
    }

    /// Returns the colours over shares of the length and of the way down: of the places within,
    /// else of the nearest one.
    pub(super) fn over(&self, along: [f64; 2], down: [f64; 2]) -> PartColours {
        let range = |share: [f64; 2], count: usize| {
            let place = |share: f64| (share * count as f64 - 0.5).max(0.0);
            let (first, end) = (place(share[0]).ceil() as usize, place(share[1]).ceil() as usize);
            let middle = ((0.5 * (share[0] + share[1]) * count as f64) as usize).min(count - 1);
            if first < end { first..end.min(count) } else { middle..middle + 1 }
        };
        let (mut sum, mut squares, mut count) = ([0.0f64; 3], 0.0, 0.0);
        for row in range(down, self.colours.height()) {
            for colour in &self.colours.row(row)[range(along, self.colours.width())] {
                if colour.iter().all(|c| c.is_finite()) {
                    (0..3).for_each(|i| sum[i] += f64::from(colour[i]));
                    squares += colour.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>();
                    count += 1.0;
                }
            }
        }
        if count == 0.0 {
            return PartColours { mean: None, deviation: 0.0 };
        }
        let mean = sum.map(|sum| sum / count);
        let variance = squares / count - mean.iter().map(|m| m * m).sum::<f64>();
        PartColours { mean: Some(mean.map(|m| m as f32)), deviation: (variance.max(0.0) / 3.0).sqrt() }
    }
}

/// Bilinear colour at a column and row; NaN outside and beside unknown pixels.
fn colour_at(image: &Grid<[f32; 3]>, column: f64, row: f64) -> [f32; 3] {
    let (left, top) = (column.floor(), row.floor());
    let inside = left >= 0.0 && top >= 0.0 && left + 1.0 < image.width() as f64 && top + 1.0 < image.height() as f64;
    if !inside {
        return [f32::NAN; 3];
    }
    let (c, r, u, v) = (left as usize, top as usize, (column - left) as f32, (row - top) as f32);
    let along = |row: usize| [0, 1, 2].map(|i| image[(c, row)][i] * (1.0 - u) + image[(c + 1, row)][i] * u);
    let (upper, lower) = (along(r), along(r + 1));
    [0, 1, 2].map(|i| upper[i] * (1.0 - v) + lower[i] * v)
}
