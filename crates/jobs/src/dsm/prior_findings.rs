//! The agreement of the swept heights with the buildings of a city model.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::dsm::notes::Notes;
use crate::dsm::report::{LeftOut, PriorReport};

/// A building is taken to be gone when a smaller share of its pixels agrees with the heights found.
/// On small buildings the coarse heights are wrong more often than right.
const BUILDING_MIN: f64 = 0.1;
/// Number of buildings that are named in the choice; the report names all.
const NAMED: usize = 3;

/// Pixels of a building in a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Vote {
    /// Pixels whose height agrees with the height found.
    pub(crate) agreeing: u64,
    /// Pixels with a height to compare with.
    pub(crate) compared: u64,
}

impl Vote {
    /// Returns whether too few pixels agree.
    pub(crate) fn is_gone(&self) -> bool {
        (self.agreeing as f64) < BUILDING_MIN * self.compared as f64
    }
}

/// Agreement of the heights of one view with the buildings that it sees.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    pub(crate) votes: BTreeMap<u32, Vote>,
    /// Largest difference of heights that agree, metres.
    pub(crate) tolerance_m: f32,
}

/// Agreement of the heights of several views, or chunks, with the buildings of a city model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PriorFindings {
    /// Findings by the number of the building in the model, counted from 1.
    pub buildings: BTreeMap<u32, BuildingFinding>,
    /// Largest difference of heights that agree, metres.
    pub tolerance_m: f32,
    /// Number of views that see the model and whose heights hardly agree with any of it.
    pub disagreeing_views: usize,
}

/// Agreement of the heights of several views with one building.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BuildingFinding {
    /// Identifier of the building in the model.
    pub id: String,
    /// Sum over the views that keep the building.
    pub kept: ViewVotes,
    /// Sum over the views that leave the building out.
    pub gone: ViewVotes,
}

/// Sum of the votes of views.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ViewVotes {
    /// Number of views.
    pub views: usize,
    /// Pixels whose height agrees with the height found.
    pub agreeing_pixels: u64,
    /// Pixels with a height to compare with.
    pub compared_pixels: u64,
}

impl ViewVotes {
    fn add(&mut self, other: Self) {
        self.views += other.views;
        self.agreeing_pixels += other.agreeing_pixels;
        self.compared_pixels += other.compared_pixels;
    }
}

impl PriorFindings {
    /// Adds a view that sees the model; its evidence is `None` where hardly anything agrees.
    pub(crate) fn add(&mut self, evidence: Option<&Evidence>) {
        let Some(evidence) = evidence else {
            self.disagreeing_views += 1;
            return;
        };
        self.tolerance_m = evidence.tolerance_m;
        for (&number, vote) in &evidence.votes {
            let building = self.buildings.entry(number).or_default();
            let votes = if vote.is_gone() { &mut building.gone } else { &mut building.kept };
            votes.add(ViewVotes { views: 1, agreeing_pixels: vote.agreeing, compared_pixels: vote.compared });
        }
    }

    /// Sets the identifiers of the buildings, given in the order of their numbers.
    #[must_use]
    pub(crate) fn named(mut self, ids: &[String]) -> Self {
        for (number, building) in &mut self.buildings {
            building.id = ids.get((*number as usize).wrapping_sub(1)).cloned().unwrap_or_default();
        }
        self
    }

    /// Adds the findings of a chunk.
    pub(crate) fn extend(&mut self, other: &Self) {
        self.tolerance_m = self.tolerance_m.max(other.tolerance_m);
        self.disagreeing_views += other.disagreeing_views;
        for (&number, theirs) in &other.buildings {
            let own = self.buildings.entry(number).or_default();
            own.id.clone_from(&theirs.id);
            own.kept.add(theirs.kept);
            own.gone.add(theirs.gone);
        }
    }

    /// Reports the buildings that were left out, and why.
    pub(crate) fn report(&self, model: PathBuf, notes: &mut Notes<'_>) -> PriorReport {
        let left_out: Vec<LeftOut> = self
            .buildings
            .values()
            .filter(|building| building.gone.views > 0)
            .map(|building| LeftOut {
                id: building.id.clone(),
                views: building.gone.views,
                of_views: building.gone.views + building.kept.views,
                agreeing_pixels: building.gone.agreeing_pixels,
                compared_pixels: building.gone.compared_pixels,
            })
            .collect();
        let names: Vec<&str> = left_out.iter().take(NAMED).map(|building| building.id.as_str()).collect();
        let more = if left_out.len() > NAMED { ", …" } else { "" };
        let value = match left_out.len() {
            0 if self.disagreeing_views > 0 => format!(
                "none of {}; {} views agree with nothing of the model and do without",
                self.buildings.len(),
                self.disagreeing_views
            ),
            0 => format!("none of {}", self.buildings.len()),
            count => format!("{count} of {}: {}{more}", self.buildings.len(), names.join(", ")),
        };
        let reason = format!(
            "fewer than {:.0} % of their pixels are at the heights that a coarser level found",
            100.0 * BUILDING_MIN
        );
        notes.choose("buildings left out", value, reason);
        PriorReport {
            model,
            buildings_seen: self.buildings.len(),
            disagreeing_views: self.disagreeing_views,
            least_agreeing: BUILDING_MIN,
            tolerance_m: f64::from(self.tolerance_m),
            left_out,
        }
    }
}
