//! `skysweep split`: context and target views of a COLMAP model, by the overlap of what they see.

use std::path::{Path, PathBuf};

use jobs::split::SplitJobConfig;

use crate::error::hinted;
use crate::options::{Named, named};
use crate::progress::WriteOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep split`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Overlap is the intersection over union of the points of the model that two views see. Contexts \
                        are chosen by their overlap with the first image, targets by their average overlap with the contexts."
)]
pub(crate) struct Args {
    /// Folder of a COLMAP model with its points.
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// File to write (JSON) [default: print only].
    #[arg(short, long, value_name = "OUT.json")]
    output: Option<PathBuf>,
    /// The paper's overlaps: contexts 0.15 and targets 0.02 to 0.1 (narrow), or contexts 0.25 and
    /// targets 0.03 to 0.15 (wide).
    #[arg(long, value_parser = named(&PRESETS), default_value = "narrow")]
    preset: Preset,
    /// Number of contexts.
    #[arg(long, value_name = "N", default_value_t = 2)]
    contexts: usize,
    /// Overlap of each further context with the first one [default: the preset's].
    #[arg(long, value_name = "IOU")]
    context_iou: Option<f64>,
    /// Average overlaps of the targets with the contexts [default: the preset's].
    #[arg(long, value_name = "IOU", value_delimiter = ',')]
    target_ious: Option<Vec<f64>>,
    /// Name of the first context [default: the first by name of the images that see points].
    #[arg(long, value_name = "IMAGE")]
    first: Option<String>,
    #[command(flatten)]
    write: WriteOptions,
}

/// Makes the configuration of a preset.
type Preset = fn(PathBuf) -> SplitJobConfig;

const PRESETS: [Named<Preset>; 2] = [
    ("narrow", SplitJobConfig::narrow, "contexts 0.15, targets 0.02 to 0.1"),
    ("wide", SplitJobConfig::wide, "contexts 0.25, targets 0.03 to 0.15"),
];

/// Runs `skysweep split`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let output = args.output.as_deref();
    let written = output.unwrap_or(Path::new(""));
    let report =
        args.write.show.watch(global, written, |watcher| jobs::split::run(&config(args), watcher)).map_err(hinted)?;
    args.write.show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

fn config(args: &Args) -> SplitJobConfig {
    let mut config = (args.preset)(args.model.clone());
    config.contexts = args.contexts;
    config.context_iou = args.context_iou.unwrap_or(config.context_iou);
    if let Some(ious) = &args.target_ious {
        config.target_ious.clone_from(ious);
    }
    config.first.clone_from(&args.first);
    config.output.clone_from(&args.output);
    config.overwrite = args.write.overwrite;
    config
}
