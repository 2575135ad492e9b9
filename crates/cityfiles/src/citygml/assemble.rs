//! Assembles the geometries after the walk: follows links, assigns classes, and drops surfaces that
//! a solid repeats.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use city::{DefectCode, Geometry, GeometryKind, Lod, ModelPoint, SurfaceClass, SurfacePolygon};

use super::appearance::Appearances;
use super::boundary::SurfaceAttributes;
use super::implicit::Implicit;
use super::links::{Group, Links, Named, Resolved};
use super::paint::{Polygon, Rings, paint};
use crate::builder::Builder;
use crate::error::CityFault;
use crate::placement::{Expansion, Instances};

/// What the walk over a document found.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) groups: Vec<Group>,
    pub(super) polygons: Vec<Polygon>,
    pub(super) named: HashMap<String, Named>,
    pub(super) rings: Rings,
    pub(super) appearances: Appearances,
    pub(super) surfaces: SurfaceAttributes,
}

/// Adds the geometries of all groups to their objects.
pub(super) fn assemble(builder: &mut Builder, found: Found) -> Result<(), CityFault> {
    let Found { groups, mut polygons, named, rings, appearances, surfaces } = found;
    let groups = &groups[..];
    let mut links = Links::new(groups, &named);
    paint(builder, &mut polygons, &appearances, &rings, &mut links)?;
    let resolved = resolve(builder, groups, &mut polygons, &mut links, &surfaces)?;
    let usable = polygons.iter_mut().filter(|polygon| !polygon.rings.is_empty());
    surfaces.give(builder, usable.map(|polygon| (polygon.boundary, &mut polygon.attributes)));
    let in_solids: HashSet<(usize, Lod, usize)> = groups
        .iter()
        .zip(&resolved)
        .filter(|(group, _)| group.kind.is_solid() && group.implicit.is_none())
        .flat_map(|(group, found)| found.iter().map(|member| (group.object, group.lod, member.polygon)))
        .collect();
    let mut boundaries: BTreeMap<(usize, Lod), Geometry> = BTreeMap::new();
    let mut instances = Instances::default();
    for (group, found) in groups.iter().zip(&resolved) {
        if let Some(implicit) = &group.implicit {
            add_instance(builder, &mut instances, group, implicit, found, &polygons)?;
            continue;
        }
        let surface = |member: &Resolved| surface(&polygons[member.polygon], member);
        if group.kind.is_solid() {
            let mut geometry = Geometry::new(Some(group.lod), group.kind);
            geometry.surfaces = found.iter().filter_map(surface).collect();
            add(builder, group.object, geometry);
            continue;
        }
        let alone = found.iter().filter(|member| !in_solids.contains(&(group.object, group.lod, member.polygon)));
        let surfaces: Vec<SurfacePolygon> = alone.filter_map(surface).collect();
        if group.in_boundary {
            let all = boundaries.entry((group.object, group.lod));
            let all = all.or_insert_with(|| Geometry::new(Some(group.lod), GeometryKind::MultiSurface));
            all.surfaces.extend(surfaces);
        } else {
            let mut geometry = Geometry::new(Some(group.lod), group.kind);
            geometry.surfaces = surfaces;
            add(builder, group.object, geometry);
        }
    }
    for ((object, _), geometry) in boundaries {
        add(builder, object, geometry);
    }
    Ok(())
}

/// Follows the links of all groups, and gives unclassified polygons the boundary surface of their
/// members.
fn resolve<'a>(
    builder: &mut Builder,
    groups: &'a [Group],
    polygons: &mut [Polygon],
    links: &mut Links<'a>,
    surfaces: &SurfaceAttributes,
) -> Result<Vec<Vec<Resolved>>, CityFault> {
    let sizes: Vec<usize> =
        polygons.iter().map(|polygon| polygon.size().saturating_add(surfaces.size(polygon.boundary))).collect();
    // A polygon that its own element uses and that a solid links to is in the model twice.
    let own = sizes.iter().sum::<usize>().saturating_mul(4);
    let mut expansion = Expansion::default();
    let mut resolved: Vec<Vec<Resolved>> = Vec::with_capacity(groups.len());
    for group in groups {
        let mut found = Vec::with_capacity(group.members.len());
        for member in &group.members {
            if let Err(link) = links.follow(member, 0, &mut found)? {
                let detail = format!("xlink {:?}", link.chars().take(80).collect::<String>());
                builder.dropped(DefectCode::UnresolvedReference, group.object, format!("line {}", member.line), detail);
            }
        }
        let size = found.iter().map(|member| match polygons[member.polygon].boundary.class {
            SurfaceClass::Unclassified => sizes[member.polygon].saturating_add(surfaces.size(member.boundary)),
            _ => sizes[member.polygon],
        });
        let size = size.fold(0, usize::saturating_add);
        expansion.add(size, own, &format!("line {}", group.line))?;
        // A boundary surface also classifies a polygon that belongs to a solid and that it only
        // links to.
        for member in &found {
            let polygon = &mut polygons[member.polygon];
            if polygon.boundary.class == SurfaceClass::Unclassified {
                polygon.boundary = member.boundary;
            }
        }
        resolved.push(found);
    }
    Ok(resolved)
}

/// Adds an instance of an implicit geometry. Its surfaces get their own vertices.
fn add_instance(
    builder: &mut Builder,
    instances: &mut Instances,
    group: &Group,
    implicit: &Implicit,
    found: &[Resolved],
    polygons: &[Polygon],
) -> Result<(), CityFault> {
    let place = format!("line {}", group.line);
    let placement = match implicit.placement() {
        Ok(placement) => placement,
        Err((code, detail)) => {
            builder.dropped(code, group.object, place, detail);
            return Ok(());
        }
    };
    let rings = found.iter().flat_map(|member| &polygons[member.polygon].rings);
    let mut used: Vec<u32> = rings.flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let own: Vec<(u64, [f64; 3])> =
        used.iter().map(|&v| (u64::from(v), builder.position(v).from_origin(ModelPoint::default()))).collect();
    let index_of = instances.place(builder, &placement, own.into_iter(), &place)?;
    let mut geometry = Geometry::new(Some(group.lod), group.kind);
    for mut surface in found.iter().filter_map(|member| surface(&polygons[member.polygon], member)) {
        let placed = surface.rings.iter_mut().flatten();
        placed.for_each(|vertex| *vertex = index_of.get(&u64::from(*vertex)).copied().unwrap_or(*vertex));
        if surface.rings.iter().flatten().all(|&vertex| builder.is_usable(vertex)) {
            geometry.surfaces.push(surface);
        } else {
            builder.dropped(DefectCode::CoordinateOutOfRange, group.object, place.clone(), "an implicit geometry");
        }
    }
    add(builder, group.object, geometry);
    Ok(())
}

/// Adds a geometry to its object, unless it has no surfaces.
fn add(builder: &mut Builder, object: usize, geometry: Geometry) {
    if !geometry.surfaces.is_empty() {
        builder.object_mut(object).geometries.push(geometry);
    }
}

/// Returns the surface of a member, or `None` for a polygon that cannot be used, which has been
/// reported.
fn surface(polygon: &Polygon, member: &Resolved) -> Option<SurfacePolygon> {
    let mut rings = polygon.rings.clone();
    if member.turned {
        rings.iter_mut().for_each(|ring| ring.reverse());
    }
    let appearance = polygon.appearance.as_ref();
    let appearance = appearance.map(|found| if member.turned { Arc::new(found.reversed()) } else { found.clone() });
    (!rings.is_empty()).then_some(SurfacePolygon {
        rings,
        class: polygon.boundary.class,
        solid: member.solid,
        shell: member.shell,
        attributes: polygon.attributes.clone(),
        appearance,
    })
}
