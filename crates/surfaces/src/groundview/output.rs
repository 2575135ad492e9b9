//! Renders all ground views and writes the folder.

use std::path::PathBuf;

use formats::colmap::{ColmapEncoding, ColmapModel, ColmapPoint, ColmapView};
use formats::raster::{Band, BandData, ImageSource, MapTile, write_map_tile, write_png_rgb};
use groundview::{GroundView, Panorama, Viewer, render, visible_cells};
use numeric::Progress;
use raster::Grid;

use super::config::{GroundCameras, GroundViewConfig};
use super::error::GroundViewError;
use super::report::{GroundViewFailure, GroundViewReport, GroundViewRow, REPORT};
use super::shots::{Shot, Shots};
use super::view_files::{points_of, view_row, write_maps};
use super::view_surface::{SurfaceKind, ViewSurface};
use job::error_text::with_causes;
use job::files::FileError;
use job::output_folder::OutputFolder;
use job::report_page;

/// Folders of the views.
pub(super) const FOLDERS: [&str; 7] = ["depth", "normal", "mask", "sky", "previews", "sparse/0", PICTURES];
/// Folder of the crops of pictures.
const PICTURES: &str = "images";

/// A picture of a panorama, with its file.
type OpenPicture = (PathBuf, Grid<[f32; 3]>);

/// Renders and writes all views.
pub(super) fn write(
    config: &GroundViewConfig,
    folder: &OutputFolder,
    surface: &ViewSurface,
    shots: &Shots,
    progress: &dyn Progress,
) -> Result<GroundViewReport, GroundViewError> {
    let pictures = shots.shots.iter().any(|shot| shot.picture.is_some());
    for name in FOLDERS.into_iter().filter(|name| pictures || *name != PICTURES) {
        folder.subfolder(name)?;
    }
    let mut made = Made::new(surface, shots);
    let mut open: Option<OpenPicture> = None;
    progress.begin("views", shots.shots.len());
    for shot in &shots.shots {
        progress.check_cancelled()?;
        match cut(shots, shot, &mut open) {
            Err(error) if config.is_list() => {
                made.failed.push(GroundViewFailure { id: shot.stem.clone(), reason: with_causes(&error) });
            }
            picture => made.add(config, surface, shots, shot, picture?.as_ref())?,
        }
        progress.step();
    }
    made.finish(config, surface)
}

/// Views that were made so far.
struct Made {
    rows: Vec<GroundViewRow>,
    failed: Vec<GroundViewFailure>,
    model: ColmapModel,
    points: Vec<ColmapPoint>,
    /// Number of cameras that see each cell, for rasters.
    seen_by: Option<Grid<u16>>,
}

impl Made {
    fn new(surface: &ViewSurface, shots: &Shots) -> Self {
        let seen_by = match &surface.kind {
            SurfaceKind::Field(field, _) => Some(field.heights().map(|_| 0u16)),
            SurfaceKind::Mesh(_) => None,
        };
        Self {
            rows: Vec::new(),
            failed: shots.failed.clone(),
            model: ColmapModel { lenses: shots.lenses.clone(), views: Vec::new() },
            points: Vec::new(),
            seen_by,
        }
    }

    /// Renders and writes one view.
    fn add(
        &mut self,
        config: &GroundViewConfig,
        surface: &ViewSurface,
        shots: &Shots,
        shot: &Shot,
        picture: Option<&Grid<[u8; 3]>>,
    ) -> Result<(), GroundViewError> {
        let (viewer, folder) = (shots.viewer(shot), &config.output);
        let view: GroundView = render(surface, &viewer, &shot.pose);
        write_maps(folder, shot, &view, config.overwrite)?;
        if let Some(picture) = picture {
            write_png_rgb(folder.join(PICTURES).join(&shot.name), picture, config.overwrite)
                .map_err(FileError::from)?;
        }
        // A panorama and its crops count as one camera.
        let is_counted = shot.lens.is_none() || matches!(config.cameras, GroundCameras::Model(_));
        if let (Some(counts), SurfaceKind::Field(field, _), true) = (&mut self.seen_by, &surface.kind, is_counted) {
            let seen = visible_cells(field, &viewer, &shot.pose);
            let cells = counts.data_mut().iter_mut().zip(seen.data());
            cells.for_each(|(count, seen)| *count = count.saturating_add(u16::from(*seen)));
        }
        if let Some(lens) = shot.lens {
            let number = self.model.views.len() as u32;
            self.points.extend(points_of(&view, &viewer, shot, number, config.points_per_view, picture));
            self.model.views.push(ColmapView { id: number + 1, name: shot.name.clone(), lens, pose: shot.pose });
        }
        self.rows.push(view_row(shot, &view));
        Ok(())
    }

    /// Writes what is made of all views: visibility, COLMAP model, origin, report.
    fn finish(self, config: &GroundViewConfig, surface: &ViewSurface) -> Result<GroundViewReport, GroundViewError> {
        let (folder, overwrite) = (&config.output, config.overwrite);
        let mut cells_seen = None;
        if let (Some(counts), SurfaceKind::Field(field, geotransform)) = (&self.seen_by, &surface.kind) {
            let bands = [Band { description: "cameras_that_see_the_cell", data: BandData::U16(counts) }];
            let (crs, geotransform) = (surface.projection.definition(), *geotransform);
            let tile = MapTile { bands: &bands, geotransform, crs, height_from_value: None, metadata: &[] };
            write_map_tile(folder.join("visibility.tif"), &tile, overwrite).map_err(FileError::from)?;
            let seen = counts.data().iter().filter(|count| **count > 0).count();
            cells_seen = Some([seen, field.heights().data().iter().filter(|h| h.is_finite()).count()]);
        }
        let origin = surface.local_origin();
        if !self.model.views.is_empty() {
            let sparse = folder.join("sparse/0");
            formats::colmap::write(&sparse, &self.model, &self.points, ColmapEncoding::Binary, overwrite)
                .map_err(FileError::from)?;
            origin.write(&sparse.join("origin.json"), overwrite).map_err(FileError::from)?;
        }
        origin.write(&folder.join("origin.json"), overwrite).map_err(FileError::from)?;
        let report = GroundViewReport {
            views: self.rows,
            failed: self.failed,
            points: self.points.len(),
            cells_seen,
            folder: folder.clone(),
        };
        let lead = "Depths, normals and masks of what cameras on the ground see.";
        report_page::write(&folder.join(REPORT), ("Ground views", lead), &report, Vec::new(), overwrite)?;
        Ok(report)
    }
}

impl Shots {
    /// Returns the pixels of a shot.
    fn viewer(&self, shot: &Shot) -> Viewer<'_> {
        shot.lens.map_or(Viewer::Panorama(self.panorama), |lens| Viewer::Perspective(&self.lenses[lens]))
    }
}

/// Cuts the crop of a shot from the picture of its panorama. `open` keeps the last picture that was
/// read.
fn cut(shots: &Shots, shot: &Shot, open: &mut Option<OpenPicture>) -> Result<Option<Grid<[u8; 3]>>, GroundViewError> {
    let (Some((path, turn)), Some(lens)) = (&shot.picture, shot.lens) else { return Ok(None) };
    if open.as_ref().is_none_or(|(known, _)| known != path) {
        let source = ImageSource::open(path)?;
        *open = Some((path.clone(), source.read_colour(source.window())?));
    }
    let Some((_, picture)) = open else { return Ok(None) };
    let crop = Panorama::crop(picture, &shots.lenses[lens], *turn);
    Ok(Some(crop.map(|p| p.map(|c| c.round().clamp(0.0, 255.0) as u8))))
}
