//! Collects the materials, textures, texture coordinates and themes of a file. Equal ones get one
//! number, because each line of a sequence and each object of CityGML repeats them.

use std::collections::HashMap;

use city::Appearance;
use serde_json::{Map, Value};

/// Limit of the themes of a file. Every surface may have an entry for each; real files have one or
/// two.
pub(super) const THEMES_MAX: usize = 64;

/// The appearance of a model under construction.
#[derive(Debug, Default)]
pub(super) struct Palette {
    appearance: Appearance,
    material_of: HashMap<String, u32>,
    texture_of: HashMap<String, u32>,
    vertex_of: HashMap<[u64; 2], u32>,
}

impl Palette {
    /// Returns the number of a theme, or `None` when there are too many.
    pub(super) fn theme(&mut self, name: &str) -> Option<u32> {
        let themes = &mut self.appearance.themes;
        let known = themes.iter().position(|theme| theme == name);
        if known.is_none() && themes.len() < THEMES_MAX {
            themes.push(name.to_owned());
        }
        known.or_else(|| themes.iter().position(|theme| theme == name)).map(|theme| theme as u32)
    }

    /// Returns the number of a material.
    pub(super) fn material(&mut self, members: Map<String, Value>) -> u32 {
        number(&mut self.material_of, &mut self.appearance.materials, members)
    }

    /// Returns the number of a texture.
    pub(super) fn texture(&mut self, members: Map<String, Value>) -> u32 {
        number(&mut self.texture_of, &mut self.appearance.textures, members)
    }

    /// Returns the number of a texture coordinate.
    pub(super) fn vertex(&mut self, vertex: [f64; 2]) -> u32 {
        let vertices = &mut self.appearance.vertices;
        *self.vertex_of.entry(vertex.map(|c| (c + 0.0).to_bits())).or_insert_with(|| {
            vertices.push(vertex);
            (vertices.len() - 1) as u32
        })
    }

    /// Names the themes that a viewer shows first, unless they are named already.
    pub(super) fn set_defaults(&mut self, material: Option<String>, texture: Option<String>) {
        let Appearance { default_material_theme, default_texture_theme, .. } = &mut self.appearance;
        *default_material_theme = default_material_theme.take().or(material);
        *default_texture_theme = default_texture_theme.take().or(texture);
    }

    pub(super) fn finish(self) -> Appearance {
        self.appearance
    }
}

/// Returns the number of `members` in `list`, and adds them if they are new.
fn number(known: &mut HashMap<String, u32>, list: &mut Vec<Map<String, Value>>, members: Map<String, Value>) -> u32 {
    let key = serde_json::to_string(&members).unwrap_or_default();
    *known.entry(key).or_insert_with(|| {
        list.push(members);
        (list.len() - 1) as u32
    })
}
