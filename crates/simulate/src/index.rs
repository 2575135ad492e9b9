//! Which blocks a ray can meet: square buckets of the plane, each with the blocks whose bounding box touches it.

use nalgebra::Vector3;

use crate::block::Solid;

/// Side of a bucket, metres: about a building, and about the ground track of a ray between the highest roof and the ground.
const BUCKET_M: f64 = 24.0;

/// Buckets over the bounding box of all blocks.
#[derive(Debug, Clone)]
pub(crate) struct BlockIndex {
    corner_m: [f64; 2],
    shape: [usize; 2],
    buckets: Vec<Vec<usize>>,
    boxes: Vec<[f64; 4]>,
}

impl BlockIndex {
    pub(crate) fn new(solids: &[Solid]) -> Self {
        let boxes: Vec<[f64; 4]> = solids.iter().map(bounding_box).collect();
        let low = |k: usize| boxes.iter().map(|b| b[k]).fold(f64::INFINITY, f64::min);
        let high = |k: usize| boxes.iter().map(|b| b[k + 2]).fold(f64::NEG_INFINITY, f64::max);
        let cells = |k: usize| if boxes.is_empty() { 0 } else { ((high(k) - low(k)) / BUCKET_M) as usize + 1 };
        let shape = [cells(0), cells(1)];
        let buckets = vec![Vec::new(); shape[0] * shape[1]];
        let mut index = Self { corner_m: [low(0), low(1)], shape, buckets, boxes };
        for block in 0..solids.len() {
            let [x0, y0, x1, y1] = index.boxes[block];
            for bucket in index.buckets_touching([x0, y0], [x1, y1]).collect::<Vec<_>>() {
                index.buckets[bucket].push(block);
            }
        }
        index
    }

    /// The blocks whose bounding box touches a box of the plane; a block may come more than once.
    pub(crate) fn near(&self, low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = usize> {
        let touches = move |i: &usize| {
            let [x0, y0, x1, y1] = self.boxes[*i];
            x0 <= high[0] && y0 <= high[1] && x1 >= low[0] && y1 >= low[1]
        };
        self.buckets_touching(low, high).flat_map(|bucket| self.buckets[bucket].iter().copied()).filter(touches)
    }

    /// The blocks that a segment can meet.
    pub(crate) fn between(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> impl Iterator<Item = usize> {
        self.near([a.x.min(b.x), a.y.min(b.y)], [a.x.max(b.x), a.y.max(b.y)])
    }

    fn buckets_touching(&self, low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = usize> + use<> {
        let columns = self.buckets_along(0, low[0], high[0]);
        let rows = self.buckets_along(1, low[1], high[1]);
        let width = self.shape[0];
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    fn buckets_along(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        // Casts saturate: what lies before the first bucket ends at 0, what lies after the last starts at the end.
        let first = ((low - self.corner_m[axis]) / BUCKET_M).floor().max(0.0) as usize;
        let end = (((high - self.corner_m[axis]) / BUCKET_M).floor() + 1.0) as usize;
        first..end.min(self.shape[axis])
    }
}

fn bounding_box(solid: &Solid) -> [f64; 4] {
    let [x, y] = solid.block.centre_m;
    let [dx, dy] = solid.half_extent();
    [x - dx, y - dy, x + dx, y + dy]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::town;

    #[test]
    fn every_block_is_found_where_it_stands_and_none_far_away() {
        let scene = town::build(2, 300.0, 50.0, 35.0);
        let solids: Vec<Solid> = scene.blocks().map(|b| Solid::new(*b)).collect();
        let index = BlockIndex::new(&solids);
        for (i, solid) in solids.iter().enumerate() {
            let centre = solid.block.centre_m;
            assert!(index.near(centre, centre).any(|found| found == i));
        }
        assert_eq!(index.near([9e3, 9e3], [9e3, 9e3]).count(), 0);
        assert_eq!(index.near([-9e3, 0.0], [-8e3, 0.0]).count(), 0);
        assert_eq!(BlockIndex::new(&[]).near([0.0, 0.0], [1.0, 1.0]).count(), 0);
    }
}
