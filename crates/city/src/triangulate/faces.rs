//! Walks from face to face of a constrained triangulation: finds the faces inside, and counts
//! connected pieces.

use spade::Triangulation as _;
use spade::handles::{FixedFaceHandle, InnerTag};

use super::plane::Cdt;

/// Returns per face whether an odd number of constraints separates it from the outside.
pub(super) fn faces_by_parity(cdt: &Cdt) -> Vec<bool> {
    let mut parity: Vec<Option<bool>> = vec![None; cdt.num_all_faces()];
    let mut open: Vec<(FixedFaceHandle<InnerTag>, bool)> = Vec::new();
    let border = cdt.directed_edges().filter(|edge| edge.is_outer_edge()).map(|edge| edge.rev());
    open.extend(border.filter_map(|edge| Some((edge.face().as_inner()?.fix(), edge.is_constraint_edge()))));
    while let Some((face, inside)) = open.pop() {
        let face = cdt.face(face);
        if parity[face.index()].replace(inside).is_some() {
            continue;
        }
        for edge in face.adjacent_edges().map(|edge| edge.rev()) {
            if let Some(next) = edge.face().as_inner().filter(|next| parity[next.index()].is_none()) {
                open.push((next.fix(), inside ^ edge.is_constraint_edge()));
            }
        }
    }
    parity.into_iter().map(|inside| inside.unwrap_or(false)).collect()
}

/// Counts the pieces that the faces inside form when constraints separate them.
pub(super) fn pieces_inside(cdt: &Cdt, inside: &[bool]) -> usize {
    let mut open_to_visit = inside.to_vec();
    let mut pieces = 0;
    for start in cdt.inner_faces() {
        if !open_to_visit[start.index()] {
            continue;
        }
        pieces += 1;
        let mut at = vec![start.fix()];
        while let Some(face) = at.pop() {
            let face = cdt.face(face);
            if !std::mem::replace(&mut open_to_visit[face.index()], false) {
                continue;
            }
            let free = face.adjacent_edges().into_iter().filter(|edge| !edge.is_constraint_edge());
            at.extend(free.filter_map(|edge| Some(edge.rev().face().as_inner()?.fix())));
        }
    }
    pieces
}
