//! Runs the tiles job.

use std::path::{Path, PathBuf};
use std::time::Instant;

use formats::positions::read_positions;
use geodesy::{EnuFrame, LonLatHeight};
use numeric::Progress;
use raster::Window;

use super::config::TilesConfig;
use super::error::TilesError;
use super::manifest::{
    GroundCameraInTile, SatelliteInTile, TileFate, TileManifest, TileRecord, TilesReport, shares, turned,
};
use super::picture;
use super::satellite::Satellites;
use crate::camera_stand::{CameraStand, Cameras};
use crate::heightmap::{HeightMapConfig, TileMaker};
use crate::ortho::{self, OrthoConfig};
use job::corrections::Corrections;
use job::error::JobError;
use job::error_text::with_causes;
use job::files;
use job::output_folder::OutputFolder;
use job::report_page;
use job::run_folder::surface_file;
use job::threads;

/// List of the tiles.
const LIST: &str = "tiles.json";
/// Description of a tile.
const TILE: &str = "tile.json";
/// Name of the tile of a single camera.
const ONLY: &str = "tile";
/// Points along each side of the lattice at which images are looked for.
const LATTICE: usize = 5;
/// Times that the surface around a tile may be widened: each time it holds the tallest thing that
/// was found so far.
const ROUNDS: usize = 4;

/// Makes tiles.
///
/// # Errors
/// [`JobError`]: a source, list or image that cannot be read, folders in the way, a single tile
/// that cannot be made. A tile of a list that cannot be made is a failed position of the report.
pub fn run(config: &TilesConfig, progress: &dyn Progress) -> Result<TilesReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &TilesConfig, progress: &dyn Progress) -> Result<TilesReport, TilesError> {
    config.validate()?;
    threads::install(config.maps.threads, || {
        let begun = Instant::now();
        let folder = OutputFolder::take(&config.maps.output)?;
        let images = images(config)?;
        let stands = stands(&config.maps)?;
        let maps = HeightMapConfig { source: surface_file(&config.maps.source), ..config.maps.clone() };
        let corrections = Corrections::for_surface(&config.maps.source, &config.corrections)?;
        let satellites = Satellites::open(&images, &corrections, progress)?;
        let maker = TileMaker::open(&maps, progress)?;
        let work = Work { config, images: &images, corrections: &corrections, satellites, maker, folder, stands };
        progress.begin("tiles", work.stands.len());
        let mut tiles = Vec::with_capacity(work.stands.len());
        for (id, stand) in &work.stands {
            progress.check_cancelled()?;
            let fate = match stand {
                Err(reason) => TileFate::Failed { reason: reason.clone() },
                Ok(stand) => work.fate(id, stand, progress)?,
            };
            tiles.push(TileRecord { id: id.clone(), fate });
            progress.step();
        }
        let count = |wanted: fn(&TileFate) -> bool| tiles.iter().filter(|r| wanted(&r.fate)).count();
        let report = TilesReport {
            made: count(|fate| matches!(fate, TileFate::Made)),
            kept: count(|fate| matches!(fate, TileFate::Kept)),
            failed: count(|fate| matches!(fate, TileFate::Failed { .. })),
            seconds: begun.elapsed().as_secs_f64(),
            images: images.clone(),
            tiles,
            written: config.maps.output.join(LIST),
        };
        let lead = format!("{} tiles of height maps and orthos around cameras.", report.tiles.len());
        let layers = picture::layers(&config.maps.output, &report, 1.0 / config.maps.resolution_px_per_m)?;
        report_page::write(&report.written, ("Tiles", &lead), &report, layers, true)?;
        Ok(report)
    })?
}

/// Returns the images of the configuration, or else those of the run that made the surface.
fn images(config: &TilesConfig) -> Result<Vec<PathBuf>, TilesError> {
    if !config.images.is_empty() {
        return Ok(config.images.clone());
    }
    match Corrections::images_of_run(&config.maps.source)? {
        none if none.is_empty() => Err(TilesError::NoImages { source_path: config.maps.source.clone() }),
        images => Ok(images),
    }
}

/// Camera positions with their identifiers; the reason where a row cannot be used.
type Stands = Vec<(String, Result<CameraStand, String>)>;

/// Returns the cameras of a configuration.
fn stands(maps: &HeightMapConfig) -> Result<Stands, TilesError> {
    Ok(match maps.stand.cameras()? {
        Cameras::One(stand) => vec![(ONLY.to_owned(), Ok(stand))],
        Cameras::List(list) => read_positions(list)?
            .into_iter()
            .map(|row| (row.id, row.position.map(|position| maps.stand.of_row(&position))))
            .collect(),
    })
}

/// What every tile needs.
struct Work<'a> {
    config: &'a TilesConfig,
    images: &'a [PathBuf],
    corrections: &'a Corrections,
    satellites: Satellites,
    maker: TileMaker,
    folder: OutputFolder,
    stands: Stands,
}

impl Work<'_> {
    /// Makes a tile, or keeps it. Only a cancelled job and a folder in the way end the run, and for
    /// a single camera every reason.
    fn fate(&self, id: &str, stand: &CameraStand, progress: &dyn Progress) -> Result<TileFate, TilesError> {
        let request = self.request(stand);
        let path = self.folder.path().join(id);
        self.folder.require_own(id, &is_of_tile)?;
        if !self.config.maps.overwrite && path.symlink_metadata().is_ok() {
            let same = request_of(&path.join(TILE)).is_some_and(|found| found == request);
            return if same { Ok(TileFate::Kept) } else { Err(TilesError::OtherTile { path }) };
        }
        let made = self.make(id, stand, request, progress);
        progress.check_cancelled()?;
        match made {
            Ok(()) => Ok(TileFate::Made),
            Err(error) if !self.config.maps.stand.is_list() => Err(error),
            Err(error) => Ok(TileFate::Failed { reason: with_causes(&error) }),
        }
    }

    /// Returns a number for the tile that is asked for: tiles with the same number are the same.
    fn request(&self, stand: &CameraStand) -> String {
        let images: Vec<_> = self.images.iter().map(|path| (path, self.corrections.find(path))).collect();
        self.maker.request(stand, &format!("{images:?}; {:?}", self.config.mosaic))
    }

    /// Makes a tile in a work folder, and moves it to its name.
    fn make(&self, id: &str, stand: &CameraStand, request: String, progress: &dyn Progress) -> Result<(), TilesError> {
        let work = self.folder.work_folder()?;
        let (tile, scratch) = (work.path().join(id), work.path().join("scratch"));
        files::create_folder(&tile)?;
        files::create_folder(&scratch)?;
        let mut map = self.maker.make(stand, &tile.join("height.tif"))?;
        let camera = LonLatHeight::new(stand.lon_deg, stand.lat_deg, map.tags.camera_height_m);
        let ground = self.lattice(stand, map.tags.ground_height_m.unwrap_or(camera.height_m))?;
        let reaching = self.satellites.that_reach(&ground);
        if reaching.is_empty() {
            return Err(TilesError::OutsideImages { images: self.images.len() });
        }
        let wide = scratch.join("wide.tif");
        let margin = self.write_surface_around(stand, self.satellites.slant(&reaching, camera), &wide)?;
        let mut config = OrthoConfig::new(reaching, wide, scratch.join("ortho.tif"));
        config.mosaic = self.config.mosaic;
        let size = self.config.maps.size_px;
        let window = Window { x: margin as i64, y: margin as i64, width: size, height: size };
        let ortho = ortho::run_in_window(&config, window, self.corrections, progress)?;
        for (made, name) in [(&ortho.ortho, "ortho.tif"), (&ortho.mask, "ortho_mask.tif")] {
            files::move_to(made, &tile.join(name))?;
        }
        let picture_range = picture::write(&tile.join("ortho.tif"), &tile.join("ortho.png"))?;
        map.path = "height.tif".into();
        let satellites = ortho.images.iter().filter_map(|part| {
            let view = self.satellites.towards(&part.path, camera)?;
            Some(SatelliteInTile::new(part.clone(), view, stand))
        });
        let manifest = TileManifest {
            id: id.to_owned(),
            size_px: size,
            ortho: "ortho.tif".into(),
            ortho_mask: "ortho_mask.tif".into(),
            picture: "ortho.png".into(),
            picture_range,
            seen_hidden_outside_void: shares(&ortho),
            ground_cameras: self.ground_cameras(id, stand, camera)?,
            satellites: satellites.collect(),
            height_map: map,
            request,
        };
        files::write_json(&tile.join(TILE), &manifest, false)?;
        self.folder.remove_folder(id, &is_of_tile)?;
        Ok(self.folder.publish(work.path(), id)?)
    }

    /// Returns ground points all over a tile, at a height above the ellipsoid.
    fn lattice(&self, stand: &CameraStand, height_m: f64) -> Result<Vec<LonLatHeight>, TilesError> {
        let step = (self.config.maps.size_px as f64 - 1.0) / (LATTICE - 1) as f64;
        let at = |i: usize| (i % LATTICE, i / LATTICE);
        let pixels: Vec<[f64; 2]> =
            (0..LATTICE * LATTICE).map(at).map(|(c, r)| [c as f64 * step, r as f64 * step]).collect();
        let points = self.maker.lonlat(stand, &pixels)?;
        Ok(points.into_iter().map(|[lon, lat]| LonLatHeight::new(lon, lat, height_m)).collect())
    }

    /// Writes the surface of a tile and of what lies around it, as far as the tallest thing there
    /// can hide the tile. Returns the margin in pixels.
    fn write_surface_around(&self, stand: &CameraStand, slant: f64, path: &Path) -> Result<usize, TilesError> {
        let HeightMapConfig { size_px, resolution_px_per_m, .. } = self.config.maps;
        let reach = |height_m: f64| (height_m * slant * resolution_px_per_m).ceil() as usize + 1;
        // What stands beside a flat tile may be tall, too.
        let mut margin = size_px / 4;
        for _ in 0..ROUNDS {
            let needed = reach(self.maker.write_surface(stand, size_px + 2 * margin, path)?);
            if needed <= margin {
                break;
            }
            margin = needed;
        }
        Ok(margin)
    }

    /// Returns the cameras of the list that stand on a tile, its own first.
    fn ground_cameras(
        &self,
        id: &str,
        stand: &CameraStand,
        camera: LonLatHeight,
    ) -> Result<Vec<GroundCameraInTile>, TilesError> {
        let frame = EnuFrame::new(camera);
        let known: Vec<(&String, &CameraStand)> =
            self.stands.iter().filter_map(|(other, stand)| Some((other, stand.as_ref().ok()?))).collect();
        let places: Vec<[f64; 2]> = known.iter().map(|(_, stand)| [stand.lon_deg, stand.lat_deg]).collect();
        let pixels = self.maker.pixels(stand, &places)?;
        let side = -0.5..=self.config.maps.size_px as f64 - 0.5;
        let mut found = Vec::new();
        for ((other, place), pixel) in known.into_iter().zip(pixels) {
            let own = other == id;
            if !own && !pixel.iter().all(|p| side.contains(p)) {
                continue;
            }
            let height_m = if own { Some(camera.height_m) } else { place.height_m };
            let at = LonLatHeight::new(place.lon_deg, place.lat_deg, height_m.unwrap_or(camera.height_m));
            let enu = frame.enu_from_ground(at);
            let turn = (place.heading_deg - stand.heading_deg).rem_euclid(360.0);
            let entry = GroundCameraInTile {
                id: other.clone(),
                lon_deg: place.lon_deg,
                lat_deg: place.lat_deg,
                height_m,
                heading_deg: place.heading_deg,
                pixel,
                right_forward_m: turned([enu.east, enu.north], stand.heading_deg),
                up_m: height_m.map(|_| enu.up),
                relative_heading_deg: if turn > 180.0 { turn - 360.0 } else { turn },
            };
            if own { found.insert(0, entry) } else { found.push(entry) }
        }
        Ok(found)
    }
}

/// Whether a tile has a file of this name.
fn is_of_tile(name: &str) -> bool {
    ["height.tif", "ortho.tif", "ortho_mask.tif", "ortho.png", "ortho.pgw", TILE].contains(&name)
}

/// Returns the request number of a tile's description.
fn request_of(path: &Path) -> Option<String> {
    let text = files::read_text(path).ok()?;
    let value: serde_json::Value = serde_json::from_str(&text).ok()?;
    Some(value.get("request")?.as_str()?.to_owned())
}
