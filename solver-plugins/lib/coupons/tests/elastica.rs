//! The heavy elastica, solved here by shooting from the tip and held against the integral form of the moment (thesis eq. 3.2),
//! checks the reference profiles of the cantilever workflow, which `reference-profiles.py` makes by shooting from the clamp; and
//! what the thesis says of its tips.

use std::path::Path;

const GRAVITY: f64 = 9.80665;
const STATIONS: usize = 4000;

/// M(k) in N, k in 1/m: `linear k + asymptote (1 - exp(-k / scale))`.
#[derive(Clone, Copy)]
struct Law {
    linear: f64,
    asymptote: f64,
    scale: f64,
}

/// Numbers as printed: N mm, N, 1/mm.
const fn voce(linear: f64, asymptote: f64, scale: f64) -> Law {
    Law {
        linear: 1e-3 * linear,
        asymptote,
        scale: 1e3 * scale,
    }
}

const fn constant(stiffness: f64) -> Law {
    Law {
        linear: stiffness,
        asymptote: 0.0,
        scale: 1.0,
    }
}

impl Law {
    fn moment(self, k: f64) -> f64 {
        self.linear * k + self.asymptote * -(-k / self.scale).exp_m1()
    }

    /// Curvature of a moment >= 0 by Newton's method; M is concave, so from the left it never overshoots.
    fn curvature(self, moment: f64) -> f64 {
        let mut k = 0.0;
        for _ in 0..200 {
            let slope = self.linear + self.asymptote / self.scale * (-k / self.scale).exp();
            let step = (moment - self.moment(k)) / slope;
            k += step;
            if step.abs() < 1e-13 * (1.0 + k) {
                break;
            }
        }
        k
    }
}

/// Angle below the horizontal (rad) and moment (N) at evenly spaced stations from the tip to the clamp, for an angle at
/// the tip: `dtheta/du = -k(M)`, `dM/du = w u cos theta`, u counted from the tip; Heun's method.
fn from_the_tip(law: Law, weight: f64, length: f64, tip_angle: f64) -> Vec<[f64; 2]> {
    let h = length / STATIONS as f64;
    let slopes = |u: f64, [angle, moment]: [f64; 2]| {
        [-law.curvature(moment.max(0.0)), weight * u * angle.cos()]
    };
    let mut state = [tip_angle, 0.0];
    let mut states = vec![state];
    for i in 0..STATIONS {
        let u = h * i as f64;
        let a = slopes(u, state);
        let b = slopes(u + h, [state[0] + h * a[0], state[1] + h * a[1]]);
        state = [0, 1].map(|c| state[c] + 0.5 * h * (a[c] + b[c]));
        states.push(state);
    }
    states
}

/// Profile `[x, z]` (m) at evenly spaced stations from the clamp, by the angle of the tip with which the strip leaves the clamp
/// horizontally. The moment of the weight further out (thesis eq. 3.2) is held against that of the equations.
fn profile(law: Law, weight: f64, length: f64) -> Vec<[f64; 2]> {
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if from_the_tip(law, weight, length, middle)[STATIONS][0] > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    let mut states = from_the_tip(law, weight, length, 0.5 * (low + high));
    states.reverse();
    let h = length / STATIONS as f64;
    let mut points = vec![[0.0f64, 0.0f64]];
    for w in states.windows(2) {
        let (middle, last) = (0.5 * (w[0][0] + w[1][0]), points[points.len() - 1]);
        points.push([last[0] + h * middle.cos(), last[1] - h * middle.sin()]);
    }
    // M(s) = w (integral of x du - x(s) (L - s)), by trapezia from the tip.
    let mut outer = 0.0;
    for i in (0..STATIONS).rev() {
        outer += 0.5 * h * (points[i][0] + points[i + 1][0]);
        let arm = outer - points[i][0] * h * (STATIONS - i) as f64;
        assert!((weight * arm - states[i][1]).abs() < 1e-5 * states[0][1]);
    }
    points
}

const NCF: (f64, f64) = (0.440 * GRAVITY, 0.210);
const WOVEN: (f64, f64) = (0.210 * GRAVITY, 0.130);
const NCF_POSITIVE: Law = voce(0.19457, 0.03139, 0.0040);
const NCF_NEGATIVE: Law = voce(0.10279, 0.03619, 0.0065);
const WOVEN_LAW: Law = voce(0.01549, 0.00757, 0.02);

fn tip(law: Law, strip: (f64, f64)) -> f64 {
    profile(law, strip.0, strip.1)[STATIONS][1]
}

/// Columns of a CSV file in mm, as m.
fn read(name: &str) -> Vec<[f64; 2]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../workflows/coupons/cantilever/reference")
        .join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    assert_eq!(lines.next(), Some("x [mm],z [mm]"));
    lines
        .map(|l| {
            let (x, z) = l.split_once(',').unwrap();
            [x, z].map(|v| 1e-3 * v.parse::<f64>().unwrap())
        })
        .collect()
}

#[test]
fn reference_profiles_are_the_heavy_elastica_by_another_method() {
    let cases = [
        ("ncf-positive-nonlinear.csv", NCF_POSITIVE, NCF),
        ("ncf-positive-b415.csv", constant(0.0038), NCF),
        ("ncf-positive-binit.csv", constant(0.0080), NCF),
        ("ncf-negative-nonlinear.csv", NCF_NEGATIVE, NCF),
        ("ncf-negative-b415.csv", constant(0.0032), NCF),
        ("ncf-negative-binit.csv", constant(0.0057), NCF),
        ("woven-nonlinear.csv", WOVEN_LAW, WOVEN),
        ("woven-b415.csv", constant(0.00022), WOVEN),
        ("woven-binit.csv", constant(0.00039), WOVEN),
    ];
    for (name, law, strip) in cases {
        let (own, file) = (profile(law, strip.0, strip.1), read(name));
        let every = STATIONS as f64 / (file.len() - 1) as f64;
        for (i, p) in file.iter().enumerate() {
            let at = i as f64 * every;
            let (k, s) = ((at as usize).min(STATIONS - 1), at - at.floor());
            let s = if at as usize == STATIONS { 1.0 } else { s };
            for c in 0..2 {
                let value = own[k][c] + s * (own[k + 1][c] - own[k][c]);
                let off = (value - p[c]).abs();
                assert!(off < 5e-6, "{name}, point {i}: {:.2e} m off", off);
            }
        }
    }
}

#[test]
fn constant_stiffness_lifts_the_tips_as_the_thesis_says() {
    let above = |law: Law, b: f64, strip| {
        let nonlinear = tip(law, strip);
        (tip(constant(b), strip) - nonlinear, nonlinear.abs())
    };
    let (lift, fall) = above(NCF_POSITIVE, 0.0038, NCF);
    assert!(
        (lift / fall - 0.19).abs() < 0.005,
        "NCF+: {:.4}",
        lift / fall
    );
    let (lift, fall) = above(NCF_NEGATIVE, 0.0032, NCF);
    assert!(
        (lift / fall - 0.15).abs() < 0.005,
        "NCF-: {:.4}",
        lift / fall
    );
    let (lift, _) = above(WOVEN_LAW, 0.00022, WOVEN);
    assert!((lift - 0.004).abs() < 2e-4, "woven: {:.3} mm", 1e3 * lift);
}

#[test]
fn a_stiff_strip_falls_as_a_linear_beam() {
    // z = w L^4 / (8 B) for small deflections.
    let z = tip(constant(10.0), NCF);
    let beam = NCF.0 * NCF.1.powi(4) / 80.0;
    assert!((z.abs() / beam - 1.0).abs() < 1e-4, "{z} against {beam}");
}
