//! Cuts of a length whose parts are small at its ends and grow inwards.
//!
//! A Gaussian reaches beyond its part by a share of the part's size. Where nothing may hang over an
//! end, the part there is as small as the end asks for, and each further one is twice as large: the
//! sum of what all of them leave beyond the end falls below 0.05 within the size of the first.

/// Size of a part in sizes of the one before it.
const GROWTH: f64 = 2.0;
/// A rest of so many sizes of the next part is not cut again.
const REST: f64 = 1.5;

/// Returns the bounds of the parts of a length, from 0 to the length. The parts at the ends are at
/// most about as large as `ends`, no part is larger than `most`.
pub(super) fn graded(length: f64, ends: [f64; 2], most: f64) -> Vec<f64> {
    let mut sizes = ends.map(|size| size.min(most));
    let mut done = [0.0, length];
    let mut bounds = vec![0.0, length];
    while done[1] - done[0] > REST * sizes[0].min(sizes[1]) {
        let end = usize::from(sizes[1] < sizes[0]);
        done[end] += if end == 0 { sizes[0] } else { -sizes[1] };
        bounds.push(done[end]);
        sizes[end] = (GROWTH * sizes[end]).min(most);
    }
    bounds.sort_by(f64::total_cmp);
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn parts_grow_inwards() {
        assert_eq!(graded(1.0, [f64::INFINITY; 2], 16.0), [0.0, 1.0]);
        assert_eq!(graded(8.0, [0.5, f64::INFINITY], 16.0), [0.0, 0.5, 1.5, 3.5, 8.0]);
        assert_eq!(graded(4.0, [0.5, 0.5], 16.0), [0.0, 0.5, 1.5, 2.5, 3.5, 4.0]);
        assert_eq!(graded(0.1, [0.125, 0.125], 16.0), [0.0, 0.1]);
    }

    proptest! {
        #[test]
        fn parts_cover_the_length(length in 0.01..80.0f64, a in 0.1..40.0f64, b in 0.1..40.0f64) {
            let bounds = graded(length, [a, b], 16.0);
            prop_assert_eq!((bounds[0], bounds[bounds.len() - 1]), (0.0, length));
            let sizes: Vec<f64> = bounds.windows(2).map(|pair| pair[1] - pair[0]).collect();
            prop_assert!(sizes.iter().all(|s| *s > 0.0 && *s <= REST * 16.0 + 1e-9));
            prop_assert!(sizes[0] <= REST * a + 1e-9 && sizes[sizes.len() - 1] <= REST * b + 1e-9);
        }
    }
}
