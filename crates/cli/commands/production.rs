//! `skysweep plan`, `run` and `merge`: a surface model in parts, by one process or many. `skysweep
//! template` prints job files.

use std::path::PathBuf;

use jobs::production::{ChunkRunConfig, ChunkSelection, MergeConfig, merge_run, plan_run, run_chunks};

use crate::commands::dsm::{SceneArgs, print as print_report, production_hinted};
use crate::options::{Named, named};
use crate::progress::{RunOptions, ShowOptions};
use crate::{Global, Outcome, print};

/// Arguments of `skysweep plan`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: skysweep plan left.tif right.tif -o run; skysweep run run; skysweep merge run")]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    show: ShowOptions,
}

/// Arguments of `skysweep run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "An array job: skysweep run RUN --chunks $SLURM_ARRAY_TASK_ID/100 --resume")]
pub(crate) struct ChunkArgs {
    /// Folder of a planned run. Several processes may work in it at once.
    #[arg(value_name = "RUN")]
    folder: PathBuf,
    /// Chunks to compute: numbers from 0 (3,7), or a share (2/5 is the second of five) [default:
    /// all that nobody else computes].
    #[arg(long, value_name = "N,…|K/N")]
    chunks: Option<ChunkSelection>,
    /// Try failed chunks again; plan and compute again what no longer fits the inputs, the
    /// configuration or the version.
    #[arg(long)]
    resume: bool,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[command(flatten)]
    show: ShowOptions,
}

/// Arguments of `skysweep merge`.
#[derive(Debug, clap::Args)]
#[command(mut_arg("overwrite", |arg| arg.help("Replace existing results")))]
pub(crate) struct MergeArgs {
    /// Folder of a planned run whose chunks are computed.
    #[arg(value_name = "RUN")]
    folder: PathBuf,
    /// Leave chunks without a result void.
    #[arg(long)]
    partial: bool,
    #[command(flatten)]
    run: RunOptions,
}

/// Arguments of `skysweep template`.
#[derive(Debug, clap::Args)]
pub(crate) struct TemplateArgs {
    /// Job that the file is for.
    #[arg(value_name = "JOB", value_parser = named(&TEMPLATES))]
    template: &'static str,
}

const TEMPLATES: [Named<&str>; 3] = [
    ("dsm", jobs::dsm::job_file::DSM_TEMPLATE, "A surface model: skysweep dsm JOB.toml"),
    ("batch", jobs::batch::BATCH_TEMPLATE, "Many scenes: skysweep batch BATCH.toml"),
    ("study", jobs::batch::STUDY_TEMPLATE, "One patch with several settings: skysweep batch STUDY.toml"),
];

/// Runs `skysweep plan`.
pub(crate) fn plan(args: &PlanArgs, global: Global) -> anyhow::Result<Outcome> {
    let config = args.scene.config()?;
    let plan = args.show.watch(global, &config.output, |watcher| plan_run(&config, watcher));
    let plan = plan.map_err(production_hinted)?;
    args.show.print(global, &plan, || plan.text())?;
    Ok(Outcome::Complete)
}

/// Runs `skysweep run`.
pub(crate) fn run(args: &ChunkArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = ChunkRunConfig::new(args.folder.clone());
    config.chunks = args.chunks.clone().unwrap_or_default();
    config.resume = args.resume;
    config.threads = args.threads;
    let report = args.show.watch(global, &args.folder, |watcher| run_chunks(&config, watcher));
    let report = report.map_err(production_hinted)?;
    args.show.print(global, &report, || report.text())?;
    let what = || format!("chunks that could not be computed: {}", report.failed.len());
    Ok(if report.failed.is_empty() { Outcome::Complete } else { Outcome::Partial(what()) })
}

/// Runs `skysweep merge`.
pub(crate) fn merge(args: &MergeArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = MergeConfig::new(args.folder.clone());
    config.partial = args.partial;
    config.overwrite = args.run.overwrite;
    config.threads = args.run.threads;
    let show = args.run.show;
    let product = show.watch(global, &args.folder, |watcher| merge_run(&config, watcher));
    print_report(show, global, &product.map_err(production_hinted)?.report, &args.folder)
}

/// Runs `skysweep template`.
pub(crate) fn template(args: &TemplateArgs) -> anyhow::Result<Outcome> {
    print::text(args.template).map(|()| Outcome::Complete)
}
