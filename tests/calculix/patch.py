#!/usr/bin/env python3
"""Pulls an exported ply with CalculiX, and holds the stiffness that it finds against that of a laminate of two layers.

usage: patch.py PLYFLOW SAMPLE CCX

PLYFLOW is the program, SAMPLE the example `sheared-square` of the crate `plyflow-export`, CCX CalculiX (Debian: calculix-ccx). The square is sheared by
0.4 rad, so its families are not at right angles. Every node is moved as a uniform strain in the plane of the square says, with its rotations
held. Twice the internal energy is then area * strain * A * strain with the laminate's stiffness A. (The forces that CalculiX prints at nodes of shells do not
add up to it: where rotations are held too, some of them go into its constraints.) Exit code 0: all within the bound.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

# Constants of a layer (Pa, 1): E1, E2, E3, nu12, nu13, nu23, G12, G13, G23. Without nu13 and nu23, layers do not press on each other.
LAYER = (140e9, 9e9, 9e9, 0.3, 0.0, 0.0, 5e9, 5e9, 3e9)
# As the example has it: shear (rad), stretch, turn about x (rad), side (m), thickness (m).
SHEAR, STRETCH, TURN, SIDE, THICKNESS = 0.4, 1.1, np.pi / 6, 0.1, 0.0005
STRAINS = {"along x": (1e-3, 0, 0), "along y": (0, 1e-3, 0), "shear": (0, 0, 1e-3), "all": (4e-4, -7e-4, 5e-4)}
# Largest relative error of the energy.
BOUND = 1e-3


def laminate():
    """Stiffness A (N/m) of both layers in the plane's x and y, each half as thick as the ply at constant volume."""
    e1, e2, _, nu12, _, _, g12, _, _ = LAYER
    d = 1 - nu12**2 * e2 / e1
    q = np.array([[e1, nu12 * e2, 0], [nu12 * e2, e2, 0], [0, 0, g12 * d]]) / d
    total = np.zeros((3, 3))
    for fibre in ((STRETCH, 0.0), (STRETCH * np.tan(SHEAR), 1.0)):
        c, s = np.array(fibre) / np.linalg.norm(fibre)
        # Strains (e_x, e_y, gamma_xy) in the axes of the layer.
        turned = np.array([[c * c, s * s, s * c], [s * s, c * c, -s * c], [-2 * s * c, 2 * s * c, c * c - s * s]])
        total += turned.T @ q @ turned * (THICKNESS / STRETCH / 2)
    return total


def nodes(deck):
    """Numbers and points of the nodes of a deck."""
    found, reading = {}, False
    for line in deck.read_text().splitlines():
        if line.startswith("*"):
            reading = line.strip() == "*Node"
        elif reading:
            number, *point = line.split(",")
            found[int(number)] = np.array([float(x) for x in point])
    return found


def run(ccx, folder, name, text):
    (folder / f"{name}.inp").write_text(text)
    done = subprocess.run([ccx, name], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode or "*ERROR" in done.stdout or "*WARNING" in done.stdout:
        raise SystemExit(f"patch.py: {name}: {done.stdout[-3000:]}")
    return folder / f"{name}.dat"


def main(plyflow, sample, ccx):
    folder = Path(tempfile.mkdtemp())
    subprocess.run([sample, "square.vtkhdf"], cwd=folder, check=True)
    subprocess.run([plyflow, "export", "square.vtkhdf", "--format", "calculix", "--body", "lower"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    points = nodes(folder / "square.inp")
    axes = np.array([[1, 0, 0], [0, np.cos(TURN), np.sin(TURN)]])
    area, stiffness, bad = SIDE**2 * STRETCH, laminate(), False
    for name, strain in STRAINS.items():
        e_x, e_y, gamma = strain
        tensor = np.array([[e_x, gamma / 2], [gamma / 2, e_y]])
        moved = {k: axes.T @ tensor @ axes @ p for k, p in points.items()}
        deck = "*Material, name=NCF__440_G_M2\n*Elastic, type=Engineering Constants\n"
        deck += ", ".join(f"{v:g}" for v in LAYER[:8]) + f",\n{LAYER[8]:g}\n*Include, input=square.inp\n*Step\n*Static\n*Boundary\n"
        for k, u in moved.items():
            deck += "".join(f"{k}, {i + 1}, {i + 1}, {u[i]:.12e}\n" for i in range(3)) + f"{k}, 4, 6\n"
        deck += "*El Print, elset=LOWER, totals=only\nELSE\n*End Step\n"
        found = 2 * float(run(ccx, folder, "patch", deck).read_text().split()[-1])
        expected = area * float(np.array(strain) @ stiffness @ np.array(strain))
        error = found / expected - 1
        bad |= not abs(error) < BOUND
        print(f"{name}: twice the energy {found:.6e} J, of the laminate {expected:.6e} J, error {error:+.1e} (bound {BOUND:g})")
    return int(bad)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    sys.exit(main(*(str(Path(a).resolve()) if Path(a).exists() else a for a in sys.argv[1:])))
