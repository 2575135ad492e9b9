//! Makes the ortho block by block: each cell comes from the image that sees it most steeply.

use formats::raster::Dem;
use geodesy::LonLatHeight;
use numeric::Progress;
use occlusion::OcclusionSurface;
use ortho::{Balance, MosaicRule, Pair, Sight, balance, best_view, feather_weight, median_value};
use raster::Grid;
use rayon::prelude::*;

use super::error::OrthoError;
use super::inputs::{OrthoGrid, OrthoInputs, Pixels};
use super::laying::Laying;
use super::states::{HIDDEN, OUTSIDE, OrthoCounts, SEEN, VOID};
use super::view::{Cell, Seen, look};

/// Side of a block, cells.
const BLOCK: usize = 512;
/// Number of cells, spread over the ortho, whose grey values are compared.
const COMPARED: usize = 60_000;
/// Half the width of a feathered seam, cells. Differences of grey values that the balance leaves
/// are soft shadows of the seam over a few cells; over many, the images would be mixed where they
/// do not match to the pixel.
const FEATHER_CELLS: usize = 16;

/// An ortho.
pub(crate) struct Ortho {
    /// Values by band, NaN where there is none.
    pub(crate) bands: Vec<Grid<f32>>,
    /// [`SEEN`], [`HIDDEN`], [`OUTSIDE`] or [`VOID`].
    pub(super) state: Grid<u8>,
    /// Number of the image, from 1; 0 where there is none.
    pub(super) view: Grid<u8>,
    /// Gains and offsets by image and band.
    pub(super) balances: Vec<Vec<Balance>>,
    /// Counts of cells by image.
    pub(crate) counts: Vec<OrthoCounts>,
}

/// Makes the ortho.
///
/// # Errors
/// [`OrthoError::NothingSeen`], and pixels that cannot be read.
pub(super) fn make<P: Pixels>(
    inputs: &OrthoInputs<'_, P>,
    laying: Laying,
    progress: &dyn Progress,
) -> Result<Ortho, OrthoError> {
    let surface = OcclusionSurface::new(&inputs.surface.dsm.heights, inputs.surface.cell_m);
    let work = Work { inputs, tolerance_m: laying.tolerance_m, surface: &surface };
    let bands = inputs.images[0].source.bands();
    let balances = if !laying.balance || inputs.images.len() < 2 {
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
        // Seams are blended with what lies around them, beyond the block.
        let margin = if laying.mosaic == MosaicRule::Feather { FEATHER_CELLS } else { 0 };
        let wide = block.grown(margin, (width, height));
        let cells = work.cells(&wide, 1);
        let seen = work.look(&cells)?;
        let part = LookedAt { block: &wide, cells: &cells, seen: &seen };
        ortho.take(&block, &part, laying);
        progress.step();
    }
    if !ortho.state.data().iter().any(|state| matches!(*state, SEEN | HIDDEN)) {
        let heights = ortho.state.data().iter().filter(|state| **state != VOID).count();
        return Err(OrthoError::NothingSeen { cells: ortho.state.data().len(), heights });
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

impl Block {
    /// Returns the block with `margin` more cells on each side, inside a raster of `size`.
    fn grown(&self, margin: usize, size: (usize, usize)) -> Self {
        let (left, top) = (self.left.saturating_sub(margin), self.top.saturating_sub(margin));
        let right = (self.left + self.width + margin).min(size.0);
        let foot = (self.top + self.height + margin).min(size.1);
        Self { left, top, width: right - left, height: foot - top }
    }

    /// Returns the number of a cell of the ortho among those of the block.
    const fn index(&self, (column, row): (usize, usize)) -> usize {
        (row - self.top) * self.width + column - self.left
    }
}

/// A block as all images see it.
struct LookedAt<'a> {
    block: &'a Block,
    cells: &'a [Option<Cell>],
    seen: &'a [Seen],
}

impl LookedAt<'_> {
    /// Returns the weights of all images in the cells of the block.
    fn feather_weights(&self) -> Vec<Grid<f32>> {
        let count = self.cells.len();
        let best: Vec<Option<usize>> = (0..count).map(|k| best_view(self.seen.iter().map(|s| s.sights[k]))).collect();
        let grid = |of: &dyn Fn(usize) -> bool| {
            let cells = (0..count).map(of).collect();
            Grid::from_vec(self.block.width, self.block.height, cells).unwrap_or_else(|| Grid::filled(0, 0, false))
        };
        let weight = |(view, seen): (usize, &Seen)| {
            let gives = grid(&|k| best[k] == Some(view));
            let sees = grid(&|k| matches!(seen.sights[k], Sight::Seen { .. }));
            feather_weight(&gives, &sees, FEATHER_CELLS)
        };
        self.seen.par_iter().enumerate().map(|(view, seen)| weight((view, seen))).collect()
    }
}

/// What every block needs.
struct Work<'a, P> {
    inputs: &'a OrthoInputs<'a, P>,
    tolerance_m: f64,
    surface: &'a OcclusionSurface<'a>,
}

impl<P: Pixels> Work<'_, P> {
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
        let ground = Ground { grid: &self.inputs.grid, dsm: &self.inputs.surface.dsm, surface: self.surface };
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
    /// Fills the cells of a block from the images. `part` holds the block, and what lies around it
    /// as far as it counts.
    fn take(&mut self, block: &Block, part: &LookedAt<'_>, laying: Laying) {
        let seen = part.seen;
        let weights = if laying.mosaic == MosaicRule::Feather { part.feather_weights() } else { Vec::new() };
        let mut values = Vec::with_capacity(seen.len());
        for row in block.top..block.top + block.height {
            for column in block.left..block.left + block.width {
                let at = (column, row);
                let k = part.block.index(at);
                for (counts, seen) in self.counts.iter_mut().zip(seen) {
                    counts.seen += usize::from(matches!(seen.sights[k], Sight::Seen { .. }));
                    counts.hidden += usize::from(seen.sights[k] == Sight::Hidden);
                }
                if part.cells[k].is_none() {
                    continue;
                }
                let hidden = seen.iter().position(|s| s.sights[k] == Sight::Hidden);
                let best = best_view(seen.iter().map(|s| s.sights[k]));
                self.state[at] = match (best, hidden) {
                    (Some(_), _) => SEEN,
                    (None, Some(_)) => HIDDEN,
                    (None, None) => OUTSIDE,
                };
                let Some(view) = best.or(hidden.filter(|_| laying.keep_hidden)) else { continue };
                self.view[at] = (view + 1) as u8;
                self.counts[view].used += usize::from(best.is_some());
                for (band, grid) in self.bands.iter_mut().enumerate() {
                    let value = |view: usize| self.balances[view][band].apply(seen[view].values[band][k]);
                    let is_seen = |view: &usize| matches!(seen[*view].sights[k], Sight::Seen { .. });
                    grid[at] = match laying.mosaic {
                        _ if best.is_none() => value(view),
                        MosaicRule::Best => value(view),
                        MosaicRule::Feather => {
                            let weighted = (0..seen.len()).filter(is_seen).map(|view| (weights[view].data()[k], view));
                            let (sum, total) = weighted.fold((0.0, 0.0), |(sum, total), (weight, view)| {
                                (sum + weight * value(view), total + weight)
                            });
                            sum / total
                        }
                        MosaicRule::Median => {
                            values.clear();
                            values.extend((0..seen.len()).filter(is_seen).map(value));
                            median_value(&mut values)
                        }
                    };
                }
            }
        }
    }
}
