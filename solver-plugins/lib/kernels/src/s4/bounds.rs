//! Bounds of the largest frequency of an element of `s4`.
//!
//! The stiffness is `sum of (strain derivative)^T tangent (strain derivative) + geometric part`.
//! Each kind of strain is moved by three parts of a motion: displacements in the element's plane (y),
//! across it (z), and rotations (r), with masses and inertias taken in. What a kind can store is at
//! most `(a |y| + b |z| + c |r|)^2`, where a^2, b^2, c^2 bound its blocks as in [`crate::quad`]: a
//! product of the largest eigenvalues of its factors. So omega^2 is at most the largest eigenvalue of
//! the sum of `(a, b, c) (a, b, c)^T` over the kinds. In a flat element membrane and transverse shear
//! move different parts, and the larger of them counts, not their sum. Directors have length 1, so a
//! strain's derivative by a rotation is never longer than that by its director.

use super::forces::View;
use super::section::{S4, row};
use crate::quad::largest;
use nalgebra::{Matrix3, Vector3};
use plyflow_geometry::vec3::{Vec3, cross, dot, mix, norm};

/// What each kind of strain stores over displacements in the plane, across it, and rotations: roots of
/// its blocks' bounds (1/s).
#[derive(Default)]
struct Kinds(Matrix3<f64>);

impl Kinds {
    /// Adds a kind by the bounds of its blocks' omega^2 (1/s2).
    fn add(&mut self, blocks: [f64; 3]) {
        let v = Vector3::from(blocks.map(|b| b.max(0.0).sqrt()));
        self.0 += v * v.transpose();
    }

    /// Bound of omega^2 of all kinds together (1/s2).
    fn largest(&self) -> f64 {
        self.0.symmetric_eigenvalues().max()
    }
}

/// Bounds of the rotational stiffness (N m) by kind.
struct Rotational {
    /// Transverse shear of the sides.
    sides: f64,
    /// Curvature along the fibres.
    bending: f64,
    /// Twist.
    twist: f64,
    /// The directors' hourglass mode.
    hourglass: f64,
}

impl Rotational {
    fn sum(&self) -> f64 {
        self.sides + self.bending + self.twist + self.hourglass
    }
}

/// Constants of one lane.
struct Lane {
    b: [f64; 4],
    h: [f64; 2],
    area: f64,
    plane: f64,
    /// b^T b: 11, 22, 12, and its largest eigenvalue.
    gradient: [f64; 3],
    widest: f64,
    shear: [f64; 3],
    edge: [f64; 2],
    director: f64,
    inertia: f64,
}

impl Lane {
    fn new(constants: &[f64], n: usize, l: usize) -> Self {
        let c = |r: usize| constants[r * n + l];
        let b = [c(0), c(1), c(2), c(3)];
        let gradient = [
            2.0 * (b[0] * b[0] + b[1] * b[1]),
            2.0 * (b[2] * b[2] + b[3] * b[3]),
            2.0 * (b[0] * b[2] + b[1] * b[3]),
        ];
        Self {
            b,
            h: [c(4), c(5)],
            area: c(6),
            plane: c(7),
            gradient,
            widest: largest(gradient[0], gradient[1], gradient[2]),
            shear: [c(row::SHEAR), c(row::SHEAR + 1), c(row::SHEAR + 2)],
            edge: [c(row::EDGE), c(row::EDGE + 1)],
            director: c(row::DIRECTOR),
            inertia: c(row::INERTIA),
        }
    }

    /// Squared length of the hourglass vector h - h1 B1 - h2 B2 (h and B are orthogonal).
    fn mode(&self) -> f64 {
        let ([h1, h2], g) = (self.h, self.gradient);
        4.0 + h1 * h1 * g[0] + h2 * h2 * g[1] + 2.0 * h1 * h2 * g[2]
    }

    /// Stiffness over the displacements (N/m) of the transverse shear, without curvature in the
    /// element: the sides' means through the gradient, their differences through the hourglass mode.
    /// `skew`: cosine between the derivatives of the two means, 0 for equal directors.
    fn plate(&self, skew: f64) -> f64 {
        // Largest eigenvalue of K S, from trace and determinant.
        let (k, s) = (self.shear, self.gradient);
        let trace = k[0] * s[0] + k[1] * s[1] + 2.0 * k[2] * s[2];
        let det = (k[0] * k[1] - k[2] * k[2]) * (s[0] * s[1] - s[2] * s[2]);
        let means = 0.5 * trace + (0.25 * trace * trace - det).max(0.0).sqrt();
        means * (1.0 + skew) + 4.0 * (self.edge[0] + self.edge[1])
    }

    /// Stiffness over the rotations (N m): transverse shear (sides along `along`, `across`), curvature
    /// with the tangents `bending` and `twist`, the directors' hourglass mode. `c`: C11, C22.
    fn rotational(
        &self,
        along: [Vec3; 2],
        across: [Vec3; 2],
        bending: f64,
        twist: f64,
        c: [f64; 2],
    ) -> Rotational {
        let (b, k) = (self.b, self.shear);
        let over = |p: [f64; 2], q: [f64; 2]| {
            k[0] * p[0] * q[0] + k[1] * p[1] * q[1] + k[2] * (p[0] * q[1] + p[1] * q[0])
        };
        // Over the diagonals, then over the means s1, s2 of opposite sides (times root 2).
        let (p13, p24) = ([b[0], b[2]], [b[1], b[3]]);
        let (h13, h24, hx) = (over(p13, p13), over(p24, p24), over(p13, p24));
        let (h11, h22, h12) = (
            0.5 * (h13 + h24) - hx,
            0.5 * (h13 + h24) + hx,
            0.5 * (h13 - h24).abs(),
        );
        let (h1, h2) = (
            (h11 + h12).max(2.0 * self.edge[0]),
            (h22 + h12).max(2.0 * self.edge[1]),
        );
        let longest = |t: [Vec3; 2]| dot(t[0], t[0]).max(dot(t[1], t[1]));
        let mut lean = 0.0f64;
        for a in along {
            for o in across {
                lean = lean.max(dot(a, o).abs());
            }
        }
        let sides = 0.5
            * largest(
                h1 * longest(along),
                h2 * longest(across),
                (h1 * h2).sqrt() * lean,
            );
        Rotational {
            sides,
            bending: self.area * self.widest * bending * c[0].max(c[1]),
            twist: self.area * self.widest * 0.5 * twist * (c[0] + c[1]),
            hourglass: self.director * self.mode(),
        }
    }
}

/// Bound of the rotational stiffness (N m) at rest of lane l with reference nodes x.
pub(super) fn at_rest(s4: &S4, constants: &[f64], n: usize, l: usize, x: &[Vec3; 4]) -> f64 {
    let lane = Lane::new(constants, n, l);
    let along = [mix(1.0, x[1], -1.0, x[0]), mix(1.0, x[2], -1.0, x[3])];
    let across = [mix(1.0, x[3], -1.0, x[0]), mix(1.0, x[2], -1.0, x[1])];
    let together = if s4.rest.coupled { 2.0 } else { 1.0 };
    let twisted = if s4.rest.twist_bends {
        s4.rest.twist
    } else {
        0.0
    };
    let bending = s4.rest.stiffness * together + twisted;
    // The layers' twist is 4 w z^2 G = 0.15 h^2 G, far below the bending; the step's bound has it.
    let twist = if s4.layers.is_some() {
        0.0
    } else {
        s4.rest.twist
    };
    let bound = lane.rotational(along, across, bending, twist, [1.0, 1.0]);
    bound.sum()
}

/// Stiffness over the displacements (N/m) of the transverse shear of lane l at rest.
pub(super) fn plate(constants: &[f64], n: usize, l: usize) -> f64 {
    Lane::new(constants, n, l).plate(0.0)
}

/// A bound of 2 / omega_max with the masses and inertias that `initialise` wrote; 0 of an element that is inside out.
/// Long, as it adds up one bound: each kind of strain once, with the names that the formula has.
pub(super) fn critical_step(
    s4: &S4,
    position: &[f64],
    directors: &[f64],
    constants: &[f64],
    n: usize,
    s: &View<'_>,
    step: &mut [f64],
) {
    for l in 0..n {
        let lane = Lane::new(constants, n, l);
        let state = State::new(s4, position, directors, n, l, s);
        let mass = 0.25 * s4.areal_mass * lane.area;
        let inertia = lane.inertia;
        let mixed = (mass * inertia).sqrt();
        let c = state.metric;
        let (shared, swelling) = state.thickening(s4, s.swell[l]);
        let bending = state.bending + shared;
        let twist = state.twist + if s4.layers.is_some() { 0.0 } else { shared };
        let [s11, s22] = state.slope.map(|v| dot(v, v));
        let mode = state.mode(&lane);
        let (bending, twist) = (bending * mode.length, twist * mode.length);
        let bent = lane.area * lane.widest * bending * s11.max(s22);
        let twisted = lane.area * lane.widest * 0.5 * twist * (s11 + s22);
        let rotation = lane.rotational(
            [state.side[0], state.side[1]],
            [state.side[2], state.side[3]],
            bending,
            twist,
            [c[0], c[1]],
        );
        // The layers' shear is membrane and twist in one kind of strain.
        let (material, rest) = state.membrane(&lane);
        let shear = lane.plate(state.skew());
        let lean = state.lean();
        let mut kinds = Kinds::default();
        let [y, z, r] = [1.0 / mass, 1.0 / mass, 1.0 / inertia];
        kinds.add([(material + twisted) * y, 0.0, rotation.twist * r]);
        kinds.add([shear * lean * lean * y, shear * z, rotation.sides * r]);
        let flexed = (rotation.bending.sqrt() + mode.flexed(&lane, bending, twist)).powi(2);
        kinds.add([bent * y, 0.0, flexed * r]);
        kinds.add([lane.area * lane.widest * swelling * y, 0.0, 0.0]);
        let held = lane.director + lane.area * mode.work / 16.0;
        kinds.add([0.0, 0.0, held * lane.mode() * r]);
        // Second derivatives of the strains: curvature is bilinear in slopes of x and of d, a side's
        // shear in its ends; a turned director has d2 d = t x (t x d).
        let (pull, reaction) = state.loads(&lane, &mode);
        let moment = lane.area * state.moment();
        let changing = moment * mode.size / 16.0 * (lane.mode() * lane.widest).sqrt();
        let coupling =
            lane.widest * moment * mode.length.sqrt() + 2.0 * pull + changing * s11.max(s22).sqrt();
        let reaction = reaction + 2.0 * changing * c[0].max(c[1]).sqrt();
        let lambda = kinds.largest() + rest / mass + coupling / mixed + reaction / inertia;
        let is_inside_out = state.is_inside_out();
        step[l] = if is_inside_out {
            0.0
        } else {
            2.0 / lambda.sqrt()
        };
    }
}

/// The directors' hourglass mode q_d of one lane, and what it does to curvatures: `k = c k0`, `c = 1 + |q_d|^2 / 32`.
struct Mode {
    /// |q_d|.
    size: f64,
    /// c^2.
    length: f64,
    /// k0 (1/m).
    curvature: Vec3,
    /// Size of `M k0` (N).
    work: f64,
}

impl Mode {
    /// Root of what curvatures store as the mode changes c (root of N m).
    fn flexed(&self, lane: &Lane, bending: f64, twist: f64) -> f64 {
        let [k1, k2, k12] = self.curvature;
        let stored = bending * (k1 * k1 + k2 * k2) + 2.0 * twist * k12 * k12;
        (lane.area * stored.max(0.0) * lane.mode()).sqrt() * self.size / 16.0
    }
}

/// What the bound needs of the state of one lane.
struct State {
    x: [Vec3; 4],
    d: [Vec3; 4],
    g: [Vec3; 2],
    slope: [Vec3; 2],
    /// Sides 1-2, 4-3, 1-4, 2-3.
    side: [Vec3; 4],
    metric: [f64; 3],
    stress: [f64; 3],
    moments: [f64; 3],
    /// Largest and shear tangent of all layers (N/m).
    stiffness: [f64; 2],
    bending: f64,
    twist: f64,
}

impl State {
    fn new(s4: &S4, position: &[f64], directors: &[f64], n: usize, l: usize, s: &View<'_>) -> Self {
        let at =
            |from: &[f64], r: usize| -> Vec3 { core::array::from_fn(|k| from[(r + k) * n + l]) };
        let x: [Vec3; 4] = core::array::from_fn(|i| at(position, 3 * i));
        let side = |i: usize, j: usize| mix(1.0, x[j], -1.0, x[i]);
        let tangent = |p: usize, r: usize| s.stiffness[(2 * p + r) * n + l].max(0.0);
        let (mut stiffness, mut layered) = ([tangent(0, 0), tangent(0, 1)], 0.0);
        if let Some(w) = &s4.layers {
            let outer = |r: usize| w.surface * (tangent(1, r) + tangent(2, r));
            stiffness = [0, 1].map(|r| w.core * stiffness[r] + outer(r));
            // dM12/dk12 of the two layers; their tangent is at most the largest one.
            layered = 2.0 * w.height * w.height * outer(1);
        }
        let t: Vec3 = at(s.tangent, 0);
        // The trace of all that hang together.
        let family = if s4.rest.twist_bends {
            t[0] + t[1] + t[2]
        } else if s4.rest.coupled {
            t[0] + t[1]
        } else {
            t[0].max(t[1])
        };
        Self {
            x,
            d: core::array::from_fn(|i| at(directors, 3 * i)),
            g: [at(s.g, 0), at(s.g, 3)],
            slope: [at(s.slope, 0), at(s.slope, 3)],
            side: [side(0, 1), side(3, 2), side(0, 3), side(1, 2)],
            metric: at(s.metric, 0),
            stress: at(s.stress, 0),
            moments: at(s.moment, 0),
            stiffness,
            bending: family.max(0.0),
            twist: layered
                + if s4.layers.is_some() {
                    0.0
                } else {
                    t[2].max(0.0)
                },
        }
    }

    /// Of a section that thickens, with the energy w (J/m2) of its bending: what its moments' change with the area needs of
    /// the bending tangents (N m), by 2 p M dk dlnJ <= t dk^2 + p^2 M^2 / t dlnJ^2 with any t > 0; and its stiffness over
    /// gradients of the displacements (N/m). dlnJ^2 = (a^c . dg_c)^2 is at most the trace of C^-1; what comes with the second derivative
    /// of ln J, and what its stress takes off the membrane's, are at most 2 and 1 of the largest eigenvalue of C^-1.
    fn thickening(&self, s4: &S4, w: f64) -> (f64, f64) {
        let p = f64::from(s4.parameters.thickening);
        if p == 0.0 {
            return (0.0, 0.0);
        }
        let [m1, m2, m12] = self.moments;
        let square = m1 * m1 + m2 * m2 + 2.0 * m12 * m12;
        let shared = self.bending + square.sqrt() * s4.thickness;
        let coupled = square / shared.max(f64::MIN_POSITIVE);
        let [c11, c22, c12] = self.metric;
        let least = (c11 + c22 - largest(c11, c22, c12)).max(1e-6);
        let trace = (c11 + c22) / (c11 * c22 - c12 * c12).max(crate::thickening::LEAST);
        (shared, p * p * (w + coupled) * trace + 3.0 * p * w / least)
    }

    /// Cosine between the derivatives of the means of opposite sides by the displacements.
    fn skew(&self) -> f64 {
        let d = &self.d;
        let half = |a: Vec3, b: Vec3, c: Vec3, e: Vec3| -> Vec3 {
            core::array::from_fn(|k| 0.25 * (a[k] + b[k] - c[k] - e[k]))
        };
        dot(half(d[0], d[1], d[2], d[3]), half(d[0], d[3], d[1], d[2])).abs()
    }

    /// Largest moment resultant (N).
    fn moment(&self) -> f64 {
        let [a, b, c] = self.moments;
        largest(a, b, c).max(largest(-a, -b, c))
    }

    /// Whether a director lies a right angle or more from the normal. The sides' transverse shear, a sine, has fallen since 90 degrees, and
    /// rests at 180: the sheet looks at itself from behind, and no step brings it back.
    fn is_inside_out(&self) -> bool {
        let [g1, g2] = self.g;
        let normal = cross(g1, g2);
        self.d.iter().any(|d| dot(*d, normal) <= 0.0)
    }

    /// Sine of the largest angle between a director and the normal.
    fn lean(&self) -> f64 {
        let [g1, g2] = self.g;
        let normal = cross(g1, g2);
        let n = mix(
            1.0 / norm(normal).max(f64::MIN_POSITIVE),
            normal,
            0.0,
            normal,
        );
        let out = |d: &Vec3| norm(mix(1.0, *d, -dot(*d, n), n));
        self.d.iter().map(out).fold(0.0, f64::max).min(1.0)
    }

    /// Stiffness over the displacements (N/m) as [`crate::quad`] explains: of the material, which acts in the
    /// plane, and of stress and hourglass control, which act in any direction.
    fn membrane(&self, lane: &Lane) -> (f64, f64) {
        let [c11, c22, c12] = self.metric;
        let stretch = largest(c11, c22, c12);
        let stress = largest(self.stress[0], self.stress[1], self.stress[2]).max(0.0);
        let [tangent, shear] = self.stiffness;
        let apart = ((tangent * c11.max(c22)).sqrt() + (shear * (c11 + c22)).sqrt()).powi(2);
        let material = (tangent * stretch).min(apart);
        let narrow = (c11 + c22 - stretch).max(1e-6).sqrt();
        let q: Vec3 = core::array::from_fn(|k| {
            let x = &self.x;
            ((x[0][k] - x[1][k]) + (x[2][k] - x[3][k]))
                - lane.h[0] * self.g[0][k]
                - lane.h[1] * self.g[1][k]
        });
        let [g1, g2] = self.g;
        let normal = cross(g1, g2);
        let qn = dot(q, normal).abs() / norm(normal).max(1e-6);
        let turn = lane.widest.sqrt() / narrow;
        let mode = lane.mode();
        let bent = lane.plane * qn * (2.0 * mode.sqrt() * turn + 3.0 * norm(q) * turn * turn);
        let over = lane.area * lane.widest;
        (over * material, over * stress + lane.plane * mode + bent)
    }

    /// The directors' hourglass mode.
    fn mode(&self, lane: &Lane) -> Mode {
        let (d, [g1, g2], [s1, s2]) = (&self.d, self.g, self.slope);
        let mode: Vec3 = core::array::from_fn(|k| {
            ((d[0][k] - d[1][k]) + (d[2][k] - d[3][k])) - lane.h[0] * s1[k] - lane.h[1] * s2[k]
        });
        let square = dot(mode, mode);
        let k = [
            -dot(s1, g1),
            -dot(s2, g2),
            -0.5 * (dot(s1, g2) + dot(s2, g1)),
        ];
        let [m1, m2, m12] = self.moments;
        Mode {
            size: square.sqrt(),
            length: (1.0 + square / 32.0).powi(2),
            curvature: k,
            work: (m1 * k[0] + m2 * k[1] + 2.0 * m12 * k[2]).abs(),
        }
    }

    /// Bounds of the sides' transverse forces (N) and of |dW/dd| at a node (N m).
    fn loads(&self, lane: &Lane, mode: &Mode) -> (f64, f64) {
        let d = &self.d;
        let ends = [[0, 1], [3, 2], [0, 3], [1, 2]];
        let mut e = [0.0; 4];
        for (e, (t, [i, j])) in e.iter_mut().zip(self.side.iter().zip(ends)) {
            *e = 0.5 * (dot(*t, d[i]) + dot(*t, d[j]));
        }
        let b = lane.b;
        let (m13, m24) = (
            -0.5 * (e[0] + e[1] + e[2] + e[3]),
            0.5 * (e[0] + e[1] - e[2] - e[3]),
        );
        let (y1, y2) = (b[0] * m13 + b[1] * m24, b[2] * m13 + b[3] * m24);
        let k = lane.shear;
        let (q1, q2) = (k[0] * y1 + k[2] * y2, k[2] * y1 + k[1] * y2);
        let (c13, c24) = (b[0] * q1 + b[2] * q2, b[1] * q1 + b[3] * q2);
        // The reference's warp counts as if it were shear: more than there is.
        let pull = 0.5 * (c13.abs() + c24.abs())
            + (lane.edge[0] * (e[0] - e[1])).abs()
            + (lane.edge[1] * (e[2] - e[3])).abs();
        let longest = self.side.iter().map(|t| norm(*t)).fold(0.0, f64::max);
        let [m1, m2, m12] = self.moments;
        let [g1, g2] = self.g;
        let columns = [mix(m1, g1, m12, g2), mix(m12, g1, m2, g2)].map(|v| lane.area * norm(v));
        let widest = lane.widest.sqrt();
        let held = lane.director + lane.area * mode.work / 16.0;
        let reaction = widest * mode.length.sqrt() * (columns[0] + columns[1])
            + held * lane.mode().sqrt() * mode.size
            + pull * longest;
        (pull, reaction)
    }
}
