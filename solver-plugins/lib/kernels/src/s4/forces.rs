//! Kinematics, superposition of the layers and nodal forces of `s4`, on lanes.

use super::rotation::{cross, dot, mix, scaled, sub, turn};
use super::section::{Layers, row};
use crate::{Lanes, WIDTH, dispatch, thickening};

/// What one batch of at most `N` lanes needs between the material calls. Rows of n lanes lie one
/// after the other from the start of each field.
#[repr(align(64))]
pub(super) struct Scratch<const N: usize> {
    /// g1, g2: `[2][3][lanes]`.
    g: [[f64; N]; 6],
    /// d,1 and d,2: `[2][3][lanes]`.
    slope: [[f64; N]; 6],
    /// Of the middle, the upper and the lower layer: `[3][3][lanes]`.
    metric: [[f64; N]; 9],
    stress: [[f64; N]; 9],
    energy: [[f64; N]; 3],
    stiffness: [[f64; N]; 6],
    /// As the bending law gets them: k12 is 0 when the layers carry the twist.
    curvature: [[f64; N]; 3],
    moment: [[f64; N]; 3],
    tangent: [[f64; N]; 3],
    bending: [f64; N],
    /// The bending of a section that thickens, without the layers' twist.
    swell: [f64; N],
}

impl<const N: usize> Scratch<N> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self {
            g: [[0.0; N]; 6],
            slope: [[0.0; N]; 6],
            metric: [[0.0; N]; 9],
            stress: [[0.0; N]; 9],
            energy: [[0.0; N]; 3],
            stiffness: [[0.0; N]; 6],
            curvature: [[0.0; N]; 3],
            moment: [[0.0; N]; 3],
            tangent: [[0.0; N]; 3],
            bending: [0.0; N],
            swell: [0.0; N],
        }
    }

    pub(super) fn view(&mut self) -> View<'_> {
        View {
            g: self.g.as_flattened_mut(),
            slope: self.slope.as_flattened_mut(),
            metric: self.metric.as_flattened_mut(),
            stress: self.stress.as_flattened_mut(),
            energy: self.energy.as_flattened_mut(),
            stiffness: self.stiffness.as_flattened_mut(),
            curvature: self.curvature.as_flattened_mut(),
            moment: self.moment.as_flattened_mut(),
            tangent: self.tangent.as_flattened_mut(),
            bending: &mut self.bending,
            swell: &mut self.swell,
        }
    }
}

/// A [`Scratch`] of any size.
pub(super) struct View<'a> {
    pub g: &'a mut [f64],
    pub slope: &'a mut [f64],
    pub metric: &'a mut [f64],
    pub stress: &'a mut [f64],
    pub energy: &'a mut [f64],
    pub stiffness: &'a mut [f64],
    pub curvature: &'a mut [f64],
    pub moment: &'a mut [f64],
    pub tangent: &'a mut [f64],
    pub bending: &'a mut [f64],
    pub swell: &'a mut [f64],
}

dispatch!(pub(super) fn kinematics(
    position: &[f64],
    spin: &[f64],
    dt: f64,
    constants: &[f64],
    n: usize,
    height: Option<f64>,
    directors: &mut [f64],
    s: &mut View<'_>,
) = kinematics_kernel, lanes n);
dispatch!(pub(super) fn superpose(n: usize, layers: &Layers, s: &mut View<'_>) = superpose_kernel, lanes n);
dispatch!(pub(super) fn swell(power: u32, n: usize, s: &mut View<'_>) = swell_kernel, lanes n);
dispatch!(pub(super) fn forces(
    position: &[f64],
    directors: &[f64],
    constants: &[f64],
    n: usize,
    s: &View<'_>,
    force: &mut [f64],
    moment: &mut [f64],
    energy: &mut [f64],
) = forces_kernel, lanes n);

/// A node's or a column's three components.
#[inline(always)]
fn three<V: Lanes>(from: &[f64], first: usize, n: usize, c: usize) -> [V; 3] {
    [
        V::load(from, first * n + c),
        V::load(from, (first + 1) * n + c),
        V::load(from, (first + 2) * n + c),
    ]
}

#[inline(always)]
fn store<V: Lanes>(v: &[V; 3], to: &mut [f64], first: usize, n: usize, c: usize) {
    for k in 0..3 {
        v[k].store(to, (first + k) * n + c);
    }
}

/// Four nodes' three components.
#[inline(always)]
fn nodes<V: Lanes>(from: &[f64], n: usize, c: usize) -> [[V; 3]; 4] {
    [
        three(from, 0, n, c),
        three(from, 3, n, c),
        three(from, 6, n, c),
        three(from, 9, n, c),
    ]
}

/// `p (v1 - v3) + q (v2 - v4)`: a derivative at the point.
#[inline(always)]
fn gradient<V: Lanes>(v: &[[V; 3]; 4], p: V, q: V) -> [V; 3] {
    mix(p, &sub(&v[0], &v[2]), q, &sub(&v[1], &v[3]))
}

/// `v1 - v2 + v3 - v4 - h1 u - h2 w`: a nodal vector's hourglass mode, with its derivatives u, w.
#[inline(always)]
fn hourglass<V: Lanes>(v: &[[V; 3]; 4], h: [V; 2], u: &[V; 3], w: &[V; 3]) -> [V; 3] {
    let (a, b) = (sub(&v[0], &v[1]), sub(&v[2], &v[3]));
    [
        (a[0] + b[0]) - h[0] * u[0] - h[1] * w[0],
        (a[1] + b[1]) - h[0] * u[1] - h[1] * w[1],
        (a[2] + b[2]) - h[0] * u[2] - h[1] * w[2],
    ]
}

/// What the directors' hourglass mode takes off the slopes of their mean, as a factor `1 + |q_d|^2 / 32`: four unit vectors that are
/// turned to and fro by b (`|q_d| = 4 b`) have a mean, and its slopes, shorter by cos b. Uncorrected, an element that is bent gives way
/// to this mode, which no neighbour sees.
#[inline(always)]
fn lengthened<V: Lanes>(d: &[[V; 3]; 4], h: [V; 2], s1: &[V; 3], s2: &[V; 3]) -> V {
    let q = hourglass(d, h, s1, s2);
    V::splat(1.0) + V::splat(1.0 / 32.0) * dot(&q, &q)
}

/// Turns the directors (which start along the normal) and writes g, d,a, metrics and curvatures.
#[inline(always)]
fn kinematics_kernel<V: Lanes>(
    position: &[f64],
    spin: &[f64],
    dt: f64,
    constants: &[f64],
    n: usize,
    height: Option<f64>,
    directors: &mut [f64],
    s: &mut View<'_>,
) {
    let half = V::splat(0.5);
    for c in (0..n).step_by(WIDTH) {
        let b = |r: usize| V::load(constants, r * n + c);
        let (b11, b21, b12, b22) = (b(0), b(1), b(2), b(3));
        let normal: [V; 3] = three(constants, row::NORMAL, n, c);
        let mut d = [[V::splat(0.0); 3]; 4];
        for i in 0..4 {
            let before: [V; 3] = three(directors, 3 * i, n, c);
            let fresh = dot(&before, &before).lt(half);
            let before = [
                V::select(fresh, normal[0], before[0]),
                V::select(fresh, normal[1], before[1]),
                V::select(fresh, normal[2], before[2]),
            ];
            let w: [V; 3] = three(spin, 3 * i, n, c);
            d[i] = turn(&before, &scaled(V::splat(dt), &w));
            store(&d[i], directors, 3 * i, n, c);
        }
        let x: [[V; 3]; 4] = nodes(position, n, c);
        let (g1, g2) = (gradient(&x, b11, b21), gradient(&x, b12, b22));
        let (s1, s2) = (gradient(&d, b11, b21), gradient(&d, b12, b22));
        store(&g1, s.g, 0, n, c);
        store(&g2, s.g, 3, n, c);
        store(&s1, s.slope, 0, n, c);
        store(&s2, s.slope, 3, n, c);
        let metric = [dot(&g1, &g1), dot(&g2, &g2), dot(&g1, &g2)];
        store(&metric, s.metric, 0, n, c);
        let length = lengthened(&d, [b(4), b(5)], &s1, &s2);
        let twist = -(length * (half * (dot(&s1, &g2) + dot(&s2, &g1))));
        let mut k = [-(length * dot(&s1, &g1)), -(length * dot(&s2, &g2)), twist];
        if let Some(z) = height {
            let change = V::splat(2.0 * z) * twist;
            let layer = |c12: V| [metric[0], metric[1], c12];
            store(&layer(metric[2] - change), s.metric, 3, n, c);
            store(&layer(metric[2] + change), s.metric, 6, n, c);
            k[2] = V::splat(0.0);
        }
        store(&k, s.curvature, 0, n, c);
    }
}

/// Stress of the middle becomes that of all layers; their twisting moment and what their energy
/// exceeds the middle's are added to the bending. With dC12 = -2 z dk12, `M12 = -sum w z S12`.
#[inline(always)]
fn superpose_kernel<V: Lanes>(n: usize, layers: &Layers, s: &mut View<'_>) {
    let (core, surface) = (V::splat(layers.core), V::splat(layers.surface));
    let lever = V::splat(layers.surface * layers.height);
    for c in (0..n).step_by(WIDTH) {
        let middle: [V; 3] = three(s.stress, 0, n, c);
        let (up, down): ([V; 3], [V; 3]) = (three(s.stress, 3, n, c), three(s.stress, 6, n, c));
        let sum = [
            core * middle[0] + surface * (up[0] + down[0]),
            core * middle[1] + surface * (up[1] + down[1]),
            core * middle[2] + surface * (up[2] + down[2]),
        ];
        store(&sum, s.stress, 0, n, c);
        let twist = V::load(s.moment, 2 * n + c) + lever * (down[2] - up[2]);
        twist.store(s.moment, 2 * n + c);
        let [w, wu, wd]: [V; 3] = three(s.energy, 0, n, c);
        let more = surface * ((wu - w) + (wd - w));
        (V::load(s.bending, c) + more).store(s.bending, c);
    }
}

/// What a bent section that thickens adds to the stress: `2 d(J^-p W_b)/dC = -p J^-p W_b C^-1`.
#[inline(always)]
fn swell_kernel<V: Lanes>(power: u32, n: usize, s: &mut View<'_>) {
    for c in (0..n).step_by(WIDTH) {
        let [c11, c22, c12]: [V; 3] = three(s.metric, 0, n, c);
        let inverse = V::splat(1.0) / (c11 * c22 - c12 * c12).max(V::splat(thickening::LEAST));
        let pull = V::splat(f64::from(power)) * V::load(s.swell, c) * inverse;
        let [s11, s22, s12]: [V; 3] = three(s.stress, 0, n, c);
        let sum = [s11 - pull * c22, s22 - pull * c11, s12 + pull * c12];
        store(&sum, s.stress, 0, n, c);
    }
}

/// Long, as it is the loop of a kernel: pieces of it would share most of its values, and its speed would hang on how they are inlined.
#[inline(always)]
fn forces_kernel<V: Lanes>(
    position: &[f64],
    directors: &[f64],
    constants: &[f64],
    n: usize,
    s: &View<'_>,
    force: &mut [f64],
    moment: &mut [f64],
    energy: &mut [f64],
) {
    let half = V::splat(0.5);
    for c in (0..n).step_by(WIDTH) {
        let b = |r: usize| V::load(constants, r * n + c);
        let (b11, b21, b12, b22) = (b(0), b(1), b(2), b(3));
        let (h1, h2, area) = (b(4), b(5), b(6));
        let (x, d): ([[V; 3]; 4], [[V; 3]; 4]) = (nodes(position, n, c), nodes(directors, n, c));
        let (g1, g2): ([V; 3], [V; 3]) = (three(s.g, 0, n, c), three(s.g, 3, n, c));
        let (s1, s2): ([V; 3], [V; 3]) = (three(s.slope, 0, n, c), three(s.slope, 3, n, c));

        // Sides: 1-2, 4-3, 1-4, 2-3.
        let side = [
            sub(&x[1], &x[0]),
            sub(&x[2], &x[3]),
            sub(&x[3], &x[0]),
            sub(&x[2], &x[1]),
        ];
        let mean = [
            mix(half, &d[0], half, &d[1]),
            mix(half, &d[3], half, &d[2]),
            mix(half, &d[0], half, &d[3]),
            mix(half, &d[1], half, &d[2]),
        ];
        let e = [
            dot(&side[0], &mean[0]),
            dot(&side[1], &mean[1]),
            dot(&side[2], &mean[2]),
            dot(&side[3], &mean[3]),
        ];
        let warp = b(row::WARP);
        let (a1, a2) = ((e[0] - e[1]) + warp, (e[2] - e[3]) + warp);
        let (along, across) = (half * (e[0] + e[1]), half * (e[2] + e[3]));
        // Transverse shear over the diagonals 3-1 and 4-2.
        let (m13, m24) = (-(along + across), along - across);
        let (y1, y2) = (b11 * m13 + b21 * m24, b12 * m13 + b22 * m24);
        let (k11, k22, k12) = (b(row::SHEAR), b(row::SHEAR + 1), b(row::SHEAR + 2));
        let (q1, q2) = (k11 * y1 + k12 * y2, k12 * y1 + k22 * y2);
        let (c13, c24) = (b11 * q1 + b12 * q2, b21 * q1 + b22 * q2);
        let (r1, r2) = (b(row::EDGE) * a1, b(row::EDGE + 1) * a2);
        let (p, q) = (half * (c24 - c13), -(half * (c24 + c13)));
        let pull = [p + r1, p - r1, q + r2, q - r2];
        let shear = half * (q1 * y1 + q2 * y2);

        // In-plane hourglass mode: q less its part along the normal.
        let (c11, c22, c12) = (
            V::load(s.metric, c),
            V::load(s.metric, n + c),
            V::load(s.metric, 2 * n + c),
        );
        let inverse = V::splat(1.0) / (c11 * c22 - c12 * c12).max(V::splat(1e-12));
        let root = inverse.sqrt();
        let nn = scaled(root, &cross(&g1, &g2));
        let hx = hourglass(&x, [h1, h2], &g1, &g2);
        let hd = hourglass(&d, [h1, h2], &s1, &s2);
        let (plane, bent) = (b(7), b(row::DIRECTOR));
        let (qq, qn, qd) = (dot(&hx, &hx), dot(&hx, &nn), dot(&hd, &hd));
        let (w1, w2) = (dot(&hx, &g1), dot(&hx, &g2));
        let lift = plane * qn;
        let w1u = lift * (c22 * w1 - c12 * w2) * inverse;
        let w2u = lift * (c11 * w2 - c12 * w1) * inverse;

        let stress = scaled(area, &three(s.stress, 0, n, c));
        // Curvatures are the product of `length` and of what slopes and columns give.
        let length = V::splat(1.0) + V::splat(1.0 / 32.0) * qd;
        let m = scaled(area, &three(s.moment, 0, n, c));
        let (p1, p2) = (mix(m[0], &g1, m[2], &g2), mix(m[2], &g1, m[1], &g2));
        let work = -(dot(&s1, &p1) + dot(&s2, &p2));
        let held = bent + V::splat(1.0 / 16.0) * work;
        let m = scaled(length, &m);
        let (p1, p2) = (scaled(length, &p1), scaled(length, &p2));
        let (mut f, mut t) = ([[V::splat(0.0); 3]; 4], [[V::splat(0.0); 3]; 4]);
        for k in 0..3 {
            let stay = plane * hx[k] - lift * nn[k];
            let t1 =
                stress[0] * g1[k] + stress[2] * g2[k] - (m[0] * s1[k] + m[2] * s2[k]) - h1 * stay
                    + w1u * nn[k];
            let t2 =
                stress[2] * g1[k] + stress[1] * g2[k] - (m[2] * s1[k] + m[1] * s2[k]) - h2 * stay
                    + w2u * nn[k];
            let (u, w) = (b11 * t1 + b12 * t2, b21 * t1 + b22 * t2);
            let v = [
                pull[0] * mean[0][k],
                pull[1] * mean[1][k],
                pull[2] * mean[2][k],
                pull[3] * mean[3][k],
            ];
            f[0][k] = (stay + u) - (v[0] + v[2]);
            f[1][k] = (w - stay) + (v[0] - v[3]);
            f[2][k] = (stay - u) + (v[1] + v[3]);
            f[3][k] = (v[2] - v[1]) - (w + stay);
            // The same for the directors.
            let stay = held * hd[k];
            let t1 = -p1[k] - h1 * stay;
            let t2 = -p2[k] - h2 * stay;
            let (u, w) = (b11 * t1 + b12 * t2, b21 * t1 + b22 * t2);
            let v = [
                half * pull[0] * side[0][k],
                half * pull[1] * side[1][k],
                half * pull[2] * side[2][k],
                half * pull[3] * side[3][k],
            ];
            t[0][k] = (stay + u) + (v[0] + v[2]);
            t[1][k] = (w - stay) + (v[0] + v[3]);
            t[2][k] = (stay - u) + (v[1] + v[3]);
            t[3][k] = (v[1] + v[2]) - (w + stay);
        }
        for i in 0..4 {
            store(&f[i], force, 3 * i, n, c);
            store(&cross(&d[i], &t[i]), moment, 3 * i, n, c);
        }
        (V::load(s.energy, c) * area).store(energy, c);
        (V::load(s.bending, c) * area + shear).store(energy, n + c);
        let hourglass = plane * (qq - qn * qn) + bent * qd + (r1 * a1 + r2 * a2);
        (half * hourglass).store(energy, 2 * n + c);
    }
}
