//! Finds the walls among the cells of a raster.
//!
//! A single cell centre only shows whether it is above or below a wall. The pattern of the centres
//! shows more: along a straight wall that is not parallel to the grid, the steps of the pattern
//! give its place to a tenth of a cell. So wherever four neighbouring cells differ by a step, the
//! cells around are parted at the middle of the four heights' widest gap by the line of the widest
//! margin ([`pattern`]). Where no line parts them, lines found nearby are tried in pairs (a
//! building's corner, from inside or outside), as one side of a strip (a parapet thinner than the
//! cells), and a circle (a crown); the form that is wrong about the fewest centres is taken. Four
//! cells of which one side differs by another step are parted twice: ground, roof and the parapet
//! between them.
//!
//! On simulated towns with parapets of 0.4 m and trees (three seeds, cells of 0.5 m, true heights),
//! hidden cells are told with 97 % precision and 96 to 97 % recall under 16.5°, and 93 % of both
//! under 6°, where a wall hides two cells and a parapet a fifth of one; on cells of 0.25 m, 97 % of
//! both. A surface that is bilinear throughout has a recall of 82, 62 and 73 %.
//!
//! Every centre keeps its own side. On either side the surface is bilinear, and continued in a
//! straight line beyond the side's own cells: a roof goes on falling to its eaves.

mod curve;
mod outline;
mod pattern;
mod sample;

use raster::Grid;
use rayon::prelude::*;

use curve::Curve;
use outline::Outline;

/// Lines are taken from up to so many cells away, at most [`LINES`] of them.
const NEAR: isize = 4;
const LINES: usize = 8;
/// Where a form and the four centres disagree, each centre is this far on its own side, cells.
const MARGIN: f32 = 0.02;
/// A surface is continued beyond a wall where its own next cells differ by less than so many steps.
const CONTINUED: f32 = 2.5;
/// No wall.
const NONE: u32 = u32::MAX;

/// The walls of a raster.
#[derive(Debug, Clone)]
pub(super) struct Walls {
    /// For each cell the first wall among it, its right, its lower and its lower right neighbour.
    first: Grid<u32>,
    walls: Vec<Wall>,
    step_m: f32,
}

/// What parts four cells.
#[derive(Debug, Clone, Copy)]
struct Wall {
    outline: Outline,
    /// Cells above this height are on the upper side.
    level: f32,
    /// What parts the lower side and the upper once more.
    within: [u32; 2],
}

/// A wall as it is found.
#[derive(Debug, Clone, Copy)]
struct Found {
    column: usize,
    wall: Wall,
    loss: f32,
}

impl Walls {
    /// Finds the walls of cells (NaN where there is no height): where neighbours differ by more
    /// than `step_m`.
    pub(super) fn find(cells: &Grid<f32>, step_m: f32) -> Self {
        let (width, height) = (cells.width(), cells.height());
        let mut walls = Self { first: Grid::filled(width, height, NONE), walls: Vec::new(), step_m };
        if width < 2 || height < 2 {
            return walls;
        }
        let straight =
            |row: usize| (0..width - 1).filter_map(move |column| Found::straight(cells, (column, row), step_m));
        let mut rows: Vec<Vec<Found>> = (0..height - 1).into_par_iter().map(|row| straight(row).collect()).collect();
        let lines = Lines::new(&rows, width, height);
        rows.par_iter_mut().enumerate().for_each(|(row, found)| {
            found.iter_mut().filter(|f| f.loss > 0.0).for_each(|f| f.improve(cells, row, &lines, None));
        });
        let seconds: Vec<Vec<(usize, usize, Wall)>> =
            rows.par_iter().enumerate().map(|(row, found)| seconds(cells, row, found, &lines, step_m)).collect();
        for (row, (found, seconds)) in rows.iter().zip(seconds).enumerate() {
            let start = walls.walls.len();
            for f in found {
                walls.first[(f.column, row)] = walls.walls.len() as u32;
                walls.walls.push(f.wall);
            }
            for (of, side, wall) in seconds {
                let next = walls.walls.len() as u32;
                walls.walls[start + of].within[side] = next;
                walls.walls.push(wall);
            }
        }
        walls
    }

    /// Difference of neighbours beyond which they form a wall, metres.
    pub(super) fn step_m(&self) -> f32 {
        self.step_m
    }

    /// The height at a place `[u, v]` (0 to 1 along columns and rows) among four cells, of which
    /// the first is at `corner` and which all have heights: upper left, upper right, lower left,
    /// lower right. `None` where no wall is among them.
    #[inline]
    pub(super) fn height(
        &self,
        cells: &Grid<f32>,
        corner: (usize, usize),
        heights: [f32; 4],
        place: [f32; 2],
    ) -> Option<f32> {
        let first = self.walls.get(self.first[corner] as usize)?;
        let own = self.own_of(Some(first), heights, [true; 4], place);
        let continued = self.continued(cells, corner, heights, own, false);
        Some(continued.iter().zip(weights(place)).map(|(z, w)| z * w).sum())
    }

    /// Returns what parts four cells of which the first is at `corner`: the first wall, and the
    /// walls within its sides.
    pub(super) fn parting<'a>(&'a self, cells: &'a Grid<f32>, corner: (usize, usize)) -> Vec<Parting<'a>> {
        let Some(first) = self.walls.get(self.first[corner] as usize) else { return Vec::new() };
        let heights = four(cells, corner);
        let one = |wall, own, outer| Parting { walls: self, cells, corner, heights, wall, own, outer };
        let mut all = vec![one(first, [true; 4], None)];
        for upper in [false, true] {
            if let Some(second) = self.walls.get(first.within[usize::from(upper)] as usize) {
                all.push(one(second, first.own_on(heights, [true; 4], upper), Some((first, upper))));
            }
        }
        all
    }

    /// Which of the four centres are on the side of a place: those of their `own` that `next` and
    /// the walls within its sides do not part from it.
    fn own_of<'a>(
        &'a self,
        mut next: Option<&'a Wall>,
        heights: [f32; 4],
        mut own: [bool; 4],
        place: [f32; 2],
    ) -> [bool; 4] {
        let weights = weights(place);
        while let Some(wall) = next {
            let upper = wall.side_at(&heights, &own, &weights, place) >= 0.0;
            own = wall.own_on(heights, own, upper);
            next = self.walls.get(wall.within[usize::from(upper)] as usize);
        }
        own
    }

    /// The heights of four cells if all were on the side of their `own`. `steadily`: beyond a
    /// centre the smaller of the last two rises counts, none where they differ in sign.
    fn continued(
        &self,
        cells: &Grid<f32>,
        corner: (usize, usize),
        heights: [f32; 4],
        own: [bool; 4],
        steadily: bool,
    ) -> [f32; 4] {
        let limit = CONTINUED * self.step_m;
        // From one of the four to the next along columns or rows.
        let beyond = |k: usize, along: usize| {
            let (column, row) = (corner.0 + k % 2, corner.1 + k / 2);
            let back = |at: usize, towards: usize, by: usize, size: usize| match towards {
                0 => Some(at + by).filter(|&i| i < size),
                _ => at.checked_sub(by),
            };
            let before = |by: usize| {
                if along == 0 {
                    back(column, 1 - k % 2, by, cells.width()).map(|column| cells[(column, row)])
                } else {
                    back(row, 1 - k / 2, by, cells.height()).map(|row| cells[(column, row)])
                }
            };
            let Some(first) = before(1) else { return 0.0 };
            let rise = heights[k] - first;
            let rise = match before(2).filter(|_| steadily).map(|second| first - second) {
                Some(earlier) if earlier.abs() < rise.abs() => earlier,
                _ => rise,
            };
            let is_steady = !steadily || rise * (heights[k] - first) > 0.0;
            if rise.abs() <= limit && is_steady { rise } else { 0.0 }
        };
        std::array::from_fn(|k| {
            let (beside, over, across) = (k ^ 1, k ^ 2, k ^ 3);
            let (by_column, by_row) = (heights[beside] + beyond(beside, 0), heights[over] + beyond(over, 1));
            match (own[k], own[beside], own[over], own[across]) {
                (true, ..) => heights[k],
                (_, true, true, _) => by_column + (by_row - by_column) / 2.0,
                (_, true, false, _) => by_column,
                (_, false, true, _) => by_row,
                (_, false, false, true) => heights[across] + beyond(across, 0) + beyond(across, 1),
                _ => heights[k],
            }
        })
    }
}

/// A wall among four cells, with the cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parting<'a> {
    walls: &'a Walls,
    cells: &'a Grid<f32>,
    corner: (usize, usize),
    heights: [f32; 4],
    wall: &'a Wall,
    own: [bool; 4],
    /// The wall whose side (upper or not) it parts.
    outer: Option<(&'a Wall, bool)>,
}

impl Parting<'_> {
    /// Signed distance of a place (0 to 1 along columns and rows), cells, positive on the upper
    /// side.
    pub(super) fn side_at(&self, place: [f32; 2]) -> f32 {
        self.wall.side_at(&self.heights, &self.own, &weights(place), place)
    }

    /// Whether a place is on the side of another wall that this one parts.
    pub(super) fn reaches(&self, place: [f32; 2]) -> bool {
        self.outer.is_none_or(|(wall, upper)| {
            (wall.side_at(&self.heights, &[true; 4], &weights(place), place) >= 0.0) == upper
        })
    }

    /// The heights of both sides at a place on the wall: lower, upper. A side is continued to the
    /// wall only where it goes on as it came over two cells: a parapet does not rise further.
    pub(super) fn heights_at(&self, place: [f32; 2]) -> [f32; 2] {
        [false, true].map(|upper| {
            let own = self.wall.own_on(self.heights, self.own, upper);
            let next = self.walls.walls.get(self.wall.within[usize::from(upper)] as usize);
            let own = self.walls.own_of(next, self.heights, own, place);
            let continued = self.walls.continued(self.cells, self.corner, self.heights, own, true);
            continued.iter().zip(weights(place)).map(|(z, w)| z * w).sum()
        })
    }
}

impl Wall {
    /// Those of the `own` centres that are on one side.
    fn own_on(&self, heights: [f32; 4], own: [bool; 4], upper: bool) -> [bool; 4] {
        std::array::from_fn(|k| own[k] && (heights[k] > self.level) == upper)
    }

    /// Signed distance of a place, cells, positive on the upper side; of the centres only their
    /// `own` have a say.
    fn side_at(&self, heights: &[f32; 4], own: &[bool; 4], weights: &[f32; 4], place: [f32; 2]) -> f32 {
        let (mut agrees, mut kept) = (true, 0.0);
        for k in 0..4 {
            let upper = heights[k] > self.level;
            let at = self.outline.at([(k % 2) as f32 - 0.5, (k / 2) as f32 - 0.5]);
            agrees &= !own[k] || (at > 0.0) == upper;
            kept += weights[k] * if upper { at.max(MARGIN) } else { at.min(-MARGIN) };
        }
        if agrees { self.outline.at([place[0] - 0.5, place[1] - 0.5]) } else { kept }
    }
}

impl Found {
    /// The line that parts four cells; `None` where they differ by no step.
    fn straight(cells: &Grid<f32>, corner: (usize, usize), step_m: f32) -> Option<Self> {
        let [a, b, c, d] = four(cells, corner);
        let steepest = (a - b).abs().max((c - d).abs()).max((a - c).abs()).max((b - d).abs());
        if (a + b + c + d).is_nan() || steepest <= step_m {
            return None;
        }
        Self::at_level(cells, corner, widest_gap([a, b, c, d]))
    }

    fn at_level(cells: &Grid<f32>, corner: (usize, usize), level: f32) -> Option<Self> {
        let samples = pattern::samples(cells, corner, level);
        let outline = Outline::Edge(pattern::part(&samples, false)?);
        let wall = Wall { outline, level, within: [NONE; 2] };
        Some(Self { column: corner.0, wall, loss: outline.loss(&samples, f32::INFINITY) })
    }

    /// Takes another form where that is wrong about fewer centres.
    fn improve(&mut self, cells: &Grid<f32>, row: usize, lines: &Lines, outer: Option<Curve>) {
        let samples = pattern::samples(cells, (self.column, row), self.wall.level);
        let mut offer = |outline: Outline| {
            let loss = outline.loss(&samples, self.loss);
            if loss < self.loss {
                (self.wall.outline, self.loss) = (outline, loss);
            }
        };
        let near = lines.near(self.column, row, outer);
        near.iter().filter_map(|line| Outline::strip(*line, &samples)).for_each(&mut offer);
        for (i, &one) in near.iter().enumerate() {
            for &other in &near[..i] {
                offer(Outline::Within(one, other));
                offer(Outline::Around(one, other));
            }
            offer(Outline::Edge(one));
        }
        if let Some(circle) = pattern::part(&samples, true) {
            offer(Outline::Edge(circle));
        }
    }
}

/// The walls within one side of the walls of a row: (which of them, which side, what parts it).
fn seconds(cells: &Grid<f32>, row: usize, found: &[Found], lines: &Lines, step_m: f32) -> Vec<(usize, usize, Wall)> {
    let mut all = Vec::new();
    for (k, first) in found.iter().enumerate() {
        let heights = four(cells, (first.column, row));
        for side in 0..2 {
            let own = heights.map(|z| if (z > first.wall.level) == (side == 1) { z } else { f32::NAN });
            let (low, high) = own.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &z| (l.min(z), h.max(z)));
            if high - low <= step_m {
                continue;
            }
            if let Some(mut second) = Found::at_level(cells, (first.column, row), widest_gap(own)) {
                if second.loss > 0.0 {
                    let outer = match first.wall.outline {
                        Outline::Edge(curve) => Some(curve),
                        _ => None,
                    };
                    second.improve(cells, row, lines, outer);
                }
                all.push((k, side, second.wall));
            }
        }
    }
    all
}

/// Lines that part the cells around them without a mistake, by place.
struct Lines {
    index: Grid<u32>,
    lines: Vec<Curve>,
    /// (columns, rows) to go, nearest first.
    ways: Vec<[isize; 2]>,
}

impl Lines {
    fn new(rows: &[Vec<Found>], width: usize, height: usize) -> Self {
        let (mut index, mut lines) = (Grid::filled(width, height, NONE), Vec::new());
        for (row, found) in rows.iter().enumerate() {
            for f in found.iter().filter(|f| f.loss <= 0.0) {
                if let Outline::Edge(line) = f.wall.outline {
                    index[(f.column, row)] = lines.len() as u32;
                    lines.push(line);
                }
            }
        }
        let mut ways: Vec<[isize; 2]> = (-NEAR..=NEAR).flat_map(|j| (-NEAR..=NEAR).map(move |i| [i, j])).collect();
        ways.sort_by_key(|[i, j]| i * i + j * j);
        Self { index, lines, ways }
    }

    /// Different lines around four cells, as they are seen from there.
    fn near(&self, column: usize, row: usize, outer: Option<Curve>) -> Vec<Curve> {
        let mut found: Vec<Curve> = outer.into_iter().collect();
        for &[i, j] in &self.ways {
            let (Some(c), Some(r)) = (column.checked_add_signed(i), row.checked_add_signed(j)) else { continue };
            if c >= self.index.width() || r >= self.index.height() {
                continue;
            }
            let Some(line) = self.lines.get(self.index[(c, r)] as usize) else { continue };
            let line = line.line_from([-i as f32, -j as f32]);
            if !found.iter().any(|known| known.is_like(&line)) {
                found.push(line);
            }
            if found.len() == LINES {
                break;
            }
        }
        found
    }
}

fn four(cells: &Grid<f32>, (column, row): (usize, usize)) -> [f32; 4] {
    let (top, low) = (cells.row(row), cells.row(row + 1));
    [top[column], top[column + 1], low[column], low[column + 1]]
}

/// The middle of the widest gap between heights; those that are none do not count.
fn widest_gap(mut heights: [f32; 4]) -> f32 {
    heights.sort_by(f32::total_cmp);
    let gaps = heights.windows(2).map(|pair| (pair[1] - pair[0], pair[0])).filter(|(gap, _)| !gap.is_nan());
    let (gap, below) =
        gaps.fold((f32::NEG_INFINITY, heights[0]), |best, next| if next.0 > best.0 { next } else { best });
    below + gap / 2.0
}

fn weights([u, v]: [f32; 2]) -> [f32; 4] {
    [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: usize = 24;

    /// Cells at the height that a place has.
    fn cells(height: impl Fn(f32, f32) -> f32) -> Grid<f32> {
        let at = |i: usize| height((i % SIZE) as f32, (i / SIZE) as f32);
        Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(at).collect()).unwrap()
    }

    fn at(walls: &Walls, cells: &Grid<f32>, column: f32, row: f32) -> f32 {
        let (c, r) = (column as usize, row as usize);
        let heights = four(cells, (c, r));
        walls.height(cells, (c, r), heights, [column - c as f32, row - r as f32]).unwrap_or(heights[0])
    }

    /// Share of places around the middle whose height is another one by more than half a metre, in
    /// cells per cell of `length`.
    fn strip_wrong(height: impl Fn(f32, f32) -> f32, length: f32) -> f32 {
        let cells = cells(&height);
        let walls = Walls::find(&cells, 0.8);
        let wrong = (0..160 * 160).filter(|k| {
            let [c, r] = [k % 160, k / 160].map(|i| 4.0 + (i as f32 + 0.5) / 10.0);
            (at(&walls, &cells, c, r) - height(c, r)).abs() > 0.5
        });
        wrong.count() as f32 / 100.0 / length
    }

    proptest! {
        /// Whatever stands there, centres keep their heights, and nothing is far above or below
        /// all.
        #[test]
        fn centres_keep_their_heights(values in prop::collection::vec(0..6u8, SIZE * SIZE), u in 0.0..1.0f32, v in 0.0..1.0f32) {
            let cells = cells(|c, r| f32::from(values[r as usize * SIZE + c as usize]) * 0.9);
            let walls = Walls::find(&cells, 0.8);
            for r in 1..SIZE - 2 {
                for c in 1..SIZE - 2 {
                    prop_assert_eq!(at(&walls, &cells, c as f32, r as f32), cells[(c, r)]);
                    let between = at(&walls, &cells, c as f32 + u, r as f32 + v);
                    prop_assert!((-8.0..13.0).contains(&between), "{}", between);
                }
            }
        }
    }

    #[test]
    fn straight_walls_are_found_between_the_cells() {
        let wrong = |k: u8| {
            let (sin, cos) = (f32::from(k) * 2.3).to_radians().sin_cos();
            let d = f32::from(k % 7) / 7.0 - 0.5;
            strip_wrong(|c, r| if cos * (c - 12.0) + sin * (r - 12.0) > d { 10.0 } else { 0.0 }, 16.0)
        };
        let wrong: Vec<f32> = (0..80).map(wrong).collect();
        // Half a cell along the grid, where the pattern has no steps and says nothing but the cell.
        assert!(wrong.iter().all(|w| *w < 0.6), "{wrong:?}");
        let mean = wrong.iter().sum::<f32>() / 80.0;
        // The middle between the centres would be wrong by a quarter of a cell.
        assert!(mean < 0.12, "{mean} cells");
    }

    /// Turned by 17°, (along, across) from the middle.
    fn turned(c: f32, r: f32) -> (f32, f32) {
        let (sin, cos) = 17.0_f32.to_radians().sin_cos();
        (cos * (c - 11.6) + sin * (r - 11.7), cos * (r - 11.7) - sin * (c - 11.6))
    }

    #[test]
    fn a_corner_is_no_rounder_than_it_stands() {
        let corner = |c, r| if turned(c, r).0 < 0.0 && turned(c, r).1 < 0.0 { 10.0 } else { 0.0 };
        let hollow = |c, r| if turned(c, r).0 < 0.0 || turned(c, r).1 < 0.0 { 10.0 } else { 0.0 };
        for wrong in [strip_wrong(corner, 16.0), strip_wrong(hollow, 16.0)] {
            assert!(wrong < 0.12, "{wrong} cells");
        }
    }

    #[test]
    fn a_parapet_thinner_than_the_cells_runs_on() {
        let roof = |c, r| match turned(c, r).1 {
            across if across > 0.0 => 0.0,
            across if across > -0.8 => 10.9,
            _ => 10.0,
        };
        let cells = cells(roof);
        let walls = Walls::find(&cells, 0.8);
        // Along its middle line, where every sixth column has no cell of it.
        let (sin, cos) = 17.0_f32.to_radians().sin_cos();
        let found = (0..140).map(|k| {
            let along = k as f32 / 10.0 - 7.0;
            at(&walls, &cells, 11.6 + cos * along + sin * 0.4, 11.7 + sin * along - cos * 0.4)
        });
        assert!(found.filter(|z| *z > 10.8).count() > 130);
        assert!(strip_wrong(roof, 16.0) < 0.2);
    }

    #[test]
    fn a_roof_goes_on_falling_to_its_eaves() {
        // A slope of half a metre per cell up to a wall at column 11.5.
        let cells = cells(|c, _| if c < 11.5 { 10.0 - 0.5 * c } else { 0.0 });
        let walls = Walls::find(&cells, 0.8);
        assert!((at(&walls, &cells, 11.4, 9.3) - 4.3).abs() < 1e-4);
        assert_eq!(at(&walls, &cells, 11.6, 9.3), 0.0);
    }
}
