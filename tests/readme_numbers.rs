//! The README says what the benches measured: skysweep's column of its table is that of `benches/results/scenes.json`, line by line,
//! S2P's accuracy is that of its peers, and sentences below the table are held to it and to `benches/results/scale.md`.

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

/// The columns of skysweep and S2P.
const OWN: usize = 3;
const S2P: usize = 4;

/// What a column says on the line for `label` in or after that of the scene `before`, without emphasis.
fn cell(readme: &str, before: &str, label: &str, column: usize) -> String {
    let lines = readme.lines().skip_while(|line| !line.starts_with(&format!("| {before}")));
    let named = |line: &&str| line.split('|').nth(2).is_some_and(|column| column.trim().starts_with(label));
    let line = lines.take_while(|line| line.starts_with('|')).find(named);
    let line = line.unwrap_or_else(|| panic!("no line \"{label}\" in or after \"{before}\""));
    line.split('|').nth(column).unwrap().replace("**", "").trim().to_owned()
}

fn read() -> (String, Value) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let results = std::fs::read(root.join("benches/results/scenes.json")).unwrap();
    (readme, serde_json::from_slice(&results).unwrap())
}

fn measured<'a>(results: &'a Value, scene: &str, preset: &str) -> Measured<'a> {
    let mut rows = results["rows"].as_array().unwrap().iter();
    let row = rows.find(|row| row["scene"] == scene && row["preset"] == preset);
    Measured { row: row.unwrap_or_else(|| panic!("no {scene} with {preset}")) }
}

#[test]
fn the_table_says_what_was_measured() {
    let (readme, results) = read();
    let of = |scene: &str, preset: &str| measured(&results, scene, preset);
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
        assert_eq!(cell(&readme, before, label, OWN), expected, "{before}, {label}");
    }
}

#[test]
fn the_column_of_s2p_says_what_is_known_of_it() {
    let (readme, results) = read();
    for (before, views) in [
        ("JAX_068, WorldView-3", &[1, 2, 3, 4, 5, 6, 7][..]),
        ("JAX_068, views 001-003-004", &[1, 3, 4]),
        ("JAX_068, views 002-005-006", &[2, 5, 6]),
        ("JAX_068, views 001-003 ", &[1, 3]),
        ("JAX_068, views 002-003", &[2, 3]),
    ] {
        let mut peers = results["peers"].as_array().unwrap().iter();
        let peer = peers.find(|peer| peer["tool"] == "S2P" && peer["views"] == serde_json::json!(views)).unwrap();
        let [mae, right, covered] = ["mae", "completeness_1", "valid_ratio"].map(|name| peer[name].as_f64().unwrap());
        let expected = format!("{mae:.2} m, {:.1} %, {:.1} %", 100.0 * right, 100.0 * covered);
        assert_eq!(cell(&readme, before, "MAE", S2P), expected, "{before}");
    }
}

#[test]
fn the_sentences_below_the_table_say_what_was_measured() {
    let (readme, results) = read();
    let text = readme.split_whitespace().collect::<Vec<_>>().join(" ");
    let right = |scene: &str| 100.0 * measured(&results, scene, "balanced").metric("completeness_1");
    let town = measured(&results, "town", "balanced");
    let (nmad_cm, mae_m) = (100.0 * town.metric("nmad"), town.metric("mae"));
    let scale = include_str!("../benches/results/scale.md");
    let largest = scale.lines().find(|line| line.starts_with("| 20000 |")).unwrap();
    let number = |column: usize| largest.split('|').nth(column).unwrap().trim().parse::<f64>().unwrap();
    let (cost, minutes) = (number(6), number(7) / 60.0);
    let spread = scale.split("the greatest cost per megapixel is ").nth(1).unwrap().split(" % above").next().unwrap();
    for sentence in [
        format!("NMAD of {nmad_cm:.0} cm, an MAE of {mae_m:.2} m and {:.1} % of all cells", right("town")),
        format!("{:.0} % of the simulated hills are right to a metre", right("hills")),
        format!("a quarry's faces, {:.0} %", right("quarry")),
        format!(
            "takes {minutes:.0} minutes in 2 GB: {cost:.1} CPU seconds per megapixel, as smaller pairs do to {spread} %"
        ),
    ] {
        assert!(text.contains(&sentence), "the README does not say \"{sentence}\"");
    }
}
