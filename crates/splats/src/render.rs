//! Rendering of splats: C = Σ cᵢ wᵢ, front to back; the weights wᵢ are those of `hits`.
//!
//! The heights of a pixel are the heights of the splats' planes on its ray: their mean by weight,
//! and their median, where the accumulated weight passes one half (as surfaces are read out of
//! 2DGS).

use crs::CrsError;
use gaussian::{LabelVotes, Splat, SplatLabel};
use raster::Grid;

use super::SplatCamera;
use super::pass::{Arrangement, TILE_PIXELS, Tile};

/// A rendered image.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// Colours over black.
    pub colour: Grid<[f32; 3]>,
    /// Accumulated weight Σ wᵢ, 1 where the splats hide everything behind them.
    pub coverage: Grid<f32>,
    /// Mean local height by weight, metres; NaN where there is no splat.
    pub mean_height_m: Grid<f32>,
    /// Local height at half of the weight, metres; NaN where less than half is covered.
    pub median_height_m: Grid<f32>,
    /// Depth at half of the weight, metres, as the camera counts it; NaN where less than half is
    /// covered.
    pub median_depth_m: Grid<f32>,
}

/// Renders splats through a camera.
///
/// # Errors
/// [`CrsError`] when PROJ cannot be set up.
pub fn render(splats: &[Splat], camera: &impl SplatCamera) -> Result<Rendering, CrsError> {
    Ok(render_arranged(splats, &Arrangement::new(splats, camera)?))
}

/// Returns the label of each pixel, given those of the splats: that with the greatest weight in the
/// rendering, as [`LabelVotes`] counts.
///
/// # Errors
/// [`CrsError`] when PROJ cannot be set up.
///
/// # Panics
/// If there are fewer labels than splats.
pub fn render_labels(
    splats: &[Splat],
    labels: &[SplatLabel],
    camera: &impl SplatCamera,
) -> Result<Grid<SplatLabel>, CrsError> {
    let arrangement = Arrangement::new(splats, camera)?;
    let (width, height) = arrangement.size();
    let tiles = arrangement.map_tiles(|tile| label_tile(labels, tile));
    let mut map = Grid::filled(width, height, SplatLabel::NONE);
    tiles.into_iter().flatten().for_each(|(column, row, label)| map[(column, row)] = label);
    Ok(map)
}

fn label_tile(labels: &[SplatLabel], tile: &Tile<'_>) -> Vec<(usize, usize, SplatLabel)> {
    let labels: Vec<SplatLabel> = tile.splats().map(|index| labels[index as usize]).collect();
    let mut votes = vec![LabelVotes::default(); TILE_PIXELS];
    let mut parts = Vec::new();
    tile.parts(&mut parts);
    for part in &parts {
        votes[part.pixel as usize].add(labels[part.slot as usize], part.weight);
    }
    tile.pixels().map(|(index, column, row)| (column, row, votes[index].take())).collect()
}

pub(super) fn render_arranged(splats: &[Splat], arrangement: &Arrangement) -> Rendering {
    let (width, height) = arrangement.size();
    let tiles = arrangement.map_tiles(|tile| render_tile(splats, tile));
    let mut rendering = Rendering {
        colour: Grid::filled(width, height, [0.0; 3]),
        coverage: Grid::filled(width, height, 0.0),
        mean_height_m: Grid::filled(width, height, f32::NAN),
        median_height_m: Grid::filled(width, height, f32::NAN),
        median_depth_m: Grid::filled(width, height, f32::NAN),
    };
    for (column, row, pixel) in tiles.into_iter().flatten() {
        rendering.colour[(column, row)] = pixel.colour;
        rendering.coverage[(column, row)] = pixel.coverage;
        if pixel.coverage > 0.0 {
            rendering.mean_height_m[(column, row)] = pixel.height / pixel.coverage;
        }
        [rendering.median_height_m[(column, row)], rendering.median_depth_m[(column, row)]] = pixel.median;
    }
    rendering
}

#[derive(Debug, Clone, Copy)]
struct Pixel {
    colour: [f32; 3],
    coverage: f32,
    /// Σ wᵢ zᵢ.
    height: f32,
    /// Height and depth.
    median: [f32; 2],
}

fn render_tile(splats: &[Splat], tile: &Tile<'_>) -> Vec<(usize, usize, Pixel)> {
    let colours: Vec<[f32; 3]> = tile.splats().map(|index| splats[index as usize].colour).collect();
    let empty = Pixel { colour: [0.0; 3], coverage: 0.0, height: 0.0, median: [f32::NAN; 2] };
    let mut pixels = [empty; TILE_PIXELS];
    let mut parts = Vec::new();
    tile.parts(&mut parts);
    for part in &parts {
        let (pixel, colour) = (&mut pixels[part.pixel as usize], colours[part.slot as usize]);
        (0..3).for_each(|i| pixel.colour[i] += part.weight * colour[i]);
        pixel.coverage += part.weight;
        pixel.height += part.weight * part.height;
        if pixel.coverage >= 0.5 && pixel.median[0].is_nan() {
            pixel.median = [part.height, part.depth];
        }
    }
    tile.pixels().map(|(index, column, row)| (column, row, pixels[index])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LensSplatCamera, MapSplatCamera, SplatSurface};
    use camera::{Lens, LensModel, Pose};
    use raster::GeoTransform;

    fn disc(position: [f32; 3], sigma: f32, colour: [f32; 3], opacity: f32) -> Splat {
        Splat { position, scale_m: [sigma, sigma, 1e-3], rotation: [1.0, 0.0, 0.0, 0.0], colour, opacity }
    }

    /// Two discs over one another, against the formula.
    #[test]
    fn the_upper_splat_covers_the_lower_one() {
        let heights = Grid::filled(21, 21, 0.0f32);
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(0.0, 21.0, 1.0), [0.0; 3]);
        let camera = MapSplatCamera::new(&surface).unwrap();
        let splats =
            [disc([10.5, 10.5, 2.0], 2.0, [0.0, 1.0, 0.0], 0.9), disc([12.5, 10.5, 5.0], 3.0, [1.0, 0.0, 0.0], 0.6)];
        let image = render(&splats, &camera).unwrap();
        let alpha = |opacity: f64, sigma: f64, d2: f64| opacity * (-0.5 * d2 / (sigma * sigma + 1e-3)).exp();
        for (column, row) in [(10, 10), (12, 10), (8, 13), (20, 10)] {
            let d2 = |x: f64| (column as f64 - x).powi(2) + (row as f64 - 10.0).powi(2);
            let (upper, lower) = (alpha(0.6, 3.0, d2(12.0)), alpha(0.9, 2.0, d2(10.0)));
            let lower = if lower < 1.0 / 255.0 { 0.0 } else { lower * (1.0 - upper) };
            let [red, green, _] = image.colour[(column, row)].map(f64::from);
            assert!((red - upper).abs() < 1e-5 && (green - lower).abs() < 1e-5, "{column} {row}");
            let mean = (5.0 * upper + 2.0 * lower) / (upper + lower);
            assert!((f64::from(image.mean_height_m[(column, row)]) - mean).abs() < 1e-4);
        }
        assert_eq!(image.median_height_m[(12, 10)], 5.0);
        assert_eq!(image.coverage[(0, 20)], 0.0);
        assert!(image.mean_height_m[(0, 20)].is_nan());
    }

    #[test]
    fn a_leaning_disc_has_the_heights_of_its_plane() {
        let heights = Grid::filled(21, 21, 0.0f32);
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(0.0, 21.0, 1.0), [0.0; 3]);
        let half = (0.5f32 * 0.5f32.atan()).sin_cos();
        // Turned about north so that east rises by one half.
        let splat = Splat { rotation: [half.1, 0.0, -half.0, 0.0], ..disc([10.5, 10.5, 4.0], 3.0, [1.0; 3], 0.9) };
        let image = render(&[splat], &MapSplatCamera::new(&surface).unwrap()).unwrap();
        for column in 7..14 {
            let expected = 4.0 + 0.5 * (column as f32 - 10.0);
            assert!((image.mean_height_m[(column, 10)] - expected).abs() < 1e-3, "{column}");
        }
    }

    #[test]
    fn a_perspective_camera_sees_what_is_before_it() {
        let lens = Lens::new(64, 48, LensModel::Pinhole, &[50.0, 50.0, 31.5, 23.5]).unwrap();
        let pose = Pose { rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]], centre: [0.0, 0.0, 30.0] };
        let camera = LensSplatCamera { lens: &lens, pose: &pose };
        let splats = [
            disc([0.0, 0.0, 5.0], 1.0, [0.0, 0.0, 1.0], 0.9),
            disc([0.0, 0.0, 0.0], 8.0, [1.0, 0.0, 0.0], 0.9),
            disc([0.0, 0.0, 60.0], 8.0, [0.0, 1.0, 0.0], 0.9),
        ];
        let image = render(&splats, &camera).unwrap();
        assert!(image.colour[(31, 23)][2] > 0.8 && image.colour[(31, 23)][1] == 0.0);
        assert!(image.colour[(45, 23)][0] > 0.4 && image.colour[(45, 23)][2] < 0.01);
    }

    /// The sums of the weights of two labels are what two colours show.
    #[test]
    fn labels_have_the_weights_of_the_rendering() {
        let lens = Lens::new(64, 48, LensModel::Pinhole, &[50.0, 50.0, 31.5, 23.5]).unwrap();
        let pose = Pose { rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]], centre: [0.0, 0.0, 30.0] };
        let camera = LensSplatCamera { lens: &lens, pose: &pose };
        let known = [SplatLabel { class: 2, object: 1 }, SplatLabel { class: 3, object: 1 }, SplatLabel::NONE];
        let random = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 997) as f32 / 997.0;
        let splat = |i: usize| {
            let position = [30.0 * random(i, 1) - 15.0, 20.0 * random(i, 2) - 10.0, 4.0 * random(i, 3)];
            let colour = [0, 1, 2].map(|kind| if kind == i % 3 { 1.0 } else { 0.0 });
            disc(position, 0.5 + random(i, 4), colour, 0.5)
        };
        let splats: Vec<Splat> = (0..220).map(splat).collect();
        let labels: Vec<SplatLabel> = (0..220).map(|i| known[i % 3]).collect();
        let (image, map) = (render(&splats, &camera).unwrap(), render_labels(&splats, &labels, &camera).unwrap());
        let mut counts = [0; 4];
        for (found, (sums, coverage)) in map.data().iter().zip(image.colour.data().iter().zip(image.coverage.data())) {
            let best = (0..3).fold(0, |best, i| if sums[i] > sums[best] { i } else { best });
            let is_close = (0..3).any(|i| i != best && sums[best] - sums[i] < 1e-5) || (coverage - 0.5).abs() < 1e-5;
            let expected = if *coverage > 0.5 { known[best] } else { SplatLabel::NONE };
            assert!(*found == expected || is_close, "{found:?} {sums:?} {coverage}");
            counts[if *coverage > 0.5 { best } else { 3 }] += 1;
        }
        assert!(counts.iter().all(|count| *count > 100), "{counts:?}");
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let heights = Grid::filled(70, 50, 0.0f32);
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(0.0, 50.0, 1.0), [0.0; 3]);
        let camera = MapSplatCamera::new(&surface).unwrap();
        let random = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 997) as f32 / 997.0;
        let splats: Vec<Splat> = (0..3000)
            .map(|i| {
                disc(
                    [70.0 * random(i, 1), 50.0 * random(i, 2), random(i, 3)],
                    0.2 + random(i, 4),
                    [random(i, 5); 3],
                    0.8,
                )
            })
            .collect();
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&splats, &camera).unwrap())
        };
        let (one, three) = (with(1), with(3));
        assert_eq!(one.colour, three.colour);
        assert_eq!(one.coverage, three.coverage);
    }
}
