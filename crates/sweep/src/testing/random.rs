//! Repeatable numbers for tests.

/// Numbers below the one asked for, always the same ones (a linear congruential generator; Numerical Recipes, 7.1).
pub(crate) fn random() -> impl FnMut(u32) -> u32 {
    let mut state = 12345u32;
    move |n| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    }
}
