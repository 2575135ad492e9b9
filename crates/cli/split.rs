//! `skysweep split`: context and target views of a COLMAP model, by the overlap of what they see.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use colmap::split::{Choice, Split, SplitConfig, points_of_views, split};
use io::colmap::{ColmapModel, ColmapPoint};
use serde_json::{Value, json};

use crate::{Global, Outcome, print};

/// Arguments of `skysweep split`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Overlap is the intersection over union of the points of the model that two views see. Views are chosen \
                        greedily, closest to what is wanted; with several contexts the largest overlap counts."
)]
pub(crate) struct Args {
    /// Folder of a COLMAP model with its points.
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// File to write (JSON) [default: print only].
    #[arg(short, long, value_name = "OUT.json")]
    output: Option<PathBuf>,
    /// The paper's overlaps: contexts 0.15 and targets 0.02 to 0.1 (narrow), or contexts 0.25 and targets 0.03 to 0.15 (wide).
    #[arg(long, value_enum, default_value_t = Preset::Narrow)]
    preset: Preset,
    /// Number of contexts.
    #[arg(long, value_name = "N", default_value_t = 2)]
    contexts: usize,
    /// Overlap of each context with those before [default: the preset's].
    #[arg(long, value_name = "IOU")]
    context_iou: Option<f64>,
    /// Overlaps of the targets with the contexts [default: the preset's].
    #[arg(long, value_name = "IOU", value_delimiter = ',')]
    target_ious: Option<Vec<f64>>,
    /// Name of the first context [default: the one with the best split].
    #[arg(long, value_name = "IMAGE")]
    first: Option<String>,
    /// Replace the file if it exists.
    #[arg(long)]
    overwrite: bool,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Preset {
    Narrow,
    Wide,
}

/// Runs `skysweep split`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let (model, points) = io::colmap::read_with_points(&args.model)?;
    let config = config(args, &model)?;
    let found = split(&points_by_view(&model, &points), &config)?;
    let report = report(args, &model, &found);
    if let Some(path) = &args.output {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        io::write_bytes(path, text.as_bytes(), args.overwrite)?;
    }
    if args.json {
        print::json(&report)?;
    } else if !global.is_quiet() || args.output.is_none() {
        print::text(&summary(&model, &found))?;
    }
    Ok(Outcome::Complete)
}

fn config(args: &Args, model: &ColmapModel) -> anyhow::Result<SplitConfig> {
    let preset = match args.preset {
        Preset::Narrow => SplitConfig::narrow(),
        Preset::Wide => SplitConfig::wide(),
    };
    let index = |name: &String| {
        let found = model.views.iter().position(|view| view.name == *name);
        found.with_context(|| format!("no image of the model is called {name:?}"))
    };
    ensure!(args.contexts <= model.views.len(), "{} contexts of {} images", args.contexts, model.views.len());
    Ok(SplitConfig {
        contexts: args.contexts,
        context_iou: args.context_iou.unwrap_or(preset.context_iou),
        target_ious: args.target_ious.clone().unwrap_or(preset.target_ious),
        first: args.first.as_ref().map(index).transpose()?,
    })
}

fn points_by_view(model: &ColmapModel, points: &[ColmapPoint]) -> Vec<Vec<u32>> {
    let tracks: Vec<Vec<u32>> = points.iter().map(|point| point.track.iter().map(|seen| seen.view).collect()).collect();
    points_of_views(model.views.len(), tracks.iter().map(Vec::as_slice))
}

fn report(args: &Args, model: &ColmapModel, found: &Split) -> Value {
    let one = |choice: &Choice| json!({ "image": model.views[choice.view].name, "wanted_iou": choice.wanted_iou, "iou": choice.iou });
    let all = |choices: &[Choice]| choices.iter().map(one).collect::<Vec<_>>();
    json!({
        "model": args.model.display().to_string(),
        "contexts": all(&found.contexts),
        "targets": all(&found.targets),
        "deviation": found.deviation,
    })
}

fn summary(model: &ColmapModel, found: &Split) -> String {
    let line = |what: &str, choice: &Choice| {
        let name = &model.views[choice.view].name;
        match (choice.iou, choice.wanted_iou) {
            (Some(iou), Some(wanted)) => format!("{what:10} {iou:.3} (wanted {wanted:.3})  {name}\n"),
            _ => format!("{what:10} first                  {name}\n"),
        }
    };
    let contexts = found.contexts.iter().map(|choice| line("context", choice));
    contexts.chain(found.targets.iter().map(|choice| line("target", choice))).collect()
}
