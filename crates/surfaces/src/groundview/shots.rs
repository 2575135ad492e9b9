//! Lays out the cameras: the cameras of a COLMAP model, or panoramas with their crops.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use camera::{Lens, Pose};
use formats::positions::read_positions;
use groundview::{Panorama, level_pose};

use super::config::{GroundCameras, GroundViewConfig};
use super::error::GroundViewError;
use super::report::GroundViewFailure;
use super::view_surface::ViewSurface;
use crate::camera_stand::{CameraStand, Cameras, StandConfig};
use job::error_text::with_causes;
use job::files;
use job::placed_model;

/// Endings of the pictures of panoramas, in the order of preference.
const ENDINGS: [&str; 7] = ["png", "jpg", "jpeg", "tif", "tiff", "PNG", "JPG"];

/// All views that are rendered.
pub(super) struct Shots {
    /// Lenses of the perspective cameras.
    pub(super) lenses: Vec<Lens>,
    /// Pixels of every panorama.
    pub(super) panorama: Panorama,
    /// The views.
    pub(super) shots: Vec<Shot>,
    /// Rows of the list without a view.
    pub(super) failed: Vec<GroundViewFailure>,
}

/// A camera in its place.
pub(super) struct Shot {
    /// Name of its files, without folder and ending.
    pub(super) stem: String,
    /// Name of its image in the COLMAP model.
    pub(super) name: String,
    /// Index of its lens; `None` for a panorama.
    pub(super) lens: Option<usize>,
    /// Position and direction, metres from the origin.
    pub(super) pose: Pose,
    /// Picture that it is cut from, and its turn from the middle of the picture, degrees.
    pub(super) picture: Option<(PathBuf, f64)>,
}

impl Shots {
    /// Lays out the views of a configuration.
    pub(super) fn of(config: &GroundViewConfig, surface: &ViewSurface) -> Result<Self, GroundViewError> {
        let panorama = Panorama { width: config.panorama_width_px, height: config.panorama_width_px / 2 };
        let stand = match &config.cameras {
            GroundCameras::Model(folder) => return Self::of_model(folder, surface, panorama),
            GroundCameras::Panoramas(stand) => stand,
        };
        let lenses = vec![Panorama::crop_lens(config.crop_size_px, config.crop_fov_deg)?];
        let mut made = Self { lenses, panorama, shots: Vec::new(), failed: Vec::new() };
        match stand.cameras()? {
            Cameras::One(at) => made.add_panorama(config, stand, surface, "panorama", &at)?,
            Cameras::List(list) => made.add_list(config, stand, surface, list)?,
        }
        Ok(made)
    }

    /// Adds the rows of a list. A row without a view is noted as failed.
    fn add_list(
        &mut self,
        config: &GroundViewConfig,
        stand: &StandConfig,
        surface: &ViewSurface,
        list: &Path,
    ) -> Result<(), GroundViewError> {
        for row in read_positions(list)? {
            let added = match &row.position {
                Ok(position) => self
                    .add_panorama(config, stand, surface, &row.id, &stand.of_row(position))
                    .map_err(|error| with_causes(&error)),
                Err(reason) => Err(reason.clone()),
            };
            self.failed.extend(added.err().map(|reason| GroundViewFailure { id: row.id, reason }));
        }
        Ok(())
    }

    /// Lays out the cameras of a COLMAP model.
    fn of_model(folder: &Path, surface: &ViewSurface, panorama: Panorama) -> Result<Self, GroundViewError> {
        let model = placed_model::read(folder, &surface.local_origin()).map_err(GroundViewError::PlacedModel)?;
        let mut taken = HashSet::new();
        let mut shots = Vec::with_capacity(model.views.len());
        for view in model.views {
            let stem = files::flat_stem(&view.name);
            if !taken.insert(stem.clone()) {
                return Err(GroundViewError::SameName { stem });
            }
            shots.push(Shot { stem, name: view.name, lens: Some(view.lens), pose: view.pose, picture: None });
        }
        Ok(Self { lenses: model.lenses, panorama, shots, failed: Vec::new() })
    }

    /// Adds a panorama and its crops.
    fn add_panorama(
        &mut self,
        config: &GroundViewConfig,
        stand: &StandConfig,
        surface: &ViewSurface,
        id: &str,
        at: &CameraStand,
    ) -> Result<(), GroundViewError> {
        let map = surface.projection.map_from_lonlat(at.lon_deg, at.lat_deg)?;
        // Grid north and true north differ by the convergence of the map at the camera.
        let north = surface.projection.map_from_lonlat(at.lon_deg, at.lat_deg + 1e-4)?;
        let north_deg = (north.x - map.x).atan2(north.y - map.y).to_degrees();
        let heading = at.heading_deg;
        if !heading.is_finite() {
            return Err(GroundViewError::Heading { heading_deg: heading });
        }
        let (x, y) = (map.x - surface.origin[0], map.y - surface.origin[1]);
        let z = match at.height_m {
            Some(height) => height - surface.origin[2],
            None => surface.ground_at(x, y).ok_or(GroundViewError::NoGround)? + stand.ground_offset_m,
        };
        if !z.is_finite() {
            return Err(GroundViewError::CameraHeight { height_m: z });
        }
        let picture = config.pictures.as_deref().map(|folder| picture(folder, id)).transpose()?;
        let shot = |stem: String, lens: Option<usize>, turn: f64| Shot {
            name: format!("{stem}.png"),
            stem,
            lens,
            pose: level_pose([x, y, z], heading + north_deg + turn),
            picture: picture.as_ref().filter(|_| lens.is_some()).map(|path| (path.clone(), turn)),
        };
        self.shots.push(shot(id.to_owned(), None, 0.0));
        for k in 0..config.crops {
            let turn = 360.0 * k as f64 / config.crops as f64;
            self.shots.push(shot(format!("{id}_{k:03}"), Some(0), turn));
        }
        Ok(())
    }
}

/// Finds the picture of a panorama.
fn picture(folder: &Path, id: &str) -> Result<PathBuf, GroundViewError> {
    let found = ENDINGS.iter().map(|ending| folder.join(format!("{id}.{ending}"))).find(|path| path.is_file());
    found.ok_or_else(|| GroundViewError::NoPicture { id: id.to_owned(), folder: folder.to_owned() })
}
