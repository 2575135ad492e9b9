//! When an image was taken, from its metadata.

use chrono::NaiveDateTime;

use super::source::ImageSource;

/// Where the time is found: the domain of GDAL, the key, and the form. GDAL's readers of the
/// providers' metadata (IMD, DIMAP, PVL and others) write the first. The second is the field IDATIM
/// of the NITF header, which converted files keep.
const PLACES: [(&str, &str, &str); 3] = [
    ("IMAGERY", "ACQUISITIONDATETIME", "%Y-%m-%d %H:%M:%S"),
    ("", "ACQUISITIONDATETIME", "%Y-%m-%d %H:%M:%S"),
    ("", "NITF_IDATIM", "%Y%m%d%H%M%S"),
];

impl ImageSource {
    /// Returns when the image was taken, seconds of UTC since 1970; `None` where its metadata do
    /// not say.
    pub fn acquired_s(&self) -> Option<i64> {
        PLACES.iter().find_map(|(domain, name, form)| {
            let (_, text) = self.metadata(domain).into_iter().find(|(key, _)| key == name)?;
            parse(&text, form)
        })
    }
}

fn parse(text: &str, form: &str) -> Option<i64> {
    NaiveDateTime::parse_from_str(text.trim(), form).ok().map(|time| time.and_utc().timestamp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_give_the_same_second() {
        assert_eq!(parse("2014-10-05 16:01:49", PLACES[0].2), Some(1_412_524_909));
        assert_eq!(parse("20141005160149", PLACES[2].2), Some(1_412_524_909));
        assert_eq!(parse("2014-10-05", PLACES[0].2), None, "the time of the day is missing");
        assert_eq!(parse("--", PLACES[2].2), None);
    }
}
