"""The picture of exported drawings: a flat ply with its fibre lines, and both on the formed part, as DXF files have them."""

import tempfile
from pathlib import Path

import ezdxf
import numpy as np

import runs
import scene3d
import style

WIDTH, HEIGHT = 320, 240
# What the drawings are in (m).
MM = 1e-3
COLOURS = {"ply_1": (0.1, 0.1, 0.1), "ply_1-fibres_1": (0.0, 0.45, 0.70), "ply_1-fibres_2": (0.84, 0.37, 0.0)}
# Lines are drawn in front of the ply that they lie on.
OVER_PLY = 0.003


def _lines(path: Path) -> list:
    """Lines of a drawing with their layers, closed ones up to their beginning."""
    found = []
    for entity in ezdxf.readfile(path).modelspace():
        if entity.dxftype() == "LWPOLYLINE":
            points = [(x, y, 0.0) for x, y, *_ in entity.get_points()]
        else:
            points = [tuple(v.dxf.location) for v in entity.vertices]
        closed = points[:1] if entity.is_closed else []
        found.append((entity.dxf.layer, MM * np.array(points + closed)))
    return found


def export():
    """Left the flat drawing, right the draped one over the ply."""
    place = runs.run("kinematic/workflow", "hemisphere")
    draped = runs.artifact(place, "hemisphere")
    with tempfile.TemporaryDirectory() as folder:
        file, *store = place
        runs.plyflow("export", file, "hemisphere", *store, "--format", "dxf", "--unit", "mm", "--net", "10 mm", "--to", folder)
        flat, on_part = (_lines(Path(folder) / f"hemisphere-{what}.dxf") for what in ("flat", "draped"))
    figure, axes = style.canvas(2 * WIDTH, HEIGHT + 40)
    scale = 0.8 * HEIGHT / 0.1
    for layer, points in flat:
        if layer in COLOURS:
            axes.plot(WIDTH / 2 + scale * points[:, 0], 35 + HEIGHT / 2 - scale * points[:, 1], color=COLOURS[layer], linewidth=1.6 if layer == "ply_1" else 0.8)
    view = scene3d.View((WIDTH, HEIGHT), scene3d.Camera(-62, 38, (0.0, 0.0, 0.02), 0.15))
    points = draped.points("ply_1")
    view.surface(draped.points("tool"), draped.cells("tool"), style.TOOL)
    view.surface(points, draped.cells("ply_1"), (0.93, 0.92, 0.88), lift=0.5 * OVER_PLY)
    for layer, line in on_part:
        view.lines(np.stack([line[:-1], line[1:]], axis=1), COLOURS[layer], 2.0 if layer == "ply_1" else 1.2, lift=OVER_PLY)
    style.put(axes, view.picture(), WIDTH, 30)
    axes.text(20, 18, "hemisphere-flat.dxf", fontsize=7, va="center")
    axes.text(WIDTH + 20, 18, "hemisphere-draped.dxf", fontsize=7, va="center")
    return style.save_png(figure, "export", [])
