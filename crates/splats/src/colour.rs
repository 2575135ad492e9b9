//! Colours that render back to the images.
//!
//! A rendered pixel is linear in the colours, C = W c, with the weights of the front-to-back pass.
//! The colours with the least squared residuals over the pixels of all views are approached by
//! simultaneous iterations, c ← c + Wᵀ r / Wᵀ 1 (SIRT, Gilbert 1972; rows of W sum to 1 at most, so
//! it converges). Residuals are clipped, so that a car or a glint in one view pulls no further than
//! the clip. Pixels that show no surface of a splat (walls, hidden ground) are left out.

use crs::CrsError;
use gaussian::Splat;
use raster::Grid;

use super::SplatCamera;
use super::pass::{Arrangement, TILE_PIXELS, Tile};
use super::render::{Rendering, render_arranged};

/// Settings of the colour fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourFit {
    /// Number of iterations.
    pub rounds: usize,
    /// Largest residual, as a share of the display range; larger ones are clipped.
    pub clip: f32,
}

impl Default for ColourFit {
    /// Sixteen iterations, a clip at a tenth of the range.
    fn default() -> Self {
        Self { rounds: 16, clip: 0.1 }
    }
}

/// An image that colours are fitted to.
pub struct FitView<'a> {
    arrangement: Arrangement,
    image: &'a Grid<[f32; 3]>,
    use_pixel: &'a Grid<bool>,
}

impl<'a> FitView<'a> {
    /// Creates the view of splats through a camera. `image` is in the display range and as large as
    /// the image of the camera; `use_pixel` selects the pixels that count.
    ///
    /// # Errors
    /// [`CrsError`] when PROJ cannot be set up.
    pub fn new(
        splats: &[Splat],
        camera: &impl SplatCamera,
        image: &'a Grid<[f32; 3]>,
        use_pixel: &'a Grid<bool>,
    ) -> Result<Self, CrsError> {
        Ok(Self { arrangement: Arrangement::new(splats, camera)?, image, use_pixel })
    }

    /// Renders the splats as this view sees them.
    pub fn render(&self, splats: &[Splat]) -> Rendering {
        render_arranged(splats, &self.arrangement)
    }
}

/// Fits the colours of splats to views of them. Their geometry must be the one that the views were
/// created with.
pub fn fit_colours(splats: &mut [Splat], views: &[FitView<'_>], fit: &ColourFit) {
    let mut change = vec![Change::default(); splats.len()];
    for _ in 0..fit.rounds {
        change.fill(Change::default());
        for view in views {
            let tiles = view.arrangement.map_tiles(|tile| tile_change(splats, tile, view, fit.clip));
            for (splat, part) in tiles.into_iter().flatten() {
                let sum = &mut change[splat as usize];
                (0..3).for_each(|i| sum.residual[i] += part.residual[i]);
                sum.weight += part.weight;
            }
        }
        for (splat, change) in splats.iter_mut().zip(&change).filter(|(_, change)| change.weight > 1e-3) {
            (0..3).for_each(|i| splat.colour[i] += change.residual[i] / change.weight);
        }
    }
}

/// Weighted residuals of a splat and the sum of the weights.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    residual: [f32; 3],
    weight: f32,
}

fn tile_change(splats: &[Splat], tile: &Tile<'_>, view: &FitView<'_>, clip: f32) -> Vec<(u32, Change)> {
    let indices: Vec<u32> = tile.splats().collect();
    let mut parts = Vec::new();
    tile.parts(&mut parts);
    let mut rendered = [[0.0f32; 3]; TILE_PIXELS];
    for part in &parts {
        let colour = splats[indices[part.slot as usize] as usize].colour;
        (0..3).for_each(|i| rendered[part.pixel as usize][i] += part.weight * colour[i]);
    }
    let mut residual = [None; TILE_PIXELS];
    for (index, column, row) in tile.pixels() {
        let seen = view.image[(column, row)];
        if view.use_pixel[(column, row)] && seen.iter().all(|c| c.is_finite()) {
            residual[index] = Some([0, 1, 2].map(|i| (seen[i] - rendered[index][i]).clamp(-clip, clip)));
        }
    }
    let mut change = vec![Change::default(); tile.len()];
    for part in &parts {
        if let Some(residual) = residual[part.pixel as usize] {
            let sum = &mut change[part.slot as usize];
            (0..3).for_each(|i| sum.residual[i] += part.weight * residual[i]);
            sum.weight += part.weight;
        }
    }
    indices.into_iter().zip(change).filter(|(_, change)| change.weight > 0.0).collect()
}
