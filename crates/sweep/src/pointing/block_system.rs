//! Sparse symmetric systems of equations with one block of unknowns per view.
//!
//! A block of the matrix exists where two views share a track. The system is solved by Cholesky's
//! method on blocks. The view with the fewest neighbours is eliminated first (minimum degree),
//! which keeps the number of new blocks small: the cost of a strip of images grows with its length,
//! and not with its cube. Sums are formed in a fixed order, so that the result has the same bytes
//! always.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::SMatrix;

use super::model::{PARAMETERS, Parameters};

type Block = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// A system of equations. Only the lower half of its matrix is kept.
pub(super) struct BlockSystem {
    /// Blocks by row and column; the row is the larger one, or equal.
    blocks: BTreeMap<(usize, usize), Block>,
    right: Vec<Parameters>,
}

/// A view that was eliminated: its factor, its reduced right side, and the blocks that tie it to
/// the views that were eliminated later.
struct Eliminated {
    view: usize,
    factor: Block,
    right: Parameters,
    later: Vec<(usize, Block)>,
}

impl BlockSystem {
    /// Makes the system of independent unknowns with `weights`, whose right side is `right`.
    pub(super) fn diagonal(weights: &[Parameters], right: Vec<Parameters>) -> Self {
        let block = |(view, weight): (usize, &Parameters)| ((view, view), Block::from_diagonal(weight));
        Self { blocks: weights.iter().enumerate().map(block).collect(), right }
    }

    /// Adds to the block of a row and a column that is not larger.
    pub(super) fn add(&mut self, row: usize, column: usize, block: &Block) {
        *self.blocks.entry((row, column)).or_insert_with(Block::zeros) += block;
    }

    /// Adds to the right side of a view.
    pub(super) fn add_right(&mut self, view: usize, part: &Parameters) {
        self.right[view] += part;
    }

    /// Solves the system. Returns `None` when its matrix is not positive definite.
    pub(super) fn solve(mut self) -> Option<Vec<Parameters>> {
        let mut neighbours = vec![BTreeSet::new(); self.right.len()];
        for &(row, column) in self.blocks.keys().filter(|(row, column)| row != column) {
            neighbours[row].insert(column);
            neighbours[column].insert(row);
        }
        let mut waiting: BTreeSet<(usize, usize)> =
            neighbours.iter().enumerate().map(|(view, near)| (near.len(), view)).collect();
        let mut eliminated = Vec::with_capacity(self.right.len());
        while let Some((_, view)) = waiting.pop_first() {
            let near = std::mem::take(&mut neighbours[view]);
            eliminated.push(self.eliminate(view, &near)?);
            for &other in &near {
                waiting.remove(&(neighbours[other].len(), other));
                neighbours[other].remove(&view);
                neighbours[other].extend(near.iter().filter(|&&v| v != other));
                waiting.insert((neighbours[other].len(), other));
            }
        }
        Some(substituted(&eliminated, self.right.len()))
    }

    /// Eliminates a view from the equations of its neighbours.
    fn eliminate(&mut self, view: usize, near: &BTreeSet<usize>) -> Option<Eliminated> {
        let factor = self.blocks.remove(&(view, view))?.cholesky()?.unpack();
        let right = factor.solve_lower_triangular(&self.right[view])?;
        let mut later: Vec<(usize, Block)> = Vec::with_capacity(near.len());
        for &other in near {
            // The block in the row of the view and the column of the other.
            let block = if view > other {
                self.blocks.remove(&(view, other))?
            } else {
                self.blocks.remove(&(other, view))?.transpose()
            };
            later.push((other, factor.solve_lower_triangular(&block)?));
        }
        for (i, (row, from_row)) in later.iter().enumerate() {
            self.right[*row] -= from_row.transpose() * right;
            for (column, from_column) in &later[..=i] {
                self.add(*row, *column, &-(from_row.transpose() * from_column));
            }
        }
        Some(Eliminated { view, factor, right, later })
    }
}

/// Returns the unknowns, from the view eliminated last to the first.
fn substituted(eliminated: &[Eliminated], views: usize) -> Vec<Parameters> {
    let mut x = vec![Parameters::zeros(); views];
    for one in eliminated.iter().rev() {
        let known: Parameters = one.later.iter().map(|(other, block)| block * x[*other]).sum();
        x[one.view] = one.factor.tr_solve_lower_triangular(&(one.right - known)).unwrap_or_else(Parameters::zeros);
    }
    x
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// A number between −0.5 and 0.5 that follows from its position.
    fn number(i: usize) -> f64 {
        (i.wrapping_mul(2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    #[test]
    fn a_ring_of_views_has_the_solution_of_the_whole_matrix() {
        const VIEWS: usize = 9;
        let part = |i: usize| Parameters::from_fn(|k, _| number(31 * i + k));
        let right: Vec<Parameters> = (0..VIEWS).map(part).collect();
        let mut system = BlockSystem::diagonal(&[Parameters::repeat(9.0); VIEWS], right.clone());
        let mut whole = DMatrix::from_diagonal_element(VIEWS * PARAMETERS, VIEWS * PARAMETERS, 9.0);
        for a in 0..VIEWS {
            let b = (a + 1) % VIEWS;
            let (row, column) = (a.max(b), a.min(b));
            let block = Block::from_fn(|i, j| number(97 * a + 7 * i + j));
            system.add(row, column, &block);
            let (i, j) = (row * PARAMETERS, column * PARAMETERS);
            whole.view_mut((i, j), (PARAMETERS, PARAMETERS)).copy_from(&block);
            whole.view_mut((j, i), (PARAMETERS, PARAMETERS)).copy_from(&block.transpose());
        }
        let flat = DVector::from_iterator(VIEWS * PARAMETERS, right.iter().flat_map(|p| p.iter().copied()));
        let expected = whole.lu().solve(&flat).unwrap();
        let found = system.solve().unwrap();
        for (i, value) in found.iter().flat_map(|p| p.iter()).enumerate() {
            assert!((value - expected[i]).abs() < 1e-12, "{i}: {value} {}", expected[i]);
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_solution() {
        let system = BlockSystem::diagonal(&[Parameters::repeat(-1.0)], vec![Parameters::zeros()]);
        assert!(system.solve().is_none());
    }
}
