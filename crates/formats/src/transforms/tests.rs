//! Reads files as nerfstudio and Blender write them, and refuses invalid ones.

use camera::{ImagePoint, LensModel};

use super::*;

const UNIT: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

fn read_text(text: &str) -> Result<ColmapModel, Fault> {
    parse(text.as_bytes(), None)
}

fn one_frame(intrinsics: &str, matrix: &str) -> String {
    format!(r#"{{{intrinsics}"frames": [{{"file_path": "images/a.png", "transform_matrix": {matrix}}}]}}"#)
}

const SIMPLE: &str = r#""w": 640, "h": 480, "fl_x": 500, "#;

#[track_caller]
fn close(found: [f64; 3], expected: [f64; 3]) {
    assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-9), "{found:?}, expected {expected:?}");
}

#[test]
fn opengl_axes_become_those_of_colmap() {
    let text = one_frame(SIMPLE, "[[1,0,0,10],[0,1,0,20],[0,0,1,30],[0,0,0,1]]");
    let model = read_text(&text).unwrap();
    let pose = model.views[0].pose;
    close(pose.centre, [10.0, 20.0, 30.0]);
    // An OpenGL camera faces −z, its y axis points up.
    close(pose.camera_from_world([10.0, 20.0, 25.0]), [0.0, 0.0, 5.0]);
    close(pose.camera_from_world([10.0, 21.0, 30.0]), [0.0, -1.0, 0.0]);
    let lens = &model.lenses[0];
    assert_eq!((lens.model(), lens.focal_px()), (LensModel::Pinhole, [500.0, 500.0]));
    assert_eq!(lens.principal_point(), ImagePoint { sample: 319.5, line: 239.5 });
    assert_eq!((model.views[0].id, model.views[0].name.as_str()), (1, "images/a.png"));
}

#[test]
fn blender_has_an_angle_and_no_size() {
    let text = format!(
        r#"{{"camera_angle_x": 0.6911112070083618, "frames": [
            {{"file_path": "./train/r_0", "rotation": 0.01, "transform_matrix": {UNIT}}},
            {{"file_path": "./train/r_1", "rotation": 0.01, "transform_matrix": {UNIT}}}]}}"#
    );
    let model = parse(text.as_bytes(), Some([800, 800])).unwrap();
    // The focal length that NeRF's loaders compute for these scenes.
    assert!((model.lenses[0].focal_px()[0] - 1111.111).abs() < 1e-3);
    assert_eq!((model.lenses.len(), model.views[1].name.as_str()), (1, "train/r_1"));
    let Fault { what, place } = read_text(&text).unwrap_err();
    assert!(what.contains("give the size") && place == "frame 0", "{what}");
}

#[test]
fn frames_may_have_lenses_of_their_own() {
    let text = format!(
        r#"{{"w": 64, "h": 48, "fl_x": 50, "fl_y": 51, "cx": 30, "cy": 25, "k1": 0.1, "k2": 0.01, "p1": 1e-3, "p2": 2e-3,
            "camera_model": "OPENCV", "frames": [
            {{"file_path": "a", "transform_matrix": {UNIT}}},
            {{"file_path": "b", "transform_matrix": {UNIT}, "k3": 0.001}},
            {{"file_path": "c", "transform_matrix": {UNIT}, "camera_model": "OPENCV_FISHEYE", "p1": 0, "p2": 0, "k4": 1e-4}},
            {{"file_path": "d", "transform_matrix": {UNIT}}}]}}"#
    );
    let model = read_text(&text).unwrap();
    let lenses: Vec<_> = model.lenses.iter().map(Lens::model).collect();
    assert_eq!(lenses, [LensModel::OpenCv, LensModel::FullOpenCv, LensModel::OpenCvFisheye]);
    assert_eq!(model.views.iter().map(|view| view.lens).collect::<Vec<_>>(), [0, 1, 2, 0]);
    assert_eq!(model.lenses[0].parameters(), [50.0, 51.0, 29.5, 24.5, 0.1, 0.01, 1e-3, 2e-3]);
    assert_eq!(model.lenses[1].parameters()[4..], [0.1, 0.01, 1e-3, 2e-3, 0.001, 0.0, 0.0, 0.0]);
}

#[test]
fn what_nerfstudio_applied_is_undone() {
    // The usual transform of nerfstudio swaps x and y and negates z.
    let applied = r#""applied_transform": [[0,1,0,0],[1,0,0,0],[0,0,-1,0]], "applied_scale": 2, "#;
    let text = one_frame(&format!("{SIMPLE}{applied}"), "[[1,0,0,2],[0,1,0,4],[0,0,1,6],[0,0,0,1]]");
    let pose = read_text(&text).unwrap().views[0].pose;
    close(pose.centre, [2.0, 1.0, -3.0]);
    // The camera faces −z of the world of the file, which is +z of the original world.
    close(pose.rotation[2], [0.0, 0.0, 1.0]);
}

#[test]
fn hostile_files_are_refused_with_their_place() {
    #[track_caller]
    fn refused(text: &str, words: &str, place: &str) {
        let Fault { what, place: found } = read_text(text).unwrap_err();
        assert!(what.contains(words) && found == place, "{what} ({found})");
    }
    let matrix = |matrix: &str| one_frame(SIMPLE, matrix);
    let lens = |intrinsics: &str| one_frame(intrinsics, UNIT);
    refused("", "EOF", "JSON");
    refused("[1]", "invalid type", "JSON");
    refused("{}", "frames", "JSON");
    refused(&format!(r#"{{"frames": [], "x": {}"#, "[".repeat(100_000)), "recursion", "JSON");
    refused(&matrix("[[NaN,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), "expected value", "JSON");
    refused(&matrix("[[1e400,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), "out of range", "JSON");
    refused(&matrix("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]"), "scale is 0", "frame 0");
    refused(&matrix("[[1,0,0,0],[1,0,0,0],[0,0,1,0],[0,0,0,1]]"), "scale is 0", "frame 0");
    refused(&matrix("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]"), "scales by 2", "frame 0");
    refused(&matrix("[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]"), "mirrors", "frame 0");
    refused(&matrix("[[1,0.2,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), "no rotation", "frame 0");
    refused(&matrix("[[1,0,0],[0,1,0],[0,0,1]]"), "rows of four", "frame 0");
    refused(&matrix("[]"), "rows of four", "frame 0");
    refused(&lens(r#""w": 640, "h": 480, "#), "the focal length is missing", "frame 0");
    refused(&lens(r#""w": 1e18, "h": 480, "fl_x": 1, "#), "side of the image", "frame 0");
    refused(&lens(r#""w": 0.5, "h": 480, "fl_x": 1, "#), "side of the image", "frame 0");
    refused(&lens(r#""w": 640, "fl_x": 1, "#), "give the size", "frame 0");
    refused(&lens(r#""w": 64, "h": 48, "fl_x": -1, "#), "positive", "frame 0");
    refused(&lens(r#""w": 64, "h": 48, "camera_angle_x": 4, "#), "expected more than 0", "frame 0");
    refused(&lens(r#""w": 64, "h": 48, "fl_x": 1, "k4": 0.1, "#), "k4", "frame 0");
    refused(&lens(r#""w": 64, "h": 48, "fl_x": 1, "camera_model": "EQUIRECTANGULAR", "#), "EQUIRECT", "frame 0");
    refused(&lens(r#""w": 64, "h": 48, "fl_x": 1, "is_fisheye": true, "p1": 0.1, "#), "fisheye", "frame 0");
    refused(&lens(r#""w": 64, "h": 48, "fl_x": 1, "applied_scale": 0, "#), "scale is 0", "applied_transform");
    for name in ["../../x", "/etc/x", "", "a/../../x", "..\\\\x", "./"] {
        let text = one_frame(SIMPLE, UNIT).replace("images/a.png", name);
        refused(&text, "leads out", "frame 0");
    }
}

#[test]
fn the_file_is_read_from_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    std::fs::write(&path, one_frame(SIMPLE, UNIT)).unwrap();
    assert_eq!(read(&path, None).unwrap().views.len(), 1);
    let missing = read(folder.path().join("none"), None).unwrap_err().to_string();
    assert!(missing.starts_with("cannot read the file ("), "{missing}");
    std::fs::write(&path, "{").unwrap();
    let broken = read(&path, None).unwrap_err().to_string();
    assert!(broken.ends_with(&format!(" (JSON): {}", path.display())), "{broken}");
}
