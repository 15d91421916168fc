"""Pictures of workflows/coupons and workflows/hemisphere."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize

import runs
import scene3d
import spar
import style
from style import BLUE, GREY, INK, MM, ORANGE, RED


def bias_extension():
    """Shear and wrinkle amplitude of both pulled fabrics, in the meshes for every day, and what the thesis states of its tests."""
    figure, panels = plt.subplots(2, 2, figsize=(7, 5.4), layout="constrained", sharex="col")
    cases = (("bias-extension-ncf", "rf4_5mm", "NCF, 200 × 100 mm"), ("bias-extension-woven", "rf4_75mm", "woven, 300 × 150 mm"))
    for (shear, amplitude), (name, step, title) in zip(panels.T, cases):
        place = runs.run(f"coupons/{name}/workflow")
        run = runs.artifact(place, step)
        x = run.array("curves/run/displacement") * MM
        shear.plot(x, np.degrees(run.array("curves/run/shear_a")), color=BLUE, label="computed, at the centre")
        shear.plot(x, np.degrees(run.array("curves/theory/shear")), color=GREY, linestyle=(0, (4, 2)), label="pin-jointed net")
        # The first measured point is the start, the second the onset of wrinkles.
        shear.plot(run.array("curves/measured/shear_displacement")[1:] * MM, np.degrees(run.array("curves/measured/shear")[1:]), "o",
                   color=RED, label="thesis: onset of wrinkles")
        shear.set(title=title, ylabel="shear angle (deg)")
        amplitude.plot(x, run.array("curves/run/amplitude") * MM, color=BLUE, label="computed")
        amplitude.plot(run.array("curves/measured/amplitude_displacement") * MM, run.array("curves/measured/amplitude") * MM, "o",
                       color=RED, label="thesis")
        amplitude.set(xlabel="displacement (mm)", ylabel="wrinkle amplitude (mm)", xlim=(0, x[-1]))
        for axes in (shear, amplitude):
            axes.set_ylim(bottom=0)
        shear.legend(loc="upper left")
        amplitude.legend(loc="upper right" if "ncf" in name else "upper left")
    return style.save_svg(figure, "bias-extension")


def cantilever():
    """Profiles of hanging strips: shells and the heavy elastica with the same law."""
    place = runs.run("coupons/cantilever/workflow")
    figure, panels = plt.subplots(1, 3, figsize=(7, 3.5), layout="constrained", sharey=True, width_ratios=(190, 190, 110))
    laws = (("nonlinear", "nonlinear law", BLUE), ("b415", "constant, B(41.5°)", ORANGE), ("binit", "constant, initial", style.GREEN))
    for axes, (fabric, title) in zip(panels, (("ncf_positive", "NCF, positive bending"), ("ncf_negative", "NCF, negative bending"), ("woven", "woven"))):
        for law, label, colour in laws:
            run = runs.artifact(place, f"{fabric}_{law}_rf4")
            axes.plot(run.array("curves/reference/x") * MM, run.array("curves/reference/z") * MM, color=colour, linewidth=1.2, label=label)
            axes.plot(run.array("profile/x")[::2] * MM, run.array("profile/z")[::2] * MM, "o", color=colour, markersize=3.2,
                      markerfacecolor="white", markeredgewidth=0.9)
        axes.set(title=title, aspect="equal", xlabel="x (mm)", xlim=(-5, 105 if fabric == "woven" else 185), ylim=(-195, 8))
    panels[0].set_ylabel("z (mm)")
    handles = panels[0].get_legend_handles_labels()[0]
    marks = [plt.Line2D([], [], color=INK, linewidth=1.2, label="elastica"),
             plt.Line2D([], [], color=INK, marker="o", markersize=3.2, markerfacecolor="white", linestyle="none", label="shells (rf4)")]
    figure.legend(handles=handles + marks, loc="outside lower center", ncols=5, columnspacing=1.2, handlelength=1.6)
    return style.save_svg(figure, "cantilever")


def buckling():
    """Load and amplitude of a strip between clamps that come together: shells and the elastica."""
    place = runs.run("coupons/buckling/workflow")
    figure, panels = plt.subplots(1, 2, figsize=(7, 2.8), layout="constrained")
    for axes, name, unit, label in zip(panels, ("load", "amplitude"), (1e-3, MM), ("load per width (N/mm)", "amplitude (mm)")):
        for element, colour in (("rf4", BLUE), ("s4", ORANGE)):
            run = runs.artifact(place, f"elastica_40_{element}")
            axes.plot(run.array("curves/run/shortening")[::8] * 100, run.array(f"curves/run/{name}")[::8] * unit, "o", color=colour,
                      markersize=3.2 if element == "rf4" else 2, markerfacecolor="white", markeredgewidth=0.9, label=f"{element}, 40 elements")
        x, y = (run.array(f"curves/elastica/{c}") for c in ("shortening", name))
        axes.plot(x * 100, y * unit, color=INK, linewidth=1.2, label="elastica")
        axes.set(xlabel="end shortening (% of the length)", ylabel=label, xlim=(0, 40), ylim=(0, None))
    panels[1].legend(loc="lower right")
    return style.save_svg(figure, "buckling")


def unidirectional():
    """A unidirectional ply that is pulled off its fibres: membranes and the closed form of the law."""
    place = runs.run("coupons/unidirectional/workflow")
    figure, panels = plt.subplots(1, 2, figsize=(7, 2.8), layout="constrained")
    for axes, name, label in zip(panels, ("shear_angle", "strain"), ("shear of the fibres (deg)", "strain along the pull (%)")):
        unit = 180 / np.pi if name == "shear_angle" else 100
        for degrees, colour in ((20, BLUE), (45, ORANGE), (70, style.GREEN)):
            run = runs.artifact(place, f"off_{degrees}")
            axes.plot(run.array("curves/closed_form/force"), run.array(f"curves/closed_form/{name}") * unit, color=colour, linewidth=1.2,
                      label=f"{degrees}° off the pull")
            axes.plot(run.array("curves/run/force"), run.array(f"curves/run/{name}") * unit, "o", color=colour, markersize=3.2,
                      markerfacecolor="white", markeredgewidth=0.9)
        axes.set(xlabel="force over the width (N/m)", ylabel=label, xlim=(0, None))
    panels[0].legend(loc="lower left")
    return style.save_svg(figure, "unidirectional")


def crossing():
    """A fabric whose families cross at 60 degrees, pulled at three angles: membranes and the closed form of the law."""
    place = runs.run("coupons/crossing/workflow")
    figure, panels = plt.subplots(1, 2, figsize=(7, 2.8), layout="constrained")
    ways = (("bisector", "families at ±30°", BLUE), ("off_20", "at 20° and 80°", ORANGE), ("off_75", "at 75° and 135°", style.GREEN))
    for axes, name, label in zip(panels, ("shear_angle", "strain"), ("shear of the fibres (deg)", "strain along the pull (%)")):
        unit = 180 / np.pi if name == "shear_angle" else 100
        for step, words, colour in ways:
            run = runs.artifact(place, step)
            whole = run.array("curves/closed_form/force")[-1]
            axes.plot(run.array("curves/closed_form/force") / whole, run.array(f"curves/closed_form/{name}") * unit, color=colour,
                      linewidth=1.2, label=f"{words}, to {whole:.0f} N/m")
            axes.plot(run.array("curves/run/force") / whole, run.array(f"curves/run/{name}") * unit, "o", color=colour, markersize=3.2,
                      markerfacecolor="white", markeredgewidth=0.9)
        axes.set(xlabel="share of the force", ylabel=label, xlim=(0, None))
    panels[1].legend(loc="upper left")
    return style.save_svg(figure, "crossing")


def hysteresis():
    """Loops of shear, of shear under tension and of bending, with friction between the yarns."""
    place = runs.run("coupons/hysteresis/workflow")
    figure, (shear, bending) = plt.subplots(1, 2, figsize=(7, 2.8), layout="constrained")
    for step, name, colour in (("shear", "without tension", BLUE), ("shear_tension", "under tension", ORANGE)):
        run = runs.artifact(place, step)
        shear.plot(np.degrees(run.array("curves/run/shear_angle")), run.array("curves/run/normalised_force"), color=colour, linewidth=1.2,
                   label=name)
    shear.set(xlabel="shear angle (deg)", ylabel="shear force (N/m)")
    shear.legend(loc="upper left")
    run = runs.artifact(place, "bending_rf4")
    k = run.array("curves/run/curvature")
    bending.plot(k * 1e-3, run.array("curves/run/moment"), color=BLUE, linewidth=1.2, label="computed (rf4)")
    bending.plot(k * 1e-3, 0.0004 * k, color=GREY, linestyle=(0, (4, 2)), label="the law alone")
    bending.set(xlabel="curvature (1/mm)", ylabel="moment per width (N)")
    bending.legend(loc="upper left")
    return style.save_svg(figure, "hysteresis")


def hemisphere():
    """The woven ply of case A in 5 mm shells, pressed: shear from above and the wrinkles from the side."""
    place = runs.run("hemisphere/workflow-coarse")
    formed, census = runs.artifact(place, "woven"), runs.artifact(place, "woven_wrinkles")
    width, height = 700, 470
    figure, axes = style.canvas(2 * width, height + 160)
    shear = ScalarMappable(Normalize(-50, 50), "RdBu_r")
    off = ScalarMappable(Normalize(0, 7), spar.HEIGHTS)
    points, cells = formed.points("ply_1"), formed.cells("ply_1")
    values = ((np.degrees(formed.at_points("ply_1", "shear_angle")), shear), (census.field("ply_1", "deviation") * MM, off))
    for k, (field, colours) in enumerate(values):
        view = scene3d.View((width, height), scene3d.Camera(-70, 38, (0, 0, -0.011), 0.385))
        view.surface(points, cells, spar.paint(field, colours))
        view.lines(scene3d.grid_lines(points, cells), (0.15, 0.15, 0.15), 0.7, lift=0.0008, share=0.3)
        style.put(axes, view.picture(), k * width, 0)
    style.colour_bar(figure, (140, height + 55, 420, 22), shear, "shear angle (deg)")
    style.colour_bar(figure, (width + 140, height + 55, 420, 22), off, "distance from punch and die (mm)")
    style.scale_bar(axes, 40, height + 30, 0.05, width / 0.385)
    return style.save_png(figure, "hemisphere", [shear, off])


def tied():
    """Two plies formed over the hat, loose and tied to each other: the shear of the upper one, drawn on the flat ply."""
    place = runs.run("stacks/tied")
    figure, panels = plt.subplots(1, 2, figsize=(6, 1.9), layout="constrained", sharey=True)
    for axes, step, title in zip(panels, ("loose", "tied"), ("two loose plies", "tied")):
        formed = runs.artifact(place, step)
        flat, cells = formed.reference("ply_2")[:, :2] * 1e3, formed.cells("ply_2")
        shear = np.degrees(formed.field("ply_2", "shear_angle"))
        shown = PolyCollection(flat[cells], array=shear, cmap="RdBu_r", norm=Normalize(-10, 10), edgecolors="face", linewidths=0.3)
        axes.add_collection(shown)
        axes.set(title=f"{title}: {np.abs(shear).max():.0f}° at most", xlabel="x (mm)", aspect="equal", xlim=(-145, 145), ylim=(-75, 75))
        axes.grid(False)
    panels[0].set_ylabel("y (mm)")
    figure.colorbar(shown, ax=panels, label="shear angle (deg)", shrink=0.8)
    return style.save_png(figure, "tied", [shown])


def double_dome():
    """The woven ply of the double dome, stamped in matched dies and draped: shear, and how it lies on the punch."""
    place = runs.run("double-dome/workflow-coarse")
    width, height = 700, 420
    figure, axes = style.canvas(2 * width, height + 130)
    shear = ScalarMappable(Normalize(-50, 50), "RdBu_r")
    for k, (step, title) in enumerate((("stamped", "stamped in matched dies"), ("drape", "draped, where the net reaches"))):
        formed = runs.artifact(place, step)
        points, cells = formed.points("ply_1"), formed.cells("ply_1")
        if step == "drape":
            cells = cells[formed.field("ply_1", "draped") > 0.5]
        values = np.degrees(formed.at_points("ply_1", "shear_angle"))
        view = scene3d.View((width, height), scene3d.Camera(-60, 38, (0, 0, 0.03), 0.5))
        view.surface(points, cells, spar.paint(values, shear))
        view.lines(scene3d.grid_lines(points, cells), (0.15, 0.15, 0.15), 0.7, lift=0.0008, share=0.3)
        style.put(axes, view.picture(), k * width, 0)
        axes.text(k * width + width / 2, height + 18, title, ha="center", va="top", fontsize=9)
    style.colour_bar(figure, (width - 210, height + 70, 420, 22), shear, "shear angle (deg)")
    style.scale_bar(axes, 40, height + 90, 0.1, width / 0.5)
    return style.save_png(figure, "double-dome", [shear])
