//! Normals of a point cloud: the direction of least variance of the points in a ball.

use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;

use super::index::PointIndex;
use numeric::vector::{dot, sub, unit};

/// Lowest number of points that have a plane.
const LEAST_POINTS: usize = 3;

/// Returns the upward normal of the points within `radius_m`, or `None` if they are fewer than
/// three or on one line.
pub(super) fn normal(index: &PointIndex, at: [f64; 3], radius_m: f64) -> Option<[f64; 3]> {
    let mut near: Vec<([f64; 3], u32)> = index.within(at, radius_m).collect();
    if near.len() < LEAST_POINTS {
        return None;
    }
    // Sorting makes the sums independent of the order in which the tree is searched.
    near.sort_unstable_by_key(|(_, index)| *index);
    let count = near.len() as f64;
    let mut mean = [0.0; 3];
    near.iter().for_each(|(p, _)| (0..3).for_each(|i| mean[i] += (p[i] - at[i]) / count));
    let mut spread = Matrix3::<f64>::zeros();
    for (p, _) in &near {
        let d = sub(sub(*p, at), mean);
        (0..9).for_each(|n| spread[(n / 3, n % 3)] += d[n / 3] * d[n % 3] / count);
    }
    let eigen = SymmetricEigen::new(spread);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [least, middle, most] = order.map(|i| eigen.eigenvalues[i]);
    if !(middle > 1e-9 * most && middle > least) {
        return None;
    }
    let column = eigen.eigenvectors.column(order[0]);
    unit([column[0], column[1], column[2]]).map(upwards)
}

/// Returns the normals at many points.
pub(super) fn normals(index: &PointIndex, points: &[[f64; 3]], radius_m: f64) -> Vec<Option<[f64; 3]>> {
    points.par_iter().map(|&point| normal(index, point, radius_m)).collect()
}

/// Returns the direction or its opposite, such that the first of z, y, x that is not zero is
/// positive.
fn upwards(n: [f64; 3]) -> [f64; 3] {
    let first = [n[2], n[1], n[0]].into_iter().find(|c| *c != 0.0).unwrap_or(1.0);
    if first < 0.0 { n.map(|c| -c) } else { n }
}

/// Returns the direction or its opposite, whichever is on the side of `side`.
pub(super) fn towards(n: [f64; 3], side: [f64; 3]) -> [f64; 3] {
    if dot(n, side) < 0.0 { n.map(|c| -c) } else { n }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_plane_and_what_has_none() {
        let plane: Vec<[f64; 3]> = (0..100)
            .map(|n| {
                let (x, y) = (f64::from(n % 10) * 0.1, f64::from(n / 10) * 0.1);
                [x, y, 0.75 * x]
            })
            .collect();
        let index = PointIndex::new(&plane);
        let found = normal(&index, [0.5, 0.5, 0.375], 0.3).unwrap();
        assert!((found[0] + 0.6).abs() < 1e-9 && found[1].abs() < 1e-9 && (found[2] - 0.8).abs() < 1e-9, "{found:?}");
        assert_eq!(normal(&index, [9.0; 3], 0.3), None);
        let line: Vec<[f64; 3]> = (0..10).map(|n| [f64::from(n) * 0.1, 0.0, 0.0]).collect();
        assert_eq!(normal(&PointIndex::new(&line), [0.5, 0.0, 0.0], 1.0), None);
        assert_eq!(towards([0.0, 0.0, 1.0], [0.1, 0.0, -0.2]), [0.0, 0.0, -1.0]);
    }
}
