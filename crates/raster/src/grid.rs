//! A dense row-major grid.

use rayon::prelude::*;

use crate::Window;

/// Raster of `width × height` cells in row-major order. `(column, row)` = (0, 0) is the upper-left
/// pixel.
///
/// ```
/// use raster::Grid;
///
/// let mut grid = Grid::filled(3, 2, 0.0);
/// grid[(2, 1)] = 7.5;
/// assert_eq!(grid.row(1), [0.0, 0.0, 7.5]);
/// assert_eq!(grid.get(3, 0), None);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

impl<T: Copy> Grid<T> {
    /// Returns a grid with every cell set to `value`.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// Copies a window, which may reach outside the grid. Cells there are set to `padding`.
    pub fn window(&self, window: Window, padding: T) -> Self {
        let mut part = Self::filled(window.width, window.height, padding);
        if let Some(shared) = Window::whole(self.width, self.height).intersection(&window) {
            for y in shared.y..shared.y + shared.height as i64 {
                let (from, to) = (shared.x as usize, (shared.x - window.x) as usize);
                let cells = &self.row(y as usize)[from..from + shared.width];
                part.row_mut((y - window.y) as usize)[to..to + shared.width].copy_from_slice(cells);
            }
        }
        part
    }

    /// Returns the grid with columns and rows exchanged, so that a pass along rows also serves for
    /// columns.
    pub fn transposed(&self) -> Self
    where
        T: Send + Sync,
    {
        let mut data = self.data.clone();
        data.par_chunks_mut(self.height.max(1)).enumerate().for_each(|(column, cells)| {
            cells.iter_mut().enumerate().for_each(|(row, cell)| *cell = self.data[row * self.width + column]);
        });
        Self { width: self.height, height: self.width, data }
    }
}

impl Grid<f32> {
    /// Sets the cells whose index `is_void` accepts to NaN.
    ///
    /// ```
    /// let mut heights = raster::Grid::filled(2, 1, 5.0f32);
    /// heights.void_where(|i| i == 1);
    /// assert!(heights.data()[0] == 5.0 && heights.data()[1].is_nan());
    /// ```
    pub fn void_where(&mut self, is_void: impl Fn(usize) -> bool) {
        self.data.iter_mut().enumerate().filter(|(i, _)| is_void(*i)).for_each(|(_, value)| *value = f32::NAN);
    }

    /// Returns the grid with NaN in the cells whose index `is_void` accepts.
    pub fn without(&self, is_void: impl Fn(usize) -> bool) -> Self {
        let mut kept = self.clone();
        kept.void_where(is_void);
        kept
    }
}

impl<T: PartialOrd> Grid<T> {
    /// Returns whether a cell that lies not on the border is above its eight neighbours.
    ///
    /// ```
    /// let grid = raster::Grid::from_vec(3, 3, vec![1, 2, 1, 0, 3, 2, 1, 1, 0]).unwrap();
    /// assert!(grid.is_peak((1, 1)));
    /// ```
    pub fn is_peak(&self, (x, y): (usize, usize)) -> bool {
        let own = &self[(x, y)];
        (y - 1..=y + 1).all(|v| (x - 1..=x + 1).all(|u| (u, v) == (x, y) || self[(u, v)] < *own))
    }
}

impl<T> Grid<T> {
    /// Returns a grid over row-major data, or `None` if the length is not `width · height`.
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (data.len() == width.checked_mul(height)?).then_some(Self { width, height, data })
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns all cells, row after row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// Returns all cells for writing, row after row.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Returns one row.
    pub fn row(&self, row: usize) -> &[T] {
        &self.data[row * self.width..(row + 1) * self.width]
    }

    /// Returns one row for writing.
    pub fn row_mut(&mut self, row: usize) -> &mut [T] {
        &mut self.data[row * self.width..(row + 1) * self.width]
    }

    /// Returns the cells, row after row, and drops the grid.
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }

    /// Returns a cell, or `None` outside the grid.
    pub fn get(&self, column: usize, row: usize) -> Option<&T> {
        (column < self.width && row < self.height).then(|| &self.data[row * self.width + column])
    }

    /// Returns a grid of the same shape with `f` applied to every cell.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Grid<U> {
        Grid { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }

    /// Returns a grid of what `f` makes of each cell and of the same cell of a grid of this size.
    ///
    /// ```
    /// let [upper, lower] = [5.0, 3.0].map(|height_m| raster::Grid::filled(2, 2, height_m));
    /// assert_eq!(upper.zip_map(&lower, |a, b| a - b).data(), [2.0; 4]);
    /// ```
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn zip_map<U, V>(&self, other: &Grid<U>, mut f: impl FnMut(&T, &U) -> V) -> Grid<V> {
        assert_eq!((self.width, self.height), (other.width, other.height), "two grids of one size");
        let data = self.data.iter().zip(&other.data).map(|(a, b)| f(a, b)).collect();
        Grid { width: self.width, height: self.height, data }
    }
}

impl<T> std::ops::Index<(usize, usize)> for Grid<T> {
    type Output = T;

    /// Returns the cell at (column, row).
    fn index(&self, (column, row): (usize, usize)) -> &T {
        debug_assert!(column < self.width);
        &self.data[row * self.width + column]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Grid<T> {
    fn index_mut(&mut self, (column, row): (usize, usize)) -> &mut T {
        debug_assert!(column < self.width);
        &mut self.data[row * self.width + column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_pad_what_lies_outside() {
        let grid = Grid::from_vec(3, 2, vec![1, 2, 3, 4, 5, 6]).unwrap();
        let part = grid.window(Window { x: -1, y: 1, width: 3, height: 2 }, 0);
        assert_eq!(part.data(), [0, 4, 5, 0, 0, 0]);
        assert_eq!(grid.window(Window::whole(3, 2), 0), grid);
        assert_eq!(grid.window(Window { x: 9, y: 9, width: 2, height: 1 }, 7).data(), [7, 7]);
        assert_eq!(grid.window(Window { x: i64::MAX, y: i64::MIN, width: 1, height: 1 }, 7).data(), [7]);
    }

    #[test]
    fn columns_become_rows() {
        let grid = Grid::from_vec(3, 2, vec![1, 2, 3, 4, 5, 6]).unwrap();
        assert_eq!(grid.transposed(), Grid::from_vec(2, 3, vec![1, 4, 2, 5, 3, 6]).unwrap());
        assert_eq!(grid.transposed().transposed(), grid);
        assert_eq!(Grid::filled(0, 4, 1).transposed(), Grid::filled(4, 0, 1));
    }
}
