//! Builds a city model from the elements of a file: finds objects by identifier, checks vertices
//! and collects defects.

use std::collections::{HashMap, HashSet};

use super::palette::Palette;
use city::{CityModel, CityObject, CrsReference, Defect, DefectCode, Effect, ModelPoint, ObjectKind};

/// Largest absolute coordinate. Coordinates on the Earth are smaller, even in feet.
const COORDINATE_LIMIT: f64 = 1e8;

/// A city model under construction.
#[derive(Debug, Default)]
pub(super) struct Builder {
    model: CityModel,
    defects: Vec<Defect>,
    object_of: HashMap<String, usize>,
    /// Vertices with invalid coordinates. They are stored as zero, and no surface may use them.
    unusable: HashSet<u32>,
    /// Objects and the identifiers of their parents.
    parents: Vec<(usize, String)>,
    /// Materials, textures and themes of the model.
    pub(super) palette: Palette,
}

impl Builder {
    /// Sets the reference system, and notes when it is missing or unknown.
    pub(super) fn set_crs(&mut self, crs: CrsReference) {
        if crs.is_missing() {
            self.note(DefectCode::CrsMissing, None, "file", "");
        } else if crs.epsg.is_none() {
            self.note(DefectCode::CrsUnknown, None, "file", crs.name.clone().unwrap_or_default());
        }
        self.model.crs = crs;
    }

    /// Adds an object and returns its index. A repeated identifier is noted and stays with the
    /// first object.
    pub(super) fn object(&mut self, id: impl Into<String>, kind: ObjectKind) -> usize {
        let (id, index) = (id.into(), self.model.objects.len());
        if self.object_of.contains_key(&id) {
            self.note(DefectCode::DuplicateId, Some(index), "file", "");
        } else {
            self.object_of.insert(id.clone(), index);
        }
        self.model.objects.push(CityObject::new(id, kind));
        index
    }

    pub(super) fn object_mut(&mut self, object: usize) -> &mut CityObject {
        &mut self.model.objects[object]
    }

    /// Names the parent of an object. The parent may follow later in the file.
    pub(super) fn parent(&mut self, object: usize, parent: impl Into<String>) {
        self.parents.push((object, parent.into()));
    }

    /// Adds a vertex and returns its index, or `None` when all 32-bit indices are used.
    pub(super) fn vertex(&mut self, point: ModelPoint) -> Option<u32> {
        let index = u32::try_from(self.model.vertices.len()).ok().filter(|&i| i < u32::MAX)?;
        let usable = [point.x, point.y, point.z].iter().all(|c| c.abs() <= COORDINATE_LIMIT);
        if !usable {
            self.unusable.insert(index);
        }
        self.model.vertices.push(if usable { point } else { ModelPoint::default() });
        Some(index)
    }

    pub(super) fn vertex_count(&self) -> usize {
        self.model.vertices.len()
    }

    /// Returns the position of a vertex.
    pub(super) fn position(&self, index: u32) -> ModelPoint {
        self.model.vertices[index as usize]
    }

    /// Returns whether the coordinates of a vertex are valid.
    pub(super) fn is_usable(&self, vertex: u32) -> bool {
        !self.unusable.contains(&vertex)
    }

    /// Counts things in the file that the model cannot hold.
    pub(super) fn left_out(&mut self, what: &str, count: usize) {
        if count > 0 {
            *self.model.left_out.entry(what.to_owned()).or_insert(0) += count;
        }
    }

    /// Adds a defect without consequence.
    pub(super) fn note(
        &mut self,
        code: DefectCode,
        object: Option<usize>,
        place: impl Into<String>,
        detail: impl Into<String>,
    ) {
        self.defect(code, Effect::Noted, object, place, detail);
    }

    /// Adds a defect because of which an element is left out.
    pub(super) fn dropped(
        &mut self,
        code: DefectCode,
        object: usize,
        place: impl Into<String>,
        detail: impl Into<String>,
    ) {
        self.defect(code, Effect::Dropped, Some(object), place, detail);
    }

    fn defect(
        &mut self,
        code: DefectCode,
        effect: Effect,
        object: Option<usize>,
        place: impl Into<String>,
        detail: impl Into<String>,
    ) {
        self.defects.push(Defect { code, effect, object, place: place.into(), detail: detail.into() });
    }

    /// Links the parents, and returns the model and its defects.
    pub(super) fn finish(mut self) -> (CityModel, Vec<Defect>) {
        for (object, parent) in std::mem::take(&mut self.parents) {
            match self.object_of.get(&parent) {
                Some(&index) if index != object => self.model.objects[object].parent = Some(index),
                _ => {
                    let detail = format!("parent {parent:?}");
                    self.note(DefectCode::UnresolvedReference, Some(object), "parents", detail);
                }
            }
        }
        self.cut_circles();
        self.model.appearance = std::mem::take(&mut self.palette).finish();
        (self.model, self.defects)
    }

    /// Removes a parent from each circle of parents.
    fn cut_circles(&mut self) {
        // Colours: 0 unseen, 1 on the way up from the current object, 2 without a circle above.
        let mut colour = vec![0u8; self.model.objects.len()];
        for start in 0..colour.len() {
            let mut way = Vec::new();
            let mut at = Some(start);
            while let Some(object) = at.filter(|&object| colour[object] == 0) {
                colour[object] = 1;
                way.push(object);
                at = self.model.objects[object].parent;
            }
            if let (Some(object), Some(&last)) = (at.filter(|&object| colour[object] == 1), way.last()) {
                let detail = format!("the parents of {:?} lead back to it", self.model.objects[object].id);
                self.model.objects[last].parent = None;
                self.note(DefectCode::UnresolvedReference, Some(last), "parents", detail);
            }
            way.into_iter().for_each(|object| colour[object] = 2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_are_linked_and_circles_cut() {
        let mut builder = Builder::default();
        for id in ["a", "b", "c", "a"] {
            builder.object(id, ObjectKind::BUILDING);
        }
        builder.parent(0, "b");
        builder.parent(1, "c");
        builder.parent(2, "a");
        builder.parent(3, "nobody");
        let (model, defects) = builder.finish();
        assert_eq!(model.validate(), Ok(()));
        assert_eq!(model.objects.iter().filter(|o| o.parent.is_some()).count(), 2);
        let codes: Vec<_> = defects.iter().map(|d| (d.code.number(), d.object)).collect();
        assert_eq!(codes, [(1007, Some(3)), (1006, Some(3)), (1006, Some(2))]);
    }
}
