//! `skysweep rpc`: show, use and convert RPC camera models.
//!
//! Image coordinates are sample (column) and line (row) with the centre of the upper-left pixel at (0, 0); ground
//! coordinates are WGS 84 longitude and latitude in degrees and the height above the ellipsoid in metres.

mod info;
mod points;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use io::rpc::{Existing, RpcFile, RpcFormat};

use crate::Outcome;

/// Arguments of `skysweep rpc`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Show the RPC of a file: format, offsets and scales, validity box, ground sampling distance, viewing angles.
    Info(info::Args),
    /// Project ground points into the image.
    Project(points::ProjectArgs),
    /// Find the ground point that is seen at an image position, at a given height.
    Localize(points::LocalizeArgs),
    /// Write the RPC in another format.
    Convert(ConvertArgs),
}

/// Arguments of `skysweep rpc convert`.
#[derive(Debug, clap::Args)]
struct ConvertArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// File to write.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Format to write [default: by the ending of OUT: .txt, .rpb or .json].
    #[arg(long)]
    format: Option<OutputFormat>,
    /// Replace OUT where it exists.
    #[arg(long)]
    overwrite: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum OutputFormat {
    /// `KEY: value` lines, as _RPC.TXT.
    Text,
    /// DigitalGlobe's RPB.
    Rpb,
    /// JSON with rpcm's names.
    Json,
}

/// Runs `skysweep rpc`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::Info(args) => info::run(args),
        Command::Project(args) => points::project(args),
        Command::Localize(args) => points::localize(args),
        Command::Convert(args) => convert(args),
    }
}

/// Reads the RPC of a file and tells its warnings to the log.
fn read(path: &Path) -> anyhow::Result<RpcFile> {
    let file = io::rpc::read(path)?;
    for warning in &file.warnings {
        tracing::warn!("{}: {warning}", file.source.display());
    }
    tracing::info!("{}: {}", file.source.display(), file.format);
    Ok(file)
}

fn convert(args: &ConvertArgs) -> anyhow::Result<Outcome> {
    let format = match args.format {
        Some(OutputFormat::Text) => RpcFormat::Text,
        Some(OutputFormat::Rpb) => RpcFormat::Rpb,
        Some(OutputFormat::Json) => RpcFormat::Json,
        None => format_of(&args.output)?,
    };
    let file = read(&args.file)?;
    let existing = if args.overwrite { Existing::Replace } else { Existing::Keep };
    match io::rpc::write(&args.output, &file.rpc, format, existing) {
        Err(e @ io::rpc::RpcWriteError::Exists { .. }) => {
            Err(e).context("nothing was written: give --overwrite to replace")
        }
        result => Ok(result.map(|()| Outcome::Complete)?),
    }
}

fn format_of(output: &Path) -> anyhow::Result<RpcFormat> {
    let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("txt" | "rpc") => Ok(RpcFormat::Text),
        Some("rpb") => Ok(RpcFormat::Rpb),
        Some("json") => Ok(RpcFormat::Json),
        _ => bail!("no format belongs to the ending of {}: give --format text, rpb or json", output.display()),
    }
}
