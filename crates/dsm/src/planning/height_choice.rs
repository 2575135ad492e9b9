//! The heights to search: given, from an elevation model, or from the tie points.

use reconstruct::HeightRange;
use report::plain_number;

use crate::config::DsmConfig;
use crate::error::{DsmError, DsmSetting};
use crate::notes::Notes;
use crate::pointing::evidence::dem_with_ties;
use crate::pointing::point::Pointed;
use crate::pointing::ties::TIES_MIN;

/// Searched below the lowest tie point at least, metres: tie points seldom lie at the bottom of a
/// pit or courtyard.
const MARGIN_BELOW_M: f64 = 20.0;
/// Searched above the highest tie point at least, metres: tie points seldom lie on top of a mast or
/// tower.
const MARGIN_ABOVE_M: f64 = 60.0;
/// A given range is searched below the lowest tie point by no more than this and the span of the
/// tie points, metres.
const FAR_BELOW_M: f64 = 100.0;
/// A given range is searched above the highest tie point by no more than this and the span of the
/// tie points, metres. No building is taller than twice this.
const FAR_ABOVE_M: f64 = 500.0;

/// Chooses the heights to search.
///
/// # Errors
/// [`DsmError::RangeMissesScene`], [`DsmError::DemMissesScene`], [`DsmError::NoTies`], and
/// [`DsmError::Value`] for an elevation model with heights that are not on Earth.
pub(crate) fn choose_heights(
    config: &DsmConfig,
    pointed: &Pointed,
    notes: &mut Notes<'_>,
) -> Result<HeightRange, DsmError> {
    let (range, reason) = if let Some(given) = config.height_range_m {
        given_heights(given, pointed.tie_heights, notes)?
    } else if let Some(dem) = pointed.dem_heights {
        if dem.low_m < HeightRange::EARTH.low_m || dem.high_m > HeightRange::EARTH.high_m {
            return Err(DsmError::value(
                DsmSetting::Dem,
                format!("a file with heights from {:.0} to {:.0} m", dem.low_m, dem.high_m),
                "heights of the Earth's surface; is its no-data value declared?",
            ));
        }
        let range = dem_with_ties(with_margins(dem), dem, pointed.tie_heights, notes)?;
        (range, format!("the DEM's {:.0} to {:.0} m with margins", dem.low_m, dem.high_m))
    } else {
        let ties = pointed.pointing.inliers;
        let Some(seen) = pointed.tie_heights else { return Err(DsmError::NoTies { ties, needed: TIES_MIN }) };
        let reason = format!(
            "{ties} tie points between {:.0} and {:.0} m, with margins for pits and towers",
            seen.low_m, seen.high_m
        );
        (with_margins(seen), reason)
    };
    // A range that was given is printed as it was given, unless it is extended to the tie points.
    let value = match config.height_range_m {
        Some(given) if given == range => format!("{} to {} m", plain_number(range.low_m), plain_number(range.high_m)),
        _ => format!("{:.1} to {:.1} m", range.low_m, range.high_m),
    };
    notes.choose("height range", value, reason);
    Ok(range)
}

/// Returns the heights to search for a given range, with the reason.
fn given_heights(
    given: HeightRange,
    seen: Option<HeightRange>,
    notes: &mut Notes<'_>,
) -> Result<(HeightRange, String), DsmError> {
    let Some(seen) = seen else { return Ok((given, "given".to_owned())) };
    if given.high_m < seen.low_m || given.low_m > seen.high_m {
        return Err(DsmError::RangeMissesScene { asked: given, seen });
    }
    if seen.low_m < given.low_m || seen.high_m > given.high_m {
        notes.warn(format!(
            "the height range {} to {} m cuts the scene, \
             whose tie points lie between {:.0} and {:.0} m above the ellipsoid: what is outside stays void",
            given.low_m, given.high_m, seen.low_m, seen.high_m
        ));
    }
    let reason = format!(
        "given {} to {} m, tie points between {:.0} and {:.0} m",
        plain_number(given.low_m),
        plain_number(given.high_m),
        seen.low_m,
        seen.high_m
    );
    Ok((searched(given, seen), reason))
}

/// Returns the heights to search for a given range when tie points lie in `seen`.
///
/// Heights with tie points outside the given range are searched too. Their pixels are then
/// recognised and left out, instead of getting a false height inside the range. Heights kilometres
/// from every tie point are not searched.
fn searched(given: HeightRange, seen: HeightRange) -> HeightRange {
    let near = with_margins(seen);
    let span = seen.high_m - seen.low_m;
    HeightRange::new(
        given.low_m.max(seen.low_m - span - FAR_BELOW_M).min(near.low_m),
        given.high_m.min(seen.high_m + span + FAR_ABOVE_M).max(near.high_m),
    )
}

/// Adds a tenth of the span for what the tie points missed, and at least the fixed margins.
fn with_margins(seen: HeightRange) -> HeightRange {
    let tenth = 0.1 * seen.span_m();
    seen.grown(tenth.max(MARGIN_BELOW_M), tenth.max(MARGIN_ABOVE_M))
}

/// Returns the height at which footprints and angles are taken: the middle of the tie points'
/// heights, or else of the range.
pub(crate) fn middle_height_m(tie_heights: Option<HeightRange>, range: HeightRange) -> f64 {
    tie_heights.unwrap_or(range).middle_m().clamp(range.low_m, range.high_m)
}
