//! Splats of a surface and its images, with a report of count against error.
//!
//! Cells that a view sees take the values of its image. Views are brought to the gain and offset of
//! the view that sees most (by median and interquartile range over the cells that both see), and
//! the colour of a cell is the median of its views. The display range is the range of the cells'
//! colours without their extreme 0.25 %. Blocks are divided by heights and these colours. The
//! colours of the splats are then fitted to the images themselves.

use crs::CrsError;
use gaussian::Splat;
use numeric::{middle_values, nearest_quantile};
use raster::{Grid, Interpolation, sample};
use rayon::prelude::*;
use serde::Serialize;

use super::colour::FitView;
use super::overhang;
use super::sight::mark_pixels;
use super::wall_light::WallView;
use super::walls::{WallSplats, wall_splats};
use super::{
    ColourFit, DivisionConfig, GaussianConfig, HeightErrors, MapSplatCamera, Rendering, RpcSplatCamera, SplatBlock,
    SplatSurface, divide, fit_colours, height_errors, psnr_db, render, splat_of_block, ssim, uniform, visible_cells,
    visible_pixels,
};

/// Share of the cells' colours that is clipped at each end of the display range.
const TAIL: f64 = 0.0025;
/// Spread of large blocks that hang over nothing: their corners are covered to 94 % instead of
/// 84 %, so that no lattice shows from near by.
const SEAM_SPREAD: f64 = 0.6;
/// Least side of a large block, cells: smaller ones follow the colours of the images, which a wider
/// Gaussian would blur.
const SEAM_SIDE: usize = 4;
/// Sides of the uniform splats for comparison, cells.
const CURVE_SIDES: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// Settings of the splats.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SplatConfig {
    /// Bounds of the blocks.
    pub division: DivisionConfig,
    /// Shape and opacity of the Gaussians.
    pub gaussian: GaussianConfig,
    /// Settings of the colour fit.
    pub colour: ColourFit,
    /// Side of square splats, cells, instead of blocks under bounds.
    pub uniform_side: Option<usize>,
    /// Whether uniform splats of several sizes are measured for comparison.
    pub compare: bool,
    /// Whether the walls between cells get splats too. Uniform splats have none.
    pub walls: bool,
}

/// An image of the surface.
#[derive(Debug, Clone, Copy)]
pub struct SplatView<'a> {
    /// Its camera.
    pub camera: RpcSplatCamera<'a>,
    /// Red, green, blue in the image's own units, NaN where unknown.
    pub image: &'a Grid<[f32; 3]>,
}

/// Splats with their blocks, renderings and report.
#[derive(Debug, Clone)]
pub struct SplatScene {
    /// The splats, metres from the surface's origin: first those of the blocks, then the walls.
    pub splats: Vec<Splat>,
    /// The blocks of the first splats.
    pub blocks: Vec<SplatBlock>,
    /// The splats as each image sees them, in the display range.
    pub renderings: Vec<Grid<[f32; 3]>>,
    /// Count and errors.
    pub report: SplatReport,
}

/// Count and errors of splats. `V` is what is known of each view.
#[derive(Debug, Clone, Serialize)]
pub struct SplatReport<V = ViewReport> {
    /// Number of cells with a height.
    pub cells: usize,
    /// Number of splats, walls included.
    pub splats: usize,
    /// Number of splats on walls.
    pub walls: usize,
    /// Number of splats on walls whose colours an image shows. The others have the mean of the
    /// walls that are seen on the same outline, or of all.
    pub walls_seen: usize,
    /// Area of the walls, m².
    pub walls_area_m2: f64,
    /// Largest distance of a height from the plane of its splat, metres.
    pub plane_error_max_m: f64,
    /// Errors of the heights rendered from above, without the walls, as the mean by weight.
    pub mean_height: Option<HeightErrors>,
    /// Errors of the heights rendered from above, without the walls, at half of the weight.
    pub median_height: Option<HeightErrors>,
    /// Values of the reference image at 0 and 1 of the display range, per channel.
    pub display_range: [[f32; 2]; 3],
    /// How well the splats render back into each image.
    pub views: Vec<V>,
    /// Uniform splats of several sizes, when asked for.
    pub uniform: Vec<CurvePoint>,
    /// Number of uniform splats with the same root mean square error of mean heights, when asked
    /// for: interpolated in the logarithms, at most one per cell.
    pub uniform_at_equal_rmse: Option<f64>,
}

impl<V> SplatReport<V> {
    /// Replaces what is known of each view, in the order of the views.
    pub fn map_views<W>(self, work: impl FnMut(V) -> W) -> SplatReport<W> {
        SplatReport {
            cells: self.cells,
            splats: self.splats,
            walls: self.walls,
            walls_seen: self.walls_seen,
            walls_area_m2: self.walls_area_m2,
            plane_error_max_m: self.plane_error_max_m,
            mean_height: self.mean_height,
            median_height: self.median_height,
            display_range: self.display_range,
            views: self.views.into_iter().map(work).collect(),
            uniform: self.uniform,
            uniform_at_equal_rmse: self.uniform_at_equal_rmse,
        }
    }
}

/// How well the splats render back into one image.
#[derive(Debug, Clone, Serialize)]
pub struct ViewReport {
    /// Share of the cells with a height that the view sees.
    pub seen: f64,
    /// Number of pixels that show seen cells; the numbers below are over these.
    pub pixels: usize,
    /// Peak signal-to-noise ratio, decibels; the peak is 1 of the display range.
    pub psnr_db: Option<f64>,
    /// Structural similarity.
    pub ssim: Option<f64>,
    /// Mean accumulated weight.
    pub coverage: f64,
    /// Factor from this image's units to the reference's, per channel.
    pub gain: [f32; 3],
    /// Offset from this image's units to the reference's, per channel.
    pub offset: [f32; 3],
}

/// Splats of one size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Side of the squares, cells.
    pub side: usize,
    /// Number of splats.
    pub splats: usize,
    /// Root mean square error of mean heights, metres.
    pub rmse_m: f64,
}

/// Inputs that no splats can be made of.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct SplatError(#[from] pub(crate) Reason);

/// Why no splats can be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Reason {
    /// No cell of the surface has a height.
    #[error("the surface has no height: no splats can be made")]
    NoHeights,
    /// A bound is not positive.
    #[error("{name} is {value}, expected a positive number")]
    Bound {
        /// Name of the value.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A grid is not as large as the surface.
    #[error("{what} has {found:?} cells, the surface {expected:?}: both must lie on one grid")]
    Size {
        /// Name of the value.
        what: &'static str,
        /// Columns and rows of the grid.
        found: (usize, usize),
        /// Columns and rows of the surface.
        expected: (usize, usize),
    },
    /// An image shows nothing of the surface.
    #[error("image {number} shows no cell of the surface: is it of another place?")]
    Elsewhere {
        /// Position of the image in the list, from 1.
        number: usize,
    },
    /// The geotransform has no inverse.
    #[error("the geotransform of the surface is singular")]
    Singular,
    /// A coordinate conversion failed.
    #[error(transparent)]
    Geodesy(#[from] CrsError),
}

impl From<CrsError> for SplatError {
    fn from(error: CrsError) -> Self {
        Reason::from(error).into()
    }
}

/// Makes splats of a surface and its images. `confidence` is per cell in 0 to 1, NaN where unknown.
///
/// # Errors
/// [`SplatError`] for a surface without heights, a bound that is not positive, a grid of another
/// size, and an image that does not show the surface.
pub fn make_splats(
    surface: &SplatSurface<'_>,
    confidence: Option<&Grid<f32>>,
    views: &[SplatView<'_>],
    config: &SplatConfig,
) -> Result<SplatScene, SplatError> {
    check(surface, confidence, config)?;
    let mut seen = Vec::with_capacity(views.len());
    for (number, view) in (1..).zip(views) {
        let one = Seen::new(surface, view)?;
        if !one.shows.data().contains(&true) {
            return Err(Reason::Elsewhere { number }.into());
        }
        seen.push(one);
    }
    let balance = balance(&seen);
    let colours = cell_colours(surface, &seen, &balance);
    let range = display_range(&colours);
    let shown = colours.map(|c| displayed(*c, &range));
    let blocks = match config.uniform_side {
        Some(side) => uniform(surface, side),
        None => {
            let division =
                DivisionConfig { clear_sides: config.division.clear_sides || config.walls, ..config.division };
            divide(surface, (!views.is_empty()).then_some(&shown), &division, &config.gaussian)
        }
    };
    let splat = |block: &SplatBlock| {
        first_splat(surface, block, &shown, confidence, &gaussian_of_block(surface, block, config))
    };
    let mut splats: Vec<Splat> = blocks.par_iter().map(splat).collect();
    let images: Vec<Grid<[f32; 3]>> = views
        .iter()
        .zip(&balance)
        .map(|(view, (gain, offset))| {
            view.image
                .map(|p| displayed([0, 1, 2].map(|i| gain[i] * p[i] + offset[i]), &range).map(|c| c.clamp(0.0, 1.0)))
        })
        .collect();
    let walls = if config.walls && config.uniform_side.is_none() {
        let views: Vec<WallView<'_>> =
            views.iter().zip(&images).map(|(view, image)| WallView { camera: &view.camera, image }).collect();
        wall_splats(surface, &views, confidence, &config.division, &config.gaussian)?
    } else {
        WallSplats::default()
    };
    splats.extend(&walls.splats);
    let mut shows: Vec<Grid<bool>> = seen.iter().map(|seen| seen.shows.clone()).collect();
    for ((shows, places), view) in shows.iter_mut().zip(&walls.shown).zip(views) {
        mark_pixels(shows, &view.camera.pixels(places.iter().copied())?);
    }
    let mut fits = Vec::with_capacity(views.len());
    for ((view, image), shows) in views.iter().zip(&images).zip(&shows) {
        fits.push(FitView::new(&splats, &view.camera, image, shows)?);
    }
    fit_colours(&mut splats, &fits, &config.colour);
    let (flat, upright) = splats.split_at_mut(blocks.len());
    // A part of a wall can be smaller than a pixel, and its colour little more than a difference.
    upright.iter_mut().for_each(|splat| splat.colour = splat.colour.map(|c| c.clamp(0.0, 1.0)));
    let mut report = heights_report(surface, &blocks, flat, config)?;
    (report.splats, report.display_range) = (splats.len(), range);
    (report.walls, report.walls_seen, report.walls_area_m2) = (walls.splats.len(), walls.seen, walls.area_m2);
    let mut renderings = Vec::with_capacity(views.len());
    for (((fit, image), seen), balance) in fits.iter().zip(&images).zip(&seen).zip(&balance) {
        let rendering = fit.render(&splats);
        report.views.push(view_report(&rendering, image, seen, *balance, report.cells));
        renderings.push(rendering.colour);
    }
    Ok(SplatScene { splats, blocks, renderings, report })
}

pub(super) fn check(
    surface: &SplatSurface<'_>,
    confidence: Option<&Grid<f32>>,
    config: &SplatConfig,
) -> Result<(), Reason> {
    let bounds = [
        ("the bound on heights", config.division.error_m),
        ("the bound on colours", config.division.colour_error),
        ("the spread", config.gaussian.spread),
    ];
    if let Some((name, value)) = bounds.into_iter().find(|(_, value)| value.is_nan() || *value <= 0.0) {
        return Err(Reason::Bound { name, value });
    }
    let expected = (surface.heights().width(), surface.heights().height());
    match confidence.map(|c| (c.width(), c.height())) {
        Some(found) if found != expected => Err(Reason::Size { what: "the confidence", found, expected }),
        _ if surface.heights().data().iter().any(|h| h.is_finite()) => Ok(()),
        _ => Err(Reason::NoHeights),
    }
}

/// Cells and pixels that a view sees.
struct Seen {
    /// Values of the seen cells in the image's units, NaN elsewhere.
    values: Grid<[f32; 3]>,
    cells: usize,
    /// Pixels that show seen cells.
    shows: Grid<bool>,
}

impl Seen {
    fn new(surface: &SplatSurface<'_>, view: &SplatView<'_>) -> Result<Self, SplatError> {
        let visible = visible_cells(surface, view.camera.towards_sensor());
        let channels = [0, 1, 2].map(|i| view.image.map(|p| p[i]));
        let (width, height) = (visible.width(), visible.height());
        let mut values = Grid::filled(width, height, [f32::NAN; 3]);
        let mut cells = 0;
        for row in 0..height {
            let columns: Vec<usize> = (0..width).filter(|&column| visible[(column, row)]).collect();
            let position = |&column: &usize| {
                surface.position(column as f64, row as f64, surface.local_height(column as i64, row as i64))
            };
            let pixels = view.camera.pixels(columns.iter().map(position))?;
            for (&column, [u, v]) in columns.iter().zip(pixels) {
                let value = [0, 1, 2].map(|i| sample(&channels[i], u, v, Interpolation::Bilinear));
                if value.iter().all(|c| c.is_finite()) {
                    values[(column, row)] = value;
                    cells += 1;
                }
            }
        }
        let shows = visible_pixels(surface, &visible, &view.camera)?;
        Ok(Self { values, cells, shows })
    }
}

type Balance = ([f32; 3], [f32; 3]);

/// Returns the gain and offset that bring every view to the view that sees most.
fn balance(seen: &[Seen]) -> Vec<Balance> {
    let Some(reference) = seen.iter().enumerate().rev().max_by_key(|(_, s)| s.cells).map(|(i, _)| i) else {
        return Vec::new();
    };
    let one = |(i, view): (usize, &Seen)| {
        let (mut gain, mut offset) = ([1.0; 3], [0.0; 3]);
        for channel in (0..3).filter(|_| i != reference) {
            let pairs = view.values.data().iter().zip(seen[reference].values.data());
            let both = pairs.map(|(a, b)| (a[channel], b[channel])).filter(|(a, b)| a.is_finite() && b.is_finite());
            let (mut own, mut other): (Vec<f32>, Vec<f32>) = both.unzip();
            if let (Some(own), Some(other)) = (quartiles(&mut own), quartiles(&mut other)) {
                gain[channel] = if own[2] > own[0] { (other[2] - other[0]) / (own[2] - own[0]) } else { 1.0 };
                offset[channel] = other[1] - gain[channel] * own[1];
            }
        }
        (gain, offset)
    };
    seen.iter().enumerate().map(one).collect()
}

fn quartiles(values: &mut [f32]) -> Option<[f32; 3]> {
    (values.len() >= 8).then(|| [0.25, 0.5, 0.75].map(|share| nearest_quantile(values, share).unwrap_or(f32::NAN)))
}

/// Returns the median over the views that see a cell, in the reference's units; NaN where no view
/// sees it.
fn cell_colours(surface: &SplatSurface<'_>, seen: &[Seen], balance: &[Balance]) -> Grid<[f32; 3]> {
    let (width, height) = (surface.heights().width(), surface.heights().height());
    let mut colours = Grid::filled(width, height, [f32::NAN; 3]);
    let mut values = Vec::with_capacity(seen.len());
    for (at, colour) in colours.data_mut().iter_mut().enumerate() {
        for (channel, colour) in colour.iter_mut().enumerate() {
            values.clear();
            let views = seen.iter().zip(balance);
            let all = views.map(|(s, (gain, offset))| gain[channel] * s.values.data()[at][channel] + offset[channel]);
            values.extend(all.filter(|v| v.is_finite()));
            values.sort_unstable_by(f32::total_cmp);
            if let Some((low, high)) = middle_values(&values) {
                *colour = 0.5 * (low + high);
            }
        }
    }
    colours
}

pub(super) fn display_range(colours: &Grid<[f32; 3]>) -> [[f32; 2]; 3] {
    [0, 1, 2].map(|channel| {
        let mut values: Vec<f32> = colours.data().iter().map(|c| c[channel]).filter(|c| c.is_finite()).collect();
        let [Some(low), Some(high)] = [TAIL, 1.0 - TAIL].map(|share| nearest_quantile(&mut values, share)) else {
            return [0.0, 1.0];
        };
        if high > low { [low, high] } else { [low, low + 1.0] }
    })
}

pub(super) fn displayed(colour: [f32; 3], range: &[[f32; 2]; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| (colour[i] - range[i][0]) / (range[i][1] - range[i][0]))
}

/// Returns the shape of a block's Gaussian: wide where it covers seams and hangs over nothing.
fn gaussian_of_block(surface: &SplatSurface<'_>, block: &SplatBlock, config: &SplatConfig) -> GaussianConfig {
    let wide = GaussianConfig { spread: config.gaussian.spread.max(SEAM_SPREAD), ..config.gaussian };
    let is_large = config.uniform_side.is_none() && block.width.min(block.height) >= SEAM_SIDE;
    if is_large && overhang::is_free(surface, block, &wide, config.division.error_m) { wide } else { config.gaussian }
}

/// Returns the splat of a block with the mean of its cells' colours and confidences; middle grey
/// where no view sees a cell.
pub(super) fn first_splat(
    surface: &SplatSurface<'_>,
    block: &SplatBlock,
    colours: &Grid<[f32; 3]>,
    confidence: Option<&Grid<f32>>,
    config: &GaussianConfig,
) -> Splat {
    let (mut sum, mut count) = ([0.0f32; 3], 0);
    let (mut trust, mut trusted) = (0.0, 0);
    for row in block.row..block.row + block.height {
        for column in block.column..block.column + block.width {
            let colour = colours[(column, row)];
            if colour.iter().all(|c| c.is_finite()) {
                (0..3).for_each(|i| sum[i] += colour[i].clamp(0.0, 1.0));
                count += 1;
            }
            if let Some(c) = confidence.map(|c| c[(column, row)]).filter(|c| c.is_finite()) {
                (trust, trusted) = (trust + f64::from(c), trusted + 1);
            }
        }
    }
    let colour = if count > 0 { sum.map(|s| s / count as f32) } else { [0.5; 3] };
    let trust = if trusted > 0 { trust / f64::from(trusted) } else { f64::NAN };
    splat_of_block(surface, block, colour, trust, config)
}

fn heights_report(
    surface: &SplatSurface<'_>,
    blocks: &[SplatBlock],
    splats: &[Splat],
    config: &SplatConfig,
) -> Result<SplatReport, SplatError> {
    let camera = MapSplatCamera::new(surface).ok_or(Reason::Singular)?;
    let rendering = render(splats, &camera)?;
    let height = surface.origin()[2];
    let errors = |found: &Grid<f32>| height_errors(found, surface.heights(), height);
    let mean_height = errors(&rendering.mean_height_m);
    let mut curve = Vec::new();
    for side in CURVE_SIDES.into_iter().filter(|_| config.compare) {
        let gaussian = GaussianConfig { opacity_min: config.gaussian.opacity_max, ..config.gaussian };
        let some: Vec<Splat> =
            uniform(surface, side).iter().map(|b| splat_of_block(surface, b, [0.5; 3], 1.0, &gaussian)).collect();
        if let Some(found) = errors(&render(&some, &camera)?.mean_height_m) {
            curve.push(CurvePoint { side, splats: some.len(), rmse_m: found.rmse_m });
        }
    }
    Ok(SplatReport {
        cells: surface.heights().data().iter().filter(|h| h.is_finite()).count(),
        splats: splats.len(),
        walls: 0,
        walls_seen: 0,
        walls_area_m2: 0.0,
        plane_error_max_m: blocks.iter().map(|block| plane_error(surface, block)).fold(0.0, f64::max),
        mean_height,
        median_height: errors(&rendering.median_height_m),
        display_range: [[0.0, 1.0]; 3],
        views: Vec::new(),
        uniform_at_equal_rmse: mean_height.and_then(|errors| count_at(&curve, errors.rmse_m)),
        uniform: curve,
    })
}

fn plane_error(surface: &SplatSurface<'_>, block: &SplatBlock) -> f64 {
    let rows = block.row..block.row + block.height;
    let cells = rows.flat_map(|row| (block.column..block.column + block.width).map(move |column| (column, row)));
    let error = |(column, row): (usize, usize)| {
        surface.local_height(column as i64, row as i64) - block.height_at(column as f64, row as f64)
    };
    cells.map(|cell| error(cell).abs()).fold(0.0, f64::max)
}

/// Returns the number of uniform splats at an error, interpolated between the points of the curve.
fn count_at(curve: &[CurvePoint], rmse_m: f64) -> Option<f64> {
    let (first, last) = (curve.first()?, curve.last()?);
    if rmse_m <= first.rmse_m {
        return Some(first.splats as f64);
    }
    let between = curve.windows(2).find(|pair| pair[0].rmse_m <= rmse_m && rmse_m <= pair[1].rmse_m);
    Some(between.map_or(last.splats as f64, |pair| {
        let [a, b] = [pair[0], pair[1]];
        let span = (b.rmse_m / a.rmse_m).ln();
        let share = if span > 0.0 { (rmse_m / a.rmse_m).ln() / span } else { 0.0 };
        (a.splats as f64).powf(1.0 - share) * (b.splats as f64).powf(share)
    }))
}

fn view_report(
    rendering: &Rendering,
    image: &Grid<[f32; 3]>,
    seen: &Seen,
    (gain, offset): Balance,
    cells: usize,
) -> ViewReport {
    let pixels = seen.shows.data().iter().filter(|s| **s).count();
    let covered = rendering.coverage.data().iter().zip(seen.shows.data()).filter(|(_, s)| **s);
    ViewReport {
        seen: seen.cells as f64 / cells.max(1) as f64,
        pixels,
        psnr_db: psnr_db(&rendering.colour, image, &seen.shows),
        ssim: ssim(&rendering.colour, image, &seen.shows),
        coverage: covered.map(|(c, _)| f64::from(*c)).sum::<f64>() / pixels.max(1) as f64,
        gain,
        offset,
    }
}
