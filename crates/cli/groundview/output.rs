//! The files of the views, and the report.

use std::path::{Path, PathBuf};

use anyhow::Context;
use camera::ImagePoint;
use groundview::{GROUND, GroundView, Panorama, SKY, Viewer, render, visible_cells};
use io::colmap::{ColmapEncoding, ColmapModel, ColmapObservation, ColmapPoint, ColmapView};
use io::npy;
use io::raster::{Band, BandData, ImageSource, MapTile, write_map_tile, write_png_gray, write_png_rgb};
use numeric::Progress;
use raster::Grid;
use report::{depth_preview, normal_preview, side_by_side};
use serde::Serialize;

use super::MakeArgs;
use super::shots::{Failure, Shot, Shots};
use super::surface::{Kind, Surface};

pub(super) const REPORT: &str = "report.json";
/// Failures that are printed one by one.
const TOLD: usize = 20;
/// Colour of points of views without a picture.
const GREY: [u8; 3] = [128; 3];

/// What was made.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    views: Vec<ViewReport>,
    /// What was asked for and is not there.
    failed: Vec<Failure>,
    points: usize,
    /// Cells of a raster that some view sees, and all that have a height.
    cells_seen: Option<[usize; 2]>,
}

#[derive(Debug, Serialize)]
struct ViewReport {
    name: String,
    kind: &'static str,
    size: (usize, usize),
    centre: [f64; 3],
    ground_share: f64,
    sky_share: f64,
    depth_range_m: Option<[f32; 2]>,
}

impl Report {
    /// Whether all that was asked for is there.
    pub(super) fn is_complete(&self) -> bool {
        self.failed.is_empty()
    }

    /// Names what is not there.
    pub(super) fn tell_failures(&self) {
        for Failure { id, reason } in self.failed.iter().take(TOLD) {
            tracing::error!("{id}: {reason}");
        }
    }

    pub(super) fn text(&self, folder: &Path) -> String {
        let mut text = String::new();
        for view in &self.views {
            let (ground, sky) = (100.0 * view.ground_share, 100.0 * view.sky_share);
            let [low, high] = view.depth_range_m.unwrap_or([f32::NAN; 2]);
            text += &format!(
                "{:11} {:20} {ground:.1} % surface, {sky:.1} % sky, {low:.1} to {high:.1} m\n",
                view.kind, view.name
            );
        }
        if let Some([seen, all]) = self.cells_seen {
            text += &format!("cells       {seen} of {all} seen\n");
        }
        if !self.failed.is_empty() {
            text += &format!("failed      {}, see {}\n", self.failed.len(), folder.join(REPORT).display());
        }
        text + &format!("points      {}\nwritten     {}\n", self.points, folder.display())
    }
}

/// Renders and writes all views.
pub(super) fn write(
    args: &MakeArgs,
    surface: &Surface,
    shots: &Shots,
    folder: &Path,
    progress: &dyn Progress,
) -> anyhow::Result<Report> {
    let pictures = shots.shots.iter().any(|shot| shot.picture.is_some());
    for name in
        ["depth", "normal", "mask", "sky", "previews", "sparse/0"].into_iter().chain(pictures.then_some("images"))
    {
        let path = folder.join(name);
        std::fs::create_dir_all(&path).with_context(|| format!("cannot make the folder: {}", path.display()))?;
    }
    let mut report = Report { views: Vec::new(), failed: shots.failed.clone(), points: 0, cells_seen: None };
    let mut model = ColmapModel { lenses: shots.lenses.clone(), views: Vec::new() };
    let mut points = Vec::new();
    let mut seen_by = match &surface.kind {
        Kind::Field(field, _) => Some(field.heights().map(|_| 0u16)),
        Kind::Mesh(_) => None,
    };
    let mut open: Option<(PathBuf, Grid<[f32; 3]>)> = None;
    progress.begin("views", shots.shots.len());
    for shot in &shots.shots {
        let viewer = shots.viewer(shot);
        let picture = match cut(shots, shot, &mut open) {
            Err(error) if args.stand.positions.is_some() => {
                report.failed.push(Failure { id: shot.stem.clone(), reason: format!("{error:#}") });
                progress.step();
                continue;
            }
            picture => picture?,
        };
        let view = render(surface, &viewer, &shot.pose);
        write_maps(folder, shot, &view, args.overwrite)?;
        if let Some(picture) = &picture {
            write_png_rgb(folder.join("images").join(&shot.name), picture, args.overwrite)?;
        }
        // A panorama and its crops are one camera.
        let is_counted = shot.lens.is_none() || args.cameras.is_some();
        if let (Some(counts), Kind::Field(field, _), true) = (&mut seen_by, &surface.kind, is_counted) {
            let seen = visible_cells(field, &viewer, &shot.pose);
            let cells = counts.data_mut().iter_mut().zip(seen.data());
            cells.for_each(|(count, seen)| *count = count.saturating_add(u16::from(*seen)));
        }
        if let Some(lens) = shot.lens {
            let number = model.views.len() as u32;
            points.extend(points_of(&view, &viewer, shot, number, args.points, picture.as_ref()));
            model.views.push(ColmapView { id: number + 1, name: shot.name.clone(), lens, pose: shot.pose });
        }
        report.views.push(view_report(shot, &view));
        progress.step();
    }
    if let (Some(counts), Kind::Field(field, geotransform)) = (&seen_by, &surface.kind) {
        let bands = [Band { description: "cameras_that_see_the_cell", data: BandData::U16(counts) }];
        let crs = surface.projection.definition();
        let tile = MapTile { bands: &bands, geotransform: *geotransform, crs, height_from_value: None, metadata: &[] };
        write_map_tile(folder.join("visibility.tif"), &tile, args.overwrite)?;
        let seen = counts.data().iter().filter(|count| **count > 0).count();
        report.cells_seen = Some([seen, field.heights().data().iter().filter(|h| h.is_finite()).count()]);
    }
    report.points = points.len();
    if !model.views.is_empty() {
        io::colmap::write(&folder.join("sparse/0"), &model, &points, ColmapEncoding::Binary, args.overwrite)?;
        surface.local_origin().write(&folder.join("sparse/0/origin.json"), args.overwrite)?;
    }
    surface.local_origin().write(&folder.join("origin.json"), args.overwrite)?;
    let json = serde_json::to_string_pretty(&report)? + "\n";
    io::write_bytes(folder.join(REPORT), json.as_bytes(), args.overwrite)?;
    Ok(report)
}

impl Shots {
    fn viewer(&self, shot: &Shot) -> Viewer<'_> {
        shot.lens.map_or(Viewer::Panorama(self.panorama), |lens| Viewer::Perspective(&self.lenses[lens]))
    }
}

/// The crop of a shot from its panorama's picture, of which the last one read is kept.
fn cut(
    shots: &Shots,
    shot: &Shot,
    open: &mut Option<(PathBuf, Grid<[f32; 3]>)>,
) -> anyhow::Result<Option<Grid<[u8; 3]>>> {
    let (Some((path, turn)), Some(lens)) = (&shot.picture, shot.lens) else { return Ok(None) };
    if open.as_ref().is_none_or(|(known, _)| known != path) {
        let source = ImageSource::open(path)?;
        *open = Some((path.clone(), source.read_colour(source.window())?));
    }
    let Some((_, picture)) = open else { return Ok(None) };
    let crop = Panorama::crop(picture, &shots.lenses[lens], *turn);
    Ok(Some(crop.map(|p| p.map(|c| c.round().clamp(0.0, 255.0) as u8))))
}

fn write_maps(folder: &Path, shot: &Shot, view: &GroundView, overwrite: bool) -> anyhow::Result<()> {
    let path = |kind: &str, ending: &str| folder.join(kind).join(format!("{}.{ending}", shot.stem));
    let (width, height) = (view.kind.width(), view.kind.height());
    npy::write(path("depth", "npy"), &[height, width], view.depth_m.data(), overwrite)?;
    npy::write(path("normal", "npy"), &[height, width, 3], view.normal.data().as_flattened(), overwrite)?;
    let mask = |wanted: u8| view.kind.map(|kind| if *kind == wanted { 255 } else { 0 });
    write_png_gray(path("mask", "png"), &mask(GROUND), overwrite)?;
    write_png_gray(path("sky", "png"), &mask(SKY), overwrite)?;
    let preview = side_by_side(&[&normal_preview(&view.normal), &depth_preview(&view.depth_m)]);
    Ok(write_png_rgb(path("previews", "png"), &preview, overwrite)?)
}

fn view_report(shot: &Shot, view: &GroundView) -> ViewReport {
    let share = |wanted: u8| {
        view.kind.data().iter().filter(|kind| **kind == wanted).count() as f64 / view.kind.data().len().max(1) as f64
    };
    let depths = || view.depth_m.data().iter().copied().filter(|d| d.is_finite());
    let range = [depths().fold(f32::INFINITY, f32::min), depths().fold(f32::NEG_INFINITY, f32::max)];
    ViewReport {
        name: shot.stem.clone(),
        kind: if shot.lens.is_some() { "perspective" } else { "panorama" },
        size: (view.kind.width(), view.kind.height()),
        centre: shot.pose.centre,
        ground_share: share(GROUND),
        sky_share: share(SKY),
        depth_range_m: range[0].is_finite().then_some(range),
    }
}

/// Points of the surface at evenly spread pixels of a perspective view.
fn points_of(
    view: &GroundView,
    viewer: &Viewer<'_>,
    shot: &Shot,
    number: u32,
    most: usize,
    picture: Option<&Grid<[u8; 3]>>,
) -> Vec<ColmapPoint> {
    let (width, height) = viewer.size();
    let stride = ((width * height) as f64 / most.max(1) as f64).sqrt().ceil().max(1.0) as usize;
    let mut points = Vec::new();
    for row in (stride / 2..height).step_by(stride).filter(|_| most > 0) {
        for column in (stride / 2..width).step_by(stride) {
            let depth = f64::from(view.depth_m[(column, row)]);
            let Some(in_camera) = viewer.direction(column, row).filter(|_| depth.is_finite()) else { continue };
            let away = |i: usize| (0..3).map(|j| shot.pose.rotation[j][i] * in_camera[j]).sum::<f64>();
            points.push(ColmapPoint {
                position: [0, 1, 2].map(|i| shot.pose.centre[i] + depth * away(i)),
                color: picture.map_or(GREY, |picture| picture[(column, row)]),
                error_px: 0.0,
                track: vec![ColmapObservation { view: number, pixel: ImagePoint::new(column as f64, row as f64) }],
            });
        }
    }
    points
}
