//! Assembles the geometries after the walk: follows links, assigns classes, and drops surfaces that
//! a solid repeats.

use std::collections::{BTreeMap, HashMap, HashSet};

use city::{DefectCode, Geometry, GeometryKind, Lod, ModelPoint, SurfaceClass, SurfacePolygon};

use super::implicit::Implicit;
use crate::citymodel::builder::Builder;
use crate::citymodel::error::CityFault;
use crate::citymodel::placement::{Expansion, Instances, surface_size};

/// Limit of the depth of links that lead to links.
const LINK_DEPTH_MAX: usize = 4;
/// Limit of the links that are followed in a file. Links to sets of links multiply.
const LINKED_MAX: usize = 10_000_000;

/// A polygon. It has no rings when it cannot be used.
#[derive(Debug)]
pub(super) struct Polygon {
    pub(super) rings: Vec<Vec<u32>>,
    pub(super) class: SurfaceClass,
}

/// The geometry of a property of an object.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) object: usize,
    pub(super) lod: Lod,
    pub(super) kind: GeometryKind,
    /// Whether it belongs to a boundary surface.
    pub(super) in_boundary: bool,
    pub(super) members: Vec<Member>,
    /// Placement of its surfaces, when they have their own coordinates.
    pub(super) implicit: Option<Implicit>,
    /// Line of the property in the file.
    pub(super) line: usize,
}

/// A surface of a geometry.
#[derive(Debug, Clone)]
pub(super) struct Member {
    pub(super) target: Target,
    pub(super) solid: u32,
    pub(super) shell: u32,
    pub(super) turned: bool,
    pub(super) class: SurfaceClass,
    pub(super) line: usize,
}

/// The polygon of a member.
#[derive(Debug, Clone)]
pub(super) enum Target {
    /// Index of a polygon.
    Polygon(usize),
    /// The value of a `xlink:href`.
    Link(String),
}

/// The element with an identifier.
#[derive(Debug)]
pub(super) enum Named {
    /// Index of a polygon.
    Polygon(usize),
    /// A range of the members of a group.
    Members { group: usize, first: usize, last: usize },
}

/// A member after its links have been followed.
#[derive(Debug, Clone, Copy)]
struct Resolved {
    polygon: usize,
    solid: u32,
    shell: u32,
    turned: bool,
    class: SurfaceClass,
}

/// Adds the geometries of all groups to their objects.
pub(super) fn assemble(
    builder: &mut Builder,
    groups: &[Group],
    mut polygons: Vec<Polygon>,
    named: &HashMap<String, Named>,
) -> Result<(), CityFault> {
    let resolved = resolve(builder, groups, &mut polygons, named)?;
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

/// Follows the links of all groups, and gives unclassified polygons the class of their members.
fn resolve(
    builder: &mut Builder,
    groups: &[Group],
    polygons: &mut [Polygon],
    named: &HashMap<String, Named>,
) -> Result<Vec<Vec<Resolved>>, CityFault> {
    let sizes: Vec<usize> =
        polygons.iter().map(|p| surface_size(p.rings.len(), p.rings.iter().map(Vec::len).sum())).collect();
    // A polygon that its own element uses and that a solid links to is in the model twice.
    let own = sizes.iter().sum::<usize>().saturating_mul(4);
    let mut expansion = Expansion::default();
    let mut links = Links { groups, named, followed: 0 };
    let mut resolved: Vec<Vec<Resolved>> = Vec::with_capacity(groups.len());
    for group in groups {
        let mut found = Vec::with_capacity(group.members.len());
        for member in &group.members {
            if let Err(link) = links.follow(member, 0, &mut found)? {
                let detail = format!("xlink {:?}", link.chars().take(80).collect::<String>());
                builder.dropped(DefectCode::UnresolvedReference, group.object, format!("line {}", member.line), detail);
            }
        }
        let size = found.iter().map(|member| sizes[member.polygon]).fold(0, usize::saturating_add);
        expansion.add(size, own, &format!("line {}", group.line))?;
        // A boundary surface also classifies a polygon that belongs to a solid and that it only
        // links to.
        for member in &found {
            let polygon = &mut polygons[member.polygon];
            if polygon.class == SurfaceClass::Unclassified {
                polygon.class = member.class;
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
    (!rings.is_empty()).then_some(SurfacePolygon {
        rings,
        class: polygon.class,
        solid: member.solid,
        shell: member.shell,
        attributes: None,
    })
}

/// Follows links, and counts them.
struct Links<'a> {
    groups: &'a [Group],
    named: &'a HashMap<String, Named>,
    followed: usize,
}

impl<'a> Links<'a> {
    /// Follows a member to its polygons. The inner error is a link that leads nowhere.
    fn follow(
        &mut self,
        member: &'a Member,
        depth: usize,
        found: &mut Vec<Resolved>,
    ) -> Result<Result<(), &'a str>, CityFault> {
        let Member { solid, shell, turned, class, .. } = *member;
        let link = match &member.target {
            Target::Polygon(polygon) => {
                found.push(Resolved { polygon: *polygon, solid, shell, turned, class });
                return Ok(Ok(()));
            }
            Target::Link(link) => link.as_str(),
        };
        self.followed += 1;
        if self.followed > LINKED_MAX {
            let what = format!("the file has more than {LINKED_MAX} links to surfaces, counting links behind links");
            return Err(CityFault::unsupported(what, format!("line {}", member.line)));
        }
        let target = link.strip_prefix('#').and_then(|id| self.named.get(id));
        match target {
            Some(&Named::Polygon(polygon)) => {
                found.push(Resolved { polygon, solid, shell, turned, class });
                Ok(Ok(()))
            }
            Some(&Named::Members { group, first, last }) if depth < LINK_DEPTH_MAX => {
                let start = found.len();
                for below in &self.groups[group].members[first..last] {
                    if let Err(lost) = self.follow(below, depth + 1, found)? {
                        return Ok(Err(lost));
                    }
                }
                for below in &mut found[start..] {
                    *below = Resolved { solid, shell, turned: below.turned ^ turned, class, ..*below };
                }
                Ok(Ok(()))
            }
            _ => Ok(Err(link)),
        }
    }
}
