//! The split job: chooses context and target views of a COLMAP model by the overlap of what they
//! see.

use std::path::PathBuf;

use colmap::split::{ChosenView, SplitConfig, SplitError, points_of_views, split};
use formats::FormatError;
use formats::colmap::{ColmapModel, ColmapPoint};
use serde::{Deserialize, Serialize};

use job::error::{JobError, from_steps, job_errors};
use job::files::{self, FileError};
use job::report_page;
use numeric::{Cancelled, Progress, failures};

/// A COLMAP model and the overlaps that are wanted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SplitJobConfig {
    /// Folder of a COLMAP model with its points.
    pub model: PathBuf,
    /// File for the report (JSON), whose page is written beside it; neither is written when `None`.
    pub output: Option<PathBuf>,
    /// Number of context views.
    pub contexts: usize,
    /// Wanted overlap of each further context with the first one, as intersection over union.
    pub context_iou: f64,
    /// Wanted average overlap of each target with the contexts, as intersection over union.
    pub target_ious: Vec<f64>,
    /// Name of the first context; the first by name of the images that see points when `None`.
    pub first: Option<String>,
    /// Whether an existing `output` may be replaced.
    pub overwrite: bool,
}

/// The chosen views.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SplitJobReport {
    /// Folder of the model.
    pub model: String,
    /// Views to reconstruct from, in the order of choice.
    pub contexts: Vec<SplitImage>,
    /// Views to predict, in the order of the wanted overlaps.
    pub targets: Vec<SplitImage>,
    /// Sum of the absolute differences between wanted and found overlaps.
    pub deviation: f64,
}

/// A chosen image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SplitImage {
    /// Name of the image.
    pub image: String,
    /// Overlap that was wanted; `None` for the first context.
    pub wanted_iou: Option<f64>,
    /// Overlap of a context with the first one, or average overlap of a target with all contexts;
    /// `None` for the first context.
    pub iou: Option<f64>,
}

/// A split that could not be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SplitJobError {
    /// No image has the name of the first context.
    #[error("no image of the COLMAP model has the name '{name}': expected a name of its list of images")]
    UnknownImage {
        /// The name.
        name: String,
    },
    /// More contexts than images.
    #[error("{contexts} context views are asked for, and the model has {images} images: expected no more than these")]
    TooManyContexts {
        /// Number of contexts asked for.
        contexts: usize,
        /// Number of images in the model.
        images: usize,
    },
    /// The overlaps cannot be served.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(SplitJobError: Other {
    Self::Job(error) => error.kind(),
});

job_errors!(SplitJobError);

from_steps!(SplitJobError: Job(FileError, Cancelled, FormatError));

impl SplitJobReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let line = |what: &str, chosen: &SplitImage| {
            let name = &chosen.image;
            match (chosen.iou, chosen.wanted_iou) {
                (Some(iou), Some(wanted)) => format!("{what:10} {iou:.3} (wanted {wanted:.3})  {name}\n"),
                _ => format!("{what:10} first                  {name}\n"),
            }
        };
        let contexts = self.contexts.iter().map(|chosen| line("context", chosen));
        contexts.chain(self.targets.iter().map(|chosen| line("target", chosen))).collect()
    }
}

impl SplitJobConfig {
    /// Two contexts of overlap 0.15 and targets of 0.02 to 0.1: the narrow preset of Cross-View
    /// Splatter.
    pub fn narrow(model: PathBuf) -> Self {
        Self::preset(model, SplitConfig::narrow())
    }

    /// Two contexts of overlap 0.25 and targets of 0.03 to 0.15: the wide preset of Cross-View
    /// Splatter.
    pub fn wide(model: PathBuf) -> Self {
        Self::preset(model, SplitConfig::wide())
    }

    fn preset(model: PathBuf, preset: SplitConfig) -> Self {
        let SplitConfig { contexts, context_iou, target_ious, .. } = preset;
        Self { model, output: None, contexts, context_iou, target_ious, first: None, overwrite: false }
    }
}

/// Chooses context and target views.
///
/// # Errors
/// [`JobError`]: a model without points, an unknown first image, overlaps that cannot be
/// served, an output that exists.
///
/// ```
/// use numeric::{Failure, Kind};
/// use scenes::split::{SplitJobConfig, run};
/// // The cameras of the sample have no points, so they share nothing that could be compared.
/// let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/cameras/sparse/0");
/// let refused = run(&SplitJobConfig::narrow(model.into()), &numeric::Silent);
/// assert!(matches!(refused.unwrap_err().kind(), Kind::Other | Kind::File));
/// ```
pub fn run(config: &SplitJobConfig, progress: &dyn Progress) -> Result<SplitJobReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &SplitJobConfig, progress: &dyn Progress) -> Result<SplitJobReport, SplitJobError> {
    if let Some(path) = &config.output {
        files::check_destination(path, config.overwrite)?;
        report_page::refuse_existing(path, config.overwrite)?;
    }
    progress.begin("split", 2);
    let (model, points) = formats::colmap::read_with_points(&config.model)?;
    progress.step();
    progress.check_cancelled()?;
    let points = points_by_view(&model, &points);
    let found = split(&points, &goal(config, &model, &points)?)?;
    let image = |choice: &ChosenView| SplitImage {
        image: model.views[choice.view].name.clone(),
        wanted_iou: choice.wanted_iou,
        iou: choice.iou,
    };
    let report = SplitJobReport {
        model: config.model.display().to_string(),
        contexts: found.contexts.iter().map(image).collect(),
        targets: found.targets.iter().map(image).collect(),
        deviation: found.deviation,
    };
    if let Some(path) = &config.output {
        let lead = "Views to reconstruct from, and views to predict, chosen by the points that they share.";
        report_page::write(path, ("Context and target views", lead), &report, Vec::new(), config.overwrite)?;
    }
    progress.step();
    Ok(report)
}

/// The wanted overlaps with the first image as an index. Without a name it is the first of the
/// sequence: the lowest name among the images that see points.
fn goal(config: &SplitJobConfig, model: &ColmapModel, points: &[Vec<u32>]) -> Result<SplitConfig, SplitJobError> {
    let index = |name: &String| {
        let found = model.views.iter().position(|view| view.name == *name);
        found.ok_or_else(|| SplitJobError::UnknownImage { name: name.clone() })
    };
    let first_of_sequence = || {
        let usable = (0..model.views.len()).filter(|&view| points.get(view).is_some_and(|seen| !seen.is_empty()));
        usable.min_by(|&a, &b| model.views[a].name.cmp(&model.views[b].name))
    };
    if config.contexts > model.views.len() {
        return Err(SplitJobError::TooManyContexts { contexts: config.contexts, images: model.views.len() });
    }
    Ok(SplitConfig {
        contexts: config.contexts,
        context_iou: config.context_iou,
        target_ious: config.target_ious.clone(),
        first: config.first.as_ref().map(index).transpose()?.or_else(first_of_sequence),
    })
}

fn points_by_view(model: &ColmapModel, points: &[ColmapPoint]) -> Vec<Vec<u32>> {
    let tracks: Vec<Vec<u32>> = points.iter().map(|point| point.track.iter().map(|seen| seen.view).collect()).collect();
    points_of_views(model.views.len(), tracks.iter().map(Vec::as_slice))
}
