//! `skysweep rpc`: show, use and convert RPC camera models.

use crate::Outcome;

/// Arguments of `skysweep rpc`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {}

/// Runs `skysweep rpc`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    match args.command {}
}
