//! Metrics agree with NumPy to 1e-6. The reference is `reference/eval_numpy.txt`, written by
//! `reference/eval_numpy.py`.

use eval::{AlignmentMethod, CellMap, EvalConfig, EvalInput, Evaluation, MetresFromCells, Metrics, Overlap, evaluate};
use raster::{GeoTransform, Grid};
use std::collections::HashMap;

const REFERENCE: &str = include_str!("reference/eval_numpy.txt");
const TOLERANCE: f64 = 1e-6;
/// Height of the generator's level terrain.
const TERRAIN_M: f32 = 29.0;

struct Case {
    name: String,
    alignment: AlignmentMethod,
    skip: Vec<i32>,
    dz_m: f64,
    reference: (Grid<f32>, GeoTransform),
    test: (Grid<f32>, GeoTransform),
    classes: Grid<Option<i32>>,
    metrics: Vec<(String, HashMap<String, f64>)>,
}

fn rows<T>(lines: &mut std::str::Lines<'_>, columns: usize, rows: usize, parse: impl Fn(&str) -> T) -> Grid<T> {
    let cells = lines.take(rows).flat_map(str::split_whitespace).map(parse).collect();
    Grid::from_vec(columns, rows, cells).expect("a full grid")
}

fn surface(lines: &mut std::str::Lines<'_>, label: &str) -> (Grid<f32>, GeoTransform) {
    let header = lines.next().unwrap().strip_prefix(label).expect(label);
    let n: Vec<f64> = header.split_whitespace().map(|n| n.parse().unwrap()).collect();
    (rows(lines, n[0] as usize, n[1] as usize, |c| c.parse().unwrap()), GeoTransform::north_up(n[2], n[4], n[3]))
}

fn next_case(lines: &mut std::str::Lines<'_>) -> Option<Case> {
    let name = lines.by_ref().find_map(|line| line.strip_prefix("case "))?.to_owned();
    let mut value = |key: &str| lines.next().unwrap().strip_prefix(key).expect("the key").trim().to_owned();
    let alignment = if value("align") == "z" { AlignmentMethod::Z } else { AlignmentMethod::None };
    let skip = value("skip").split_whitespace().map(|c| c.parse().unwrap()).collect();
    let dz_m = value("dz").parse().unwrap();
    let (reference, test) = (surface(lines, "reference "), surface(lines, "test "));
    assert_eq!(lines.next(), Some("classes"));
    let classes = rows(lines, reference.0.width(), reference.0.height(), |c| Some(c.parse().unwrap()));
    let metrics = lines.map_while(|line| line.strip_prefix("metrics ")).map(named_values).collect();
    Some(Case { name, alignment, skip, dz_m, reference, test, classes, metrics })
}

fn named_values(line: &str) -> (String, HashMap<String, f64>) {
    let (label, values) = line.split_once(' ').unwrap();
    let pair = |text: &str| text.split_once('=').map(|(name, v)| (name.to_owned(), v.parse().unwrap())).unwrap();
    (label.to_owned(), values.split_whitespace().map(pair).collect())
}

fn check(context: &str, found: &Metrics, expected: &HashMap<String, f64>) {
    let found = found.named();
    assert_eq!(found.len(), expected.len(), "{context}: {found:?}");
    for (name, value) in found {
        let (value, expected) = (value.expect("a value"), expected[&name]);
        assert!((value - expected).abs() <= TOLERANCE, "{context}, {name}: {value}, NumPy says {expected}");
    }
}

/// Checks areas and volumes to 1e-6 of their size, because the aligned surface has single
/// precision.
fn check_overlap(context: &str, found: &Overlap, expected: &HashMap<String, f64>) {
    for (name, value) in [("reference", found.reference), ("test", found.test), ("shared", found.shared)] {
        let expected = expected[name];
        assert!((value - expected).abs() <= TOLERANCE * expected, "{context}, {name}: {value}, NumPy says {expected}");
    }
}

/// Returns the metrics with the generator's label: `all`, a class, `slope_<lower bound>`, `edge` or
/// `rest`.
fn metrics_of<'a>(found: &'a Evaluation, label: &str) -> &'a Metrics {
    let slope = || found.slopes.iter().find(|bin| label == format!("slope_{}", bin.from_deg)).map(|bin| &bin.metrics);
    let class = || found.classes.iter().find(|c| c.class.to_string() == label).map(|c| &c.metrics);
    match label {
        "all" => &found.overall,
        "edge" => &found.edges.edge,
        "rest" => &found.edges.rest,
        _ => class().or_else(slope).unwrap_or_else(|| panic!("no cells for {label}")),
    }
}

/// Returns the number of sets of cells that have errors.
fn sets_with_values(found: &Evaluation) -> usize {
    let classes = found.classes.iter().map(|c| &c.metrics);
    let slopes = found.slopes.iter().map(|bin| &bin.metrics);
    let all = classes.chain(slopes).chain([&found.overall, &found.edges.edge, &found.edges.rest]);
    all.filter(|metrics| metrics.n > 0).count()
}

#[test]
fn all_metrics_agree_with_numpy() {
    let mut lines = REFERENCE.lines();
    let mut count = 0;
    while let Some(case) = next_case(&mut lines) {
        let terrain = case.classes.map(|_| TERRAIN_M);
        let map = CellMap::affine(&case.reference.1, &case.test.1).unwrap();
        let input = EvalInput {
            classes: Some(&case.classes),
            terrain: Some(&terrain),
            ..EvalInput::new(&case.test.0, &case.reference.0, &map, MetresFromCells::new(&case.reference.1, (1.0, 1.0)))
        };
        let config = EvalConfig { alignment: case.alignment, skip: case.skip, ..EvalConfig::default() };
        let found = evaluate(&input, &config).unwrap();
        assert!((found.shift.dz_m - case.dz_m).abs() <= TOLERANCE, "{}: {:?}", case.name, found.shift);
        for (label, expected) in &case.metrics {
            let context = format!("{} {label}", case.name);
            match label.as_str() {
                "footprint" => check_overlap(&context, &found.standing.footprint, expected),
                "volume" => check_overlap(&context, &found.standing.volume, expected),
                _ => check(&context, metrics_of(&found, label), expected),
            }
        }
        assert_eq!(case.metrics.len(), sets_with_values(&found) + 2, "{}", case.name);
        count += 1;
    }
    assert_eq!(count, 4);
}
