//! The export job: images and cameras as a dataset in the layout of Sat-NeRF, which EOGS reads too.
//!
//! `cameras/NAME.json` holds the size, the RPC in rpcm's words, the sun, the date, the outline and
//! the range of heights of an image; `train.txt` and `test.txt` beside them name these files.
//! `images/NAME.tif` has the pixels as three bands of 8 bits, with the same RPC in its tag. The
//! RPCs include the pointing corrections of the run. Images of a run are cut to the ground of its
//! surface model. `dataset.json`, which is written last, is the report.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use camera::{ImagePoint, Rpc, RpcCamera};
use formats::raster::{Band, BandData, ImageSource, SampleType, iso_time, write_image_with_rpc};
use formats::rpc::RpcFormat;
use formats::stac::SunPosition;
use geodesy::LonLatHeight;
use numeric::{Progress, percentile};
use raster::{Grid, Window};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::error::RpcJobError;
use super::export_scene::{Scene, scene_of};
use job::error::{JobError, SettingError};
use job::files;
use job::output_folder::OutputFolder;

/// The report, which is written last.
const RECORD: &str = "dataset.json";
/// Folders of the dataset.
const CAMERAS: &str = "cameras";
const IMAGES: &str = "images";
/// Files beside the cameras. Sat-NeRF writes the last one itself, from the cameras.
const LISTS: [&str; 3] = ["train.txt", "test.txt", "scene.loc"];
/// Most pixels of an image: the readers of this layout hold a ray for each in memory.
const PIXELS_MAX: usize = 64 << 20;
/// Pixels around the ground of the surface model that stay when an image is cut.
const MARGIN_PX: f64 = 8.0;
/// Shares of the pixels that become black and white, percent: a few bright roofs or a dark rim must
/// not decide the contrast.
const BLACK_WHITE: [f64; 2] = [0.5, 99.5];

/// Images to be exported, and the folder for them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RpcExportConfig {
    /// Images with RPCs, folders or patterns of such, or the folder of one DSM run.
    pub inputs: Vec<PathBuf>,
    /// Folder for the dataset.
    pub output: PathBuf,
    /// Lowest and highest height of the scene above the ellipsoid, metres; that of the run's
    /// surface model when `None`.
    pub height_range_m: Option<[f64; 2]>,
    /// Every how many images one is kept for tests, from the first one by name; none when 0.
    pub hold_out: usize,
    /// Azimuth and elevation of the sun for images that do not say where it stood, degrees.
    pub sun_deg: Option<[f64; 2]>,
    /// Whether an earlier dataset may be replaced.
    pub overwrite: bool,
}

/// What was exported.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RpcExportReport {
    /// Folder of the dataset.
    pub output: PathBuf,
    /// Lowest and highest height of the scene above the ellipsoid, metres.
    pub height_range_m: [f64; 2],
    /// The images, by name.
    pub images: Vec<RpcExportedImage>,
    /// Largest difference between an RPC that was written and the corrected camera, pixels.
    pub residual_px: f64,
}

/// An exported image.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RpcExportedImage {
    /// Name of its files, without their endings.
    pub name: String,
    /// Where it came from.
    pub source: PathBuf,
    /// First column and row of the source that it shows.
    pub origin_px: [i64; 2],
    /// Columns and rows.
    pub size: [usize; 2],
    /// Whether it is kept for tests.
    pub held_out: bool,
}

impl RpcExportConfig {
    /// An export with every eighth image held out, which replaces nothing.
    pub fn new(inputs: Vec<PathBuf>, output: PathBuf) -> Self {
        Self { inputs, output, height_range_m: None, hold_out: 8, sun_deg: None, overwrite: false }
    }

    /// Checks the range of heights and the sun.
    ///
    /// # Errors
    /// [`JobError`] that names the setting.
    pub fn validate(&self) -> Result<(), JobError> {
        let setting = |name, found: [f64; 2], expected: &str| {
            JobError::from(SettingError::new(name, format!("{} {}", found[0], found[1]), expected))
        };
        match (self.height_range_m, self.sun_deg) {
            (Some(range @ [low, high]), _) if !(low < high && low > -1000.0 && high < 10_000.0) => {
                Err(setting("the range of heights", range, "the lower one first, between -1000 and 10000 metres"))
            }
            (_, Some(sun @ [azimuth, elevation]))
                if !(0.0..=360.0).contains(&azimuth) || !(0.0..=90.0).contains(&elevation) =>
            {
                Err(setting("the place of the sun", sun, "an azimuth of 0 to 360 and an elevation of 0 to 90 degrees"))
            }
            _ => Ok(()),
        }
    }
}

impl RpcExportReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let [low, high] = self.height_range_m;
        let held = self.images.iter().filter(|image| image.held_out).count();
        format!(
            "images     {}, of which {held} are held out\nheights    {low:.0} to {high:.0} m above the ellipsoid\n\
             cameras    {}\nimages     {}\n",
            self.images.len(),
            self.output.join(CAMERAS).display(),
            self.output.join(IMAGES).display()
        )
    }
}

/// Writes images and cameras in the layout of Sat-NeRF.
///
/// # Errors
/// [`JobError`]: a setting out of range, images that cannot be read, without RPC or of one name,
/// an unknown sun or range of heights, a folder that holds something else.
///
/// ```
/// use scenes::rpc::{RpcExportConfig, export};
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let views = ["view_1.tif", "view_2.tif"].map(|view| std::path::Path::new(town).join(view));
/// let mut config = RpcExportConfig::new(views.to_vec(), folder.path().join("dataset"));
/// config.height_range_m = Some([150.0, 300.0]);
/// config.sun_deg = Some([150.0, 50.0]);
/// let report = export(&config, &numeric::Silent)?;
/// assert!(report.images[0].held_out && report.output.join("cameras/view_2.json").is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn export(config: &RpcExportConfig, progress: &dyn Progress) -> Result<RpcExportReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &RpcExportConfig, progress: &dyn Progress) -> Result<RpcExportReport, RpcJobError> {
    config.validate()?;
    let scene = scene_of(&config.inputs, config.height_range_m, progress)?;
    let names = names(&scene.images)?;
    let folder = OutputFolder::take(&config.output)?;
    let earlier = earlier(&folder);
    let known = |name: &str| earlier.contains(name);
    let is_empty = files::names_in(folder.path()).all(|name| name.starts_with('.'));
    if !is_empty && !config.overwrite {
        return Err(RpcJobError::NotEmpty { path: config.output.clone() });
    }
    [CAMERAS, IMAGES].into_iter().try_for_each(|name| folder.require_own(name, &known))?;
    let work = folder.work_folder()?;
    for name in [CAMERAS, IMAGES] {
        files::create_folder(&work.path().join(name))?;
    }
    let (mut images, mut residual_px) = (Vec::new(), 0.0_f64);
    for (number, (path, name)) in scene.images.iter().zip(&names).enumerate() {
        progress.check_cancelled()?;
        let held_out = config.hold_out > 0 && number % config.hold_out == 0;
        let one = Export { config, scene: &scene, folder: work.path() };
        let (size, origin_px, residual) = one.image(path, name, progress)?;
        residual_px = residual_px.max(residual);
        images.push(RpcExportedImage { name: name.clone(), source: path.clone(), origin_px, size, held_out });
    }
    for (list, is_test) in [(LISTS[0], false), (LISTS[1], true)] {
        let lines: Vec<String> =
            images.iter().filter(|image| image.held_out == is_test).map(|image| image.name.clone() + ".json").collect();
        // The readers split at line breaks, so that a last one would name a file without a name.
        formats::atomic::write_bytes(work.path().join(CAMERAS).join(list), lines.join("\n").as_bytes(), false)?;
    }
    let report =
        RpcExportReport { output: config.output.clone(), height_range_m: scene.height_range_m, images, residual_px };
    folder.remove(RECORD)?;
    for name in [CAMERAS, IMAGES] {
        folder.remove_folder(name, &known)?;
        folder.publish(work.path(), name)?;
    }
    files::write_json(&folder.path().join(RECORD), &report, true)?;
    Ok(report)
}

/// Returns the names of the files of an earlier dataset in the folder.
fn earlier(folder: &OutputFolder) -> BTreeSet<String> {
    let record = files::read_text(&folder.path().join(RECORD)).unwrap_or_default();
    let record: Value = serde_json::from_str(&record).unwrap_or_default();
    let images = record["images"].as_array().into_iter().flatten().filter_map(|image| image["name"].as_str());
    let of_images = images.flat_map(|name| [format!("{name}.json"), format!("{name}.tif")]);
    of_images.chain(LISTS.map(str::to_owned)).collect()
}

/// Returns the names of the images without their endings, which must differ.
fn names(images: &[PathBuf]) -> Result<Vec<String>, RpcJobError> {
    let stem = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<String> = images.iter().map(stem).collect();
    let mut seen = BTreeSet::new();
    match names.iter().position(|name| !seen.insert(name)) {
        None => Ok(names),
        Some(at) => Err(RpcJobError::SameName { name: names[at].clone() }),
    }
}

/// What the export of one image needs.
struct Export<'a> {
    config: &'a RpcExportConfig,
    scene: &'a Scene,
    folder: &'a Path,
}

impl Export<'_> {
    /// Writes an image and its camera. Returns its size, its origin in the source, and the residual
    /// of the RPC in pixels.
    fn image(
        &self,
        path: &Path,
        name: &str,
        progress: &dyn Progress,
    ) -> Result<([usize; 2], [i64; 2], f64), RpcJobError> {
        let camera = self.scene.corrections.camera(path, progress)?;
        let source = ImageSource::open(path)?;
        let window = self.window(&source, &camera).ok_or_else(|| RpcJobError::Outside { path: path.to_owned() })?;
        if window.width.saturating_mul(window.height) > PIXELS_MAX {
            return Err(RpcJobError::TooLarge { path: path.to_owned(), size: [window.width, window.height] });
        }
        let stated = source.sun();
        let given = self.config.sun_deg.map(|[azimuth_deg, elevation_deg]| SunPosition { azimuth_deg, elevation_deg });
        let sun = stated.or(given).ok_or_else(|| RpcJobError::NoSun { path: path.to_owned() })?;
        let fit = camera.folded()?;
        let rpc = Rpc {
            samp_off: fit.rpc.samp_off - window.x as f64,
            line_off: fit.rpc.line_off - window.y as f64,
            ..fit.rpc
        };
        let [red, green, blue] = bytes_of(&source.read_colour(window)?, source.info().sample == SampleType::U8);
        let bands = [("red", &red), ("green", &green), ("blue", &blue)];
        let bands = bands.map(|(description, band)| Band { description, data: BandData::U8(band) });
        let image = format!("{name}.tif");
        write_image_with_rpc(self.folder.join(IMAGES).join(&image), &bands, &rpc, None, false)?;
        let text = formats::rpc::to_text(&rpc, RpcFormat::Json)?;
        let [low, high] = self.scene.height_range_m;
        let mut record = json!({
            "img": image,
            "height": window.height,
            "width": window.width,
            "sun_elevation": format!("{:+}", sun.elevation_deg),
            "sun_azimuth": sun.azimuth_deg.to_string(),
            "geojson": outline(&rpc, window, (low + high) / 2.0),
            "min_alt": low,
            "max_alt": high,
            "rpc": serde_json::from_str::<Value>(&text).unwrap_or_default(),
        });
        if let Some(time) = source.acquired_s().and_then(iso_time) {
            record["acquisition_date"] = time.chars().filter(char::is_ascii_digit).collect::<String>().into();
        }
        let place = self.folder.join(CAMERAS).join(format!("{name}.json"));
        files::write_json(&place, &record, false)?;
        Ok(([window.width, window.height], [window.x, window.y], fit.max_px))
    }

    /// Returns the part of an image that shows the ground of the surface model, or all of it.
    fn window(&self, source: &ImageSource, camera: &RpcCamera) -> Option<Window> {
        let whole = source.window();
        if self.scene.outline_deg.is_empty() {
            return Some(whole);
        }
        let [mut west, mut north, mut east, mut south] = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
        for [lon_deg, lat_deg] in &self.scene.outline_deg {
            for height_m in self.scene.height_range_m {
                let at = camera.project(LonLatHeight::new(*lon_deg, *lat_deg, height_m)).ok()?;
                (west, east) = (west.min(at.sample), east.max(at.sample));
                (north, south) = (north.min(at.line), south.max(at.line));
            }
        }
        let start = |value: f64| (value - MARGIN_PX).floor();
        let length = |from: f64, to: f64| (to + MARGIN_PX).ceil() - start(from);
        let wanted = Window {
            x: start(west) as _,
            y: start(north) as _,
            width: length(west, east) as usize,
            height: length(north, south) as usize,
        };
        whole.intersection(&wanted)
    }
}

/// Returns three bands of 8 bits. Pixels that have 8 bits stay as they are; others are stretched,
/// all three bands alike. Void pixels are black.
fn bytes_of(colours: &Grid<[f32; 3]>, has_bytes: bool) -> [Grid<u8>; 3] {
    let [black, white] = if has_bytes {
        [0.0, 255.0]
    } else {
        let known = colours.data().iter().flatten().copied().filter(|value| value.is_finite());
        let mut known: Vec<f64> = known.map(f64::from).collect();
        BLACK_WHITE.map(|share| percentile(&mut known, share).unwrap_or(0.0) as f32)
    };
    let scale = if white > black { 255.0 / (white - black) } else { 0.0 };
    let byte =
        |value: f32| if value.is_finite() { ((value - black) * scale).round().clamp(0.0, 255.0) as u8 } else { 0 };
    [0, 1, 2].map(|band| colours.map(|colour| byte(colour[band])))
}

/// Returns the outline of an image on the ground at a height, as Sat-NeRF keeps it.
fn outline(rpc: &Rpc, window: Window, height_m: f64) -> Value {
    let (width, height) = (window.width as f64, window.height as f64);
    let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)];
    let ground = corners.map(|(sample, line)| rpc.localize(ImagePoint::new(sample, line), height_m).ok());
    let ground: Vec<[f64; 2]> = ground.iter().flatten().map(|g| [g.lon_deg, g.lat_deg]).collect();
    let middle = |axis: usize| {
        let values = ground.iter().map(|corner| corner[axis]);
        (values.clone().fold(f64::INFINITY, f64::min) + values.fold(f64::NEG_INFINITY, f64::max)) / 2.0
    };
    json!({"coordinates": [ground], "type": "Polygon", "center": [middle(0), middle(1)]})
}
