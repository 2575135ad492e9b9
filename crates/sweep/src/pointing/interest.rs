//! Points worth matching: corners by the smaller eigenvalue of the structure tensor (Shi and Tomasi
//! 1994), spread evenly over the image.

use raster::{Grid, Window};

/// Half width of the window over which gradients are summed, pixels.
const WINDOW: usize = 3;

/// Finds the strongest corner of every `cell × cell` square of a part of the image, at least
/// `border` pixels inside the image.
///
/// Corners are (column, row), the strongest first. Squares without texture above the noise have
/// none.
pub(crate) fn corners(image: &Grid<f32>, part: Window, cell: usize, border: usize, noise: f32) -> Vec<[usize; 2]> {
    let (w, h) = (image.width(), image.height());
    let border = border.max(WINDOW + 1);
    let ends = |from: i64, length: usize, size: usize| {
        let from = from as usize;
        from.max(border)..(from + length).min(size.saturating_sub(border))
    };
    let (columns, rows) = (ends(part.x, part.width, w), ends(part.y, part.height, h));
    let mut found = Vec::new();
    for y0 in rows.clone().step_by(cell) {
        for x0 in columns.clone().step_by(cell) {
            let xs = x0..(x0 + cell).min(columns.end);
            let ys = y0..(y0 + cell).min(rows.end);
            found.extend(strongest(image, xs, ys, noise));
        }
    }
    found.sort_by(|a: &([usize; 2], f32), b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    found.into_iter().map(|(p, _)| p).collect()
}

/// Finds the strongest corner of a square.
fn strongest(
    image: &Grid<f32>,
    xs: std::ops::Range<usize>,
    ys: std::ops::Range<usize>,
    noise: f32,
) -> Option<([usize; 2], f32)> {
    // Every second pixel is enough: the response of a corner is wider than that.
    let candidates = ys.step_by(2).flat_map(|y| xs.clone().step_by(2).map(move |x| [x, y]));
    candidates
        .map(|p| (p, response(image, p)))
        .filter(|(_, r)| *r > 4.0 * noise * noise)
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Computes the smaller eigenvalue of the mean structure tensor around a pixel; 0 next to invalid
/// pixels.
fn response(image: &Grid<f32>, [x, y]: [usize; 2]) -> f32 {
    let (mut xx, mut xy, mut yy) = (0.0f32, 0.0, 0.0);
    for v in y - WINDOW..=y + WINDOW {
        for u in x - WINDOW..=x + WINDOW {
            let gx = 0.5 * (image[(u + 1, v)] - image[(u - 1, v)]);
            let gy = 0.5 * (image[(u, v + 1)] - image[(u, v - 1)]);
            xx += gx * gx;
            xy += gx * gy;
            yy += gy * gy;
        }
    }
    let n = ((2 * WINDOW + 1) * (2 * WINDOW + 1)) as f32;
    let (a, b, c) = (xx / n, xy / n, yy / n);
    let root = (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let smaller = 0.5 * (a + c) - root;
    if smaller.is_finite() { smaller } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_is_found_and_an_edge_is_not() {
        let mut g = Grid::filled(64, 64, 0.0f32);
        for y in 32..64 {
            for x in 20..64 {
                g[(x, y)] = 100.0;
            }
        }
        let found = corners(&g, Window::whole(64, 64), 64, 4, 1.0);
        assert_eq!(found.len(), 1);
        assert!(found[0][0].abs_diff(20) <= 4 && found[0][1].abs_diff(32) <= 4, "{found:?}");
    }
}
