//! Draws surfels and brings the gradient of a loss back to them.
//!
//! Each entry of a tile gets its own gradient, and those of a surfel are added in the order of its
//! tiles, so that the number of threads changes nothing.

use gaussian::SplatLabel;
use rayon::prelude::*;

use crate::arrange::Arrangement;
use crate::bands::{Painted, Rays};
use crate::image::{DepthSpread, SurfelImages};
use crate::labels::label_map;
use crate::screen::{ScreenGradient, gradient};
use crate::simd::{Registers, prefetch};
use crate::surfel::Surfel;
use crate::view::SurfelCamera;

/// Greatest number of columns or rows of an image.
pub const MAX_SIDE: usize = 65_535;

/// Surfels whose entries are asked for before they are added.
const AHEAD: usize = 8;

/// A drawn image, with what its gradient needs. Drawing again reuses the memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drawing {
    painted: Painted,
    arrangement: Arrangement,
    by_entry: Vec<ScreenGradient>,
    pairs: u64,
    registers: Registers,
    spread: DepthSpread,
    is_perspective: bool,
}

/// The gradient of a loss by the parameters of surfels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfelGradients {
    /// One for each surfel; 0 for those that are not drawn.
    pub surfels: Vec<Surfel>,
    /// Length of the gradient by the position in the image, per pixel; NaN for surfels that are not
    /// drawn or hidden by others. Where it is large, more surfels are needed.
    pub by_pixel: Vec<f32>,
}

impl Drawing {
    /// Draws surfels.
    ///
    /// # Panics
    /// If the image has more than [`MAX_SIDE`] columns or rows.
    ///
    /// # Examples
    /// ```
    /// use train::{Drawing, PinholeView, Registers, Surfel};
    ///
    /// let camera = PinholeView {
    ///     rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    ///     centre: [0.0; 3],
    ///     focal_px: [32.0; 2],
    ///     principal_px: [15.0; 2],
    ///     size: [31, 31],
    /// };
    /// let surfel = Surfel {
    ///     position: [0.0, 0.0, 5.0],
    ///     rotation: [1.0, 0.0, 0.0, 0.0],
    ///     log_scale: [0.0; 2],
    ///     opacity_logit: 0.0,
    ///     colour: [1.0, 0.5, 0.0],
    /// };
    /// let drawing = Drawing::new(&[surfel], &camera, Registers::Longest);
    /// let (images, middle) = (drawing.images(), 15 * 31 + 15);
    /// // Its opacity of a half, less what the blur by a pixel spreads over a larger area.
    /// assert!((images.coverage[middle] - 0.5).abs() < 0.002);
    /// assert_eq!(images.colour[1][middle], 0.5 * images.coverage[middle]);
    /// assert!((images.depth_m[middle] / images.coverage[middle] - 5.0).abs() < 1e-6);
    /// ```
    pub fn new<C: SurfelCamera>(surfels: &[Surfel], camera: &C, registers: Registers) -> Self {
        let mut drawing = Self { registers, ..Self::default() };
        drawing.redraw(surfels, camera);
        drawing
    }

    /// Draws surfels in place of what was drawn before.
    ///
    /// # Panics
    /// If the image has more than [`MAX_SIDE`] columns or rows.
    pub fn redraw<C: SurfelCamera>(&mut self, surfels: &[Surfel], camera: &C) {
        let size = camera.size();
        assert!(size.iter().all(|&s| s <= MAX_SIDE), "an image of {size:?} pixels is too large");
        self.is_perspective = C::PERSPECTIVE;
        self.arrangement.arrange(surfels, camera);
        self.pairs = self.painted.paint(&self.arrangement, Rays::new(C::PERSPECTIVE, self.spread), self.registers);
    }

    /// Chooses what the distortion is the spread of, from the next drawing on.
    pub fn set_spread(&mut self, spread: DepthSpread) {
        self.spread = spread;
    }

    /// Returns the images.
    pub fn images(&self) -> &SurfelImages {
        &self.painted.images
    }

    /// Returns the number of pairs of a splat and a pixel that it is drawn at.
    pub fn pairs(&self) -> u64 {
        self.pairs
    }

    /// Returns the label of each pixel, by rows, given those of the surfels: that with the greatest
    /// weight in the drawing, as [`gaussian::LabelVotes`] counts.
    ///
    /// # Panics
    /// If the labels are not those of the surfels of the drawing.
    pub fn labels(&self, labels: &[SplatLabel]) -> Vec<SplatLabel> {
        assert_eq!(labels.len(), self.arrangement.splats.len(), "other surfels were drawn");
        label_map(&self.arrangement, labels, self.is_perspective, self.registers)
    }

    /// Computes the gradient by the surfels, given that by the images.
    ///
    /// # Panics
    /// If surfels, camera or gradients are not those of the drawing.
    pub fn gradients<C: SurfelCamera>(
        &mut self,
        surfels: &[Surfel],
        camera: &C,
        by_images: &SurfelImages,
        out: &mut SurfelGradients,
    ) {
        let Self { painted, arrangement, by_entry, registers, spread, .. } = self;
        assert_eq!(by_images.size, arrangement.size, "the gradient belongs to another image");
        assert_eq!(surfels.len(), arrangement.splats.len(), "other surfels were drawn");
        by_entry.resize(arrangement.entries.len(), [0.0; 16]);
        painted.spread(arrangement, by_images, Rays::new(C::PERSPECTIVE, *spread), *registers, by_entry);
        let one = |(number, surfel): (usize, &Surfel)| {
            let view = camera.local(number, surfel.position.map(f64::from));
            let Some(view) = view.filter(|_| arrangement.splats[number].is_drawn()) else {
                return (Surfel::default(), f32::NAN);
            };
            let (mut sum, mut is_hidden) = ([0.0f32; 16], true);
            for &place in arrangement.places_from(number + AHEAD) {
                prefetch(&by_entry[place as usize]);
            }
            for &place in arrangement.places_of(number) {
                // Entries that were not drawn hold what was there before.
                if painted.masks[place as usize] != 0 {
                    sum.iter_mut().zip(by_entry[place as usize]).for_each(|(s, g)| *s += g);
                    is_hidden = false;
                }
            }
            if is_hidden {
                return (Surfel::default(), f32::NAN);
            }
            (gradient(surfel, &view, C::PERSPECTIVE, &sum.map(f64::from)), sum[6].hypot(sum[7]))
        };
        surfels.par_iter().enumerate().map(one).unzip_into_vecs(&mut out.surfels, &mut out.by_pixel);
    }
}
