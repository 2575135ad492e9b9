//! The texts with numbers: each is made from the results files and stands between markers on the
//! pages.

use serde_json::Value;

use super::results::{Results, Row, median, number};

/// Views of JAX_068, the scene's name in `scenes.json`, and how a page names it.
const JAX: [(&[u64], &str, &str); 6] = [
    (&[1, 2, 3, 4, 5, 6, 7], "jax_068 7 views", "all 7 views"),
    (&[1, 3, 4], "jax_068 001-003-004", "001, 003, 004"),
    (&[2, 5, 6], "jax_068 002-005-006", "002, 005, 006"),
    (&[1, 3], "jax_068 001-003", "001, 003"),
    (&[2, 3], "jax_068 002-003", "002, 003"),
    (&[2, 4], "jax_068 002-004", "002, 004"),
];

/// Returns the text of a block.
///
/// # Panics
///
/// Panics when no block has this name, or when a results file lacks one of its numbers.
pub(crate) fn block(name: &str, results: &Results) -> String {
    match name {
        "circumstances" => circumstances(results),
        "jax" => jax(results),
        "elsewhere" => elsewhere(results),
        "simulated" => simulated(results),
        "large" => large(results),
        "heightmaps" => heightmaps(results),
        "priors" => priors(results),
        "presets" => presets(results),
        "agreement" => agreement(results),
        _ => panic!("no block has the name {name}"),
    }
}

fn circumstances(results: &Results) -> String {
    let scenes = &results.scenes;
    let runs = match number(&scenes["runs"]) {
        1.0 => "One run".to_owned(),
        runs => format!("Medians of {runs} runs"),
    };
    let [machine, date] = ["machine", "date"].map(|name| scenes[name].as_str().expect("a text"));
    format!("{runs} of `make bench` on {machine}, {date}, with default options. CPU is user time of the whole command.")
}

/// Mean absolute error, share of all cells that are right to a metre, and coverage.
struct Accuracy {
    mae_m: f64,
    right_percent: f64,
    covered_percent: f64,
}

impl Accuracy {
    fn of_row(row: &Row<'_>) -> Self {
        let [right_percent, covered_percent] = ["completeness_1", "valid_ratio"].map(|name| row.percent(name));
        Self { mae_m: row.metric("mae"), right_percent, covered_percent }
    }

    fn of_peer(peer: &Value) -> Self {
        let [right, covered] = ["completeness_1", "valid_ratio"].map(|name| number(&peer[name]));
        Self { mae_m: number(&peer["mae"]), right_percent: 100.0 * right, covered_percent: 100.0 * covered }
    }

    fn text(&self) -> String {
        let Self { mae_m, right_percent, covered_percent } = self;
        format!("{mae_m:.2} m, {right_percent:.1} %, {covered_percent:.1} %")
    }
}

/// Ours beside S2P on real images, like with like.
///
/// # Panics
///
/// Panics when the sentence below the table is no longer true.
fn jax(results: &Results) -> String {
    let mut text =
        "| views | surface | skysweep: MAE, < 1 m, coverage | S2P: MAE, < 1 m, coverage | CPU s | S2P CPU s |\n\
                    |---|---|---|---|--:|--:|\n"
            .to_owned();
    for (views, scene, name) in JAX {
        let peer = results.s2p(views, false).expect("S2P on these views");
        let seconds = match peer["cpu_note"].as_str() {
            Some(note) => note.trim_end_matches(" s a pair").to_owned(),
            None => format!("{:.0}", number(&peer["cpu_s"])),
        };
        let ours = Accuracy::of_row(&results.row(scene, "balanced --fill none"));
        let theirs = Accuracy::of_peer(peer);
        let is_true = ours.covered_percent < theirs.covered_percent && ours.mae_m < theirs.mae_m;
        assert!(is_true, "{scene}: observed surfaces no longer cover less with a smaller MAE; mend the sentence");
        let cpu = results.row(scene, "balanced").number("cpu_s");
        text += &format!("| {name} | observed | {} | {} | {cpu:.1} | {seconds} |\n", ours.text(), theirs.text());
        let ours = Accuracy::of_row(&results.row(scene, "balanced --fill all"));
        let theirs = results.s2p(views, true).map(Accuracy::of_peer);
        if let Some(theirs) = &theirs {
            let is_true = ours.right_percent > theirs.right_percent && ours.mae_m < theirs.mae_m;
            assert!(is_true, "{scene}: the filled surface is no longer better; mend the sentence");
        }
        let theirs = theirs.map_or("–".to_owned(), |theirs| theirs.text());
        text += &format!("| | filled | {} | {theirs} | | |\n", ours.text());
    }
    text + "\nBefore filling, skysweep keeps fewer heights than S2P: it covers less, and its MAE is smaller. Where S2P's \
            filled surface is known, ours has more cells that are right to a metre and a smaller MAE. A dash means that the \
            sources give no filled surface.\n"
}

/// Real scenes without a measured truth.
fn elsewhere(results: &Results) -> String {
    let mut text = "| scene | skysweep CPU s | fast | S2P CPU s | CARS CPU s |\n|---|--:|--:|--:|--:|\n".to_owned();
    for (scene, name) in [
        ("s2p_pair", "Pléiades pair, La Réunion"),
        ("s2p_triplet", "Pléiades triplet, quarry near Marseille"),
        ("phr_gizeh", "Pléiades pair, pyramid of Khufu"),
    ] {
        let [balanced, fast] = ["balanced", "fast"].map(|preset| results.row(scene, preset).number("cpu_s"));
        let [s2p, cars] = ["S2P", "CARS"].map(|tool| number(&results.peers["cpu_s"][scene][tool]));
        text += &format!("| {name} | {balanced:.1} | {fast:.1} | {s2p:.0} | {cars:.0} |\n");
    }
    let khufu = results.row("phr_gizeh", "balanced");
    let faces = |prefix: &str| {
        let [east, south, west] =
            ["east_deg", "south_deg", "west_deg"].map(|face| khufu.metric(&format!("{prefix}{face}")));
        format!("{east:.2}°, {south:.2}° and {west:.2}°")
    };
    text += &format!(
        "\nThe east, south and west faces of the pyramid rise at 51.84°. skysweep measures {}, S2P {}.\n",
        faces(""),
        faces("s2p_")
    );
    text
}

fn simulated(results: &Results) -> String {
    let town = results.row("town", "balanced");
    let right = |scene: &str| results.row(scene, "balanced").percent("completeness_1");
    format!(
        "On the sample town, whose surface is known exactly, the NMAD is {:.0} cm, the MAE {:.2} m, and {:.1} % of \
         all cells are \
         right to a metre, trees, vehicles and walls included. Forests of separate crowns are the hardest: of the \
         simulated hills \
         {:.0} % of the cells are right to a metre, of a quarry {:.0} %.",
        100.0 * town.metric("nmad"),
        town.metric("mae"),
        right("town"),
        right("hills"),
        right("quarry")
    )
}

fn large(results: &Results) -> String {
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let last = results.scale.lines().rfind(|line| line.starts_with("| ") && line.contains('²')).expect("a row");
    let row = cells(last);
    let value = |column: usize| row[column].parse::<f64>().expect("a number");
    let spread = results.scale.split("the greatest cost per megapixel is ").nth(1).expect("the spread");
    let spread = spread.split(" % above").next().expect("a number");
    format!(
        "A simulated pair of {side} × {side} pixels takes {:.0} minutes and {:.1} GB: {:.1} CPU seconds per \
         megapixel, which \
         differ by {spread} % between the sizes measured.",
        value(7) / 60.0,
        value(8) / 1000.0,
        value(6),
        side = row[1]
    )
}

fn heightmaps(results: &Results) -> String {
    let all = &results.heightmaps;
    let mut readings = all["readings"].as_array().expect("readings").iter();
    let bilinear = readings.find(|reading| reading["interpolation"] == "bilinear").expect("the default interpolation");
    format!(
        "{} height maps of 518 × 518 pixels from one surface model take {:.0} s on {} threads. Away from walls they \
         are {:.0} mm \
         (RMSE) from the true surface.",
        all["tiles"],
        number(&bilinear["seconds"]),
        all["threads"],
        1000.0 * number(&bilinear["open"]["rmse_m"])
    )
}

fn priors(results: &Results) -> String {
    let of = |tool: &str, path: &str| median(&results.priors["runs"]["1"][tool], path);
    let maps = "/maps/wall_s";
    format!(
        "On one thread, 100 depth and normal maps of a real tile take {:.1} s; Open3D (Embree) takes {:.1} s. The \
         tile is loaded and \
         triangulated in {:.2} s, and depths are within {:.3} mm of brute force.",
        of("skysweep", maps),
        of("open3d", maps),
        of("skysweep", "/load_and_triangulate/wall_s"),
        1000.0 * number(&results.priors["check"]["brute_force"]["max_m"])
    )
}

/// Presets and fills on the real scene.
fn presets(results: &Results) -> String {
    let mut text =
        "| views | options | CPU s | MAE m | NMAD m | < 1 m % | coverage % |\n|---|---|--:|--:|--:|--:|--:|\n"
            .to_owned();
    for (_, scene, name) in JAX {
        let all = ["fast", "balanced", "accurate", "balanced --fill none", "balanced --fill all"];
        for preset in all {
            let row = results.row(scene, preset);
            text += &format!(
                "| {name} | `--preset {preset}` | {:.1} | {:.3} | {:.3} | {:.1} | {:.1} |\n",
                row.number("cpu_s"),
                row.metric("mae"),
                row.metric("nmad"),
                row.percent("completeness_1"),
                row.percent("valid_ratio")
            );
        }
    }
    text
}

/// How far programs differ from one another where there is no truth.
fn agreement(results: &Results) -> String {
    let mut text =
        "| scene | skysweep to S2P: median difference | CARS to S2P: median difference |\n|---|--:|--:|\n".to_owned();
    for scene in ["s2p_pair", "s2p_triplet"] {
        let ours = results.row(scene, "balanced").metric("median_abs");
        let cars = number(&results.peers["surfaces"][scene]["median"]);
        text += &format!("| `{scene}` | {ours:.2} m | {cars:.2} m |\n");
    }
    text
}
