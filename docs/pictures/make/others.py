"""The picture of the files of others: what two steps in Python read, and what is formed of it."""

import json
import os

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

import runs
import scene3d
import style
from spar import paint

WIDTH, HEIGHT = 700, 460
CAMERA = scene3d.Camera(-60, 40, (0.0, 0.0, 0.025), 0.33)
# How far over the tool the outline is drawn (m).
ABOVE = 0.045
# The ply is drawn in front of the tool that it touches.
OVER_TOOL = 0.004


def _artifact(step: str) -> runs.Artifact:
    """What a step of the workflow made, whose steps in Python may run."""
    interpreter = runs.ROOT / ".tools" / "files-of-others" / "bin" / "python"
    if not interpreter.exists():
        raise SystemExit(f"make-pictures: there is no {interpreter}: run scripts/check-files-of-others")
    os.environ["PLYFLOW_PYTHON"] = str(interpreter)
    file = str(runs.workflows() / "files-of-others" / "workflow.yaml")
    place = ("--store", str(runs.STORE / "files-of-others"), "--trust")
    runs.plyflow("run", file, *place, "--no-report", "--quiet")
    told = runs.plyflow("inspect", step, "--workflow", file, *place, "--format", "json")
    return runs.Artifact(json.loads(told)["path"])


def files_of_others():
    """Left what was read, right the formed ply."""
    tool, blank, formed = (_artifact(step) for step in ("tool", "blank", "formed"))
    figure, axes = style.canvas(2 * WIDTH, HEIGHT + 180)
    points, cells = tool.points("hat"), tool.cells("hat")
    # Its foot is not seen, and would blur the light on the walls.
    cells = cells[points[cells][:, :, 2].max(axis=1) > 1e-6]
    used, cells = np.unique(cells, return_inverse=True)
    points, cells = points[used], cells.reshape(-1, 3)

    view = scene3d.View((WIDTH, HEIGHT), CAMERA)
    view.surface(points, cells, style.TOOL)
    view.lines(scene3d.grid_lines(points, cells), (0.45, 0.47, 0.5), 0.5, lift=OVER_TOOL, share=0.35)
    for name, colour in (("outline", (0.0, 0.45, 0.70)), ("hole_0", (0.84, 0.37, 0.0))):
        corners = blank.array(f"outlines/blank/{name}")
        placed = np.column_stack([corners, np.full(len(corners), ABOVE)])
        view.lines(np.stack([placed, np.roll(placed, -1, axis=0)], axis=1), colour, 2.5, lift=0.2)
    style.put(axes, view.picture(), 0, 40)
    axes.text(30, 30, "hat.step and blank.dxf, as read", fontsize=10, va="center")

    colours = ScalarMappable(Normalize(-20, 20), "RdBu_r")
    view = scene3d.View((WIDTH, HEIGHT), CAMERA)
    view.surface(points, cells, style.TOOL)
    points, cells = formed.points("ply"), formed.cells("ply")
    view.surface(points, cells, paint(np.degrees(formed.at_points("ply", "shear_angle")), colours), lift=OVER_TOOL)
    view.lines(scene3d.grid_lines(points, cells), (0.2, 0.2, 0.2), 0.6, lift=OVER_TOOL + 0.002, share=0.3)
    style.put(axes, view.picture(), WIDTH, 40)
    axes.text(WIDTH + 30, 30, "formed", fontsize=10, va="center")
    style.colour_bar(figure, (WIDTH + 60, HEIGHT + 70, 420, 20), colours, "shear angle (deg)", ticks=[-20, -10, 0, 10, 20])
    style.scale_bar(axes, 60, HEIGHT + 90, 0.05, WIDTH / 0.33)
    return style.save_png(figure, "files-of-others", [colours])
