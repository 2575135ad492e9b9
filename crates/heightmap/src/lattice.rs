//! The map from the pixels of a tile to a source of heights, and back.
//!
//! The exact map (geotransform, projection of the tile, longitude and latitude, projection of the
//! source, geoid) is computed at the nodes of a lattice and interpolated bilinearly between them.
//! The lattice is refined until the interpolation at the centres of its meshes is within a
//! thousandth of a pixel and a tenth of a millimetre of height.

use crs::{HeightConverter, MapProjection};
use raster::{GeoTransform, Grid};

use crate::error::HeightMapError;
use crate::frame::TileFrame;

/// Meshes along each side of the lattice: at the start, and at most.
const MESHES: (usize, usize) = (8, 256);
/// Largest error of a position, pixels of the tile.
const TOLERANCE_PX: f64 = 1e-3;
/// Largest error of a height, metres.
const TOLERANCE_M: f64 = 1e-4;
/// Margin of a map from a source around the tile, as a share of the extent of the tile.
const MARGIN: f64 = 0.02;

/// Coordinate reference system of a source.
#[derive(Debug)]
pub struct SourceMap {
    /// Projection of its map.
    pub projection: MapProjection,
    /// Conversion of its heights to the ellipsoid.
    pub heights: HeightConverter,
}

/// The map from the pixels of a tile to a source, or back.
#[derive(Debug, Clone)]
pub struct TileMap {
    low: [f64; 2],
    step: [f64; 2],
    /// Two coordinates, and the metres to add to heights of the source to get heights above the
    /// ellipsoid.
    nodes: Grid<[f64; 3]>,
}

impl TileMap {
    /// Returns the map from (column, row) of a tile to the coordinates (x, y) of the map of a
    /// source.
    ///
    /// # Errors
    /// [`HeightMapError::OutsideSource`] if the projection or the geoid of the source is not
    /// defined over the whole tile.
    pub fn to_map(frame: &TileFrame, source: &SourceMap) -> Result<Self, HeightMapError> {
        Self::from_pixels(frame, source, |x, y| Some([x, y]))
    }

    /// Returns the map from (column, row) of a tile to (column, row) of a grid on the map of a
    /// source.
    ///
    /// # Errors
    /// As [`Self::to_map`], and for a singular geotransform.
    pub fn to_grid(frame: &TileFrame, source: &SourceMap, grid: &GeoTransform) -> Result<Self, HeightMapError> {
        Self::from_pixels(frame, source, |x, y| grid.cell_from_map(x, y).map(|(c, r)| [c, r]))
    }

    /// Returns the map from coordinates (x, y) of the map of a source to (column, row) of a tile.
    /// It holds over the tile and a small margin.
    ///
    /// # Errors
    /// As [`Self::to_map`].
    pub fn from_map(frame: &TileFrame, source: &SourceMap) -> Result<Self, HeightMapError> {
        let (low, high) = Self::to_map(frame, source)?.extent();
        let exact = |at: &[[f64; 2]]| {
            let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = at.iter().map(|&[x, y]| (x, y)).unzip();
            source.projection.lonlat_from_map_slices(&mut lon, &mut lat)?;
            let shift = undulation(source, &lon, &lat)?;
            let lonlat: Vec<[f64; 2]> = lon.into_iter().zip(lat).map(|(lon, lat)| [lon, lat]).collect();
            let pixels = frame.pixels_from_lonlat(&lonlat)?;
            Ok(pixels.iter().zip(shift).map(|([c, r], shift)| [*c, *r, shift]).collect())
        };
        Self::fitted(low, high, &exact, [TOLERANCE_PX, TOLERANCE_PX, TOLERANCE_M])
    }

    fn from_pixels(
        frame: &TileFrame,
        source: &SourceMap,
        place: impl Fn(f64, f64) -> Option<[f64; 2]>,
    ) -> Result<Self, HeightMapError> {
        let exact = |at: &[[f64; 2]]| {
            let lonlat = frame.lonlat_from_pixels(at)?;
            let (mut x, mut y): (Vec<f64>, Vec<f64>) = lonlat.iter().map(|&[lon, lat]| (lon, lat)).unzip();
            let shift = undulation(source, &x, &y)?;
            source.projection.map_from_lonlat_slices(&mut x, &mut y)?;
            let placed = |((x, y), shift): ((&f64, &f64), f64)| {
                let [a, b] = place(*x, *y).unwrap_or([f64::NAN; 2]);
                [a, b, shift]
            };
            Ok(x.iter().zip(&y).zip(shift).map(placed).collect::<Vec<_>>())
        };
        // The outer edges of the outer pixels.
        let (low, high, c) = ([-0.5; 2], [frame.request().size as f64 - 0.5; 2], frame.centre());
        let near: Vec<[f64; 3]> = exact(&[[c, c], [c + 0.5, c], [c, c + 0.5]])?;
        let pixel = |i: usize| 2.0 * (near[1][i] - near[0][i]).abs().max((near[2][i] - near[0][i]).abs());
        Self::fitted(low, high, &exact, [TOLERANCE_PX * pixel(0), TOLERANCE_PX * pixel(1), TOLERANCE_M])
    }

    fn fitted(
        low: [f64; 2],
        high: [f64; 2],
        exact: &impl Fn(&[[f64; 2]]) -> Result<Vec<[f64; 3]>, HeightMapError>,
        tolerance: [f64; 3],
    ) -> Result<Self, HeightMapError> {
        let mut meshes = MESHES.0;
        loop {
            let step = [0, 1].map(|i| (high[i] - low[i]) / meshes as f64);
            let places = |count: usize, offset: f64| -> Vec<[f64; 2]> {
                let at = |k: usize, i: usize| low[i] + (k as f64 + offset) * step[i];
                (0..count * count).map(|k| [at(k % count, 0), at(k / count, 1)]).collect()
            };
            let nodes = exact(&places(meshes + 1, 0.0))?;
            let nodes = Grid::from_vec(meshes + 1, meshes + 1, nodes).ok_or(HeightMapError::OutsideSource)?;
            if !nodes.data().iter().flatten().all(|v| v.is_finite()) {
                return Err(HeightMapError::OutsideSource);
            }
            let map = Self { low, step, nodes };
            let centres = places(meshes, 0.5);
            let close = |(at, exact): (&[f64; 2], [f64; 3])| {
                let found = map.at(at[0], at[1]);
                (0..3).all(|i| (found[i] - exact[i]).abs() <= tolerance[i])
            };
            if centres.iter().zip(exact(&centres)?).all(close) {
                return Ok(map);
            }
            meshes *= 2;
            if meshes > MESHES.1 {
                return Err(HeightMapError::OutsideSource);
            }
        }
    }

    /// Returns the two coordinates of a position, and the metres to add to heights of the source
    /// there.
    #[inline]
    pub fn at(&self, x: f64, y: f64) -> [f64; 3] {
        let along = |value: f64, i: usize, nodes: usize| {
            let u = (value - self.low[i]) / self.step[i];
            let first = (u.max(0.0) as usize).min(nodes - 2);
            (first, u - first as f64)
        };
        let (i, s) = along(x, 0, self.nodes.width());
        let (j, t) = along(y, 1, self.nodes.height());
        let (top, low) = (&self.nodes.row(j)[i..i + 2], &self.nodes.row(j + 1)[i..i + 2]);
        let mut out = [0.0; 3];
        for (k, value) in out.iter_mut().enumerate() {
            let upper = top[0][k] + s * (top[1][k] - top[0][k]);
            let lower = low[0][k] + s * (low[1][k] - low[0][k]);
            *value = upper + t * (lower - upper);
        }
        out
    }

    /// Returns whether the map holds at a position.
    #[inline]
    pub fn holds(&self, x: f64, y: f64) -> bool {
        let (low, high) = self.domain();
        x >= low[0] && x <= high[0] && y >= low[1] && y <= high[1]
    }

    /// Returns the domain of the map: least and greatest coordinates.
    #[inline]
    pub fn domain(&self) -> ([f64; 2], [f64; 2]) {
        let meshes = [self.nodes.width() - 1, self.nodes.height() - 1];
        (self.low, [0, 1].map(|i| self.low[i] + self.step[i] * meshes[i] as f64))
    }

    /// Returns the range of the map: least and greatest coordinates, with a small margin.
    pub fn extent(&self) -> ([f64; 2], [f64; 2]) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for node in self.nodes.data() {
            for i in 0..2 {
                low[i] = low[i].min(node[i]);
                high[i] = high[i].max(node[i]);
            }
        }
        let margin = [0, 1].map(|i| MARGIN * (high[i] - low[i]));
        ([0, 1].map(|i| low[i] - margin[i]), [0, 1].map(|i| high[i] + margin[i]))
    }
}

/// Returns the metres to add to heights of the source to get heights above the ellipsoid.
fn undulation(source: &SourceMap, lon: &[f64], lat: &[f64]) -> Result<Vec<f64>, HeightMapError> {
    let mut shift = vec![0.0; lon.len()];
    match source.heights.ellipsoid_from_datum_slices(lon, lat, &mut shift)? {
        0 => Ok(shift),
        _ => Err(HeightMapError::NoDatum { datum: source.heights.datum().to_string() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{MapSystem, TileRequest};
    use crs::VerticalDatum;

    #[test]
    fn both_ways_are_exact_to_a_thousandth_of_a_pixel_in_metres_degrees_and_over_a_geoid() {
        for (epsg, datum) in
            [(32631, VerticalDatum::Ellipsoid), (4326, VerticalDatum::Egm96), (32633, VerticalDatum::Egm96)]
        {
            let source = SourceMap {
                projection: MapProjection::from_epsg(epsg).unwrap(),
                heights: HeightConverter::new(datum).unwrap(),
            };
            let request = TileRequest { heading_deg: 37.0, ..TileRequest::at(5.4, 52.0) };
            let frame = TileFrame::new(request, 45.0, MapSystem::Local).unwrap();
            let (there, back) =
                (TileMap::to_map(&frame, &source).unwrap(), TileMap::from_map(&frame, &source).unwrap());
            for pixel in [[0.0, 0.0], [517.0, 3.0], [258.5, 258.5], [101.3, 444.4]] {
                let [x, y, shift] = there.at(pixel[0], pixel[1]);
                let [c, r, shift_back] = back.at(x, y);
                assert!((c - pixel[0]).abs() < 3e-3 && (r - pixel[1]).abs() < 3e-3, "{epsg}: {pixel:?} {c} {r}");
                let [lon, lat] = frame.lonlat_from_pixels(&[pixel]).unwrap()[0];
                let exact = source.heights.ellipsoid_from_datum(lon, lat, 0.0).unwrap();
                assert!((shift - exact).abs() < 2e-4 && (shift_back - exact).abs() < 2e-4, "{datum}");
                assert!(back.holds(x, y) && !back.holds(x + 1e4, y));
            }
        }
    }
}
