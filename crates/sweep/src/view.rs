//! A view: an image pyramid with its camera.

use camera::RpcCamera;
use numeric::{order_statistic, upper_median};
use raster::{Grid, Pyramid};

/// Variance that an 8-bit quantisation alone leaves.
pub(crate) const QUANTISATION_VARIANCE: f32 = 1.0 / 12.0;
/// The pyramid stops when a side would fall below this: a handful of patches.
const SIDE_MIN: usize = 32;
/// From the largest image there is to a pixel.
const LEVELS_MAX: usize = 16;

/// One image of the scene. Invalid pixels (no-data, masked) are NaN on every level.
#[derive(Debug, Clone)]
pub struct SweepView {
    /// The camera of level 0, corrected.
    pub camera: RpcCamera,
    /// Level 0 is the full resolution; each level halves the one before it.
    pub levels: Vec<Grid<f32>>,
    /// Standard deviation of the image noise at level 0, grey values: patches flatter than this carry no information.
    pub noise: f32,
    /// Typical difference between neighbouring pixels of each level, grey values: what its texture is measured by.
    pub contrast: Vec<f32>,
}

impl SweepView {
    /// A view of an image, NaN where invalid.
    pub fn new(camera: RpcCamera, mut image: Grid<f32>) -> Self {
        // One kind of NaN: the census tells it by its bits.
        image.data_mut().iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = f32::NAN);
        let noise = noise_deviation(&image);
        let levels = Pyramid::new(image, LEVELS_MAX, SIDE_MIN).into_levels();
        let contrast = levels.iter().map(typical_difference).collect();
        Self { camera, levels, noise, contrast }
    }

    /// A view of which only the levels from `level` on are there: `image` is that level, the finer ones are empty.
    pub fn from_level(camera: RpcCamera, level: usize, image: Grid<f32>) -> Self {
        let noise = noise_deviation(&image) * (1 << level) as f32;
        let mut levels = vec![Grid::filled(0, 0, f32::NAN); level];
        levels.extend(Pyramid::new(image, LEVELS_MAX, SIDE_MIN).into_levels());
        let contrast = levels.iter().map(typical_difference).collect();
        Self { camera, levels, noise, contrast }
    }

    /// A view that does not see the scene: every level is empty.
    pub fn absent(camera: RpcCamera) -> Self {
        let levels = vec![Grid::filled(0, 0, f32::NAN); LEVELS_MAX];
        Self { camera, levels, noise: 0.0, contrast: vec![0.0; LEVELS_MAX] }
    }

    /// What the sweep takes of it on a level; `index` is its place among the views.
    pub fn on_level(&self, index: usize, level: usize) -> ViewLevel<'_> {
        ViewLevel {
            index,
            image: &self.levels[level],
            camera: &self.camera,
            noise: self.noise_at(level),
            contrast: self.contrast[level],
        }
    }

    /// The pixels of a level whose patch holds a single value: saturated, or a void that nothing declares. No height shows there.
    pub fn blank(&self, level: usize) -> Grid<bool> {
        let image = &self.levels[level];
        let mut out = Grid::filled(image.width(), image.height(), false);
        for y in 1..image.height().saturating_sub(1) {
            let [above, own, below] = [y - 1, y, y + 1].map(|y| image.row(y).windows(3));
            for (blank, ((a, b), c)) in out.row_mut(y)[1..].iter_mut().zip(above.zip(own).zip(below)) {
                let all = |row: &[f32]| (row[0] == b[1]) & (row[1] == b[1]) & (row[2] == b[1]);
                *blank = all(a) & all(b) & all(c);
            }
        }
        out
    }

    /// The most noise to expect on a level: each reduction at least halves it.
    pub fn noise_at(&self, level: usize) -> f32 {
        self.noise / (1 << level) as f32
    }
}

/// A source view on the level being swept.
#[derive(Debug, Clone, Copy)]
pub struct ViewLevel<'a> {
    /// Its place among the views.
    pub index: usize,
    /// Its image on this level, NaN where invalid.
    pub image: &'a Grid<f32>,
    /// Its camera.
    pub camera: &'a RpcCamera,
    /// Its noise on this level, grey values.
    pub noise: f32,
    /// Its typical difference between neighbouring pixels on this level, grey values.
    pub contrast: f32,
}

/// Median of the greater of the differences to the left and to the upper neighbour; 0 for an image without any.
fn typical_difference(g: &Grid<f32>) -> f32 {
    let (w, h) = (g.width(), g.height());
    // About a quarter of a million pixels tell the median to a few thousandths.
    let step = 1.max(((w * h) as f64 / 2.5e5).sqrt() as usize);
    let places = (1..h).step_by(step).flat_map(|y| (1..w).step_by(step).map(move |x| (x, y)));
    let difference = |(x, y): (usize, usize)| {
        let here = g[(x, y)];
        (here - g[(x - 1, y)]).abs().max((here - g[(x, y - 1)]).abs())
    };
    let mut all: Vec<f32> = places.map(difference).filter(|d| d.is_finite()).collect();
    upper_median(&mut all).unwrap_or(0.0)
}

/// Standard deviation of the noise: of the response to Immerkær's mask (1996), which smooth and straight structures do
/// not excite, the lower quartile, which texture hardly reaches. 0 for an image without valid neighbourhoods.
fn noise_deviation(g: &Grid<f32>) -> f32 {
    let (w, h) = (g.width(), g.height());
    // Every ninth pixel of at most a few million: the quartile does not need more.
    let step = 3.max(((w * h) as f64 / 4e6).sqrt() as usize);
    let mut responses = Vec::new();
    for y in (1..h.saturating_sub(1)).step_by(step) {
        for x in (1..w.saturating_sub(1)).step_by(step) {
            let at = |i: usize, j: usize| g[(x + i - 1, y + j - 1)];
            let corners = at(0, 0) + at(2, 0) + at(0, 2) + at(2, 2);
            let sides = at(1, 0) + at(0, 1) + at(2, 1) + at(1, 2);
            let response = (corners - 2.0 * sides + 4.0 * at(1, 1)).abs() / 6.0;
            if response.is_finite() {
                responses.push(response);
            }
        }
    }
    let quarter = responses.len() / 4;
    // A quarter of a normal deviate lies within 0.3186 of its deviation.
    order_statistic(&mut responses, quarter).map_or(0.0, |response| response / 0.3186)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_blank_where_its_whole_patch_has_one_value() {
        let value = |i: usize| if (2..6).contains(&(i % 9)) && i / 9 < 5 { 255.0 } else { (i * i % 251) as f32 };
        let image = Grid::from_vec(9, 8, (0..72).map(value).collect()).unwrap();
        let blank =
            SweepView { levels: vec![image], ..SweepView::absent(crate::testing::camera::leaning_camera(9, [0.0; 2])) }
                .blank(0);
        let expected = |i: usize| (3..5).contains(&(i % 9)) && (1..4).contains(&(i / 9));
        assert!((0..72).all(|i| blank.data()[i] == expected(i)), "{blank:?}");
    }

    #[test]
    fn the_contrast_of_a_ramp_is_its_slope_on_every_level() {
        let g = Grid::from_vec(128, 128, (0..128 * 128).map(|i| (i % 128) as f32 * 0.5).collect()).unwrap();
        assert_eq!(typical_difference(&g), 0.5);
        let levels = Pyramid::new(g, 2, SIDE_MIN).into_levels();
        assert!((typical_difference(&levels[1]) - 1.0).abs() < 1e-3);
        assert_eq!(typical_difference(&Grid::filled(9, 9, f32::NAN)), 0.0);
    }

    #[test]
    fn the_noise_of_a_noisy_ramp_is_found() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        // The sum of twelve uniform deviates minus six is close to a normal one.
        let values = (0..300 * 300).map(|i| {
            let normal: f32 = (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
            (i % 300) as f32 * 0.5 + 3.0 * normal
        });
        let g = Grid::from_vec(300, 300, values.collect()).unwrap();
        let found = noise_deviation(&g);
        assert!((found - 3.0).abs() < 0.3, "{found}");
    }
}
