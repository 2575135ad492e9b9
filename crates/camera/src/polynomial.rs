//! The RPC00B cubic and its derivatives.
//!
//! Terms: 1, L, P, H, LP, LH, PH, L², P², H², PLH, L³, LP², LH², L²P, P³, PH², L²H, P²H, H³ of the
//! normalised longitude, latitude and height.

/// Returns `a · b + c` with two roundings. A fused multiply-add would give other last bits on
/// processors that have it.
#[inline(always)]
fn mul_add(a: f64, b: f64, c: f64) -> f64 {
    a * b + c
}

/// A cubic at one normalised height: 1, L, P, LP, L², P², L³, LP², L²P, P³.
pub(crate) type PlaneCubic = [f64; 10];

/// Returns the ten coefficients that are left when the height of a cubic is fixed. The reduction is
/// exact.
#[inline(always)]
pub(crate) fn at_height(c: &[f64; 20], h: f64) -> PlaneCubic {
    [
        mul_add(h, mul_add(h, mul_add(h, c[19], c[9]), c[3]), c[0]),
        mul_add(h, mul_add(h, c[13], c[5]), c[1]),
        mul_add(h, mul_add(h, c[16], c[6]), c[2]),
        mul_add(h, c[10], c[4]),
        mul_add(h, c[17], c[7]),
        mul_add(h, c[18], c[8]),
        c[11],
        c[12],
        c[14],
        c[15],
    ]
}

/// Returns the value of a cubic at a fixed height.
#[inline(always)]
pub(crate) fn plane_value(q: &PlaneCubic, l: f64, p: f64) -> f64 {
    // A polynomial in P whose coefficients are polynomials in L.
    let q0 = mul_add(l, mul_add(l, mul_add(l, q[6], q[4]), q[1]), q[0]);
    let q1 = mul_add(l, mul_add(l, q[8], q[3]), q[2]);
    let q2 = mul_add(l, q[7], q[5]);
    mul_add(p, mul_add(p, mul_add(p, q[9], q2), q1), q0)
}

/// Returns the value of a cubic at a fixed height, and its derivatives by L and P.
#[inline(always)]
pub(crate) fn plane_gradient(q: &PlaneCubic, l: f64, p: f64) -> [f64; 3] {
    let q0 = mul_add(l, mul_add(l, mul_add(l, q[6], q[4]), q[1]), q[0]);
    let q1 = mul_add(l, mul_add(l, q[8], q[3]), q[2]);
    let q2 = mul_add(l, q[7], q[5]);
    let value = mul_add(p, mul_add(p, mul_add(p, q[9], q2), q1), q0);
    let d0 = mul_add(l, mul_add(l, 3.0 * q[6], 2.0 * q[4]), q[1]);
    let d1 = mul_add(l, 2.0 * q[8], q[3]);
    let d_l = mul_add(p, mul_add(p, q[7], d1), d0);
    let d_p = mul_add(p, mul_add(p, 3.0 * q[9], 2.0 * q2), q1);
    [value, d_l, d_p]
}

/// Returns the derivative of a cubic by H.
pub(crate) fn derivative_by_height(c: &[f64; 20], l: f64, p: f64, h: f64) -> f64 {
    c[3] + l * (c[5] + l * c[17] + p * c[10])
        + p * (c[6] + p * c[18])
        + h * (2.0 * (c[9] + l * c[13] + p * c[16]) + 3.0 * h * c[19])
}

/// Returns the twenty terms in RPC00B order.
pub(crate) fn terms(l: f64, p: f64, h: f64) -> [f64; 20] {
    [
        1.0,
        l,
        p,
        h,
        l * p,
        l * h,
        p * h,
        l * l,
        p * p,
        h * h,
        p * l * h,
        l * l * l,
        l * p * p,
        l * h * h,
        l * l * p,
        p * p * p,
        p * h * h,
        l * l * h,
        p * p * h,
        h * h * h,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every nesting against the plain sum of terms, and derivatives against central differences
    /// (exact for cubics up to the third derivative, which Richardson's step removes).
    #[test]
    fn nested_forms_agree_with_the_plain_sum_of_terms() {
        let c: [f64; 20] = std::array::from_fn(|i| ((i * 7 + 3) % 11) as f64 - 4.5);
        let sum = |l: f64, p: f64, h: f64| terms(l, p, h).iter().zip(&c).map(|(t, c)| t * c).sum::<f64>();
        let derivative = |g: &dyn Fn(f64) -> f64| {
            let d = |e: f64| (g(e) - g(-e)) / (2.0 * e);
            (4.0 * d(0.05) - d(0.1)) / 3.0
        };
        for (l, p, h) in [(0.3, -0.7, 0.9), (-1.2, 0.4, -0.6), (0.0, 1.0, 2.0)] {
            let q = at_height(&c, h);
            let [value, d_l, d_p] = plane_gradient(&q, l, p);
            assert!((value - sum(l, p, h)).abs() < 1e-12);
            assert!((plane_value(&at_height(&c, h), l, p) - value).abs() < 1e-12);
            assert!((d_l - derivative(&|e| sum(l + e, p, h))).abs() < 1e-10);
            assert!((d_p - derivative(&|e| sum(l, p + e, h))).abs() < 1e-10);
            assert!((derivative_by_height(&c, l, p, h) - derivative(&|e| sum(l, p, h + e))).abs() < 1e-10);
        }
    }
}
