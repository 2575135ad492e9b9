//! The front-to-back pass over the tiles of an image: the weight of each splat in each pixel.
//!
//! A splat's opacity at a pixel is α e^(−q/2) with q the squared distance in its image covariance J
//! Σ Jᵀ + 0.3 px² (the low-pass of Kerbl et al. 2023, whose constants are kept: nothing below
//! 1/255, at most 0.99, an end below a transmittance of 10⁻⁴). Its weight is the opacity times the
//! transmittance of the splats in front. Splats are ordered by depth, then by index. Tiles are
//! independent, so the result does not depend on the number of threads.

use crs::CrsError;
use gaussian::Splat;
use rayon::prelude::*;

use super::SplatCamera;
use super::camera::Projection;

/// Side of a tile, pixels.
pub(super) const TILE: usize = 16;
/// Number of pixels of a tile.
pub(super) const TILE_PIXELS: usize = TILE * TILE;

/// Least variance in the image, px², so that a splat much smaller than a pixel still falls on one.
const VARIANCE_MIN: f64 = 1e-3;
const ALPHA_MIN: f32 = 1.0 / 255.0;
const ALPHA_MAX: f32 = 0.99;
const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Sine of the angle between the tangents in the image below which a splat counts as seen edge-on.
const EDGE_ON: f64 = 0.02;
/// Number of splats projected at a time.
const CHUNK: usize = 4096;

/// A splat in the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Footprint {
    /// Index of the splat.
    pub(super) splat: u32,
    centre: [f32; 2],
    /// Inverse covariance: xx, xy, yy.
    conic: [f32; 3],
    /// Half of the size of its bounding box, pixels.
    half: [f32; 2],
    opacity: f32,
    /// Local height of the centre, and its change per column and row on the plane of the splat,
    /// metres.
    height: f32,
    slope: [f32; 2],
    depth: f64,
}

/// The splats of an image, by tiles.
pub(super) struct Arrangement {
    width: usize,
    height: usize,
    footprints: Vec<Footprint>,
    /// Footprints that touch each tile, front to back.
    tiles: Vec<Vec<u32>>,
}

/// The part of one splat in one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Pixel within the tile.
    pub(super) pixel: u32,
    /// Index in the tile's list.
    pub(super) slot: u32,
    pub(super) weight: f32,
    /// Local height of the splat's plane at the pixel.
    pub(super) height: f32,
}

impl Arrangement {
    /// Projects splats and sorts them into tiles.
    pub(super) fn new(splats: &[Splat], camera: &impl SplatCamera) -> Result<Self, CrsError> {
        let (width, height) = camera.size();
        let low_pass = camera.low_pass_px2().max(VARIANCE_MIN);
        let chunks: Result<Vec<Vec<Footprint>>, CrsError> = splats
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(chunk, part)| {
                let positions: Vec<[f64; 3]> = part.iter().map(|s| s.position.map(f64::from)).collect();
                let seen = camera.project(&positions)?;
                let numbered = (chunk * CHUNK..).zip(part).zip(seen);
                let made =
                    numbered.filter_map(|((index, splat), seen)| footprint(index as u32, splat, &seen?, low_pass));
                Ok(made.filter(|f| f.touches(width, height)).collect())
            })
            .collect();
        let mut footprints = chunks?.concat();
        footprints.par_sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then(a.splat.cmp(&b.splat)));
        let across = width.div_ceil(TILE);
        let mut tiles = vec![Vec::new(); across * height.div_ceil(TILE)];
        for (index, footprint) in footprints.iter().enumerate() {
            let [columns, rows] = footprint.tiles(width, height);
            for row in rows {
                for column in columns.clone() {
                    tiles[row * across + column].push(index as u32);
                }
            }
        }
        Ok(Self { width, height, footprints, tiles })
    }

    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Runs over all tiles in parallel and returns the results in the order of the tiles.
    pub(super) fn map_tiles<T: Send>(&self, run: impl Fn(&Tile<'_>) -> T + Sync) -> Vec<T> {
        let across = self.width.div_ceil(TILE);
        let tile = |(index, list): (usize, &Vec<u32>)| {
            let (left, top) = (index % across * TILE, index / across * TILE);
            let (columns, rows) = (TILE.min(self.width - left), TILE.min(self.height - top));
            run(&Tile { arrangement: self, list, left, top, columns, rows })
        };
        self.tiles.par_iter().enumerate().map(tile).collect()
    }
}

/// A tile of an image with its splats.
pub(super) struct Tile<'a> {
    arrangement: &'a Arrangement,
    list: &'a [u32],
    pub(super) left: usize,
    pub(super) top: usize,
    columns: usize,
    rows: usize,
}

impl Tile<'_> {
    /// Splats of the tile's list.
    pub(super) fn splats(&self) -> impl Iterator<Item = u32> + '_ {
        self.list.iter().map(|&f| self.arrangement.footprints[f as usize].splat)
    }

    /// Number of splats in the tile's list.
    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// Returns the pixels of the tile that are in the image: index within the tile, column, row.
    pub(super) fn pixels(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        (0..self.rows).flat_map(move |r| (0..self.columns).map(move |c| (r * TILE + c, self.left + c, self.top + r)))
    }

    /// Returns all parts of splats in pixels, front to back in every pixel.
    pub(super) fn parts(&self, parts: &mut Vec<Part>) {
        parts.clear();
        let mut transmittance = [1.0f32; TILE_PIXELS];
        for (slot, &index) in self.list.iter().enumerate() {
            let f = &self.arrangement.footprints[index as usize];
            let range = |centre: f32, half: f32, first: usize, count: usize| {
                let low = (centre - half - first as f32).ceil().max(0.0) as usize;
                let high = (centre + half - first as f32).floor() + 1.0;
                low..(high.max(0.0) as usize).min(count)
            };
            for row in range(f.centre[1], f.half[1], self.top, self.rows) {
                let dv = (self.top + row) as f32 - f.centre[1];
                for column in range(f.centre[0], f.half[0], self.left, self.columns) {
                    let du = (self.left + column) as f32 - f.centre[0];
                    let pixel = row * TILE + column;
                    let q = f.conic[0] * du * du + 2.0 * f.conic[1] * du * dv + f.conic[2] * dv * dv;
                    let alpha = (f.opacity * (-0.5 * q).exp()).min(ALPHA_MAX);
                    if alpha < ALPHA_MIN || transmittance[pixel] < TRANSMITTANCE_MIN {
                        continue;
                    }
                    parts.push(Part {
                        pixel: pixel as u32,
                        slot: slot as u32,
                        weight: alpha * transmittance[pixel],
                        height: f.height + f.slope[0] * du + f.slope[1] * dv,
                    });
                    transmittance[pixel] *= 1.0 - alpha;
                }
            }
        }
    }
}

impl Footprint {
    fn touches(&self, width: usize, height: usize) -> bool {
        let inside = |i: usize, size: usize| {
            self.centre[i] + self.half[i] >= 0.0 && self.centre[i] - self.half[i] <= size as f32 - 1.0
        };
        inside(0, width) && inside(1, height)
    }

    fn tiles(&self, width: usize, height: usize) -> [std::ops::Range<usize>; 2] {
        let range = |i: usize, size: usize| {
            let low = (self.centre[i] - self.half[i]).max(0.0) as usize / TILE;
            let high = (self.centre[i] + self.half[i]).clamp(0.0, size as f32 - 1.0) as usize / TILE;
            low..high + 1
        };
        [range(0, width), range(1, height)]
    }
}

/// Returns the footprint of a splat in the image; `None` when it has no extent there.
fn footprint(index: u32, splat: &Splat, seen: &Projection, low_pass: f64) -> Option<Footprint> {
    let axes = splat.axes();
    let j = &seen.jacobian;
    // The axes of the splat in the image, each as long as its standard deviation.
    let image = [0, 1, 2].map(|k| {
        let scale = f64::from(splat.scale_m[k]);
        [0, 1].map(|i| scale * (0..3).map(|a| j[i][a] * axes[k][a]).sum::<f64>())
    });
    let sum = |a: usize, b: usize| image.iter().map(|axis| axis[a] * axis[b]).sum::<f64>();
    let (xx, xy, yy) = (sum(0, 0) + low_pass, sum(0, 1), sum(1, 1) + low_pass);
    let det = xx * yy - xy * xy;
    if !(det > 0.0 && det.is_finite()) {
        return None;
    }
    // The distance at which the opacity falls below the least one that counts.
    let reach = (2.0 * (f64::from(splat.opacity) / f64::from(ALPHA_MIN)).ln()).max(0.0).sqrt();
    Some(Footprint {
        splat: index,
        centre: seen.pixel.map(|c| c as f32),
        conic: [yy / det, -xy / det, xx / det].map(|c| c as f32),
        half: [(reach * xx.sqrt()) as f32, (reach * yy.sqrt()) as f32],
        opacity: splat.opacity,
        height: splat.position[2],
        slope: height_slope(splat, &axes, &image).map(|s| s as f32),
        depth: seen.depth,
    })
}

/// Returns the change of the height of the splat's plane per column and row; zero where the splat
/// is seen edge-on.
fn height_slope(splat: &Splat, axes: &[[f64; 3]; 3], image: &[[f64; 2]; 3]) -> [f64; 2] {
    let ([a, c], [b, d]) = (image[0], image[1]);
    let det = a * d - b * c;
    if det.abs() <= EDGE_ON * a.hypot(c) * b.hypot(d) {
        return [0.0; 2];
    }
    let rise = [0, 1].map(|k| f64::from(splat.scale_m[k]) * axes[k][2]);
    // One column is (d, −c) / det of the two tangents, one row (−b, a) / det.
    [(rise[0] * d - rise[1] * c) / det, (-rise[0] * b + rise[1] * a) / det]
}
