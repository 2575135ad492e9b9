//! Binary glTF with `KHR_gaussian_splatting` (ratified by Khronos): splats as points whose
//! attributes are float numbers.
//!
//! Scales are in metres and opacities between 0 and 1, both as they are drawn. The node turns east,
//! north and up to the axes of glTF (x, −z, y), the attributes keep those of the local origin. A
//! file of another program is read in the frame of its points; nodes that do anything else to them
//! are refused.

use gaussian::{Splat, SplatHarmonics};
use serde_json::{Map, Value, json};

use super::numbers::coefficient;
use crate::gltf::{Glb, GlbBuffers};
use crate::splat_ply::{SH_C0, SH_DEGREE_MAX, SplatFile, SplatForm, SplatLayout};

const EXTENSION: &str = "KHR_gaussian_splatting";
/// Quaternion (x, y, z, w) from east, north and up to the axes of glTF: a quarter turn.
const TURN: [f64; 4] = [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];

/// Returns the bytes of a file.
pub(super) fn encode(file: &SplatFile) -> Result<Vec<u8>, String> {
    let splats = &file.splats;
    if splats.is_empty() {
        return Err("there are no splats, and glTF has no empty lists".to_owned());
    }
    let mut buffers = GlbBuffers::default();
    let positions: Vec<[f32; 3]> = splats.iter().map(|s| s.position).collect();
    let mut attributes = Map::new();
    attributes.insert("POSITION".to_owned(), buffers.positions(&positions).into());
    // Viewers that do not know splats show points of these colours.
    let byte = |c: f32| (255.0 * c.clamp(0.0, 1.0)).round() as u8;
    let colours = splats.iter().flat_map(|s| [s.colour[0], s.colour[1], s.colour[2], s.opacity].map(byte));
    attributes.insert("COLOR_0".to_owned(), buffers.byte_colours(colours.collect()).into());
    let mut put = |name: &str, kind: &'static str, numbers: Vec<f32>| {
        let place = buffers.numbers(kind, splats.len(), &numbers);
        attributes.insert(format!("{EXTENSION}:{name}"), place.into());
    };
    let turned = |s: &Splat| [s.rotation[1], s.rotation[2], s.rotation[3], s.rotation[0]];
    put("ROTATION", "VEC4", splats.iter().flat_map(turned).collect());
    put("SCALE", "VEC3", splats.iter().flat_map(|s| s.scale_m).collect());
    put("OPACITY", "SCALAR", splats.iter().map(|s| s.opacity).collect());
    let constant = |s: &Splat| s.colour.map(|c| ((f64::from(c) - 0.5) / SH_C0) as f32);
    put("SH_DEGREE_0_COEF_0", "VEC3", splats.iter().flat_map(constant).collect());
    for (degree, number, place) in coefficients(file.layout.sh_degree) {
        let of = |splat: usize| [0, 1, 2].map(|channel| coefficient(file, splat, channel, place));
        put(&format!("SH_DEGREE_{degree}_COEF_{number}"), "VEC3", (0..splats.len()).flat_map(of).collect());
    }
    let document = json!({
        "asset": { "version": "2.0", "generator": "skysweep" },
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "rotation": TURN }],
        "meshes": [{ "primitives": [{
            "attributes": attributes,
            "mode": 0,
            "extensions": { EXTENSION: { "kernel": "ellipse", "colorSpace": "srgb_rec709_display" } },
        }] }],
    });
    let mut out = Vec::new();
    Glb::new(document, buffers)?.write(&mut out).map_err(|error| error.to_string())?;
    Ok(out)
}

/// Returns the coefficients beyond the constant one: degree, number in the degree, place in all.
fn coefficients(degree: u8) -> impl Iterator<Item = (u8, usize, usize)> {
    (1..=degree).flat_map(|degree| {
        let (before, count) = (SplatHarmonics::count(degree - 1), 2 * usize::from(degree) + 1);
        (0..count).map(move |number| (degree, number, before + number))
    })
}

/// Reads the splats of a file.
pub(super) fn decode(bytes: &[u8]) -> Result<SplatFile, String> {
    let (document, binary) = chunks(bytes)?;
    let list = |value: &Value, key: &str| value[key].as_array().cloned().unwrap_or_default();
    let primitives = list(&document, "meshes").iter().flat_map(|mesh| list(mesh, "primitives")).collect::<Vec<_>>();
    let found: Vec<&Value> = primitives.iter().filter(|p| p["extensions"][EXTENSION].is_object()).collect();
    let [primitive] = found[..] else {
        return Err(format!("found {} sets of splats ({EXTENSION}), expected one", found.len()));
    };
    if let Some(kernel) = primitive["extensions"][EXTENSION]["kernel"].as_str().filter(|k| *k != "ellipse") {
        return Err(format!("the kernel of the splats is {kernel:?}, expected \"ellipse\""));
    }
    if primitive["extensions"][EXTENSION]["extensions"].is_object() {
        return Err("the splats are packed by another extension, expected plain attributes".to_owned());
    }
    list(&document, "nodes").iter().try_for_each(plain)?;
    let reader = Reader { document: &document, binary };
    let of = |name: &str, width: usize| {
        let place = primitive["attributes"][name].as_u64();
        let place = place.ok_or_else(|| format!("the splats have no attribute {name}"))?;
        reader.numbers(name, place as usize, width)
    };
    let own = |name: &str, width: usize| of(&format!("{EXTENSION}:{name}"), width);
    let (positions, rotations) = (of("POSITION", 3)?, own("ROTATION", 4)?);
    let (scales, opacities) = (own("SCALE", 3)?, own("OPACITY", 1)?);
    let constants = own("SH_DEGREE_0_COEF_0", 3)?;
    let count = opacities.len();
    let has = |degree: u8| primitive["attributes"][format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_0")].is_u64();
    let sh_degree = (1..=SH_DEGREE_MAX).take_while(|degree| has(*degree)).last().unwrap_or(0);
    let higher = coefficients(sh_degree)
        .map(|(degree, number, _)| own(&format!("SH_DEGREE_{degree}_COEF_{number}"), 3))
        .collect::<Result<Vec<_>, String>>()?;
    let lengths = [positions.len() / 3, rotations.len() / 4, scales.len() / 3, constants.len() / 3];
    let all = lengths.into_iter().chain(higher.iter().map(|h| h.len() / 3));
    if let Some(other) = all.into_iter().find(|length| *length != count) {
        return Err(format!("an attribute has {other} splats, another one {count}"));
    }
    let splat = |i: usize| {
        let q: [f32; 4] = std::array::from_fn(|k| rotations[4 * i + k]);
        let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
        let [x, y, z, w] = q.map(|c| c / length);
        Splat {
            position: [0, 1, 2].map(|axis| positions[3 * i + axis]),
            scale_m: [0, 1, 2].map(|axis| scales[3 * i + axis].max(f32::MIN_POSITIVE)),
            rotation: [w, x, y, z],
            colour: [0, 1, 2].map(|c| (0.5 + SH_C0 * f64::from(constants[3 * i + c])) as f32),
            opacity: opacities[i].clamp(f32::MIN_POSITIVE, 1.0 - f32::EPSILON),
        }
    };
    let of_splat = |i: usize| {
        let higher = &higher;
        (0..3).flat_map(move |channel| higher.iter().map(move |numbers| numbers[3 * i + channel]))
    };
    let harmonics: Vec<f32> = (0..count).flat_map(of_splat).collect();
    if harmonics.iter().any(|c| !c.is_finite()) {
        return Err("a harmonic is not finite".to_owned());
    }
    let are_zero = harmonics.iter().all(|c| *c == 0.0);
    Ok(SplatFile {
        splats: (0..count).map(splat).collect(),
        harmonics: SplatHarmonics::new(sh_degree, harmonics).filter(|_| !are_zero),
        labels: None,
        layout: SplatLayout { form: SplatForm::Ellipsoids, sh_degree },
        origin: None,
    })
}

/// Returns the document and the binary chunk.
fn chunks(bytes: &[u8]) -> Result<(Value, &[u8]), String> {
    let cut_off = || "the glTF file is cut off".to_owned();
    let mut rest = bytes.get(12..).ok_or_else(cut_off)?;
    let mut chunk = |kind: &[u8; 4]| {
        let (length, after) = rest.split_first_chunk::<4>().ok_or_else(cut_off)?;
        let (found, after) = after.split_first_chunk::<4>().ok_or_else(cut_off)?;
        if found != kind {
            return Err(format!("found a chunk {:?} in the glTF file", String::from_utf8_lossy(found)));
        }
        let (content, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(cut_off)?;
        rest = after;
        Ok(content)
    };
    let document =
        serde_json::from_slice(chunk(b"JSON")?).map_err(|error| format!("the glTF has no JSON ({error})"))?;
    Ok((document, chunk(b"BIN\0")?))
}

/// Refuses a node that moves splats, but for the turn of [`encode`].
fn plain(node: &Value) -> Result<(), String> {
    let is = |key: &str, expected: &[f64]| {
        let Some(found) = node[key].as_array() else { return true };
        let close = |(value, expected): (&Value, &f64)| value.as_f64().is_some_and(|v| (v - expected).abs() < 1e-6);
        found.len() == expected.len() && found.iter().zip(expected).all(close)
    };
    let turned = is("rotation", &[0.0, 0.0, 0.0, 1.0]) || is("rotation", &TURN);
    let unit = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    if turned && is("translation", &[0.0; 3]) && is("scale", &[1.0; 3]) && is("matrix", &unit) {
        return Ok(());
    }
    Err("a node of the glTF moves, turns or scales its splats, expected one that only makes y the upward axis"
        .to_owned())
}

/// Reads attributes.
struct Reader<'a> {
    document: &'a Value,
    binary: &'a [u8],
}

impl Reader<'_> {
    /// Returns the numbers of an accessor of vectors of a width.
    fn numbers(&self, name: &str, place: usize, width: usize) -> Result<Vec<f32>, String> {
        let accessor = &self.document["accessors"][place];
        let view = accessor["bufferView"].as_u64().map(|view| &self.document["bufferViews"][view as usize]);
        let view = view.ok_or_else(|| format!("{name} has no values"))?;
        let whole = |value: &Value, key: &str| value[key].as_u64().map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let (kind, expected) = (accessor["type"].as_str(), ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1]);
        if kind != Some(expected) || accessor["sparse"].is_object() {
            return Err(format!("{name} is of type {kind:?}, expected {expected} without gaps"));
        }
        let is_share = accessor["normalized"].as_bool() == Some(true);
        let (size, value): (usize, fn(&[u8]) -> f32) = match (accessor["componentType"].as_u64(), is_share) {
            (Some(5126), _) => (4, |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            (Some(5120), true) => (1, |b| (f32::from(b[0].cast_signed()) / 127.0).max(-1.0)),
            (Some(5121), true) => (1, |b| f32::from(b[0]) / 255.0),
            (Some(5122), true) => (2, |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32_767.0).max(-1.0)),
            (Some(5123), true) => (2, |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65_535.0),
            (found, _) => return Err(format!("{name} has components {found:?}, expected floats or shares")),
        };
        let count = whole(accessor, "count").ok_or_else(|| format!("{name} has no count"))?;
        let row = size * width;
        let step = whole(view, "byteStride").unwrap_or(row);
        let offset = |value: &Value| whole(value, "byteOffset").unwrap_or(0);
        let start = offset(view).checked_add(offset(accessor));
        let end = |start: usize| count.checked_sub(1)?.checked_mul(step)?.checked_add(row)?.checked_add(start);
        let bytes = start.and_then(|start| self.binary.get(start..end(start)?));
        let bytes = bytes.filter(|_| step >= row).ok_or_else(|| {
            format!("{name} announces {count} splats, which the {} bytes of the file do not hold", self.binary.len())
        })?;
        let rows = bytes.chunks(step);
        Ok(rows.flat_map(|bytes| (0..width).map(move |k| value(&bytes[k * size..(k + 1) * size]))).collect())
    }
}
