//! A dense row-major grid.

use crate::Window;

/// A `width × height` raster in row-major order; `(column, row)` = (0, 0) is the upper-left pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

impl<T: Copy> Grid<T> {
    /// A grid with every cell set to `value`.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// A copy of a window, which may reach outside: cells there are `padding`.
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
}

impl<T> Grid<T> {
    /// A grid over existing row-major data; `None` when the length is not `width · height`.
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (data.len() == width.checked_mul(height)?).then_some(Self { width, height, data })
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All cells, row after row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All cells, row after row, to change.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// One row.
    pub fn row(&self, row: usize) -> &[T] {
        &self.data[row * self.width..(row + 1) * self.width]
    }

    /// One row, to change.
    pub fn row_mut(&mut self, row: usize) -> &mut [T] {
        &mut self.data[row * self.width..(row + 1) * self.width]
    }

    /// The cells by themselves.
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }

    /// A cell, or `None` outside the grid.
    pub fn get(&self, column: usize, row: usize) -> Option<&T> {
        (column < self.width && row < self.height).then(|| &self.data[row * self.width + column])
    }

    /// A grid of the same shape with `f` applied to every cell.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Grid<U> {
        Grid { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }
}

impl<T> std::ops::Index<(usize, usize)> for Grid<T> {
    type Output = T;

    /// The cell at (column, row).
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
}
