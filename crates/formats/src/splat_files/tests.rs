//! Round trips of every format, their bytes, and files that are damaged.

use gaussian::{Splat, SplatHarmonics};
use numeric::{Failure, Kind};

use super::*;
use crate::splat_ply::{SplatForm, SplatLayout};

/// Splats of a place of 40 m, with harmonics of degree 3 in small numbers.
fn scene(count: usize, form: SplatForm, sh_degree: u8) -> SplatFile {
    // Knuth's linear congruences (MMIX).
    let mut state = 7u64;
    let mut unit = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (low + (high - low) * (state >> 40) as f64 / f64::from(1 << 24)) as f32
    };
    let mut splats = Vec::new();
    for _ in 0..count {
        let q = [unit(-1.0, 1.0), unit(-1.0, 1.0), unit(-1.0, 1.0), unit(-1.0, 1.0)];
        let length = q.iter().map(|c| c * c).sum::<f32>().sqrt().max(1e-3);
        let (u, v) = (unit(-4.0, 0.5).exp(), unit(-4.0, 0.5).exp());
        splats.push(Splat {
            position: [unit(-20.0, 20.0), unit(-20.0, 20.0), unit(-3.0, 9.0)],
            scale_m: [u, v, if form == SplatForm::Discs { 1e-3 * u.min(v) } else { unit(-4.0, 0.5).exp() }],
            rotation: q.map(|c| c / length),
            colour: [unit(0.0, 1.0), unit(0.0, 1.0), unit(0.0, 1.0)],
            opacity: unit(0.05, 0.999),
        });
    }
    let coefficients = (0..count * 3 * SplatHarmonics::count(3)).map(|_| unit(-0.3, 0.3)).collect();
    let harmonics = SplatHarmonics::new(3, coefficients).filter(|_| sh_degree > 0);
    let origin = Some(LocalOrigin::new("EPSG:32631", "ellipsoid", [690_000.0, 4_820_000.0, 180.0]));
    SplatFile { splats, harmonics, labels: None, layout: SplatLayout { form, sh_degree }, origin }
}

/// Greatest angle of the axes, and differences of positions, logarithms of the first two scales,
/// colours and opacities.
fn differences(a: &SplatFile, b: &SplatFile) -> [f32; 5] {
    let mut most = [0.0f32; 5];
    for (a, b) in a.splats.iter().zip(&b.splats) {
        let cos = (0..4).map(|i| a.rotation[i] * b.rotation[i]).sum::<f32>().abs().min(1.0);
        let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let logs = |s: &Splat| [s.scale_m[0].ln(), s.scale_m[1].ln()];
        let here = [
            2.0 * cos.acos(),
            apart(&a.position, &b.position),
            apart(&logs(a), &logs(b)),
            apart(&a.colour, &b.colour),
            apart(&[a.opacity], &[b.opacity]),
        ];
        (0..5).for_each(|k| most[k] = most[k].max(here[k]));
    }
    most
}

#[test]
fn every_format_brings_splats_back() {
    let folder = tempfile::tempdir().unwrap();
    // Half of the last place of angles, metres, logarithms, colours, opacities.
    let bounds = [
        ("s.ply", [2e-3, 0.0, 1e-5, 1e-6, 1e-6]),
        ("s.spz", [6e-3, 5e-6, 1.0 / 32.0 + 1e-4, 0.0038, 0.5 / 255.0 + 1e-4]),
        // Components of quaternions are known to 1 / 255 √½, the largest follows from the others.
        // 16 bits of ±ln 21 are 1e-4 of the distance from the axes.
        ("s.sog", [2e-2, 1.1e-3, 0.02, 0.01, 0.5 / 255.0 + 1e-4]),
        ("s.glb", [2e-3, 0.0, 1e-5, 1e-6, 1e-6]),
    ];
    for (name, bounds) in bounds {
        for (form, sh_degree) in [(SplatForm::Discs, 0), (SplatForm::Ellipsoids, 2), (SplatForm::Discs, 3)] {
            let (path, file) = (folder.path().join(name), scene(500, form, sh_degree));
            write(&path, &file, true).unwrap();
            let back = read(&path).unwrap();
            assert_eq!((back.splats.len(), &back.origin, back.layout), (500, &file.origin, file.layout), "{name}");
            let found = differences(&file, &back);
            assert!(found.iter().zip(bounds).all(|(f, b)| *f <= b), "{name}: {found:?}, at most {bounds:?}");
            if let Some(harmonics) = &back.harmonics {
                let known = file.harmonics.as_ref().unwrap();
                let count = SplatHarmonics::count(sh_degree);
                let apart = |i: usize, c: usize| {
                    let pairs = harmonics.of(i, c).iter().zip(&known.of(i, c)[..count]);
                    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
                };
                let most = (0..500).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| apart(i, c));
                let most = most.fold(0.0, f32::max);
                assert!(most <= 0.5 / 128.0 + 1e-6, "{name}: {most}");
            }
            assert_eq!(back.harmonics.map_or(0, |h| h.degree()), sh_degree, "{name}");
        }
    }
}

#[test]
fn discs_are_told_from_ellipsoids_without_a_word_in_the_file() {
    let flat = scene(20, SplatForm::Discs, 0);
    let mut padded = flat.clone();
    padded.layout.form = SplatForm::Ellipsoids;
    assert!(padded.is_flat() && !scene(20, SplatForm::Ellipsoids, 0).is_flat());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    write(&path, &padded, false).unwrap();
    let back = read(&path).unwrap();
    assert!(back.layout.form == SplatForm::Ellipsoids && back.is_flat());
}

/// The header and the first splat of SPZ, computed by hand from its description.
#[test]
fn the_bytes_of_spz_are_those_of_its_description() {
    let splat = Splat {
        position: [1.0, -0.5, 100.0],
        scale_m: [1.0, (-2.0f32).exp(), (-20.0f32).exp()],
        rotation: [0.5, 0.5, -0.5, 0.5],
        colour: [0.5; 3],
        opacity: 0.6,
    };
    let layout = SplatLayout { form: SplatForm::Discs, sh_degree: 0 };
    let bytes =
        spz::encode(&SplatFile { splats: vec![splat], harmonics: None, labels: None, layout, origin: None }).unwrap();
    let mut body = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&bytes[..]), &mut body).unwrap();
    // 100 m leave 16 bits behind the point.
    assert_eq!(body[..16], *b"NGSP\x03\0\0\0\x01\0\0\0\0\x10\0\0");
    // y and z are turned round.
    assert_eq!(body[16..25], [0, 0, 1, 0, 0x80, 0, 0, 0, 0x9c]);
    assert_eq!(body[25..32], [153, 128, 128, 128, 160, 128, 0]);
    // The largest of x, y, z, w is the first of equals; the others are ½ √2 of 511, z negative.
    let share = (511.0 * std::f64::consts::FRAC_1_SQRT_2).round() as u32;
    let bits = share << 20 | (512 | share) << 10 | share;
    assert_eq!(body[32..], bits.to_le_bytes());
}

#[test]
fn versions_2_and_4_of_spz_are_read() {
    let file = scene(40, SplatForm::Ellipsoids, 1);
    let packed = spz::encode(&file).unwrap();
    let mut body = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut body).unwrap();
    let three = spz::decode(&packed).unwrap();
    // Version 4 has the same streams, each packed by itself. Raw blocks are Zstandard, too.
    let (mut four, mut data) = (body[..16].to_vec(), Vec::new());
    (four[4], four[15]) = (4, 6);
    four.extend(32u32.to_le_bytes());
    four.extend([0; 12]);
    let mut rest = &body[16..];
    for size in [9, 1, 3, 3, 4, 9] {
        let (own, after) = rest.split_at(40 * size);
        rest = after;
        // Frame header without checksum, content size of two bytes (less 256), one last raw block.
        let header = 1 | (own.len() as u32) << 3;
        let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd];
        if own.len() < 256 {
            frame.extend([0x20, own.len() as u8]);
        } else {
            frame.push(0x60);
            frame.extend((own.len() as u16 - 256).to_le_bytes());
        }
        frame.extend(&header.to_le_bytes()[..3]);
        frame.extend(own);
        four.extend((frame.len() as u64).to_le_bytes());
        four.extend((own.len() as u64).to_le_bytes());
        data.extend(frame);
    }
    four.extend(data);
    assert_eq!(spz::decode(&four).unwrap(), three);
    // Version 2 has rotations of three bytes.
    let mut two = body[..16 + 40 * 16].to_vec();
    two[4] = 2;
    for splat in &three.splats {
        let [w, x, y, z] = splat.rotation;
        let sign = if w < 0.0 { -1.0 } else { 1.0 };
        two.extend([x, -y, -z].map(|c| (127.5 + 127.5 * sign * c).round() as u8));
    }
    two.extend(&body[16 + 40 * 20..]);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gzip, &two).unwrap();
    let second = spz::decode(&gzip.finish().unwrap()).unwrap();
    let found = differences(&three, &second);
    // Small real parts lose most.
    assert!(found[0] < 0.3 && found[1..] == [0.0; 4], "{found:?}");
    let mut other = body;
    other[4] = 9;
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gzip, &other).unwrap();
    assert!(spz::decode(&gzip.finish().unwrap()).unwrap_err().contains("version of the SPZ file is 9"));
}

/// Turning the harmonics with their splats leaves the colour of a direction as it is.
#[test]
fn harmonics_turn_with_the_axes_of_spz() {
    let file = scene(3, SplatForm::Ellipsoids, 3);
    let back = spz::decode(&spz::encode(&file).unwrap()).unwrap();
    let (known, found) = (file.harmonics.unwrap(), back.harmonics.unwrap());
    let packed = spz::encode(&scene(3, SplatForm::Ellipsoids, 3)).unwrap();
    let mut body = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut body).unwrap();
    // What another program sees: the bytes of the first splat, along the direction turned by half.
    let stored = &body[16 + 3 * 20..];
    let coefficients = (0..3).flat_map(|c| (0..15).map(move |k| (f32::from(stored[3 * k + c]) - 128.0) / 128.0));
    let stored = SplatHarmonics::new(3, coefficients.collect()).unwrap();
    for [x, y, z] in [[0.3, -0.8, 0.5], [-0.6, 0.1, 0.9], [0.2, 0.9, -0.4]] {
        let [a, b, c] = [
            known.colour(0, [2.0; 3], [x, y, z]),
            found.colour(0, [2.0; 3], [x, y, z]),
            stored.colour(0, [2.0; 3], [x, -y, -z]),
        ];
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 0.03 && (b[i] - c[i]).abs() < 1e-5), "{a:?} {b:?} {c:?}");
    }
}

/// Nothing that is cut off or has other bytes panics, and cut files are refused.
#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let placed = scene(60, SplatForm::Discs, 1);
    let file = SplatFile { origin: None, ..placed.clone() };
    for name in ["s.spz", "s.sog", "s.glb"] {
        let path = folder.path().join(name);
        write(&path, &file, false).unwrap();
        assert_eq!(write(&path, &file, false).unwrap_err().kind(), Kind::OutputExists);
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(1 + whole.len() / 97) {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "{name} of {length} bytes");
        }
        for at in (0..whole.len()).step_by(1 + whole.len() / 211) {
            let mut other = whole.clone();
            other[at] ^= 0x55;
            std::fs::write(&path, &other).unwrap();
            // Other numbers may be splats, too.
            if let Ok(found) = read(&path) {
                assert!(found.splats.iter().all(|s| s.validate().is_ok()));
            }
        }
    }
    let odd = folder.path().join("s.splat");
    assert!(write(&odd, &placed, false).unwrap_err().to_string().contains(".spz"));
    assert!(!odd.exists() && !crate::splat_ply::origin_path(&odd).exists());
    let mut far = file;
    far.splats[0].position[0] = 9e6;
    let error = write(&folder.path().join("far.spz"), &far, false).unwrap_err().to_string();
    assert!(error.contains("9000000 m from the origin"), "{error}");
}

#[test]
fn nodes_that_move_splats_and_packed_splats_are_refused() {
    let file = scene(10, SplatForm::Discs, 0);
    let bytes = glb::encode(&file).unwrap();
    let changed = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut other = bytes.clone();
        other[at..at + to.len()].copy_from_slice(to.as_bytes());
        glb::decode(&other)
    };
    assert!(glb::decode(&bytes).is_ok());
    assert!(changed("rotation", "position").is_ok(), "without a turn");
    assert!(changed("[-0.7071", "[-0.6071").unwrap_err().contains("turns"));
    assert!(changed("ellipse", "pyramid").unwrap_err().contains("pyramid"));
    assert!(changed("KHR_gaussian_splatting\":{", "EXT_gaussian_splatting\":{").unwrap_err().contains("found 0 sets"));
}
