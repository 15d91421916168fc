//! Vectors of three components, as plain arrays.

use plyflow_fixed::FixedBits;

/// A point or vector (m unless said otherwise).
pub type Vec3 = [f64; 3];

/// a + b.
#[inline(always)]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[inline(always)]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s a.
#[inline(always)]
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// p a + q b.
#[inline(always)]
pub fn mix(p: f64, a: Vec3, q: f64, b: Vec3) -> Vec3 {
    core::array::from_fn(|k| p * a[k] + q * b[k])
}

/// a . b.
#[inline(always)]
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a x b.
#[inline(always)]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// |a|.
#[inline(always)]
pub fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// |a - b|.
#[inline(always)]
pub fn distance(a: Vec3, b: Vec3) -> f64 {
    norm(sub(a, b))
}

/// a / |a|; what has no length stays as it is.
#[inline(always)]
pub fn unit(a: Vec3) -> Vec3 {
    let n = norm(a);
    if n > 0.0 { scale(a, 1.0 / n) } else { a }
}

/// Between two unit vectors along the great circle: `a` at `w` = 0, `b` at 1.
pub fn slerp(a: Vec3, b: Vec3, w: f64) -> Vec3 {
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
