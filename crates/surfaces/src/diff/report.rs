//! The report of a change.

use std::fmt::Write;
use std::path::PathBuf;

use change::{ChangeConfig, ChangeRegion, ErrorCorrelation, Volume};
use eval::{LocalShifts, Shift};
use serde::Serialize;

/// Most regions that the text lists.
const LISTED: usize = 12;

/// A region of change with its number.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct DiffRegion {
    /// Its number in `regions.tif`.
    pub number: usize,
    /// Middle of its cells on the map of the first surface.
    pub centre: [f64; 2],
    /// Area, change, volume and significance.
    #[serde(flatten)]
    pub found: ChangeRegion,
}

/// Volumes within a polygon of the given layer.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct AreaVolume {
    /// Name of the polygon, or its number from 1.
    pub name: String,
    /// The volumes.
    #[serde(flatten)]
    pub volume: Volume,
}

/// A finished change.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct DiffReport {
    /// Surface of the first date.
    pub before: PathBuf,
    /// Surface of the second date.
    pub after: PathBuf,
    /// When the images of the first surface were taken, as far as the surface says so.
    pub before_acquired: Vec<String>,
    /// When those of the second surface were taken.
    pub after_acquired: Vec<String>,
    /// Folder of the results.
    pub output: PathBuf,
    /// CRS of the rasters, and the vertical datum of both surfaces.
    pub crs: String,
    /// Vertical datum in words.
    pub vertical: String,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Shift that was added to the second surface, metres.
    pub shift: Shift,
    /// What blocks were moved by besides, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blocks: Option<DiffBlocks>,
    /// Factor, at least 1, that the stated deviations needed to explain the differences of
    /// unchanged ground; without stated deviations the deviation that was measured, metres.
    pub sigma_factor: f64,
    /// Median level of detection of a cell at the confidence, metres.
    pub detection_m: f64,
    /// Deviation of an offset of all heights, metres. It is part of all regional deviations.
    pub offset_sigma_m: f64,
    /// Correlation of the errors of two cells by their distance.
    pub correlation: ErrorCorrelation,
    /// Cells observed on both dates.
    pub observed_cells: usize,
    /// Those of them that decide: rather right than wrong, and clear of the borders.
    pub deciding_cells: usize,
    /// Cells with a height on both dates of which one was filled.
    pub filled_cells: usize,
    /// Candidates that were tested.
    pub tested: usize,
    /// The regions of significant change.
    pub regions: Vec<DiffRegion>,
    /// Volumes over all cells.
    pub total: Volume,
    /// Volumes within the given polygons.
    pub areas: Vec<AreaVolume>,
    /// Parameters of the search.
    pub parameters: ChangeConfig,
    /// Choices and doubts that a reader must know.
    pub notes: Vec<String>,
}

/// Local shifts of the second surface, after the shift of the whole.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DiffBlocks {
    /// Side of the blocks as asked for, metres.
    pub side_m: f64,
    /// Number of blocks.
    pub count: usize,
    /// Blocks that found a shift of their own; the others take those beside them.
    pub found: usize,
    /// Standard deviations of the true local shifts east, north and up, metres; 0 where noise
    /// explains what was found.
    pub deviation_m: [f64; 3],
    /// Largest local shift sideways, metres.
    pub largest_sideways_m: f64,
    /// Largest local shift up or down, metres.
    pub largest_up_m: f64,
}

impl DiffBlocks {
    pub(super) fn new(side_m: f64, local: &LocalShifts) -> Self {
        let (largest_sideways_m, largest_up_m) = local.largest_m;
        let (count, found, deviation_m) = (local.blocks(), local.found, local.deviation_m);
        Self { side_m, count, found, deviation_m, largest_sideways_m, largest_up_m }
    }

    /// Returns the blocks in words.
    pub(super) fn text(&self) -> String {
        format!(
            "{} of {} blocks of {} m found a shift of their own, up to {:.2} m sideways and {:.2} m up or down",
            self.found, self.count, self.side_m, self.largest_sideways_m, self.largest_up_m
        )
    }
}

impl DiffReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let shift = &self.shift;
        let mut text = format!(
            "change  {}\n\
             dates   {} to {}\n\
             shift   {:+.2} m east, {:+.2} m north, {:+.2} m up\n\
             cells   {} observed on both dates, {} of them decide\n\
             level   {:.2} m for a cell (deviations × {:.2})\n\
             regions {} of {} candidates\ngain    {:.0} ± {:.0} m³\nloss    {:.0} ± {:.0} m³\n",
            self.output.display(),
            dates(&self.before_acquired),
            dates(&self.after_acquired),
            shift.dx_m,
            shift.dy_m,
            shift.dz_m,
            self.observed_cells,
            self.deciding_cells,
            self.detection_m,
            self.sigma_factor,
            self.regions.len(),
            self.tested,
            self.total.gain_m3,
            self.total.gain_sigma_m3,
            self.total.loss_m3,
            self.total.loss_sigma_m3,
        );
        // Writing to a string does not fail.
        if let Some(blocks) = &self.blocks {
            let _ = writeln!(text, "blocks  {}", blocks.text());
        }
        for region in self.regions.iter().take(LISTED) {
            let (n, found) = (region.number, &region.found);
            let _ = writeln!(
                text,
                "  {n:<4}  {:.0} m², {:+.2} ± {:.2} m, {:+.0} ± {:.0} m³; {:.0} % of it decided, right with {:.2}",
                found.area_m2,
                found.mean_m,
                found.mean_sigma_m,
                found.volume_m3,
                found.volume_sigma_m3,
                100.0 * found.decided_m2 / found.area_m2,
                found.probability
            );
        }
        if self.regions.len() > LISTED {
            let _ = writeln!(text, "  and {} more in changes.geojson", self.regions.len() - LISTED);
        }
        for area in &self.areas {
            let v = &area.volume;
            let _ = writeln!(
                text,
                "area    {}: gain {:.0} ± {:.0} m³, loss {:.0} ± {:.0} m³, net {:+.0} ± {:.0} m³",
                area.name, v.gain_m3, v.gain_sigma_m3, v.loss_m3, v.loss_sigma_m3, v.net_m3, v.net_sigma_m3
            );
        }
        for note in &self.notes {
            let _ = writeln!(text, "note    {note}");
        }
        text
    }
}

/// Returns the days of acquisition in words: one, or the first and the last.
pub(super) fn dates(acquired: &[String]) -> String {
    let mut days: Vec<&str> = acquired.iter().map(|time| time.split('T').next().unwrap_or(time)).collect();
    days.sort_unstable();
    match (days.first(), days.last()) {
        (Some(first), Some(last)) if first != last => format!("{first}/{last}"),
        (Some(only), _) => (*only).to_owned(),
        _ => "unknown".to_owned(),
    }
}
