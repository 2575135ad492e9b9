//! Masks of the ground and of images, areas by their polygons, and bands: what is excluded has no
//! influence, and what is not excluded is as it would be without.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crs::{Crs, MapProjection};
use dsm::{DsmConfig, DsmError, DsmReport, LayerArea, MapBounds, Preset, run};
use formats::raster::{Band, BandChoice, BandData, CogRaster, ImageSource, write_cog, write_image_with_rpc};
use numeric::Silent;
use raster::{GeoTransform, Grid};

/// Code of masked cells in `dsm/source.tif`.
const MASKED: f32 = 13.0;
/// System of the surface models.
const EPSG: u32 = 32631;

fn town(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town")).join(name)
}

/// The town on coarse cells, which takes a second.
fn config(images: &[PathBuf], output: PathBuf) -> DsmConfig {
    let mut config = DsmConfig::new(images.to_vec(), output);
    (config.preset, config.gsd_m, config.crs_epsg) = (Preset::Fast, Some(2.0), Some(EPSG));
    config
}

fn originals() -> Vec<PathBuf> {
    ["view_1.tif", "view_2.tif", "view_3.tif"].map(town).into()
}

fn samples(path: &Path) -> Grid<f32> {
    let source = ImageSource::open(path).unwrap();
    source.read_samples(1, source.window()).unwrap()
}

fn layer(config: &DsmConfig, name: &str) -> Grid<f32> {
    samples(&config.output.join("dsm").join(name))
}

fn made(config: &DsmConfig) -> DsmReport {
    run(config, &Silent).unwrap()
}

/// The rectangle of the surface model, whose cells are 2 m.
fn extent(config: &DsmConfig) -> (MapBounds, GeoTransform, (usize, usize)) {
    let source = ImageSource::open(config.output.join("dsm/dsm.tif")).unwrap();
    let info = source.info();
    let place = info.geotransform.unwrap();
    let (x_min, y_max) = place.map_from_cell(-0.5, -0.5);
    let (x_max, y_min) = place.map_from_cell(info.width as f64 - 0.5, info.height as f64 - 0.5);
    (MapBounds::from([x_min, y_min, x_max, y_max]), place, (info.width, info.height))
}

/// Writes polygons on a map as GeoJSON in longitude and latitude.
fn write_polygons(path: &Path, polygons: &[(&str, Vec<(f64, f64)>)]) {
    let map = MapProjection::from_epsg(EPSG).unwrap();
    let mut text = "{\"type\": \"FeatureCollection\", \"features\": [".to_owned();
    for (i, (name, corners)) in polygons.iter().enumerate() {
        let closed = corners.iter().chain(corners.first()).map(|(x, y)| {
            let (lon, lat) = map.lonlat_from_map(*x, *y).unwrap();
            format!("[{lon:.12}, {lat:.12}]")
        });
        let ring: Vec<String> = closed.collect();
        write!(
            text,
            "{}{{\"type\": \"Feature\", \"properties\": {{\"name\": \"{name}\"}}, \
             \"geometry\": {{\"type\": \"Polygon\", \"coordinates\": [[{}]]}}}}",
            if i > 0 { "," } else { "" },
            ring.join(", ")
        )
        .unwrap();
    }
    std::fs::write(path, text + "]}").unwrap();
}

/// A cell of the grid with its row, column and value.
fn cells(grid: &Grid<f32>) -> impl Iterator<Item = (usize, usize, f32)> {
    grid.data().iter().enumerate().map(|(i, v)| (i % grid.width(), i / grid.width(), *v))
}

/// Values that are equal, or both without data.
fn same(a: f32, b: f32) -> bool {
    a == b || a.is_nan() && b.is_nan()
}

#[test]
fn an_area_is_cut_out_of_the_same_surface() {
    let folder = tempfile::tempdir().unwrap();
    let mut whole = config(&originals(), folder.path().join("whole"));
    made(&whole);
    let (bounds, place, size) = extent(&whole);
    whole.bounds = Some(bounds);
    whole.overwrite = true;
    made(&whole);
    // A triangle, and another polygon that is not asked for.
    let [x_min, y_min, x_max, y_max] = bounds.to_array();
    let triangle = vec![(x_min + 20.37, y_min + 31.0), (x_max - 41.0, y_min + 70.61), (x_min + 90.19, y_max - 33.0)];
    let other = vec![(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)];
    let file = folder.path().join("areas.geojson");
    write_polygons(&file, &[("north", triangle.clone()), ("all", other)]);
    let mut cut = config(&originals(), folder.path().join("cut"));
    cut.bounds = whole.bounds;
    let mut area = LayerArea::new(file.clone());
    area.name = Some("north".to_owned());
    cut.area = Some(area.clone());
    let report = made(&cut);
    let is_inside = |column: usize, row: usize| {
        let (x, y) = place.map_from_cell(column as f64, row as f64);
        let left = |a: (f64, f64), b: (f64, f64)| (b.0 - a.0) * (y - a.1) - (b.1 - a.1) * (x - a.0) > 0.0;
        (0..3).all(|i| left(triangle[i], triangle[(i + 1) % 3]))
    };
    let (source, mut inside) = (layer(&cut, "source.tif"), 0);
    assert_eq!((source.width(), source.height()), size);
    for name in ["dsm.tif", "sigma.tif", "confidence.tif", "views.tif"] {
        let reference = layer(&whole, name);
        for (column, row, value) in cells(&layer(&cut, name)) {
            if is_inside(column, row) {
                inside += 1;
                assert!(
                    same(value, reference[(column, row)]),
                    "{name} {column} {row} {value} {}",
                    reference[(column, row)]
                );
            } else {
                assert!(
                    value.is_nan() && source[(column, row)] == MASKED,
                    "{name} {column} {row} {value} {} {bounds:?} {triangle:?}",
                    source[(column, row)]
                );
            }
        }
    }
    assert_eq!(report.surface.counts.masked, size.0 * size.1 - inside / 4);
    assert!(report.text(&cut.output).contains("% masked)"));

    // Without bounds, the grid is the rectangle around the polygon. Chunks beside it are not swept.
    let mut alone = config(&originals(), folder.path().join("alone"));
    (alone.area, alone.chunk) = (Some(area), Some(64));
    let report = made(&alone);
    assert!(
        report.surface.cells < size.0 * size.1 && report.surface.counts.observed > inside / 8,
        "{:?}",
        report.surface
    );
    let mut missing = LayerArea::new(file);
    missing.name = Some("south".to_owned());
    alone.area = Some(missing);
    alone.overwrite = true;
    let told = run(&alone, &Silent).unwrap_err().to_string();
    assert!(told.contains("no feature has the name \"south\"; there are north, all"), "{told}");
}

#[test]
fn masked_ground_is_void_and_fills_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut plain = config(&originals(), folder.path().join("plain"));
    made(&plain);
    let (bounds, place, size) = extent(&plain);
    let [x_min, y_min, ..] = bounds.to_array();
    let lake = vec![(x_min + 60.0, y_min + 60.0), (x_min + 120.0, y_min + 60.0), (x_min + 120.0, y_min + 140.0)];
    let polygons = folder.path().join("water.geojson");
    write_polygons(&polygons, &[("lake", lake)]);
    // A raster in another system, 0.2 times as fine.
    let raster = folder.path().join("no_go.tif");
    let mut zones = Grid::filled(40, 30, 0u8);
    (10..20).for_each(|row| zones.row_mut(row)[5..25].fill(7));
    let map = MapProjection::from_epsg(EPSG).unwrap();
    let corner = map.lonlat_from_map(x_min + 100.0, y_min + 260.0).unwrap();
    let lonlat = GeoTransform([corner.0, 1.2e-4, 0.0, corner.1, 0.0, -9e-5]);
    let bands = [Band { description: "zone", data: BandData::U8(&zones) }];
    write_cog(&raster, &CogRaster::new(&bands, lonlat, Crs::ellipsoidal(4326)), true).unwrap();

    plain.masks = vec![polygons, raster.clone()];
    plain.output = folder.path().join("masked");
    plain.fill = dsm::Fill::All;
    let report = made(&plain);
    let (source, heights) = (layer(&plain, "source.tif"), layer(&plain, "dsm.tif"));
    let zone_of = |column: usize, row: usize| {
        let (x, y) = place.map_from_cell(column as f64, row as f64);
        let (lon, lat) = map.lonlat_from_map(x, y).unwrap();
        let (column, row) = lonlat.cell_from_map(lon, lat).unwrap();
        // Not within a thousandth of a border.
        let is_sure = [column, row].iter().all(|v| ((v + 0.5).fract() - 0.5).abs() < 0.499);
        let at = (column.round() as usize, row.round() as usize);
        is_sure.then(|| zones.get(at.0, at.1).is_some_and(|zone| *zone != 0))
    };
    let (mut in_zone, mut in_lake) = (0, 0);
    for (column, row, code) in cells(&source) {
        let (x, y) = place.map_from_cell(column as f64, row as f64);
        let is_lake =
            (60.0..120.0).contains(&(x - x_min)) && y - y_min > 60.0 && 3.0 * (y - y_min) < 4.0 * (x - x_min) - 60.0;
        let Some(is_zone) = zone_of(column, row) else { continue };
        assert_eq!(code == MASKED, is_lake || is_zone, "{column} {row}");
        assert!(code != MASKED || heights[(column, row)].is_nan());
        (in_zone, in_lake) = (in_zone + usize::from(is_zone), in_lake + usize::from(is_lake));
    }
    assert!(in_zone > 100 && in_lake > 100, "{in_zone} {in_lake}");
    assert!(report.surface.counts.masked <= size.0 * size.1 && report.surface.counts.masked >= in_zone.max(in_lake));

    // A raster without a system, and a file that is none.
    for (path, words) in [(town("view_1.tif"), "image masks"), (folder.path().join("absent.geojson"), "No such file")] {
        plain.masks = vec![path];
        plain.overwrite = true;
        let told = run(&plain, &Silent).unwrap_err();
        assert!(told.to_string().contains(words), "{told}");
    }
}

/// Writes copies of the images with a bright block in the first one, and returns them.
fn painted(folder: &Path, grey: Option<u16>) -> Vec<PathBuf> {
    std::fs::create_dir_all(folder).unwrap();
    let copy = |(i, original): (usize, PathBuf)| {
        let mut pixels = samples(&original).map(|v| *v as u16);
        if let Some(grey) = grey.filter(|_| i == 0) {
            (102..295).for_each(|row| pixels.row_mut(row)[202..412].fill(grey));
        }
        let path = folder.join(original.file_name().unwrap());
        let rpc = formats::rpc::read_for_image(&original).unwrap().rpc;
        let bands = [Band { description: "pan", data: BandData::U16(&pixels) }];
        write_image_with_rpc(&path, &bands, &rpc, None, true).unwrap();
        path
    };
    originals().into_iter().enumerate().map(copy).collect()
}

/// Whatever a cloud hides, and however bright it is, a masked cloud is not there.
#[test]
fn masked_pixels_have_no_influence() {
    let folder = tempfile::tempdir().unwrap();
    let clear = painted(&folder.path().join("clear"), None);
    let cloudy = painted(&folder.path().join("cloudy"), Some(3000));
    let size = samples(&clear[0]);
    // The mask is coarser than the image by a factor of five.
    let mut mask = Grid::filled(size.width().div_ceil(5), size.height().div_ceil(5), 0u8);
    (20..60).for_each(|row| mask.row_mut(row)[40..84].fill(255));
    let file = folder.path().join("view_1_clouds.tif");
    let band = Band { description: "cloud", data: BandData::U8(&mask) };
    formats::raster::write_map(&file, &[band], None, &[], true).unwrap();
    let mut runs = [&clear, &cloudy].map(|images| {
        let mut config =
            config(images, folder.path().join(format!("out_{}", images[0].parent().unwrap().ends_with("clear"))));
        config.image_masks = vec![file.clone()];
        let report = made(&config);
        let told = report.choices.iter().find(|choice| choice.name == "masked pixels").unwrap();
        assert!(told.value.contains("view_1.tif") && told.value.ends_with(" %"), "{}", told.value);
        config
    });
    for name in ["dsm.tif", "sigma.tif", "views.tif", "source.tif"] {
        let [a, b] = [&runs[0], &runs[1]].map(|config| layer(config, name));
        assert!(a.data().iter().zip(b.data()).all(|(a, b)| same(*a, *b)), "{name}");
    }
    let unmasked = config(&cloudy, folder.path().join("unmasked"));
    made(&unmasked);
    let [with, without] = [&runs[1], &unmasked].map(|config| layer(config, "views.tif"));
    assert_ne!(with.data(), without.data());

    // A mask of another shape, and one that covers all.
    let config = &mut runs[0];
    config.overwrite = true;
    let wrong = Grid::filled(50, 90, 0u8);
    let write = |grid: &Grid<u8>| {
        let band = Band { description: "cloud", data: BandData::U8(grid) };
        formats::raster::write_map(&file, &[band], None, &[], true).unwrap();
    };
    write(&wrong);
    let told = run(config, &Silent).unwrap_err();
    assert!(matches!(told, DsmError::Value { .. }) && told.to_string().contains("50 × 90 pixels"), "{told}");
    write(&Grid::filled(mask.width(), mask.height(), 1));
    let report = made(config);
    assert!(
        report.warnings.iter().any(|w| w.contains("hardly a pixel") && w.contains("view_1.tif")),
        "{:?}",
        report.warnings
    );
}

/// Polygons on the ground mask the pixels that show them.
#[test]
fn clouds_may_be_polygons_on_the_ground() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config(&originals(), folder.path().join("out"));
    made(&config);
    let (bounds, place, _) = extent(&config);
    let before = layer(&config, "views.tif");
    let [x_min, y_min, x_max, y_max] = bounds.to_array();
    let middle = 0.5 * (x_min + x_max);
    let file = folder.path().join("view_3-clouds.geojson");
    // It reaches far beyond what the camera model is for.
    let (south, north, west) = (y_min - 3e3, y_max + 3e3, x_min - 1e6);
    let west = vec![(west, south), (middle, south), (middle, north), (west, north)];
    write_polygons(&file, &[("cloud", west)]);
    config.image_masks = vec![file];
    config.output = folder.path().join("masked");
    made(&config);
    let (mut of_three, mut fewer) = ([0u32; 2], [0u32; 2]);
    for (column, row, views) in cells(&layer(&config, "views.tif")) {
        let (x, _) = place.map_from_cell(column as f64, row as f64);
        // Roofs are seen beside their place.
        let side = usize::from(x > middle);
        if before[(column, row)] == 3.0 && (x - middle).abs() > 20.0 {
            of_three[side] += 1;
            fewer[side] += u32::from(views < 3.0 || views.is_nan());
        }
    }
    let share = |side: usize| f64::from(fewer[side]) / f64::from(of_three[side]);
    assert!(share(0) > 0.99 && share(1) < 0.1, "{} {}", share(0), share(1));
}

#[test]
fn a_band_is_matched_by_number_or_name() {
    let folder = tempfile::tempdir().unwrap();
    let single = painted(&folder.path().join("single"), None);
    let several: Vec<PathBuf> = single
        .iter()
        .map(|path| {
            let pixels = samples(path).map(|v| *v as u16);
            let noise = pixels.map(|v| v.wrapping_mul(40_503) >> 4);
            let out = folder.path().join(path.file_name().unwrap());
            let bands = ["coastal", "pan", "nir"].into_iter().zip([&noise, &pixels, &noise]);
            let bands: Vec<Band<'_>> =
                bands.map(|(description, grid)| Band { description, data: BandData::U16(grid) }).collect();
            write_image_with_rpc(&out, &bands, &formats::rpc::read_for_image(path).unwrap().rpc, None, true).unwrap();
            out
        })
        .collect();
    let plain = config(&single, folder.path().join("plain"));
    made(&plain);
    for (i, band) in [BandChoice::Number(2), BandChoice::Name("PAN".to_owned())].into_iter().enumerate() {
        let mut chosen = config(&several, folder.path().join(i.to_string()));
        chosen.band = Some(band);
        made(&chosen);
        for name in ["dsm.tif", "sigma.tif", "source.tif"] {
            let (a, b) = (layer(&plain, name), layer(&chosen, name));
            assert!(a.data().iter().zip(b.data()).all(|(a, b)| same(*a, *b)), "{name}");
        }
    }
    let mut wrong = config(&several, folder.path().join("wrong"));
    wrong.band = Some(BandChoice::Name("red".to_owned()));
    let told = dsm::open(&wrong).unwrap_err();
    let cause = std::error::Error::source(&told).unwrap().to_string();
    assert!(cause.contains("no band \"red\"") && cause.contains("2 pan"), "{cause}");
}

#[test]
fn masks_without_an_image_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config(&originals(), folder.path().join("out"));
    config.image_masks = vec![folder.path().join("clouds.tif")];
    let told = run(&config, &Silent).unwrap_err().to_string();
    assert!(told.contains("a mask of no images") && told.contains("view_1_clouds.tif for view_1.tif"), "{told}");
    assert!(!config.output.exists());
}
