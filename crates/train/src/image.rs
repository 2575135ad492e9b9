//! The images that a drawing gives, and the gradients of a loss by them.

/// What the distortion of a ray is the spread of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DepthSpread {
    /// Of the depths; the distortion is in square metres.
    #[default]
    Depths,
    /// Of the inverse depths of a perspective camera; the distortion is per square metre. It is
    /// that of normalised device coordinates (2DGS) but for a factor, so that what is far away may
    /// spread. Affine cameras have no inverse depths, and keep the spread of depths.
    InverseDepths,
}

/// The images of a drawing, by rows; the same type holds the gradients of a loss by each value.
///
/// All are sums over the splats of a pixel with their weights wᵢ = αᵢ Πⱼ₍ᵢ₎ (1 − αⱼ), which add up
/// to the coverage. They are 0 where there is no splat.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfelImages {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Σ wᵢ cᵢ: red, green, blue over black.
    pub colour: [Vec<f32>; 3],
    /// Σ wᵢ, 1 where nothing behind the splats is seen.
    pub coverage: Vec<f32>,
    /// Σ wᵢ nᵢ: unit normals in the local frame, turned to the camera.
    pub normal: [Vec<f32>; 3],
    /// Σ wᵢ zᵢ: depths of the intersections, metres. Divided by the coverage, it is the expected
    /// depth.
    pub depth_m: Vec<f32>,
    /// ½ Σᵢⱼ wᵢ wⱼ (sᵢ − sⱼ)²: how far the splats of a ray are apart. s is the depth or its
    /// inverse, see [`DepthSpread`].
    pub distortion: Vec<f32>,
}

impl SurfelImages {
    /// Returns images of zeros.
    pub fn zeros(size: [usize; 2]) -> Self {
        let mut images = Self::default();
        images.resize(size);
        images
    }

    /// Changes the size. The values are any.
    pub(crate) fn resize(&mut self, size: [usize; 2]) {
        self.size = size;
        for plane in self.planes_mut() {
            plane.resize(size[0] * size[1], 0.0);
        }
    }

    /// Returns all images: red, green, blue, coverage, normal, depth, distortion.
    pub fn planes(&self) -> [&[f32]; 9] {
        let [red, green, blue] = &self.colour;
        let [east, north, up] = &self.normal;
        [red, green, blue, &self.coverage, east, north, up, &self.depth_m, &self.distortion]
    }

    /// Returns all images in the order of [`Self::planes`].
    pub fn planes_mut(&mut self) -> [&mut Vec<f32>; 9] {
        let [red, green, blue] = &mut self.colour;
        let [east, north, up] = &mut self.normal;
        [red, green, blue, &mut self.coverage, east, north, up, &mut self.depth_m, &mut self.distortion]
    }
}
