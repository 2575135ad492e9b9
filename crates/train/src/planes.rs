//! Copies between the images, which lie by rows, and the blocks of a tile.
//!
//! A line of a tile is a line of the cache in every image. It is copied at once for all its blocks,
//! because lines of a power of two apart would push each other out of the cache. Those of the next
//! tile are asked for at the same time.

use crate::arrange::TILE;
use crate::footprint::{BLOCK_SIDE, BLOCKS};
use crate::simd::{Block, InstructionSet};

/// Images of a drawing.
pub(crate) const IMAGES: usize = 9;
/// Blocks across a tile.
const ACROSS: usize = TILE / BLOCK_SIDE;

/// The values of a tile's pixels in all images.
pub(crate) type TileImages = [[Block; IMAGES]; BLOCKS];

/// Copies a tile into a row of tiles of the images, as far as it lies in them. `width` is the
/// number of columns.
#[inline(always)]
pub(crate) fn write_tile<I: InstructionSet>(
    isa: I,
    tile: &TileImages,
    column: usize,
    width: usize,
    planes: &mut [&mut [f32]],
) {
    let count = (width - column).min(TILE);
    for (number, plane) in planes.iter_mut().enumerate() {
        for (line, row) in plane.chunks_exact_mut(width).enumerate() {
            if let Some(next) = row.get(column + TILE) {
                isa.prefetch(next);
            }
            let to = &mut row[column..column + count];
            if let Ok(to) = <&mut [f32; TILE]>::try_from(&mut *to) {
                for (block, to) in to.as_chunks_mut::<BLOCK_SIDE>().0.iter_mut().enumerate() {
                    *to = *lanes(&tile[line / BLOCK_SIDE * ACROSS + block][number], line);
                }
            } else {
                for (x, to) in to.iter_mut().enumerate() {
                    *to = lanes(&tile[line / BLOCK_SIDE * ACROSS + x / BLOCK_SIDE][number], line)[x % BLOCK_SIDE];
                }
            }
        }
    }
}

/// Copies a tile of the images. What lies outside of them is 0.
#[inline(always)]
pub(crate) fn read_tile<I: InstructionSet>(
    isa: I,
    tile: &mut TileImages,
    origin: [usize; 2],
    size: [usize; 2],
    planes: &[&[f32]; IMAGES],
) {
    let [across, down] = [0, 1].map(|i| (size[i] - origin[i]).min(TILE));
    if across < TILE || down < TILE {
        *tile = [[Block::ZERO; IMAGES]; BLOCKS];
    }
    for (number, plane) in planes.iter().enumerate() {
        for line in 0..down {
            let start = (origin[1] + line) * size[0] + origin[0];
            if let Some(next) = plane.get(start + TILE) {
                isa.prefetch(next);
            }
            let from = &plane[start..start + across];
            if let Ok(from) = <&[f32; TILE]>::try_from(from) {
                for (block, from) in from.as_chunks::<BLOCK_SIDE>().0.iter().enumerate() {
                    *lanes_mut(&mut tile[line / BLOCK_SIDE * ACROSS + block][number], line) = *from;
                }
            } else {
                for (x, from) in from.iter().enumerate() {
                    let block = &mut tile[line / BLOCK_SIDE * ACROSS + x / BLOCK_SIDE][number];
                    lanes_mut(block, line)[x % BLOCK_SIDE] = *from;
                }
            }
        }
    }
}

/// Returns the lanes of a block in a line of its tile.
#[inline(always)]
fn lanes(block: &Block, line: usize) -> &[f32; BLOCK_SIDE] {
    &block.0.as_chunks::<BLOCK_SIDE>().0[line % BLOCK_SIDE]
}

#[inline(always)]
fn lanes_mut(block: &mut Block, line: usize) -> &mut [f32; BLOCK_SIDE] {
    &mut block.0.as_chunks_mut::<BLOCK_SIDE>().0[line % BLOCK_SIDE]
}
