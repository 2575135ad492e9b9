//! The outlines of sets of cells.

use std::collections::BTreeMap;

/// A corner of cells: column and row of the cell to its lower right.
type Corner = (i64, i64);

/// Returns the outlines of a set of cells as polygons: each has its outer ring first, then its
/// holes. Cells that touch at a corner only are apart.
///
/// `cells` are indices into a grid of `width` columns. Rings are in cells, with the centre of the
/// first cell at (0, 0), so that corners lie at halves. They end at the corner at which they begin.
/// With rows counted downwards, outer rings turn counter-clockwise and holes clockwise when rows
/// are drawn upwards, as on a map.
///
/// ```
/// // Three cells of a grid of four columns.
/// let polygons = raster::outlines(&[0, 1, 4], 4);
/// assert_eq!(polygons.len(), 1);
/// assert_eq!(polygons[0][0].len(), 7);
/// ```
pub fn outlines(cells: &[usize], width: usize) -> Vec<Vec<Vec<(f64, f64)>>> {
    let place = |at: usize| ((at % width) as i64, (at / width) as i64);
    let set: std::collections::BTreeSet<Corner> = cells.iter().map(|at| place(*at)).collect();
    // Edges by their first corners; the set lies to the left when rows are drawn downwards from the
    // top of a map.
    let mut edges: BTreeMap<Corner, Vec<Corner>> = BTreeMap::new();
    for &(x, y) in &set {
        let sides = [
            ((x, y - 1), (x + 1, y), (x, y)),
            ((x - 1, y), (x, y), (x, y + 1)),
            ((x, y + 1), (x, y + 1), (x + 1, y + 1)),
            ((x + 1, y), (x + 1, y + 1), (x + 1, y)),
        ];
        for (beside, from, to) in sides {
            if !set.contains(&beside) {
                edges.entry(from).or_default().push(to);
            }
        }
    }
    let mut rings = Vec::new();
    while let Some((&start, _)) = edges.first_key_value() {
        if let Some(ring) = ring_from(start, &mut edges) {
            rings.push(ring);
        }
    }
    grouped(rings)
}

/// Takes the edges of one ring. Where two edges begin, the one that turns left stays with its cell.
fn ring_from(start: Corner, edges: &mut BTreeMap<Corner, Vec<Corner>>) -> Option<Vec<(f64, f64)>> {
    let (mut at, mut heading, mut corners) = (start, None::<(i64, i64)>, Vec::new());
    loop {
        let open = edges.get_mut(&at)?;
        let turn = |to: &Corner| match heading {
            // The cross product of a left turn is negative, because rows count downwards.
            Some((dx, dy)) => dx * (to.1 - at.1) - dy * (to.0 - at.0),
            None => 0,
        };
        let chosen = (0..open.len()).min_by_key(|k| turn(&open[*k]))?;
        let to = open.swap_remove(chosen);
        if open.is_empty() {
            edges.remove(&at);
        }
        let step = (to.0 - at.0, to.1 - at.1);
        if heading != Some(step) {
            corners.push((at.0 as f64 - 0.5, at.1 as f64 - 0.5));
        }
        (at, heading) = (to, Some(step));
        if at == start {
            corners.push(corners[0]);
            return Some(corners);
        }
    }
}

/// Puts holes behind the outer rings that hold them.
fn grouped(rings: Vec<Vec<(f64, f64)>>) -> Vec<Vec<Vec<(f64, f64)>>> {
    let area = |ring: &[(f64, f64)]| -> f64 { ring.windows(2).map(|w| w[0].0 * w[1].1 - w[1].0 * w[0].1).sum() };
    let (outer, holes): (Vec<_>, Vec<_>) = rings.into_iter().partition(|ring| area(ring) < 0.0);
    let mut polygons: Vec<Vec<Vec<(f64, f64)>>> = outer.into_iter().map(|ring| vec![ring]).collect();
    for hole in holes {
        // A point just beside the first edge, outside of the hole's own cells.
        let (a, b) = (hole[0], hole[1]);
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let (dx, dy) = ((b.0 - a.0) / length, (b.1 - a.1) / length);
        let point = (a.0 + 0.5 * dx + 0.25 * dy, a.1 + 0.5 * dy - 0.25 * dx);
        // Outer rings within the hole do not hold it; of those that do, the smallest is its own.
        let holder = polygons
            .iter_mut()
            .filter(|polygon| is_inside(point, &polygon[0]))
            .min_by(|a, b| area(&a[0]).abs().total_cmp(&area(&b[0]).abs()));
        if let Some(polygon) = holder {
            polygon.push(hole);
        }
    }
    polygons
}

fn is_inside((x, y): (f64, f64), ring: &[(f64, f64)]) -> bool {
    let crosses = |w: &[(f64, f64)]| {
        let ((x0, y0), (x1, y1)) = (w[0], w[1]);
        (y0 > y) != (y1 > y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    };
    ring.windows(2).filter(|w| crosses(w)).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, mark_inside};

    /// The polygons of any set hold exactly its cells again.
    #[test]
    fn outlines_hold_their_cells_again() {
        let (width, height) = (23, 17);
        for seed in 0..40u64 {
            let is_in = |at: &usize| (*at as u64 * 7 + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 61 < 2 + seed % 5;
            let cells: Vec<usize> = (0..width * height).filter(is_in).collect();
            let polygons = outlines(&cells, width);
            let mut count = Grid::filled(width, height, 0);
            for polygon in &polygons {
                let mut inside = Grid::filled(width, height, false);
                mark_inside(polygon, &mut inside);
                count.data_mut().iter_mut().zip(inside.data()).for_each(|(n, inside)| *n += u8::from(*inside));
                assert!(polygon.iter().all(|ring| ring.first() == ring.last()));
            }
            for at in 0..width * height {
                assert_eq!(count.data()[at], u8::from(cells.contains(&at)), "seed {seed}, cell {at}");
            }
        }
    }

    #[test]
    fn a_ring_of_cells_has_a_hole() {
        let cells = [0, 1, 2, 5, 7, 10, 11, 12];
        let polygons = outlines(&cells, 5);
        assert_eq!((polygons.len(), polygons[0].len()), (1, 2));
        assert_eq!(polygons[0][1].len(), 5);
    }
}
