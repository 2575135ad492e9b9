//! The passes over all tiles: rows of tiles in parallel, each with its own part of every image.

use std::ops::Range;

use rayon::prelude::*;

use crate::arrange::{Arrangement, TILE};
use crate::backward::{self, BlockGradients, TileGradients};
use crate::footprint::BLOCKS;
use crate::forward::{self, BlockSums, DrawnTile, TileSums, TileTask};
use crate::image::{DepthSpread, SurfelImages};
use crate::planes::{IMAGES, TileImages, read_tile, write_tile};
use crate::screen::ScreenGradient;
use crate::simd::{Block, InstructionSet, Kernel, Lanes, Registers, dispatch};

/// What the forward pass leaves.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Painted {
    pub(crate) images: SurfelImages,
    /// Blocks in which each entry was drawn.
    pub(crate) masks: Vec<u16>,
    /// Pixels of each of these blocks, one bit each, in the order of the entries: by rows of tiles.
    pixels: Vec<Vec<u16>>,
    /// End of the pixels of each tile in its row.
    pixel_ends: Vec<u32>,
    /// Sums of each tile.
    ends: Vec<TileEnd>,
}

/// Transmittance, Σ wᵢ sᵢ and Σ wᵢ sᵢ² of the blocks of a tile. The images would have lost their
/// digits.
type TileEnd = [[Block; 3]; BLOCKS];

/// How the rays of a camera lie, and whether the spread of a ray is that of inverse depths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rays {
    /// An affine camera, with the spread of depths.
    Affine,
    /// A perspective camera, with the spread of depths.
    Perspective,
    /// A perspective camera, with the spread of inverse depths.
    InverseDepths,
}

impl Rays {
    pub(crate) fn new(perspective: bool, spread: DepthSpread) -> Self {
        match (perspective, spread) {
            (false, _) => Self::Affine,
            (true, DepthSpread::Depths) => Self::Perspective,
            (true, DepthSpread::InverseDepths) => Self::InverseDepths,
        }
    }
}

/// What the sums of a tile are measured in.
#[derive(Debug, Clone, Copy)]
struct Measure {
    reference_depth: f32,
    /// The moment that holds Σ wᵢ sᵢ.
    first: usize,
    /// Spread of an image per spread of the sums.
    unit: f32,
}

impl Measure {
    fn new(rays: Rays, reference_depth: f32) -> Self {
        // A tile without splats has no reference depth, and no spread either.
        match rays {
            Rays::InverseDepths if reference_depth > 0.0 => {
                Self { reference_depth, first: 2, unit: 1.0 / (reference_depth * reference_depth) }
            }
            Rays::InverseDepths => Self { reference_depth, first: 2, unit: 0.0 },
            Rays::Affine | Rays::Perspective => Self { reference_depth, first: 0, unit: 1.0 },
        }
    }
}

impl Painted {
    /// Draws what was arranged. Returns the number of pairs of a splat and a pixel.
    pub(crate) fn paint(&mut self, arrangement: &Arrangement, rays: Rays, registers: Registers) -> u64 {
        self.images.resize(arrangement.size);
        let [across, down] = arrangement.tiles;
        self.masks.clear();
        self.masks.resize(arrangement.entries.len(), 0);
        self.pixels.resize(down, Vec::new());
        self.pixel_ends.resize(across * down, 0);
        self.ends.resize(across * down, [[Block::ZERO; 3]; BLOCKS]);
        if across * down == 0 {
            return 0;
        }
        let planes = bands_of(self.images.planes_mut().into_iter(), arrangement.size[0] * TILE);
        let masks = by_rows(arrangement, &mut self.masks);
        let tiles = self.ends.chunks_mut(across).zip(self.pixel_ends.chunks_mut(across)).zip(&mut self.pixels);
        let work: Vec<_> = planes.into_iter().zip(masks).zip(tiles).enumerate().collect();
        let pairs = work.into_par_iter().map_init(
            || Box::new(([BlockSums::EMPTY; BLOCKS], [[Block::ZERO; IMAGES]; BLOCKS])),
            |scratch, (row, ((planes, masks), ((ends, pixel_ends), pixels)))| {
                let (sums, images) = &mut **scratch;
                let band =
                    ForwardBand { arrangement, row, rays, planes, masks, pixels, pixel_ends, ends, sums, images };
                dispatch(registers, band)
            },
        );
        pairs.sum()
    }

    /// Computes the gradient of every entry that was drawn.
    pub(crate) fn spread(
        &self,
        arrangement: &Arrangement,
        by_images: &SurfelImages,
        rays: Rays,
        registers: Registers,
        by_entry: &mut [ScreenGradient],
    ) {
        let work: Vec<_> = by_rows(arrangement, by_entry).into_iter().enumerate().collect();
        work.into_par_iter().for_each_init(
            || Box::new(([BlockGradients::ZERO; BLOCKS], [[Block::ZERO; IMAGES]; BLOCKS])),
            |scratch, (row, out)| {
                let (gradients, images) = &mut **scratch;
                let planes = by_images.planes();
                let band = BackwardBand { arrangement, painted: self, planes, row, rays, gradients, images, out };
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

/// Draws a row of tiles.
struct ForwardBand<'a> {
    arrangement: &'a Arrangement,
    row: usize,
    rays: Rays,
    /// The row in all images.
    planes: Vec<&'a mut [f32]>,
    masks: &'a mut [u16],
    pixels: &'a mut Vec<u16>,
    pixel_ends: &'a mut [u32],
    ends: &'a mut [TileEnd],
    sums: &'a mut TileSums,
    images: &'a mut TileImages,
}

impl Kernel for ForwardBand<'_> {
    /// The number of pairs.
    type Output = u64;

    #[inline(always)]
    fn run<I: InstructionSet>(self, isa: I) -> u64 {
        let Self { arrangement, row, rays, mut planes, masks, pixels, pixel_ends, ends, sums, images } = self;
        let mut pairs = 0;
        let mut count = 0;
        for column in 0..arrangement.tiles[0] {
            let (task, entries) = task(arrangement, row, column);
            let mut out = DrawnTile { sums, masks: &mut masks[entries], pixels, count: &mut count };
            pairs += match rays {
                Rays::Affine => forward::draw::<I, false, false>(isa, &task, &mut out),
                Rays::Perspective => forward::draw::<I, true, false>(isa, &task, &mut out),
                Rays::InverseDepths => forward::draw::<I, true, true>(isa, &task, &mut out),
            };
            pixel_ends[column] = count as u32;
            finish(isa, Measure::new(rays, task.reference_depth), sums, &mut ends[column], images);
            write_tile(isa, images, task.origin[0], task.size[0], &mut planes);
        }
        pairs
    }
}

/// Makes the images of a tile of its sums, and keeps what its gradient needs.
#[inline(always)]
fn finish<I: InstructionSet>(isa: I, measure: Measure, sums: &TileSums, end: &mut TileEnd, out: &mut TileImages) {
    for ((sums, end), out) in sums.iter().zip(end).zip(out) {
        let BlockSums { transmittance, colour: [red, green, blue], normal: [east, north, up], moments } = sums;
        *end = [*transmittance, moments[measure.first], moments[1]];
        let (mut coverages, mut depths, mut distortions) = (Block::ZERO, Block::ZERO, Block::ZERO);
        for part in 0..I::PARTS {
            let (depth, second) = (isa.load(&moments[0], part), isa.load(&moments[1], part));
            let first = isa.load(&moments[measure.first], part);
            let coverage = isa.splat(1.0).sub(isa.load(transmittance, part));
            coverage.store(&mut coverages, part);
            isa.splat(measure.reference_depth).mul_add(coverage, depth).store(&mut depths, part);
            let spread = first.neg_mul_add(first, coverage.mul(second));
            spread.mul(isa.splat(measure.unit)).store(&mut distortions, part);
        }
        *out = [*red, *green, *blue, coverages, *east, *north, *up, depths, distortions];
    }
}

/// Computes the gradients of the entries of a row of tiles.
struct BackwardBand<'a> {
    arrangement: &'a Arrangement,
    painted: &'a Painted,
    /// Gradients by all images.
    planes: [&'a [f32]; IMAGES],
    row: usize,
    rays: Rays,
    gradients: &'a mut TileGradients,
    images: &'a mut TileImages,
    out: &'a mut [ScreenGradient],
}

impl Kernel for BackwardBand<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: InstructionSet>(self, isa: I) {
        let Self { arrangement, painted, planes, row, rays, gradients, images, out } = self;
        let first = entries_of_row(arrangement, row).start;
        let mut start = 0;
        for column in 0..arrangement.tiles[0] {
            let (task, entries) = task(arrangement, row, column);
            let tile = row * arrangement.tiles[0] + column;
            let end = painted.pixel_ends[tile] as usize;
            let pixels = &painted.pixels[row][start..end];
            start = end;
            if pixels.is_empty() {
                continue;
            }
            let masks = &painted.masks[first + entries.start..first + entries.end];
            read_tile(isa, images, task.origin, task.size, &planes);
            begin(isa, Measure::new(rays, task.reference_depth), &painted.ends[tile], images, gradients);
            let out = &mut out[entries];
            match rays {
                Rays::Affine => backward::spread::<I, false, false>(isa, &task, masks, pixels, gradients, out),
                Rays::Perspective => backward::spread::<I, true, false>(isa, &task, masks, pixels, gradients, out),
                Rays::InverseDepths => backward::spread::<I, true, true>(isa, &task, masks, pixels, gradients, out),
            }
        }
    }
}

/// Makes the gradients by the sums of a tile of those by its images.
#[inline(always)]
fn begin<I: InstructionSet>(isa: I, measure: Measure, end: &TileEnd, images: &TileImages, out: &mut TileGradients) {
    for ((end, by_image), out) in end.iter().zip(images).zip(out) {
        let [transmittances, firsts, seconds] = end;
        let [red, green, blue, by_coverages, east, north, up, by_depths, by_distortions] = by_image;
        out.transmittance = *transmittances;
        out.rest = Block::ZERO;
        out.colour = [*red, *green, *blue];
        out.normal = [*east, *north, *up];
        for part in 0..I::PARTS {
            let by_depth = isa.load(by_depths, part);
            let by_distortion = isa.load(by_distortions, part).mul(isa.splat(measure.unit));
            let (first, second) = (isa.load(firsts, part), isa.load(seconds, part));
            let coverage = isa.splat(1.0).sub(isa.load(transmittances, part));
            let by_sum = isa.splat(measure.reference_depth).mul_add(by_depth, isa.load(by_coverages, part));
            second.mul_add(by_distortion, by_sum).store(&mut out.moments[0], part);
            if measure.first == 0 {
                first.add(first).neg_mul_add(by_distortion, by_depth).store(&mut out.moments[1], part);
            } else {
                by_depth.store(&mut out.moments[1], part);
                first.add(first).neg_mul_add(by_distortion, isa.splat(0.0)).store(&mut out.moments[3], part);
            }
            coverage.mul(by_distortion).store(&mut out.moments[2], part);
        }
    }
}
