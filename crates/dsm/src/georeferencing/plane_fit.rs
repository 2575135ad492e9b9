//! Least-squares fit of a plane `value = a + b x + c y`.

/// A plane over two coordinates, which count from `centre`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FittedPlane {
    pub(crate) centre: [f64; 2],
    /// Value at the centre.
    pub(crate) offset: f64,
    /// Change of the value per unit of each coordinate.
    pub(crate) slope: [f64; 2],
}

impl FittedPlane {
    /// Fits a plane to pairs of a place and a value. `None` for fewer than three samples, or places
    /// on a line.
    pub(crate) fn fit(samples: impl Iterator<Item = ([f64; 2], f64)> + Clone) -> Option<Self> {
        let count = samples.clone().count() as f64;
        let sum = samples.clone().fold([0.0; 3], |s, ([x, y], v)| [s[0] + x, s[1] + y, s[2] + v]);
        let [x0, y0, mean] = sum.map(|s| s / count);
        // Sums of squares and products about the means.
        let (mut xx, mut xy, mut yy, mut xv, mut yv) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ([x, y], v) in samples {
            let (x, y, v) = (x - x0, y - y0, v - mean);
            xx += x * x;
            xy += x * y;
            yy += y * y;
            xv += x * v;
            yv += y * v;
        }
        let determinant = xx * yy - xy * xy;
        let is_solvable = determinant.is_finite() && determinant > 1e-9 * xx * yy;
        is_solvable.then(|| Self {
            centre: [x0, y0],
            offset: mean,
            slope: [(xv * yy - yv * xy) / determinant, (yv * xx - xv * xy) / determinant],
        })
    }

    /// Returns the value at a place.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> f64 {
        self.offset + self.slope[0] * (x - self.centre[0]) + self.slope[1] * (y - self.centre[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_found_again() {
        let places = [[0.0, 0.0], [4.0, 0.0], [1.0, 3.0], [5.0, 5.0]];
        let samples = places.iter().map(|&[x, y]| ([x, y], 2.0 + 0.5 * x - 0.25 * y));
        let plane = FittedPlane::fit(samples).unwrap();
        assert!((plane.at([7.0, -1.0]) - 5.75).abs() < 1e-12, "{plane:?}");
        assert_eq!(FittedPlane::fit([([0.0, 0.0], 1.0), ([1.0, 1.0], 2.0), ([2.0, 2.0], 3.0)].into_iter()), None);
        assert_eq!(FittedPlane::fit(std::iter::empty()), None);
    }
}
