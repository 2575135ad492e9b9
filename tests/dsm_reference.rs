//! Co-registration to a reference elevation model: the surface follows the reference to a
//! decimetre, and weak evidence is refused.

mod common;

use std::path::{Path, PathBuf};

use common::sample;
use crs::{Crs, VerticalDatum};
use eval::{AlignmentMethod, CellMap, EvalConfig, EvalInput, MetresFromCells, evaluate};
use io::raster::{Band, BandData, CogRaster, Dem, read_dem, write_cog};
use jobs::dsm::{DsmConfig, DsmError, DsmReport, run};
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

fn config(output: PathBuf, reference: PathBuf) -> DsmConfig {
    let images = ["view_1.tif", "view_2.tif", "view_3.tif"].map(sample);
    let mut config = DsmConfig::new(images.into(), output);
    config.reference_dem = Some(reference);
    config.dem_vertical = Some(VerticalDatum::Ellipsoid);
    config
}

/// Returns the shift that would bring the surface of a run onto a reference.
fn left(folder: &Path, reference: &Path) -> [f64; 3] {
    let (dsm, reference) = (read_dem(folder.join("dsm/dsm.tif")).unwrap(), read_dem(reference).unwrap());
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
        let report: DsmReport = run(&config(output.clone(), reference.clone()), &Silent).unwrap();
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
    let truth = read_dem(sample("truth/dsm.tif")).unwrap();
    let refused = |name: &str, heights: &Grid<f32>, shift: [f64; 3], words: &str| {
        let reference = folder.path().join(format!("{name}.tif"));
        write(&reference, &truth, heights, shift);
        let error = run(&config(folder.path().join(name), reference), &Silent).unwrap_err();
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
