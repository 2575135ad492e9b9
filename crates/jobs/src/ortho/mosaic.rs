//! Makes the ortho block by block: each cell comes from the image that sees it most steeply.

use geodesy::LonLatHeight;
use io::raster::Dem;
use numeric::Progress;
use occlusion::OcclusionSurface;
use ortho::{Balance, Pair, Sight, balance, best_view};
use raster::Grid;
use rayon::prelude::*;

use super::config::OrthoConfig;
use super::error::OrthoError;
use super::inputs::{OrthoGrid, OrthoInputs};
use super::states::{HIDDEN, OUTSIDE, OrthoCounts, SEEN, VOID};
use super::view::{Cell, Seen, look};

/// Side of a block, cells.
const BLOCK: usize = 512;
/// Number of cells, spread over the ortho, whose grey values are compared.
const COMPARED: usize = 60_000;

/// An ortho.
pub(super) struct Ortho {
    /// Values by band, NaN where there is none.
    pub(super) bands: Vec<Grid<f32>>,
    /// [`SEEN`], [`HIDDEN`], [`OUTSIDE`] or [`VOID`].
    pub(super) state: Grid<u8>,
    /// Number of the image, from 1; 0 where there is none.
    pub(super) view: Grid<u8>,
    /// Gains and offsets by image and band.
    pub(super) balances: Vec<Vec<Balance>>,
    /// Counts of cells by image.
    pub(super) counts: Vec<OrthoCounts>,
}

/// Makes the ortho.
pub(super) fn make(inputs: &OrthoInputs, config: &OrthoConfig, progress: &dyn Progress) -> Result<Ortho, OrthoError> {
    let surface = OcclusionSurface::new(&inputs.dsm.heights, inputs.cell_m);
    let work = Work { inputs, tolerance_m: config.tolerance_m, surface: &surface };
    let bands = inputs.images[0].source.info().bands;
    let balances = if !config.balance || inputs.images.len() < 2 {
        vec![vec![Balance::NONE; bands]; inputs.images.len()]
    } else {
        work.balances(bands, progress)?
    };
    let (width, height) = (inputs.grid.width, inputs.grid.height);
    let mut ortho = Ortho {
        bands: vec![Grid::filled(width, height, f32::NAN); bands],
        state: Grid::filled(width, height, VOID),
        view: Grid::filled(width, height, 0),
        balances,
        counts: vec![OrthoCounts::default(); inputs.images.len()],
    };
    let blocks = work.blocks();
    progress.begin("ortho", blocks.len());
    for block in blocks {
        progress.check_cancelled()?;
        let cells = work.cells(&block, 1);
        let seen = work.look(&cells)?;
        ortho.take(&block, &cells, &seen, config.keep_hidden);
        progress.step();
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

/// What every block needs.
struct Work<'a> {
    inputs: &'a OrthoInputs,
    tolerance_m: f64,
    surface: &'a OcclusionSurface<'a>,
}

impl Work<'_> {
    /// Divides the ortho into blocks, row by row.
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

    /// Returns every `stride`-th cell of a block along both axes of the ortho; `None` for a cell
    /// without a height.
    fn cells(&self, block: &Block, stride: usize) -> Vec<Option<Cell>> {
        let on = |first: usize, length: usize| (first.next_multiple_of(stride)..first + length).step_by(stride);
        let rows: Vec<usize> = on(block.top, block.height).collect();
        let ground = Ground { grid: &self.inputs.grid, dsm: &self.inputs.dsm, surface: self.surface };
        let ground = &ground;
        rows.par_iter()
            .flat_map_iter(|&row| on(block.left, block.width).map(move |column| ground.cell(column, row)))
            .collect()
    }

    /// Looks at cells through every image.
    fn look(&self, cells: &[Option<Cell>]) -> Result<Vec<Seen>, OrthoError> {
        let images = self.inputs.images.iter();
        images.map(|image| look(self.surface, image, cells, self.tolerance_m)).collect()
    }

    /// Computes gains and offsets by image and band, from cells all over the ortho.
    fn balances(&self, bands: usize, progress: &dyn Progress) -> Result<Vec<Vec<Balance>>, OrthoError> {
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
        progress.begin("grey values", blocks.len());
        for block in blocks {
            progress.check_cancelled()?;
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
            progress.step();
        }
        let reference = (0..images).max_by_key(|&i| (first[i], std::cmp::Reverse(i))).unwrap_or(0);
        let solved = pairs.iter().map(|pairs| balance(images, reference, pairs)).collect::<Result<Vec<_>, _>>();
        let solved = solved?;
        Ok((0..images).map(|image| solved.iter().map(|band| band[image]).collect()).collect())
    }
}

/// Finds the ground points of the cells.
struct Ground<'a> {
    grid: &'a OrthoGrid,
    dsm: &'a Dem,
    surface: &'a OcclusionSurface<'a>,
}

impl Ground<'_> {
    /// Returns a cell with its ground point; `None` if the surface has no height there.
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
    /// Fills the cells of a block from the images.
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
