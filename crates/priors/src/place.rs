//! The place of a city model on the Earth: the map projection and the vertical datum.
//!
//! RPCs use heights above the WGS 84 ellipsoid, so the heights of the model are converted first.

use city::{CrsReference, TriangleMesh};
use crs::{CrsIdentity, HeightConverter, MapProjection, VerticalDatum};

use crate::PriorsError;

/// Map projection and vertical datum of a model.
#[derive(Debug)]
pub struct ModelPlace {
    /// Map projection, in metres.
    pub projection: MapProjection,
    /// Vertical datum of the heights; `None` when it is unknown, which counts as the ellipsoid.
    pub datum: Option<VerticalDatum>,
}

impl ModelPlace {
    /// Returns the place that a model names. `map_epsg` and `datum` override the model.
    ///
    /// # Errors
    /// - [`PriorsError::MapUnknown`] when there is no EPSG code.
    /// - [`PriorsError::MapNotMetric`] when the coordinates are not in metres.
    /// - [`PriorsError::Geodesy`] when PROJ does not know the code.
    pub fn of(crs: &CrsReference, map_epsg: Option<u32>, datum: Option<VerticalDatum>) -> Result<Self, PriorsError> {
        let stated = crs.epsg.map(|code| CrsIdentity::of(&format!("EPSG:{code}"))).transpose()?;
        let code = map_epsg.or(crs.epsg).ok_or_else(|| PriorsError::MapUnknown { crs: crs.to_string() })?;
        let definition = format!("EPSG:{code}");
        let projection = MapProjection::from_definition(&definition)?;
        if projection.metres_per_unit() != Some(1.0) {
            return Err(PriorsError::MapNotMetric { definition });
        }
        let in_file = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(stated.and_then(|identity| identity.vertical));
        Ok(Self { projection, datum: datum.or(in_file) })
    }

    /// Returns the vertical datum, or the ellipsoid when it is unknown.
    pub fn datum(&self) -> VerticalDatum {
        self.datum.unwrap_or_default()
    }

    /// Converts the heights of a mesh in this map to heights above the WGS 84 ellipsoid.
    ///
    /// # Errors
    /// - [`PriorsError::Geodesy`] when a position cannot be projected, or the grid of the datum is
    ///   missing.
    /// - [`PriorsError::BeyondDatum`] when the mesh extends beyond the grid. The mesh is unchanged
    ///   then.
    pub fn to_ellipsoid(&self, mesh: &mut TriangleMesh) -> Result<(), PriorsError> {
        let datum = self.datum();
        if datum == VerticalDatum::Ellipsoid {
            return Ok(());
        }
        let origin = mesh.origin;
        let (mut x, mut y): (Vec<f64>, Vec<f64>) =
            mesh.positions.iter().map(|p| (p[0] + origin.x, p[1] + origin.y)).unzip();
        self.projection.lonlat_from_map_slices(&mut x, &mut y)?;
        let mut heights: Vec<f64> = mesh.positions.iter().map(|p| p[2] + origin.z).collect();
        HeightConverter::new(datum)?.ellipsoid_from_datum_slices(&x, &y, &mut heights)?;
        if heights.iter().any(|height| !height.is_finite()) {
            return Err(PriorsError::BeyondDatum { datum });
        }
        mesh.positions.iter_mut().zip(heights).for_each(|(p, height)| p[2] = height - origin.z);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_goes_before_what_the_model_says() {
        let place = |epsg, vertical, asked, datum| {
            ModelPlace::of(&CrsReference { name: None, epsg, vertical_epsg: vertical }, asked, datum)
        };
        let dutch = place(Some(7415), None, None, None).unwrap();
        assert!(dutch.datum.is_some() && dutch.projection.definition().contains("7415"));
        let above_sea = Some(VerticalDatum::from_epsg(5773));
        let asked = place(Some(25832), Some(7837), Some(32632), above_sea).unwrap();
        assert_eq!((asked.datum, asked.projection.definition()), (above_sea, "EPSG:32632"));
        assert_eq!(place(Some(25832), None, None, None).unwrap().datum(), VerticalDatum::Ellipsoid);
        assert!(matches!(place(None, None, None, None), Err(PriorsError::MapUnknown { .. })));
        assert!(matches!(place(Some(4326), None, None, None), Err(PriorsError::MapNotMetric { .. })));
    }
}
