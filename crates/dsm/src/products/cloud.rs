//! The coloured point cloud.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use classes::{BUILDING, GROUND, LOW_VEGETATION, VEGETATION, WATER};
use formats::points::{CloudExtent, CloudFormat, SurfaceCloud, write_cloud};
use numeric::Progress;
use raster::Grid;
use serde::Serialize;

use super::error::ProductsError;
use super::scene::SurfaceOfRun;
use job::files::FileError;
use job::output_folder::OutputFolder;

/// Files of the cloud.
pub(super) const FILES: [(&str, CloudFormat); 2] =
    [("cloud.laz", CloudFormat::Laz), ("cloud.copc.laz", CloudFormat::Copc)];
/// Class of LAS for points without another one.
const UNCLASSIFIED: u8 = 1;
/// Code of observed cells in `source.tif`.
const OBSERVED: u8 = 1;

/// A point cloud that was made.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct CloudReport {
    /// LAZ file.
    pub laz: PathBuf,
    /// COPC file with the same points.
    pub copc: PathBuf,
    /// Reference system of the points.
    pub crs: String,
    /// Points of the class ground, where there is a terrain model.
    pub ground_points: Option<u64>,
    /// Points of each LAS class.
    pub class_points: BTreeMap<u8, u64>,
    /// Number and extent of the points.
    #[serde(flatten)]
    pub extent: CloudExtent,
}

/// Rasters that tell the classes of points, where they were made.
pub(super) struct ClassSources<'a> {
    /// States of the terrain model.
    pub(super) ground: Option<&'a Path>,
    /// Classes of the cells.
    pub(super) classes: Option<&'a Path>,
}

/// Makes both files.
pub(super) fn make(
    surface: &SurfaceOfRun,
    colours: &Grid<[u16; 3]>,
    sources: &ClassSources<'_>,
    filled: bool,
    folder: &OutputFolder,
    progress: &dyn Progress,
) -> Result<CloudReport, ProductsError> {
    progress.begin("point cloud", FILES.len());
    let (width, height) = surface.size();
    let ground = sources.ground.map(|path| surface.raster(path)).transpose()?;
    let known = sources.classes.map(|path| surface.raster(path)).transpose()?;
    let mut classes = Grid::filled(width, height, UNCLASSIFIED);
    for (at, class) in classes.data_mut().iter_mut().enumerate() {
        let state = ground.as_ref().map(|ground| ground.data()[at] == 1.0);
        *class = point_class(known.as_ref().map(|known| known.data()[at] as u8), state);
    }
    let (sigma_m, confidence) = (surface.layer("sigma.tif")?, surface.layer("confidence.tif")?);
    let (views, source) = (surface.codes("views.tif")?, surface.codes("source.tif")?);
    let cloud = SurfaceCloud {
        geotransform: surface.dem.geotransform,
        crs: surface.crs,
        in_degrees: surface.projection.metres_per_unit().is_none(),
        heights: &surface.dem.heights,
        sigma_m: &sigma_m,
        confidence: &confidence,
        views: &views,
        source: &source,
        colours,
        classes: &classes,
        observed_only: !filled,
        created: SystemTime::now(),
    };
    let work = folder.work_folder()?;
    let mut extent = None;
    for (name, format) in FILES {
        progress.check_cancelled()?;
        extent = Some(write_cloud(&work.path().join(name), &cloud, format, false).map_err(FileError::from)?);
        progress.step();
    }
    for (name, _) in FILES {
        folder.remove(name)?;
        folder.publish(work.path(), name)?;
    }
    let is_point =
        |cell: usize| surface.dem.heights.data()[cell].is_finite() && (filled || source.data()[cell] == OBSERVED);
    let mut class_points = BTreeMap::new();
    for cell in (0..width * height).filter(|cell| is_point(*cell)) {
        *class_points.entry(classes.data()[cell]).or_insert(0) += 1;
    }
    let ground_points = ground.map(|_| class_points.get(&GROUND).copied().unwrap_or(0));
    let [laz, copc] = FILES.map(|(name, _)| folder.path().join(name));
    let extent = extent.unwrap_or(CloudExtent { points: 0, synthetic: 0, low: [0.0; 3], high: [0.0; 3] });
    Ok(CloudReport { laz, copc, crs: surface.crs.to_string(), ground_points, class_points, extent })
}

/// Returns the LAS class of a point, from the class of its cell and from whether the terrain model
/// shows the ground there. What stands beside the ground without being anything is unclassified.
fn point_class(class: Option<u8>, is_ground: Option<bool>) -> u8 {
    match (class, is_ground) {
        (Some(code @ (LOW_VEGETATION | VEGETATION | BUILDING | WATER)), _) => code,
        (Some(GROUND), None) | (_, Some(true)) => GROUND,
        _ => UNCLASSIFIED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_classes_of_their_cells_and_ground_is_what_the_terrain_shows() {
        for code in [LOW_VEGETATION, VEGETATION, BUILDING, WATER] {
            assert_eq!(point_class(Some(code), Some(true)), code);
        }
        assert_eq!(point_class(Some(GROUND), Some(false)), UNCLASSIFIED);
        assert_eq!([point_class(Some(GROUND), None), point_class(None, Some(true))], [GROUND, GROUND]);
        assert_eq!([point_class(None, None), point_class(Some(0), None)], [UNCLASSIFIED, UNCLASSIFIED]);
    }
}
