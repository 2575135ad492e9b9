//! The satellite images of tiles: which of them reach a tile, and how far aside from it things can
//! stand that hide it.

use std::path::PathBuf;

use camera::{RpcCamera, ViewDirection};
use formats::raster::ImageSource;
use geodesy::LonLatHeight;
use numeric::Progress;

use super::error::TilesError;
use job::corrections::Corrections;

/// Satellite images with their cameras.
pub(super) struct Satellites {
    images: Vec<Satellite>,
}

struct Satellite {
    path: PathBuf,
    camera: RpcCamera,
    /// Columns and rows.
    size: [f64; 2],
}

impl Satellites {
    pub(super) fn open(
        paths: &[PathBuf],
        corrections: &Corrections,
        progress: &dyn Progress,
    ) -> Result<Self, TilesError> {
        let open = |path: &PathBuf| {
            let info = ImageSource::open(path)?.info().clone();
            let camera = corrections.camera(path, progress)?;
            Ok(Satellite { path: path.clone(), camera, size: [info.width as f64, info.height as f64] })
        };
        Ok(Self { images: paths.iter().map(open).collect::<Result<_, TilesError>>()? })
    }

    /// Returns the images that show at least one of some ground points.
    pub(super) fn that_reach(&self, ground: &[LonLatHeight]) -> Vec<PathBuf> {
        let shows = |image: &&Satellite| {
            ground.iter().any(|point| {
                let at = image.camera.project(*point).ok();
                at.is_some_and(|at| {
                    (0.0..image.size[0]).contains(&at.sample) && (0.0..image.size[1]).contains(&at.line)
                })
            })
        };
        self.images.iter().filter(shows).map(|image| image.path.clone()).collect()
    }

    /// Returns the direction from a ground point towards the sensor of an image.
    pub(super) fn towards(&self, path: &PathBuf, ground: LonLatHeight) -> Option<ViewDirection> {
        let image = self.images.iter().find(|image| image.path == *path)?;
        image.camera.view_direction(ground).ok()
    }

    /// Returns how many metres aside a line of sight moves per metre of height, at most.
    pub(super) fn slant(&self, paths: &[PathBuf], ground: LonLatHeight) -> f64 {
        let views = paths.iter().filter_map(|path| self.towards(path, ground));
        views.map(|view| view.east.hypot(view.north) / view.up).fold(0.0, f64::max)
    }
}
