//! The page of a job beside its report in JSON.

use std::path::{Path, PathBuf};

use raster::{Grid, Light};
use report::{JobPage, Legend, MapLayer};
use serde::Serialize;

use crate::files::{self, FileError};

/// Longest side of the maps of a page, pixels.
const MAP_SIDE: usize = 1000;
/// Percentiles of the values between which colours are spread.
const PERCENTILES: (f64, f64) = (1.0, 99.0);

/// Returns the file of the page beside a report.
pub fn page_file(report: &Path) -> PathBuf {
    report.with_extension("html")
}

/// Fails when the report or its page exist and may not be replaced.
pub fn refuse_existing(report: &Path, overwrite: bool) -> Result<(), FileError> {
    [report, &page_file(report)].into_iter().try_for_each(|path| files::refuse_existing(path, overwrite))
}

/// Writes the page of a report, then the report. `title` and `lead` open the page.
pub fn write(
    path: &Path,
    (title, lead): (&str, &str),
    report: &impl Serialize,
    layers: Vec<MapLayer>,
    overwrite: bool,
) -> Result<(), FileError> {
    let value = serde_json::to_value(report)?;
    write_page(path, &JobPage { layers, ..JobPage::of_report(title, lead, &value) }, report, overwrite)
}

/// Writes a page, then its report.
pub fn write_page(path: &Path, page: &JobPage, report: &impl Serialize, overwrite: bool) -> Result<(), FileError> {
    let file = page_file(path);
    let html =
        page.html().map_err(|e| FileError::Unwritable { path: file.clone(), source: std::io::Error::other(e) })?;
    formats::write_bytes(&file, html.as_bytes(), overwrite)?;
    files::write_json(path, report, overwrite)
}

/// Returns a map of heights in cells of `cell_m` as a shaded relief.
pub fn relief_layer(name: &str, caption: &str, heights: &Grid<f32>, cell_m: f64) -> MapLayer {
    let (small, factor) = thinned(heights);
    let side_m = cell_m * factor as f64;
    let (low, high) = raster::height_percentiles(&small, PERCENTILES.0, PERCENTILES.1).unwrap_or((0.0, 1.0));
    let shade = raster::hillshade(&small, (side_m, side_m), Light::default());
    MapLayer {
        name: name.to_owned(),
        picture: raster::coloured_relief(&small, &shade, low, high),
        caption: caption.to_owned(),
        legend: Some(Legend::heights(low, high, "m")),
    }
}

/// Returns a map in the colours of a legend.
pub fn legend_layer(name: &str, caption: &str, values: &Grid<f32>, legend: Legend) -> MapLayer {
    let picture = legend.picture(&thinned(values).0);
    MapLayer { name: name.to_owned(), picture, caption: caption.to_owned(), legend: Some(legend) }
}

/// Writes the legends of layers as the styles of QGIS, each under the name that is given with it.
pub fn write_styles<'a>(
    folder: &Path,
    layers: impl IntoIterator<Item = (&'a str, &'a MapLayer)>,
) -> Result<(), FileError> {
    for (name, layer) in layers {
        if let Some(legend) = &layer.legend {
            formats::write_bytes(folder.join(name), legend.qml().as_bytes(), false)?;
        }
    }
    Ok(())
}

/// Returns the percentiles of a map between which its colours are spread.
pub fn shown_range(values: &Grid<f32>) -> (f32, f32) {
    raster::height_percentiles(&thinned(values).0, PERCENTILES.0, PERCENTILES.1).unwrap_or((0.0, 1.0))
}

/// Returns every n-th cell along both axes, so that a map fits a page, and n.
pub fn thinned<T: Copy>(values: &Grid<T>) -> (Grid<T>, usize) {
    let (width, height) = (values.width(), values.height());
    let step = width.max(height).div_ceil(MAP_SIDE).max(1);
    let rows = (0..height).step_by(step);
    let cells: Vec<T> = rows.flat_map(|y| values.row(y).iter().step_by(step).copied()).collect();
    match Grid::from_vec(width.div_ceil(step), height.div_ceil(step), cells) {
        Some(small) => (small, step),
        None => (values.clone(), 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_lies_beside_its_report() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        let heights = Grid::filled(2001, 3, 5.0f32);
        let layers = vec![relief_layer("Ground", "The ground.", &heights, 0.5)];
        write(&path, ("A job", "Done."), &serde_json::json!({ "cells": 3 }), layers, false).unwrap();
        let page = std::fs::read_to_string(page_file(&path)).unwrap();
        assert!(page.contains("A job") && page.contains("<dt>cells</dt><dd>3</dd>"));
        assert!(path.is_file() && refuse_existing(&path, true).is_ok());
        std::fs::remove_file(&path).unwrap();
        assert!(refuse_existing(&path, false).is_err(), "the page is there");
    }

    #[test]
    fn a_large_map_is_thinned() {
        let (small, step) = thinned(&Grid::from_vec(2001, 1, (0..2001).collect::<Vec<i32>>()).unwrap());
        assert_eq!((small.width(), small.height(), step, small[(1, 0)]), (667, 1, 3, 3));
    }
}
