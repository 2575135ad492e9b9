//! Vectors of three numbers: the few operations that geometry needs.
//!
//! The order of the floating-point operations is part of the contract: results have the same bits
//! everywhere.

/// Three coordinates, or three components.
pub type Vector = [f64; 3];

/// Returns `a − b`.
#[inline]
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns the scalar product.
///
/// ```
/// assert_eq!(numeric::vector::dot([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]), 32.0);
/// ```
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the vector product.
///
/// ```
/// assert_eq!(numeric::vector::cross([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
/// ```
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns `factor · a`.
#[inline]
pub fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|c| c * factor)
}

/// Returns `a + t · b`: the point at parameter `t` of a line.
#[inline]
pub fn along(a: Vector, t: f64, b: Vector) -> Vector {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

/// Returns the length.
#[inline]
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the vector of length 1 in the same direction, or `None` if the length is zero or not
/// finite.
///
/// ```
/// assert_eq!(numeric::vector::unit([0.0, 3.0, 4.0]), Some([0.0, 0.6, 0.8]));
/// assert_eq!(numeric::vector::unit([0.0; 3]), None);
/// ```
#[inline]
pub fn unit(a: Vector) -> Option<Vector> {
    let length = norm(a);
    (length > 0.0 && length.is_finite()).then(|| a.map(|c| c / length))
}

/// Returns the vector of length 1 in the same direction. The components are NaN if the length is
/// zero.
#[inline]
pub fn normalized(a: Vector) -> Vector {
    let length = norm(a);
    a.map(|c| c / length)
}

/// Returns `sum + a × b`.
#[inline]
pub fn add_cross(sum: Vector, a: Vector, b: Vector) -> Vector {
    along(sum, 1.0, cross(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn directions_have_length_one() {
        assert_eq!(unit([f64::INFINITY, 0.0, 0.0]), None);
        assert_eq!(unit([f64::NAN, 0.0, 0.0]), None);
        assert_eq!(normalized([0.0, -2.0, 0.0]), [0.0, -1.0, 0.0]);
        assert!(normalized([0.0; 3])[0].is_nan());
    }

    proptest! {
        #[test]
        fn the_vector_product_is_perpendicular_to_both(
            a in prop::array::uniform3(-9.0..9.0f64), b in prop::array::uniform3(-9.0..9.0f64),
        ) {
            let product = cross(a, b);
            prop_assert!(dot(product, a).abs() < 1e-10 && dot(product, b).abs() < 1e-10);
            // Lagrange's identity.
            let squares = dot(a, a) * dot(b, b) - dot(a, b).powi(2);
            prop_assert!((dot(product, product) - squares).abs() < 1e-9 * (1.0 + dot(a, a) * dot(b, b)));
            prop_assert_eq!(add_cross(sub(a, b), a, b), along(sub(a, b), 1.0, scale(product, 1.0)));
        }
    }
}
