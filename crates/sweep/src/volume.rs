//! The cost volume of one window of a view: for every pixel its own hypotheses, their costs against the sources, and what
//! the semi-global aggregation makes of them.

use raster::{Grid, Window};

use crate::SweepError;
use crate::cost::{BlockCosts, COST_MAX, CostConfig, Reference, SourceLevel, TileScratch, sweep_tile};
use crate::level::tiles;
use crate::ranges::Ranges;
use crate::semiglobal::{LANES, Penalties, RowSums, Volume, aggregate};

/// A window with more hypotheses than this would take more than 2 GB.
const HYPOTHESES_MAX: u32 = 700_000_000;

/// Costs of a window's pixels, row after row; memory follows the hypotheses, a byte each.
#[derive(Debug, Clone)]
pub struct CostVolume {
    width: usize,
    height: usize,
    low: Vec<i32>,
    offsets: Vec<u32>,
    costs: Vec<u8>,
    edges: Vec<u8>,
}

impl CostVolume {
    /// Sweeps a window of the reference through the hypotheses of its pixels.
    ///
    /// # Errors
    /// A camera that fails inside the scene, or is not smooth at the scale of a tile; more hypotheses than fit into memory.
    pub fn compute(
        reference: Reference<'_>,
        sources: &[SourceLevel<'_>],
        window: Window,
        config: &CostConfig,
    ) -> Result<Self, SweepError> {
        let (low, offsets) = layout(reference.ranges, window)?;
        let mut costs = vec![COST_MAX; offsets.last().map_or(0, |&n| n as usize) + LANES];
        let mut scratch = TileScratch::default();
        let mut block = BlockCosts { window, offsets: &offsets, costs: &mut costs };
        for tile in tiles(window, config.tile) {
            sweep_tile(reference, sources, tile, config, &mut scratch, &mut block)?;
        }
        let mut edges = edge_strength(reference.view.image, window, reference.view.noise);
        if let Some(prior) = reference.prior {
            prior.favour(window, reference.ranges.step_m, &low, &offsets, &mut costs);
            prior.mark_edges(window, reference.ranges.step_m, &mut edges);
        }
        Ok(Self { width: window.width, height: window.height, low, offsets, costs, edges })
    }

    /// Number of hypotheses of all pixels.
    pub fn hypotheses(&self) -> usize {
        self.costs.len() - LANES
    }

    /// The sums of the path costs over eight directions, one per hypothesis: `read` is given every row's, the last row first.
    /// `forward` is room for the first half of the directions; one that is used again need not be made anew.
    pub fn aggregate(&self, penalties: Penalties, forward: &mut Vec<u16>, read: impl FnMut(usize, RowSums<'_>)) {
        aggregate(&self.as_block(), penalties, forward, read);
    }

    pub(crate) fn as_block(&self) -> Volume<'_> {
        Volume {
            width: self.width,
            height: self.height,
            low: &self.low,
            offsets: &self.offsets,
            costs: &self.costs,
            edges: &self.edges,
        }
    }
}

/// First hypotheses and cost offsets of a window's pixels.
fn layout(ranges: &Ranges, window: Window) -> Result<(Vec<i32>, Vec<u32>), SweepError> {
    let area = window.width * window.height;
    let (mut low, mut offsets) = (Vec::with_capacity(area), Vec::with_capacity(area + 1));
    let mut next = 0u32;
    offsets.push(next);
    for y in 0..window.height {
        for x in 0..window.width {
            let at = (window.x as usize + x, window.y as usize + y);
            low.push(ranges.low[at]);
            next += u32::from(ranges.count[at]);
            if next > HYPOTHESES_MAX {
                return Err(SweepError::TooManyHypotheses { limit: HYPOTHESES_MAX });
            }
            offsets.push(next);
        }
    }
    Ok((low, offsets))
}

/// How strong an edge each pixel is, 0 to 255: its gradient against the block's typical one and the noise. Pixels without
/// a value are no edge, and say nothing of what is typical.
fn edge_strength(image: &Grid<f32>, w: Window, noise: f32) -> Vec<u8> {
    let mut gradient = Vec::with_capacity(w.width * w.height);
    let mut known = Vec::with_capacity(w.width * w.height);
    for y in 0..w.height {
        for x in 0..w.width {
            let (gx, gy) = (w.x as usize + x, w.y as usize + y);
            let here = image[(gx, gy)];
            let right = image.get(gx + 1, gy).copied().unwrap_or(here);
            let below = image.get(gx, gy + 1).copied().unwrap_or(here);
            let g = (right - here).abs().max((below - here).abs());
            gradient.push(if g.is_finite() { g } else { 0.0 });
            known.extend(g.is_finite().then_some(g));
        }
    }
    let middle = known.len() / 2;
    let typical = if known.is_empty() { 0.0 } else { *known.select_nth_unstable_by(middle, f32::total_cmp).1 };
    // Gradients up to twice the typical one are texture; from eight times on they are edges.
    let unit = typical.max(noise).max(f32::MIN_POSITIVE);
    gradient.iter().map(|g| (((g / unit - 2.0) / 6.0).clamp(0.0, 1.0) * 255.0) as u8).collect()
}
