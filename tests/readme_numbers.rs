//! The README's table says what `make bench` measured: skysweep's column is that of `benches/results/scenes.json`, line by line.

use std::path::Path;

use serde_json::Value;

/// A preset's results on a scene.
struct Measured<'a> {
    row: &'a Value,
}

impl Measured<'_> {
    fn metric(&self, name: &str) -> f64 {
        let all = self.row["metrics"].as_array().unwrap();
        all.iter().find(|metric| metric[0] == name).unwrap_or_else(|| panic!("no {name}"))[1].as_f64().unwrap()
    }

    fn cpu_s(&self) -> f64 {
        self.row["cpu_s"].as_f64().unwrap()
    }

    fn accuracy(&self) -> String {
        let [right, covered] = ["completeness_1", "valid_ratio"].map(|name| 100.0 * self.metric(name));
        format!("{:.2} m, {right:.1} %, {covered:.1} %", self.metric("mae"))
    }

    fn most_believed(&self, percent: u32) -> String {
        let [mae, right] = ["mae", "completeness_1"].map(|name| self.metric(&format!("{name}_at_{percent}")));
        format!("{mae:.2} m, {:.1} %", 100.0 * right)
    }
}

/// What skysweep's column says on the line for `label` in or after that of the scene `before`, without emphasis.
fn own_column(readme: &str, before: &str, label: &str) -> String {
    let lines = readme.lines().skip_while(|line| !line.starts_with(&format!("| {before}")));
    let named = |line: &&str| line.split('|').nth(2).is_some_and(|column| column.trim().starts_with(label));
    let line = lines.take_while(|line| line.starts_with('|')).find(named);
    let line = line.unwrap_or_else(|| panic!("no line \"{label}\" in or after \"{before}\""));
    line.split('|').nth(3).unwrap().replace("**", "").trim().to_owned()
}

#[test]
fn the_table_says_what_was_measured() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let results = std::fs::read(root.join("benches/results/scenes.json")).unwrap();
    let results: Value = serde_json::from_slice(&results).unwrap();
    let of = |scene: &str, preset: &str| {
        let mut rows = results["rows"].as_array().unwrap().iter();
        let row = rows.find(|row| row["scene"] == scene && row["preset"] == preset);
        Measured { row: row.unwrap_or_else(|| panic!("no {scene} with {preset}")) }
    };
    let mut expected = Vec::new();
    for (before, scene, label, preset) in [
        ("JAX_068, WorldView-3", "jax_068 7 views", "MAE", "balanced"),
        ("JAX_068, views 001-003-004", "jax_068 001-003-004", "MAE", "balanced"),
        ("JAX_068, views 001-003-004", "jax_068 001-003-004", "every void closed", "balanced --fill all"),
        ("JAX_068, views 002-005-006", "jax_068 002-005-006", "MAE", "balanced"),
        ("JAX_068, views 002-005-006", "jax_068 002-005-006", "every void closed", "balanced --fill all"),
        ("JAX_068, views 001-003 ", "jax_068 001-003", "MAE", "balanced"),
        ("JAX_068, views 002-003", "jax_068 002-003", "MAE", "balanced"),
    ] {
        expected.push((before, label, of(scene, preset).accuracy()));
    }
    for (before, scene, percent) in
        [("JAX_068, views 001-003 ", "jax_068 001-003", 75), ("JAX_068, views 002-003", "jax_068 002-003", 80)]
    {
        expected.push((before, "the most believed", of(scene, "balanced").most_believed(percent)));
    }
    let pairs = ["jax_068 001-003", "jax_068 002-003", "jax_068 002-004"];
    let range = |preset: &str| {
        let all = pairs.map(|scene| of(scene, preset).cpu_s());
        let (least, most) = (all.into_iter().fold(f64::MAX, f64::min), all.into_iter().fold(0.0, f64::max));
        let (least, most) = (format!("{least:.1}"), format!("{most:.1}"));
        if least == most { format!("{least} s") } else { format!("{least} to {most} s") }
    };
    expected.push(("JAX_068, WorldView-3", "CPU", format!("{:.0} s", of("jax_068 7 views", "balanced").cpu_s())));
    expected.push((
        "JAX_068, views 002-003",
        "CPU of a pair",
        format!("{} (fast: {})", range("balanced"), range("fast")),
    ));
    for (before, scene) in [("Pléiades pair, La", "s2p_pair"), ("Pléiades triplet", "s2p_triplet")] {
        let [balanced, fast] = ["balanced", "fast"].map(|preset| of(scene, preset).cpu_s());
        expected.push((before, "CPU", format!("{balanced:.1} s (fast: {fast:.1} s)")));
    }
    expected.push(("Pléiades pair, pyramid", "CPU", format!("{:.1} s", of("phr_gizeh", "balanced").cpu_s())));
    let khufu = of("phr_gizeh", "balanced");
    let faces = ["east_deg", "south_deg", "west_deg"].map(|face| format!("{:.2}°", khufu.metric(face)));
    expected.push(("Pléiades pair, pyramid", "faces", faces.join(", ")));
    let table = readme.lines().skip_while(|line| !line.starts_with("| scene |")).skip(2);
    assert_eq!(table.take_while(|line| line.starts_with('|')).count(), expected.len(), "lines of the table");
    for (before, label, expected) in expected {
        assert_eq!(own_column(&readme, before, label), expected, "{before}, {label}");
    }
}
