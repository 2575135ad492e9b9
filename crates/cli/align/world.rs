//! The world of an alignment: a map, and an origin that local positions are counted from.

use std::collections::HashMap;

use anyhow::{bail, ensure};
use colmap::align::PointPair;
use crs::{HeightConverter, MapProjection, VerticalDatum};
use geodesy::utm_epsg;
use io::colmap::ColmapModel;
use io::control::{ControlPosition, Place, Subject};
use io::splat_ply::LocalOrigin;

use super::Known;

/// A map with an origin.
pub(super) struct World {
    pub(super) origin: LocalOrigin,
    /// Easting, northing and ellipsoidal height of every position.
    places: Vec<[f64; 3]>,
}

impl World {
    /// The map of `crs`, or the UTM zone of the first position, with its origin amid the positions.
    pub(super) fn of(positions: &[ControlPosition], crs: Option<u32>, vertical: VerticalDatum) -> anyhow::Result<Self> {
        let geographic = positions.iter().find_map(|position| match position.place {
            Place::Geographic(ground) => Some(ground),
            Place::Map(_) => None,
        });
        let epsg = match (crs, geographic) {
            (Some(epsg), _) => epsg,
            (None, Some(ground)) => utm_epsg(ground.lon_deg, ground.lat_deg)?,
            (None, None) => bail!("the positions are on a map, or there are none: give its --crs"),
        };
        let projection = MapProjection::from_epsg(epsg)?;
        ensure!(
            projection.metres_per_unit() == Some(1.0),
            "EPSG:{epsg} is not projected in metres: choose another --crs"
        );
        let converter = (vertical != VerticalDatum::Ellipsoid).then(|| HeightConverter::new(vertical)).transpose()?;
        let places: Vec<[f64; 3]> = positions
            .iter()
            .map(|position| {
                let ([x, y, height], (lon, lat)) = match position.place {
                    Place::Map(place) => (place, projection.lonlat_from_map(place[0], place[1])?),
                    Place::Geographic(g) => {
                        let map = projection.map_from_lonlat(g.lon_deg, g.lat_deg)?;
                        ([map.x, map.y, g.height_m], (g.lon_deg, g.lat_deg))
                    }
                };
                let height = match &converter {
                    Some(converter) => converter.ellipsoid_from_datum(lon, lat, height)?,
                    None => height,
                };
                Ok([x, y, height])
            })
            .collect::<anyhow::Result<_>>()?;
        // The median: one wild position must not carry the origin away.
        let middle = |axis: usize| {
            let mut values: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0).round()
        };
        let origin = LocalOrigin::new(format!("EPSG:{epsg}"), "ellipsoid", [middle(0), middle(1), middle(2)]);
        Ok(Self { origin, places })
    }

    /// The positions that the model knows: of its images, by name (or by the last part of it, where that is unique), or given in it.
    pub(super) fn known(&self, positions: &[ControlPosition], model: &ColmapModel) -> anyhow::Result<Known> {
        let last = |name: &str| name.rsplit('/').next().unwrap_or(name).to_owned();
        let whole: HashMap<&str, usize> = model.views.iter().enumerate().map(|(i, v)| (v.name.as_str(), i)).collect();
        let mut by_last: HashMap<String, Option<usize>> = HashMap::new();
        for (index, view) in model.views.iter().enumerate() {
            by_last.entry(last(&view.name)).and_modify(|found| *found = None).or_insert(Some(index));
        }
        let mut known = Known { names: Vec::new(), pairs: Vec::new(), unknown: 0 };
        let mut taken = vec![false; model.views.len()];
        for (position, place) in positions.iter().zip(&self.places) {
            let (name, source) = match &position.subject {
                Subject::Model(source) => (format!("point {}", known.pairs.len() + 1), *source),
                Subject::Image(name) => {
                    let found =
                        whole.get(name.as_str()).copied().or_else(|| by_last.get(&last(name)).copied().flatten());
                    let Some(view) = found else {
                        known.unknown += 1;
                        continue;
                    };
                    ensure!(!std::mem::replace(&mut taken[view], true), "image {name:?} has two positions: keep one");
                    (name.clone(), model.views[view].pose.centre)
                }
            };
            let target = [0, 1, 2].map(|i| place[i] - self.origin.origin[i]);
            known.names.push(name);
            known.pairs.push(PointPair { source, target });
        }
        ensure!(!known.pairs.is_empty(), "none of the positions is of an image of the model: compare the names");
        Ok(known)
    }
}
