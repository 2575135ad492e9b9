//! STAC items and collections of rasters (SpatioTemporal Asset Catalog 1.1.0, with the extensions
//! projection 2.0.0 and processing 1.2.0), so that catalogues find them.
//!
//! All links are relative, so a folder can be moved. Footprints are in degrees on WGS 84.

use std::time::{SystemTime, UNIX_EPOCH};

use crs::{CrsError, MapProjection};
use formats::raster::iso_time;
use raster::GeoTransform;
use serde_json::{Value, json};

const VERSION: &str = "1.1.0";
const PROJECTION: &str = "https://stac-extensions.github.io/projection/v2.0.0/schema.json";
const PROCESSING: &str = "https://stac-extensions.github.io/processing/v1.2.0/schema.json";
const COG: &str = "image/tiff; application=geotiff; profile=cloud-optimized";
/// Number of points on each side of the outline: sides of a map are curves in degrees.
const POINTS_PER_SIDE: usize = 8;
/// Names of the files, which lie beside each other.
const ITEM: &str = "./item.json";
const COLLECTION: &str = "./collection.json";

/// Rasters on one grid, which become an item.
pub(crate) struct StacRasters<'a> {
    /// Identifier of the item.
    pub(crate) id: String,
    /// What it is, in a sentence.
    pub(crate) description: String,
    /// EPSG code of the CRS.
    pub(crate) epsg: u32,
    /// Position of the grid.
    pub(crate) geotransform: GeoTransform,
    /// Columns and rows.
    pub(crate) size: (usize, usize),
    /// Side of a cell, metres.
    pub(crate) gsd_m: f64,
    /// When the images were taken, in the form of ISO 8601.
    pub(crate) acquired: Vec<String>,
    /// The files.
    pub(crate) assets: Vec<StacAsset<'a>>,
}

/// A file of an item.
pub(crate) struct StacAsset<'a> {
    /// Name of the asset.
    pub(crate) name: &'a str,
    /// Path relative to the item.
    pub(crate) path: String,
    /// What it shows.
    pub(crate) title: String,
    /// What it is for.
    pub(crate) role: &'static str,
    /// What kind of file it is.
    pub(crate) kind: AssetKind<'a>,
}

/// Kind of a file.
pub(crate) enum AssetKind<'a> {
    /// A Cloud-Optimised GeoTIFF of one band.
    Cog {
        /// Description of the band.
        band: &'a str,
        /// Type of its cells in STAC's words.
        data_type: &'static str,
        /// No-data value.
        no_data: f64,
        /// Unit of its cells; empty without one.
        unit: &'static str,
    },
    /// Another file of this media type.
    Other(&'static str),
}

/// Returns the item, and the collection that holds it alone.
///
/// # Errors
/// [`CrsError`] when the grid lies where the map projection has no inverse.
pub(crate) fn item_and_collection(rasters: &StacRasters<'_>) -> Result<(Value, Value), CrsError> {
    let outline = outline(rasters)?;
    let bbox = outline.iter().fold([f64::MAX, f64::MAX, f64::MIN, f64::MIN], |b, [x, y]| {
        [b[0].min(*x), b[1].min(*y), b[2].max(*x), b[3].max(*y)]
    });
    let made = SystemTime::now().duration_since(UNIX_EPOCH).ok().and_then(|d| iso_time(d.as_secs() as i64));
    let made = made.unwrap_or_default();
    let g = rasters.geotransform.0;
    let mut properties = json!({
        "description": rasters.description,
        "created": made,
        "gsd": rasters.gsd_m,
        "proj:code": format!("EPSG:{}", rasters.epsg),
        "proj:shape": [rasters.size.1, rasters.size.0],
        "proj:transform": [g[1], g[2], g[0], g[4], g[5], g[3]],
        "processing:software": { "skysweep": env!("CARGO_PKG_VERSION") },
    });
    let mut times = rasters.acquired.clone();
    times.sort_unstable();
    let (first, last) = (times.first().unwrap_or(&made), times.last().unwrap_or(&made));
    if first == last {
        properties["datetime"] = json!(first);
    } else {
        properties["datetime"] = Value::Null;
        properties["start_datetime"] = json!(first);
        properties["end_datetime"] = json!(last);
    }
    let collection_id = format!("{}-collection", rasters.id);
    let assets: serde_json::Map<String, Value> =
        rasters.assets.iter().map(|asset| (asset.name.to_owned(), asset.json())).collect();
    let item = json!({
        "type": "Feature",
        "stac_version": VERSION,
        "stac_extensions": [PROJECTION, PROCESSING],
        "id": rasters.id,
        "geometry": { "type": "Polygon", "coordinates": [outline] },
        "bbox": bbox,
        "properties": properties,
        "links": [link("root", COLLECTION), link("parent", COLLECTION), link("collection", COLLECTION)],
        "collection": collection_id,
        "assets": assets,
    });
    let collection = json!({
        "type": "Collection",
        "stac_version": VERSION,
        "id": collection_id,
        "description": rasters.description,
        "license": "other",
        "extent": { "spatial": { "bbox": [bbox] }, "temporal": { "interval": [[first, last]] } },
        "links": [link("root", COLLECTION), { "rel": "item", "href": ITEM, "type": "application/geo+json" }],
    });
    Ok((item, collection))
}

fn link(rel: &str, to: &str) -> Value {
    json!({ "rel": rel, "href": to, "type": "application/json" })
}

impl StacAsset<'_> {
    fn json(&self) -> Value {
        let mut asset = json!({ "href": self.path, "title": self.title, "roles": [self.role] });
        match &self.kind {
            AssetKind::Other(media_type) => asset["type"] = json!(media_type),
            AssetKind::Cog { band, data_type, no_data, unit } => {
                asset["type"] = json!(COG);
                let mut band = json!({ "name": band, "data_type": data_type, "nodata": no_data });
                if !unit.is_empty() {
                    band["unit"] = json!(unit);
                }
                asset["bands"] = json!([band]);
            }
        }
        asset
    }
}

/// Returns the closed outline of the grid, counter-clockwise, degrees of longitude and latitude.
fn outline(rasters: &StacRasters<'_>) -> Result<Vec<[f64; 2]>, CrsError> {
    let projection = MapProjection::from_epsg(rasters.epsg)?;
    let (width, height) = (rasters.size.0 as f64, rasters.size.1 as f64);
    // From the centre of a cell to its corner.
    let (left, top, right, foot) = (-0.5, -0.5, width - 0.5, height - 0.5);
    let corners = [[left, top], [left, foot], [right, foot], [right, top], [left, top]];
    let mut points = Vec::with_capacity(4 * POINTS_PER_SIDE + 1);
    for side in corners.windows(2) {
        for step in 0..POINTS_PER_SIDE {
            let t = step as f64 / POINTS_PER_SIDE as f64;
            let [column, row] = [0, 1].map(|i| side[0][i] + t * (side[1][i] - side[0][i]));
            let (x, y) = rasters.geotransform.map_from_cell(column, row);
            let (lon, lat) = projection.lonlat_from_map(x, y)?;
            points.push([lon, lat]);
        }
    }
    points.extend(points.first().copied());
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rasters(acquired: &[&str]) -> StacRasters<'static> {
        StacRasters {
            id: "town".to_owned(),
            description: "A surface model.".to_owned(),
            epsg: 32617,
            geotransform: GeoTransform::north_up(436_000.0, 3_358_000.0, 0.5),
            size: (400, 200),
            gsd_m: 0.5,
            acquired: acquired.iter().map(|s| (*s).to_owned()).collect(),
            assets: vec![StacAsset {
                name: "dsm",
                path: "../dsm/dsm.tif".to_owned(),
                title: "Heights".to_owned(),
                role: "data",
                kind: AssetKind::Cog { band: "height_m", data_type: "float32", no_data: -32768.0, unit: "m" },
            }],
        }
    }

    #[test]
    fn an_item_has_its_place_and_time() {
        let (item, collection) =
            item_and_collection(&rasters(&["2015-01-02T00:00:00Z", "2014-01-02T00:00:00Z"])).unwrap();
        let bbox: Vec<f64> = serde_json::from_value(item["bbox"].clone()).unwrap();
        assert!(bbox[0] < -81.66 && bbox[2] > -81.67 && bbox[1] > 30.3 && bbox[3] < 30.4, "{bbox:?}");
        assert_eq!(item["properties"]["start_datetime"], "2014-01-02T00:00:00Z");
        assert_eq!(item["properties"]["datetime"], Value::Null);
        assert_eq!(item["collection"], collection["id"]);
        assert_eq!(item["assets"]["dsm"]["bands"][0]["unit"], "m");
        let ring: Vec<[f64; 2]> = serde_json::from_value(item["geometry"]["coordinates"][0].clone()).unwrap();
        let twice_area: f64 = ring.windows(2).map(|s| s[0][0] * s[1][1] - s[1][0] * s[0][1]).sum();
        assert!(ring.first() == ring.last() && twice_area > 0.0, "the outline is closed and counter-clockwise");
    }

    #[test]
    fn one_time_is_the_datetime() {
        let (item, _) = item_and_collection(&rasters(&["2014-01-02T00:00:00Z"])).unwrap();
        assert_eq!(item["properties"]["datetime"], "2014-01-02T00:00:00Z");
        assert!(item["properties"].get("start_datetime").is_none());
    }
}
