"""Pictures of drawings: a flat ply with its fibre lines, and both on the formed part, as DXF files have them; and the plies of a ply book."""

import shutil
import tempfile
from pathlib import Path

import ezdxf
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

import runs
import scene3d
import style
from spar import paint

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


def steered():
    """Left the flat ply with its steered fibres, right where they lie on the formed ply."""
    place = runs.run("blanks/workflow-steered")
    formed = runs.artifact(place, "formed")
    with tempfile.TemporaryDirectory() as folder:
        file, *store = place
        runs.plyflow("export", file, "formed", *store, "--format", "dxf", "--unit", "mm", "--net", "12 mm", "--to", folder)
        flat, on_part = (_lines(Path(folder) / f"formed-{what}.dxf") for what in ("flat", "draped"))
    figure, axes = style.canvas(2 * WIDTH, HEIGHT + 20)
    scale = 0.85 * HEIGHT / 0.22
    for layer, points in flat:
        if layer in COLOURS:
            axes.plot(WIDTH / 2 + scale * points[:, 0], 10 + HEIGHT / 2 - scale * points[:, 1], color=COLOURS[layer], linewidth=1.6 if layer == "ply_1" else 0.8)
    view = scene3d.View((WIDTH, HEIGHT), scene3d.Camera(-62, 38, (0.0, 0.0, 0.02), 0.31))
    view.surface(formed.points("ply_1"), formed.cells("ply_1"), (0.93, 0.92, 0.88))
    for layer, line in on_part:
        view.lines(np.stack([line[:-1], line[1:]], axis=1), COLOURS[layer], 2.0 if layer == "ply_1" else 1.2, lift=OVER_PLY)
    style.put(axes, view.picture(), WIDTH, 10)
    return style.save_png(figure, "steered", [])


# The plies of the hat stringer, the one nearest to the tool first.
LAYUP = {"skin": (0.35, 0.35, 0.35), "doubler": (0.0, 0.45, 0.70), "cap": (0.84, 0.37, 0.0)}


def new_part():
    """Left the plies of the book as they lie over the tool, right draped, by the commands of the guide."""
    folder = runs.STORE / "new-part"
    shutil.rmtree(folder, ignore_errors=True)
    hat = runs.workflows() / "hat-stringer"
    runs.plyflow("new", "study", "hat", "--into", str(folder), "--tool", str(hat / "hat.stl"), "--unit", "mm", "--plies", str(hat / "layup" / "plies.csv"))
    place = (str(folder / "hat" / "workflow.yaml"),)
    runs.plyflow("run", *place, "--until", "drape", "--no-report", "--quiet")
    runs.plyflow("export", *place, "drape", "--format", "dxf", "--unit", "mm", "--net", "10 mm", "--to", str(folder))
    draped = runs.artifact(place, "drape")
    width, height = 640, 400
    figure, axes = style.canvas(2 * width, height + 150)
    scale = 0.86 * width / 0.33
    for layer, points in _lines(folder / "drape-flat.dxf"):
        name = layer.removesuffix("-fibres_1")
        if name in LAYUP:
            axes.plot(width / 2 + scale * points[:, 0], 30 + height / 2 - scale * points[:, 1], color=LAYUP[name], linewidth=2.0 if layer == name else 0.5)
    for k, (name, colour) in enumerate(LAYUP.items()):
        axes.text(40 + 150 * k, height + 60, name, color=colour, fontsize=11, va="center")
    colours = ScalarMappable(Normalize(-40, 40), "RdBu_r")
    view = scene3d.View((width, height), scene3d.Camera(-62, 40, (0.0, 0.0, 0.015), 0.36))
    view.surface(draped.points("tool"), draped.cells("tool"), style.TOOL)
    for k, name in enumerate(LAYUP):
        points, cells = draped.points(name), draped.cells(name)
        lift = (k + 1) * OVER_PLY
        view.surface(points, cells, paint(np.degrees(draped.at_points(name, "shear_angle")), colours), lift=lift)
        view.lines(points[scene3d.rim(cells)], LAYUP[name], 2.0, lift=lift + 0.5 * OVER_PLY)
    style.put(axes, view.picture(), width, 30)
    style.colour_bar(figure, (width + 60, height + 45, 420, 20), colours, "shear angle (deg)", ticks=[-40, -20, 0, 20, 40])
    return style.save_png(figure, "new-part", [colours])
