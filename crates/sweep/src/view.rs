//! Views: image pyramids with their cameras.

use camera::{ImagePoint, RpcCamera};
use numeric::{order_statistic, upper_median};
use raster::{Grid, Pyramid, Window, bicubic_along};

/// Variance of the rounding error of integer grey values.
pub(crate) const QUANTISATION_VARIANCE: f32 = 1.0 / 12.0;
/// A pixel further from the median than this many spreads of the image is a defect of the sensor or
/// of the file: glints and lamps stay within a few hundred. Sums of f32 over windows that hold one
/// lose all other values.
const HOT_SPREADS: f32 = 1000.0;
/// Shares of the pixels below and above the spread of the grey values.
const SPREAD_QUANTILES: [f64; 3] = [0.02, 0.5, 0.98];
/// Largest number of hot pixels: one in this many, and a few in small images. More are content.
const HOT_ONE_IN: usize = 10_000;
const HOT_FEW: usize = 8;
/// Number of pixels that give the quantiles of an image.
const SAMPLES: f64 = 2.5e5;
/// Smallest side of a pyramid level, pixels: a handful of patches.
const SIDE_MIN: usize = 32;
/// Largest number of levels: enough to reduce the largest image to a pixel.
const LEVELS_MAX: usize = 16;

/// One image of the scene as a pyramid, with its camera. Invalid pixels (no-data, masked) are NaN
/// on every level.
///
/// ```
/// use camera::{Rpc, RpcCamera};
/// use raster::Grid;
/// use sweep::SweepView;
///
/// # let one = [1.0, 0.0, 0.0, 0.0];
/// # let terms = |t: [f64; 4]| std::array::from_fn(|i| t.get(i).copied().unwrap_or(0.0));
/// # let rpc = Rpc {
/// #     line_off: 50.0, samp_off: 50.0, lat_off: 0.0, long_off: 0.0, height_off: 0.0,
/// #     line_scale: 50.0, samp_scale: 50.0, lat_scale: 1e-3, long_scale: 1e-3,
/// #     height_scale: 100.0,
/// #     line_num: terms([0.0, 0.0, -1.0, 0.0]), line_den: terms(one),
/// #     samp_num: terms([0.0, 1.0, 0.0, 0.5]), samp_den: terms(one),
/// #     err_bias_m: None, err_rand_m: None,
/// # };
/// let view = SweepView::new(RpcCamera::new(rpc), Grid::filled(100, 100, 0.0));
/// assert_eq!(view.levels[1].width(), 50);
/// ```
#[derive(Debug, Clone)]
pub struct SweepView {
    /// Corrected camera of level 0.
    pub camera: RpcCamera,
    /// Images. Level 0 is the full resolution; each level halves the one before it.
    pub levels: Vec<Grid<f32>>,
    /// Standard deviation of the image noise at level 0, grey values. Patches flatter than this
    /// carry no information.
    pub noise: f32,
    /// Median difference between neighbouring pixels of each level, grey values: the unit of its
    /// texture.
    pub contrast: Vec<f32>,
    /// Column and row of the first pixel in the image that this is a part of, level 0: the tiles in
    /// which costs are computed are those of the whole image. Multiples of the pixels of the levels
    /// used; zeros for a whole image.
    pub first: [usize; 2],
}

impl SweepView {
    /// Builds a view from an image that is NaN where invalid.
    pub fn new(camera: RpcCamera, image: Grid<f32>) -> Self {
        Self::from_level(camera, 0, image)
    }

    /// Builds a view without its finest levels: `image` is level `level`, NaN where invalid, and
    /// finer levels are empty.
    pub fn from_level(camera: RpcCamera, level: usize, mut image: Grid<f32>) -> Self {
        // The quantisation of the census relies on the bits of this NaN.
        image.data_mut().iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = f32::NAN);
        drop_hot(&mut image);
        let noise = noise_deviation(&image) * (1 << level) as f32;
        let mut levels = vec![Grid::filled(0, 0, f32::NAN); level];
        levels.extend(Pyramid::new(image, LEVELS_MAX, SIDE_MIN).into_levels());
        let contrast = levels.iter().map(typical_difference).collect();
        Self { camera, levels, noise, contrast, first: [0; 2] }
    }

    /// Makes the view a part of an image that begins at the column and row `first` of it, see
    /// [`Self::first`].
    #[must_use]
    pub fn beginning_at(self, first: [usize; 2]) -> Self {
        Self { first, ..self }
    }

    /// Sets the pixels of a level that lie outside a window of level 0 to NaN, so that no height is
    /// searched for there.
    pub fn void_outside(&mut self, level: usize, inside: Window) {
        let image = &mut self.levels[level];
        let cut = |at: i64, size: usize| (at.max(0) as usize >> level).min(size);
        let columns = cut(inside.x, image.width())..cut(inside.x + inside.width as i64, image.width());
        let rows = cut(inside.y, image.height())..cut(inside.y + inside.height as i64, image.height());
        for y in 0..image.height() {
            let row = image.row_mut(y);
            if rows.contains(&y) {
                row[..columns.start].fill(f32::NAN);
                row[columns.end..].fill(f32::NAN);
            } else {
                row.fill(f32::NAN);
            }
        }
    }

    /// Empties all levels but one, whose image is still needed; a level that the view does not have
    /// empties all. The camera stays.
    pub fn keep_level(&mut self, level: usize) {
        let others = self.levels.iter_mut().enumerate().filter(|(other, _)| *other != level);
        others.for_each(|(_, image)| *image = Grid::filled(0, 0, f32::NAN));
    }

    /// Returns a view that does not see the scene: every level is empty.
    pub fn absent(camera: RpcCamera) -> Self {
        let levels = vec![Grid::filled(0, 0, f32::NAN); LEVELS_MAX];
        Self { camera, levels, noise: 0.0, contrast: vec![0.0; LEVELS_MAX], first: [0; 2] }
    }

    /// Returns the view with one level only, whose pixels lie `offset_px` (columns, rows; pixels of
    /// the level) further on the same image. Values between pixels are bicubic.
    #[must_use]
    pub fn on_lattice(&self, level: usize, offset_px: [f64; 2]) -> Self {
        let image = &self.levels[level];
        let mut moved = Grid::filled(image.width(), image.height(), f32::NAN);
        for y in 0..image.height() {
            let row = moved.row_mut(y);
            bicubic_along(image, [offset_px[0], offset_px[1] + y as f64], [1.0, 0.0], row);
            row.iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = f32::NAN);
        }
        let mut levels = vec![Grid::filled(0, 0, f32::NAN); self.levels.len()];
        levels[level] = moved;
        let [column, row] = offset_px.map(|px| px * f64::from(1u32 << level));
        Self {
            camera: self.camera.cropped(ImagePoint::new(column, row)),
            levels,
            noise: self.noise,
            contrast: self.contrast.clone(),
            first: self.first,
        }
    }

    /// Returns the view on one level; `index` is its index among the views.
    pub fn on_level(&self, index: usize, level: usize) -> ViewLevel<'_> {
        ViewLevel {
            index,
            image: &self.levels[level],
            camera: &self.camera,
            noise: self.noise_at(level),
            contrast: self.contrast[level],
            first: self.first.map(|at| at >> level),
        }
    }

    /// Marks the pixels of a level whose 3 × 3 patch holds a single value: saturated, or a void
    /// that nothing declares. Images show no height there.
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

    /// Returns the largest noise to expect on a level: each reduction at least halves it.
    pub fn noise_at(&self, level: usize) -> f32 {
        self.noise / (1 << level) as f32
    }
}

/// A view on the level being swept.
#[derive(Debug, Clone, Copy)]
pub struct ViewLevel<'a> {
    /// Index among the views.
    pub index: usize,
    /// Image on this level, NaN where invalid.
    pub image: &'a Grid<f32>,
    /// Camera of level 0.
    pub camera: &'a RpcCamera,
    /// Standard deviation of the noise on this level, grey values.
    pub noise: f32,
    /// Median difference between neighbouring pixels on this level, grey values.
    pub contrast: f32,
    /// Column and row of the first pixel in the image that this is a part of, pixels of this level.
    pub first: [usize; 2],
}

/// Makes the few pixels invalid that are far beyond all others.
fn drop_hot(image: &mut Grid<f32>) {
    let step = 1.max((image.data().len() as f64 / SAMPLES) as usize);
    let mut known: Vec<f32> = image.data().iter().step_by(step).copied().filter(|v| v.is_finite()).collect();
    let last = known.len().saturating_sub(1) as f64;
    let quantile = |share: f64, known: &mut [f32]| order_statistic(known, (share * last) as usize);
    let [low, middle, high] = SPREAD_QUANTILES.map(|share| quantile(share, &mut known));
    let (Some(low), Some(middle), Some(high)) = (low, middle, high) else { return };
    let far = HOT_SPREADS * (high - low);
    let is_hot = |v: f32| (v - middle).abs() > far;
    let hot = image.data().iter().filter(|v| is_hot(**v)).count();
    if far > 0.0 && hot > 0 && hot <= image.data().len() / HOT_ONE_IN + HOT_FEW {
        image.data_mut().iter_mut().filter(|v| is_hot(**v)).for_each(|v| *v = f32::NAN);
    }
}

/// Returns the median over the pixels of the greater difference to the left and to the upper
/// neighbour; 0 for an image without valid differences.
fn typical_difference(g: &Grid<f32>) -> f32 {
    let (w, h) = (g.width(), g.height());
    // A quarter of a million pixels give the median to a few thousandths.
    let step = 1.max(((w * h) as f64 / 2.5e5).sqrt() as usize);
    let places = (1..h).step_by(step).flat_map(|y| (1..w).step_by(step).map(move |x| (x, y)));
    let difference = |(x, y): (usize, usize)| {
        let here = g[(x, y)];
        (here - g[(x - 1, y)]).abs().max((here - g[(x, y - 1)]).abs())
    };
    let mut all: Vec<f32> = places.map(difference).filter(|d| d.is_finite()).collect();
    upper_median(&mut all).unwrap_or(0.0)
}

/// Estimates the standard deviation of the noise; 0 for an image without valid neighbourhoods.
///
/// The estimate is the lower quartile of the responses to Immerkær's mask (1996). Smooth and
/// straight structures do not excite the mask, and texture hardly reaches the lower quartile.
fn noise_deviation(g: &Grid<f32>) -> f32 {
    let (w, h) = (g.width(), g.height());
    // The quartile needs no more than every ninth pixel, and of large images fewer.
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
    // A quarter of all normal deviates lie within 0.3186 standard deviations.
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
    fn a_view_keeps_one_level_or_none() {
        let camera = crate::testing::camera::leaning_camera(64, [0.0; 2]);
        let mut view = SweepView::new(camera, Grid::filled(128, 128, 7.0));
        let sides = |view: &SweepView| view.levels.iter().map(Grid::width).collect::<Vec<_>>();
        view.keep_level(1);
        assert_eq!(sides(&view), [0, 64, 0]);
        view.keep_level(view.levels.len());
        assert_eq!(sides(&view), [0; 3]);
    }

    #[test]
    fn a_view_on_another_lattice_shows_the_same_places() {
        let ramp = |i: usize| 2.0 * (i % 64) as f32 - 3.0 * (i / 64) as f32;
        let mut image = Grid::from_vec(64, 64, (0..64 * 64).map(ramp).collect()).unwrap();
        image[(40, 20)] = f32::NAN;
        let view = SweepView::new(crate::testing::camera::leaning_camera(64, [0.3, -0.2]), image);
        let moved = view.on_lattice(1, [0.5, 0.25]);
        let sides: Vec<usize> = moved.levels.iter().map(Grid::width).collect();
        assert_eq!(sides, [0, 32]);
        // A column of level 1 is two of level 0, and a row as well.
        let by = 2.0 * 2.0 * 0.5 - 3.0 * 2.0 * 0.25;
        assert!((moved.levels[1][(5, 7)] - view.levels[1][(5, 7)] - by).abs() < 1e-4);
        assert!(moved.levels[1][(31, 7)].is_nan());
        assert!(view.on_lattice(0, [0.5, 0.25]).levels[0][(40, 20)].is_nan());
        let ground = geodesy::LonLatHeight { lon_deg: 1e-5, lat_deg: 2e-5, height_m: 10.0 };
        let [own, shifted] = [&view, &moved].map(|view| view.camera.project(ground).unwrap());
        assert!((own.sample - shifted.sample - 1.0).abs() < 1e-9 && (own.line - shifted.line - 0.5).abs() < 1e-9);
    }

    #[test]
    fn pixels_outside_a_window_are_voids_of_one_level() {
        let image = Grid::filled(64, 64, 7.0);
        let mut view = SweepView::new(crate::testing::camera::leaning_camera(64, [0.0; 2]), image);
        view.void_outside(1, Window { x: -8, y: 20, width: 28, height: 100 });
        let known = |level: usize| view.levels[level].data().iter().filter(|v| !v.is_nan()).count();
        assert_eq!((known(0), known(1)), (64 * 64, 10 * 22));
        assert!(!view.levels[1][(9, 10)].is_nan() && view.levels[1][(10, 10)].is_nan());
    }

    /// One pixel of 1e10 would shift the mean of its tile so far that no other value is left in it.
    #[test]
    fn a_hot_pixel_costs_nothing_but_itself() {
        let values = |i: usize| ((i * 7919) % 1009) as f32 * 0.5;
        let plain = Grid::from_vec(200, 150, (0..200 * 150).map(values).collect()).unwrap();
        let camera = || crate::testing::camera::leaning_camera(200, [0.0; 2]);
        for hot in [1e10, f32::INFINITY, -3e8] {
            let mut image = plain.clone();
            image[(77, 31)] = hot;
            let view = SweepView::new(camera(), image);
            let mut level = view.levels[0].data().iter().zip(plain.data()).enumerate();
            assert!(level.all(|(i, (a, b))| a == b || (a.is_nan() && i == 31 * 200 + 77)), "{hot}");
            assert!(view.levels[1].data().iter().all(|v| v.is_nan() || (0.0..=505.0).contains(v)), "{hot}");
        }
        // Values that are rare but not absurd stay.
        let mut image = plain.clone();
        image[(77, 31)] = 60_000.0;
        assert_eq!(SweepView::new(camera(), image).levels[0][(77, 31)], 60_000.0);
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
        // The sum of twelve uniform deviates minus six is nearly normal.
        let values = (0..300 * 300).map(|i| {
            let normal: f32 = (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
            (i % 300) as f32 * 0.5 + 3.0 * normal
        });
        let g = Grid::from_vec(300, 300, values.collect()).unwrap();
        let found = noise_deviation(&g);
        assert!((found - 3.0).abs() < 0.3, "{found}");
    }
}
