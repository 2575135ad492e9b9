//! The identity of a coordinate reference system: an EPSG code on the ground and a vertical datum.
//!
//! The automatic choice is [`geodesy::utm_epsg`].

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use geodesy::utm_epsg;

use crate::{CrsError, proj_handle};

/// What heights are measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum VerticalDatum {
    /// The WGS 84 ellipsoid, as inside the program.
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
    /// EPSG code of the vertical CRS; `None` for ellipsoidal heights, which have none of their own.
    pub fn epsg(&self) -> Option<u32> {
        match *self {
            Self::Ellipsoid => None,
            Self::Egm96 => Some(5773),
            Self::Egm2008 => Some(3855),
            Self::Epsg(code) => Some(code),
        }
    }

    /// The datum of a vertical CRS's EPSG code.
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

/// A horizontal CRS and what heights in it are measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Crs {
    /// EPSG code of the projected or geographic horizontal CRS.
    pub horizontal: u32,
    /// Datum of the heights.
    pub vertical: VerticalDatum,
}

impl Crs {
    /// A CRS with heights above the ellipsoid.
    pub const fn ellipsoidal(horizontal: u32) -> Self {
        Self { horizontal, vertical: VerticalDatum::Ellipsoid }
    }

    /// WKT2:2019 of the whole: a compound CRS, or for ellipsoidal heights the horizontal CRS with a height axis.
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] when PROJ does not know a code.
    pub fn wkt(&self) -> Result<String, CrsError> {
        proj_handle::wkt(&self.to_string(), self.vertical == VerticalDatum::Ellipsoid)
            .map_err(|reason| unknown(self, reason))
    }

    /// PROJ's and GDAL's name for the horizontal part, `EPSG:32617`.
    pub fn horizontal_definition(&self) -> String {
        format!("EPSG:{}", self.horizontal)
    }
}

impl fmt::Display for Crs {
    /// `EPSG:32617` for ellipsoidal heights, else the compound `EPSG:32617+5773`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.vertical.epsg() {
            None => write!(f, "EPSG:{}", self.horizontal),
            Some(vertical) => write!(f, "EPSG:{}+{vertical}", self.horizontal),
        }
    }
}

/// What a definition met in a file (WKT, `EPSG:n`, PROJJSON) is in terms of EPSG codes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrsIdentity {
    /// Name in the definition.
    pub name: String,
    /// EPSG code of the horizontal part, if it carries one or PROJ is sure of one.
    pub horizontal: Option<u32>,
    /// Datum of the heights; `None` when the definition does not say.
    pub vertical: Option<VerticalDatum>,
}

impl CrsIdentity {
    /// Takes a definition apart.
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] when PROJ does not read the definition as a CRS.
    pub fn of(definition: &str) -> Result<Self, CrsError> {
        let codes = proj_handle::codes(definition).map_err(|reason| unknown(&"the definition in the file", reason))?;
        let ellipsoidal = codes.three_dimensional.then_some(VerticalDatum::Ellipsoid);
        let vertical = codes.vertical.map(VerticalDatum::from_epsg).or(ellipsoidal);
        Ok(Self { name: codes.name, horizontal: codes.horizontal, vertical })
    }
}

fn unknown(what: &dyn fmt::Display, reason: String) -> CrsError {
    CrsError::NoTransformation { source_crs: "EPSG:4979".to_owned(), target_crs: what.to_string(), reason }
}

/// A CRS as the user asks for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CrsRequest {
    /// The UTM or polar zone of the scene (`auto` or `utm`).
    #[default]
    Auto,
    /// A code, and a vertical datum where the text names one (`EPSG:32617+5773`).
    Epsg {
        /// EPSG code of the horizontal CRS.
        horizontal: u32,
        /// Vertical datum, if named.
        vertical: Option<VerticalDatum>,
    },
}

impl CrsRequest {
    /// EPSG code of the horizontal CRS for a scene centred at a position in degrees.
    ///
    /// # Errors
    /// [`geodesy::GeodesyError::InvalidPosition`] when the choice is automatic and the position is none.
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

/// The code in `epsg:1234` or `1234` (lower case).
fn epsg_code(text: &str) -> Option<u32> {
    let digits = text.strip_prefix("epsg:").unwrap_or(text);
    let plain = !digits.is_empty() && digits.len() <= 7 && digits.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
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
                let found = CrsIdentity::of(&crs.wkt().unwrap()).unwrap();
                assert_eq!((found.horizontal, found.vertical), (Some(horizontal), Some(vertical)), "{crs}");
            }
        }
        let flat = CrsIdentity::of("EPSG:32617").unwrap();
        assert_eq!((flat.horizontal, flat.vertical), (Some(32617), None));
        assert!(CrsIdentity::of("nothing").is_err());
        assert!(Crs::ellipsoidal(1).wkt().is_err());
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
