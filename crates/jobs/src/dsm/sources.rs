//! For each view, the choice of the views that it is compared with.

use std::collections::BTreeMap;

use crate::dsm::config::DsmConfig;
use crate::dsm::error::{DsmError, DsmSetting};
use crate::dsm::notes::Notes;
use crate::dsm::point::Pointed;
use crate::dsm::tuning::SweepTuning;
use crate::dsm::values::ImagePair;
use crate::dsm::view_geometry::{ViewGeometry, angle_merit};

/// Least rating of an angle, so that tie points decide among pairs with bad angles.
const MERIT_MIN: f64 = 0.05;

/// Chooses the sources of every view: the views with the most tie points at the best angles. A view
/// that is not asked for has none.
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
    let found: BTreeMap<ImagePair, usize> = pointed.ties.iter().map(|t| (t.pair.ordered(), t.ties.len())).collect();
    let merit = |i: usize, j: usize| {
        let pair = ImagePair::new(i, j);
        let angle_deg = geometry.pair(pair).map_or(0.0, |p| p.angle_deg);
        // One more, so that angles decide where nothing was matched.
        (1 + found.get(&pair.ordered()).copied().unwrap_or(0)) as f64 * angle_merit(angle_deg).max(MERIT_MIN)
    };
    let n = geometry.outlines.len();
    let mut sources = vec![Vec::new(); n];
    for (i, own) in sources.iter_mut().enumerate() {
        if config.references.as_ref().is_some_and(|r| !r.contains(&i)) {
            continue;
        }
        *own = (0..n).filter(|&j| pointed.pairs.contains(&ImagePair::new(i, j).ordered())).collect();
        own.sort_by(|&a, &b| merit(i, b).total_cmp(&merit(i, a)).then(a.cmp(&b)));
        own.truncate(tuning.sources);
    }
    let number = |view: usize| pointed.images[view].number + 1;
    let mut text: Vec<(usize, String)> =
        sources.iter().enumerate().map(|(i, s)| (number(i), format!("{}←{}", number(i), list(s, number)))).collect();
    text.sort();
    let text: Vec<String> = text.into_iter().map(|(_, text)| text).collect();
    notes.choose("sources", text.join(" "), format!("at most {} per view, by tie points and angle", tuning.sources));
    if sources.iter().all(Vec::is_empty) {
        return Err(DsmError::value(
            DsmSetting::References,
            "only images that no other one can be matched with",
            "at least one image that shares ground with another under a useful angle",
        ));
    }
    Ok(sources)
}

fn list(views: &[usize], number: impl Fn(usize) -> usize) -> String {
    let names: Vec<String> = views.iter().map(|v| number(*v).to_string()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(",") }
}

/// Returns the largest parallax of the pairs of views and sources, pixels per metre.
pub(crate) fn widest_parallax(sources: &[Vec<usize>], geometry: &ViewGeometry) -> f64 {
    let used = sources.iter().enumerate().flat_map(|(i, s)| s.iter().map(move |&j| ImagePair::new(i, j)));
    used.filter_map(|pair| geometry.pair(pair)).map(|p| p.parallax_px_per_m).fold(0.0, f64::max)
}
