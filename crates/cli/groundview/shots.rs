//! The cameras: those of a COLMAP model, or panoramas with their crops.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use camera::{Lens, Pose};
use groundview::{Panorama, level_pose};
use io::positions::read_positions;
use serde::Serialize;

use super::MakeArgs;
use super::surface::Surface;
use crate::stand::Stand;
use jobs::placed_model;

/// Most columns of a panorama and pixels along a crop.
const SIDE_MAX: usize = 16_384;
/// Endings of pictures of panoramas.
const ENDINGS: [&str; 7] = ["png", "jpg", "jpeg", "tif", "tiff", "PNG", "JPG"];

/// What is rendered.
pub(super) struct Shots {
    pub(super) lenses: Vec<Lens>,
    /// The pixels of every panorama.
    pub(super) panorama: Panorama,
    pub(super) shots: Vec<Shot>,
    /// Rows of the list that give none.
    pub(super) failed: Vec<Failure>,
}

/// What was asked for and is not there.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Failure {
    pub(super) id: String,
    pub(super) reason: String,
}

/// A camera in its place.
pub(super) struct Shot {
    /// Of its files.
    pub(super) stem: String,
    /// In the COLMAP model.
    pub(super) name: String,
    /// Its lens; `None` for a panorama.
    pub(super) lens: Option<usize>,
    pub(super) pose: Pose,
    /// The picture that it is cut from, and by how much it is turned in it, degrees.
    pub(super) picture: Option<(PathBuf, f64)>,
}

impl Shots {
    pub(super) fn of(args: &MakeArgs, surface: &Surface) -> anyhow::Result<Self> {
        ensure!((2..=SIDE_MAX).contains(&args.width), "--width is {}, expected 2 to {SIDE_MAX}", args.width);
        let panorama = Panorama { width: args.width, height: args.width / 2 };
        if let Some(folder) = &args.cameras {
            return Self::of_model(folder, surface, panorama);
        }
        ensure!(
            (1..=SIDE_MAX).contains(&args.crop_size),
            "--crop-size is {}, expected 1 to {SIDE_MAX}",
            args.crop_size
        );
        ensure!(args.fov > 0.0 && args.fov < 180.0, "--fov is {}, expected degrees between 0 and 180", args.fov);
        ensure!(args.crops <= 360, "--crops is {}, at most 360", args.crops);
        let lenses = vec![Panorama::crop_lens(args.crop_size, args.fov)?];
        let mut made = Self { lenses, panorama, shots: Vec::new(), failed: Vec::new() };
        match (args.stand.single()?, &args.stand.positions) {
            (Some(stand), _) => made.add_panorama(args, surface, "panorama", &stand)?,
            (_, Some(list)) => made.add_list(args, surface, list)?,
            _ => bail!("no cameras: give --cameras FOLDER, --center LON LAT, --camera FILE or --positions FILE"),
        }
        Ok(made)
    }

    /// Adds the rows of a list; one that gives no view is noted and left out.
    fn add_list(&mut self, args: &MakeArgs, surface: &Surface, list: &Path) -> anyhow::Result<()> {
        for row in read_positions(list)? {
            let added = match &row.position {
                Ok(position) => self
                    .add_panorama(args, surface, &row.id, &args.stand.of_row(position))
                    .map_err(|error| format!("{error:#}")),
                Err(reason) => Err(reason.clone()),
            };
            self.failed.extend(added.err().map(|reason| Failure { id: row.id, reason }));
        }
        Ok(())
    }

    fn of_model(folder: &Path, surface: &Surface, panorama: Panorama) -> anyhow::Result<Self> {
        let model = placed_model::read(folder, &surface.local_origin())?;
        let mut taken = HashSet::new();
        let mut shots = Vec::with_capacity(model.views.len());
        for view in model.views {
            let stem = Path::new(&view.name).with_extension("").to_string_lossy().replace(['/', '\\'], "_");
            ensure!(taken.insert(stem.clone()), "two images would be written as {stem}");
            shots.push(Shot { stem, name: view.name, lens: Some(view.lens), pose: view.pose, picture: None });
        }
        Ok(Self { lenses: model.lenses, panorama, shots, failed: Vec::new() })
    }

    fn add_panorama(&mut self, args: &MakeArgs, surface: &Surface, id: &str, at: &Stand) -> anyhow::Result<()> {
        let map = surface.projection.map_from_lonlat(at.lon_deg, at.lat_deg)?;
        // True north is a little beside the north of the map.
        let north = surface.projection.map_from_lonlat(at.lon_deg, at.lat_deg + 1e-4)?;
        let north_deg = (north.x - map.x).atan2(north.y - map.y).to_degrees();
        let heading = at.heading_deg;
        ensure!(heading.is_finite(), "the heading is {heading}, expected degrees");
        let (x, y) = (map.x - surface.origin[0], map.y - surface.origin[1]);
        let z = match at.height_m {
            Some(height) => height - surface.origin[2],
            None => {
                let ground =
                    surface.height_at(x, y).context("the surface has no height under it: give --camera-height")?;
                ground + args.stand.ground_offset
            }
        };
        ensure!(z.is_finite(), "the camera's height is {z}, expected metres");
        let picture = args.pictures.as_deref().map(|folder| picture(folder, id)).transpose()?;
        let shot = |stem: String, lens: Option<usize>, turn: f64| Shot {
            name: format!("{stem}.png"),
            stem,
            lens,
            pose: level_pose([x, y, z], heading + north_deg + turn),
            picture: picture.as_ref().filter(|_| lens.is_some()).map(|path| (path.clone(), turn)),
        };
        self.shots.push(shot(id.to_owned(), None, 0.0));
        for k in 0..args.crops {
            let turn = 360.0 * k as f64 / args.crops as f64;
            self.shots.push(shot(format!("{id}_{k:03}"), Some(0), turn));
        }
        Ok(())
    }
}

fn picture(folder: &Path, id: &str) -> anyhow::Result<PathBuf> {
    let found = ENDINGS.iter().map(|ending| folder.join(format!("{id}.{ending}"))).find(|path| path.is_file());
    found.with_context(|| format!("no picture {id}.png, .jpg or .tif: {}", folder.display()))
}
