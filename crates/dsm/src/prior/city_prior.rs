//! A city model as the prior of the height sweep.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use city::{MeshConfig, ModelError, TriangleMesh};
use cityfiles::CityError;
use crs::CrsError;
use numeric::{Failure, failures};
use priors::{LinesOfSight, ModelPlace, PriorModel, PriorsError, SatelliteMaps, buildings_of};
use reconstruct::{DsmGrid, MapBounds, ViewPrior};
use report::{counted, plain_number};
use sweep::SweepView;

use crate::error::DsmError;
use crate::notes::Notes;

#[derive(Debug, thiserror::Error)]
enum Cause {
    #[error(transparent)]
    Unreadable(#[from] CityError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Crs(#[from] CrsError),
    #[error(transparent)]
    Priors(#[from] PriorsError),
    #[error("no building of the model has a usable surface")]
    NothingUsable,
}

impl Cause {
    fn about(self, path: &Path) -> DsmError {
        DsmError::Prior { path: path.to_owned(), kind: self.kind(), source: self.into() }
    }
}

failures!(Cause: Other {
    Self::Unreadable(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Priors(error) => error.kind(),
});

/// A city model in its map, with heights above the ellipsoid.
#[derive(Debug)]
pub(crate) struct CityPrior {
    path: PathBuf,
    model: PriorModel,
    place: ModelPlace,
    /// Identifiers of all objects, in the order of their numbers.
    pub(crate) ids: Vec<String>,
    /// Numbers of buildings' objects and of their surfaces, in words.
    size: String,
}

/// Where the buildings of a model stand on the map of a grid.
struct ModelExtent {
    /// Smallest rectangle around them.
    bounds: MapBounds,
    /// Whether one of them stands on the grid.
    has_building: bool,
}

impl CityPrior {
    /// Reads a model, which must name its CRS.
    ///
    /// # Errors
    /// [`DsmError::Prior`].
    pub(crate) fn read(path: &Path) -> Result<Self, DsmError> {
        Self::open(path).map_err(|cause| cause.about(path))
    }

    fn open(path: &Path) -> Result<Self, Cause> {
        let file = cityfiles::read(path)?;
        let mut mesh = TriangleMesh::from_model(&file.model, &MeshConfig::default())?.mesh;
        if mesh.triangles.is_empty() {
            return Err(Cause::NothingUsable);
        }
        let place = ModelPlace::of(&file.model.crs, None, None)?;
        place.to_ellipsoid(&mut mesh)?;
        let objects: HashSet<u32> = mesh.surfaces.iter().map(|surface| surface.object).collect();
        let size = format!("{} with {}", counted(objects.len(), "object"), counted(mesh.surfaces.len(), "surface"));
        let ids = file.model.objects.iter().map(|object| object.id.clone()).collect();
        let model = PriorModel::new(mesh, &buildings_of(&file.model))?;
        Ok(Self { path: path.to_owned(), model, place, ids, size })
    }

    /// Notes the use of the model, and warns when none of its buildings stands in the scene.
    ///
    /// # Errors
    /// [`DsmError::Crs`].
    pub(crate) fn note(&self, grid: &DsmGrid, notes: &mut Notes<'_>) -> Result<(), DsmError> {
        let path = self.path.display();
        if self.place.datum.is_none() {
            notes.warn(format!("the model does not say what its heights are above, taken as the ellipsoid: {path}"));
        }
        notes.choose("prior", self.size.clone(), path.to_string());
        let (scene, extent) = (grid.bounds(), self.extent_on(grid)?);
        if !extent.has_building {
            let in_words = |bounds: MapBounds| bounds.to_array().map(plain_number).join(", ");
            notes.warn(format!(
                "no building of the city model stands in the scene, so it does not help: the model covers [{}], the \
                 scene [{}] in EPSG:{}; check the model's place and CRS: {path}",
                in_words(extent.bounds),
                in_words(scene),
                grid.epsg
            ));
        }
        Ok(())
    }

    /// Finds where the buildings stand on the map of a grid.
    fn extent_on(&self, grid: &DsmGrid) -> Result<ModelExtent, CrsError> {
        let (mesh, scene) = (self.model.mesh(), grid.bounds());
        let place = |p: &[f64; 3]| (p[0] + mesh.origin.x, p[1] + mesh.origin.y);
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = mesh.positions.iter().map(place).unzip();
        self.place.projection.lonlat_from_map_slices(&mut x, &mut y)?;
        grid.projection()?.map_from_lonlat_slices(&mut x, &mut y)?;
        let mut extent = ModelExtent { bounds: MapBounds::EMPTY, has_building: false };
        for (_, triangle) in mesh.triangles.iter().enumerate().filter(|(t, _)| self.model.is_building(*t)) {
            let corners = triangle.map(|corner| (x[corner as usize], y[corner as usize]));
            let covered = corners.iter().fold(MapBounds::EMPTY, |bounds, (x, y)| bounds.including(*x, *y));
            extent.has_building |= covered.meets(scene);
            extent.bounds = corners.iter().fold(extent.bounds, |bounds, (x, y)| bounds.including(*x, *y));
        }
        Ok(extent)
    }

    /// Renders the model into every view; `None` for a view that does not see it. `gsd_m` is a
    /// pixel on the ground.
    ///
    /// # Errors
    /// [`DsmError::Prior`] for an image that is too large for maps.
    pub(crate) fn seen_from(&self, views: &[SweepView], gsd_m: f64) -> Result<Vec<Option<ViewPrior>>, DsmError> {
        let seen = |view: &SweepView| {
            let size = view.levels.first().map_or((0, 0), |image| (image.width(), image.height()));
            if size.0 == 0 || size.1 == 0 {
                return Ok(None);
            }
            let lines = LinesOfSight::new(&view.camera, size, &self.model, &self.place.projection)?;
            let maps = SatelliteMaps::render(&self.model, &lines)?;
            Ok((maps.hits() > 0).then_some(ViewPrior { height_m: maps.height_m, object: maps.object, gsd_m }))
        };
        let all: Result<_, PriorsError> = views.iter().map(seen).collect();
        all.map_err(|error| Cause::from(error).about(&self.path))
    }
}
