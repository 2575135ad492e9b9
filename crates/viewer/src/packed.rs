//! Splats in the bytes that the page draws.
//!
//! A splat has 32 bytes, little-endian: its position as three f32, metres from the origin of its
//! file; halves (IEEE 754 binary16) of red, green, blue, opacity and the natural logarithms of the
//! three scales, and 16 bits of no meaning; its rotation in 32 bits. These are the number of the
//! largest component of the quaternion (w, x, y, z) in the upper two, and the three others, which
//! lie within ±1/√2, with 10 bits each. An axis is off by 0.2° at most.
//!
//! The harmonics of a splat are halves: red, green and blue of each coefficient in turn, with zeros
//! up to whole texels of 16 bytes.
//!
//! Labels are the numbers of the objects of all splats (u32), and after them those of their classes
//! (u8).

use formats::splat_ply::SplatFile;

/// Bytes of a texel.
const TEXEL: usize = 16;

/// Returns the splats of a file.
pub(super) fn splats(file: &SplatFile) -> Vec<u8> {
    let mut out = Vec::with_capacity(32 * file.splats.len());
    for splat in &file.splats {
        splat.position.iter().for_each(|c| out.extend_from_slice(&c.to_le_bytes()));
        let logarithms = splat.scale_m.map(f32::ln);
        let halves = splat.colour.into_iter().chain([splat.opacity]).chain(logarithms).chain([0.0]);
        halves.for_each(|value| out.extend_from_slice(&half(value).to_le_bytes()));
        out.extend_from_slice(&rotation(splat.rotation).to_le_bytes());
    }
    out
}

/// Returns the harmonics of a file; nothing where it has none.
pub(super) fn harmonics(file: &SplatFile) -> Vec<u8> {
    let Some(harmonics) = &file.harmonics else { return Vec::new() };
    let mut out = Vec::new();
    for splat in 0..file.splats.len() {
        let channels = [0, 1, 2].map(|channel| harmonics.of(splat, channel));
        for coefficient in 0..channels[0].len() {
            channels.iter().for_each(|of| out.extend_from_slice(&half(of[coefficient]).to_le_bytes()));
        }
        out.resize(out.len().next_multiple_of(TEXEL), 0);
    }
    out
}

/// Returns the labels of a file; nothing where it has none.
pub(super) fn labels(file: &SplatFile) -> Vec<u8> {
    let Some(labels) = &file.labels else { return Vec::new() };
    let objects = labels.of.iter().flat_map(|label| label.object.to_le_bytes());
    objects.chain(labels.of.iter().map(|label| label.class)).collect()
}

/// Returns the nearest half. Values below 2⁻¹⁴ become 0, those above 65,504 become that.
fn half(value: f32) -> u16 {
    let bits = value.to_bits();
    let (sign, magnitude) = ((bits >> 16) as u16 & 0x8000, bits & 0x7fff_ffff);
    match magnitude {
        0..0x3880_0000 => sign,
        0x477f_e000.. => sign | 0x7bff,
        // Halfway between two halves, the even one is taken.
        _ => sign | ((magnitude + 0xfff + (magnitude >> 13 & 1) - 0x3800_0000) >> 13) as u16,
    }
}

/// Returns a unit quaternion in 32 bits.
fn rotation(q: [f32; 4]) -> u32 {
    let largest = (1..4).fold(0, |best, i| if q[i].abs() > q[best].abs() { i } else { best });
    // The same rotation with a largest component above 0.
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 };
    let rest = (0..4).filter(|i| *i != largest);
    rest.fold(largest as u32, |word, i| {
        let share = (sign * q[i] * std::f32::consts::FRAC_1_SQRT_2 + 0.5).clamp(0.0, 1.0);
        word << 10 | (1023.0 * share).round() as u32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A half as f64, from its definition.
    fn value(half: u16) -> f64 {
        let sign = if half & 0x8000 == 0 { 1.0 } else { -1.0 };
        match half >> 10 & 31 {
            0 => sign * f64::from(half & 1023) * 2f64.powi(-24),
            exponent => sign * 2f64.powi(i32::from(exponent) - 15) * (1.0 + f64::from(half & 1023) / 1024.0),
        }
    }

    #[test]
    fn halves_are_the_nearest() {
        for number in [0.0f32, 1.0, -1.0, 0.1, 0.99, -9.2103, 3.75, 65_504.0, 1e-3, 6.2e-5] {
            let found = value(half(number));
            assert!((found - f64::from(number)).abs() <= f64::from(number.abs()) * 2f64.powi(-11), "{number}: {found}");
        }
        assert_eq!((value(half(1e9)), value(half(-1e9)), value(half(1e-9))), (65_504.0, -65_504.0, 0.0));
        // All halves that are not too small come back.
        for bits in (0x0400..0x7c00).step_by(7) {
            assert_eq!(half(value(bits) as f32), bits);
        }
    }

    #[test]
    fn rotations_come_back() {
        for seed in 0..200 {
            let raw: [f64; 4] = std::array::from_fn(|i| ((seed * 4 + i) as f64 * 12.9898).sin());
            let length = raw.iter().map(|c| c * c).sum::<f64>().sqrt();
            let q = raw.map(|c| c / length);
            let word = rotation(q.map(|c| c as f32));
            let largest = (word >> 30) as usize;
            let three =
                [20, 10, 0].map(|shift| (f64::from(word >> shift & 1023) / 1023.0 - 0.5) * std::f64::consts::SQRT_2);
            let rest = (1.0 - three.iter().map(|c| c * c).sum::<f64>()).sqrt();
            let back: [f64; 4] = std::array::from_fn(|i| match i {
                _ if i == largest => rest,
                _ => three[if i < largest { i } else { i - 1 }],
            });
            let cosine = (0..4).map(|i| q[i] * back[i]).sum::<f64>().abs().min(1.0);
            assert!((2.0 * cosine.acos()).to_degrees() < 0.25, "{q:?} {back:?}");
        }
    }
}
