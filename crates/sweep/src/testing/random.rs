//! Repeatable numbers for tests.

/// Returns a generator of numbers below its argument, always the same ones: the linear congruential
/// generator of Numerical Recipes, 7.1.
pub(crate) fn random() -> impl FnMut(u32) -> u32 {
    let mut state = 12345u32;
    move |n| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    }
}
