//! Makes height maps for the rows of a list: many tiles in one process.
//!
//! A map is written as `ID.tif`, and its metadata holds a number for what was asked for. A run that
//! finds such a map keeps it, so that a run that was stopped goes on where it was. The fate of each
//! row is in `report.json`, written at the end.

use std::path::{Path, PathBuf};
use std::time::Instant;

use formats::positions::{PositionRow, read_positions};
use numeric::Progress;
use rayon::prelude::*;

use super::config::HeightMapConfig;
use super::error::HeightMapJobError;
use super::maker::Maker;
use super::report::{HeightMapFate, HeightMapList, HeightMapRecord};
use super::source_map::Laid;
use super::tags::HeightMapTags;
use crate::camera_stand::CameraStand;
use job::error_text::with_causes;
use job::output_folder::OutputFolder;
use job::report_page;

const REPORT: &str = "report.json";

/// Makes the maps of a list and writes the report.
pub(super) fn run(
    config: &HeightMapConfig,
    positions: &Path,
    progress: &dyn Progress,
) -> Result<HeightMapList, HeightMapJobError> {
    let _taken = OutputFolder::take(&config.output)?;
    let rows = read_positions(positions)?;
    let maker = Maker::open(config, progress)?;
    let report = Run { config, maker: &maker, begun: Instant::now() }.all(&rows, progress)?;
    let lead = "Height maps seen from above, one for each position of a list.";
    report_page::write(&report.written, ("Height maps", lead), &report, Vec::new(), true)?;
    Ok(report)
}

struct Run<'a> {
    config: &'a HeightMapConfig,
    maker: &'a Maker,
    begun: Instant,
}

impl Run<'_> {
    /// Makes the maps of all rows, group by group.
    fn all(&self, rows: &[PositionRow], progress: &dyn Progress) -> Result<HeightMapList, HeightMapJobError> {
        progress.begin("height maps", rows.len());
        let mut maps = Vec::with_capacity(rows.len());
        for group in rows.chunks(self.maker.source.batch(&self.maker.settings)) {
            progress.check_cancelled()?;
            maps.extend(self.group(group, progress)?);
        }
        let count = |wanted: fn(&HeightMapFate) -> bool| maps.iter().filter(|r| wanted(&r.fate)).count();
        Ok(HeightMapList {
            rows: rows.len(),
            made: count(|fate| matches!(fate, HeightMapFate::Made(_))),
            kept: count(|fate| matches!(fate, HeightMapFate::Kept)),
            failed: count(|fate| matches!(fate, HeightMapFate::Failed { .. })),
            seconds: self.begun.elapsed().as_secs_f64(),
            maps,
            written: self.config.output.join(REPORT),
        })
    }

    /// Makes the maps of some rows, except maps that an earlier run made.
    fn group(&self, rows: &[PositionRow], progress: &dyn Progress) -> Result<Vec<HeightMapRecord>, HeightMapJobError> {
        let mut open: Vec<(&PositionRow, CameraStand)> = Vec::new();
        let mut fates: Vec<Option<HeightMapFate>> = Vec::new();
        for row in rows {
            let (fate, stand) = match &row.position {
                Err(reason) => (Some(HeightMapFate::Failed { reason: reason.clone() }), None),
                Ok(position) => {
                    let stand = self.config.stand.of_row(position);
                    if self.is_there(row, &stand)? { (Some(HeightMapFate::Kept), None) } else { (None, Some(stand)) }
                }
            };
            if fate.is_some() {
                progress.step();
            }
            fates.push(fate);
            open.extend(stand.map(|stand| (row, stand)));
        }
        let stands: Vec<CameraStand> = open.iter().map(|(_, stand)| *stand).collect();
        let laid = self.maker.source.lay(&self.maker.settings, &stands);
        let finish = |((row, stand), laid): (&(&PositionRow, CameraStand), Result<Laid, HeightMapJobError>)| {
            let made = laid.and_then(|laid| self.maker.finish(stand, laid, &self.path(row)));
            progress.step();
            match made {
                Ok(made) => HeightMapFate::Made(Box::new(made)),
                Err(error) => HeightMapFate::Failed { reason: with_causes(&error) },
            }
        };
        let mut finished = open.par_iter().zip(laid).map(finish).collect::<Vec<_>>().into_iter();
        let records = rows.iter().zip(fates).map(|(row, fate)| {
            let fate = fate.or_else(|| finished.next()).ok_or(HeightMapJobError::WorkerLost)?;
            Ok(HeightMapRecord { id: row.id.clone(), fate })
        });
        records.collect()
    }

    fn path(&self, row: &PositionRow) -> PathBuf {
        self.config.output.join(format!("{}.tif", row.id))
    }

    /// Returns whether the map that is asked for exists. Another file in its place is an error for
    /// the whole run.
    fn is_there(&self, row: &PositionRow, stand: &CameraStand) -> Result<bool, HeightMapJobError> {
        let path = self.path(row);
        if self.config.overwrite || path.symlink_metadata().is_err() {
            return Ok(false);
        }
        let same = HeightMapTags::read(&path).is_ok_and(|tags| tags.request == self.maker.request(stand));
        if same { Ok(true) } else { Err(HeightMapJobError::OtherMap { path }) }
    }
}
