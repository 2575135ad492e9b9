//! `skysweep align`: a COLMAP model brought to the world by GPS positions of its images or by points known in both.

mod noise;
mod world;

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use camera::Similarity;
use colmap::align::{AlignConfig, Alignment, NoiseLevel, PointPair, align, spread_ratio};
use crs::VerticalDatum;
use io::colmap::{ColmapEncoding, ColmapModel, ColmapPoint, ColmapView};
use io::splat_ply::LocalOrigin;
use serde_json::{Value, json};

use crate::{Global, Outcome, print};

/// Less spread of the cameras across their line than this part of that along it is worth a warning.
const SPREAD_LOW: f64 = 0.05;

/// Arguments of `skysweep align`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The positions are a CSV with the columns name, lon, lat, height (GPS of the images) or x, y, z, lon, lat, \
                        height (points of the model); easting, northing instead of lon, lat with --crs. The model that is written \
                        is in metres from the origin in OUT/origin.json, along the axes of the map."
)]
pub(crate) struct Args {
    /// Folder of a COLMAP model (text or binary).
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Known positions.
    #[arg(long, visible_alias = "gps", visible_alias = "pairs", value_name = "FILE.csv")]
    positions: PathBuf,
    /// Folder to write: the model, origin.json, similarity.json, align.json.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Projected EPSG code of the world [default: the UTM zone of the positions].
    #[arg(long, value_name = "EPSG")]
    crs: Option<u32>,
    /// What the heights of the positions are above: ellipsoid, egm96, egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM", default_value = "ellipsoid")]
    vertical: VerticalDatum,
    /// Largest residual that is believed, metres [default: from the residuals].
    #[arg(long, value_name = "METRES")]
    threshold: Option<f64>,
    /// Of the random numbers.
    #[arg(long, value_name = "N", default_value_t = AlignConfig::default().seed)]
    seed: u64,
    /// Text or binary files.
    #[arg(long, value_enum, default_value_t = Encoding::Bin)]
    encoding: Encoding,
    #[command(flatten)]
    noise: noise::Args,
    /// Exit with 1 when the root mean square residual is above this, metres.
    #[arg(long, value_name = "METRES")]
    max_rmse: Option<f64>,
    /// Replace files that exist.
    #[arg(long)]
    overwrite: bool,
    /// Print the report as JSON instead of text.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Encoding {
    Bin,
    Txt,
}

impl From<Encoding> for ColmapEncoding {
    fn from(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Bin => Self::Binary,
            Encoding::Txt => Self::Text,
        }
    }
}

/// A COLMAP model with its points.
struct Model {
    cameras: ColmapModel,
    points: Vec<ColmapPoint>,
}

/// Positions known in both frames.
struct Known {
    names: Vec<String>,
    pairs: Vec<PointPair>,
    /// Positions of images that the model does not have.
    unknown: usize,
}

/// Runs `skysweep align`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    if let Some(threshold) = args.threshold {
        ensure!(threshold > 0.0, "--threshold is {threshold}, expected a number of metres above 0");
    }
    let existing = args.output.join("align.json");
    ensure!(
        args.overwrite || !existing.exists(),
        "the output exists: give --overwrite to replace it: {}",
        existing.display()
    );
    let model = read_model(&args.model)?;
    let positions = io::control::read(&args.positions)?;
    let world = world::World::of(&positions, args.crs, args.vertical)?;
    let known = world.known(&positions, &model.cameras)?;
    let config = AlignConfig { threshold_m: args.threshold, seed: args.seed, ..AlignConfig::default() };
    let alignment = align(&known.pairs, &config)
        .with_context(|| format!("{} of the positions are of the model's images", known.pairs.len()))?;
    let levels = noise::measure(&args.noise, &known.pairs, &alignment, &config)?;
    let report = report(args, &world, &known, &alignment, &levels);
    let write = |folder: &Path, similarity: &Similarity| -> anyhow::Result<()> {
        write_model(folder, &model, similarity, &world.origin, args.encoding.into(), args.overwrite)
    };
    write(&args.output, &alignment.world_from_model)?;
    noise::write(&args.noise, &known.pairs, &alignment, &config, &write)?;
    let text = serde_json::to_string_pretty(&report)? + "\n";
    io::write_bytes(&existing, text.as_bytes(), args.overwrite)?;
    if args.json {
        print::json(&report)?;
    } else if !global.is_quiet() {
        print::text(&summary(args, &known, &alignment, &levels))?;
    }
    Ok(outcome(args, &known, &alignment))
}

fn read_model(folder: &Path) -> anyhow::Result<Model> {
    let has_points = ["points3D.bin", "points3D.txt"].iter().any(|name| folder.join(name).is_file());
    if has_points {
        let (cameras, points) = io::colmap::read_with_points(folder)?;
        return Ok(Model { cameras, points });
    }
    tracing::warn!("the model has no points3D: cameras alone are aligned: {}", folder.display());
    Ok(Model { cameras: io::colmap::read(folder)?, points: Vec::new() })
}

/// Writes the moved model with its origin and the similarity that moved it.
fn write_model(
    folder: &Path,
    model: &Model,
    world_from_model: &Similarity,
    origin: &LocalOrigin,
    encoding: ColmapEncoding,
    overwrite: bool,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder: {}", folder.display()))?;
    let move_view = |view: &ColmapView| ColmapView { pose: world_from_model.move_pose(&view.pose), ..view.clone() };
    let move_point =
        |point: &ColmapPoint| ColmapPoint { position: world_from_model.apply(point.position), ..point.clone() };
    let moved = ColmapModel {
        lenses: model.cameras.lenses.clone(),
        views: model.cameras.views.iter().map(move_view).collect(),
    };
    let points: Vec<ColmapPoint> = model.points.iter().map(move_point).collect();
    origin.write(&folder.join("origin.json"), overwrite)?;
    let similarity = serde_json::to_string_pretty(&similarity_json(world_from_model))? + "\n";
    io::write_bytes(folder.join("similarity.json"), similarity.as_bytes(), overwrite)?;
    Ok(io::colmap::write(folder, &moved, &points, encoding, overwrite)?)
}

fn similarity_json(similarity: &Similarity) -> Value {
    json!({
        "scale": similarity.scale(),
        "rotation": similarity.rotation(),
        "translation": similarity.translation(),
    })
}

fn report(args: &Args, world: &world::World, known: &Known, alignment: &Alignment, levels: &[NoiseLevel]) -> Value {
    let each = known.names.iter().zip(&alignment.residuals_m).zip(&alignment.inliers);
    let each =
        each.map(|((name, residual_m), inlier)| json!({ "name": name, "residual_m": residual_m, "inlier": inlier }));
    json!({
        "model": args.model.display().to_string(),
        "positions": args.positions.display().to_string(),
        "origin": world.origin,
        "world_from_model": similarity_json(&alignment.world_from_model),
        "pairs": known.pairs.len(),
        "inliers": alignment.inlier_count(),
        "positions_without_image": known.unknown,
        "threshold_m": alignment.threshold_m,
        "rmse_m": alignment.rmse_m(),
        "spread_across_line": spread_ratio(known.pairs.iter().map(|p| p.source)),
        "residuals": each.collect::<Vec<_>>(),
        "noise": levels,
    })
}

fn summary(args: &Args, known: &Known, alignment: &Alignment, levels: &[NoiseLevel]) -> String {
    let similarity = &alignment.world_from_model;
    let mut text = format!(
        "positions  {} of {} agree within {:.3} m, RMSE {:.3} m\nscale      {:.6} m per unit of the model\n",
        alignment.inlier_count(),
        known.pairs.len(),
        alignment.threshold_m,
        alignment.rmse_m(),
        similarity.scale(),
    );
    text += &noise::table(levels);
    text + &format!("written    {}\n", args.output.display())
}

/// What the user should know, and whether a requested threshold was missed.
fn outcome(args: &Args, known: &Known, alignment: &Alignment) -> Outcome {
    let spread = spread_ratio(known.pairs.iter().map(|p| p.source));
    if spread < SPREAD_LOW {
        tracing::warn!("the positions lie almost on a line (spread {spread:.3}): the turn about it is uncertain");
    }
    if known.unknown > 0 {
        tracing::warn!("{} positions are of images that are not in the model", known.unknown);
    }
    match args.max_rmse {
        Some(most) if alignment.rmse_m() > most => {
            tracing::error!(
                "the residuals have a root mean square of {:.3} m, allowed are {most} m",
                alignment.rmse_m()
            );
            Outcome::Partial
        }
        _ => Outcome::Complete,
    }
}
