//! What the page of a batch shows of a scene: its picture, how good it is, and its results. All of
//! it is read from the files of the scene, so that tasks of earlier runs are shown as well.

use std::path::Path;

use formats::read_regular;
use report::{BatchAccuracy, BatchSceneRow, PageLink};
use serde_json::Value;

use job::files::TEXT_LIMIT;

/// Largest thumbnail that is taken into the page, bytes. They are 256 pixels wide.
const THUMBNAIL_BYTES: u64 = 1 << 20;
/// Results that the page links to, in the folder of a scene.
const RESULTS: [(&str, &str); 12] = [
    ("report/report.html", "report"),
    ("dsm/dsm.tif", "surface"),
    ("dsm/relief.png", "relief"),
    ("ortho/ortho.tif", "ortho"),
    ("eval/report.html", "errors"),
    ("heightmap.tif", "height map"),
    ("heightmaps", "height maps"),
    ("priors/report.html", "priors"),
    ("dtm/dtm.html", "terrain"),
    ("classes/classes.html", "classes"),
    ("products/products.html", "products"),
    ("diff/diff.html", "change"),
];

/// Returns the row of a scene, with the state and the time of its tasks.
pub(super) fn of(name: &str, folder: &Path, is_complete: bool, seconds: f64) -> BatchSceneRow {
    let read = |name: &str| -> Value {
        let bytes = read_regular(&folder.join(name), TEXT_LIMIT).unwrap_or_default();
        serde_json::from_slice(&bytes).unwrap_or_default()
    };
    let (run, errors) = (read("report/report.json"), read("eval/report.json"));
    // The folder of a scene lies beside the page.
    let beside = folder.file_name().unwrap_or_default().to_string_lossy();
    let links = RESULTS.iter().filter(|(path, _)| folder.join(path).exists());
    BatchSceneRow {
        name: name.to_owned(),
        thumbnail: read_regular(&folder.join("dsm/thumbnail.png"), THUMBNAIL_BYTES).ok(),
        is_complete,
        images: run["images"].as_array().map(Vec::len),
        cells: cells(&run["surface"]),
        residual_px: run["pointing"]["residual_after_px"].as_f64(),
        accuracy: accuracy(&errors["metrics"]),
        seconds,
        links: links.map(|(path, title)| PageLink::new(format!("{beside}/{path}"), *title)).collect(),
    }
}

/// Returns the number of cells and the shares of them that were observed and filled.
fn cells(surface: &Value) -> Option<(usize, f64, f64)> {
    let count = |name: &str| surface[name].as_u64();
    let cells = count("cells").filter(|cells| *cells > 0)?;
    let share = |name: &str| Some(count(name)? as f64 / cells as f64);
    Some((usize::try_from(cells).ok()?, share("observed")?, share("filled")?))
}

/// Returns the errors of an evaluation; `None` without one.
fn accuracy(metrics: &Value) -> Option<BatchAccuracy> {
    let number = |name: &str| metrics[name].as_f64();
    metrics.is_object().then(|| BatchAccuracy {
        mae_m: number("mae"),
        nmad_m: number("nmad"),
        within_1_m: number("completeness_1"),
    })
}
