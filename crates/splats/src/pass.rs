//! The pass over the tiles of an image: the weight of each splat in each pixel.
//!
//! A splat's opacity at a pixel is α e^(−q/2) with q the squared distance of the pixel's ray from
//! its centre, in standard deviations; see `affine` for satellites and `central` for perspective
//! cameras, and `hits` for the weights. Tiles are independent, so the result does not depend on the
//! number of threads.

use crs::CrsError;
use gaussian::Splat;
use rayon::prelude::*;

use super::affine::{self, AffineFootprint};
use super::central::{self, CentralFootprint, Rays};
use super::hits::{self, Hit, TILE};
use super::{RayModel, SplatCamera};

/// Number of pixels of a tile.
pub(super) const TILE_PIXELS: usize = TILE * TILE;

/// The splats of an image, by tiles.
pub(super) struct Arrangement {
    width: usize,
    height: usize,
    footprints: Footprints,
    /// Footprints that touch each tile.
    tiles: Vec<Vec<u32>>,
}

enum Footprints {
    Affine(Vec<AffineFootprint>),
    Central(Vec<CentralFootprint>, Rays),
}

/// The part of one splat in one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Pixel within the tile.
    pub(super) pixel: u32,
    /// Index in the tile's list.
    pub(super) slot: u32,
    pub(super) weight: f32,
    /// Local height and depth at which the pixel's ray meets the splat.
    pub(super) height: f32,
    pub(super) depth: f32,
}

impl Arrangement {
    /// Projects splats and sorts them into tiles.
    pub(super) fn new(splats: &[Splat], camera: &impl SplatCamera) -> Result<Self, CrsError> {
        let (size, low_pass) = (camera.size(), camera.low_pass_px2());
        let (footprints, tiles) = match camera.ray_model() {
            RayModel::Affine(camera) => {
                let footprints = affine::footprints(splats, camera, size, low_pass)?;
                let tiles = affine::tiles(&footprints, size);
                (Footprints::Affine(footprints), tiles)
            }
            RayModel::Central(lens, pose) => {
                let footprints = central::footprints(splats, lens, pose, low_pass);
                let rays = Rays::new(lens, pose);
                let tiles = central::tiles(&footprints, &rays, size);
                (Footprints::Central(footprints, rays), tiles)
            }
        };
        Ok(Self { width: size.0, height: size.1, footprints, tiles })
    }

    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Runs over all tiles in parallel and returns the results in the order of the tiles.
    pub(super) fn map_tiles<T: Send>(&self, run: impl Fn(&Tile<'_>) -> T + Sync) -> Vec<T> {
        let across = self.width.div_ceil(TILE);
        let tile = |(index, list): (usize, &Vec<u32>)| {
            let (left, top) = (index % across * TILE, index / across * TILE);
            let (columns, rows) = (TILE.min(self.width - left), TILE.min(self.height - top));
            run(&Tile { arrangement: self, list, left, top, columns, rows })
        };
        self.tiles.par_iter().enumerate().map(tile).collect()
    }
}

/// A tile of an image with its splats.
pub(super) struct Tile<'a> {
    arrangement: &'a Arrangement,
    list: &'a [u32],
    left: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

impl Tile<'_> {
    /// Splats of the tile's list.
    pub(super) fn splats(&self) -> impl Iterator<Item = u32> + '_ {
        self.list.iter().map(|&f| match &self.arrangement.footprints {
            Footprints::Affine(footprints) => footprints[f as usize].splat,
            Footprints::Central(footprints, _) => footprints[f as usize].splat,
        })
    }

    /// Number of splats in the tile's list.
    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// Returns the pixels of the tile that are in the image: index within the tile, column, row.
    pub(super) fn pixels(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        (0..self.rows).flat_map(move |r| (0..self.columns).map(move |c| (r * TILE + c, self.left + c, self.top + r)))
    }

    /// Returns all parts of splats in pixels, front to back in every pixel.
    pub(super) fn parts(&self, parts: &mut Vec<Part>) {
        parts.clear();
        let mut pixels: Vec<Vec<Hit>> = vec![Vec::new(); TILE_PIXELS];
        let (corner, size) = ([self.left, self.top], [self.columns, self.rows]);
        let mut add = |column: usize, row: usize, hit: Hit| hits::insert(&mut pixels[row * TILE + column], hit);
        for (slot, &index) in (0..).zip(self.list) {
            match &self.arrangement.footprints {
                Footprints::Affine(footprints) => footprints[index as usize].hits(slot, corner, size, &mut add),
                Footprints::Central(footprints, rays) => {
                    footprints[index as usize].hits(rays, slot, corner, size, &mut add);
                }
            }
        }
        for (pixel, hits) in (0..).zip(&pixels) {
            hits::weigh(hits, |hit, weight| {
                parts.push(Part { pixel, slot: hit.slot, weight, height: hit.height, depth: hit.depth });
            });
        }
    }
}
