//! Numbers in sentences and on pages: counts with their nouns, true minus signs, no negative zero.

/// Returns a count and its noun, in the plural unless the count is 1.
///
/// ```
/// assert_eq!(report::counted(1, "view"), "1 view");
/// assert_eq!(report::counted(0, "view"), "0 views");
/// ```
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Returns a length or coordinate in metres without the rounding noise of its computation: to a
/// micrometre, without trailing zeros.
///
/// ```
/// assert_eq!(report::plain_number(693_800.1 + 150.5), "693950.6");
/// assert_eq!([163.25, -0.0, 40.0].map(report::plain_number), ["163.25", "0", "40"]);
/// ```
pub fn plain_number(value: f64) -> String {
    let rounded = format!("{value:.6}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// Returns a count in groups of three digits, with narrow spaces that do not break.
///
/// ```
/// assert_eq!(report::grouped(1_234_567), "1\u{202f}234\u{202f}567");
/// ```
pub fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len());
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// Returns a quantity with the digits that mean something to a reader: hundredths up to a hundred,
/// tenths up to ten thousand and in coordinates, three digits below 1, seven decimals of a degree
/// (a centimetre on the ground). Areas and volumes above a hundred are whole.
///
/// ```
/// let lengths = [693_950.2537, 163.2549, 12.3456, 0.123_456, 0.0, -0.5].map(|v| report::sensible(v, "m"));
/// assert_eq!(lengths, ["693950.3", "163.3", "12.35", "0.123", "0", "-0.5"]);
/// assert_eq!(report::sensible(1234.56, "m³"), "1235");
/// assert_eq!(report::sensible(5.398_765_43, "°"), "5.3987654");
/// ```
pub fn sensible(value: f64, unit: &str) -> String {
    let size = value.abs();
    let whole = matches!(unit, "m²" | "m³") && size >= 100.0;
    let decimals = match () {
        () if !value.is_finite() => return "–".to_owned(),
        () if unit == "°" => 7,
        () if whole => 0,
        () if size >= 100.0 => 1,
        () if size >= 1.0 => 2,
        () if size > 0.0 && size < 1e-4 => return format!("{value:.2e}"),
        () if size > 0.0 => (2.0 - size.log10().floor()) as usize,
        () => return "0".to_owned(),
    };
    let text = format!("{value:.decimals$}");
    let short = if decimals > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { text.as_str() };
    short.to_owned()
}

/// Units at the end of names of fields, and how they are written.
const UNITS: [(&str, &str); 12] = [
    ("m", "m"),
    ("m2", "m²"),
    ("m3", "m³"),
    ("km", "km"),
    ("px", "px"),
    ("deg", "°"),
    ("db", "dB"),
    ("s", "s"),
    ("seconds", "s"),
    ("mb", "MB"),
    ("gib", "GiB"),
    ("percent", "%"),
];
/// Abbreviations in names of fields.
const ABBREVIATIONS: [&str; 19] = [
    "psnr", "ssim", "crs", "epsg", "dsm", "dtm", "rpc", "gsd", "glb", "laz", "copc", "ply", "rms", "rmse", "mae",
    "nmad", "bic", "iou", "2dgs",
];

/// Returns the unit that the name of a field ends with.
pub(crate) fn unit_of(name: &str) -> Option<&'static str> {
    let (_, last) = name.rsplit_once('_')?;
    UNITS.iter().find(|(text, _)| *text == last).map(|(_, unit)| *unit)
}

/// Returns the name of a field of a report in words, with its unit.
pub(crate) fn field_words(name: &str) -> String {
    let unit = unit_of(name);
    let words = unit.and_then(|_| name.rsplit_once('_')).map_or(name, |(words, _)| words);
    let word = |word: &str| if ABBREVIATIONS.contains(&word) { word.to_uppercase() } else { word.to_owned() };
    let words = words.split('_').map(word).collect::<Vec<_>>().join(" ");
    unit.map_or(words.clone(), |unit| format!("{words}, {unit}"))
}

/// Sets the numbers of a text as a page shows them: a hyphen before a number becomes a minus sign,
/// a zero has no sign, and a lone hyphen becomes a dash. Hyphens inside words and names stay.
pub(crate) fn typeset(text: &str) -> String {
    if text == "-" {
        return "–".to_owned();
    }
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    for (at, character) in text.char_indices() {
        let number = &text[at + character.len_utf8()..];
        let is_sign = matches!(character, '-' | '+') && number.starts_with(|c: char| c.is_ascii_digit());
        if !is_sign || before.is_alphanumeric() {
            out.push(character);
        } else if !is_zero(number) {
            out.push(if character == '-' { '\u{2212}' } else { '+' });
        }
        before = character;
    }
    out
}

/// Whether the number at the beginning of a text is zero.
fn is_zero(text: &str) -> bool {
    let digits = text.bytes().take_while(|byte| byte.is_ascii_digit() || *byte == b'.');
    !text.is_empty() && digits.filter(u8::is_ascii_digit).all(|digit| digit == b'0')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_words_with_units() {
        let fields = ["psnr_before_db", "cell_m", "cells_below_ground", "m", "least_building_m2", "crs", "seconds"];
        let words = ["PSNR before, dB", "cell, m", "cells below ground", "m", "least building, m²", "CRS", "seconds"];
        assert_eq!(fields.map(field_words), words);
    }

    #[test]
    fn numbers_have_true_signs_and_names_keep_their_hyphens() {
        assert_eq!(typeset("dx -0.41 m, dy +6.39 m"), "dx \u{2212}0.41 m, dy +6.39 m");
        assert_eq!(typeset("-0.00 m (-0.001)"), "0.00 m (\u{2212}0.001)");
        assert_eq!(typeset("+0.00"), "0.00");
        assert_eq!(typeset("nuth-kaab, view-2.tif, 2-3"), "nuth-kaab, view-2.tif, 2-3");
        assert_eq!((typeset("-"), typeset("- 3")), ("–".to_owned(), "- 3".to_owned()));
    }
}
