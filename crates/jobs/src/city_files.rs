//! City model files among the inputs of a job.

use std::path::Path;

/// Returns whether a file is a city model, by its ending. The readers look at the content.
pub(crate) fn is_city_model(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["json", "jsonl", "gml", "xml", "obj", "ply", "cityjson", "citygml"].contains(&ending.as_str())
}
