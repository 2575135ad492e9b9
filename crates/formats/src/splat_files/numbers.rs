//! What the formats share: harmonics that may be missing, opacities of bytes.

use crate::splat_ply::SplatFile;

/// Returns a coefficient of the harmonics of a splat beyond the constant one, 0 where there is
/// none.
pub(super) fn coefficient(file: &SplatFile, splat: usize, channel: usize, number: usize) -> f32 {
    let known = file.harmonics.as_ref().and_then(|harmonics| harmonics.of(splat, channel).get(number));
    known.copied().unwrap_or(0.0)
}

/// Returns an opacity strictly between 0 and 1 for a byte.
pub(super) fn opacity_of(byte: u8) -> f32 {
    (f32::from(byte) / 255.0).clamp(f32::MIN_POSITIVE, 1.0 - f32::EPSILON)
}
