//! The comparison of maps in the pixels of one camera: depths, normals, masks.

use std::path::{Path, PathBuf};

use eval::{compare_depths, compare_masks, compare_normals};
use formats::maps::MapFile;
use numeric::Progress;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::error::EvalJobError;
use super::requirements::EvalRequirements;
use job::error::JobError;
use job::files::FileError;
use job::threads;

/// Kind of a map in the pixels of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MapKind {
    /// Depths: one number a pixel; 0, NaN and infinity are no depth.
    Depth,
    /// Normals: three numbers a pixel; zeros are no normal.
    Normals,
    /// Masks: one number a pixel; every value but 0 is set.
    Mask,
}

impl MapKind {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("depth", Self::Depth, "Depths, one number a pixel; 0, NaN and infinity are no depth"),
        ("normals", Self::Normals, "Normals, three numbers a pixel; zeros are no normal"),
        ("mask", Self::Mask, "Masks; every value but 0 is set"),
    ];
}

/// A comparison of two maps of one camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct MapEvalConfig {
    /// Map to evaluate.
    pub test: PathBuf,
    /// Map that is believed.
    pub reference: PathBuf,
    /// Kind of both maps. `None` finds it from shape and type of the reference.
    pub kind: Option<MapKind>,
    /// Largest mean error: metres for depths, degrees for normals.
    pub max_mae: Option<f64>,
    /// Worker threads. `None` uses all cores.
    pub threads: Option<usize>,
}

/// A finished comparison of two maps.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MapEvalReport {
    generator: String,
    /// Kind of both maps.
    pub kind: MapKind,
    /// The evaluated map, by name.
    pub test: String,
    /// The reference, by name.
    pub reference: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// All numbers by name: a [`eval::DepthComparison`], [`eval::NormalComparison`] or
    /// [`eval::MaskComparison`].
    pub result: Value,
    /// Requirements that are not met.
    pub missed: Vec<String>,
}

/// Numbers of a comparison, and the mean error that the requirement is held against.
struct Compared {
    result: Value,
    mean_error: Option<f64>,
}

impl MapEvalConfig {
    /// A comparison of maps whose kind is found from the reference.
    pub fn new(test: PathBuf, reference: PathBuf) -> Self {
        Self { test, reference, kind: None, max_mae: None, threads: None }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        Ok(EvalRequirements { max_mae: self.max_mae, ..EvalRequirements::default() }.validate()?)
    }
}

/// Compares two maps. No file is written.
///
/// # Errors
/// [`JobError`]: maps that cannot be read, have other shapes, or are of an unknown kind.
///
/// ```
/// use surfaces::eval::{MapEvalConfig, compare_maps};
/// use numeric::Silent;
///
/// let folder = tempfile::tempdir()?;
/// let (test, reference) = (folder.path().join("test.npy"), folder.path().join("reference.npy"));
/// formats::npy::write(&test, &[1, 2], &[2.5f32, 4.0], false)?;
/// formats::npy::write(&reference, &[1, 2], &[2.0f32, 4.0], false)?;
/// let report = compare_maps(&MapEvalConfig::new(test, reference), &Silent)?;
/// assert_eq!(report.result["errors"]["mae"], 0.25);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compare_maps(config: &MapEvalConfig, progress: &dyn Progress) -> Result<MapEvalReport, JobError> {
    config.validate()?;
    Ok(threads::install(config.threads, || {
        progress.check_cancelled()?;
        compare(config)
    })??)
}

fn compare(config: &MapEvalConfig) -> Result<MapEvalReport, EvalJobError> {
    let (test, reference) = (formats::maps::read(&config.test)?, formats::maps::read(&config.reference)?);
    let kind = match config.kind {
        Some(kind) => kind,
        None => kind_of(&reference, &config.reference)?,
    };
    let shape = |map: &MapFile| (map.width, map.height, map.channels);
    if shape(&test) != shape(&reference) {
        let words = |map: &MapFile| format!("{} x {} pixels of {} numbers", map.width, map.height, map.channels);
        return Err(EvalJobError::MapShapes { test: words(&test), reference: words(&reference) });
    }
    check_channels(kind, &test, &config.test)?;
    let Compared { result, mean_error } = compare_as(kind, &test, &reference)?;
    let missed = config.max_mae.filter(|&most| mean_error.is_some_and(|mae| mae.is_nan() || mae > most));
    Ok(MapEvalReport {
        generator: format!("skysweep eval {}", env!("CARGO_PKG_VERSION")),
        kind,
        test: config.test.display().to_string(),
        reference: config.reference.display().to_string(),
        size: [test.width, test.height],
        result,
        missed: missed.map(|most| format!("mae is above {most}")).into_iter().collect(),
    })
}

/// Finds the kind of a map from its shape and type.
fn kind_of(map: &MapFile, path: &Path) -> Result<MapKind, EvalJobError> {
    match (map.channels, map.is_mask) {
        (1, true) => Ok(MapKind::Mask),
        (1, false) => Ok(MapKind::Depth),
        (3, false) => Ok(MapKind::Normals),
        (channels, _) => {
            let expected = "1 or 3, or a stated kind";
            Err(EvalJobError::MapChannels { path: path.to_owned(), channels, expected })
        }
    }
}

fn check_channels(kind: MapKind, map: &MapFile, path: &Path) -> Result<(), EvalJobError> {
    let (needed, expected) =
        if kind == MapKind::Normals { (3, "3 for normals") } else { (1, "1 for depths and masks") };
    if map.channels == needed {
        return Ok(());
    }
    Err(EvalJobError::MapChannels { path: path.to_owned(), channels: map.channels, expected })
}

/// Compares two maps of a known kind.
fn compare_as(kind: MapKind, test: &MapFile, reference: &MapFile) -> Result<Compared, EvalJobError> {
    let json = |value: serde_json::Result<Value>| value.map_err(FileError::from);
    Ok(match kind {
        MapKind::Depth => {
            let found = compare_depths(&test.data, &reference.data)?;
            let mean_error = found.errors.map(|errors| errors.mae).or(Some(f64::NAN));
            Compared { result: json(serde_json::to_value(found))?, mean_error }
        }
        MapKind::Normals => {
            let found = compare_normals(test.data.as_chunks().0, reference.data.as_chunks().0)?;
            let mean_error = found.angles.map(|angles| angles.mean_deg).or(Some(f64::NAN));
            Compared { result: json(serde_json::to_value(found))?, mean_error }
        }
        MapKind::Mask => {
            let set = |map: &MapFile| map.data.iter().map(|&value| value != 0.0).collect::<Vec<bool>>();
            let found = compare_masks(&set(test), &set(reference))?;
            Compared { result: json(serde_json::to_value(found))?, mean_error: None }
        }
    })
}

impl MapEvalReport {
    /// Returns every number of the result, one a line.
    pub fn table(&self) -> String {
        let kind = serde_json::to_value(self.kind).unwrap_or_default();
        let mut lines = format!(
            "{:<22} {}\n{:<22} {}\n{:<22} {}\n",
            "test",
            self.test,
            "reference",
            self.reference,
            "kind",
            kind.as_str().unwrap_or_default()
        );
        for (group, values) in self.result.as_object().into_iter().flatten() {
            match values {
                Value::Object(values) => {
                    for (name, value) in values {
                        lines += &format!("{:<22} {}\n", format!("{group}.{name}"), shown(value));
                    }
                }
                value => lines += &format!("{group:<22} {}\n", shown(value)),
            }
        }
        lines
    }
}

fn shown(value: &Value) -> String {
    match value {
        Value::Array(values) => values.iter().map(shown).collect::<Vec<_>>().join("  "),
        Value::Number(number) if number.is_f64() => format!("{:.6}", number.as_f64().unwrap_or(f64::NAN)),
        Value::Null => "-".to_owned(),
        other => other.to_string(),
    }
}
