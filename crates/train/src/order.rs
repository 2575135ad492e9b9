//! Surfels in the order of a curve that fills space, so that neighbours lie together in memory.

use crate::surfel::Surfel;

/// Bits of a coordinate in the code of a position.
const BITS: u32 = 16;

/// Returns the numbers of the surfels along a Morton curve through their bounds.
///
/// Surfels in this order are drawn faster, because what lies together in the image does so in
/// memory, too.
pub fn spatial_order(surfels: &[Surfel]) -> Vec<u32> {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for surfel in surfels {
        for i in 0..3 {
            low[i] = low[i].min(surfel.position[i]);
            high[i] = high[i].max(surfel.position[i]);
        }
    }
    let side = (0..3).map(|i| high[i] - low[i]).fold(f32::MIN_POSITIVE, f32::max);
    let code = |surfel: &Surfel| {
        let cell = |i: usize| ((surfel.position[i] - low[i]) / side * ((1 << BITS) - 1) as f32) as u64;
        spread(cell(0)) | spread(cell(1)) << 1 | spread(cell(2)) << 2
    };
    let mut codes: Vec<(u64, u32)> = surfels.iter().map(code).zip(0..).collect();
    codes.sort_unstable();
    codes.into_iter().map(|(_, number)| number).collect()
}

/// Puts two zeros between the bits of a number below 2¹⁶.
fn spread(number: u64) -> u64 {
    (0..BITS).fold(0, |code, bit| code | (number >> bit & 1) << (3 * bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_follow_each_other() {
        let at = |x: f32, y: f32| Surfel { position: [x, y, 0.0], ..Surfel::default() };
        let surfels = [at(0.0, 0.0), at(9.0, 9.0), at(0.1, 0.1), at(9.1, 8.9), at(0.0, 9.0), at(0.1, 8.9)];
        let order = spatial_order(&surfels);
        let place = |number: u32| order.iter().position(|&n| n == number).unwrap();
        for [a, b] in [[0, 2], [1, 3], [4, 5]] {
            assert_eq!(place(a).abs_diff(place(b)), 1, "{order:?}");
        }
        assert_eq!(spatial_order(&[]), [0u32; 0]);
    }
}
