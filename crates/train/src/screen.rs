//! From a surfel to its footprint in the image, and the gradient back.
//!
//! With u and v the position in the plane in standard deviations, j the derivatives of the pixel
//! and ζ those of the relative depth along the two axes, a point of the plane lies at the offset
//! (u j_u + v j_v) / (1 + u ζ_u + v ζ_v) from the centre's pixel, exactly. The inverse is
//! u = p₀ r, v = p₁ r with (p₀, p₁) = A · offset, A = [j_u j_v]⁻¹ and r = 1 / (1 − ζ_u p₀ − ζ_v
//! p₁).
//! The depth there is z₀ r. For an affine camera r = 1, and the depth is z₀ + γ_u u + γ_v v.

use crate::surfel::Surfel;
use crate::view::LocalView;

/// Opacity of a pixel below which a splat is not drawn, as in all viewers of splats.
pub(crate) const LEAST_ALPHA: f64 = 1.0 / 255.0;
/// Sine of the angle between a splat and the line of sight below which it is not drawn (1.1°). It
/// is thinner than a pixel there, and its inverse has no precision in f32.
const EDGE_ON: f64 = 0.02;
/// Room for rounding when splats are told to be coarser than the least footprint.
const ROUNDED: f64 = 0.999;
/// Inverse variance of the least footprint, px⁻²: that of the 2DGS code.
pub(crate) const LOW_PASS_PER_PX2: f64 = 2.0;

/// Gradient slots of a splat in the image. With u and v the position in the plane, s the gradient
/// α ∂L/∂α and t that by 1 / r (perspective) or by the depth (affine), they are, in this order:
/// Σ s u², Σ s u v, Σ s v², by both slopes (Σ t u and Σ t v), by both coordinates of the pixel, one
/// of no meaning here, by the depth, Σ s, by colour, by normal.
pub(crate) type ScreenGradient = [f32; 16];

/// A surfel in the image: two lines of the cache.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(crate) struct ScreenSplat {
    /// Column and row of the centre.
    pub(crate) pixel: [f64; 2],
    /// A by rows: standard deviations per pixel.
    pub(crate) inverse: [f32; 4],
    /// ζ of a perspective camera, γ (metres) of an affine one.
    pub(crate) slopes: [f32; 2],
    /// Depth of the centre, metres.
    pub(crate) depth: f32,
    /// Binary logarithm of the opacity at the centre.
    pub(crate) log2_opacity: f32,
    pub(crate) colour: [f32; 3],
    /// Unit normal in the local frame, turned to the camera.
    pub(crate) normal: [f32; 3],
    /// Squared distance in standard deviations beyond which the splat is not drawn.
    pub(crate) cutoff: f32,
    /// First and last column, first and last row; inside the image.
    pub(crate) bounds: [u16; 4],
    /// Whether the least footprint may reach beyond the ellipse somewhere.
    pub(crate) is_fine: bool,
}

impl ScreenSplat {
    /// A surfel of which nothing is drawn.
    pub(crate) const HIDDEN: Self = Self {
        pixel: [0.0; 2],
        inverse: [0.0; 4],
        slopes: [0.0; 2],
        depth: 0.0,
        log2_opacity: 0.0,
        colour: [0.0; 3],
        normal: [0.0; 3],
        cutoff: 0.0,
        bounds: [0; 4],
        is_fine: true,
    };

    /// Returns whether the splat is drawn.
    pub(crate) fn is_drawn(&self) -> bool {
        self.cutoff > 0.0
    }
}

/// The derivatives that both directions need.
struct Plane {
    axes: [[f64; 3]; 3],
    scale: [f64; 2],
    /// j_u and j_v: pixels per standard deviation.
    in_image: [[f64; 2]; 2],
    /// ζ or γ.
    slopes: [f64; 2],
    /// A by rows.
    inverse: [[f64; 2]; 2],
    /// Sign that turns the normal to the camera.
    turned: f64,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn dot2(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Plane {
    /// Returns the plane in the image; `None` where it is seen from the edge.
    fn new(surfel: &Surfel, view: &LocalView, perspective: bool) -> Option<Self> {
        let (axes, scale) = (surfel.axes(), surfel.scale_m());
        let [column, row] = view.jacobian;
        let in_image = [0, 1].map(|k| [scale[k] * dot(column, axes[k]), scale[k] * dot(row, axes[k])]);
        let depth = if perspective { view.depth_m } else { 1.0 };
        let slopes = [0, 1].map(|k| scale[k] * dot(view.depth_axis, axes[k]) / depth);
        let [[ux, uy], [vx, vy]] = in_image;
        let determinant = ux * vy - vx * uy;
        // The line of sight is where the pixel does not change.
        let across = [
            column[1] * row[2] - column[2] * row[1],
            column[2] * row[0] - column[0] * row[2],
            column[0] * row[1] - column[1] * row[0],
        ];
        let along_normal = dot(across, axes[2]);
        let faces = along_normal.abs() > EDGE_ON * dot(across, across).sqrt();
        if !faces {
            return None;
        }
        let facing = along_normal * dot(across, view.depth_axis);
        let inverse = [[vy / determinant, -vx / determinant], [-uy / determinant, ux / determinant]];
        Some(Self { axes, scale, in_image, slopes, inverse, turned: if facing > 0.0 { -1.0 } else { 1.0 } })
    }

    /// Returns whether the least footprint may reach beyond the ellipse somewhere.
    ///
    /// Within the ellipse |(u, v)| ≤ c = √cutoff, so that r = 1 + ζ·(u, v) ≤ 1 + |ζ| c. Where the
    /// greatest singular value of A times that is at most √2, u² + v² ≤ 2 |offset|² in the
    /// ellipse, and the circle 2 |offset|² ≤ cutoff lies within it. With |ζ| c < 1 it lies before
    /// the camera.
    fn is_fine(&self, cutoff: f64, perspective: bool) -> bool {
        let [[a0, b0], [a1, b1]] = self.inverse;
        let (squares, determinant) = (a0 * a0 + b0 * b0 + a1 * a1 + b1 * b1, a0 * b1 - b0 * a1);
        let spread = (squares * squares - 4.0 * determinant * determinant).max(0.0).sqrt();
        let greatest_squared = 0.5 * (squares + spread);
        let slope = if perspective { (cutoff * dot2(self.slopes, self.slopes)).sqrt() } else { 0.0 };
        let is_coarse =
            slope < ROUNDED && greatest_squared * (1.0 + slope) * (1.0 + slope) < LOW_PASS_PER_PX2 * ROUNDED;
        !is_coarse
    }

    /// Returns least and greatest offsets from the centre's pixel at which the splat is drawn, or
    /// `None` where it reaches beyond the camera and may be anywhere.
    fn reach(&self, cutoff: f64, perspective: bool) -> Option<[[f64; 2]; 2]> {
        let [u, v] = self.in_image;
        let [zu, zv] = if perspective { self.slopes } else { [0.0; 2] };
        let beyond = cutoff * (zu * zu + zv * zv) - 1.0;
        if beyond > -1e-3 {
            return None;
        }
        let low_pass = (cutoff / LOW_PASS_PER_PX2).sqrt();
        Some([0, 1].map(|i| {
            // The tangents of the ellipse's image are the roots of a quadratic equation.
            let (square, mixed) = (cutoff * (u[i] * u[i] + v[i] * v[i]), cutoff * (u[i] * zu + v[i] * zv));
            let root = (mixed * mixed - square * beyond).max(0.0).sqrt();
            let ends = [(mixed + root) / beyond, (mixed - root) / beyond];
            [ends[0].min(-low_pass), ends[1].max(low_pass)]
        }))
    }
}

/// Returns the splat that a camera sees of a surfel; `None` where nothing of it is drawn.
pub(crate) fn project(surfel: &Surfel, view: &LocalView, perspective: bool, size: [usize; 2]) -> Option<ScreenSplat> {
    let opacity = surfel.opacity();
    let log_opacity = opacity.ln();
    let cutoff = 2.0 * (log_opacity - LEAST_ALPHA.ln());
    // NaN is not visible either.
    let visible = cutoff > 0.0;
    if !visible {
        return None;
    }
    let plane = Plane::new(surfel, view, perspective)?;
    let last = size.map(|s| s as f64 - 1.0);
    let mut bounds = [0, last[0] as u16, 0, last[1] as u16];
    if let Some(reach) = plane.reach(cutoff, perspective) {
        for i in 0..2 {
            let [from, to] = reach[i].map(|offset| view.pixel[i] + offset);
            let meets = to >= 0.0 && from <= last[i];
            if !meets {
                return None;
            }
            bounds[2 * i] = from.ceil().clamp(0.0, last[i]) as u16;
            bounds[2 * i + 1] = to.floor().clamp(0.0, last[i]) as u16;
        }
    }
    let [[a0, b0], [a1, b1]] = plane.inverse;
    let made = ScreenSplat {
        pixel: view.pixel,
        inverse: [a0, b0, a1, b1].map(|a| a as f32),
        slopes: plane.slopes.map(|s| s as f32),
        depth: view.depth_m as f32,
        log2_opacity: (log_opacity * std::f64::consts::LOG2_E) as f32,
        colour: surfel.colour,
        normal: plane.axes[2].map(|n| (plane.turned * n) as f32),
        cutoff: cutoff as f32,
        bounds,
        is_fine: plane.is_fine(cutoff, perspective),
    };
    let drawn = bounds[0] <= bounds[1] && bounds[2] <= bounds[3];
    let finite = made.inverse.iter().chain(&made.slopes).all(|v| v.is_finite());
    (drawn && finite).then_some(made)
}

/// Returns the gradient by a surfel's parameters, given that by its splat in the image.
pub(crate) fn gradient(surfel: &Surfel, view: &LocalView, perspective: bool, by_splat: &[f64; 16]) -> Surfel {
    let Some(plane) = Plane::new(surfel, view, perspective) else { return Surfel::default() };
    let [suu, suv, svv, gs_u, gs_v, gx, gy, _, gz, sum, red, green, blue, nx, ny, nz] = *by_splat;
    let [[a0, b0], [a1, b1]] = plane.inverse;
    let by_slopes = [gs_u, gs_v];
    // S = Σ ∂L/∂p ⊗ p. With A = J⁻¹, the gradient by J is −Aᵀ S.
    let pulled = [[suu, suv], [suv, svv]];
    let s = [0, 1].map(|i| [0, 1].map(|j| plane.slopes[i] * by_slopes[j] - pulled[i][j]));
    // Columns of J are the axes in the image.
    let by_image = [0, 1].map(|k| [-(a0 * s[0][k] + a1 * s[1][k]), -(b0 * s[0][k] + b1 * s[1][k])]);
    let depth = if perspective { view.depth_m } else { 1.0 };
    let [column, row] = view.jacobian;
    // By the scaled axes in space.
    let by_axes = [0, 1].map(|k| {
        [0, 1, 2]
            .map(|i| by_image[k][0] * column[i] + by_image[k][1] * row[i] + by_slopes[k] / depth * view.depth_axis[i])
    });
    let (mut by_pixel, mut by_depth) = ([gx, gy], gz);
    if perspective {
        // The derivatives of the pixel change with the centre, too.
        for k in 0..2 {
            by_pixel[0] -= by_image[k][0] * plane.slopes[k];
            by_pixel[1] -= by_image[k][1] * plane.slopes[k];
            let sizes = by_image[k][0] * plane.in_image[k][0] + by_image[k][1] * plane.in_image[k][1];
            by_depth -= (sizes + by_slopes[k] * plane.slopes[k]) / depth;
        }
    }
    let position =
        [0, 1, 2].map(|i| (by_pixel[0] * column[i] + by_pixel[1] * row[i] + by_depth * view.depth_axis[i]) as f32);
    let log_scale = [0, 1].map(|k| (plane.scale[k] * dot(by_axes[k], plane.axes[k])) as f32);
    let scaled = |k: usize| by_axes[k].map(|g| g * plane.scale[k]);
    let rotation = by_rotation(surfel, [scaled(0), scaled(1), [nx, ny, nz].map(|n| n * plane.turned)]);
    let opacity = surfel.opacity();
    Surfel {
        position,
        rotation,
        log_scale,
        opacity_logit: (sum * (1.0 - opacity)) as f32,
        colour: [red, green, blue].map(|c| c as f32),
    }
}

/// Returns the gradient by the quaternion, given that by the unit axes.
fn by_rotation(surfel: &Surfel, [g0, g1, g2]: [[f64; 3]; 3]) -> [f32; 4] {
    let (unit, length) = surfel.unit_rotation();
    let [w, x, y, z] = unit;
    let by_unit = [
        z * g0[1] - y * g0[2] - z * g1[0] + x * g1[2] + y * g2[0] - x * g2[1],
        y * g0[1] + z * g0[2] + y * g1[0] - 2.0 * x * g1[1] + w * g1[2] + z * g2[0] - w * g2[1] - 2.0 * x * g2[2],
        -2.0 * y * g0[0] + x * g0[1] - w * g0[2] + x * g1[0] + z * g1[2] + w * g2[0] + z * g2[1] - 2.0 * y * g2[2],
        -2.0 * z * g0[0] + w * g0[1] + x * g0[2] - w * g1[0] - 2.0 * z * g1[1] + y * g1[2] + x * g2[0] + y * g2[1],
    ]
    .map(|g| 2.0 * g);
    let along: f64 = (0..4).map(|i| by_unit[i] * unit[i]).sum();
    std::array::from_fn(|i| ((by_unit[i] - along * unit[i]) / length) as f32)
}
