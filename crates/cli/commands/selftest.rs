//! `skysweep selftest`: whether this installation works.

use std::path::{Path, PathBuf};

use jobs::selftest::SelftestConfig;

use crate::progress::ShowOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep selftest`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder below which temporary files are made and removed again [default: that of the system].
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    #[command(flatten)]
    show: ShowOptions,
}

/// Runs `skysweep selftest`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = SelftestConfig::default();
    config.folder.clone_from(&args.folder);
    let report = args.show.watch(global, Path::new(""), |watcher| jobs::selftest::run(&config, watcher))?;
    args.show.print(global, &report, || report.text())?;
    let failed = report.failed();
    let what = || format!("the installation does not work: {}", failed.join(", "));
    Ok(if failed.is_empty() { Outcome::Complete } else { Outcome::Partial(what()) })
}
