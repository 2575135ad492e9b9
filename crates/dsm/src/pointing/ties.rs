//! Tie points over the pairs of views and the joint correction of all cameras.

use camera::RpcCamera;
use geodesy::LonLatHeight;
use reconstruct::{HeightRange, ImagePair};
use serde::{Deserialize, Serialize};
use sweep::SweepView;
use sweep::pointing::{
    AdjustConfig, Adjustment, EvenView, ModelOrder, PlacedTie, Tie, TieConfig, Track, adjust, agreement, join_ties,
    match_pair,
};

use crate::pointing::evidence::is_beyond_chance;

/// Fewer tie points than this do not determine the heights of a scene.
pub(crate) const TIES_MIN: usize = 12;

/// Ties of a wide search do not belong together when one shift per view leaves larger residuals
/// than this, pixels.
const WIDE_RESIDUAL_PX: f64 = 1.0;
/// One of this many points is tried over all heights, before the others are tried near the heights
/// that it shows.
const FEW: usize = 5;
/// Heights may lie outside those of the first ties by the ties' own span and this, metres.
const NARROWED_MARGIN_M: f64 = 100.0;
/// One tie in this many may still be wrong at each end of the heights.
const WRONG_AT_ENDS: usize = 100;

/// Tie points of one pair of views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PairTies {
    /// The pair: its first view is the reference, whose corners were searched for in the second.
    pub pair: ImagePair,
    /// Tie points found, each written as `[sample, line, sample, line, correlation]`.
    #[serde(with = "tie_rows")]
    pub ties: Vec<Tie>,
    /// The ties before those were left out on which the views do not agree; empty where none were.
    /// They show what the RPCs explain, and a file of the ties does without them.
    #[serde(skip)]
    pub(crate) corners: Vec<Tie>,
    /// Patches on which the views agree, whether they are used or not. They lie all over the pair,
    /// and show whether it is one picture.
    #[serde(skip)]
    pub(crate) patches: Vec<Tie>,
}

impl PairTies {
    pub(crate) fn new(pair: ImagePair, ties: Vec<Tie>) -> Self {
        Self { pair, ties, corners: Vec::new(), patches: Vec::new() }
    }

    /// The ties as they were found, whether the views agree on them or not.
    pub(crate) fn as_found(&self) -> &[Tie] {
        if self.corners.is_empty() { &self.ties } else { &self.corners }
    }
}

/// Matches pairs of views, given best first, over the heights in `range`. `done` is called after
/// each pair.
///
/// The ties of a pair that the views agree on all over their ground take the place of the first
/// ones, which hold on to shadows where the sun has moved.
///
/// A few points of the first pair with enough ties narrow the height range of the others, and all
/// its points that of the other pairs. A pair with fewer than `least` ties is searched again for a
/// gross pointing error. A pair on whose ground the views do not agree is searched again at the
/// places that the other pairs show.
pub(crate) fn match_pairs(
    views: &[SweepView],
    pairs: &[ImagePair],
    range: HeightRange,
    (config, least): (&TieConfig, usize),
    done: &(dyn Fn() + Sync),
) -> Vec<PairTies> {
    let mut near = range;
    let mut out = Vec::with_capacity(pairs.len());
    let even: Vec<EvenView> = views.iter().map(|_| EvenView::default()).collect();
    let narrowed = |found: &PairTies| {
        let seen = heights_seen(views, found)?;
        let margin = seen.span_m() + NARROWED_MARGIN_M;
        Some(seen.grown(margin, margin).cut_to(range))
    };
    for &pair in pairs {
        let ties_of = |heights: HeightRange, config: &TieConfig| {
            let heights = (heights.low_m, heights.high_m);
            PairTies::new(pair, match_pair(&views[pair.first], &views[pair.second], heights, config))
        };
        let is_wide = near == range;
        if is_wide {
            let few = TieConfig { points: config.points / FEW, ..*config };
            near = narrowed(&ties_of(range, &few)).unwrap_or(range);
        }
        let cameras = (&views[pair.first].camera, &views[pair.second].camera);
        let true_ties = |found: PairTies| {
            let is_true = is_beyond_chance(cameras, &found.ties, near.middle_m(), least);
            if is_true { found } else { PairTies::new(pair, Vec::new()) }
        };
        let mut found = true_ties(ties_of(near, config));
        if found.ties.len() < least && near != range {
            // A pointing error along the line of sight gives the pair other heights.
            found = true_ties(ties_of(range, config));
        }
        if found.ties.len() < least {
            found = verified(views, ties_of(near, &wide_search(config)));
        }
        if found.ties.len() < least && near != range {
            found = verified(views, ties_of(range, &wide_search(config)));
        }
        let was = near;
        if is_wide {
            near = narrowed(&found).unwrap_or(range);
        }
        if was == range && near != range {
            // Over all heights the points were spread over more than both images see at one.
            let again = ties_of(near, config);
            found = if again.ties.len() > found.ties.len() { again } else { found };
        }
        if found.ties.len() >= least {
            let heights = (near.low_m, near.high_m);
            let (first, second) = (&views[pair.first], &views[pair.second]);
            let even = [&even[pair.first], &even[pair.second]];
            if let Some(agreed) = agreement(first, second, &found.ties, heights, config, even) {
                if !agreed.holds_ties {
                    let agreeing = agreed.ties.iter().chain(&agreed.patches).copied().collect();
                    found.corners = std::mem::replace(&mut found.ties, agreeing);
                }
                found.patches = agreed.patches;
            }
        }
        out.push(found);
        done();
    }
    search_again(views, &mut out, near, config, &even);
    out
}

/// Searches again those pairs on whose ground the views do not agree, at the places where the other
/// pairs show it: shadows or a wide angle have left them few right corners, or none.
fn search_again(
    views: &[SweepView],
    pairs: &mut [PairTies],
    heights: HeightRange,
    config: &TieConfig,
    even: &[EvenView],
) {
    let known: Vec<PairTies> = pairs.iter().filter(|found| !found.patches.is_empty()).cloned().collect();
    if known.is_empty() || known.len() == pairs.len() {
        return;
    }
    let (adjusted, _) = adjust_views(views, &known, &shifts());
    let corrected = |(view, &correction): (&SweepView, _)| RpcCamera { rpc: view.camera.rpc.clone(), correction };
    let cameras: Vec<RpcCamera> = views.iter().zip(&adjusted.corrections).map(corrected).collect();
    let heights = (heights.low_m, heights.high_m);
    for found in pairs.iter_mut().filter(|found| found.patches.is_empty()) {
        let ImagePair { first, second } = found.pair;
        let expected = |&ground: &LonLatHeight| {
            let [reference, source] = [first, second].map(|view| cameras[view].project(ground).ok());
            Some(Tie { reference: reference?, source: source?, correlation: 1.0 })
        };
        let expected: Vec<Tie> = adjusted.ground.iter().flatten().filter_map(expected).collect();
        let even = [&even[first], &even[second]];
        if let Some(agreed) = agreement(&views[first], &views[second], &expected, heights, config, even) {
            found.corners = std::mem::replace(&mut found.ties, agreed.patches.clone());
            found.patches = agreed.patches;
        }
    }
}

/// Keeps the ties of a pair that one correction brings together: a wide search finds more chance
/// likenesses.
fn verified(views: &[SweepView], found: PairTies) -> PairTies {
    let (adjustment, tracks) = adjust_views(views, std::slice::from_ref(&found), &shifts());
    if adjustment.residual_px.1 > WIDE_RESIDUAL_PX {
        return PairTies { ties: Vec::new(), ..found };
    }
    let fits = |t: &&Tie| {
        let at = |track: &Track| track.contains(&(found.pair.first, t.reference));
        tracks.iter().zip(&adjustment.ground).any(|(track, ground)| ground.is_some() && at(track))
    };
    PairTies { ties: found.ties.iter().filter(fits).copied().collect(), ..found }
}

/// Returns the heights of one pair's ties without outliers; `None` when there are too few ties.
pub(crate) fn heights_seen(views: &[SweepView], found: &PairTies) -> Option<HeightRange> {
    if found.ties.len() < TIES_MIN {
        return None;
    }
    tie_heights(&adjust_views(views, std::slice::from_ref(found), &shifts()).0)
}

/// Returns the adjustment of a single pair, from which only heights and the residual are used:
/// shifts are enough.
fn shifts() -> AdjustConfig {
    AdjustConfig { max_order: ModelOrder::Translation, ..AdjustConfig::default() }
}

/// Returns the least and greatest height of the inliers of an adjustment; `None` when there are
/// fewer than [`TIES_MIN`].
pub(crate) fn tie_heights(adjustment: &Adjustment) -> Option<HeightRange> {
    let mut heights: Vec<f64> = adjustment.ground.iter().flatten().map(|g| g.height_m).collect();
    if heights.len() < TIES_MIN {
        return None;
    }
    heights.sort_by(f64::total_cmp);
    let cut = heights.len() / WRONG_AT_ENDS;
    Some(HeightRange::new(heights[cut], heights[heights.len() - 1 - cut]))
}

/// Adjusts the cameras of views, see [`adjust_cameras`].
fn adjust_views(views: &[SweepView], pairs: &[PairTies], config: &AdjustConfig) -> (Adjustment, Vec<Track>) {
    let cameras: Vec<_> = views.iter().map(|v| v.camera.clone()).collect();
    let sizes: Vec<_> = views.iter().map(|v| (v.levels[0].width(), v.levels[0].height())).collect();
    adjust_cameras(&cameras, &sizes, pairs, config)
}

/// Joins the ties of all pairs to tracks. Returns also the number of ties that contradict better
/// ones.
pub(crate) fn join_pairs(pairs: &[PairTies]) -> (Vec<Track>, usize) {
    let placed = |found: &PairTies| {
        let ImagePair { first: reference, second: source } = found.pair;
        found.ties.iter().map(move |&tie| PlacedTie { reference, source, tie }).collect::<Vec<_>>()
    };
    join_ties(&pairs.iter().flat_map(placed).collect::<Vec<_>>())
}

/// Joins the ties of all pairs to tracks and adjusts all cameras. `sizes` are the columns and rows
/// of the cameras' images.
pub(crate) fn adjust_cameras(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    pairs: &[PairTies],
    config: &AdjustConfig,
) -> (Adjustment, Vec<Track>) {
    let (tracks, _) = join_pairs(pairs);
    (adjust(cameras, sizes, &tracks, config), tracks)
}

/// Returns the search for pairs in which the ordinary one finds nothing: ten times its pointing
/// error, from a coarser level.
fn wide_search(config: &TieConfig) -> TieConfig {
    TieConfig { band_px: 10.0 * config.band_px, coarse_side: config.coarse_side * 2 / 5, ..*config }
}

/// Serde adapter for tie points: one row of five numbers for each.
mod tie_rows {
    use camera::ImagePoint;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use sweep::pointing::Tie;

    type Row = (f64, f64, f64, f64, f32);

    pub(super) fn serialize<S: Serializer>(ties: &[Tie], out: S) -> Result<S::Ok, S::Error> {
        let row =
            |t: &Tie| -> Row { (t.reference.sample, t.reference.line, t.source.sample, t.source.line, t.correlation) };
        ties.iter().map(row).collect::<Vec<Row>>().serialize(out)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Vec<Tie>, D::Error> {
        let tie = |(a, b, c, d, correlation): Row| Tie {
            reference: ImagePoint::new(a, b),
            source: ImagePoint::new(c, d),
            correlation,
        };
        Ok(Vec::<Row>::deserialize(input)?.into_iter().map(tie).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::DsmConfig;
    use crate::images::image_pixels::read_views;
    use crate::images::open::open;

    /// A pair without corners gets ties at the places that the other two pairs show, unless its
    /// views show something else there.
    #[test]
    fn a_pair_without_corners_is_searched_where_the_others_show_the_ground() {
        let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town");
        let paths = [1, 2, 3].map(|number| town.join(format!("view_{number}.tif")));
        let images = open(&DsmConfig::new(paths.into(), "unused".into())).unwrap().images;
        let views = read_views(&images, &|| ()).unwrap();
        let range = HeightRange::new(100.0, 400.0);
        let config = TieConfig::default();
        let pairs = [(0, 1), (0, 2), (1, 2)].map(|(first, second)| ImagePair::new(first, second));
        let matched = match_pairs(&views, &pairs, range, (&config, TIES_MIN), &|| ());
        let heights = heights_seen(&views, &matched[0]).unwrap();
        let searched = |views: &[SweepView]| {
            let mut some = matched.clone();
            some[2] = PairTies::new(pairs[2], Vec::new());
            let even: Vec<EvenView> = views.iter().map(|_| EvenView::default()).collect();
            search_again(views, &mut some, heights, &config, &even);
            some
        };
        let found = searched(&views);
        assert!(found[2].ties.len() > 5 * TIES_MIN, "{} ties", found[2].ties.len());
        assert_eq!(found[2].ties, found[2].patches);
        let (with, without) = (adjust_views(&views, &found, &shifts()), adjust_views(&views, &matched[..2], &shifts()));
        let shift_px = |view: usize| {
            let [a, b] = [&with.0, &without.0].map(|adjusted| adjusted.corrections[view].translation_px);
            (a[0] - b[0]).hypot(a[1] - b[1])
        };
        assert!((0..3).all(|view| shift_px(view) < 0.5) && with.0.residual_px.1 < 0.5);
        let mut turned = views.clone();
        turned[2].levels.iter_mut().for_each(|level| level.data_mut().reverse());
        assert!(searched(&turned)[2].ties.is_empty());
    }
}
