//! Division of an area into square tiles, and their reassembly.

use raster::{Grid, Window};

/// Returns the windows of side `side` that cover `area`, row after row. The last ones may be
/// smaller.
pub(crate) fn tiles(area: Window, side: usize) -> Vec<Window> {
    tiles_on(area, side, [0; 2])
}

/// Returns the windows of a lattice of squares of side `side` that cover `area`, row after row. The
/// first pixel of the area is that column and row of the lattice which `first` names. The windows
/// at the borders may be smaller.
pub(crate) fn tiles_on(area: Window, side: usize, first: [usize; 2]) -> Vec<Window> {
    let cuts = |from: i64, length: usize, first: usize| {
        let before = first % side;
        let ends = (side - before..).step_by(side).take_while(move |end| *end < length).chain([length]);
        ends.filter(|end| *end > 0).scan(0, move |start, end| {
            let cut = (from + *start as i64, end - *start);
            *start = end;
            Some(cut)
        })
    };
    let rows = cuts(area.y, area.height, first[1]);
    let in_row = |(y, height)| cuts(area.x, area.width, first[0]).map(move |(x, width)| Window { x, y, width, height });
    rows.flat_map(in_row).collect()
}

/// Copies `part` into `whole` at the window `at`, which must lie inside.
pub(crate) fn paste<T: Copy>(whole: &mut Grid<T>, at: Window, part: &Grid<T>) {
    for y in 0..at.height {
        whole.row_mut(at.y as usize + y)[at.x as usize..][..at.width].copy_from_slice(part.row(y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_of_a_part_are_those_of_the_whole() {
        let whole = tiles(Window::whole(300, 200), 64);
        assert_eq!(whole.len(), 20);
        let part = Window { x: 70, y: 64, width: 140, height: 136 };
        let cut: Vec<Window> = whole.iter().filter_map(|tile| tile.intersection(&part)).collect();
        let moved = |w: Window| Window { x: w.x + part.x, y: w.y + part.y, ..w };
        let own = tiles_on(Window::whole(part.width, part.height), 64, [70, 64]);
        assert_eq!(own.into_iter().map(moved).collect::<Vec<_>>(), cut);
        assert_eq!(tiles_on(Window::whole(10, 5), 64, [60, 0]).len(), 2);
        assert!(tiles(Window::whole(0, 5), 64).is_empty());
    }
}
