//! On which sides walls bound a region.

use raster::Grid;

/// Distance outside of a region within which a wall has ended, and inside within which it has
/// begun, metres: walls of surfaces made from images are ramps of up to three metres.
const OUTSIDE_M: f64 = 3.0;
const INSIDE_M: f64 = 1.5;
/// Share of the border on one side along which there must be a wall: neighbours and trees hide the
/// rest.
const WALL_SHARE: f64 = 0.3;
/// Slope across the border, rise per run, up to which standing cells outside go on level: another
/// roof, clutter or a crown hides the wall there. Steep ground that stands above a wrong terrain
/// goes on with its slope.
const LEVEL: f32 = 0.2;
/// Sides that need no wall: a house in a slope has none uphill.
const OPEN_SIDES: usize = 1;

/// Whether walls of `least_m` and more bound a region on several sides: on all that can be seen
/// except one. A slope that goes on across the border is no wall, and what `stands` level outside
/// hides it. `numbers` are those of the regions of all cells. A region whose sides are all out of
/// sight has walls.
pub(crate) fn has_walls(
    surface: &Grid<f32>,
    stands: &Grid<bool>,
    numbers: &Grid<u32>,
    cells: &[usize],
    cell_m: f64,
    least_m: f32,
) -> bool {
    let steps = |metres: f64| ((metres / cell_m).round() as i64).max(1);
    let (outside, inside) = (steps(OUTSIDE_M), steps(INSIDE_M));
    let width = surface.width();
    let Some(&first) = cells.first() else { return false };
    let number = numbers.data()[first];
    let at = |x: i64, y: i64| {
        let place = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        Some((*numbers.get(place.0, place.1)? == number, surface[place], stands[place]))
    };
    let (mut walls, mut seen) = ([0usize; 4], [0usize; 4]);
    for &cell in cells {
        let (x, y) = ((cell % width) as i64, (cell / width) as i64);
        for (side, (dx, dy)) in [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().enumerate() {
            let out = (1..=outside).map_while(|k| at(x + k * dx, y + k * dy).filter(|(is_own, ..)| !is_own));
            let low = out.map(|(_, height, _)| height).fold(f32::NAN, f32::min);
            if low.is_nan() {
                continue;
            }
            let own = (0..=inside).map_while(|k| at(x - k * dx, y - k * dy).filter(|(is_own, ..)| *is_own));
            let drop = own.map(|(_, height, _)| height).fold(f32::NAN, f32::max) - low;
            // The surface further out and further in tells how much of the drop is its slope.
            let height = |k: i64| at(x + k * dx, y + k * dy).map_or(f32::NAN, |(_, height, _)| height);
            let (within, beyond) = (height(-inside - outside) - height(-inside), height(outside) - height(2 * outside));
            let slope = within.min(beyond).max(0.0) / outside as f32;
            let is_wall = drop - slope * (inside + outside) as f32 >= least_m;
            let is_standing = |k: i64| at(x + k * dx, y + k * dy).is_some_and(|(.., stands)| stands);
            let is_hidden = slope < LEVEL * cell_m as f32 && (1..=outside).all(is_standing);
            if is_wall || !is_hidden {
                seen[side] += 1;
                walls[side] += usize::from(is_wall);
            }
        }
    }
    let is_wall = |side: usize| walls[side] as f64 >= WALL_SHARE * seen[side] as f64;
    let sides: Vec<usize> = (0..4).filter(|side| seen[*side] > 0).collect();
    sides.iter().filter(|side| !is_wall(**side)).count() <= OPEN_SIDES && sides.iter().any(|side| is_wall(*side))
        || sides.is_empty()
}
