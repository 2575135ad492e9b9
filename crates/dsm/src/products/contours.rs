//! Contour lines of the ground.

use std::path::{Path, PathBuf};

use formats::raster::{ContourSurface, read_dem, write_contours};
use numeric::Progress;
use raster::{gaussian, height_percentiles};
use serde::Serialize;

use super::error::ProductsError;
use super::scene::SurfaceOfRun;
use job::files::FileError;
use job::output_folder::OutputFolder;

/// File of the lines.
pub(super) const FILE: &str = "contours.gpkg";
/// Steps between lines that people use, up to powers of ten.
const STEPS: [f64; 3] = [1.0, 2.0, 5.0];
/// Number of lines over the relief that is aimed at.
const LINES: f64 = 25.0;
/// Standard deviation of the smoothing, cells. Lines of the bare cells would show their noise.
pub(super) const SMOOTHING_PX: f32 = 1.5;

/// Length of the shortest line, cells: the smoothing resolves no loop of a few cells.
const SHORTEST_PX: f64 = 10.0;

/// Contour lines that were made.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct ContoursReport {
    /// GeoPackage with the layer `contours`.
    pub file: PathBuf,
    /// Step between the lines, in the unit of their heights.
    pub interval: f64,
    /// Unit of the heights of the lines, that of the vertical reference system: `m` or `ft`.
    pub unit: &'static str,
    /// Number of lines.
    pub lines: u64,
    /// Lines that were left out because they are shorter than ten cells.
    pub specks: u64,
}

/// Makes the lines of a terrain model. `interval` counts in the unit of the heights.
pub(super) fn make(
    surface: &SurfaceOfRun,
    dtm: &Path,
    interval: Option<f64>,
    folder: &OutputFolder,
    progress: &dyn Progress,
) -> Result<ContoursReport, ProductsError> {
    progress.begin("contour lines", 1);
    let ground = read_dem(dtm)?;
    let heights = gaussian(&ground.heights, SMOOTHING_PX);
    let metres = surface.crs.vertical.metres_per_unit().unwrap_or(1.0);
    let relief_m = height_percentiles(&heights, 0.5, 99.5).map_or(0.0, |(low, high)| f64::from(high - low));
    let interval = interval.unwrap_or_else(|| fitting_interval(relief_m / metres, surface.cell_m() / metres));
    let (width, height) = ground.geotransform.cell_size();
    let lines = ContourSurface {
        heights: &heights,
        geotransform: ground.geotransform,
        crs: surface.crs,
        interval,
        shortest: SHORTEST_PX * width.min(height),
    };
    let work = folder.work_folder()?;
    let made = write_contours(&work.path().join(FILE), &lines, false).map_err(FileError::from)?;
    folder.remove(FILE)?;
    folder.publish(work.path(), FILE)?;
    progress.step();
    let unit = if metres == 1.0 { "m" } else { "ft" };
    let file = folder.path().join(FILE);
    Ok(ContoursReport { file, interval, unit, lines: made.written, specks: made.specks })
}

/// Returns the smallest usual interval that gives few enough lines and is no finer than a cell.
fn fitting_interval(relief: f64, cell: f64) -> f64 {
    let least = (relief / LINES).max(cell).max(1e-3);
    let tens = 10f64.powf(least.log10().floor());
    let steps = STEPS.iter().map(|step| step * tens).chain([10.0 * tens]);
    steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9)).unwrap_or(10.0 * tens)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_usual_numbers() {
        for (relief, cell, expected) in
            [(20.0, 0.5, 1.0), (4.0, 0.5, 0.5), (30.0, 0.3, 2.0), (1000.0, 10.0, 50.0), (0.0, 1.0, 1.0)]
        {
            assert!((fitting_interval(relief, cell) - expected).abs() < 1e-9, "{relief} {cell}");
        }
    }
}
