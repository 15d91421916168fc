//! Small meshes of `s4`: assembly, a Newton solver for statics, central differences.

use super::{Batch, Mat, Out, STILL, Shell, V3, nudged, reaction, solve};

pub struct Model {
    pub shell: Shell,
    pub cells: Vec<(Batch, Vec<[usize; 4]>, usize)>,
    pub mass: Vec<f64>,
    pub inertia: Vec<f64>,
    pub x: Vec<V3>,
    pub v: Vec<V3>,
    pub w: Vec<V3>,
}

/// Sums over the elements.
pub struct Internal {
    pub force: Vec<V3>,
    pub moment: Vec<V3>,
    /// Membrane, bending, hourglass.
    pub energy: [f64; 3],
    pub step: f64,
}

/// Nodes and cells of `nx` by `ny` elements on `w` by `h`, inner nodes moved by `jitter` of a cell.
pub fn rectangle(
    [nx, ny]: [usize; 2],
    [w, h]: [f64; 2],
    jitter: f64,
) -> (Vec<V3>, Vec<[usize; 4]>) {
    let mut r = super::super::common::Random(43);
    let nodes = (0..(nx + 1) * (ny + 1))
        .map(|n| (n % (nx + 1), n / (nx + 1)))
        .map(|(i, j)| {
            let inner = (1..nx).contains(&i) && (1..ny).contains(&j);
            let d = if inner { jitter } else { 0.0 };
            let (x, y) = (i as f64 + d * r.next(), j as f64 + d * r.next());
            [w * x / nx as f64, h * y / ny as f64, 0.0]
        })
        .collect();
    let cells = (0..nx * ny)
        .map(|c| c % nx + (c / nx) * (nx + 1))
        .map(|a| [a, a + 1, a + nx + 2, a + nx + 1])
        .collect();
    (nodes, cells)
}

impl Model {
    pub fn new(json: &str, m: &Mat, (x, cells): (Vec<V3>, Vec<[usize; 4]>), axis: V3) -> Self {
        let shell = Shell::new(json, m).unwrap();
        let (mut mass, mut inertia) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        let cells: Vec<_> = cells
            .chunks(8)
            .map(|c| {
                let ids: Vec<[usize; 4]> = (0..8).map(|l| c[l.min(c.len() - 1)]).collect();
                let q: Vec<_> = ids.iter().map(|q| q.map(|n| x[n])).collect();
                let b = shell.start(&q, axis);
                for (l, q) in c.iter().enumerate() {
                    for i in 0..4 {
                        mass[q[i]] += b.mass[8 * i + l];
                        inertia[q[i]] += b.inertia[8 * i + l];
                    }
                }
                (b, ids, c.len())
            })
            .collect();
        let (v, w) = (vec![[0.0; 3]; x.len()], vec![[0.0; 3]; x.len()]);
        Self {
            shell,
            cells,
            mass,
            inertia,
            x,
            v,
            w,
        }
    }

    /// Forces at the positions, after the nodes turned with their spins for `dt`.
    pub fn internal(&mut self, dt: f64) -> Internal {
        let zero = || vec![[0.0; 3]; self.x.len()];
        let mut sum = Internal {
            force: zero(),
            moment: zero(),
            energy: [0.0; 3],
            step: f64::INFINITY,
        };
        for (b, ids, used) in &mut self.cells {
            let take = |from: &[V3]| ids.iter().map(|q| q.map(|n| from[n])).collect::<Vec<_>>();
            let f = self.shell.forces(b, &take(&self.x), &take(&self.w), dt);
            for (l, q) in ids.iter().enumerate().take(*used) {
                for i in 0..4 {
                    let (p, m) = (Out::at(&f.force, i, l), Out::at(&f.moment, i, l));
                    (0..3).for_each(|k| sum.force[q[i]][k] += p[k]);
                    (0..3).for_each(|k| sum.moment[q[i]][k] += m[k]);
                }
                (0..3).for_each(|r| sum.energy[r] += f.energy[8 * r + l]);
                sum.step = sum.step.min(f.step[l]);
            }
        }
        sum
    }

    pub fn kinetic(&self) -> f64 {
        let part = |m: &[f64], v: &[V3]| -> f64 {
            m.iter()
                .zip(v)
                .map(|(m, v)| 0.5 * m * super::dot(*v, *v))
                .sum()
        };
        part(&self.mass, &self.v) + part(&self.inertia, &self.w)
    }

    /// One step of central differences from velocities at the half step before.
    pub fn step(&mut self, dt: f64, force: &Internal) {
        for n in 0..self.x.len() {
            for k in 0..3 {
                self.v[n][k] -= dt * force.force[n][k] / self.mass[n];
                self.w[n][k] -= dt * force.moment[n][k] / self.inertia[n];
                self.x[n][k] += dt * self.v[n][k];
            }
        }
    }

    /// Newton's method to equilibrium with the nodal forces `load`; dof 6 n + k (k < 3: position,
    /// else rotation) is held where `held` says so. Returns the steps taken.
    pub fn equilibrium(&mut self, load: &[V3], held: &dyn Fn(usize, usize) -> bool) -> usize {
        let count = 6 * self.x.len();
        let free: Vec<usize> = (0..count).filter(|c| !held(c / 6, c % 6)).collect();
        let scale = load.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        self.w.fill([0.0; 3]);
        for iteration in 0..40 {
            let f = self.internal(0.0);
            let residual = |c: usize| {
                let (n, k) = (c / 6, c % 6);
                if k < 3 {
                    load[n][k] - f.force[n][k]
                } else {
                    -f.moment[n][k - 3]
                }
            };
            let right: Vec<f64> = free.iter().map(|c| residual(*c)).collect();
            if iteration > 0 && right.iter().all(|r| r.abs() < 1e-6 * scale) {
                return iteration;
            }
            let k = self.tangent();
            let small: Vec<Vec<f64>> = free
                .iter()
                .map(|i| free.iter().map(|j| k[*i][*j]).collect())
                .collect();
            let d = solve(small, right);
            // A large turn at once would leave the basin: at most 0.2 rad.
            let turn = free
                .iter()
                .zip(&d)
                .filter(|(c, _)| *c % 6 > 2)
                .fold(0.0f64, |m, (_, v)| m.max(v.abs()));
            let factor = (0.2 / turn).min(1.0);
            for (c, v) in free.iter().zip(&d) {
                let to = if c % 6 < 3 { &mut self.x } else { &mut self.w };
                to[c / 6][c % 3] += factor * v;
            }
            self.internal(1.0);
            self.w.fill([0.0; 3]);
        }
        panic!("no equilibrium after 40 steps");
    }

    /// d(force, moment)/d(position, rotation) by differences; a small stiffness holds the turns about
    /// the directors, which have none.
    fn tangent(&self) -> Vec<Vec<f64>> {
        let count = 6 * self.x.len();
        let mut k = vec![vec![0.0; count]; count];
        for (b, ids, used) in &self.cells {
            let x: Vec<_> = ids.iter().map(|q| q.map(|n| self.x[n])).collect();
            let dof =
                |q: &[usize; 4], c: usize| 6 * q[c % 12 / 3] + c % 3 + if c < 12 { 0 } else { 3 };
            let mut largest = 0.0f64;
            for c in 0..24 {
                let h = if c < 12 { 1e-8 } else { 1e-6 };
                let (p, m) = (
                    nudged(&self.shell, b, &x, c, h),
                    nudged(&self.shell, b, &x, c, -h),
                );
                for (l, q) in ids.iter().enumerate().take(*used) {
                    let (p, m) = (reaction(&p, l), reaction(&m, l));
                    for r in 0..24 {
                        let d = (p[r] - m[r]) / (2.0 * h);
                        k[dof(q, r)][dof(q, c)] += d;
                        if r >= 12 && c >= 12 {
                            largest = largest.max(d.abs());
                        }
                    }
                }
            }
            for (l, q) in ids.iter().enumerate().take(*used) {
                for i in 0..4 {
                    let d = Out::at(&b.history[..12 * 8], i, l);
                    for r in 0..3 {
                        for c in 0..3 {
                            k[6 * q[i] + 3 + r][6 * q[i] + 3 + c] += 0.1 * largest * d[r] * d[c];
                        }
                    }
                }
            }
        }
        k
    }

    /// Still nodes.
    pub fn rest(&mut self) {
        self.v.fill([0.0; 3]);
        self.w.fill(STILL[0]);
    }
}
