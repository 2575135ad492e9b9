//! The members of a CityJSON document that are read. Other members are skipped.

use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use serde_json::value::RawValue;
use serde_json::{Map, Value};

use serde::de::{Deserialize, DeserializeOwned, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Name of [`Document::vertical`] in the file.
pub(super) const VERTICAL: &str = "+verticalReferenceSystem";

/// A document (`CityJSON`) or a line of a sequence (`CityJSONFeature`).
#[derive(Debug, serde::Deserialize)]
pub(super) struct Document {
    #[serde(rename = "type")]
    pub(super) kind: Option<String>,
    pub(super) version: Option<String>,
    pub(super) transform: Option<Transform>,
    pub(super) metadata: Option<Metadata>,
    /// The vertical system of a pair that has no code of its own, as we write it.
    #[serde(rename = "+verticalReferenceSystem")]
    pub(super) vertical: Option<String>,
    #[serde(rename = "CityObjects")]
    pub(super) objects: Option<Pairs<Object>>,
    #[serde(default)]
    pub(super) vertices: Vec<[f64; 3]>,
    #[serde(rename = "geometry-templates")]
    pub(super) templates: Option<Templates>,
    #[serde(default)]
    pub(super) appearance: Lenient<Looks>,
}

/// The materials and textures of a document.
#[derive(Debug, Default, serde::Deserialize)]
pub(super) struct Looks {
    #[serde(default)]
    pub(super) materials: Lenient<Vec<Lenient<Map<String, Value>>>>,
    #[serde(default)]
    pub(super) textures: Lenient<Vec<Lenient<Map<String, Value>>>>,
    #[serde(default, rename = "vertices-texture")]
    pub(super) vertices: Lenient<Vec<Lenient<[f64; 2]>>>,
    #[serde(default, rename = "default-theme-material")]
    pub(super) default_material: Lenient<String>,
    #[serde(default, rename = "default-theme-texture")]
    pub(super) default_texture: Lenient<String>,
}

#[derive(Debug, Clone, Copy, serde::Deserialize)]
pub(super) struct Transform {
    pub(super) scale: [f64; 3],
    pub(super) translate: [f64; 3],
}

#[derive(Debug, serde::Deserialize)]
pub(super) struct Metadata {
    #[serde(rename = "referenceSystem")]
    pub(super) reference_system: Option<String>,
}

#[derive(Debug, serde::Deserialize)]
pub(super) struct Object {
    #[serde(rename = "type")]
    pub(super) kind: Option<String>,
    pub(super) parents: Option<Vec<String>>,
    #[serde(default)]
    pub(super) attributes: Lenient<Map<String, Value>>,
    /// A list since version 1.1, one address before.
    pub(super) address: Option<Value>,
    pub(super) geometry: Option<Vec<Shape>>,
}

/// A geometry, or an instance of a template.
#[derive(Debug, serde::Deserialize)]
pub(super) struct Shape {
    #[serde(rename = "type")]
    pub(super) kind: Option<String>,
    pub(super) lod: Option<LodText>,
    #[serde(default)]
    pub(super) boundaries: Nested,
    pub(super) semantics: Option<Semantics>,
    pub(super) template: Option<u64>,
    /// Materials by theme.
    #[serde(default)]
    pub(super) material: Lenient<Pairs<Lenient<ThemeValues>>>,
    /// Textures by theme.
    #[serde(default)]
    pub(super) texture: Lenient<Pairs<Lenient<ThemeValues>>>,
    #[serde(rename = "transformationMatrix")]
    pub(super) matrix: Option<Vec<f64>>,
}

/// Materials or textures of a geometry in a theme.
#[derive(Debug, serde::Deserialize)]
pub(super) struct ThemeValues {
    /// Material of all surfaces.
    #[serde(default)]
    pub(super) value: Nested,
    /// One material per surface, or one texture with its coordinates per ring.
    #[serde(default)]
    pub(super) values: Nested,
}

#[derive(Debug, serde::Deserialize)]
pub(super) struct Semantics {
    #[serde(default)]
    pub(super) surfaces: Vec<SemanticSurface>,
    #[serde(default)]
    pub(super) values: Nested,
}

#[derive(Debug, serde::Deserialize)]
pub(super) struct SemanticSurface {
    #[serde(rename = "type")]
    pub(super) kind: Option<String>,
    /// Relations to other surfaces, by their numbers in this list.
    #[serde(default)]
    pub(super) parent: Option<IgnoredAny>,
    #[serde(default)]
    pub(super) children: Option<IgnoredAny>,
    /// Attributes of the surface, shared by all that refer to it.
    #[serde(flatten, deserialize_with = "shared")]
    pub(super) attributes: Arc<Map<String, Value>>,
}

fn shared<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<Map<String, Value>>, D::Error> {
    Map::deserialize(deserializer).map(Arc::new)
}

#[derive(Debug, serde::Deserialize)]
pub(super) struct Templates {
    #[serde(default)]
    pub(super) templates: Vec<Shape>,
    #[serde(default, rename = "vertices-templates")]
    pub(super) vertices: Vec<[f64; 3]>,
}

/// Level of detail: text since version 1.1, a number before.
#[derive(Debug, serde::Deserialize)]
#[serde(untagged)]
pub(super) enum LodText {
    Text(String),
    Number(f64),
}

impl fmt::Display for LodText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Number(number) => write!(f, "{number}"),
        }
    }
}

/// A member that the geometry does not need. A value of the wrong type costs only itself.
#[derive(Debug, Default)]
pub(super) enum Lenient<T> {
    /// `null`, or a missing member.
    #[default]
    Missing,
    Good(T),
    /// A value of the wrong type.
    Malformed,
}

impl<T> Lenient<T> {
    /// Returns the value, and adds one to `malformed` for a value of the wrong type.
    pub(super) fn counted(self, malformed: &mut usize) -> Option<T> {
        *malformed += usize::from(matches!(self, Self::Malformed));
        match self {
            Self::Good(value) => Some(value),
            Self::Missing | Self::Malformed => None,
        }
    }

    pub(super) fn as_ref(&self) -> Lenient<&T> {
        match self {
            Self::Missing => Lenient::Missing,
            Self::Good(value) => Lenient::Good(value),
            Self::Malformed => Lenient::Malformed,
        }
    }
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for Lenient<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let raw = Box::<RawValue>::deserialize(deserializer)?;
        Ok(serde_json::from_str::<Option<T>>(raw.get())
            .map_or(Self::Malformed, |value| value.map_or(Self::Missing, Self::Good)))
    }
}

/// The members of a JSON object in the order of the file, including repeated names.
#[derive(Debug)]
pub(super) struct Pairs<T>(pub(super) Vec<(String, T)>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Pairs<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Members<T> {
            type Value = Pairs<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }
        deserializer.deserialize_map(Members(PhantomData))
    }
}

/// Indices in nested arrays of any depth.
#[derive(Debug, Default, PartialEq)]
pub(super) enum Nested {
    /// `null`, or a missing member.
    #[default]
    Null,
    /// An index.
    Index(u64),
    /// Something else: a number that is negative or not whole, text, an object.
    Other,
    /// An array.
    List(Vec<Nested>),
}

impl Nested {
    /// Returns the elements of an array, and nothing for other values.
    pub(super) fn list(&self) -> &[Nested] {
        match self {
            Self::List(list) => list,
            _ => &[],
        }
    }
}

impl<'de> Deserialize<'de> for Nested {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NestedVisitor)
    }
}

struct NestedVisitor;

impl<'de> Visitor<'de> for NestedVisitor {
    type Value = Nested;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an index or an array")
    }

    fn visit_u64<E>(self, index: u64) -> Result<Nested, E> {
        Ok(Nested::Index(index))
    }

    fn visit_i64<E>(self, _: i64) -> Result<Nested, E> {
        Ok(Nested::Other)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Nested, E> {
        Ok(Nested::Other)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Nested, E> {
        Ok(Nested::Other)
    }

    fn visit_str<E>(self, _: &str) -> Result<Nested, E> {
        Ok(Nested::Other)
    }

    fn visit_unit<E>(self) -> Result<Nested, E> {
        Ok(Nested::Null)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Nested, A::Error> {
        while map.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Nested::Other)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Nested, A::Error> {
        let mut list = Vec::new();
        while let Some(element) = seq.next_element()? {
            list.push(element);
        }
        Ok(Nested::List(list))
    }
}
