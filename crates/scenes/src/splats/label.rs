//! Carries class and object of a city model onto splats of any origin: of a surface model, of a
//! training, of another program.
//!
//! The rule is [`::priors::splat_labels`]: a splat takes the nearest surface when its mass lies on
//! it within a tolerance. Splats on a map are brought to the model by the origin beside them,
//! others by a similarity.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use ::priors::{ModelPlace, PriorModel, buildings_of, splat_labels};
use camera::{Similarity, SimilarityError};
use city::{CrsReference, MeshConfig, SurfaceClass, TriangleMesh};
use crs::{CrsIdentity, VerticalDatum};
use formats::splat_files;
use formats::splat_ply::LocalOrigin;
use gaussian::SplatLabel;
use numeric::Progress;
use serde::{Deserialize, Serialize};

use super::convert::format_of;
use super::error::SplatsJobError;
use super::make::pointing_path;
use crate::priors::with_table;
use job::corrections::Corrections;
use job::dataset_folder::{UNKNOWN_DATUM, UNKNOWN_FRAME};
use job::error::{JobError, SettingError};
use job::files;
use job::threads::install;

/// Tolerance of the default, metres: eaves overhang walls by about half a metre, which LoD2 models
/// leave out, and their footprints and roofs are as near to the truth as that.
const TOLERANCE_M: f64 = 0.5;

/// Splats that take the labels of a city model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SplatLabelConfig {
    /// File of splats of any format, with its origin beside it where it lies on a map.
    pub splats: PathBuf,
    /// City model: CityJSON, CityGML, OBJ, PLY.
    pub city: PathBuf,
    /// File to write, a PLY: the other formats hold no labels. The origin and the table of the
    /// objects go beside it.
    pub output: PathBuf,
    /// Greatest root mean square distance of a splat's mass from the surface that it takes, metres
    /// of the city model.
    pub tolerance_m: f64,
    /// Similarity from the city model to the frame that the origin of the splats is counted in
    /// (JSON), where the two do not lie on one map.
    pub transform: Option<PathBuf>,
    /// Vertical datum of the heights of the city model; the one that its file states when `None`.
    pub vertical: Option<VerticalDatum>,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

/// What the splats were labelled with.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SplatLabelReport {
    /// Number of splats.
    pub splats: usize,
    /// Number of splats that lie on a surface of the city model.
    pub labelled: usize,
    /// Number of labelled splats of each class.
    pub classes: BTreeMap<String, usize>,
    /// Number of objects that have splats.
    pub objects: usize,
    /// Number of objects with surfaces in the city model.
    pub objects_of_model: usize,
}

impl SplatLabelConfig {
    /// Labels of a city model under the default tolerance.
    pub fn new(splats: PathBuf, city: PathBuf, output: PathBuf) -> Self {
        let (transform, vertical, threads) = (None, None, None);
        Self { splats, city, output, tolerance_m: TOLERANCE_M, transform, vertical, threads, overwrite: false }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] for a tolerance or an ending that is none.
    pub fn validate(&self) -> Result<(), SettingError> {
        if !(self.tolerance_m > 0.0 && self.tolerance_m.is_finite()) {
            return Err(SettingError::new("the tolerance of labels", self.tolerance_m, "more than 0 m"));
        }
        if !format_of(&self.output)?.holds_labels() {
            let expected = "one that ends in .ply, which alone holds classes and objects";
            return Err(SettingError::new("the file of labelled splats", self.output.display(), expected));
        }
        Ok(())
    }
}

impl SplatLabelReport {
    fn new(labels: &[SplatLabel], mesh: &TriangleMesh) -> Self {
        let mut classes = BTreeMap::new();
        let labelled: Vec<&SplatLabel> = labels.iter().filter(|label| !label.is_none()).collect();
        for class in labelled.iter().filter_map(|label| SurfaceClass::from_number(label.class)) {
            *classes.entry(class.name().to_owned()).or_default() += 1;
        }
        Self {
            splats: labels.len(),
            labelled: labelled.len(),
            classes,
            objects: labelled.iter().map(|label| label.object).collect::<BTreeSet<u32>>().len(),
            objects_of_model: mesh.surfaces.iter().map(|surface| surface.object).collect::<BTreeSet<u32>>().len(),
        }
    }

    /// Returns the report of `output` as text, which ends in a line break.
    pub fn text(&self, output: &Path) -> String {
        let share = 100.0 * self.labelled as f64 / self.splats.max(1) as f64;
        let classes: Vec<String> = self.classes.iter().map(|(name, count)| format!("{count} {name}")).collect();
        format!(
            "splats     {}, {} of them on the city model ({share:.1} %)\nclasses    {}\nobjects    {} of {} have splats\n\
             written    {}\n",
            self.splats,
            self.labelled,
            if classes.is_empty() { "-".to_owned() } else { classes.join(", ") },
            self.objects,
            self.objects_of_model,
            output.display()
        )
    }
}

/// Labels splats.
///
/// # Errors
/// [`JobError`]: settings out of their range, files that hold no splats or no city model,
/// splats and a model that do not lie on one map, an output that exists.
///
/// ```
/// use scenes::splats::{SplatLabelConfig, SplatsConfig, label, make};
/// let town = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
/// let folder = tempfile::tempdir()?;
/// let ply = folder.path().join("town.ply");
/// let mut coarse = SplatsConfig::new(town.join("truth/dsm.tif"), vec![town.join("view_1.tif")], ply.clone());
/// (coarse.uniform_side, coarse.compare) = (Some(4), false);
/// make(&coarse, &numeric::Silent)?;
/// let city = town.join("truth/buildings.city.json");
/// let report = label(&SplatLabelConfig::new(ply, city, folder.path().join("labelled.ply")), &numeric::Silent)?;
/// assert!(report.objects > 0 && report.labelled < report.splats);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn label(config: &SplatLabelConfig, progress: &dyn Progress) -> Result<SplatLabelReport, JobError> {
    config.validate()?;
    files::check_destination(&config.output, config.overwrite)?;
    Ok(install(config.threads, || label_and_write(config, progress))??)
}

fn label_and_write(config: &SplatLabelConfig, progress: &dyn Progress) -> Result<SplatLabelReport, SplatsJobError> {
    let mut file = splat_files::read(&config.splats)?;
    let city = cityfiles::read(&config.city)?.model;
    let mut mesh = TriangleMesh::from_model(&city, &MeshConfig::default())?.mesh;
    if mesh.triangles.is_empty() {
        return Err(SplatsJobError::NoSurface { path: config.city.clone(), objects: city.objects.len() });
    }
    progress.check_cancelled()?;
    let mesh_from_splats = mesh_from_splats(config, file.origin.as_ref(), &city.crs, &mut mesh, progress)?;
    let model = PriorModel::new(mesh, &buildings_of(&city))?;
    let labels = splat_labels(&model, &file.splats, &mesh_from_splats, config.tolerance_m)?;
    progress.check_cancelled()?;
    let report = SplatLabelReport::new(&labels, model.mesh());
    if report.labelled == 0 {
        progress.warn("no splat lies on the city model: check that the two lie in one place, and the tolerance");
    }
    let beside = pointing_path(&config.splats);
    if beside.is_file() && beside != pointing_path(&config.output) {
        Corrections::read(&beside)?.write(&pointing_path(&config.output), config.overwrite)?;
    }
    file.labels = Some(with_table(labels, &city));
    splat_files::write(&config.output, &file, config.overwrite)?;
    Ok(report)
}

/// Returns how positions of the splats become positions in the mesh. The heights of the mesh are
/// brought to the datum of the splats.
fn mesh_from_splats(
    config: &SplatLabelConfig,
    origin: Option<&LocalOrigin>,
    crs: &CrsReference,
    mesh: &mut TriangleMesh,
    progress: &dyn Progress,
) -> Result<Similarity, SplatsJobError> {
    let start = [mesh.origin.x, mesh.origin.y, mesh.origin.z];
    let local = origin.map_or([0.0; 3], |origin| origin.origin);
    if let Some(path) = &config.transform {
        let model_from_frame = formats::similarity::read(path)?.inverse();
        return Ok(shift(start.map(|c| -c))?.after(&model_from_frame.after(&shift(local)?)));
    }
    let unplaced = || SplatsJobError::NotPlaced { path: config.splats.clone() };
    let origin = origin.filter(|origin| origin.crs != UNKNOWN_FRAME).ok_or_else(unplaced)?;
    // A dataset of the model itself names its system as the model does, and has its heights.
    if origin.vertical != UNKNOWN_DATUM || origin.crs != crs.to_string() {
        let map = CrsIdentity::of(&origin.crs).map_err(|_| unplaced())?.horizontal;
        bring_to(config, origin, map, crs, mesh, progress)?;
    }
    Ok(shift([0, 1, 2].map(|i| local[i] - start[i]))?)
}

/// Checks that a model lies on the map of the splats, and brings its heights to their datum.
fn bring_to(
    config: &SplatLabelConfig,
    origin: &LocalOrigin,
    map: Option<u32>,
    crs: &CrsReference,
    mesh: &mut TriangleMesh,
    progress: &dyn Progress,
) -> Result<(), SplatsJobError> {
    if crs.epsg.is_none() {
        progress.warn("the city model names no reference system, so it is taken as that of the splats");
    }
    let place = ModelPlace::of(crs, map.filter(|_| crs.epsg.is_none()), config.vertical)?;
    let own = CrsIdentity::of(place.projection.definition())?.horizontal;
    let datum = || place.datum.map_or("an unknown datum".to_owned(), |datum| datum.to_string());
    let other = || SplatsJobError::OtherMap {
        splats: Box::new(origin.clone()),
        city: place.projection.definition().to_owned(),
        vertical: datum(),
    };
    if own.is_none() || own != map {
        return Err(other());
    }
    match origin.vertical.parse::<VerticalDatum>() {
        Ok(VerticalDatum::Ellipsoid) => {
            if place.datum.is_none() {
                progress.warn(
                    "the city model does not state the vertical datum of its heights, so they are taken as ellipsoidal",
                );
            }
            Ok(place.to_ellipsoid(mesh)?)
        }
        Ok(vertical) if place.datum.is_some_and(|known| known != vertical) => Err(other()),
        _ => Ok(()),
    }
}

fn shift(by: [f64; 3]) -> Result<Similarity, SimilarityError> {
    Similarity::new(1.0, Similarity::IDENTITY.rotation(), by)
}
