//! Known cells at the border of voids: the candidates from which voids are filled.
//!
//! Cells are sorted into square buckets. Rings of buckets around a place are searched outwards, and
//! only what lies inside the circle that the rings complete is used, so that no direction is
//! preferred.

use raster::Grid;

use super::directions::Known;

/// Distance to a void up to which a known cell belongs to its border, cells: the second cell is
/// less affected by the edge than the first.
const DEPTH: usize = 2;
/// Side of a bucket, cells.
const BUCKET: usize = 8;

/// A known cell beside a void.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BorderCell {
    /// Column.
    pub(super) x: f32,
    /// Row.
    pub(super) y: f32,
    /// Height above the origin, metres.
    pub(super) height_m: f32,
    /// Number of a void beside it. A cell beside several voids is listed once for each.
    pub(super) void: u32,
}

/// Cells that are wanted of a border.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// Void whose border is searched; `None` for all.
    pub(super) void: Option<u32>,
    /// Greatest height, metres.
    pub(super) height_max_m: f32,
    /// Number of cells that are enough.
    pub(super) count: usize,
    /// Largest distance, cells.
    pub(super) reach: f32,
}

/// Border cells by bucket.
#[derive(Debug)]
pub(super) struct Border {
    cells: Vec<BorderCell>,
    /// First cell of each bucket, row by row, and the number of cells.
    starts: Vec<usize>,
    /// Least height of each bucket, metres; infinite without cells.
    lowest_m: Vec<f32>,
    columns: usize,
    rows: usize,
}

impl Border {
    /// Collects the cells of `sources` with a height near voids. `voids` holds the number of the
    /// void of each void cell, and 0 elsewhere.
    pub(super) fn new(sources: &Grid<f32>, voids: &Grid<u32>) -> Self {
        let (w, h) = (sources.width(), sources.height());
        let (columns, rows) = (w.div_ceil(BUCKET).max(1), h.div_ceil(BUCKET).max(1));
        let mut buckets: Vec<Vec<BorderCell>> = vec![Vec::new(); columns * rows];
        let mut beside = Vec::new();
        for y in 0..h {
            for x in (0..w).filter(|&x| !sources[(x, y)].is_nan()) {
                beside.clear();
                for v in y.saturating_sub(DEPTH)..(y + DEPTH + 1).min(h) {
                    let near = &voids.row(v)[x.saturating_sub(DEPTH)..(x + DEPTH + 1).min(w)];
                    for &void in near.iter().filter(|void| **void != 0) {
                        if !beside.contains(&void) {
                            beside.push(void);
                        }
                    }
                }
                let cell = |void: &u32| BorderCell { x: x as f32, y: y as f32, height_m: sources[(x, y)], void: *void };
                buckets[y / BUCKET * columns + x / BUCKET].extend(beside.iter().map(cell));
            }
        }
        let mut starts = vec![0];
        let mut cells = Vec::new();
        let mut lowest_m = Vec::with_capacity(buckets.len());
        for bucket in buckets {
            lowest_m.push(bucket.iter().map(|cell| cell.height_m).fold(f32::INFINITY, f32::min));
            cells.extend(bucket);
            starts.push(cells.len());
        }
        Self { cells, starts, lowest_m, columns, rows }
    }

    /// Returns all cells, bucket by bucket.
    pub(super) fn cells(&self) -> &[BorderCell] {
        &self.cells
    }

    /// Finds the nearest wanted cells around a place: all within a circle that holds enough of
    /// them, or within reach.
    pub(super) fn nearest(&self, [x, y]: [f32; 2], wanted: Wanted) -> Vec<Known> {
        let mut found: Vec<Known> = Vec::new();
        // A cell beside several voids is listed several times in a row.
        let mut last = None;
        let (u, v) = (x as usize / BUCKET, y as usize / BUCKET);
        let rings = self.columns.max(self.rows);
        for ring in 0..rings {
            self.ring(u, v, ring, wanted.height_max_m, |cell| {
                let is_own = wanted.void.is_none_or(|void| void == cell.void);
                if !is_own || cell.height_m > wanted.height_max_m {
                    return;
                }
                let (dx, dy) = (cell.x - x, cell.y - y);
                let apart = (dx * dx + dy * dy).sqrt();
                if apart <= wanted.reach && last.replace((cell.x, cell.y)) != Some((cell.x, cell.y)) {
                    found.push(Known::new(cell.height_m, apart));
                }
            });
            // The place lies somewhere in its bucket, so that the rings complete this circle.
            let complete = (ring * BUCKET) as f32;
            if found.len() >= wanted.count && found.iter().filter(|k| k.apart <= complete).count() >= wanted.count {
                found.retain(|k| k.apart <= complete);
                break;
            }
            if complete > wanted.reach {
                break;
            }
        }
        found
    }

    /// Visits the cells of the buckets at a distance of `ring` buckets. Buckets without a height up
    /// to `height_max_m` are left out.
    fn ring(&self, u: usize, v: usize, ring: usize, height_max_m: f32, mut visit: impl FnMut(&BorderCell)) {
        let (left, right) = (u.saturating_sub(ring), (u + ring).min(self.columns - 1));
        for row in v.saturating_sub(ring)..=(v + ring).min(self.rows - 1) {
            let mut see = |column: usize| {
                let bucket = row * self.columns + column;
                if self.lowest_m[bucket] > height_max_m {
                    return;
                }
                self.cells[self.starts[bucket]..self.starts[bucket + 1]].iter().for_each(&mut visit);
            };
            if row.abs_diff(v) == ring {
                (left..=right).for_each(&mut see);
                continue;
            }
            if u >= ring {
                see(u - ring);
            }
            if u + ring < self.columns {
                see(u + ring);
            }
        }
    }
}

/// Numbers the connected voids of a surface from 1, in the order of their first cells; 0 where
/// there is a height. Cells are connected to their four neighbours. Returns the number of voids
/// too.
pub(super) fn number_voids(height_m: &Grid<f32>) -> (Grid<u32>, u32) {
    let (w, h) = (height_m.width(), height_m.height());
    let mut out = Grid::filled(w, h, 0u32);
    let (mut open, mut count) = (Vec::new(), 0);
    for seed in 0..w * h {
        if out.data()[seed] != 0 || !height_m.data()[seed].is_nan() {
            continue;
        }
        count += 1;
        out.data_mut()[seed] = count;
        open.push(seed);
        while let Some(p) = open.pop() {
            let (x, y) = (p % w, p / w);
            let sides = [(x > 0, -1), (x + 1 < w, 1), (y > 0, -(w as isize)), (y + 1 < h, w as isize)];
            for q in sides.into_iter().filter(|s| s.0).map(|s| p.wrapping_add_signed(s.1)) {
                if out.data()[q] == 0 && height_m.data()[q].is_nan() {
                    out.data_mut()[q] = count;
                    open.push(q);
                }
            }
        }
    }
    (out, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_cells_of_a_border_fill_a_circle() {
        let mut height_m = Grid::filled(80, 80, 1.0f32);
        (20..60).for_each(|y| (20..60).for_each(|x| height_m[(x, y)] = f32::NAN));
        height_m[(70, 70)] = f32::NAN;
        let (voids, count) = number_voids(&height_m);
        assert_eq!((count, voids[(30, 30)], voids[(70, 70)], voids[(0, 0)]), (2, 1, 2, 0));
        let border = Border::new(&height_m, &voids);
        let wanted = Wanted { void: Some(1), height_max_m: 2.0, count: 20, reach: 30.0 };
        let found = border.nearest([25.0, 25.0], wanted);
        let radius = found.iter().map(|k| k.apart).fold(0.0, f32::max);
        let is_near = |c: &&BorderCell| c.void == 1 && (c.x - 25.0).hypot(c.y - 25.0) <= radius;
        let all = border.cells().iter().filter(is_near).count();
        assert!(found.len() == all && all >= 20 && radius <= 30.0, "{} {all} {radius}", found.len());
        // The other void's border, and nothing that is too high.
        assert_eq!(border.nearest([25.0, 25.0], Wanted { void: Some(2), reach: 90.0, ..wanted }).len(), 24);
        assert!(border.nearest([25.0, 25.0], Wanted { height_max_m: 0.5, ..wanted }).is_empty());
    }

    #[test]
    fn a_cell_beside_two_voids_is_found_once() {
        let mut height_m = Grid::filled(20, 20, 1.0f32);
        (height_m[(9, 10)], height_m[(11, 10)]) = (f32::NAN, f32::NAN);
        let (voids, _) = number_voids(&height_m);
        let border = Border::new(&height_m, &voids);
        let wanted = Wanted { void: None, height_max_m: 2.0, count: 99, reach: 1.0 };
        assert_eq!(border.nearest([10.0, 10.0], wanted).len(), 3);
    }
}
