//! SOG (PlayCanvas), version 2: splats as pixels of lossless WebP images, in one archive.
//!
//! `meta.json` names the images and holds the tables of their bytes. Positions are 16 bits of
//! sign(x) ln(1 + |x|) between bounds, rotations the three smallest components of a quaternion,
//! logarithms of scales, constant harmonics and higher ones places in tables of 256 values. The
//! higher ones of a splat are a place in a palette of at most 65,536. `model` says whether splats
//! are discs.

use std::io::{Cursor, Read, Write};

use gaussian::{Splat, SplatHarmonics};
use image_webp::{ColorType, WebPDecoder, WebPEncoder};
use serde::{Deserialize, Serialize};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::codebook::{CODES, Codebook, Palette};
use super::numbers::{coefficient, opacity_of};
use crate::splat_ply::{SH_C0, SH_DEGREE_MAX, SplatFile, SplatForm, SplatLayout};

/// Name of the description in the archive.
const META: &str = "meta.json";
/// Vectors of the palette in a row of its image.
const ROW: usize = 64;
/// Largest file of an archive, bytes.
const PART_LIMIT: u64 = 4 << 30;
/// Largest image in memory, bytes.
const IMAGE_LIMIT: usize = 2 << 30;
/// The model of discs.
const DISCS: &str = "2dgs";

#[derive(Serialize, Deserialize)]
struct Meta {
    version: u32,
    count: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    means: Means,
    scales: Coded,
    quats: Plain,
    sh0: Coded,
    #[serde(rename = "shN", default, skip_serializing_if = "Option::is_none")]
    higher: Option<Higher>,
}

#[derive(Serialize, Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: [String; 2],
}

#[derive(Serialize, Deserialize)]
struct Coded {
    codebook: Vec<f32>,
    files: [String; 1],
}

#[derive(Serialize, Deserialize)]
struct Plain {
    files: [String; 1],
}

#[derive(Serialize, Deserialize)]
struct Higher {
    count: usize,
    bands: u8,
    codebook: Vec<f32>,
    files: [String; 2],
}

/// An image of four bytes a pixel.
struct Pixels {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

impl Pixels {
    /// Returns an image with a pixel for each of `count` splats.
    fn of(count: usize, pixel: impl Fn(usize) -> [u8; 4]) -> Self {
        let width = (count as f64).sqrt().ceil().max(1.0) as usize;
        let width = width.next_multiple_of(4);
        Self::sized(width, count.div_ceil(width).max(1), |i| if i < count { pixel(i) } else { [0; 4] })
    }

    fn sized(width: usize, height: usize, pixel: impl Fn(usize) -> [u8; 4]) -> Self {
        Self { width, height, bytes: (0..width * height).flat_map(pixel).collect() }
    }

    fn at(&self, pixel: usize) -> [u8; 4] {
        let at = 4 * pixel;
        [self.bytes[at], self.bytes[at + 1], self.bytes[at + 2], self.bytes[at + 3]]
    }

    fn encode(&self) -> Result<Vec<u8>, String> {
        let mut out = Vec::new();
        let encoder = WebPEncoder::new(&mut out);
        let encoded = encoder.encode(&self.bytes, self.width as u32, self.height as u32, ColorType::Rgba8);
        encoded.map_err(|error| format!("the splats do not fit in images ({error})"))?;
        Ok(out)
    }

    fn decode(name: &str, bytes: &[u8]) -> Result<Self, String> {
        let told = |error| format!("{name} is not a WebP image that can be read ({error})");
        let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(told)?;
        decoder.set_memory_limit(IMAGE_LIMIT);
        let ((width, height), has_alpha) = (decoder.dimensions(), decoder.has_alpha());
        let size = decoder.output_buffer_size().filter(|size| *size <= IMAGE_LIMIT);
        let mut found = vec![0; size.ok_or_else(|| format!("{name} has {width} × {height} pixels, too many"))?];
        decoder.read_image(&mut found).map_err(told)?;
        if !has_alpha {
            found = found.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], u8::MAX]).collect();
        }
        Ok(Self { width: width as usize, height: height as usize, bytes: found })
    }
}

/// Positions are stored by this.
fn squeezed(x: f64) -> f64 {
    x.signum() * x.abs().ln_1p()
}

/// The inverse of [`squeezed`].
fn stretched(x: f64) -> f64 {
    x.signum() * x.abs().exp_m1()
}

/// Returns the bytes of an archive.
pub(super) fn encode(file: &SplatFile) -> Result<Vec<u8>, String> {
    let splats = &file.splats;
    let count = splats.len();
    let place = |i: usize| splats[i].position.map(|c| squeezed(f64::from(c)));
    let bound = |pick: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        let most = (0..count).fold([start; 3], |most, i| {
            let place = place(i);
            [0, 1, 2].map(|axis| pick(most[axis], place[axis]))
        });
        most.map(|c| if c.is_finite() { c } else { 0.0 })
    };
    let (mins, maxs) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
    let fixed = |i: usize, axis: usize| {
        let span = maxs[axis] - mins[axis];
        if span > 0.0 { (65_535.0 * (place(i)[axis] - mins[axis]) / span).round() as u16 } else { 0 }
    };
    let mean = |byte: usize| {
        Pixels::of(count, |i| {
            let [x, y, z] = [0, 1, 2].map(|axis| fixed(i, axis).to_le_bytes()[byte]);
            [x, y, z, u8::MAX]
        })
    };
    // The third scale of discs is one number for all: it says nothing, and the table is for the
    // others.
    let is_flat = file.is_flat();
    let thin = splats.iter().map(|s| s.scale_m[2]).fold(f32::INFINITY, f32::min).ln();
    let scale = |i: usize, axis: usize| if is_flat && axis == 2 { thin } else { splats[i].scale_m[axis].ln() };
    let scales = Codebook::of((0..3 * count).map(|k| scale(k / 3, k % 3)).collect());
    let constant = |i: usize, channel: usize| ((f64::from(splats[i].colour[channel]) - 0.5) / SH_C0) as f32;
    let constants = Codebook::of((0..3 * count).map(|k| constant(k / 3, k % 3)).collect());
    let coded =
        |book: &Codebook, value: &dyn Fn(usize, usize) -> f32, i: usize| [0, 1, 2].map(|k| book.nearest(value(i, k)));
    let opacity = |i: usize| (255.0 * splats[i].opacity).round() as u8;
    let mut parts = vec![
        ("means_l.webp", mean(0)),
        ("means_u.webp", mean(1)),
        ("quats.webp", Pixels::of(count, |i| packed(splats[i].rotation))),
        ("scales.webp", Pixels::of(count, |i| with_alpha(coded(&scales, &scale, i), u8::MAX))),
        ("sh0.webp", Pixels::of(count, |i| with_alpha(coded(&constants, &constant, i), opacity(i)))),
    ];
    let higher = higher(file, &mut parts);
    let meta = Meta {
        version: 2,
        count,
        model: is_flat.then(|| DISCS.to_owned()),
        means: Means { mins, maxs, files: ["means_l.webp", "means_u.webp"].map(str::to_owned) },
        scales: Coded { codebook: scales.0, files: ["scales.webp".to_owned()] },
        quats: Plain { files: ["quats.webp".to_owned()] },
        sh0: Coded { codebook: constants.0, files: ["sh0.webp".to_owned()] },
        higher,
    };
    let meta = serde_json::to_vec(&meta).map_err(|error| error.to_string())?;
    let told = |error: zip::result::ZipError| format!("the archive cannot be made ({error})");
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // The images are packed already.
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut put = |name: &str, bytes: &[u8]| {
        archive.start_file(name, stored).map_err(told)?;
        archive.write_all(bytes).map_err(|error| told(error.into()))
    };
    put(META, &meta)?;
    for (name, pixels) in &parts {
        put(name, &pixels.encode()?)?;
    }
    Ok(archive.finish().map_err(told)?.into_inner())
}

fn with_alpha([r, g, b]: [u8; 3], alpha: u8) -> [u8; 4] {
    [r, g, b, alpha]
}

/// Adds the images of the harmonics beyond the constant one, where the file has any.
fn higher(file: &SplatFile, parts: &mut Vec<(&'static str, Pixels)>) -> Option<Higher> {
    let per_channel = file.layout.rest() / 3;
    let size = file.layout.rest();
    if size == 0 || file.harmonics.is_none() || file.splats.is_empty() {
        return None;
    }
    let count = file.splats.len();
    let value = |k: usize| coefficient(file, k / size, k % size / per_channel, k % per_channel);
    let vectors: Vec<f32> = (0..count * size).map(value).collect();
    let palette = Palette::of(&vectors, size, Palette::VECTORS_MAX);
    let book = Codebook::of(palette.vectors.clone());
    let entries = palette.vectors.len() / size;
    let centroids = Pixels::sized(ROW * per_channel, entries.div_ceil(ROW), |pixel| {
        let (row, column) = (pixel / (ROW * per_channel), pixel % (ROW * per_channel));
        let (entry, number) = (row * ROW + column / per_channel, column % per_channel);
        let coded = |channel: usize| {
            let value = palette.vectors.get(entry * size + channel * per_channel + number);
            book.nearest(value.copied().unwrap_or(0.0))
        };
        with_alpha([0, 1, 2].map(coded), u8::MAX)
    });
    let label = |i: usize| {
        let [low, high] = palette.labels[i].to_le_bytes();
        [low, high, 0, u8::MAX]
    };
    parts.push(("shN_centroids.webp", centroids));
    parts.push(("shN_labels.webp", Pixels::of(count, label)));
    let files = ["shN_centroids.webp", "shN_labels.webp"].map(str::to_owned);
    Some(Higher { count: entries, bands: file.layout.sh_degree, codebook: book.0, files })
}

/// Returns a quaternion (w, x, y, z) as the three smallest components and the place of the largest.
fn packed(rotation: [f32; 4]) -> [u8; 4] {
    let q = rotation.map(f64::from);
    let largest = (1..4).fold(0, |best, i| if q[i].abs() > q[best].abs() { i } else { best });
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut out = [0, 0, 0, 252 + largest as u8];
    for (byte, i) in out.iter_mut().zip((0..4).filter(|i| *i != largest)) {
        let share = 0.5 + 0.5 * sign * q[i] * std::f64::consts::SQRT_2;
        *byte = (255.0 * share).round().clamp(0.0, 255.0) as u8;
    }
    out
}

/// Returns the quaternion of [`packed`].
fn unpacked([a, b, c, place]: [u8; 4]) -> [f32; 4] {
    let Some(largest) = place.checked_sub(252).map(usize::from) else { return [1.0, 0.0, 0.0, 0.0] };
    let mut q = [0.0f64; 4];
    for (byte, i) in [a, b, c].into_iter().zip((0..4).filter(|i| *i != largest)) {
        q[i] = (2.0 * f64::from(byte) / 255.0 - 1.0) / std::f64::consts::SQRT_2;
    }
    q[largest] = (1.0 - q.iter().map(|c| c * c).sum::<f64>()).max(0.0).sqrt();
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    q.map(|c| (c / length) as f32)
}

/// Reads the splats of an archive.
pub(super) fn decode(bytes: &[u8]) -> Result<SplatFile, String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| format!("the archive is damaged ({e})"))?;
    let mut part = |name: &str| {
        let file = archive.by_name(name).map_err(|error| format!("the archive has no {name} ({error})"))?;
        let mut content = Vec::new();
        let read = file.take(PART_LIMIT).read_to_end(&mut content);
        read.map(|_| content).map_err(|error| format!("{name} cannot be unpacked ({error})"))
    };
    let meta = part(META)?;
    let meta: Meta = serde_json::from_slice(&meta)
        .map_err(|error| format!("{META} does not describe splats of SOG, version 2 ({error})"))?;
    if meta.version != 2 {
        return Err(format!("the version of the SOG file is {}, expected 2", meta.version));
    }
    let mut image = |name: &str| Pixels::decode(name, &part(name)?);
    let count = meta.count;
    let mut pixels = |name: &str| {
        let pixels = image(name)?;
        let found = pixels.width * pixels.height;
        if found < count { Err(format!("{name} has {found} pixels for {count} splats")) } else { Ok(pixels) }
    };
    let [low, high] = [pixels(&meta.means.files[0])?, pixels(&meta.means.files[1])?];
    let (quats, scales) = (pixels(&meta.quats.files[0])?, pixels(&meta.scales.files[0])?);
    let constants = pixels(&meta.sh0.files[0])?;
    for (name, codebook) in [("scales", &meta.scales.codebook), ("sh0", &meta.sh0.codebook)] {
        whole(name, codebook)?;
    }
    let harmonics = match &meta.higher {
        Some(higher) => {
            let labels = pixels(&higher.files[1])?;
            Some(harmonics(higher, &image(&higher.files[0])?, &labels, count)?)
        }
        None => None,
    };
    let splat = |i: usize| {
        let (low, high, colour) = (low.at(i), high.at(i), constants.at(i));
        let coordinate = |axis: usize| {
            let share = f64::from(u16::from_le_bytes([low[axis], high[axis]])) / 65_535.0;
            let Means { mins, maxs, .. } = &meta.means;
            stretched(mins[axis] + share * (maxs[axis] - mins[axis])) as f32
        };
        let [su, sv, thickness, _] = scales.at(i).map(|code| meta.scales.codebook[usize::from(code)].exp());
        let channel = |c: usize| (0.5 + SH_C0 * f64::from(meta.sh0.codebook[usize::from(colour[c])])) as f32;
        Splat {
            position: [0, 1, 2].map(coordinate),
            scale_m: [su, sv, thickness],
            rotation: unpacked(quats.at(i)),
            colour: [0, 1, 2].map(channel),
            opacity: opacity_of(colour[3]),
        }
    };
    let form = if meta.model.as_deref() == Some(DISCS) { SplatForm::Discs } else { SplatForm::Ellipsoids };
    let layout = SplatLayout { form, sh_degree: harmonics.as_ref().map_or(0, SplatHarmonics::degree) };
    Ok(SplatFile { splats: (0..count).map(splat).collect(), harmonics, labels: None, layout, origin: None })
}

fn whole(name: &str, codebook: &[f32]) -> Result<(), String> {
    if codebook.len() != CODES {
        return Err(format!("the table of {name} has {} values, expected {CODES}", codebook.len()));
    }
    Ok(())
}

fn harmonics(higher: &Higher, centroids: &Pixels, labels: &Pixels, count: usize) -> Result<SplatHarmonics, String> {
    whole("shN", &higher.codebook)?;
    if !(1..=SH_DEGREE_MAX).contains(&higher.bands) {
        return Err(format!("the degree of the harmonics is {}, expected 1 to {SH_DEGREE_MAX}", higher.bands));
    }
    let per_channel = SplatHarmonics::count(higher.bands);
    let (found, expected) = (centroids.width, ROW * per_channel);
    if found != expected || centroids.height < higher.count.div_ceil(ROW) {
        return Err(format!(
            "the palette of {} vectors has {found} × {} pixels, expected {expected} columns and a row for {ROW} vectors",
            higher.count, centroids.height
        ));
    }
    let mut coefficients = Vec::with_capacity(3 * per_channel * count);
    for i in 0..count {
        let [low, high, ..] = labels.at(i);
        let entry = usize::from(u16::from_le_bytes([low, high]));
        for channel in 0..3 {
            let value = |number: usize| {
                let pixel = entry / ROW * expected + entry % ROW * per_channel + number;
                higher.codebook[usize::from(centroids.at(pixel)[channel])]
            };
            // A place outside of the palette has no harmonics.
            coefficients.extend((0..per_channel).map(|n| if entry < higher.count { value(n) } else { 0.0 }));
        }
    }
    if coefficients.iter().any(|c| !c.is_finite()) {
        return Err("a harmonic is not finite".to_owned());
    }
    SplatHarmonics::new(higher.bands, coefficients).ok_or_else(|| "the harmonics are incomplete".to_owned())
}
