//! Polygons of a layer in longitude and latitude.

use std::path::Path;

use crs::{CrsError, MapProjection};
use formats::areas::AreaName;
use geo::{BooleanOps, BoundingRect, Coord, LineString, MapCoordsInPlace, MultiPoint, MultiPolygon, Polygon, Rect};

use crate::error::DsmError;

/// Longest edge that stays one edge, metres. A straight line of this length on one map bends by a
/// few centimetres on another.
const EDGE_M: f64 = 500.0;
/// Most parts of an edge.
const PARTS_MAX: f64 = 10_000.0;
/// Polygons are cut at this share of its sides beyond the ground of interest.
const BEYOND: f64 = 0.1;
/// Metres in a degree of latitude.
const METRES_PER_DEGREE: f64 = 111_000.0;

/// Whether a file holds polygons, by its ending. Other files are rasters.
pub(crate) fn holds_polygons(path: &Path) -> bool {
    let ending = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| matches!(ending.as_str(), "geojson" | "json" | "gpkg" | "shp"))
}

/// Returns the rectangle around points in longitude and latitude, with something beyond.
pub(crate) fn ground_around(points: impl IntoIterator<Item = (f64, f64)>) -> Option<Rect<f64>> {
    let rect = MultiPoint::from_iter(points).bounding_rect()?;
    let beyond = Coord { x: BEYOND * rect.width(), y: BEYOND * rect.height() };
    Some(Rect::new(rect.min() - beyond, rect.max() + beyond))
}

/// Reads polygons on the ground of interest; all of them where that is `None`. Long edges get
/// further corners, so that they stay straight on their own map.
///
/// # Errors
/// [`DsmError::Area`], [`DsmError::Crs`] for corners without a place on the Earth.
pub(crate) fn read_polygons(
    path: &Path,
    wanted: AreaName<'_>,
    around: Option<Rect<f64>>,
) -> Result<MultiPolygon<f64>, DsmError> {
    let area = formats::areas::read(path, wanted)?;
    let map = MapProjection::from_definition(&area.crs)?;
    let on_ground = |c: Coord<f64>| map.lonlat_from_map(c.x, c.y).map(|(x, y)| Coord { x, y });
    let ring = |ring: &LineString<f64>| -> Result<LineString<f64>, CrsError> {
        let mut out = Vec::with_capacity(ring.0.len());
        for edge in ring.lines() {
            let (from, to) = (on_ground(edge.start)?, on_ground(edge.end)?);
            out.push(from);
            let length_m = METRES_PER_DEGREE * (to.x - from.x).hypot(to.y - from.y);
            let parts = (length_m / EDGE_M).ceil().min(PARTS_MAX) as usize;
            for part in 1..parts {
                out.push(on_ground(edge.start + (edge.end - edge.start) * (part as f64 / parts as f64))?);
            }
        }
        Ok(LineString(out))
    };
    let polygon = |polygon: &Polygon<f64>| -> Result<Polygon<f64>, CrsError> {
        let holes = polygon.interiors().iter().map(ring).collect::<Result<_, _>>()?;
        Ok(Polygon::new(ring(polygon.exterior())?, holes))
    };
    let all = MultiPolygon(area.polygons.iter().map(polygon).collect::<Result<_, _>>()?);
    // A camera or a map gives far corners a place that means nothing.
    Ok(around.map_or_else(|| all.clone(), |rect| all.intersection(&rect.to_polygon())))
}

/// Returns the rings of each polygon in the cells that `place` gives. A polygon with a corner that
/// has no place is left out.
pub(crate) fn rings_in_cells(
    mut polygons: MultiPolygon<f64>,
    place: impl Fn(Coord<f64>) -> Option<(f64, f64)>,
) -> Vec<Vec<Vec<(f64, f64)>>> {
    let nowhere = Coord { x: f64::NAN, y: f64::NAN };
    polygons.map_coords_in_place(|c| place(c).map_or(nowhere, |(x, y)| Coord { x, y }));
    let ring = |ring: &LineString<f64>| ring.0.iter().map(|c| (c.x, c.y)).collect();
    let rings = |p: &Polygon<f64>| std::iter::once(p.exterior()).chain(p.interiors()).map(ring).collect();
    let has_places = |rings: &Vec<Vec<(f64, f64)>>| rings.iter().flatten().all(|(x, y)| x.is_finite() && y.is_finite());
    polygons.iter().map(rings).filter(has_places).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The northern border of a zone of 6° bends by kilometres on its map.
    #[test]
    fn long_edges_stay_straight_on_their_own_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wide.geojson");
        std::fs::write(
            &path,
            r#"{"features": [{"properties": {}, "geometry": {"type": "Polygon", "coordinates":
                [[[0, 49], [6, 49], [6, 50], [0, 50], [0, 49]], [[1, 49.2], [2, 49.2], [2, 49.4], [1, 49.2]]]}}]}"#,
        )
        .unwrap();
        let found = read_polygons(&path, AreaName::ALL, None).unwrap();
        let outer = found.0[0].exterior();
        assert!(outer.lines().all(|l| (l.dx().hypot(l.dy())) * METRES_PER_DEGREE <= 1.001 * EDGE_M));
        assert!(outer.0.iter().any(|c| (c.x - 3.0).abs() < 0.003 && c.y == 50.0));
        assert_eq!(found.0[0].interiors().len(), 1);
        let near = ground_around([(3.0, 49.0), (4.0, 49.9)]).unwrap();
        let cut = read_polygons(&path, AreaName::ALL, Some(near)).unwrap().bounding_rect().unwrap();
        assert!((cut.min().x - 2.9).abs() < 1e-6 && (cut.max().y - 49.99).abs() < 1e-6, "{cut:?}");
    }
}
