//! The self-test job: whether an installation works, told in a minute.
//!
//! The map projections of PROJ are compared with formulas that need no library, the formats of GDAL
//! are looked for, and a small simulated town becomes a surface model that is compared with the
//! exact one, once with one thread and once with all. Everything is written to a folder of the
//! system for temporary files and removed again. What is only absent, such as a geoid grid, is no
//! failure.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use ::eval::AlignmentMethod;
use ::simulate::SimulationConfig;
use crs::{HeightConverter, MapProjection, VerticalDatum};
use geodesy::TransverseMercator;
use job::error_text::with_causes;
use numeric::{Cancelled, Progress, Silent};
use serde::{Deserialize, Serialize};

use dsm::{DsmConfig, HeightRange};
use scenes::simulate::SimulateConfig;
use surfaces::eval::{EvalTarget, GridEvalConfig, compare_grids};

/// Formats without which nothing can be read or written.
const REQUIRED: [&str; 3] = ["GTiff", "COG", "VRT"];
/// Formats of deliveries: any driver of each serves.
const DELIVERIES: [(&str, &[&str]); 4] = [
    ("NITF", &["NITF"]),
    ("JPEG 2000", &["JP2OpenJPEG", "JP2KAK", "JP2MrSID", "JPEG2000"]),
    ("DIMAP", &["DIMAP"]),
    ("TIL", &["TIL"]),
];
/// Side of the town in metres and of its pixels: the smallest scene in which houses, streets and
/// trees stand on some hundred pixels a side.
const TOWN_M: f64 = 120.0;
const GSD_M: f64 = 1.0;
/// Most that 68 % of the errors of a working installation may reach, pixels. The matching of such
/// scenes errs by a fifth of a pixel; whatever is broken errs by many.
const ERROR_MAX_PX: f64 = 1.0;
/// Least share of the cells with a height.
const COVERED_MIN: f64 = 0.8;
/// Scale and false easting of UTM.
const UTM_SCALE: f64 = 0.9996;
const UTM_EASTING_M: f64 = 500_000.0;
/// Largest difference of two ways to compute a map position, metres.
const MAP_MAX_M: f64 = 1e-3;

/// How a self-test runs.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SelftestConfig {
    /// Folder below which files are made and removed again; that of the system when `None`.
    pub folder: Option<PathBuf>,
}

/// What a self-test found.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SelftestReport {
    /// Version of the program.
    pub version: String,
    /// Operating system and processor.
    pub system: String,
    /// The checks, in the order in which they were made.
    pub checks: Vec<SelftestCheck>,
}

/// A check of a self-test.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SelftestCheck {
    /// What was checked.
    pub name: &'static str,
    /// How it ended.
    pub state: SelftestState,
    /// What was found.
    pub found: String,
    /// How long it took, seconds.
    pub seconds: f64,
}

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SelftestState {
    /// It works.
    Passed,
    /// A part is not installed that not everyone needs.
    Absent,
    /// It does not work.
    Failed,
}

impl SelftestReport {
    /// Returns the names of the checks that failed.
    pub fn failed(&self) -> Vec<&'static str> {
        self.checks.iter().filter(|check| check.state == SelftestState::Failed).map(|check| check.name).collect()
    }

    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mut out = format!("skysweep {} on {}\n", self.version, self.system);
        for check in &self.checks {
            let state = match check.state {
                SelftestState::Passed => "works",
                SelftestState::Absent => "absent",
                SelftestState::Failed => "FAILED",
            };
            let _ = writeln!(out, "{state:<8}{:<18}{} ({:.1} s)", check.name, check.found, check.seconds);
        }
        out
    }
}

/// Tests the installation. A check that fails is part of the report.
///
/// # Errors
/// [`Cancelled`].
///
/// ```no_run
/// let report = jobs::selftest::run(&jobs::selftest::SelftestConfig::default(), &numeric::Silent)?;
/// assert!(report.failed().is_empty(), "{}", report.text());
/// # Ok::<(), numeric::Cancelled>(())
/// ```
pub fn run(config: &SelftestConfig, progress: &dyn Progress) -> Result<SelftestReport, Cancelled> {
    let mut checks = Vec::new();
    let mut check = |name: &'static str, work: &dyn Fn() -> Result<(SelftestState, String), String>| {
        progress.check_cancelled()?;
        progress.begin(name, 1);
        let start = Instant::now();
        let (state, found) = work().unwrap_or_else(|what| (SelftestState::Failed, what));
        checks.push(SelftestCheck { name, state, found, seconds: start.elapsed().as_secs_f64() });
        progress.step();
        Ok::<(), Cancelled>(())
    };
    check("instructions", &|| Ok((SelftestState::Passed, instructions())))?;
    check("formats", &formats)?;
    check("map projections", &projections)?;
    check("geoids", &geoids)?;
    check("surface model", &|| surface(config.folder.as_deref()))?;
    Ok(SelftestReport {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        checks,
    })
}

/// Names the number of cores and the instructions that the fast paths can use here.
fn instructions() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{cores} cores, {}", fast_paths())
}

#[cfg(target_arch = "x86_64")]
fn fast_paths() -> &'static str {
    match (std::is_x86_feature_detected!("avx512bw"), std::is_x86_feature_detected!("avx2")) {
        (true, _) => "AVX-512",
        (false, true) => "AVX2",
        _ => "the plain path",
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn fast_paths() -> &'static str {
    "the plain path"
}

/// Looks for the drivers of GDAL.
fn formats() -> Result<(SelftestState, String), String> {
    let known = formats::raster::raster_formats();
    let has = |name: &&str| known.iter().any(|known| known == name);
    let missing: Vec<&str> = REQUIRED.into_iter().filter(|name| !has(name)).collect();
    if !missing.is_empty() {
        return Err(format!("GDAL was built without {}, expected {}", missing.join(", "), REQUIRED.join(", ")));
    }
    let without = DELIVERIES.iter().filter(|(_, drivers)| !drivers.iter().any(&has));
    let without: Vec<&str> = without.map(|(name, _)| *name).collect();
    Ok(if without.is_empty() {
        (SelftestState::Passed, format!("{} of GDAL, those of deliveries among them", known.len()))
    } else {
        (SelftestState::Absent, format!("GDAL was built without {}", without.join(", ")))
    })
}

/// Compares PROJ with the formulas of this program.
fn projections() -> Result<(SelftestState, String), String> {
    let mut worst_m = 0.0_f64;
    for (lon, lat, middle, code) in [(5.4, 43.5, 3.0, 32631), (-81.66, 30.35, -81.0, 32617)] {
        let projection = MapProjection::from_epsg(code).map_err(|e| with_causes(&e))?;
        let found = projection.map_from_lonlat(lon, lat).map_err(|e| with_causes(&e))?;
        let formulas = TransverseMercator::new(middle, 0.0, UTM_SCALE).and_then(|map| map.map_from_lonlat(lon, lat));
        let formulas = formulas.map_err(|e| with_causes(&e))?;
        worst_m = worst_m.max((found.x - formulas.x - UTM_EASTING_M).hypot(found.y - formulas.y));
    }
    if worst_m <= MAP_MAX_M {
        Ok((SelftestState::Passed, format!("PROJ agrees with the formulas within {:.3} mm", worst_m * 1e3)))
    } else {
        Err(format!("PROJ differs from the formulas by {worst_m:.3} m: its database may be of another version"))
    }
}

/// Looks for the grids of the geoids.
fn geoids() -> Result<(SelftestState, String), String> {
    let datums = [("EGM96", VerticalDatum::Egm96), ("EGM2008", VerticalDatum::Egm2008)];
    let (present, absent): (Vec<_>, Vec<_>) =
        datums.into_iter().partition(|(_, datum)| HeightConverter::new(*datum).is_ok());
    let names = |list: &[(&str, VerticalDatum)]| list.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" and ");
    Ok(match absent.as_slice() {
        [] => (SelftestState::Passed, format!("the grids of {} are installed", names(&present))),
        _ => (
            SelftestState::Absent,
            format!(
                "no grid of {}; heights above the ellipsoid need none, and --fetch-grids fetches a grid",
                names(&absent)
            ),
        ),
    })
}

/// Makes the surface model of a small town and compares it with the exact surface.
fn surface(folder: Option<&Path>) -> Result<(SelftestState, String), String> {
    let mut builder = tempfile::Builder::new();
    let builder = builder.prefix("skysweep-selftest-");
    let folder = folder.map_or_else(|| builder.tempdir(), |folder| builder.tempdir_in(folder));
    let folder = folder.map_err(|e| format!("cannot make a folder for temporary files: {e}"))?;
    let at = |name: &str| folder.path().join(name);
    let mut scene = SimulationConfig::preset("town").map_err(|e| with_causes(&e))?;
    (scene.size_m, scene.gsd_m, scene.views) = (TOWN_M, GSD_M, 3);
    scenes::simulate::run(&SimulateConfig::new(scene, at("town")), &Silent).map_err(|e| with_causes(&e))?;
    let images: Vec<PathBuf> = (1..=3).map(|view| at(&format!("town/view_{view}.tif"))).collect();
    let truth = at("town/truth/dsm.tif");
    let known = formats::raster::read_dem(&truth).map_err(|e| with_causes(&e))?;
    let heights = known.heights.data().iter().filter(|height| height.is_finite()).map(|height| f64::from(*height));
    let [low, high] = heights.fold([f64::MAX, f64::MIN], |[low, high], h| [low.min(h), high.max(h)]);
    for (name, threads) in [("one", Some(1)), ("all", None)] {
        let mut config = DsmConfig::new(images.clone(), at(name));
        config.threads = threads;
        config.height_range_m = Some(HeightRange::new(low - 10.0, high + 10.0));
        dsm::run(&config, &Silent).map_err(|e| with_causes(&e))?;
    }
    let bytes = |name: &str| std::fs::read(at(name).join("dsm/dsm.tif")).map_err(|e| e.to_string());
    if bytes("one")? != bytes("all")? {
        return Err("one thread and all threads make different surfaces".to_owned());
    }
    let mut config = GridEvalConfig::new(at("all/dsm/dsm.tif"), truth);
    config.alignment = AlignmentMethod::Xyz;
    config.target = EvalTarget::Nowhere;
    let metrics = compare_grids(&config, &Silent).map_err(|e| with_causes(&e))?.evaluation.overall;
    let covered = metrics.n as f64 / metrics.reference_cells.max(1) as f64;
    let error_m = metrics.errors.map_or(f64::INFINITY, |errors| errors.le68);
    let found = format!(
        "a simulated town of three views: {:.0} % of cells have a height, 68 % of the errors are below {error_m:.2} m",
        covered * 100.0
    );
    let expected = ERROR_MAX_PX * GSD_M;
    if covered >= COVERED_MIN && error_m <= expected {
        return Ok((SelftestState::Passed, found + ", the same bytes with one thread and with all"));
    }
    Err(format!("{found}, expected at least {:.0} % and at most {expected} m", COVERED_MIN * 100.0))
}
