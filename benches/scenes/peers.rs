//! What other programs make of the same images: `benches/peers/peers.json` (with where its numbers come from), and the results
//! that `benches/peers/cars/run.sh` left in `benches/results/cars.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::scenes;

/// One result of another program.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Peer {
    pub(crate) tool: String,
    /// `jax_068`, or a simulated scene's name.
    pub(crate) scene: String,
    /// What it was given, in words.
    pub(crate) input: String,
    /// Numbers of the views used in `jax_068`; all of a simulated scene.
    #[serde(default)]
    pub(crate) views: Vec<usize>,
    pub(crate) cpu_s: f64,
    /// What must be known of the processor time.
    #[serde(default)]
    pub(crate) cpu_note: String,
    /// Of all images together; from the images where the file does not say.
    pub(crate) megapixels: Option<f64>,
    pub(crate) mae: f64,
    pub(crate) rmse: f64,
    pub(crate) nmad: f64,
    /// Shares of the reference's cells.
    pub(crate) completeness_1: f64,
    pub(crate) valid_ratio: f64,
}

#[derive(Deserialize)]
struct File {
    entries: Vec<Peer>,
}

/// All that is known.
pub(crate) fn all(root: &Path, data: &Path) -> anyhow::Result<Vec<Peer>> {
    let mut peers = Vec::new();
    for name in ["benches/peers/peers.json", "benches/results/cars.json"] {
        let path = root.join(name);
        if path.is_file() {
            let file: File = serde_json::from_str(&std::fs::read_to_string(&path)?)?;
            peers.extend(file.entries);
        }
    }
    for peer in &mut peers {
        let images = scenes::jax_images(data, &peer.views);
        if peer.megapixels.is_none() && !images.is_empty() && images.iter().all(|image| image.is_file()) {
            peer.megapixels = Some(scenes::megapixels(&images)?);
        }
    }
    Ok(peers)
}
