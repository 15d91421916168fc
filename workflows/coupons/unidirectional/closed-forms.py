#!/usr/bin/env python3
"""Writes the closed forms of a unidirectional ply (../../materials/unidirectional.yaml): its picture frame, its tension off the
fibres, and its cantilevers along both families.

The energy of the law over the undeformed area is k1/2 (l1 - 1)^2 + k2/2 (l2 - 1)^2 + Phi(sin g), dPhi/d(sin g) = F(g). A strip under
the force N over its undeformed width, whose ends are free to slant, has one second Piola-Kirchhoff resultant, T along the pull.
With family 1 at the angle a from the pull (c = cos a, s = sin a) its components are S11 = T c^2, S22 = T s^2, S12 = -T c s, so

    F(g) = -T c s l1 l2,  k1 (l1 - 1) l1 = T c^2 l1^2 + F sin g,  k2 (l2 - 1) l2 = T s^2 l2^2 + F sin g,

and the stretch along the pull is L = sqrt(c^2 l1^2 + s^2 l2^2 - 2 c s l1 l2 sin g), with N = T L.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to."""

import sys
from math import cos, pi, radians, sin, sqrt

sys.path.insert(0, "../cantilever")
profiles = __import__("reference-profiles")

THICKNESS, AREAL_MASS = 0.3e-3, 0.3
# The modulus of the fibres in the workflow, lowered so that a strip comes to rest soon.
FIBRE_MODULUS, ACROSS = 30e6, 6e6
BENDING = (4e-3, 4e-5)


def force(g):
    """F_norm (N/m) at the shear angle g (rad), odd."""
    a = abs(g)
    return (60.0 * a + 120.0 * a**3) * (1.0 if g >= 0.0 else -1.0)


def stretches(tension, angle, g):
    """l1 and l2 where the strip carries T and its fibres are sheared by g: each equation is quadratic in its stretch."""
    k = (FIBRE_MODULUS * THICKNESS, ACROSS * THICKNESS)
    shares = (cos(angle) ** 2, sin(angle) ** 2)
    shear = force(g) * sin(g)
    # (k - T c^2) l^2 - k l - F sin g = 0
    return [(ki + sqrt(ki * ki + 4.0 * (ki - tension * q) * shear)) / (2.0 * (ki - tension * q)) for ki, q in zip(k, shares)]


def state(pull, angle):
    """Strain along the pull and shear angle under the force `pull` (N/m), by bisection of g inside bisection of T."""
    c, s = cos(angle), sin(angle)

    def sheared(tension):
        low, high = -1.2, 0.0
        for _ in range(80):
            g = 0.5 * (low + high)
            l1, l2 = stretches(tension, angle, g)
            low, high = (g, high) if force(g) + tension * c * s * l1 * l2 < 0.0 else (low, g)
        return 0.5 * (low + high)

    def stretch(tension):
        g = sheared(tension)
        l1, l2 = stretches(tension, angle, g)
        return sqrt(c * c * l1 * l1 + s * s * l2 * l2 - 2.0 * c * s * l1 * l2 * sin(g)), g

    low, high = 0.0, pull
    for _ in range(80):
        tension = 0.5 * (low + high)
        low, high = (tension, high) if tension * stretch(tension)[0] < pull else (low, tension)
    stretched, g = stretch(0.5 * (low + high))
    return stretched - 1.0, g


if __name__ == "__main__":
    with open("reference/picture-frame.csv", "w") as out:
        out.write("# 60 N/m g + 120 N/m g^3, odd; written by closed-forms.py\n")
        out.write("shear_angle [rad],normalised_force [N/m]\n")
        for i in range(-50, 51):
            g = 0.02 * i
            out.write(f"{g:.6f},{force(g):.9f}\n")
    for degrees, pull in ((20, 100.0), (45, 60.0), (70, 100.0)):
        with open(f"reference/off-axis-{degrees}.csv", "w") as out:
            out.write(f"# Fibres {degrees} deg off the pull, 30 MPa along and 6 MPa across them, 0.3 mm; written by closed-forms.py\n")
            out.write("force [N/m],strain [1],shear_angle [rad]\n0,0,0\n")
            for i in range(1, 6):
                strain, g = state(pull * i / 5, radians(degrees))
                out.write(f"{pull * i / 5:.6f},{strain:.9f},{g:.9f}\n")
        print(f"{degrees} deg, {pull} N/m: strain {strain:.5f}, shear {g * 180 / pi:.3f} deg, l1, l2 - 1:",
              [l - 1.0 for l in stretches(pull / (1.0 + strain), radians(degrees), g)])
    for family, stiffness, length in ((1, BENDING[0], 0.150), (2, BENDING[1], 0.032)):
        weight = AREAL_MASS * profiles.GRAVITY
        states = profiles.elastica(profiles.constant(stiffness), weight, length, 260)
        with open(f"reference/cantilever-{family}.csv", "w") as out:
            out.write(f"# Heavy elastica along family {family}: overhang {1e3 * length:.0f} mm, B = {stiffness} N m, weight {weight:.6f} N/m2; ")
            out.write("written by closed-forms.py. z is negative downwards.\nx [mm],z [mm]\n")
            for _, _, x, z in states:
                out.write(f"{1e3 * x:.6f},{1e3 * z:.6f}\n")
        print(f"family {family}: tip {1e3 * states[-1][2]:.3f} {1e3 * states[-1][3]:.3f} mm")
