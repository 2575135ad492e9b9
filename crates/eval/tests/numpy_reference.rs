//! Metrics against NumPy: `reference/eval_numpy.txt`, written by `reference/eval_numpy.py`, to 1e-6.

use eval::{Alignment, CellMap, EvalConfig, EvalInput, MetresFromCells, Metrics, evaluate};
use raster::{GeoTransform, Grid};
use std::collections::HashMap;

const REFERENCE: &str = include_str!("reference/eval_numpy.txt");
const TOLERANCE: f64 = 1e-6;

struct Case {
    name: String,
    alignment: Alignment,
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
    let alignment = if value("align") == "z" { Alignment::Z } else { Alignment::None };
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

#[test]
fn all_metrics_agree_with_numpy() {
    let mut lines = REFERENCE.lines();
    let mut count = 0;
    while let Some(case) = next_case(&mut lines) {
        let map = CellMap::affine(&case.reference.1, &case.test.1).unwrap();
        let input = EvalInput {
            test: &case.test.0,
            reference: &case.reference.0,
            test_from_reference: &map,
            metres_from_cells: MetresFromCells::new(&case.reference.1, (1.0, 1.0)),
            classes: Some(&case.classes),
        };
        let config = EvalConfig { alignment: case.alignment, skip: case.skip, ..EvalConfig::default() };
        let found = evaluate(&input, &config).unwrap();
        assert!((found.shift.dz_m - case.dz_m).abs() <= TOLERANCE, "{}: {:?}", case.name, found.shift);
        assert_eq!(found.classes.len() + 1, case.metrics.len(), "{}", case.name);
        for (label, expected) in &case.metrics {
            let class = found.classes.iter().find(|c| c.class.to_string() == *label).map(|c| &c.metrics);
            check(&format!("{} {label}", case.name), class.unwrap_or(&found.overall), expected);
        }
        count += 1;
    }
    assert_eq!(count, 4);
}
