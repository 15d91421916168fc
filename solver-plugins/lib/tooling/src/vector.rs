//! Vectors of three numbers.

use plyflow_fixed::FixedBits;

pub(crate) type V3 = [f64; 3];

#[inline]
pub(crate) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(crate) fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub(crate) fn scale(a: V3, s: f64) -> V3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline]
pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline]
pub(crate) fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// Unit vector; zero stays zero.
#[inline]
pub(crate) fn unit(a: V3) -> V3 {
    let n = norm(a);
    if n > 0.0 { scale(a, 1.0 / n) } else { a }
}

/// Between two unit vectors along the great circle.
pub(crate) fn slerp(a: V3, b: V3, w: f64) -> V3 {
    let angle = dot(a, b).clamp(-1.0, 1.0).fixed_acos();
    if angle < 1e-12 {
        return a;
    }
    let s = angle.fixed_sin();
    unit(add(
        scale(a, ((1.0 - w) * angle).fixed_sin() / s),
        scale(b, (w * angle).fixed_sin() / s),
    ))
}
