//! Context and target views of a camera model, chosen by what they see in common.
//!
//! The overlap of two views is the intersection over union of the points of the model that they
//! see. Views are chosen greedily, by the rule of the supplement of Cross-View Splatter
//! (Turkulainen et al. 2026): the first image of the sequence is the first context. Each further
//! context is the unused view whose overlap with the first context is closest to the wanted one.
//! Then, for each wanted target overlap in turn, the unused view is chosen whose average overlap
//! with all contexts is closest to it. Ties go to the view that comes first.
//!
//! The presets are the paper's: contexts 0.15 with targets 0.02, 0.05, 0.07, 0.1, and contexts 0.25
//! with targets 0.03, 0.07, 0.1, 0.15.

use serde::Serialize;

/// The overlaps that are wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct SplitConfig {
    /// Number of context views.
    pub contexts: usize,
    /// Overlap of each further context with the first one.
    pub context_iou: f64,
    /// Average overlap of each target with the contexts.
    pub target_ious: Vec<f64>,
    /// Index of the first context; the first view that sees points when `None`.
    pub first: Option<usize>,
}

impl SplitConfig {
    /// The paper's preset with contexts of overlap 0.15.
    pub fn narrow() -> Self {
        Self { contexts: 2, context_iou: 0.15, target_ious: vec![0.02, 0.05, 0.07, 0.1], first: None }
    }

    /// The paper's preset with contexts of overlap 0.25.
    pub fn wide() -> Self {
        Self { contexts: 2, context_iou: 0.25, target_ious: vec![0.03, 0.07, 0.1, 0.15], first: None }
    }
}

/// A chosen view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChosenView {
    /// Index of the view.
    pub view: usize,
    /// Overlap that was wanted; `None` for the first context.
    pub wanted_iou: Option<f64>,
    /// Overlap of a context with the first one, or average overlap of a target with all contexts;
    /// `None` for the first context.
    pub iou: Option<f64>,
}

/// The chosen contexts and targets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Split {
    /// Views to reconstruct from, in the order of choice.
    pub contexts: Vec<ChosenView>,
    /// Views to predict, in the order of the wanted overlaps.
    pub targets: Vec<ChosenView>,
    /// Σ |overlap − wanted overlap|.
    pub deviation: f64,
}

/// Overlaps that cannot be served.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct SplitError(#[from] Reason);

/// Why overlaps cannot be served.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Reason {
    /// Fewer views see points than are to be chosen.
    #[error("{found} views see points of the model, {needed} are to be chosen")]
    TooFew {
        /// Number of views that see points.
        found: usize,
        /// Number of views to choose.
        needed: usize,
    },
    /// The first view is not in the model or sees nothing.
    #[error("view {view} cannot be the first: it is not in the model or sees no point of it")]
    First {
        /// Its index.
        view: usize,
    },
    /// No contexts, or an overlap outside of 0 to 1.
    #[error("{what}: expected at least one context and overlaps from 0 to 1")]
    Wanted {
        /// What was asked for.
        what: String,
    },
}

/// Returns the points that each view sees, in rising order without repetitions, from the views of
/// each point.
pub fn points_of_views<'a>(view_count: usize, tracks: impl Iterator<Item = &'a [u32]>) -> Vec<Vec<u32>> {
    let mut points = vec![Vec::new(); view_count];
    for (point, track) in (0u32..).zip(tracks) {
        for &view in track {
            if let Some(seen) = points.get_mut(view as usize).filter(|seen| seen.last() != Some(&point)) {
                seen.push(point);
            }
        }
    }
    points
}

/// Returns the intersection over union of two rising sequences; 0 where both are empty.
///
/// ```
/// assert_eq!(colmap::split::iou(&[1, 2, 3], &[2, 3, 4]), 0.5);
/// ```
pub fn iou(a: &[u32], b: &[u32]) -> f64 {
    let (mut i, mut j, mut both) = (0, 0, 0usize);
    while let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
        both += usize::from(x == y);
        i += usize::from(x <= y);
        j += usize::from(y <= x);
    }
    let union = a.len() + b.len() - both;
    if union > 0 { both as f64 / union as f64 } else { 0.0 }
}

/// Chooses contexts and targets; `points` is the result of [`points_of_views`].
///
/// # Errors
/// [`SplitError`] for no contexts, overlaps outside of 0 to 1, fewer views with points than are to
/// be chosen, and a first view without points.
pub fn split(points: &[Vec<u32>], config: &SplitConfig) -> Result<Split, SplitError> {
    let wanted = std::iter::once(config.context_iou).chain(config.target_ious.iter().copied());
    if let Some(bad) = wanted.into_iter().find(|iou| !(0.0..=1.0).contains(iou)) {
        return Err(Reason::Wanted { what: format!("an overlap of {bad} was asked for") }.into());
    }
    if config.contexts == 0 {
        return Err(Reason::Wanted { what: "no contexts were asked for".to_owned() }.into());
    }
    let usable: Vec<usize> = (0..points.len()).filter(|&view| !points[view].is_empty()).collect();
    let needed = config.contexts + config.target_ious.len();
    if usable.len() < needed {
        return Err(Reason::TooFew { found: usable.len(), needed }.into());
    }
    let first = match config.first {
        Some(first) if usable.contains(&first) => first,
        Some(view) => return Err(Reason::First { view }.into()),
        None => usable.first().copied().ok_or(Reason::TooFew { found: 0, needed })?,
    };
    Ok(from_first(points, usable, first, config))
}

/// Returns the average overlap of a view with some others.
fn average_iou(points: &[Vec<u32>], view: usize, others: &[usize]) -> f64 {
    others.iter().map(|&other| iou(&points[view], &points[other])).sum::<f64>() / others.len() as f64
}

fn from_first(points: &[Vec<u32>], mut unused: Vec<usize>, first: usize, config: &SplitConfig) -> Split {
    unused.retain(|&view| view != first);
    let mut contexts = vec![ChosenView { view: first, wanted_iou: None, iou: None }];
    for _ in 1..config.contexts {
        contexts.extend(closest(points, &mut unused, &[first], config.context_iou));
    }
    let all: Vec<usize> = contexts.iter().map(|context| context.view).collect();
    let targets: Vec<ChosenView> =
        config.target_ious.iter().filter_map(|&wanted| closest(points, &mut unused, &all, wanted)).collect();
    let off = |choice: &ChosenView| choice.iou.zip(choice.wanted_iou).map_or(0.0, |(iou, wanted)| (iou - wanted).abs());
    let deviation = contexts.iter().chain(&targets).map(off).sum();
    Split { contexts, targets, deviation }
}

/// Takes the unused view whose average overlap with others is closest to what is wanted.
fn closest(points: &[Vec<u32>], unused: &mut Vec<usize>, others: &[usize], wanted: f64) -> Option<ChosenView> {
    let mut best: Option<(usize, f64)> = None;
    for (place, &view) in unused.iter().enumerate() {
        let iou = average_iou(points, view, others);
        if best.is_none_or(|(_, least): (usize, f64)| (iou - wanted).abs() < (least - wanted).abs()) {
            best = Some((place, iou));
        }
    }
    let (place, iou) = best?;
    Some(ChosenView { view: unused.remove(place), wanted_iou: Some(wanted), iou: Some(iou) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn overlaps_are_counted() {
        assert_eq!(iou(&[1, 3, 5], &[3, 4, 5, 6]), 0.4);
        assert_eq!((iou(&[], &[]), iou(&[1], &[]), iou(&[2, 9], &[2, 9])), (0.0, 0.0, 1.0));
        let tracks: [&[u32]; 3] = [&[0, 2, 0], &[2], &[1, 7]];
        assert_eq!(points_of_views(3, tracks.into_iter()), [vec![0], vec![2], vec![0, 1]]);
    }

    #[test]
    fn what_cannot_be_split_is_refused() {
        let points = vec![vec![1, 2], vec![], vec![2, 3]];
        let config = |contexts, target_ious: &[f64]| SplitConfig {
            contexts,
            target_ious: target_ious.to_vec(),
            ..SplitConfig::narrow()
        };
        assert!(matches!(split(&points, &config(2, &[0.1])), Err(SplitError(Reason::TooFew { found: 2, needed: 3 }))));
        assert!(matches!(split(&points, &config(0, &[])), Err(SplitError(Reason::Wanted { .. }))));
        assert!(matches!(split(&points, &config(1, &[1.5])), Err(SplitError(Reason::Wanted { .. }))));
        let first = SplitConfig { first: Some(1), ..config(1, &[0.1]) };
        assert!(matches!(split(&points, &first), Err(SplitError(Reason::First { view: 1 }))));
        let found = split(&points, &config(1, &[0.3])).unwrap();
        assert_eq!((found.contexts[0].view, found.targets[0].view), (0, 2));
    }

    proptest! {
        /// Against sets and a search through all views, written down from the text of the paper.
        #[test]
        fn the_choice_is_that_of_the_paper(
            seen in prop::collection::vec(prop::collection::btree_set(0..40u32, 1..30), 7..12),
            contexts in 1..4usize,
        ) {
            let points: Vec<Vec<u32>> = seen.iter().map(|s| s.iter().copied().collect()).collect();
            let iou = |a: usize, b: usize| {
                let both = seen[a].intersection(&seen[b]).count();
                both as f64 / seen[a].union(&seen[b]).count() as f64
            };
            for preset in [SplitConfig::narrow(), SplitConfig::wide()] {
                let config = SplitConfig { contexts, ..preset };
                let found = split(&points, &config).unwrap();
                let mut chosen = vec![0usize];
                let pick = |chosen: &[usize], overlap: &dyn Fn(usize) -> f64, wanted: f64| {
                    let unused = (0..seen.len()).filter(|view| !chosen.contains(view));
                    unused.min_by(|a, b| (overlap(*a) - wanted).abs().total_cmp(&(overlap(*b) - wanted).abs())).unwrap()
                };
                for _ in 1..contexts {
                    chosen.push(pick(&chosen, &|view| iou(view, 0), config.context_iou));
                }
                let known = chosen.clone();
                let average = |view: usize| known.iter().map(|&c| iou(view, c)).sum::<f64>() / known.len() as f64;
                for &wanted in &config.target_ious {
                    chosen.push(pick(&chosen, &average, wanted));
                }
                let views: Vec<usize> = found.contexts.iter().chain(&found.targets).map(|choice| choice.view).collect();
                prop_assert_eq!(views, chosen);
                for target in &found.targets {
                    prop_assert!((target.iou.unwrap() - average(target.view)).abs() < 1e-12);
                }
            }
        }
    }
}
