//! Division of an area into square tiles, and their reassembly.

use raster::{Grid, Window};

/// Returns the windows of side `side` that cover `area`, row after row. The last ones may be
/// smaller.
pub(crate) fn tiles(area: Window, side: usize) -> Vec<Window> {
    let mut out = Vec::new();
    for y in (0..area.height).step_by(side) {
        for x in (0..area.width).step_by(side) {
            out.push(Window {
                x: area.x + x as i64,
                y: area.y + y as i64,
                width: side.min(area.width - x),
                height: side.min(area.height - y),
            });
        }
    }
    out
}

/// Copies `part` into `whole` at the window `at`, which must lie inside.
pub(crate) fn paste<T: Copy>(whole: &mut Grid<T>, at: Window, part: &Grid<T>) {
    for y in 0..at.height {
        whole.row_mut(at.y as usize + y)[at.x as usize..][..at.width].copy_from_slice(part.row(y));
    }
}
