//! `skysweep dsm` end to end on the sample town: its accuracy, its independence of threads and
//! tiles, what it writes, and what it refuses.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use formats::raster::{Band, BandData, ImageSource, write_image_with_rpc};
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;

use crate::common::{sample, skysweep, small_town};

fn views() -> [PathBuf; 3] {
    ["view_1.tif", "view_2.tif", "view_3.tif"].map(sample)
}

/// Returns the command `skysweep dsm` on two views of the small town with coarse cells, which takes
/// a second.
fn small(output: &Path) -> Command {
    let mut command = skysweep();
    command.arg("dsm").args(["view_1.tif", "view_3.tif"].map(small_town)).arg("-o").arg(output);
    command.args(["-q", "--gsd", "1"]);
    command
}

/// The grid, the sources, the pointing and the fusion follow the content of the images. The report
/// counts them as they were given.
#[test]
fn the_order_of_the_images_does_not_change_a_byte() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second, third] = ["view_1.tif", "view_2.tif", "view_3.tif"].map(small_town);
    let orders = [[&first, &second, &third], [&third, &first, &second], [&second, &third, &first]];
    let mut expected: Option<Vec<Vec<u8>>> = None;
    for (number, order) in orders.iter().enumerate() {
        let out = folder.path().join(number.to_string());
        skysweep().arg("dsm").args(order).arg("-o").arg(&out).args(["-q", "--gsd", "1"]).assert().code(0);
        let files = ["dsm.tif", "sigma.tif", "confidence.tif", "views.tif", "filled.tif"];
        let found: Vec<Vec<u8>> = files.iter().map(|name| std::fs::read(out.join("dsm").join(name)).unwrap()).collect();
        let same = expected.get_or_insert_with(|| found.clone()).iter().zip(&found).all(|(a, b)| a == b);
        assert!(same, "{order:?}");
        let report: Value = serde_json::from_slice(&std::fs::read(out.join("report/report.json")).unwrap()).unwrap();
        let names: Vec<&str> =
            report["images"].as_array().unwrap().iter().map(|i| i["path"].as_str().unwrap()).collect();
        assert!(names.iter().zip(order).all(|(name, path)| Path::new(name) == path.as_path()), "{names:?}");
    }
}

#[test]
fn the_town_is_found_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    skysweep()
        .arg("dsm")
        .args(views())
        .arg("-o")
        .arg(&out)
        .assert()
        .code(0)
        .stderr(predicate::str::contains("height range"));
    for file in [
        "dsm/dsm.tif",
        "dsm/sigma.tif",
        "dsm/views.tif",
        "dsm/filled.tif",
        "dsm/hillshade.png",
        "dsm/relief.png",
        "dsm/relief.pgw",
        "dsm/thumbnail.png",
        "dsm/thumbnail.pgw",
        "dsm/source.qml",
        "used_config.toml",
        "stac/collection.json",
    ] {
        assert!(out.join(file).is_file(), "{file} is missing");
    }
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report/report.json")).unwrap()).unwrap();
    assert_eq!(report["pointing"]["order"], "translation", "the town's pointing errors are shifts");
    let after = report["pointing"]["rms_px"].as_f64().unwrap();
    assert!(after < 0.2, "pointing residuals of {after} px are left");
    let page = std::fs::read_to_string(out.join("report/report.html")).unwrap();
    for part in
        ["id=\"layer4\"", "id=\"hatched\"", "Residuals by image", "Residuals in image 2", "height range", "view_1.tif"]
    {
        assert!(page.contains(part), "{part} is not on the page");
    }
    assert!(!page.contains("<script") && !page.contains("http://") && !page.contains("https://"));
    let item: Value = serde_json::from_slice(&std::fs::read(out.join("stac/item.json")).unwrap()).unwrap();
    let assets = item["assets"].as_object().unwrap();
    assert!(assets.len() >= 8, "{assets:?}");
    for (name, asset) in assets {
        assert!(out.join("stac").join(asset["href"].as_str().unwrap()).is_file(), "the asset {name} is missing");
    }
    let evaluation = skysweep()
        .arg("eval")
        .arg(out.join("dsm/dsm.tif"))
        .arg(sample("truth/dsm.tif"))
        .args(["--align", "xyz", "--json"])
        .output()
        .unwrap();
    let evaluation: Value = serde_json::from_slice(&evaluation.stdout).unwrap();
    let metric = |name: &str| evaluation["metrics"][name].as_f64().unwrap();
    // The truth has no vehicles and the images have some, which are among the cells that are not
    // right.
    assert!(metric("completeness_1") > 0.94, "completeness {}", metric("completeness_1"));
    assert!(metric("nmad") < 0.1, "NMAD {}", metric("nmad"));
    assert!(metric("mae") < 0.5, "MAE {}", metric("mae"));
}

#[test]
fn threads_and_tiles_do_not_change_a_byte() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        small(&out).args(options).assert().code(0);
        ["dsm/dsm.tif", "dsm/sigma.tif", "dsm/views.tif", "dsm/filled.tif"].map(|f| std::fs::read(out.join(f)).unwrap())
    };
    let one = run("one", &["--threads", "1"]);
    assert!(one == run("two", &["--threads", "2"]), "two threads give other bytes than one");
    assert!(
        one == run("tiles", &["--threads", "2", "--tile", "77"]),
        "tiles of 77 cells give other bytes than of 1024"
    );
}

#[test]
fn options_are_obeyed() {
    let folder = tempfile::tempdir().unwrap();
    let first = folder.path().join("first");
    small(&first).assert().code(0);
    let dem = formats::raster::read_dem(first.join("dsm/dsm.tif")).unwrap();
    let (x, y) = dem.geotransform.map_from_cell(50.5, 60.5);
    let bounds = [x, y - 90.0, x + 120.0, y].map(|v| v.to_string());
    let out = folder.path().join("part");
    small(&out)
        .arg("--bounds")
        .args(&bounds)
        .args(["--vertical", "egm96", "--height-range", "170", "280", "--preset", "fast", "--progress", "json"])
        .assert()
        .code(0)
        .stderr(predicate::str::contains("\"event\":\"stage\""));
    let part = formats::raster::read_dem(out.join("dsm/dsm.tif")).unwrap();
    assert_eq!((part.heights.width(), part.heights.height()), (120, 90));
    assert_eq!(part.vertical, Some(crs::VerticalDatum::Egm96));
    // The same ground above another datum: they differ by the undulation, the same one everywhere.
    let mut differences = Vec::new();
    for row in 0..part.heights.height() {
        for column in 0..part.heights.width() {
            let d = dem.heights[(column + 51, row + 61)] - part.heights[(column, row)];
            if d.is_finite() {
                differences.push(f64::from(d));
            }
        }
    }
    differences.sort_by(f64::total_cmp);
    let undulation = differences[differences.len() / 2];
    let converter = crs::HeightConverter::new(crs::VerticalDatum::Egm96).unwrap();
    let projection = crs::MapProjection::from_epsg(dem.horizontal_epsg.unwrap()).unwrap();
    let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
    let expected = converter.ellipsoid_from_datum(lon, lat, 0.0).unwrap();
    // A pair of views does not determine the common height, which the weak prior on pointing holds
    // to half a metre here.
    assert!((undulation - expected).abs() < 0.5, "{undulation} instead of {expected}");
}

/// Runs a command that must end with exit code 2, one clear message, and nothing written.
fn refused(mut command: Command, output: &Path, message: &str) {
    command.assert().code(2).stdout("").stderr(predicate::str::contains(message));
    assert!(!output.exists(), "{} was left behind", output.display());
}

/// Checks that no surface is made of the first view and `other`.
fn refused_beside_a_view(other: &Path, output: &Path, message: &str) {
    let mut command = skysweep();
    command.arg("dsm").arg(sample("view_1.tif")).arg(other).arg("-o").arg(output);
    refused(command, output, message);
}

#[test]
fn too_few_images_and_the_same_image_twice_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = skysweep();
    command.arg("dsm").arg(sample("view_1.tif")).arg("-o").arg(&out);
    refused(command, &out, "expected at least 2");
    let mut command = skysweep();
    command.arg("dsm").args([sample("view_1.tif"), sample("view_1.tif")]).arg("-o").arg(&out);
    refused(command, &out, "given twice");
}

#[test]
fn copies_of_one_image_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let (copy, out) = (folder.path().join("copy.tif"), folder.path().join("out"));
    std::fs::copy(sample("view_1.tif"), &copy).unwrap();
    refused_beside_a_view(&copy, &out, "the same image is given twice");
}

#[test]
fn images_without_rpc_and_damaged_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let plain = folder.path().join("plain.png");
    formats::raster::write_png_gray(&plain, &raster::Grid::filled(64, 64, 7), false).unwrap();
    refused_beside_a_view(&plain, &out, "RPC");
    let damaged = folder.path().join("damaged.tif");
    let bytes = std::fs::read(sample("view_2.tif")).unwrap();
    std::fs::write(&damaged, &bytes[..bytes.len() / 2]).unwrap();
    refused_beside_a_view(&damaged, &out, "damaged.tif");
    refused_beside_a_view(&folder.path().join("missing.tif"), &out, "missing.tif");
}

#[test]
fn images_of_different_places_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (far, out) = (folder.path().join("far.tif"), folder.path().join("out"));
    let mut rpc = formats::rpc::read_for_image(&sample("view_3.tif")).unwrap().rpc;
    rpc.long_off += 0.5;
    let pixels = raster::Grid::filled(722, 752, 100u16);
    let bands = [formats::raster::Band { description: "pan", data: formats::raster::BandData::U16(&pixels) }];
    formats::raster::write_image_with_rpc(&far, &bands, &rpc, None, false).unwrap();
    refused_beside_a_view(&far, &out, "share no ground");
}

/// Without tie points the pointing is unknown, whatever else is given.
#[test]
fn images_without_tie_points_are_refused_unless_the_pointing_is_taken_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let (other, out) = (folder.path().join("other.tif"), folder.path().join("out"));
    let rpc = formats::rpc::read_for_image(&sample("view_3.tif")).unwrap().rpc;
    let mut random = numeric::SplitMix64::new(7);
    let values = (0..722 * 752).map(|_| random.uniform_in(200.0, 1800.0) as u16).collect();
    let pixels = raster::Grid::from_vec(722, 752, values).unwrap();
    let bands = [formats::raster::Band { description: "pan", data: formats::raster::BandData::U16(&pixels) }];
    formats::raster::write_image_with_rpc(&other, &bands, &rpc, None, false).unwrap();
    for command in ["dsm", "plan"] {
        let mut command_line = skysweep();
        command_line.arg(command).arg(sample("view_1.tif")).arg(&other).arg("-o").arg(&out);
        command_line.args(["--preset", "fast", "--chunk", "300", "--height-range", "170", "280"]);
        refused(command_line, &out, "--no-pointing");
    }
}

#[test]
fn a_height_range_or_bounds_that_miss_the_scene_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = small(&out);
    command.args(["--height-range", "5000", "5200"]);
    refused(command, &out, "misses the scene");
    let mut command = small(&out);
    command.args(["--height-range", "60", "50"]);
    refused(command, &out, "--height-range");
    let mut command = small(&out);
    command.args(["--bounds", "0", "0", "10", "10"]);
    refused(command, &out, "share no ground");
    let mut command = small(&out);
    command.args(["--memory", "10"]);
    refused(command, &out, "--memory");
}

/// Writes a polygon in longitude and latitude.
fn polygon(path: &Path, [x0, y0, x1, y1]: [f64; 4]) {
    let ring = format!("[[[{x0}, {y0}], [{x1}, {y0}], [{x1}, {y1}], [{x0}, {y1}], [{x0}, {y0}]]]");
    let geometry = format!(r#"{{"type": "Polygon", "coordinates": {ring}}}"#);
    let feature = format!(r#"{{"type": "Feature", "properties": {{}}, "geometry": {geometry}}}"#);
    std::fs::write(path, format!(r#"{{"type": "FeatureCollection", "features": [{feature}]}}"#)).unwrap();
}

/// What misses the scene is told with both places, and that the axes are exchanged where they are.
#[test]
fn inputs_that_have_no_effect_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (gsd, found) in
        [("500", "the cell size is 500 m, which gives a grid of"), ("-1", "the cell size is -1, expected")]
    {
        let mut command = skysweep();
        command.arg("dsm").args(views()).arg("-o").arg(&out).args(["-q", "--gsd", gsd]);
        let told = command.assert().code(2).stderr(predicate::str::contains(found));
        told.stderr(predicate::str::contains("the cell size is set by --gsd"));
    }
    let exchanged = "with x and y exchanged they would meet";
    let mut command = small(&out);
    command.args(["--bounds", "4822000", "693000", "4823000", "694500"]);
    refused(command, &out, exchanged);
    let (swapped, far) = (folder.path().join("swapped.geojson"), folder.path().join("far.geojson"));
    polygon(&swapped, [43.529, 5.3986, 43.531, 5.4014]);
    polygon(&far, [6.3986, 43.529, 6.4014, 43.531]);
    let mut command = small(&out);
    command.arg("--area").arg(&swapped);
    refused(command, &out, exchanged);
    let mut command = small(&out);
    command.arg("--area").arg(&far);
    refused(command, &out, "longitudes 6.3986° to 6.4014°");
    let good = folder.path().join("good.geojson");
    polygon(&good, [5.3986, 43.529, 5.3995, 43.531]);
    let mut command = skysweep();
    command.arg("dsm").arg(sample("view_1.tif")).arg(sample("view_3.tif")).arg("-o").arg(&out).args(["--gsd", "1"]);
    [&swapped, &far, &good].into_iter().for_each(|mask| {
        command.arg("--mask").arg(mask);
    });
    let run = command.args(["--preset", "fast", "--dry-run"]).assert().code(0);
    let told = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
    let warned = |mask: &str| told.lines().filter(|l| l.contains("covers nothing") && l.contains(mask)).count();
    assert_eq!(["swapped.geojson", "far.geojson", "good.geojson"].map(warned), [1, 1, 0], "{told}");
    assert!(told.contains(exchanged), "{told}");
}

/// An image is doubtful by itself when its two RPCs differ, when its RPC is that of another size,
/// and when a constant takes its rim.
#[test]
fn doubtful_images_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let warnings = |name: &str, change: &dyn Fn(&Path, usize)| -> Vec<String> {
        let place = folder.path().join(name);
        std::fs::create_dir(&place).unwrap();
        let images = ["view_1.tif", "view_2.tif"].map(|view| place.join(view));
        for (number, image) in images.iter().enumerate() {
            std::fs::copy(sample(&image.file_name().unwrap().to_string_lossy()), image).unwrap();
            change(image, number);
        }
        let mut command = skysweep();
        command.arg("dsm").args(&images).arg("-o").arg(place.join("out")).args(["--preset", "fast", "--gsd", "2"]);
        let run = command.args(["--dry-run", "--progress", "none"]).assert();
        let told = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        let is_doubt = |line: &&str| ["two RPCs", "centred on", "exactly"].iter().any(|word| line.contains(word));
        told.lines().filter(is_doubt).map(str::to_owned).collect()
    };
    let beside = |image: &Path, shift_px: f64| {
        let mut rpc = formats::rpc::read_for_image(image).unwrap().rpc;
        rpc.samp_off += shift_px;
        let path = image.with_file_name(format!("{}_RPC.TXT", image.file_stem().unwrap().to_string_lossy()));
        formats::rpc::write(&path, &rpc, formats::rpc::RpcFormat::Text, false).unwrap();
    };
    // Pixels that are made of those of an image, under its RPC.
    let redrawn = |image: &Path, step: usize, void_to: usize| {
        let source = ImageSource::open(image).unwrap();
        let (pixels, rpc) =
            (source.read_samples(1, source.window()).unwrap(), formats::rpc::read_for_image(image).unwrap().rpc);
        let (width, height) = (pixels.width() / step, pixels.height() / step);
        let value =
            |i: usize| if i % width < void_to { 65_535 } else { pixels[(i % width * step, i / width * step)] as u16 };
        let made = Grid::from_vec(width, height, (0..width * height).map(value).collect()).unwrap();
        let bands = [Band { description: "grey", data: BandData::U16(&made) }];
        write_image_with_rpc(image, &bands, &rpc, None, true).unwrap();
    };
    assert_eq!(warnings("plain", &|_, _| {}), Vec::<String>::new());
    assert_eq!(warnings("same", &|image, _| beside(image, 0.0)), Vec::<String>::new());
    let moved = warnings("moved", &|image, number| beside(image, if number == 0 { 7.0 } else { 0.0 }));
    assert!(
        moved.len() == 1 && moved[0].contains("differ by up to 7.0 px") && moved[0].contains("view_1_RPC.TXT"),
        "{moved:?}"
    );
    let half = warnings("half", &|image, _| redrawn(image, 2, 0));
    assert!(half.len() == 2 && half[0].contains("2 times as large in both directions"), "{half:?}");
    let void = warnings("void", &|image, _| redrawn(image, 1, 120));
    assert!(void.len() == 2 && void[0].contains("16 % of the image is one patch of exactly 65535"), "{void:?}");
}

#[test]
fn results_are_not_replaced_unasked_and_places_that_cannot_be_written_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    std::fs::create_dir_all(out.join("dsm")).unwrap();
    std::fs::write(out.join("dsm/dsm.tif"), "precious").unwrap();
    small(&out).assert().code(2).stderr(predicate::str::contains("--overwrite"));
    assert_eq!(std::fs::read(out.join("dsm/dsm.tif")).unwrap(), b"precious");
    assert!(!out.join(".skysweep-partial").exists());
    let file = folder.path().join("file");
    std::fs::write(&file, "not a folder").unwrap();
    small(&file.join("out")).assert().code(2).stderr(predicate::str::contains("cannot write the output"));
    assert_eq!(std::fs::read(&file).unwrap(), b"not a folder");
}

/// The town is near Marseille; Swiss coordinates of it mean little, Floridan ones nothing.
#[test]
fn a_crs_far_outside_its_area_of_use_must_be_forced() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let with = |crs: &str| {
        let mut command = small(&out);
        command.args(["--crs", crs, "--overwrite"]);
        command
    };
    let refused = with("EPSG:32617").assert().code(2);
    refused.stderr(predicate::str::contains("EPSG:32617, which is for").and(predicate::str::contains("--force")));
    with("EPSG:32617").arg("--force").assert().code(0);
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report/report.json")).unwrap()).unwrap();
    assert!(report["warnings"].to_string().contains("outside its area of use"), "{}", report["warnings"]);
    // Just outside: a warning is enough.
    with("EPSG:2056").assert().code(0);
}

/// The vertical datum belongs to heights. Counts and shares are not metres above anything.
#[test]
fn only_heights_have_a_vertical_datum() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    small(&out).args(["--vertical", "egm96"]).assert().code(0);
    let datum = |name: &str| formats::raster::read_dem(out.join("dsm").join(name)).unwrap().vertical;
    assert_eq!(datum("dsm.tif"), Some(crs::VerticalDatum::Egm96));
    for name in ["sigma.tif", "views.tif", "confidence.tif", "filled.tif"] {
        assert_eq!(datum(name), None, "{name}");
    }
}

/// Two runs into one folder would mix their files.
#[test]
fn a_folder_in_use_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    let other_run = std::fs::File::open(&out).unwrap();
    other_run.lock().unwrap();
    let refused = small(&out).assert().code(2);
    refused.stderr(predicate::str::contains("another run is writing into the folder"));
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
    drop(other_run);
    small(&out).assert().code(0);
    let names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(names.iter().all(|name| !name.to_string_lossy().starts_with('.')), "{names:?}");
}

/// The link that an attacker could plant under the name of the work folder is not followed.
#[cfg(unix)]
#[test]
fn planted_links_are_not_followed() {
    let folder = tempfile::tempdir().unwrap();
    let (out, outside) = (folder.path().join("out"), folder.path().join("outside"));
    std::fs::create_dir_all(outside.join("dsm")).unwrap();
    std::fs::create_dir(&out).unwrap();
    std::fs::write(outside.join("dsm/dsm.tif"), b"precious").unwrap();
    std::os::unix::fs::symlink(&outside, out.join(".skysweep-partial")).unwrap();
    small(&out).assert().code(0);
    assert_eq!(std::fs::read(outside.join("dsm/dsm.tif")).unwrap(), b"precious");
    std::fs::remove_dir_all(&out).unwrap();
    std::fs::create_dir(&out).unwrap();
    std::os::unix::fs::symlink(outside.join("dsm"), out.join("dsm")).unwrap();
    small(&out).arg("--overwrite").assert().code(2).stderr(predicate::str::contains("a link is in the place"));
    assert_eq!(std::fs::read(outside.join("dsm/dsm.tif")).unwrap(), b"precious");
}

/// An evaluation belongs to the DSM that it measured.
#[test]
fn overwriting_removes_the_evaluation_of_the_old_surface() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    small(&out).assert().code(0);
    let evaluate =
        || skysweep().arg("eval").arg(out.join("dsm/dsm.tif")).arg(small_town("truth/dsm.tif")).arg("-q").assert();
    evaluate().code(0);
    assert!(out.join("eval/report.html").is_file());
    std::fs::write(out.join("eval/notes.txt"), b"mine").unwrap();
    small(&out).args(["--overwrite", "--preset", "fast"]).assert().code(0);
    let left: Vec<_> = std::fs::read_dir(out.join("eval")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["notes.txt"]);
}

/// A folder stands for the images with an RPC in it, and a pattern in quotes for the files that
/// match: the plan is that of the images by name.
#[test]
fn folders_and_patterns_stand_for_their_images() {
    let folder = tempfile::tempdir().unwrap();
    let pass = folder.path().join("pass");
    std::fs::create_dir(&pass).unwrap();
    for view in ["view_1.tif", "view_3.tif"] {
        std::fs::copy(sample(view), pass.join(view)).unwrap();
    }
    std::fs::copy(sample("truth/dsm.tif"), pass.join("no_image.tif")).unwrap();
    let plan = |images: &[PathBuf]| {
        let mut command = skysweep();
        command.arg("dsm").args(images).arg("-o").arg(folder.path().join("out")).args(["--dry-run", "--json"]);
        let told = command.args(["--gsd", "2"]).assert().code(0).get_output().stdout.clone();
        let plan: Value = serde_json::from_slice(&told).unwrap();
        let images = plan["plan"]["config"]["images"].as_array().map(Vec::len);
        assert_eq!(images, Some(2));
        plan["plan"]["grid"].clone()
    };
    let named = plan(&[pass.join("view_1.tif"), pass.join("view_3.tif")]);
    assert!(named.is_object());
    assert_eq!(plan(std::slice::from_ref(&pass)), named);
    assert_eq!(plan(&[pass.join("view_*.tif")]), named);
    assert_eq!(plan(&[pass.join("view_1.tif"), folder.path().join("p?ss/view_3.tif")]), named);
    let surfaces = folder.path().join("surfaces");
    std::fs::create_dir(&surfaces).unwrap();
    std::fs::copy(sample("truth/dsm.tif"), surfaces.join("dsm.tif")).unwrap();
    for (image, words) in [(pass.join("*.jp2"), "no file matches the pattern"), (surfaces, "no image with an RPC")] {
        let mut command = skysweep();
        command.arg("dsm").arg(image).arg("-o").arg(folder.path().join("out")).arg("-q");
        command.assert().code(2).stderr(predicate::str::contains(words));
    }
}

/// Bounds in degrees or on another map give a grid that holds them; maps that stretch the ground
/// are told.
#[test]
fn bounds_have_a_map_of_their_own_and_a_stretched_map_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let planned = |options: &[&str]| {
        let mut command = skysweep();
        command.arg("dsm").args(views()).arg("-o").arg(folder.path().join("out")).args(["--dry-run", "--gsd", "2"]);
        command.args(options).assert().get_output().clone()
    };
    let grid = |options: &[&str]| -> Value {
        let output = planned(&[options, &["--json"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["plan"]["grid"].clone()
    };
    let on_map = ["--bounds", "693880", "4822280", "693980", "4822380"];
    let plain = grid(&on_map);
    assert_eq!(grid(&[&on_map[..], &["--bounds-crs", "EPSG:32631"]].concat()), plain);
    let map = crs::MapProjection::from_epsg(32631).unwrap();
    let (west, south) = map.lonlat_from_map(693_880.0, 4_822_280.0).unwrap();
    let (east, north) = map.lonlat_from_map(693_980.0, 4_822_380.0).unwrap();
    let degrees = [west, south, east, north].map(|edge| edge.to_string());
    let options = |flag: &'static str| {
        let mut options = vec!["--bounds"];
        options.extend(degrees.iter().map(String::as_str));
        options.extend([flag, "EPSG:4326"]);
        options
    };
    let around = grid(&options("--bounds-crs"));
    assert_eq!(grid(&options("-te_srs")), around);
    let size = |grid: &Value| [0, 1].map(|side| grid["size"][side].as_u64().unwrap());
    let (inner, outer) = (size(&plain), size(&around));
    // The meridian is turned by less than two degrees here, which adds a few cells.
    assert!((0..2).all(|side| inner[side] <= outer[side] && outer[side] <= inner[side] + 6), "{inner:?} {outer:?}");
    let told = String::from_utf8_lossy(&planned(&["--bounds-crs", "EPSG:4326"]).stderr).into_owned();
    assert!(told.contains("a CRS for them"), "{told}");
    let told = String::from_utf8_lossy(&planned(&["--crs", "EPSG:3857"]).stderr).into_owned();
    assert!(told.contains("EPSG:3857 stretches the ground by 1.3"), "{told}");
    let told = String::from_utf8_lossy(&planned(&[]).stderr).into_owned();
    assert!(!told.contains("stretches"), "{told}");
}

#[cfg(unix)]
#[test]
fn the_same_image_under_two_names_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("other.tif");
    std::os::unix::fs::symlink(sample("view_1.tif"), &other).unwrap();
    let mut command = skysweep();
    command.arg("dsm").arg(sample("view_1.tif")).arg(&other).arg("-o").arg(folder.path().join("out")).arg("-q");
    command.assert().code(2).stderr(predicate::str::contains("the same image is given twice"));
}

/// Programs that follow the progress learn how the run ended, and `-v` shows the stages.
#[test]
fn progress_tells_the_end_and_verbose_the_stages() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = |arguments: &[&str]| {
        let mut command = skysweep();
        command.arg("dsm").args(["view_1.tif", "view_3.tif"].map(small_town)).arg("-o").arg(&out).args(["--gsd", "2"]);
        let output = command.args(["--preset", "fast"]).args(arguments).output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    let last = |text: &str| -> Value {
        serde_json::from_str(text.lines().rfind(|line| line.starts_with('{')).unwrap()).unwrap()
    };
    for (event, why) in [("done", "the folder is new"), ("error", "the results exist")] {
        let told = last(&run(&["--progress", "json"]));
        assert_eq!((told["event"].as_str(), told["output"].as_str()), (Some(event), out.to_str()), "{why}: {told}");
    }
    let verbose = run(&["--progress", "none", "--overwrite", "-v"]);
    assert!(verbose.contains("sweeping heights") && verbose.contains(" s\n"), "{verbose}");
    assert!(!verbose.contains("dsm.tif"));
    let most = run(&["--progress", "none", "--overwrite", "-vv"]);
    assert!(most.contains("sweeping heights") && most.contains("writes ") && most.contains("dsm.tif"), "{most}");
    assert!(!run(&["--progress", "none", "--overwrite"]).contains("sweeping heights"));
}

/// What is given is printed as it was given, under our names or GDAL's.
#[test]
fn given_values_are_printed_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, options: &[&str]| {
        let mut command = skysweep();
        command.arg("dsm").arg(sample("view_1.tif")).arg(sample("view_3.tif")).arg("-o").arg(folder.path().join(name));
        let output = command.args(["--preset", "fast", "--progress", "none"]).args(options).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stderr).unwrap()
    };
    let heights = ["--height-range", "163.125", "268.0625"];
    let area = ["693800.3", "4822300.75", "693920.3", "4822420.75"];
    let ours = run("ours", &[&heights[..], &["--gsd", "1.25", "--crs", "EPSG:32631", "--bounds"], &area].concat());
    assert!(ours.contains(" m (given 163.125 to 268.0625 m, tie points"), "{ours}");
    let bounds = formats::raster::read_dem(folder.path().join("ours/dsm/dsm.tif")).unwrap();
    let corner = bounds.geotransform.map_from_cell(-0.5, bounds.heights.height() as f64 - 0.5);
    let printed = ours.lines().find_map(|line| line.strip_prefix("bounds        [")).unwrap();
    let printed: Vec<f64> =
        printed.split(']').next().unwrap().split(", ").map(|value| value.parse().unwrap()).collect();
    assert!((printed[0] - corner.0).abs() < 1e-6 && (printed[1] - corner.1).abs() < 1e-6, "{ours} {corner:?}");
    let gdal = run("gdal", &[&heights[..], &["-tr", "1.25", "-1.25", "-t_srs=EPSG:32631", "-te"], &area].concat());
    assert_eq!(ours.lines().filter(|l| l.contains("(given")).count(), 4);
    assert!(ours.lines().filter(|l| l.contains("(given")).all(|line| gdal.contains(line)), "{gdal}");
}
