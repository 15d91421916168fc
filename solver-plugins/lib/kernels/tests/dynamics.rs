//! Small structures stepped explicitly with the components through their C tables.

mod common;
use common::*;
use plyflow_kernels::rf4::Rf4;

/// A rectangular sheet of `nx` by `ny` elements of type `rf4`.
struct Sheet {
    element: El,
    cells: Vec<(Elements, Vec<[usize; 4]>)>,
    patches: Vec<(Patches, Vec<Vec<usize>>, usize)>,
    mass: Vec<f64>,
    x: Vec<[f64; 3]>,
    v: Vec<[f64; 3]>,
}

fn padded<T: Clone>(items: &[T]) -> Vec<Vec<T>> {
    let pad = |c: &[T]| -> Vec<T> { (0..8).map(|i| c[i.min(c.len() - 1)].clone()).collect() };
    items.chunks(8).map(pad).collect()
}

impl Sheet {
    fn new(m: &Mat, [nx, ny]: [usize; 2], x: Vec<[f64; 3]>, axis: [f64; 3]) -> Self {
        let element = El::new::<Rf4>("{}", m).unwrap();
        let id = |i: usize, j: usize| j * (nx + 1) + i;
        let quads: Vec<[usize; 4]> = (0..nx * ny)
            .map(|c| (c % nx, c / nx))
            .map(|(i, j)| [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)])
            .collect();
        let mut mass = vec![0.0; x.len()];
        let cells: Vec<_> = padded(&quads)
            .into_iter()
            .enumerate()
            .map(|(b, ids)| {
                let q: Vec<Quad> = ids.iter().map(|q| q.map(|n| x[n])).collect();
                let e = element.initialise(&q, &[axis; 8]);
                for (l, q) in ids.iter().enumerate().take(quads.len() - 8 * b) {
                    (0..4).for_each(|i| mass[q[i]] += e.mass[i * 8 + l]);
                }
                (e, ids)
            })
            .collect();
        let inner: Vec<Vec<usize>> = (1..nx)
            .flat_map(|i| (1..ny).map(move |j| (i, j)))
            .map(|(i, j)| {
                let ring = (0..9)
                    .filter(|k| *k != 4)
                    .map(|k| id(i + k % 3 - 1, j + k / 3 - 1));
                std::iter::once(id(i, j)).chain(ring).collect()
            })
            .collect();
        let width = |n: usize| x[id(n, 0)][0] - x[0][0];
        let area = width(nx) * (x[id(0, ny)][1] - x[0][1]) / inner.len() as f64;
        let patches = padded(&inner)
            .into_iter()
            .enumerate()
            .map(|(b, ids)| {
                let p: Vec<Patch> = ids
                    .iter()
                    .map(|n| n.iter().map(|n| x[*n]).collect())
                    .collect();
                (
                    element.initialise_patches(&p, axis, area),
                    ids,
                    (inner.len() - 8 * b).min(8),
                )
            })
            .collect();
        let v = vec![[0.0; 3]; x.len()];
        Self {
            element,
            cells,
            patches,
            mass,
            x,
            v,
        }
    }

    /// Internal forces, internal energy, and the step that elements and patches allow.
    fn internal(&mut self) -> (Vec<[f64; 3]>, f64, f64) {
        let mut force = vec![[0.0; 3]; self.x.len()];
        let mut row = vec![0.0; self.x.len()];
        let (mut energy, mut step) = (0.0, f64::INFINITY);
        for (e, ids) in &mut self.cells {
            let q: Vec<Quad> = ids.iter().map(|q| q.map(|n| self.x[n])).collect();
            let f = self.element.forces(e, &q);
            // Padding repeats the last element: count it once.
            let distinct = ids
                .iter()
                .enumerate()
                .filter(|(l, q)| *l == 0 || ids[l - 1] != **q);
            for (l, q) in distinct {
                for i in 0..4 {
                    (0..3).for_each(|k| force[q[i]][k] += f.force[(3 * i + k) * 8 + l]);
                }
                energy += total(&f, 8, l);
                step = step.min(f.step[l]);
            }
        }
        for (p, ids, used) in &mut self.patches {
            let x: Vec<Patch> = ids
                .iter()
                .map(|n| n.iter().map(|n| self.x[*n]).collect())
                .collect();
            let f = self.element.patch_forces(p, &x);
            for (l, nodes) in ids.iter().enumerate().take(*used) {
                for (i, n) in nodes.iter().enumerate() {
                    (0..3).for_each(|k| force[*n][k] += f.force[(3 * i + k) * 8 + l]);
                    row[*n] += f.stiffness[i * 8 + l];
                }
                energy += f.energy[l];
            }
        }
        let bending = row
            .iter()
            .zip(&self.mass)
            .map(|(r, m)| r / m)
            .fold(0.0, f64::max);
        (force, energy, 2.0 / ((2.0 / step).powi(2) + bending).sqrt())
    }

    fn kinetic(&self) -> f64 {
        let square = |v: &[f64; 3]| v.iter().map(|c| c * c).sum::<f64>();
        self.mass
            .iter()
            .zip(&self.v)
            .map(|(m, v)| 0.5 * m * square(v))
            .sum()
    }

    /// One central-difference step with mass damping; nodes keep the components that `free` denies.
    fn step(&mut self, dt: f64, damping: f64, free: impl Fn(usize, usize) -> bool) {
        let force = self.internal().0;
        let (a, b) = (1.0 - 0.5 * damping * dt, 1.0 + 0.5 * damping * dt);
        for n in 0..self.x.len() {
            for k in (0..3).filter(|k| free(n, *k)) {
                self.v[n][k] = (a * self.v[n][k] - dt * force[n][k] / self.mass[n]) / b;
                self.x[n][k] += dt * self.v[n][k];
            }
        }
    }
}

fn rectangle([nx, ny]: [usize; 2], [w, h]: [f64; 2], jitter: f64) -> Vec<[f64; 3]> {
    let mut r = Random(41);
    (0..(nx + 1) * (ny + 1))
        .map(|n| (n % (nx + 1), n / (nx + 1)))
        .map(|(i, j)| {
            let inner = (1..nx).contains(&i) && (1..ny).contains(&j);
            let d = if inner { jitter } else { 0.0 };
            let (x, y) = (i as f64 + d * r.next(), j as f64 + d * r.next());
            [w * x / nx as f64, h * y / ny as f64, 0.0]
        })
        .collect()
}

#[test]
fn free_vibration_at_the_reported_step_conserves_energy_on_a_distorted_mesh() {
    let m = fabric(&woven("fibre-energy")).unwrap();
    let mut s = Sheet::new(&m, [8, 8], rectangle([8, 8], [0.04, 0.04], 0.2), AXIS);
    let mut r = Random(42);
    s.v.iter_mut()
        .for_each(|v| *v = std::array::from_fn(|_| 0.5 * r.next()));
    let dt = 0.9 * s.internal().2;
    let start = s.kinetic();
    let (mut first, mut last) = (0.0, 0.0);
    for i in 0..4000 {
        let before = s.kinetic();
        let stored = s.internal().1;
        s.step(dt, 0.0, |_, _| true);
        // Kinetic energy at whole steps from the half steps around; it swings with the highest
        // modes, so means count.
        let sum = 0.5 * (before + s.kinetic()) + stored;
        if i < 1000 {
            first += sum / 1000.0;
        } else if i >= 3000 {
            last += sum / 1000.0;
        }
    }
    assert!(
        (last / first - 1.0).abs() < 0.01,
        "{first} J became {last} J"
    );
    // 2.5 times the step must fail: the reported one is not needlessly small by that much.
    let mut t = Sheet::new(&m, [8, 8], rectangle([8, 8], [0.04, 0.04], 0.2), AXIS);
    t.v.iter_mut()
        .for_each(|v| *v = std::array::from_fn(|_| 0.5 * r.next()));
    (0..300).for_each(|_| t.step(2.5 * dt, 0.0, |_, _| true));
    let wild = t.kinetic();
    assert!(
        wild.is_nan() || wild > 10.0 * start,
        "2.5 times the step is stable too: {wild} J"
    );
}

#[test]
fn buckled_strip_takes_the_amplitude_of_the_elastica() {
    // Hinged strip of 100 mm, ends 1 mm closer: amplitude k / K(k) of the length where
    // 2 E(k) / K(k) = 2 - 0.01; to that order 2 / pi sqrt(0.01) (1 - 0.01 / 8) L.
    let json = r#"{"fibre_modulus":2.5e8,"shear":{"coefficients":[0,200]},
        "bending":{"positive":{"linear":0.005}},"thickness":4e-4,"areal_mass":0.44}"#;
    let m = fabric(json).unwrap();
    let (n, length, close) = ([40, 2], 0.1, 0.001);
    let mut s = Sheet::new(&m, n, rectangle(n, [length, 0.005], 0.0), [1.0, 0.0, 0.0]);
    let want = 2.0 / std::f64::consts::PI * 0.1 * (1.0 - 0.01 / 8.0) * length;
    for x in &mut s.x {
        x[2] = 0.8 * want * (std::f64::consts::PI * x[0] / length).sin();
        x[0] *= 1.0 - close / length;
    }
    let dt = 0.8 * s.internal().2;
    let end = |i: usize| [0, 40].contains(&(i % 41));
    let steps = (0.12 / dt) as usize;
    for _ in 0..steps {
        let held = |i: usize, k: usize| if k == 1 { i == 0 } else { end(i) };
        s.step(dt, 150.0, |i, k| !held(i, k));
    }
    let got = s.x[41 + 20][2];
    assert!(
        (got / want - 1.0).abs() < 0.02,
        "amplitude {got} m, elastica {want} m"
    );
    assert!(s.kinetic() < 1e-9, "still moving: {} J", s.kinetic());
}
