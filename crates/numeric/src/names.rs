//! The known name that a mistyped one was meant to be.
//!
//! Names are compared without regard to case by Levenshtein's distance: the number of letters to
//! insert, remove or replace.

/// Returns the known name that is most like `name`; `None` where none is.
///
/// ```
/// let known = ["fast", "balanced", "accurate"];
/// assert_eq!(numeric::nearest_name("acurate", known), Some("accurate"));
/// assert_eq!(numeric::nearest_name("slow", known), None);
/// ```
pub fn nearest_name<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = name.to_ascii_lowercase();
    // A name without its unit, or with more words, is a likely slip.
    let is_part = |other: &str| name.len() >= 3 && (other.starts_with(&name) || name.starts_with(other));
    let distance = |other: &str| {
        let other = other.to_ascii_lowercase();
        if is_part(&other) && other != name { 1 } else { edits(&name, &other) }
    };
    let best = known.into_iter().map(|other| (distance(other), other)).min()?;
    // A third of the letters, and two of a short name, may be wrong, but not all of them.
    (best.0 <= 2.max(name.len() / 3) && best.0 < name.len()).then_some(best.1)
}

/// Returns the number of letters to insert, remove or replace.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, c) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, d) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(c != *d);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::nearest_name;

    #[test]
    fn slips_have_their_name_and_strangers_none() {
        let known = ["dsm", "dtm", "ortho", "heightmap", "gsd_m", "simulate"];
        for (slip, meant) in [
            ("dms", Some("dsm")),
            ("DTM", Some("dtm")),
            ("hightmap", Some("heightmap")),
            ("gsd", Some("gsd_m")),
            ("simulat", Some("simulate")),
            ("xy", None),
            ("colour", None),
            ("", None),
        ] {
            assert_eq!(nearest_name(slip, known), meant, "{slip}");
        }
        assert_eq!(nearest_name("a", []), None);
    }
}
