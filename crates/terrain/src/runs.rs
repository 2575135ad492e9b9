//! Cells of a mask in runs along the rows.

use std::ops::Range;

use raster::Grid;

/// Cells that vector instructions process together. The last cells of a run are computed with those
/// behind it up to a multiple of this number, whose results are not used: that takes less time than
/// one cell after the other.
pub(crate) const LANES: usize = 16;

/// Cells of a row without a gap.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Run {
    pub(crate) row: usize,
    pub(crate) columns: Range<usize>,
}

/// Returns the runs of a mask, from top to bottom and from left to right.
pub(crate) fn runs(mask: &Grid<bool>) -> Vec<Run> {
    let mut out = Vec::new();
    for row in 0..mask.height() {
        let mut first = 0;
        for part in mask.row(row).chunk_by(|a, b| a == b) {
            let columns = first..first + part.len();
            first = columns.end;
            if part[0] {
                out.push(Run { row, columns });
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_end_at_gaps_and_at_the_ends_of_rows() {
        let mask = Grid::from_vec(4, 3, b"xx.xxxxx....".iter().map(|c| *c == b'x').collect()).unwrap();
        let found: Vec<(usize, Range<usize>)> = runs(&mask).into_iter().map(|run| (run.row, run.columns)).collect();
        assert_eq!(found, [(0, 0..2), (0, 3..4), (1, 0..4)]);
    }
}
