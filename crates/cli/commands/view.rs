//! `skysweep view`: an interactive viewer of runs and rasters in the browser of this computer.

use std::path::PathBuf;

use jobs::view::{ViewConfig, ViewServer};
use numeric::Choice;

use crate::error::with_hint;
use crate::progress::ShowOptions;
use crate::{Global, Outcome, print};

/// Show a run, rasters, splats or meshes in the browser: layers, profiles, 3D.
#[derive(Debug, clap::Args)]
#[command(after_help = "The printed address works on this computer only, and only as a whole: it holds a secret. \
                        Ctrl-C ends the viewer. Example: skysweep view out --open")]
pub(crate) struct Args {
    /// Folders of runs, trainings and datasets, rasters, splats (PLY, SPZ, SOG, GLB), meshes (GLB).
    /// The first raster sets the coordinate system of the map.
    #[arg(required = true, value_name = "RUN|FILE")]
    inputs: Vec<PathBuf>,
    /// Port on 127.0.0.1 [default: a free one].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,
    /// End after this time [default: with Ctrl-C].
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
    #[command(flatten)]
    show: ShowOptions,
}

/// Runs `skysweep view`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = ViewConfig::new(args.inputs.clone());
    config.port = args.port;
    config.seconds = args.seconds;
    let named = args.inputs.first().cloned().unwrap_or_default();
    let report = args.show.watch(global, &named, |watcher| {
        let viewer = ViewServer::open(&config, watcher)?;
        if args.show.json {
            let reason = "for this computer and this run alone".to_owned();
            watcher.choice(&Choice { name: "address".to_owned(), value: viewer.url(), reason });
        } else {
            // Without standard output the viewer still works; the page may open itself.
            let _ = print::text(&format!("{}\n", viewer.url()));
        }
        if args.open {
            viewer.open_browser()?;
        }
        viewer.serve(watcher)
    });
    let report = report.map_err(|error| {
        let hint = (error.setting() == Some("the port")).then_some("leave --port out for a free one");
        with_hint(error, hint)
    })?;
    args.show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
