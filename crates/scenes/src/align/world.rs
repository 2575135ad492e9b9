//! The world of an alignment: a map, an origin on it, and the pairs of positions known in the model
//! and on the map.

use std::collections::HashMap;

use colmap::align::PointPair;
use crs::{HeightConverter, MapProjection, VerticalDatum};
use formats::colmap::ColmapModel;
use formats::control::{ControlPosition, Place, Subject};
use formats::splat_ply::LocalOrigin;
use geodesy::utm_epsg;
use numeric::upper_median;

use super::error::AlignJobError;

/// A map with an origin.
pub(super) struct World {
    /// The origin; local positions are relative to it.
    pub(super) origin: LocalOrigin,
    /// Easting, northing and ellipsoidal height of every position.
    places: Vec<[f64; 3]>,
}

/// Positions known in the model and in the world.
pub(super) struct KnownPositions {
    /// Name of each pair.
    pub(super) names: Vec<String>,
    pub(super) pairs: Vec<PointPair>,
    /// Number of positions whose image is not in the model.
    pub(super) unknown: usize,
}

impl World {
    /// Places the positions on the map `epsg`, or on the UTM zone of the first position, with an
    /// origin amid them.
    pub(super) fn of(
        positions: &[ControlPosition],
        epsg: Option<u32>,
        vertical: VerticalDatum,
    ) -> Result<Self, AlignJobError> {
        let epsg = map_of(positions, epsg)?;
        let projection = MapProjection::from_epsg(epsg)?;
        if projection.metres_per_unit() != Some(1.0) {
            return Err(AlignJobError::NotMetres { epsg });
        }
        let converter = (vertical != VerticalDatum::Ellipsoid).then(|| HeightConverter::new(vertical)).transpose()?;
        let place = |position: &ControlPosition| place_on(&projection, converter.as_ref(), position);
        let places: Vec<[f64; 3]> = positions.iter().map(place).collect::<Result<_, _>>()?;
        // The median: one wild position must not carry the origin away.
        let middle = |axis: usize| {
            let mut values: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            upper_median(&mut values).unwrap_or(0.0).round()
        };
        let origin = LocalOrigin::new(format!("EPSG:{epsg}"), "ellipsoid", [middle(0), middle(1), middle(2)]);
        Ok(Self { origin, places })
    }

    /// Pairs the positions with the model: images by name, or by the last part of the name where
    /// that is unique.
    pub(super) fn known(
        &self,
        positions: &[ControlPosition],
        model: &ColmapModel,
    ) -> Result<KnownPositions, AlignJobError> {
        let names = ViewNames::of(model);
        let mut known = KnownPositions { names: Vec::new(), pairs: Vec::new(), unknown: 0 };
        let mut taken = vec![false; model.views.len()];
        for (position, place) in positions.iter().zip(&self.places) {
            let (name, source) = match &position.subject {
                Subject::Model(source) => (format!("point {}", known.pairs.len() + 1), *source),
                Subject::Image(name) => {
                    let Some(view) = names.find(name) else {
                        known.unknown += 1;
                        continue;
                    };
                    if std::mem::replace(&mut taken[view], true) {
                        return Err(AlignJobError::TwoPositions { image: name.clone() });
                    }
                    (name.clone(), model.views[view].pose.centre)
                }
            };
            let target = [0, 1, 2].map(|i| place[i] - self.origin.origin[i]);
            known.names.push(name);
            known.pairs.push(PointPair { source, target });
        }
        if known.pairs.is_empty() {
            return Err(AlignJobError::NothingKnown);
        }
        Ok(known)
    }
}

/// The EPSG code of the map: the one given, or the UTM zone of the first geographic position.
fn map_of(positions: &[ControlPosition], given: Option<u32>) -> Result<u32, AlignJobError> {
    if let Some(epsg) = given {
        return Ok(epsg);
    }
    let geographic = positions.iter().find_map(|position| match position.place {
        Place::Geographic(ground) => Some(ground),
        Place::Map { .. } => None,
    });
    let ground = geographic.ok_or(AlignJobError::UnknownMap)?;
    Ok(utm_epsg(ground.lon_deg, ground.lat_deg)?)
}

/// Easting, northing and ellipsoidal height of a position.
fn place_on(
    projection: &MapProjection,
    converter: Option<&HeightConverter>,
    position: &ControlPosition,
) -> Result<[f64; 3], AlignJobError> {
    let ([x, y, height], (lon, lat)) = match position.place {
        Place::Map { point, height_m } => ([point.x, point.y, height_m], projection.lonlat_from_map(point.x, point.y)?),
        Place::Geographic(g) => {
            let map = projection.map_from_lonlat(g.lon_deg, g.lat_deg)?;
            ([map.x, map.y, g.height_m], (g.lon_deg, g.lat_deg))
        }
    };
    let height = match converter {
        Some(converter) => converter.ellipsoid_from_datum(lon, lat, height)?,
        None => height,
    };
    Ok([x, y, height])
}

/// Views by name.
struct ViewNames<'a> {
    whole: HashMap<&'a str, usize>,
    /// By the last part of the name; `None` where several views share it.
    last: HashMap<&'a str, Option<usize>>,
}

impl<'a> ViewNames<'a> {
    fn of(model: &'a ColmapModel) -> Self {
        let whole = model.views.iter().enumerate().map(|(i, v)| (v.name.as_str(), i)).collect();
        let mut last: HashMap<&str, Option<usize>> = HashMap::new();
        for (index, view) in model.views.iter().enumerate() {
            last.entry(last_part(&view.name)).and_modify(|found| *found = None).or_insert(Some(index));
        }
        Self { whole, last }
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.whole.get(name).copied().or_else(|| self.last.get(last_part(name)).copied().flatten())
    }
}

fn last_part(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
