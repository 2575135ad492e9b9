//! The coloured point cloud.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use io::points::{CloudExtent, CloudFormat, SurfaceCloud, write_cloud};
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
/// Classes of LAS.
const GROUND: u8 = 2;
const UNCLASSIFIED: u8 = 1;

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
    /// Number and extent of the points.
    #[serde(flatten)]
    pub extent: CloudExtent,
}

/// Makes both files. `ground` is the raster of the states of the terrain model.
pub(super) fn make(
    surface: &SurfaceOfRun,
    colours: &Grid<[u16; 3]>,
    ground: Option<&Path>,
    filled: bool,
    folder: &OutputFolder,
    progress: &dyn Progress,
) -> Result<CloudReport, ProductsError> {
    progress.begin("point cloud", FILES.len());
    let (width, height) = surface.size();
    let classes = match ground {
        Some(path) => surface.raster(path)?.map(|state| if *state == 1.0 { GROUND } else { UNCLASSIFIED }),
        None => Grid::filled(width, height, UNCLASSIFIED),
    };
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
    let is_ground = |cell: usize| {
        classes.data()[cell] == GROUND
            && surface.dem.heights.data()[cell].is_finite()
            && (filled || source.data()[cell] == 1)
    };
    let ground_points = ground.map(|_| (0..width * height).filter(|&cell| is_ground(cell)).count() as u64);
    let [laz, copc] = FILES.map(|(name, _)| folder.path().join(name));
    let extent = extent.unwrap_or(CloudExtent { points: 0, synthetic: 0, low: [0.0; 3], high: [0.0; 3] });
    Ok(CloudReport { laz, copc, crs: surface.crs.to_string(), ground_points, extent })
}
