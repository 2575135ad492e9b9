//! The rays of a tile: up to 1024 rays through one eye, in subtiles of 64, with the nearest
//! triangle of each.
//!
//! Depths are stored as inverse depths, because these are linear over a triangle. A larger value is
//! nearer, and 0 is a miss. Each has an error bound, and two that differ by less than their errors
//! are compared in f64. When any hit suffices, the inverse depth starts at the target's and becomes
//! infinite as soon as something lies before it.

use crate::Bvh;
use crate::eye::Eye;
use crate::ray::MISS;
use crate::setup::{Facet, FastFacet, values};
use crate::simd::{InstructionSet, Lanes};

/// Rays of a group: the lanes of one register.
pub(crate) const LANES: usize = 8;
/// Rays of a subtile.
pub(crate) const SUBTILE: usize = 64;
/// Subtiles of a tile.
pub(crate) const SUBTILES: usize = 16;
/// Rays of a tile.
pub(crate) const RAYS: usize = SUBTILE * SUBTILES;

const GROUPS: usize = RAYS / LANES;
const GROUPS_PER_SUBTILE: usize = SUBTILE / LANES;

/// The question that rays answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Question {
    /// Which triangle is the first on the ray?
    Closest,
    /// Does any triangle lie before the end of the ray?
    Any,
}

/// The rays of a tile with the nearest triangles found so far.
#[derive(Debug)]
pub(crate) struct Tile {
    question: Question,
    /// Directions (x, y) in f64.
    pub(crate) exact: [[f64; 2]; RAYS],
    /// Inverse depths of the rays' ends in f64, for [`Question::Any`].
    ends: [f64; RAYS],
    x: [[f32; LANES]; GROUPS],
    y: [[f32; LANES]; GROUPS],
    inverse: [[f32; LANES]; GROUPS],
    error: [[f32; LANES]; GROUPS],
    /// Number of the nearest triangle in the order of the leaves, [`MISS`] for none.
    pub(crate) met: [[u32; LANES]; GROUPS],
    /// Bounds of the directions in each subtile.
    low_x: [[f32; LANES]; SUBTILES / LANES],
    high_x: [[f32; LANES]; SUBTILES / LANES],
    low_y: [[f32; LANES]; SUBTILES / LANES],
    high_y: [[f32; LANES]; SUBTILES / LANES],
    /// Smallest inverse depth in each subtile. A triangle behind it cannot be nearer for any ray.
    farthest: [[f32; LANES]; SUBTILES / LANES],
    /// Lower bounds of all directions, x and y.
    pub(crate) low: [f32; 2],
    pub(crate) high: [f32; 2],
    /// Smallest inverse depth of all rays.
    pub(crate) farthest_of_all: f32,
}

/// A triangle that is tested against the rays of a tile.
struct Candidate {
    /// Number in the order of the leaves.
    number: usize,
    facet: Facet,
    fast: FastFacet,
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

    /// Loads new rays. `ray` gives (x, y, depth of the end) of a ray by its number, `None` for no
    /// ray.
    ///
    /// Returns whether there is at least one ray.
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
                // No triangle is nearer than an infinite inverse depth, so lanes without a ray find
                // nothing.
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

    /// Returns the largest |x| and |y| of the rays.
    #[inline(always)]
    pub(crate) fn reach(&self) -> [f64; 2] {
        [0, 1].map(|axis| f64::from(self.low[axis].abs().max(self.high[axis].abs())))
    }

    /// Tests a triangle against all rays.
    #[inline(always)]
    pub(crate) fn meet<I: InstructionSet>(&mut self, isa: I, eye: &Eye, bvh: &Bvh, number: usize, reach: [f64; 2]) {
        let Some(facet) = Facet::new(eye, &bvh.corners[number]) else { return };
        let fast = facet.fast(reach);
        let candidate = Candidate { number, facet, fast };
        let mut changed = false;
        for block in 0..SUBTILES / LANES {
            let mut open = self.subtiles_in_reach(isa, &candidate.fast, block);
            while open != 0 {
                let lane = open.trailing_zeros() as usize;
                open &= open - 1;
                changed |= self.meet_subtile(isa, eye, bvh, &candidate, block * LANES + lane);
            }
        }
        if changed {
            self.farthest_of_all = self.farthest.as_flattened().iter().copied().fold(f32::INFINITY, f32::min);
        }
    }

    /// Returns the subtiles of a block in which a triangle may be the nearest, as a bit mask.
    #[inline(always)]
    fn subtiles_in_reach<I: InstructionSet>(&self, isa: I, fast: &FastFacet, block: usize) -> u32 {
        let (low_x, high_x) = (isa.load(&self.low_x[block]), isa.load(&self.high_x[block]));
        let (low_y, high_y) = (isa.load(&self.low_y[block]), isa.load(&self.high_y[block]));
        let mut inside = isa.splat(fast.nearest_inverse).above(isa.load(&self.farthest[block]));
        for (edge, &error) in fast.edges.iter().zip(&fast.edge_error) {
            let x = if edge[0] > 0.0 { high_x } else { low_x };
            let y = if edge[1] > 0.0 { high_y } else { low_y };
            inside = inside.and(values(isa, edge, x, y).above(isa.splat(-2.0 * error)));
        }
        inside.bits()
    }

    #[inline(always)]
    fn meet_subtile<I: InstructionSet>(
        &mut self,
        isa: I,
        eye: &Eye,
        bvh: &Bvh,
        candidate: &Candidate,
        subtile: usize,
    ) -> bool {
        let Candidate { number, facet, fast } = candidate;
        let number = *number;
        let mut changed = false;
        for group in subtile * GROUPS_PER_SUBTILE..(subtile + 1) * GROUPS_PER_SUBTILE {
            let (x, y) = (isa.load(&self.x[group]), isa.load(&self.y[group]));
            let edges = fast.edges.map(|edge| values(isa, &edge, x, y));
            let beyond = |i: usize, sign: f32| edges[i].above(isa.splat(sign * fast.edge_error[i]));
            let maybe_inside = beyond(0, -1.0).and(beyond(1, -1.0)).and(beyond(2, -1.0));
            if maybe_inside.bits() == 0 {
                continue;
            }
            let (inverse, error) = (values(isa, &fast.inverse_depth, x, y), isa.splat(fast.inverse_error));
            let (best, best_error) = (isa.load(&self.inverse[group]), isa.load(&self.error[group]));
            let maybe = maybe_inside.and(inverse.add(error).above(best.sub(best_error)));
            let maybe_bits = maybe.bits();
            if maybe_bits == 0 {
                continue;
            }
            let certain = beyond(0, 1.0).and(beyond(1, 1.0)).and(beyond(2, 1.0));
            let certain = certain.and(inverse.sub(error).above(best.add(best_error)));
            self.take(isa, group, certain, inverse, error, number);
            changed = true;
            let mut unsure = maybe_bits & !certain.bits();
            while unsure != 0 {
                let lane = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                self.decide(eye, bvh, number, facet, group, lane);
            }
        }
        if changed {
            self.update_farthest(isa, subtile);
        }
        changed
    }

    /// Stores a triangle for the lanes in which it is certainly the nearest.
    #[inline(always)]
    fn take<I: InstructionSet>(
        &mut self,
        isa: I,
        group: usize,
        lanes: I::Lanes,
        inverse: I::Lanes,
        error: I::Lanes,
        number: usize,
    ) {
        let (inverse, error) = match self.question {
            Question::Closest => (inverse, error),
            Question::Any => (isa.splat(f32::INFINITY), isa.splat(0.0)),
        };
        lanes.pick(inverse, isa.load(&self.inverse[group])).store(&mut self.inverse[group]);
        lanes.pick(error, isa.load(&self.error[group])).store(&mut self.error[group]);
        lanes.pick(isa.splat_bits(number as u32), isa.load_bits(&self.met[group])).store_bits(&mut self.met[group]);
    }

    /// Decides in f64 for one ray whether a triangle is nearer than the nearest one so far.
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
    fn update_farthest<I: InstructionSet>(&mut self, isa: I, subtile: usize) {
        let mut lowest = isa.splat(f32::INFINITY);
        for group in subtile * GROUPS_PER_SUBTILE..(subtile + 1) * GROUPS_PER_SUBTILE {
            lowest = lowest.min(isa.load(&self.inverse[group]).sub(isa.load(&self.error[group])));
        }
        let mut lanes = [0.0; LANES];
        lowest.store(&mut lanes);
        self.farthest[subtile / LANES][subtile % LANES] = lanes.into_iter().fold(f32::INFINITY, f32::min);
    }
}
