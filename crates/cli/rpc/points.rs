//! `skysweep rpc project` and `localize`: one point from the command line, or many from a file or standard input.
//!
//! Input lines hold three numbers separated by blanks or commas; empty lines and lines starting with # are passed over.
//! Every other line gives one line of output, in order. A point without an answer gives `nan nan` (in JSON an `error`),
//! a line on standard error, and exit code 1 at the end.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use camera::{CameraError, ImagePoint};
use geodesy::LonLatHeight;
use serde_json::{Value, json};

use crate::Outcome;

/// Longer lines hold no three numbers.
const LINE_MAX: u64 = 4096;

/// Arguments of `skysweep rpc project`.
#[derive(Debug, clap::Args)]
pub(crate) struct ProjectArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// Longitude, degrees.
    #[arg(long, requires_all = ["lat", "height"], allow_negative_numbers = true)]
    lon: Option<f64>,
    /// Latitude, degrees.
    #[arg(long, requires = "lon", allow_negative_numbers = true)]
    lat: Option<f64>,
    /// Height above the WGS 84 ellipsoid, metres.
    #[arg(long, requires = "lon", allow_negative_numbers = true)]
    height: Option<f64>,
    /// File with a point per line: longitude latitude height; - is standard input [default: -].
    #[arg(long, value_name = "FILE", conflicts_with_all = ["lon", "lat", "height"])]
    points: Option<PathBuf>,
    /// Print one JSON object per point.
    #[arg(long)]
    json: bool,
}

/// Arguments of `skysweep rpc localize`.
#[derive(Debug, clap::Args)]
pub(crate) struct LocalizeArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// Column; 0 is the centre of the first.
    #[arg(long, requires_all = ["line", "height"], allow_negative_numbers = true)]
    sample: Option<f64>,
    /// Row; 0 is the centre of the first.
    #[arg(long, requires = "sample", allow_negative_numbers = true)]
    line: Option<f64>,
    /// Height above the WGS 84 ellipsoid, metres.
    #[arg(long, requires = "sample", allow_negative_numbers = true)]
    height: Option<f64>,
    /// File with a point per line: sample line height; - is standard input [default: -].
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sample", "line", "height"])]
    points: Option<PathBuf>,
    /// Print one JSON object per point.
    #[arg(long)]
    json: bool,
}

/// An answer: for people and for programs.
struct Answer {
    text: String,
    json: Value,
}

/// Runs `skysweep rpc project`.
pub(crate) fn project(args: &ProjectArgs) -> anyhow::Result<Outcome> {
    let rpc = super::read(&args.file)?.rpc;
    let answer = |[lon, lat, height]: [f64; 3]| {
        let p = rpc.project(LonLatHeight::new(lon, lat, height))?;
        Ok(Answer {
            text: format!("{:.9} {:.9}", p.sample, p.line),
            json: json!({ "lon_deg": lon, "lat_deg": lat, "height_m": height, "sample": p.sample, "line": p.line }),
        })
    };
    match (args.lon, args.lat, args.height) {
        (Some(lon), Some(lat), Some(height)) => one([lon, lat, height], answer, args.json),
        _ => many(args.points.as_deref(), answer, args.json),
    }
}

/// Runs `skysweep rpc localize`.
pub(crate) fn localize(args: &LocalizeArgs) -> anyhow::Result<Outcome> {
    let rpc = super::read(&args.file)?.rpc;
    let answer = |[sample, line, height]: [f64; 3]| {
        let g = rpc.localize(ImagePoint::new(sample, line), height)?;
        Ok(Answer {
            text: format!("{:.12} {:.12} {}", g.lon_deg, g.lat_deg, g.height_m),
            json: json!({ "sample": sample, "line": line, "lon_deg": g.lon_deg, "lat_deg": g.lat_deg, "height_m": height }),
        })
    };
    match (args.sample, args.line, args.height) {
        (Some(sample), Some(line), Some(height)) => one([sample, line, height], answer, args.json),
        _ => many(args.points.as_deref(), answer, args.json),
    }
}

fn one(
    point: [f64; 3],
    answer: impl Fn([f64; 3]) -> Result<Answer, CameraError>,
    json: bool,
) -> anyhow::Result<Outcome> {
    let answer = answer(point).with_context(|| format!("no answer for the point {point:?}"))?;
    let text = if json { answer.json.to_string() } else { answer.text };
    crate::print::text(&(text + "\n"))?;
    Ok(Outcome::Complete)
}

fn many(
    points: Option<&Path>,
    answer: impl Fn([f64; 3]) -> Result<Answer, CameraError>,
    json: bool,
) -> anyhow::Result<Outcome> {
    let mut input: Box<dyn BufRead> = match points.filter(|p| *p != Path::new("-")) {
        Some(path) => {
            let file = File::open(path).with_context(|| format!("cannot read the points of {}", path.display()))?;
            Box::new(BufReader::new(file))
        }
        None => Box::new(std::io::stdin().lock()),
    };
    let mut output = std::io::BufWriter::new(std::io::stdout().lock());
    let mut failed = 0_usize;
    let mut number = 0_usize;
    while let Some(line) = next_line(&mut *input).with_context(|| format!("line {} of the points", number + 1))? {
        number += 1;
        let Some(point) = parse(&line).with_context(|| format!("line {number} of the points"))? else { continue };
        let text = match answer(point) {
            Ok(answer) if json => answer.json.to_string(),
            Ok(answer) => answer.text,
            Err(e) => {
                failed += 1;
                tracing::warn!("line {number}: {e}");
                if json { json!({ "error": e.to_string() }).to_string() } else { "nan nan".to_owned() }
            }
        };
        writeln!(output, "{text}")?;
    }
    output.flush()?;
    if failed == 0 {
        return Ok(Outcome::Complete);
    }
    tracing::error!("{failed} points have no answer");
    Ok(Outcome::Partial)
}

fn next_line(input: &mut dyn BufRead) -> anyhow::Result<Option<String>> {
    let mut line = String::new();
    let read = input.take(LINE_MAX).read_line(&mut line)?;
    if read as u64 == LINE_MAX {
        bail!("the line has {LINE_MAX} characters or more, expected three numbers");
    }
    Ok((read > 0).then_some(line))
}

/// The three numbers of a line; `None` for empty lines and comments.
fn parse(line: &str) -> anyhow::Result<Option<[f64; 3]>> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let mut words = line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
    let mut point = [0.0; 3];
    for value in &mut point {
        let word = words.next().with_context(|| format!("found {line:?}, expected three numbers"))?;
        *value = word.parse().with_context(|| format!("found {word:?}, expected a number"))?;
    }
    if words.next().is_some() {
        bail!("found {line:?}, expected three numbers");
    }
    Ok(Some(point))
}
