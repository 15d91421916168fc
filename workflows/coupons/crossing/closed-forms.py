#!/usr/bin/env python3
"""Writes the closed forms of a fabric whose families cross at 60 degrees (../../materials/unidirectional.yaml with `crossing`), pulled at
several angles.

The energy of the law over the undeformed area is k1/2 (l1 - 1)^2 + k2/2 (l2 - 1)^2 + Phi(sin g), dPhi/d(sin g) = F(g), with the shear
angle g = p - t: the families, p apart before, are t apart now. The pull lies along X = x1 a1 + x2 a2 of the directions a1, a2 of both
families. A line along X is stretched by

    L^2 = x1^2 l1^2 + x2^2 l2^2 + 2 x1 x2 l1 l2 cos t.

A strip whose ends are free to slant has the least energy under the force N over its undeformed width, so the derivatives of W - N L by
l1, l2 and t are zero. With T = N / L:

    k1 (l1 - 1) = T (x1^2 l1 + x1 x2 l2 cos t),  k2 (l2 - 1) = T (x2^2 l2 + x1 x2 l1 cos t),  F(g) cos g = T x1 x2 l1 l2 sin t.

Newton's method solves them, in small steps of the force. No metric and no tensor appears: what the solver does with these is not used.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to."""

from math import cos, degrees, radians, sin, sqrt

THICKNESS = 0.3e-3
# The moduli in the workflow, lowered so that a strip comes to rest soon.
K = (30e6 * THICKNESS, 6e6 * THICKNESS)
CROSSING = radians(60.0)


def force(g):
    """F_norm (N/m) at the shear angle g (rad), odd."""
    a = abs(g)
    return (60.0 * a + 120.0 * a**3) * (1.0 if g >= 0.0 else -1.0)


def shares(angle):
    """x1 and x2 of the pull where family 1 lies at `angle` (rad) from it."""
    other = angle + CROSSING
    return sin(other) / sin(CROSSING), -sin(angle) / sin(CROSSING)


def stretch(state, x):
    l1, l2, t = state
    return sqrt((x[0] * l1) ** 2 + (x[1] * l2) ** 2 + 2.0 * x[0] * x[1] * l1 * l2 * cos(t))


def residuals(state, pull, x):
    """What the three equations leave (N/m)."""
    l1, l2, t = state
    tension, both = pull / stretch(state, x), x[0] * x[1]
    g = CROSSING - t
    return (
        K[0] * (l1 - 1.0) - tension * (x[0] ** 2 * l1 + both * l2 * cos(t)),
        K[1] * (l2 - 1.0) - tension * (x[1] ** 2 * l2 + both * l1 * cos(t)),
        force(g) * cos(g) - tension * both * l1 * l2 * sin(t),
    )


def determinant(m):
    (a, b, c), (d, e, f), (g, h, i) = m
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def solve(state, pull, x):
    """The state under the force `pull` (N/m) from one near it."""
    for _ in range(60):
        left = residuals(state, pull, x)
        if max(abs(r) for r in left) < 1e-11 * max(K):
            return state
        columns = []
        for k in range(3):
            h = 1e-7
            up, down = ([s + sign * h * (i == k) for i, s in enumerate(state)] for sign in (1.0, -1.0))
            columns.append([(a - b) / (2.0 * h) for a, b in zip(residuals(up, pull, x), residuals(down, pull, x))])
        rows = [[columns[c][r] for c in range(3)] for r in range(3)]
        whole = determinant(rows)
        change = []
        for k in range(3):
            put = [[left[r] if c == k else rows[r][c] for c in range(3)] for r in range(3)]
            change.append(determinant(put) / whole)
        state = [s - d for s, d in zip(state, change)]
    raise SystemExit(f"no state at {pull} N/m: {left}")


if __name__ == "__main__":
    for angle, pull in ((-30, 300.0), (20, 60.0), (75, 30.0)):
        x = shares(radians(angle))
        with open(f"reference/off-axis-{angle}.csv", "w") as out:
            out.write(f"# Families {angle} and {angle + 60} deg off the pull, 30 and 6 MPa along them, 0.3 mm; written by closed-forms.py\n")
            out.write("force [N/m],strain [1],shear_angle [rad]\n0,0,0\n")
            state = [1.0, 1.0, CROSSING]
            for i in range(1, 101):
                state = solve(state, pull * i / 100, x)
                if i % 20 == 0:
                    out.write(f"{pull * i / 100:.6f},{stretch(state, x) - 1.0:.9f},{CROSSING - state[2]:.9f}\n")
        print(f"{angle} deg, {pull} N/m: strain {stretch(state, x) - 1.0:.5f}, shear {degrees(CROSSING - state[2]):.3f} deg, l1, l2 - 1: {state[0] - 1.0:.6f} {state[1] - 1.0:.6f}")
