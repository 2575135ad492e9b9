//! The passes over all tiles: rows of tiles in parallel, each with its own part of every image.

use std::ops::Range;

use rayon::prelude::*;

use crate::arrange::{Arrangement, TILE};
use crate::backward::{self, BlockGradients, TileGradients};
use crate::footprint::{BLOCK_SIDE, BLOCKS, pixel_of};
use crate::forward::{self, BlockSums, TileSums, TileTask};
use crate::image::SurfelImages;
use crate::screen::ScreenGradient;
use crate::simd::{Block, InstructionSet, Kernel, LANES, Registers, dispatch};

/// Images that are written: those of the drawing and those that its gradient needs.
const PLANES: usize = 12;

/// What the forward pass leaves.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Painted {
    pub(crate) images: SurfelImages,
    /// Blocks in which each entry was drawn.
    pub(crate) masks: Vec<u16>,
    /// Σ wᵢ mᵢ², by rows.
    second_moment: Vec<f32>,
    /// Number of the last entry of a pixel, by rows.
    last: Vec<f32>,
    /// Π (1 − αᵢ), by rows. The coverage would have lost its digits.
    transmittance: Vec<f32>,
}

impl Painted {
    /// Draws what was arranged. Returns the number of pairs of a splat and a pixel.
    pub(crate) fn paint(&mut self, arrangement: &Arrangement, perspective: bool, registers: Registers) -> u64 {
        self.images.resize(arrangement.size);
        let pixels = arrangement.size[0] * arrangement.size[1];
        for plane in [&mut self.second_moment, &mut self.last, &mut self.transmittance] {
            plane.resize(pixels, 0.0);
        }
        self.masks.clear();
        self.masks.resize(arrangement.entries.len(), 0);
        if pixels == 0 {
            return 0;
        }
        let planes = self.images.planes_mut().into_iter().chain([
            &mut self.second_moment,
            &mut self.last,
            &mut self.transmittance,
        ]);
        let planes = bands_of(planes, arrangement.size[0] * TILE);
        let masks = by_rows(arrangement, &mut self.masks);
        let work: Vec<_> = planes.into_iter().zip(masks).enumerate().collect();
        let pairs = work.into_par_iter().map_init(
            || Box::new([BlockSums::EMPTY; BLOCKS]),
            |sums, (row, (planes, masks))| {
                dispatch(registers, ForwardBand { arrangement, row, perspective, planes, masks, sums })
            },
        );
        pairs.sum()
    }

    /// Computes the gradient of every entry that was drawn.
    pub(crate) fn spread(
        &self,
        arrangement: &Arrangement,
        by_images: &SurfelImages,
        perspective: bool,
        registers: Registers,
        by_entry: &mut [ScreenGradient],
    ) {
        let work: Vec<_> = by_rows(arrangement, by_entry).into_iter().enumerate().collect();
        work.into_par_iter().for_each_init(
            || Box::new([BlockGradients::NONE; BLOCKS]),
            |pixels, (row, out)| {
                let band = BackwardBand { arrangement, painted: self, by_images, row, perspective, pixels, out };
                dispatch(registers, band);
            },
        );
    }
}

/// Cuts values of entries into rows of tiles.
fn by_rows<'a, T>(arrangement: &Arrangement, mut rest: &'a mut [T]) -> Vec<&'a mut [T]> {
    let row = |row| {
        let (part, behind) = std::mem::take(&mut rest).split_at_mut(entries_of_row(arrangement, row).len());
        rest = behind;
        part
    };
    (0..arrangement.tiles[1]).map(row).collect()
}

/// Cuts planes into rows of tiles: the parts of all planes, row by row.
fn bands_of<'a>(planes: impl Iterator<Item = &'a mut Vec<f32>>, length: usize) -> Vec<Vec<&'a mut [f32]>> {
    let mut bands: Vec<Vec<&mut [f32]>> = Vec::new();
    for plane in planes {
        for (row, part) in plane.chunks_mut(length).enumerate() {
            if row == bands.len() {
                bands.push(Vec::new());
            }
            bands[row].push(part);
        }
    }
    bands
}

/// Returns the range of the entries of a row of tiles.
fn entries_of_row(arrangement: &Arrangement, row: usize) -> Range<usize> {
    let across = arrangement.tiles[0];
    let at = |tile: usize| arrangement.tile_starts[tile] as usize;
    at(row * across)..at((row + 1) * across)
}

fn task(arrangement: &Arrangement, row: usize, column: usize) -> (TileTask<'_>, Range<usize>) {
    let tile = row * arrangement.tiles[0] + column;
    let entries = arrangement.entries_of(tile);
    let task = TileTask {
        splats: &arrangement.splats,
        entries: &arrangement.entries[entries.clone()],
        origin: [column * TILE, row * TILE],
        size: arrangement.size,
        reference_depth: arrangement.reference_depth(tile),
    };
    let before = entries_of_row(arrangement, row).start;
    (task, entries.start - before..entries.end - before)
}

/// Calls `visit` for the rows of a block, as far as they lie in the image: pixels in the row of
/// tiles, and lanes.
#[inline(always)]
fn for_rows(task: &TileTask<'_>, block: usize, mut visit: impl FnMut(Range<usize>, Range<usize>)) {
    let [column, row] = pixel_of(block, 0);
    let x = task.origin[0] + column;
    let count = task.size[0].saturating_sub(x).min(BLOCK_SIDE);
    for line in 0..task.size[1].saturating_sub(task.origin[1] + row).min(BLOCK_SIDE) {
        let at = (row + line) * task.size[0] + x;
        if count > 0 {
            visit(at..at + count, line * BLOCK_SIDE..line * BLOCK_SIDE + count);
        }
    }
}

/// Copies a row of a block, which is mostly whole.
#[inline(always)]
fn copy_row(to: &mut [f32], from: &[f32]) {
    match (<&mut [f32; BLOCK_SIDE]>::try_from(&mut *to), <&[f32; BLOCK_SIDE]>::try_from(from)) {
        (Ok(to), Ok(from)) => *to = *from,
        _ => to.copy_from_slice(from),
    }
}

/// Draws a row of tiles.
struct ForwardBand<'a> {
    arrangement: &'a Arrangement,
    row: usize,
    perspective: bool,
    /// The nine images, the second moment, the last entry and the transmittance.
    planes: Vec<&'a mut [f32]>,
    masks: &'a mut [u16],
    sums: &'a mut TileSums,
}

impl Kernel for ForwardBand<'_> {
    /// The number of pairs.
    type Output = u64;

    #[inline(always)]
    fn run<I: InstructionSet>(mut self, isa: I) -> u64 {
        let mut pairs = 0;
        for column in 0..self.arrangement.tiles[0] {
            let (task, entries) = task(self.arrangement, self.row, column);
            let masks = &mut self.masks[entries];
            pairs += if self.perspective {
                forward::draw::<I, true>(isa, &task, masks, self.sums)
            } else {
                forward::draw::<I, false>(isa, &task, masks, self.sums)
            };
            self.write(&task);
        }
        pairs
    }
}

impl ForwardBand<'_> {
    /// Writes the sums of a tile into the images.
    #[inline(always)]
    fn write(&mut self, task: &TileTask<'_>) {
        for (block, sums) in self.sums.iter().enumerate() {
            let [mut coverage, mut depth, mut distortion] = [Block::ZERO; 3];
            let [first, second] = &sums.moments;
            for lane in 0..LANES {
                coverage.0[lane] = 1.0 - sums.transmittance.0[lane];
                depth.0[lane] = task.reference_depth.mul_add(coverage.0[lane], first.0[lane]);
                distortion.0[lane] = coverage.0[lane] * second.0[lane] - first.0[lane] * first.0[lane];
            }
            let [red, green, blue] = &sums.colour;
            let [east, north, up] = &sums.normal;
            let (last, transmittance) = (&sums.last, &sums.transmittance);
            let from: [&Block; PLANES] =
                [red, green, blue, &coverage, east, north, up, &depth, &distortion, second, last, transmittance];
            for_rows(task, block, |pixels, lanes| {
                for (plane, from) in self.planes.iter_mut().zip(from) {
                    copy_row(&mut plane[pixels.clone()], &from.0[lanes.clone()]);
                }
            });
        }
    }
}

/// Computes the gradients of the entries of a row of tiles.
struct BackwardBand<'a> {
    arrangement: &'a Arrangement,
    painted: &'a Painted,
    by_images: &'a SurfelImages,
    row: usize,
    perspective: bool,
    pixels: &'a mut TileGradients,
    out: &'a mut [ScreenGradient],
}

impl Kernel for BackwardBand<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: InstructionSet>(mut self, isa: I) {
        let arrangement = self.arrangement;
        let first = entries_of_row(arrangement, self.row).start;
        for column in 0..arrangement.tiles[0] {
            let (task, entries) = task(arrangement, self.row, column);
            let masks = &self.painted.masks[first + entries.start..first + entries.end];
            if masks.iter().all(|&mask| mask == 0) {
                continue;
            }
            self.read(&task);
            let out = &mut self.out[entries];
            if self.perspective {
                backward::spread::<I, true>(isa, &task, masks, self.pixels, out);
            } else {
                backward::spread::<I, false>(isa, &task, masks, self.pixels, out);
            }
        }
    }
}

impl BackwardBand<'_> {
    /// Reads the state of a tile's pixels, and their gradients by the sums.
    #[inline(always)]
    fn read(&mut self, task: &TileTask<'_>) {
        let (painted, by_images) = (self.painted, self.by_images);
        let start = self.row * TILE * task.size[0];
        for (block, to) in self.pixels.iter_mut().enumerate() {
            *to = BlockGradients::NONE;
            let [by_sum, by_first, by_second] = &mut to.moments;
            for_rows(task, block, |pixels, lanes| {
                let pixels = start + pixels.start..start + pixels.end;
                let copy = |to: &mut Block, plane: &[f32]| copy_row(&mut to.0[lanes.clone()], &plane[pixels.clone()]);
                copy(&mut to.last, &painted.last);
                copy(&mut to.transmittance, &painted.transmittance);
                for i in 0..3 {
                    copy(&mut to.colour[i], &by_images.colour[i]);
                    copy(&mut to.normal[i], &by_images.normal[i]);
                }
                for (at, lane) in pixels.clone().zip(lanes.clone()) {
                    let (by_depth, by_spread) = (by_images.depth_m[at], by_images.distortion_m2[at]);
                    let coverage = painted.images.coverage[at];
                    let first = painted.images.depth_m[at] - task.reference_depth * coverage;
                    by_sum.0[lane] = by_images.coverage[at]
                        + task.reference_depth * by_depth
                        + painted.second_moment[at] * by_spread;
                    by_first.0[lane] = by_depth - 2.0 * first * by_spread;
                    by_second.0[lane] = coverage * by_spread;
                }
            });
        }
    }
}
