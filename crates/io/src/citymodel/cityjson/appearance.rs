//! Materials and textures of CityJSON: the lists of a document, and the nested references of a
//! geometry.
//!
//! A material is a number per surface, or one for all. A texture is a list per ring: its number,
//! then one texture coordinate per vertex of the ring. `null` stands for none. References to
//! nothing, and textures whose coordinates do not fit the ring, are counted and left out.

use std::sync::Arc;

use city::{RingTexture, SurfaceAppearance};
use serde_json::{Map, Value};

use super::schema::{Looks, Nested, Pairs, Shape, ThemeValues};
use crate::citymodel::builder::Builder;
use crate::citymodel::palette::THEMES_MAX;

/// Numbers in the model of the materials, textures and texture coordinates of a document.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    /// `None` for an element that is not an object.
    materials: Vec<Option<u32>>,
    textures: Vec<Option<u32>>,
    vertices: Vec<u32>,
}

impl Numbers {
    /// Adds the appearance of a document to the model.
    pub(super) fn register(builder: &mut Builder, looks: Looks) -> Self {
        let palette = &mut builder.palette;
        palette.set_defaults(looks.default_material, looks.default_texture);
        Self {
            materials: looks.materials.into_iter().map(|value| Some(palette.material(members(value)?))).collect(),
            textures: looks.textures.into_iter().map(|value| Some(palette.texture(members(value)?))).collect(),
            vertices: looks.vertices.into_iter().map(|vertex| palette.vertex(vertex)).collect(),
        }
    }
}

fn members(value: Value) -> Option<Map<String, Value>> {
    match value {
        Value::Object(members) => Some(members),
        _ => None,
    }
}

/// The themes of a geometry with their references.
pub(super) struct Themes<'a> {
    numbers: &'a Numbers,
    materials: Vec<(u32, &'a ThemeValues)>,
    textures: Vec<(u32, &'a ThemeValues)>,
}

impl<'a> Themes<'a> {
    /// Numbers the themes of a shape. Themes beyond the limit are counted.
    pub(super) fn of(builder: &mut Builder, shape: &'a Shape, numbers: &'a Numbers) -> Self {
        let mut numbered = |themes: &'a Option<Pairs<ThemeValues>>| {
            let all = themes.as_ref().map_or(&[][..], |themes| &themes.0);
            let first = all.iter().take(THEMES_MAX);
            let found: Vec<_> =
                first.filter_map(|(name, values)| Some((builder.palette.theme(name)?, values))).collect();
            builder.left_out("themes", all.len() - found.len());
            found
        };
        let (materials, textures) = (numbered(&shape.material), numbered(&shape.texture));
        Self { numbers, materials, textures }
    }

    /// Returns the appearance of the surface at `path` in the nested values, if it has any.
    pub(super) fn of_surface(
        &self,
        builder: &mut Builder,
        path: &[usize],
        rings: &[Vec<u32>],
    ) -> Option<Arc<SurfaceAppearance>> {
        let mut appearance = SurfaceAppearance::default();
        let mut lost = 0;
        for &(theme, values) in &self.materials {
            let value = if values.value == Nested::Null { at(&values.values, path) } else { &values.value };
            match (value, element(&self.numbers.materials, value)) {
                (Nested::Null, _) => {}
                (_, Some(&Some(material))) => appearance.set_material(theme, material),
                _ => lost += 1,
            }
        }
        for &(theme, values) in &self.textures {
            for (number, (value, ring)) in at(&values.values, path).list().iter().zip(rings).enumerate() {
                match self.texture(value.list(), ring.len()) {
                    Ok(None) => {}
                    Ok(Some(texture)) => appearance.set_texture(theme, rings.len(), number, texture),
                    Err(()) => lost += 1,
                }
            }
        }
        builder.left_out("invalid references to materials and textures", lost);
        (!appearance.is_empty()).then(|| Arc::new(appearance))
    }

    /// Returns the texture of a ring of `corners` vertices; an error when it refers to nothing.
    fn texture(&self, values: &[Nested], corners: usize) -> Result<Option<RingTexture>, ()> {
        let Some((texture, vertices)) = values.split_first().filter(|(texture, _)| **texture != Nested::Null) else {
            return Ok(None);
        };
        let Some(&Some(texture)) = element(&self.numbers.textures, texture) else { return Err(()) };
        let vertices: Option<Vec<u32>> =
            vertices.iter().map(|vertex| element(&self.numbers.vertices, vertex).copied()).collect();
        let vertices = vertices.filter(|vertices| vertices.len() == corners).ok_or(())?;
        Ok(Some(RingTexture { texture, vertices }))
    }
}

/// Returns the value at a path of nested arrays; a shorter nesting has none.
fn at<'a>(nested: &'a Nested, path: &[usize]) -> &'a Nested {
    path.iter().fold(nested, |nested, &index| nested.list().get(index).unwrap_or(&Nested::Null))
}

fn element<'a, T>(list: &'a [T], index: &Nested) -> Option<&'a T> {
    match index {
        Nested::Index(index) => list.get(usize::try_from(*index).ok()?),
        _ => None,
    }
}
