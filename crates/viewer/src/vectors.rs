//! Vectors on the map: contour lines, regions of change, areas, outlines of buildings, with their
//! attributes. They are laid into the coordinate system of the map when the viewer opens.

use std::path::Path;

use crs::MapProjection;
use formats::vectors::{VectorFeature, VectorKind, VectorLayer, read_vectors};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::error::ViewError;
use job::error_text::with_causes;

/// Fields by which lines and polygons are known: heights of contour lines, signs of changes.
const ELEVATION: &str = "elevation";
const CHANGE: &str = "mean_m";

/// A layer of vectors.
#[derive(Debug, Clone, Serialize)]
pub(super) struct SceneVectors {
    /// Name for people.
    title: String,
    /// How it is drawn.
    look: VectorLook,
    /// Number of features.
    count: usize,
    /// The features as JSON.
    #[serde(skip)]
    pub(super) features: Vec<u8>,
}

/// How vectors are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum VectorLook {
    /// Lines of one height each, every fifth one bold.
    Contours,
    /// Red for a gain, blue for a loss.
    Change,
    /// One colour.
    Plain,
}

/// A feature on the map.
#[derive(Serialize)]
struct OnMap {
    kind: &'static str,
    /// x and y in turns, for each part.
    parts: Vec<Vec<f64>>,
    properties: Map<String, Value>,
}

impl SceneVectors {
    /// Reads the layers of a file. `suffix` tells those of several inputs apart, `map` is the
    /// system of the map as WKT.
    ///
    /// # Errors
    /// [`ViewError::Vectors`]; [`ViewError::VectorPlace`] for a map without a system, and for
    /// systems that PROJ does not know.
    pub(super) fn read(path: &Path, suffix: &str, map: Option<&str>) -> Result<Vec<Self>, ViewError> {
        let failed = |what: String| ViewError::VectorPlace { path: path.to_owned(), what };
        let wkt = map.ok_or_else(|| failed("the first raster names none".to_owned()))?;
        let to = MapProjection::from_definition(wkt).map_err(|error| failed(with_causes(&error)))?;
        let layers = read_vectors(path)?;
        let one = |layer: VectorLayer| {
            let from = MapProjection::from_definition(&layer.crs).map_err(|error| failed(with_causes(&error)))?;
            Ok(Self::of(layer, suffix, &from, &to))
        };
        layers.into_iter().filter(|layer| !layer.features.is_empty()).map(one).collect()
    }

    fn of(layer: VectorLayer, suffix: &str, from: &MapProjection, to: &MapProjection) -> Self {
        let has = |name: &str| layer.features.iter().all(|feature| feature.properties.contains_key(name));
        let look = match () {
            () if has(ELEVATION) => VectorLook::Contours,
            () if has(CHANGE) => VectorLook::Change,
            () => VectorLook::Plain,
        };
        let title = match (layer.name.as_str(), look) {
            (_, VectorLook::Contours) => "Contour lines".to_owned(),
            (_, VectorLook::Change) => "Changes".to_owned(),
            ("areas", _) => "Areas".to_owned(),
            ("buildings", _) => "Buildings".to_owned(),
            (name, _) => name.to_owned(),
        };
        let title = if suffix.is_empty() { title } else { format!("{title} · {suffix}") };
        // Millimetres, or a ten-millionth of a degree.
        let digits = if to.metres_per_unit().is_some() { 1e3 } else { 1e7 };
        let on_map: Vec<OnMap> =
            layer.features.into_iter().filter_map(|feature| placed(feature, from, to, digits)).collect();
        let count = on_map.len();
        let features = serde_json::to_vec(&json!({ "features": on_map })).unwrap_or_default();
        Self { title, look, count, features }
    }
}

/// Lays a feature into the system of the map. Corners that have no place there are left out; `None`
/// without any.
fn placed(feature: VectorFeature, from: &MapProjection, to: &MapProjection, digits: f64) -> Option<OnMap> {
    let rounded = |value: f64| (value * digits).round() / digits;
    let part = |part: &Vec<geo::Coord<f64>>| -> Vec<f64> {
        let corner = |c: &geo::Coord<f64>| {
            let (lon, lat) = from.lonlat_from_map(c.x, c.y).ok()?;
            let place = to.map_from_lonlat(lon, lat).ok()?;
            (place.x.is_finite() && place.y.is_finite()).then(|| [rounded(place.x), rounded(place.y)])
        };
        part.iter().filter_map(corner).flatten().collect()
    };
    let parts: Vec<Vec<f64>> = feature.parts.iter().map(part).filter(|part| !part.is_empty()).collect();
    let kind = match feature.kind {
        VectorKind::Points => "points",
        VectorKind::Lines => "lines",
        VectorKind::Polygons => "polygons",
    };
    (!parts.is_empty()).then_some(OnMap { kind, parts, properties: feature.properties })
}
