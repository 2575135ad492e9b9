//! Appearance of a model: materials, textures, and what each surface shows in each theme.
//!
//! Materials and textures are kept as CityJSON writes them. A surface refers to them by number.
//! Texture coordinates belong to the vertices of a ring, in the order of the ring, so whatever
//! reorders or drops vertices of a ring must do the same here.

use serde_json::{Map, Value};

/// Materials, textures and texture coordinates of a model, and the names of its themes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Appearance {
    /// Materials with their members of CityJSON, such as `diffuseColor`.
    pub materials: Vec<Map<String, Value>>,
    /// Textures with their members of CityJSON. `image` is a path relative to the model's file, an
    /// absolute path or an address.
    pub textures: Vec<Map<String, Value>>,
    /// Texture coordinates of all rings; (0, 0) is the lower left corner of the image.
    pub vertices: Vec<[f64; 2]>,
    /// Names of the themes.
    pub themes: Vec<String>,
    /// Theme of the materials that a viewer shows first.
    pub default_material_theme: Option<String>,
    /// Theme of the textures that a viewer shows first.
    pub default_texture_theme: Option<String>,
}

/// Materials and textures of a surface.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SurfaceAppearance {
    /// Materials, at most one per theme.
    pub materials: Vec<SurfaceMaterial>,
    /// Textures, at most one per theme.
    pub textures: Vec<SurfaceTexture>,
}

/// Material of a surface in a theme.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceMaterial {
    /// Index in [`Appearance::themes`].
    pub theme: u32,
    /// Index in [`Appearance::materials`].
    pub material: u32,
}

/// Textures of the rings of a surface in a theme.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SurfaceTexture {
    /// Index in [`Appearance::themes`].
    pub theme: u32,
    /// One entry per ring of the surface; `None` for a ring without a texture.
    pub rings: Vec<Option<RingTexture>>,
}

/// Texture of a ring.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RingTexture {
    /// Index in [`Appearance::textures`].
    pub texture: u32,
    /// Indices in [`Appearance::vertices`], one per vertex of the ring.
    pub vertices: Vec<u32>,
}

impl Appearance {
    /// Returns whether there is neither a material nor a texture.
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty() && self.textures.is_empty()
    }
}

impl SurfaceAppearance {
    /// Returns whether the surface has neither a material nor a texture.
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty() && self.textures.is_empty()
    }

    /// Returns the material in a theme.
    pub fn material(&self, theme: u32) -> Option<u32> {
        self.materials.iter().find(|found| found.theme == theme).map(|found| found.material)
    }

    /// Returns the textures of the rings in a theme.
    pub fn texture(&self, theme: u32) -> Option<&SurfaceTexture> {
        self.textures.iter().find(|found| found.theme == theme)
    }

    /// Sets the material in a theme, unless it has one.
    pub fn set_material(&mut self, theme: u32, material: u32) {
        if self.material(theme).is_none() {
            self.materials.push(SurfaceMaterial { theme, material });
        }
    }

    /// Sets the texture of a ring in a theme, unless it has one. `rings` is the number of rings of
    /// the surface, and `ring` is less than it.
    pub fn set_texture(&mut self, theme: u32, rings: usize, ring: usize, texture: RingTexture) {
        let at = self.textures.iter().position(|found| found.theme == theme).unwrap_or_else(|| {
            self.textures.push(SurfaceTexture { theme, rings: vec![None; rings] });
            self.textures.len() - 1
        });
        self.textures[at].rings[ring].get_or_insert(texture);
    }

    /// Returns the appearance of the surface with every ring in the opposite order.
    pub fn reversed(&self) -> Self {
        let mut reversed = self.clone();
        let rings = reversed.textures.iter_mut().flat_map(|texture| &mut texture.rings).flatten();
        rings.for_each(|ring| ring.vertices.reverse());
        reversed
    }

    /// Returns whether the textures fit rings with these numbers of vertices, and all numbers are
    /// within `appearance`.
    pub fn fits(&self, appearance: &Appearance, rings: &[Vec<u32>]) -> bool {
        let below = |index: u32, count: usize| (index as usize) < count;
        let themes = appearance.themes.len();
        let materials =
            |found: &SurfaceMaterial| below(found.theme, themes) && below(found.material, appearance.materials.len());
        let ring = |(found, ring): (&Option<RingTexture>, &Vec<u32>)| {
            found.as_ref().is_none_or(|found| {
                found.vertices.len() == ring.len()
                    && below(found.texture, appearance.textures.len())
                    && found.vertices.iter().all(|&vertex| below(vertex, appearance.vertices.len()))
            })
        };
        let textures = |found: &SurfaceTexture| {
            below(found.theme, themes) && found.rings.len() == rings.len() && found.rings.iter().zip(rings).all(ring)
        };
        self.materials.iter().all(materials) && self.textures.iter().all(textures)
    }
}
