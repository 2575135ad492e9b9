//! Colours of errors: blue where the surface is too low, red where it is too high, near white at
//! zero.
//!
//! Both arms darken evenly. So the sign is read by hue and the size by lightness, also by readers
//! who cannot tell red from green.

/// Colours at −1, −½, 0, ½ and 1 of the range.
const STOPS: [[f64; 3]; 5] =
    [[24.0, 62.0, 120.0], [109.0, 165.0, 212.0], [247.0, 246.0, 242.0], [236.0, 148.0, 104.0], [140.0, 20.0, 38.0]];
/// Colour of a cell that is void in the test.
pub const MISSING: [u8; 3] = [72, 72, 76];
/// Colour of a cell that is not evaluated: void in the reference, masked or skipped.
pub const OUTSIDE: [u8; 3] = [222, 222, 222];

/// Returns the colour of an error relative to the range, clamped to −1 … 1.
///
/// ```
/// let [red, _, blue] = report::diverging(0.5);
/// assert!(red > blue);
/// ```
pub fn diverging(relative: f64) -> [u8; 3] {
    let position = (relative.clamp(-1.0, 1.0) + 1.0) / 2.0 * (STOPS.len() - 1) as f64;
    let below = (position as usize).min(STOPS.len() - 2);
    let t = position - below as f64;
    std::array::from_fn(|i| (STOPS[below][i] + t * (STOPS[below + 1][i] - STOPS[below][i])).round() as u8)
}

/// Returns a colour for CSS.
pub(crate) fn css([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_is_the_lightest_and_the_ends_are_the_darkest() {
        let light = |relative: f64| diverging(relative).iter().map(|&c| u32::from(c)).sum::<u32>();
        for i in 0..20 {
            let (near, far) = (f64::from(i) / 20.0, f64::from(i + 1) / 20.0);
            assert!(light(near) >= light(far) && light(-near) >= light(-far), "at {far}");
        }
        assert_eq!(diverging(9.0), diverging(1.0));
        assert_eq!(diverging(f64::NEG_INFINITY), diverging(-1.0));
        assert!(diverging(0.5)[0] > diverging(0.5)[2] && diverging(-0.5)[0] < diverging(-0.5)[2]);
        assert_eq!(css([255, 0, 10]), "#ff000a");
    }
}
