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

    /// The correction of an image: by its path, else by its name where that is unique; none where the run did not use it.
    pub(crate) fn for_image(&self, path: &Path) -> ImageCorrection {
        let same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
        let by_path = self.0.iter().find(|(other, _)| same(other, path));
        let mut by_name = self.0.iter().filter(|(other, _)| other.file_name() == path.file_name());
        let only = by_name.next().filter(|_| by_name.next().is_none());
        match by_path.or(only) {
            Some((_, correction)) => *correction,
            None => {
                if !self.0.is_empty() {
                    tracing::warn!(
                        "the run that the corrections are from did not use the image: its RPC is taken as it is: {}",
                        path.display()
                    );
                }
                ImageCorrection::IDENTITY
            }
        }
    }
}
