//! EPSG codes from the names of reference systems in city models.
//!
//! These names are known: OGC's URLs and URNs (`http://www.opengis.net/def/crs/EPSG/0/7415`,
//! `urn:ogc:def:crs:EPSG::25832`, compound `urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837` and
//! `…/crs-compound?1=…&2=…`), `EPSG:25832`, and the names of the German surveys
//! (`urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH`). Any other name is kept without a code.

use city::CrsReference;
use crs::compound_epsg;

/// German vertical systems: their names by the working group of the surveys (AdV), and their EPSG
/// codes.
const ADV_HEIGHTS: [(&str, u32); 4] =
    [("DE_DHHN2016_NH", 7837), ("DE_DHHN92_NH", 5783), ("DE_DHHN85_NOH", 5784), ("DE_DHHN12_NOH", 7699)];

/// Returns the reference with the name in a file.
pub(super) fn crs_reference(name: &str) -> CrsReference {
    let name = name.trim();
    let (epsg, vertical_epsg) = adv_codes(name).unwrap_or_else(|| ogc_codes(name));
    CrsReference { name: (!name.is_empty()).then(|| name.chars().take(200).collect()), epsg, vertical_epsg }
}

/// Returns the horizontal and vertical codes of a German name: UTM or Gauss-Krüger, and a height
/// system.
fn adv_codes(name: &str) -> Option<(Option<u32>, Option<u32>)> {
    let rest = strip_prefix_ignoring_case(name, "urn:adv:crs:")?;
    let (plane, height) = rest.split_once('*').unwrap_or((rest, ""));
    let zone = |prefix: &str| plane.strip_prefix(prefix).and_then(|z| z.parse::<u32>().ok());
    let horizontal = match (zone("ETRS89_UTM"), zone("DE_DHDN_3GK")) {
        (Some(zone @ 28..=38), _) => Some(25800 + zone),
        // The first digit after `3GK` is the strip. A second digit may name the realisation of a
        // survey.
        (_, Some(strip)) => leading_digit(strip).filter(|s| (2..=5).contains(s)).map(|s| 31464 + s),
        _ => None,
    };
    // A geoid model may follow the height system.
    let height = height.split('*').next().unwrap_or_default();
    let vertical = ADV_HEIGHTS.iter().find(|(known, _)| *known == height).map(|&(_, code)| code);
    Some((horizontal, vertical))
}

fn leading_digit(number: u32) -> Option<u32> {
    number.to_string().chars().next()?.to_digit(10)
}

/// Returns the first and the second EPSG code of an OGC name.
fn ogc_codes(name: &str) -> (Option<u32>, Option<u32>) {
    let mut codes = name.split([',', '&', '+']).filter_map(epsg_code);
    let first = codes.next();
    (first, codes.next())
}

/// Returns the code in a part of a name: the number after `EPSG`, its separators and its version.
fn epsg_code(part: &str) -> Option<u32> {
    let lower = part.to_ascii_lowercase();
    let after = match lower.rfind("epsg") {
        Some(at) => &lower[at + 4..],
        None if !lower.is_empty() && lower.bytes().all(|b| b.is_ascii_digit()) => &lower[..],
        None => return None,
    };
    let last = after.rsplit([':', '/', '#']).find(|piece| !piece.is_empty())?;
    last.trim().parse().ok().filter(|code| (1..1_000_000).contains(code))
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}

/// Returns OGC's URL of a reference, or `None` without an EPSG code. CityJSON 2.0 knows one code
/// only, so a horizontal and a vertical one are written as the compound CRS of both where EPSG has
/// one. Otherwise this is the horizontal one alone, and [`lone_vertical_url`] is the other.
pub(super) fn ogc_url(crs: &CrsReference) -> Option<String> {
    let url = |code: u32| format!("https://www.opengis.net/def/crs/EPSG/0/{code}");
    match (crs.epsg?, crs.vertical_epsg) {
        (epsg, None) => Some(url(epsg)),
        (epsg, Some(vertical)) => Some(url(compound_epsg(epsg, vertical).unwrap_or(epsg))),
    }
}

/// Returns OGC's URL of a vertical system that is not part of [`ogc_url`].
pub(super) fn lone_vertical_url(crs: &CrsReference) -> Option<String> {
    let (horizontal, vertical) = (crs.epsg?, crs.vertical_epsg?);
    let is_lone = compound_epsg(horizontal, vertical).is_none();
    is_lone.then(|| format!("https://www.opengis.net/def/crs/EPSG/0/{vertical}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_give_codes() {
        for (name, epsg, vertical) in [
            ("urn:ogc:def:crs:EPSG::7415", Some(7415), None),
            ("urn:ogc:def:crs:EPSG:6.12:25832", Some(25832), None),
            ("https://www.opengis.net/def/crs/EPSG/0/7415", Some(7415), None),
            ("http://www.opengis.net/gml/srs/epsg.xml#28992", Some(28992), None),
            ("EPSG:25832", Some(25832), None),
            ("28992", Some(28992), None),
            ("urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837", Some(25832), Some(7837)),
            ("urn:ogc:def:crs,crs:EPSG:6.12:25833,crs:EPSG:6.12:5783", Some(25833), Some(5783)),
            ("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", Some(25832), Some(7837)),
            ("urn:adv:crs:ETRS89_UTM33*DE_DHHN92_NH", Some(25833), Some(5783)),
            ("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH*GCG2016", Some(25832), Some(7837)),
            ("urn:adv:crs:ETRS89_UTM32", Some(25832), None),
            ("urn:adv:crs:DE_DHDN_3GK3*DE_DHHN12_NOH", Some(31467), Some(7699)),
            ("local", None, None),
            ("urn:ogc:def:crs:OGC:1.3:CRS84", None, None),
            ("EPSG:99999999999999999999", None, None),
        ] {
            let crs = crs_reference(name);
            assert_eq!((crs.epsg, crs.vertical_epsg), (epsg, vertical), "{name}");
        }
        assert!(crs_reference("  ").is_missing());
    }

    #[test]
    fn urls_lead_back() {
        for (crs, code) in [
            (CrsReference::from_epsg(7415, None), 7415),
            (CrsReference::from_epsg(28992, Some(5709)), 7415),
            (CrsReference::from_epsg(25832, Some(5783)), 5555),
            (CrsReference::from_epsg(25832, None), 25832),
        ] {
            let url = ogc_url(&crs).unwrap();
            // The pattern of CityJSON 2.0's schema.
            assert!(url.starts_with("https://www.opengis.net/def/crs/"), "{url}");
            assert_eq!(crs_reference(&url).epsg, Some(code));
        }
        assert!(ogc_url(&CrsReference::default()).is_none());
    }
}
