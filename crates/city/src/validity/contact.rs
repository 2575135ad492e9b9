//! The relation of two closed surfaces: apart, touching, sharing faces, or reaching into each
//! other.
//!
//! Each edge of one surface is cut where it passes through a triangle of the other. The pieces are
//! then inside, outside or on the other surface. Surfaces whose edges lie in each other's faces are
//! distinguished by the faces that they share: when both face the same way, their interiors are on
//! the same side.

use super::limits::{MAX_COMPARISONS, SHELL_TOLERANCE_M};
use super::patch::{Bounds, Patch, Side};
use numeric::vector::{Vector, cross, dot, norm, sub, unit};

/// The number of comparisons of triangles that are left.
#[derive(Debug)]
pub(super) struct Budget {
    left: usize,
}

impl Budget {
    pub(super) fn new() -> Self {
        Self { left: MAX_COMPARISONS }
    }

    /// Takes some comparisons, or returns `None` when too few are left.
    pub(super) fn spend(&mut self, comparisons: usize) -> Option<()> {
        self.left = self.left.checked_sub(comparisons)?;
        Some(())
    }
}

/// On which sides of a surface parts of another one are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Parts {
    pub(super) inside: bool,
    pub(super) outside: bool,
}

/// The relation of surfaces A and B.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Contact {
    /// Where parts of A are, as seen from B.
    pub(super) a: Parts,
    /// Where parts of B are, as seen from A.
    pub(super) b: Parts,
    /// They share part of a face, and face the same way there.
    pub(super) same_face: bool,
    /// They share part of a face, and face opposite ways there.
    pub(super) opposite_face: bool,
}

impl Parts {
    /// Returns where parts of the edges of `a` are, as seen from `b`.
    fn of(a: &Patch, b: &Patch, tolerance_m: f64, budget: &mut Budget) -> Option<Self> {
        let mut parts = Self::default();
        for (_, [p, q]) in a.edges() {
            if parts.are_on_both_sides() {
                break;
            }
            if !Bounds::of([p, q]).meets(&b.bounds, tolerance_m) {
                parts.outside = true;
                continue;
            }
            let cuts = cuts([p, q], b);
            budget.spend(b.corners.len().saturating_mul(cuts.len()))?;
            for pair in cuts.windows(2) {
                let middle = 0.5 * (pair[0] + pair[1]);
                match b.side([0, 1, 2].map(|i| p[i] + middle * (q[i] - p[i])), tolerance_m) {
                    Side::Inside => parts.inside = true,
                    Side::Outside => parts.outside = true,
                    Side::On => {}
                }
            }
        }
        Some(parts)
    }

    pub(super) fn are_on_both_sides(self) -> bool {
        self.inside && self.outside
    }
}

impl Contact {
    /// Compares two surfaces, or returns `None` when that exceeds the budget.
    pub(super) fn of(a: &Patch, b: &Patch, tolerance_m: f64, budget: &mut Budget) -> Option<Self> {
        budget.spend(1)?;
        let apart = Parts { inside: false, outside: true };
        let mut contact = Self { a: apart, b: apart, ..Self::default() };
        if !a.bounds.meets(&b.bounds, tolerance_m) {
            return Some(contact);
        }
        contact.a = Parts::of(a, b, tolerance_m, budget)?;
        contact.b = Parts::of(b, a, tolerance_m, budget)?;
        for (i, s) in a.corners.iter().enumerate().filter(|(_, s)| Bounds::of(**s).meets(&b.bounds, tolerance_m)) {
            let bounds = Bounds::of(*s);
            budget.spend(b.corners.len())?;
            for t in b.corners.iter().filter(|t| bounds.meets(&Bounds::of(**t), tolerance_m)) {
                match shared_face(&a.corners[i], t, tolerance_m) {
                    Some(true) => contact.same_face = true,
                    Some(false) => contact.opposite_face = true,
                    None => {}
                }
            }
        }
        Some(contact)
    }

    /// Returns whether the interiors of two solids, each facing outwards, overlap.
    pub(super) fn interiors_meet(&self) -> bool {
        self.a.inside || self.b.inside || self.same_face
    }

    /// Returns whether the surfaces are equal: each lies on the other.
    pub(super) fn is_same(&self) -> bool {
        self.a == Parts::default() && self.b == Parts::default()
    }

    /// Returns whether the surfaces share part of a face.
    pub(super) fn shares_face(&self) -> bool {
        self.same_face || self.opposite_face
    }
}

/// Returns the fractions along an edge of its ends and of its crossings with the planes of nearby
/// triangles, ascending.
fn cuts([p, q]: [Vector; 2], b: &Patch) -> Vec<f64> {
    let edge = Bounds::of([p, q]);
    let mut cuts = vec![0.0, 1.0];
    for t in b.corners.iter().filter(|t| Bounds::of(**t).meets(&edge, SHELL_TOLERANCE_M)) {
        let Some(normal) = normal(t) else { continue };
        let (from, to) = (dot(normal, sub(p, t[0])), dot(normal, sub(q, t[0])));
        if from * to < 0.0 {
            cuts.push(from / (from - to));
        }
    }
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    cuts
}

/// Returns the unit normal of a triangle, or `None` when it is thinner than the tolerance.
pub(super) fn normal(&[a, b, c]: &[Vector; 3]) -> Option<Vector> {
    let (e, f, g) = (sub(b, a), sub(c, a), sub(c, b));
    let doubled = cross(e, f);
    let longest = norm(e).max(norm(f)).max(norm(g));
    (norm(doubled) > SHELL_TOLERANCE_M * longest).then(|| unit(doubled)).flatten()
}

/// Returns whether two triangles face the same way, when they lie in one plane and share more than
/// their borders.
///
/// Returns `None` when they do not overlap.
pub(super) fn shared_face(s: &[Vector; 3], t: &[Vector; 3], tolerance_m: f64) -> Option<bool> {
    let (n, m) = (normal(s)?, normal(t)?);
    let off = |n: Vector, of: &[Vector; 3], others: &[Vector; 3]| {
        others.iter().any(|&p| dot(n, sub(p, of[0])).abs() > tolerance_m)
    };
    if off(n, s, t) || off(m, t, s) {
        return None;
    }
    let common = clipped(s, t, n);
    let area = common_area(&common, n);
    let around: f64 = (0..common.len()).map(|i| norm(sub(common[(i + 1) % common.len()], common[i]))).sum();
    (area > tolerance_m * around).then(|| dot(n, m) > 0.0)
}

/// Clips `t` to the sides of `s`, whose normal is `n` (Sutherland and Hodgman 1974).
fn clipped(s: &[Vector; 3], t: &[Vector; 3], n: Vector) -> Vec<Vector> {
    let mut polygon = t.to_vec();
    for i in 0..3 {
        let (from, inwards) = (s[i], cross(n, sub(s[(i + 1) % 3], s[i])));
        let depth = |p: Vector| dot(inwards, sub(p, from));
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for k in 0..polygon.len() {
            let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            let (da, db) = (depth(a), depth(b));
            if da >= 0.0 {
                kept.push(a);
            }
            if (da < 0.0) != (db < 0.0) {
                let along = da / (da - db);
                kept.push([0, 1, 2].map(|i| a[i] + along * (b[i] - a[i])));
            }
        }
        polygon = kept;
    }
    polygon
}

fn common_area(polygon: &[Vector], n: Vector) -> f64 {
    let Some((&first, rest)) = polygon.split_first() else { return 0.0 };
    let doubled: f64 = rest.windows(2).map(|pair| dot(n, cross(sub(pair[0], first), sub(pair[1], first)))).sum();
    0.5 * doubled.abs()
}
