//! The frames in which the model and the image are compared: windows of one grid over the model,
//! whose cells are as wide as a pixel of the image.
//!
//! Frames overlap, and those of the model are wanted again in every round. What an image shows of a
//! cell of the grid is therefore kept.

use std::collections::HashMap;

use camera::{ImagePoint, RpcCamera};
use geodesy::LonLatHeight;
use occlusion::{GridGround, OcclusionSurface};
use ortho::Sight;
use raster::Grid;

use super::error::RegisterError;
use super::model::Model;
use crate::ortho::{Cell, OrthoImage, look};

/// Height by which the surface must stand above a line of sight to hide what is behind it, metres.
/// Noise of a measured surface hides nothing.
const TOLERANCE_M: f64 = 1.0;
/// Side of the blocks in which cells are kept. A frame is a few of them wide.
const BLOCK: usize = 32;

/// The grid over the model.
pub(super) struct Frames<'a> {
    surface: &'a OcclusionSurface<'a>,
    ground: &'a GridGround,
    unobserved: Option<&'a Grid<bool>>,
    beside_jumps: &'a Grid<bool>,
    /// Cells of the model per cell of a frame.
    step: f64,
    /// Columns and rows.
    size: [usize; 2],
}

/// A square window of the grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Column and row in the middle.
    pub(super) centre: [usize; 2],
    /// Cells on every side of it.
    pub(super) half: usize,
}

impl Frame {
    /// Returns the cells of the grid, row by row; `None` outside.
    fn cells(self, size: [usize; 2]) -> impl Iterator<Item = Option<[usize; 2]>> {
        let side = 2 * self.half + 1;
        (0..side * side).map(move |k| {
            let inside =
                |axis: usize, i: usize| (self.centre[axis] + i).checked_sub(self.half).filter(|at| *at < size[axis]);
            Some([inside(0, k % side)?, inside(1, k / side)?])
        })
    }

    fn picture(self, values: Vec<f32>) -> Grid<f32> {
        let side = 2 * self.half + 1;
        Grid::from_vec(side, side, values).unwrap_or_else(|| Grid::filled(0, 0, f32::NAN))
    }
}

impl<'a> Frames<'a> {
    pub(super) fn new(model: &'a Model, surface: &'a OcclusionSurface<'a>, gsd_m: f64) -> Self {
        let step = gsd_m / model.cell_m;
        let along = |cells: usize| ((cells as f64 - 1.0) / step) as usize + 1;
        Self {
            surface,
            ground: &model.ground,
            unobserved: model.unobserved.as_ref(),
            beside_jumps: &model.beside_jumps,
            step,
            size: [along(model.heights.width()), along(model.heights.height())],
        }
    }

    /// Returns cells of the grid on a lattice of `count` along its longer side, which begins so
    /// many spacings from its corner. All of them have heights.
    pub(super) fn centres(&self, count: usize, from: [f64; 2]) -> Vec<[usize; 2]> {
        let spacing = self.size[0].max(self.size[1]) as f64 / count as f64;
        let along = |axis: usize| {
            let cells = self.size[axis] as f64;
            let count = (cells / spacing).floor().max(1.0);
            (0..count as usize).map(move |i| ((i as f64 + from[axis]) * cells / count) as usize)
        };
        let lattice = along(1).flat_map(|row| along(0).map(move |column| [column, row]));
        lattice.filter(|at| self.height_at(at.map(|at| at as f64)).is_finite()).collect()
    }

    /// Returns the column and row of the model.
    fn in_model(&self, at: [f64; 2]) -> [f64; 2] {
        at.map(|at| at * self.step)
    }

    /// Returns the height of the surface at a place on the grid, metres; NaN where it has none.
    pub(super) fn height_at(&self, at: [f64; 2]) -> f32 {
        let [column, row] = self.in_model(at);
        self.surface.height_at(column, row)
    }

    /// Returns longitude and latitude of a place on the grid, degrees.
    pub(super) fn lonlat(&self, at: [f64; 2]) -> [f64; 2] {
        let [column, row] = self.in_model(at);
        self.ground.lonlat(column, row)
    }

    /// Returns whether the model holds at a cell: it was observed, and lies beside no jump.
    fn holds(&self, at: [usize; 2]) -> bool {
        let [column, row] = self.in_model(at.map(|at| at as f64)).map(|at| at.round() as usize);
        let is_marked = |mask: &Grid<bool>| mask.get(column, row).is_some_and(|marked| *marked);
        !self.unobserved.is_some_and(is_marked) && !is_marked(self.beside_jumps)
    }

    /// Returns a cell that has a height.
    fn cell(&self, at: [usize; 2]) -> Option<Cell> {
        let [column, row] = self.in_model(at.map(|at| at as f64));
        let height = self.surface.height_at(column, row);
        let [lon, lat] = self.ground.lonlat(column, row);
        let ground = LonLatHeight::new(lon, lat, f64::from(height));
        height.is_finite().then_some(Cell { in_dsm: [column, row], ground })
    }

    /// Returns a frame of a function of columns and rows of the model; NaN where cells may not be
    /// compared.
    pub(super) fn picture(&self, frame: Frame, value: impl Fn([f64; 2]) -> f32) -> Grid<f32> {
        let one = |at: Option<[usize; 2]>| {
            let cell = at.filter(|at| self.holds(*at)).and_then(|at| self.cell(at));
            cell.map_or(f32::NAN, |cell| value(cell.in_dsm))
        };
        frame.picture(frame.cells(self.size).map(one).collect())
    }

    /// Returns where a camera expects the `wanted` cells of a frame, by their numbers row by row;
    /// `None` for others, and where it has no answer or a cell has no height.
    pub(super) fn places(
        &self,
        camera: &RpcCamera,
        frame: Frame,
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<Option<ImagePoint>> {
        let place = |(number, at): (usize, Option<[usize; 2]>)| {
            let at = at.filter(|_| wanted(number))?;
            camera.project(self.cell(at)?.ground).ok()
        };
        frame.cells(self.size).enumerate().map(place).collect()
    }

    /// Returns what an image shows at cells, the mean over its bands.
    fn shown(&self, image: &OrthoImage, at: &[[usize; 2]]) -> Result<Vec<Shown>, RegisterError> {
        let cells: Vec<Option<Cell>> = at.iter().map(|at| self.cell(*at)).collect();
        let seen = look(self.surface, image, &cells, TOLERANCE_M)?;
        let bands = seen.values.len().max(1) as f32;
        let shown = |(k, sight): (usize, &Sight)| Shown {
            grey: seen.values.iter().map(|band| band[k]).sum::<f32>() / bands,
            is_of_model: matches!(sight, Sight::Seen { .. }) && self.holds(at[k]),
        };
        Ok(seen.sights.iter().enumerate().map(shown).collect())
    }
}

/// What an image shows at a cell.
#[derive(Debug, Clone, Copy)]
struct Shown {
    /// Grey value; NaN outside of the image.
    grey: f32,
    /// Whether it is the model that is seen there: the model holds, and nothing hides it.
    is_of_model: bool,
}

/// What an image shows on the grid, as far as frames of it were wanted: of a large model that is a
/// small part.
#[derive(Default)]
pub(super) struct Laid {
    /// Cells by block and, within one, row by row; `None` where nothing was wanted yet.
    blocks: HashMap<[usize; 2], Vec<Option<Shown>>>,
}

impl Laid {
    /// Lays the image on the cells of a frame that it was not laid on yet.
    pub(super) fn lay(&mut self, image: &OrthoImage, frames: &Frames<'_>, frame: Frame) -> Result<(), RegisterError> {
        let missing: Vec<[usize; 2]> = {
            let mut value = self.reader();
            frame.cells(frames.size).flatten().filter(|at| value(*at).is_none()).collect()
        };
        let values = frames.shown(image, &missing)?;
        for (at, value) in missing.into_iter().zip(values) {
            let (block, cell) = place(at);
            self.blocks.entry(block).or_insert_with(|| vec![None; BLOCK * BLOCK])[cell] = Some(value);
        }
        Ok(())
    }

    /// Returns what the image shows of the model in a frame that it was laid on; NaN where that is
    /// not the model.
    pub(super) fn picture(&self, frames: &Frames<'_>, frame: Frame) -> Grid<f32> {
        self.picture_of(frames, frame, |shown| if shown.is_of_model { shown.grey } else { f32::NAN })
    }

    /// Returns all that the image shows in a frame that it was laid on, whether it is the model or
    /// not; NaN outside of the image.
    pub(super) fn whole_picture(&self, frames: &Frames<'_>, frame: Frame) -> Grid<f32> {
        self.picture_of(frames, frame, |shown| shown.grey)
    }

    fn picture_of(&self, frames: &Frames<'_>, frame: Frame, value: impl Fn(Shown) -> f32) -> Grid<f32> {
        let mut shown = self.reader();
        let value = |at: Option<[usize; 2]>| at.and_then(&mut shown).map_or(f32::NAN, &value);
        frame.picture(frame.cells(frames.size).map(value).collect())
    }

    /// Returns a function of what a cell shows, which looks for a block only where another one
    /// was asked before.
    fn reader(&self) -> impl FnMut([usize; 2]) -> Option<Shown> {
        let mut last: ([usize; 2], Option<&Vec<Option<Shown>>>) = ([usize::MAX; 2], None);
        move |at| {
            let (block, cell) = place(at);
            if last.0 != block {
                last = (block, self.blocks.get(&block));
            }
            last.1?[cell]
        }
    }
}

/// Returns the block of a cell and its place in there.
fn place([column, row]: [usize; 2]) -> ([usize; 2], usize) {
    ([column / BLOCK, row / BLOCK], row % BLOCK * BLOCK + column % BLOCK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_over_the_border_has_no_cells_outside() {
        let cells: Vec<_> = Frame { centre: [0, 2], half: 1 }.cells([2, 3]).collect();
        let (a, b) = (|row| Some([0, row]), |row| Some([1, row]));
        assert_eq!(cells, [None, a(1), b(1), None, a(2), b(2), None, None, None]);
    }
}
