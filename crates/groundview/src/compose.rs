//! Lays a rendered ground layer over a satellite layer: C = C_ground + (1 − α_ground) · C_sat
//! (Cross-View Splatter).
//!
//! A splat renderer leaves the colours of the ground layer weighted by their opacity.

use raster::Grid;

/// Layers of different sizes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the layers have {ground:?}, {alpha:?} and {satellite:?} pixels (ground, alpha, satellite): expected one size")]
pub struct SizeError {
    /// Columns and rows of the ground layer.
    pub ground: (usize, usize),
    /// Columns and rows of its opacity.
    pub alpha: (usize, usize),
    /// Columns and rows of the satellite layer.
    pub satellite: (usize, usize),
}

/// Lays the ground layer over the satellite layer; opacities are 0 to 1.
///
/// # Errors
/// [`SizeError`] for layers of different sizes.
///
/// ```
/// use raster::Grid;
///
/// let both = groundview::compose(
///     &Grid::filled(1, 1, [0.2, 0.0, 0.0]),
///     &Grid::filled(1, 1, 0.5),
///     &Grid::filled(1, 1, [0.0, 0.0, 0.8]),
/// )?;
/// assert_eq!(both[(0, 0)], [0.2, 0.0, 0.4]);
/// # Ok::<(), groundview::SizeError>(())
/// ```
pub fn compose(
    ground: &Grid<[f32; 3]>,
    alpha: &Grid<f32>,
    satellite: &Grid<[f32; 3]>,
) -> Result<Grid<[f32; 3]>, SizeError> {
    let sizes = SizeError {
        ground: (ground.width(), ground.height()),
        alpha: (alpha.width(), alpha.height()),
        satellite: (satellite.width(), satellite.height()),
    };
    if sizes.ground != sizes.alpha || sizes.ground != sizes.satellite {
        return Err(sizes);
    }
    let mut out = ground.clone();
    for ((pixel, alpha), below) in out.data_mut().iter_mut().zip(alpha.data()).zip(satellite.data()) {
        let through = 1.0 - alpha.clamp(0.0, 1.0);
        pixel.iter_mut().zip(below).for_each(|(c, below)| *c += through * below);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_ground_lets_through_is_the_satellite() {
        let layer = |v: f32| Grid::filled(2, 1, [v, 2.0 * v, 0.0]);
        let alpha = Grid::from_vec(2, 1, vec![0.25, 1.0]).unwrap();
        let out = compose(&layer(0.1), &alpha, &layer(0.4)).unwrap();
        assert!((out[(0, 0)][0] - (0.1 + 0.75 * 0.4)).abs() < 1e-6 && (out[(0, 0)][1] - 0.8).abs() < 1e-6);
        assert_eq!(out[(1, 0)], layer(0.1)[(1, 0)]);
        assert!(compose(&layer(0.1), &Grid::filled(1, 1, 1.0), &layer(0.1)).is_err());
    }
}
