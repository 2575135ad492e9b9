//! Materials and textures of CityJSON: the lists of a document, and the nested references of a
//! geometry.
//!
//! A material is a number per surface, or one for all. A texture is a list per ring: its number,
//! then one texture coordinate per vertex of the ring. `null` stands for none. References to
//! nothing, and textures whose coordinates do not fit the ring, are counted and left out.

use std::sync::Arc;

use city::{RingTexture, SurfaceAppearance};

use super::schema::{Lenient, Looks, Nested, Pairs, Shape, ThemeValues};
use crate::builder::Builder;
use crate::palette::THEMES_MAX;

/// What the count of appearances of the wrong type is called.
const MALFORMED: &str = "malformed materials and textures";

/// Numbers in the model of the materials, textures and texture coordinates of a document.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    /// `None` for an element of the wrong type.
    materials: Vec<Option<u32>>,
    textures: Vec<Option<u32>>,
    vertices: Vec<Option<u32>>,
}

impl Numbers {
    /// Adds the appearance of a document to the model, and counts what has the wrong type.
    pub(super) fn register(builder: &mut Builder, looks: Lenient<Looks>) -> Self {
        let mut malformed = 0;
        let looks = looks.counted(&mut malformed).unwrap_or_default();
        let palette = &mut builder.palette;
        let default_material = looks.default_material.counted(&mut malformed);
        palette.set_defaults(default_material, looks.default_texture.counted(&mut malformed));
        let numbers = Self {
            materials: numbered(looks.materials, &mut malformed, |material| palette.material(material)),
            textures: numbered(looks.textures, &mut malformed, |texture| palette.texture(texture)),
            vertices: numbered(looks.vertices, &mut malformed, |vertex| palette.vertex(vertex)),
        };
        builder.left_out(MALFORMED, malformed);
        numbers
    }
}

/// Numbers the elements of a list; `None` stands for an element of the wrong type, which is
/// counted.
fn numbered<T>(
    list: Lenient<Vec<Lenient<T>>>,
    malformed: &mut usize,
    mut number: impl FnMut(T) -> u32,
) -> Vec<Option<u32>> {
    let list = list.counted(malformed).unwrap_or_default();
    list.into_iter().map(|element| element.counted(malformed).map(&mut number)).collect()
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
        let mut malformed = 0;
        let mut numbered = |themes: &'a Lenient<Pairs<Lenient<ThemeValues>>>| {
            let all = themes.as_ref().counted(&mut malformed).map_or(&[][..], |themes| &themes.0);
            let all: Vec<(&String, &ThemeValues)> = all
                .iter()
                .filter_map(|(name, values)| Some((name, values.as_ref().counted(&mut malformed)?)))
                .collect();
            let first = all.iter().take(THEMES_MAX);
            let found: Vec<_> =
                first.filter_map(|&(name, values)| Some((builder.palette.theme(name)?, values))).collect();
            builder.left_out("themes", all.len() - found.len());
            found
        };
        let (materials, textures) = (numbered(&shape.material), numbered(&shape.texture));
        builder.left_out(MALFORMED, malformed);
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
            vertices.iter().map(|vertex| element(&self.numbers.vertices, vertex).copied().flatten()).collect();
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
