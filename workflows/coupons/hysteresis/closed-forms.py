#!/usr/bin/env python3
"""Writes the closed forms of a fabric with friction between its yarns, sheared in a picture frame and bent to circles to and fro.

Friction is a slider on a spring beside the law: over x, which is sin g in shear and the curvature in bending, its force is
K (x - p) with a bound Y, and p moves along when the bound is reached. On a straight leg it is linear up to the bound and then
constant, so its work is exact. The law itself gives back all that it takes, on a path that ends where it began.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to."""

from math import radians, sin


def leg(start, end, stands, spring, bound):
    """Force at the end, work, and where the slider stands after the leg."""
    first, sign = spring * (start - stands), 1.0 if end > start else -1.0
    last = spring * (end - stands)
    if abs(last) <= bound:
        return last, 0.5 * (first + last) * (end - start), stands
    slips = stands + sign * bound / spring
    work = 0.5 * (first + sign * bound) * (slips - start) + sign * bound * (end - slips)
    return sign * bound, work, end - sign * bound / spring


def loop(path, spring, bound):
    stands, work = 0.0, 0.0
    for start, end in zip(path, path[1:]):
        _, more, stands = leg(start, end, stands, spring, bound)
        work += more
    return work


def force(g):
    return 40.0 * g + 60.0 * g**3


FRICTION, ANGLE, PER_TENSION = 4.0, radians(1.0), 0.002
FIBRE_STIFFNESS, STRAIN = 300e6 * 0.3e-3, 0.01
MOMENT, CURVATURE = 1e-3, 2.0
SPRING = FRICTION / sin(ANGLE)


def curve(name, angles, bound, text):
    """The force along the path, over the shear that was passed through."""
    with open(f"reference/{name}.csv", "w") as out:
        out.write(f"# {text}; written by closed-forms.py\npath_length [rad],normalised_force [N/m]\n")
        stands, passed = 0.0, 0.0
        for a, b in zip(angles, angles[1:]):
            for i in range(401):
                g = a + (b - a) * i / 400
                if a == b or (i == 0 and passed > 0.0):
                    continue
                rub, _, _ = leg(sin(a), sin(g), stands, SPRING, bound) if g != a else (SPRING * (sin(a) - stands), 0.0, 0.0)
                out.write(f"{passed + abs(g - a):.9f},{force(g) + rub:.9f}\n")
            if a != b:
                stands = leg(sin(a), sin(b), stands, SPRING, bound)[2]
            passed += abs(b - a)
    print(f"{name}: {loop([sin(g) for g in angles], SPRING, bound):.6f} N/m")


if __name__ == "__main__":
    shear = (0.0, 0.4, -0.4, 0.4, 0.0)
    curve("shear", shear, FRICTION, "40 N/m g + 60 N/m g^3, friction 4 N/m over 1 deg")
    # Both families carry their tension from the first leg on, which is one without shear.
    tight = FRICTION + PER_TENSION * 2.0 * FIBRE_STIFFNESS * STRAIN
    print("bound under tension:", tight, "N/m")
    curve("shear-tension", (0.0, *shear), tight, f"The same under a fibre strain of 1 %: friction {tight:.3f} N/m over the same spring")
    bend = [1e3 * k for k in (0.0, 0.05, -0.05, 0.05, 0.0)]
    print(f"bending: {loop(bend, MOMENT / CURVATURE, MOMENT):.8f} N/m")
