//! The ortho, block by block: each cell from the image that sees it most steeply, grey values brought together before.

use anyhow::Context;
use geodesy::LonLatHeight;
use io::raster::Dem;
use numeric::Progress;
use occlusion::Surface;
use ortho::{Balance, Pair, Sight, balance, best_view};
use raster::Grid;
use rayon::prelude::*;

use super::Args;
use super::inputs::{Inputs, OrthoGrid};
use super::view::{Cell, Seen, look};
use crate::progress::Watcher;

/// Side of a block, cells.
const BLOCK: usize = 512;
/// Cells from which grey values are compared.
const COMPARED: usize = 60_000;

/// What a cell is.
pub(super) const SEEN: u8 = 0;
pub(super) const HIDDEN: u8 = 1;
pub(super) const OUTSIDE: u8 = 2;
pub(super) const VOID: u8 = 255;

/// A true ortho.
pub(super) struct Ortho {
    /// NaN where there is no value.
    pub(super) bands: Vec<Grid<f32>>,
    /// One of [`SEEN`], [`HIDDEN`], [`OUTSIDE`], [`VOID`].
    pub(super) state: Grid<u8>,
    /// The image, from 1; 0 where there is none.
    pub(super) view: Grid<u8>,
    /// Per image and band.
    pub(super) balances: Vec<Vec<Balance>>,
    /// Per image the cells that it sees, those that are hidden in it, and those that it gave.
    pub(super) counts: Vec<Counts>,
}

#[derive(Debug, Clone, Copy, Default, serde::Serialize)]
pub(super) struct Counts {
    pub(super) seen: usize,
    pub(super) hidden: usize,
    pub(super) used: usize,
}

/// Makes the ortho.
pub(super) fn make(inputs: &Inputs, args: &Args, watcher: &Watcher) -> anyhow::Result<Ortho> {
    let surface = Surface::new(&inputs.dsm.heights, inputs.cell_m);
    let work = Work { inputs, args, surface: &surface };
    let bands = inputs.images[0].source.info().bands;
    let balances = if args.no_balance || inputs.images.len() < 2 {
        vec![vec![Balance::NONE; bands]; inputs.images.len()]
    } else {
        work.balances(bands, watcher)?
    };
    let (width, height) = (inputs.grid.width, inputs.grid.height);
    let mut ortho = Ortho {
        bands: vec![Grid::filled(width, height, f32::NAN); bands],
        state: Grid::filled(width, height, VOID),
        view: Grid::filled(width, height, 0),
        balances,
        counts: vec![Counts::default(); inputs.images.len()],
    };
    let blocks = work.blocks();
    watcher.begin("ortho", blocks.len());
    for block in blocks {
        let cells = work.cells(&block, 1);
        let seen = work.look(&cells)?;
        ortho.take(&block, &cells, &seen, args.keep_hidden);
        watcher.step();
    }
    Ok(ortho)
}

/// A rectangle of cells.
struct Block {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

struct Work<'a> {
    inputs: &'a Inputs,
    args: &'a Args,
    surface: &'a Surface<'a>,
}

impl Work<'_> {
    fn blocks(&self) -> Vec<Block> {
        let grid = &self.inputs.grid;
        let starts = |cells: usize| (0..cells).step_by(BLOCK);
        let block = |left: usize, top: usize| Block {
            left,
            top,
            width: BLOCK.min(grid.width - left),
            height: BLOCK.min(grid.height - top),
        };
        starts(grid.height).flat_map(|top| starts(grid.width).map(move |left| block(left, top))).collect()
    }

    /// The cells of a block, every `stride`-th along both axes of the ortho; `None` without a height.
    fn cells(&self, block: &Block, stride: usize) -> Vec<Option<Cell>> {
        let on = |first: usize, length: usize| (first.next_multiple_of(stride)..first + length).step_by(stride);
        let rows: Vec<usize> = on(block.top, block.height).collect();
        let ground = Ground { grid: &self.inputs.grid, dsm: &self.inputs.dsm, surface: self.surface };
        let ground = &ground;
        rows.par_iter()
            .flat_map_iter(|&row| on(block.left, block.width).map(move |column| ground.cell(column, row)))
            .collect()
    }

    fn look(&self, cells: &[Option<Cell>]) -> anyhow::Result<Vec<Seen>> {
        let images = self.inputs.images.iter();
        images.map(|image| look(self.surface, image, cells, self.args.tolerance)).collect()
    }

    /// Gains and offsets from cells all over the ortho.
    fn balances(&self, bands: usize, watcher: &Watcher) -> anyhow::Result<Vec<Vec<Balance>>> {
        let images = self.inputs.images.len();
        let cells = self.inputs.grid.width as f64 * self.inputs.grid.height as f64;
        let stride = (cells / COMPARED as f64).sqrt().ceil().max(1.0) as usize;
        let mut pairs: Vec<Vec<Pair>> = vec![Vec::new(); bands];
        for i in 0..images {
            for j in i + 1..images {
                pairs.iter_mut().for_each(|band| band.push(Pair { images: (i, j), values: Vec::new() }));
            }
        }
        let mut first = vec![0usize; images];
        let blocks = self.blocks();
        watcher.begin("grey values", blocks.len());
        for block in blocks {
            let cells = self.cells(&block, stride);
            let seen = self.look(&cells)?;
            for k in 0..cells.len() {
                if let Some(view) = best_view(seen.iter().map(|s| s.sights[k])) {
                    first[view] += 1;
                }
            }
            for (band, pairs) in pairs.iter_mut().enumerate() {
                pairs.iter_mut().for_each(|pair| compare(pair, band, &seen));
            }
            watcher.step();
        }
        let reference = (0..images).max_by_key(|&i| (first[i], std::cmp::Reverse(i))).unwrap_or(0);
        let solved = pairs.iter().map(|pairs| balance(images, reference, pairs)).collect::<Result<Vec<_>, _>>();
        let solved = solved.context("give --no-balance")?;
        Ok((0..images).map(|image| solved.iter().map(|band| band[image]).collect()).collect())
    }
}

/// The cells of an ortho on its surface.
struct Ground<'a> {
    grid: &'a OrthoGrid,
    dsm: &'a Dem,
    surface: &'a Surface<'a>,
}

impl Ground<'_> {
    /// `None` where the surface has no height.
    fn cell(&self, column: usize, row: usize) -> Option<Cell> {
        let Self { grid, dsm, .. } = self;
        let (c, r) = (column as f64, row as f64);
        let (in_dsm, height) = if grid.is_dsm {
            ([c, r], dsm.heights[(column, row)])
        } else {
            let (x, y) = grid.geotransform.map_from_cell(c, r);
            let (c, r) = dsm.geotransform.cell_from_map(x, y)?;
            ([c, r], self.surface.height_at(c, r))
        };
        let [lon, lat] = grid.ground.lonlat(column as f64, row as f64);
        height.is_finite().then(|| Cell { in_dsm, ground: LonLatHeight::new(lon, lat, f64::from(height)) })
    }
}

/// Adds the values of cells that both images of a pair see.
fn compare(pair: &mut Pair, band: usize, seen: &[Seen]) {
    let (a, b) = (&seen[pair.images.0], &seen[pair.images.1]);
    let both = |k: usize| matches!((a.sights[k], b.sights[k]), (Sight::Seen { .. }, Sight::Seen { .. }));
    let cells = (0..a.sights.len()).filter(|&k| both(k));
    pair.values.extend(cells.map(|k| (a.values[band][k], b.values[band][k])));
}

impl Ortho {
    /// Takes the cells of a block from the images.
    fn take(&mut self, block: &Block, cells: &[Option<Cell>], seen: &[Seen], keep_hidden: bool) {
        for (counts, seen) in self.counts.iter_mut().zip(seen) {
            counts.seen += seen.sights.iter().filter(|s| matches!(s, Sight::Seen { .. })).count();
            counts.hidden += seen.sights.iter().filter(|s| matches!(s, Sight::Hidden)).count();
        }
        for (k, cell) in cells.iter().enumerate() {
            let at = (block.left + k % block.width, block.top + k / block.width);
            if cell.is_none() {
                continue;
            }
            let hidden = seen.iter().position(|s| s.sights[k] == Sight::Hidden);
            let best = best_view(seen.iter().map(|s| s.sights[k]));
            self.state[at] = match (best, hidden) {
                (Some(_), _) => SEEN,
                (None, Some(_)) => HIDDEN,
                (None, None) => OUTSIDE,
            };
            let Some(view) = best.or(hidden.filter(|_| keep_hidden)) else { continue };
            self.view[at] = (view + 1) as u8;
            self.counts[view].used += usize::from(best.is_some());
            for (band, grid) in self.bands.iter_mut().enumerate() {
                grid[at] = self.balances[view][band].apply(seen[view].values[band][k]);
            }
        }
    }
}
