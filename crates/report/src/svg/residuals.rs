//! Residuals of points in an image as a map: a vector at the place of each point.

use numeric::percentile;

use super::axis::Axis;
use super::chart::Chart;

/// Share of the height of the map that the longest vectors have.
const LONGEST: f64 = 0.12;
/// Percentile of the lengths that counts as the longest: outliers would shrink all others.
const LONG_PERCENTILE: f64 = 95.0;

/// A point of an image and its residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResidual {
    /// Place in the image: sample and line, pixels.
    pub at: [f64; 2],
    /// Residual along the sample and the line, pixels.
    pub residual_px: [f64; 2],
}

/// Returns a map of residuals in an image of `size` pixels, and how many times as long as the
/// residuals its vectors are, rounded to one digit. `None` without a residual.
pub fn residual_map(title: &str, size: (usize, usize), points: &[PointResidual]) -> Option<(Chart, f64)> {
    let mut lengths: Vec<f64> = points.iter().map(|point| point.residual_px[0].hypot(point.residual_px[1])).collect();
    lengths.retain(|length| length.is_finite());
    let long = percentile(&mut lengths, LONG_PERCENTILE).filter(|long| *long > 0.0)?;
    // The axes have one scale, and the image is in the middle.
    let (width, height) = (size.0.max(1) as f64, size.1.max(1) as f64);
    let shown_height = height.max(width / Chart::shape());
    let (beside, above) = (0.5 * (shown_height * Chart::shape() - width), 0.5 * (shown_height - height));
    let x = Axis::linear("sample, px", -beside, width + beside);
    let y = Axis::linear("line, px", -above, height + above).reversed();
    let magnification = one_digit(LONGEST * shown_height / long);
    let mut chart = Chart::new(title, x, y);
    chart.line("rule", [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height), (0.0, 0.0)].into_iter());
    for PointResidual { at, residual_px } in
        points.iter().filter(|point| point.residual_px.iter().all(|r| r.is_finite()))
    {
        let end = [0, 1].map(|axis| at[axis] + magnification * residual_px[axis]);
        chart.vector((at[0], at[1]), (end[0], end[1]));
    }
    Some((chart, magnification))
}

/// Returns the largest number of one digit and zeros that is not above a positive value.
fn one_digit(value: f64) -> f64 {
    let decade = 10f64.powf(value.log10().floor());
    decade * (value / decade).floor().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_begin_at_their_points_and_lines_grow_downwards() {
        let points = [
            PointResidual { at: [100.0, 50.0], residual_px: [0.3, 0.0] },
            PointResidual { at: [100.0, 150.0], residual_px: [0.0, 0.3] },
            PointResidual { at: [3.0, 3.0], residual_px: [f64::NAN, 0.0] },
        ];
        let (chart, magnification) = residual_map("Residuals", (200, 200), &points).unwrap();
        assert_eq!(magnification, 80.0);
        let svg = chart.inline();
        // The area of the marks is 256 units high for 200 lines: 24 pixels are 30.7 units.
        assert!(svg.contains("M301.0 80.0L331.7 80.0") && svg.contains("M301.0 208.0L301.0 238.7"), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(residual_map("none", (200, 200), &[]).is_none());
        assert!(residual_map("none", (200, 200), &[PointResidual { at: [1.0; 2], residual_px: [0.0; 2] }]).is_none());
    }

    #[test]
    fn magnifications_have_one_digit() {
        assert_eq!([0.034, 1.0, 99.9, 240.0].map(one_digit), [0.03, 1.0, 90.0, 200.0]);
    }
}
