//! Doubt about ground points: positions that no image shows, heights above another datum or in
//! feet, and a control point that contradicts the others.
//!
//! Ties give the geometry of the views among each other. What is left to control is a shift of a
//! few pixels, as large as providers err. Points that ask for far more, or that would ask for less
//! if their numbers meant something else, are more likely wrong than the cameras.
//!
//! One wrong point among others is found by leaving it out: the cameras are adjusted to the others,
//! and the point is compared with where they then see it, in units of the others' own spread. At a
//! corner of a block the others leave the cameras free, and a right point is far from there, too.
//! How free they are is told by the adjustment with the point: it follows a point by the part
//! v / (σ² + v) of the difference, of the point's own variance σ² and the cameras' variance v
//! without it.

use std::path::Path;

use camera::{ImagePoint, RpcCamera};
use crs::{HeightConverter, VerticalDatum};
use geodesy::{EnuFrame, EnuPoint, LonLatHeight};
use numeric::upper_median;
use sweep::pointing::{AdjustConfig, Adjustment, ControlPoint, Track, ground_of};
use sweep::source_from_reference;

use crate::error::{DsmError, DsmSetting};
use crate::notes::Notes;

/// A position is outside of an image when it lies further beside it than this, pixels: twenty
/// deviations of the pointing of RPCs, as far as chips are searched for.
const BESIDE_PX: f64 = 200.0;
/// Metres in a foot; the survey foot differs by two millionths.
const FOOT_M: f64 = 0.3048;
/// Another meaning of the heights is named when it leaves at most this part of the difference, and
/// no more than RPCs err by. The
/// pointing of RPCs by chance hits a geoid's undulation so well in one of six scenes where both are
/// of one size, and hardly ever where the undulation is several times larger.
const EXPLAINED: f64 = 0.25;
/// Differences of heights that are named, and that are refused, standard deviations of what the
/// pointing of RPCs leaves: the deviation that the adjustment expects is a generous one.
const NAMED: f64 = 2.0;
const REFUSED: f64 = 10.0;
/// A control point is wrong when it is this many times as far from where the cameras that were
/// adjusted to the others see it as the others are. The spread of four is known to a quarter.
const TIMES_OTHERS: f64 = 4.0;
/// And when it is further off than this many deviations, of its own and of the cameras without it:
/// of four hundred right points one is.
const OWN_DEVIATIONS: f64 = 3.0;
/// Least spread of the others, parts of what their own accuracies let expect: nobody measures
/// places that much better than stated.
const SPREAD_MIN: f64 = 0.25;
/// Fewest control points of which one can be found wrong: two that agree without it.
const POINTS_MIN: usize = 3;
/// Points with the largest residuals that are tried; a wrong one may raise those beside it.
const TRIED_MAX: usize = 3;

/// A ground point as it was given.
#[derive(Debug, Clone)]
pub(crate) struct SurveyedPoint {
    pub(crate) name: String,
    /// Height in the file.
    pub(crate) given_height_m: f64,
    /// What that height is above.
    pub(crate) datum: VerticalDatum,
    /// Position with its coordinates exchanged, where that is one.
    pub(crate) exchanged: Option<LonLatHeight>,
    pub(crate) point: ControlPoint,
}

impl SurveyedPoint {
    /// Returns whether some image in which the point has a place shows a position.
    fn is_shown(&self, ground: LonLatHeight, cameras: &[RpcCamera], sizes: &[(usize, usize)]) -> bool {
        self.point.seen.iter().any(|(view, _)| {
            let (width, height) = (sizes[*view].0 as f64, sizes[*view].1 as f64);
            let is_near = |at: f64, size: f64| (-BESIDE_PX..size + BESIDE_PX).contains(&at);
            let place = cameras[*view].project(ground);
            place.is_ok_and(|place| is_near(place.sample, width) && is_near(place.line, height))
        })
    }

    /// Returns the position with another height above the ellipsoid.
    fn at(&self, height_m: f64) -> LonLatHeight {
        LonLatHeight { height_m, ..self.point.ground }
    }

    /// Returns what the height may mean instead, with the height above the ellipsoid that follows.
    fn other_heights(&self) -> Vec<(Meaning, f64)> {
        let LonLatHeight { lon_deg, lat_deg, height_m } = self.point.ground;
        let above = |datum, given_m: f64| match datum {
            VerticalDatum::Ellipsoid => Some(given_m),
            _ => HeightConverter::new(datum).and_then(|c| c.ellipsoid_from_datum(lon_deg, lat_deg, given_m)).ok(),
        };
        let mut out = Vec::new();
        out.extend(above(self.datum, FOOT_M * self.given_height_m).map(|height| (Meaning::Feet, height)));
        let datums = [VerticalDatum::Ellipsoid, VerticalDatum::Egm96].into_iter().filter(|datum| *datum != self.datum);
        out.extend(datums.filter_map(|datum| Some((Meaning::Above(datum), above(datum, self.given_height_m)?))));
        out.retain(|(_, other_m)| (other_m - height_m).abs() > f64::EPSILON);
        out
    }

    /// Returns the given position minus where cameras see the point, east, north and up, metres;
    /// `None` for a point with a place in one image.
    fn off_m(&self, cameras: &[RpcCamera]) -> Option<[f64; 3]> {
        let EnuPoint { east, north, up } =
            EnuFrame::new(self.point.ground).enu_from_ground(ground_of(cameras, &self.point.seen)?);
        Some([-east, -north, -up])
    }

    /// Returns the standard deviations of [`Self::off_m`] that the point's accuracies let expect.
    fn expected_m(&self, cameras: &[RpcCamera]) -> Option<[f64; 3]> {
        let ControlPoint { ground, horizontal_m, vertical_m, pixel_px, seen } = &self.point;
        let (view, _) = seen.first()?;
        let px_per_m = px_per_m_on_ground(&cameras[*view], *ground)?;
        let horizontal = horizontal_m.hypot(pixel_px / px_per_m);
        let vertical =
            vertical_m.hypot(pixel_px * std::f64::consts::SQRT_2 / parallax_px_per_m(cameras, seen, *ground)?);
        Some([horizontal, horizontal, vertical])
    }
}

/// What a height may mean instead of metres above the datum that is stated.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    Feet,
    Above(VerticalDatum),
}

impl Meaning {
    /// Says what the heights would be and what to do.
    fn hint(self) -> &'static str {
        match self {
            Self::Feet => "in feet they would fit: give them in metres",
            Self::Above(VerticalDatum::Ellipsoid) => {
                "above the ellipsoid they would fit: leave the vertical datum out of crs"
            }
            Self::Above(_) => {
                "above the EGM96 geoid (mean sea level) they would fit: name it in crs, such as EPSG:4326+5773"
            }
        }
    }
}

/// Marks the points whose position no image shows in which they have a place.
///
/// # Errors
/// [`DsmError::Value`] when these are most of the points, with the likely cause.
pub(crate) fn outside_all(
    points: &[&SurveyedPoint],
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    path: &Path,
) -> Result<Vec<bool>, DsmError> {
    let outside: Vec<bool> = points.iter().map(|point| !point.is_shown(point.point.ground, cameras, sizes)).collect();
    let of_outside = || points.iter().zip(&outside).filter(|(_, is_outside)| **is_outside).map(|(point, _)| *point);
    let count = of_outside().count();
    if count == 0 || 2 * count <= points.len() {
        return Ok(outside);
    }
    let most = |is_shown: &dyn Fn(&SurveyedPoint) -> bool| 2 * of_outside().filter(|p| is_shown(p)).count() > count;
    let with_height = |point: &SurveyedPoint, meaning: Meaning| {
        let others = point.other_heights();
        let other = others.iter().find(|(other, _)| *other == meaning);
        other.is_some_and(|(_, height_m)| point.is_shown(point.at(*height_m), cameras, sizes))
    };
    let cause = if most(&|p| p.exchanged.is_some_and(|ground| p.is_shown(ground, cameras, sizes))) {
        "; with their two coordinates exchanged they would lie in the images: x and lon are to the east, y and lat to \
         the north"
            .to_owned()
    } else if most(&|p| with_height(p, Meaning::Feet)) {
        format!("; {}", Meaning::Feet.hint())
    } else {
        "; check that crs names the map of the coordinates, and that the points belong to these images".to_owned()
    };
    let first = of_outside().next().map_or(String::new(), |point| {
        let LonLatHeight { lon_deg, lat_deg, height_m } = point.point.ground;
        format!(", {} at longitude {lon_deg:.5}, latitude {lat_deg:.5}, {height_m:.0} m", point.name)
    });
    let found =
        format!("a file with {count} of {} points outside of all images{first}: {}", points.len(), path.display());
    Err(DsmError::value(DsmSetting::Control, found, format!("positions that the images show{cause}")))
}

/// Compares the heights of the points with those at which the images see them.
///
/// # Errors
/// [`DsmError::Value`] when they are further apart than any pointing error, with the likely cause.
pub(crate) fn refuse_or_warn_of_heights(
    points: &[&SurveyedPoint],
    cameras: &[RpcCamera],
    path: &Path,
    notes: &mut Notes<'_>,
) -> Result<(), DsmError> {
    let measured: Vec<(&SurveyedPoint, f64)> =
        points.iter().filter_map(|point| Some((*point, ground_of(cameras, &point.point.seen)?.height_m))).collect();
    let off_m = |height_m: &dyn Fn(&SurveyedPoint) -> Option<f64>| {
        upper_median(&mut measured.iter().filter_map(|(p, seen_m)| Some(height_m(p)? - seen_m)).collect::<Vec<f64>>())
    };
    let Some(as_given_m) = off_m(&|point| Some(point.point.ground.height_m)) else { return Ok(()) };
    let parallax = |(p, _): &(&SurveyedPoint, f64)| parallax_px_per_m(cameras, &p.point.seen, p.point.ground);
    let Some(px_per_m) = upper_median(&mut measured.iter().filter_map(parallax).collect::<Vec<f64>>()) else {
        return Ok(());
    };
    // The pointing of two views.
    let deviation_m = AdjustConfig::default().prior_px * std::f64::consts::SQRT_2 / px_per_m;
    let away = as_given_m.abs() / deviation_m;
    let meaning = |meaning: Meaning| {
        let height = |point: &SurveyedPoint| {
            point.other_heights().iter().find(|(other, _)| *other == meaning).map(|(_, height_m)| *height_m)
        };
        Some((meaning, off_m(&height)?.abs()))
    };
    let meanings = [Meaning::Feet, Meaning::Above(VerticalDatum::Ellipsoid), Meaning::Above(VerticalDatum::Egm96)];
    let best = meanings.into_iter().filter_map(meaning).min_by(|a, b| a.1.total_cmp(&b.1));
    let left_max_m = (EXPLAINED * as_given_m.abs()).min(NAMED * deviation_m);
    let explained = best.filter(|(_, left_m)| away > 1.0 && *left_m <= left_max_m);
    let cause = explained.map_or("check their unit and what they are above", |(meaning, _)| meaning.hint());
    let side = if as_given_m > 0.0 { "above" } else { "below" };
    let off = as_given_m.abs();
    if away > REFUSED {
        let found = format!(
            "a file with heights {off:.0} m {side} those at which the images see its points: {}",
            path.display()
        );
        let most_m = REFUSED * deviation_m;
        let expected = format!("heights at most {most_m:.0} m away, as far as RPCs may err; {cause}");
        return Err(DsmError::value(DsmSetting::Control, found, expected));
    }
    if explained.is_some() || away > NAMED {
        notes.warn(format!(
            "the heights of the ground points are {off:.1} m {side} those at which the images see them, where RPCs \
             usually err by {deviation_m:.0} m; {cause}: {}",
            path.display()
        ));
    }
    Ok(())
}

/// Finds a control point that contradicts the others: its number, why, and the adjustment without
/// it. `cameras` are adjusted to all of them.
pub(crate) fn wrong_point(
    points: &[&SurveyedPoint],
    cameras: &[RpcCamera],
    fit: impl Fn(&[ControlPoint]) -> Adjustment,
    with: impl Fn(&Adjustment) -> Vec<RpcCamera>,
) -> Option<(usize, String, Adjustment)> {
    if points.len() < POINTS_MIN {
        return None;
    }
    let size = |point: &SurveyedPoint| match (point.off_m(cameras), point.expected_m(cameras)) {
        (Some(off), Some(expected)) => off.iter().zip(expected).map(|(off, m)| off.abs() / m).fold(0.0, f64::max),
        _ => point.point.residual(cameras),
    };
    let mut order: Vec<(usize, f64)> = points.iter().map(|point| size(point)).enumerate().collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let tried = order.into_iter().take(TRIED_MAX).filter_map(|(number, _)| {
        let others: Vec<&SurveyedPoint> = (0..points.len()).filter(|i| *i != number).map(|i| points[i]).collect();
        let found = fit(&others.iter().map(|point| point.point.clone()).collect::<Vec<_>>());
        let (times, reason) = contradiction(points[number], &others, cameras, &with(&found))?;
        Some((times, number, reason, found))
    });
    let worst = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((worst.1, worst.2, worst.3))
}

/// Returns how many times as far a point is from where cameras see it as the others are, and says
/// it; `None` for a point that fits. `following` are the cameras adjusted to all points, and
/// `cameras` those adjusted to the others.
fn contradiction(
    point: &SurveyedPoint,
    others: &[&SurveyedPoint],
    following: &[RpcCamera],
    cameras: &[RpcCamera],
) -> Option<(f64, String)> {
    /// Names of the three parts of a difference.
    const PARTS: [&str; 3] = ["east", "north", "height"];
    let Some((off, own)) = point.off_m(cameras).zip(point.expected_m(cameras)) else {
        let residual = point.point.residual(cameras);
        let of_others = others.iter().map(|other| other.point.residual(cameras)).filter(|r| r.is_finite());
        let usual = root_mean_square(of_others).unwrap_or(1.0).max(SPREAD_MIN);
        let is_wrong = residual > OWN_DEVIATIONS && residual > TIMES_OTHERS * usual;
        return is_wrong.then(|| {
            let text = format!(
                "it is {residual:.1} of its standard deviations from where the cameras see it that fit the others, \
                 which are {usual:.1} away"
            );
            (residual / usual, text)
        });
    };
    let left = point.off_m(following)?;
    let part = |axis: usize| {
        // Of a difference d, σ² / (σ² + v) is left by cameras that follow the point.
        let deviation_m = own[axis] * (off[axis] / left[axis]).abs().max(1.0).sqrt();
        let of_others = others.iter().filter_map(|other| Some(other.off_m(cameras)?[axis]));
        let spread_m = root_mean_square(of_others)?.max(SPREAD_MIN * own[axis]);
        let (off_m, times) = (off[axis], off[axis].abs() / spread_m);
        let is_wrong = times > TIMES_OTHERS && off_m.abs() > OWN_DEVIATIONS * deviation_m;
        let text = || {
            format!(
                "its {} is off by {off_m:+.2} m where the cameras fit the others to {spread_m:.2} m; check its \
                 position, what its height is above, and its places in the images",
                PARTS[axis]
            )
        };
        is_wrong.then(|| (times, text()))
    };
    (0..3).filter_map(part).max_by(|a, b| a.0.total_cmp(&b.0))
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| (sum + value * value, count + 1));
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// Returns the pixels that a metre on the ground takes, along the shorter axis.
fn px_per_m_on_ground(camera: &RpcCamera, ground: LonLatHeight) -> Option<f64> {
    /// Distance of the places that are compared, metres; cameras are linear over it.
    const STEP_M: f64 = 10.0;
    let frame = EnuFrame::new(ground);
    let here = camera.project(ground).ok()?;
    let apart = |east: f64, north: f64| {
        let there = camera.project(frame.ground_from_enu(EnuPoint { east, north, up: 0.0 })).ok()?;
        Some((there.sample - here.sample).hypot(there.line - here.line) / STEP_M)
    };
    Some(apart(STEP_M, 0.0)?.min(apart(0.0, STEP_M)?))
}

/// Returns the largest parallax among the views that see a point, pixels per metre of height.
fn parallax_px_per_m(cameras: &[RpcCamera], seen: &Track, ground: LonLatHeight) -> Option<f64> {
    /// Difference of the heights that are compared, metres.
    const STEP_M: f64 = 10.0;
    let pair = |(a, at): &(usize, ImagePoint), b: usize| {
        let place = |height_m: f64| source_from_reference(&cameras[*a], &cameras[b], 0, *at, height_m).ok();
        let (low, high) = (place(ground.height_m)?, place(ground.height_m + STEP_M)?);
        Some((high.sample - low.sample).hypot(high.line - low.line) / STEP_M)
    };
    let all =
        seen.iter().flat_map(|from| seen.iter().filter_map(move |(to, _)| (*to != from.0).then(|| pair(from, *to))?));
    all.filter(|px| *px > 0.0).max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cameras of the town, whose heights are off by some metres.
    fn cameras(up_m: f64) -> Vec<RpcCamera> {
        let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data-samples/town");
        let camera = |i: usize| {
            let mut rpc = formats::rpc::read_for_image(&town.join(format!("view_{i}.tif"))).unwrap().rpc;
            rpc.height_off += up_m;
            RpcCamera::new(rpc)
        };
        (1..=3).map(camera).collect()
    }

    /// A point at a place of the first image that cameras see `up_m` below where it is.
    fn surveyed(place: [f64; 2], up_m: f64) -> SurveyedPoint {
        let cameras = cameras(0.0);
        let ground = cameras[0].localize(ImagePoint::new(place[0], place[1]), 200.0).unwrap();
        let shown = |camera: &RpcCamera| camera.project(ground).unwrap();
        SurveyedPoint {
            name: "p".to_owned(),
            given_height_m: 200.0 + up_m,
            datum: VerticalDatum::Ellipsoid,
            exchanged: None,
            point: ControlPoint {
                ground: LonLatHeight { height_m: 200.0 + up_m, ..ground },
                horizontal_m: 0.1,
                vertical_m: 0.1,
                pixel_px: 0.1,
                seen: cameras.iter().map(shown).enumerate().collect(),
            },
        }
    }

    /// A point is off by 2.5 m without it, and the others are not off at all. It is wrong where the
    /// cameras hardly follow it, and right where they follow it all the way because nothing else
    /// holds them there.
    #[test]
    fn a_point_that_holds_a_corner_alone_is_no_contradiction() {
        let others = [[100.0, 100.0], [500.0, 120.0], [300.0, 420.0]].map(|place| surveyed(place, 0.0));
        let others: Vec<&SurveyedPoint> = others.iter().collect();
        let point = surveyed([520.0, 500.0], 2.5);
        let found = |followed_m: f64| contradiction(&point, &others, &cameras(followed_m), &cameras(0.0));
        let (times, text) = found(0.1).unwrap();
        assert!(times > TIMES_OTHERS && text.contains("height is off by +2.50 m"), "{times}: {text}");
        assert_eq!(found(2.49), None);
    }
}
