#!/usr/bin/env python3
"""Writes the reference curves of the coupon workflows that are closed forms of the thesis' numbers.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to."""

from math import radians


def ncf_yarn(g):
    return 29.56 * g**5 - 65.56 * g**4 + 137.06 * g**3 + 94.73 * g**2 + 112.19 * g


def ncf_stitch(g):
    if 0.06 <= g < 0.5:
        return 2000 * g - 120
    if 0.5 <= g < 0.75:
        return -3520 * g + 2640
    return 0.0


def ncf(g):
    return ncf_yarn(g) + ncf_stitch(g) if g >= 0 else -ncf_yarn(-g)


def woven(g):
    a = abs(g)
    f = (37.35 * a - 322.61 * a**2 + 1458.51 * a**3 - 3539.56 * a**4 + 4727.84 * a**5
         - 3275.20 * a**6 + 930.53 * a**7)
    return f if g >= 0 else -f


SOURCE = "F. Yu, thesis, table 3.1 (units: N/m over rad); odd for negative angles"
for name, law, last in [("ncf", ncf, 55), ("woven", woven, 60)]:
    with open(f"picture-frame/reference/{name}.csv", "w") as out:
        out.write(f"# Normalised shear force of {SOURCE}\n")
        out.write("shear_angle [rad],normalised_force [N/m]\n")
        for i in range(-20 * last, 20 * last + 1):
            g = radians(i / 20)
            out.write(f"{g:.9f},{law(g):.9f}\n")
