//! Splats of a surface and a picture on its grid: one splat per cell, as cross-view models predict
//! them, or as few as bounds allow. A bird's-eye height map and the satellite tile over it are such
//! a pair.

use gaussian::Splat;
use raster::Grid;

use super::scene::{Reason, check, display_range, displayed, first_splat};
use super::{DivisionConfig, GaussianConfig, SplatConfig, SplatError, SplatSurface, divide, uniform};

/// Makes splats of a surface: one per cell, or as few as `merged` allows. `picture` (red, green,
/// blue in 0 to 1, NaN where unknown) and `confidence` (0 to 1) are per cell. Splats without a
/// colour are middle grey.
///
/// # Errors
/// [`SplatError`] for a surface without heights, a bound that is not positive, and a picture or
/// confidence of another size.
pub fn picture_splats(
    surface: &SplatSurface<'_>,
    picture: Option<&Grid<[f32; 3]>>,
    confidence: Option<&Grid<f32>>,
    merged: Option<DivisionConfig>,
) -> Result<Vec<Splat>, SplatError> {
    let division = merged.unwrap_or_default();
    check(surface, confidence, &SplatConfig { division, ..SplatConfig::default() })?;
    let expected = (surface.heights().width(), surface.heights().height());
    if let Some(found) = picture.map(|p| (p.width(), p.height())).filter(|found| *found != expected) {
        return Err(Reason::Size { what: "the picture", found, expected }.into());
    }
    let gaussian = GaussianConfig::default();
    let blocks = match merged {
        Some(division) => divide(surface, picture, &division, &gaussian),
        None => uniform(surface, 1),
    };
    let grey = || Grid::filled(expected.0, expected.1, [f32::NAN; 3]);
    let colours = picture.map_or_else(grey, Grid::clone);
    Ok(blocks.iter().map(|block| first_splat(surface, block, &colours, confidence, &gaussian)).collect())
}

/// Brings a picture in units of its own to 0 to 1, with the extreme quarter of a percent of its
/// values clipped on each side.
pub fn stretched(picture: &Grid<[f32; 3]>) -> Grid<[f32; 3]> {
    let range = display_range(picture);
    picture.map(|colour| displayed(*colour, &range).map(|c| c.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    #[test]
    fn cells_become_splats_with_their_own_colours() {
        let mut heights = Grid::filled(8, 8, 5.0_f32);
        heights[(3, 4)] = f32::NAN;
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(100.0, 200.0, 0.5), [100.0, 200.0, 1.0]);
        let picture = Grid::from_vec(8, 8, (0..64).map(|i| [i as f32 / 64.0, 0.5, 1.0]).collect()).unwrap();
        let splats = picture_splats(&surface, Some(&picture), None, None).unwrap();
        assert_eq!(splats.len(), 63);
        assert!(splats.iter().all(|s| s.position[2] == 4.0 && s.validate().is_ok()));
        let first = splats.iter().find(|s| s.position == [0.25, -0.25, 4.0]).unwrap();
        assert_eq!((first.colour, first.opacity), ([0.0, 0.5, 1.0], 0.99));
        let other = Grid::filled(8, 7, [0.0; 3]);
        assert!(matches!(picture_splats(&surface, Some(&other), None, None), Err(SplatError(Reason::Size { .. }))));
    }

    #[test]
    fn level_ground_of_one_colour_takes_few() {
        let heights = Grid::filled(64, 64, 5.0_f32);
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(100.0, 200.0, 0.5), [100.0, 200.0, 1.0]);
        let picture = Grid::filled(64, 64, [0.2; 3]);
        let merged = picture_splats(&surface, Some(&picture), None, Some(DivisionConfig::default())).unwrap();
        assert!(merged.len() * 10 < 64 * 64, "{}", merged.len());
    }

    #[test]
    fn other_units_are_stretched() {
        let picture = Grid::from_vec(1000, 1, (0..1000).map(|i| [100.0 + i as f32; 3]).collect()).unwrap();
        let shown = stretched(&picture);
        assert_eq!((shown[(0, 0)], shown[(999, 0)]), ([0.0; 3], [1.0; 3]));
        assert!((shown[(500, 0)][0] - 0.5).abs() < 2e-3);
    }
}
