//! Tables of the images of a run: what is known of each, and how good each is.

use std::path::Path;

use report::{JobTable, sensible};

use crate::report::{DsmReport, ImageReport};

/// What stands where the metadata of an image do not say something.
const UNKNOWN: &str = "unknown";

/// Returns what is known of the images: when, by which satellite and in which sun they were taken.
pub(super) fn image_table(report: &DsmReport) -> JobTable {
    let unknown = || UNKNOWN.to_owned();
    let number = |value: Option<f64>, unit| value.map_or_else(unknown, |value| sensible(value, unit));
    let row = |(i, image): (usize, &ImageReport)| {
        let sun = image.sun.map(|sun| format!("{:.0}, {:.0}", sun.azimuth_deg, sun.elevation_deg));
        vec![
            name_of(i, image),
            image.acquired.as_deref().map_or_else(unknown, in_words),
            image.satellite.clone().unwrap_or_else(unknown),
            sun.unwrap_or_else(unknown),
            image.incidence_deg.map_or_else(unknown, |angle| format!("{angle:.1}")),
            number(image.gsd_m, "m"),
            format!("{} × {}", image.size.0, image.size.1),
            image.rpc.clone(),
        ]
    };
    let heads =
        ["image", "taken", "satellite", "sun: azimuth, elevation, °", "incidence, °", "GSD, m", "size, px", "RPC"];
    table("Images", &heads, report, row)
}

/// Returns how good the images are: what the tie points show of their pointing, and the share of
/// their pixels that other images confirm.
pub(super) fn quality_table(report: &DsmReport) -> JobTable {
    let row = |(i, image): (usize, &ImageReport)| {
        let found = report.pointing.images.get(i);
        let [shift_x, shift_y] = shift_at_middle(image);
        let share = |share: Option<f64>| match share.filter(|share| share.is_finite()) {
            Some(share) => format!("{:.0} %", 100.0 * share),
            None => "–".to_owned(),
        };
        vec![
            name_of(i, image),
            format!("{shift_x:+.2}, {shift_y:+.2}"),
            found.map_or(String::new(), |f| format!("{} of {}", f.inliers, f.tracks)),
            share(found.map(|f| f.covered)),
            found.map(|f| f.residual_px).filter(|v| v.is_finite()).map_or("–".to_owned(), |v| format!("{v:.2}")),
            share(report.surface.kept_by_image.get(i).copied().flatten()),
        ]
    };
    let heads = [
        "image",
        "correction in the middle, px",
        "tie points without outliers",
        "shared ground with ties nearby",
        "residual, px",
        "pixels that another image confirms",
    ];
    table("Quality of the images", &heads, report, row)
}

/// Returns the first and the last day on which images were taken, in words, and how many do not
/// say.
pub(super) fn days(report: &DsmReport) -> String {
    let day =
        |image: &ImageReport| image.acquired.as_deref().and_then(|time| time.split('T').next()).map(str::to_owned);
    let mut days: Vec<String> = report.images.iter().filter_map(day).collect();
    days.sort_unstable();
    let silent = report.images.len() - days.len();
    match (days.first(), days.last()) {
        (Some(first), Some(last)) => {
            let taken =
                if first == last { format!("Taken on {first}") } else { format!("Taken from {first} to {last}") };
            if silent == 0 { format!("{taken}.") } else { format!("{taken}; the date of {silent} images is unknown.") }
        }
        _ => "The dates of the images are unknown.".to_owned(),
    }
}

fn table(
    title: &str,
    heads: &[&str],
    report: &DsmReport,
    row: impl Fn((usize, &ImageReport)) -> Vec<String>,
) -> JobTable {
    JobTable {
        title: title.to_owned(),
        heads: heads.iter().map(|head| (*head).to_owned()).collect(),
        rows: report.images.iter().enumerate().map(row).collect(),
    }
}

fn name_of(number: usize, image: &ImageReport) -> String {
    format!("{} {}", number + 1, file_name(&image.path))
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns a time of ISO 8601 as people write it.
fn in_words(time: &str) -> String {
    let text = time.replacen('T', " ", 1);
    text.strip_suffix('Z').map_or(text.clone(), |utc| format!("{utc} UTC"))
}

/// Returns the shift that the correction gives the middle of an image, pixels.
fn shift_at_middle(image: &ImageReport) -> [f64; 2] {
    let middle = camera::ImagePoint::new(0.5 * image.size.0 as f64, 0.5 * image.size.1 as f64);
    let moved = image.applied_correction.apply(middle);
    [moved.sample - middle.sample, moved.line - middle.line]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_people_do() {
        assert_eq!(in_words("2014-10-05T16:01:49Z"), "2014-10-05 16:01:49 UTC");
        assert_eq!(in_words("2014-10-05"), "2014-10-05");
    }
}
