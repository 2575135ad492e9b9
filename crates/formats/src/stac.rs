//! STAC items (SpatioTemporal Asset Catalog) in the place of images: which file is the image, which
//! has the RPC, and what the item says about the view.
//!
//! Local files are read. Paths in an item are relative to it. What the image itself says goes
//! before what the item says.

use std::path::{Path, PathBuf};

use chrono::DateTime;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Largest item, bytes. Items have a few kilobytes.
const BYTES_MAX: u64 = 16 << 20;
/// Beginnings of the media types of images that GDAL reads.
const IMAGE_TYPES: [&str; 6] =
    ["image/tiff", "image/geotiff", "image/vnd.stac.geotiff", "image/jp2", "image/nitf", "application/vnd.nitf"];
/// Extensions of images, for assets without a media type.
const IMAGE_EXTENSIONS: [&str; 7] = ["tif", "tiff", "ntf", "nitf", "nsf", "jp2", "vrt"];
/// Roles of pictures that only look like the image.
const PICTURE_ROLES: [&str; 3] = ["thumbnail", "overview", "metadata"];

/// Longest name of a satellite, characters. Longer texts are none.
const NAME_MAX: usize = 40;

/// Where the sun stood.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SunPosition {
    /// Clockwise from north, degrees.
    pub azimuth_deg: f64,
    /// Above the horizon, degrees.
    pub elevation_deg: f64,
}

impl SunPosition {
    /// Angle between two positions, degrees.
    pub fn angle_deg(&self, other: &Self) -> f64 {
        let direction = |sun: &Self| {
            let (azimuth, elevation) = (sun.azimuth_deg.to_radians(), sun.elevation_deg.to_radians());
            [azimuth.sin() * elevation.cos(), azimuth.cos() * elevation.cos(), elevation.sin()]
        };
        let (a, b) = (direction(self), direction(other));
        let cosine: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        cosine.clamp(-1.0, 1.0).acos().to_degrees()
    }
}

/// What an item says about an image.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StacItem {
    /// The image.
    pub image: PathBuf,
    /// File with its RPC, where the item names one.
    pub rpc: Option<PathBuf>,
    /// When the image was taken, seconds of UTC since 1970.
    pub acquired_s: Option<i64>,
    /// Name of the satellite (`platform`).
    pub satellite: Option<String>,
    /// Where the sun stood.
    pub sun: Option<SunPosition>,
    /// Angle of the line of sight to the vertical on the ground, degrees.
    pub incidence_deg: Option<f64>,
}

/// An item that does not lead to an image. The text does not name the item.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StacError {
    /// The file cannot be read.
    #[error("cannot read the file: {0}")]
    Unreadable(std::io::Error),
    /// The file is no item.
    #[error("{found}, expected a STAC item (a GeoJSON feature with stac_version and assets) that names an image")]
    NotAnItem {
        /// What the file is.
        found: String,
    },
    /// No asset is an image, or several are.
    #[error("{found} (the assets are {assets}): give the image itself, or mark it with the role `data`")]
    NoImage {
        /// Which images there are.
        found: String,
        /// Names and media types of all assets.
        assets: String,
    },
    /// An asset lies elsewhere than in a file.
    #[error(
        "the asset `{asset}` lies at {href}: copy it beside the item and name the copy, since local files are read"
    )]
    NotLocal {
        /// Name of the asset.
        asset: String,
        /// Where it lies.
        href: String,
    },
    /// The file of an asset does not exist.
    #[error("the asset `{asset}` is not there, expected the file {}", path.display())]
    Missing {
        /// Name of the asset.
        asset: String,
        /// The file.
        path: PathBuf,
    },
    /// A property has a value that cannot be.
    #[error("{property} is {found}, expected {expected}")]
    Property {
        /// Name of the property.
        property: &'static str,
        /// Its value.
        found: String,
        /// Values that can be.
        expected: &'static str,
    },
}

/// Returns whether a name is that of an item: it ends in `.json` or `.geojson`.
pub(crate) fn is_item_name(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json") || e.eq_ignore_ascii_case("geojson"))
}

/// Reads an item.
///
/// # Errors
/// [`StacError`] for a file that cannot be read, that is no item, or whose item leads to no image.
pub(crate) fn read_item(path: &Path) -> Result<StacItem, StacError> {
    let bytes = read_limited(path)?;
    let value: Value = serde_json::from_slice(&bytes)
        .map_err(|error| StacError::NotAnItem { found: format!("not valid JSON ({error})") })?;
    let not_an_item = |found: &str| StacError::NotAnItem { found: found.to_owned() };
    match value["type"].as_str() {
        Some("Feature") => {}
        Some("Collection" | "Catalog") => return Err(not_an_item("a STAC collection or catalogue")),
        Some("FeatureCollection") => return Err(not_an_item("several features")),
        _ => return Err(not_an_item("JSON of another kind")),
    }
    if !value["stac_version"].is_string() {
        return Err(not_an_item("a GeoJSON feature without stac_version"));
    }
    let Some(assets) = value["assets"].as_object() else { return Err(not_an_item("a feature without assets")) };
    let folder = path.parent().unwrap_or(Path::new(""));
    let image = file_of(image_asset(assets)?, folder)?;
    let rpc = rpc_asset(assets).map(|asset| file_of(asset, folder)).transpose()?;
    let properties = &value["properties"];
    let sun = match [angle(properties, SUN_AZIMUTH)?, angle(properties, SUN_ELEVATION)?] {
        [Some(azimuth_deg), Some(elevation_deg)] => Some(SunPosition { azimuth_deg, elevation_deg }),
        _ => None,
    };
    let incidence_deg = angle(properties, INCIDENCE)?;
    let satellite = properties["platform"].as_str().and_then(satellite_name);
    Ok(StacItem { image, rpc, acquired_s: time(properties)?, satellite, sun, incidence_deg })
}

fn read_limited(path: &Path) -> Result<Vec<u8>, StacError> {
    let found = std::fs::metadata(path).map_err(StacError::Unreadable)?;
    if !found.is_file() || found.len() > BYTES_MAX {
        let found = if found.is_file() { format!("{} bytes", found.len()) } else { "no file".to_owned() };
        return Err(StacError::NotAnItem { found });
    }
    std::fs::read(path).map_err(StacError::Unreadable)
}

/// An asset with its name.
type Asset<'a> = (&'a str, &'a Value);

/// Returns the image: of several, the one of role `data`; of several of these, the panchromatic
/// one.
fn image_asset(assets: &Map<String, Value>) -> Result<Asset<'_>, StacError> {
    let has_role = |asset: &Value, wanted: &[&str]| {
        let roles = asset["roles"].as_array().map(Vec::as_slice).unwrap_or_default();
        roles.iter().filter_map(Value::as_str).any(|role| wanted.contains(&role))
    };
    let images: Vec<Asset<'_>> = assets
        .iter()
        .map(|(name, asset)| (name.as_str(), asset))
        .filter(|(_, asset)| is_image(asset) && !has_role(asset, &PICTURE_ROLES))
        .collect();
    let of_role: Vec<Asset<'_>> = images.iter().copied().filter(|(_, asset)| has_role(asset, &["data"])).collect();
    let candidates = if of_role.is_empty() { images } else { of_role };
    let panchromatic: Vec<Asset<'_>> = candidates.iter().copied().filter(|asset| is_panchromatic(*asset)).collect();
    match (&candidates[..], &panchromatic[..]) {
        ([only], _) | (_, [only]) => Ok(*only),
        (candidates, _) => {
            let names: Vec<String> = candidates.iter().map(|(name, _)| format!("`{name}`")).collect();
            let found = match &names[..] {
                [] => "no asset is an image".to_owned(),
                names => format!("several assets may be the image: {}", names.join(", ")),
            };
            let described =
                |(name, asset): (&String, &Value)| format!("{name}: {}", asset["type"].as_str().unwrap_or("no type"));
            let assets = assets.iter().map(described).collect::<Vec<_>>().join("; ");
            Err(StacError::NoImage { found, assets: if assets.is_empty() { "none".to_owned() } else { assets } })
        }
    }
}

fn is_image(asset: &Value) -> bool {
    match asset["type"].as_str() {
        Some(media) => IMAGE_TYPES.iter().any(|image| media.to_ascii_lowercase().starts_with(image)),
        None => IMAGE_EXTENSIONS.iter().any(|extension| {
            let name = asset["href"].as_str().unwrap_or_default().to_ascii_lowercase();
            name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'))
        }),
    }
}

/// Whether an asset's name or one of its bands is panchromatic (`pan`).
fn is_panchromatic((name, asset): Asset<'_>) -> bool {
    let is_pan = |text: &str| {
        let lower = text.to_ascii_lowercase();
        lower.split(|c: char| !c.is_alphanumeric()).any(|word| word == "pan" || word == "panchromatic")
    };
    let bands = ["bands", "eo:bands"].iter().filter_map(|key| asset[*key].as_array()).flatten();
    let names = bands.flat_map(|band| ["name", "common_name", "eo:common_name"].map(|key| band[key].as_str()));
    is_pan(name) || names.flatten().any(is_pan)
}

/// Returns the asset with the RPC: its name or its file is one of an RPC.
fn rpc_asset(assets: &Map<String, Value>) -> Option<Asset<'_>> {
    let is_rpc = |(name, asset): &Asset<'_>| {
        let href = asset["href"].as_str().unwrap_or_default().to_ascii_lowercase();
        let file = href.rsplit('/').next().unwrap_or_default();
        let by_name = name.to_ascii_lowercase().split(|c: char| !c.is_alphanumeric()).any(|word| word == "rpc");
        let by_file = file.ends_with("_rpc.txt") || file.ends_with(".rpb") || file.starts_with("rpc_");
        (by_name || by_file) && !is_image(asset)
    };
    assets.iter().map(|(name, asset)| (name.as_str(), asset)).find(is_rpc)
}

/// Returns the local file of an asset.
fn file_of((name, asset): Asset<'_>, folder: &Path) -> Result<PathBuf, StacError> {
    let href = asset["href"].as_str().unwrap_or_default();
    let local = match href.split_once("://") {
        Some((scheme, rest)) if scheme.eq_ignore_ascii_case("file") => rest.trim_start_matches("localhost"),
        Some(_) => return Err(StacError::NotLocal { asset: name.to_owned(), href: href.to_owned() }),
        None if href.starts_with("/vsi") => {
            return Err(StacError::NotLocal { asset: name.to_owned(), href: href.to_owned() });
        }
        None => href,
    };
    let path = folder.join(local);
    // Spaces and umlauts are written as they are, or as addresses have them.
    let path = if path.is_file() { path } else { folder.join(percent_decoded(local)) };
    if local.is_empty() || is_item_name(&path) && is_image(asset) || !path.is_file() {
        return Err(StacError::Missing { asset: name.to_owned(), path: folder.join(local) });
    }
    Ok(path)
}

/// Replaces `%20` and the like; text that is no such code stays.
fn percent_decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = (first == b'%').then(|| after.get(..2)).flatten();
        let value = code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        bytes.push(value.unwrap_or(first));
        rest = if value.is_some() { &after[2..] } else { after };
    }
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

/// A property that is an angle: its name, its least and greatest value, and these in words.
type AngleProperty = (&'static str, [f64; 2], &'static str);

const SUN_AZIMUTH: AngleProperty = ("view:sun_azimuth", [0.0, 360.0], "an angle from 0 to 360 degrees");
const SUN_ELEVATION: AngleProperty = ("view:sun_elevation", [-90.0, 90.0], "an angle from -90 to 90 degrees");
const INCIDENCE: AngleProperty = ("view:incidence_angle", [0.0, 90.0], "an angle from 0 to 90 degrees");

fn angle(properties: &Value, (property, [least, most], expected): AngleProperty) -> Result<Option<f64>, StacError> {
    match &properties[property] {
        Value::Null => Ok(None),
        found => match found.as_f64() {
            Some(value) if (least..=most).contains(&value) => Ok(Some(value)),
            _ => Err(StacError::Property { property, found: found.to_string(), expected }),
        },
    }
}

/// Returns the time of the item: `datetime`, or the beginning of its time.
fn time(properties: &Value) -> Result<Option<i64>, StacError> {
    let named = ["datetime", "start_datetime"].into_iter().find(|name| !properties[*name].is_null());
    let Some(property) = named else { return Ok(None) };
    let found = &properties[property];
    let parsed = found.as_str().and_then(|text| DateTime::parse_from_rfc3339(text).ok());
    let expected = "a time such as 2024-05-01T10:15:00Z";
    parsed.map(|time| Some(time.timestamp())).ok_or(StacError::Property {
        property,
        found: found.to_string(),
        expected,
    })
}

/// Returns a name without the quotes and spaces around it; `None` for none and for what is no name.
pub(crate) fn satellite_name(text: &str) -> Option<String> {
    let name = text.trim().trim_matches(['"', '\'']).trim();
    let is_name = !name.is_empty() && name.chars().count() <= NAME_MAX && !name.chars().any(char::is_control);
    is_name.then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Writes an item with `assets` and `properties` into a folder that has `images`.
    fn item(assets: Value, properties: Value) -> Result<StacItem, StacError> {
        let folder = tempfile::tempdir().unwrap();
        for name in ["pan.tif", "a b.tif", "colour.tif", "pan_RPC.TXT"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let path = folder.path().join("item.json");
        let text = json!({ "type": "Feature", "stac_version": "1.1.0", "assets": assets, "properties": properties });
        std::fs::write(&path, text.to_string()).unwrap();
        read_item(&path)
    }

    fn name(item: &StacItem) -> String {
        item.image.file_name().unwrap().to_string_lossy().into_owned()
    }

    #[test]
    fn the_image_is_found_with_its_rpc_and_its_view() {
        let assets = json!({
            "preview": { "href": "./colour.tif", "type": "image/tiff", "roles": ["thumbnail"] },
            "ms": { "href": "./colour.tif", "type": "image/tiff; application=geotiff", "roles": ["data"] },
            "image": { "href": "./pan.tif", "type": "image/tiff; application=geotiff", "roles": ["data"],
                       "eo:bands": [{ "name": "PAN" }] },
            "rpc": { "href": "pan_RPC.TXT", "type": "text/plain", "roles": ["metadata"] },
        });
        let properties = json!({ "datetime": "2024-05-01T10:15:00Z", "view:sun_azimuth": 150.5,
                                 "view:sun_elevation": 48, "view:incidence_angle": 12.5, "platform": "PNEO3" });
        let found = item(assets, properties).unwrap();
        assert_eq!((name(&found), found.acquired_s), ("pan.tif".to_owned(), Some(1_714_558_500)));
        assert_eq!(found.sun, Some(SunPosition { azimuth_deg: 150.5, elevation_deg: 48.0 }));
        assert!(found.rpc.unwrap().ends_with("pan_RPC.TXT"));
        assert_eq!((found.incidence_deg, found.satellite.as_deref()), (Some(12.5), Some("PNEO3")));
    }

    #[test]
    fn a_satellite_has_a_plain_name() {
        assert_eq!(satellite_name(" \"WV03\" "), Some("WV03".to_owned()));
        let long = "x".repeat(NAME_MAX + 1);
        assert_eq!(["", "  ", "a\nb", long.as_str()].map(satellite_name), [const { None }; 4]);
    }

    #[test]
    fn names_may_be_those_of_addresses() {
        let found = item(json!({ "a": { "href": "a%20b.tif" } }), json!({ "datetime": null })).unwrap();
        assert_eq!((name(&found), found.acquired_s), ("a b.tif".to_owned(), None));
        let found = item(json!({ "a": { "href": "a b.tif", "type": "image/tiff" } }), Value::Null).unwrap();
        assert_eq!(name(&found), "a b.tif");
    }

    #[test]
    fn what_cannot_be_is_named() {
        let text = |assets, properties| item(assets, properties).unwrap_err().to_string();
        let one = || json!({ "a": { "href": "pan.tif" } });
        assert!(text(json!({}), Value::Null).starts_with("no asset is an image (the assets are none)"));
        let two = json!({ "a": { "href": "pan.tif" }, "b": { "href": "colour.tif" } });
        assert!(text(two, Value::Null).starts_with("several assets may be the image: `a`, `b`"));
        let far = json!({ "a": { "href": "https://example.com/pan.tif" } });
        assert!(text(far, Value::Null).contains("lies at https://example.com/pan.tif: copy it"));
        assert!(text(json!({ "a": { "href": "/vsicurl/x.tif" } }), Value::Null).contains("copy it"));
        assert!(text(json!({ "a": { "href": "gone.tif" } }), Value::Null).contains("is not there"));
        assert!(text(json!({ "a": { "href": "item.json", "type": "image/tiff" } }), Value::Null).contains("not there"));
        assert!(text(json!({ "a": { "href": 7, "type": "image/tiff" } }), Value::Null).contains("not there"));
        assert!(text(one(), json!({ "datetime": "yesterday" })).starts_with("datetime is \"yesterday\""));
        assert!(text(one(), json!({ "view:sun_elevation": 140 })).contains("is 140, expected an angle from -90"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.json");
        for (content, found) in [
            ("{", "not valid JSON"),
            ("[]", "JSON of another kind"),
            ("{\"type\":\"Collection\"}", "a STAC collection"),
            ("{\"type\":\"Feature\"}", "a GeoJSON feature without stac_version"),
            ("{\"type\":\"Feature\",\"stac_version\":\"1.0.0\"}", "a feature without assets"),
        ] {
            std::fs::write(&path, content).unwrap();
            let error = read_item(&path).unwrap_err().to_string();
            assert!(error.starts_with(found), "{error}");
        }
    }

    #[test]
    fn the_sun_moves_by_angles_on_the_sky() {
        let sun = |azimuth_deg, elevation_deg| SunPosition { azimuth_deg, elevation_deg };
        assert!((sun(0.0, 0.0).angle_deg(&sun(90.0, 0.0)) - 90.0).abs() < 1e-9);
        assert!(sun(10.0, 90.0).angle_deg(&sun(200.0, 90.0)) < 1e-6, "the azimuth of the zenith is none");
        assert!((sun(359.0, 0.0).angle_deg(&sun(1.0, 0.0)) - 2.0).abs() < 1e-9);
    }
}
