//! `skysweep batch`: many scenes and tasks that a file names.

use std::path::PathBuf;

use jobs::batch::read_batch;

use crate::error::hinted;
use crate::progress::ShowOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep batch`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "skysweep template batch prints a file to begin with. Started again, a batch goes on where it was."
)]
pub(crate) struct Args {
    /// The batch file.
    #[arg(value_name = "BATCH.toml")]
    file: PathBuf,
    /// Check the file and say what would be done; write nothing.
    #[arg(long)]
    dry_run: bool,
    /// Work on this scene alone; may be repeated.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    #[command(flatten)]
    show: ShowOptions,
}

/// Runs `skysweep batch`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut batch = read_batch(&args.file).map_err(hinted)?;
    batch.select(&args.only).map_err(hinted)?;
    if args.dry_run {
        let report = jobs::batch::look(&batch).map_err(hinted)?;
        args.show.print(global, &report, || report.text())?;
        let what = || "tasks that would fail; the list names the reasons".to_owned();
        return Ok(if report.has_failed() { Outcome::Partial(what()) } else { Outcome::Complete });
    }
    let report = args.show.watch(global, &batch.output, |watcher| jobs::batch::run(&batch, watcher)).map_err(hinted)?;
    args.show.print(global, &report, || report.text())?;
    let what = || format!("tasks that are not complete: {}; the report names the reasons", report.incomplete);
    Ok(if report.incomplete == 0 { Outcome::Complete } else { Outcome::Partial(what()) })
}
