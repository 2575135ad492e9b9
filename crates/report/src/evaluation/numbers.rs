//! Format of metrics: metres, shares in percent, counts.

/// Returns whether a metric counts cells.
pub(super) fn is_count(name: &str) -> bool {
    matches!(name, "n" | "reference_cells" | "outliers")
}

fn is_share(name: &str) -> bool {
    name == "valid_ratio" || name.starts_with("completeness_") || name.starts_with("pag_")
}

/// Returns the name with its unit.
pub(super) fn label(name: &str) -> String {
    let unit = match name {
        _ if is_count(name) => "",
        _ if is_share(name) => " %",
        _ => " m",
    };
    format!("{name}{unit}")
}

/// Formats the value in that unit, or as a dash if there is none.
pub(super) fn cell(name: &str, value: Option<f64>) -> String {
    match value {
        None => "-".into(),
        Some(count) if is_count(name) => format!("{count:.0}"),
        Some(share) if is_share(name) => format!("{:.2}", 100.0 * share),
        // A rounded zero has no sign.
        Some(metres) => format!("{metres:.3}").replace("-0.000", "0.000"),
    }
}

/// Formats a share in percent, or as a dash if there is none.
pub(super) fn percent(share: Option<f64>) -> String {
    share.map_or("-".into(), |share| format!("{:.1}", 100.0 * share))
}

/// Formats an integer in groups of three digits.
pub(super) fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_follow_the_name() {
        assert_eq!((label("mae"), cell("mae", Some(0.12345))), ("mae m".into(), "0.123".into()));
        assert_eq!((label("pag_1"), cell("pag_1", Some(0.5))), ("pag_1 %".into(), "50.00".into()));
        assert_eq!((label("outliers"), cell("outliers", Some(7.0))), ("outliers".into(), "7".into()));
        assert_eq!((cell("mae", None), cell("mean", Some(-0.0001))), ("-".into(), "0.000".into()));
        assert_eq!((grouped(0), grouped(262_144)), ("0".into(), "262\u{202f}144".into()));
    }
}
