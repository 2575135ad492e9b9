//! SPZ (Niantic): splats as bytes, packed by gzip (versions 2 and 3) or Zstandard (version 4).
//!
//! A header and six streams: positions (24 bits, fixed point), opacities, colours, logarithms of
//! scales, rotations, harmonics (coefficient by coefficient, red, green and blue of each). Colours
//! are 0.15 times the constant harmonic plus a half, scales (ln s + 10) · 16, harmonics 128 + 128
//! c. Version 3 keeps the three smallest components of a quaternion in ten bits each, version 2 x,
//! y and z in a byte each. [`encode`] writes version 3, which all readers know.
//!
//! The axes of SPZ are right, up and back where those of PLY are right, down and forward, so that
//! all programs turn splats by half a turn about x between the two. So do we.

use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use gaussian::{Splat, SplatHarmonics};
use ruzstd::decoding::StreamingDecoder;

use super::numbers::{coefficient, opacity_of};
use crate::splat_ply::{SH_C0, SH_DEGREE_MAX, SplatFile, SplatForm, SplatLayout};

/// First bytes of a gzip stream.
pub(super) const GZIP: [u8; 2] = [0x1f, 0x8b];
/// First bytes of a header.
pub(super) const MAGIC: [u8; 4] = *b"NGSP";
/// Factor of the constant harmonic, which leaves room for colours beyond black and white.
const COLOUR_SCALE: f64 = 0.15;
/// Most bits of a position behind the point: 4 µm where a unit is a metre.
const FRACTION_BITS_MAX: u32 = 18;
/// Most bytes of positions that a byte of the file can hold, as in the original reader.
const RATIO_MAX: u64 = 1024;

/// Signs of the axes in the file, and of the harmonics along them: half a turn about x.
const AXES: [f32; 3] = [1.0, -1.0, -1.0];
const HARMONICS: [f32; 15] = [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// Returns the colours of the bytes 0 and 255.
pub(super) fn colour_range() -> [f32; 2] {
    [-0.5, 0.5].map(|byte| (0.5 + SH_C0 * byte / COLOUR_SCALE) as f32)
}

/// What the header says.
struct Header {
    version: u32,
    count: usize,
    sh_degree: u8,
    fraction_bits: u32,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let header: &[u8; 16] = bytes.first_chunk().ok_or("the SPZ header is cut off")?;
        if !header.starts_with(&MAGIC) {
            return Err("the packed file does not begin with \"NGSP\", so it is not SPZ".to_owned());
        }
        let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        let (version, sh_degree, fraction_bits) = (word(4), header[12], u32::from(header[13]));
        if !(2..=4).contains(&version) {
            return Err(format!("the version of the SPZ file is {version}, expected 2, 3 or 4"));
        }
        if sh_degree > SH_DEGREE_MAX {
            return Err(format!("the degree of the harmonics is {sh_degree}, expected 0 to {SH_DEGREE_MAX}"));
        }
        if fraction_bits > 23 {
            return Err(format!("positions have {fraction_bits} bits behind the point, expected at most 23"));
        }
        Ok(Self { version, count: word(8) as usize, sh_degree, fraction_bits })
    }

    fn layout(&self) -> SplatLayout {
        SplatLayout { form: SplatForm::Ellipsoids, sh_degree: self.sh_degree }
    }

    /// Bytes of a splat in each stream.
    fn sizes(&self) -> [usize; 6] {
        [9, 1, 3, 3, if self.version == 2 { 3 } else { 4 }, self.layout().rest()]
    }
}

/// Returns the bytes of splats.
pub(super) fn encode(file: &SplatFile) -> Result<Vec<u8>, String> {
    let splats = &file.splats;
    let count = u32::try_from(splats.len()).map_err(|_| "SPZ holds at most 4 billion splats")?;
    let reach = splats.iter().flat_map(|s| s.position).fold(0.0f64, |most, c| most.max(f64::from(c).abs()));
    let fits = |bits: &u32| reach * f64::from(1u32 << bits) < f64::from((1 << 23) - 1);
    let bits = (0..=FRACTION_BITS_MAX)
        .rev()
        .find(fits)
        .ok_or_else(|| format!("a splat is {reach:.0} m from the origin, SPZ holds {} m at most", (1 << 23) - 1))?;
    let mut out = MAGIC.to_vec();
    out.extend(3u32.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend([file.layout.sh_degree, bits as u8, 0, 0]);
    let byte = |value: f64| value.round().clamp(0.0, 255.0) as u8;
    for coordinate in splats.iter().flat_map(|s| [0, 1, 2].map(|axis| AXES[axis] * s.position[axis])) {
        let fixed = (f64::from(coordinate) * f64::from(1u32 << bits)).round() as i32;
        out.extend(&fixed.to_le_bytes()[..3]);
    }
    out.extend(splats.iter().map(|s| byte(255.0 * f64::from(s.opacity))));
    let colour = |c: f32| byte(255.0 * (COLOUR_SCALE * (f64::from(c) - 0.5) / SH_C0 + 0.5));
    out.extend(splats.iter().flat_map(|s| s.colour.map(colour)));
    let scale = |s: f32| byte(16.0 * (f64::from(s).ln() + 10.0));
    out.extend(splats.iter().flat_map(|s| s.scale_m.map(scale)));
    out.extend(splats.iter().flat_map(|s| packed(s.rotation).to_le_bytes()));
    let harmonics = file.layout.rest() / 3;
    for splat in 0..splats.len() {
        for (number, sign) in HARMONICS.iter().enumerate().take(harmonics) {
            let value = |channel| f64::from(sign * coefficient(file, splat, channel, number));
            let channel = |channel| byte(128.0 + 128.0 * value(channel));
            out.extend([0, 1, 2].map(channel));
        }
    }
    let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
    gzip.write_all(&out).and_then(|()| gzip.finish()).map_err(|error| error.to_string())
}

/// Returns a quaternion (w, x, y, z) as the three smallest of its components.
fn packed([w, x, y, z]: [f32; 4]) -> u32 {
    let q = [x * AXES[0], y * AXES[1], z * AXES[2], w].map(f64::from);
    let largest = (1..4).fold(0, |best, i| if q[i].abs() > q[best].abs() { i } else { best });
    let others = (0..4).filter(|i| *i != largest);
    others.fold(largest as u32, |bits, i| {
        let is_negative = (q[i] < 0.0) != (q[largest] < 0.0);
        let size = (511.0 * q[i].abs() * std::f64::consts::SQRT_2).round().min(511.0) as u32;
        (bits << 10) | (u32::from(is_negative) << 9) | size
    })
}

/// Returns the quaternion (w, x, y, z) of [`packed`].
fn unpacked(bits: u32) -> [f32; 4] {
    let largest = (bits >> 30) as usize;
    let (mut q, mut left) = ([0.0f64; 4], bits);
    for i in (0..4).rev().filter(|i| *i != largest) {
        let size = f64::from(left & 511) / 511.0 / std::f64::consts::SQRT_2;
        q[i] = if left >> 9 & 1 == 1 { -size } else { size };
        left >>= 10;
    }
    completed(q, largest)
}

/// Computes the component of a unit quaternion (x, y, z, w) that is missing; returns (w, x, y, z).
fn completed(mut q: [f64; 4], missing: usize) -> [f32; 4] {
    let rest: f64 = q.iter().map(|c| c * c).sum();
    q[missing] = (1.0 - rest).max(0.0).sqrt();
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [x, y, z, w] = q.map(|c| (c / length) as f32);
    [w, x * AXES[0], y * AXES[1], z * AXES[2]]
}

/// Reads the splats of a file.
pub(super) fn decode(bytes: &[u8]) -> Result<SplatFile, String> {
    if bytes.starts_with(&MAGIC) {
        return streams_of_zstandard(bytes);
    }
    let mut decoder = MultiGzDecoder::new(bytes);
    let unpack = |error: std::io::Error| format!("the file cannot be unpacked ({error})");
    let mut start = [0; 16];
    decoder.read_exact(&mut start).map_err(unpack)?;
    let header = Header::parse(&start)?;
    if header.version == 4 {
        return Err("the SPZ file of version 4 is packed by gzip, expected Zstandard".to_owned());
    }
    let sizes = header.sizes();
    let expected = room(&header, &sizes, bytes.len())?;
    let mut body = Vec::new();
    decoder.take(expected + 1).read_to_end(&mut body).map_err(unpack)?;
    if (body.len() as u64) < expected {
        let count = header.count;
        return Err(format!("{count} splats take {expected} bytes, the file has {}: it is cut off", body.len()));
    }
    let mut rest = &body[..];
    let streams = sizes.map(|size| {
        let (own, after) = rest.split_at(size * header.count);
        rest = after;
        own
    });
    Ok(splats(&header, streams))
}

/// Returns the number of bytes of all streams, if a file of that size can hold them.
fn room(header: &Header, sizes: &[usize; 6], file: usize) -> Result<u64, String> {
    let expected = sizes.iter().sum::<usize>() as u64 * header.count as u64;
    if 9 * header.count as u64 > RATIO_MAX * file as u64 {
        return Err(format!("the header announces {} splats, which {file} bytes cannot hold", header.count));
    }
    Ok(expected)
}

/// Reads version 4: a header, a table of the streams, the streams one after the other.
fn streams_of_zstandard(bytes: &[u8]) -> Result<SplatFile, String> {
    let header = Header::parse(bytes)?;
    let sizes = header.sizes();
    room(&header, &sizes, bytes.len())?;
    let cut_off = || "the SPZ file is cut off".to_owned();
    let start: &[u8; 32] = bytes.first_chunk().ok_or_else(cut_off)?;
    let (count, table) = (usize::from(start[15]), u32::from_le_bytes([start[16], start[17], start[18], start[19]]));
    // The harmonics of degree 0 may have no stream.
    if header.version != 4 || !(5..=6).contains(&count) || (count == 5 && header.sh_degree > 0) {
        return Err(format!("the SPZ file of version {} has {count} streams, expected 6", header.version));
    }
    let mut table = bytes.get(table as usize..).ok_or_else(cut_off)?;
    let mut data = table.get(16 * count..).ok_or_else(cut_off)?;
    let mut streams: [Vec<u8>; 6] = Default::default();
    for (stream, size) in streams.iter_mut().zip(sizes).take(count) {
        let (entry, rest) = table.split_first_chunk::<8>().ok_or_else(cut_off)?;
        table = rest.get(8..).ok_or_else(cut_off)?;
        let length = usize::try_from(u64::from_le_bytes(*entry)).map_err(|_| cut_off())?;
        let (own, after) = data.split_at_checked(length).ok_or_else(cut_off)?;
        data = after;
        let expected = size * header.count;
        if expected > 0 {
            let decoder = StreamingDecoder::new(own).map_err(|error| format!("a stream is damaged ({error})"))?;
            let read = decoder.take(expected as u64 + 1).read_to_end(stream);
            read.map_err(|error| format!("a stream cannot be unpacked ({error})"))?;
        }
        if stream.len() != expected {
            return Err(format!("a stream has {} bytes, expected {expected}", stream.len()));
        }
    }
    Ok(splats(&header, streams.each_ref().map(Vec::as_slice)))
}

/// Returns the splats of streams of the right lengths.
fn splats(header: &Header, streams: [&[u8]; 6]) -> SplatFile {
    let [positions, opacities, colours, scales, rotations, harmonics] = streams;
    let unit = f64::from(1u32 << header.fraction_bits);
    let splat = |i: usize| {
        let coordinate = |axis: usize| {
            let at = 9 * i + 3 * axis;
            let fixed = i32::from_le_bytes([0, positions[at], positions[at + 1], positions[at + 2]]) >> 8;
            AXES[axis] * (f64::from(fixed) / unit) as f32
        };
        let rotation = if header.version == 2 {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(rotations[3 * i + axis]) / 127.5 - 1.0);
            completed([x, y, z, 0.0], 3)
        } else {
            let at = &rotations[4 * i..4 * i + 4];
            unpacked(u32::from_le_bytes([at[0], at[1], at[2], at[3]]))
        };
        let colour = |c: u8| (0.5 + SH_C0 * (f64::from(c) / 255.0 - 0.5) / COLOUR_SCALE) as f32;
        Splat {
            position: [0, 1, 2].map(coordinate),
            scale_m: [0, 1, 2].map(|axis| (f64::from(scales[3 * i + axis]) / 16.0 - 10.0).exp() as f32),
            rotation,
            colour: [0, 1, 2].map(|channel| colour(colours[3 * i + channel])),
            opacity: opacity_of(opacities[i]),
        }
    };
    let count = SplatHarmonics::count(header.sh_degree);
    let value = |i: usize, channel: usize, number: usize| {
        HARMONICS[number] * (f32::from(harmonics[3 * (count * i + number) + channel]) - 128.0) / 128.0
    };
    let of = |i: usize| (0..3).flat_map(move |channel| (0..count).map(move |number| value(i, channel, number)));
    let coefficients: Vec<f32> = (0..header.count).flat_map(of).collect();
    let are_zero = coefficients.iter().all(|c| *c == 0.0);
    SplatFile {
        splats: (0..header.count).map(splat).collect(),
        harmonics: SplatHarmonics::new(header.sh_degree, coefficients).filter(|_| !are_zero),
        labels: None,
        layout: header.layout(),
        origin: None,
    }
}
