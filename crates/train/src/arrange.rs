//! The splats of an image, sorted by depth into tiles of 16 × 16 pixels.

use std::ops::Range;

use rayon::prelude::*;

use crate::screen::{ScreenSplat, project};
use crate::surfel::Surfel;
use crate::view::SurfelCamera;

/// Columns and rows of a tile.
pub(crate) const TILE: usize = 16;

/// What is drawn where. An entry is a splat in a tile.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Arrangement {
    /// Columns and rows of the image.
    pub(crate) size: [usize; 2],
    /// Tiles across and down.
    pub(crate) tiles: [usize; 2],
    /// The splat of each surfel; not all are drawn.
    pub(crate) splats: Vec<ScreenSplat>,
    /// Depths, as integers in their order, with the splats that are drawn; sorted.
    order: Vec<u64>,
    /// Splats of the entries, tile by tile, each from front to back.
    pub(crate) entries: Vec<u32>,
    /// First entry of each tile, and the number of entries.
    pub(crate) tile_starts: Vec<u32>,
    /// First entry of each tile that has no splat yet.
    next: Vec<u32>,
    /// Entries of the splats, splat by splat, each in the order of its tiles.
    places: Vec<u32>,
    /// Tiles of each splat.
    rectangles: Vec<TileRectangle>,
}

/// The tiles that the bounds of a splat meet.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TileRectangle {
    left: u16,
    right: u16,
    top: u16,
    bottom: u16,
    /// Place of the first tile's entry; those of the others follow by rows.
    first_place: u32,
}

impl Arrangement {
    /// Projects surfels and sorts them. Splats of equal depth are in the order of the surfels.
    pub(crate) fn arrange<C: SurfelCamera>(&mut self, surfels: &[Surfel], camera: &C) {
        let size = camera.size();
        self.size = size;
        self.tiles = size.map(|s| s.div_ceil(TILE));
        let one = |(number, surfel): (usize, &Surfel)| {
            let view = camera.local(number, surfel.position.map(f64::from));
            view.and_then(|view| project(surfel, &view, C::PERSPECTIVE, size)).unwrap_or(ScreenSplat::HIDDEN)
        };
        surfels.par_iter().enumerate().map(one).collect_into_vec(&mut self.splats);
        let drawn = self.splats.iter().enumerate().filter(|(_, splat)| splat.is_drawn());
        self.order.clear();
        self.order.extend(drawn.map(|(number, splat)| u64::from(in_order(splat.depth)) << 32 | number as u64));
        self.order.par_sort_unstable();
        self.count();
        self.fill();
    }

    /// Counts the entries of tiles and splats.
    fn count(&mut self) {
        self.tile_starts.clear();
        self.tile_starts.resize(self.tiles[0] * self.tiles[1] + 1, 0);
        self.rectangles.clear();
        let mut count = 0;
        for splat in &self.splats {
            let [left, right, top, bottom] = splat.bounds.map(|b| b / TILE as u16);
            self.rectangles.push(TileRectangle { left, right, top, bottom, first_place: count });
            if !splat.is_drawn() {
                continue;
            }
            count += u32::from(right - left + 1) * u32::from(bottom - top + 1);
            for row in usize::from(top)..=usize::from(bottom) {
                let first = row * self.tiles[0] + 1;
                self.tile_starts[first + usize::from(left)..=first + usize::from(right)]
                    .iter_mut()
                    .for_each(|n| *n += 1);
            }
        }
        for tile in 1..self.tile_starts.len() {
            self.tile_starts[tile] += self.tile_starts[tile - 1];
        }
        self.entries.resize(count as usize, 0);
        self.places.resize(count as usize, 0);
    }

    /// Fills the entries, from front to back.
    fn fill(&mut self) {
        self.next.clone_from(&self.tile_starts);
        for &key in &self.order {
            let number = (key & 0xffff_ffff) as u32;
            let rectangle = &self.rectangles[number as usize];
            let mut places = self.places[rectangle.first_place as usize..].iter_mut();
            for row in rectangle.top..=rectangle.bottom {
                let first = usize::from(row) * self.tiles[0];
                let tiles = first + usize::from(rectangle.left)..=first + usize::from(rectangle.right);
                for (next, place) in self.next[tiles].iter_mut().zip(&mut places) {
                    self.entries[*next as usize] = number;
                    *place = *next;
                    *next += 1;
                }
            }
        }
    }

    /// Returns the range of the entries of a tile.
    pub(crate) fn entries_of(&self, tile: usize) -> Range<usize> {
        self.tile_starts[tile] as usize..self.tile_starts[tile + 1] as usize
    }

    /// Returns the entries of a splat, which has none where it is not drawn or does not exist.
    pub(crate) fn places_from(&self, number: usize) -> &[u32] {
        let is_drawn = self.splats.get(number).is_some_and(ScreenSplat::is_drawn);
        if is_drawn { self.places_of(number) } else { &[] }
    }

    /// Returns the entries of a splat that is drawn.
    pub(crate) fn places_of(&self, number: usize) -> &[u32] {
        let TileRectangle { left, right, top, bottom, first_place } = self.rectangles[number];
        let count = usize::from(right - left + 1) * usize::from(bottom - top + 1);
        &self.places[first_place as usize..first_place as usize + count]
    }

    /// Returns the depth that the depths of a tile's entries are measured from, metres. It is
    /// amidst them, which keeps their differences precise.
    pub(crate) fn reference_depth(&self, tile: usize) -> f32 {
        let entries = &self.entries[self.entries_of(tile)];
        entries.get(entries.len() / 2).map_or(0.0, |&splat| self.splats[splat as usize].depth)
    }
}

/// Returns a float as an integer in the same order, negative floats included.
fn in_order(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}
