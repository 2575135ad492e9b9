//! Many rays through one eye: the depth image of a camera, and the visibility of many points.
//!
//! Images are cut into tiles of 32 × 32 pixels, and points are sorted into tiles along a Morton
//! curve. The rays of a tile traverse the tree together. Tiles are independent and run in parallel.

use rayon::prelude::*;

use crate::Bvh;
use crate::eye::{Eye, Target};
use crate::ray::MISS;
use crate::setup::{Facet, value};
use crate::simd::dispatch;
use crate::tile::{LANES, Question, RAYS, SUBTILE, Tile};
use crate::traverse::{TileCast, Visit};

/// Side of an image tile, pixels.
const TILE_SIDE: usize = 32;
/// Side of a subtile, pixels.
const SUBTILE_SIDE: usize = 8;

/// Depth and nearest triangle of every pixel, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Depth along [`Eye::forward`], metres; +∞ where nothing is met.
    pub depth: Vec<f32>,
    /// Index of the triangle; [`MISS`] where nothing is met.
    pub triangle: Vec<u32>,
}

impl Bvh {
    /// Returns the nearest triangle on every pixel's ray, and its depth.
    ///
    /// `direction` maps (column, row) to the point (x, y) of the image plane at distance 1 through
    /// which the ray goes. Pixels for which it is `None` or not finite are misses.
    pub fn cast_image(
        &self,
        eye: &Eye,
        width: usize,
        height: usize,
        direction: impl Fn(usize, usize) -> Option<[f64; 2]> + Sync,
    ) -> DepthImage {
        let pixels = width.saturating_mul(height);
        let mut image = DepthImage { width, height, depth: vec![f32::INFINITY; pixels], triangle: vec![MISS; pixels] };
        if self.is_empty() || pixels == 0 || !eye.is_finite() {
            return image;
        }
        let band = width * TILE_SIDE;
        let depths = image.depth.par_chunks_mut(band);
        let bands = depths.zip(image.triangle.par_chunks_mut(band)).enumerate();
        bands.for_each_init(
            || Scratch::new(Question::Closest),
            |scratch, (band, (depth, triangle))| {
                for left in (0..width).step_by(TILE_SIDE) {
                    let place = Place { left, top: band * TILE_SIDE, width, height };
                    self.cast_tile(eye, &place, &direction, scratch, depth, triangle);
                }
            },
        );
        image
    }

    fn cast_tile(
        &self,
        eye: &Eye,
        place: &Place,
        direction: &impl Fn(usize, usize) -> Option<[f64; 2]>,
        scratch: &mut Scratch,
        depth: &mut [f32],
        triangle: &mut [u32],
    ) {
        let ray = |i: usize| {
            let (column, row) = place.pixel(i)?;
            direction(column, row).map(|[x, y]| [x, y, 0.0])
        };
        if !scratch.cast(self, eye, ray) {
            return;
        }
        let mut facets = LastFacet { number: MISS, facet: None };
        for i in 0..RAYS {
            let number = scratch.tile.met[i / LANES][i % LANES];
            let (Some((column, row)), true) = (place.pixel(i), number != MISS) else { continue };
            let at = (row - place.top) * place.width + column;
            let [x, y] = scratch.tile.exact[i];
            depth[at] = facets.depth(self, eye, number, x, y) as f32;
            triangle[at] = self.index_of[number as usize];
        }
    }

    /// Returns for each target whether a triangle lies before it.
    ///
    /// Targets count as hidden if they are behind the eye (depth not positive) or not finite.
    pub fn occluded(&self, eye: &Eye, targets: &[Target]) -> Vec<bool> {
        let usable = |t: &Target| t.depth > 0.0 && t.depth.is_finite() && t.x.abs() < 1e6 && t.y.abs() < 1e6;
        if self.is_empty() || !eye.is_finite() {
            return targets.iter().map(|target| !(eye.is_finite() && usable(target))).collect();
        }
        let order = morton_order(targets);
        let parts: Vec<Vec<bool>> = order
            .par_chunks(RAYS)
            .map_init(
                || Scratch::new(Question::Any),
                |scratch, chunk| {
                    let target = |i: usize| chunk.get(i).map(|&t| &targets[t as usize]).filter(|t| usable(t));
                    let any = scratch.cast(self, eye, |i| target(i).map(|t| [t.x, t.y, t.depth]));
                    let hidden = |i: usize| !any || scratch.tile.met[i / LANES][i % LANES] != MISS;
                    (0..chunk.len()).map(|i| target(i).is_none() || hidden(i)).collect()
                },
            )
            .collect();
        let mut hidden = vec![true; targets.len()];
        for (&target, found) in order.iter().zip(parts.into_iter().flatten()) {
            hidden[target as usize] = found;
        }
        hidden
    }
}

/// Position of a tile in its image.
struct Place {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Place {
    /// Returns the pixel of a ray. Rays are numbered by subtiles of 8 × 8 pixels.
    #[inline(always)]
    fn pixel(&self, ray: usize) -> Option<(usize, usize)> {
        let (subtile, inside) = (ray / SUBTILE, ray % SUBTILE);
        let per_row = TILE_SIDE / SUBTILE_SIDE;
        let column = self.left + (subtile % per_row) * SUBTILE_SIDE + inside % SUBTILE_SIDE;
        let row = self.top + (subtile / per_row) * SUBTILE_SIDE + inside / SUBTILE_SIDE;
        (column < self.width && row < self.height).then_some((column, row))
    }
}

/// Scratch buffers of one thread.
struct Scratch {
    tile: Box<Tile>,
    stack: Vec<Visit>,
}

impl Scratch {
    fn new(question: Question) -> Self {
        Self { tile: Tile::new(question), stack: Vec::with_capacity(256) }
    }

    /// Casts the rays of a tile. Returns false if the tile has none.
    fn cast(&mut self, bvh: &Bvh, eye: &Eye, ray: impl Fn(usize) -> Option<[f64; 3]>) -> bool {
        let any = self.tile.load(ray);
        if any {
            dispatch(TileCast { bvh, eye, tile: &mut self.tile, stack: &mut self.stack });
        }
        any
    }
}

/// The facet of the previous pixel, kept because neighbours mostly see the same triangle.
struct LastFacet {
    number: u32,
    facet: Option<Facet>,
}

impl LastFacet {
    #[inline(always)]
    fn depth(&mut self, bvh: &Bvh, eye: &Eye, number: u32, x: f64, y: f64) -> f64 {
        if self.number != number {
            *self = Self { number, facet: Facet::new(eye, &bvh.corners[number as usize]) };
        }
        self.facet.map_or(f64::INFINITY, |facet| 1.0 / value(&facet.inverse_depth, x, y))
    }
}

/// Returns the order of the targets along a Morton curve over their bounds, so that neighbours in
/// the order are neighbours in the image.
fn morton_order(targets: &[Target]) -> Vec<u32> {
    let finite = || targets.iter().filter(|t| t.x.abs() < 1e6 && t.y.abs() < 1e6);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for target in finite() {
        low = [low[0].min(target.x), low[1].min(target.y)];
        high = [high[0].max(target.x), high[1].max(target.y)];
    }
    let scale = [0, 1].map(|i| if high[i] > low[i] { 65_535.0 / (high[i] - low[i]) } else { 0.0 });
    // A cast from float to integer saturates and turns NaN into zero.
    let cell = |value: f64, axis: usize| spread(((value - low[axis]) * scale[axis]) as u16);
    let key = |i: usize| u64::from(cell(targets[i].x, 0) | cell(targets[i].y, 1) << 1) << 32 | i as u64;
    let mut keys: Vec<u64> = (0..targets.len()).into_par_iter().map(key).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Returns the bits of a number with a zero bit after each.
fn spread(value: u16) -> u32 {
    let mut v = u32::from(value);
    v = (v | v << 8) & 0x00ff_00ff;
    v = (v | v << 4) & 0x0f0f_0f0f;
    v = (v | v << 2) & 0x3333_3333;
    (v | v << 1) & 0x5555_5555
}
