//! Brings splats from one format to another: PLY, SPZ, SOG, binary glTF.

use std::path::{Path, PathBuf};

use formats::splat_files::{self, SplatFormat};
use formats::splat_ply::{SH_DEGREE_MAX, SplatFile, SplatForm, SplatLayout};
use gaussian::Splat;
use numeric::Progress;
use serde::{Deserialize, Serialize};

use super::error::SplatsJobError;
use job::error::{JobError, SettingError};
use job::files;
use job::threads::install;

/// Splats to bring to another format.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SplatConvertConfig {
    /// File of splats of any format, with its origin beside it where it has one.
    pub splats: PathBuf,
    /// File to write, whose ending names its format: `.ply`, `.spz`, `.sog` or `.glb`. The origin
    /// goes beside it.
    pub output: PathBuf,
    /// Whether a PLY has two scales for each splat (2DGS) rather than three (3DGS); as in the file
    /// when `None`. The other formats always have three.
    pub discs: Option<bool>,
    /// Degree of the harmonics, 0 to 3: padded with zeros or cut; that of the file when `None`.
    pub sh_degree: Option<u8>,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SplatConvertReport {
    /// Number of splats.
    pub splats: usize,
    /// Whether they are discs.
    pub flat: bool,
    /// Degree of the harmonics.
    pub sh_degree: u8,
    /// Splats with a colour that the format cannot hold, which was brought to the nearest that it
    /// can: SPZ has none below -0.44 and above 1.44.
    pub clipped: usize,
    /// Splats with a class and an object of a city model, which the format cannot hold: only PLY
    /// does.
    pub labels_lost: usize,
    /// Size of the file read, bytes.
    pub bytes_before: u64,
    /// Size of the file written, bytes.
    pub bytes: u64,
}

impl SplatConvertConfig {
    /// Splats as they are in another format.
    pub fn new(splats: PathBuf, output: PathBuf) -> Self {
        Self { splats, output, discs: None, sh_degree: None, threads: None, overwrite: false }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] for a degree or an ending that is none.
    pub fn validate(&self) -> Result<(), SettingError> {
        if let Some(degree) = self.sh_degree.filter(|degree| *degree > SH_DEGREE_MAX) {
            return Err(SettingError::new("the degree of the harmonics", degree, "0 to 3"));
        }
        format_of(&self.output).map(|_| ())
    }
}

/// Returns the format that a path names.
pub(super) fn format_of(path: &Path) -> Result<SplatFormat, SettingError> {
    SplatFormat::of_ending(path).ok_or_else(|| {
        let expected = format!("one that ends in {}", SplatFormat::endings());
        SettingError::new("the file of splats", path.display(), expected)
    })
}

impl SplatConvertReport {
    /// Returns the report of `output` as text, which ends in a line break.
    pub fn text(&self, output: &Path) -> String {
        let kind = if self.flat { "discs" } else { "ellipsoids" };
        let clipped = match self.clipped {
            0 => String::new(),
            count => format!("clipped    {count} splats have colours that the format cannot hold\n"),
        };
        let lost = match self.labels_lost {
            0 => String::new(),
            count => format!("labels     class and object of {count} splats are left out: only PLY holds them\n"),
        };
        format!(
            "splats     {} {kind}, harmonics of degree {}\nsize       {:.1} MB, before {:.1} MB\n{clipped}{lost}written    {}\n",
            self.splats,
            self.sh_degree,
            self.bytes as f64 / 1e6,
            self.bytes_before as f64 / 1e6,
            output.display()
        )
    }
}

/// Converts splats.
///
/// # Errors
/// [`JobError`]: settings out of their range, a file that holds no splats, an output that
/// exists or cannot hold them.
///
/// ```
/// use scenes::splats::{SplatConvertConfig, SplatsConfig, convert, make};
/// let town = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
/// let folder = tempfile::tempdir()?;
/// let ply = folder.path().join("town.ply");
/// let mut coarse = SplatsConfig::new(town.join("truth/dsm.tif"), vec![town.join("view_1.tif")], ply.clone());
/// (coarse.uniform_side, coarse.compare) = (Some(4), false);
/// make(&coarse, &numeric::Silent)?;
/// let report = convert(&SplatConvertConfig::new(ply, folder.path().join("small.spz")), &numeric::Silent)?;
/// assert!(4 * report.bytes < report.bytes_before);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn convert(config: &SplatConvertConfig, progress: &dyn Progress) -> Result<SplatConvertReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &SplatConvertConfig, progress: &dyn Progress) -> Result<SplatConvertReport, SplatsJobError> {
    config.validate()?;
    files::check_destination(&config.output, config.overwrite)?;
    install(config.threads, || {
        let mut file = splat_files::read(&config.splats)?;
        progress.check_cancelled()?;
        let is_disc = config.discs.unwrap_or_else(|| file.is_flat());
        let form = if is_disc { SplatForm::Discs } else { SplatForm::Ellipsoids };
        file.layout = SplatLayout { form, sh_degree: config.sh_degree.unwrap_or(file.layout.sh_degree) };
        splat_files::write(&config.output, &file, config.overwrite)?;
        let size = |path: &Path| std::fs::metadata(path).map_or(0, |data| data.len());
        let SplatFile { splats, layout, .. } = &file;
        let format = format_of(&config.output)?;
        let range = format.colour_range();
        let labels = file.labels.iter().filter(|_| !format.holds_labels()).flat_map(|labels| &labels.of);
        let is_clipped =
            |splat: &Splat| range.is_some_and(|[low, high]| splat.colour.iter().any(|c| *c < low || *c > high));
        Ok(SplatConvertReport {
            splats: splats.len(),
            flat: file.is_flat(),
            sh_degree: layout.sh_degree,
            clipped: splats.iter().filter(|splat| is_clipped(splat)).count(),
            labels_lost: labels.filter(|label| !label.is_none()).count(),
            bytes_before: size(&config.splats),
            bytes: size(&config.output),
        })
    })?
}
