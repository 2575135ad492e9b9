//! Metrics of surfaces and maps agree with SciPy, trimesh and NumPy. The reference is
//! `reference/surface_scipy.txt`, written by `reference/surface_scipy.py`.

use std::collections::BTreeMap;

use eval::{
    LocalSurface, SurfaceComparison, SurfaceComparisonConfig, compare_depths, compare_normals, compare_surfaces,
};

const REFERENCE: &str = include_str!("reference/surface_scipy.txt");
const TOLERANCE: f64 = 1e-6;

type Values = BTreeMap<String, f64>;

struct Reader {
    lines: std::str::Lines<'static>,
}

impl Reader {
    fn line(&mut self, label: &str) -> &'static str {
        self.lines.next().and_then(|line| line.strip_prefix(label)).unwrap_or_else(|| panic!("no {label}")).trim()
    }

    fn rows<const N: usize>(&mut self, label: &str) -> Vec<[f64; N]> {
        let count = self.line(label).parse().unwrap();
        let row = |line: &str| {
            let numbers: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
            <[f64; N]>::try_from(numbers).unwrap()
        };
        self.lines.by_ref().take(count).map(row).collect()
    }

    fn values(&mut self, label: &str) -> Values {
        let pair = |text: &str| text.split_once('=').map(|(name, v)| (name.to_owned(), v.parse().unwrap())).unwrap();
        self.line(label).split_whitespace().map(pair).collect()
    }
}

#[track_caller]
fn check(case: &str, found: &[(&str, f64)], expected: &Values) {
    let found: Values = found.iter().map(|(name, v)| ((*name).to_owned(), *v)).collect();
    let names = |values: &Values| values.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(expected), "{case}");
    for (name, value) in &found {
        let expected = expected[name];
        assert!((value - expected).abs() <= TOLERANCE, "{case}, {name}: {value}, the reference says {expected}");
    }
}

/// Returns every number of a comparison with its path: `accuracy.mean_m`, `precision_0.1`.
fn named(found: &SurfaceComparison) -> Vec<(String, f64)> {
    let json = serde_json::to_value(found).unwrap();
    let mut values = Vec::new();
    for (prefix, key) in [("accuracy", "accuracy"), ("completeness", "completeness"), ("angle", "normal_angle")]
        .into_iter()
        .chain([("m3c2", "m3c2"), ("voc", "voc")])
    {
        for (name, value) in json[key].as_object().unwrap() {
            values.push((format!("{prefix}.{name}"), value.as_f64().unwrap()));
        }
    }
    for score in &found.scores {
        let t = score.threshold_m;
        values.push((format!("precision_{t}"), score.precision));
        values.push((format!("recall_{t}"), score.recall));
        values.push((format!("f_{t}"), score.f_score));
    }
    values.extend([("chamfer_m".to_owned(), found.chamfer_m), ("hausdorff_m".to_owned(), found.hausdorff_m)]);
    values.retain(|(name, _)| name != "voc.voxel_m");
    values
}

fn clouds(reader: &mut Reader, case: &str, config: &SurfaceComparisonConfig) {
    let (test, reference) = (reader.rows::<3>("test "), reader.rows::<3>("reference "));
    let expected = reader.values("values ");
    let found = compare_surfaces(&LocalSurface::Points(test.clone()), &LocalSurface::Points(reference.clone()), config)
        .unwrap();
    let values = named(&found);
    check(case, &values.iter().map(|(name, v)| (name.as_str(), *v)).collect::<Vec<_>>(), &expected);
    // A shift by whole voxels and whole metres changes nothing except rounding.
    let moved = |points: Vec<[f64; 3]>| points.into_iter().map(|[x, y, z]| [x + 2000.0, y - 4000.0, z]).collect();
    let far =
        compare_surfaces(&LocalSurface::Points(moved(test)), &LocalSurface::Points(moved(reference)), config).unwrap();
    for ((name, here), (_, there)) in values.iter().zip(named(&far)) {
        assert!((here - there).abs() < 1e-6, "{case}, {name}: {here} and {there}");
    }
}

fn mesh(reader: &mut Reader, case: &str, config: &SurfaceComparisonConfig) {
    let points = LocalSurface::Points(reader.rows::<3>("points "));
    let positions = reader.rows::<3>("positions ");
    let triangles = reader.rows::<3>("triangles ").into_iter().map(|t| t.map(|corner| corner as u32)).collect();
    let expected = reader.values("values ");
    let house = LocalSurface::Mesh { positions, triangles };
    let forth = compare_surfaces(&points, &house, config).unwrap();
    let back = compare_surfaces(&house, &points, config).unwrap();
    for (statistics, share) in [
        (forth.accuracy, forth.scores.iter().map(|s| s.precision).collect::<Vec<_>>()),
        (back.completeness, back.scores.iter().map(|s| s.recall).collect()),
    ] {
        let s = statistics;
        let mut found =
            vec![("distance.n", s.n as f64), ("distance.mean_m", s.mean_m), ("distance.median_m", s.median_m)];
        found.extend([("distance.rmse_m", s.rmse_m), ("distance.le90_m", s.le90_m), ("distance.le95_m", s.le95_m)]);
        found.extend([("distance.max_m", s.max_m), ("share_0.05", share[0])]);
        found.extend([("share_0.1", share[1]), ("share_0.3", share[2])]);
        check(case, &found, &expected);
    }
}

fn depths(reader: &mut Reader, case: &str) {
    let pairs = reader.rows::<2>("pairs ");
    let expected = reader.values("values ");
    let column = |i: usize| pairs.iter().map(|pair| pair[i]).collect::<Vec<f64>>();
    let found = compare_depths(&column(0), &column(1)).unwrap();
    let (valid, e) = (found.valid, found.errors.unwrap());
    let mut values =
        vec![("valid.both", valid.both as f64), ("valid.iou", valid.iou), ("bias", e.bias), ("mae", e.mae)];
    values.extend([("rmse", e.rmse), ("median_abs", e.median_abs), ("max_abs", e.max_abs), ("abs_rel", e.abs_rel)]);
    values.extend([("delta_1", e.delta[0]), ("delta_2", e.delta[1]), ("delta_3", e.delta[2])]);
    check(case, &values, &expected);
}

fn normals(reader: &mut Reader, case: &str) {
    let pairs = reader.rows::<6>("pairs ");
    let expected = reader.values("values ");
    let half = |from: usize| pairs.iter().map(|p| [p[from], p[from + 1], p[from + 2]]).collect::<Vec<_>>();
    let found = compare_normals(&half(0), &half(3)).unwrap();
    let a = found.angles.unwrap();
    let mut values =
        vec![("valid.both", found.valid.both as f64), ("mean_deg", a.mean_deg), ("median_deg", a.median_deg)];
    values.extend([("max_deg", a.max_deg), ("rmse_deg", a.rmse_deg)]);
    values.extend([("within_11.25", a.within[0]), ("within_30", a.within[2])]);
    check(case, &values, &expected);
}

#[test]
fn all_surface_metrics_agree_with_scipy() {
    let mut reader = Reader { lines: REFERENCE.lines() };
    assert!(reader.line("#").contains("surface_scipy.py"));
    let thresholds_m = reader.line("thresholds ").split_whitespace().map(|t| t.parse().unwrap()).collect();
    let stated = reader.values("config ");
    let config = SurfaceComparisonConfig {
        thresholds_m,
        normal_scale_m: stated["normal_scale"],
        cylinder_m: stated["cylinder"],
        cylinder_reach_m: stated["reach"],
        registration_m: stated["registration"],
        voxel_m: stated["voxel"],
        ..SurfaceComparisonConfig::default()
    };
    let mut cases = Vec::new();
    while let Some(line) = reader.lines.next() {
        let case = line.strip_prefix("case ").expect("a case");
        match case.split_once(' ').unwrap().0 {
            "clouds" => clouds(&mut reader, case, &config),
            "mesh" => mesh(&mut reader, case, &config),
            "depths" => depths(&mut reader, case),
            _ => normals(&mut reader, case),
        }
        cases.push(case);
    }
    assert_eq!(cases, ["clouds near", "clouds far", "mesh house", "depths maps", "normals maps"]);
}
