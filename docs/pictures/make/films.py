"""Pictures of workflows/single-diaphragm."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Polygon

import runs
import scene3d
import style
from style import BLUE, GREY, INK, MM, ORANGE, SKY

# Times of the run (s), what happens then, and the colour of the film.
TIMES = ((0.19, "frame down", SKY), (0.31, "half of the drawing", "#2f8fc4"), (0.43, "end", BLUE))


def cut(formed: runs.Artifact, body: str, frame: int = -1) -> np.ndarray:
    """The section of a body at x = 0, [k][2] of (y, z) in mm, ordered along y."""
    faces = scene3d.triangles(formed.cells(body)) if formed.cells(body).shape[1] == 4 else formed.cells(body)
    points = scene3d.section(formed.points(body, frame), faces, 0.0).reshape(-1, 2) * MM
    return points[np.argsort(points[:, 0])]


def single_diaphragm():
    """Sections across the block at three times, over a bed and on the tool's own plate."""
    place = runs.run("single-diaphragm/workflow", "coarse", "no_bed")
    figure, panels = plt.subplots(2, 1, figsize=(7, 3.7), layout="constrained", sharex=True)
    for axes, step, title in zip(panels, ("coarse", "no_bed"), ("over a bed", "without a bed: the frame lies on the tool's own plate")):
        formed = runs.artifact(place, step)
        tool = scene3d.section(formed.points("tool"), formed.cells("tool"), 0.0) * MM
        # A body is closed: its section is filled from the foot up, column by column.
        for low, high in tool:
            axes.add_patch(Polygon([(low[0], 0), tuple(low), tuple(high), (high[0], 0)], color="#c9ccd1", linewidth=0))
        if step == "coarse":
            axes.axhline(0, color=INK, linewidth=2)
        for time, label, colour in TIMES:
            frame = int(np.argmin(np.abs(formed.times - time)))
            film = cut(formed, "film", frame)
            axes.plot(*film.T, color=colour, linewidth=1.4, label=f"film: {label}")
            for rim in film[[0, -1]]:
                axes.plot(*rim, "s", color=GREY, markersize=4)
        axes.plot(*cut(formed, "ply").T, color=ORANGE, linewidth=2, label="ply: end")
        axes.set(aspect="equal", title=title, ylabel="z (mm)", xlim=(-190, 190), ylim=(-3, 45))
        axes.grid(False)
    panels[1].set_xlabel("y across the tool (mm)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return style.save_svg(figure, "single-diaphragm")
