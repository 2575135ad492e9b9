//! The identity of a coordinate reference system: a horizontal EPSG code and a vertical datum.
//!
//! The automatic choice of the horizontal code is [`geodesy::utm_epsg`].

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use geodesy::utm_epsg;

use crate::error::CrsError;
use crate::proj_handle;

/// The surface that heights are measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum VerticalDatum {
    /// The WGS 84 ellipsoid, which all computations use.
    #[default]
    Ellipsoid,
    /// The EGM96 geoid (EPSG:5773).
    Egm96,
    /// The EGM2008 geoid (EPSG:3855).
    Egm2008,
    /// Another vertical CRS by its EPSG code.
    Epsg(u32),
}

impl VerticalDatum {
    /// Returns the EPSG code of the vertical CRS; `None` for ellipsoidal heights, which have no
    /// vertical CRS.
    pub fn epsg(&self) -> Option<u32> {
        match *self {
            Self::Ellipsoid => None,
            Self::Egm96 => Some(5773),
            Self::Egm2008 => Some(3855),
            Self::Epsg(code) => Some(code),
        }
    }

    /// Returns how many metres a unit of the vertical CRS has: 1 for most, 0.3048 for feet.
    ///
    /// ```
    /// use crs::VerticalDatum;
    ///
    /// assert_eq!(VerticalDatum::Egm96.metres_per_unit()?, 1.0);
    /// let navd88_in_us_feet = VerticalDatum::Epsg(6360);
    /// assert!((navd88_in_us_feet.metres_per_unit()? - 1200.0 / 3937.0).abs() < 1e-12);
    /// # Ok::<(), crs::CrsError>(())
    /// ```
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] for a code that PROJ does not know.
    pub fn metres_per_unit(&self) -> Result<f64, CrsError> {
        match *self {
            Self::Ellipsoid | Self::Egm96 | Self::Egm2008 => Ok(1.0),
            Self::Epsg(code) => {
                proj_handle::metres_per_vertical_unit(code).map_err(|reason| unknown(&format!("EPSG:{code}"), reason))
            }
        }
    }

    /// Returns the datum of the vertical CRS with this EPSG code.
    pub fn from_epsg(code: u32) -> Self {
        match code {
            5773 => Self::Egm96,
            3855 => Self::Egm2008,
            other => Self::Epsg(other),
        }
    }
}

impl fmt::Display for VerticalDatum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ellipsoid => f.write_str("ellipsoid"),
            Self::Egm96 => f.write_str("egm96"),
            Self::Egm2008 => f.write_str("egm2008"),
            Self::Epsg(code) => write!(f, "EPSG:{code}"),
        }
    }
}

impl FromStr for VerticalDatum {
    type Err = CrsError;

    /// Reads `ellipsoid`, `egm96`, `egm2008`, `EPSG:5773` or `5773`, in any letter case.
    fn from_str(text: &str) -> Result<Self, CrsError> {
        match text.trim().to_ascii_lowercase().as_str() {
            "ellipsoid" | "ellipsoidal" | "wgs84" => Ok(Self::Ellipsoid),
            "egm96" => Ok(Self::Egm96),
            "egm2008" | "egm08" => Ok(Self::Egm2008),
            other => epsg_code(other)
                .map(Self::from_epsg)
                .ok_or_else(|| CrsError::UnknownVerticalDatum { text: text.to_owned() }),
        }
    }
}

impl From<VerticalDatum> for String {
    fn from(datum: VerticalDatum) -> Self {
        datum.to_string()
    }
}

impl TryFrom<String> for VerticalDatum {
    type Error = CrsError;

    fn try_from(text: String) -> Result<Self, CrsError> {
        text.parse()
    }
}

/// A horizontal CRS and a vertical datum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Crs {
    /// EPSG code of the projected or geographic horizontal CRS.
    pub horizontal: u32,
    /// Datum of the heights.
    pub vertical: VerticalDatum,
}

impl Crs {
    /// Makes a CRS with heights above the ellipsoid.
    pub const fn ellipsoidal(horizontal: u32) -> Self {
        Self { horizontal, vertical: VerticalDatum::Ellipsoid }
    }

    /// Returns the WKT2:2019 of a compound CRS, or for ellipsoidal heights of the horizontal CRS
    /// with a height axis.
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] when PROJ does not know a code.
    pub fn wkt(&self) -> Result<String, CrsError> {
        proj_handle::wkt(&self.to_string(), self.vertical == VerticalDatum::Ellipsoid)
            .map_err(|reason| unknown(self, reason))
    }

    /// Returns the WKT1 of a compound CRS, as LAS 1.4 asks for it. Ellipsoidal heights are the
    /// vertical part `Ellipsoid (metre)`, which PROJ reads back as a three-dimensional CRS.
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] when PROJ does not know a code.
    pub fn wkt1(&self) -> Result<String, CrsError> {
        proj_handle::wkt1(&self.to_string(), self.vertical == VerticalDatum::Ellipsoid)
            .map_err(|reason| unknown(self, reason))
    }

    /// Returns the name of the horizontal part for PROJ and GDAL, such as `EPSG:32617`.
    pub fn horizontal_definition(&self) -> String {
        format!("EPSG:{}", self.horizontal)
    }
}

impl fmt::Display for Crs {
    /// Writes `EPSG:32617` for ellipsoidal heights, else the compound `EPSG:32617+5773`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.vertical.epsg() {
            None => write!(f, "EPSG:{}", self.horizontal),
            Some(vertical) => write!(f, "EPSG:{}+{vertical}", self.horizontal),
        }
    }
}

/// The EPSG codes of a definition from a file (WKT, `EPSG:n`, PROJJSON).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrsIdentity {
    /// Name in the definition.
    pub name: String,
    /// EPSG code of the horizontal part, if it has one or PROJ recognises it with at least 90 %
    /// confidence.
    pub horizontal: Option<u32>,
    /// Vertical datum; `None` when the definition has none.
    pub vertical: Option<VerticalDatum>,
}

impl CrsIdentity {
    /// Finds the codes of a definition.
    ///
    /// ```
    /// use crs::{Crs, CrsIdentity, VerticalDatum};
    ///
    /// let crs = Crs { horizontal: 32617, vertical: VerticalDatum::Egm96 };
    /// let identity = CrsIdentity::of(&crs.wkt()?)?;
    /// assert_eq!(identity.horizontal, Some(32617));
    /// assert_eq!(identity.vertical, Some(VerticalDatum::Egm96));
    /// # Ok::<(), crs::CrsError>(())
    /// ```
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] when PROJ cannot read the definition as a CRS.
    pub fn of(definition: &str) -> Result<Self, CrsError> {
        let codes = proj_handle::codes(definition).map_err(|reason| unknown(&"the definition in the file", reason))?;
        let ellipsoidal = codes.three_dimensional.then_some(VerticalDatum::Ellipsoid);
        let vertical = codes.vertical.map(VerticalDatum::from_epsg).or(ellipsoidal);
        Ok(Self { name: codes.name, horizontal: codes.horizontal, vertical })
    }
}

/// Returns the WKT2:2019 of the horizontal part of any CRS that PROJ reads.
///
/// # Errors
/// [`CrsError::NoTransformation`] when PROJ cannot read the definition as a CRS.
pub fn horizontal_wkt(definition: &str) -> Result<String, CrsError> {
    proj_handle::horizontal_wkt(definition).map_err(|reason| unknown(&"the definition", reason))
}

/// Returns the WKT2:2019 of a CRS with heights, made of the horizontal part of any CRS that PROJ
/// reads and a vertical datum.
///
/// ```
/// use crs::{CrsIdentity, VerticalDatum, compound_wkt};
///
/// let map = "+proj=tmerc +lat_0=43.5 +lon_0=5.4 +datum=WGS84 +units=m +type=crs";
/// let identity = CrsIdentity::of(&compound_wkt(map, VerticalDatum::Egm96)?)?;
/// assert_eq!((identity.horizontal, identity.vertical), (None, Some(VerticalDatum::Egm96)));
/// # Ok::<(), crs::CrsError>(())
/// ```
///
/// # Errors
/// [`CrsError::NoTransformation`] when PROJ does not know one of the two, or they do not fit.
pub fn compound_wkt(horizontal: &str, vertical: VerticalDatum) -> Result<String, CrsError> {
    let made = match vertical.epsg() {
        None => proj_handle::horizontal_wkt(horizontal).and_then(|wkt| proj_handle::wkt(&wkt, true)),
        Some(code) => proj_handle::compound_wkt(horizontal, &format!("EPSG:{code}")),
    };
    made.map_err(|reason| unknown(&format!("the definition with heights above {vertical}"), reason))
}

fn unknown(what: &dyn fmt::Display, reason: String) -> CrsError {
    CrsError::NoTransformation { source_crs: "EPSG:4979".to_owned(), target_crs: what.to_string(), reason }
}

/// A CRS as the user requests it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CrsRequest {
    /// The UTM or polar zone of the scene (`auto` or `utm`).
    #[default]
    Auto,
    /// A code, and optionally a vertical datum (`EPSG:32617+5773`).
    Epsg {
        /// EPSG code of the horizontal CRS.
        horizontal: u32,
        /// Vertical datum, if named.
        vertical: Option<VerticalDatum>,
    },
}

impl CrsRequest {
    /// Returns the EPSG code of the horizontal CRS for a scene centred at a position in degrees.
    ///
    /// # Errors
    /// [`CrsError::Position`] when the choice is automatic and the position is not on the Earth.
    pub fn horizontal_at(&self, lon_deg: f64, lat_deg: f64) -> Result<u32, CrsError> {
        match *self {
            Self::Auto => Ok(utm_epsg(lon_deg, lat_deg)?),
            Self::Epsg { horizontal, .. } => Ok(horizontal),
        }
    }
}

impl FromStr for CrsRequest {
    type Err = CrsError;

    /// Reads `auto`, `utm`, `EPSG:32617`, `32617` or `EPSG:32617+5773`, in any letter case.
    fn from_str(text: &str) -> Result<Self, CrsError> {
        let lower = text.trim().to_ascii_lowercase();
        if lower == "auto" || lower == "utm" {
            return Ok(Self::Auto);
        }
        let unknown = || CrsError::UnknownCrs { text: text.to_owned() };
        let (ground, height) = match lower.split_once('+') {
            Some((ground, height)) => (ground, Some(height)),
            None => (lower.as_str(), None),
        };
        let horizontal = epsg_code(ground).ok_or_else(unknown)?;
        let vertical = height.map(|h| epsg_code(h).map(VerticalDatum::from_epsg).ok_or_else(unknown)).transpose()?;
        Ok(Self::Epsg { horizontal, vertical })
    }
}

/// Parses the code in `epsg:1234` or `1234` (lower case).
fn epsg_code(text: &str) -> Option<u32> {
    let digits = text.strip_prefix("epsg:").unwrap_or(text);
    let plain = !digits.is_empty() && digits.len() <= 7 && digits.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
}

/// Returns the EPSG code of the compound CRS of a horizontal and a vertical one, if EPSG has one.
///
/// ```
/// assert_eq!(crs::compound_epsg(28992, 5709), Some(7415));
/// ```
pub fn compound_epsg(horizontal: u32, vertical: u32) -> Option<u32> {
    proj_handle::code_of(&format!("EPSG:{horizontal}+{vertical}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn user_text_is_read_in_all_its_forms() {
        let plain = CrsRequest::Epsg { horizontal: 32617, vertical: None };
        assert_eq!("EPSG:32617".parse(), Ok(plain));
        assert_eq!(" 32617".parse(), Ok(plain));
        assert_eq!("UTM".parse(), Ok(CrsRequest::Auto));
        assert_eq!(
            "epsg:32617+5773".parse(),
            Ok(CrsRequest::Epsg { horizontal: 32617, vertical: Some(VerticalDatum::Egm96) })
        );
        for bad in ["", "EPSG:", "mars", "32617+", "-4326", "EPSG:99999999999"] {
            assert!(matches!(bad.parse::<CrsRequest>(), Err(CrsError::UnknownCrs { .. })), "{bad}");
        }
    }

    #[test]
    fn identities_survive_wkt() {
        for vertical in [VerticalDatum::Ellipsoid, VerticalDatum::Egm96, VerticalDatum::Egm2008] {
            for horizontal in [32617, 5041, 4326] {
                let crs = Crs { horizontal, vertical };
                for wkt in [crs.wkt().unwrap(), crs.wkt1().unwrap()] {
                    let found = CrsIdentity::of(&wkt).unwrap();
                    assert_eq!((found.horizontal, found.vertical), (Some(horizontal), Some(vertical)), "{wkt}");
                }
            }
        }
        let flat = CrsIdentity::of("EPSG:32617").unwrap();
        assert_eq!((flat.horizontal, flat.vertical), (Some(32617), None));
        assert!(CrsIdentity::of("nothing").is_err());
        assert!(Crs::ellipsoidal(1).wkt().is_err());
    }

    #[test]
    fn heights_above_an_unknown_datum_are_not_ellipsoidal() {
        let wkt = Crs { horizontal: 32617, vertical: VerticalDatum::Egm96 }.wkt().unwrap();
        let end = wkt.find("VERTCRS").unwrap();
        let local = format!(
            "{}VERTCRS[\"local level\",VDATUM[\"gauge of the harbour\"],CS[vertical,1],AXIS[\"up\",up,\
             LENGTHUNIT[\"metre\",1]]]]",
            &wkt[..end]
        );
        let found = CrsIdentity::of(&local).unwrap();
        assert_eq!((found.horizontal, found.vertical), (Some(32617), None));
    }

    #[test]
    fn maps_without_a_code_take_a_datum() {
        let map = "+proj=tmerc +lat_0=43.5 +lon_0=5.4 +datum=WGS84 +units=m +type=crs";
        for vertical in [VerticalDatum::Ellipsoid, VerticalDatum::Egm2008, VerticalDatum::Epsg(5720)] {
            let wkt = compound_wkt(map, vertical).unwrap();
            assert_eq!(CrsIdentity::of(&wkt).unwrap().vertical, Some(vertical), "{wkt}");
            let flat = CrsIdentity::of(&horizontal_wkt(&wkt).unwrap()).unwrap();
            assert_eq!((flat.horizontal, flat.vertical), (None, None));
        }
        assert!(compound_wkt(map, VerticalDatum::Epsg(1)).is_err() && horizontal_wkt("nothing").is_err());
    }

    #[test]
    fn vertical_datums_survive_text() {
        for datum in [VerticalDatum::Ellipsoid, VerticalDatum::Egm96, VerticalDatum::Egm2008, VerticalDatum::Epsg(5703)]
        {
            assert_eq!(datum.to_string().parse(), Ok(datum));
        }
        assert_eq!("EPSG:3855".parse(), Ok(VerticalDatum::Egm2008));
        assert!("sea level".parse::<VerticalDatum>().is_err());
        assert_eq!(Crs { horizontal: 32617, vertical: VerticalDatum::Egm96 }.to_string(), "EPSG:32617+5773");
    }
}
