//! The coordinate reference system of a LAS file: a WKT record, or else GeoTIFF keys.

use crs::{CrsError, CrsIdentity, VerticalDatum};
use las::Header;
use las::crs::{GeoTiffCrs, GeoTiffData};

/// GeoTIFF key of the vertical unit.
const VERTICAL_UNITS: u16 = 4099;
/// EPSG codes of vertical units, and metres per unit.
const METRES_PER_UNIT: [(u16, f64); 3] = [(9001, 1.0), (9002, 0.3048), (9003, 1200.0 / 3937.0)];

/// The coordinate reference system of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stated {
    /// Definition: WKT, or `EPSG:n`.
    pub(super) definition: Option<String>,
    pub(super) horizontal_epsg: Option<u32>,
    pub(super) vertical: Option<VerticalDatum>,
    /// Metres per unit of the heights.
    pub(super) height_unit_m: f64,
}

/// Reads the reference system from the header. All fields are empty when the file names none.
pub(super) fn stated(header: &Header) -> Result<Stated, CrsError> {
    let nothing = Stated { definition: None, horizontal_epsg: None, vertical: None, height_unit_m: 1.0 };
    if let Some(wkt) = header.get_wkt_crs_bytes() {
        let wkt = String::from_utf8_lossy(wkt).trim_matches(['\0', ' ', '\n']).to_owned();
        if !wkt.is_empty() {
            let identity = CrsIdentity::of(&wkt)?;
            let (horizontal_epsg, vertical) = (identity.horizontal, identity.vertical);
            return Ok(Stated { definition: Some(wkt), horizontal_epsg, vertical, ..nothing });
        }
    }
    match header.get_geotiff_crs() {
        Ok(Some(keys)) => Ok(from_keys(&keys, nothing)),
        // Keys that cannot be read count as no reference system, which the caller reports.
        Ok(None) | Err(_) => Ok(nothing),
    }
}

fn from_keys(keys: &GeoTiffCrs, nothing: Stated) -> Stated {
    let is_epsg = |code: &u16| (1024..=32766).contains(code);
    let projected = keys.get_projected_crs_geo_key_value().filter(is_epsg);
    let horizontal = projected.or(keys.get_geodetic_crs_geo_key_value().filter(is_epsg)).map(u32::from);
    let vertical = keys.get_vertical_crs_geo_key_value().filter(is_epsg);
    let unit = keys.entries.iter().find(|entry| entry.id == VERTICAL_UNITS).and_then(|entry| match entry.data {
        GeoTiffData::U16(code) => METRES_PER_UNIT.iter().find(|(known, _)| *known == code).map(|(_, metres)| *metres),
        _ => None,
    });
    Stated {
        definition: horizontal.map(|code| format!("EPSG:{code}")),
        horizontal_epsg: horizontal,
        vertical: vertical.map(|code| VerticalDatum::from_epsg(u32::from(code))),
        height_unit_m: unit.unwrap_or(nothing.height_unit_m),
    }
}
