//! Ground control points, which place the block in the world, and check points, which measure how
//! well that succeeded.
//!
//! Control points enter the adjustment with their accuracies, but for those that `control_doubt`
//! finds to be wrong. Check points do not: they are located from their places in the images with
//! the corrected cameras, and compared with their positions. CE90 and LE90 are the horizontal and
//! vertical errors that nine of ten check points do not exceed.

use std::path::{Path, PathBuf};

use camera::{ImageCorrection, ImagePoint, RpcCamera};
use crs::{CrsRequest, HeightConverter, MapProjection, VerticalDatum};
use formats::ground_points::{GroundPoint, ImagePlace, read_ground_points};
use geodesy::{EnuFrame, LonLatHeight};
use numeric::order_statistic;
use sweep::pointing::{AdjustConfig, Adjustment, ControlPoint, Observations, Track, adjust_to_control, ground_of};

use crate::error::{DsmError, DsmSetting};
use crate::georeferencing::chips::find_places;
use crate::georeferencing::control_doubt::{SurveyedPoint, outside_all, refuse_or_warn_of_heights, wrong_point};
use crate::images::scene_image::SceneImage;
use crate::notes::Notes;
use crate::report::{CheckPointReport, ChipReport, ControlPointReport, ControlReport};

/// A control point this many of its standard deviations from where the images see it is named.
const ODD: f64 = 4.0;
/// Most points in the list of a warning.
const NAMED_MAX: usize = 8;

/// The ground points of a run, in the frames of the parts of the images that were read.
#[derive(Debug, Default)]
pub(crate) struct GroundControl {
    path: PathBuf,
    /// Points that are given for the adjustment, and why some do not take part.
    control: Vec<(SurveyedPoint, Option<String>)>,
    /// Points that only measure.
    checks: Vec<SurveyedPoint>,
    /// Searches for image chips.
    chips: Vec<ChipReport>,
}

/// An adjustment to control points.
pub(crate) struct Controlled {
    /// The adjustment with the control points that take part.
    pub(crate) found: Adjustment,
    /// The adjustment without control points.
    pub(crate) by_ties: Adjustment,
}

impl GroundControl {
    /// Reads the ground points that images of the run show, and finds their chips in the images.
    /// Without a file there are none.
    ///
    /// # Errors
    /// [`DsmError::Control`] for a file that cannot be used, [`DsmError::Value`] when no image of
    /// the run shows a point, or a place lies outside its image; [`DsmError::Crs`].
    pub(crate) fn read(path: Option<&Path>, images: &[SceneImage], notes: &mut Notes<'_>) -> Result<Self, DsmError> {
        let Some(path) = path else { return Ok(Self::default()) };
        let mut out = Self { path: path.to_owned(), ..Self::default() };
        for point in read_ground_points(path).map_err(DsmError::Control)? {
            let mut seen = places(&point, images)?;
            if seen.is_empty() && point.chip.is_none() {
                continue;
            }
            let (ground, datum) = position(&point, [point.x, point.y])?;
            out.chips.extend(find_places(&point, ground, images, &mut seen, notes)?);
            if seen.is_empty() {
                continue;
            }
            // Exchanged coordinates may not be on the map, and are then not what was meant.
            let exchanged = position(&point, [point.y, point.x]).ok().map(|(ground, _)| ground);
            let GroundPoint { horizontal_m, vertical_m, pixel_px, .. } = point;
            let surveyed = SurveyedPoint {
                name: point.name,
                given_height_m: point.height_m,
                datum,
                exchanged,
                point: ControlPoint { ground, horizontal_m, vertical_m, pixel_px, seen },
            };
            if point.is_check { out.checks.push(surveyed) } else { out.control.push((surveyed, None)) }
        }
        if out.control.is_empty() && out.checks.is_empty() {
            let found = format!("a file without a place in an image of the run: {}", path.display());
            let expected = "places whose images have the names of the run's, or chips that are found in them";
            return Err(DsmError::value(DsmSetting::Control, found, expected));
        }
        Ok(out)
    }

    /// Adjusts the cameras to tie points and control points. Points outside of all images and
    /// control points that contradict the others do not take part; warnings name them.
    ///
    /// # Errors
    /// [`DsmError::Value`] when most points lie outside of all images, or their heights are further
    /// from where the images see them than RPCs err, with the likely cause.
    pub(crate) fn adjust(
        &mut self,
        cameras: &[RpcCamera],
        sizes: &[(usize, usize)],
        tracks: &[Track],
        notes: &mut Notes<'_>,
    ) -> Result<Controlled, DsmError> {
        let fit = |control: &[ControlPoint]| {
            let observations = Observations { tracks, control };
            adjust_to_control(cameras, sizes, observations, &AdjustConfig::default())
        };
        let by_ties = fit(&[]);
        if self.control.is_empty() && self.checks.is_empty() {
            return Ok(Controlled { found: by_ties.clone(), by_ties });
        }
        let with = |found: &Adjustment| corrected(cameras, &found.corrections);
        let tied = with(&by_ties);
        let all: Vec<&SurveyedPoint> = self.control.iter().map(|(point, _)| point).chain(&self.checks).collect();
        let outside = outside_all(&all, &tied, sizes, &self.path)?;
        let inside: Vec<&SurveyedPoint> =
            all.iter().zip(&outside).filter(|(_, is_outside)| !**is_outside).map(|(point, _)| *point).collect();
        refuse_or_warn_of_heights(&inside, &tied, &self.path, notes)?;
        self.set_aside(&outside, notes);
        let mut found = fit(&self.used());
        // A third of the points may be wrong; with more, nobody knows which ones.
        for _ in 0..self.used().len() / 3 {
            let used: Vec<&SurveyedPoint> = self.control.iter().filter(|c| c.1.is_none()).map(|c| &c.0).collect();
            let Some((wrong, reason, without)) = wrong_point(&used, &with(&found), fit, with) else { break };
            let name = used[wrong].name.clone();
            notes.warn(format!("a control point contradicts the others and is not used, because {reason}: {name}"));
            let entry = self.control.iter_mut().filter(|(_, why)| why.is_none()).nth(wrong);
            entry.into_iter().for_each(|(_, why)| *why = Some(reason.clone()));
            found = without;
        }
        Ok(Controlled { found, by_ties })
    }

    /// Leaves out the points that lie outside of all images, control points first.
    fn set_aside(&mut self, outside: &[bool], notes: &mut Notes<'_>) {
        const WHY: &str = "its position lies outside of all images";
        let mut named: Vec<String> = Vec::new();
        for ((point, why), _) in self.control.iter_mut().zip(outside).filter(|(_, is_outside)| **is_outside) {
            *why = Some(WHY.to_owned());
            named.push(point.name.clone());
        }
        let mut of_checks = outside[self.control.len()..].iter();
        self.checks.retain(|check| {
            let is_outside = of_checks.next() == Some(&true);
            named.extend(is_outside.then(|| check.name.clone()));
            !is_outside
        });
        if !named.is_empty() {
            let count = named.len();
            named.truncate(NAMED_MAX);
            notes.warn(format!(
                "{count} ground points are not used, because the images in which they have places do not show their \
                 positions; check their coordinates: {}{}",
                named.join(", "),
                if count > NAMED_MAX { ", …" } else { "" }
            ));
        }
    }

    /// Returns the control points that take part.
    fn used(&self) -> Vec<ControlPoint> {
        self.control.iter().filter(|(_, why)| why.is_none()).map(|(point, _)| point.point.clone()).collect()
    }

    /// Compares the points with what the corrected cameras see; `None` without points.
    pub(crate) fn report(
        &self,
        images: &[SceneImage],
        cameras: &[RpcCamera],
        (found, is_applied): (&Adjustment, bool),
        notes: &mut Notes<'_>,
    ) -> Option<ControlReport> {
        if self.control.is_empty() && self.checks.is_empty() {
            return None;
        }
        let cameras = if is_applied { corrected(cameras, &found.corrections) } else { cameras.to_vec() };
        let row = |(point, why): &(SurveyedPoint, Option<String>)| point.row(&cameras, images, why.clone());
        let control: Vec<ControlPointReport> = self.control.iter().map(row).collect();
        for odd in control.iter().filter(|point| is_applied && point.used && point.residual > ODD) {
            notes.warn(format!(
                "a control point does not fit: it is {:.0} of its standard deviations from where the images see it; \
                 check its position, its height's datum and its places in the images: {}",
                odd.residual, odd.name
            ));
        }
        let chips = self.chips.clone();
        let mut report =
            ControlReport { control, checks: Vec::new(), chips, unmeasured: 0, ce90_m: None, le90_m: None };
        measure(&self.checks, &mut report, &cameras, notes);
        Some(report)
    }

    /// Compares the check points that were measured before with what other cameras see.
    pub(crate) fn measure_again(&self, report: &mut ControlReport, cameras: &[RpcCamera], notes: &mut Notes<'_>) {
        let is_known = |check: &&SurveyedPoint| report.checks.iter().any(|known| known.name == check.name);
        let checks: Vec<SurveyedPoint> = self.checks.iter().filter(is_known).cloned().collect();
        let unmeasured = report.unmeasured;
        measure(&checks, report, cameras, notes);
        report.unmeasured += unmeasured;
    }
}

/// Compares check points with what cameras see.
fn measure(checks: &[SurveyedPoint], report: &mut ControlReport, cameras: &[RpcCamera], notes: &mut Notes<'_>) {
    let measured: Vec<CheckPointReport> = checks.iter().filter_map(|check| check.measured(cameras)).collect();
    let mut horizontal: Vec<f64> = measured.iter().map(|c| c.error_m[0].hypot(c.error_m[1])).collect();
    let mut vertical: Vec<f64> = measured.iter().map(|c| c.error_m[2].abs()).collect();
    (report.ce90_m, report.le90_m) = (ninetieth(&mut horizontal), ninetieth(&mut vertical));
    let points = format!("{} control points, {} check points", report.control.len(), measured.len());
    let shown = |m: Option<f64>| m.map_or("unknown".to_owned(), |m| format!("{m:.2} m"));
    let errors = format!("CE90 {}, LE90 {} at the check points", shown(report.ce90_m), shown(report.le90_m));
    notes.choose("control", points, errors);
    report.unmeasured = checks.len() - measured.len();
    report.checks = measured;
}

/// Returns cameras with other corrections.
fn corrected(cameras: &[RpcCamera], corrections: &[ImageCorrection]) -> Vec<RpcCamera> {
    let with = |(camera, correction): (&RpcCamera, &ImageCorrection)| RpcCamera {
        rpc: camera.rpc.clone(),
        correction: *correction,
    };
    cameras.iter().zip(corrections).map(with).collect()
}

impl SurveyedPoint {
    /// Locates the point and compares; `None` where fewer than two images show it.
    fn measured(&self, cameras: &[RpcCamera]) -> Option<CheckPointReport> {
        let at = EnuFrame::new(self.point.ground).enu_from_ground(ground_of(cameras, &self.point.seen)?);
        Some(CheckPointReport { name: self.name.clone(), error_m: [at.east, at.north, at.up] })
    }

    /// Returns what the cameras show of the point. `reason` says why it did not take part.
    fn row(&self, cameras: &[RpcCamera], images: &[SceneImage], reason: Option<String>) -> ControlPointReport {
        let off = |(view, place): &(usize, ImagePoint)| {
            let shown = cameras[*view].project(self.point.ground).ok()?;
            Some((*view, [place.sample - shown.sample, place.line - shown.line]))
        };
        let length = |[x, y]: [f64; 2]| x.hypot(y);
        let furthest = self.point.seen.iter().filter_map(off).max_by(|a, b| length(a.1).total_cmp(&length(b.1)));
        let image = furthest.and_then(|(view, _)| images[view].path.file_name());
        ControlPointReport {
            name: self.name.clone(),
            used: reason.is_none(),
            residual: self.point.residual(cameras),
            image: image.unwrap_or_default().to_string_lossy().into_owned(),
            off_px: furthest.map(|(_, off)| off),
            off_height_m: self.measured(cameras).map(|measured| measured.error_m[2]),
            reason,
        }
    }
}

/// Returns the value that nine of ten do not exceed; `None` without values.
fn ninetieth(values: &mut [f64]) -> Option<f64> {
    let last = (0.9 * values.len() as f64).ceil() as usize;
    order_statistic(values, last.checked_sub(1)?)
}

/// Returns the places of a point in the images of the run.
fn places(point: &GroundPoint, images: &[SceneImage]) -> Result<Track, DsmError> {
    let place = |view: usize| {
        let path = &images[view].path;
        let is_own = |name: &str| path == Path::new(name) || path.file_name().is_some_and(|own| own == name);
        let ImagePlace { image, place } = point.seen.iter().find(|seen| is_own(&seen.image))?;
        let (width, height) = images[view].size;
        if !(-1.0..=width as f64).contains(&place.sample) || !(-1.0..=height as f64).contains(&place.line) {
            let (name, ImagePoint { sample, line }) = (&point.name, place);
            let found = format!("a file with {name} at sample {sample}, line {line} of {image}");
            let expected = format!("places inside of the {width} x {height} pixels of that image");
            return Some(Err(DsmError::value(DsmSetting::Control, found, expected)));
        }
        Some(Ok((view, *place)))
    };
    (0..images.len()).filter_map(place).collect()
}

/// Returns the position of a point with some coordinates, above the ellipsoid, and the datum of its
/// height.
fn position(point: &GroundPoint, [x, y]: [f64; 2]) -> Result<(LonLatHeight, VerticalDatum), DsmError> {
    /// Codes of longitude and latitude on WGS 84, with and without heights.
    const GEOGRAPHIC: [u32; 2] = [4326, 4979];
    let (mut lon, mut lat) = (x, y);
    let mut datum = VerticalDatum::Ellipsoid;
    if let Some(crs) = &point.crs
        && let CrsRequest::Epsg { horizontal, vertical } = crs.parse()?
    {
        datum = vertical.unwrap_or_default();
        if !GEOGRAPHIC.contains(&horizontal) {
            (lon, lat) = MapProjection::from_epsg(horizontal)?.lonlat_from_map(x, y)?;
        }
    }
    let height_m = match datum {
        VerticalDatum::Ellipsoid => point.height_m,
        datum => HeightConverter::new(datum)?.ellipsoid_from_datum(lon, lat, point.height_m)?,
    };
    Ok((LonLatHeight::new(lon, lat, height_m), datum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_of_ten_are_below_the_ninetieth() {
        assert_eq!(ninetieth(&mut []), None);
        assert_eq!(ninetieth(&mut [3.0]), Some(3.0));
        let mut ten: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!(ninetieth(&mut ten), Some(9.0));
    }
}
