//! From a surfel to its footprint in the image, and the gradient back.
//!
//! With u and v the position in the plane in standard deviations, j the derivatives of the pixel
//! and ζ those of the relative depth along the two axes, a point of the plane lies at the offset
//! (u j_u + v j_v) / (1 + u ζ_u + v ζ_v) from the centre's pixel, exactly. The inverse is
//! u = p₀ r, v = p₁ r with (p₀, p₁) = A · offset, A = [j_u j_v]⁻¹ and r = 1 / (1 − ζ_u p₀ − ζ_v
//! p₁).
//! The depth there is z₀ r. For an affine camera r = 1, and the depth is z₀ + γ_u u + γ_v v.
//!
//! A pixel shows the mean over its area. So the Gaussian is blurred in its own plane by the pixel
//! as the plane sees it: its covariance 1 becomes 1 + s A Aᵀ with the variance s of a pixel, and
//! its opacity falls by the factor that its area grows by (the 2D filter of Yu et al., "Mip-
//! Splatting", CVPR 2024, in the plane of the splat as Younes and Boukhayma, "Anti-Aliased 2D
//! Gaussian Splatting", 2025). With J Jᵀ + s = L Lᵀ, that is the splat whose derivatives of the
//! pixel are L instead of J = [j_u j_v], in the same plane: its ζ are Lᵀ Aᵀ ζ. From then on there
//! is no difference between splats, however fine they are.

use crate::surfel::Surfel;
use crate::view::LocalView;

/// Opacity of a pixel below which a splat is not drawn, as in all viewers of splats.
pub(crate) const LEAST_ALPHA: f64 = 1.0 / 255.0;
/// Sine of the angle between a splat and the line of sight below which it is not drawn (1.1°). It
/// is thinner than a pixel there, and its inverse has no precision in f32.
const EDGE_ON: f64 = 0.02;
/// Variance of a pixel, px²: that of Mip-Splatting, close to the 1/12 of a square.
const PIXEL_PX2: f64 = 0.1;

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
    /// L⁻¹ by rows: standard deviations of the blurred splat per pixel.
    pub(crate) inverse: [f32; 4],
    /// ζ of a perspective camera, γ (metres) of an affine one, of the blurred splat.
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
    /// Whether the plane runs to the horizon or behind the camera within the splat.
    pub(crate) is_wide: bool,
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
        is_wide: false,
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
}

/// A splat after the blur of a pixel.
struct Blurred {
    /// The columns of L.
    in_image: [[f64; 2]; 2],
    /// L⁻¹ by rows.
    inverse: [[f64; 2]; 2],
    /// Aᵀ ζ: the change of 1 / r, or of the depth, by a pixel.
    by_pixel: [f64; 2],
    /// Lᵀ Aᵀ ζ.
    slopes: [f64; 2],
    /// Natural logarithm of the factor of the opacity.
    log_share: f64,
}

impl Blurred {
    fn new(plane: &Plane) -> Self {
        let [[ux, uy], [vx, vy]] = plane.in_image;
        let determinant = ux * vy - vx * uy;
        let (xx, xy, yy) = (ux * ux + vx * vx, ux * uy + vx * vy, uy * uy + vy * vy);
        // Of J Jᵀ + s; no difference of large numbers as that of the sums would be.
        let blurred = determinant * determinant + PIXEL_PX2 * (xx + yy) + PIXEL_PX2 * PIXEL_PX2;
        let first = (xx + PIXEL_PX2).sqrt();
        let (across, second) = (xy / first, blurred.sqrt() / first);
        let [[a0, b0], [a1, b1]] = plane.inverse;
        let [zu, zv] = plane.slopes;
        let by_pixel = [a0 * zu + a1 * zv, b0 * zu + b1 * zv];
        Self {
            in_image: [[first, across], [0.0, second]],
            inverse: [[1.0 / first, 0.0], [-across / (first * second), 1.0 / second]],
            by_pixel,
            slopes: [first * by_pixel[0] + across * by_pixel[1], second * by_pixel[1]],
            log_share: determinant.abs().ln() - 0.5 * blurred.ln(),
        }
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
        Some([0, 1].map(|i| {
            // The tangents of the ellipse's image are the roots of a quadratic equation.
            let (square, mixed) = (cutoff * (u[i] * u[i] + v[i] * v[i]), cutoff * (u[i] * zu + v[i] * zv));
            let root = (mixed * mixed - square * beyond).max(0.0).sqrt();
            [(mixed + root) / beyond, (mixed - root) / beyond]
        }))
    }

    /// Returns the gradient by the axes in the image, j_u and j_v, and by ζ, given that by the
    /// blurred splat: its axes, its ζ and the logarithm of its opacity.
    fn gradient(
        &self,
        plane: &Plane,
        by_axes: [[f64; 2]; 2],
        by_slopes: [f64; 2],
        by_share: f64,
    ) -> ([[f64; 2]; 2], [f64; 2]) {
        let [j, a, own, l] = [plane.in_image, plane.inverse, self.inverse, self.in_image];
        let g = self.by_pixel;
        // ζ of the blurred splat is Lᵀ g, with g = Aᵀ ζ.
        let by_l = [0, 1].map(|k| [0, 1].map(|i| by_axes[k][i] + g[i] * by_slopes[k]));
        let by_g = [0, 1].map(|i| l[0][i] * by_slopes[0] + l[1][i] * by_slopes[1]);
        // What is drawn depends on L by L Lᵀ alone, so that the gradient by L is 2 S L with a
        // symmetric S, which is the gradient by L Lᵀ = J Jᵀ + s.
        let twice = [0, 1].map(|i| [0, 1].map(|k| by_l[0][i] * own[0][k] + by_l[1][i] * own[1][k]));
        let mixed = 0.5 * (twice[0][1] + twice[1][0]);
        let twice = [[twice[0][0], mixed], [mixed, twice[1][1]]];
        let by_zeta = a.map(|row| dot2(row, by_g));
        let precision = [0, 1].map(|i| [0, 1].map(|k| own[0][i] * own[0][k] + own[1][i] * own[1][k]));
        let by_j = [0, 1].map(|k| {
            [0, 1].map(|i| {
                let share = a[k][i] - dot2(precision[i], j[k]);
                dot2(twice[i], j[k]) - g[i] * by_zeta[k] + by_share * share
            })
        });
        (by_j, by_zeta)
    }
}

/// Returns the splat that a camera sees of a surfel; `None` where nothing of it is drawn.
pub(crate) fn project(surfel: &Surfel, view: &LocalView, perspective: bool, size: [usize; 2]) -> Option<ScreenSplat> {
    let visible = |log_opacity: f64| {
        let cutoff = 2.0 * (log_opacity - LEAST_ALPHA.ln());
        // NaN is not visible either.
        (cutoff > 0.0).then_some(cutoff)
    };
    let log_opacity = surfel.opacity().ln();
    visible(log_opacity)?;
    let plane = Plane::new(surfel, view, perspective)?;
    let blurred = Blurred::new(&plane);
    let log_opacity = log_opacity + blurred.log_share;
    let cutoff = visible(log_opacity)?;
    let last = size.map(|s| s as f64 - 1.0);
    let mut bounds = [0, last[0] as u16, 0, last[1] as u16];
    let reach = blurred.reach(cutoff, perspective);
    if let Some(reach) = reach {
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
    let [[a0, b0], [a1, b1]] = blurred.inverse;
    let made = ScreenSplat {
        pixel: view.pixel,
        inverse: [a0, b0, a1, b1].map(|a| a as f32),
        slopes: blurred.slopes.map(|s| s as f32),
        depth: view.depth_m as f32,
        log2_opacity: (log_opacity * std::f64::consts::LOG2_E) as f32,
        colour: surfel.colour,
        normal: plane.axes[2].map(|n| (plane.turned * n) as f32),
        cutoff: cutoff as f32,
        bounds,
        is_wide: reach.is_none(),
    };
    let drawn = bounds[0] <= bounds[1] && bounds[2] <= bounds[3];
    let finite = made.inverse.iter().chain(&made.slopes).all(|v| v.is_finite());
    (drawn && finite).then_some(made)
}

/// Returns the gradient by a surfel's parameters, given that by its splat in the image.
pub(crate) fn gradient(surfel: &Surfel, view: &LocalView, perspective: bool, by_splat: &[f64; 16]) -> Surfel {
    let Some(plane) = Plane::new(surfel, view, perspective) else { return Surfel::default() };
    let [suu, suv, svv, gs_u, gs_v, gx, gy, _, gz, sum, red, green, blue, nx, ny, nz] = *by_splat;
    let blurred = Blurred::new(&plane);
    let [[a0, b0], [a1, b1]] = blurred.inverse;
    let by_slopes = [gs_u, gs_v];
    // S = Σ ∂L/∂p ⊗ p. With p = L⁻¹ · offset, the gradient by L is −L⁻ᵀ S.
    let pulled = [[suu, suv], [suv, svv]];
    let s = [0, 1].map(|i| [0, 1].map(|j| blurred.slopes[i] * by_slopes[j] - pulled[i][j]));
    let by_image = [0, 1].map(|k| [-(a0 * s[0][k] + a1 * s[1][k]), -(b0 * s[0][k] + b1 * s[1][k])]);
    let (by_image, by_slopes) = blurred.gradient(&plane, by_image, by_slopes, sum);
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
