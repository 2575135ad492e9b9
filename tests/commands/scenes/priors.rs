//! `skysweep priors` from the command line: a whole dataset, what is refused, and that nothing is
//! left behind.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use camera::{Lens, LensModel, Pose};
use formats::colmap::{self, ColmapEncoding, ColmapModel, ColmapPoint, ColmapView};
use formats::npy::NpyData;
use serde_json::Value;

/// A house of 8 × 6 m with a ridge, in EPSG:25832.
const MODEL: &str = r#"{"type":"CityJSON","version":"2.0",
    "metadata":{"referenceSystem":"https://www.opengis.net/def/crs/EPSG/0/25832"},
    "transform":{"scale":[0.5,0.5,0.5],"translate":[500000.0,5700000.0,30.0]},
    "CityObjects":{"house":{"type":"Building","geometry":[{"type":"Solid","lod":"2.2","boundaries":[[
            [[0,3,2,1]],[[0,1,5,4]],[[2,3,7,6]],[[1,2,6,9,5]],[[3,0,4,8,7]],[[4,5,9,8]],[[6,7,8,9]]]],
            "semantics":{"surfaces":[{"type":"GroundSurface"},{"type":"WallSurface"},{"type":"RoofSurface"}],
                "values":[[0,1,1,1,1,2,2]]}}]}BROKEN},
    "vertices":[[0,0,0],[16,0,0],[16,12,0],[0,12,0],[0,0,6],[16,0,6],[16,12,6],[0,12,6],[0,6,10],[16,6,10]]}"#;
const BROKEN: &str =
    r#","line":{"type":"Building","geometry":[{"type":"MultiSurface","lod":"2","boundaries":[[[0,1,0]]]}]}"#;
pub(super) const OFFSET: [&str; 4] = ["--offset", "500004", "5700003", "30"];
pub(super) const SIZE: [usize; 2] = [64, 48];

pub(super) struct Bench {
    pub(super) folder: tempfile::TempDir,
}

impl Bench {
    pub(super) fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        std::fs::write(bench.path("house.city.json"), MODEL.replace("BROKEN", "")).unwrap();
        bench.write_cameras(&ring(4), &[]);
        bench
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write_cameras(&self, model: &ColmapModel, points: &[ColmapPoint]) {
        let sparse = self.path("scene/sparse/0");
        std::fs::create_dir_all(&sparse).unwrap();
        colmap::write(&sparse, model, points, ColmapEncoding::Text, true).unwrap();
    }

    pub(super) fn run(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        let fixed = ["priors", "house.city.json", "--cameras", "scene", "--points", "2000", "--progress", "none"];
        let mut command = Command::cargo_bin("skysweep").unwrap();
        command.current_dir(self.folder.path()).args(fixed).args(arguments).assert()
    }

    #[track_caller]
    fn refused(&self, arguments: &[&str], words: &str) {
        let assert = self.run(&[&OFFSET[..], &["-o", "out"], arguments].concat()).code(2);
        let told = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(told.contains(words), "{words:?} is not in\n{told}");
        assert!(!self.path("out").exists(), "something was left behind");
    }

    pub(super) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&std::fs::read(self.path(name)).unwrap()).unwrap()
    }
}

fn lens(model: LensModel, centre: [f64; 2], rest: &[f64]) -> Lens {
    let focal: &[f64] = if model == LensModel::Pinhole || model == LensModel::OpenCv { &[50.0, 50.0] } else { &[50.0] };
    Lens::new(SIZE[0], SIZE[1], model, &[focal, &centre, rest].concat()).unwrap()
}

/// Cameras that look at the house from 25 m around and 20 m above.
fn ring(count: u32) -> ColmapModel {
    let view = |number: u32| {
        let angle = std::f64::consts::TAU * (f64::from(number) + 0.3) / f64::from(count);
        let centre = [25.0 * angle.cos(), 25.0 * angle.sin(), 20.0];
        let length = centre.iter().map(|c| c * c).sum::<f64>().sqrt();
        let forward = centre.map(|c| -c / length);
        let level = forward[0].hypot(forward[1]);
        let right = [forward[1] / level, -forward[0] / level, 0.0];
        let down = [-forward[2] * right[1], forward[2] * right[0], forward[0] * right[1] - forward[1] * right[0]];
        ColmapView {
            id: number + 1,
            name: format!("view_{}.png", number + 1),
            lens: 0,
            pose: Pose { rotation: [right, down, forward], centre },
        }
    };
    let lenses = vec![lens(LensModel::Pinhole, [31.5, 23.5], &[])];
    ColmapModel { lenses, views: (0..count).map(view).collect() }
}

fn floats(path: &Path) -> (Vec<usize>, Vec<f32>) {
    let array = formats::npy::read(path).unwrap();
    let NpyData::F32(data) = array.data else { panic!("{path:?} is not f32") };
    (array.shape, data)
}

fn ply_header(path: &Path) -> String {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[test]
fn a_whole_dataset() {
    let bench = Bench::new();
    let told = bench.run(&[&OFFSET[..], &["-o", "out", "--json", "--geotiff", "--extras"]].concat()).code(0);
    let report: Value = serde_json::from_slice(&told.get_output().stdout).unwrap();
    assert_eq!(report, bench.json("out/report.json"));
    let kept = report["kept"].as_u64().unwrap() as usize;
    assert!(kept > 500 && kept <= 2_000, "{kept}");
    let (text, points) = colmap::read_with_points(&bench.path("out/sparse/0")).unwrap();
    assert_eq!((text.views.len(), points.len()), (4, kept));
    assert!(points.iter().all(|p| p.track.len() >= 2));
    // Observations lie where the cameras see their points.
    for point in points.iter().step_by(17) {
        for seen in &point.track {
            let view = &text.views[seen.view as usize];
            let [x, y, z] = view.pose.camera_from_world(point.position);
            let pixel = text.lenses[view.lens].project(x / z, y / z).unwrap();
            assert!((pixel.sample - seen.pixel.sample).abs() + (pixel.line - seen.pixel.line).abs() < 1e-6);
        }
    }
    let mut top = 0.0f64;
    for view in 1..=4 {
        let (shape, depth) = floats(&bench.path(&format!("out/raw_depth/view_{view}.npy")));
        let (normal_shape, normal) = floats(&bench.path(&format!("out/raw_normal/view_{view}.npy")));
        assert_eq!((shape, normal_shape), (vec![SIZE[1], SIZE[0]], vec![SIZE[1], SIZE[0], 3]));
        let mask = formats::npy::read(bench.path(&format!("out/raw_mask/view_{view}.npy"))).unwrap();
        let NpyData::Bool(mask) = mask.data else { panic!("no bools") };
        let pose = text.views[view - 1].pose;
        for (i, (&z, n)) in depth.iter().zip(normal.chunks_exact(3)).enumerate() {
            assert_eq!(z.is_finite(), mask[i]);
            assert_eq!(n.iter().any(|c| *c != 0.0), mask[i]);
            if mask[i] {
                let ray = [((i % SIZE[0]) as f64 - 31.5) / 50.0, ((i / SIZE[0]) as f64 - 23.5) / 50.0, 1.0];
                let at = |k: usize| {
                    pose.centre[k] + f64::from(z) * (0..3).map(|j| pose.rotation[j][k] * ray[j]).sum::<f64>()
                };
                // On the house: 8 × 6 m around zero, up to 5 m.
                assert!(at(0).abs() < 4.001 && at(1).abs() < 3.001 && (-0.001..5.001).contains(&at(2)));
                top = top.max(at(2));
            }
        }
        for file in [
            "masks/view_1.png",
            "depth_png/view_1.png",
            "class/view_1.npy",
            "object/view_1.npy",
            "geotiff/view_1_depth.tif",
            "geotiff/view_1_normal.tif",
            "geotiff/view_1_class.tif",
            "geotiff/view_1_object.tif",
            "previews/view_1_depth.png",
            "previews/view_1_normal.png",
        ] {
            let name = format!("out/{}", file.replace("view_1", &format!("view_{view}")));
            assert!(bench.path(&name).metadata().is_ok_and(|m| m.len() > 60), "{name}");
        }
    }
    assert!(top > 4.5, "{top}");
    for ply in ["out/points3D.ply", "out/sparse/0/points3D.ply"] {
        let header = ply_header(&bench.path(ply));
        let words = "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float \
          ny\nproperty float nz\nproperty uchar red";
        assert!(header.contains(&format!("element vertex {kept}\n{words}")), "{header}");
    }
    assert!(ply_header(&bench.path("out/splats/splats_2dgs.ply")).contains(&format!("element vertex {kept}\n")));
    assert!(!ply_header(&bench.path("out/splats/splats_2dgs.ply")).contains("scale_2"));
    assert_eq!(bench.json("out/labels.json")["objects"][0]["id"], "house");
    assert_eq!(bench.json("out/schedule.json")["factors"]["depth"]["to_iteration"], 7_000);
    let origin = bench.json("out/origin.json");
    assert_eq!(origin["model_crs"], "EPSG:25832");
    assert_eq!(origin["model_from_dataset"]["translation"], serde_json::json!([500_004.0, 5_700_003.0, 30.0]));
    assert!(report["notes"][0].as_str().unwrap().contains("Ground surfaces"));
    assert!(std::fs::read_to_string(bench.path("out/report.html")).unwrap().contains("data:image/png"));
    assert!(!bench.path("out/.skysweep-partial").exists());
}

/// Each point is written once, and its size is said before the work and after it.
#[test]
fn a_dataset_is_compact_unless_more_is_asked_for() {
    let bench = Bench::new();
    let told = bench.run(&[&OFFSET[..], &["-o", "out"]].concat()).code(0);
    let (before, after) = (&told.get_output().stderr, &told.get_output().stdout);
    let (before, after) = (String::from_utf8_lossy(before), String::from_utf8_lossy(after));
    let size = before.lines().find(|line| line.starts_with("size ")).unwrap_or_else(|| panic!("{before}"));
    assert!(size.contains("at most ") && size.contains(" MB (the maps of 4 views and up to 2000 points)"), "{size}");
    assert!(after.contains("or more of 4 views\nwritten    ") && after.contains(" MB)"), "{after}");
    for file in ["sparse/0/points3D.bin", "sparse/0/images.bin", "sparse/0/points3D.ply", "raw_normal/view_1.npy"] {
        assert!(bench.path("out").join(file).is_file(), "{file}");
    }
    for file in ["sparse/0/points3D.txt", "points3D.ply", "splats"] {
        assert!(!bench.path("out").join(file).exists(), "{file}");
    }
}

#[test]
fn threads_change_nothing_and_overwrite_replaces() {
    let bench = Bench::new();
    let run = |out: &str, threads: &str, more: &[&str]| {
        let arguments = ["-o", out, "--threads", threads, "--geometric-error", "0.2"];
        bench.run(&[&OFFSET[..], &arguments, more].concat())
    };
    // --points and --geometric-error exclude each other.
    run("one", "1", &[]).code(2);
    let files = ["sparse/0/images.bin", "sparse/0/points3D.txt", "points3D.ply", "raw_depth/view_2.npy"];
    let go = |out: &str, threads: &str, more: &[&str]| {
        let base = ["-o", out, "--threads", threads, "--spacing", "poisson"];
        bench.run(&[&OFFSET[..], &base, more].concat())
    };
    go("one", "1", &["--extras"]).code(0);
    go("four", "4", &["--extras"]).code(0);
    for file in files {
        let read = |out: &str| std::fs::read(bench.path(out).join(file)).unwrap();
        assert!(read("one") == read("four"), "{file}");
    }
    let report = |out: &str| {
        let mut report = bench.json(&format!("{out}/report.json"));
        // The command lines name the folder.
        assert!(report["commands"].take()[0].as_str().unwrap().contains(&format!("-s {out} ")));
        report
    };
    assert_eq!(report("one"), report("four"));
    std::fs::write(bench.path("one/image.txt"), "mine").unwrap();
    go("one", "2", &[]).code(2);
    go("one", "2", &["--overwrite", "--maps-only"]).code(0);
    assert!(bench.path("one/image.txt").exists() && !bench.path("one/sparse").exists());
}

#[test]
fn a_similarity_scales_depths_and_turns_normals() {
    let bench = Bench::new();
    bench.run(&[&OFFSET[..], &["-o", "metres"]].concat()).code(0);
    // A frame of half metres, turned by a quarter about the vertical: (x, y) → (−y, x).
    let turned =
        r#"{"scale": 2.0, "rotation": [[0,-1,0],[1,0,0],[0,0,1]], "translation": [11400006.0, -1000008.0, -60.0]}"#;
    std::fs::write(bench.path("t.json"), turned).unwrap();
    let mut cameras = ring(4);
    let turn = |v: [f64; 3]| [-v[1], v[0], v[2]];
    for view in &mut cameras.views {
        view.pose = Pose { rotation: view.pose.rotation.map(turn), centre: turn(view.pose.centre).map(|c| 2.0 * c) };
    }
    bench.write_cameras(&cameras, &[]);
    bench.run(&["--transform", "t.json", "-o", "halves"]).code(0);
    let (_, metres) = floats(&bench.path("metres/raw_depth/view_1.npy"));
    let (_, halves) = floats(&bench.path("halves/raw_depth/view_1.npy"));
    let close = |(a, b): (&f32, &f32)| (a.is_infinite() && b.is_infinite()) || (2.0 * a - b).abs() < 1e-4;
    assert!(metres.iter().zip(&halves).filter(|&pair| close(pair)).count() > metres.len() - 4);
    let (_, before) = floats(&bench.path("metres/raw_normal/view_1.npy"));
    let (_, after) = floats(&bench.path("halves/raw_normal/view_1.npy"));
    let middle = 3 * (24 * SIZE[0] + 32);
    let expected = turn([0, 1, 2].map(|i| f64::from(before[middle + i])));
    assert!((0..3).all(|i| (expected[i] - f64::from(after[middle + i])).abs() < 1e-6), "{expected:?}");
}

#[test]
fn national_coordinates_of_cameras_are_moved_to_their_middle() {
    let bench = Bench::new();
    bench.run(&[&OFFSET[..], &["-o", "near"]].concat()).code(0);
    let mut cameras = ring(4);
    for view in &mut cameras.views {
        view.pose.centre = [0, 1, 2].map(|i| view.pose.centre[i] + [500_004.0, 5_700_003.0, 30.0][i]);
    }
    bench.write_cameras(&cameras, &[]);
    bench.run(&["-o", "far"]).code(0);
    let (_, near) = floats(&bench.path("near/raw_depth/view_3.npy"));
    let (_, far) = floats(&bench.path("far/raw_depth/view_3.npy"));
    // Poses come through quaternion and translation, which at 5,700 km keep a nanometre.
    assert!(near.iter().zip(&far).filter(|(a, b)| a == b || (**a - **b).abs() < 1e-4).count() > near.len() - 4);
    let moved = bench.json("far/origin.json");
    assert_eq!(moved["cameras_moved_by"][0], 500_004.0);
    assert!(colmap::read(&bench.path("far/sparse/0")).unwrap().views[0].pose.centre[0].abs() < 30.0);
}

#[test]
fn lenses_that_trainers_get_wrong_are_refused() {
    let bench = Bench::new();
    let with = |lens: Lens| {
        let mut cameras = ring(4);
        cameras.lenses = vec![lens];
        bench.write_cameras(&cameras, &[]);
    };
    with(lens(LensModel::OpenCv, [31.5, 23.5], &[-0.1, 0.0, 0.0, 0.0]));
    bench.refused(&[], "OPENCV");
    bench.run(&[&OFFSET[..], &["-o", "maps", "--maps-only"]].concat()).code(0);
    assert!(bench.path("maps/raw_depth/view_1.npy").exists() && !bench.path("maps/points3D.ply").exists());
    with(lens(LensModel::Pinhole, [36.5, 22.5], &[]));
    bench.refused(&[], "principal point is +5.00, -1.00 px");
    bench.run(&[&OFFSET[..], &["-o", "gsplat", "--trainer", "gsplat"]].concat()).code(0);
    bench.run(&[&OFFSET[..], &["-o", "cropped", "--recrop"]].concat()).code(0);
    let crop = &bench.json("cropped/crops.json")["view_1.png"];
    assert_eq!(*crop, serde_json::json!({ "x": 10, "y": 0, "width": 54, "height": 46 }));
    assert_eq!(floats(&bench.path("cropped/raw_depth/view_1.npy")).0, [46, 54]);
    let cropped = colmap::read(&bench.path("cropped/sparse/0")).unwrap();
    assert_eq!(cropped.lenses[0].principal_point(), camera::ImagePoint { sample: 26.5, line: 22.5 });
    with(lens(LensModel::Pinhole, [60.0, 23.5], &[]));
    bench.refused(&["--recrop"], "less than half");
    with(lens(LensModel::SimplePinhole, [31.5, 23.5], &[]));
    bench.run(&[&OFFSET[..], &["-o", "simple", "--extras"]].concat()).code(0);
    let text = std::fs::read_to_string(bench.path("simple/sparse/0/cameras.txt")).unwrap();
    assert!(text.contains("1 PINHOLE 64 48 50.0 50.0 32.0 24.0"), "{text}");
}

#[test]
fn names_that_cannot_be_paired_are_refused() {
    let bench = Bench::new();
    let rename = |names: [&str; 2]| {
        let path = bench.path("scene/sparse/0/images.txt");
        bench.write_cameras(&ring(4), &[]);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("view_1.png", names[0]).replace("view_2.png", names[1])).unwrap();
    };
    for (names, words) in [
        (["view.1.png", "b.png"], "dot before its ending"),
        (["../../x.png", "b.png"], "leads out of its folder"),
        (["/etc/x.png", "b.png"], "leads out of its folder"),
        (["left/a.png", "right/A.jpg"], "same file stem"),
        ([".png", "b.png"], "gives no file name"),
    ] {
        rename(names);
        bench.refused(&[], words);
    }
}

#[test]
fn bad_input_is_told_and_leaves_nothing() {
    let bench = Bench::new();
    for (arguments, words) in [
        (&["--density", "1e12"][..], "cannot be used with"),
        (&["--epsilon", "-1"], "unexpected argument"),
        (&["--epsilon", "nan"], "ε is NaN"),
        (&["--max-observations", "0"], "1 to 255"),
        (&["--class-weight", "spire=2"], "no class \"spire\""),
        (&["--class-weight", "roof=-2"], "weight of a class is -2"),
        (&["--lod", "3"], "no object of the model could be used"),
        (&["--class-weight", "roof=0", "--class-weight", "wall=0"], "no surface is left to sample"),
    ] {
        bench.refused(arguments, words);
    }
    let out = ["-o", "out"];
    let told = |arguments: &[&str]| {
        let assert = bench.run(&[arguments, &out].concat()).code(2);
        assert!(!bench.path("out").exists());
        String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
    };
    // Without the offset the cameras are 5,700 km away.
    assert!(told(&[]).contains("--offset or --transform"));
    assert!(told(&["--offset", "nan", "0", "0"]).contains("not finite"));
    std::fs::write(bench.path("t.json"), r#"{"scale": -1}"#).unwrap();
    assert!(told(&["--transform", "t.json"]).contains("scale is -1"));
    assert!(told(&["--transform", "missing.json"]).contains("cannot read"));
    let sparse = bench.path("scene/sparse/0");
    std::fs::write(sparse.join("cameras.bin"), u64::MAX.to_le_bytes()).unwrap();
    assert!(told(&OFFSET).contains("cameras.bin"));
    std::fs::remove_file(sparse.join("cameras.bin")).unwrap();
    let huge = "1 PINHOLE 16777216 16777216 50 50 8388608 8388608\n";
    std::fs::write(sparse.join("cameras.txt"), huge).unwrap();
    assert!(told(&OFFSET).contains("pixels, up to"));
    std::fs::remove_dir_all(bench.path("scene")).unwrap();
    assert!(told(&OFFSET).contains("found no cameras"));
    std::fs::write(bench.path("out"), "a file").unwrap();
    bench.run(&[&OFFSET[..], &out].concat()).code(2);
    assert_eq!(std::fs::read_to_string(bench.path("out")).unwrap(), "a file");
}

/// A picture whose pixels tell where they are.
fn picture(path: &Path, size: [usize; 2]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_fn(size[0] as u32, size[1] as u32, |x, y| image::Rgb([x as u8, y as u8, 200]))
        .save(path)
        .unwrap();
}

#[test]
fn pictures_are_masked_for_buildings_alone_and_copied_otherwise() {
    let bench = Bench::new();
    bench.refused(&["--images"], "there is no picture of the camera \"view_1.png\"");
    for number in 1..=4 {
        picture(&bench.path(&format!("scene/images/view_{number}.png")), SIZE);
    }
    bench.run(&[&OFFSET[..], &["-o", "copied", "--images", "--mode", "building-enhanced"]].concat()).code(0);
    let read = |path: &str| std::fs::read(bench.path(path)).unwrap();
    assert!(read("copied/images/view_3.png") == read("scene/images/view_3.png"));
    let alone = ["-o", "alone", "--images=scene/images"];
    bench.run(&[&OFFSET[..], &alone].concat()).code(0);
    let masked = image::open(bench.path("alone/images/view_2.png")).unwrap();
    let masked = masked.as_rgba8().expect("red, green, blue and alpha");
    let mask = formats::npy::read(bench.path("alone/raw_mask/view_2.npy")).unwrap();
    let NpyData::Bool(mask) = mask.data else { panic!("a mask of truth values") };
    assert!(mask.iter().any(|m| *m) && mask.iter().any(|m| !*m));
    for ((x, y, pixel), shown) in masked.enumerate_pixels().zip(mask) {
        assert_eq!(pixel.0, if shown { [x as u8, y as u8, 200, 255] } else { [0; 4] }, "{x}, {y}");
    }
    // The originals are never replaced by masked ones: neither a user's own nor copies of an
    // earlier run.
    let own = (["-o", "scene", "--images", "--overwrite"], "view_1.png");
    let copies = (["-o", "copied", "--images=copied/images", "--overwrite"], "lies in the folder that the dataset's");
    for (options, reason) in [own, copies] {
        let told = bench.run(&[&OFFSET[..], &options].concat()).code(2);
        let told = String::from_utf8_lossy(&told.get_output().stderr).into_owned();
        assert!(told.contains(reason), "{told}");
    }
    assert!(read("copied/images/view_3.png") == read("scene/images/view_3.png"));
    picture(&bench.path("scene/images/view_4.png"), [SIZE[0] + 1, SIZE[1]]);
    bench.refused(&["--images"], "has 65 x 48 pixels, its camera needs 64 x 48");
    // Cropped cameras have cropped pictures.
    let mut cameras = ring(4);
    cameras.lenses = vec![lens(LensModel::Pinhole, [36.5, 22.5], &[])];
    bench.write_cameras(&cameras, &[]);
    bench
        .run(&[&OFFSET[..], &["-o", "cropped", "--recrop", "--images", "--mode", "building-enhanced"]].concat())
        .code(0);
    let cropped = image::open(bench.path("cropped/images/view_1.png")).unwrap().to_rgba8();
    assert_eq!(cropped.dimensions(), (54, 46));
    assert_eq!(cropped.get_pixel(0, 0).0, [10, 0, 200, 255]);
}

#[test]
fn names_with_folders_keep_them_for_the_trainers_that_know_them() {
    let bench = Bench::new();
    let mut cameras = ring(4);
    for (number, view) in cameras.views.iter_mut().enumerate() {
        view.name = format!("{}/image_{}.png", ["left", "right"][number % 2], number / 2);
        picture(&bench.path("pictures").join(&view.name), SIZE);
    }
    bench.write_cameras(&cameras, &[]);
    // 2DGS leaves out the folders, and two images would share their maps.
    bench.refused(&["--images=pictures"], "same file stem");
    let wanted = ["-o", "nested out", "--trainer", "gsplat", "--images=pictures", "--geotiff", "--json"];
    let told = bench.run(&[&OFFSET[..], &wanted].concat()).code(0);
    let maps = ["raw_depth/left/image_1.npy", "masks/right/image_0.png", "images/right/image_1.png"];
    let more = ["depth_png/left/image_0.png", "previews/left/image_0.png"];
    for file in maps.into_iter().chain(more) {
        assert!(bench.path("nested out").join(file).is_file(), "{file}");
    }
    let report: Value = serde_json::from_slice(&told.get_output().stdout).unwrap();
    let commands = report["commands"].as_array().unwrap();
    let step = report["depth_png_step"].as_f64().unwrap();
    let has = |words: &str| commands.iter().any(|line| line.as_str().unwrap().contains(words));
    assert!(has("simple_trainer_2dgs.py --data_dir 'nested out' --data_factor 1"), "{commands:?}");
    assert!(has(&format!("--depth-unit-scale-factor {step}")), "{commands:?}");
    // The last one is our own, and it runs.
    let own = commands.last().unwrap().as_str().unwrap();
    assert_eq!(own, "skysweep train 'nested out' -o 'nested out_trained'");
    let train = ["train", "nested out", "-o", "trained", "--iterations", "2", "--progress", "none"];
    Command::cargo_bin("skysweep").unwrap().current_dir(bench.folder.path()).args(train).assert().code(0);
}

#[test]
fn misses_have_the_depth_that_the_reader_expects() {
    let bench = Bench::new();
    for (miss, is) in [("0", (|d: f32| d == 0.0) as fn(f32) -> bool), ("nan", f32::is_nan), ("inf", f32::is_infinite)] {
        bench.run(&[&OFFSET[..], &["-o", miss, "--miss", miss, "--maps-only"]].concat()).code(0);
        let (_, depth) = floats(&bench.path(miss).join("raw_depth/view_1.npy"));
        let misses = depth.iter().filter(|depth| is(**depth)).count();
        let hits = depth.iter().filter(|depth| (10.0..50.0).contains(*depth)).count();
        assert!(misses > 100 && hits > 100 && misses + hits == depth.len(), "{miss}: {misses}, {hits}");
    }
}

#[test]
fn lost_objects_are_told_by_the_exit_code() {
    let bench = Bench::new();
    std::fs::write(bench.path("house.city.json"), MODEL.replace("BROKEN", BROKEN)).unwrap();
    bench.run(&[&OFFSET[..], &["-o", "out"]].concat()).code(1);
    let notes = bench.json("out/report.json")["notes"].to_string();
    assert!(notes.contains("1 object of the model could not be used"), "{notes}");
}

#[test]
fn the_enhanced_mode_keeps_the_points_of_the_scene() {
    let bench = Bench::new();
    let seen = formats::colmap::ColmapObservation { view: 1, pixel: camera::ImagePoint { sample: 10.0, line: 11.0 } };
    let tree = ColmapPoint { position: [9.0, 1.0, 2.0], color: [1, 200, 3], error_px: 0.4, track: vec![seen] };
    bench.write_cameras(&ring(4), std::slice::from_ref(&tree));
    bench.run(&[&OFFSET[..], &["-o", "only"]].concat()).code(0);
    bench.run(&[&OFFSET[..], &["-o", "enhanced", "--mode", "building-enhanced"]].concat()).code(0);
    let points = |out: &str| colmap::read_with_points(&bench.path(out).join("sparse/0")).unwrap().1;
    assert!(!points("only").contains(&tree));
    assert_eq!(points("enhanced").last(), Some(&tree));
    assert_eq!(bench.json("enhanced/report.json")["scene_points"], 1);
}

#[test]
fn transforms_json_serves_as_well() {
    let bench = Bench::new();
    // Above the house, looking straight down, with OpenGL's axes.
    let frame = |name: &str, x: f64| {
        format!(r#"{{"file_path": "{name}", "transform_matrix": [[1,0,0,{x}],[0,1,0,0],[0,0,1,30],[0,0,0,1]]}}"#)
    };
    let text = format!(
        r#"{{"w": 64, "h": 48, "fl_x": 80, "fl_y": 80, "cx": 32, "cy": 24, "frames": [{}, {}]}}"#,
        frame("images/a.png", 0.5),
        frame("images/b.png", -0.5)
    );
    std::fs::write(bench.path("transforms.json"), text).unwrap();
    let arguments = ["priors", "house.city.json", "--cameras", "transforms.json", "--density", "20", "-o", "out", "-q"];
    let mut command = Command::cargo_bin("skysweep").unwrap();
    command.current_dir(bench.folder.path()).args(arguments).args(OFFSET).assert().code(0);
    let (_, depth) = floats(&bench.path("out/raw_depth/a.npy"));
    let nearest = depth.iter().copied().fold(f32::INFINITY, f32::min);
    // The ridge is 5 m high.
    assert!((25.0..25.4).contains(&nearest), "{nearest}");
}

/// The two lines of the README: the sample town in the cameras of a flight, and in its satellite
/// images.
#[test]
fn the_sample_town() {
    let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town");
    let folder = tempfile::tempdir().unwrap();
    let run = |cameras: &[&str], out: &str, more: &[&str]| {
        let mut command = Command::cargo_bin("skysweep").unwrap();
        command.current_dir(&town).args(["priors", "truth/buildings.city.json", "--cameras"]).args(cameras).args(more);
        let assert =
            command.arg("-o").arg(folder.path().join(out)).args(["--json", "--progress", "none"]).assert().code(0);
        serde_json::from_slice::<Value>(&assert.get_output().stdout).unwrap()
    };
    let flight = run(&["cameras"], "flight", &["--points", "20000"]);
    assert!(flight["kept"].as_u64().unwrap() > 5_000, "{flight}");
    let views = flight["views"].as_array().unwrap();
    assert!(views.iter().all(|view| view["hit_pixels"].as_u64().unwrap() > 20_000), "{flight}");
    assert!(folder.path().join("flight/previews/flight_01.png").is_file());
    let satellite = run(&["view_1.tif", "view_2.tif"], "satellite", &[]);
    let images = satellite["images"].as_array().unwrap();
    assert_eq!(images.len(), 2);
    assert!(images.iter().all(|image| image["hit_pixels"].as_u64().unwrap() > 20_000), "{satellite}");
}
