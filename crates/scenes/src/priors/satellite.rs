//! Priors for satellite images: maps in the pixels of each image, with its RPC.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use ::priors::{
    LinesOfSight, MISSING_CLASS, ModelPlace, NO_OBJECT, PriorModel, PriorsError, SatelliteMaps, buildings_of,
};
use camera::{ImageCorrection, Rpc, RpcCamera};
use city::CrsReference;
use cityfiles::CityFile;
use formats::raster::{Band, BandData, ImageSource, Provenance, write_map_with_rpc, write_png_rgb};
use numeric::Progress;
use raster::NO_DATA;
use report::{SatellitePriorsReport, SatelliteRow, ViewPictures, height_preview, normal_preview};
use serde_json::json;

use super::config::{PriorsConfig, PriorsImages};
use super::error::PriorsJobError;
use super::folder::PriorsFolder;
use super::labels::labels;
use super::model::UsableModel;
use super::notes::unusable_note;
use super::outcome::{PriorsJobReport, PriorsProduct};
use super::previews::{IN_PAGE, is_spread};
use job::corrections::Corrections;
use job::files::{self, FileError};

/// Folders of maps.
const FOLDERS: [&str; 7] = ["height", "distance", "normal", "mask", "class", "object", "previews"];

/// An image that maps are made for.
struct PriorsImage {
    path: PathBuf,
    stem: String,
    camera: RpcCamera,
    /// Columns and rows.
    size: (usize, usize),
}

/// Makes the maps of all images.
pub(super) fn make(
    config: &PriorsConfig,
    paths: &[PathBuf],
    progress: &dyn Progress,
) -> Result<PriorsJobReport, PriorsJobError> {
    let partial = PriorsFolder::take(config)?;
    let images = read_images(config, paths, progress)?;
    let read = UsableModel::read(config)?;
    let unusable = read.unusable();
    let place = place_of(config, &read.file.model.crs, progress)?;
    let mut mesh = read.meshed.mesh;
    place.to_ellipsoid(&mut mesh)?;
    let model = PriorModel::new(mesh, &buildings_of(&read.file.model))?;
    for name in FOLDERS {
        files::create_folder(&partial.path().join(name))?;
    }
    let writer = MapWriter { config, model: &model, place: &place, folder: partial.path() };
    let (rows, pictures) = writer.write_all(&images, progress)?;
    let report = report(config, &read.file, &model, &place, rows, unusable);
    let page = report.html(&pictures)?;
    formats::write_bytes(partial.path().join("report.html"), page.as_bytes(), false).map_err(FileError::from)?;
    files::write_json(&partial.path().join("labels.json"), &labels(&read.file.model, model.mesh()), false)?;
    files::write_json(&partial.path().join("report.json"), &report.json().map_err(FileError::from)?, false)?;
    let bytes = files::bytes_below(partial.path());
    partial.publish()?;
    let (product, output) = (PriorsProduct::SatelliteMaps(Box::new(report)), config.output.clone());
    Ok(PriorsJobReport { product, unusable_objects: unusable, output, bytes })
}

fn read_images(
    config: &PriorsConfig,
    paths: &[PathBuf],
    progress: &dyn Progress,
) -> Result<Vec<PriorsImage>, PriorsJobError> {
    if config.offset.is_some() || config.transform.is_some() || config.images != PriorsImages::None {
        return Err(PriorsJobError::NotPerspective);
    }
    let corrections = config.corrections.as_deref().map(Corrections::read).transpose()?.unwrap_or_default();
    let mut known: HashMap<String, &Path> = HashMap::new();
    let mut images = Vec::with_capacity(paths.len());
    for path in paths {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        // File systems that ignore case would give both the same file.
        if let Some(other) = known.insert(stem.to_lowercase(), path) {
            return Err(PriorsJobError::SameName { first: other.to_owned(), second: path.clone() });
        }
        let camera = corrections.camera(path, progress)?;
        let window = ImageSource::open(path)?.window();
        images.push(PriorsImage { path: path.clone(), stem, camera, size: (window.width, window.height) });
    }
    Ok(images)
}

/// Returns where the model lies, as its file and the configuration state it.
fn place_of(config: &PriorsConfig, crs: &CrsReference, progress: &dyn Progress) -> Result<ModelPlace, PriorsJobError> {
    let place = ModelPlace::of(crs, config.map_epsg, config.vertical).map_err(|error| match error {
        source @ PriorsError::MapUnknown { .. } => PriorsJobError::MapUnknown { source },
        other => other.into(),
    })?;
    if place.datum.is_none() {
        progress.warn("the model does not state the vertical datum of its heights, so they are taken as ellipsoidal");
    }
    Ok(place)
}

/// Renders and writes the maps of images.
struct MapWriter<'a> {
    config: &'a PriorsConfig,
    model: &'a PriorModel,
    place: &'a ModelPlace,
    folder: &'a Path,
}

impl MapWriter<'_> {
    fn write_all(
        &self,
        images: &[PriorsImage],
        progress: &dyn Progress,
    ) -> Result<(Vec<SatelliteRow>, Vec<ViewPictures>), PriorsJobError> {
        progress.begin("maps", images.len());
        let (mut rows, mut pictures) = (Vec::with_capacity(images.len()), Vec::new());
        for (number, image) in images.iter().enumerate() {
            progress.check_cancelled()?;
            let shown = |wanted| is_spread(number, images.len(), wanted);
            let in_image =
                |source| PriorsJobError::SatelliteImage { path: image.path.clone(), source: Box::new(source) };
            let lines = LinesOfSight::new(&image.camera, image.size, self.model, &self.place.projection)
                .map_err(|e| in_image(e.into()))?;
            let maps = SatelliteMaps::render(self.model, &lines).map_err(|e| in_image(e.into()))?;
            let corrected = image.camera.correction != ImageCorrection::IDENTITY;
            let rpc = if corrected {
                image.camera.folded().map_err(|e| in_image(e.into()))?.rpc
            } else {
                image.camera.rpc.clone()
            };
            self.write_maps(image, &lines, &maps, &rpc)?;
            if shown(self.config.previews) {
                let made = self.write_previews(image, &maps)?;
                pictures.extend(Some(made).filter(|_| shown(self.config.previews.min(IN_PAGE))));
            }
            rows.push(row(image, &lines, &maps, corrected));
            progress.step();
        }
        if rows.iter().all(|row| row.hit_pixels == 0) {
            return Err(nothing_in_images(self.model, self.place, images));
        }
        Ok((rows, pictures))
    }

    fn write_maps(
        &self,
        image: &PriorsImage,
        lines: &LinesOfSight,
        maps: &SatelliteMaps,
        rpc: &Rpc,
    ) -> Result<(), FileError> {
        let name = image.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let provenance = Provenance { sources: vec![name], acquired: Vec::new() };
        let write = |kind: &str, bands: &[Band<'_>], no_data: Option<f64>| {
            let path = self.folder.join(kind).join(format!("{}.tif", image.stem));
            write_map_with_rpc(path, bands, rpc, no_data, &provenance, false)
        };
        let no_data = Some(f64::from(NO_DATA));
        let from = format!("distance_from_height_{:.3}_m", lines.from_height_m());
        write("height", &[Band { description: "ellipsoidal_height_m", data: BandData::F32(&maps.height_m) }], no_data)?;
        write("distance", &[Band { description: &from, data: BandData::F32(&maps.distance_m) }], no_data)?;
        let components = [0, 1, 2].map(|i| maps.normal.map(|n| n[i]));
        let bands: Vec<Band<'_>> = ["normal_east", "normal_north", "normal_up"]
            .iter()
            .zip(&components)
            .map(|(&description, c)| Band { description, data: BandData::F32(c) })
            .collect();
        write("normal", &bands, no_data)?;
        let mask = maps.mask().map(|seen| u8::from(*seen));
        write("mask", &[Band { description: "building", data: BandData::U8(&mask) }], None)?;
        let class = [Band { description: "surface_class", data: BandData::U8(&maps.class) }];
        write("class", &class, Some(f64::from(MISSING_CLASS)))?;
        let object = [Band { description: "object_number", data: BandData::U32(&maps.object) }];
        write("object", &object, Some(f64::from(NO_OBJECT)))?;
        Ok(())
    }

    fn write_previews(&self, image: &PriorsImage, maps: &SatelliteMaps) -> Result<ViewPictures, FileError> {
        let (heights, normals) = (height_preview(&maps.height_m), normal_preview(&maps.normal));
        let path = |what: &str| self.folder.join("previews").join(format!("{}_{what}.png", image.stem));
        write_png_rgb(path("height"), &heights, false)?;
        write_png_rgb(path("normal"), &normals, false)?;
        Ok(ViewPictures { name: image.stem.clone(), maps: vec![("heights", heights), ("normals", normals)] })
    }
}

fn row(image: &PriorsImage, lines: &LinesOfSight, maps: &SatelliteMaps, corrected: bool) -> SatelliteRow {
    let heights = || maps.height_m.data().iter().copied().filter(|h| h.is_finite());
    let range = [heights().fold(f32::INFINITY, f32::min), heights().fold(f32::NEG_INFINITY, f32::max)];
    SatelliteRow {
        image: image.path.display().to_string(),
        name: image.stem.clone(),
        size: [image.size.0, image.size.1],
        hit_pixels: maps.hits(),
        height_range_m: range[0].is_finite().then_some(range),
        distance_from_height_m: lines.from_height_m(),
        line_of_sight_error_m: lines.error_m(),
        corrected,
    }
}

fn report(
    config: &PriorsConfig,
    file: &CityFile,
    model: &PriorModel,
    place: &ModelPlace,
    rows: Vec<SatelliteRow>,
    unusable: usize,
) -> SatellitePriorsReport {
    let mut notes = Vec::new();
    if unusable > 0 {
        notes.push(unusable_note(unusable));
    }
    if place.datum.is_none() {
        notes.push("The model does not say what its heights are above: taken as the ellipsoid.".to_owned());
    }
    let blind = rows.iter().filter(|row| row.hit_pixels == 0).count();
    if blind > 0 {
        let see = if blind == 1 { "image sees" } else { "images see" };
        notes.push(format!("{blind} {see} no building."));
    }
    SatellitePriorsReport {
        model: config.model.display().to_string(),
        model_crs: file.model.crs.to_string(),
        map: place.projection.definition().to_owned(),
        model_heights_above: place.datum().to_string(),
        triangles: model.mesh().triangles.len(),
        notes,
        images: rows,
        maps: json!({
            "height": "metres above the WGS 84 ellipsoid, no-data -32768",
            "distance": "metres along the line of sight from distance_from_height_m downwards, no-data -32768",
            "normal": "east, north, up; unit length, turned to the sensor, 0 where no building is seen",
            "mask": "1 where a building is seen",
            "class": "labels.json has the names",
            "object": "labels.json has the identifiers",
        }),
    }
}

/// The error of images that see no building, with the places of model and image.
fn nothing_in_images(model: &PriorModel, place: &ModelPlace, images: &[PriorsImage]) -> PriorsJobError {
    let origin = model.mesh().origin;
    let at = place.projection.lonlat_from_map(origin.x, origin.y);
    let model = at.map_or_else(|error| error.to_string(), |(lon, lat)| format!("{lon:.5}° E, {lat:.5}° N"));
    let image = images.first().map_or_else(String::new, |image| {
        format!("{:.5}° E, {:.5}° N", image.camera.rpc.long_off, image.camera.rpc.lat_off)
    });
    PriorsJobError::NothingInImages { model, image }
}
