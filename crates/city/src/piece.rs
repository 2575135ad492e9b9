//! The triangles of one object: checks its shells, finds repeated polygons and cuts the others.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use crate::select;
use crate::shell;
use crate::triangulate::{Triangulation, triangulate};
use crate::{CityModel, Defect, DefectCode, Effect, Geometry, Lod, SurfaceClass, SurfacePolygon};
use numeric::vector::Vector;

/// The triangles of one object. Their corners are vertices of the model.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    /// Index of the object, which its defects name.
    object: usize,
    pub(crate) polygons: Vec<(SurfaceClass, Triangulation)>,
    pub(crate) defects: Vec<Defect>,
}

impl Piece {
    /// Cuts the surfaces of an object at a level of detail; `position` returns the place of a
    /// vertex, metres.
    pub(crate) fn new(model: &CityModel, object: usize, lod: Option<Lod>, position: &impl Fn(u32) -> Vector) -> Self {
        let mut piece = Self { object, ..Self::default() };
        let mut known: HashMap<Vec<u32>, usize> = HashMap::new();
        for (number, geometry) in select::geometries(&model.objects[object], lod) {
            let turn = piece.check_shells(geometry, number, position);
            for (index, surface) in geometry.surfaces.iter().enumerate() {
                let place = || format!("geometry {number}, surface {index}");
                match known.entry(sorted_corners(surface)) {
                    Entry::Occupied(first) => {
                        piece.merge_class(*first.get(), surface.class);
                        piece.defect(DefectCode::DuplicatePolygon, Effect::Dropped, place(), String::new());
                    }
                    Entry::Vacant(entry) => {
                        entry.insert(piece.polygons.len());
                        piece.add(surface, turn[index], position, &place);
                    }
                }
            }
        }
        piece
    }

    fn defect(&mut self, code: DefectCode, effect: Effect, place: String, detail: String) {
        self.defects.push(Defect { code, effect, object: Some(self.object), place, detail });
    }

    /// Sets the class of a polygon that has none: a polygon may be classified in only one of two
    /// geometries.
    fn merge_class(&mut self, polygon: usize, class: SurfaceClass) {
        if let Some((known, _)) = self.polygons.get_mut(polygon).filter(|(c, _)| *c == SurfaceClass::Unclassified) {
            *known = class;
        }
    }

    fn add(
        &mut self,
        surface: &SurfacePolygon,
        turn: bool,
        position: &impl Fn(u32) -> Vector,
        place: &impl Fn() -> String,
    ) {
        let mut cut = triangulate(&surface.rings, position);
        for finding in std::mem::take(&mut cut.findings) {
            let effect = if finding.dropped { Effect::Dropped } else { Effect::Noted };
            self.defect(finding.code, effect, place(), finding.detail);
        }
        if turn {
            cut.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self.polygons.push((surface.class, cut));
    }

    /// Returns per surface whether it must be turned around. Only the surfaces of solids have an
    /// outside.
    fn check_shells(&mut self, geometry: &Geometry, number: usize, position: &impl Fn(u32) -> Vector) -> Vec<bool> {
        let mut turn = vec![false; geometry.surfaces.len()];
        if !geometry.kind.is_solid() {
            return turn;
        }
        let mut start = 0;
        for members in geometry.surfaces.chunk_by(|a, b| (a.solid, a.shell) == (b.solid, b.shell)) {
            let (solid, number_of_shell) = (members[0].solid, members[0].shell);
            let check = shell::check(&members.iter().collect::<Vec<_>>(), number_of_shell == 0, position);
            turn[start..start + members.len()].copy_from_slice(&check.turn);
            start += members.len();
            for (code, detail) in check.found {
                let turned = matches!(code, DefectCode::WrongOrientation | DefectCode::WrongOrientationShell);
                let effect = if turned { Effect::Repaired } else { Effect::Noted };
                let place = format!("geometry {number}, solid {solid}, shell {number_of_shell}");
                self.defect(code, effect, place, detail);
            }
        }
        turn
    }
}

/// Returns the corners in ascending order, a key that does not depend on where and which way a ring
/// runs.
fn sorted_corners(surface: &SurfacePolygon) -> Vec<u32> {
    let mut corners: Vec<u32> = surface.rings.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners
}
