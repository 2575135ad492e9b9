//! Tie points over the pairs of views, the joint correction, and the height range that they show.

use std::collections::BTreeMap;

use camera::RpcCamera;
use sweep::SweepView;

use crate::dsm::setup::TIES_MIN;
use sweep::pointing::{AdjustConfig, Adjustment, ModelOrder, Tie, TieConfig, Track, adjust, match_pair};

/// Ties of a wide search that one shift per view leaves further apart than this do not belong together, pixels.
const WIDE_RESIDUAL_PX: f64 = 1.0;

/// One of so many points is tried over all heights, before the others are near those that it shows.
const FEW: usize = 5;

/// Ties of one pair of views.
#[derive(Debug, Clone)]
pub(crate) struct PairTies {
    /// The view whose corners were searched.
    pub(crate) reference: usize,
    /// The view they were searched in.
    pub(crate) source: usize,
    /// What was found.
    pub(crate) ties: Vec<Tie>,
}

/// Matches the pairs, given best first. A few points of the first one with enough ties narrow the height range of the others, and
/// all of them that of the other pairs. A pair that gives too few is searched again for a gross pointing error.
pub(crate) fn match_pairs(
    views: &[SweepView],
    pairs: &[(usize, usize)],
    range_m: (f64, f64),
    config: &TieConfig,
    done: &(dyn Fn() + Sync),
) -> Vec<PairTies> {
    let mut range = range_m;
    let mut out = Vec::with_capacity(pairs.len());
    // Everything may lie as far outside what is seen as that's own spread, and 100 m more.
    let narrowed = |found: &PairTies| {
        let seen = heights_seen(views, found)?;
        let margin = (seen.1 - seen.0) + 100.0;
        Some(((seen.0 - margin).max(range_m.0), (seen.1 + margin).min(range_m.1)))
    };
    for &(reference, source) in pairs {
        let is_wide = range == range_m;
        if is_wide {
            let few = TieConfig { points: config.points / FEW, ..*config };
            let ties = match_pair(&views[reference], &views[source], range, &few);
            range = narrowed(&PairTies { reference, source, ties }).unwrap_or(range_m);
        }
        let ties = match_pair(&views[reference], &views[source], range, config);
        let mut found = PairTies { reference, source, ties };
        if found.ties.len() < TIES_MIN {
            let ties = match_pair(&views[reference], &views[source], range, &wide_search(config));
            found = verified(views, PairTies { reference, source, ties });
        }
        if is_wide {
            range = narrowed(&found).unwrap_or(range_m);
        }
        out.push(found);
        done();
    }
    out
}

/// Those of a pair's ties that one correction brings together: a wide search finds more that is alike by chance.
fn verified(views: &[SweepView], pair: PairTies) -> PairTies {
    let (adjustment, tracks) = adjust_views(views, std::slice::from_ref(&pair), &shifts());
    if adjustment.residual_px.1 > WIDE_RESIDUAL_PX {
        return PairTies { ties: Vec::new(), ..pair };
    }
    let fits = |t: &&Tie| {
        let at = |track: &Track| track.first().is_some_and(|(_, p)| *p == t.reference);
        tracks.iter().zip(&adjustment.ground).any(|(track, ground)| ground.is_some() && at(track))
    };
    PairTies { ties: pair.ties.iter().filter(fits).copied().collect(), ..pair }
}

/// The span of the heights of one pair's ties, the outliers left out.
pub(crate) fn heights_seen(views: &[SweepView], pair: &PairTies) -> Option<(f64, f64)> {
    if pair.ties.len() < TIES_MIN {
        return None;
    }
    let adjustment = adjust_views(views, std::slice::from_ref(pair), &shifts()).0;
    span_of(&adjustment, TIES_MIN)
}

/// For one pair, of which nothing more is asked than heights and whether its ties belong together.
fn shifts() -> AdjustConfig {
    AdjustConfig { max_order: ModelOrder::Translation, ..AdjustConfig::default() }
}

/// Least and greatest height of an adjustment's inliers, when there are at least `min` of them.
pub(crate) fn span_of(adjustment: &Adjustment, min: usize) -> Option<(f64, f64)> {
    let mut heights: Vec<f64> = adjustment.ground.iter().flatten().map(|g| g.height_m).collect();
    if heights.len() < min {
        return None;
    }
    heights.sort_by(f64::total_cmp);
    // One tie in a hundred may still be wrong at each end.
    let cut = heights.len() / 100;
    Some((heights[cut], heights[heights.len() - 1 - cut]))
}

/// Joins the pairs' ties to tracks and adjusts all views: see [`adjust_cameras`].
fn adjust_views(views: &[SweepView], pairs: &[PairTies], config: &AdjustConfig) -> (Adjustment, Vec<Track>) {
    let cameras: Vec<_> = views.iter().map(|v| v.camera.clone()).collect();
    let sizes: Vec<_> = views.iter().map(|v| (v.levels[0].width(), v.levels[0].height())).collect();
    adjust_cameras(&cameras, &sizes, pairs, config)
}

/// Joins the pairs' ties to tracks (one corner of a reference, seen in all its sources) and adjusts all cameras, whose images
/// have `sizes` (columns, rows).
pub(crate) fn adjust_cameras(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    pairs: &[PairTies],
    config: &AdjustConfig,
) -> (Adjustment, Vec<Track>) {
    let mut by_corner: BTreeMap<(usize, u64, u64), Track> = BTreeMap::new();
    for pair in pairs {
        for tie in &pair.ties {
            let corner = tie.reference;
            let track = by_corner
                .entry((pair.reference, corner.sample.to_bits(), corner.line.to_bits()))
                .or_insert_with(|| vec![(pair.reference, corner)]);
            track.push((pair.source, tie.source));
        }
    }
    let tracks: Vec<Track> = by_corner.into_values().collect();
    (adjust(cameras, sizes, &tracks, config), tracks)
}

/// The search for what the ordinary one does not find: ten times its pointing error, from a coarser level.
fn wide_search(config: &TieConfig) -> TieConfig {
    TieConfig { band_px: 10.0 * config.band_px, coarse_side: config.coarse_side * 2 / 5, ..*config }
}
