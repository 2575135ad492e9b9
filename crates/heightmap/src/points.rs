//! Heights of points at the pixels of a tile: the highest point in the square of each pixel.
//!
//! [`PointTiles`] adds every point to all tiles that it falls into, so that one pass over a cloud
//! fills them all.

use std::collections::HashMap;

use raster::Grid;

use crate::lattice::TileMap;

/// Collects the highest points of a tile.
#[derive(Debug)]
pub struct HighestPoints {
    map: TileMap,
    zero_m: f64,
    heights: Grid<f32>,
    points: u64,
}

impl HighestPoints {
    /// Makes an empty tile of `size × size` pixels. `map` leads from the map of the points to
    /// pixels ([`TileMap::from_map`]). Heights are kept above `zero_m` (metres above the
    /// ellipsoid).
    pub fn new(map: TileMap, size: usize, zero_m: f64) -> Self {
        Self { map, zero_m, heights: Grid::filled(size, size, f32::NAN), points: 0 }
    }

    /// Adds a point at (x, y) of its map with a height above its datum, metres.
    #[inline]
    pub fn push(&mut self, x: f64, y: f64, height_m: f64) {
        if !self.map.holds(x, y) {
            return;
        }
        let [column, row, shift] = self.map.at(x, y);
        let (column, row) = ((column + 0.5).floor(), (row + 0.5).floor());
        let inside = |v: f64, pixels: usize| v >= 0.0 && v < pixels as f64;
        if inside(column, self.heights.width()) && inside(row, self.heights.height()) && height_m.is_finite() {
            let height = (height_m + (shift - self.zero_m)) as f32;
            let cell = &mut self.heights[(column as usize, row as usize)];
            if cell.is_nan() || height > *cell {
                *cell = height;
            }
            self.points += 1;
        }
    }

    /// Returns the heights, NaN where there is no point, and the number of points in the tile.
    pub fn finish(self) -> (Grid<f32>, u64) {
        (self.heights, self.points)
    }
}

/// Tiles over one cloud. A grid of squares as wide as the widest tile finds the tiles of a point.
#[derive(Debug)]
pub struct PointTiles {
    tiles: Vec<HighestPoints>,
    side: f64,
    near: HashMap<(i64, i64), Vec<usize>>,
}

impl PointTiles {
    /// Arranges tiles that one pass fills.
    pub fn new(tiles: Vec<HighestPoints>) -> Self {
        let domains: Vec<_> = tiles.iter().map(|tile| tile.map.domain()).collect();
        let widest = |(low, high): &([f64; 2], [f64; 2])| (high[0] - low[0]).max(high[1] - low[1]);
        let side = domains.iter().map(widest).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        let mut near: HashMap<_, Vec<usize>> = HashMap::new();
        for (tile, (low, high)) in domains.iter().enumerate() {
            let ((i0, j0), (i1, j1)) = (square(side, low[0], low[1]), square(side, high[0], high[1]));
            for place in (i0..=i1).flat_map(|i| (j0..=j1).map(move |j| (i, j))) {
                near.entry(place).or_default().push(tile);
            }
        }
        Self { tiles, side, near }
    }

    /// Adds a point to its tiles; see [`HighestPoints::push`].
    #[inline]
    pub fn push(&mut self, x: f64, y: f64, height_m: f64) {
        let Some(near) = self.near.get(&square(self.side, x, y)) else { return };
        for &tile in near {
            self.tiles[tile].push(x, y, height_m);
        }
    }

    /// Returns the heights of the tiles in their order; see [`HighestPoints::finish`].
    pub fn finish(self) -> Vec<(Grid<f32>, u64)> {
        self.tiles.into_iter().map(HighestPoints::finish).collect()
    }
}

fn square(side: f64, x: f64, y: f64) -> (i64, i64) {
    ((x / side).floor() as i64, (y / side).floor() as i64)
}
