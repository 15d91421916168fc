"""Picture of workflows/double-dome."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

import runs
import scene3d
import spar
import style


def double_dome():
    """Shear of the ply by geometry alone and between matched dies, over the punch and the blocks of the holder."""
    width, height = 700, 420
    figure, axes = style.canvas(2 * width, height + 180)
    colours = ScalarMappable(Normalize(-50, 50), "RdBu_r")
    place = runs.run("double-dome/workflow-coarse")
    for k, (step, what) in enumerate((("drape", "kinematic drape"), ("stamped", "between matched dies, held by four blocks on springs"))):
        formed = runs.artifact(place, step)
        view = scene3d.View((width, height), scene3d.Camera(-60, 40, (0.0, 0.0, 0.03), 0.6))
        for body in [b for b in formed.bodies if b == "tool" or b.startswith("holder")]:
            view.surface(formed.points(body), formed.cells(body), style.TOOL)
        points, cells = formed.points("ply_1"), formed.cells("ply_1")
        shear = np.degrees(formed.at_points("ply_1", "shear_angle"))
        view.surface(points, cells, spar.paint(shear, colours), lift=0.002)
        view.lines(scene3d.grid_lines(points, cells), (0.2, 0.2, 0.2), 0.6, lift=0.004, share=0.25)
        style.put(axes, view.picture(), k * width, 45)
        axes.text(k * width + 30, 34, what, fontsize=10, va="center")
    style.colour_bar(figure, (60, height + 75, 420, 22), colours, "shear angle (deg)", ticks=[-50, -25, 0, 25, 50])
    style.scale_bar(axes, 1220, height + 110, 0.1, width / 0.6)
    return style.save_png(figure, "double-dome", [colours])
