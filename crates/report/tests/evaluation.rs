//! The page, the text and the JSON of an evaluation hold what they should, and nothing else.

use eval::{AlignmentMethod, CellMap, EvalConfig, EvalInput, Evaluation, MetresFromCells, evaluate};
use raster::{GeoTransform, Grid};
use report::{EvaluationReport, Protocol};

/// Returns ground with a house. The test is half a metre too high, lacks a corner, and its house is
/// one cell wider.
fn surfaces() -> (Grid<f32>, Grid<f32>) {
    let house = |i: usize, grown: usize| {
        let (column, row) = (i % 80, i / 80);
        let inside = (20 - grown..50 + grown).contains(&column) && (20 - grown..45 + grown).contains(&row);
        10.0 + 0.02 * column as f32 + if inside { 8.0 } else { 0.0 }
    };
    let grid = |f: &dyn Fn(usize) -> f32| Grid::from_vec(80, 60, (0..4800).map(f).collect()).unwrap();
    let test = grid(&|i| if i % 80 < 6 && i / 80 < 6 { f32::NAN } else { house(i, 1) + 0.5 });
    (test, grid(&|i| house(i, 0)))
}

fn with_report(change: impl Fn(&mut Protocol), check: impl Fn(&EvaluationReport<'_>, &Evaluation)) {
    let (test, reference) = surfaces();
    let geotransform = GeoTransform::north_up(0.0, 0.0, 0.5);
    let metres = MetresFromCells::new(&geotransform, (1.0, 1.0));
    let map = CellMap::identity();
    let classes = reference.map(|&h| Some(if h > 15.0 { 6 } else { 2 }));
    let input = EvalInput { classes: Some(&classes), ..EvalInput::new(&test, &reference, &map, metres) };
    let config = EvalConfig { alignment: AlignmentMethod::None, ..EvalConfig::default() };
    let found = evaluate(&input, &config).unwrap();
    let mut protocol = Protocol {
        test: "run/dsm/dsm.tif".into(),
        reference: "truth <&> \"x\".tif".into(),
        size: (80, 60),
        cell_m: (0.5, 0.5),
        crs: "EPSG:32617".into(),
        horizontal_epsg: Some(32617),
        vertical: "ellipsoid".into(),
        config,
        classes: Some("classes.tif".into()),
        mask: None,
        terrain: None,
        objects: None,
        layers: Vec::new(),
        notes: vec!["a note with <tags>".into()],
        missed: Vec::new(),
    };
    change(&mut protocol);
    check(&EvaluationReport { protocol: &protocol, found: &found, reference: &reference }, &found);
}

/// Signs are true minus signs, a zero has none, and the short names are explained.
#[test]
fn numbers_have_true_signs_and_short_names_are_explained() {
    with_report(
        |protocol| protocol.notes = vec!["off by -0.00 m and -1.25 m".into()],
        |report, _| {
            let html = report.html().unwrap();
            let body = &html[html.find("<body>").unwrap()..];
            for text in body.split('<').filter_map(|piece| piece.split_once('>')).map(|(_, text)| text) {
                let wrong = text.match_indices('-').any(|(at, _)| {
                    let is_free = text[..at].chars().next_back().is_none_or(|c| !c.is_alphanumeric());
                    is_free && text[at + 1..].starts_with(|c: char| c.is_ascii_digit())
                });
                assert!(!wrong && text.trim() != "-", "{text}");
                assert!(!text.contains("\u{2212}0.00 ") && !text.contains("\u{2212}0.000 "), "{text}");
            }
            assert!(body.contains("off by 0.00 m and \u{2212}1.25 m"));
            for name in ["LE90", "NMAD", "pag_T", "completeness_T", "IoU"] {
                assert!(body[body.find("Abbreviations").unwrap()..].contains(name), "{name}");
            }
        },
    );
}

#[test]
fn the_page_stands_alone_and_is_well_formed() {
    with_report(
        |_| (),
        |report, _| {
            let html = report.html().unwrap();
            assert!(html.starts_with("<!DOCTYPE html>") && html.ends_with("</html>\n"));
            for forbidden in ["http://", "https://", "<script", "NaN", "inf", "<tags>", "truth <"] {
                assert!(!html.replace("info", "").contains(forbidden), "{forbidden}");
            }
            assert_eq!(html.matches("src=\"data:image/png;base64,").count(), 3);
            assert!(html.matches("<svg class=\"chart\"").count() >= 4);
            for tag in
                ["div", "figure", "svg", "table", "tr", "td", "th", "dl", "dd", "p", "ul", "li", "figcaption", "text"]
            {
                let opened = html.matches(&format!("<{tag} ")).count() + html.matches(&format!("<{tag}>")).count();
                assert_eq!(opened, html.matches(&format!("</{tag}>")).count(), "<{tag}>");
            }
            for text in
                ["mean absolute error", "alignment", "6 building", "run/dsm/dsm.tif", "a note with &lt;tags&gt;"]
            {
                assert!(html.contains(text), "{text}");
            }
            assert_eq!(html, report.html().unwrap(), "the same input gives the same page");
        },
    );
}

#[test]
fn text_and_json_hold_the_same_numbers() {
    with_report(
        |protocol| protocol.missed.push("mae is too large".into()),
        |report, found| {
            let (json, table) = (report.json(), report.table());
            let mae = found.overall.errors.unwrap().mae;
            assert_eq!(json.pointer("/metrics/mae").unwrap().as_f64(), Some(mae));
            assert!(table.lines().any(|line| line.starts_with("mae m") && line.contains(&format!("{mae:.3}"))));
            for pointer in [
                "/classes/6/rmse",
                "/edges/edge/mae",
                "/edges/rest/n",
                "/slopes/0/metrics/nmad",
                "/standing/volume_m3/iou",
                "/standing/footprint_m2/recall",
                "/sharpness/overreach_m/median",
                "/histogram/counts/40",
                "/cumulative/cells/100",
                "/metrics/robust_rmse",
                "/metrics/le68",
                "/requirements_missed/0",
            ] {
                assert!(json.pointer(pointer).is_some_and(|v| !v.is_null()), "{pointer}: {json}");
            }
            assert!((found.sharpness.overreach_m.unwrap().median - 0.5).abs() < 0.05, "{:?}", found.sharpness);
            assert_eq!(found.standing.footprint.recall(), Some(1.0));
            for text in ["footprint", "overreach", "slope of ref.", "edges"] {
                assert!(table.contains(text), "{text}: {table}");
            }
            assert!(EvaluationReport::is_ours(&json.to_string()));
            assert!(!EvaluationReport::is_ours("{\"generator\": \"other\"}") && !EvaluationReport::is_ours("no json"));
        },
    );
}
