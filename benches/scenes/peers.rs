//! Results of other programs on the same images.
//!
//! `benches/results/peers.json` is written by `benches/peers/peers.sh` and names its sources;
//! `benches/results/cars.json` is written by `benches/peers/cars/run.sh`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::scenes;

/// One result of another program.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Peer {
    pub(crate) tool: String,
    /// `jax_068`, or a simulated scene's name.
    pub(crate) scene: String,
    /// Description of its input.
    pub(crate) input: String,
    /// Numbers of the views used in `jax_068`. Empty for a simulated scene, of which all views are
    /// used.
    #[serde(default)]
    pub(crate) views: Vec<usize>,
    /// Whether voids were filled afterwards.
    #[serde(default)]
    pub(crate) filled: bool,
    /// User seconds; none where the source gives none.
    pub(crate) cpu_s: Option<f64>,
    /// Restriction that applies to the processor time, such as a range.
    #[serde(default)]
    pub(crate) cpu_note: String,
    /// Megapixels of all images together. Computed from the images where the file does not give
    /// them.
    pub(crate) megapixels: Option<f64>,
    pub(crate) mae: f64,
    pub(crate) rmse: f64,
    pub(crate) nmad: f64,
    /// Shares of all reference cells, 0 to 1.
    pub(crate) completeness_1: f64,
    pub(crate) valid_ratio: f64,
}

#[derive(Deserialize)]
struct File {
    entries: Vec<Peer>,
    /// User seconds of each tool on the scenes without a measured truth.
    #[serde(default)]
    cpu_s: BTreeMap<String, BTreeMap<String, f64>>,
}

fn read(path: &Path) -> anyhow::Result<Option<File>> {
    if !path.is_file() {
        return Ok(None);
    }
    Ok(Some(serde_json::from_str(&std::fs::read_to_string(path)?)?))
}

/// Returns the user seconds of S2P by scene.
pub(crate) fn s2p_cpu_s(root: &Path) -> anyhow::Result<BTreeMap<String, f64>> {
    let known = read(&root.join("benches/results/peers.json"))?.map(|file| file.cpu_s).unwrap_or_default();
    Ok(known.into_iter().filter_map(|(scene, tools)| Some((scene, *tools.get("S2P")?))).collect())
}

/// Returns every known result on `jax_068` and on simulated scenes.
pub(crate) fn all(root: &Path, data: &Path) -> anyhow::Result<Vec<Peer>> {
    let mut peers = Vec::new();
    for name in ["benches/results/peers.json", "benches/results/cars.json"] {
        peers.extend(read(&root.join(name))?.into_iter().flat_map(|file| file.entries));
    }
    for peer in &mut peers {
        let images = scenes::jax_images(data, &peer.views);
        if peer.megapixels.is_none() && !images.is_empty() && images.iter().all(|image| image.is_file()) {
            peer.megapixels = Some(scenes::megapixels(&images)?);
        }
    }
    Ok(peers)
}
