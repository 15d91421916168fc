#!/usr/bin/env python3
"""Writes the reference profiles of the cantilever tests: the heavy elastica with a nonlinear law M(k).

    dtheta/ds = k(M),  dM/ds = -w (L - s) cos theta,  theta(0) = 0,  M(L) = 0,
    dx/ds = cos theta, dz/ds = -sin theta

(theta: angle below the horizontal, M: moment per width, w: weight per area, L: overhang), by shooting: the
moment at the clamp is found by bisection, the equations are integrated by fourth-order Runge-Kutta.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to. A Rust
test (solver-plugins/lib/coupons/tests/elastica.rs) checks them with another method."""

from math import cos, exp, sin

GRAVITY = 9.80665


def voce(linear, asymptote, scale):
    """M(k) in N, k in 1/m; linear in N m, scale in 1/m."""
    return lambda k: linear * k + asymptote * (1.0 - exp(-k / scale))


def constant(stiffness):
    return lambda k: stiffness * k


def inverse(law, moment):
    """k with law(k) = moment, by bisection; odd."""
    if moment < 0.0:
        return -inverse(law, -moment)
    low, high = 0.0, 1.0
    while law(high) < moment:
        high *= 2.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if law(middle) < moment else (low, middle)
    return 0.5 * (low + high)


def integrate(law, weight, length, clamp_moment, steps):
    h = length / steps

    def slopes(s, y):
        return (inverse(law, y[1]), -weight * (length - s) * cos(y[0]), cos(y[0]), -sin(y[0]))

    def moved(y, d, f):
        return tuple(a + f * b for a, b in zip(y, d))

    y = (0.0, clamp_moment, 0.0, 0.0)
    states = [y]
    for i in range(steps):
        s = i * h
        a = slopes(s, y)
        b = slopes(s + 0.5 * h, moved(y, a, 0.5 * h))
        c = slopes(s + 0.5 * h, moved(y, b, 0.5 * h))
        d = slopes(s + h, moved(y, c, h))
        y = tuple(v + h / 6.0 * (p + 2 * q + 2 * r + t) for v, p, q, r, t in zip(y, a, b, c, d))
        states.append(y)
    return states


def elastica(law, weight, length, steps):
    low, high = 0.0, 0.5 * weight * length**2
    for _ in range(60):
        middle = 0.5 * (low + high)
        if integrate(law, weight, length, middle, steps)[-1][1] < 0.0:
            low = middle
        else:
            high = middle
    return integrate(law, weight, length, 0.5 * (low + high), steps)


NCF, WOVEN = 0.440 * GRAVITY, 0.210 * GRAVITY
CASES = [
    ("ncf-positive-nonlinear", voce(0.19457e-3, 0.03139, 4.0), NCF, 0.210, "Voce 0.19457 k + 0.03139 (1 - exp(-k/0.0040))"),
    ("ncf-positive-b415", constant(0.0038), NCF, 0.210, "B(41.5 deg) = 0.0038 N m"),
    ("ncf-positive-binit", constant(0.0080), NCF, 0.210, "B_init = 0.0080 N m"),
    ("ncf-negative-nonlinear", voce(0.10279e-3, 0.03619, 6.5), NCF, 0.210, "Voce 0.10279 k + 0.03619 (1 - exp(-k/0.0065))"),
    ("ncf-negative-b415", constant(0.0032), NCF, 0.210, "B(41.5 deg) = 0.0032 N m"),
    ("ncf-negative-binit", constant(0.0057), NCF, 0.210, "B_init = 0.0057 N m"),
    ("woven-nonlinear", voce(0.01549e-3, 0.00757, 20.0), WOVEN, 0.130, "Voce 0.01549 k + 0.00757 (1 - exp(-k/0.02))"),
    ("woven-b415", constant(0.00022), WOVEN, 0.130, "B(41.5 deg) = 0.00022 N m"),
    ("woven-binit", constant(0.00039), WOVEN, 0.130, "B_init = 0.00039 N m"),
]

if __name__ == "__main__":
    for name, law, weight, length, text in CASES:
        coarse, states = (elastica(law, weight, length, n) for n in (130, 260))
        error = max(abs(coarse[-1][2] - states[-1][2]), abs(coarse[-1][3] - states[-1][3]))
        with open(f"reference/{name}.csv", "w") as out:
            out.write(f"# Heavy elastica, overhang {1e3 * length:.0f} mm, {text} (k in 1/mm, M in N), weight {weight:.6f} N/m2;\n")
            out.write(f"# laws: F. Yu, thesis, tables 3.1 and 3.2; solved by reference-profiles.py. z is negative downwards.\n")
            out.write("x [mm],z [mm]\n")
            for _, _, x, z in states:
                out.write(f"{1e3 * x:.6f},{1e3 * z:.6f}\n")
        print(f"{name}: tip {1e3 * states[-1][2]:.3f} {1e3 * states[-1][3]:.3f} mm, angle {states[-1][0]:.4f} rad, "
              f"clamp curvature {inverse(law, states[0][1]) * 1e-3:.5f} 1/mm, halved steps differ {1e3 * error:.1e} mm")
