//! The model that an image is registered to: a surface, and pictures of what it looks like.

use std::path::{Path, PathBuf};

use camera::{ImageCorrection, RpcCamera};
use crs::MapProjection;
use formats::raster::{Dem, ImageSource};
use geodesy::LonLatHeight;
use numeric::Progress;
use occlusion::{Eyeline, GridGround};
use raster::{GeoTransform, Grid};
use splats::{MapSplatCamera, SplatSurface};

use super::config::{RegisterConfig, RegisterModel};
use super::error::RegisterError;
use crate::ortho::{OrthoError, OrthoImage};
use crate::surface_layer::weak_cells;
use job::corrections::Corrections;
use job::map_surface;

/// Most cells of the picture of splats from above.
const CELLS_MAX: f64 = (1u64 << 26) as f64;
/// Probability below which a height is no evidence: it is clearly more often wrong than right. Most
/// of the ground of weak surfaces lies just below one half, and images are still placed on it.
const LEAST_CONFIDENCE: f32 = 0.4;
/// Rise per run of a height jump between neighbouring cells: steeper than roofs and most slopes.
const JUMP_SLOPE: f32 = 2.0;
/// Cells beside a height jump that are not compared: they lie on the wall between two heights, or
/// show both sides of it through the blur of the images.
const JUMP_REACH: usize = 2;
/// Least opacity of splats that show the surface.
const COVERED: f32 = 0.5;

/// A surface and what it looks like.
pub(super) struct Model {
    /// Heights above the ellipsoid, metres.
    pub(super) heights: Grid<f32>,
    /// Cells that nothing has measured, if the surface says so: they are no evidence.
    pub(super) unobserved: Option<Grid<bool>>,
    /// Cells beside height jumps: what is seen there depends on the direction of view.
    pub(super) beside_jumps: Grid<bool>,
    pub(super) geotransform: GeoTransform,
    /// Side of a cell, metres.
    pub(super) cell_m: f64,
    pub(super) projection: MapProjection,
    pub(super) ground: GridGround,
    /// Mean height, metres.
    pub(super) middle_m: f64,
    pub(super) looks: Looks,
}

/// What a surface looks like.
pub(super) enum Looks {
    /// As images see it.
    Images(Vec<(PathBuf, OrthoImage)>),
    /// As this grey picture on the cells of the surface; NaN where nothing is known.
    Picture(Grid<f32>),
}

/// The image to be registered.
pub(super) struct NewImage {
    pub(super) path: PathBuf,
    pub(super) image: OrthoImage,
    /// Side of a pixel on the ground, metres.
    pub(super) gsd_m: f64,
}

impl Model {
    /// Reads the model of a configuration. Splats are pictured from above, with cells of the
    /// image's ground sampling distance.
    pub(super) fn open(
        config: &RegisterConfig,
        camera: &RpcCamera,
        progress: &dyn Progress,
    ) -> Result<Self, RegisterError> {
        match &config.model {
            RegisterModel::Surface { dsm, images } => Self::of_surface(config, dsm, images, progress),
            RegisterModel::Splats(path) => Self::of_splats(path, &config.image, camera),
        }
    }

    fn of_surface(
        config: &RegisterConfig,
        dsm: &Path,
        images: &[PathBuf],
        progress: &dyn Progress,
    ) -> Result<Self, RegisterError> {
        let map = map_surface::read(dsm, config.vertical, progress)?;
        let unobserved = unobserved(&map.dem)?;
        let mut model = Self::on(map.dem.heights, map.dem.geotransform, map.projection, dsm)?;
        model.unobserved = unobserved;
        let of_run = if images.is_empty() { Corrections::images_of_run(dsm)? } else { images.to_vec() };
        let own = config.image.canonicalize().ok();
        let others = of_run.into_iter().filter(|path| own.is_none() || path.canonicalize().ok() != own);
        let others: Vec<PathBuf> = others.collect();
        if others.is_empty() {
            return Err(RegisterError::NoImages { path: dsm.to_owned() });
        }
        let corrections = Corrections::for_surface(dsm, &config.corrections)?;
        let mut open = Vec::with_capacity(others.len());
        for path in others {
            let camera = corrections.camera(&path, progress)?;
            let image = model.look_through(&path, camera)?;
            open.push((path, image));
        }
        model.looks = Looks::Images(open);
        Ok(model)
    }

    fn of_splats(path: &Path, image: &Path, camera: &RpcCamera) -> Result<Self, RegisterError> {
        let file = formats::splat_files::read(path)?;
        let origin =
            file.origin.ok_or_else(|| RegisterError::NoOrigin { path: formats::splat_ply::origin_path(path) })?;
        if origin.vertical != "ellipsoid" {
            return Err(RegisterError::Datum { vertical: origin.vertical, path: path.to_owned() });
        }
        let projection = MapProjection::from_definition(&origin.crs)?;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for splat in &file.splats {
            for axis in 0..2 {
                let at = f64::from(splat.position[axis]) + origin.origin[axis];
                (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at));
            }
        }
        let area = (high[0] - low[0]) * (high[1] - low[1]);
        if !(area > 0.0 && area.is_finite()) {
            return Err(RegisterError::NoHeights { path: path.to_owned() });
        }
        let (lon, lat) = projection.lonlat_from_map(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))?;
        let gsd = camera.gsd(LonLatHeight::new(lon, lat, origin.origin[2]));
        let gsd_m = gsd.map_err(|source| RegisterError::Camera { path: image.to_owned(), source })?.mean_m();
        let cell = gsd_m.max((area / CELLS_MAX).sqrt());
        let count = |axis: usize| ((high[axis] - low[axis]) / cell).ceil().max(2.0) as usize;
        let void = Grid::filled(count(0), count(1), f32::NAN);
        let geotransform = GeoTransform::north_up(low[0], high[1], cell);
        let surface = SplatSurface::new(&void, geotransform, origin.origin);
        let from_above =
            MapSplatCamera::new(&surface).ok_or_else(|| RegisterError::NoHeights { path: path.to_owned() })?;
        let seen = splats::render(&file.splats, &from_above)?;
        let heights = seen.median_height_m.map(|height| (f64::from(*height) + origin.origin[2]) as f32);
        let picture = seen.colour.zip_map(&seen.coverage, |colour, covered| {
            if *covered < COVERED { f32::NAN } else { colour.iter().sum::<f32>() / (3.0 * covered) }
        });
        let mut model = Self::on(heights, geotransform, projection, path)?;
        model.looks = Looks::Picture(picture);
        Ok(model)
    }

    /// Makes a model that looks like nothing yet.
    fn on(
        heights: Grid<f32>,
        geotransform: GeoTransform,
        projection: MapProjection,
        path: &Path,
    ) -> Result<Self, RegisterError> {
        let known = heights.data().iter().filter(|height| height.is_finite());
        let (sum, count) = known.fold((0.0, 0usize), |(sum, count), &height| (sum + f64::from(height), count + 1));
        if count == 0 {
            return Err(RegisterError::NoHeights { path: path.to_owned() });
        }
        let (along_columns, along_rows) = geotransform.cell_size();
        let ground = GridGround::new(&projection, &geotransform, (heights.width(), heights.height()))?;
        let cell_m = (along_columns * along_rows).sqrt();
        Ok(Self {
            cell_m,
            beside_jumps: beside_jumps(&heights, JUMP_SLOPE * cell_m as f32),
            heights,
            unobserved: None,
            geotransform,
            projection,
            ground,
            middle_m: sum / count as f64,
            looks: Looks::Images(Vec::new()),
        })
    }

    /// Opens an image that sees the surface.
    pub(super) fn look_through(&self, path: &Path, camera: RpcCamera) -> Result<OrthoImage, RegisterError> {
        let source = ImageSource::open(path)?;
        let size = (self.heights.width(), self.heights.height());
        let eyeline = Eyeline::new(&camera, &self.projection, &self.geotransform, size, self.middle_m)
            .map_err(|source| OrthoError::NotSeen { path: path.to_owned(), source })?;
        let corrected = camera.correction != ImageCorrection::IDENTITY;
        Ok(OrthoImage { source, camera, corrected, eyeline })
    }
}

/// Marks the cells within [`JUMP_REACH`] of neighbouring cells whose heights differ by more than
/// `jump_m`.
fn beside_jumps(heights: &Grid<f32>, jump_m: f32) -> Grid<bool> {
    let (width, height) = (heights.width(), heights.height());
    let mut out = Grid::filled(width, height, false);
    let near = |at: usize, count: usize| at.saturating_sub(JUMP_REACH)..(at + JUMP_REACH + 1).min(count);
    for y in 0..height {
        for x in 0..width {
            let differs = |u: usize, v: usize| heights.get(u, v).is_some_and(|h| (h - heights[(x, y)]).abs() > jump_m);
            let (right, below) = (differs(x + 1, y), differs(x, y + 1));
            if right || below {
                let (columns, rows) = (near(x, width), near(y, height));
                let columns = columns.start..(columns.end + usize::from(right)).min(width);
                (rows.start..(rows.end + usize::from(below)).min(height))
                    .for_each(|v| out.row_mut(v)[columns.clone()].fill(true));
            }
        }
    }
    out
}

/// Reads which cells of a surface were filled, or are hardly ever right; `None` without layers
/// beside it.
fn unobserved(surface: &Dem) -> Result<Option<Grid<bool>>, RegisterError> {
    Ok(weak_cells(surface, LEAST_CONFIDENCE)?.mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_beside_a_wall_are_marked_on_both_sides_and_slopes_are_not() {
        let heights = |x: usize| 0.4 * x as f32 + if x >= 10 { 6.0 } else { 0.0 };
        let grid = Grid::from_vec(20, 3, (0..60).map(|i| heights(i % 20)).collect()).unwrap();
        let marked: Vec<usize> = (0..20).filter(|x| beside_jumps(&grid, 1.0)[(*x, 1)]).collect();
        assert_eq!(marked, [7, 8, 9, 10, 11, 12]);
    }
}
