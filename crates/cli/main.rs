//! The `skysweep` command: arguments in, exit code out; all work is in the crates.
//!
//! One module per subcommand, each with an `Args` struct and a `run` that returns an [`Outcome`].
//! Results go to standard output; log lines and errors go to standard error. Exit codes: 0
//! complete, 1 finished with failed parts or below a requested threshold, 2 bad input or I/O error.

mod commands;
mod completions;
mod corrections;
mod error;
mod global;
mod ground;
mod interrupt;
mod log;
mod options;
mod print;
mod progress;
mod stand;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::commands::{
    align, batch, buildings, city, classes, diff, dsm, dtm, eval, groundview, heightmap, mesh, ortho, priors,
    production, products, register, rpc, selftest, simulate, splats, split, tiles, train, view,
};
use crate::global::{Global, Outcome};

/// Satellite surface models from RPC images.
#[derive(Debug, Parser)]
#[command(name = "skysweep", version, about, propagate_version = true, arg_required_else_help = true)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Bring a COLMAP model to the world by GPS or point pairs.
    Align(Box<align::Args>),
    /// Do many scenes and tasks that a file names; what is done stays done.
    Batch(batch::Args),
    /// Find buildings in one image: an index of 0 to 1.
    Buildings(buildings::Args),
    /// Show and convert city models.
    #[command(subcommand)]
    City(city::Command),
    /// Find ground, buildings and vegetation of a surface model.
    Classes(classes::Args),
    /// Print a completion script for a shell.
    Completions(completions::CompletionArgs),
    /// Find what changed between two surface models, with volumes.
    Diff(Box<diff::Args>),
    /// Make a surface model from satellite images.
    Dsm(Box<dsm::Args>),
    /// Find the bare ground under a surface model, and heights above it.
    Dtm(dtm::Args),
    /// Measure how far a surface model is from a reference.
    Eval(Box<eval::Args>),
    /// Make depths, normals and masks of what cameras and panoramas on the ground see.
    Groundview(Box<groundview::Args>),
    /// Make height maps seen from above around a camera, turned to its heading.
    Heightmap(Box<heightmap::Args>),
    /// Make a surface model of the computed chunks of a planned run.
    Merge(production::MergeArgs),
    /// Make a mesh of trained splats or of depth maps.
    Mesh(Box<mesh::Args>),
    /// Lay satellite images on a surface model, hidden cells marked.
    Ortho(Box<ortho::Args>),
    /// Print the manual page of a command.
    Man(completions::ManArgs),
    /// Plan a surface model in parts, and write the plan into a run folder.
    Plan(Box<production::PlanArgs>),
    /// Make depth, normal and mask priors of a city model for the cameras of a scene.
    Priors(Box<priors::Args>),
    /// Make point clouds, terrain and other products of a surface model.
    Products(products::Args),
    /// Correct the pointing of a new image against an existing surface model or splats.
    Register(Box<register::Args>),
    /// Show, use and convert RPC camera models.
    #[command(subcommand)]
    Rpc(rpc::Command),
    /// Compute chunks of a planned run.
    Run(production::ChunkArgs),
    /// Test whether this installation works, in a minute.
    Selftest(selftest::Args),
    /// Make a scene seen through RPC cameras, with its exact surface.
    Simulate(simulate::Args),
    /// Make Gaussian splats of a surface model and its images.
    Splats(Box<splats::Args>),
    /// Train flat Gaussian splats on the images of a dataset, with building priors.
    Train(Box<train::Args>),
    /// Choose context and target views of a COLMAP model by their overlap.
    Split(split::Args),
    /// Print a commented job file.
    Template(production::TemplateArgs),
    /// Make training tiles around cameras: height map, ortho and cameras in one folder each.
    Tiles(Box<tiles::Args>),
    /// Show a run, rasters, splats or meshes in the browser: layers, profiles, 3D.
    View(view::Args),
}

fn main() -> ExitCode {
    let command = options::grouped(Cli::command());
    let arguments = options::without_gdal_spellings(std::env::args_os(), &command);
    let cli = Cli::from_arg_matches(&command.get_matches_from(arguments)).unwrap_or_else(|error| error.exit());
    log::init(cli.global);
    if cli.global.allow_remote {
        jobs::remote::allow_remote();
    }
    if cli.global.fetch_grids {
        jobs::remote::fetch_grids();
    }
    match run(&cli) {
        Ok(Outcome::Complete) => ExitCode::SUCCESS,
        Ok(Outcome::Partial(what)) => {
            error::report(&anyhow::Error::msg(what));
            ExitCode::from(1)
        }
        Err(e) if error::is_closed_pipe(&e) => ExitCode::SUCCESS,
        Err(e) => {
            error::report(&e);
            interrupt::end_if_interrupted();
            ExitCode::from(2)
        }
    }
}

fn run(cli: &Cli) -> anyhow::Result<Outcome> {
    match &cli.command {
        Command::Align(args) => align::run(args, cli.global),
        Command::Batch(args) => batch::run(args, cli.global),
        Command::Buildings(args) => buildings::run(args, cli.global),
        Command::City(command) => city::run(command, cli.global),
        Command::Classes(args) => classes::run(args, cli.global),
        Command::Completions(args) => completions::completions(args, &mut options::grouped(Cli::command())),
        Command::Diff(args) => diff::run(args, cli.global),
        Command::Dsm(args) => dsm::run(args, cli.global),
        Command::Dtm(args) => dtm::run(args, cli.global),
        Command::Eval(args) => eval::run(args, cli.global),
        Command::Groundview(args) => groundview::run(args, cli.global),
        Command::Heightmap(args) => heightmap::run(args, cli.global),
        Command::Merge(args) => production::merge(args, cli.global),
        Command::Mesh(args) => mesh::run(args, cli.global),
        Command::Ortho(args) => ortho::run(args, cli.global),
        Command::Man(args) => completions::man(args, options::grouped(Cli::command())),
        Command::Plan(args) => production::plan(args, cli.global),
        Command::Priors(args) => priors::run(args, cli.global),
        Command::Products(args) => products::run(args, cli.global),
        Command::Register(args) => register::run(args, cli.global),
        Command::Rpc(command) => rpc::run(command, cli.global),
        Command::Run(args) => production::run(args, cli.global),
        Command::Selftest(args) => selftest::run(args, cli.global),
        Command::Simulate(args) => simulate::run(args, cli.global),
        Command::Splats(args) => splats::run(args, cli.global),
        Command::Train(args) => train::run(args, cli.global),
        Command::Split(args) => split::run(args, cli.global),
        Command::Tiles(args) => tiles::run(args, cli.global),
        Command::Template(args) => production::template(args),
        Command::View(args) => view::run(args, cli.global),
    }
}
