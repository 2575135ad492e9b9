//! Hillshade against gdaldem (`reference/generate.sh`).

use raster::{Grid, Light, hillshade};

/// Reads an ESRI ASCII grid. Header lines begin with a letter.
fn ascii_grid(text: &str) -> Grid<f32> {
    let rows: Vec<Vec<f32>> = text
        .lines()
        .filter(|line| !line.trim_start().starts_with(|c: char| c.is_ascii_alphabetic()))
        .map(|line| line.split_whitespace().map(|n| n.parse().unwrap()).collect())
        .collect();
    Grid::from_vec(rows[0].len(), rows.len(), rows.concat()).unwrap()
}

#[test]
fn hillshade_agrees_with_gdaldem_to_one_grey_level() {
    let heights = ascii_grid(include_str!("reference/heights.asc"));
    let expected = ascii_grid(include_str!("reference/shade.asc"));
    let shade = hillshade(&heights, (0.5, 0.5), Light { z_factor: 1.5, ..Light::default() });
    for row in 1..heights.height() - 1 {
        for column in 1..heights.width() - 1 {
            let (ours, theirs) = (f32::from(shade[(column, row)]), expected[(column, row)]);
            assert!((ours - theirs).abs() <= 1.0, "({column}, {row}): {ours}, gdaldem {theirs}");
        }
    }
}
