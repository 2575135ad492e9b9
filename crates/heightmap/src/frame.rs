//! The position of a tile and of its pixels.
//!
//! The tile lies on a transverse Mercator of its own, with its origin at the camera and true scale
//! at the height of the ground. In it the heading is a plain rotation, and the pixels are squares
//! of 1 / r metres on the ground. With θ the heading, clockwise from true north, right of the
//! camera is (cos θ, −sin θ) in (east, north) and forward is (sin θ, cos θ). The map of another
//! CRS, such as UTM, is turned by its convergence and stretched by its scale. Its geotransform is
//! the best affine fit. The fit is refused if a corner is off by more than a fiftieth of a pixel.

use std::sync::Arc;

use crs::{Crs, MapProjection};
use geodesy::{LonLatHeight, TransverseMercator};
use raster::GeoTransform;

use crate::error::HeightMapError;

/// Most pixels along a side.
const SIZE_MAX: usize = 16_384;
/// Longest side, metres: beyond it a local map is no longer a plane.
const SIDE_MAX_M: f64 = 20_000.0;
/// Largest departure of a CRS from its geotransform, pixels.
const BEND_MAX_PX: f64 = 0.02;

/// A tile: position and heading of the camera, size and resolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileRequest {
    /// Longitude of the camera, degrees.
    pub lon_deg: f64,
    /// Latitude of the camera, degrees.
    pub lat_deg: f64,
    /// Heading: direction of the top of the tile, degrees clockwise from true north.
    pub heading_deg: f64,
    /// Pixels along each side.
    pub size: usize,
    /// Pixels per metre on the ground.
    pub resolution_px_per_m: f64,
}

impl TileRequest {
    /// A tile as in the paper, north up: 518 × 518 pixels, 2 per metre.
    pub fn at(lon_deg: f64, lat_deg: f64) -> Self {
        Self { lon_deg, lat_deg, heading_deg: 0.0, size: 518, resolution_px_per_m: 2.0 }
    }
}

/// Map projection that a tile is written in.
#[derive(Debug, Clone)]
pub enum MapSystem {
    /// The tile's own transverse Mercator.
    Local,
    /// Another map in metres.
    Projected {
        /// Its EPSG code.
        epsg: u32,
        /// Its projection.
        projection: Arc<MapProjection>,
    },
}

/// A tile with its position on the Earth.
///
/// ```
/// use heightmap::{MapSystem, TileFrame, TileRequest};
///
/// let frame = TileFrame::new(TileRequest::at(4.36, 52.0), 2.0, MapSystem::Local)?;
/// let centre = frame.centre();
/// let [lon_deg, lat_deg] = frame.lonlat_from_pixels(&[[centre, centre]])?[0];
/// assert!((lon_deg - 4.36).abs() < 1e-9 && (lat_deg - 52.0).abs() < 1e-9);
/// # Ok::<(), heightmap::HeightMapError>(())
/// ```
#[derive(Debug, Clone)]
pub struct TileFrame {
    request: TileRequest,
    local: TransverseMercator,
    system: MapSystem,
    geotransform: GeoTransform,
}

impl TileFrame {
    /// Lays out a tile. `height_m` is the height of the ground or camera above the ellipsoid, to
    /// some metres; it sets the scale of the local map.
    ///
    /// # Errors
    /// [`HeightMapError`] for numbers out of range, and for a CRS that is not in metres or bends
    /// the tile.
    pub fn new(request: TileRequest, height_m: f64, system: MapSystem) -> Result<Self, HeightMapError> {
        let TileRequest { lon_deg, lat_deg, heading_deg, size, resolution_px_per_m } = request;
        let side_m = size as f64 / resolution_px_per_m;
        let sound = (1..=SIZE_MAX).contains(&size) && resolution_px_per_m > 0.0 && side_m > 0.0 && side_m <= SIDE_MAX_M;
        if !sound {
            let (most, widest_m) = (SIZE_MAX, SIDE_MAX_M);
            return Err(HeightMapError::Tile { size, resolution_px_per_m, most, widest_m });
        }
        if !heading_deg.is_finite() {
            return Err(HeightMapError::Heading { heading_deg });
        }
        let local = TransverseMercator::local(LonLatHeight::new(lon_deg, lat_deg, height_m))?;
        let own = turned(heading_deg, size, 1.0 / resolution_px_per_m);
        let geotransform = match &system {
            MapSystem::Local => own,
            MapSystem::Projected { epsg, projection } => fitted(*epsg, projection, &local, &own, size)?,
        };
        Ok(Self { request, local, system, geotransform })
    }

    /// Returns the tile that was asked for.
    pub fn request(&self) -> &TileRequest {
        &self.request
    }

    /// Returns the tile's own transverse Mercator, also if the tile is written in another
    /// projection.
    pub fn local(&self) -> &TransverseMercator {
        &self.local
    }

    /// Returns the map from pixels to metres of the projection.
    pub fn geotransform(&self) -> GeoTransform {
        self.geotransform
    }

    /// Returns the CRS of the projection, with heights above the ellipsoid; `None` for the tile's
    /// own map, see [`Self::wkt`].
    pub fn crs(&self) -> Option<Crs> {
        match &self.system {
            MapSystem::Local => None,
            MapSystem::Projected { epsg, .. } => Some(Crs::ellipsoidal(*epsg)),
        }
    }

    /// Returns the WKT of the tile's own map.
    pub fn wkt(&self) -> String {
        self.local.wkt()
    }

    /// Returns the column of the camera, which is also its row.
    pub fn centre(&self) -> f64 {
        (self.request.size as f64 - 1.0) / 2.0
    }

    /// Converts pixels (column, row) to longitudes and latitudes, degrees.
    ///
    /// # Errors
    /// [`HeightMapError`] for a position outside of the projection.
    pub fn lonlat_from_pixels(&self, pixels: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, HeightMapError> {
        let on_map = pixels.iter().map(|&[column, row]| self.geotransform.map_from_cell(column, row));
        match &self.system {
            MapSystem::Local => {
                on_map.map(|(x, y)| Ok(self.local.lonlat_from_map(x, y).map(|(lon, lat)| [lon, lat])?)).collect()
            }
            MapSystem::Projected { projection, .. } => {
                let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = on_map.unzip();
                match projection.lonlat_from_map_slices(&mut lon, &mut lat)? {
                    0 => Ok(lon.into_iter().zip(lat).map(|(lon, lat)| [lon, lat]).collect()),
                    _ => Err(HeightMapError::OutsideSource),
                }
            }
        }
    }

    /// Converts longitudes and latitudes to pixels; NaN for positions outside of the projection.
    ///
    /// # Errors
    /// [`HeightMapError::Crs`] for a transformation that PROJ cannot make.
    pub fn pixels_from_lonlat(&self, lonlat: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, HeightMapError> {
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = lonlat.iter().map(|&[lon, lat]| (lon, lat)).unzip();
        match &self.system {
            MapSystem::Local => {
                for (x, y) in x.iter_mut().zip(&mut y) {
                    let at = self.local.map_from_lonlat(*x, *y);
                    (*x, *y) = at.map_or((f64::NAN, f64::NAN), |at| (at.x, at.y));
                }
            }
            MapSystem::Projected { projection, .. } => {
                projection.map_from_lonlat_slices(&mut x, &mut y)?;
            }
        }
        let pixel = |(x, y)| self.geotransform.cell_from_map(x, y).map_or([f64::NAN; 2], |(c, r)| [c, r]);
        Ok(x.into_iter().zip(y).map(pixel).collect())
    }
}

/// Returns the geotransform of pixels of `pixel_m` metres around the origin, turned clockwise.
fn turned(heading_deg: f64, size: usize, pixel_m: f64) -> GeoTransform {
    let (sin, cos) = quadrant_sin_cos(heading_deg);
    let half = size as f64 / 2.0 * pixel_m;
    // Right of the camera per column, behind it per row.
    let (right, back) = ((cos, -sin), (-sin, -cos));
    let corner = (-half * (right.0 + back.0), -half * (right.1 + back.1));
    GeoTransform([corner.0, pixel_m * right.0, pixel_m * back.0, corner.1, pixel_m * right.1, pixel_m * back.1])
}

/// Computes sine and cosine of degrees, exactly at multiples of 90, so that a heading of 90 has no
/// rotation terms of 1e-17.
fn quadrant_sin_cos(degrees: f64) -> (f64, f64) {
    let turn = degrees.rem_euclid(360.0);
    match turn {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => turn.to_radians().sin_cos(),
    }
}

/// Fits the affine map from pixels to another CRS: exact at the middles of the sides, checked at
/// the corners and the centre.
fn fitted(
    epsg: u32,
    projection: &MapProjection,
    local: &TransverseMercator,
    own: &GeoTransform,
    size: usize,
) -> Result<GeoTransform, HeightMapError> {
    if projection.metres_per_unit() != Some(1.0) {
        return Err(HeightMapError::NotMetric { epsg });
    }
    let project = |column: f64, row: f64| -> Result<[f64; 2], HeightMapError> {
        let (x, y) = own.map_from_cell(column, row);
        let (lon, lat) = local.lonlat_from_map(x, y)?;
        let at = projection.map_from_lonlat(lon, lat)?;
        Ok([at.x, at.y])
    };
    let (low, n) = (-0.5, size as f64);
    let (mid, high) = (low + n / 2.0, low + n);
    let [left, right, top, bottom] = [project(low, mid)?, project(high, mid)?, project(mid, low)?, project(mid, high)?];
    let along = [0, 1].map(|i| (right[i] - left[i]) / n);
    let down = [0, 1].map(|i| (bottom[i] - top[i]) / n);
    let middle = [0, 1].map(|i| (left[i] + right[i] + top[i] + bottom[i]) / 4.0);
    let corner = [0, 1].map(|i| middle[i] - (along[i] + down[i]) * n / 2.0);
    let found = GeoTransform([corner[0], along[0], down[0], corner[1], along[1], down[1]]);
    let mut off_px: f64 = 0.0;
    for (column, row) in [(low, low), (high, low), (low, high), (high, high), (mid, mid)] {
        let [x, y] = project(column, row)?;
        let (c, r) = found.cell_from_map(x, y).ok_or(HeightMapError::NotMetric { epsg })?;
        off_px = off_px.max((c - column).hypot(r - row));
    }
    if off_px <= BEND_MAX_PX { Ok(found) } else { Err(HeightMapError::Bent { epsg, off_px, limit_px: BEND_MAX_PX }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geodesy::{EnuFrame, utm_epsg};

    fn system(epsg: u32) -> MapSystem {
        MapSystem::Projected { epsg, projection: Arc::new(MapProjection::from_epsg(epsg).unwrap()) }
    }

    #[test]
    fn the_top_is_forward_and_the_right_is_right() {
        for heading_deg in [0.0, 37.0, 90.0, -120.0] {
            let request = TileRequest { heading_deg, ..TileRequest::at(4.36, 52.0) };
            let frame = TileFrame::new(request, 2.0, MapSystem::Local).unwrap();
            let enu = EnuFrame::new(LonLatHeight::new(4.36, 52.0, 2.0));
            let c = frame.centre();
            // 100 m before the camera, 50 m to its right.
            let [lon, lat] = frame.lonlat_from_pixels(&[[c + 100.0, c - 200.0]]).unwrap()[0];
            let p = enu.enu_from_ground(LonLatHeight::new(lon, lat, 2.0));
            let (sin, cos) = heading_deg.to_radians().sin_cos();
            let (east, north) = (50.0 * cos + 100.0 * sin, -50.0 * sin + 100.0 * cos);
            assert!((p.east - east).abs() < 1e-3 && (p.north - north).abs() < 1e-3, "{heading_deg}: {p:?}");
        }
    }

    #[test]
    fn utm_holds_the_same_pixels_and_far_from_its_meridian_too() {
        for (lon, lat) in [(4.36, 52.0), (5.999, 60.2), (-81.66, 30.34), (55.5, -21.1)] {
            let request = TileRequest { heading_deg: 37.0, ..TileRequest::at(lon, lat) };
            let local = TileFrame::new(request, 30.0, MapSystem::Local).unwrap();
            let utm = TileFrame::new(request, 30.0, system(utm_epsg(lon, lat).unwrap())).unwrap();
            let pixels = [[0.0, 0.0], [517.0, 0.0], [258.5, 258.5], [13.0, 499.0]];
            let there = local.pixels_from_lonlat(&utm.lonlat_from_pixels(&pixels).unwrap()).unwrap();
            for (a, b) in pixels.iter().zip(there) {
                assert!((a[0] - b[0]).hypot(a[1] - b[1]) < BEND_MAX_PX, "{lon} {lat}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn what_makes_no_tile_is_refused() {
        let at = TileRequest::at(4.36, 52.0);
        let made = |request| TileFrame::new(request, 0.0, MapSystem::Local);
        assert!(matches!(made(TileRequest { size: 0, ..at }), Err(HeightMapError::Tile { .. })));
        assert!(matches!(made(TileRequest { resolution_px_per_m: f64::NAN, ..at }), Err(HeightMapError::Tile { .. })));
        assert!(matches!(made(TileRequest { resolution_px_per_m: 1e-3, ..at }), Err(HeightMapError::Tile { .. })));
        assert!(matches!(made(TileRequest { heading_deg: f64::INFINITY, ..at }), Err(HeightMapError::Heading { .. })));
        assert!(matches!(made(TileRequest { lat_deg: 91.0, ..at }), Err(HeightMapError::Position(_))));
        assert!(matches!(TileFrame::new(at, 0.0, system(4326)), Err(HeightMapError::NotMetric { epsg: 4326 })));
        // A tile of 10 km at the edge of a UTM zone.
        let wide = TileRequest { size: 10_000, resolution_px_per_m: 1.0, ..TileRequest::at(8.999, 60.0) };
        assert!(matches!(TileFrame::new(wide, 0.0, system(32631)), Err(HeightMapError::Bent { .. })));
    }
}
