//! World files: the place of a picture on the map, in six lines beside it (ESRI's format).

use std::path::{Path, PathBuf};

use raster::GeoTransform;

use crate::atomic::{SaveError, write_bytes};

/// Writes the world file of a PNG whose pixels are squares of `factor` cells of a grid, and returns
/// its path. An earlier one is replaced: it belongs to the picture.
///
/// # Errors
/// [`SaveError`] when the system refuses.
pub fn write_world_file(picture: &Path, grid: GeoTransform, factor: usize) -> Result<PathBuf, SaveError> {
    let path = picture.with_extension("pgw");
    write_bytes(&path, world_file(grid, factor).as_bytes(), true)?;
    Ok(path)
}

/// Returns the six lines: the pixel as a vector along the row and along the column, and the centre
/// of the upper-left pixel.
fn world_file(grid: GeoTransform, factor: usize) -> String {
    let (f, g) = (factor as f64, grid.0);
    let middle = |origin: f64, column: f64, row: f64| origin + 0.5 * f * (column + row);
    let lines = [g[1] * f, g[4] * f, g[2] * f, g[5] * f, middle(g[0], g[1], g[2]), middle(g[3], g[4], g[5])];
    lines.map(|value| format!("{value:.15}\n")).concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_world_file_names_the_centre_of_the_first_pixel() {
        let folder = tempfile::tempdir().unwrap();
        let grid = GeoTransform::north_up(1000.0, 2000.0, 0.5);
        let path = write_world_file(&folder.path().join("relief.png"), grid, 2).unwrap();
        assert_eq!(path, folder.path().join("relief.pgw"));
        let text = std::fs::read_to_string(path).unwrap();
        let lines: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
        assert_eq!(lines, [1.0, 0.0, 0.0, -1.0, 1000.5, 1999.5]);
    }

    /// GDAL's terms of rows and columns are in another order than the lines of the file.
    #[test]
    fn a_turned_grid_keeps_its_axes() {
        let grid = GeoTransform([10.0, 0.3, 0.4, 20.0, 0.4, -0.3]);
        let lines: Vec<f64> = world_file(grid, 1).lines().map(|line| line.parse().unwrap()).collect();
        let expected = [0.3, 0.4, 0.4, -0.3, 10.35, 20.05];
        assert!(lines.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{lines:?}");
    }
}
