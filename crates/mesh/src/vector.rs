//! The few vector operations on `[f64; 3]` that the geometry here needs.

pub(crate) type Vector = [f64; 3];

pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|c| c * factor)
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The vector of length 1; `None` for zero and for lengths that are not finite.
pub(crate) fn unit(a: Vector) -> Option<Vector> {
    let length = norm(a);
    (length > 0.0 && length.is_finite()).then(|| scale(a, 1.0 / length))
}

/// `sum + a × b`.
pub(crate) fn add_cross(sum: Vector, a: Vector, b: Vector) -> Vector {
    let c = cross(a, b);
    [sum[0] + c[0], sum[1] + c[1], sum[2] + c[2]]
}
