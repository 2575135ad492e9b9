//! A checked interpolant: any smooth map (u, v, height) → two numbers, replaced on a tile by a cubic.
//!
//! The exact chain reference pixel → ground → source pixel costs a localisation and a projection; inside a tile a
//! polynomial of total degree three in (u, v, height) is hundreds of times cheaper. It is the discrete Chebyshev
//! projection on 4 × 4 × 4 nodes, which needs no matrix. Its error is then measured against the exact map on a
//! lattice at 0, ±0.7 and ±1 of the half-extents, close to where the first neglected terms (T₄ along each axis) have
//! their extremes; the largest is kept with the interpolant, and a tile over the tolerance is an error or is divided.
//!
//! Units are those of the map: pixels for image → image, degrees or metres for image → ground.

use raster::Window;

use crate::{CameraError, ImagePoint, RpcCamera};

/// The error that the height sweep accepts, pixels.
pub const DEFAULT_TOLERANCE_PX: f64 = 0.02;

/// Nodes along each axis; degree plus one.
const N: usize = 4;
/// Monomials of total degree ≤ 3 in three variables.
const TERMS: usize = 20;
/// Positions along each axis at which the error is measured.
const CHECKS: [f64; 5] = [-1.0, -0.7, 0.0, 0.7, 1.0];
/// Half-extents smaller than this (pixels, metres) are widened to it: a single pixel or plane stays well defined.
const HALF_MIN: f64 = 0.5;

/// Where an interpolant holds: closed intervals of columns and rows (pixel centres) and of heights in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileExtent {
    /// First and last column.
    pub u: (f64, f64),
    /// First and last row.
    pub v: (f64, f64),
    /// Lowest and highest height, metres above the ellipsoid.
    pub height_m: (f64, f64),
}

/// A cubic in (u, v, height) for each of two outputs, with its measured error.
#[derive(Debug, Clone, PartialEq)]
pub struct TileInterpolant {
    extent: TileExtent,
    /// Centre and half-extent of u, v, height.
    centre: [f64; 3],
    half: [f64; 3],
    /// Monomial coefficients of the normalised variables, in the order of [`exponents`].
    coefficients: [[f64; TERMS]; 2],
    max_error: f64,
}

/// An interpolant on one row: a cubic in (u, height).
#[derive(Debug, Clone, PartialEq)]
pub struct RowInterpolant {
    centre: [f64; 2],
    inverse_half: [f64; 2],
    /// By power of the height, then of u: 4 + 3 + 2 + 1 terms.
    coefficients: [[f64; 10]; 2],
}

/// Why a map could not be replaced on a tile.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InterpolantError<E> {
    /// The exact map failed inside the tile.
    #[error("the exact map fails inside the tile at column {}, row {}, height {} m: {source}", at[0], at[1], at[2])]
    Exact {
        /// Where: column, row, height.
        at: [f64; 3],
        /// What it said.
        source: E,
    },
    /// The extent is reversed or not finite.
    #[error("the tile's extent is reversed or not finite: {extent:?}")]
    Extent {
        /// What was given.
        extent: TileExtent,
    },
    /// The error is over the tolerance (or not finite), also on the smallest tile where tiles may be divided.
    #[error(
        "the interpolant is off by {error} on {extent:?}; expected at most {tolerance}: the map is not smooth there, \
         or the tile too large"
    )]
    Rough {
        /// Largest error found, in the map's units.
        error: f64,
        /// What was accepted.
        tolerance: f64,
        /// The tile.
        extent: TileExtent,
    },
}

impl TileExtent {
    /// The pixel centres of a window, and a range of heights.
    pub fn of_window(window: &Window, height_m: (f64, f64)) -> Self {
        let span = |first: i64, n: usize| (first as f64, first as f64 + n.saturating_sub(1) as f64);
        Self { u: span(window.x, window.width), v: span(window.y, window.height), height_m }
    }

    fn is_valid(&self) -> bool {
        [self.u, self.v, self.height_m].iter().all(|&(lo, hi)| lo <= hi && lo.is_finite() && hi.is_finite())
    }

    /// The four quarters in column and row.
    fn quarters(&self) -> [Self; 4] {
        let (um, vm) = (0.5 * (self.u.0 + self.u.1), 0.5 * (self.v.0 + self.v.1));
        let part = |u, v| Self { u, v, height_m: self.height_m };
        let (left, right, upper, lower) = ((self.u.0, um), (um, self.u.1), (self.v.0, vm), (vm, self.v.1));
        [part(left, upper), part(right, upper), part(left, lower), part(right, lower)]
    }
}

impl TileInterpolant {
    /// Fits the interpolant on a tile and measures its error.
    ///
    /// # Errors
    /// The exact map's own, and an error above `tolerance` (in the map's units).
    pub fn fit<E>(
        extent: TileExtent,
        tolerance: f64,
        exact: impl Fn(f64, f64, f64) -> Result<[f64; 2], E>,
    ) -> Result<Self, InterpolantError<E>> {
        if !extent.is_valid() {
            return Err(InterpolantError::Extent { extent });
        }
        let intervals = [extent.u, extent.v, extent.height_m];
        let centre = intervals.map(|(lo, hi)| 0.5 * (lo + hi));
        let half = intervals.map(|(lo, hi)| (0.5 * (hi - lo)).max(HALF_MIN));
        let located = |n: [f64; 3]| {
            let at: [f64; 3] = std::array::from_fn(|i| centre[i] + half[i] * n[i]);
            exact(at[0], at[1], at[2]).map_err(|source| InterpolantError::Exact { at, source })
        };
        let coefficients = chebyshev_projection(located)?;
        let mut tile = Self { extent, centre, half, coefficients, max_error: 0.0 };
        tile.max_error = tile.measured_error(located)?;
        // Written so that an error which is NaN is refused too.
        if tile.max_error <= tolerance {
            Ok(tile)
        } else {
            Err(InterpolantError::Rough { error: tile.max_error, tolerance, extent })
        }
    }

    /// Fits interpolants on a tile that is divided into quarters wherever the error is over `tolerance`, down to
    /// tiles narrower than twice `smallest`, columns and rows. The order is that of the division: upper left, upper
    /// right, lower left, lower right.
    ///
    /// # Errors
    /// As [`TileInterpolant::fit`] on the smallest tiles.
    pub fn fit_divided<E>(
        extent: TileExtent,
        tolerance: f64,
        smallest: f64,
        exact: &impl Fn(f64, f64, f64) -> Result<[f64; 2], E>,
    ) -> Result<Vec<Self>, InterpolantError<E>> {
        let narrow = (extent.u.1 - extent.u.0).max(extent.v.1 - extent.v.0) < 2.0 * smallest.max(1.0);
        match Self::fit(extent, tolerance, exact) {
            Ok(tile) => Ok(vec![tile]),
            Err(InterpolantError::Rough { .. }) if !narrow => {
                let mut tiles = Vec::new();
                for quarter in extent.quarters() {
                    tiles.append(&mut Self::fit_divided(quarter, tolerance, smallest, exact)?);
                }
                Ok(tiles)
            }
            Err(e) => Err(e),
        }
    }

    /// The chain reference pixel at a height → ground → source pixel, on a tile of the reference.
    ///
    /// # Errors
    /// As [`TileInterpolant::fit`]; the tolerance is in pixels.
    pub fn source_from_reference(
        reference: &RpcCamera,
        source: &RpcCamera,
        extent: TileExtent,
        tolerance_px: f64,
    ) -> Result<Self, InterpolantError<CameraError>> {
        Self::fit(extent, tolerance_px, |u, v, h| {
            let p = source.project(reference.localize(ImagePoint::new(u, v), h)?)?;
            Ok([p.sample, p.line])
        })
    }

    /// Where the interpolant holds.
    pub fn extent(&self) -> TileExtent {
        self.extent
    }

    /// The largest distance to the exact map over the check lattice, in the map's units.
    pub fn max_error(&self) -> f64 {
        self.max_error
    }

    /// The map's value at column `u`, row `v` and a height in metres.
    pub fn eval(&self, u: f64, v: f64, height_m: f64) -> [f64; 2] {
        let n = |x: f64, i: usize| (x - self.centre[i]) / self.half[i];
        let (a, b, c) = (n(u, 0), n(v, 1), n(height_m, 2));
        self.coefficients.map(|k| {
            let h0 = row_cubic(&k[..10], a, b);
            let h1 = (k[10] + a * (k[11] + a * k[12])) + b * ((k[13] + a * k[14]) + b * k[15]);
            let h2 = k[16] + a * k[17] + b * k[18];
            h0 + c * (h1 + c * (h2 + c * k[19]))
        })
    }

    /// The interpolant on row `v`.
    pub fn row(&self, v: f64) -> RowInterpolant {
        let b = (v - self.centre[1]) / self.half[1];
        let coefficients = self.coefficients.map(|k| {
            [
                k[0] + b * (k[4] + b * (k[7] + b * k[9])),
                k[1] + b * (k[5] + b * k[8]),
                k[2] + b * k[6],
                k[3],
                k[10] + b * (k[13] + b * k[15]),
                k[11] + b * k[14],
                k[12],
                k[16] + b * k[18],
                k[17],
                k[19],
            ]
        });
        RowInterpolant {
            centre: [self.centre[0], self.centre[2]],
            inverse_half: [1.0 / self.half[0], 1.0 / self.half[2]],
            coefficients,
        }
    }

    fn measured_error<E>(
        &self,
        exact: impl Fn([f64; 3]) -> Result<[f64; 2], InterpolantError<E>>,
    ) -> Result<f64, InterpolantError<E>> {
        let mut worst = 0.0_f64;
        for a in CHECKS {
            for b in CHECKS {
                for c in CHECKS {
                    let e = exact([a, b, c])?;
                    let at: [f64; 3] = std::array::from_fn(|i| self.centre[i] + self.half[i] * [a, b, c][i]);
                    let m = self.eval(at[0], at[1], at[2]);
                    let error = (e[0] - m[0]).hypot(e[1] - m[1]);
                    // `f64::max` would lose a NaN.
                    if error.is_nan() {
                        return Ok(f64::NAN);
                    }
                    worst = worst.max(error);
                }
            }
        }
        Ok(worst)
    }
}

impl RowInterpolant {
    /// The map's value at column `u` and a height in metres.
    #[inline]
    pub fn eval(&self, u: f64, height_m: f64) -> [f64; 2] {
        let a = (u - self.centre[0]) * self.inverse_half[0];
        let c = (height_m - self.centre[1]) * self.inverse_half[1];
        self.coefficients.map(|k| {
            let h0 = k[0] + a * (k[1] + a * (k[2] + a * k[3]));
            let h1 = k[4] + a * (k[5] + a * k[6]);
            h0 + c * (h1 + c * ((k[7] + a * k[8]) + c * k[9]))
        })
    }

    /// The map along the row from column `u0`, with one height per column; as many values as the shortest slice.
    pub fn eval_columns(&self, u0: f64, height_m: &[f64], x: &mut [f64], y: &mut [f64]) {
        for (i, ((&h, x), y)) in height_m.iter().zip(x).zip(y).enumerate() {
            [*x, *y] = self.eval(u0 + i as f64, h);
        }
    }
}

/// The ten terms without the height.
fn row_cubic(k: &[f64], a: f64, b: f64) -> f64 {
    let b0 = k[0] + a * (k[1] + a * (k[2] + a * k[3]));
    let b1 = k[4] + a * (k[5] + a * k[6]);
    let b2 = k[7] + a * k[8];
    b0 + b * (b1 + b * (b2 + b * k[9]))
}

/// Powers of u, v and height of each coefficient: by power of the height, then of v, then of u.
fn exponents() -> impl Iterator<Item = [usize; 3]> {
    (0..N).flat_map(|k| (0..N - k).flat_map(move |j| (0..N - k - j).map(move |i| [i, j, k])))
}

/// Monomial coefficients of the projection on Chebyshev polynomials of total degree ≤ 3, from the exact map at the
/// 4 × 4 × 4 Chebyshev nodes of [−1, 1]³.
fn chebyshev_projection<E>(
    exact: impl Fn([f64; 3]) -> Result<[f64; 2], InterpolantError<E>>,
) -> Result<[[f64; TERMS]; 2], InterpolantError<E>> {
    let node: [f64; N] = std::array::from_fn(|i| (std::f64::consts::PI * (i as f64 + 0.5) / N as f64).cos());
    let t = |degree: usize, x: f64| (degree as f64 * x.acos()).cos();
    let mut sums = [[0.0; N * N * N]; 2];
    for (ia, ib, ic) in (0..N * N * N).map(|m| (m % N, m / N % N, m / (N * N))) {
        let value = exact([node[ia], node[ib], node[ic]])?;
        for [i, j, k] in exponents() {
            let weight = t(i, node[ia]) * t(j, node[ib]) * t(k, node[ic]);
            let norm: f64 = [i, j, k].iter().map(|&d| if d == 0 { 1.0 } else { 2.0 } / N as f64).product();
            for (sum, value) in sums.iter_mut().zip(value) {
                sum[i + N * (j + N * k)] += norm * weight * value;
            }
        }
    }
    Ok(sums.map(|mut s| {
        for stride in [1, N, N * N] {
            monomials_along(&mut s, stride);
        }
        let mut terms = exponents().map(|[i, j, k]| s[i + N * (j + N * k)]);
        std::array::from_fn(|_| terms.next().unwrap_or(0.0))
    }))
}

/// Turns Chebyshev into monomial coefficients along one axis: T₂ = 2x² − 1, T₃ = 4x³ − 3x.
fn monomials_along(s: &mut [f64; N * N * N], stride: usize) {
    for first in (0..N * N * N).filter(|m| (m / stride).is_multiple_of(N)) {
        let c: [f64; N] = std::array::from_fn(|d| s[first + d * stride]);
        let m = [c[0] - c[2], c[1] - 3.0 * c[3], 2.0 * c[2], 4.0 * c[3]];
        for (d, value) in m.into_iter().enumerate() {
            s[first + d * stride] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXTENT: TileExtent = TileExtent { u: (100.0, 163.0), v: (40.0, 71.0), height_m: (-20.0, 180.0) };

    fn cubic(u: f64, v: f64, h: f64) -> [f64; 2] {
        let (a, b, c) = (u / 50.0, v / 50.0, h / 100.0);
        [1.0 + a - 2.0 * b * c + a * a * b - 0.3 * c * c * c, 5.0 - c + 0.2 * a * b * c - b * b * b + 0.1 * c * c * a]
    }

    fn smooth(u: f64, v: f64, h: f64) -> Result<[f64; 2], CameraError> {
        Ok([(u / 40.0).sin() * (h / 150.0).cos() * 30.0, (v / 60.0 + h / 300.0).exp()])
    }

    #[test]
    fn cubics_are_reproduced_at_points_rows_and_columns() {
        let tile = TileInterpolant::fit(EXTENT, 1e-10, |u, v, h| Ok::<_, CameraError>(cubic(u, v, h))).unwrap();
        let heights = [-20.0, 3.5, 77.0, 180.0];
        let (mut x, mut y) = ([0.0; 4], [0.0; 4]);
        tile.row(51.0).eval_columns(120.0, &heights, &mut x, &mut y);
        for (i, h) in heights.into_iter().enumerate() {
            let exact = cubic(120.0 + i as f64, 51.0, h);
            let point = tile.eval(120.0 + i as f64, 51.0, h);
            for (axis, row) in [x[i], y[i]].into_iter().enumerate() {
                assert!((exact[axis] - point[axis]).abs() < 1e-11);
                assert!((exact[axis] - row).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn the_measured_error_bounds_the_error_between_its_lattice() {
        let tile = TileInterpolant::fit(EXTENT, 1.0, smooth).unwrap();
        let mut worst = 0.0_f64;
        for m in 0..21 * 21 * 21 {
            let at = |i: usize, (lo, hi): (f64, f64)| lo + (hi - lo) * i as f64 / 20.0;
            let (u, v, h) = (at(m % 21, EXTENT.u), at(m / 21 % 21, EXTENT.v), at(m / 441, EXTENT.height_m));
            let (e, t) = (smooth(u, v, h).unwrap(), tile.eval(u, v, h));
            worst = worst.max((e[0] - t[0]).hypot(e[1] - t[1]));
        }
        assert!(worst > 0.0 && worst < 1.1 * tile.max_error(), "{worst} {}", tile.max_error());
    }

    #[test]
    fn a_rough_tile_is_refused_and_can_be_divided() {
        let bound = 0.3 * TileInterpolant::fit(EXTENT, 1.0, smooth).unwrap().max_error();
        let flat = TileExtent { height_m: (50.0, 50.0), ..EXTENT };
        let refused = TileInterpolant::fit(EXTENT, bound, smooth);
        assert!(matches!(refused, Err(InterpolantError::Rough { tolerance, .. }) if tolerance == bound));
        let tiles = TileInterpolant::fit_divided(flat, 1e-4, 4.0, &smooth).unwrap();
        assert!(tiles.len() > 1 && tiles.iter().all(|t| t.max_error() <= 1e-4));
        let area = |e: TileExtent| (e.u.1 - e.u.0) * (e.v.1 - e.v.0);
        assert_eq!(tiles.iter().map(|t| area(t.extent())).sum::<f64>(), area(flat));
    }

    #[test]
    fn failures_of_the_map_and_maps_that_are_nan_are_errors() {
        let fails = |u: f64, _: f64, _: f64| if u > 160.0 { Err(CameraError::Singular) } else { Ok([0.0; 2]) };
        assert!(matches!(TileInterpolant::fit(EXTENT, 1.0, fails), Err(InterpolantError::Exact { .. })));
        let nan = |_: f64, _: f64, _: f64| Ok::<_, CameraError>([f64::NAN, 0.0]);
        assert!(matches!(TileInterpolant::fit(EXTENT, 1.0, nan), Err(InterpolantError::Rough { .. })));
        let reversed = TileExtent { u: (5.0, 4.0), ..EXTENT };
        assert!(matches!(TileInterpolant::fit(reversed, 1.0, smooth), Err(InterpolantError::Extent { .. })));
    }
}
