"""A fabric whose yarns rub on each other: when the shear is taken back, the fabric does not follow its loading curve."""

import plyflow
from plyflow import declare


@plyflow.law(
    "my-sheet",
    version="0.1.0",
    vendor="You",
    parameters={
        "fibre_stiffness": declare.quantity("force_per_length", exclusive_minimum="0 N/m", default="50 kN/m", doc="Stress over strain of both families."),
        "shear_stiffness": declare.quantity("force_per_length", minimum="0 N/m", default="100 N/m", doc="Elastic shear at small angles."),
        "shear_stiffening": declare.quantity("force_per_length", minimum="0 N/m", default="400 N/m", doc="Its part that grows with the cube."),
        "friction": declare.quantity("force_per_length", minimum="0 N/m", default="20 N/m", doc="Shear stress at which the yarns slip."),
        "stick": declare.quantity("force_per_length", exclusive_minimum="0 N/m", default="1000 N/m", doc="Shear stiffness before they slip."),
        "bending_stiffness": declare.quantity("moment", exclusive_minimum="0 N m", default="1 N mm", doc="Moment per width over curvature."),
    },
    history=3,
)
def membrane(p, c11, c22, c12, history):
    """A sheet of two fibre families with elastic shear, and friction between the yarns."""
    e11, e22 = 0.5 * (c11 - 1.0), 0.5 * (c22 - 1.0)
    stored = 0.5 * p.fibre_stiffness * (e11 * e11 + e22 * e22)
    elastic = p.shear_stiffness * c12 + p.shear_stiffening * c12**3
    stored += 0.5 * p.shear_stiffness * c12**2 + 0.25 * p.shear_stiffening * c12**4

    # The yarns stick until the friction between them is used up. Then they slip.
    shear_before, before, work = history[0], history[1], history[2]
    moved = c12 - shear_before
    rub = min(max(before + p.stick * moved, -p.friction), p.friction)
    slipped = moved - (rub - before) / p.stick
    work += 0.5 * (rub * rub - before * before) / p.stick + rub * slipped
    history[0], history[1], history[2] = c12, rub, work
    return p.fibre_stiffness * e11, p.fibre_stiffness * e22, elastic + rub, stored + work


@membrane.bending
def bending(p, k11, k22, k12):
    """Constant bending stiffness, the same along both families and in twist."""
    d = p.bending_stiffness
    return d * k11, d * k22, d * k12, 0.5 * d * (k11 * k11 + k22 * k22 + 2.0 * k12 * k12)
