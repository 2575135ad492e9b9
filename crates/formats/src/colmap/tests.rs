//! Reads valid, broken and hostile COLMAP models in text and binary.

use super::*;
use crate::format_error::FormatError;

const CAMERAS: &str = "# comment\n7 PINHOLE 640 480 500 510 320 240\n9 SIMPLE_RADIAL 64 48 50 32 24 0.1\n";
const IMAGES: &str = "# comment\n\n1 1 0 0 0 1 2 3 7 a b.png\n1.0 2.0 -1\n\
    2 0.5 0.5 0.5 0.5 0 0 0 9 sub/c.png\n\n3 1 0 0 0 0 0 0 7 d.png";

fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

fn read_text(cameras: &str, images: &str) -> Result<ColmapModel, FormatError> {
    read(folder(&[("cameras.txt", cameras.as_bytes()), ("images.txt", images.as_bytes())]).path())
}

/// The same model in binary.
fn binary_model() -> (Vec<u8>, Vec<u8>) {
    let mut cameras = 2u64.to_le_bytes().to_vec();
    let all: [(u32, u32, [u64; 2], &[f64]); 2] =
        [(7, 1, [640, 480], &[500.0, 510.0, 320.0, 240.0]), (9, 2, [64, 48], &[50.0, 32.0, 24.0, 0.1])];
    for (id, model, size, parameters) in all {
        cameras.extend(id.to_le_bytes());
        cameras.extend(model.to_le_bytes());
        size.iter().for_each(|s| cameras.extend(s.to_le_bytes()));
        parameters.iter().for_each(|p| cameras.extend(p.to_le_bytes()));
    }
    let mut images = 3u64.to_le_bytes().to_vec();
    let all: [(u32, [f64; 7], u32, &str, u64); 3] = [
        (1, [1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0], 7, "a b.png", 2),
        (2, [0.5, 0.5, 0.5, 0.5, 0.0, 0.0, 0.0], 9, "sub/c.png", 0),
        (3, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 7, "d.png", 0),
    ];
    for (id, pose, camera, name, points) in all {
        images.extend(id.to_le_bytes());
        pose.iter().for_each(|p| images.extend(p.to_le_bytes()));
        images.extend(camera.to_le_bytes());
        images.extend(name.bytes().chain([0]));
        images.extend(points.to_le_bytes());
        images.extend(std::iter::repeat_n(0xff, 24 * points as usize));
    }
    (cameras, images)
}

fn read_binary(cameras: &[u8], images: &[u8]) -> Result<ColmapModel, FormatError> {
    read(folder(&[("cameras.bin", cameras), ("images.bin", images)]).path())
}

#[track_caller]
fn refused(result: Result<ColmapModel, FormatError>, words: &str, place: &str) {
    let error = result.unwrap_err();
    let (text, path) = (error.to_string(), error.path().display().to_string());
    assert!(text.contains(words) && text.ends_with(&format!(" ({place}): {path}")), "{text}");
}

#[test]
fn text_and_binary_give_the_same_model() {
    let model = read_text(CAMERAS, IMAGES).unwrap();
    let (cameras, images) = binary_model();
    assert_eq!(model, read_binary(&cameras, &images).unwrap());
    assert_eq!(model.lenses[0].principal_point(), camera::ImagePoint { sample: 319.5, line: 239.5 });
    assert_eq!(model.lenses[1].principal_point(), camera::ImagePoint { sample: 31.5, line: 23.5 });
    let names: Vec<_> = model.views.iter().map(|v| (v.id, v.name.as_str(), v.lens)).collect();
    assert_eq!(names, [(1, "a b.png", 0), (2, "sub/c.png", 1), (3, "d.png", 0)]);
    assert_eq!(model.views[0].pose.centre, [-1.0, -2.0, -3.0]);
}

#[test]
fn broken_text_is_refused_with_its_line() {
    refused(read_text("1 PINHOLE 640 480 500 510 320", IMAGES), "4 parameters, found 3", "line 1");
    refused(read_text("1 PINHOLE 640 480 1 1 1 1 1", IMAGES), "4 parameters, found 5", "line 1");
    refused(read_text("\n1 EYE 640 480", IMAGES), "not the name of a COLMAP camera model", "line 2");
    refused(read_text("1 PINHOLE 640 x", IMAGES), "expected a number", "line 1");
    refused(read_text("1 PINHOLE 18446744073709551615 480 1 1 1 1", IMAGES), "pixels", "line 1");
    refused(read_text("1 PINHOLE 640 480 NaN 1 1 1", IMAGES), "parameter 0", "line 1");
    refused(read_text(&format!("{CAMERAS}7 PINHOLE 8 8 1 1 1 1"), IMAGES), "second time", "line 4");
    refused(read_text(CAMERAS, "1 1 0 0"), "ends before the pose", "line 1");
    refused(read_text(CAMERAS, "1 0 0 0 0 0 0 0 7 a.png"), "pose", "line 1");
    refused(read_text(CAMERAS, "1 1 0 0 0 0 0 0 8 a.png"), "camera 8", "line 1");
    refused(read_text(CAMERAS, "1 1 0 0 0 0 0 0 7 a.png\n\n1 1 0 0 0 0 0 0 7 b.png"), "second time", "line 3");
    for name in ["../../x", "/etc/x", "", "a/../../x", "..\\x"] {
        refused(read_text(CAMERAS, &format!("1 1 0 0 0 0 0 0 7 {name}")), "leads out", "line 1");
    }
}

#[test]
fn broken_binaries_are_refused_with_their_byte() {
    let (cameras, images) = binary_model();
    for count in [3u64, 1 << 40, u64::MAX] {
        let mut many = cameras.clone();
        many[..8].copy_from_slice(&count.to_le_bytes());
        refused(
            read_binary(&many, &images),
            if count == 3 { "ends" } else { "room for" },
            if count == 3 { "byte 120" } else { "byte 0" },
        );
        let mut many = images.clone();
        // The points of the first image follow its name.
        many[80..88].copy_from_slice(&count.saturating_mul(1 << 30).to_le_bytes());
        refused(read_binary(&cameras, &many), "the points of an image", "byte 88");
    }
    for end in 0..cameras.len() {
        assert!(read_binary(&cameras[..end], &images).is_err(), "{end}");
    }
    for end in 0..images.len() {
        assert!(read_binary(&cameras, &images[..end]).is_err(), "{end}");
    }
    let mut odd = cameras.clone();
    odd[12] = 99;
    refused(read_binary(&odd, &images), "99 is not the number of a COLMAP camera model", "byte 8");
}

#[test]
fn a_folder_without_a_model() {
    let folder = folder(&[("cameras.txt", b"")]);
    for (folder, name) in [(folder.path().to_owned(), "images"), (folder.path().join("none"), "cameras")] {
        let error = read(&folder).unwrap_err();
        assert_eq!(error.path(), folder);
        assert!(
            error.to_string().starts_with(&format!("the folder holds neither {name}.bin nor {name}.txt, ")),
            "{error}"
        );
    }
}

#[test]
fn real_models_are_read() {
    let Some(data) = testing::shared_data("city") else { return };
    for (folder, lenses, views) in [
        ("colmap/Abu2005G+ARKit_To_3DGSFormat/sparse/0", 1, 20),
        ("colmap/bartoszek+test_colmap/sparse/0", 23, 23),
        ("colmap/bartoszek+test_colmap/dense/0/sparse", 23, 23),
        ("peer_reference/sparse/0", 1, 100),
    ] {
        let model = read(&data.join(folder)).unwrap();
        assert_eq!((model.lenses.len(), model.views.len()), (lenses, views), "{folder}");
    }
}
