//! A dense row-major grid.

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
