//! Priors for satellite images: maps in the pixels of each image, with its RPC.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use ::priors::{
    LinesOfSight, MISSING_CLASS, ModelPlace, NO_OBJECT, PriorModel, PriorsError, SatelliteMaps, buildings_of,
};
use anyhow::{Context, bail};
use camera::{ImageCorrection, RpcCamera};
use city::CrsReference;
use crs::CrsRequest;
use io::citymodel::CityFile;
use io::raster::{Band, BandData, ImageSource, write_image_with_rpc, write_png_rgb};
use numeric::Progress as _;
use raster::NO_DATA;
use report::{SatellitePriorsReport, SatelliteRow, ViewPictures, depth_preview, normal_preview};
use serde_json::{Value, json};

use super::content::{labels, write_json};
use super::folder::Folder;
use super::options::Args;
use crate::progress::{Log, Watcher};
use jobs::corrections::Corrections;

/// Folders of maps.
const FOLDERS: [&str; 7] = ["height", "distance", "normal", "mask", "class", "object", "previews"];

/// An image that maps are made for.
struct Image {
    path: PathBuf,
    stem: String,
    camera: RpcCamera,
    size: (usize, usize),
}

/// Makes the maps of all images; the report.
pub(super) fn make(args: &Args, paths: &[PathBuf], watcher: &Watcher) -> anyhow::Result<(Value, usize)> {
    let folder = Folder::new(&args.output, args.overwrite)?;
    let images = images(args, paths)?;
    let (file, meshed) = super::read_model(args)?;
    let unusable = super::unusable(&meshed);
    let place = place_of(args, &file.model.crs)?;
    let mut mesh = meshed.mesh;
    place.to_ellipsoid(&mut mesh)?;
    let model = PriorModel::new(mesh, &buildings_of(&file.model))?;
    let made = folder.begin()?;
    for name in FOLDERS {
        let path = made.path().join(name);
        fs::create_dir_all(&path).with_context(|| format!("cannot make the folder: {}", path.display()))?;
    }
    watcher.begin("maps", images.len());
    let (mut rows, mut pictures) = (Vec::with_capacity(images.len()), Vec::new());
    for (number, image) in images.iter().enumerate() {
        let shown = |wanted| super::maps::spread(number, images.len(), wanted);
        let previews = shown(args.previews);
        let (row, picture) = write_image(image, &model, &place, made.path(), previews)?;
        rows.push(row);
        pictures.extend(picture.filter(|_| shown(args.previews.min(super::maps::IN_PAGE))));
        watcher.step();
    }
    if rows.iter().all(|row| row.hit_pixels == 0) {
        bail!("{}", nothing_in_sight(&model, &place, &images));
    }
    let report = report(args, &file, &model, &place, rows, unusable);
    io::write_bytes(made.path().join("report.html"), report.html(&pictures)?.as_bytes(), false)?;
    let report = report.json()?;
    write_json(&made.path().join("labels.json"), &labels(&file.model, model.mesh()))?;
    write_json(&made.path().join("report.json"), &report)?;
    made.publish()?;
    Ok((report, unusable))
}

/// What to say on the terminal.
pub(super) fn summary(args: &Args, report: &Value) -> String {
    let mut text = String::new();
    for image in report["images"].as_array().into_iter().flatten() {
        text += &format!("image      {} pixels see a building: {}\n", image["hit_pixels"], args.output.display());
    }
    text + &format!("report     {}\n", args.output.join("report.html").display())
}

fn images(args: &Args, paths: &[PathBuf]) -> anyhow::Result<Vec<Image>> {
    if args.offset.is_some() || args.transform.is_some() {
        bail!(
            "--offset and --transform are for perspective cameras: satellite images find the model by its coordinates"
        );
    }
    let corrections = args.corrections.as_deref().map(Corrections::read).transpose()?.unwrap_or_default();
    let mut known: HashMap<String, &Path> = HashMap::new();
    let mut images = Vec::with_capacity(paths.len());
    for path in paths {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        // Where upper and lower case are one, so are their files.
        if let Some(other) = known.insert(stem.to_lowercase(), path) {
            bail!("two images have the same name, and so would their maps: {} and {}", other.display(), path.display());
        }
        let rpc = io::rpc::read_for_image(path)?.rpc;
        let window = ImageSource::open(path)?.window();
        let camera = RpcCamera { rpc, correction: corrections.for_image(path, &Log) };
        images.push(Image { path: path.clone(), stem, camera, size: (window.width, window.height) });
    }
    Ok(images)
}

/// Where the model is, by its own words and by the options.
fn place_of(args: &Args, crs: &CrsReference) -> anyhow::Result<ModelPlace> {
    let (map, datum) = match args.crs {
        Some(CrsRequest::Epsg { horizontal, vertical }) => (Some(horizontal), vertical),
        Some(CrsRequest::Auto) => bail!("--crs must name a code: EPSG:n"),
        None => (None, None),
    };
    let place = match ModelPlace::of(crs, map, args.vertical.or(datum)) {
        Err(e @ PriorsError::MapUnknown { .. }) => bail!("{e}: satellite images need it, give --crs EPSG:n"),
        place => place?,
    };
    if place.datum.is_none() {
        tracing::warn!("the model does not say what its heights are above, taken as the ellipsoid (--vertical)");
    }
    Ok(place)
}

fn write_image(
    image: &Image,
    model: &PriorModel,
    place: &ModelPlace,
    folder: &Path,
    previews: bool,
) -> anyhow::Result<(SatelliteRow, Option<ViewPictures>)> {
    let failed = || format!("in the image: {}", image.path.display());
    let lines = LinesOfSight::new(&image.camera, image.size, model, &place.projection).with_context(failed)?;
    let maps = SatelliteMaps::render(model, &lines).with_context(failed)?;
    let corrected = image.camera.correction != ImageCorrection::IDENTITY;
    let rpc = if corrected { image.camera.folded().with_context(failed)?.rpc } else { image.camera.rpc.clone() };
    let write = |kind: &str, bands: &[Band<'_>], no_data: Option<f64>| {
        write_image_with_rpc(folder.join(kind).join(format!("{}.tif", image.stem)), bands, &rpc, no_data, false)
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
    let pictures = previews.then(|| write_previews(image, &maps, folder)).transpose()?;
    let heights = || maps.height_m.data().iter().copied().filter(|h| h.is_finite());
    let range = [heights().fold(f32::INFINITY, f32::min), heights().fold(f32::NEG_INFINITY, f32::max)];
    let row = SatelliteRow {
        image: image.path.display().to_string(),
        name: image.stem.clone(),
        size: [image.size.0, image.size.1],
        hit_pixels: maps.hits(),
        height_range_m: range[0].is_finite().then_some(range),
        distance_from_height_m: lines.from_height_m(),
        line_of_sight_error_m: lines.error_m(),
        corrected,
    };
    Ok((row, pictures))
}

fn write_previews(image: &Image, maps: &SatelliteMaps, folder: &Path) -> anyhow::Result<ViewPictures> {
    let (heights, normals) = (depth_preview(&maps.height_m), normal_preview(&maps.normal));
    let path = |what: &str| folder.join("previews").join(format!("{}_{what}.png", image.stem));
    write_png_rgb(path("height"), &heights, false)?;
    write_png_rgb(path("normal"), &normals, false)?;
    Ok(ViewPictures { name: image.stem.clone(), maps: vec![("heights", heights), ("normals", normals)] })
}

fn report(
    args: &Args,
    file: &CityFile,
    model: &PriorModel,
    place: &ModelPlace,
    rows: Vec<SatelliteRow>,
    unusable: usize,
) -> SatellitePriorsReport {
    let mut notes = Vec::new();
    if unusable > 0 {
        notes.push(super::content::unusable_note(unusable));
    }
    if place.datum.is_none() {
        notes.push("The model does not say what its heights are above: taken as the ellipsoid.".to_owned());
    }
    let blind = rows.iter().filter(|row| row.hit_pixels == 0).count();
    if blind > 0 {
        notes.push(format!("{blind} images see no building."));
    }
    SatellitePriorsReport {
        model: args.model.display().to_string(),
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

/// What to say where no image has the model in it.
fn nothing_in_sight(model: &PriorModel, place: &ModelPlace, images: &[Image]) -> String {
    let origin = model.mesh().origin;
    let at = place.projection.lonlat_from_map(origin.x, origin.y);
    let model = at.map_or_else(|error| error.to_string(), |(lon, lat)| format!("{lon:.5}° E, {lat:.5}° N"));
    let image = images.first().map_or_else(String::new, |image| {
        format!("{:.5}° E, {:.5}° N", image.camera.rpc.long_off, image.camera.rpc.lat_off)
    });
    format!("no image has a building in it: the model is at {model}, the first image at {image}")
}
