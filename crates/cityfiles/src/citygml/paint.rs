//! Gives the polygons of a document their materials and textures.
//!
//! Texture coordinates belong to the ring that they name, one per vertex in the order of the file.
//! The coordinate of the vertex that closes the ring goes with that vertex.

use std::collections::HashMap;
use std::sync::Arc;

use city::{RingTexture, SurfaceAppearance};

use super::appearance::{Appearances, RingCoordinates, SurfaceData};
use super::boundary::{Boundary, SharedAttributes};
use super::links::Links;
use crate::builder::Builder;
use crate::error::CityFault;
use crate::placement::surface_size;

/// Polygon and number of the ring for the identifier of each ring.
pub(super) type Rings = HashMap<String, (usize, usize)>;

/// A polygon. It has no rings when it cannot be used.
#[derive(Debug)]
pub(super) struct Polygon {
    pub(super) rings: Vec<Vec<u32>>,
    /// Boundary surface that it belongs to.
    pub(super) boundary: Boundary,
    /// Attributes of that surface.
    pub(super) attributes: Option<SharedAttributes>,
    pub(super) appearance: Option<Arc<SurfaceAppearance>>,
}

impl Polygon {
    /// Returns the size of a surface of the polygon.
    pub(super) fn size(&self) -> usize {
        let textures = || self.appearance.iter().flat_map(|found| &found.textures).flat_map(|texture| &texture.rings);
        let corners: usize = self.rings.iter().map(Vec::len).sum();
        let painted: usize = textures().flatten().map(|ring| ring.vertices.len()).sum();
        surface_size(self.rings.len() + textures().count(), corners + painted)
    }

    /// Returns the appearance to be changed. Nothing shares it before the geometries are made.
    fn appearance(&mut self) -> &mut SurfaceAppearance {
        Arc::make_mut(self.appearance.get_or_insert_default())
    }
}

/// Gives the polygons their materials and textures, and counts what cannot be given.
pub(super) fn paint(
    builder: &mut Builder,
    polygons: &mut [Polygon],
    appearances: &Appearances,
    rings: &Rings,
    links: &mut Links<'_>,
) -> Result<(), CityFault> {
    let (mut lost_materials, mut lost_textures) = (0, 0);
    for (theme, data) in appearances.uses() {
        match data {
            SurfaceData::Material { material, targets } => {
                for target in targets {
                    let found = links.polygons_behind(target)?;
                    lost_materials += usize::from(found.is_empty());
                    found.into_iter().for_each(|polygon| polygons[polygon].appearance().set_material(theme, *material));
                }
            }
            SurfaceData::Texture { texture, rings: painted } => {
                for coordinates in painted {
                    let is_given = give_texture(polygons, rings, theme, *texture, coordinates);
                    lost_textures += usize::from(!is_given);
                }
            }
        }
    }
    builder.left_out("materials of surfaces that are not there", lost_materials);
    builder.left_out("texture coordinates that fit no ring", lost_textures);
    appearances.left_out().into_iter().for_each(|(what, count)| builder.left_out(what, count));
    Ok(())
}

/// Gives a ring its texture, and returns whether there is such a ring with as many vertices.
fn give_texture(
    polygons: &mut [Polygon],
    rings: &Rings,
    theme: u32,
    texture: u32,
    coordinates: &RingCoordinates,
) -> bool {
    let name = coordinates.ring.strip_prefix('#').unwrap_or(&coordinates.ring);
    let Some(&(polygon, ring)) = rings.get(name) else { return false };
    let polygon = &mut polygons[polygon];
    let (count, corners) = (polygon.rings.len(), polygon.rings[ring].len());
    let given = coordinates.vertices.len();
    if given != corners && given != corners + 1 {
        return false;
    }
    let vertices = coordinates.vertices[..corners].to_vec();
    polygon.appearance().set_texture(theme, count, ring, RingTexture { texture, vertices });
    true
}
