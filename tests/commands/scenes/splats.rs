//! `skysweep splats` end to end: count against error on a simulated town, the image that the splats
//! render back to, the file as trainers read it, pointing taken over from a run, and what is
//! refused.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::{json, sample, simulated, skysweep};
use formats::raster::{ImageSource, read_dem};
use formats::splat_ply::LocalOrigin;
use predicates::prelude::*;
use serde_json::Value;

/// A town of 120 m whose images point where their RPCs say; made once.
fn town() -> &'static Path {
    static TOWN: OnceLock<PathBuf> = OnceLock::new();
    let pointing = ("pointing_error_px = [1.0, 3.0]", "pointing_error_px = [0.0, 0.0]");
    TOWN.get_or_init(|| simulated("splats", &[("size_m = 320.0", "size_m = 120.0"), pointing]))
}

/// PSNR of a rendering over the pixels whose true height is that of the surface model there: those
/// it shows.
fn psnr_by_truth(scene: &Path, rendering: &Path, range: &Value, view: &str) -> (f64, usize) {
    let image = ImageSource::open(scene.join(format!("{view}.tif"))).unwrap();
    let pixels = image.read_colour(image.window()).unwrap();
    let rendered = ImageSource::open(rendering).unwrap();
    let rendered = rendered.read_colour(rendered.window()).unwrap();
    let truth = scene.join("truth").join(view.replace("view", "heights") + ".tif");
    let rpc = formats::rpc::read_for_image(&truth).unwrap().rpc;
    let source = ImageSource::open(&truth).unwrap();
    let heights = source.read_luma(source.window()).unwrap().luma;
    let dsm = read_dem(scene.join("truth/dsm.tif")).unwrap();
    let projection = crs::MapProjection::from_epsg(dsm.horizontal_epsg.unwrap()).unwrap();
    let (low, high) = (range[0].as_f64().unwrap(), range[1].as_f64().unwrap());
    let (mut sum, mut count) = (0.0, 0);
    for row in 0..heights.height() {
        for column in 0..heights.width() {
            let height = f64::from(heights[(column, row)]);
            let Ok(ground) = rpc.localize(camera::ImagePoint::new(column as f64, row as f64), height) else { continue };
            let map = projection.map_from_lonlat(ground.lon_deg, ground.lat_deg).unwrap();
            let (c, r) = dsm.geotransform.cell_from_map(map.x, map.y).unwrap();
            let (c, r) = (c.round(), r.round());
            // Away from the border, beyond which there are no splats to complete a pixel.
            let inside = |at: f64, size: usize| at >= 2.0 && at < size as f64 - 2.0;
            if !inside(c, dsm.heights.width()) || !inside(r, dsm.heights.height()) {
                continue;
            }
            if (f64::from(dsm.heights[(c as usize, r as usize)]) - height).abs() < 0.3 {
                let expected = ((f64::from(pixels[(column, row)][0]) - low) / (high - low)).clamp(0.0, 1.0);
                sum += (f64::from(rendered[(column, row)][0]) / 255.0 - expected).powi(2);
                count += 1;
            }
        }
    }
    (-10.0 * (sum / f64::from(count)).log10(), count as usize)
}

#[test]
fn a_quarter_of_the_splats_shows_the_same_town() {
    let folder = tempfile::tempdir().unwrap();
    let scene = town();
    let (ply, pictures) = (folder.path().join("s.ply"), folder.path().join("pictures"));
    for view in ["view_2", "view_3"] {
        let mut command = skysweep();
        command
            .arg("splats")
            .arg(scene.join("truth/dsm.tif"))
            .arg(scene.join(format!("{view}.tif")))
            .arg("-o")
            .arg(&ply);
        command.arg("--render").arg(&pictures).args(["--compare", "--json", "--overwrite"]);
        let report = json(command.output().unwrap());
        let number = |key: &str| report[key].as_f64().unwrap();
        // Uniform splats have no walls.
        assert!(number("walls") > 0.0 && number("walls") < 0.6 * number("splats"), "{report}");
        assert!(number("walls_seen") > 0.02 * number("walls") && number("walls_area_m2") > 1000.0, "{report}");
        let times = number("uniform_at_equal_rmse") / (number("splats") - number("walls"));
        assert!(times >= 4.0, "uniform splats are only {times:.2} times as many at the same error");
        assert!(number("plane_error_max_m") <= 0.25 + 1e-6);
        assert!(report["median_height"]["rmse_m"].as_f64().unwrap() < 0.1);
        let told = report["views"][0]["psnr_db"].as_f64().unwrap();
        let rendering = pictures.join(view).with_extension("png");
        let (found, pixels) = psnr_by_truth(scene, &rendering, &report["display_range"][0], view);
        assert!(pixels > 40_000, "{pixels} pixels show the surface");
        assert!(told >= 28.0 && found >= 28.0, "{view}: PSNR {told:.2} dB as told, {found:.2} dB by the truth");
    }
}

/// The rows of a PLY as the loaders of 3DGS see them: properties by name, little-endian f32.
fn load(path: &Path) -> (Vec<String>, Vec<Vec<f32>>) {
    let bytes = std::fs::read(path).unwrap();
    let mark = b"end_header\n";
    let body = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\nelement vertex "));
    let names: Vec<String> =
        header.lines().filter_map(|line| line.strip_prefix("property float ")).map(str::to_owned).collect();
    let floats: Vec<f32> = bytes[body..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    (names.clone(), floats.chunks_exact(names.len()).map(<[f32]>::to_vec).collect())
}

/// The normal of a splat: what its quaternion (real part first) makes of the third axis.
fn third_axis([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]
}

#[test]
fn the_file_is_what_trainers_load_and_lies_on_the_surface() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, ply) = (town(), folder.path().join("s.ply"));
    let mut command = skysweep();
    command.arg("splats").arg(scene.join("truth/dsm.tif")).arg(scene.join("view_2.tif")).arg("-o").arg(&ply);
    let report = json(command.args(["--json", "--sh-degree", "3"]).output().unwrap());
    let (names, rows) = load(&ply);
    assert_eq!(rows.len() as u64, report["splats"].as_u64().unwrap());
    assert_eq!(names.iter().filter(|n| n.starts_with("f_rest_")).count(), 45);
    let column = |name: &str| names.iter().position(|n| n == name).unwrap();
    let origin: LocalOrigin =
        serde_json::from_slice(&std::fs::read(ply.with_extension("origin.json")).unwrap()).unwrap();
    assert_eq!((origin.crs.as_str(), origin.vertical.as_str()), ("EPSG:32631", "ellipsoid"));
    let dsm = read_dem(scene.join("truth/dsm.tif")).unwrap();
    let (mut off_surface, mut walls) = (0, 0);
    for row in &rows {
        let at = |name: &str| f64::from(row[column(name)]);
        let length: f64 = (0..4).map(|i| at(&format!("rot_{i}")).powi(2)).sum();
        assert!((length - 1.0).abs() < 1e-5);
        let opacity = 1.0 / (1.0 + (-at("opacity")).exp());
        assert!((opacity - 0.99).abs() < 1e-3, "no confidence was given: {opacity}");
        assert!((0..3).all(|i| (0.001..40.0).contains(&at(&format!("scale_{i}")).exp())));
        let [x, y, z] = ["x", "y", "z"].map(at);
        let map = [x + origin.origin[0], y + origin.origin[1]];
        let (c, r) = dsm.geotransform.cell_from_map(map[0], map[1]).unwrap();
        let normal = third_axis([0, 1, 2, 3].map(|i| at(&format!("rot_{i}"))));
        if normal[2].abs() < 1e-3 {
            // Walls stand between the upper and the lower cells beside them.
            walls += 1;
            let cells = (0..25).map(|k| [c.round() + f64::from(k % 5) - 2.0, r.round() + f64::from(k / 5) - 2.0]);
            let heights = cells.filter_map(|[c, r]| dsm.heights.get(c as usize, r as usize));
            let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &z| (l.min(z), h.max(z)));
            let height = z + origin.origin[2];
            assert!(height > f64::from(low) - 0.5 && height < f64::from(high) + 0.3, "{low} {height} {high}");
            continue;
        }
        // The middle of an even block lies between cells of the block; its plane is within the
        // bound of each.
        let near = [(c - 0.01).round(), (c + 0.01).round()];
        let near = near.into_iter().flat_map(|c| [(r - 0.01).round(), (r + 0.01).round()].map(|r| [c, r]));
        let off = near.map(|[c, r]| {
            let (e, n) = dsm.geotransform.map_from_cell(c, r);
            let rise = -(normal[0] * (e - map[0]) + normal[1] * (n - map[1])) / normal[2];
            (f64::from(dsm.heights[(c as usize, r as usize)]) - origin.origin[2] - z - rise).abs()
        });
        let off = off.fold(0.0, f64::max);
        off_surface += usize::from(off > 0.25 + 0.01);
    }
    assert_eq!(off_surface, 0);
    assert_eq!(walls, report["walls"].as_u64().unwrap());
    let mut command = skysweep();
    command.arg("splats").arg(scene.join("truth/dsm.tif")).arg(scene.join("view_2.tif")).arg("-o").arg(&ply);
    let without = json(command.args(["--json", "--no-walls", "--overwrite"]).output().unwrap());
    assert!(without["splats"].as_u64().unwrap() + walls <= rows.len() as u64);
    assert_eq!(without["walls"], 0);
}

#[test]
fn discs_uniform_splats_and_threads() {
    let folder = tempfile::tempdir().unwrap();
    let scene = town();
    let run = |name: &str, threads: &str, options: &[&str]| {
        let ply = folder.path().join(name);
        let mut command = skysweep();
        command.env("RAYON_NUM_THREADS", threads).arg("splats").arg(scene.join("truth/dsm.tif"));
        command.arg(scene.join("view_2.tif")).arg("-o").arg(&ply).arg("-q").args(options).assert().code(0);
        ply
    };
    let bytes = |path: PathBuf| std::fs::read(path).unwrap();
    assert!(bytes(run("a.ply", "1", &[])) == bytes(run("b.ply", "3", &[])), "threads change the splats");
    let discs = formats::splat_ply::read(&run("c.ply", "2", &["--form", "2d", "--uniform", "4"])).unwrap();
    assert_eq!((discs.layout.form, discs.splats.len()), (formats::splat_ply::SplatForm::Discs, 60 * 60));
    // Squares of 4 cells of half a metre: one metre of standard deviation where the ground is
    // level.
    assert!(discs.splats.iter().all(|s| s.scale_m[0] >= 0.999 && s.scale_m[1] >= 0.999));
}

/// The sample's RPCs are off by pixels, each its own way: a run finds out, and the splats take it
/// over.
#[test]
fn pointing_comes_from_the_run_that_made_the_surface() {
    let folder = tempfile::tempdir().unwrap();
    let (out, ply) = (folder.path().join("out"), folder.path().join("s.ply"));
    let images = ["view_1.tif", "view_2.tif", "view_3.tif"].map(sample);
    let middle = ["--bounds", "693870", "4822410", "693990", "4822530"];
    let mut command = skysweep();
    command.arg("dsm").args(&images).arg("-o").arg(&out).args(["-q", "--gsd", "1"]).args(middle).assert().code(0);
    let psnr = |options: &[&str]| {
        let mut command = skysweep();
        command.arg("splats").arg(out.join("dsm/dsm.tif")).args(&images).arg("-o").arg(&ply);
        command.arg("--confidence").arg(out.join("dsm/confidence.tif")).args(["--json", "--overwrite"]).args(options);
        let report = json(command.output().unwrap());
        (0..3).map(|i| report["views"][i]["psnr_db"].as_f64().unwrap()).sum::<f64>() / 3.0
    };
    let (without, with) = (psnr(&["--corrections", "none"]), psnr(&[]));
    assert!(with > without + 0.5, "{with:.2} dB with the corrections of the run, {without:.2} dB without");
    // The splats of the last run were made with the corrections. Looking through them takes those.
    let seen = folder.path().join("seen");
    let rendered = |options: &[&str]| {
        let mut command = skysweep();
        command.args(["splats", "render"]).arg(&ply).args(&images).arg("-o").arg(&seen);
        let report =
            json(command.args(["--json", "--overwrite", "--progress", "none"]).args(options).output().unwrap());
        (0..3).map(|i| report["views"][i]["psnr_db"].as_f64().unwrap()).sum::<f64>() / 3.0
    };
    let (with, without) = (rendered(&[]), rendered(&["--corrections", "none"]));
    assert!(with > without + 0.5, "{with:.2} dB rendered with the corrections, {without:.2} dB without");
    let opacities: Vec<f32> = formats::splat_ply::read(&ply).unwrap().splats.iter().map(|s| s.opacity).collect();
    let confidence = read_dem(out.join("dsm/confidence.tif")).unwrap().heights;
    let surest = confidence.data().iter().copied().filter(|c| c.is_finite()).fold(0.0, f32::max);
    let most = opacities.iter().copied().fold(0.0, f32::max);
    // Opacities go from 0.3 without any confidence to 0.99 with all of it; a splat has the mean
    // confidence of its cells.
    let bound = 0.3 + 0.69 * surest;
    assert!(most <= bound + 1e-6 && most > bound - 0.01, "{most} of a confidence of {surest}");
    assert!(opacities.iter().any(|o| *o < 0.7), "confidence becomes opacity");
}

/// Splats seen from the air and from the ground: the image that they are of, and heights where a
/// ray meets the same surface.
#[test]
fn splats_are_seen_again_through_images_and_perspective_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, ply) = (town(), folder.path().join("s.ply"));
    let (dsm, image) = (scene.join("truth/dsm.tif"), scene.join("view_2.tif"));
    skysweep().arg("splats").arg(&dsm).arg(&image).arg("-o").arg(&ply).arg("-q").assert().code(0);
    let render = |name: &str, arguments: &[&std::ffi::OsStr]| {
        let out = folder.path().join(name);
        let mut command = skysweep();
        command
            .args(["splats", "render", "--json", "--progress", "none"])
            .arg(&ply)
            .args(arguments)
            .arg("-o")
            .arg(&out);
        (json(command.output().unwrap()), out)
    };
    let (report, out) = render("image", &[image.as_os_str()]);
    let view = &report["views"][0];
    assert_eq!((report["views"].as_array().unwrap().len(), view["name"].as_str()), (1, Some("view_2")));
    assert!(view["psnr_db"].as_f64().unwrap() > 24.0, "{view}");
    assert!(out.join("colour/view_2.png").is_file() && out.join("alpha/view_2.png").is_file());

    let ground = folder.path().join("ground");
    let mut command = skysweep();
    command.arg("groundview").arg(&dsm).args(["--center", "5.4", "43.53", "--ground-offset", "25", "--width", "16"]);
    command.args(["--crops", "3", "--crop-size", "200", "-q", "-o"]).arg(&ground).assert().code(0);
    let model = ground.join("sparse/0");
    let (report, out) = render("cameras", &["--cameras".as_ref(), model.as_os_str()]);
    assert!(report["views"][2]["psnr_db"].is_null() && report["views"][2]["coverage"].as_f64().unwrap() > 0.1);
    let array = |path: PathBuf| formats::npy::read(path).unwrap().data.to_f64();
    let cameras = formats::colmap::read(&model).unwrap();
    let origin: LocalOrigin = serde_json::from_slice(&std::fs::read(model.join("origin.json")).unwrap()).unwrap();
    let mut off: Vec<f64> = Vec::new();
    for view in &cameras.views {
        // The surface that the depths are of leans where there are walls.
        let stem = view.name.strip_suffix(".png").unwrap();
        let depth = array(ground.join(format!("depth/{stem}.npy")));
        let normal = array(ground.join(format!("normal/{stem}.npy")));
        let height = array(out.join(format!("height/{stem}.npy")));
        let both = depth
            .iter()
            .zip(&height)
            .enumerate()
            .filter(|(k, (d, h))| (*d + *h).is_finite() && normal[3 * k + 2] > 0.9);
        for (k, (depth, height)) in both {
            let at = camera::ImagePoint::new((k % 200) as f64, (k / 200) as f64);
            let [x, y] = cameras.lenses[view.lens].direction(at).unwrap();
            let r = &view.pose.rotation;
            let up = r[0][2] * x + r[1][2] * y + r[2][2];
            off.push((view.pose.centre[2] + depth * up + origin.origin[2] - height).abs());
        }
    }
    off.sort_by(f64::total_cmp);
    assert!(off.len() > 15_000, "{} pixels", off.len());
    assert!(off[off.len() / 2] < 0.25, "the median height is {} m off", off[off.len() / 2]);
    // The views as pictures of themselves differ by the bytes of a PNG.
    let pictures = folder.path().join("cameras/colour");
    let options = ["--cameras".as_ref(), model.as_os_str(), "--pictures".as_ref(), pictures.as_os_str()];
    let (report, _) = render("again", &options);
    assert!((0..3).all(|i| report["views"][i]["psnr_db"].as_f64().unwrap() > 50.0), "{report}");
    let refused = |arguments: &[&std::ffi::OsStr], words: &str| {
        let mut command = skysweep();
        command.args(["splats", "render"]).arg(&ply).args(arguments).arg("-o").arg(folder.path().join("no"));
        command.assert().code(2).stderr(predicate::str::contains(words.to_owned()));
        assert!(!folder.path().join("no").exists());
    };
    refused(&[], "nothing to look through");
    // Models are looked for in the folders below, too; there is none.
    refused(&["--cameras".as_ref(), scene.join("truth").as_os_str()], "COLMAP");
}

/// Splats look the same in every format, from images and from perspective cameras, and keep their
/// place.
#[test]
fn splats_look_the_same_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let scene = town();
    let (dsm, image) = (scene.join("truth/dsm.tif"), scene.join("view_2.tif"));
    let ground = folder.path().join("ground");
    let mut command = skysweep();
    command.arg("groundview").arg(&dsm).args(["--center", "5.4", "43.53", "--ground-offset", "25", "--width", "16"]);
    command.args(["--crops", "3", "--crop-size", "120", "-q", "-o"]).arg(&ground).assert().code(0);
    let render = |splats: &Path, pictures: Option<&Path>| {
        let out = splats.with_extension("seen");
        let mut command = skysweep();
        command.args(["splats", "render", "--json", "--progress", "none"]).arg(splats).arg("--cameras");
        command.arg(ground.join("sparse/0")).arg("-o").arg(&out);
        if let Some(pictures) = pictures {
            command.arg("--pictures").arg(pictures);
        }
        (json(command.output().unwrap()), out)
    };
    for form in ["2d", "3d"] {
        let ply = folder.path().join(form).with_extension("ply");
        let mut command = skysweep();
        command.arg("splats").arg(&dsm).arg(&image).args(["-q", "--form", form, "-o"]).arg(&ply).assert().code(0);
        let pictures = render(&ply, None).1.join("colour");
        let origin = std::fs::read(ply.with_extension("origin.json")).unwrap();
        for (ending, options) in [("spz", &[][..]), ("sog", &["--sh-degree", "0"]), ("glb", &["--sh-degree", "2"])] {
            let other = folder.path().join(format!("{form}_{ending}.{ending}"));
            let mut command = skysweep();
            command.args(["splats", "convert", "--json"]).arg(&ply).arg(&other).args(options);
            let report = json(command.output().unwrap());
            assert_eq!(report["flat"], form == "2d", "{ending}: {report}");
            // Some colours of the town are brighter than SPZ can be.
            assert!(ending == "spz" || report["clipped"] == 0, "{ending}: {report}");
            assert!(std::fs::read(other.with_extension("origin.json")).unwrap() == origin);
            let (seen, _) = render(&other, Some(&pictures));
            let psnr = |i: usize| seen["views"][i]["psnr_whole_db"].as_f64().unwrap();
            assert!((0..3).all(|i| psnr(i) > 40.0), "{form} {ending}: {seen}");
            // And back to what trainers load, also with the other number of scales.
            let back = folder.path().join(format!("{form}_{ending}_back.ply"));
            let mut command = skysweep();
            command.args(["splats", "convert", "-q", "--overwrite", "--form", "3d", "--sh-degree", "3"]);
            command.arg(&other).arg(&back).assert().code(0);
            assert_eq!(load(&back).0.len(), 62);
            let (seen, _) = render(&back, Some(&pictures));
            let psnr = |i: usize| seen["views"][i]["psnr_whole_db"].as_f64().unwrap();
            assert!((0..3).all(|i| psnr(i) > 40.0), "{form} {ending} and back: {seen}");
        }
        let mut command = skysweep();
        let odd = folder.path().join("town.splat");
        command.args(["splats", "convert"]).arg(&ply).arg(&odd);
        command.assert().code(2).stderr(predicate::str::contains(".ply, .spz, .sog, .glb"));
        skysweep().args(["splats", "convert"]).arg(&image).arg(folder.path().join("no.spz")).assert().code(2);
        assert!(!odd.exists() && !folder.path().join("no.spz").exists());
    }
}

/// SPZ has bytes for colours; what they cannot hold is counted.
#[test]
fn colours_that_a_format_cannot_hold_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (bright, spz) = (folder.path().join("bright.ply"), folder.path().join("bright.spz"));
    let splat = gaussian::Splat {
        position: [1.0; 3],
        scale_m: [0.5; 3],
        rotation: [1.0, 0.0, 0.0, 0.0],
        colour: [0.2, 0.5, 1.4],
        opacity: 0.5,
    };
    let splats = vec![splat, gaussian::Splat { colour: [0.2, -0.6, 1.0], ..splat }];
    let layout = formats::splat_ply::SplatLayout::default();
    let file = formats::splat_ply::SplatFile { splats, harmonics: None, labels: None, layout, origin: None };
    formats::splat_files::write(&bright, &file, false).unwrap();
    let mut command = skysweep();
    command.args(["splats", "convert", "--json"]).arg(&bright).arg(&spz);
    assert_eq!(json(command.output().unwrap())["clipped"], 1);
    let back = formats::splat_files::read(&spz).unwrap().splats;
    assert!((back[1].colour[1] + 0.44).abs() < 0.01 && (back[0].colour[2] - 1.4).abs() < 0.004, "{back:?}");
    assert!(!spz.with_extension("origin.json").exists());
}

#[test]
fn what_cannot_be_done_is_said_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let ply = folder.path().join("s.ply");
    let (dsm, image) = (sample("truth/dsm.tif"), sample("view_1.tif"));
    let refused = |options: &[&std::ffi::OsStr], words: &str| {
        let words = predicate::str::contains(words.to_owned());
        skysweep().arg("splats").args(options).arg("-o").arg(&ply).assert().code(2).stderr(words);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    let (dsm, image) = (dsm.as_os_str(), image.as_os_str());
    refused(&[dsm, image, "--error".as_ref(), "0".as_ref()], "the bound on heights is 0");
    refused(&[dsm, dsm], "RPC");
    refused(&[image, image], "geotransform");
    refused(&["none.tif".as_ref(), image], "none.tif");
    refused(&[dsm, image, "--confidence".as_ref(), image], "confidence");
    std::fs::write(&ply, "mine").unwrap();
    let arguments = [dsm, image];
    skysweep()
        .arg("splats")
        .args(arguments)
        .arg("-o")
        .arg(&ply)
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--overwrite"));
    assert_eq!(std::fs::read(&ply).unwrap(), b"mine");
}
