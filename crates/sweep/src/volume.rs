//! The cost volume of one window of a view: for every pixel its own hypotheses, their costs against the sources, and what
//! the semi-global aggregation makes of them.

use multiversion::multiversion;
use numeric::upper_median;
use raster::{Grid, Window};

use crate::aggregation::{FARTHEST, LANES, Penalties, RowSums, Volume, aggregate};
use crate::cost::{BlockCosts, CostConfig, TileScratch, sweep_tile};
use crate::error::SweepError;
use crate::ranges::{NOT_STEEP, Ranges};
use crate::reference::Reference;
use crate::tiles::tiles;
use crate::view::ViewLevel;

/// A window with more hypotheses than this would take more than 2 GB.
const HYPOTHESES_MAX: u32 = 700_000_000;

/// Costs of a window's pixels, row after row; memory follows the hypotheses, a byte each.
#[derive(Debug, Clone)]
pub struct CostVolume {
    width: usize,
    height: usize,
    low: Vec<i32>,
    steep: Vec<i32>,
    offsets: Vec<u32>,
    costs: Vec<u8>,
    edges: Vec<u8>,
}

impl CostVolume {
    /// Sweeps a window of the reference through the hypotheses of its pixels. `room` is for the costs ([`Self::into_room`]): fresh
    /// pages cost as much as what is written to them.
    ///
    /// # Errors
    /// A camera that fails inside the scene, or is not smooth at the scale of a tile; more hypotheses than fit into memory.
    pub fn compute(
        reference: Reference<'_>,
        sources: &[ViewLevel<'_>],
        window: Window,
        config: &CostConfig,
        room: Vec<u8>,
    ) -> Result<Self, SweepError> {
        let (low, offsets) = layout(reference.ranges, window)?;
        let steep = reference.ranges.steep.window(window, NOT_STEEP).into_vec();
        // Every hypothesis gets its cost below, whatever was there.
        let mut costs = room;
        costs.resize(offsets.last().map_or(0, |&n| n as usize) + LANES, 0);
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
        Ok(Self { width: window.width, height: window.height, low, steep, offsets, costs, edges })
    }

    /// Number of hypotheses of all pixels.
    pub fn hypotheses(&self) -> usize {
        self.costs.len() - LANES
    }

    /// The room that the costs took, for the next volume.
    pub fn into_room(self) -> Vec<u8> {
        self.costs
    }

    /// The sums of the path costs over eight directions, one per hypothesis: `read` is given every row's, the last row first.
    /// `forward` is room for the first half of the directions; one that is used again need not be made anew.
    pub fn aggregate(&self, penalties: Penalties, forward: &mut Vec<u8>, read: impl FnMut(usize, RowSums<'_>)) {
        aggregate(&self.as_block(), penalties, forward, read);
    }

    pub(crate) fn as_block(&self) -> Volume<'_> {
        Volume {
            width: self.width,
            height: self.height,
            low: &self.low,
            steep: &self.steep,
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
    for y in window.y as usize..window.y as usize + window.height {
        let lows = &ranges.low.row(y)[window.x as usize..][..window.width];
        let farthest = lows.iter().fold(0, |farthest, low| low.unsigned_abs().max(farthest));
        if farthest > FARTHEST {
            return Err(SweepError::HeightsTooFar { farthest, limit: FARTHEST });
        }
        low.extend_from_slice(lows);
        let counts = &ranges.count.row(y)[window.x as usize..][..window.width];
        offsets.extend(counts.iter().map(|count| {
            next += u32::from(*count);
            next
        }));
        if next > HYPOTHESES_MAX {
            return Err(SweepError::TooManyHypotheses { limit: HYPOTHESES_MAX });
        }
    }
    Ok((low, offsets))
}

/// How strong an edge each pixel is, 0 to 255: its gradient against the block's typical one and the noise. Pixels without
/// a value are no edge, and say nothing of what is typical.
fn edge_strength(image: &Grid<f32>, w: Window, noise: f32) -> Vec<u8> {
    let mut gradient = vec![0.0f32; w.width * w.height];
    for (y, row) in gradient.chunks_exact_mut(w.width).enumerate() {
        let gy = w.y as usize + y;
        let below = if gy + 1 < image.height() { gy + 1 } else { gy };
        gradients(&image.row(gy)[w.x as usize..], &image.row(below)[w.x as usize..], row);
    }
    // The median of a fourth of the rows, thousands of pixels even in a small block, is as good as that of all.
    let rows = gradient.chunks_exact(w.width).step_by(4);
    let mut known: Vec<f32> = rows.flatten().copied().filter(|g| g.is_finite()).collect();
    let typical = upper_median(&mut known).unwrap_or(0.0);
    let mut edges = vec![0; gradient.len()];
    grade_edges(&gradient, typical.max(noise).max(f32::MIN_POSITIVE), &mut edges);
    edges
}

/// Gradients up to twice the typical one, the `unit`, are texture; from eight times on they are edges.
#[multiversion(targets("x86_64+avx2"))]
fn grade_edges(gradient: &[f32], unit: f32, out: &mut [u8]) {
    for (edge, g) in out.iter_mut().zip(gradient) {
        let grade = (((g / unit - 2.0) / 6.0).clamp(0.0, 1.0) * 255.0) as i32 as u8;
        *edge = if g.is_finite() { grade } else { 0 };
    }
}

/// The greater of the differences to the right and to the lower neighbour; the last column may have no right one.
#[multiversion(targets("x86_64+avx2"))]
fn gradients(row: &[f32], below: &[f32], out: &mut [f32]) {
    let inner = out.len().min(row.len() - 1);
    let (own, right) = (&row[..inner], &row[1..][..inner]);
    for (((g, here), right), below) in out.iter_mut().zip(own).zip(right).zip(below) {
        *g = (right - here).abs().max((below - here).abs());
    }
    if let Some(g) = out.get_mut(inner) {
        *g = (below[inner] - row[inner]).abs().max((0.0 * row[inner]).abs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_that_no_surface_has_are_an_error() {
        let window = Window::whole(5, 4);
        let mut ranges = Ranges::uniform(5, 4, 1.0, (0.0, 9.0));
        assert!(layout(&ranges, window).is_ok());
        ranges.low[(3, 2)] = i32::MIN;
        let error = layout(&ranges, window).unwrap_err();
        assert_eq!(error, SweepError::HeightsTooFar { farthest: 1 << 31, limit: FARTHEST });
    }
}
