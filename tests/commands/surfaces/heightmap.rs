//! `skysweep heightmap` end to end: where its pixels are and what they hold, against rasterio,
//! pyproj and NumPy (`reference/heightmap.txt`, written by `heightmap.py`), and what it refuses.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::common::skysweep;
use crs::{Crs, MapProjection, VerticalDatum};
use formats::raster::{Band, BandData, CogRaster, Dem, ImageSource, read_dem, write_cog};
use formats::splat_ply::LocalOrigin;
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;
use tempfile::TempDir;

const CENTRE: [&str; 3] = ["--center", "5.4", "43.53"];
/// A twentieth of a pixel of half a metre.
const PLACE_TOLERANCE_M: f64 = 0.05 * 0.5;

fn town(name: &str) -> PathBuf {
    crate::common::sample("truth").join(name)
}

/// The rows of a section of the reference.
fn reference(section: &str) -> Vec<Vec<f64>> {
    let text = include_str!("../../reference/heightmap.txt");
    let rows = text.lines().filter_map(|line| line.strip_prefix(section)?.strip_prefix(' '));
    rows.map(|row| row.split(' ').map(|v| v.parse().unwrap()).collect()).collect()
}

/// Makes a map of a source around the town's centre.
fn map(folder: &TempDir, source: &Path, options: &[&str]) -> PathBuf {
    let path = folder.path().join(format!("map_{}.tif", options.join("_").replace(['-', ':', '/'], "")));
    skysweep().arg("heightmap").arg(source).args(CENTRE).args(options).arg("-o").arg(&path).assert().code(0);
    path
}

fn tags(path: &Path) -> HashMap<String, String> {
    ImageSource::open(path).unwrap().metadata("").into_iter().collect()
}

fn number(tags: &HashMap<String, String>, key: &str) -> f64 {
    tags[key].parse().unwrap()
}

/// Values as they stand in the file.
fn values(path: &Path, band: usize) -> Grid<f32> {
    crate::common::band(path, band)
}

/// Whether two maps hold the same, voids included.
fn same(a: &Path, b: &Path) -> bool {
    let bits = |path: &Path| values(path, 1).data().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    bits(a) == bits(b)
}

fn at(dem: &Dem, row: &[f64]) -> f64 {
    f64::from(dem.heights[(row[0] as usize, row[1] as usize)])
}

/// Both have no height, or the same within a tolerance.
fn agree(found: f64, expected: f64, tolerance: f64) -> bool {
    (found.is_nan() && expected.is_nan()) || (found - expected).abs() <= tolerance
}

#[test]
fn a_turned_map_is_in_its_place_and_holds_the_surface() {
    let folder = tempfile::tempdir().unwrap();
    for crs in ["local", "utm"] {
        let path = map(&folder, &town("dsm.tif"), &["--heading", "37", "--crs", crs]);
        let dem = read_dem(&path).unwrap();
        let projection = MapProjection::from_definition(dem.crs_wkt.as_deref().unwrap()).unwrap();
        let places = reference("place");
        assert_eq!(places.len(), 1000);
        let mut voids = 0;
        for row in &places {
            let (x, y) = dem.geotransform.map_from_cell(row[0], row[1]);
            let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
            let off_m = [(lon - row[2]) * row[3].to_radians().cos(), lat - row[3]].map(|d| d.to_radians() * 6.37e6);
            assert!(off_m[0].hypot(off_m[1]) < PLACE_TOLERANCE_M, "{crs} {row:?}: {off_m:?} m off");
            // On the local map places agree to micrometres, and so do heights; UTM bends by up to a
            // fiftieth of a pixel.
            let tolerance = if crs == "local" { 1e-3 } else { 0.05 };
            assert!(agree(at(&dem, row), row[4], tolerance), "{crs} {row:?}: {}", at(&dem, row));
            voids += usize::from(row[4].is_nan());
        }
        assert!(voids > 10 && dem.vertical == Some(VerticalDatum::Ellipsoid));
    }
}

#[test]
fn gdallocationinfo_finds_the_surface_at_the_places() {
    let folder = tempfile::tempdir().unwrap();
    let path = map(&folder, &town("dsm.tif"), &["--heading", "37"]);
    let places = reference("place");
    let lonlat: String = places.iter().map(|row| format!("{} {}\n", row[2], row[3])).collect();
    let mut gdal = assert_cmd::Command::new("gdallocationinfo");
    let Ok(output) = gdal.args(["-valonly", "-wgs84"]).arg(&path).write_stdin(lonlat).output() else {
        testing::skip("gdallocationinfo is not installed");
        return;
    };
    let camera = number(&tags(&path), "CAMERA_HEIGHT_M");
    let found: Vec<f64> =
        String::from_utf8(output.stdout).unwrap().lines().map(|v| v.trim().parse().unwrap()).collect();
    assert_eq!(found.len(), places.len());
    for (value, row) in found.iter().zip(&places) {
        let height = if *value == -32768.0 { f64::NAN } else { value + camera };
        assert!(agree(height, row[4], 1e-3), "{row:?}: {height}");
    }
}

#[test]
fn without_a_heading_it_is_rasterios_warp() {
    let folder = tempfile::tempdir().unwrap();
    let dem = read_dem(map(&folder, &town("dsm.tif"), &[])).unwrap();
    let rows = reference("warp");
    assert_eq!(rows.len(), 500);
    for row in &rows {
        // GDAL's warp transforms whole rows through an approximation even where it is told not to.
        assert!(agree(at(&dem, row), row[2], 2e-3), "{row:?}: {}", at(&dem, row));
    }
}

#[test]
fn a_city_model_is_met_from_above() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--heading", "37", "--source-vertical", "ellipsoid", "--camera-height", "190"];
    let path = map(&folder, &town("buildings.city.json"), &options);
    let dem = read_dem(&path).unwrap();
    let rows = reference("roof");
    let met = rows.iter().filter(|row| row[2].is_finite()).count();
    assert!(rows.len() > 900 && met > 50, "{met} of {} places under a roof", rows.len());
    for row in &rows {
        let found = at(&dem, row);
        // Vertices lie on whole millimetres, so that polygons are not quite plane.
        assert!(agree(found, row[2], 5e-3), "{row:?}: {found}");
    }
    assert_eq!(tags(&path)["SOURCE_KIND"], "city model");
}

#[test]
fn a_terrain_model_stands_in_where_there_is_no_building() {
    let folder = tempfile::tempdir().unwrap();
    let dtm = town("dtm.tif");
    let options = ["--source-vertical", "ellipsoid", "--dtm", dtm.to_str().unwrap(), "--confidence"];
    let path = map(&folder, &town("buildings.city.json"), &options);
    let (dem, confidence) = (read_dem(&path).unwrap(), values(&path, 2));
    let ground = read_dem(map(&folder, &dtm, &[])).unwrap();
    let mut counts = [0; 2];
    for (i, &known) in confidence.data().iter().enumerate() {
        let (height, terrain) = (dem.heights.data()[i], ground.heights.data()[i]);
        if known == 0.0 {
            assert!((height - terrain).abs() < 1e-3);
        } else {
            assert!(known == 1.0 && height > terrain - 3.0);
        }
        counts[known as usize] += 1;
    }
    assert!(counts[0] > 100_000 && counts[1] > 20_000, "{counts:?}");
}

#[test]
fn a_cloud_gives_the_highest_point_of_each_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.las");
    let points: Vec<[f64; 3]> = reference("point").iter().map(|p| [p[0], p[1], p[2]]).collect();
    formats::points::write_las(&cloud, &points, Crs::ellipsoidal(32631), false).unwrap();
    let path = map(&folder, &cloud, &["--heading", "-23", "--size", "24"]);
    let dem = read_dem(&path).unwrap();
    let rows = reference("cell");
    assert_eq!(dem.heights.data().iter().filter(|h| h.is_finite()).count(), rows.len());
    for row in &rows {
        assert!(agree(at(&dem, row), row[2], 1e-4), "{row:?}: {}", at(&dem, row));
    }
    assert_eq!(tags(&path)["SOURCE_KIND"], "point cloud");
}

#[test]
fn what_the_file_says_of_itself_is_what_was_asked_for_and_found() {
    let folder = tempfile::tempdir().unwrap();
    let camera = folder.path().join("camera.json");
    std::fs::write(&camera, r#"{"lon_deg": 5.4, "lat_deg": 43.53, "heading_deg": -12.5}"#).unwrap();
    let path = folder.path().join("map.tif");
    let mut command = skysweep();
    command.arg("heightmap").arg(town("dsm.tif")).arg("--camera").arg(&camera).arg("-o").arg(&path);
    let output = command.args(["--json", "--ground-offset", "1.5"]).assert().code(0).get_output().stdout.clone();
    let (tags, told): (_, Value) = (tags(&path), serde_json::from_slice(&output).unwrap());
    for (key, told) in [
        ("CAMERA_LON_DEG", &told["camera_lon_deg"]),
        ("CAMERA_LAT_DEG", &told["camera_lat_deg"]),
        ("CAMERA_HEIGHT_M", &told["camera_height_m"]),
        ("GROUND_HEIGHT_M", &told["ground_height_m"]),
        ("HEADING_DEG", &told["heading_deg"]),
        ("RESOLUTION_PX_PER_M", &told["resolution_px_per_m"]),
        ("SCENE_SCALE_M", &told["scene_scale_m"]),
    ] {
        assert_eq!(number(&tags, key).to_bits(), told.as_f64().unwrap().to_bits(), "{key}");
    }
    assert_eq!(number(&tags, "CAMERA_LAT_DEG"), 43.53);
    assert_eq!(number(&tags, "HEADING_DEG"), -12.5);
    assert!((number(&tags, "CAMERA_HEIGHT_M") - number(&tags, "GROUND_HEIGHT_M") - 1.5).abs() < 1e-9);
    assert_eq!(
        (tags["SOURCE"].as_str(), tags["UNITS"].as_str(), tags["NORMALIZED"].as_str()),
        ("dsm.tif", "metre", "no")
    );
    // The ground is the surface at the middle of the tile, which is its zero less the offset.
    let heights = values(&path, 1);
    let middle: f32 = [(258, 258), (259, 258), (258, 259), (259, 259)].iter().map(|&at| heights[at] / 4.0).sum();
    assert!((middle + 1.5).abs() < 1e-4, "{middle}");
    assert!(path.with_extension("png").is_file() && path.with_extension("pgw").is_file());
    let page = std::fs::read_to_string(folder.path().join("map_report.html")).unwrap();
    assert!(page.contains("Heights relative to the camera") && page.contains("camera height, m"), "no map on the page");
}

/// A position that is off by a few metres lies on a roof. The ground is beside and under it.
#[test]
fn the_ground_under_a_camera_is_no_roof() {
    let folder = tempfile::tempdir().unwrap();
    let (surface, ground) = (read_dem(town("dsm.tif")).unwrap(), read_dem(town("dtm.tif")).unwrap());
    let numbers = values(&town("buildings.tif"), 1);
    let projection = MapProjection::from_definition(surface.crs_wkt.as_deref().unwrap()).unwrap();
    let mut seen = Vec::new();
    for row in (100..surface.heights.height() - 100).step_by(7) {
        for column in (100..surface.heights.width() - 100).step_by(7) {
            let (number, terrain) = (numbers[(column, row)], ground.heights[(column, row)]);
            if number <= 0.0 || seen.contains(&number) || surface.heights[(column, row)] - terrain < 4.0 {
                continue;
            }
            seen.push(number);
            let (x, y) = surface.geotransform.map_from_cell(column as f64, row as f64);
            let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
            for (source, vertical) in [("dsm.tif", None), ("buildings.city.json", Some("ellipsoid"))] {
                let path = folder.path().join("map.tif");
                let mut command = skysweep();
                command.arg("heightmap").arg(town(source)).arg("--center").args([lon, lat].map(|v| v.to_string()));
                command.args(vertical.iter().flat_map(|datum| ["--source-vertical", datum]));
                command.args(["--size", "300", "--no-preview", "--overwrite", "-o"]).arg(&path).assert().code(0);
                let found = number_of(&path, "GROUND_HEIGHT_M");
                assert!((found - f64::from(terrain)).abs() < 1.5, "{source}: {found} instead of {terrain}");
            }
            if seen.len() == 4 {
                return;
            }
        }
    }
    panic!("{} buildings", seen.len());
}

fn number_of(path: &Path, key: &str) -> f64 {
    number(&tags(path), key)
}

/// Viewers read a large map by its tiles and overviews.
#[test]
fn large_maps_are_tiled_and_have_overviews() {
    let folder = tempfile::tempdir().unwrap();
    let path = map(&folder, &town("dsm.tif"), &["--size", "1200", "--resolution", "4"]);
    let bytes = std::fs::read(&path).unwrap();
    let number = |at: usize, size: usize| bytes[at..at + size].iter().rev().fold(0, |n, b| 256 * n + usize::from(*b));
    assert_eq!(&bytes[..4], b"II*\0", "a little-endian TIFF");
    // Each image is a list of entries of 12 bytes, and the place of the next one.
    let (mut at, mut widths) = (number(4, 4), Vec::new());
    while at != 0 {
        let entries = number(at, 2);
        let value = |tag: usize| {
            let of_tag = (0..entries).map(|i| at + 2 + 12 * i).find(|&entry| number(entry, 2) == tag)?;
            Some(number(of_tag + 8, if number(of_tag + 2, 2) == 3 { 2 } else { 4 }))
        };
        let (width, tile) = (value(256).unwrap(), value(322).expect("a tile width"));
        assert!(tile.is_power_of_two() && tile <= 512, "{tile}");
        widths.push(width);
        at = number(at + 2 + 12 * entries, 4);
    }
    assert!(widths.contains(&1200) && widths.contains(&600), "{widths:?}");
}

#[test]
fn a_normalised_map_times_its_scale_is_the_metric_map() {
    let folder = tempfile::tempdir().unwrap();
    let metric = map(&folder, &town("dsm.tif"), &["--heading", "37"]);
    let heights = values(&metric, 1);
    for asked in ["auto", "97.5"] {
        let path = map(&folder, &town("dsm.tif"), &["--heading", "37", "--normalize", asked]);
        let (tags, scaled) = (tags(&path), values(&path, 1));
        let s = number(&tags, "SCENE_SCALE_M");
        for (&height, &scaled) in heights.data().iter().zip(scaled.data()) {
            assert!(agree(f64::from(scaled) * s, f64::from(height), 1e-5), "{height} {scaled}");
        }
        assert!((number(&tags, "RESOLUTION_PX_PER_SCENE_UNIT") - 2.0 * s).abs() < 1e-9);
        assert_eq!(tags["NORMALIZED"], "yes");
        // Readers that follow GDAL's scale and offset see heights above the ellipsoid in either
        // map.
        let (a, b) = (read_dem(&path).unwrap(), read_dem(&metric).unwrap());
        assert!(a.heights.data().iter().zip(b.heights.data()).all(|(a, b)| agree((*a).into(), (*b).into(), 1e-4)));
        if asked == "auto" {
            let mean = mean_length(&heights, 2.0);
            assert!((s - mean).abs() < 1e-6 * mean, "{s} {mean}");
        }
    }
}

fn mean_length(heights: &Grid<f32>, resolution: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for row in 0..heights.height() {
        for column in 0..heights.width() {
            let [u, v] = [column, row].map(|i| (i as f64 - 258.5) / resolution);
            let h = f64::from(heights[(column, row)]);
            if h.is_finite() {
                sum += (u * u + v * v + h * h).sqrt();
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn unprojected_points_lie_on_the_surface() {
    let folder = tempfile::tempdir().unwrap();
    let path = map(&folder, &town("dsm.tif"), &["--heading", "37", "--normalize", "auto"]);
    let cloud = folder.path().join("points.las");
    skysweep().args(["heightmap", "unproject"]).arg(&path).arg("-o").arg(&cloud).assert().code(0);
    let heights = values(&path, 1);
    let known = heights.data().iter().filter(|h| h.is_finite()).count();
    let dsm = read_dem(town("dsm.tif")).unwrap();
    let mut points = 0;
    formats::points::PointCloud::open(&cloud)
        .unwrap()
        .visit(|p| {
            let (c, r) = dsm.geotransform.cell_from_map(p.x, p.y).unwrap();
            let height = f64::from(raster::bilinear(&dsm.heights, c, r));
            // Coordinates are kept to a millimetre; on a façade of 20 m that is 4 cm of height.
            assert!(height.is_nan() || (height - p.height_m).abs() < 0.05, "{p:?}: {height}");
            points += 1;
        })
        .unwrap();
    assert_eq!(points, known);
    let ply = folder.path().join("points.ply");
    skysweep().args(["heightmap", "unproject"]).arg(&path).arg("-o").arg(&ply).assert().code(0);
    let bytes = std::fs::read(&ply).unwrap();
    let header = b"end_header\n";
    let body = bytes.windows(header.len()).position(|w| w == header).unwrap() + header.len();
    assert_eq!(bytes.len() - body, 27 * known);
    assert!(String::from_utf8_lossy(&bytes[..body]).contains(&format!("element vertex {known}")));
}

#[test]
fn unprojected_splats_lie_on_the_surface_in_the_pictures_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = map(&folder, &town("dsm.tif"), &["--heading", "37", "--normalize", "auto", "--confidence"]);
    let picture = folder.path().join("tile.png");
    let size = values(&path, 1).width();
    let pixels = Grid::from_vec(size, size, (0..size * size).map(|i| [(i % 251) as u8, 80, 0]).collect()).unwrap();
    formats::raster::write_png_rgb(&picture, &pixels, false).unwrap();
    let unproject = |name: &str, options: &[&str]| {
        let ply = folder.path().join(name);
        let mut command = skysweep();
        command.args(["heightmap", "unproject", "--splats", "--picture"]).arg(&picture).arg(&path).arg("-o").arg(&ply);
        command.args(options).assert().code(0);
        let origin: LocalOrigin =
            serde_json::from_slice(&std::fs::read(ply.with_extension("origin.json")).unwrap()).unwrap();
        (formats::splat_ply::read(&ply).unwrap().splats, origin)
    };
    let (splats, origin) = unproject("splats.ply", &[]);
    let heights = values(&path, 1);
    assert_eq!(splats.len(), heights.data().iter().filter(|h| h.is_finite()).count());
    let (from, to) = (MapProjection::from_definition(&origin.crs).unwrap(), MapProjection::from_epsg(32631).unwrap());
    let dsm = read_dem(town("dsm.tif")).unwrap();
    for splat in splats.iter().step_by(7) {
        let [x, y, z] = [0, 1, 2].map(|i| f64::from(splat.position[i]) + origin.origin[i]);
        let (lon, lat) = from.lonlat_from_map(x, y).unwrap();
        let at = to.map_from_lonlat(lon, lat).unwrap();
        let (c, r) = dsm.geotransform.cell_from_map(at.x, at.y).unwrap();
        let height = f64::from(raster::bilinear(&dsm.heights, c, r));
        assert!(height.is_nan() || (height - z).abs() < 0.02, "{height} {z}");
        // The source has every height: confidence 1. A pixel of half a metre: a quarter of a metre
        // of standard deviation.
        assert!((splat.opacity - 0.99).abs() < 1e-4 && splat.scale_m[0] >= 0.2499);
        assert!((splat.colour[1] - 80.0 / 255.0).abs() < 1e-5 && splat.colour[2].abs() < 1e-5);
    }
    assert!(splats.iter().any(|s| s.colour[0] > 0.9) && splats.iter().any(|s| s.colour[0] < 0.1));
    // Colours that change with every pixel keep theirs apart; grey ones go together.
    formats::raster::write_png_rgb(&picture, &Grid::filled(size, size, [128; 3]), true).unwrap();
    let (merged, _) = unproject("merged.ply", &["--merge", "0.25"]);
    assert!(merged.len() * 4 < splats.len(), "{} of {}", merged.len(), splats.len());
    let mut command = skysweep();
    command.args(["heightmap", "unproject", "--splats", "--frame", "camera"]).arg(&path).arg("-o");
    command.arg(folder.path().join("c.ply")).assert().code(2).stderr(predicate::str::contains("mirrored"));
    let mut command = skysweep();
    command.args(["heightmap", "unproject", "--splats"]).arg(&path).arg("-o").arg(folder.path().join("c.las"));
    command.assert().code(2).stderr(predicate::str::contains(".ply"));
}

#[test]
fn heights_above_a_geoid_are_brought_to_the_ellipsoid() {
    let folder = tempfile::tempdir().unwrap();
    let dsm = read_dem(town("dsm.tif")).unwrap();
    let above_geoid = folder.path().join("geoid.tif");
    let crs = Crs { horizontal: 32631, vertical: VerticalDatum::Egm96 };
    let bands = [Band { description: "height_m", data: BandData::F32(&dsm.heights) }];
    write_cog(&above_geoid, &CogRaster::new(&bands, dsm.geotransform, crs), false).unwrap();
    let converter = crs::HeightConverter::new(VerticalDatum::Egm96).unwrap();
    let undulation = converter.ellipsoid_from_datum(5.4, 43.53, 0.0).unwrap();
    let camera = |path: &Path| number(&tags(path), "CAMERA_HEIGHT_M");
    let plain = camera(&map(&folder, &town("dsm.tif"), &["--size", "64"]));
    let lifted = camera(&map(&folder, &above_geoid, &["--size", "64", "--resolution", "2.0"]));
    assert!((lifted - plain - undulation).abs() < 1e-3, "{lifted} {plain} {undulation}");
}

fn rows(folder: &Path) -> PathBuf {
    let list = folder.join("cameras.csv");
    let rows = "id,lon,lat,heading\na,5.4,43.53,37\nnorth,5.4002,43.5304,\nfar,6.5,43.5,0\nbad,east,43.53,0\n";
    std::fs::write(&list, rows).unwrap();
    list
}

#[test]
fn a_list_is_made_whole_with_its_bad_rows_named_and_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (list, out) = (rows(folder.path()), folder.path().join("maps"));
    let run = |options: &[&str]| {
        let mut command = skysweep();
        command.arg("heightmap").arg(town("dsm.tif")).arg("--positions").arg(&list).arg("-o").arg(&out);
        command.args(["--size", "100", "--progress", "none"]).args(options).assert()
    };
    let report = || -> Value { serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap() };
    run(&[]).code(1).stderr(predicate::str::contains("far").and(predicate::str::contains("east")));
    let first = report();
    assert_eq!((first["made"].as_u64(), first["failed"].as_u64()), (Some(2), Some(2)));
    assert_eq!(
        (&first["maps"][0]["status"], &first["maps"][2]["status"]),
        (&Value::from("made"), &Value::from("failed"))
    );
    // One of a list is the one alone.
    let alone = map(&folder, &town("dsm.tif"), &["--heading", "37", "--size", "100"]);
    assert!(same(&out.join("a.tif"), &alone));
    // What is there is kept, what is not is made, to the same bytes.
    let bytes = |id: &str| std::fs::read(out.join(id)).unwrap();
    let (a, north) = (bytes("a.tif"), bytes("north.tif"));
    std::fs::remove_file(out.join("a.tif")).unwrap();
    // Quiet is not silent about what failed.
    run(&["--threads", "1", "-q"]).code(1).stderr(predicate::str::contains("error: 2 height maps could not be made"));
    assert_eq!((report()["made"].as_u64(), report()["kept"].as_u64()), (Some(1), Some(1)));
    assert!(bytes("a.tif") == a && bytes("north.tif") == north);
    // Other options ask for other maps.
    run(&["--normalize", "auto"]).code(2).stderr(predicate::str::contains("--overwrite"));
    run(&["--normalize", "auto", "--overwrite"]).code(1);
    assert_ne!(bytes("a.tif"), a);
}

#[test]
fn lists_over_a_cloud_are_those_of_single_maps() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.laz");
    let points: Vec<[f64; 3]> = reference("point").iter().map(|p| [p[0], p[1], p[2]]).collect();
    formats::points::write_las(&cloud, &points, Crs::ellipsoidal(32631), false).unwrap();
    let (list, out) = (folder.path().join("cameras.csv"), folder.path().join("maps"));
    std::fs::write(&list, "lon,lat,heading\n5.4,43.53,-23\n5.40001,43.53001,10\n").unwrap();
    let mut command = skysweep();
    command.arg("heightmap").arg(&cloud).arg("--positions").arg(&list).arg("-o").arg(&out).args(["--size", "24"]);
    command.assert().code(0);
    let alone = map(&folder, &cloud, &["--heading", "-23", "--size", "24"]);
    assert!(same(&out.join("row_1.tif"), &alone) && !same(&out.join("row_2.tif"), &alone));
}

#[test]
fn what_cannot_be_a_map_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("map.tif");
    let dsm = town("dsm.tif");
    for (options, words) in [
        (vec![], "--center"),
        (vec!["--center", "5.4", "95"], "(5.4, 95)"),
        (vec!["--center", "5.4032", "43.53"], "--dtm or --camera-height"),
        (vec!["--center", "5.5", "43.53", "--camera-height", "200"], "lies outside the source: it covers x"),
        (vec!["--center", "43.53", "5.4"], "with latitude and longitude exchanged it would lie inside"),
        (vec!["--center", "5.4", "43.53", "--size", "0"], "0 x 0"),
        (vec!["--center", "5.4", "43.53", "--resolution", "nan"], "NaN"),
        (vec!["--center", "5.4", "43.53", "--heading", "inf"], "heading"),
        (vec!["--center", "5.4", "43.53", "--normalize", "0"], "--normalize"),
        (vec!["--center", "5.4", "43.53", "--crs", "EPSG:4326"], "metres"),
        (vec!["--center", "5.4", "43.53", "--crs", "EPSG:1"], "EPSG:1"),
        (vec!["--camera", "/nonexistent.json"], "camera file"),
    ] {
        let mut command = skysweep();
        command.arg("heightmap").arg(&dsm).args(&options).arg("-o").arg(&out);
        command.assert().code(2).stderr(predicate::str::contains(words));
        assert!(!out.exists(), "{options:?}");
    }
    std::fs::write(&out, "mine").unwrap();
    let mut command = skysweep();
    command.arg("heightmap").arg(&dsm).args(CENTRE).arg("-o").arg(&out);
    command.assert().code(2).stderr(predicate::str::contains("--overwrite"));
    assert_eq!(std::fs::read(&out).unwrap(), b"mine");
    let mut command = skysweep();
    command.args(["heightmap", "unproject"]).arg(&dsm).arg("-o").arg(folder.path().join("p.ply"));
    command.assert().code(2).stderr(predicate::str::contains("no height map"));
}
