//! The heights of one view on the map grid.

use geodesy::{LonLatHeight, MapPoint};
use multiversion::multiversion;
use raster::{GeoTransform, Grid, Window, level0_from_level};
use rayon::prelude::*;

use crate::consistency::Heights;
use crate::error::SweepError;
use crate::geometry::{LocalMap, PixelBox};
use crate::height_map::height_span;
use crate::ranges::extremes;
use crate::tiles::{paste, tiles};

/// Output grid: its placement and map projection.
pub struct GridFrame<'a> {
    /// Placement of the cells on the map.
    pub geotransform: GeoTransform,
    /// Projects a ground point to the map; `None` where the projection is undefined.
    pub map_from_ground: &'a (dyn Fn(LonLatHeight) -> Option<MapPoint> + Sync),
}

/// Surface of one view, sampled on the grid.
#[derive(Debug, Clone)]
pub struct ViewSurface {
    /// Index of the view.
    pub(super) view: usize,
    /// Grid column and row of the first cell.
    origin: [f32; 2],
    /// Height above the origin of the view's height map, metres; NaN where the view has none.
    pub height_m: Grid<f32>,
    /// Standard deviation, metres.
    pub sigma_m: Grid<f32>,
    /// Weight of each height, 0 to 1.
    pub weight: Grid<f32>,
}

/// Weight of a height at a border, against 1 inside a surface.
const BORDER_WEIGHT: f32 = 0.25;
/// Weight of a height that another one fits as well, against 1 for a distinct one. Such heights
/// decide only where no view has a distinct one.
const INDISTINCT_WEIGHT: f32 = 0.1;
/// Weight of a height where the image is blank, against 1 elsewhere. It comes from its surroundings
/// in the image and decides only where no view has seen a height.
const BLANK_WEIGHT: f32 = 1e-4;
/// Least weight of a cell's height that was seen: below that of a single one at a border that
/// another height fits as well.
pub(super) const SEEN_WEIGHT: f32 = 5e-3;
/// Share of its weight that a height has in its cell where no facet covers the centre of the cell.
const LONE_SHARE: f32 = 0.5;
/// Reach of a border beside a jump, pixels: half a patch, and the blur of the edge.
const BORDER_REACH: usize = 2;
/// Side of the tiles in which a local map replaces the exact projection to the grid, pixels.
const TILE: usize = 64;
/// A pixel placed on the grid.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    /// Column of the grid.
    x: f32,
    /// Row of the grid.
    y: f32,
    /// Height above the origin, metres; NaN if the pixel is not kept.
    h: f32,
    /// Standard deviation of the height, metres.
    sigma: f32,
    /// Weight of the height.
    weight: f32,
}

/// Vertex of a pixel that is not kept.
const NO_VERTEX: Vertex = Vertex { x: 0.0, y: 0.0, h: f32::NAN, sigma: f32::NAN, weight: 0.0 };

/// Kept pixels of one view in grid coordinates.
#[derive(Debug, Clone)]
pub struct PlacedView {
    /// Index of the view.
    pub(super) view: usize,
    vertices: Grid<Vertex>,
    /// Windows of the image, each with the box of grid cells that its facets reach: x0, y0, x1, y1.
    extents: Vec<(Window, [f32; 4])>,
}

/// Places the kept heights of one view on the grid.
///
/// A height with another one lower by more than `jump_m` beside it is at a border and gets a
/// smaller weight: patches that hold a roof's edge see the roof's height outside it too. The weight
/// grows with the confidence of the height. Heights of `blank` pixels count for next to nothing.
///
/// # Errors
/// Returns [`SweepError::Camera`] if the camera or the map projection fails inside the scene.
pub fn place_view(
    heights: Heights<'_>,
    level: u32,
    keep: &Grid<bool>,
    blank: &Grid<bool>,
    jump_m: f32,
    frame: &GridFrame<'_>,
) -> Result<PlacedView, SweepError> {
    let borders = border_weights(&heights.map.height_m, jump_m);
    let mut vertices = place(heights, level, keep, frame)?;
    let weights = borders.data().iter().zip(heights.map.confidence.data()).zip(blank.data());
    for (vertex, ((border, confidence), is_blank)) in vertices.data_mut().iter_mut().zip(weights) {
        let seen = if *is_blank { BLANK_WEIGHT } else { 1.0 };
        vertex.weight = seen * border * (INDISTINCT_WEIGHT + confidence).min(1.0);
    }
    let windows = tiles(Window::whole(vertices.width(), vertices.height()), TILE);
    let extents = windows.into_iter().filter_map(|w| Some((w, extent(&vertices, w)?))).collect();
    Ok(PlacedView { view: heights.index, vertices, extents })
}

/// Marks the cells of the grid that the given pixels of a view fall into at their heights.
///
/// # Errors
/// Returns [`SweepError::Camera`] if the camera or the map projection fails inside the scene.
pub fn mark_cells(
    heights: Heights<'_>,
    level: u32,
    pixels: &Grid<bool>,
    frame: &GridFrame<'_>,
    cells: &mut Grid<bool>,
) -> Result<(), SweepError> {
    for w in tiles(Window::whole(pixels.width(), pixels.height()), TILE) {
        let vertices = place_tile(heights, level, w, pixels, frame)?;
        for v in vertices.iter().flat_map(|tile| tile.data()).filter(|v| !v.h.is_nan() && v.x >= 0.0 && v.y >= 0.0) {
            let at = (v.x as usize, v.y as usize);
            if at.0 < cells.width() && at.1 < cells.height() {
                cells[at] = true;
            }
        }
    }
    Ok(())
}

/// Returns the weight of each height: [`BORDER_WEIGHT`] where the least height within
/// [`BORDER_REACH`] is lower by more than `jump_m`, 1 elsewhere.
fn border_weights(height_m: &Grid<f32>, jump_m: f32) -> Grid<f32> {
    let mut out = extremes(height_m, f32::INFINITY, f32::min, BORDER_REACH);
    for (weight, height) in out.data_mut().iter_mut().zip(height_m.data()) {
        *weight = if *weight < height - jump_m { BORDER_WEIGHT } else { 1.0 };
    }
    out
}

/// Returns the box of cells that the facets of a window reach; `None` if it has no vertex.
fn extent(vertices: &Grid<Vertex>, w: Window) -> Option<[f32; 4]> {
    let mut e = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
    // One more row and column, as facets belong to the window of their upper-left pixel.
    let (x1, y1) = (w.x as usize + w.width + 1, w.y as usize + w.height + 1);
    for y in w.y as usize..y1.min(vertices.height()) {
        for v in &vertices.row(y)[w.x as usize..x1.min(vertices.width())] {
            if !v.h.is_nan() {
                e = [e[0].min(v.x), e[1].min(v.y), e[2].max(v.x), e[3].max(v.y)];
            }
        }
    }
    (e[0] <= e[2]).then(|| [e[0] - 1.0, e[1] - 1.0, e[2] + 1.0, e[3] + 1.0])
}

impl PlacedView {
    /// Samples the view's surface on the cells of a window of the grid.
    ///
    /// Facets are sampled at the centres of the cells. Those with a height difference above `tear`
    /// metres are left out. A cell whose centre no facet covers has the highest of the kept pixels
    /// inside it. Cells without either, at walls and beside what the view does not see, stay void.
    pub fn rasterise(&self, cells: Window, tear: f32) -> ViewSurface {
        let (mut facets, mut points) = (ViewSurface::empty(self.view, cells), ViewSurface::empty(self.view, cells));
        let (x1, y1) = ((cells.x + cells.width as i64) as f32, (cells.y + cells.height as i64) as f32);
        for (w, e) in &self.extents {
            if e[0] < x1 && e[1] < y1 && e[2] >= cells.x as f32 && e[3] >= cells.y as f32 {
                rasterise_window(&self.vertices, *w, tear, &mut facets);
                put_points(&self.vertices, *w, &mut points);
            }
        }
        facets.complete(&points);
        facets
    }
}

/// Samples the facets that begin in a window of the image.
#[multiversion(targets("x86_64+avx2"))]
fn rasterise_window(vertices: &Grid<Vertex>, w: Window, tear: f32, facets: &mut ViewSurface) {
    for y in w.y as usize..w.y as usize + w.height {
        for x in w.x as usize..w.x as usize + w.width {
            let a = vertices[(x, y)];
            let corner = |dx, dy| vertices.get(x + dx, y + dy).copied().filter(|v| !v.h.is_nan());
            let (right, below, across) = (corner(1, 0), corner(0, 1), corner(1, 1));
            if !a.h.is_nan() {
                match (right, below, across) {
                    (Some(b), Some(c), None) => facets.facet([a, b, c], tear),
                    (_, _, Some(c)) => {
                        [right, below].into_iter().flatten().for_each(|b| facets.facet([a, b, c], tear));
                    }
                    _ => {}
                }
            } else if let (Some(b), Some(c), Some(d)) = (right, below, across) {
                facets.facet([b, c, d], tear);
            }
        }
    }
}

/// Puts the pixels of a window of the image into the cells that they fall into.
fn put_points(vertices: &Grid<Vertex>, w: Window, points: &mut ViewSurface) {
    for y in w.y as usize..w.y as usize + w.height {
        for v in vertices.row(y)[w.x as usize..][..w.width].iter().filter(|v| !v.h.is_nan()) {
            points.put(Vertex { x: v.x.round(), y: v.y.round(), weight: LONE_SHARE * v.weight, ..*v });
        }
    }
}

/// Places all kept pixels on the grid.
fn place(
    heights: Heights<'_>,
    level: u32,
    keep: &Grid<bool>,
    frame: &GridFrame<'_>,
) -> Result<Grid<Vertex>, SweepError> {
    let map = heights.map;
    let (width, height) = (map.height_m.width(), map.height_m.height());
    let windows = tiles(Window::whole(width, height), TILE);
    let parts: Vec<Option<Grid<Vertex>>> =
        windows.par_iter().map(|w| place_tile(heights, level, *w, keep, frame)).collect::<Result<_, SweepError>>()?;
    let mut out = Grid::filled(width, height, NO_VERTEX);
    for (w, part) in windows.iter().zip(&parts) {
        part.iter().for_each(|part| paste(&mut out, *w, part));
    }
    Ok(out)
}

/// Places the kept pixels of a tile on the grid; `None` if there are none.
fn place_tile(
    heights: Heights<'_>,
    level: u32,
    w: Window,
    keep: &Grid<bool>,
    frame: &GridFrame<'_>,
) -> Result<Option<Grid<Vertex>>, SweepError> {
    let map = heights.map;
    let is_kept = |y: usize| keep.row(y)[w.x as usize..][..w.width].contains(&true);
    if !(w.y as usize..w.y as usize + w.height).any(is_kept) {
        return Ok(None);
    }
    let Some(range) = height_span(map, w) else { return Ok(None) };
    let exact = |[u, v]: [f64; 2], h: f64| {
        let at = camera::ImagePoint::new(level0_from_level(u, level), level0_from_level(v, level));
        let ground = heights.view.camera.localize(at, h)?;
        let MapPoint { x, y } = (frame.map_from_ground)(ground).ok_or(camera::CameraError::NotFinite)?;
        let (column, row) = frame.geotransform.cell_from_map(x, y).ok_or(camera::CameraError::NotFinite)?;
        Ok([column, row])
    };
    let failed = |source| SweepError::Camera { view: heights.index, source };
    let local = LocalMap::fit(PixelBox::of_window(w), range, exact).map_err(failed)?;
    // A twentieth of a cell does not show in the result. A tile with a larger error is placed
    // exactly.
    let fits = local.max_error_px <= 0.05;
    let mut out = Grid::filled(w.width, w.height, NO_VERTEX);
    for y in 0..w.height {
        for x in 0..w.width {
            let at = (w.x as usize + x, w.y as usize + y);
            let h = map.height_m[at];
            if h.is_nan() || !keep[at] {
                continue;
            }
            let (p, height_m) = ([at.0 as f64, at.1 as f64], map.origin_m + f64::from(h));
            let [cx, cy] = if fits { local.at(p, height_m) } else { exact(p, height_m).map_err(failed)? };
            out[(x, y)] = Vertex { x: cx as f32, y: cy as f32, h, sigma: map.sigma_m[at], weight: 1.0 };
        }
    }
    Ok(Some(out))
}

impl ViewSurface {
    /// Returns the surface on a part of its cells, whose window counts from its first cell.
    pub(super) fn part(&self, cells: Window) -> Self {
        Self {
            view: self.view,
            origin: [self.origin[0] + cells.x as f32, self.origin[1] + cells.y as f32],
            height_m: self.height_m.window(cells, f32::NAN),
            sigma_m: self.sigma_m.window(cells, f32::NAN),
            weight: self.weight.window(cells, 0.0),
        }
    }

    pub(super) fn empty(view: usize, cells: Window) -> Self {
        Self {
            view,
            origin: [cells.x as f32, cells.y as f32],
            height_m: Grid::filled(cells.width, cells.height, f32::NAN),
            sigma_m: Grid::filled(cells.width, cells.height, f32::NAN),
            weight: Grid::filled(cells.width, cells.height, 0.0),
        }
    }

    /// Stores a height in a cell unless a higher one is there.
    #[inline(always)]
    fn put(&mut self, sample: Vertex) {
        let (column, row) = (sample.x - self.origin[0], sample.y - self.origin[1]);
        if column < 0.0 || row < 0.0 {
            return;
        }
        let at = (column as usize, row as usize);
        if at.0 >= self.height_m.width() || at.1 >= self.height_m.height() {
            return;
        }
        let own = &mut self.height_m[at];
        if own.is_nan() || *own < sample.h {
            *own = sample.h;
            self.sigma_m[at] = sample.sigma;
            self.weight[at] = sample.weight;
        }
    }

    /// Fills the cells that have no height with those of `other`.
    fn complete(&mut self, other: &Self) {
        for (i, own) in self.height_m.data_mut().iter_mut().enumerate().filter(|(_, own)| own.is_nan()) {
            *own = other.height_m.data()[i];
            self.sigma_m.data_mut()[i] = other.sigma_m.data()[i];
            self.weight.data_mut()[i] = other.weight.data()[i];
        }
    }

    /// Samples a triangle at the centres of the cells that it covers.
    #[inline(always)]
    fn facet(&mut self, [a, b, c]: [Vertex; 3], tear: f32) {
        let least = a.h.min(b.h).min(c.h);
        let greatest = a.h.max(b.h).max(c.h);
        if greatest - least > tear {
            return;
        }
        let det = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        if det.abs() < 1e-6 {
            return;
        }
        let inv = 1.0 / det;
        let (x0, x1) = (a.x.min(b.x).min(c.x).ceil(), a.x.max(b.x).max(c.x).floor());
        let (y0, y1) = (a.y.min(b.y).min(c.y).ceil(), a.y.max(b.y).max(c.y).floor());
        let mut y = y0;
        while y <= y1 {
            let mut x = x0;
            while x <= x1 {
                let (dx, dy) = (x - a.x, y - a.y);
                let s = (dx * (c.y - a.y) - dy * (c.x - a.x)) * inv;
                let t = (dy * (b.x - a.x) - dx * (b.y - a.y)) * inv;
                if s >= -1e-4 && t >= -1e-4 && s + t <= 1.0 + 1e-4 {
                    let mix = |p: f32, q: f32, r: f32| p + s * (q - p) + t * (r - p);
                    let weight = a.weight.min(b.weight).min(c.weight);
                    let (h, sigma) = (mix(a.h, b.h, c.h), mix(a.sigma, b.sigma, c.sigma));
                    self.put(Vertex { x, y, h, sigma, weight });
                }
                x += 1.0;
            }
            y += 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::{FusionConfig, fuse_views};
    use crate::height_map::HeightMap;
    use crate::testing::camera::leaning_camera;
    use crate::testing::plane::view_of_plane;

    const SIZE: usize = 80;
    const METRES_PER_DEGREE: f64 = 111_320.0;

    /// A view of waves of 3 m, on a map with the coordinates `false_origin` at (0°, 0°).
    fn placed(false_origin: [f64; 2]) -> PlacedView {
        let view = view_of_plane(leaning_camera(SIZE, [0.3, -0.2]), SIZE, 0.0);
        let mut map = HeightMap::empty(SIZE, SIZE, 40.0);
        for (i, h) in map.height_m.data_mut().iter_mut().enumerate() {
            *h = 3.0 * ((i % SIZE) as f32 * 0.1).sin() + 2.0 * ((i / SIZE) as f32 * 0.13).cos();
        }
        let heights = Heights { index: 0, view: &view, map: &map };
        let to_map = move |g: LonLatHeight| {
            let (east, north) = (g.lon_deg * METRES_PER_DEGREE, g.lat_deg * METRES_PER_DEGREE);
            Some(MapPoint { x: false_origin[0] + east, y: false_origin[1] + north })
        };
        let geotransform = GeoTransform::north_up(false_origin[0] - 20.0, false_origin[1] + 20.0, 0.5);
        let frame = GridFrame { geotransform, map_from_ground: &to_map };
        let keep = Grid::filled(SIZE, SIZE, true);
        let blank = Grid::filled(SIZE, SIZE, false);
        place_view(heights, 0, &keep, &blank, 5.0, &frame).unwrap()
    }

    fn surface(false_origin: [f64; 2]) -> ViewSurface {
        placed(false_origin).rasterise(Window::whole(80, 80), 5.0)
    }

    #[test]
    fn a_view_that_is_placed_twice_counts_once() {
        let config = FusionConfig { same_surface_m: 1.0, tear_m: 5.0, step_m: 0.5, origin_m: 40.0, tile: 256 };
        let view = placed([0.0; 2]);
        let once = fuse_views(std::slice::from_ref(&view), (80, 80), &config);
        let twice = fuse_views(&[view.clone(), view], (80, 80), &config);
        let bits = |grid: &Grid<f32>| grid.data().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&twice.height_m), bits(&once.height_m));
        assert_eq!(bits(&twice.sigma_m), bits(&once.sigma_m));
        assert_eq!(bits(&twice.confidence), bits(&once.confidence));
        assert_eq!(twice.views, once.views);
        assert!(once.views.data().iter().filter(|n| **n == 1).count() > 3000);
    }

    /// At 5,000 km the resolution of an f32 is half a metre: no absolute coordinate may pass
    /// through one.
    #[test]
    fn heights_at_utm_coordinates_are_those_at_the_origin() {
        let (near, far) = (surface([0.0, 0.0]), surface([499_980.0, 5_000_020.0]));
        let mut compared = 0;
        for (a, b) in near.height_m.data().iter().zip(far.height_m.data()) {
            assert!(a.is_nan() == b.is_nan() && (a.is_nan() || (a - b).abs() < 1e-4), "{a} {b}");
            compared += usize::from(!a.is_nan());
        }
        assert!(compared > 3000, "only {compared} cells");
    }
}
