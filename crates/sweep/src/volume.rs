//! The cost volume of one window of a view: the hypotheses of every pixel with their costs against
//! the sources, and their aggregation.

use multiversion::multiversion;
use numeric::upper_median;
use raster::{Grid, Window};

use crate::aggregation::{FARTHEST, LANES, Penalties, RowSums, VolumeBlock, aggregate};
use crate::cost::{BlockCosts, CostConfig, TileScratch, sweep_tile};
use crate::error::SweepError;
use crate::ranges::{NOT_STEEP, Ranges};
use crate::reference::Reference;
use crate::tiles::tiles_on;
use crate::view::ViewLevel;

/// Largest number of hypotheses of a window: more would take over 2 GB.
const HYPOTHESES_MAX: u32 = 700_000_000;

/// Costs of a window's pixels, row after row, one byte per hypothesis.
#[derive(Debug, Clone)]
pub struct CostVolume {
    width: usize,
    height: usize,
    /// First hypothesis of each pixel.
    low: Vec<i32>,
    /// Hypothesis at which a steep surface is expected at each pixel.
    steep: Vec<i32>,
    /// Index of each pixel's first cost; one entry more than there are pixels.
    offsets: Vec<u32>,
    /// The costs, followed by [`LANES`] entries that belong to no pixel.
    costs: Vec<u8>,
    /// Strength of the image edge at each pixel, 0 to 255.
    edges: Vec<u8>,
}

impl CostVolume {
    /// Computes the costs of all hypotheses of a window of the reference.
    ///
    /// `buffer` becomes the memory of the costs, and [`Self::into_buffer`] returns it: fresh pages
    /// would cost as much time as writing to them.
    ///
    /// # Errors
    /// Returns [`SweepError::NotSmooth`] if a camera is not smooth at the scale of a tile,
    /// [`SweepError::TooManyHypotheses`] if the window does not fit into memory, and
    /// [`SweepError::HeightsTooFar`] if the ranges lie absurdly far from the ellipsoid.
    pub fn compute(
        reference: Reference<'_>,
        sources: &[ViewLevel<'_>],
        window: Window,
        config: &CostConfig,
        buffer: Vec<u8>,
    ) -> Result<Self, SweepError> {
        let (low, offsets) = layout(reference.ranges, window)?;
        let steep = reference.ranges.steep.window(window, NOT_STEEP).into_vec();
        // Every hypothesis gets its cost below, whatever the buffer holds.
        let mut costs = buffer;
        costs.resize(offsets.last().map_or(0, |&n| n as usize) + LANES, 0);
        let mut scratch = TileScratch::default();
        let mut block = BlockCosts { window, offsets: &offsets, costs: &mut costs };
        let first = [(0, window.x), (1, window.y)].map(|(axis, at)| reference.view.first[axis] + at as usize);
        for tile in tiles_on(window, config.tile, first) {
            sweep_tile(reference, sources, tile, config, &mut scratch, &mut block)?;
        }
        let mut edges = edge_strength(reference.view.image, window, reference.view.noise);
        if let Some(prior) = reference.prior {
            prior.favour(window, reference.ranges.step_m, &low, &offsets, &mut costs);
            prior.mark_edges(window, reference.ranges.step_m, &mut edges);
        }
        Ok(Self { width: window.width, height: window.height, low, steep, offsets, costs, edges })
    }

    /// Returns the number of hypotheses of all pixels.
    pub fn hypotheses(&self) -> usize {
        self.costs.len() - LANES
    }

    /// Returns the memory of the costs, for the next volume.
    pub fn into_buffer(self) -> Vec<u8> {
        self.costs
    }

    /// Sums the path costs over eight directions and hands every row of sums to `read`, the last
    /// row first. `forward` is a scratch buffer for the first four directions, which may be used
    /// again.
    pub fn aggregate(&self, penalties: Penalties, forward: &mut Vec<u8>, read: impl FnMut(usize, RowSums<'_>)) {
        aggregate(&self.as_block(), penalties, forward, read);
    }

    /// Returns the volume as the aggregation reads it.
    pub(crate) fn as_block(&self) -> VolumeBlock<'_> {
        VolumeBlock {
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

/// Returns the first hypothesis of each pixel of a window, and the index of its first cost.
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

/// Returns the strength of the edge at each pixel, 0 to 255: its gradient against the block's
/// median and the noise. Invalid pixels are no edge and do not count in the median.
fn edge_strength(image: &Grid<f32>, w: Window, noise: f32) -> Vec<u8> {
    let mut gradient = vec![0.0f32; w.width * w.height];
    for (y, row) in gradient.chunks_exact_mut(w.width).enumerate() {
        let gy = w.y as usize + y;
        let below = if gy + 1 < image.height() { gy + 1 } else { gy };
        gradients(&image.row(gy)[w.x as usize..], &image.row(below)[w.x as usize..], row);
    }
    // A quarter of the rows, thousands of pixels even in a small block, gives the median well
    // enough.
    let rows = gradient.chunks_exact(w.width).step_by(4);
    let mut known: Vec<f32> = rows.flatten().copied().filter(|g| g.is_finite()).collect();
    let typical = upper_median(&mut known).unwrap_or(0.0);
    let mut edges = vec![0; gradient.len()];
    grade_edges(&gradient, typical.max(noise).max(f32::MIN_POSITIVE), &mut edges);
    edges
}

/// Grades gradients from 0 to 255: up to twice the `unit` they are texture, from eight times it
/// they are full edges.
#[multiversion(targets("x86_64+avx2"))]
fn grade_edges(gradient: &[f32], unit: f32, out: &mut [u8]) {
    for (edge, g) in out.iter_mut().zip(gradient) {
        let grade = (((g / unit - 2.0) / 6.0).clamp(0.0, 1.0) * 255.0) as i32 as u8;
        *edge = if g.is_finite() { grade } else { 0 };
    }
}

/// Computes the greater of the differences to the right and to the lower neighbour. The last column
/// may lack a right neighbour.
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
