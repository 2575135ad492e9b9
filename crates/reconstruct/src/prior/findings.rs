//! The agreement of the swept heights with the buildings of a city model.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

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
    /// Makes the findings of views from the differences of the heights found to the model's, by
    /// view and building, metres; `None` for a view whose heights hardly agree with any of the
    /// model. `gone` are the buildings that are not used.
    pub(crate) fn new(views: &[Option<BTreeMap<u32, Vec<f32>>>], gone: &BTreeSet<u32>, tolerance_m: f32) -> Self {
        let mut out = Self { tolerance_m, ..Self::default() };
        for view in views {
            let Some(differences) = view else {
                out.disagreeing_views += 1;
                continue;
            };
            for (&number, all) in differences {
                let building = out.buildings.entry(number).or_default();
                let votes = if gone.contains(&number) { &mut building.gone } else { &mut building.kept };
                let agreeing = all.iter().filter(|d| d.abs() <= tolerance_m).count() as u64;
                votes.add(ViewVotes { views: 1, agreeing_pixels: agreeing, compared_pixels: all.len() as u64 });
            }
        }
        out
    }

    /// Sets the identifiers of the buildings, given in the order of their numbers.
    #[must_use]
    pub fn named(mut self, ids: &[String]) -> Self {
        for (number, building) in &mut self.buildings {
            building.id = ids.get((*number as usize).wrapping_sub(1)).cloned().unwrap_or_default();
        }
        self
    }

    /// Adds the findings of a chunk.
    pub fn extend(&mut self, other: &Self) {
        self.tolerance_m = self.tolerance_m.max(other.tolerance_m);
        self.disagreeing_views += other.disagreeing_views;
        for (&number, theirs) in &other.buildings {
            let own = self.buildings.entry(number).or_default();
            own.id.clone_from(&theirs.id);
            own.kept.add(theirs.kept);
            own.gone.add(theirs.gone);
        }
    }
}
