//! Height maps for the rows of a list: many tiles in one process.
//!
//! A map is written as `ID.tif` and says in its metadata what it was asked to be; a run that finds such a map keeps it, so that
//! a killed run goes on where it was. What became of each row is in `report.json`, written at the end.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, ensure};
use io::positions::{PositionRow, read_positions};
use io::write_bytes;
use rayon::prelude::*;
use serde::Serialize;

use super::MakeArgs;
use super::tags::Tags;
use super::tile::{Made, Maker};
use crate::progress::Watcher;
use crate::stand::Stand;
use crate::{Global, Outcome, print};

const REPORT: &str = "report.json";
/// Failures that are printed one by one.
const TOLD: usize = 20;

/// What became of the rows of a list.
#[derive(Debug, Serialize)]
struct Report {
    rows: usize,
    made: usize,
    kept: usize,
    failed: usize,
    seconds: f64,
    maps: Vec<Record>,
}

#[derive(Debug, Serialize)]
struct Record {
    id: String,
    #[serde(flatten)]
    fate: Fate,
}

#[derive(Debug, Serialize)]
#[serde(tag = "status", rename_all = "lowercase")]
enum Fate {
    /// Written now.
    Made(Box<Made>),
    /// An earlier run had written it.
    Kept,
    /// Not written.
    Failed { reason: String },
}

/// Runs `skysweep heightmap --positions`.
pub(super) fn run(
    args: &MakeArgs,
    source: &Path,
    positions: &Path,
    output: &Path,
    global: Global,
) -> anyhow::Result<Outcome> {
    let rows = read_positions(positions)?;
    let maker = Maker::open(args, source, args.previews)?;
    std::fs::create_dir_all(output).with_context(|| format!("cannot make the folder: {}", output.display()))?;
    let report = Run { args, maker: &maker, output, begun: Instant::now() }.all(&rows, global)?;
    let json = serde_json::to_string_pretty(&report)? + "\n";
    write_bytes(output.join(REPORT), json.as_bytes(), true)?;
    for record in report.maps.iter().filter(|r| matches!(r.fate, Fate::Failed { .. })).take(TOLD) {
        if let Fate::Failed { reason } = &record.fate {
            tracing::error!("{}: {reason}", record.id);
        }
    }
    if args.json {
        print::json(&report)?;
    } else if !global.is_quiet() {
        let Report { made, kept, failed, seconds, .. } = &report;
        let path = output.join(REPORT);
        print::text(&format!(
            "maps    {made} made, {kept} kept, {failed} failed in {seconds:.1} s\nreport  {}\n",
            path.display()
        ))?;
    }
    Ok(if report.failed == 0 { Outcome::Complete } else { Outcome::Partial })
}

struct Run<'a> {
    args: &'a MakeArgs,
    maker: &'a Maker,
    output: &'a Path,
    begun: Instant,
}

impl Run<'_> {
    fn all(&self, rows: &[PositionRow], global: Global) -> anyhow::Result<Report> {
        let watcher = Watcher::new(self.args.progress, global);
        numeric::Progress::begin(&watcher, "height maps", rows.len());
        let mut maps = Vec::with_capacity(rows.len());
        for group in rows.chunks(self.maker.source.batch(&self.maker.settings)) {
            maps.extend(self.group(group, &watcher)?);
        }
        watcher.finish();
        let count = |wanted: fn(&Fate) -> bool| maps.iter().filter(|r| wanted(&r.fate)).count();
        Ok(Report {
            rows: rows.len(),
            made: count(|fate| matches!(fate, Fate::Made(_))),
            kept: count(|fate| matches!(fate, Fate::Kept)),
            failed: count(|fate| matches!(fate, Fate::Failed { .. })),
            seconds: self.begun.elapsed().as_secs_f64(),
            maps,
        })
    }

    /// Makes the maps of some rows, those that are there already left out.
    fn group(&self, rows: &[PositionRow], watcher: &Watcher) -> anyhow::Result<Vec<Record>> {
        let mut open: Vec<(&PositionRow, Stand)> = Vec::new();
        let mut fates: Vec<Option<Fate>> = Vec::new();
        for row in rows {
            let (fate, stand) = match &row.position {
                Err(reason) => (Some(Fate::Failed { reason: reason.clone() }), None),
                Ok(position) => {
                    let stand = self.args.stand.of_row(position);
                    if self.is_there(row, &stand)? { (Some(Fate::Kept), None) } else { (None, Some(stand)) }
                }
            };
            if fate.is_some() {
                numeric::Progress::step(watcher);
            }
            fates.push(fate);
            open.extend(stand.map(|stand| (row, stand)));
        }
        let stands: Vec<Stand> = open.iter().map(|(_, stand)| *stand).collect();
        let laid = self.maker.source.lay(&self.maker.settings, &stands);
        let finish = |((row, stand), laid): (&(&PositionRow, Stand), anyhow::Result<_>)| {
            let made = laid.and_then(|laid| self.maker.finish(stand, laid, &self.path(row)));
            numeric::Progress::step(watcher);
            match made {
                Ok(made) => Fate::Made(Box::new(made)),
                Err(error) => Fate::Failed { reason: format!("{error:#}") },
            }
        };
        let mut finished = open.par_iter().zip(laid).map(finish).collect::<Vec<_>>().into_iter();
        let records = rows.iter().zip(fates).map(|(row, fate)| {
            let fate = fate.or_else(|| finished.next()).context("a row of the list was lost")?;
            Ok(Record { id: row.id.clone(), fate })
        });
        records.collect()
    }

    fn path(&self, row: &PositionRow) -> std::path::PathBuf {
        self.output.join(format!("{}.tif", row.id))
    }

    /// Whether the map that is wanted is there; another file in its place is an error for the whole run.
    fn is_there(&self, row: &PositionRow, stand: &Stand) -> anyhow::Result<bool> {
        let path = self.path(row);
        if self.args.overwrite || path.symlink_metadata().is_err() {
            return Ok(false);
        }
        let same = Tags::read(&path).is_ok_and(|tags| tags.request == self.maker.request(stand));
        ensure!(
            same,
            "a file is in the way that is not the map asked for (other options, or another source): choose another folder or \
             pass --overwrite: {}",
            path.display()
        );
        Ok(true)
    }
}
