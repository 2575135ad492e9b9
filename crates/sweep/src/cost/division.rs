//! Division of a tile into parts that are swept through the height planes of their own pixels only.
//!
//! A tile with a wall between two roofs, for example, would otherwise be swept through all planes
//! between them.

use multiversion::multiversion;
use raster::Window;

use super::part::MARGIN;
use super::shift::OVERHANG;
use crate::ranges::Ranges;

/// Smallest side of a part, pixels. An RPC that is not smooth over eight pixels is broken.
pub(super) const TILE_MIN: usize = 8;
/// Fixed cost of a plane, in units of a pixel's cost.
const PLANE_PIXELS: usize = 256;
/// Returns the planes that the pixels of a tile have hypotheses on: the first one and the one after
/// the last.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn plane_span(ranges: &Ranges, tile: Window) -> (i32, i32) {
    let mut span = (i32::MAX, i32::MIN);
    for y in tile.y as usize..tile.y as usize + tile.height {
        let low = &ranges.low.row(y)[tile.x as usize..][..tile.width];
        let count = &ranges.count.row(y)[tile.x as usize..][..tile.width];
        for (low, count) in low.iter().zip(count) {
            span = (span.0.min(*low), span.1.max(low + i32::from(*count)));
        }
    }
    span
}

/// A part of a tile and the planes that it is swept through.
pub(super) struct SweptPart {
    /// The part in image coordinates.
    pub(super) window: Window,
    /// First plane and the one after the last.
    pub(super) planes: (i32, i32),
    /// Whether its pixels have no hypotheses outside these planes.
    pub(super) is_all: bool,
}

/// Appends the parts by which a tile is swept through `planes` at the least cost.
///
/// Each part is swept through those of the planes that its pixels have hypotheses on. Returns the
/// cost, in units of a pixel's cost, and the planes of all pixels of the tile.
pub(super) fn divide(
    ranges: &Ranges,
    tile: Window,
    planes: (i32, i32),
    parts: &mut Vec<SweptPart>,
) -> (usize, (i32, i32)) {
    let first = parts.len();
    let (divided, asked) = if tile.width.max(tile.height) >= 2 * TILE_MIN {
        let [(a, p), (b, q)] = halves(tile).map(|half| divide(ranges, half, planes, parts));
        (a + b, (p.0.min(q.0), p.1.max(q.1)))
    } else {
        (usize::MAX, plane_span(ranges, tile))
    };
    let own = (asked.0.max(planes.0), asked.1.min(planes.1));
    if own.0 >= own.1 {
        return (0, asked);
    }
    // Every part pays for its own margin and for registers that are filled up.
    let width = tile.width + 2 * MARGIN;
    let area = (width + width.next_multiple_of(OVERHANG)) / 2 * (tile.height + 2 * MARGIN);
    let whole = (own.1 - own.0) as usize * (area + PLANE_PIXELS) + area;
    if divided < whole {
        return (divided, asked);
    }
    parts.truncate(first);
    parts.push(SweptPart { window: tile, planes: own, is_all: own == asked });
    (whole, asked)
}

/// Returns the two halves of a tile, divided across its longer side.
pub(super) fn halves(t: Window) -> [Window; 2] {
    if t.width >= t.height {
        let w = t.width / 2;
        [Window { width: w, ..t }, Window { x: t.x + w as i64, width: t.width - w, ..t }]
    } else {
        let h = t.height / 2;
        [Window { height: h, ..t }, Window { y: t.y + h as i64, height: t.height - h, ..t }]
    }
}
