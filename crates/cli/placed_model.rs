//! A COLMAP model in its place on a map: with the `origin.json` beside it that `skysweep align` and `groundview` write.

use std::path::Path;

use anyhow::{Context, ensure};
use io::colmap::ColmapModel;
use io::splat_ply::LocalOrigin;

/// Reads the cameras of a model, moved to positions that are counted from `here`.
pub(crate) fn read(folder: &Path, here: &LocalOrigin) -> anyhow::Result<ColmapModel> {
    let mut model = io::colmap::read(folder)?;
    let path = folder.join("origin.json");
    let text = std::fs::read_to_string(&path).with_context(|| {
        format!("the model has no origin on a map: bring it there with skysweep align: {}", path.display())
    })?;
    let origin: LocalOrigin = serde_json::from_str(&text)
        .with_context(|| format!("not an origin as skysweep writes it: {}", path.display()))?;
    ensure!(
        origin.crs == here.crs && origin.vertical == here.vertical,
        "the cameras are in {} above the {}, the surface is in {} above the {}: align them there (skysweep align --crs)",
        origin.crs,
        origin.vertical,
        here.crs,
        here.vertical
    );
    let shift = [0, 1, 2].map(|i| origin.origin[i] - here.origin[i]);
    for view in &mut model.views {
        view.pose.centre = [0, 1, 2].map(|i| view.pose.centre[i] + shift[i]);
    }
    Ok(model)
}
