#!/usr/bin/env python3
"""Writes the moment-curvature laws of both fabrics (F. Yu, thesis, tables 3.1 and 3.2) as reference curves.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to."""

from math import exp


def voce(linear, asymptote, scale):
    return lambda k: linear * k + asymptote * (1.0 - exp(-k / scale))


POSITIVE = voce(0.19457, 0.03139, 0.0040)
NEGATIVE = voce(0.10279, 0.03619, 0.0065)
WOVEN = voce(0.01549, 0.00757, 0.02)

# A bend with its centre of curvature on the side of the ply's normal is positive for family 1 of the NCF and
# negative for family 2, which lies on the other face.
for name, up, down, text in [
    ("ncf-family-1", POSITIVE, NEGATIVE, "NCF, family 1: positive law for k > 0, negative law for k < 0"),
    ("ncf-family-2", NEGATIVE, POSITIVE, "NCF, family 2: negative law for k > 0, positive law for k < 0"),
    ("woven", WOVEN, WOVEN, "woven, both families and signs"),
]:
    with open(f"reference/{name}.csv", "w") as out:
        out.write(f"# {text}; F. Yu, thesis, tables 3.1 and 3.2 (k in 1/mm, M in N)\n")
        out.write("curvature [1/mm],moment [N]\n")
        for i in range(-520, 521):
            k = i * 1e-4
            moment = up(k) if k >= 0 else -down(-k)
            out.write(f"{k:.4f},{moment:.9f}\n")
