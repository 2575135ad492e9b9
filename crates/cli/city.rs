//! `skysweep city`: what is in a city model, and its triangles or footprints in another format.
//!
//! Exit code 1 when parts of the model were lost: objects none of whose surfaces could be used, or surfaces that the reader
//! had to leave out. The report names every object of the file, used or not, with the reason.

mod report;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use city::{Effect, Lod, LodChoice, MeshConfig, Meshed, ObjectStatus, Scope, TriangleMesh};
use clap::ValueEnum;
use io::citymodel::{CityError, CityFile, CityJsonOptions, MeshFormat, write_cityjson, write_footprints, write_mesh};

use crate::{Outcome, print};
use report::Report;

/// Arguments of `skysweep city`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Show what is in a city model: format, reference system, levels of detail, objects, triangles, defects.
    Info(InfoArgs),
    /// Write the triangles (OBJ, PLY, glTF), the footprints with heights (GeoJSON) or the model (CityJSON 2.0).
    Convert(ConvertArgs),
}

/// What both commands read, and how.
#[derive(Debug, clap::Args)]
struct Input {
    /// City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
    #[arg(value_name = "MODEL")]
    file: PathBuf,
    /// Level of detail, such as 2.2 [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    lod: Option<Lod>,
    /// Use every object with surfaces, not only buildings.
    #[arg(long)]
    all_objects: bool,
    /// Write what became of every object, with all defects, to this file (JSON). Only with it solids are checked for shells
    /// that meet themselves, cavities that are none, and parts that overlap (codes 306, 4xx, 5xx, 601).
    #[arg(long, value_name = "REPORT.json")]
    report: Option<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    overwrite: bool,
}

#[derive(Debug, clap::Args)]
struct InfoArgs {
    #[command(flatten)]
    input: Input,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct ConvertArgs {
    #[command(flatten)]
    input: Input,
    /// File to write.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Format to write [default: by the ending of OUT: .obj, .ply, .glb, .geojson or .json].
    #[arg(long)]
    format: Option<Format>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Wavefront OBJ, whole coordinates.
    Obj,
    /// Binary PLY, f32 from an origin that the header names.
    Ply,
    /// Binary glTF, f32 from an origin that the extras name.
    Glb,
    /// Footprints with heights in longitude and latitude.
    Geojson,
    /// CityJSON 2.0 with all objects and levels.
    Cityjson,
}

/// Runs `skysweep city`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::Info(args) => info(args),
        Command::Convert(args) => convert(args),
    }
}

fn info(args: &InfoArgs) -> anyhow::Result<Outcome> {
    let (file, meshed) = read(&args.input)?;
    let report = Report::new(&file, &meshed);
    if args.json {
        print::json(&report.summary())?;
    } else {
        print::text(&report.to_text())?;
    }
    write_report(&args.input, &report)?;
    Ok(outcome(&file, &meshed))
}

fn convert(args: &ConvertArgs) -> anyhow::Result<Outcome> {
    let format = match args.format {
        Some(format) => format,
        None => format_of(&args.output)?,
    };
    let (file, meshed) = read(&args.input)?;
    let (path, overwrite) = (&args.output, args.input.overwrite);
    let triangles = |format| write_mesh(path, &file.model, &meshed.mesh, format, overwrite);
    let written = match format {
        Format::Obj => triangles(MeshFormat::Obj),
        Format::Ply => triangles(MeshFormat::Ply),
        Format::Glb => triangles(MeshFormat::Glb),
        Format::Cityjson => {
            write_cityjson(path, &file.model, &CityJsonOptions { overwrite, ..CityJsonOptions::default() })
        }
        Format::Geojson => write_footprints(path, &file.model, &meshed.objects, overwrite).map(|count| {
            if count.without > 0 {
                tracing::warn!("{} objects have no surface that looks down, and no footprint", count.without);
            }
        }),
    };
    match written {
        Err(e @ CityError::Exists { .. }) => return Err(e).context("nothing was written: give --overwrite to replace"),
        written => written?,
    }
    write_report(&args.input, &Report::new(&file, &meshed))?;
    Ok(outcome(&file, &meshed))
}

fn read(input: &Input) -> anyhow::Result<(CityFile, Meshed)> {
    let file = io::citymodel::read(&input.file)?;
    let config = MeshConfig {
        lod: input.lod.map_or_else(LodChoice::default, LodChoice::Only),
        scope: if input.all_objects { Scope::Everything } else { Scope::Buildings },
    };
    let mut meshed = TriangleMesh::from_model(&file.model, &config)?;
    if input.report.is_some() {
        meshed.defects.extend(city::check_solids(&file.model, &config)?);
    }
    tracing::info!("{}: {}, {} triangles", file.source.display(), file.format, meshed.mesh.triangles.len());
    Ok((file, meshed))
}

fn write_report(input: &Input, report: &Report<'_>) -> anyhow::Result<()> {
    let Some(path) = &input.report else { return Ok(()) };
    let text = serde_json::to_string_pretty(&report.full())? + "\n";
    io::write_bytes(path, text.as_bytes(), input.overwrite)?;
    Ok(())
}

/// Whether anything of the model was lost.
fn outcome(file: &CityFile, meshed: &Meshed) -> Outcome {
    let unusable = meshed.objects.iter().any(|object| object.status == ObjectStatus::Unusable);
    let dropped =
        |defect: &city::Defect| defect.effect == Effect::Dropped && defect.code != city::DefectCode::NotASurface;
    if unusable || file.defects.iter().any(dropped) { Outcome::Partial } else { Outcome::Complete }
}

fn format_of(output: &Path) -> anyhow::Result<Format> {
    let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("obj") => Ok(Format::Obj),
        Some("ply") => Ok(Format::Ply),
        Some("glb") => Ok(Format::Glb),
        Some("geojson") => Ok(Format::Geojson),
        Some("json") => Ok(Format::Cityjson),
        _ => bail!(
            "no format belongs to the ending of {}: give --format obj, ply, glb, geojson or cityjson",
            output.display()
        ),
    }
}
