//! Ground control points, which place the block in the world, and check points, which measure how
//! well that succeeded.
//!
//! Control points enter the adjustment with their accuracies. Check points do not: they are located
//! from their places in the images with the corrected cameras, and compared with their positions.
//! CE90 and LE90 are the horizontal and vertical errors that nine of ten check points do not
//! exceed.

use std::path::Path;

use camera::{ImageCorrection, ImagePoint, RpcCamera};
use crs::{CrsRequest, HeightConverter, MapProjection, VerticalDatum};
use geodesy::{EnuFrame, LonLatHeight};
use io::ground_points::{GroundPoint, ImagePlace, read_ground_points};
use numeric::order_statistic;
use sweep::pointing::{Adjustment, ControlPoint, Track, ground_of};

use crate::dsm::chips::find_places;
use crate::dsm::error::{DsmError, DsmSetting};
use crate::dsm::images::SceneImage;
use crate::dsm::notes::Notes;
use crate::dsm::report::{CheckPointReport, ChipReport, ControlPointReport, ControlReport};

/// A control point this many of its standard deviations from where the images see it is named.
const ODD: f64 = 4.0;

/// The ground points of a run, in the frames of the parts of the images that were read.
#[derive(Debug, Default)]
pub(crate) struct GroundControl {
    names: Vec<String>,
    /// Points that take part in the adjustment.
    pub(crate) control: Vec<ControlPoint>,
    checks: Vec<Check>,
    /// Searches for image chips.
    chips: Vec<ChipReport>,
}

/// A point that only measures.
#[derive(Debug)]
struct Check {
    name: String,
    ground: LonLatHeight,
    seen: Track,
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
        let mut out = Self::default();
        for point in read_ground_points(path)? {
            let mut seen = places(&point, images)?;
            if seen.is_empty() && point.chip.is_none() {
                continue;
            }
            let ground = position(&point)?;
            out.chips.extend(find_places(&point, ground, images, &mut seen, notes)?);
            if seen.is_empty() {
                continue;
            }
            if point.is_check {
                out.checks.push(Check { name: point.name, ground, seen });
                continue;
            }
            let GroundPoint { horizontal_m, vertical_m, pixel_px, .. } = point;
            out.names.push(point.name);
            out.control.push(ControlPoint { ground, horizontal_m, vertical_m, pixel_px, seen });
        }
        if out.control.is_empty() && out.checks.is_empty() {
            let found = format!("a file without a place in an image of the run: {}", path.display());
            let expected = "places whose images have the names of the run's, or chips that are found in them";
            return Err(DsmError::value(DsmSetting::Control, found, expected));
        }
        Ok(out)
    }

    /// Compares the points with what the corrected cameras see; `None` without points.
    pub(crate) fn report(
        &self,
        cameras: &[RpcCamera],
        found: &Adjustment,
        is_applied: bool,
        notes: &mut Notes<'_>,
    ) -> Option<ControlReport> {
        if self.control.is_empty() && self.checks.is_empty() {
            return None;
        }
        let with = |(camera, correction): (&RpcCamera, &ImageCorrection)| RpcCamera {
            rpc: camera.rpc.clone(),
            correction: if is_applied { *correction } else { camera.correction },
        };
        let cameras: Vec<RpcCamera> = cameras.iter().zip(&found.corrections).map(with).collect();
        let control: Vec<ControlPointReport> = self
            .names
            .iter()
            .zip(&found.control_residual)
            .map(|(name, residual)| ControlPointReport { name: name.clone(), residual: *residual })
            .collect();
        for odd in control.iter().filter(|point| is_applied && point.residual > ODD) {
            notes.warn(format!(
                "a control point does not fit: it is {:.0} of its standard deviations from where the images see it; \
                 check its position, its height's datum and its places in the images: {}",
                odd.residual, odd.name
            ));
        }
        let chips = self.chips.clone();
        let mut report =
            ControlReport { control, checks: Vec::new(), chips, unmeasured: 0, ce90_m: None, le90_m: None };
        self.measure_again(&mut report, &cameras, notes);
        Some(report)
    }

    /// Compares the check points with what other cameras see.
    pub(crate) fn measure_again(&self, report: &mut ControlReport, cameras: &[RpcCamera], notes: &mut Notes<'_>) {
        let checks: Vec<CheckPointReport> = self.checks.iter().filter_map(|check| check.measured(cameras)).collect();
        let mut horizontal: Vec<f64> = checks.iter().map(|c| c.error_m[0].hypot(c.error_m[1])).collect();
        let mut vertical: Vec<f64> = checks.iter().map(|c| c.error_m[2].abs()).collect();
        (report.ce90_m, report.le90_m) = (ninetieth(&mut horizontal), ninetieth(&mut vertical));
        let points = format!("{} control points, {} check points", report.control.len(), checks.len());
        let shown = |m: Option<f64>| m.map_or("unknown".to_owned(), |m| format!("{m:.2} m"));
        let errors = format!("CE90 {}, LE90 {} at the check points", shown(report.ce90_m), shown(report.le90_m));
        notes.choose("control", points, errors);
        report.unmeasured = self.checks.len() - checks.len();
        report.checks = checks;
    }
}

impl Check {
    /// Locates the point and compares; `None` where fewer than two images show it.
    fn measured(&self, cameras: &[RpcCamera]) -> Option<CheckPointReport> {
        let at = EnuFrame::new(self.ground).enu_from_ground(ground_of(cameras, &self.seen)?);
        Some(CheckPointReport { name: self.name.clone(), error_m: [at.east, at.north, at.up] })
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

/// Returns the position of a point above the ellipsoid.
fn position(point: &GroundPoint) -> Result<LonLatHeight, DsmError> {
    /// Codes of longitude and latitude on WGS 84, with and without heights.
    const GEOGRAPHIC: [u32; 2] = [4326, 4979];
    let (mut lon, mut lat) = (point.x, point.y);
    let mut datum = VerticalDatum::Ellipsoid;
    if let Some(crs) = &point.crs
        && let CrsRequest::Epsg { horizontal, vertical } = crs.parse()?
    {
        datum = vertical.unwrap_or_default();
        if !GEOGRAPHIC.contains(&horizontal) {
            (lon, lat) = MapProjection::from_epsg(horizontal)?.lonlat_from_map(point.x, point.y)?;
        }
    }
    let height_m = match datum {
        VerticalDatum::Ellipsoid => point.height_m,
        datum => HeightConverter::new(datum)?.ellipsoid_from_datum(lon, lat, point.height_m)?,
    };
    Ok(LonLatHeight::new(lon, lat, height_m))
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
