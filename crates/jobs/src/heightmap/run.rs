//! Runs the height map job for one camera or for a list.

use numeric::Progress;

use super::config::HeightMapConfig;
use super::error::HeightMapJobError;
use super::list;
use super::maker::Maker;
use super::report::{HeightMapMade, HeightMapReport};
use crate::camera_stand::{CameraStand, Cameras};
use crate::run_folder::surface_file;
use crate::{files, threads};

/// Makes one height map, or one for each row of a list.
///
/// # Errors
/// [`HeightMapJobError`]: a source or list that cannot be read, a single map that cannot be made,
/// files in the way. For a list, a map that cannot be made is a failed row of the report.
///
/// ```
/// use jobs::camera_stand::{StandConfig, StandSource};
/// use jobs::heightmap::{HeightMapConfig, run};
/// use numeric::Silent;
///
/// let dsm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/dsm.tif");
/// let folder = tempfile::tempdir()?;
/// let map = folder.path().join("map.tif");
/// let stand = StandConfig::new(StandSource::Position { lon_deg: 5.4, lat_deg: 43.53 });
/// let mut config = HeightMapConfig::new(dsm.into(), map.clone(), stand);
/// config.size_px = 64;
/// run(&config, &Silent)?;
/// assert!(map.is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &HeightMapConfig, progress: &dyn Progress) -> Result<HeightMapReport, HeightMapJobError> {
    config.validate()?;
    let config = &HeightMapConfig { source: surface_file(&config.source), ..config.clone() };
    threads::install(config.threads, || match config.stand.cameras()? {
        Cameras::One(stand) => one(config, &stand, progress).map(|made| HeightMapReport::One(Box::new(made))),
        Cameras::List(positions) => list::run(config, positions, progress).map(HeightMapReport::List),
    })?
}

/// Makes the map of one camera.
fn one(
    config: &HeightMapConfig,
    stand: &CameraStand,
    progress: &dyn Progress,
) -> Result<HeightMapMade, HeightMapJobError> {
    files::check_raster_destination(&config.output, config.overwrite)?;
    let maker = Maker::open(config, progress)?;
    progress.check_cancelled()?;
    let laid = maker.source.lay(&maker.settings, &[*stand]).pop().ok_or(HeightMapJobError::WorkerLost)??;
    maker.finish(stand, laid, &config.output)
}
