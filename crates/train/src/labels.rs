//! The label of each pixel: that with the greatest sum of the weights that the drawing gives to its
//! splats.
//!
//! The tiles are drawn once more. What a splat takes of the transmittance of a pixel is its weight
//! there, so that labels follow the one rule of compositing.

use gaussian::{LabelVotes, SplatLabel};
use rayon::prelude::*;

use crate::arrange::{Arrangement, TILE};
use crate::footprint::{BLOCKS, pixel_of};
use crate::forward::{BlockSums, TileSums, TileTask, weigh};
use crate::simd::{Block, InstructionSet, Kernel, LANES, Registers, dispatch};

/// Returns the labels of the pixels of what was arranged, by rows.
pub(crate) fn label_map(
    arrangement: &Arrangement,
    labels: &[SplatLabel],
    perspective: bool,
    registers: Registers,
) -> Vec<SplatLabel> {
    let [width, height] = arrangement.size;
    let mut out = vec![SplatLabel::NONE; width * height];
    if width == 0 {
        return out;
    }
    out.par_chunks_mut(width * TILE).enumerate().for_each_init(
        || (Box::new([BlockSums::EMPTY; BLOCKS]), vec![LabelVotes::default(); TILE * TILE]),
        |(sums, votes), (row, out)| {
            dispatch(registers, LabelRow { arrangement, labels, perspective, row, sums, votes, out });
        },
    );
    out
}

/// Finds the labels of a row of tiles.
struct LabelRow<'a> {
    arrangement: &'a Arrangement,
    labels: &'a [SplatLabel],
    perspective: bool,
    row: usize,
    sums: &'a mut TileSums,
    /// Of the pixels of a tile, by rows.
    votes: &'a mut [LabelVotes],
    /// The pixels of the row of tiles.
    out: &'a mut [SplatLabel],
}

impl Kernel for LabelRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: InstructionSet>(self, isa: I) {
        let Self { arrangement, labels, perspective, row, sums, votes, out } = self;
        let width = arrangement.size[0];
        for column in 0..arrangement.tiles[0] {
            let tile = row * arrangement.tiles[0] + column;
            let entries = &arrangement.entries[arrangement.entries_of(tile)];
            let task = TileTask {
                splats: &arrangement.splats,
                entries,
                origin: [column * TILE, row * TILE],
                size: arrangement.size,
                reference_depth: arrangement.reference_depth(tile),
            };
            let take = |number: usize, block: usize, before: &Block, after: &Block| {
                let label = labels[entries[number] as usize];
                for lane in 0..LANES {
                    let weight = before.0[lane] - after.0[lane];
                    if weight > 0.0 {
                        let [x, y] = pixel_of(block, lane);
                        votes[y * TILE + x].add(label, weight);
                    }
                }
            };
            if perspective {
                weigh::<I, true>(isa, &task, sums, take);
            } else {
                weigh::<I, false>(isa, &task, sums, take);
            }
            let [across, down] = task.size_in_image();
            for y in 0..down {
                let line = &mut out[y * width + column * TILE..][..across];
                line.iter_mut().zip(&mut votes[y * TILE..]).for_each(|(to, votes)| *to = votes.take());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Drawing, PinholeView, Surfel};

    /// Surfels in a heap, with three labels and none among them.
    fn scene() -> (Vec<Surfel>, Vec<SplatLabel>) {
        let random = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 997) as f32 / 997.0;
        let surfel = |i: usize| Surfel {
            position: [4.0 * random(i, 1) - 2.0, 3.0 * random(i, 2) - 1.5, 4.0 + 3.0 * random(i, 3)],
            rotation: [1.0, random(i, 4) - 0.5, random(i, 5) - 0.5, 0.3],
            log_scale: [-2.0 + random(i, 6), -2.0 + random(i, 7)],
            opacity_logit: 4.0 * random(i, 8) - 2.0,
            colour: [0.0; 3],
        };
        let label = |i: usize| match i % 4 {
            3 => SplatLabel::NONE,
            kind => SplatLabel { class: 2 + (kind == 1) as u8, object: 1 + (kind == 2) as u32 },
        };
        ((0..700).map(surfel).collect(), (0..700).map(label).collect())
    }

    /// The sums of the weights of three labels are what three colours show.
    #[test]
    fn labels_have_the_weights_of_the_drawing() {
        let camera = PinholeView {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            centre: [0.0; 3],
            focal_px: [70.0; 2],
            principal_px: [37.0, 26.0],
            size: [75, 53],
        };
        let (mut surfels, labels) = scene();
        let known = [labels[0], labels[1], labels[2]];
        for (surfel, label) in surfels.iter_mut().zip(&labels) {
            surfel.colour = known.map(|of| if of == *label { 1.0 } else { 0.0 });
        }
        let drawing = Drawing::new(&surfels, &camera, Registers::Longest);
        let found = drawing.labels(&labels);
        let images = drawing.images();
        let mut kinds = [0; 5];
        for (pixel, found) in found.iter().enumerate() {
            let sums = images.colour.each_ref().map(|plane| plane[pixel]);
            let coverage = images.coverage[pixel];
            let all = [sums[0], sums[1], sums[2], coverage - sums.iter().sum::<f32>()];
            let best = (0..4).fold(0, |best, i| if all[i] > all[best] { i } else { best });
            let close = (0..4).any(|i| i != best && all[best] - all[i] < 1e-4) || (coverage - 0.5).abs() < 1e-4;
            let expected = if coverage > 0.5 && best < 3 { known[best] } else { SplatLabel::NONE };
            assert!(*found == expected || close, "{pixel}: {found:?} {all:?}");
            kinds[if coverage > 0.5 { best } else { 4 }] += 1;
        }
        assert!(kinds.iter().all(|count| *count > 50), "{kinds:?}");
        for registers in [Registers::Plain, Registers::Longest] {
            let drawing = Drawing::new(&surfels, &camera, registers);
            let other = drawing.labels(&labels);
            let differ = other.iter().zip(&found).filter(|(a, b)| a != b).count();
            assert!(differ < 5, "{differ}");
        }
        assert!(Drawing::new(&[], &camera, Registers::Longest).labels(&[]).iter().all(|label| label.is_none()));
    }
}
