//! Connected regions of a mask, and how far the surface drops along their borders.

use raster::Grid;

/// Distance outside of a region within which the surface must have dropped, metres. Walls in
/// satellite models are ramps of two to three metres.
const OUTSIDE_M: f64 = 4.0;
/// Widest void outside of a region across which the surface is looked for, metres: what a wall of
/// 20 m hides from a view 25° off nadir.
const GAP_M: f64 = 9.0;
/// Distance inside of a region within which the surface must have reached its height, metres.
const INSIDE_M: f64 = 2.0;
/// Distance further outside and inside over which the slope across the border is measured, metres.
const FURTHER_M: f64 = 6.0;
/// Steepest slope that is taken for ground that goes on across a border.
const STEEPEST: f32 = 1.5;
/// No number of a region.
const NONE: u32 = 0;

/// The regions of a mask, one after the other.
pub(crate) struct Regions {
    /// Number of the region of each cell, from 1; 0 is none.
    numbers: Grid<u32>,
    /// Cells of all regions, region by region.
    cells: Vec<u32>,
    /// End of each region in `cells`.
    ends: Vec<usize>,
}

impl Regions {
    /// Finds the regions of a mask; cells that touch at a corner are connected.
    pub(crate) fn of(mask: &Grid<bool>) -> Self {
        Self::joined(mask, |_, _| true)
    }

    /// Finds the regions of a mask within which the surface has no steps above `step_m`.
    pub(crate) fn smooth(mask: &Grid<bool>, surface: &Grid<f32>, step_m: f32) -> Self {
        Self::joined(mask, |from, to| (surface.data()[from] - surface.data()[to]).abs() <= step_m)
    }

    fn joined(mask: &Grid<bool>, is_joined: impl Fn(usize, usize) -> bool) -> Self {
        let (width, height) = (mask.width(), mask.height());
        let mut numbers = Grid::filled(width, height, NONE);
        let (mut cells, mut ends) = (Vec::new(), Vec::new());
        for seed in 0..mask.data().len() {
            if !mask.data()[seed] || numbers.data()[seed] != NONE {
                continue;
            }
            let number = ends.len() as u32 + 1;
            let mut next = cells.len();
            numbers.data_mut()[seed] = number;
            cells.push(seed as u32);
            while let Some(&cell) = cells.get(next) {
                next += 1;
                let (column, row) = (cell as usize % width, cell as usize / width);
                for y in row.saturating_sub(1)..(row + 2).min(height) {
                    for x in column.saturating_sub(1)..(column + 2).min(width) {
                        if mask[(x, y)] && numbers[(x, y)] == NONE && is_joined(cell as usize, y * width + x) {
                            numbers[(x, y)] = number;
                            cells.push((y * width + x) as u32);
                        }
                    }
                }
            }
            ends.push(cells.len());
        }
        Self { numbers, cells, ends }
    }

    /// The number of regions.
    pub(crate) fn len(&self) -> usize {
        self.ends.len()
    }

    /// The cells of a region, as indices into the raster.
    pub(crate) fn cells(&self, region: usize) -> &[u32] {
        let start = if region == 0 { 0 } else { self.ends[region - 1] };
        &self.cells[start..self.ends[region]]
    }

    /// Whether a region holds a cell.
    pub(crate) fn holds(&self, region: usize, cell: u32) -> bool {
        self.numbers.data()[cell as usize] as usize == region + 1
    }

    /// Whether a cell belongs to any region.
    pub(crate) fn is_any(&self, cell: u32) -> bool {
        self.numbers.data()[cell as usize] != NONE
    }

    /// The region that holds a cell of the mask.
    pub(crate) fn at(&self, cell: u32) -> usize {
        self.numbers.data()[cell as usize] as usize - 1
    }

    /// The median over the cells of a region that have a value.
    pub(crate) fn median(&self, region: usize, of: impl Fn(usize) -> f32) -> Option<f32> {
        let values = self.cells(region).iter().map(|&cell| of(cell as usize)).filter(|value| !value.is_nan());
        quantile(&mut values.collect::<Vec<f32>>(), 0.5)
    }

    /// Marks the cells of the regions that are `chosen`.
    pub(crate) fn mask(&self, chosen: impl Fn(usize) -> bool) -> Grid<bool> {
        let mut mask = self.numbers.map(|_| false);
        for region in (0..self.len()).filter(|region| chosen(*region)) {
            self.cells(region).iter().for_each(|&cell| mask.data_mut()[cell as usize] = true);
        }
        mask
    }

    /// The cells up to `reach` cells beside those of a region, along rows and columns. Those that
    /// lie beside several cells of it come several times.
    pub(crate) fn around(&self, region: usize, reach: usize) -> impl Iterator<Item = u32> {
        let (width, height) = (self.numbers.width(), self.numbers.height());
        let beside = move |&cell: &u32| {
            let (column, row) = (cell as usize % width, cell as usize / width);
            let columns = (column.saturating_sub(reach)..(column + reach + 1).min(width)).map(move |x| (x, row));
            let rows = (row.saturating_sub(reach)..(row + reach + 1).min(height)).map(move |y| (column, y));
            columns.chain(rows).map(move |(x, y)| (y * width + x) as u32)
        };
        self.cells(region).iter().flat_map(beside).filter(move |&cell| !self.holds(region, cell))
    }

    /// Returns the heights across the border of a region, along rows and columns: `reach` cells
    /// inside, at the border, and as far outside; with the cell of the border. All are known, and
    /// the middle and the first lie in the region.
    pub(crate) fn across(&self, region: usize, surface: &Grid<f32>, reach: usize) -> Vec<(u32, [f32; 3])> {
        let (width, reach) = (surface.width(), reach as i64);
        let at = |x: i64, y: i64| {
            let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
            let height = surface.get(x, y).filter(|height| !height.is_nan())?;
            Some((self.holds(region, (y * width + x) as u32), *height))
        };
        let mut found = Vec::new();
        for &cell in self.cells(region) {
            let (x, y) = ((cell as usize % width) as i64, (cell as usize / width) as i64);
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let heights = [-reach, 0, 1, reach].map(|k| at(x + k * dx, y + k * dy));
                if let [Some((true, inside)), Some((true, border)), Some((false, _)), Some((false, outside))] = heights
                {
                    found.push((cell, [inside, border, outside]));
                }
            }
        }
        found
    }

    /// Heights by which the surface drops along the border of a region, metres, each with its cell
    /// of the region. Empty for a region whose whole border lies at voids or at that of the raster.
    pub(crate) fn drops_m(&self, region: usize, surface: &Grid<f32>, cell_m: f64) -> Vec<(u32, f32)> {
        let steps = |metres: f64| ((metres / cell_m).round() as i64).max(1);
        let (outside, gap) = (steps(OUTSIDE_M), steps(GAP_M));
        let (inside, further) = (steps(INSIDE_M), steps(FURTHER_M));
        let (number, width) = (region as u32 + 1, surface.width());
        let at = |x: i64, y: i64| {
            (x >= 0 && y >= 0).then_some(())?;
            let place = (x as usize, y as usize);
            Some((*self.numbers.get(place.0, place.1)? == number, surface[place]))
        };
        let mut drops = Vec::new();
        for &cell in self.cells(region) {
            let (x, y) = ((cell as usize % width) as i64, (cell as usize / width) as i64);
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let beside = |k: i64| at(x + k * dx, y + k * dy).filter(|(is_own, _)| !is_own);
                let lowest = |start: i64| {
                    let out = (start..start + outside).map_while(beside);
                    out.map(|(_, height)| height).fold(f32::NAN, f32::min)
                };
                let mut low = lowest(1);
                if low.is_nan() {
                    let is_void = |k: &i64| beside(*k).is_some_and(|(_, height)| height.is_nan());
                    low = lowest(1 + (1..=gap).take_while(is_void).count() as i64);
                }
                if low.is_nan() {
                    continue;
                }
                let own = (0..=inside).map_while(|k| at(x - k * dx, y - k * dy).filter(|(is_own, _)| *is_own));
                let drop = own.map(|(_, height)| height).fold(f32::NAN, f32::max) - low;
                // A slope that goes on across the border is no wall.
                let along = |k: i64| at(x + k * dx, y + k * dy).map_or(f32::NAN, |(_, height)| height);
                let (within, beyond) =
                    (along(-inside - further) - along(-inside), along(outside) - along(outside + further));
                let slope = within.min(beyond);
                let is_one =
                    within.max(beyond) <= 2.0 * slope + 1.0 && slope <= STEEPEST * further as f32 * cell_m as f32;
                let on_slope = if is_one { slope.max(0.0) * (inside + outside) as f32 / further as f32 } else { 0.0 };
                drops.push((cell, drop - on_slope));
            }
        }
        drops
    }
}

/// Returns a quantile of numbers without NaN, and disorders them.
pub(crate) fn quantile(values: &mut [f32], share: f64) -> Option<f32> {
    let last = values.len().checked_sub(1)?;
    let at = (last as f64 * share).round() as usize;
    Some(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}
