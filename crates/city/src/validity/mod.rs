//! Checks solids for val3dity's codes 303 (at a vertex), 306, 4xx, 5xx and 601, and composite
//! surfaces for 303 and 305.
//!
//! The checks compare triangles with triangles, which is slow. They are made for a report, and
//! reading a model does not run them. They build upon each other as in val3dity (Ledoux 2018): only
//! closed shells are searched for self-intersections, only valid shells are compared within a
//! solid, and only valid solids with each other. The model is not changed.
//!
//! Surfaces nearer than [`SHELL_TOLERANCE_M`](limits::SHELL_TOLERANCE_M) touch. Polygons intersect,
//! and solids overlap, when one reaches into the other by more than [`OVERLAP_M`].

mod body;
mod contact;
mod limits;
mod patch;
mod selves;
mod solids;
mod vertices;

use rayon::prelude::*;

use crate::select;
use crate::shell;
use crate::triangle_mesh::positions_of;
use crate::{
    CityModel, Defect, DefectCode, Effect, Geometry, GeometryKind, MeshConfig, ModelError, ObjectKind, SurfacePolygon,
};
use body::{Body, MemberDefect};
use contact::{Budget, Contact};
use limits::OVERLAP_M;
use numeric::vector::Vector;
use patch::Patch;

/// Checks the solids that [`TriangleMesh::from_model`](crate::TriangleMesh::from_model) makes
/// triangles of, and returns the defects that it does not report itself.
///
/// # Errors
/// The errors of [`CityModel::validate`].
pub fn check_solids(model: &CityModel, config: &MeshConfig) -> Result<Vec<Defect>, ModelError> {
    model.validate()?;
    let chosen = select::choose(model, config.lod, config.scope);
    let position = positions_of(model, &chosen);
    let checked: Vec<Checked> = chosen
        .par_iter()
        .enumerate()
        .map(|(object, chosen)| {
            let mut checked = Checked::default();
            if let Ok(lod) = chosen {
                for (number, geometry) in select::geometries(&model.objects[object], *lod) {
                    checked.geometry(object, number, geometry, &position);
                }
            }
            checked
        })
        .collect();
    let mut defects = Vec::new();
    let mut bodies = Vec::new();
    for mut of_object in checked {
        defects.append(&mut of_object.defects);
        bodies.append(&mut of_object.bodies);
    }
    compare_parts(model, bodies, &mut defects);
    defects.sort_by_key(|defect| defect.object);
    Ok(defects)
}

/// Defects of the solids of an object, and its valid solids.
#[derive(Default)]
struct Checked {
    defects: Vec<Defect>,
    bodies: Vec<Body>,
}

impl Checked {
    fn report(&mut self, object: usize, code: DefectCode, place: String, detail: String) {
        self.defects.push(Defect { code, effect: Effect::Noted, object: Some(object), place, detail });
    }

    /// Checks the shells and solids of a geometry.
    fn geometry(&mut self, object: usize, number: usize, geometry: &Geometry, position: &impl Fn(u32) -> Vector) {
        if geometry.kind == GeometryKind::CompositeSurface {
            let found = shell::check_sheet(&geometry.surfaces.iter().collect::<Vec<_>>());
            found
                .into_iter()
                .for_each(|(code, detail)| self.report(object, code, format!("geometry {number}"), detail));
        }
        if !geometry.kind.is_solid() {
            return;
        }
        let first = self.bodies.len();
        for solid in geometry.surfaces.chunk_by(|a, b| a.solid == b.solid) {
            let place = format!("geometry {number}, solid {}", solid[0].solid);
            let Some(surface) = self.solid(object, &place, solid, position) else { continue };
            self.bodies.push(Body { object, geometry: number, solid: solid[0].solid, surface });
        }
        // Only the solids of a composite solid must be neighbours.
        if geometry.kind != GeometryKind::CompositeSolid {
            return;
        }
        for MemberDefect { code, member: solid, detail } in solids::compare(&self.bodies[first..]) {
            self.report(object, code, format!("geometry {number}, solid {solid}"), detail);
        }
    }

    /// Returns the surface of a solid, or `None` when the solid has a defect.
    fn solid(
        &mut self,
        object: usize,
        place: &str,
        solid: &[SurfacePolygon],
        position: &impl Fn(u32) -> Vector,
    ) -> Option<Patch> {
        let mut shells = Vec::new();
        let mut sound = true;
        for members in solid.chunk_by(|a, b| a.shell == b.shell) {
            let place = format!("{place}, shell {}", members[0].shell);
            match self.shell(object, place, &members.iter().collect::<Vec<_>>(), position) {
                Some(shell) => shells.push(shell),
                None => sound = false,
            }
        }
        if !sound {
            return None;
        }
        let found = solids::compare_shells(&shells);
        sound = found.is_empty();
        for MemberDefect { code, member: shell, detail } in found {
            self.report(object, code, format!("{place}, shell {shell}"), detail);
        }
        sound.then(|| Patch::joined(shells))
    }

    /// Returns the surface of a shell, or `None` when the shell is not closed or intersects itself.
    fn shell(
        &mut self,
        object: usize,
        place: String,
        members: &[&SurfacePolygon],
        position: &impl Fn(u32) -> Vector,
    ) -> Option<Patch> {
        let check = shell::check(members, members[0].shell == 0, position);
        let open = [DefectCode::TooFewPolygons, DefectCode::ShellNotClosed, DefectCode::NonManifold];
        if check.found.iter().any(|(code, _)| open.contains(code)) {
            return None;
        }
        let pinched = vertices::pinched(members);
        if pinched > 0 {
            let detail = format!("the polygons around a vertex form several fans: {pinched} vertices");
            self.report(object, DefectCode::NonManifold, place, detail);
            return None;
        }
        let shell = Patch::new(members, &check.turn, position)?;
        match selves::meetings(&shell) {
            Some(0) => return Some(shell),
            Some(meetings) => {
                let detail = format!("{meetings} pairs of triangles");
                self.report(object, DefectCode::ShellSelfIntersection, place, detail);
            }
            None => self.report(object, DefectCode::NotChecked, place, "306: too many triangles".to_owned()),
        }
        None
    }
}

/// Finds solids of a building and its parts that overlap.
fn compare_parts(model: &CityModel, bodies: Vec<Body>, defects: &mut Vec<Defect>) {
    let is_part = |body: &Body| {
        let kind = &model.objects[body.object].kind;
        *kind == ObjectKind::BUILDING || *kind == ObjectKind::BUILDING_PART
    };
    let mut of_building: Vec<(usize, Body)> =
        bodies.into_iter().filter(is_part).map(|body| (model.root(body.object), body)).collect();
    of_building.sort_by_key(|(root, _)| *root);
    let buildings: Vec<&[(usize, Body)]> = of_building.chunk_by(|a, b| a.0 == b.0).collect();
    let found: Vec<Vec<Defect>> = buildings.par_iter().map(|bodies| overlapping_parts(model, bodies)).collect();
    defects.extend(found.into_iter().flatten());
}

fn overlapping_parts(model: &CityModel, bodies: &[(usize, Body)]) -> Vec<Defect> {
    let (mut found, mut budget) = (Vec::new(), Budget::new());
    for (index, (_, b)) in bodies.iter().enumerate() {
        for (_, a) in bodies[..index].iter().filter(|(_, a)| (a.object, a.geometry) != (b.object, b.geometry)) {
            let contact = Contact::of(&a.surface, &b.surface, OVERLAP_M, &mut budget);
            let (code, detail) = match contact {
                Some(contact) if contact.interiors_meet() || contact.is_same() => {
                    (DefectCode::PartsOverlap, format!("with {}", model.objects[a.object].id))
                }
                Some(_) => continue,
                None => (DefectCode::NotChecked, "601, from here on: too many triangles".to_owned()),
            };
            let place = format!("geometry {}, solid {}", b.geometry, b.solid);
            found.push(Defect { code, effect: Effect::Noted, object: Some(b.object), place, detail });
            if contact.is_none() {
                return found;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests;
