//! The pointing corrections that an earlier DSM run found for its images, read from its report.

use std::path::{Path, PathBuf};

use camera::{ImageCorrection, Rpc, RpcCamera};
use formats::rpc::RpcReadError;
use serde::{Deserialize, Serialize};

use numeric::{Kind, Progress, failures};

use crate::error::{JobError, from_failures};
use crate::files::{self, FileError};
use crate::same_view::carried;

/// Where the pointing corrections of the images come from.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CorrectionSource {
    /// From the report of the run that made the surface model, where the model lies in the folder
    /// of such a run.
    #[default]
    SurfaceRun,
    /// From this report of a DSM run.
    Report(PathBuf),
    /// Nowhere: the RPCs are used as they are.
    Uncorrected,
}

/// Folders above a file in which a run is looked for: the run's own and one inside it.
const RUN_DEPTH: usize = 2;

/// A report whose corrections cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CorrectionsError {
    /// The report cannot be read.
    #[error("cannot read the report with the pointing corrections ({source}): {}", path.display())]
    Unreadable {
        /// The report.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The file is not a report of a DSM run.
    #[error("the file is not the report of a DSM run with its images ({source}): {}", path.display())]
    NotAReport {
        /// The file.
        path: PathBuf,
        /// What the JSON reader found.
        source: serde_json::Error,
    },
    /// The folder is none of a finished run.
    #[error("the folder holds no report of a DSM run (report/report.json); give the folder of one: {}", path.display())]
    NoRun {
        /// The folder.
        path: PathBuf,
    },
    /// The run did not use the image.
    #[error("the run used no image {wanted:?}; it used {}: {}", known.join(", "), path.display())]
    NotInRun {
        /// The image as it was named.
        wanted: String,
        /// Names of the images that the run used.
        known: Vec<String>,
        /// Folder of the run.
        path: PathBuf,
    },
}

failures!(CorrectionsError: File { Self::NotInRun { .. } => Kind::Input });

from_failures!(CorrectionsError);

/// Finds an image among those that a DSM run used: where it lies, and the pointing correction that
/// the run found for it (the identity where it found none).
///
/// `image` is the path of the image, or its file name alone where that is unique in the run. The
/// path that is given is preferred to that of the run, which may have moved.
///
/// # Errors
/// [`JobError`] if the folder holds no report, or the run did not use the image.
pub fn image_of_run(run: &Path, image: &Path) -> Result<(PathBuf, ImageCorrection), JobError> {
    let report = report_of_run(run).filter(|_| run.is_dir());
    let report = RunReport::read(&report.ok_or_else(|| CorrectionsError::NoRun { path: run.to_owned() })?)?;
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let wanted = whole(image);
    let by_path = report.images.iter().find(|known| whole(&known.path) == wanted);
    let mut by_name = report.images.iter().filter(|known| known.path.file_name() == image.file_name());
    let only = by_name.next().filter(|_| by_name.next().is_none());
    let name = |known: &RunImage| known.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let known = by_path.or(only).ok_or_else(|| CorrectionsError::NotInRun {
        wanted: image.display().to_string(),
        known: report.images.iter().map(name).collect(),
        path: run.to_owned(),
    })?;
    let place = if image.exists() { image } else { &known.path };
    Ok((place.to_owned(), known.applied_correction.unwrap_or(ImageCorrection::IDENTITY)))
}

/// Pointing corrections by image. An image that the run did not use, or did not correct, has none.
#[derive(Debug, Default)]
pub struct Corrections {
    images: Vec<(PathBuf, ImageCorrection)>,
}

/// The part of a run's report that is read here.
#[derive(Deserialize, Serialize)]
struct RunReport {
    images: Vec<RunImage>,
}

impl RunReport {
    fn read(path: &Path) -> Result<Self, CorrectionsError> {
        let text = formats::read_regular_text(path, files::TEXT_LIMIT)
            .map_err(|source| CorrectionsError::Unreadable { path: path.to_owned(), source })?;
        serde_json::from_str(&text).map_err(|source| CorrectionsError::NotAReport { path: path.to_owned(), source })
    }
}

#[derive(Deserialize, Serialize)]
struct RunImage {
    path: PathBuf,
    applied_correction: Option<ImageCorrection>,
}

impl Corrections {
    /// Reads the corrections of a report.
    ///
    /// # Errors
    /// [`JobError`] if the file cannot be read or is not the report of a DSM run.
    pub fn read(path: &Path) -> Result<Self, JobError> {
        let report = RunReport::read(path)?;
        let images = report.images.into_iter().filter_map(|image| Some((image.path, image.applied_correction?)));
        Ok(Self { images: images.collect() })
    }

    /// Reads the corrections that belong to a surface model, which is a file or the folder of a DSM
    /// run.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn for_surface(surface: &Path, source: &CorrectionSource) -> Result<Self, JobError> {
        match source {
            CorrectionSource::Uncorrected => Ok(Self::default()),
            CorrectionSource::Report(path) => Self::read(path),
            CorrectionSource::SurfaceRun => {
                report_of_run(surface).map_or_else(|| Ok(Self::default()), |path| Self::read(&path))
            }
        }
    }

    /// Returns the correction of one image.
    pub fn of_image(image: PathBuf, correction: ImageCorrection) -> Self {
        Self { images: vec![(image, correction)] }
    }

    /// Reads the corrections of the run in whose folder a file lies; none where it lies in no run.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn of_run_around(file: &Path) -> Result<Self, JobError> {
        let file = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        let report = file.ancestors().skip(1).take(RUN_DEPTH).find_map(report_of_run);
        report.map_or_else(|| Ok(Self::default()), |path| Self::read(&path))
    }

    /// Returns the images of the run that made a surface model; none where it lies in no run.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn images_of_run(surface: &Path) -> Result<Vec<PathBuf>, JobError> {
        let report = report_of_run(surface).map(|path| RunReport::read(&path)).transpose()?;
        Ok(report.map_or_else(Vec::new, |report| report.images.into_iter().map(|image| image.path).collect()))
    }

    /// Returns the corrections of some images only, which are known by the paths given here.
    pub fn of_images(&self, images: &[PathBuf]) -> Self {
        let one = |path: &PathBuf| Some((path.canonicalize().unwrap_or_else(|_| path.clone()), self.find(path)?));
        Self { images: images.iter().filter_map(one).collect() }
    }

    /// Writes the corrections so that [`Self::read`] reads them. Writes nothing and removes an
    /// older file when there are none.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn write(&self, path: &Path, overwrite: bool) -> Result<(), FileError> {
        if self.images.is_empty() {
            return if overwrite { files::remove(path) } else { Ok(()) };
        }
        let image = |(path, correction): &(PathBuf, ImageCorrection)| RunImage {
            path: path.clone(),
            applied_correction: Some(*correction),
        };
        files::write_json(path, &RunReport { images: self.images.iter().map(image).collect() }, overwrite)
    }

    /// Reads the RPC inside or beside an image, and adds the correction of the image, or of another
    /// one that was taken from the same place.
    ///
    /// # Errors
    /// [`RpcReadError`] if the image has no usable RPC.
    pub fn camera(&self, path: &Path, progress: &dyn Progress) -> Result<RpcCamera, RpcReadError> {
        let rpc = formats::rpc::read_for_image(path)?.rpc;
        let correction = match self.find(path) {
            Some(correction) => correction,
            None => self.of_same_view(path, &rpc, progress).unwrap_or_else(|| self.for_image(path, progress)),
        };
        Ok(RpcCamera { rpc, correction })
    }

    /// Returns the correction that the run found for another image of the same pass, with a
    /// warning.
    fn of_same_view(&self, path: &Path, rpc: &Rpc, progress: &dyn Progress) -> Option<ImageCorrection> {
        let found = self.images.iter().filter_map(|(other, correction)| {
            let of = formats::rpc::read_for_image(other).ok()?.rpc;
            carried(correction, &of, rpc).map(|(correction, residual_px)| (other, correction, residual_px))
        });
        let best = found.min_by(|a, b| a.2.total_cmp(&b.2))?;
        progress.warn(&format!(
            "the run that the corrections come from did not use this image, so it takes the correction of {}, which \
             was taken from the same place: {}",
            best.0.display(),
            path.display()
        ));
        Some(best.1)
    }

    /// Returns the correction of an image, or the identity (with a warning) if the run did not use
    /// the image.
    pub fn for_image(&self, path: &Path, progress: &dyn Progress) -> ImageCorrection {
        self.find(path).unwrap_or_else(|| {
            if !self.images.is_empty() {
                progress.warn(&format!(
                    "the run that the corrections come from did not use this image, so its RPC is used as it is: {}",
                    path.display()
                ));
            }
            ImageCorrection::IDENTITY
        })
    }

    /// Finds an image by its path, or else by its file name where that is unique.
    pub fn find(&self, path: &Path) -> Option<ImageCorrection> {
        let same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
        let by_path = self.images.iter().find(|(other, _)| same(other, path));
        let mut by_name = self.images.iter().filter(|(other, _)| other.file_name() == path.file_name());
        let only = by_name.next().filter(|_| by_name.next().is_none());
        by_path.or(only).map(|(_, correction)| *correction)
    }
}

/// Returns the report of the run that a surface model belongs to, if there is one.
fn report_of_run(surface: &Path) -> Option<PathBuf> {
    let in_run = || surface.parent().filter(|folder| folder.file_name().is_some_and(|name| name == "dsm"));
    let run = if surface.is_dir() { Some(surface) } else { in_run().and_then(Path::parent) };
    run.map(|run| run.join("report/report.json")).filter(|report| report.is_file())
}
