//! Maps in the pixels of a camera against one another: depths, normals, masks.

use std::path::Path;

use anyhow::{bail, ensure};
use eval::{compare_depths, compare_masks, compare_normals};
use io::maps::MapFile;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Args, refuse_grid_options};
use crate::print;

/// `--maps`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum MapKind {
    /// Depths, one number a pixel; 0, NaN and infinity are none.
    Depth,
    /// Normals, three numbers a pixel; zeros are none.
    Normals,
    /// Truth values; what is not 0 is set.
    Mask,
}

/// Compares, prints and writes nothing; the requirements that were missed.
pub(super) fn run(args: &Args) -> anyhow::Result<Vec<String>> {
    refuse_grid_options(args, "maps")?;
    ensure!(args.output.is_none(), "maps are compared on the terminal or with --json: leave -o out");
    ensure!(args.min_completeness.is_empty(), "--min-completeness is not for maps: leave it out");
    let (test, reference) = (io::maps::read(&args.test)?, io::maps::read(&args.reference)?);
    let kind = match args.maps {
        Some(kind) => kind,
        None => kind_of(&reference, &args.reference)?,
    };
    let size = |map: &MapFile| (map.width, map.height);
    ensure!(
        size(&test) == size(&reference) && test.channels == reference.channels,
        "the test has {} x {} pixels of {} numbers, the reference {} x {} of {}: expected maps of one camera",
        test.width,
        test.height,
        test.channels,
        reference.width,
        reference.height,
        reference.channels
    );
    let (result, mae) = compare(kind, &test, &reference)?;
    let missed = args.max_mae.filter(|&most| mae.is_some_and(|mae| mae.is_nan() || mae > most));
    let missed: Vec<String> = missed.map(|most| format!("mae is above {most}")).into_iter().collect();
    let report = json!({
        "generator": format!("skysweep eval {}", env!("CARGO_PKG_VERSION")),
        "kind": kind,
        "test": args.test.display().to_string(),
        "reference": args.reference.display().to_string(),
        "size": [test.width, test.height],
        "result": result,
        "missed": missed,
    });
    if args.json {
        print::json(&report)?
    } else {
        print::text(&table(&report))?
    }
    Ok(missed)
}

/// What a map is by its shape and type.
fn kind_of(map: &MapFile, path: &Path) -> anyhow::Result<MapKind> {
    match (map.channels, map.is_mask) {
        (1, true) => Ok(MapKind::Mask),
        (1, false) => Ok(MapKind::Depth),
        (3, false) => Ok(MapKind::Normals),
        (channels, _) => bail!("{channels} numbers a pixel: say what they are with --maps: {}", path.display()),
    }
}

/// The result, and the mean error that --max-mae is held against (degrees for normals).
fn compare(kind: MapKind, test: &MapFile, reference: &MapFile) -> anyhow::Result<(Value, Option<f64>)> {
    let channels = if kind == MapKind::Normals { 3 } else { 1 };
    ensure!(test.channels == channels, "{} numbers a pixel, expected {channels} for {kind:?}", test.channels);
    Ok(match kind {
        MapKind::Depth => {
            let found = compare_depths(&test.data, &reference.data)?;
            (serde_json::to_value(found)?, found.errors.map(|errors| errors.mae).or(Some(f64::NAN)))
        }
        MapKind::Normals => {
            let found = compare_normals(test.data.as_chunks().0, reference.data.as_chunks().0)?;
            (serde_json::to_value(found)?, found.angles.map(|angles| angles.mean_deg).or(Some(f64::NAN)))
        }
        MapKind::Mask => {
            let set = |map: &MapFile| map.data.iter().map(|&value| value != 0.0).collect::<Vec<bool>>();
            (serde_json::to_value(compare_masks(&set(test), &set(reference))?)?, None)
        }
    })
}

/// Every number of the report, one a line.
fn table(report: &Value) -> String {
    let mut lines = String::new();
    for key in ["test", "reference", "kind"] {
        lines += &format!("{key:<22} {}\n", report[key].as_str().unwrap_or_default());
    }
    for (group, values) in report["result"].as_object().into_iter().flatten() {
        match values {
            Value::Object(values) => {
                for (name, value) in values {
                    lines += &format!("{:<22} {}\n", format!("{group}.{name}"), shown(value));
                }
            }
            value => lines += &format!("{group:<22} {}\n", shown(value)),
        }
    }
    lines
}

fn shown(value: &Value) -> String {
    match value {
        Value::Array(values) => values.iter().map(shown).collect::<Vec<_>>().join("  "),
        Value::Number(number) if number.is_f64() => format!("{:.6}", number.as_f64().unwrap_or(f64::NAN)),
        Value::Null => "-".to_owned(),
        other => other.to_string(),
    }
}
