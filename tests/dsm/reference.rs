//! Co-registration to a reference elevation model: the surface follows the reference to a
//! decimetre, and weak evidence is refused.

use std::path::{Path, PathBuf};

use crate::common::{sample, small_town};
use crs::{Crs, HeightConverter, MapProjection, VerticalDatum};
use eval::{AlignmentMethod, CellMap, EvalConfig, EvalInput, MetresFromCells, evaluate};
use formats::raster::{Band, BandData, CogRaster, Dem, read_dem, write_cog};
use jobs::dsm::{DsmConfig, DsmError, DsmReport, Preset, run};
use numeric::Silent;
use raster::{GeoTransform, Grid};

const SHIFT: [f64; 3] = [3.3, -2.7, 4.1];

/// Writes heights on the grid of the town's truth, moved by `shift`.
fn write(path: &Path, truth: &Dem, heights: &Grid<f32>, shift: [f64; 3]) {
    let mut c = truth.geotransform.0;
    (c[0], c[3]) = (c[0] + shift[0], c[3] + shift[1]);
    let heights = heights.map(|height| height + shift[2] as f32);
    let bands = [Band { data: BandData::F32(&heights), description: "height_m" }];
    let crs = Crs::ellipsoidal(truth.horizontal_epsg.unwrap());
    write_cog(path, &CogRaster::new(&bands, GeoTransform(c), crs), false).unwrap();
}

fn config(town: fn(&str) -> PathBuf, output: PathBuf, reference: PathBuf) -> DsmConfig {
    let images = ["view_1.tif", "view_2.tif", "view_3.tif"].map(town);
    let mut config = DsmConfig::new(images.into(), output);
    config.reference_dem = Some(reference);
    config.dem_vertical = Some(VerticalDatum::Ellipsoid);
    config
}

/// Returns the shift that would bring the surface of a run onto a reference.
fn left(folder: &Path, reference: &Path) -> [f64; 3] {
    left_between(&folder.join("dsm/dsm.tif"), reference)
}

fn left_between(surface: &Path, reference: &Path) -> [f64; 3] {
    let (dsm, reference) = (read_dem(surface).unwrap(), read_dem(reference).unwrap());
    let cells = CellMap::affine(&reference.geotransform, &dsm.geotransform).unwrap();
    let metres = MetresFromCells::new(&reference.geotransform, (1.0, 1.0));
    let asked = EvalConfig { alignment: AlignmentMethod::Xyz, ..EvalConfig::default() };
    let found = evaluate(&EvalInput::new(&dsm.heights, &reference.heights, &cells, metres), &asked).unwrap();
    [found.shift.dx_m, found.shift.dy_m, found.shift.dz_m]
}

#[test]
fn the_surface_follows_the_reference_to_a_decimetre() {
    let folder = tempfile::tempdir().unwrap();
    let truth = read_dem(sample("truth/dsm.tif")).unwrap();
    let [here, moved] = [[0.0; 3], SHIFT].map(|shift| {
        let name = if shift == [0.0; 3] { "here" } else { "moved" };
        let (reference, output) = (folder.path().join(format!("{name}.tif")), folder.path().join(name));
        write(&reference, &truth, &truth.heights, shift);
        let report: DsmReport = run(&config(sample, output.clone(), reference.clone()), &Silent).unwrap();
        let found = report.pointing.reference.clone().unwrap();
        (found, left(&output, &reference))
    });
    assert!(moved.1.iter().all(|left_m| left_m.abs() < 0.1), "{moved:?}");
    for ((moved_m, here_m), shift_m) in moved.0.shift_m.iter().zip(here.0.shift_m).zip(SHIFT) {
        assert!((moved_m - here_m - shift_m).abs() < 0.1, "{moved_m} - {here_m}, expected {shift_m}");
    }
}

#[test]
fn weak_evidence_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let truth = read_dem(small_town("truth/dsm.tif")).unwrap();
    let refused = |name: &str, heights: &Grid<f32>, shift: [f64; 3], words: &str| {
        let reference = folder.path().join(format!("{name}.tif"));
        write(&reference, &truth, heights, shift);
        let mut config = config(small_town, folder.path().join(name), reference);
        config.preset = Preset::Fast;
        let error = run(&config, &Silent).unwrap_err();
        assert!(error.to_string().contains(words), "{name}: {error}");
        assert!(!folder.path().join(name).join("dsm").exists());
        error
    };
    let flat = truth.heights.map(|_| 210.0);
    assert!(matches!(refused("flat", &flat, [0.0; 3], "flat"), DsmError::Reference { .. }));
    assert!(matches!(refused("beside", &truth.heights, [5e4, 0.0, 0.0], "under the scene"), DsmError::Value { .. }));
    refused("datum", &truth.heights, [0.0, 0.0, 40.0], "check what its heights are above");
    refused("corner", &truth.heights, [190.0, 190.0, 0.0], "cells");
}

/// A datum that is given overrules the one that the file names, with a warning. Heights above a
/// geoid are brought to the ellipsoid. A reference that is tilted tilts the surface, where asked
/// to.
#[test]
fn datums_and_planes_are_followed() {
    let folder = tempfile::tempdir().unwrap();
    let truth = read_dem(sample("truth/dsm.tif")).unwrap();
    let geoid = HeightConverter::new(VerticalDatum::Egm96).unwrap();
    let projection = MapProjection::from_epsg(truth.horizontal_epsg.unwrap()).unwrap();
    let c = truth.geotransform;
    let (x, y) = c.map_from_cell(0.5 * truth.heights.width() as f64, 0.5 * truth.heights.height() as f64);
    let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
    let undulation_m = geoid.ellipsoid_from_datum(lon, lat, 0.0).unwrap();
    assert!(undulation_m.abs() > 10.0, "{undulation_m}");
    // 5 m per kilometre to the east and −3 m to the north.
    let mut tilted = truth.heights.clone();
    for row in 0..tilted.height() {
        for column in 0..tilted.width() {
            let (east, north) = c.map_from_cell(column as f64, row as f64);
            tilted[(column, row)] += (5e-3 * (east - x) - 3e-3 * (north - y)) as f32;
        }
    }
    let (surface, reference) = (folder.path().join("surface.tif"), folder.path().join("tilted.tif"));
    write(&surface, &truth, &truth.heights, [0.0; 3]);
    write(&reference, &truth, &tilted, [0.0, 0.0, -undulation_m]);
    let mut above_geoid = config(sample, folder.path().join("out"), reference);
    (above_geoid.dem_vertical, above_geoid.reference_plane) = (Some(VerticalDatum::Egm96), true);
    let report: DsmReport = run(&above_geoid, &Silent).unwrap();
    let contradiction = "taken as above egm96, as given, but the file names ellipsoid";
    let told = report.warnings.iter().filter(|warning| warning.contains(contradiction));
    assert_eq!(told.count(), 1, "{:?}", report.warnings);
    let found = report.pointing.reference.unwrap();
    let [east, north] = found.plane_m_per_km.unwrap();
    assert!((east - 5.0).abs() < 0.5 && (north + 3.0).abs() < 0.5, "{east} {north}");
    // Without the undulation and the tilt, the surface lies on the town's truth.
    let dsm = read_dem(folder.path().join("out/dsm/dsm.tif")).unwrap();
    let flat = folder.path().join("flat.tif");
    let mut heights = dsm.heights.clone();
    for row in 0..heights.height() {
        for column in 0..heights.width() {
            let (e, n) = dsm.geotransform.map_from_cell(column as f64, row as f64);
            heights[(column, row)] -= (5e-3 * (e - x) - 3e-3 * (n - y)) as f32;
        }
    }
    write(&flat, &dsm, &heights, [0.0; 3]);
    let left = left_between(&flat, &surface);
    assert!(left.iter().all(|left_m| left_m.abs() < 0.15), "{left:?}");
}

/// A model of the bare ground is named; a surface model is not.
#[test]
fn a_model_of_the_bare_ground_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (name, is_named) in [("truth/dtm.tif", true), ("truth/dsm.tif", false)] {
        let mut config = config(sample, folder.path().join(if is_named { "dtm" } else { "dsm" }), sample(name));
        (config.dem_vertical, config.preset) = (None, Preset::Fast);
        let report: DsmReport = run(&config, &Silent).unwrap();
        let named = report.warnings.iter().any(|warning| warning.contains("looks like a model of the bare ground"));
        assert_eq!(named, is_named, "{name}: {:?}", report.warnings);
    }
}
