//! The page of a change: what changed, between which days, how sure that is, and on what it rests.

use change::{Change, Volume};
use raster::{Grid, Light};
use report::{JobPage, JobTable, Legend, MapLayer, PageLink, grouped, number_label, sensible};

use super::report::{DiffRegion, DiffReport, dates};
use job::report_page;

/// Most regions with a row of their own; `changes.geojson` has all.
const LISTED: usize = 200;
/// Most regions whose numbers stand on the map.
const NUMBERED: usize = 60;
/// Shortest side of a map that numbers are written on, pixels: on smaller ones they would cover it.
const NUMBERED_SIDE: usize = 150;
/// Share of the colour of the change over the shade of the surface.
const TINT: f32 = 0.7;

/// Returns the page. `layers` are its maps.
pub(super) fn of(report: &DiffReport, layers: Vec<MapLayer>, has_areas: bool) -> JobPage {
    let [first, second] = [&report.before_acquired, &report.after_acquired].map(|days| dates(days));
    let count = match report.regions.len() {
        0 => "No region changed".to_owned(),
        1 => "One region changed".to_owned(),
        count => format!("{count} regions changed"),
    };
    let lead = format!(
        "{count} significantly from {first} to {second}. {} cells of {} m were observed on both dates; heights above: \
         {}.",
        grouped(report.observed_cells),
        sensible(report.cell_m, "m"),
        report.vertical,
    );
    let cells = (report.size.0 * report.size.1).max(1) as f64;
    let total = &report.total;
    let files = [
        ("change.tif", "second minus first surface, m, with its standard deviation"),
        ("significance.tif", "the change in standard deviations"),
        ("regions.tif", "number of the region of each cell"),
        ("changes.geojson", "the regions as polygons with all numbers"),
        ("areas.geojson", "the given areas with their volumes"),
        ("diff.json", "all numbers of this report"),
    ];
    let files = files.into_iter().filter(|(name, _)| has_areas || *name != "areas.geojson");
    JobPage {
        title: "Change".to_owned(),
        lead,
        cards: vec![
            (report.regions.len().to_string(), "regions of significant change"),
            (with_sigma(total.gain_m3, total.gain_sigma_m3, "m³"), "gained in these regions"),
            (with_sigma(total.loss_m3, total.loss_sigma_m3, "m³"), "lost in these regions"),
            (format!("{} m", sensible(report.detection_m, "m")), "change that a cell must exceed (median)"),
            (format!("{:.0} %", 100.0 * report.deciding_cells as f64 / cells), "of the cells decide"),
        ],
        notes: report.notes.clone(),
        layers,
        links: files.map(|(name, title)| PageLink::new(name, title)).collect(),
        tables: [Some(region_table(report)), area_table(report), Some(surface_table(report, [&first, &second]))]
            .into_iter()
            .flatten()
            .collect(),
        groups: vec![
            ("Evidence".to_owned(), evidence(report)),
            ("Parameters of the search".to_owned(), parameters(report)),
        ],
        ..JobPage::default()
    }
}

/// Returns a quantity with its standard deviation, both to two digits of the latter, but no finer
/// than millimetres.
fn with_sigma(value: f64, sigma: f64, unit: &str) -> String {
    let digits = if sigma > 0.0 { (1.0 - sigma.log10().floor()).clamp(0.0, 3.0) as usize } else { 2 };
    // A line breaks before the deviation, if anywhere.
    format!("{value:.digits$} ±\u{a0}{sigma:.digits$}\u{a0}{unit}")
}

fn region_table(report: &DiffReport) -> JobTable {
    let row = |region: &DiffRegion| {
        let found = &region.found;
        let share = |m2: f64| format!("{:.0} %", 100.0 * m2 / found.area_m2.max(f64::MIN_POSITIVE));
        let signed = |value: f64| if value > 0.0 { "+" } else { "" };
        vec![
            region.number.to_string(),
            sensible(found.area_m2, "m²"),
            format!("{}{}", signed(found.mean_m), with_sigma(found.mean_m, found.mean_sigma_m, "m")),
            format!("{:+.2}", found.extreme_m),
            format!("{}{}", signed(found.volume_m3), with_sigma(found.volume_m3, found.volume_sigma_m3, "m³")),
            share(found.decided_m2),
            share(found.filled_m2),
            format!("{:.0} %", 100.0 * found.probability),
            sensible(found.independent_cells, ""),
            format!("{:.1}, {:.1}", region.centre[0], region.centre[1]),
        ]
    };
    let heads = [
        "region",
        "area, m²",
        "mean change",
        "largest, m",
        "volume",
        "of it decided",
        "of it filled",
        "both heights right",
        "independent cells",
        "middle on the map",
    ];
    let title = match report.regions.len() {
        count if count > LISTED => format!("Regions (the first {LISTED} of {count}; changes.geojson has all)"),
        _ => "Regions".to_owned(),
    };
    table(&title, &heads, report.regions.iter().take(LISTED).map(row).collect())
}

/// Returns the volumes of the given areas; `None` without any.
fn area_table(report: &DiffReport) -> Option<JobTable> {
    let row = |(name, v): (&str, &Volume)| {
        vec![
            name.to_owned(),
            sensible(v.area_m2, "m²"),
            sensible(v.unknown_m2, "m²"),
            with_sigma(v.gain_m3, v.gain_sigma_m3, "m³"),
            with_sigma(v.loss_m3, v.loss_sigma_m3, "m³"),
            with_sigma(v.net_m3, v.net_sigma_m3, "m³"),
        ]
    };
    let heads = ["area", "known, m²", "without heights, m²", "gain", "loss", "net of all cells"];
    let rows: Vec<_> = report.areas.iter().map(|area| row((&area.name, &area.volume))).collect();
    (!rows.is_empty()).then(|| {
        let all = row(("whole scene", &report.total));
        table("Volumes", &heads, rows.into_iter().chain([all]).collect())
    })
}

fn surface_table(report: &DiffReport, days: [&String; 2]) -> JobTable {
    let row = |(which, path, days, acquired): (&str, &std::path::Path, &String, &Vec<String>)| {
        let images = if acquired.is_empty() { "unknown".to_owned() } else { acquired.join(", ") };
        vec![which.to_owned(), path.display().to_string(), days.clone(), images]
    };
    let rows = [
        ("first", report.before.as_path(), days[0], &report.before_acquired),
        ("second", report.after.as_path(), days[1], &report.after_acquired),
    ];
    let heads = ["surface", "file", "days", "images taken at (UTC)"];
    table("Surfaces", &heads, rows.into_iter().map(row).collect())
}

fn table(title: &str, heads: &[&str], rows: Vec<Vec<String>>) -> JobTable {
    JobTable { title: title.to_owned(), heads: heads.iter().map(|head| (*head).to_owned()).collect(), rows }
}

fn evidence(report: &DiffReport) -> Vec<(String, String)> {
    let shift = &report.shift;
    let fact = |name: &str, text: String| (name.to_owned(), text);
    let blocks = report.blocks.iter().map(|blocks| fact("moved by blocks", blocks.text()));
    let facts = vec![
        fact("map", format!("{}, heights above: {}", report.crs, report.vertical)),
        fact(
            "second surface moved by",
            format!("{:+.2} m east, {:+.2} m north, {:+.2} m up", shift.dx_m, shift.dy_m, shift.dz_m),
        ),
        fact("cells observed on both dates", grouped(report.observed_cells)),
        fact("of them decide", grouped(report.deciding_cells)),
        fact("cells with a filled height", grouped(report.filled_cells)),
        fact("candidates tested", grouped(report.tested)),
        fact("stated deviations times", sensible(report.sigma_factor, "")),
        fact("deviation of an offset of all heights", format!("{} m", sensible(report.offset_sigma_m, "m"))),
        fact("net volume of all cells", with_sigma(report.total.net_m3, report.total.net_sigma_m3, "m³")),
        fact("area without heights", format!("{} m²", sensible(report.total.unknown_m2, "m²"))),
    ];
    facts.into_iter().chain(blocks).collect()
}

fn parameters(report: &DiffReport) -> Vec<(String, String)> {
    let value = serde_json::to_value(report.parameters).unwrap_or_default();
    JobPage::of_report("", "", &value).facts
}

/// Returns the regions in the colours of their change over the shade of the first surface, with
/// their numbers.
pub(super) fn regions_on_surface(change: &Change, before: &Grid<f32>, cell_m: f64, legend: Legend) -> MapLayer {
    let (heights, step) = report_page::thinned(before);
    let (numbers, _) = report_page::thinned(&change.numbers);
    let (difference, _) = report_page::thinned(&change.difference);
    let side_m = cell_m * step as f64;
    let shade = raster::hillshade(&heights, (side_m, side_m), Light::default());
    let mut picture = raster::shade_picture(&shade);
    for (at, pixel) in picture.data_mut().iter_mut().enumerate() {
        if numbers.data()[at] > 0 && difference.data()[at].is_finite() {
            let colour = legend.colour(difference.data()[at]);
            let mix = |i: usize| TINT * f32::from(colour[i]) + (1.0 - TINT) * f32::from(pixel[i]);
            *pixel = std::array::from_fn(|i| mix(i) as u8);
        }
    }
    if picture.width().min(picture.height()) >= NUMBERED_SIDE {
        for (number, region) in (1..).zip(&change.regions).take(NUMBERED) {
            // A cell of the region itself: the middle of a bent one lies outside of it.
            let Some(&at) = region.cells.get(region.cells.len() / 2) else { continue };
            let (x, y) = (at % before.width() / step, at / before.width() / step);
            number_label(&mut picture, (x, y), &format!("{number}"));
        }
    }
    MapLayer {
        name: "Regions".to_owned(),
        picture,
        caption: "Regions of significant change with their numbers, on the shaded first surface.".to_owned(),
        legend: Some(legend),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_decides_the_digits() {
        let plain = |value, sigma, unit| with_sigma(value, sigma, unit).replace('\u{a0}', " ");
        assert_eq!(plain(16.1134, 0.2917, "m"), "16.11 ± 0.29 m");
        assert_eq!(plain(-718.03, 94.65, "m³"), "-718 ± 95 m³");
        assert_eq!(plain(0.5, 0.0, "m"), "0.50 ± 0.00 m");
        assert_eq!(plain(1.23456, 0.0001234, "m"), "1.235 ± 0.000 m");
    }
}
