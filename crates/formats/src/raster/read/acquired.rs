//! When an image was taken, by which satellite, and where the sun stood, from its metadata.

use chrono::NaiveDateTime;

use super::source::ImageSource;
use crate::stac::{SunPosition, satellite_name};

/// Where the time is found: the domain of GDAL, the key, and the form. GDAL's readers of the
/// providers' metadata (IMD, DIMAP, PVL and others) write the first. The second is the field IDATIM
/// of the NITF header, which converted files keep.
const PLACES: [(&str, &str, &str); 3] = [
    ("IMAGERY", "ACQUISITIONDATETIME", "%Y-%m-%d %H:%M:%S"),
    ("", "ACQUISITIONDATETIME", "%Y-%m-%d %H:%M:%S"),
    ("", "NITF_IDATIM", "%Y%m%d%H%M%S"),
];

/// Domain of DigitalGlobe's metadata.
const IMD: &str = "IMD";
/// Azimuth and elevation of the sun in it, of older and newer products.
const SUN: [[&str; 2]; 2] = [["IMAGE_1.meanSunAz", "IMAGE_1.meanSunEl"], ["IMAGE_1.sunAz", "IMAGE_1.sunEl"]];
/// Ends of the keys of both in DIMAP products, which GDAL puts into the same domain.
const SUN_DIMAP: [&str; 2] = ["Solar_Incidences.SUN_AZIMUTH", "Solar_Incidences.SUN_ELEVATION"];
/// Where the satellite is found: the domain of GDAL and the key. GDAL's readers of the providers'
/// metadata write the first; the others are the mission and the source of the NITF header.
const SATELLITES: [(&str, &str); 5] = [
    ("IMAGERY", "SATELLITEID"),
    (IMD, "IMAGE_1.satId"),
    ("", "SATELLITEID"),
    ("", "NITF_STDIDC_MISSION"),
    ("", "NITF_ISORCE"),
];

impl ImageSource {
    /// Returns when the image was taken, seconds of UTC since 1970, by its metadata or by its STAC
    /// item; `None` where they do not say.
    pub fn acquired_s(&self) -> Option<i64> {
        let own = PLACES.iter().find_map(|(domain, name, form)| parse(&self.value(domain, name)?, form));
        own.or_else(|| self.item()?.acquired_s)
    }

    /// Returns where the sun stood, by the image's metadata or by its STAC item; `None` where they
    /// do not say.
    pub fn sun(&self) -> Option<SunPosition> {
        let angle = |name| self.value(IMD, name)?.trim().parse::<f64>().ok().filter(|angle| angle.is_finite());
        let own = SUN.iter().find_map(|[azimuth, elevation]| {
            Some(SunPosition { azimuth_deg: angle(azimuth)?, elevation_deg: angle(elevation)? })
        });
        let dimap = || Some(SunPosition { azimuth_deg: self.dimap(0)?, elevation_deg: self.dimap(1)? });
        own.or_else(dimap).or_else(|| self.item()?.sun)
    }

    /// Returns the name of the satellite, by the image's metadata or by its STAC item; `None` where
    /// they do not say.
    pub fn satellite(&self) -> Option<String> {
        let own = SATELLITES.iter().find_map(|(domain, name)| satellite_name(&self.value(domain, name)?));
        own.or_else(|| self.item()?.satellite.clone())
    }

    /// Returns the first angle of the sun in the metadata of a DIMAP product.
    fn dimap(&self, which: usize) -> Option<f64> {
        let metadata = self.metadata(IMD);
        let text = metadata.iter().find(|(key, _)| key.ends_with(SUN_DIMAP[which])).map(|(_, text)| text)?;
        text.trim().parse().ok().filter(|angle: &f64| angle.is_finite())
    }

    fn value(&self, domain: &str, name: &str) -> Option<String> {
        self.metadata(domain).into_iter().find(|(key, _)| key == name).map(|(_, text)| text)
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

    #[test]
    fn satellite_and_sun_come_from_the_metadata_of_the_provider() {
        let folder = tempfile::tempdir().unwrap();
        let found = |metadata: &str| {
            let path = folder.path().join("a.vrt");
            let text = format!(
                "<VRTDataset rasterXSize=\"4\" rasterYSize=\"4\">{metadata}<VRTRasterBand dataType=\"Byte\" \
                 band=\"1\"/></VRTDataset>"
            );
            std::fs::write(&path, text).unwrap();
            let source = ImageSource::open(&path).unwrap();
            (source.satellite(), source.sun().map(|sun| (sun.azimuth_deg, sun.elevation_deg)))
        };
        let imd = |keys: [&str; 2]| {
            let [azimuth, elevation] = keys;
            format!(
                "<Metadata domain=\"IMD\"><MDI key=\"{azimuth}\">151.5</MDI><MDI key=\"{elevation}\">48</MDI></Metadata>\
                 <Metadata domain=\"IMAGERY\"><MDI key=\"SATELLITEID\">PHR1A</MDI></Metadata>"
            )
        };
        let expected = (Some("PHR1A".to_owned()), Some((151.5, 48.0)));
        assert_eq!(found(&imd(SUN[0])), expected);
        let dimap = SUN_DIMAP.map(|end| format!("Geometric_Data.Use_Area.Located_Geometric_Values_1.{end}"));
        assert_eq!(found(&imd([&dimap[0], &dimap[1]])), expected);
        assert_eq!(found("<Metadata><MDI key=\"NITF_ISORCE\"> </MDI></Metadata>"), (None, None));
    }
}
