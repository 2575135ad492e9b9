//! Meshes, city models and point clouds against one another: table, JSON, thresholds.

use std::path::Path;

use anyhow::{Context, bail};
use city::Lod;
use eval::{SurfaceComparison, SurfaceConfig, compare_surfaces};
use report::EvaluationReport;
use serde_json::{Value, json};

use super::surface_inputs::SurfaceInputs;
use super::{Args, refuse_grid_options};
use crate::{Global, print};

/// Options for surfaces that are no grids.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Surfaces (meshes, city models, clouds)")]
pub(super) struct SurfaceArgs {
    /// Samples per square metre of a mesh, up to a million in all.
    #[arg(long, value_name = "N", default_value_t = SurfaceConfig::default().samples_per_m2)]
    samples_per_m2: f64,
    /// Seed of the samples.
    #[arg(long, value_name = "N", default_value_t = 0)]
    sample_seed: u64,
    /// D of M3C2: diameter in which normals are estimated, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceConfig::default().normal_scale_m)]
    normal_scale: f64,
    /// d of M3C2: diameter of its cylinders, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceConfig::default().cylinder_m)]
    cylinder: f64,
    /// How far the cylinders reach on either side, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceConfig::default().cylinder_reach_m)]
    cylinder_reach: f64,
    /// Error of the registration, part of M3C2's level of detection, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    registration: f64,
    /// Edge of the voxels of the volumetric overlap, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceConfig::default().voxel_m)]
    voxel: f64,
    /// Level of detail of city models, such as 2.2 [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    pub(super) lod: Option<Lod>,
    /// Use every object of a city model that has surfaces, not only buildings.
    #[arg(long)]
    pub(super) all_objects: bool,
}

/// Compares, prints and writes; the requirements that were missed.
pub(super) fn run(args: &Args, global: Global) -> anyhow::Result<Vec<String>> {
    refuse_grid_options(args, "surfaces")?;
    let target = args.output.as_deref();
    target.map_or(Ok(()), |folder| check(folder, args.overwrite))?;
    let config = config(args);
    let inputs = SurfaceInputs::read(args)?;
    let found = compare_surfaces(&inputs.test, &inputs.reference, &config)?;
    let missed = missed(args, &found);
    let report = document(args, &inputs, &config, &found, &missed);
    if let Some(folder) = target {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder: {}", folder.display()))?;
        let text = serde_json::to_string_pretty(&report)? + "\n";
        io::write_bytes(folder.join(JSON), text.as_bytes(), true)?;
    }
    if args.json {
        print::json(&report)?;
    } else {
        print::text(&table(args, &inputs, &found))?;
        if let (Some(folder), false) = (target, global.is_quiet()) {
            print::text(&format!("report     {}\n", folder.join(JSON).display()))?;
        }
    }
    Ok(missed)
}

const JSON: &str = "report.json";

/// Refuses early to replace what no evaluation wrote.
fn check(folder: &Path, overwrite: bool) -> anyhow::Result<()> {
    let path = folder.join(JSON);
    let ours = std::fs::read_to_string(&path).is_ok_and(|text| EvaluationReport::is_ours(&text));
    if path.symlink_metadata().is_ok() && !ours && !overwrite {
        bail!(
            "a file is in the way that no evaluation wrote: choose another folder or pass --overwrite: {}",
            path.display()
        );
    }
    Ok(())
}

fn config(args: &Args) -> SurfaceConfig {
    let given = &args.surface;
    let default = SurfaceConfig::default();
    let mut thresholds_m = if args.thresholds.is_empty() { default.thresholds_m } else { args.thresholds.clone() };
    thresholds_m.extend(args.min_completeness.iter().map(|least| least.threshold_m));
    thresholds_m.sort_by(f64::total_cmp);
    thresholds_m.dedup();
    SurfaceConfig {
        thresholds_m,
        samples_per_m2: given.samples_per_m2,
        seed: given.sample_seed,
        normal_scale_m: given.normal_scale,
        cylinder_m: given.cylinder,
        cylinder_reach_m: given.cylinder_reach,
        registration_m: given.registration,
        voxel_m: given.voxel,
        ..default
    }
}

/// The requirements that are not met, in words.
fn missed(args: &Args, found: &SurfaceComparison) -> Vec<String> {
    let mean = found.accuracy.mean_m;
    let far = args.max_mae.filter(|&most| mean > most);
    let far = far.map(|most| format!("the mean distance of the test is {mean:.3} m, allowed are {most} m"));
    let few = args.min_completeness.iter().filter_map(|least| {
        let score = found.scores.iter().find(|score| score.threshold_m == least.threshold_m)?;
        let (recall, t, needed) = (score.recall, least.threshold_m, least.share);
        (recall < needed).then(|| format!("recall_{t} is {recall:.4}, required are {needed}"))
    });
    far.into_iter().chain(few).collect()
}

fn document(
    args: &Args,
    inputs: &SurfaceInputs,
    config: &SurfaceConfig,
    found: &SurfaceComparison,
    missed: &[String],
) -> Value {
    json!({
        "generator": format!("skysweep eval {}", env!("CARGO_PKG_VERSION")),
        "kind": "surfaces",
        "protocol": {
            "test": args.test.display().to_string(),
            "reference": args.reference.display().to_string(),
            "test_format": inputs.formats[0],
            "reference_format": inputs.formats[1],
            "crs": inputs.crs,
            "vertical": inputs.vertical.map(|datum| datum.to_string()),
            "local_origin": inputs.origin,
            "alignment": "none",
            "config": config,
            "notes": inputs.notes,
            "missed": missed,
        },
        "result": found,
    })
}

fn table(args: &Args, inputs: &SurfaceInputs, found: &SurfaceComparison) -> String {
    let mut text = String::new();
    let mut line = |label: &str, value: String| text += &format!("{label:<10} {value}\n");
    line("test", format!("{} ({})", args.test.display(), inputs.formats[0]));
    line("reference", format!("{} ({})", args.reference.display(), inputs.formats[1]));
    line("crs", inputs.crs.clone().unwrap_or_else(|| "no coordinate system".into()));
    let datum = inputs.vertical.map_or_else(|| "not stated".into(), |datum| datum.to_string());
    line("heights", format!("above {datum}; nothing is aligned"));
    text += &distances(found);
    text += &scores(found);
    text += &others(found);
    inputs.notes.iter().for_each(|note| text += &format!("note: {note}\n"));
    text
}

fn distances(found: &SurfaceComparison) -> String {
    let mut text = row("distance m", &["n", "mean", "median", "rmse", "le90", "le95", "max"].map(str::to_owned));
    for (name, side) in [("accuracy", found.accuracy), ("completeness", found.completeness)] {
        let metres = [side.mean_m, side.median_m, side.rmse_m, side.le90_m, side.le95_m, side.max_m];
        let cells: Vec<String> = std::iter::once(side.n.to_string()).chain(metres.map(|m| format!("{m:.4}"))).collect();
        text += &row(name, &cells);
    }
    format!("\n{text}")
}

fn scores(found: &SurfaceComparison) -> String {
    let mut text = row("threshold m", &["precision %", "recall %", "F-score %"].map(str::to_owned));
    for score in &found.scores {
        let shares = [score.precision, score.recall, score.f_score].map(|share| format!("{:.2}", 100.0 * share));
        text += &row(&score.threshold_m.to_string(), &shares);
    }
    format!("\n{text}\n")
}

fn others(found: &SurfaceComparison) -> String {
    let mut text = format!(
        "chamfer          {:.4} m (mean of the two mean distances)\nhausdorff        {:.4} m\n",
        found.chamfer_m, found.hausdorff_m
    );
    if let Some(angle) = found.normal_angle {
        text += &format!(
            "normal angle     mean {:.2}°, median {:.2}°, 90 % below {:.2}° (n {})\n",
            angle.mean_deg, angle.median_deg, angle.p90_deg, angle.n
        );
    }
    if let Some(m3c2) = found.m3c2 {
        let lod = m3c2.median_lod_m.map_or("none".to_owned(), |lod| format!("{lod:.4} m"));
        let real = m3c2.significant.map_or("-".to_owned(), |share| format!("{:.1} %", 100.0 * share));
        text += &format!(
            "M3C2             mean {:+.4} m, mean |d| {:.4} m, median {:+.4} m, std {:.4} m; level of detection {lod}, above it {real} ({} of {} core points)\n",
            m3c2.mean_m, m3c2.mean_abs_m, m3c2.median_m, m3c2.std_m, m3c2.n, m3c2.core_points
        );
    }
    let voc = found.voc;
    text += &format!(
        "VOC              {:.4} in voxels of {} m (completeness {:.4}, correctness {:.4})\n",
        voc.voc, voc.voxel_m, voc.completeness, voc.correctness
    );
    text
}

fn row(label: &str, cells: &[String]) -> String {
    let cells: String = cells.iter().map(|cell| format!(" {cell:>11}")).collect();
    format!("{label:<14}{cells}\n")
}
