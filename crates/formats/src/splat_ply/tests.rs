//! Round trips, the layout that loaders expect, and files that are not splats.

use gaussian::{Splat, SplatLabel};
use numeric::{Failure, Kind};

use super::*;
use proptest::prelude::*;

fn origin() -> LocalOrigin {
    LocalOrigin::new("EPSG:32631", "ellipsoid", [693_000.5, 4_822_000.25, 180.125])
}

fn splats() -> Vec<Splat> {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    vec![
        Splat {
            position: [1.5, -2.25, 3.0],
            scale_m: [0.5, 0.25, 0.01],
            rotation: [1.0, 0.0, 0.0, 0.0],
            colour: [0.1, 0.5, 0.9],
            opacity: 0.75,
        },
        Splat {
            position: [-100.0, 200.0, -3.5],
            scale_m: [4.0, 1e-3, 1e-4],
            rotation: [half, 0.0, half, 0.0],
            colour: [0.0, 1.0, 0.25],
            opacity: 0.99,
        },
    ]
}

fn close(a: &Splat, b: &Splat) -> bool {
    let pairs = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 2e-6 * (1.0 + a.abs()));
    pairs(&a.position, &b.position)
        && pairs(&a.scale_m[..2], &b.scale_m[..2])
        && pairs(&a.rotation, &b.rotation)
        && pairs(&a.colour, &b.colour)
        && pairs(&[a.opacity], &[b.opacity])
}

#[test]
fn every_layout_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    for form in [SplatForm::Ellipsoids, SplatForm::Discs] {
        for sh_degree in 0..=3 {
            let layout = SplatLayout { form, sh_degree };
            let path = folder.path().join("s.ply");
            write(&path, &splats(), &origin(), layout, true).unwrap();
            let file = read(&path).unwrap();
            assert_eq!((file.layout, file.origin), (layout, Some(origin())));
            assert!(file.splats.iter().zip(&splats()).all(|(a, b)| close(a, b)), "{:?}", file.splats);
        }
    }
}

/// A foreign file keeps its harmonics, also in another degree; zeros are none.
#[test]
fn harmonics_come_back_padded_or_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    let coefficients: Vec<f32> = (0..48).map(|i| 0.25 * i as f32 - 3.0).collect();
    let harmonics = gaussian::SplatHarmonics::new(2, coefficients).unwrap();
    for sh_degree in 1..=3 {
        let layout = SplatLayout { form: SplatForm::Discs, sh_degree };
        // Files of other programs have no origin beside.
        let known = Some(harmonics.clone());
        write_file(&path, &SplatFile { splats: splats(), harmonics: known, labels: None, layout, origin: None }, true)
            .unwrap();
        let file = read(&path).unwrap();
        let found = file.harmonics.unwrap();
        assert_eq!((found.degree(), file.origin), (sh_degree, None));
        let both = found.of(1, 2).len().min(8);
        assert_eq!(found.of(1, 2)[..both], harmonics.of(1, 2)[..both]);
        assert!(found.of(1, 2)[both..].iter().all(|c| *c == 0.0));
    }
    let layout = SplatLayout { sh_degree: 3, ..SplatLayout::default() };
    write(&path, &splats(), &origin(), layout, true).unwrap();
    assert_eq!(read(&path).unwrap().harmonics, None);
    let broken = gaussian::SplatHarmonics::new(1, vec![f32::NAN; 18]).unwrap();
    let broken = SplatFile { splats: splats(), harmonics: Some(broken), labels: None, layout, origin: Some(origin()) };
    write_file(&path, &broken, true).unwrap();
    assert!(read(&path).unwrap_err().to_string().contains("splat 0: a harmonic is not finite"));
}

/// Labels and their table come back, and loaders that know nothing of them read the rest.
#[test]
fn labels_come_back_with_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    let labels = [SplatLabel { class: 2, object: 70_000_001 }, SplatLabel::NONE];
    let mut table = LabelTable::default();
    table.classes.insert(2, "RoofSurface".to_owned());
    let attributes = [("storeys".to_owned(), 3.into())].into_iter().collect();
    let [id, kind, building] = ["part", "BuildingPart", "house"].map(str::to_owned);
    table.objects.push(LabelledObject { number: 70_000_001, id, kind, building, attributes });
    let labels = SplatLabels { of: labels.to_vec(), table };
    let layout = SplatLayout { form: SplatForm::Discs, sh_degree: 1 };
    let harmonics = gaussian::SplatHarmonics::new(1, (0..18).map(|i| i as f32 - 4.0).collect());
    let file = SplatFile { splats: splats(), harmonics, labels: Some(labels), layout, origin: Some(origin()) };
    write_file(&path, &file, false).unwrap();
    let back = read(&path).unwrap();
    assert_eq!((&back.labels, &back.harmonics, &back.origin), (&file.labels, &file.harmonics, &file.origin));
    assert!(back.splats.iter().zip(&splats()).all(|(a, b)| close(a, b)), "{:?}", back.splats);
    // The floats come first, where programs that count on their order find them.
    let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
    assert!(text.contains("property float rot_3\nproperty uchar class\nproperty uint object\nend_header\n"));
    // Without the table, the numbers are still there.
    std::fs::remove_file(objects_path(&path)).unwrap();
    let bare = read(&path).unwrap().labels.unwrap();
    assert_eq!((bare.of, bare.table), (file.labels.clone().unwrap().of, LabelTable::default()));
    std::fs::write(objects_path(&path), "[]").unwrap();
    assert!(read(&path).unwrap_err().to_string().contains("objects.json"));
    let few = SplatLabels { of: vec![SplatLabel::NONE], table: LabelTable::default() };
    let error = write_file(&path, &SplatFile { labels: Some(few), ..file }, true).unwrap_err();
    assert!(error.to_string().contains("there are 1 labels"));
}

/// Compares the first splat with what the loader of the original 3DGS code expects, computed by
/// hand.
#[test]
fn the_bytes_are_those_that_trainers_expect() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    write(&path, &splats(), &origin(), SplatLayout { sh_degree: 3, ..SplatLayout::default() }, false).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let mark = b"end_header\n";
    let end = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let names: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
    assert_eq!(names.len(), 62, "17 floats and 45 harmonics");
    assert_eq!((names[6], names[9], names[53], names[54]), ("f_dc_0", "f_rest_0", "f_rest_44", "opacity"));
    assert!(header.contains("element vertex 2\n"));
    assert_eq!(bytes.len() - end, 2 * 62 * 4);
    let row: Vec<f32> = bytes[end..end + 248].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let expected = |name: &str| row[names.iter().position(|n| *n == name).unwrap()];
    assert_eq!([expected("x"), expected("y"), expected("z")], [1.5, -2.25, 3.0]);
    assert_eq!([expected("nx"), expected("ny"), expected("nz")], [0.0, 0.0, 1.0]);
    assert!((expected("f_dc_0") - -1.417_963_1).abs() < 1e-6);
    assert_eq!((expected("f_dc_1"), expected("f_rest_20")), (0.0, 0.0));
    assert!((expected("opacity") - 3.0f32.ln()).abs() < 1e-6);
    assert!((expected("scale_0") - 0.5f32.ln()).abs() < 1e-6);
    assert_eq!([expected("rot_0"), expected("rot_1")], [1.0, 0.0]);
}

#[test]
fn nothing_is_replaced_and_no_nonsense_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    write(&path, &splats(), &origin(), SplatLayout::default(), false).unwrap();
    let again = write(&path, &splats(), &origin(), SplatLayout::default(), false).unwrap_err();
    assert_eq!((again.kind(), again.path()), (Kind::OutputExists, path.as_path()));
    let other = folder.path().join("t.ply");
    let mut broken = splats();
    broken[1].opacity = f32::NAN;
    let refused = write(&other, &broken, &origin(), SplatLayout::default(), false).unwrap_err();
    assert!(refused.to_string().starts_with("splat 1 cannot be written ("), "{refused}");
    assert!(std::error::Error::source(&refused).is_some_and(|defect| defect.is::<gaussian::SplatDefect>()));
    let degree = SplatLayout { sh_degree: 4, ..SplatLayout::default() };
    assert!(
        write(&other, &splats(), &origin(), degree, false)
            .unwrap_err()
            .to_string()
            .contains("the degree of the harmonics is 4")
    );
    assert!(!other.exists() && !origin_path(&other).exists());
}

#[test]
fn files_that_are_no_splats_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    let refused = |bytes: &[u8], words: &str| {
        std::fs::write(&path, bytes).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(b"", "does not begin with \"ply\"");
    refused(b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "binary_little_endian");
    refused(b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nend_header\n", "\"scale_0\"");
    refused(
        b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty list uchar int i\nend_header\n",
        "list property",
    );
    write(&path, &splats(), &origin(), SplatLayout::default(), true).unwrap();
    let good = std::fs::read(&path).unwrap();
    refused(&good[..good.len() - 1], "room for 1");
    let many = String::from_utf8_lossy(&good[..60]).replace("vertex 2", "vertex 18446744073709551615");
    refused(&[many.as_bytes(), &good[60..]].concat(), "announces");
    std::fs::write(origin_path(&path), "{}").unwrap();
    std::fs::write(&path, &good).unwrap();
    assert!(read(&path).unwrap_err().to_string().contains("not an origin"));
    std::fs::remove_file(origin_path(&path)).unwrap();
    assert_eq!(read(&path).unwrap().origin, None);
    assert!(read(&folder.path().join("none.ply")).unwrap_err().to_string().starts_with("cannot read the file ("));
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), cut in 0..600usize) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.ply");
        write(&path, &splats(), &origin(), SplatLayout::default(), true).unwrap();
        let mut broken = std::fs::read(&path).unwrap();
        broken.truncate(cut);
        broken.extend(bytes);
        std::fs::write(&path, &broken).unwrap();
        let _ = read(&path);
    }
}
