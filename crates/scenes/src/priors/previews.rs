//! Which views get preview pictures.

/// Number of views in the page of the report.
pub(super) const IN_PAGE: usize = 6;

/// Returns whether a view is one of `wanted` views that are spread over all `count` views.
pub(super) fn is_spread(view: usize, count: usize, wanted: usize) -> bool {
    let wanted = wanted.min(count);
    wanted > 0 && (view == 0 || view * wanted / count != (view - 1) * wanted / count)
}

#[cfg(test)]
mod tests {
    use super::is_spread;

    #[test]
    fn pictures_are_spread_over_the_views() {
        for (count, wanted, expected) in [(10, 3, 3), (5, 12, 5), (100, 6, 6), (1, 1, 1), (7, 0, 0)] {
            let chosen = (0..count).filter(|&view| is_spread(view, count, wanted)).count();
            assert_eq!(chosen, expected, "{wanted} of {count}");
        }
        assert!(is_spread(0, 10, 3));
    }
}
