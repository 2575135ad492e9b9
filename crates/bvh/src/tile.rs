//! The rays of a tile: up to 1024 through one eye, in subtiles of 64, with the nearest triangle that each has met.
//!
//! Inverse depths are kept, because they are linear over a triangle: larger is nearer, 0 is a miss. Each comes with a bound
//! of its error; two that are closer than their errors are compared in f64. In the search for any hit, the inverse depth
//! starts at that of the target and jumps to infinity when something is before it.

use crate::Bvh;
use crate::eye::Eye;
use crate::ray::MISS;
use crate::setup::{Facet, FastFacet, values};
use crate::simd::Lanes;

/// Lanes of a group.
pub(crate) const LANES: usize = 8;
/// Rays of a subtile.
pub(crate) const SUBTILE: usize = 64;
/// Subtiles of a tile.
pub(crate) const SUBTILES: usize = 16;
/// Rays of a tile.
pub(crate) const RAYS: usize = SUBTILE * SUBTILES;

const GROUPS: usize = RAYS / LANES;
const GROUPS_PER_SUBTILE: usize = SUBTILE / LANES;

/// What is asked of the rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Question {
    /// Which triangle is met first.
    Closest,
    /// Whether any is met before the ray's end.
    Any,
}

/// The rays of a tile and what they have met.
#[derive(Debug)]
pub(crate) struct Tile {
    question: Question,
    /// Exact directions.
    pub(crate) exact: [[f64; 2]; RAYS],
    /// Exact inverse depths of the rays' ends, for [`Question::Any`].
    ends: [f64; RAYS],
    x: [[f32; LANES]; GROUPS],
    y: [[f32; LANES]; GROUPS],
    inverse: [[f32; LANES]; GROUPS],
    error: [[f32; LANES]; GROUPS],
    /// Position in the tree's order of the nearest triangle.
    pub(crate) met: [[u32; LANES]; GROUPS],
    /// Bounds of the subtiles.
    low_x: [[f32; LANES]; SUBTILES / LANES],
    high_x: [[f32; LANES]; SUBTILES / LANES],
    low_y: [[f32; LANES]; SUBTILES / LANES],
    high_y: [[f32; LANES]; SUBTILES / LANES],
    /// The farthest of each subtile's rays: what is behind it cannot matter.
    farthest: [[f32; LANES]; SUBTILES / LANES],
    /// Bounds of the whole tile, x then y.
    pub(crate) low: [f32; 2],
    pub(crate) high: [f32; 2],
    /// The farthest of all rays.
    pub(crate) farthest_of_all: f32,
}

impl Tile {
    pub(crate) fn new(question: Question) -> Box<Self> {
        Box::new(Self {
            question,
            exact: [[0.0; 2]; RAYS],
            ends: [0.0; RAYS],
            x: [[0.0; LANES]; GROUPS],
            y: [[0.0; LANES]; GROUPS],
            inverse: [[0.0; LANES]; GROUPS],
            error: [[0.0; LANES]; GROUPS],
            met: [[MISS; LANES]; GROUPS],
            low_x: [[0.0; LANES]; SUBTILES / LANES],
            high_x: [[0.0; LANES]; SUBTILES / LANES],
            low_y: [[0.0; LANES]; SUBTILES / LANES],
            high_y: [[0.0; LANES]; SUBTILES / LANES],
            farthest: [[0.0; LANES]; SUBTILES / LANES],
            low: [0.0; 2],
            high: [0.0; 2],
            farthest_of_all: 0.0,
        })
    }

    /// Lays new rays into the tile: (x, y, depth of the end) by number; `None` and what is not finite is no ray.
    ///
    /// Whether there is any.
    pub(crate) fn load(&mut self, ray: impl Fn(usize) -> Option<[f64; 3]>) -> bool {
        (self.low, self.high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for subtile in 0..SUBTILES {
            self.load_subtile(subtile, &ray);
        }
        self.farthest_of_all = self.farthest.as_flattened().iter().copied().fold(f32::INFINITY, f32::min);
        self.low[0] <= self.high[0]
    }

    fn load_subtile(&mut self, subtile: usize, ray: &impl Fn(usize) -> Option<[f64; 3]>) {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let mut farthest = f32::INFINITY;
        for i in subtile * SUBTILE..(subtile + 1) * SUBTILE {
            let (group, lane) = (i / LANES, i % LANES);
            self.met[group][lane] = MISS;
            self.error[group][lane] = 0.0;
            match ray(i).filter(|[x, y, _]| x.abs() < 1e6 && y.abs() < 1e6) {
                Some([x, y, end]) => {
                    self.exact[i] = [x, y];
                    self.ends[i] = if self.question == Question::Any { 1.0 / end } else { 0.0 };
                    let (x, y) = (x as f32, y as f32);
                    (self.x[group][lane], self.y[group][lane]) = (x, y);
                    (low, high) = ([low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]);
                    let inverse = self.ends[i] as f32;
                    self.inverse[group][lane] = inverse;
                    self.error[group][lane] = inverse * f32::EPSILON;
                    farthest = farthest.min(inverse - inverse * f32::EPSILON);
                }
                // Nothing is nearer than infinitely near, so these lanes take no part.
                None => {
                    (self.x[group][lane], self.y[group][lane]) = (0.0, 0.0);
                    self.inverse[group][lane] = f32::INFINITY;
                }
            }
        }
        let (block, lane) = (subtile / LANES, subtile % LANES);
        (self.low_x[block][lane], self.low_y[block][lane]) = (low[0], low[1]);
        (self.high_x[block][lane], self.high_y[block][lane]) = (high[0], high[1]);
        self.farthest[block][lane] = farthest;
        for axis in 0..2 {
            self.low[axis] = self.low[axis].min(low[axis]);
            self.high[axis] = self.high[axis].max(high[axis]);
        }
    }

    /// Largest |x| and |y| of the rays.
    #[inline(always)]
    pub(crate) fn reach(&self) -> [f64; 2] {
        [0, 1].map(|axis| f64::from(self.low[axis].abs().max(self.high[axis].abs())))
    }

    /// Meets a triangle with all rays.
    #[inline(always)]
    pub(crate) fn meet<V: Lanes>(&mut self, eye: &Eye, bvh: &Bvh, number: usize, reach: [f64; 2]) {
        let Some(facet) = Facet::new(eye, &bvh.corners[number]) else { return };
        let fast = facet.fast(reach);
        let mut changed = false;
        for block in 0..SUBTILES / LANES {
            let mut open = self.subtiles_in_reach::<V>(&fast, block);
            while open != 0 {
                let lane = open.trailing_zeros() as usize;
                open &= open - 1;
                changed |= self.meet_subtile::<V>(eye, bvh, number, &facet, &fast, block * LANES + lane);
            }
        }
        if changed {
            self.farthest_of_all = self.farthest.as_flattened().iter().copied().fold(f32::INFINITY, f32::min);
        }
    }

    /// The subtiles that a triangle may touch, and before what they have met.
    #[inline(always)]
    fn subtiles_in_reach<V: Lanes>(&self, fast: &FastFacet, block: usize) -> u32 {
        let (low_x, high_x) = (V::load(&self.low_x[block]), V::load(&self.high_x[block]));
        let (low_y, high_y) = (V::load(&self.low_y[block]), V::load(&self.high_y[block]));
        let mut inside = V::splat(fast.nearest_inverse).above(V::load(&self.farthest[block]));
        for (edge, &error) in fast.edges.iter().zip(&fast.edge_error) {
            let x = if edge[0] > 0.0 { high_x } else { low_x };
            let y = if edge[1] > 0.0 { high_y } else { low_y };
            inside = inside.and(values(edge, x, y).above(V::splat(-2.0 * error)));
        }
        inside.bits()
    }

    #[inline(always)]
    fn meet_subtile<V: Lanes>(
        &mut self,
        eye: &Eye,
        bvh: &Bvh,
        number: usize,
        facet: &Facet,
        fast: &FastFacet,
        subtile: usize,
    ) -> bool {
        let mut changed = false;
        for group in subtile * GROUPS_PER_SUBTILE..(subtile + 1) * GROUPS_PER_SUBTILE {
            let (x, y) = (V::load(&self.x[group]), V::load(&self.y[group]));
            let edges = fast.edges.map(|edge| values(&edge, x, y));
            let beyond = |i: usize, sign: f32| edges[i].above(V::splat(sign * fast.edge_error[i]));
            let maybe_inside = beyond(0, -1.0).and(beyond(1, -1.0)).and(beyond(2, -1.0));
            if maybe_inside.bits() == 0 {
                continue;
            }
            let (inverse, error) = (values(&fast.inverse_depth, x, y), V::splat(fast.inverse_error));
            let (best, best_error) = (V::load(&self.inverse[group]), V::load(&self.error[group]));
            let maybe = maybe_inside.and(inverse.add(error).above(best.sub(best_error)));
            let maybe_bits = maybe.bits();
            if maybe_bits == 0 {
                continue;
            }
            let certain = beyond(0, 1.0).and(beyond(1, 1.0)).and(beyond(2, 1.0));
            let certain = certain.and(inverse.sub(error).above(best.add(best_error)));
            self.take(group, certain, inverse, error, number);
            changed = true;
            let mut unsure = maybe_bits & !certain.bits();
            while unsure != 0 {
                let lane = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                self.decide(eye, bvh, number, facet, group, lane);
            }
        }
        if changed {
            self.update_farthest::<V>(subtile);
        }
        changed
    }

    /// Notes a triangle for the lanes where it is certainly the nearest.
    #[inline(always)]
    fn take<V: Lanes>(&mut self, group: usize, lanes: V, inverse: V, error: V, number: usize) {
        let (inverse, error) = match self.question {
            Question::Closest => (inverse, error),
            Question::Any => (V::splat(f32::INFINITY), V::splat(0.0)),
        };
        V::pick(lanes, inverse, V::load(&self.inverse[group])).store(&mut self.inverse[group]);
        V::pick(lanes, error, V::load(&self.error[group])).store(&mut self.error[group]);
        V::pick(lanes, V::splat_bits(number as u32), V::load_bits(&self.met[group])).store_bits(&mut self.met[group]);
    }

    /// Decides in f64 for one ray whether a triangle is met before what was met so far.
    #[cold]
    #[inline(never)]
    fn decide(&mut self, eye: &Eye, bvh: &Bvh, number: usize, facet: &Facet, group: usize, lane: usize) {
        let ray = group * LANES + lane;
        let [x, y] = self.exact[ray];
        let Some(inverse) = facet.meets(x, y) else { return };
        let met = self.met[group][lane];
        let before = match self.question {
            Question::Any if met != MISS => return,
            Question::Any => self.ends[ray],
            Question::Closest if met == MISS => 0.0,
            Question::Closest => {
                Facet::new(eye, &bvh.corners[met as usize]).and_then(|facet| facet.meets(x, y)).unwrap_or(0.0)
            }
        };
        let index = |number: u32| bvh.index_of.get(number as usize).copied().unwrap_or(MISS);
        let tie = inverse == before && self.question == Question::Closest && index(number as u32) < index(met);
        if inverse > before || tie {
            self.met[group][lane] = number as u32;
            let any = self.question == Question::Any;
            self.inverse[group][lane] = if any { f32::INFINITY } else { inverse as f32 };
            self.error[group][lane] = if any { 0.0 } else { inverse as f32 * f32::EPSILON };
        }
    }

    #[inline(always)]
    fn update_farthest<V: Lanes>(&mut self, subtile: usize) {
        let mut lowest = V::splat(f32::INFINITY);
        for group in subtile * GROUPS_PER_SUBTILE..(subtile + 1) * GROUPS_PER_SUBTILE {
            lowest = lowest.min(V::load(&self.inverse[group]).sub(V::load(&self.error[group])));
        }
        let mut lanes = [0.0; LANES];
        lowest.store(&mut lanes);
        self.farthest[subtile / LANES][subtile % LANES] = lanes.into_iter().fold(f32::INFINITY, f32::min);
    }
}
