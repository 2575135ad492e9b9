//! Vectors of three numbers: the few operations that geometry here and in the crates above needs.

/// Three coordinates, or three components.
pub type Vector = [f64; 3];

/// `a − b`.
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The scalar product.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `factor · a`.
pub fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|c| c * factor)
}

/// `a + t · b`.
pub fn along(a: Vector, t: f64, b: Vector) -> Vector {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

/// The length.
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The vector of length 1 in the same direction; `None` for zero and for lengths that are not finite.
pub fn unit(a: Vector) -> Option<Vector> {
    let length = norm(a);
    (length > 0.0 && length.is_finite()).then(|| a.map(|c| c / length))
}

/// `sum + a × b`.
pub fn add_cross(sum: Vector, a: Vector, b: Vector) -> Vector {
    along(sum, 1.0, cross(a, b))
}
