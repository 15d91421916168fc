//! Mistakes in a material.

use crate::{Case, F};

pub const CASES: &[Case] = &[
    (
        F,
        "  fibre_modulus: 3 GPa\n",
        "  fibre_modulus: 3 Gpa\n",
        0,
        &["unknown unit `Gpa`", "`GPa`"],
    ),
    (
        F,
        "  fibre_modulus: 3 GPa\n",
        "",
        usize::MAX,
        &["needs the parameter `fibre_modulus`"],
    ),
    (
        F,
        "  shear: 112.19 N/m\n",
        "  shaer: 112.19 N/m\n",
        0,
        &["no parameter of `material-fabric`", "did you mean `shear`"],
    ),
    (
        F,
        "areal_mass: 440 g/m2",
        "areal_mass: 440 g/m3",
        0,
        &["is a density", "an areal mass"],
    ),
    (
        F,
        "plugin: material-fabric",
        "plugin: material-fabrik",
        0,
        &["did you mean `material-fabric`"],
    ),
    (
        F,
        "plugin: material-fabric",
        "plugin: rf4",
        0,
        &["is an element plugin, not a material plugin"],
    ),
    (
        F,
        "thickness: 0.4 mm",
        "thickness: [0.4 mm]",
        0,
        &["`thickness` is a list"],
    ),
];
