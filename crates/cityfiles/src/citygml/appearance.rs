//! The appearance module of CityGML: materials, and textures with their coordinates.
//!
//! Surface data names its targets by identifier: a material those of surfaces, a texture those of
//! rings. The identifiers may follow later in the file, so they are resolved after the walk. What
//! CityJSON cannot hold (georeferenced textures, projections, back sides, images other than PNG and
//! JPEG) is counted.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value, json};

use super::attributes::Attributes;
use crate::palette::Palette;

/// Name of the theme of an appearance that names none.
const UNNAMED_THEME: &str = "unnamed";
/// Largest text of an element other than texture coordinates, bytes.
const TEXT_MAX: usize = 1 << 16;

/// Everything that the appearances of a file say.
#[derive(Debug, Default)]
pub(super) struct Appearances {
    data: Vec<SurfaceData>,
    /// Numbers of the surface data with an identifier.
    named: BTreeMap<String, usize>,
    /// Uses of surface data in themes: the number of the theme, and of the data or a link to it.
    uses: Vec<(u32, Use)>,
    /// What is not carried, by its kind with its number.
    left_out: BTreeMap<&'static str, usize>,
}

/// A material or a texture.
#[derive(Debug)]
pub(super) enum SurfaceData {
    /// Number of a material, and the links to the surfaces that have it.
    Material { material: u32, targets: Vec<String> },
    /// Number of a texture, and the rings that show it.
    Texture { texture: u32, rings: Vec<RingCoordinates> },
}

/// Texture coordinates of a ring.
#[derive(Debug)]
pub(super) struct RingCoordinates {
    /// Link to the ring.
    pub(super) ring: String,
    /// Numbers of the coordinates, one per vertex, also of the one that closes the ring.
    pub(super) vertices: Vec<u32>,
}

#[derive(Debug)]
enum Use {
    Data(usize),
    Link(String),
}

/// An appearance that the walk is in.
#[derive(Debug, Default)]
pub(super) struct OpenAppearance {
    names: Vec<String>,
    text: String,
    theme: Option<String>,
    uses: Vec<Use>,
    data: Option<OpenData>,
}

/// Surface data that the walk is in.
#[derive(Debug, Default)]
struct OpenData {
    kind: String,
    id: Option<String>,
    /// Texts of its properties by their names.
    properties: BTreeMap<String, String>,
    targets: Vec<String>,
    rings: Vec<RingCoordinates>,
    /// Texture coordinates and links to rings of the open list, in the order of the file.
    list: (Vec<Vec<u32>>, Vec<String>),
    is_back: bool,
    projections: usize,
    broken: usize,
}

impl Appearances {
    /// Returns each surface data with the themes it is used in. A repeated use changes nothing and
    /// is left out.
    pub(super) fn uses(&self) -> impl Iterator<Item = (u32, &SurfaceData)> {
        let mut seen = BTreeSet::new();
        let found = self.uses.iter().filter_map(|(theme, used)| Some((*theme, self.number(used)?)));
        found.filter(move |used| seen.insert(*used)).map(|(theme, number)| (theme, &self.data[number]))
    }

    /// Returns the number of the surface data that is used.
    fn number(&self, used: &Use) -> Option<usize> {
        match used {
            Use::Data(number) => Some(*number),
            Use::Link(link) => self.named.get(link.strip_prefix('#')?).copied(),
        }
    }

    /// Returns what is not carried, with the links to surface data that lead nowhere.
    pub(super) fn left_out(&self) -> BTreeMap<&'static str, usize> {
        let mut all = self.left_out.clone();
        let lost = self.uses.iter().filter(|(_, used)| self.number(used).is_none()).count();
        all.extend((lost > 0).then_some(("links to materials and textures that are not there", lost)));
        all
    }

    fn count(&mut self, what: &'static str, count: usize) {
        if count > 0 {
            *self.left_out.entry(what).or_insert(0) += count;
        }
    }
}

impl OpenAppearance {
    /// Begins an element.
    pub(super) fn start(&mut self, name: &str, attributes: &Attributes) {
        self.text.clear();
        match &mut self.data {
            None => {
                if name.starts_with("surfaceData") {
                    self.uses.extend(attributes.get("href").map(|link| Use::Link(link.to_owned())));
                } else if self.names.last().is_some_and(|above| above.starts_with("surfaceData")) {
                    let id = attributes.get("id").map(str::to_owned);
                    self.data = Some(OpenData { kind: name.to_owned(), id, ..OpenData::default() });
                }
            }
            Some(data) => data.start(name, attributes),
        }
        self.names.push(name.to_owned());
    }

    /// Adds text to the open element.
    pub(super) fn text(&mut self, text: &str) {
        let is_long = self.names.last().is_some_and(|name| name == "textureCoordinates");
        if is_long || self.text.len() + text.len() <= TEXT_MAX {
            self.text.push_str(text);
        }
    }

    /// Ends the open element, and returns whether it was the appearance itself, which is then added
    /// to `all`.
    pub(super) fn end(&mut self, all: &mut Appearances, palette: &mut Palette) -> bool {
        let text = std::mem::take(&mut self.text);
        let Some(name) = self.names.pop() else {
            self.finish(all, palette);
            return true;
        };
        let is_data = self.names.last().is_some_and(|above| above.starts_with("surfaceData"));
        match &mut self.data {
            Some(data) if !is_data => {
                let is_property = self.names.last() == Some(&data.kind);
                data.end(&name, text.trim(), is_property, palette);
            }
            Some(_) => {
                let added = self.data.take().and_then(|data| data.finish(all, palette));
                self.uses.extend(added.map(Use::Data));
            }
            None if name == "theme" && !text.trim().is_empty() => self.theme = Some(text.trim().to_owned()),
            None => {}
        }
        false
    }

    fn finish(&mut self, all: &mut Appearances, palette: &mut Palette) {
        match palette.theme(self.theme.as_deref().unwrap_or(UNNAMED_THEME)) {
            Some(theme) => all.uses.extend(self.uses.drain(..).map(|used| (theme, used))),
            None => all.count("themes", 1),
        }
    }
}

impl OpenData {
    fn start(&mut self, name: &str, attributes: &Attributes) {
        self.broken += usize::from(attributes.get("href").is_some());
        match name {
            "textureCoordinates" => self.list.1.extend(attributes.get("ring").map(str::to_owned)),
            "TexCoordGen" => self.projections += 1,
            _ => {}
        }
    }

    fn end(&mut self, name: &str, text: &str, is_property: bool, palette: &mut Palette) {
        match name {
            "target" if self.kind == "X3DMaterial" => self.targets.push(text.to_owned()),
            // An invalid list fits no ring, and is counted there.
            "textureCoordinates" => self.list.0.push(coordinates(text, palette).unwrap_or_default()),
            "ring" => self.list.1.push(text.to_owned()),
            "TexCoordList" => {
                let (lists, rings) = std::mem::take(&mut self.list);
                // Lists without a ring of their own would put the others out of step.
                if lists.len() != rings.len() {
                    self.broken += lists.len();
                    return;
                }
                let pairs = lists.into_iter().zip(rings);
                self.rings.extend(pairs.map(|(vertices, ring)| RingCoordinates { ring, vertices }));
            }
            "isFront" => self.is_back = ["false", "0"].contains(&text),
            _ if is_property => drop(self.properties.insert(name.to_owned(), text.to_owned())),
            _ => {}
        }
    }

    /// Adds the surface data to `all` and returns its number; counts it where it cannot be carried.
    fn finish(self, all: &mut Appearances, palette: &mut Palette) -> Option<usize> {
        all.count("textures by projection", self.projections);
        all.count("texture coordinates that name no ring", self.broken);
        let kind = match self.kind.as_str() {
            "X3DMaterial" | "ParameterizedTexture" if self.is_back => Err("materials and textures of back sides"),
            "X3DMaterial" => {
                Ok(SurfaceData::Material { material: palette.material(self.material()), targets: self.targets })
            }
            "ParameterizedTexture" => match self.texture() {
                Some(members) => Ok(SurfaceData::Texture { texture: palette.texture(members), rings: self.rings }),
                None => Err("textures whose image is neither PNG nor JPEG"),
            },
            "GeoreferencedTexture" => Err("georeferenced textures"),
            _ => Err("appearances of other kinds"),
        };
        match kind {
            Ok(data) => {
                let number = all.data.len();
                all.data.push(data);
                if let Some(id) = self.id {
                    all.named.entry(id).or_insert(number);
                }
                Some(number)
            }
            Err(what) => {
                all.count(what, 1);
                None
            }
        }
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.properties.get(name).map(String::as_str).filter(|text| !text.is_empty())
    }

    /// Returns the members of a material in CityJSON, which requires a name.
    fn material(&self) -> Map<String, Value> {
        let mut members = Map::new();
        let name = self.get("name").or(self.id.as_deref()).unwrap_or("unnamed");
        members.insert("name".to_owned(), json!(name));
        for key in ["ambientIntensity", "shininess", "transparency"] {
            let number = self.get(key).and_then(numbers::<1>).map(|[number]| json!(number));
            members.extend(number.map(|number| (key.to_owned(), number)));
        }
        for key in ["diffuseColor", "emissiveColor", "specularColor"] {
            let colour = self.get(key).and_then(numbers::<3>).map(|colour| json!(colour));
            members.extend(colour.map(|colour| (key.to_owned(), colour)));
        }
        let smooth = self.get("isSmooth").map(|text| json!(["true", "1"].contains(&text)));
        members.extend(smooth.map(|smooth| ("isSmooth".to_owned(), smooth)));
        members
    }

    /// Returns the members of a texture in CityJSON, which knows two kinds of images.
    fn texture(&self) -> Option<Map<String, Value>> {
        let image = self.get("imageURI")?;
        let ending = image.rsplit('.').next().unwrap_or_default();
        let kind = self.get("mimeType").unwrap_or(ending).to_ascii_lowercase();
        let kind = match kind.rsplit('/').next().unwrap_or_default() {
            "png" | "x-png" => "PNG",
            "jpg" | "jpeg" | "pjpeg" => "JPG",
            _ => return None,
        };
        let mut members = Map::from_iter([("type".to_owned(), json!(kind)), ("image".to_owned(), json!(image))]);
        let words = [
            ("wrapMode", &["none", "wrap", "mirror", "clamp", "border"][..]),
            ("textureType", &["unknown", "specific", "typical"]),
        ];
        for (key, known) in words {
            let word = self.get(key).filter(|word| known.contains(word));
            members.extend(word.map(|word| (key.to_owned(), json!(word))));
        }
        // The colour of the border may have an opacity.
        let border = self
            .get("borderColor")
            .and_then(|text| numbers::<4>(text).map(Vec::from).or_else(|| numbers::<3>(text).map(Vec::from)));
        members.extend(border.map(|border| ("borderColor".to_owned(), json!(border))));
        Some(members)
    }
}

/// Returns exactly `N` finite numbers of a text.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text.split_whitespace().take(N + 1).map(finite).collect();
    numbers?.try_into().ok()
}

fn finite(word: &str) -> Option<f64> {
    word.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Returns the numbers of texture coordinates; `None` when the text is not pairs of numbers.
fn coordinates(text: &str, palette: &mut Palette) -> Option<Vec<u32>> {
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(finite).collect();
    let numbers = numbers?;
    let (pairs, rest) = numbers.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|&pair| palette.vertex(pair)).collect())
}
