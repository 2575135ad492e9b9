//! Division of a surface into blocks as large as bounds on height, colour and overhang allow.
//!
//! The division begins with squares of cells. A rectangle that breaks the bound on heights or
//! colours is cut in two where the sum of squares of both parts is least: squared distances of
//! heights to their planes and of colours to their means, each over the square of its bound. A
//! rectangle that only hangs over lower ground is cut near the side that does, so that strips run
//! along the edges of roofs. Single cells always pass. The result does not depend on the number of
//! threads.

use raster::Grid;
use rayon::prelude::*;

use super::block::{Fit, Plane, Rectangle, SplatBlock, Sums, Tables};
use super::overhang::{self, Overhang};
use super::surface::SLOPE_MAX;
use super::{GaussianConfig, SplatSurface};

/// Overhang that a block may have: a share of the overhang of its cells taken alone, and a share of
/// the bound on heights.
const OVERHANG_OF_CELLS: f64 = 1.0;
const OVERHANG_OF_BOUND: f64 = 0.5;
/// Cost of a void in a rectangle that has heights too, in squares of the bound.
const VOID_COST: f64 = 4.0;

/// Bounds of the blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DivisionConfig {
    /// Largest distance of a height from the plane of its block, metres.
    pub error_m: f64,
    /// Largest standard deviation of the colours of a block, as a share of the display range;
    /// infinite for geometry alone.
    pub colour_error: f64,
    /// Longest side of a block, cells.
    pub side_max: usize,
    /// Whether each side of a block by itself keeps the bound on overhang, as for views from the
    /// ground, instead of all sides together.
    pub clear_sides: bool,
}

impl Default for DivisionConfig {
    /// A quarter of a metre, 3.7 % of the display range (28.6 dB by itself), 32 cells.
    fn default() -> Self {
        Self { error_m: 0.25, colour_error: 0.037, side_max: 32, clear_sides: false }
    }
}

/// Divides a surface into squares of `side` cells on the plane of their heights, smaller at voids
/// and at the border.
///
/// ```
/// use raster::{GeoTransform, Grid};
/// use splats::{SplatSurface, uniform};
/// let heights = Grid::filled(6, 4, 12.5_f32);
/// let geotransform = GeoTransform::north_up(500_000.0, 5_000_000.0, 1.0);
/// let surface = SplatSurface::new(&heights, geotransform, [500_000.0, 5_000_000.0, 0.0]);
/// let blocks = uniform(&surface, 2);
/// assert_eq!((blocks.len(), blocks[0].cells()), (6, 4));
/// ```
pub fn uniform(surface: &SplatSurface<'_>, side: usize) -> Vec<SplatBlock> {
    let tiles = tiles(surface, side.max(1));
    let parts = tiles.par_iter().map(|&tile| {
        let tables = Tables::new(surface, None, tile);
        let whole = Rectangle { column: 0, row: 0, ..tile };
        let mut blocks = Vec::new();
        whole_parts(surface, &tables, whole, &mut blocks);
        blocks
    });
    parts.collect::<Vec<_>>().concat()
}

/// Adds a rectangle without voids as a block, and divides other rectangles into halves.
fn whole_parts(surface: &SplatSurface<'_>, tables: &Tables, part: Rectangle, blocks: &mut Vec<SplatBlock>) {
    let sums = tables.over(part);
    if sums.with_height() == 0.0 {
        return;
    }
    if sums.with_height() as usize == part.cells() {
        blocks.push(tables.block(part, gentle(surface, tables.fit(part, &sums).plane)));
        return;
    }
    let along_columns = part.width >= part.height;
    let at = if along_columns { part.width } else { part.height } / 2;
    part.cut(along_columns, at).into_iter().for_each(|half| whole_parts(surface, tables, half, blocks));
}

/// Limits a plane across a wall to the steepest slope, because a block of a given size cannot avoid
/// the wall.
fn gentle(surface: &SplatSurface<'_>, plane: Plane) -> Plane {
    let (width, height) = surface.geotransform().cell_size();
    Plane {
        by_column_m: plane.by_column_m.clamp(-SLOPE_MAX * width, SLOPE_MAX * width),
        by_row_m: plane.by_row_m.clamp(-SLOPE_MAX * height, SLOPE_MAX * height),
        ..plane
    }
}

/// Divides a surface into blocks within the bounds. `colours` are per cell, NaN where unknown.
pub fn divide(
    surface: &SplatSurface<'_>,
    colours: Option<&Grid<[f32; 3]>>,
    config: &DivisionConfig,
    gaussian: &GaussianConfig,
) -> Vec<SplatBlock> {
    let alone = overhang::of_cells(surface, gaussian, config.error_m);
    let tiles = tiles(surface, config.side_max.max(1));
    let parts = tiles.par_iter().map(|&tile| {
        let tables = Tables::new(surface, colours, tile);
        let division = Division { surface, tables, config, gaussian, alone: &alone };
        let mut blocks = Vec::new();
        division.take(Rectangle { column: 0, row: 0, ..tile }, &mut blocks);
        blocks
    });
    parts.collect::<Vec<_>>().concat()
}

/// Returns the squares of the grid, row after row.
fn tiles(surface: &SplatSurface<'_>, side: usize) -> Vec<Rectangle> {
    let (width, height) = (surface.heights().width(), surface.heights().height());
    let rows = (0..height).step_by(side);
    let tile = |column: usize, row: usize| Rectangle {
        column,
        row,
        width: side.min(width - column),
        height: side.min(height - row),
    };
    rows.flat_map(|row| (0..width).step_by(side).map(move |column| tile(column, row))).collect()
}

struct Division<'a> {
    surface: &'a SplatSurface<'a>,
    tables: Tables,
    config: &'a DivisionConfig,
    gaussian: &'a GaussianConfig,
    alone: &'a Grid<[f32; 4]>,
}

impl Division<'_> {
    fn take(&self, part: Rectangle, blocks: &mut Vec<SplatBlock>) {
        let sums = self.tables.over(part);
        if sums.with_height() == 0.0 {
            return;
        }
        let (along_columns, at) = if (sums.with_height() as usize) < part.cells() {
            self.best_cut(part)
        } else {
            let fit = self.tables.fit(part, &sums);
            let block = self.tables.block(part, fit.plane);
            if part.cells() == 1 {
                blocks.push(block);
                return;
            }
            if self.is_within(part, &sums, &fit, &block) {
                match self.cut_for_overhang(&block) {
                    None => {
                        blocks.push(block);
                        return;
                    }
                    Some(cut) => cut,
                }
            } else {
                self.best_cut(part)
            }
        };
        part.cut(along_columns, at).into_iter().for_each(|half| self.take(half, blocks));
    }

    /// Returns whether heights and colours keep their bounds.
    fn is_within(&self, part: Rectangle, sums: &Sums, fit: &Fit, block: &SplatBlock) -> bool {
        let count = part.cells() as f64;
        let error = self.config.error_m;
        let (width, height) = self.surface.geotransform().cell_size();
        let gentle = fit.plane.by_column_m.abs() <= SLOPE_MAX * width && fit.plane.by_row_m.abs() <= SLOPE_MAX * height;
        let alike = sums.colour_squares() <= self.config.colour_error.powi(2) * sums.with_colour();
        if !gentle || !alike || fit.squares > error * error * count {
            return false;
        }
        (block.row..block.row + block.height).all(|row| {
            (block.column..block.column + block.width).all(|column| {
                let z = self.surface.local_height(column as i64, row as i64);
                (z - block.height_at(column as f64, row as f64)).abs() <= error
            })
        })
    }

    /// Returns where to cut a block that hangs over lower ground; `None` when the overhang is
    /// within its bound.
    fn cut_for_overhang(&self, block: &SplatBlock) -> Option<(bool, usize)> {
        let overhang = Overhang::of(self.surface, block, self.gaussian, self.config.error_m);
        let worst = if self.config.clear_sides {
            overhang.worst_beyond([0, 1, 2, 3].map(|side| self.allowed_beyond(block, side)))?
        } else {
            let rows = block.row..block.row + block.height;
            let cells = rows.flat_map(|row| &self.alone.row(row)[block.column..block.column + block.width]);
            let alone: f64 = cells.flatten().map(|&harm| f64::from(harm)).sum();
            if overhang.total() <= self.allowed(alone, block.cells()) {
                return None;
            }
            overhang.worst()
        };
        let side = if worst < 2 { block.width } else { block.height };
        if side == 1 {
            // The strip is one cell wide already, so it is cut across.
            let along_columns = block.width > 1;
            return Some((along_columns, if along_columns { block.width } else { block.height } / 2));
        }
        let near = (side / 4).max(1);
        Some((worst < 2, if worst.is_multiple_of(2) { near } else { side - near }))
    }

    /// Returns the overhang that a number of cells may have that have `alone` one by one.
    fn allowed(&self, alone: f64, cells: usize) -> f64 {
        OVERHANG_OF_CELLS * alone + OVERHANG_OF_BOUND * self.config.error_m.powi(2) * cells as f64
    }

    /// Returns the overhang that a block may have beyond one side: that of its cells along it.
    fn allowed_beyond(&self, block: &SplatBlock, side: usize) -> f64 {
        let (first, last) = ([block.column, block.row], [block.column + block.width, block.row + block.height]);
        let (mut from, mut to) = (first, last);
        match side {
            0 | 2 => to[side / 2] = first[side / 2] + 1,
            _ => from[side / 2] = last[side / 2] - 1,
        }
        let cells = (from[1]..to[1]).flat_map(|row| &self.alone.row(row)[from[0]..to[0]]);
        let alone: f64 = cells.map(|cell| f64::from(cell[side])).sum();
        self.allowed(alone, (to[0] - from[0]) * (to[1] - from[1]))
    }

    /// Returns the cut with the least squares in both parts, in a tie the cut nearest to the
    /// middle.
    fn best_cut(&self, part: Rectangle) -> (bool, usize) {
        let mut best = (f64::INFINITY, false, 1);
        for (along_columns, side) in [(true, part.width), (false, part.height)] {
            for at in 1..side {
                let off = (at as f64 / side as f64 - 0.5).abs() + 0.5 / side as f64;
                let cost =
                    part.cut(along_columns, at).into_iter().map(|half| self.cost(half)).sum::<f64>() + 1e-3 * off;
                if cost < best.0 {
                    best = (cost, along_columns, at);
                }
            }
        }
        (best.1 || part.height == 1, best.2)
    }

    /// Returns the sum of squares of a part in units of the squared bounds.
    fn cost(&self, part: Rectangle) -> f64 {
        let sums = self.tables.over(part);
        let (heights, cells) = (sums.with_height(), part.cells() as f64);
        if heights == 0.0 {
            return 0.0;
        }
        let colour = sums.colour_squares() / self.config.colour_error.powi(2);
        let (squares, void) = if heights < cells {
            (sums.height_squares(), VOID_COST * heights.min(cells - heights))
        } else {
            (self.tables.fit(part, &sums).squares, 0.0)
        };
        squares / self.config.error_m.powi(2) + colour + void
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use raster::GeoTransform;

    const NORTH_UP: GeoTransform = GeoTransform::north_up(0.0, 0.0, 0.5);

    /// Every cell with a height is in exactly one block, and within the bound of its plane.
    fn check(heights: &Grid<f32>, colours: Option<&Grid<[f32; 3]>>, config: &DivisionConfig) -> Vec<SplatBlock> {
        let surface = SplatSurface::new(heights, NORTH_UP, [0.0; 3]);
        let blocks = divide(&surface, colours, config, &GaussianConfig::default());
        let mut covered = heights.map(|_| 0);
        for block in &blocks {
            for row in block.row..block.row + block.height {
                for column in block.column..block.column + block.width {
                    covered[(column, row)] += 1;
                    let z = f64::from(heights[(column, row)]);
                    assert!((z - block.height_at(column as f64, row as f64)).abs() <= config.error_m + 1e-6);
                }
            }
        }
        assert!(covered.data().iter().zip(heights.data()).all(|(&n, z)| n == i32::from(z.is_finite())));
        blocks
    }

    /// A roof of 12 m × 10 m, 6 m high, in a flat street.
    fn house() -> Grid<f32> {
        let inside = |i: usize| (20..44).contains(&(i % 64)) && (20..40).contains(&(i / 64));
        Grid::from_vec(64, 64, (0..64 * 64).map(|i| if inside(i) { 6.0 } else { 0.0 }).collect()).unwrap()
    }

    #[test]
    fn a_flat_roof_is_a_few_dozen_splats() {
        let heights = house();
        let blocks = check(&heights, None, &DivisionConfig::default());
        let roof = blocks.iter().filter(|b| b.plane.middle_m > 3.0).count();
        assert!((4..=96).contains(&roof), "{roof} blocks on the roof");
        assert!(blocks.len() < 4096 / 20, "{} blocks", blocks.len());
    }

    #[test]
    fn a_pitched_roof_is_planes_and_a_tree_is_not() {
        let ridge =
            Grid::from_vec(32, 32, (0..1024).map(|i| 8.0 - 0.3 * ((i % 32) as f32 - 15.5).abs()).collect()).unwrap();
        assert!(check(&ridge, None, &DivisionConfig::default()).len() < 24);
        // Every cell another height, as in a crown.
        let crown = Grid::from_vec(16, 16, (0..256).map(|i| ((i * 7919) % 23) as f32 * 0.4).collect()).unwrap();
        assert!(check(&crown, None, &DivisionConfig::default()).len() > 150);
    }

    #[test]
    fn colours_are_kept_apart() {
        let heights = Grid::filled(32, 32, 1.0f32);
        let edge = |i: usize| if i % 32 < 11 { [0.2f32; 3] } else { [0.8; 3] };
        let colours = Grid::from_vec(32, 32, (0..1024).map(edge).collect()).unwrap();
        let blocks = check(&heights, Some(&colours), &DivisionConfig::default());
        assert_eq!(blocks.len(), 2);
        assert_eq!((blocks[0].width, blocks[1].width), (11, 21));
        let one = DivisionConfig { colour_error: f64::INFINITY, ..DivisionConfig::default() };
        assert_eq!(check(&heights, Some(&colours), &one).len(), 1);
    }

    #[test]
    fn uniform_blocks_cover_what_has_heights() {
        let mut heights = house();
        heights[(3, 3)] = f32::NAN;
        let surface = SplatSurface::new(&heights, NORTH_UP, [0.0; 3]);
        for side in [1, 2, 3, 5] {
            let cells: usize = uniform(&surface, side).iter().map(SplatBlock::cells).sum();
            assert_eq!(cells, 4095, "{side}");
        }
        assert_eq!(uniform(&surface, 1).len(), 4095);
    }

    proptest! {
        #[test]
        fn any_surface_is_covered_within_the_bound(
            steps in prop::collection::vec(prop_oneof![Just(f32::NAN), -3.0..12.0f32, Just(0.0f32)], 35),
            error_m in 0.05..2.0f64,
        ) {
            // Patches of 6 × 6 cells, each with a little slope.
            let cell = |i: usize| {
                let (c, r) = (i % 40, i / 40);
                steps[(r / 6) * 7 + c / 6] + 0.02 * (c % 6) as f32 - 0.01 * (r % 6) as f32
            };
            let heights = Grid::from_vec(40, 30, (0..1200).map(cell).collect()).unwrap();
            check(&heights, None, &DivisionConfig { error_m, ..DivisionConfig::default() });
        }
    }
}
