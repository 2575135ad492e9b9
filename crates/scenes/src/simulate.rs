//! The simulation job: a seeded scene seen through RPC cameras, with its exact surface.
//!
//! Writes `view_1.tif` … (with the RPC in the file), where asked for `ms_1.tif` … (multispectral),
//! the record `scene.json`, the parameters `scene.toml`, and in `truth/` the rasters, the heights
//! of every image and the buildings at LoD2. A flight adds perspective cameras and the points of a
//! reconstruction in `cameras/sparse/0`, in map coordinates, their pictures in `cameras/images`,
//! and the exact surface that they see as clouds in `truth/`. Of given cameras it writes what they
//! see exactly, in `truth/cameras`.

use std::fs;
use std::path::{Path, PathBuf};

use ::simulate::{
    ExactPoint, Flight, FlightPoint, SPECTRAL_BANDS, SceneRecord, SimulateError, SimulatedView, Simulation,
    SimulationConfig, SpectralBand,
};
use camera::{LensError, Pose};
use cityfiles::{CityJsonOptions, write_cityjson};
use crs::Crs;
use formats::colmap::{self, ColmapEncoding, ColmapModel, ColmapObservation, ColmapPoint, ColmapView};
use formats::ply::{PlyPoint, write_points};
use formats::raster::{
    Band, BandData, BandSpectrum, CogRaster, write_cog, write_image_with_rpc, write_multispectral_with_rpc,
    write_png_gray,
};
use formats::splat_ply::LocalOrigin;
use numeric::{Cancelled, Kind, Progress, failures};
use raster::Grid;
use serde::{Deserialize, Serialize};

use crate::simulate_page;
use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::{self, FileError};
use job::guarded;
use job::output_folder::OutputFolder;
use job::placed_model;
use job::threads::install;

/// The record, which is written last.
const RECORD: &str = "scene.json";
/// The page of the record.
const PAGE: &str = "scene.html";
/// The parameters.
const PARAMETERS: &str = "scene.toml";
/// The folder of what given cameras see exactly.
const EXACT_VIEWS: &str = "truth/cameras";
/// The folder of the perspective cameras.
const FLIGHT: &str = "cameras/sparse/0";
/// The folder of their pictures.
const PICTURES: &str = "cameras/images";
/// Folders of a scene.
const FOLDERS: [&str; 6] =
    ["truth", FLIGHT, PICTURES, "truth/cameras/depth", "truth/cameras/part", "truth/cameras/picture"];
/// The clouds of what a flight sees: everything, and the buildings.
const CLOUDS: [&str; 2] = ["truth/flight_surface.ply", "truth/flight_buildings.ply"];
/// Spacing of their points unless another is asked for, metres.
const CLOUD_SPACING_M: f64 = 0.2;

/// A scene to be simulated and the folder for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SimulateConfig {
    /// The scene, its cameras and its radiometry.
    pub scene: SimulationConfig,
    /// Folder for the images and the truth.
    pub output: PathBuf,
    /// Perspective cameras whose exact depths, parts of the scene and pictures are written: folder
    /// of a COLMAP model on the map of the scene, with `origin.json`.
    pub cameras: Option<PathBuf>,
    /// Number of perspective cameras around the scene; none when 0.
    pub flight: u32,
    /// Azimuths between which the perspective cameras stand, degrees clockwise from north; all
    /// around when `None`.
    pub flight_arc_deg: Option<[f64; 2]>,
    /// Edge of the cubes that hold one point of the exact surface each, metres. Distances of a mesh
    /// from the cloud are too large by about half of it.
    pub flight_spacing_m: f64,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether the files of an earlier simulation may be replaced.
    pub overwrite: bool,
}

/// What was simulated.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SimulateReport {
    /// The scene, as it is written to `scene.json`.
    pub scene: SceneRecord,
    /// Number of satellite views.
    pub views: usize,
    /// Number of perspective cameras.
    pub flight: u32,
    /// Folder of the files.
    pub output: PathBuf,
}

/// A simulation that could not be made or written.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SimulateJobError {
    /// The parameters describe no scene, or the cameras do not see it.
    #[error(transparent)]
    Scene(#[from] SimulateError),
    /// A parameter file cannot be used.
    #[error("in the parameter file: {}", path.display())]
    Parameters {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: SimulateError,
    },
    /// The output folder holds files.
    #[error("the output folder is not empty: {}", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A perspective camera cannot be made.
    #[error(transparent)]
    Flight(#[from] LensError),
    /// A given camera has no lens.
    #[error("the camera has no lens in the model: {name}")]
    NoLens {
        /// Name of the camera.
        name: String,
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(SimulateJobError: Other {
    Self::Scene(_) | Self::Parameters { .. } => Kind::Input,
    Self::NotEmpty { .. } => Kind::OutputExists,
    Self::Job(error) => error.kind(),
});

job_errors!(SimulateJobError {
    Self::NotEmpty { .. } => Some("the output folder"),
});

from_steps!(SimulateJobError: Job(FileError, SettingError, Cancelled));

impl SimulateReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let SceneRecord { buildings, trees, .. } = &self.scene;
        let (views, folder) = (self.views, self.output.display());
        format!("scene      {views} views of {buildings} buildings and {trees} trees\nwritten    {folder}\n")
    }
}

impl SimulateConfig {
    /// A simulation of `scene` without a flight, in a folder that is empty.
    pub fn new(scene: SimulationConfig, output: PathBuf) -> Self {
        Self {
            scene,
            output,
            cameras: None,
            flight: 0,
            flight_arc_deg: None,
            flight_spacing_m: CLOUD_SPACING_M,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the parameters of the scene and the flight.
    ///
    /// # Errors
    /// [`JobError`] for parameters, an arc or a spacing out of range.
    pub fn validate(&self) -> Result<(), JobError> {
        if let Some(end) = self.flight_arc_deg.iter().flatten().find(|end| !(-360.0..=360.0).contains(*end)) {
            return Err(SettingError::new("an end of the arc of the flight", *end, "-360 to 360").into());
        }
        if !(0.01..=100.0).contains(&self.flight_spacing_m) {
            let found = self.flight_spacing_m;
            return Err(SettingError::new("the spacing of the exact surface", found, "0.01 to 100 metres").into());
        }
        Ok(self.scene.validate().map_err(SimulateJobError::from)?)
    }
}

/// Reads the parameters of a scene from a TOML file.
///
/// # Errors
/// [`JobError`]: a file that cannot be read, or holds no parameters of a scene.
pub fn read_scene(path: &Path) -> Result<SimulationConfig, JobError> {
    let text = files::read_text(path)?;
    let refused = |source| SimulateJobError::Parameters { path: path.to_owned(), source };
    Ok(SimulationConfig::from_toml(&text).map_err(refused)?)
}

/// Simulates a scene and writes its images and its truth.
///
/// # Errors
/// [`JobError`]: parameters out of range, a folder that is not empty, a file that cannot be
/// written.
///
/// ```
/// use scenes::simulate::{SimulateConfig, run};
/// use simulate::SimulationConfig;
/// let folder = tempfile::tempdir()?;
/// let mut scene = SimulationConfig::preset("town")?;
/// (scene.size_m, scene.gsd_m, scene.views) = (100.0, 2.0, 2);
/// let report = run(&SimulateConfig::new(scene, folder.path().join("scene")), &numeric::Silent)?;
/// assert!(report.views == 2 && report.output.join("truth/dsm.tif").is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &SimulateConfig, progress: &dyn Progress) -> Result<SimulateReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &SimulateConfig, progress: &dyn Progress) -> Result<SimulateReport, SimulateJobError> {
    config.validate()?;
    let output = &config.output;
    let folder = OutputFolder::take(output)?;
    if !config.overwrite && fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(SimulateJobError::NotEmpty { path: output.clone() });
    }
    folder.check_folders(FOLDERS)?;
    let simulation = install(config.threads, || Simulation::with_progress(config.scene.clone(), progress))??;
    progress.check_cancelled()?;
    // Without its record the folder counts as incomplete from here on.
    [RECORD, PAGE].into_iter().try_for_each(|name| folder.remove(name))?;
    remove_earlier(&folder, config.flight > 0)?;
    folder.subfolder("truth")?;
    let writer = SceneWriter { simulation: &simulation, folder: output, overwrite: config.overwrite };
    install(config.threads, || writer.write(config, progress))??;
    Ok(SimulateReport {
        scene: simulation.record(),
        views: simulation.views.len(),
        flight: config.flight,
        output: output.clone(),
    })
}

/// Removes what only an earlier simulation has: views and their truth beyond the number of this
/// one, clouds, and the cameras of a flight. In a folder without its parameters nothing is removed.
fn remove_earlier(folder: &OutputFolder, has_flight: bool) -> Result<(), FileError> {
    if !folder.path().join(PARAMETERS).is_file() {
        return Ok(());
    }
    for (below, stems) in [("", &["view", "ms"][..]), ("truth/", &["heights", "clouds"])] {
        for name in files::names_in(&folder.path().join(below)) {
            let numbered = name.strip_suffix(".tif").and_then(|name| name.rsplit_once('_'));
            let is_earlier = |(stem, number): (&str, &str)| {
                stems.contains(&stem) && !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
            };
            if numbered.is_some_and(is_earlier) {
                folder.remove(&format!("{below}{name}"))?;
            }
        }
    }
    for name in files::names_in(&folder.path().join(PICTURES)) {
        let number = name.strip_prefix("flight_").and_then(|name| name.strip_suffix(".png"));
        if number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())) {
            folder.remove(&format!("{PICTURES}/{name}"))?;
        }
    }
    // A view has a file of each kind. A file that stands alone may be the user's.
    let kinds = [("depth", "npy"), ("part", "png"), ("picture", "png")];
    let of_view = |stem: &str| kinds.map(|(kind, ending)| format!("{EXACT_VIEWS}/{kind}/{stem}.{ending}"));
    for name in files::names_in(&folder.path().join(EXACT_VIEWS).join(kinds[0].0)) {
        let own = name.strip_suffix(".npy").map(of_view);
        for name in own.iter().filter(|own| own.iter().all(|name| folder.path().join(name).is_file())).flatten() {
            folder.remove(name)?;
        }
    }
    let cameras = ["cameras.txt", "images.txt", "points3D.txt"].map(|name| format!("{FLIGHT}/{name}"));
    let of_flight = cameras.iter().map(String::as_str).chain(CLOUDS);
    of_flight.filter(|_| !has_flight).try_for_each(|name| folder.remove(name))
}

/// A simulation and the folder that it is written to.
struct SceneWriter<'a> {
    simulation: &'a Simulation,
    folder: &'a Path,
    overwrite: bool,
}

impl SceneWriter<'_> {
    fn write(&self, config: &SimulateConfig, progress: &dyn Progress) -> Result<(), SimulateJobError> {
        for (number, view) in (1..).zip(&self.simulation.views) {
            self.write_view(number, view)?;
        }
        let truth = &self.simulation.truth;
        self.write_map("dsm.tif", &[Band { description: "height_m", data: BandData::F32(&truth.dsm) }])?;
        self.write_map("dtm.tif", &[Band { description: "height_m", data: BandData::F32(&truth.dtm) }])?;
        self.write_map("classes.tif", &[Band { description: "class", data: BandData::U8(&truth.classes) }])?;
        self.write_map(
            "buildings.tif",
            &[Band { description: "building_number", data: BandData::I32(&truth.objects) }],
        )?;
        self.write_map("ortho.tif", &[Band { description: "reflectance_1e-4", data: BandData::U16(&truth.ortho) }])?;
        let names: Vec<String> = (1..=truth.visibility.len()).map(|view| format!("seen_by_view_{view}")).collect();
        let seen = names.iter().zip(&truth.visibility);
        let seen = seen.map(|(name, grid)| Band { description: name, data: BandData::U8(grid) });
        self.write_map("visibility.tif", &seen.collect::<Vec<_>>())?;
        let options = CityJsonOptions { overwrite: self.overwrite, ..CityJsonOptions::default() };
        write_cityjson(&self.folder.join("truth/buildings.city.json"), &truth.buildings, &options)
            .map_err(FileError::write)?;
        if config.flight > 0 {
            self.write_flight(config, progress)?;
        }
        if let Some(cameras) = &config.cameras {
            self.write_exact_views(cameras, progress)?;
        }
        // The parameters and the record of an earlier simulation are replaced: the folder was
        // checked at the start.
        let parameters = self.simulation.config.to_toml()?;
        formats::write_bytes(self.folder.join(PARAMETERS), parameters.as_bytes(), true).map_err(FileError::write)?;
        Ok(simulate_page::write(&self.folder.join(RECORD), &self.simulation.record(), truth)?)
    }

    fn write_view(&self, number: usize, view: &SimulatedView) -> Result<(), FileError> {
        let image = [Band { description: "panchromatic", data: BandData::U16(&view.image) }];
        let path = self.folder.join(format!("view_{number}.tif"));
        write_image_with_rpc(path, &image, &view.rpc, Some(0.0), self.overwrite)?;
        // Truth in the grid of the image keeps the true RPC, which turns a pixel and its height
        // into a place.
        let path = |what: &str| self.folder.join("truth").join(format!("{what}_{number}.tif"));
        let heights = [Band { description: "height_m", data: BandData::F32(&view.heights) }];
        let no_data = Some(f64::from(raster::NO_DATA));
        write_image_with_rpc(path("heights"), &heights, &view.true_rpc, no_data, self.overwrite)?;
        if let Some(image) = &view.multispectral {
            let bands: Vec<(Band<'_>, BandSpectrum<'_>)> =
                SPECTRAL_BANDS.iter().zip(&image.bands).map(spectral).collect();
            let path = self.folder.join(format!("ms_{number}.tif"));
            write_multispectral_with_rpc(path, &bands, &image.rpc, Some(0.0), self.overwrite)?;
        }
        if let Some(cover) = &view.clouds {
            let clouds = [Band { description: "cloud", data: BandData::U8(cover) }];
            write_image_with_rpc(path("clouds"), &clouds, &view.true_rpc, None, self.overwrite)?;
        }
        Ok(())
    }

    fn write_flight(&self, config: &SimulateConfig, progress: &dyn Progress) -> Result<(), SimulateJobError> {
        let flight = self.simulation.flight(config.flight as usize, config.flight_arc_deg)?;
        let view = |(id, pose): (u32, &Pose)| ColmapView { id, name: picture_name(id), lens: 0, pose: *pose };
        let views = (1..).zip(&flight.poses).map(view).collect();
        let model = ColmapModel { lenses: vec![flight.lens.clone()], views };
        let points: Vec<ColmapPoint> = self.simulation.flight_points(&flight).into_iter().map(colmap_point).collect();
        let folder = guarded::make_folder(self.folder, FLIGHT)?;
        colmap::write(&folder, &model, &points, ColmapEncoding::Text, self.overwrite).map_err(FileError::write)?;
        guarded::make_folder(self.folder, PICTURES)?;
        progress.begin("flight", Simulation::flight_picture_steps(&flight.lens) * flight.poses.len());
        for (id, pose) in (1..).zip(&flight.poses) {
            progress.check_cancelled()?;
            let picture = self.simulation.flight_picture(&flight.lens, pose, progress);
            write_png_gray(self.folder.join(PICTURES).join(picture_name(id)), &picture, self.overwrite)
                .map_err(FileError::write)?;
        }
        self.write_clouds(&flight, config.flight_spacing_m)
    }

    fn write_exact_views(&self, cameras: &Path, progress: &dyn Progress) -> Result<(), SimulateJobError> {
        let map = LocalOrigin::new(format!("EPSG:{}", self.simulation.truth.epsg), "ellipsoid", [0.0; 3]);
        let model = placed_model::read(cameras, &map)?;
        progress.begin("cameras", model.views.len());
        for view in &model.views {
            progress.check_cancelled()?;
            let lens =
                model.lenses.get(view.lens).ok_or_else(|| SimulateJobError::NoLens { name: view.name.clone() })?;
            let name = files::flat_stem(&view.name);
            let path = |kind: &str, ending: &str| {
                let folder = guarded::make_folder(self.folder, &format!("{EXACT_VIEWS}/{kind}"))?;
                Ok::<_, FileError>(folder.join(format!("{name}.{ending}")))
            };
            let exact = self.simulation.exact_view(lens, &view.pose);
            let shape = [exact.depth_m.height(), exact.depth_m.width()];
            formats::npy::write(path("depth", "npy")?, &shape, exact.depth_m.data(), self.overwrite)
                .map_err(FileError::write)?;
            write_png_gray(path("part", "png")?, &exact.part, self.overwrite).map_err(FileError::write)?;
            let picture = self.simulation.flight_picture(lens, &view.pose, &numeric::Silent);
            write_png_gray(path("picture", "png")?, &picture, self.overwrite).map_err(FileError::write)?;
            progress.step();
        }
        Ok(())
    }

    fn write_clouds(&self, flight: &Flight, spacing_m: f64) -> Result<(), SimulateJobError> {
        let surface = self.simulation.flight_surface(flight, spacing_m);
        let origin = surface.first().map_or([0.0; 3], |point| point.position.map(f64::floor));
        let [x, y, z] = origin;
        let comments = [format!("origin {x} {y} {z}"), format!("crs EPSG:{}", self.simulation.truth.epsg)];
        let point = |point: &ExactPoint| PlyPoint {
            position: [0, 1, 2].map(|i| (point.position[i] - origin[i]) as f32),
            normal: point.normal.map(|c| c as f32),
            color: [128; 3],
        };
        let buildings: Vec<ExactPoint> = surface.iter().filter(|point| point.on_building).copied().collect();
        for (name, points) in CLOUDS.iter().zip([&surface, &buildings]) {
            write_points(self.folder.join(name), points.iter().map(point), &comments, self.overwrite)
                .map_err(FileError::write)?;
        }
        Ok(())
    }

    fn write_map(&self, name: &str, bands: &[Band<'_>]) -> Result<(), FileError> {
        let truth = &self.simulation.truth;
        let holds_heights = bands.iter().all(|band| band.description == "height_m");
        let crs = Crs::ellipsoidal(truth.epsg);
        let cog = CogRaster { holds_heights, ..CogRaster::new(bands, truth.geotransform, crs) };
        Ok(write_cog(self.folder.join("truth").join(name), &cog, self.overwrite)?)
    }
}

/// Returns a band of a multispectral image with its name, colour and wavelength.
fn spectral<'a>((band, numbers): (&'a SpectralBand, &'a Grid<u16>)) -> (Band<'a>, BandSpectrum<'a>) {
    let spectrum = BandSpectrum { colour: band.name, centre_um: band.centre_um, width_um: band.width_um };
    (Band { description: band.name, data: BandData::U16(numbers) }, spectrum)
}

fn picture_name(id: u32) -> String {
    format!("flight_{id:02}.png")
}

fn colmap_point(point: FlightPoint) -> ColmapPoint {
    ColmapPoint {
        position: point.position,
        color: [point.grey; 3],
        error_px: point.error_px,
        track: point.seen.iter().map(|&(view, pixel)| ColmapObservation { view: view as u32, pixel }).collect(),
    }
}
