//! The pointing corrections that a run of `skysweep dsm` found for its images, from its report.

use std::path::{Path, PathBuf};

use anyhow::Context;
use camera::ImageCorrection;

/// Corrections by image; none for images that the run did not use.
#[derive(Debug, Default)]
pub(crate) struct Corrections(Vec<(PathBuf, ImageCorrection)>);

/// What is read of a run's report.
#[derive(serde::Deserialize)]
struct RunReport {
    images: Vec<RunImage>,
}

#[derive(serde::Deserialize)]
struct RunImage {
    path: PathBuf,
    applied_correction: Option<ImageCorrection>,
}

impl Corrections {
    /// Those of a report.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read the file: {}", path.display()))?;
        let report: RunReport = serde_json::from_str(&text)
            .with_context(|| format!("no report of skysweep dsm with its images: {}", path.display()))?;
        Ok(Self(report.images.into_iter().filter_map(|image| Some((image.path, image.applied_correction?))).collect()))
    }

    /// Those that go with a surface model (a file, or the folder of a run): of the report that is named, none where that is "none",
    /// else of the run that made the surface model.
    pub(crate) fn for_surface(surface: &Path, named: Option<&Path>) -> anyhow::Result<Self> {
        let of_run = || {
            let in_run = || surface.parent().filter(|folder| folder.file_name().is_some_and(|name| name == "dsm"));
            let run = if surface.is_dir() { Some(surface) } else { in_run().and_then(Path::parent) };
            run.map(|run| run.join("report/report.json")).filter(|report| report.is_file())
        };
        match named {
            Some(path) if path.as_os_str() == "none" => Ok(Self::default()),
            Some(path) => Self::read(path),
            None => of_run().map_or_else(|| Ok(Self::default()), |path| Self::read(&path)),
        }
    }

    /// The correction of an image; none, with a warning, where the run did not use it.
    pub(crate) fn for_image(&self, path: &Path) -> ImageCorrection {
        self.find(path).unwrap_or_else(|| {
            if !self.0.is_empty() {
                tracing::warn!(
                    "the run that the corrections are from did not use the image: its RPC is taken as it is: {}",
                    path.display()
                );
            }
            ImageCorrection::IDENTITY
        })
    }

    /// The correction of an image that the run used: by its path, else by its name where that is unique.
    fn find(&self, path: &Path) -> Option<ImageCorrection> {
        let same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
        let by_path = self.0.iter().find(|(other, _)| same(other, path));
        let mut by_name = self.0.iter().filter(|(other, _)| other.file_name() == path.file_name());
        let only = by_name.next().filter(|_| by_name.next().is_none());
        by_path.or(only).map(|(_, correction)| *correction)
    }
}
