//! Files, report row and points of one ground view.

use std::path::Path;

use camera::ImagePoint;
use formats::colmap::{ColmapObservation, ColmapPoint};
use formats::npy;
use formats::raster::{write_png_gray, write_png_rgb};
use groundview::{GROUND, GroundView, SKY, Viewer};
use raster::Grid;
use report::{depth_preview, normal_preview, side_by_side};

use super::report::GroundViewRow;
use super::shots::Shot;
use job::files::FileError;

/// Colour of the points of a view without a picture.
const GREY: [u8; 3] = [128; 3];

/// Writes depths, normals, masks and the preview of a view.
pub(super) fn write_maps(folder: &Path, shot: &Shot, view: &GroundView, overwrite: bool) -> Result<(), FileError> {
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

/// Describes a view.
pub(super) fn view_row(shot: &Shot, view: &GroundView) -> GroundViewRow {
    let share = |wanted: u8| {
        view.kind.data().iter().filter(|kind| **kind == wanted).count() as f64 / view.kind.data().len().max(1) as f64
    };
    let depths = || view.depth_m.data().iter().copied().filter(|d| d.is_finite());
    let range = [depths().fold(f32::INFINITY, f32::min), depths().fold(f32::NEG_INFINITY, f32::max)];
    GroundViewRow {
        name: shot.stem.clone(),
        kind: if shot.lens.is_some() { "perspective" } else { "panorama" },
        size: (view.kind.width(), view.kind.height()),
        centre: shot.pose.centre,
        ground_share: share(GROUND),
        sky_share: share(SKY),
        depth_range_m: range[0].is_finite().then_some(range),
    }
}

/// Returns points of the surface at evenly spread pixels of a perspective view, at most `most`.
pub(super) fn points_of(
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
