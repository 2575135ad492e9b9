//! Links between the surfaces of a document (`xlink:href`), within limits: links to sets of links
//! multiply.

use std::collections::HashMap;

use city::{GeometryKind, Lod};

use super::boundary::Boundary;
use super::implicit::Implicit;
use crate::error::CityFault;

/// Limit of the depth of links that lead to links.
const LINK_DEPTH_MAX: usize = 4;
/// Limit of the surfaces and links that are followed in a file. Links to sets multiply.
const FOLLOWED_MAX: usize = 10_000_000;

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
    pub(super) boundary: Boundary,
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
pub(super) struct Resolved {
    pub(super) polygon: usize,
    pub(super) solid: u32,
    pub(super) shell: u32,
    pub(super) turned: bool,
    pub(super) boundary: Boundary,
}

/// Follows links, and counts them.
pub(super) struct Links<'a> {
    groups: &'a [Group],
    named: &'a HashMap<String, Named>,
    followed: usize,
}

impl<'a> Links<'a> {
    /// Follows the links of a file.
    pub(super) fn new(groups: &'a [Group], named: &'a HashMap<String, Named>) -> Self {
        Self { groups, named, followed: 0 }
    }

    /// Returns the polygons behind a link from outside the geometries; none when it leads nowhere.
    pub(super) fn polygons_behind(&mut self, link: &str) -> Result<Vec<usize>, CityFault> {
        let mut found = Vec::new();
        match self.named.get(link.strip_prefix('#').unwrap_or(link)) {
            Some(&Named::Polygon(polygon)) => return Ok(vec![polygon]),
            Some(&Named::Members { group, first, last }) => {
                for below in &self.groups[group].members[first..last] {
                    // What leads nowhere is reported with the geometry.
                    let _lost = self.follow(below, 1, &mut found)?;
                }
            }
            None => {}
        }
        Ok(found.into_iter().map(|member| member.polygon).collect())
    }

    /// Follows a member to its polygons. The inner error is a link that leads nowhere.
    pub(super) fn follow(
        &mut self,
        member: &'a Member,
        depth: usize,
        found: &mut Vec<Resolved>,
    ) -> Result<Result<(), &'a str>, CityFault> {
        let Member { solid, shell, turned, boundary, .. } = *member;
        self.followed += 1;
        if self.followed > FOLLOWED_MAX {
            let what = format!(
                "the file has more than {FOLLOWED_MAX} surfaces and links to surfaces, counting those behind links"
            );
            return Err(CityFault::unsupported(what, format!("line {}", member.line)));
        }
        let link = match &member.target {
            Target::Polygon(polygon) => {
                found.push(Resolved { polygon: *polygon, solid, shell, turned, boundary });
                return Ok(Ok(()));
            }
            Target::Link(link) => link.as_str(),
        };
        let target = link.strip_prefix('#').and_then(|id| self.named.get(id));
        match target {
            Some(&Named::Polygon(polygon)) => {
                found.push(Resolved { polygon, solid, shell, turned, boundary });
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
                    *below = Resolved { solid, shell, turned: below.turned ^ turned, boundary, ..*below };
                }
                Ok(Ok(()))
            }
            _ => Ok(Err(link)),
        }
    }
}
