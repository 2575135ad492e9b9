//! `skysweep train` end to end: priors of the town and images of it become splats that show views
//! which were not trained on; a training goes on from its checkpoint; and what is refused.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::common::{sample, simulated, skysweep};
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog, write_png_gray, write_png_rgb};
use jobs::train::{SatelliteTrainConfig, TrainConfig, run, run_on_images};
use numeric::{Choice, Failure, Kind, Progress, Silent, upper_median};
use predicates::prelude::*;
use raster::Grid;
use train::{Drawing, PinholeView, Registers, Surfel};

/// A dataset of the town's priors with images: the points of the model under a pattern, drawn
/// larger and by other cameras than any training knows. Made once.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<PathBuf> = OnceLock::new();
    DATASET.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("train_dataset");
        skysweep()
            .arg("priors")
            .arg(sample("truth/buildings.city.json"))
            .arg("--cameras")
            .arg(sample("cameras"))
            .args(["--points", "12000", "--overwrite", "-o"])
            .arg(&folder)
            .assert()
            .success();
        draw_images(&folder);
        folder
    })
}

fn draw_images(folder: &Path) {
    let (model, points) = formats::colmap::read_with_points(&folder.join("sparse/0")).unwrap();
    let surfel = |p: &formats::colmap::ColmapPoint| {
        let [x, y, z] = p.position;
        let tone =
            |k: f64| (0.5 + 0.35 * ((0.2 + 0.05 * k) * x + 0.1 * y).sin() * (0.15 * y + 0.3 * z + k).cos()) as f32;
        // Upright discs that face a corner of the sky hide what lies behind them from all sides.
        Surfel {
            position: p.position.map(|c| c as f32),
            rotation: [0.9, 0.3, 0.2, 0.1],
            log_scale: [0.2, 0.2],
            opacity_logit: 6.0,
            colour: [tone(0.0), tone(1.0), tone(2.0)],
        }
    };
    let surfels: Vec<Surfel> = points.iter().map(surfel).collect();
    for view in &model.views {
        let lens = &model.lenses[view.lens];
        let camera = PinholeView {
            rotation: view.pose.rotation,
            centre: view.pose.centre,
            focal_px: lens.focal_px(),
            principal_px: [lens.principal_point().sample, lens.principal_point().line],
            size: [lens.width(), lens.height()],
        };
        let drawing = Drawing::new(&surfels, &camera, Registers::Longest);
        let mut picture = Grid::filled(lens.width(), lens.height(), [0u8; 3]);
        for (pixel, value) in picture.data_mut().iter_mut().enumerate() {
            *value = drawing.images().colour.each_ref().map(|plane| (255.0 * plane[pixel]).round() as u8);
        }
        let path = folder.join("images").join(&view.name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        write_png_rgb(path, &picture, true).unwrap();
    }
}

fn train(output: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = skysweep();
    command.arg("train").arg(dataset()).arg("-o").arg(output).args(["--shrink", "4", "--budget", "8000"]);
    command.args(arguments).assert()
}

fn report_of(folder: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("report.json")).unwrap()).unwrap()
}

#[test]
fn views_that_were_not_trained_on_become_better() {
    let out = tempfile::tempdir().unwrap();
    let told = train(
        &out.path().join("a"),
        &[
            "--iterations",
            "150",
            "--hold-out-view",
            "flight_04.png",
            "--hold-out-view",
            "flight_08.png",
            "--hold-out-view",
            "flight_12.png",
        ],
    )
    .success();
    told.stdout(predicate::str::contains("held out"));
    let report = report_of(&out.path().join("a"));
    let held: Vec<_> = report["views"].as_array().unwrap().iter().filter(|v| v["held_out"] == true).collect();
    assert_eq!(held.len(), 3);
    for view in held {
        let [before, after] = ["psnr_before_db", "psnr_db"].map(|key| view[key].as_f64().unwrap());
        assert!(after > before + 1.0, "{view}");
    }
    let splats = formats::splat_ply::read(&out.path().join("a/splats.ply")).unwrap();
    assert_eq!(splats.splats.len() as u64, report["splats_after"].as_u64().unwrap());
    assert!(splats.splats.len() <= 8000 && !out.path().join("a/checkpoint.bin").exists());
    assert_eq!(std::fs::read_dir(out.path().join("a/renders")).unwrap().count(), 3);
    let page = std::fs::read_to_string(out.path().join("a/report.html")).unwrap();
    assert!(page.contains("Loss by iteration") && page.contains("flight_04.png"), "no curve or view on the page");
    // The splats are looked at through the cameras of the dataset, which lie on no map.
    let seen = out.path().join("seen");
    let mut render = skysweep();
    render.args(["splats", "render"]).arg(out.path().join("a/splats.ply")).arg("--cameras").arg(dataset());
    render.args(["--progress", "none", "-o"]).arg(&seen).assert().success();
    let views = report_of(&seen)["views"].as_array().unwrap().clone();
    assert_eq!(views.len(), report["views"].as_array().unwrap().len());
    assert!(views.iter().all(|view| view["psnr_db"].as_f64().unwrap() > 12.0), "{views:?}");
    // The dataset says what it is for.
    assert_eq!(held_out(&report), ["flight_04.png", "flight_08.png", "flight_12.png"]);
    assert_eq!((&report["preset"], report["weights"]["absolute"].as_f64()), (&"building-only".into(), Some(0.8)));
    let losses = report["losses"].as_array().unwrap();
    let colour = |i: usize| losses[i]["colour"].as_f64().unwrap();
    assert!(colour(losses.len() - 1) < 0.8 * colour(0), "{losses:?}");
}

/// The views of a training, by name, that were held out.
fn held_out(report: &serde_json::Value) -> Vec<String> {
    let views = report["views"].as_array().unwrap().iter();
    views.filter(|view| view["held_out"] == true).map(|view| view["name"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn recipes_are_chosen_and_their_numbers_given() {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("a");
    let chosen =
        ["--iterations", "10", "--preset", "photographs", "--weight", "distortion=0.5", "--step", "colour-last=0.01"];
    let more = ["--schedule", "reset-every=5", "--hold-out-view", "flight_02.png", "--hold-out-view", "flight_11.png"];
    train(&folder, &[&chosen[..], &more].concat()).success();
    let report = report_of(&folder);
    assert_eq!(held_out(&report), ["flight_02.png", "flight_11.png"]);
    assert_eq!(report["preset"], "photographs");
    assert_eq!(
        (report["weights"]["distortion"].as_f64(), report["weights"]["similarity"].as_f64()),
        (Some(0.5), Some(0.2))
    );
    assert_eq!(report["settings"]["steps"]["colour_last"].as_f64(), Some(0.01));
    let refused = |arguments: &[&str], what: &str| {
        train(&out.path().join("x"), arguments).code(2).stderr(predicate::str::contains(what.to_owned()));
    };
    refused(&["--weight", "depth=1"], "the name of a number is depth, expected one of: absolute, squared");
    refused(&["--weight", "mask"], "not of the form NAME=NUMBER");
    refused(&["--step", "scale=-1"], "scale is -1");
    refused(&["--schedule", "degree=4"], "the degree of the harmonics is 4, expected 0, 1, 2 or 3");
    refused(&["--hold-out-view", "flight_13.png"], "0 views have the name flight_13.png");
}

/// What lies under a mask changes nothing, and a mask that is not there or does not fit is told.
#[test]
fn masked_pixels_take_no_part() {
    let out = tempfile::tempdir().unwrap();
    let names: Vec<String> = (1..=12).map(|number| format!("flight_{number:02}.png")).collect();
    let put = |folder: &str, painted: Option<u8>| {
        let folder = out.path().join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        for name in &names {
            let source = formats::raster::ImageSource::open(dataset().join("images").join(name)).unwrap();
            let mut picture = source.read_colour(source.window()).unwrap().map(|p| p.map(|c| c as u8));
            let (width, third) = (picture.width(), picture.width() / 3);
            for (pixel, value) in picture.data_mut().iter_mut().enumerate() {
                *value = painted.filter(|_| pixel % width < third).map_or(*value, |tone| [tone; 3]);
            }
            write_png_rgb(folder.join(name), &picture, true).unwrap();
            let mask = Grid::from_vec(
                width,
                picture.height(),
                (0..picture.data().len()).map(|i| if i % width < third { 0 } else { 255 }).collect(),
            );
            write_png_gray(out.path().join("masks").join(format!("{name}.png")), &mask.unwrap(), true).unwrap();
        }
        folder
    };
    std::fs::create_dir_all(out.path().join("masks")).unwrap();
    let masks = out.path().join("masks");
    let trained = |pictures: &Path, output: &str, masks: &Path| {
        let output = out.path().join(output);
        let (pictures, masks) = (pictures.to_str().unwrap(), masks.to_str().unwrap());
        let chosen = ["--iterations", "20", "--pictures", pictures, "--masks", masks];
        (train(&output, &chosen), output)
    };
    let results = [("white", 255), ("black", 0)].map(|(name, tone)| {
        let (told, output) = trained(&put(name, Some(tone)), &format!("trained_{name}"), &masks);
        told.success();
        let report = report_of(&output);
        let quality: Vec<_> = report["views"].as_array().unwrap().iter().map(|v| v["psnr_db"].as_f64()).collect();
        (std::fs::read(output.join("splats.ply")).unwrap(), quality)
    });
    assert!(results[0] == results[1], "what is masked changes the result");
    let plain = put("plain", None);
    let refused = |what: &str| {
        let (told, _) = trained(&plain, "refused", &masks);
        told.code(2).stderr(predicate::str::contains(what.to_owned()));
    };
    let path = masks.join("flight_03.png.png");
    std::fs::remove_file(&path).unwrap();
    refused("flight_03.png has no mask, expected flight_03.png.png or flight_03.png in");
    write_png_gray(&path, &Grid::filled(7, 5, 255), true).unwrap();
    refused("the mask has [7, 5] columns and rows, its camera");
    let size = formats::colmap::read(&dataset().join("sparse/0")).unwrap().lenses[0].clone();
    write_png_gray(&path, &Grid::filled(size.width(), size.height(), 0), true).unwrap();
    refused("the mask of flight_03.png is 0 everywhere");
}

/// What a photograph shows that is held out to judge the result changes no splat.
#[test]
fn held_out_photographs_are_not_learned_from() {
    let out = tempfile::tempdir().unwrap();
    let pictures = out.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    for entry in std::fs::read_dir(dataset().join("images")).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), pictures.join(entry.file_name())).unwrap();
    }
    let splats = |name: &str| {
        let output = out.path().join(name);
        let held_out = ["--hold-out-view", "flight_04.png", "--pictures", pictures.to_str().unwrap()];
        train(&output, &[&["--iterations", "2"][..], &held_out].concat()).success();
        std::fs::read(output.join("splats.ply")).unwrap()
    };
    let first = splats("first");
    let size = formats::colmap::read(&dataset().join("sparse/0")).unwrap().lenses[0].clone();
    let black = Grid::filled(size.width(), size.height(), [0u8; 3]);
    write_png_rgb(pictures.join("flight_04.png"), &black, true).unwrap();
    assert!(splats("second") == first, "the splats depend on a photograph that is held out");
}

/// Cameras of a transforms.json begin with random points, or with those of a model.
#[test]
fn transforms_are_trained_on() {
    let out = tempfile::tempdir().unwrap();
    let root = out.path().join("scene");
    let model = formats::colmap::read(&dataset().join("sparse/0")).unwrap();
    std::fs::create_dir_all(root.join("images")).unwrap();
    let frame = |view: &formats::colmap::ColmapView| {
        std::fs::copy(dataset().join("images").join(&view.name), root.join("images").join(&view.name)).unwrap();
        let (lens, r, c) = (&model.lenses[view.lens], view.pose.rotation, view.pose.centre);
        let ([fx, fy], at) = (lens.focal_px(), lens.principal_point());
        // The columns of OpenGL point to the right, up and back.
        let mut matrix: Vec<Vec<f64>> = (0..3).map(|i| vec![r[0][i], -r[1][i], -r[2][i], c[i]]).collect();
        matrix.push(vec![0.0, 0.0, 0.0, 1.0]);
        serde_json::json!({
            "file_path": format!("./images/{}", view.name.trim_end_matches(".png")), "transform_matrix": matrix,
            "w": lens.width(), "h": lens.height(), "fl_x": fx, "fl_y": fy, "cx": at.sample + 0.5, "cy": at.line + 0.5,
        })
    };
    let frames: Vec<_> = model.views.iter().map(frame).collect();
    std::fs::write(root.join("transforms.json"), serde_json::json!({ "frames": frames }).to_string()).unwrap();
    let output = out.path().join("a");
    let mut command = skysweep();
    command.arg("train").arg(&root).arg("-o").arg(&output).args(["--shrink", "4", "--iterations", "60"]);
    command.assert().success().stderr(predicate::str::contains("the training begins with"));
    let report = report_of(&output);
    assert_eq!((held_out(&report).len(), report["preset"].as_str()), (2, Some("photographs")));
    let trained: Vec<_> = report["views"].as_array().unwrap().iter().filter(|v| v["held_out"] == false).collect();
    let mean = |key: &str| trained.iter().map(|v| v[key].as_f64().unwrap()).sum::<f64>() / trained.len() as f64;
    assert!(mean("ssim") > mean("ssim_before") + 0.15, "{report}");
    // The model of the same cameras names its images without their folder.
    let mut command = skysweep();
    command.arg("train").arg(&root).arg("--points").arg(dataset()).arg("-o").arg(out.path().join("b"));
    let told = command.args(["--shrink", "4", "--iterations", "2"]).assert().success();
    told.stderr(predicate::str::contains("random").not());
}

/// A dataset in the layout of many reconstructions: the model in a folder of its own, the images in
/// folders by camera beside it.
#[test]
fn models_and_images_are_found_where_they_lie() {
    let out = tempfile::tempdir().unwrap();
    let root = out.path().join("scene");
    let (mut model, points) = formats::colmap::read_with_points(&dataset().join("sparse/0")).unwrap();
    for (number, view) in model.views.iter_mut().enumerate() {
        let name = format!("camera_{}/{}", number % 2, view.name);
        std::fs::create_dir_all(root.join("dense/pictures").join(&name).parent().unwrap()).unwrap();
        std::fs::copy(dataset().join("images").join(&view.name), root.join("dense/pictures").join(&name)).unwrap();
        view.name = name;
    }
    let sparse = root.join("dense/colmap/sparse/3");
    std::fs::create_dir_all(&sparse).unwrap();
    formats::colmap::write(&sparse, &model, &points, formats::colmap::ColmapEncoding::Text, false).unwrap();
    let folder = out.path().join("a");
    let mut command = skysweep();
    command.arg("train").arg(&root).arg("-o").arg(&folder).args(["--shrink", "8", "--iterations", "5"]);
    command.assert().success();
    let report = report_of(&folder);
    assert_eq!(report["preset"], "photographs");
    assert_eq!(held_out(&report), ["camera_0/flight_01.png", "camera_1/flight_06.png"]);
}

#[test]
fn threads_change_no_byte() {
    let out = tempfile::tempdir().unwrap();
    let splats = |name: &str, threads: &str| {
        train(&out.path().join(name), &["--iterations", "20", "--threads", threads]).success();
        std::fs::read(out.path().join(name).join("splats.ply")).unwrap()
    };
    assert!(splats("one", "1") == splats("two", "2"));
}

/// A small town in five images with exact RPCs, and splats of its true surface and two images. The
/// views on both sides of the judged one show the walls that it shows.
fn satellite() -> &'static (PathBuf, PathBuf) {
    static SCENE: OnceLock<(PathBuf, PathBuf)> = OnceLock::new();
    SCENE.get_or_init(|| {
        let exact = ("pointing_error_px = [1.0, 3.0]", "pointing_error_px = [0.0, 0.0]");
        let small = [("size_m = 320.0", "size_m = 60.0"), ("gsd_m = 0.5", "gsd_m = 0.8"), ("views = 3", "views = 5")];
        let scene = simulated("train_satellite", &[&small[..], &[exact]].concat());
        let splats = scene.join("splats.ply");
        let mut command = skysweep();
        command
            .arg("splats")
            .arg(scene.join("truth/dsm.tif"))
            .args(["view_1.tif", "view_2.tif"].map(|v| scene.join(v)));
        command.args(["--form", "2d", "--overwrite", "-o"]).arg(&splats).assert().success();
        (scene, splats)
    })
}

fn train_on_images(output: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let (scene, splats) = satellite();
    let mut command = skysweep();
    command.arg("train").args([1, 2, 4, 5].map(|k| scene.join(format!("view_{k}.tif")))).arg("--splats").arg(splats);
    command.arg("--dsm").arg(scene.join("truth/dsm.tif")).arg("--judge").arg(scene.join("view_3.tif"));
    command.args(["--iterations", "60"]).args(arguments).arg("-o").arg(output).assert()
}

#[test]
fn splats_learn_from_satellite_images_and_keep_their_heights() {
    let out = tempfile::tempdir().unwrap();
    train_on_images(&out.path().join("two"), &["--threads", "2"]).success().stdout(predicate::str::contains("judged"));
    let report = report_of(&out.path().join("two"));
    assert!(report["camera_error_px"].as_f64().unwrap() < 0.01, "{report}");
    let views = report["views"].as_array().unwrap();
    assert_eq!(views.len(), 5);
    for view in views {
        let [before, after] = ["psnr_before_db", "psnr_db"].map(|key| view[key].as_f64().unwrap());
        let gain = if view["held_out"] == true { 1.5 } else { 2.0 };
        assert!(after > before + gain, "{view}");
    }
    let [before, after] = [0, 1].map(|i| report["height_change_m"][i].as_f64().unwrap());
    assert!(after < 1.2 * before + 0.02, "{before} became {after} m");
    for name in ["splats.ply", "splats.origin.json", "dsm.tif", "report.html", "renders/view_3.png"] {
        assert!(out.path().join("two").join(name).is_file(), "{name}");
    }
    train_on_images(&out.path().join("one"), &["--threads", "1"]).success();
    let bytes = |name: &str| std::fs::read(out.path().join(name).join("splats.ply")).unwrap();
    assert!(bytes("one") == bytes("two"), "threads change the splats");
    train_on_images(&out.path().join("x"), &["--shrink", "2"]).code(2).stderr(predicate::str::contains("--shrink"));
    let lone = out.path().join("lone.ply");
    std::fs::copy(&satellite().1, &lone).unwrap();
    let mut command = skysweep();
    command.arg("train").arg(satellite().0.join("view_1.tif")).arg("--splats").arg(&lone).arg("-o");
    command.arg(out.path().join("y")).assert().code(2).stderr(predicate::str::contains("no origin beside the splats"));
}

/// Stops a training after a number of iterations.
struct StopAfter {
    iterations: AtomicUsize,
    trains: AtomicBool,
}

impl StopAfter {
    fn new(iterations: usize) -> Self {
        Self { iterations: iterations.into(), trains: false.into() }
    }
}

impl Progress for StopAfter {
    fn begin(&self, stage: &str, _: usize) {
        self.trains.store(stage == "training", Ordering::Relaxed);
    }

    fn step(&self) {
        if self.trains.load(Ordering::Relaxed) {
            let _ = self.iterations.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        }
    }

    fn choice(&self, _: &Choice) {}
    fn warn(&self, _: &str) {}

    fn is_cancelled(&self) -> bool {
        self.iterations.load(Ordering::Relaxed) == 0
    }
}

/// A training of 30 iterations leaves pixels out after 12. It is stopped before and after that.
#[test]
fn a_stopped_training_goes_on_to_the_same_bytes() {
    let out = tempfile::tempdir().unwrap();
    let (scene, splats) = satellite();
    let on_images = |name: &str, resume: bool| {
        let images = [1, 2, 4, 5].map(|k| scene.join(format!("view_{k}.tif"))).to_vec();
        let mut config = SatelliteTrainConfig::new(images, splats.clone(), out.path().join(name));
        config.dsm = Some(scene.join("truth/dsm.tif"));
        (config.iterations, config.resume) = (30, resume);
        config
    };
    let on_dataset = |name: &str, resume: bool| {
        let mut config = TrainConfig::new(dataset().to_owned(), out.path().join(name));
        (config.iterations, config.budget, config.shrink) = (30, 8000, 4);
        (config.resume, config.transients) = (resume, true);
        config
    };
    let bytes = |name: &str| std::fs::read(out.path().join(name).join("splats.ply")).unwrap();
    let checkpoint = |name: &str| out.path().join(name).join("checkpoint.bin").exists();
    let report = run_on_images(&on_images("whole", false), &Silent).unwrap();
    assert!(report.transient_share.iter().all(|share| (0.0..0.2).contains(share)), "{:?}", report.transient_share);
    let report = run(&on_dataset("whole_dataset", false), &Silent).unwrap();
    assert!(report.transient_share.iter().all(|share| (0.0..0.2).contains(share)), "{:?}", report.transient_share);
    for after in [5, 20] {
        let name = format!("images_{after}");
        let stopped = run_on_images(&on_images(&name, false), &StopAfter::new(after));
        assert!(
            stopped.as_ref().is_err_and(|error| error.kind() == Kind::Cancelled) && checkpoint(&name),
            "{stopped:?}"
        );
        run_on_images(&on_images(&name, true), &Silent).unwrap();
        assert!(bytes(&name) == bytes("whole") && !checkpoint(&name), "stopped after {after}");
        let name = format!("dataset_{after}");
        let stopped = run(&on_dataset(&name, false), &StopAfter::new(after));
        assert!(
            stopped.as_ref().is_err_and(|error| error.kind() == Kind::Cancelled) && checkpoint(&name),
            "{stopped:?}"
        );
        run(&on_dataset(&name, true), &Silent).unwrap();
        assert!(bytes(&name) == bytes("whole_dataset") && !checkpoint(&name), "stopped after {after}");
    }
}

/// Puts a folder into the place of the page at the end of a training, so that its results cannot
/// get their names.
struct InTheWay {
    page: PathBuf,
    count: std::sync::atomic::AtomicU32,
}

impl Progress for InTheWay {
    fn begin(&self, _: &str, _: usize) {}

    fn step(&self) {
        if self.count.fetch_add(1, Ordering::Relaxed) == 8 {
            std::fs::create_dir_all(&self.page).unwrap();
        }
    }

    fn choice(&self, _: &Choice) {}
    fn warn(&self, _: &str) {}
}

#[test]
fn a_training_that_was_killed_while_its_results_got_names_goes_on() {
    let out = tempfile::tempdir().unwrap();
    let (scene, splats) = satellite();
    let config = |name: &str, resume: bool| {
        let images = [1, 2].map(|k| scene.join(format!("view_{k}.tif"))).to_vec();
        let mut config = SatelliteTrainConfig::new(images, splats.clone(), out.path().join(name));
        (config.iterations, config.resume) = (10, resume);
        config
    };
    run_on_images(&config("whole", false), &Silent).unwrap();
    let folder = out.path().join("half");
    let page = folder.join("report.html/kept");
    let half = run_on_images(&config("half", false), &InTheWay { page: page.clone(), count: 0.into() });
    // Nothing gets its name before all can.
    assert!(half.is_err() && folder.join("checkpoint.bin").is_file(), "{half:?}");
    assert!(!folder.join("splats.ply").exists() && !folder.join("report.json").exists());
    std::fs::remove_dir_all(page.parent().unwrap()).unwrap();
    // As a kill leaves it between two files.
    std::fs::copy(out.path().join("whole/splats.ply"), folder.join("splats.ply")).unwrap();
    // Without being asked to go on, results are not replaced.
    let refused = run_on_images(&config("half", false), &Silent).unwrap_err().to_string();
    assert!(refused.contains("exists already"), "{refused}");
    run_on_images(&config("half", true), &Silent).unwrap();
    let bytes = |name: &str| std::fs::read(out.path().join(name).join("splats.ply")).unwrap();
    assert!(bytes("half") == bytes("whole") && !folder.join("checkpoint.bin").exists());
    assert!(folder.join("report.json").is_file());
    // Results beside a training that has not ended are of another one, and stay.
    std::fs::create_dir(out.path().join("other")).unwrap();
    std::fs::write(out.path().join("other/splats.ply"), b"old").unwrap();
    let refused = run_on_images(&config("other", true), &Silent).unwrap_err().to_string();
    assert!(refused.contains("exists already"), "{refused}");
    // A file that only has the name of a checkpoint is no checkpoint.
    std::fs::create_dir(out.path().join("foreign")).unwrap();
    std::fs::write(out.path().join("foreign/checkpoint.bin"), b"mine").unwrap();
    let refused = run_on_images(&config("foreign", false), &Silent).unwrap_err().to_string();
    assert!(refused.contains("checkpoint.bin, which no training wrote"), "{refused}");
    assert_eq!(std::fs::read(out.path().join("foreign/checkpoint.bin")).unwrap(), b"mine");
}

/// Splats of a surface with bumps of up to half a metre come closer to the truth when they follow
/// its form, given in another unit and from another zero.
#[test]
fn heights_of_unknown_scale_give_splats_their_form() {
    let out = tempfile::tempdir().unwrap();
    let scene = &satellite().0;
    let truth = read_dem(scene.join("truth/dsm.tif")).unwrap();
    let write = |name: &str, height: &dyn Fn(usize, f32) -> f32| {
        let values = truth.heights.data().iter().enumerate().map(|(cell, z)| height(cell, *z)).collect();
        let grid = Grid::from_vec(truth.heights.width(), truth.heights.height(), values).unwrap();
        let bands = [Band { description: "height", data: BandData::F32(&grid) }];
        let crs = Crs::ellipsoidal(truth.horizontal_epsg.unwrap());
        let path = out.path().join(name);
        write_cog(&path, &CogRaster::new(&bands, truth.geotransform, crs), false).unwrap();
        path
    };
    let width = truth.heights.width();
    let bump = |cell: usize| 0.5 * (0.8 * (cell % width) as f32).sin() * (0.8 * (cell / width) as f32).cos();
    let bumpy = write("bumpy.tif", &|cell, z| z + bump(cell));
    let relative = write("relative.tif", &|_, z| 0.02 * z - 7.0);
    let splats = out.path().join("s.ply");
    let mut command = skysweep();
    command.arg("splats").arg(&bumpy).args(["view_1.tif", "view_2.tif"].map(|view| scene.join(view)));
    command.args(["--form", "2d", "-o"]).arg(&splats).assert().success();
    let error = |name: &str, heights: Option<&Path>| {
        let mut command = skysweep();
        command.arg("train").args([1, 2, 4, 5].map(|k| scene.join(format!("view_{k}.tif")))).arg("--splats");
        command.arg(&splats).args(["--iterations", "300", "-o"]).arg(out.path().join(name));
        if let Some(path) = heights {
            command.arg("--relative-heights").arg(path);
        }
        command.assert().success();
        let file = formats::splat_ply::read(&out.path().join(name).join("splats.ply")).unwrap();
        let origin = file.origin.unwrap().origin;
        // Splats that lie on flat places.
        let level = file.splats.iter().filter(|splat| splat.normal()[2].abs() > 0.9);
        let off = level.filter_map(|splat| {
            let [x, y, z] = [0, 1, 2].map(|i| f64::from(splat.position[i]) + origin[i]);
            let (c, r) = truth.geotransform.cell_from_map(x, y)?;
            let height = truth.heights.get(c.round() as usize, r.round() as usize)?;
            Some((z - f64::from(*height)).abs()).filter(|off| off.is_finite())
        });
        upper_median(&mut off.collect::<Vec<f64>>()).unwrap()
    };
    let (without, with) = (error("without", None), error("with", Some(&relative)));
    assert!(with < 0.8 * without, "{without} m without, {with} m with");
    // A raster of another zone is refused.
    let elsewhere = out.path().join("elsewhere.tif");
    let bands = [Band { description: "height", data: BandData::F32(&truth.heights) }];
    write_cog(&elsewhere, &CogRaster::new(&bands, truth.geotransform, Crs::ellipsoidal(32632)), false).unwrap();
    for option in ["--relative-heights", "--dsm"] {
        let mut command = skysweep();
        command.arg("train").arg(scene.join("view_1.tif")).arg("--splats").arg(&splats).arg(option).arg(&elsewhere);
        let told = predicate::str::contains("the raster is in EPSG:32632, the splats in EPSG:32631: warp it first");
        command.arg("-o").arg(out.path().join("x")).assert().code(2).stderr(told);
    }
}

#[test]
fn what_cannot_be_trained_is_refused() {
    let out = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], what: &str| {
        train(&out.path().join("x"), arguments).code(2).stderr(predicate::str::contains(what.to_owned()));
    };
    refused(&["--pictures", "nowhere"], "none of 12 cameras has an image");
    refused(&["--iterations", "0"], "number of iterations is 0");
    refused(&["--hold-out", "1"], "view to keep is 1");
    std::fs::create_dir_all(out.path().join("x")).unwrap();
    std::fs::write(out.path().join("x/checkpoint.bin"), b"other").unwrap();
    refused(&["--resume"], "cannot go on from the checkpoint");
    std::fs::write(out.path().join("x/splats.ply"), b"old").unwrap();
    refused(&[], "exists already");
}

/// The castle, quarter pictures: trainings and `splats render` see the same splats alike, and the
/// recipe for photographs shows a photograph that was held out.
#[test]
fn photographs_of_a_castle_are_learned_and_rendered_alike() {
    let Some(castle) = testing::shared_data("photos/sceaux_castle") else { return };
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("a");
    let mut command = skysweep();
    command.arg("train").arg(&castle).args(["--shrink", "4", "--iterations", "200", "--budget", "12000"]);
    command.args(["--hold-out-view", "100_7107.jpg", "--schedule", "degree=3", "--progress", "none", "-o"]);
    command.arg(&folder).assert().success();
    let report = report_of(&folder);
    assert_eq!((&report["preset"], report["harmonics_degree"].as_u64()), (&"photographs".into(), Some(3)));
    let file = formats::splat_files::read(&folder.join("splats.ply")).unwrap();
    let harmonics = file.harmonics.expect("colours that depend on the direction");
    let largest = |splat| harmonics.of(splat, 0).iter().fold(0.0f32, |most, c| most.max(c.abs()));
    let coloured = (0..file.splats.len()).filter(|&splat| largest(splat) > 0.01).count();
    assert!(harmonics.degree() == 3 && 2 * coloured > file.splats.len(), "{coloured}");
    let number = |view: &serde_json::Value, key: &str| view[key].as_f64().unwrap();
    let views = report["views"].as_array().unwrap();
    let held = views.iter().find(|view| view["held_out"] == true).unwrap();
    assert!(number(held, "psnr_db") > number(held, "psnr_before_db") + 6.0 && number(held, "ssim") > 0.6, "{held}");
    let converted = folder.join("converted.glb");
    let mut convert = skysweep();
    convert.args(["splats", "convert"]).arg(folder.join("splats.ply")).arg(&converted).assert().success();
    // With the origin of the training, in another format, and as the file of another program
    // without an origin.
    for (name, file) in [("seen", "splats.ply"), ("converted", "converted.glb"), ("foreign", "splats.ply")] {
        if name == "foreign" {
            std::fs::remove_file(folder.join("splats.origin.json")).unwrap();
        }
        let seen = out.path().join(name);
        let mut render = skysweep();
        render.args(["splats", "render"]).arg(folder.join(file)).arg("--cameras").arg(&castle);
        render.args(["--shrink", "4", "--progress", "none", "-o"]).arg(&seen).assert().success();
        let rendered = report_of(&seen);
        for view in views {
            let stem = view["name"].as_str().unwrap().trim_end_matches(".jpg").to_owned();
            let same = rendered["views"].as_array().unwrap().iter().find(|other| other["name"] == stem.as_str());
            let [trained, shown] = [number(view, "psnr_db"), number(same.unwrap(), "psnr_whole_db")];
            assert!((trained - shown).abs() < 0.1, "{name}, {stem}: {trained} dB trained, {shown} dB rendered");
        }
    }
}
