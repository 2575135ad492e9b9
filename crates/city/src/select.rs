//! Selects the geometries of a model: the objects in scope, and one level of detail for each.
//!
//! The default is the highest level up to 2.x of every object of a building. A LoD0 footprint is
//! not a shape and is only used when it is asked for. A building whose parts are more detailed than
//! itself is replaced by its parts.

use crate::{BuildingRole, CityModel, CityObject, Geometry, Lod};

/// Choice of the level of detail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LodChoice {
    /// The highest level of every object whose first number is at least 1 and at most this.
    Highest(u8),
    /// This level only; a plain 2 stands for the highest of its refinements.
    Only(Lod),
}

/// Choice of the objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Scope {
    /// Buildings, their parts and their outer installations.
    #[default]
    Buildings,
    /// Every object that has surfaces.
    Everything,
}

impl Default for LodChoice {
    fn default() -> Self {
        Self::Highest(2)
    }
}

/// Whether an object is used, and if not, why.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ObjectStatus {
    /// The object is used.
    Used {
        /// Number of its triangles.
        triangles: usize,
    },
    /// The object has no geometry of surfaces.
    NoGeometry,
    /// The object does not belong to a building, and only buildings were asked for.
    OutOfScope,
    /// The object does not have the level of detail that was asked for.
    NoSuchLod {
        /// Levels that the object has, ascending.
        available: Vec<Lod>,
    },
    /// The parts of the object show it in more detail.
    ReplacedByParts,
    /// None of the surfaces could be used; the defects say why.
    Unusable,
}

/// Level of the geometries that are used, or why none is. `Ok(None)` selects the geometries without
/// a level.
pub(crate) type Chosen = Result<Option<Lod>, ObjectStatus>;

/// Decides for each object of the model.
pub(crate) fn choose(model: &CityModel, choice: LodChoice, scope: Scope) -> Vec<Chosen> {
    let mut chosen: Vec<Chosen> = model.objects.iter().map(|object| of_object(object, choice, scope)).collect();
    let mut best_part: Vec<Option<Lod>> = vec![None; model.objects.len()];
    for (object, chosen) in model.objects.iter().zip(&chosen) {
        let (Ok(Some(lod)), BuildingRole::Part) = (chosen, object.kind.role()) else { continue };
        let mut parent = object.parent;
        for _ in 0..model.objects.len() {
            let Some(index) = parent else { break };
            if best_part[index].is_some_and(|best| best >= *lod) {
                break;
            }
            best_part[index] = Some(*lod);
            parent = model.objects[index].parent;
        }
    }
    for (chosen, part) in chosen.iter_mut().zip(best_part) {
        if matches!((&chosen, part), (Ok(own), Some(part)) if own.is_none_or(|own| own < part)) {
            *chosen = Err(ObjectStatus::ReplacedByParts);
        }
    }
    chosen
}

fn of_object(object: &CityObject, choice: LodChoice, scope: Scope) -> Chosen {
    let outside = matches!(object.kind.role(), BuildingRole::Other | BuildingRole::Interior);
    if scope == Scope::Buildings && outside {
        return Err(ObjectStatus::OutOfScope);
    }
    if object.geometries.is_empty() {
        return Err(ObjectStatus::NoGeometry);
    }
    let fits = |lod: Lod| match choice {
        LodChoice::Highest(limit) => (1..=limit).contains(&lod.major()),
        LodChoice::Only(asked) => lod.matches(asked),
    };
    let levels = || object.geometries.iter().filter_map(|geometry| geometry.lod);
    let unstated = object.geometries.iter().any(|geometry| geometry.lod.is_none());
    match levels().filter(|&lod| fits(lod)).max() {
        Some(lod) => Ok(Some(lod)),
        None if unstated && matches!(choice, LodChoice::Highest(_)) => Ok(None),
        None => {
            let mut available: Vec<Lod> = levels().collect();
            available.sort_unstable();
            available.dedup();
            Err(ObjectStatus::NoSuchLod { available })
        }
    }
}

/// Iterates over the geometries of an object at a level, with their indices.
pub(crate) fn geometries(object: &CityObject, lod: Option<Lod>) -> impl Iterator<Item = (usize, &Geometry)> {
    object.geometries.iter().enumerate().filter(move |(_, geometry)| geometry.lod == lod)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GeometryKind, ObjectKind};

    fn object(kind: ObjectKind, parent: Option<usize>, levels: &[&str]) -> CityObject {
        let mut object = CityObject::new("x", kind);
        object.parent = parent;
        let geometry = |text: &&str| Geometry::new(text.parse().ok(), GeometryKind::Solid);
        object.geometries = levels.iter().map(geometry).collect();
        object
    }

    #[track_caller]
    fn check(objects: Vec<CityObject>, choice: LodChoice, expected: &[Result<&str, ObjectStatus>]) {
        let model = CityModel { objects, ..CityModel::default() };
        let found = choose(&model, choice, Scope::Buildings);
        let text = |chosen: Chosen| chosen.map(|lod| lod.map_or("none".to_owned(), |lod| lod.to_string()));
        let found: Vec<_> = found.into_iter().map(text).collect();
        let expected: Vec<_> = expected.iter().cloned().map(|e| e.map(str::to_owned)).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn the_highest_level_up_to_two() {
        let building = |levels: &[&str]| object(ObjectKind::BUILDING, None, levels);
        let missing = |levels: &[&str]| {
            Err(ObjectStatus::NoSuchLod { available: levels.iter().map(|l| l.parse().unwrap()).collect() })
        };
        let objects = || {
            vec![
                building(&["0", "1.2", "2.2", "1.3"]),
                building(&["1", "3"]),
                building(&["0"]),
                building(&["3.1", "3"]),
                building(&[]),
                building(&["?"]),
                object(ObjectKind::new("Road"), None, &["2"]),
            ]
        };
        use ObjectStatus::{NoGeometry, OutOfScope};
        let default =
            [Ok("2.2"), Ok("1"), missing(&["0"]), missing(&["3", "3.1"]), Err(NoGeometry), Ok("none"), Err(OutOfScope)];
        check(objects(), LodChoice::default(), &default);
        let only = LodChoice::Only(Lod::new(1, None));
        let expected = [
            Ok("1.3"),
            Ok("1"),
            missing(&["0"]),
            missing(&["3", "3.1"]),
            Err(NoGeometry),
            missing(&[]),
            Err(OutOfScope),
        ];
        check(objects(), only, &expected);
        let footprint = LodChoice::Only(Lod::new(0, None));
        assert_eq!(
            choose(&CityModel { objects: objects(), ..CityModel::default() }, footprint, Scope::Everything)[2],
            Ok(Some(Lod::new(0, None)))
        );
    }

    #[test]
    fn parts_replace_a_coarser_building() {
        let part = |parent, levels: &[&str]| object(ObjectKind::BUILDING_PART, Some(parent), levels);
        let building = |levels: &[&str]| object(ObjectKind::BUILDING, None, levels);
        let replaced = Err(ObjectStatus::ReplacedByParts);
        check(
            vec![building(&["1"]), part(0, &["2.2"]), part(0, &["1.2"])],
            LodChoice::default(),
            &[replaced.clone(), Ok("2.2"), Ok("1.2")],
        );
        check(vec![building(&["2"]), part(0, &["2"])], LodChoice::default(), &[Ok("2"), Ok("2")]);
        check(
            vec![building(&["1"]), part(0, &[]), part(1, &["2"])],
            LodChoice::default(),
            &[replaced, Err(ObjectStatus::NoGeometry), Ok("2")],
        );
        let chimney = object(ObjectKind::BUILDING_INSTALLATION, Some(0), &["2.2"]);
        check(vec![building(&["2"]), chimney], LodChoice::default(), &[Ok("2"), Ok("2.2")]);
    }
}
