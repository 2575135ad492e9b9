//! Compares the shells of a solid (401 to 404), and the solids of a composite solid (501 to 503).

use std::collections::HashMap;

use super::body::{Body, MemberDefect};
use super::contact::{Budget, Contact};
use super::limits::{OVERLAP_M, SHELL_TOLERANCE_M};
use super::patch::{Patch, Side};
use crate::DefectCode;
use crate::sets::DisjointSets;

/// Compares the shells of a solid. The first one is the outer shell.
pub(super) fn compare_shells(shells: &[Patch]) -> Vec<MemberDefect> {
    let (mut found, mut budget) = (Vec::new(), Budget::new());
    let defect = |code, index: usize, detail: String| MemberDefect { code, member: index as u32, detail };
    for (index, shell) in shells.iter().enumerate().skip(1) {
        for (other, earlier) in shells[..index].iter().enumerate() {
            let Some(contact) = Contact::of(earlier, shell, SHELL_TOLERANCE_M, &mut budget) else {
                let detail = "4xx, from here on: too many triangles".to_owned();
                found.push(defect(DefectCode::NotChecked, index, detail));
                return found;
            };
            if let Some(code) = cavity_defect(&contact, other == 0) {
                found.push(defect(code, index, format!("and shell {other}")));
            }
        }
    }
    if found.is_empty() {
        let cut_off = (1..shells.len()).filter(|&index| touches_all_around(shells, index));
        found.extend(cut_off.map(|index| defect(DefectCode::SolidInteriorDisconnected, index, String::new())));
    }
    found
}

/// Returns what is wrong with shell B, a cavity, in relation to shell A, which is the outer shell
/// or another cavity; `None` if nothing is.
fn cavity_defect(contact: &Contact, a_is_outer: bool) -> Option<DefectCode> {
    if contact.is_same() {
        return Some(DefectCode::DuplicateShells);
    }
    if contact.shares_face() || contact.b.are_on_both_sides() || contact.a.are_on_both_sides() {
        return Some(DefectCode::ShellsIntersect);
    }
    let nested = contact.a.inside || contact.b.inside;
    // A cavity must be inside the outer shell and outside the other cavities.
    (a_is_outer != contact.b.inside || (nested && !a_is_outer)).then_some(DefectCode::InnerShellOutside)
}

/// Returns whether edges of a cavity that lie on earlier shells close a circle, which cuts off the
/// interior within it.
fn touches_all_around(shells: &[Patch], index: usize) -> bool {
    let mut number_of: HashMap<u32, usize> = HashMap::new();
    let touching: Vec<[usize; 2]> = shells[index]
        .edges()
        .into_iter()
        .filter(|(_, [p, q])| {
            let middle = [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
            let on = |shell: &Patch| [*p, *q, middle].iter().all(|&at| shell.side(at, SHELL_TOLERANCE_M) == Side::On);
            shells[..index].iter().any(on)
        })
        .map(|(ends, _)| {
            ends.map(|vertex| {
                let next = number_of.len();
                *number_of.entry(vertex).or_insert(next)
            })
        })
        .collect();
    let mut joined = DisjointSets::new(number_of.len());
    touching.into_iter().any(|[a, b]| !joined.join(a, b))
}

/// Compares the solids of a composite solid.
pub(super) fn compare(bodies: &[Body]) -> Vec<MemberDefect> {
    let (mut found, mut budget) = (Vec::new(), Budget::new());
    let mut joined = DisjointSets::new(bodies.len());
    let defect = |code, member, detail| MemberDefect { code, member, detail };
    for (index, b) in bodies.iter().enumerate() {
        for (other, a) in bodies[..index].iter().enumerate() {
            let and = format!("and solid {}", a.solid);
            match Contact::of(&a.surface, &b.surface, OVERLAP_M, &mut budget) {
                None => {
                    let detail = "5xx, from here on: too many triangles".to_owned();
                    found.push(defect(DefectCode::NotChecked, b.solid, detail));
                    return found;
                }
                Some(contact) if contact.is_same() => found.push(defect(DefectCode::DuplicateSolids, b.solid, and)),
                Some(contact) if contact.interiors_meet() => {
                    found.push(defect(DefectCode::SolidsIntersect, b.solid, and));
                }
                Some(contact) if contact.opposite_face => {
                    joined.join(index, other);
                }
                Some(_) => {}
            }
        }
    }
    let pieces = joined.count();
    if pieces > 1 && found.is_empty() {
        let last = bodies.last().map_or(0, |body| body.solid);
        found.push(defect(DefectCode::SolidsDisconnected, last, format!("{pieces} pieces")));
    }
    found
}
