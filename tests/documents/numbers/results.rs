//! What the benches wrote to `benches/results`, by the names that the texts use.

use std::fs;

use serde_json::Value;

use crate::pages::root;

/// The files of `benches/results`.
pub(crate) struct Results {
    pub(crate) scenes: Value,
    pub(crate) peers: Value,
    pub(crate) heightmaps: Value,
    pub(crate) priors: Value,
    /// `scale.md`, which has no JSON beside it.
    pub(crate) scale: String,
}

impl Results {
    pub(crate) fn read() -> Self {
        let file = |name: &str| {
            let path = root().join("benches/results").join(name);
            fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        };
        let json = |name: &str| serde_json::from_str(&file(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        Self {
            scenes: json("scenes.json"),
            peers: json("peers.json"),
            heightmaps: json("heightmaps.json"),
            priors: json("priors.json"),
            scale: file("scale.md"),
        }
    }

    /// A scene of `scenes.json` with a preset.
    pub(crate) fn row(&self, scene: &str, preset: &str) -> Row<'_> {
        let mut rows = self.scenes["rows"].as_array().expect("rows").iter();
        let row = rows.find(|row| row["scene"] == scene && row["preset"] == preset);
        Row(row.unwrap_or_else(|| panic!("scenes.json has no {scene} with {preset}")))
    }

    /// S2P's result on views of JAX_068, if the shared data know one.
    pub(crate) fn s2p(&self, views: &[u64], filled: bool) -> Option<&Value> {
        let is_wanted = |peer: &&Value| {
            peer["tool"] == "S2P" && peer["views"] == serde_json::json!(views) && peer["filled"] == filled
        };
        self.peers["entries"].as_array().expect("entries").iter().find(is_wanted)
    }
}

/// What was measured of a preset on a scene.
pub(crate) struct Row<'a>(&'a Value);

impl Row<'_> {
    pub(crate) fn metric(&self, name: &str) -> f64 {
        let all = self.0["metrics"].as_array().expect("metrics");
        let found = all.iter().find(|metric| metric[0] == name);
        found.unwrap_or_else(|| panic!("no {name} of {} with {}", self.0["scene"], self.0["preset"]))[1]
            .as_f64()
            .expect("a number")
    }

    pub(crate) fn percent(&self, name: &str) -> f64 {
        100.0 * self.metric(name)
    }

    pub(crate) fn number(&self, name: &str) -> f64 {
        number(&self.0[name])
    }
}

/// A number of a results file.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The median of a number over the runs of `priors.json`.
pub(crate) fn median(runs: &Value, path: &str) -> f64 {
    let runs = runs.as_array().expect("runs");
    let mut all: Vec<f64> = runs.iter().map(|run| number(run.pointer(path).expect(path))).collect();
    all.sort_by(f64::total_cmp);
    let middle = all.len() / 2;
    if all.len() % 2 == 1 { all[middle] } else { (all[middle - 1] + all[middle]) / 2.0 }
}
