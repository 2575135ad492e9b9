//! A city model as the prior of the height sweep: what each view would see of it.

use std::path::{Path, PathBuf};

use geodesy::{CrsIdentity, HeightConverter, MapProjection, VerticalDatum};
use mesh::{MeshConfig, Role, TriangleMesh};
use priors::{LinesOfSight, PriorModel, SatelliteMaps};
use raster::Grid;
use sweep::View;

use crate::error::PipelineError;
use crate::setup::Choices;

/// How far the heights of city models are off: roofs of LoD2 models lie within half a metre of laser heights.
pub(crate) const DEVIATION_M: f64 = 0.5;

type Cause = Box<dyn std::error::Error + Send + Sync>;

/// A city model in its map, heights above the ellipsoid.
#[derive(Debug)]
pub(crate) struct CityPrior {
    path: PathBuf,
    model: PriorModel,
    projection: MapProjection,
}

impl CityPrior {
    /// Reads a model; it has to say in which map it is.
    ///
    /// # Errors
    /// [`PipelineError::Prior`].
    pub(crate) fn read(path: &Path, choices: &mut Choices<'_>) -> Result<Self, PipelineError> {
        Self::open(path, choices).map_err(|source| PipelineError::Prior { path: path.to_owned(), source })
    }

    fn open(path: &Path, choices: &mut Choices<'_>) -> Result<Self, Cause> {
        let file = io::city::read(path)?;
        let role = |object: &mesh::CityObject| object.kind.role();
        let is_building: Vec<bool> =
            file.model.objects.iter().map(|object| !matches!(role(object), Role::Other | Role::Interior)).collect();
        let mut mesh = TriangleMesh::from_model(&file.model, &MeshConfig::default())?.mesh;
        if mesh.triangles.is_empty() {
            return Err("no building of the model has a surface; skysweep city info says why".into());
        }
        let crs = &file.model.crs;
        let code = crs.epsg.ok_or("the model does not say in which map it is (EPSG code)")?;
        let definition = format!("EPSG:{code}");
        let projection = MapProjection::from_definition(&definition)?;
        if projection.metres_per_unit() != Some(1.0) {
            return Err(format!("the model is in {definition}, expected a projected system in metres").into());
        }
        let stated = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(CrsIdentity::of(&definition)?.vertical);
        if stated.is_none() {
            choices.warn(format!(
                "the model does not say what its heights are above, taken as the ellipsoid: {}",
                path.display()
            ));
        }
        to_ellipsoid(&mut mesh, &projection, stated.unwrap_or_default())?;
        choices.tell("prior", format!("{} buildings' surfaces", mesh.surfaces.len()), path.display().to_string());
        Ok(Self { path: path.to_owned(), model: PriorModel::new(mesh, &is_building)?, projection })
    }

    /// The model's heights in every view, at its full resolution; `None` for a view that does not see it.
    ///
    /// # Errors
    /// An image that is too large for maps.
    pub(crate) fn seen_from(&self, views: &[View]) -> Result<Vec<Option<Grid<f32>>>, PipelineError> {
        let seen = |view: &View| {
            let size = view.levels.first().map_or((0, 0), |image| (image.width(), image.height()));
            if size.0 == 0 || size.1 == 0 {
                return Ok(None);
            }
            let lines = LinesOfSight::new(&view.camera, size, &self.model, &self.projection)?;
            let maps = SatelliteMaps::render(&self.model, &lines)?;
            Ok((maps.hits() > 0).then_some(maps.height_m))
        };
        let all: Result<_, priors::PriorsError> = views.iter().map(seen).collect();
        all.map_err(|source| PipelineError::Prior { path: self.path.clone(), source: source.into() })
    }
}

/// Heights above the model's datum become heights above the ellipsoid.
fn to_ellipsoid(mesh: &mut TriangleMesh, projection: &MapProjection, datum: VerticalDatum) -> Result<(), Cause> {
    if datum == VerticalDatum::Ellipsoid {
        return Ok(());
    }
    let origin = mesh.origin;
    let (mut x, mut y): (Vec<f64>, Vec<f64>) =
        mesh.positions.iter().map(|p| (p[0] + origin.x, p[1] + origin.y)).unzip();
    projection.lonlat_from_map_slices(&mut x, &mut y)?;
    let mut heights: Vec<f64> = mesh.positions.iter().map(|p| p[2] + origin.z).collect();
    HeightConverter::new(datum)?.ellipsoid_from_datum_slices(&x, &y, &mut heights)?;
    if heights.iter().any(|height| !height.is_finite()) {
        return Err(format!("the model reaches beyond where heights above {datum} are known").into());
    }
    mesh.positions.iter_mut().zip(heights).for_each(|(p, height)| p[2] = height - origin.z);
    Ok(())
}

/// The heights of a level: those of the pixel in the middle of each coarse one, so that edges stay sharp.
pub(crate) fn at_level(height_m: &Grid<f32>, level: usize, (width, height): (usize, usize)) -> Grid<f32> {
    let side = 1usize << level;
    let place = |i: usize, n: usize| (i * side + side / 2).min(n - 1);
    let value = |i: usize| height_m[(place(i % width, height_m.width()), place(i / width, height_m.height()))];
    let mut out = Grid::filled(width, height, f32::NAN);
    out.data_mut().iter_mut().enumerate().for_each(|(i, h)| *h = value(i));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_heights_are_those_of_the_middle() {
        let fine = Grid::from_vec(5, 4, (0..20).map(|i| i as f32).collect()).unwrap();
        assert_eq!(at_level(&fine, 1, (2, 2)).data(), [6.0, 8.0, 16.0, 18.0]);
        assert_eq!(at_level(&fine, 0, (5, 4)), fine);
        assert_eq!(at_level(&fine, 2, (1, 1)).data(), [12.0]);
    }
}
