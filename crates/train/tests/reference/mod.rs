//! A slow reference of the rasteriser in f64: every pixel meets every surfel, by plain geometry.
//!
//! Where the image jumps with the parameters (the cutoff, the horizon of a plane, the
//! greatest opacity, the order of depths), a pixel close to the jump is marked as unsure. Neither
//! rounding nor differences can be judged there. So is a pixel at a surfel that is almost seen from
//! the edge, where the rounding of the pixel to f32 moves the point of its plane too far.

use train::DepthSpread;

/// Rounding of a pixel coordinate of a tile of 16 pixels to f32.
const PIXEL_ROUNDING: f64 = 16.0 / (1 << 24) as f64;
/// Move of the point of a plane that is too far, in standard deviations: with slopes that are
/// judged to 1e-4 it is a fifth of that.
const TOO_FAR: f64 = 2e-5;

/// The parameters of a surfel in the order of `Surfel::to_array`.
pub(crate) type Parameters = [f64; 13];

/// A camera: a pinhole, or an affine map.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Eye {
    Pinhole { rotation: [[f64; 3]; 3], centre: [f64; 3], focal: [f64; 2], principal: [f64; 2] },
    Affine { pixel: [f64; 2], jacobian: [[f64; 3]; 2], axis: [f64; 3] },
}

/// The nine images and the pixels that are unsure.
pub(crate) struct Reference {
    pub(crate) planes: [Vec<f64>; 9],
    pub(crate) unsure: Vec<bool>,
}

/// A splat at a pixel.
struct Hit {
    order: f64,
    alpha: f64,
    depth: f64,
    colour: [f64; 3],
    normal: [f64; 3],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn axes(q: [f64; 4]) -> [[f64; 3]; 3] {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|c| c / length);
    [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z],
    ]
}

/// The line of sight of a pixel: a point, and the direction away from the camera.
fn ray(eye: &Eye, pixel: [f64; 2]) -> ([f64; 3], [f64; 3]) {
    match *eye {
        Eye::Pinhole { rotation, centre, focal, principal } => {
            let slope = [0, 1].map(|i| (pixel[i] - principal[i]) / focal[i]);
            let d = [0, 1, 2].map(|i| slope[0] * rotation[0][i] + slope[1] * rotation[1][i] + rotation[2][i]);
            (centre, d)
        }
        Eye::Affine { pixel: at, jacobian: [column, row], axis } => {
            // The point of the plane through the origin, spanned by both rows, that is at the
            // pixel.
            let (cc, cr, rr) = (dot(column, column), dot(column, row), dot(row, row));
            let (x, y) = (pixel[0] - at[0], pixel[1] - at[1]);
            let det = cc * rr - cr * cr;
            let (s, t) = ((rr * x - cr * y) / det, (cc * y - cr * x) / det);
            let d = cross(column, row);
            let sign = dot(d, axis).signum();
            ([0, 1, 2].map(|i| s * column[i] + t * row[i]), d.map(|c| c * sign))
        }
    }
}

fn project(eye: &Eye, p: [f64; 3]) -> ([f64; 2], f64) {
    match *eye {
        Eye::Pinhole { rotation, centre, focal, principal } => {
            let d = [0, 1, 2].map(|i| p[i] - centre[i]);
            let c = rotation.map(|axis| dot(axis, d));
            ([0, 1].map(|i| focal[i] * c[i] / c[2] + principal[i]), c[2])
        }
        Eye::Affine { pixel, jacobian, axis } => ([0, 1].map(|i| pixel[i] + dot(jacobian[i], p)), dot(axis, p)),
    }
}

/// Returns the move of the pixel with a move of a point.
fn pixel_move(eye: &Eye, p: [f64; 3], by: [f64; 3]) -> [f64; 2] {
    match *eye {
        Eye::Pinhole { rotation, centre, focal, .. } => {
            let (c, d) = (rotation.map(|a| dot(a, [0, 1, 2].map(|i| p[i] - centre[i]))), rotation.map(|a| dot(a, by)));
            [0, 1].map(|i| focal[i] * (d[i] * c[2] - c[i] * d[2]) / (c[2] * c[2]))
        }
        Eye::Affine { jacobian, .. } => jacobian.map(|row| dot(row, by)),
    }
}

/// Returns the splat at a pixel, and whether it is close to a jump.
fn hit(eye: &Eye, surfel: &Parameters, pixel: [f64; 2]) -> (Option<Hit>, bool) {
    let p = surfel;
    let centre = [p[0], p[1], p[2]];
    let [tu, tv, n] = axes([p[3], p[4], p[5], p[6]]);
    let opacity = 1.0 / (1.0 + (-p[9]).exp());
    let (at, depth) = project(eye, centre);
    let perspective = matches!(eye, Eye::Pinhole { .. });
    if perspective && depth <= 0.1 {
        return (None, false);
    }
    let sight = ray(eye, at).1;
    let facing = dot(n, sight) / dot(sight, sight).sqrt();
    if facing.abs() < 0.02 {
        return (None, facing.abs() > 0.019);
    }
    // The point of the plane, and its place there in standard deviations.
    let meet = |pixel: [f64; 2]| {
        let (from, direction) = ray(eye, pixel);
        let away = [0, 1, 2].map(|i| centre[i] - from[i]);
        let t = dot(n, away) / dot(n, direction);
        let met = [0, 1, 2].map(|i| from[i] + t * direction[i]);
        let offset = [0, 1, 2].map(|i| met[i] - centre[i]);
        (met, [dot(offset, tu) / p[7].exp(), dot(offset, tv) / p[8].exp()])
    };
    let (met, [u, v]) = meet(pixel);
    // The covariance in the image, blurred by a pixel.
    let [ju, jv] = [(tu, p[7]), (tv, p[8])].map(|(axis, scale)| pixel_move(eye, centre, axis.map(|c| c * scale.exp())));
    let own = (ju[0] * jv[1] - ju[1] * jv[0]).abs();
    let [xx, xy, yy] = [(0, 0), (0, 1), (1, 1)].map(|(i, k)| ju[i] * ju[k] + jv[i] * jv[k]);
    let (xx, yy) = (xx + 0.1, yy + 0.1);
    let blurred = xx * yy - xy * xy;
    let opacity = opacity * own / blurred.sqrt();
    let cutoff = 2.0 * (255.0 * opacity).ln();
    // A place in the plane, moved into the image by the derivatives, against that covariance.
    let squared = |u: f64, v: f64| {
        let [x, y] = [0, 1].map(|i| u * ju[i] + v * jv[i]);
        (yy * x * x - 2.0 * xy * x * y + xx * y * y) / blurred
    };
    let met_depth = project(eye, met).1;
    let ratio = if perspective { depth / met_depth } else { 1.0 };
    let rho = squared(u, v);
    let is_drawn = rho <= cutoff && ratio >= 0.05;
    let alpha = opacity * (-rho / 2.0).exp();
    let rounded = || {
        (0..2).any(|i| {
            let mut beside = pixel;
            beside[i] += PIXEL_ROUNDING;
            let [u_beside, v_beside] = meet(beside).1;
            squared(u_beside - u, v_beside - v).sqrt() > TOO_FAR
        })
    };
    let unsure = facing.abs() < 0.021
        || rho <= cutoff + 0.1 && rounded()
        || (rho - cutoff).abs() < 1e-2
        || rho <= cutoff + 0.1 && ((ratio - 0.05).abs() < 1e-2 || (alpha - 0.99).abs() < 1e-3);
    // A surfel has one normal in an image, turned by the line of sight to its centre.
    let turned = if facing > 0.0 { -1.0 } else { 1.0 };
    let hit = Hit {
        order: depth,
        alpha: alpha.min(0.99),
        depth: met_depth,
        colour: [p[10], p[11], p[12]],
        normal: n.map(|c| c * turned),
    };
    (is_drawn.then_some(hit), unsure)
}

/// Draws surfels. The ninth image is the spread of depths, or of inverse depths of a pinhole.
pub(crate) fn draw(surfels: &[Parameters], eye: &Eye, size: [usize; 2], spread: DepthSpread) -> Reference {
    let count = size[0] * size[1];
    let mut planes: [Vec<f64>; 9] = std::array::from_fn(|_| vec![0.0; count]);
    let mut unsure = vec![false; count];
    for place in 0..count {
        let pixel = [(place % size[0]) as f64, (place / size[0]) as f64];
        let mut hits = Vec::new();
        for surfel in surfels {
            let (hit, close) = hit(eye, surfel, pixel);
            unsure[place] |= close;
            hits.extend(hit);
        }
        hits.sort_by(|a, b| a.order.total_cmp(&b.order));
        unsure[place] |= hits.windows(2).any(|pair| pair[1].order - pair[0].order < 1e-4);
        let mut left = 1.0f64;
        let mut drawn: Vec<[f64; 2]> = Vec::new();
        for hit in &hits {
            unsure[place] |= (left / 1e-4 - 1.0).abs() < 1e-3;
            if left < 1e-4 {
                break;
            }
            let weight = left * hit.alpha;
            left *= 1.0 - hit.alpha;
            for i in 0..3 {
                planes[i][place] += weight * hit.colour[i];
                planes[4 + i][place] += weight * hit.normal[i];
            }
            planes[3][place] += weight;
            planes[7][place] += weight * hit.depth;
            let inverse = spread == DepthSpread::InverseDepths && matches!(eye, Eye::Pinhole { .. });
            drawn.push([weight, if inverse { 1.0 / hit.depth } else { hit.depth }]);
        }
        let pairs = drawn.iter().flat_map(|a| drawn.iter().map(move |b| a[0] * b[0] * (a[1] - b[1]).powi(2)));
        planes[8][place] = pairs.sum::<f64>() / 2.0;
    }
    Reference { planes, unsure }
}
