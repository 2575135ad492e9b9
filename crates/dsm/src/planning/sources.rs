//! For each view, the choice of the views that it is compared with.

use std::collections::BTreeMap;

use reconstruct::{ImagePair, SourceCandidates, SweepTuning, ViewGeometry};

use crate::config::DsmConfig;
use crate::error::{DsmError, DsmSetting};
use crate::notes::{LISTED_MAX, Notes};
use crate::pointing::point::Pointed;

/// Chooses the sources of every view: the views with the most tie points at the best angles, over
/// each of its parts. A view that is not asked for has none.
///
/// # Errors
/// [`DsmError::Value`] when no view that is asked for has a source.
pub(crate) fn choose_sources(
    config: &DsmConfig,
    geometry: &ViewGeometry,
    pointed: &Pointed,
    tuning: &SweepTuning,
    notes: &mut Notes<'_>,
) -> Result<Vec<Vec<usize>>, DsmError> {
    let candidates = source_candidates(config, geometry, pointed, tuning);
    let sources = candidates.choose_everywhere();
    let text = if sources.len() > LISTED_MAX {
        let used = sources.iter().map(Vec::len).sum::<usize>();
        format!("{used} for {} images; each chunk chooses its own", sources.len())
    } else {
        listed(&sources, pointed)
    };
    notes.choose("sources", text, format!("about {} for each part of a view, by tie points and angle", tuning.sources));
    if sources.iter().all(Vec::is_empty) {
        return Err(DsmError::value(
            DsmSetting::References,
            "only images that no other one can be matched with",
            "at least one image that shares ground with another under a useful angle",
        ));
    }
    Ok(sources)
}

/// Rates the pairs that were matched.
pub(crate) fn source_candidates<'a>(
    config: &DsmConfig,
    geometry: &'a ViewGeometry,
    pointed: &Pointed,
    tuning: &SweepTuning,
) -> SourceCandidates<'a> {
    let found: BTreeMap<ImagePair, usize> = pointed.ties.iter().map(|t| (t.pair.ordered(), t.ties.len())).collect();
    let of_pair = |pair: &ImagePair| (*pair, found.get(pair).copied().unwrap_or(0));
    let ties = pointed.pairs.iter().map(of_pair).collect();
    SourceCandidates::of(geometry, &ties, config.references.as_deref(), tuning)
}

/// Returns the sources of each image, with the given positions of the images counted from 1.
fn listed(sources: &[Vec<usize>], pointed: &Pointed) -> String {
    let number = |view: usize| pointed.images[view].number + 1;
    let mut text: Vec<(usize, String)> =
        sources.iter().enumerate().map(|(i, s)| (number(i), format!("{}←{}", number(i), list(s, number)))).collect();
    text.sort();
    text.into_iter().map(|(_, text)| text).collect::<Vec<_>>().join(" ")
}

fn list(views: &[usize], number: impl Fn(usize) -> usize) -> String {
    let names: Vec<String> = views.iter().map(|v| number(*v).to_string()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(",") }
}
