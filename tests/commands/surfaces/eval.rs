//! `skysweep eval` from files to exit code: grids, coordinate systems, datums, classes, thresholds
//! and refusals.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use crs::{Crs, HeightConverter, MapProjection, VerticalDatum};
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use raster::{GeoTransform, Grid};
use serde_json::Value;
use tempfile::TempDir;

const WEST: f64 = 436_078.0;
const NORTH: f64 = 3_357_752.0;

/// Rolling ground with askew blocks, at UTM 17N coordinates.
fn surface(x: f64, y: f64) -> f64 {
    let (x, y) = (x - WEST, y - NORTH);
    let (u, v) = (0.956 * x + 0.292 * y, 0.956 * y - 0.292 * x);
    let block = u.rem_euclid(19.0) < 8.0 && v.rem_euclid(23.0) < 11.0;
    20.0 + 3.0 * (x / 31.0).sin() + 2.0 * (y / 23.0).cos() + if block { 7.0 } else { 0.0 }
}

fn sampled(size: (usize, usize), geotransform: &GeoTransform, f: impl Fn(f64, f64) -> f64) -> Grid<f32> {
    let cell = |i: usize| {
        let (x, y) = geotransform.map_from_cell((i % size.0) as f64, (i / size.0) as f64);
        f(x, y) as f32
    };
    Grid::from_vec(size.0, size.1, (0..size.0 * size.1).map(cell).collect()).unwrap()
}

fn write(folder: &TempDir, name: &str, data: BandData<'_>, geotransform: GeoTransform, crs: Crs) -> PathBuf {
    let path = folder.path().join(name);
    let bands = [Band { description: "height_m", data }];
    write_cog(&path, &CogRaster::new(&bands, geotransform, crs), false).unwrap();
    path
}

fn grid() -> GeoTransform {
    GeoTransform::north_up(WEST, NORTH, 0.5)
}

/// The surface in UTM 17N above a datum that is only named, not applied.
fn reference(folder: &TempDir, vertical: VerticalDatum) -> PathBuf {
    let heights = sampled((200, 180), &grid(), surface);
    write(folder, "reference.tif", BandData::F32(&heights), grid(), Crs { horizontal: 32617, vertical })
}

fn skysweep(arguments: &[&str], test: &Path, reference: &Path) -> assert_cmd::assert::Assert {
    Command::cargo_bin("skysweep").unwrap().arg("eval").args([test, reference]).args(arguments).assert()
}

fn json(arguments: &[&str], test: &Path, reference: &Path) -> Value {
    let output = skysweep(&[arguments, &["--json"]].concat(), test, reference).success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

#[test]
fn a_moved_copy_is_brought_back() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let heights = sampled((200, 180), &grid(), |x, y| surface(x, y) - 4.1);
    let moved = GeoTransform::north_up(WEST - 3.3, NORTH + 2.7, 0.5);
    let test = write(&folder, "test.tif", BandData::F32(&heights), moved, Crs::ellipsoidal(32617));
    let found = json(&[], &test, &reference);
    for (axis, expected) in [("dx_m", 3.3), ("dy_m", -2.7), ("dz_m", 4.1)] {
        assert!((number(&found, &format!("/shift/{axis}")) - expected).abs() < 0.05, "{found}");
    }
    let slopes = json(&["--align", "nuth-kaab"], &test, &reference);
    for (axis, expected) in [("dx_m", 3.3), ("dy_m", -2.7), ("dz_m", 4.1)] {
        assert!((number(&slopes, &format!("/shift/{axis}")) - expected).abs() < 0.05, "{slopes}");
    }
    assert_eq!(slopes.pointer("/protocol/alignment").and_then(Value::as_str), Some("nuth-kaab"));
    let unaligned = json(&["--align", "z"], &test, &reference);
    assert_eq!(number(&unaligned, "/shift/dx_m"), 0.0);
    assert!(number(&unaligned, "/metrics/mae") > 5.0 * number(&found, "/metrics/mae"), "{unaligned} {found}");
}

#[test]
fn another_coordinate_system_and_datum_are_met() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let (utm17, utm16) = (MapProjection::from_epsg(32617).unwrap(), MapProjection::from_epsg(32616).unwrap());
    let egm96 = HeightConverter::new(VerticalDatum::Egm96).unwrap();
    let lonlat = |x: f64, y: f64| utm17.lonlat_from_map(x, y).unwrap();
    let (lon, lat) = lonlat(WEST, NORTH);
    let corner = utm16.map_from_lonlat(lon, lat).unwrap();
    // Larger than the reference by 30 m all around, turned against it by the convergence of the
    // meridians.
    let there = GeoTransform::north_up(corner.x - 30.0, corner.y + 30.0, 0.4);
    let heights = sampled((420, 400), &there, |x, y| {
        let (lon, lat) = utm16.lonlat_from_map(x, y).unwrap();
        let point = utm17.map_from_lonlat(lon, lat).unwrap();
        egm96.datum_from_ellipsoid(lon, lat, surface(point.x, point.y)).unwrap()
    });
    let crs = Crs { horizontal: 32616, vertical: VerticalDatum::Egm96 };
    let test = write(&folder, "test.tif", BandData::F32(&heights), there, crs);
    let found = json(&["--align", "none"], &test, &reference);
    assert_eq!(number(&found, "/metrics/valid_ratio"), 1.0);
    assert!(number(&found, "/metrics/median").abs() < 0.01, "{found}");
    assert!(number(&found, "/metrics/nmad") < 0.02, "{found}");
    let aligned = json(&[], &test, &reference);
    assert!(number(&aligned, "/shift/dx_m").hypot(number(&aligned, "/shift/dy_m")) < 0.05, "{aligned}");
}

#[test]
fn datums_that_may_differ_are_refused_until_they_are_named() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Egm96);
    let heights = sampled((200, 180), &grid(), surface);
    let stated = write(&folder, "stated.tif", BandData::F32(&heights), grid(), Crs::ellipsoidal(32617));
    let converted = json(&["--align", "none"], &stated, &reference);
    assert!(number(&converted, "/metrics/median").abs() > 10.0, "{converted}");
    let named = json(&["--align", "none", "--test-vertical", "egm96"], &stated, &reference);
    assert_eq!(number(&named, "/metrics/mae"), 0.0);
    // An ASCII grid names no coordinate system at all.
    let bare = folder.path().join("bare.asc");
    let south = NORTH - 20.0 * 0.5;
    let text =
        format!("ncols 20\nnrows 20\nxllcorner {WEST}\nyllcorner {south}\ncellsize 0.5\n{}", "21.5 ".repeat(400));
    std::fs::write(&bare, text).unwrap();
    skysweep(&[], &bare, &reference).code(2).stderr(contains("above egm96").and(contains("--test-vertical")));
    skysweep(&[], &reference, &bare).code(2).stderr(contains("above egm96").and(contains("--ref-vertical")));
    let named = json(&["--align", "none", "--test-vertical", "egm96"], &bare, &reference);
    assert_eq!(number(&named, "/metrics/n"), 400.0);
    assert!(named.to_string().contains("no coordinate system"), "{named}");
    // A geoid taken for the ellipsoid is a constant, which the median removes and nothing else
    // does.
    let assumed = json(&["--align", "z"], &bare, &stated);
    assert!(assumed.to_string().contains("taken as the ellipsoid"), "{assumed}");
    skysweep(&["--align", "none"], &bare, &stated).code(2).stderr(contains("--test-vertical"));
    skysweep(&["--align", "none"], &stated, &bare).code(2).stderr(contains("--ref-vertical"));
    skysweep(&["--test-vertical", "sea"], &bare, &reference).code(2);
}

/// Writes a surface that is wrong by 5 m on the west half, and by 0.25 m on the east half.
fn wrong_in_the_west(folder: &TempDir) -> PathBuf {
    let heights = sampled((200, 180), &grid(), |x, y| surface(x, y) + if x < WEST + 50.0 { 5.0 } else { 0.25 });
    write(folder, "test.tif", BandData::F32(&heights), grid(), Crs::ellipsoidal(32617))
}

#[test]
fn classes_are_counted_apart_and_skipped() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let test = wrong_in_the_west(&folder);
    // Class 9 is the west half, on a grid of its own.
    let class_grid = GeoTransform::north_up(WEST, NORTH, 2.0);
    let classes = sampled((50, 45), &class_grid, |x, _| if x < WEST + 50.0 { 9.0 } else { 2.0 }).map(|&c| c as u8);
    let classes = write(&folder, "classes.tif", BandData::U8(&classes), class_grid, Crs::ellipsoidal(32617));
    let classes = classes.to_str().unwrap();
    let all = json(&["--align", "none", "--classes", classes], &test, &reference);
    assert!((number(&all, "/classes/9/mae") - 5.0).abs() < 1e-5);
    assert!((number(&all, "/classes/2/mae") - 0.25).abs() < 1e-5);
    assert_eq!(number(&all, "/metrics/completeness_1"), 0.5);
    let skipped = json(&["--align", "none", "--classes", classes, "--skip", "9"], &test, &reference);
    assert_eq!(number(&skipped, "/metrics/completeness_1"), 1.0);
    assert_eq!(number(&skipped, "/protocol/skipped_cells"), 18_000.0);
    assert!(skipped.pointer("/classes/9").is_none());
    let table = skysweep(&["--align", "none", "--classes", classes], &test, &reference).success();
    table.stdout(contains("2 ground")).stdout(contains("9 water")).stdout(contains("completeness_1 %"));
}

#[test]
fn a_mask_leaves_cells_out() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let test = wrong_in_the_west(&folder);
    let mask_grid = GeoTransform::north_up(WEST, NORTH, 1.0);
    let mask = sampled((100, 90), &mask_grid, |x, _| if x < WEST + 50.0 { 0.0 } else { 255.0 }).map(|&m| m as u8);
    let mask = write(&folder, "mask.tif", BandData::U8(&mask), mask_grid, Crs::ellipsoidal(32617));
    let found = json(&["--align", "none", "--mask", mask.to_str().unwrap()], &test, &reference);
    assert_eq!(number(&found, "/metrics/reference_cells"), 18_000.0);
    assert_eq!(number(&found, "/protocol/skipped_cells"), 18_000.0);
    assert!((number(&found, "/metrics/mae") - 0.25).abs() < 1e-5);
}

#[test]
fn a_terrain_model_tells_what_stands() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    // Blocks are found on the east half only; the terrain is coarser, and 1.5 m off where nothing
    // stands.
    let ground = |x: f64, y: f64| 20.0 + 3.0 * ((x - WEST) / 31.0).sin() + 2.0 * ((y - NORTH) / 23.0).cos();
    let half = |x: f64, y: f64| if x < WEST + 50.0 { ground(x, y) } else { surface(x, y) };
    let heights = sampled((200, 180), &grid(), half);
    let test = write(&folder, "test.tif", BandData::F32(&heights), grid(), Crs::ellipsoidal(32617));
    let dtm_grid = GeoTransform::north_up(WEST - 4.0, NORTH + 4.0, 2.0);
    let dtm = sampled((60, 60), &dtm_grid, ground);
    let dtm = write(&folder, "dtm.tif", BandData::F32(&dtm), dtm_grid, Crs::ellipsoidal(32617));
    let found = json(&["--align", "none", "--dtm", dtm.to_str().unwrap()], &test, &reference);
    let recall = number(&found, "/standing/volume_m3/recall");
    assert!((0.3..0.7).contains(&recall), "{found}");
    assert!(number(&found, "/standing/footprint_m2/precision") > 0.999, "{found}");
    assert_eq!(number(&found, "/standing/footprint_m2/iou"), number(&found, "/standing/footprint_m2/recall"));
    assert_eq!(found.pointer("/protocol/terrain/source").and_then(Value::as_str), Some("given"));
    let estimated = json(&["--align", "none"], &test, &reference);
    assert!((number(&estimated, "/standing/footprint_m2/recall") - recall).abs() < 0.2, "{estimated}");
    assert_eq!(estimated.pointer("/protocol/terrain/source").and_then(Value::as_str), Some("estimated"));
}

/// What a surface model says about itself lies beside it. Half of the cells are filled and 3 m too
/// high; the others are 0.3 m too high with a σ of 0.5 m.
#[test]
fn layers_beside_the_test_tell_observed_from_filled_and_judge_the_uncertainty() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let is_filled = |x: f64| x < WEST + 50.0;
    let utm = Crs::ellipsoidal(32617);
    let heights = sampled((200, 180), &grid(), |x, y| surface(x, y) + if is_filled(x) { 3.0 } else { 0.3 });
    let test = write(&folder, "dsm.tif", BandData::F32(&heights), grid(), utm);
    let flags = sampled((200, 180), &grid(), |x, _| f64::from(u8::from(is_filled(x)))).map(|&flag| flag as u8);
    write(&folder, "filled.tif", BandData::U8(&flags), grid(), utm);
    let alone = json(&["--align", "none"], &test, &reference);
    assert!(alone["sigma"].is_null() && alone["reliability"].is_null() && alone["objects"].is_null(), "{alone}");
    let sigma = sampled((200, 180), &grid(), |x, _| if is_filled(x) { 2.0 } else { 0.5 });
    write(&folder, "sigma.tif", BandData::F32(&sigma), grid(), utm);
    let confidence = sampled((200, 180), &grid(), |x, _| if is_filled(x) { 0.25 } else { 0.95 });
    write(&folder, "confidence.tif", BandData::F32(&confidence), grid(), utm);
    let found = json(&["--align", "none"], &test, &reference);
    assert_eq!(found["metrics"], alone["metrics"], "layers change no metric");
    for (name, mae, pag) in [("observed", 0.3, 1.0), ("filled", 3.0, 0.0)] {
        let of = |member: &str| number(&found, &format!("/origins/{name}/{member}"));
        assert!((of("metrics/mae") - mae).abs() < 1e-4 && of("metrics/pag_1") == pag, "{found}");
        assert!((of("metrics/valid_ratio") - 0.5).abs() < 1e-9 && of("edges/edge/n") > 100.0, "{found}");
    }
    assert_eq!((number(&found, "/sigma/observed/below_1_sigma"), number(&found, "/sigma/filled/n")), (1.0, 18_000.0));
    assert_eq!(number(&found, "/sigma/filled/below_2_sigma"), 1.0);
    // The cells are 0.5 m wide, so a height is right below one metre.
    assert_eq!(number(&found, "/reliability/right_below_m"), 1.0);
    assert!((number(&found, "/reliability/tenths/9/promised") - 0.95).abs() < 1e-6);
    assert_eq!(
        (number(&found, "/reliability/tenths/9/right"), number(&found, "/reliability/tenths/2/right")),
        (1.0, 0.0)
    );
    let table = skysweep(&["--align", "none"], &test, &reference).success();
    table.stdout(contains("origin").and(contains("filled %")).and(contains("promised %")).and(contains("sigma")));
    // `source.tif` is believed before `filled.tif`, and a file on another grid is left out.
    let codes = sampled((200, 180), &grid(), |x, _| if is_filled(x) { 4.0 } else { 11.0 }).map(|&code| code as u8);
    write(&folder, "source.tif", BandData::U8(&codes), grid(), utm);
    std::fs::remove_file(folder.path().join("sigma.tif")).unwrap();
    write(&folder, "sigma.tif", BandData::F32(&Grid::filled(9, 9, 1.0f32)), grid(), utm);
    let found = json(&["--align", "none"], &test, &reference);
    assert_eq!(
        (number(&found, "/origins/filled/metrics/n"), number(&found, "/origins/unknown_cells")),
        (18_000.0, 18_000.0)
    );
    assert!(found["sigma"].is_null() && found.to_string().contains("sigma.tif"), "{found}");
}

#[test]
fn numbered_buildings_are_found_damaged_or_lost() {
    let folder = TempDir::new().unwrap();
    let utm = Crs::ellipsoidal(32617);
    // Three halls of 12 m in a row, 20 m apart, and trees east of them.
    let hall = |x: f64, y: f64| {
        let (u, v) = (x - WEST, y - NORTH + 60.0);
        ((0.0..60.0).contains(&u) && u.rem_euclid(20.0) < 12.0 && (0.0..12.0).contains(&v))
            .then_some(1.0 + (u / 20.0).floor())
    };
    let tree = |x: f64| x > WEST + 90.0;
    let truth = |x: f64, y: f64| {
        20.0 + if hall(x, y).is_some() {
            12.0
        } else if tree(x) {
            6.0
        } else {
            0.0
        }
    };
    let truths = sampled((200, 180), &grid(), truth);
    let reference = write(&folder, "reference.tif", BandData::F32(&truths), grid(), utm);
    let numbers = sampled((200, 180), &grid(), |x, y| hall(x, y).unwrap_or(if tree(x) { -1.0 } else { 0.0 }));
    let numbers = write(&folder, "numbers.tif", BandData::F32(&numbers), grid(), utm);
    // The second hall is missing, a third of the third one too, and trees are 3 m too low in the
    // north.
    let heights = sampled((200, 180), &grid(), |x, y| match hall(x, y) {
        Some(2.0) => 20.0,
        Some(3.0) if x > WEST + 48.0 => 20.0,
        None if tree(x) && y > NORTH - 45.0 => 23.0,
        _ => truth(x, y),
    });
    let test = write(&folder, "test.tif", BandData::F32(&heights), grid(), utm);
    let found = json(&["--align", "none", "--buildings", numbers.to_str().unwrap()], &test, &reference);
    let objects = &found["objects"];
    let of = |name: &str| number(objects, &format!("/{name}"));
    assert_eq!((of("buildings"), of("lost"), of("damaged")), (3.0, 1.0, 2.0), "{objects}");
    assert!((of("trees_right") - 0.5).abs() < 1e-9 && objects["worst"][0]["number"] == 2, "{objects}");
    // The one whole hall has its outlines where they are.
    assert!(number(&found, "/outlines/median_cells").abs() < 0.01, "{found}");
    let table = skysweep(&["--align", "none", "--buildings", numbers.to_str().unwrap()], &test, &reference).success();
    table.stdout(contains("trees right %").and(contains("building 2")));
}

/// A classified LAZ cloud of the surface, denser than its cells, above EGM96.
#[test]
fn a_point_cloud_is_a_reference() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("reference.laz");
    let mut builder = las::Builder::from(las::Version::new(1, 4));
    builder.point_format = las::point::Format::new(6).unwrap();
    builder.point_format.is_compressed = true;
    let axis = |offset| las::Transform { scale: 0.001, offset };
    builder.transforms = las::Vector { x: axis(WEST), y: axis(NORTH), z: axis(0.0) };
    let mut header = builder.into_header().unwrap();
    let crs = Crs { horizontal: 32617, vertical: VerticalDatum::Egm96 };
    header.set_wkt_crs(crs.wkt().unwrap().into_bytes()).unwrap();
    let mut writer = las::Writer::from_path(&path, header).unwrap();
    for i in 0..100 * 90 {
        let (x, y) = (WEST + 0.5 + f64::from(i % 100), NORTH - 0.5 - f64::from(i / 100));
        let classification = las::point::Classification::new(if i % 2 == 0 { 2 } else { 6 }).unwrap();
        let point = las::Point { x, y, z: 12.0, classification, gps_time: Some(0.0), ..las::Point::default() };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    let heights = Grid::filled(100, 90, 12.75f32);
    let test_grid = GeoTransform::north_up(WEST, NORTH, 1.0);
    let crs = Crs { horizontal: 32617, vertical: VerticalDatum::Egm96 };
    let test = write(&folder, "test.tif", BandData::F32(&heights), test_grid, crs);
    let found = json(&["--align", "none"], &test, &path);
    assert_eq!(number(&found, "/metrics/n"), 9000.0);
    assert!((number(&found, "/classes/6/mae") - 0.75).abs() < 1e-6, "{found}");
    assert_eq!(found.pointer("/protocol/vertical").and_then(Value::as_str), Some("egm96"));
    let ground = json(&["--align", "none", "--skip", "6"], &test, &path);
    assert_eq!(number(&ground, "/metrics/reference_cells"), 4500.0);
    let coarse = json(&["--align", "none", "--ref-cell", "10"], &test, &path);
    assert_eq!(number(&coarse, "/metrics/reference_cells"), 90.0);
    skysweep(&["--ref-cell", "-1"], &test, &path).code(2);
}

#[test]
fn requirements_decide_the_exit_code() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let heights = sampled((200, 180), &grid(), |x, y| surface(x, y) + 0.75);
    let test = write(&folder, "test.tif", BandData::F32(&heights), grid(), Crs::ellipsoidal(32617));
    skysweep(&["--align", "none", "--max-mae", "0.8", "--min-completeness", "1"], &test, &reference).code(0);
    skysweep(&["--align", "none", "--max-mae", "0.7"], &test, &reference).code(1).stderr(contains("mae is 0.750 m"));
    let missed = skysweep(&["--align", "none", "--min-completeness", "0.6=0.5"], &test, &reference).code(1);
    missed.stderr(contains("completeness_0.6 is 0.0000"));
}

#[test]
fn the_error_map_holds_the_errors_and_is_not_replaced_unasked() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let heights = sampled((200, 180), &grid(), |x, y| if x < WEST + 10.0 { f64::NAN } else { surface(x, y) + 0.75 });
    let test = write(&folder, "test.tif", BandData::F32(&heights), grid(), Crs::ellipsoidal(32617));
    let map = folder.path().join("errors.tif");
    let arguments = ["--align", "none", "--error-map", map.to_str().unwrap()];
    skysweep(&arguments, &test, &reference).success();
    let errors = read_dem(&map).unwrap();
    assert!((errors.heights[(100, 90)] - 0.75).abs() < 1e-5 && errors.heights[(10, 10)].is_nan());
    assert_eq!(errors.geotransform, grid());
    skysweep(&arguments, &test, &reference).code(2);
    skysweep(&[&arguments[..], &["--overwrite"]].concat(), &test, &reference).success();
}

#[test]
fn bad_input_is_refused_in_one_message() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let far = GeoTransform::north_up(WEST + 10_000.0, NORTH, 0.5);
    let heights = Grid::filled(30, 30, 1.0f32);
    let elsewhere = write(&folder, "far.tif", BandData::F32(&heights), far, Crs::ellipsoidal(32617));
    let text = folder.path().join("text.tif");
    std::fs::write(&text, "no raster").unwrap();
    skysweep(&["--align", "none"], &elsewhere, &reference).code(2).stderr(contains("share no valid cell"));
    // No alignment helps where there is nothing to align.
    skysweep(&[], &elsewhere, &reference).code(2).stderr(contains("error:").and(contains("--align").not()));
    skysweep(&[], &text, &reference).code(2).stderr(contains("text.tif"));
    skysweep(&[], &reference, &folder.path().join("missing.tif")).code(2).stderr(contains("missing.tif"));
    let flat =
        write(&folder, "flat.tif", BandData::F32(&Grid::filled(200, 180, 5.0f32)), grid(), Crs::ellipsoidal(32617));
    skysweep(&["--align", "nuth-kaab"], &flat, &flat).code(2).stderr(contains("too flat"));
    skysweep(&["--search-m", "0"], &reference, &reference).code(2).stderr(contains("search radius"));
    skysweep(&["--search-m", "1e9"], &reference, &reference).code(2).stderr(contains("smaller radius"));
    skysweep(&["--search-m", "nan"], &reference, &reference).code(2);
    skysweep(&["--thresholds", "1,-2"], &reference, &reference).code(2).stderr(contains("threshold"));
    skysweep(&["--skip", "9"], &reference, &reference).code(2).stderr(contains("--classes"));
    skysweep(&["--min-completeness", "62"], &reference, &reference).code(2).stderr(contains("share"));
}

/// The LiDAR surface of Jacksonville, moved by its geotransform alone, and its classes, which carry
/// no georeference.
#[test]
fn the_lidar_truth_is_brought_back_too() {
    let Some(truth) = testing::shared_data("stereo/jax_068/truth") else { return };
    let (reference, classes) = (truth.join("JAX_068_DSM_georef.tif"), truth.join("JAX_068_CLS.tif"));
    let folder = TempDir::new().unwrap();
    let dem = read_dem(&reference).unwrap();
    let mut moved = dem.geotransform;
    moved.0[0] -= 3.3;
    moved.0[3] += 2.7;
    let lowered = dem.heights.map(|h| h - 4.1);
    let test = write(&folder, "test.tif", BandData::F32(&lowered), moved, Crs::ellipsoidal(32617));
    let found = json(&["--classes", classes.to_str().unwrap()], &test, &reference);
    for (axis, expected) in [("dx_m", 3.3), ("dy_m", -2.7), ("dz_m", 4.1)] {
        assert!((number(&found, &format!("/shift/{axis}")) - expected).abs() < 0.05, "{found}");
    }
    let slopes = json(&["--align", "nuth-kaab"], &test, &reference);
    for (axis, expected) in [("dx_m", 3.3), ("dy_m", -2.7), ("dz_m", 4.1)] {
        assert!((number(&slopes, &format!("/shift/{axis}")) - expected).abs() < 0.05, "{slopes}");
    }
    assert_eq!(number(&found, "/metrics/reference_cells"), 512.0 * 512.0);
    assert!(found.to_string().contains("the class raster has no georeference"));
    assert!(found.pointer("/classes/6/mae").is_some());
}

/// The folder of a run stands for its surface model, here as in the other commands.
#[test]
fn the_folder_of_a_run_is_its_surface_model() {
    let folder = TempDir::new().unwrap();
    let reference = reference(&folder, VerticalDatum::Ellipsoid);
    let run = folder.path().join("run");
    std::fs::create_dir_all(run.join("dsm")).unwrap();
    std::fs::copy(&reference, run.join("dsm/dsm.tif")).unwrap();
    let report = json(&["--no-report", "--align", "none"], &run, &reference);
    assert_eq!(number(&report, "/metrics/mae"), 0.0);
    let report = json(&["--no-report", "--align", "none"], &reference, &run);
    assert_eq!(number(&report, "/metrics/mae"), 0.0);
    // -v says what is done, -vv which files are read.
    let told = |option: &str| {
        let output = skysweep(&["--no-report", option], &run, &reference).success().get_output().stderr.clone();
        String::from_utf8(output).unwrap()
    };
    assert!(told("-v").contains("evaluation") && !told("-v").contains("dsm.tif"), "{}", told("-v"));
    assert!(told("-vv").contains("dsm/dsm.tif"), "{}", told("-vv"));
    skysweep(&[], folder.path(), &reference)
        .code(2)
        .stderr(contains("a folder is given").and(contains("reference.tif")));
}

/// A unit or a constant that makes a comparison meaningless is told by name.
#[test]
fn feet_and_undeclared_constants_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let heights = sampled((200, 180), &grid(), |x, y| 180.0 + surface(x, y));
    let metres = write(&folder, "metres.tif", BandData::F32(&heights), grid(), Crs::ellipsoidal(32617));
    let notes = |name: &str, change: &dyn Fn(usize, f32) -> f32| -> (String, PathBuf) {
        let changed = heights.data().iter().enumerate().map(|(i, height)| change(i, *height)).collect();
        let changed = Grid::from_vec(200, 180, changed).unwrap();
        let test = write(&folder, name, BandData::F32(&changed), grid(), Crs::ellipsoidal(32617));
        let told = json(&["--no-report"], &test, &metres);
        (told["notes"].to_string(), test)
    };
    let (feet, test) = notes("feet.tif", &|_, height| height / 0.3048);
    assert!(feet.contains("they are probably in feet"), "{feet}");
    let turned = json(&["--no-report"], &metres, &test);
    assert!(turned["notes"].to_string().contains("those of the reference are probably in feet"), "{turned}");
    let (far, _) = notes("far.tif", &|_, height| height + 300.0);
    assert!(far.contains("more than any two vertical datums differ"), "{far}");
    let (near, _) = notes("near.tif", &|_, height| height + 29.0);
    assert!(!near.contains("feet") && !near.contains("datums differ") && !near.contains("exactly"), "{near}");
    for value in [0.0, 200.0] {
        let name = format!("{value}.tif");
        let (constant, _) = notes(&name, &|i, height| if i % 200 < 100 { value } else { height });
        assert!(constant.contains(&format!("50 % of the cells have exactly the height {value}")), "{constant}");
    }
}
