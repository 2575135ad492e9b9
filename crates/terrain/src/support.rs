//! Ground that the heights of a surface support.
//!
//! In a dense quarter of images hardly any street has a height, and the search for objects takes
//! houses for ground, as nothing lower lies within its windows. The few heights of streets still
//! tell the ground: they lie at one smooth surface with hardly anything beneath it. Roofs differ in
//! height, and so do the wrong heights between roofs and streets, so that some lie below any
//! surface through them.
//!
//! The ground is therefore searched for like the heights of images: each level of a volume over
//! coarse nodes has a score, and paths over the nodes make its changes small, as in semi-global
//! matching (Hirschmüller 2008, <https://doi.org/10.1109/TPAMI.2007.1166>).

use raster::{Grid, gaussian};

use crate::coarse::{difference, spread, weighted_blocks};
use crate::ground::{BareGround, UNKNOWN, shown_or_below};
use crate::membrane::filled;
use crate::trend::fitted;

/// Distance of nodes, metres: streets and the houses beside them fall into one or two.
const NODE_M: f64 = 10.0;
/// Distance of two levels, metres, in surfaces of finer cells: half of what heights may be off and
/// still be right. Otherwise it is a cell, because errors of heights grow with it.
const LEVEL_M: f64 = 0.5;
/// Heights within this many levels of a ground support it, and those further below contradict it.
const LEVELS_AT: usize = 2;
/// Standard deviation over which a given ground is smoothed, metres. It takes away the bumps that
/// blocks of houses make, and leaves hills.
const BUMP_M: f64 = 40.0;
/// Greatest depth below a given ground, metres: that of streets under roofs of high-rise quarters.
const DEPTH_MAX_M: f64 = 80.0;
/// Greatest height above a given smoothed ground, metres: that of a hilltop.
const RISE_MAX_M: f64 = 10.0;
/// One height in this many may lie deeper than the deepest level.
const DEEPER: usize = 1000;
/// Heights below a ground count this often against one at it. In dense quarters heights at the
/// ground were ten times as many as below it, and at levels of roofs about as many.
const DOUBT: f32 = 3.0;
/// The same where only the nearest level is sought: errors of heights on both sides then count
/// alike.
const DOUBT_NEAR: f32 = 1.0;
/// Half of the levels among which the nearest one is sought.
const LEVELS_NEAR: usize = 3;
/// Share of the known heights that gives half of the full score: a few of them may lie at a level
/// by chance.
const CHANCE_SHARE: f32 = 0.02;
/// Cost of a change by one metre between neighbouring nodes, in scores. To follow a block of houses
/// 10 m up and down costs six, as much as they could gain on a width of some 70 m.
const COST_PER_M: f64 = 0.3;
/// Standard deviation over which the support of two grounds is compared, metres: a few houses.
const COMPARED_M: f64 = 20.0;
/// Least gain in score with which another ground takes the place of the given one.
const GAIN_MIN: f32 = 0.1;
/// Least share of heights at such a ground: a third of what the streets of dense quarters had.
const SHARE_MIN: f32 = 0.03;

/// Returns the ground under a surface with cells of `cell_m` metres: where clearly more heights
/// support a lower one than the given `ground`, the lower one, elsewhere what is given by
/// `otherwise`, which may be the same ground.
///
/// All are in metres. Voids of the surface, and places without ground, are NaN. All heights of the
/// surface count, so that weak ones should be left in it.
///
/// ```
/// use raster::Grid;
/// use terrain::supported_ground;
///
/// // Roofs of 6 to 20 m. In every third square a third of the street around the roof is known.
/// let height = |column: usize, row: usize| match (column / 15, row / 15) {
///     (x, y) if column % 15 < 9 && row % 15 < 9 => 6.0 + ((7 * x + 5 * y) % 15) as f32,
///     (x, y) if (x + y) % 3 == 0 && (column + row) % 3 == 0 => 0.0,
///     _ => f32::NAN,
/// };
/// let heights = (0..240 * 240).map(|i| height(i % 240, i / 240)).collect();
/// let surface = Grid::from_vec(240, 240, heights).unwrap();
/// let ground = surface.map(|_| 8.0);
/// let found = supported_ground(&surface, &ground, &ground, 1.0);
/// assert!(found.data().iter().all(|ground_m| ground_m.abs() < 1.0));
/// ```
#[must_use]
pub fn supported_ground(surface: &Grid<f32>, ground: &Grid<f32>, otherwise: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    let nodes = Nodes::new(surface, cell_m);
    let given = filled(&weighted_blocks(ground, nodes.side, |_| 1.0).0);
    if given.data().iter().any(|ground_m| ground_m.is_nan()) {
        return otherwise.clone();
    }
    let even = without_bumps(&given, (BUMP_M / nodes.side_m) as f32);
    let found = nodes.searched(&even, &nodes.levels(&even), DOUBT);
    let near = Levels { low_m: -(LEVELS_NEAR as f64) * nodes.level_m, count: 2 * LEVELS_NEAR + 1 };
    let found = nodes.searched(&found, &near, DOUBT_NEAR);
    let found_at_cells = nodes.at_cells(&found);
    let [old, new] = [ground, &found_at_cells].map(|ground| nodes.support(ground));
    let gain = new.zip_map(&old, |new, old| new - old);
    let lower = given.zip_map(&found, |given_m, found_m| given_m - found_m);
    let is_better = gain.zip_map(&lower, |gain, lower_m| if *gain > GAIN_MIN && *lower_m > 0.0 { 1.0 } else { 0.0 });
    let share = nodes.at_cells(&gaussian(&is_better, 1.0));
    let mut out = otherwise.clone();
    for (at, ground_m) in out.data_mut().iter_mut().enumerate() {
        *ground_m += share.data()[at].clamp(0.0, 1.0) * (found_at_cells.data()[at] - *ground_m);
    }
    out
}

/// Returns the ground that was `found` under a surface with cells of `cell_m` metres, or a lower
/// one where clearly more heights support it, as [`supported_ground`] does. Cells of the surface
/// that lie at the lower ground show it. Heights are in metres, voids of the surface are NaN.
#[must_use]
pub fn with_supported_ground(found: BareGround, surface: &Grid<f32>, cell_m: f64) -> BareGround {
    let BareGround { mut heights, mut states } = found;
    let supported = supported_ground(surface, &heights, &heights, cell_m);
    for (at, new_m) in supported.data().iter().enumerate() {
        let (old_m, state, own_m) = (&mut heights.data_mut()[at], &mut states.data_mut()[at], surface.data()[at]);
        if *state != UNKNOWN && *new_m != *old_m {
            (*old_m, *state) = shown_or_below(own_m, *new_m, true);
        }
    }
    BareGround { heights, states }
}

/// Levels of a search, relative to a guess.
struct Levels {
    low_m: f64,
    count: usize,
}

/// A surface, and the coarse nodes over it.
struct Nodes<'a> {
    surface: &'a Grid<f32>,
    /// Distance of nodes, cells of the surface and metres.
    side: usize,
    side_m: f64,
    /// Distance of levels, metres.
    level_m: f64,
    size: (usize, usize),
}

impl<'a> Nodes<'a> {
    fn new(surface: &'a Grid<f32>, cell_m: f64) -> Self {
        let side = ((NODE_M / cell_m).round() as usize).max(1);
        let size = (surface.width().div_ceil(side), surface.height().div_ceil(side));
        Self { surface, side, side_m: cell_m * side as f64, level_m: LEVEL_M.max(cell_m), size }
    }

    /// Interpolates a raster of nodes at the cells of the surface.
    fn at_cells(&self, coarse: &Grid<f32>) -> Grid<f32> {
        spread(coarse, self.side, (self.surface.width(), self.surface.height()))
    }

    /// Returns the known cells with their nodes and heights above a ground at the cells.
    fn known(&self, ground: &Grid<f32>) -> impl Iterator<Item = (usize, f32)> {
        let width = self.surface.width();
        let cells =
            self.surface.data().iter().zip(ground.data()).enumerate().map(move |(cell, (height_m, ground_m))| {
                (cell / width / self.side * self.size.0 + cell % width / self.side, height_m - ground_m)
            });
        cells.filter(|(_, above_m)| !above_m.is_nan())
    }

    /// Returns levels from the deepest heights up to a hilltop above a guess.
    fn levels(&self, guess: &Grid<f32>) -> Levels {
        let mut above: Vec<f32> = self.known(&self.at_cells(guess)).map(|(_, above_m)| above_m).collect();
        let rank = above.len() / DEEPER;
        let deepest = numeric::order_statistic(&mut above, rank).unwrap_or(0.0);
        let low_m = f64::from(deepest).clamp(-DEPTH_MAX_M, 0.0) - self.level_m;
        Levels { low_m, count: ((RISE_MAX_M - low_m) / self.level_m).ceil() as usize }
    }

    /// Returns the smooth ground with the best scores near a guess.
    fn searched(&self, guess: &Grid<f32>, levels: &Levels, doubt: f32) -> Grid<f32> {
        let costs = self.costs(guess, levels, doubt);
        let change = (COST_PER_M * self.level_m) as f32;
        let total = aggregated(&costs, self.size, levels.count, change);
        let best = total.chunks_exact(levels.count).map(|costs| (levels.low_m + self.level_m * least(costs)) as f32);
        let mut above = Grid::filled(self.size.0, self.size.1, 0.0);
        above.data_mut().iter_mut().zip(best).for_each(|(above_m, best_m)| *above_m = best_m);
        guess.zip_map(&gaussian(&above, 1.0), |guess_m, above_m| guess_m + above_m)
    }

    /// Returns the costs of all levels, node by node.
    fn costs(&self, guess: &Grid<f32>, levels: &Levels, doubt: f32) -> Vec<f32> {
        // The first layer is for what lies below all levels, the last one for what lies above.
        let mut layers = vec![Grid::filled(self.size.0, self.size.1, 0.0); levels.count + 2];
        let (low_m, level_m) = (levels.low_m as f32, self.level_m as f32);
        for (node, above_m) in self.known(&self.at_cells(guess)) {
            let layer = ((above_m - low_m) / level_m + 1.5).floor().clamp(0.0, (levels.count + 1) as f32);
            layers[layer as usize].data_mut()[node] += 1.0;
        }
        let layers: Vec<Grid<f32>> = layers.iter().map(|layer| gaussian(layer, 1.0)).collect();
        let mut costs = vec![0.0; self.size.0 * self.size.1 * levels.count];
        for (node, costs) in costs.chunks_exact_mut(levels.count).enumerate() {
            let share = |layer: usize| layers[layer].data()[node];
            let known: f32 = (0..layers.len()).map(share).sum();
            let mut below = 0.0;
            for (level, cost) in costs.iter_mut().enumerate() {
                let own = level + 1;
                below += own.checked_sub(LEVELS_AT + 1).map_or(0.0, share);
                let beside = |layer: usize| if (1..=levels.count).contains(&layer) { 0.5 * share(layer) } else { 0.0 };
                *cost = -score(share(own) + beside(own - 1) + beside(own + 1), below, known, doubt);
            }
        }
        costs
    }

    /// Returns how well the heights around each node support a ground, 0 to 1; 0 where hardly any
    /// height lies at it.
    fn support(&self, ground: &Grid<f32>) -> Grid<f32> {
        let [mut at, mut below, mut all] = [(); 3].map(|()| Grid::filled(self.size.0, self.size.1, 0.0));
        let reach_m = (LEVELS_AT as f64 * self.level_m) as f32;
        for (node, above_m) in self.known(ground) {
            at.data_mut()[node] += if above_m.abs() < reach_m { 1.0 } else { 0.0 };
            below.data_mut()[node] += if above_m < -reach_m { 1.0 } else { 0.0 };
            all.data_mut()[node] += 1.0;
        }
        let [mut at, below, all] = [at, below, all].map(|of| gaussian(&of, (COMPARED_M / self.side_m) as f32));
        for ((at, below), all) in at.data_mut().iter_mut().zip(below.data()).zip(all.data()) {
            *at = if *at > SHARE_MIN * all { score(*at, *below, *all, DOUBT) } else { 0.0 };
        }
        at
    }
}

/// Returns the score of a level: 1 if all heights lie at it, 0 if none does.
fn score(at: f32, below: f32, known: f32, doubt: f32) -> f32 {
    if at > 0.0 { at / (at + doubt * below + CHANCE_SHARE * known) } else { 0.0 }
}

/// Smooths a ground off the plane through it, so that it does not bend at the borders.
fn without_bumps(ground: &Grid<f32>, sigma: f32) -> Grid<f32> {
    let width = ground.width();
    let place = |at: usize| [(at % width) as f64, (at / width) as f64];
    let points = ground.data().iter().enumerate().map(|(at, ground_m)| {
        let [x, y] = place(at);
        ([x, y, f64::from(*ground_m)], 1.0)
    });
    let [base, along, across] = fitted(points, 0.0);
    let mut plane = ground.clone();
    for (at, plane_m) in plane.data_mut().iter_mut().enumerate() {
        let [x, y] = place(at);
        *plane_m = (base + along * x + across * y) as f32;
    }
    gaussian(&difference(ground, &plane), sigma).zip_map(&plane, |off_m, plane_m| off_m + plane_m)
}

/// Sums the costs along eight paths over the nodes, on which each level of change costs `change`.
fn aggregated(costs: &[f32], (columns, rows): (usize, usize), levels: usize, change: f32) -> Vec<f32> {
    const PATHS: [(isize, isize); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (-1, 1), (1, -1)];
    let nodes = columns * rows;
    let (mut total, mut path) = (vec![0.0; costs.len()], vec![0.0; costs.len()]);
    let mut before = vec![0.0; levels];
    for (dx, dy) in PATHS {
        let is_forward = (dy, dx) > (0, 0);
        for step in 0..nodes {
            let node = if is_forward { step } else { nodes - 1 - step };
            let x = (node % columns).checked_add_signed(-dx).filter(|x| *x < columns);
            let y = (node / columns).checked_add_signed(-dy).filter(|y| *y < rows);
            before.fill(0.0);
            if let (Some(x), Some(y)) = (x, y) {
                let from = (y * columns + x) * levels;
                before.copy_from_slice(&path[from..from + levels]);
                with_changes(&mut before, change);
            }
            for (level, before) in before.iter().enumerate() {
                let at = node * levels + level;
                path[at] = costs[at] + before;
                total[at] += path[at];
            }
        }
    }
    total
}

/// Lowers costs to what a change from another level costs, and the least of them to 0.
fn with_changes(costs: &mut [f32], change: f32) {
    for level in 1..costs.len() {
        costs[level] = costs[level].min(costs[level - 1] + change);
    }
    for level in (1..costs.len()).rev() {
        costs[level - 1] = costs[level - 1].min(costs[level] + change);
    }
    let least = costs.iter().copied().fold(f32::INFINITY, f32::min);
    costs.iter_mut().for_each(|cost| *cost -= least);
}

/// Returns the place of the least cost, to a fraction of a level.
fn least(costs: &[f32]) -> f64 {
    let at = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
    let (Some(before), Some(after)) = (at.checked_sub(1).map(|at| costs[at]), costs.get(at + 1)) else {
        return at as f64;
    };
    let bend = before - 2.0 * costs[at] + after;
    at as f64 + if bend > 0.0 { f64::from(0.5 * (before - after) / bend) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use numeric::SplitMix64;

    use super::*;
    use crate::ground::{GROUND, RISE_M, UNDER_OBJECT, VOID_FILLED};

    /// Houses of 8 × 8 m in squares of 14 m, whose roofs stand 6 to 20 m above a hilly slope. Of
    /// the heights between them, one in four is wrong, and a share of `seen` lies at the ground.
    fn quarter(seen: f64) -> (Grid<f32>, Grid<f32>) {
        let hilly = |i: usize| {
            let (x, y) = ((i % 240) as f32, (i / 240) as f32);
            0.15 * x + 3.0 * (x / 40.0).sin() * (y / 50.0).cos()
        };
        let slope = Grid::from_vec(240, 240, (0..240 * 240).map(hilly).collect()).unwrap();
        let mut surface = slope.clone();
        let mut random = SplitMix64::new(7);
        for row in 0..240 {
            for (column, height) in surface.row_mut(row).iter_mut().enumerate() {
                let (x, y) = (column / 14, row / 14);
                let roof_m = 6.0 + ((x * 5 + y * 3) % 8) as f32 * 2.0;
                let chance = random.uniform();
                *height += match column % 14 < 8 && row % 14 < 8 {
                    true => roof_m,
                    false if chance < seen => random.uniform_in(-0.5, 0.5) as f32,
                    false if chance > 0.75 => random.uniform_in(-0.5, 15.0) as f32,
                    false => f32::NAN,
                };
            }
        }
        (slope, surface)
    }

    fn worst(found: &Grid<f32>, wanted: &Grid<f32>) -> f32 {
        found.data().iter().zip(wanted.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn streets_of_which_few_heights_are_known_bring_the_ground_down() {
        let (slope, surface) = quarter(0.1);
        // Some blocks of houses were taken for ground.
        let bump = |i: usize| 9.0 * (-((i % 240) as f32 - 120.0).hypot((i / 240) as f32 - 90.0).powi(2) / 2000.0).exp();
        let mut given = slope.clone();
        given.data_mut().iter_mut().enumerate().for_each(|(i, h)| *h += bump(i));
        let found = supported_ground(&surface, &given, &given, 1.0);
        assert!(worst(&given, &slope) > 8.0 && worst(&found, &slope) < 1.5, "{}", worst(&found, &slope));
        // All of it lies on roofs.
        let high = slope.map(|h| h + 10.0);
        let found = supported_ground(&surface, &high, &high, 1.0);
        assert!(worst(&found, &slope) < 1.5, "{}", worst(&found, &slope));
    }

    #[test]
    fn states_follow_a_lower_ground() {
        let (slope, surface) = quarter(0.1);
        let heights = slope.map(|h| h + 10.0);
        let mut states = heights.map(|_| GROUND);
        states.row_mut(0).fill(UNKNOWN);
        let found = with_supported_ground(BareGround { heights, states }, &surface, 1.0);
        assert!(found.states.row(0).iter().all(|state| *state == UNKNOWN));
        for (at, state) in found.states.data().iter().enumerate().skip(240) {
            let (ground_m, own_m) = (found.heights.data()[at], surface.data()[at]);
            match *state {
                GROUND => assert_eq!(ground_m, own_m),
                UNDER_OBJECT => assert!((own_m - ground_m).abs() > RISE_M),
                state => assert!(state == VOID_FILLED && own_m.is_nan()),
            }
        }
        let streets = slope.zip_map(&surface, |h, own_m| (own_m - h).abs() < 0.5);
        let seen = streets.data().iter().zip(found.states.data()).filter(|(is_street, _)| **is_street);
        let (all, ground) = seen.fold((0, 0), |(all, ground), (_, s)| (all + 1, ground + usize::from(*s == GROUND)));
        assert!(all > 3000 && ground * 5 > all * 4, "{ground} of {all}");
    }

    #[test]
    fn a_ground_that_heights_support_stays() {
        for seen in [0.1, 0.7] {
            let (slope, surface) = quarter(seen);
            assert_eq!(worst(&supported_ground(&surface, &slope, &slope, 1.0), &slope), 0.0);
        }
        let (slope, _) = quarter(0.0);
        assert_eq!(worst(&supported_ground(&slope, &slope, &slope, 1.0), &slope), 0.0);
    }

    #[test]
    fn a_ground_is_not_lifted() {
        let (slope, surface) = quarter(0.1);
        let deep = slope.map(|h| h - 5.0);
        assert_eq!(worst(&supported_ground(&surface, &deep, &deep, 1.0), &deep), 0.0);
    }

    #[test]
    fn few_wrong_heights_below_the_ground_are_none() {
        let (slope, mut surface) = quarter(0.1);
        let cells = surface.data_mut().iter_mut().zip(slope.data()).enumerate();
        let mut random = SplitMix64::new(8);
        // One cell in fifty lies far below.
        for (_, (height, slope_m)) in cells.filter(|(i, _)| i % 50 == 0) {
            *height = slope_m - random.uniform_in(5.0, 25.0) as f32;
        }
        assert_eq!(worst(&supported_ground(&surface, &slope, &slope, 1.0), &slope), 0.0);
    }

    #[test]
    fn without_heights_of_streets_nothing_is_known_better() {
        let (slope, surface) = quarter(0.0);
        let given = slope.map(|h| h + 6.0);
        let known = surface.zip_map(&slope, |h, slope_m| if *h > slope_m + 5.5 { *h } else { f32::NAN });
        let found = supported_ground(&known, &given, &given, 1.0);
        // Not more than a storey from the lowest roofs.
        assert!(worst(&found, &given) < 3.0, "{}", worst(&found, &given));
        let unknown = Grid::filled(40, 30, f32::NAN);
        assert!(supported_ground(&unknown, &unknown, &unknown, 1.0).data().iter().all(|h| h.is_nan()));
        let level = unknown.map(|_| 3.0);
        assert_eq!(worst(&supported_ground(&unknown, &level, &level, 1.0), &level), 0.0);
    }
}
