"""Pictures of the demo, workflows/joggle-spar/workflow.yaml."""

import json

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

import runs
import scene3d
import style
from style import BLUE, GREEN, GREY, INK, MM, ORANGE, RED

# Plies are drawn this much nearer to the eye: a flat cell over a fillet would else cut into the tool that its corners lie on.
OVER_TOOL = 0.003
COARSE_LINE, FINE_LINE = (0.45, 0.42, 0.36), (0.12, 0.12, 0.12)
TOP = "ply_2"
# Pale where a ply lies on the tool, dark where it stands off; readable without telling red from green.
HEIGHTS = "YlGnBu"


def demo() -> tuple[str, ...]:
    return runs.run("joggle-spar/with-crests")


def coarse() -> runs.Artifact:
    return runs.artifact(demo(), "coarse")


def zones() -> list[dict]:
    return runs.artifact(demo(), "zones").attributes["zones"]


def paint(values: np.ndarray, colours: ScalarMappable) -> np.ndarray:
    return colours.to_rgba(values)[:, :3]


def show_tool(view: scene3d.View, formed: runs.Artifact):
    view.surface(formed.points("tool"), formed.cells("tool"), style.TOOL)


def spar_zones():
    """The formed upper ply in its coarse mesh, with the fine meshes of the zones laid in, coloured by their height over the tool."""
    formed, compared = coarse(), runs.artifact(demo(), "comparison")
    size = (1400, 830)
    # From the side on which all zones are seen.
    view = scene3d.View(size, scene3d.Camera(118, 42, (0.0, 0.004, 0.047), 0.67))
    show_tool(view, formed)
    flat = formed.reference(TOP)[formed.cells(TOP)]
    outside = np.ones(len(flat), bool)
    for x0, y0, x1, y1 in (z["box"] for z in zones()):
        within = (flat[..., 0] > x0) & (flat[..., 0] < x1) & (flat[..., 1] > y0) & (flat[..., 1] < y1)
        outside &= ~within.all(axis=1)
    points, cells = formed.points(TOP), formed.cells(TOP)
    view.surface(points, cells[outside], style.CLOTH, lift=OVER_TOOL)
    view.lines(scene3d.grid_lines(points, cells[outside]), COARSE_LINE, 1.0, lift=OVER_TOOL + 0.002, share=0.55)
    colours = ScalarMappable(Normalize(0, 5), HEIGHTS)
    names = []
    for zone in zones():
        body = f"local_{zone['name']}_{TOP}"
        fine, fine_cells = compared.points(body), compared.cells(body)
        view.surface(fine, fine_cells, paint(compared.field(body, "nodal_distance") * MM, colours), lift=OVER_TOOL + 0.003)
        view.lines(scene3d.grid_lines(fine, fine_cells), FINE_LINE, 0.7, lift=OVER_TOOL + 0.005, share=0.35)
        view.lines(fine[scene3d.rim(fine_cells)], (0.1, 0.1, 0.1), 3.0, lift=OVER_TOOL + 0.012)
        names.append((zone["name"], view.project(fine)))
    figure, axes = style.canvas(*size)
    style.put(axes, view.picture())
    for name, at in names:
        highest = at[np.argmin(at[:, 1])]
        axes.annotate(f"zone {name}", highest[:2], (highest[0] + 45, highest[1] - 62), ha="left", va="center", fontsize=10,
                      arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.8, "shrinkB": 0})
    style.colour_bar(figure, (60, 735, 420, 22), colours, "height over the tool in the zones (mm)")
    style.scale_bar(axes, 1130, 805, 0.1, size[0] / view.camera.width)
    return style.save_png(figure, "spar-zones", [colours])


def shear_angle():
    """The upper ply of the coarse run, coloured by its shear angle."""
    formed = coarse()
    size = (1400, 800)
    view = scene3d.View(size, scene3d.Camera(-66, 40, (0.0, -0.004, 0.047), 0.67))
    show_tool(view, formed)
    shear = np.degrees(formed.at_points(TOP, "shear_angle"))
    colours = ScalarMappable(Normalize(-25, 25), "RdBu_r")
    points, cells = formed.points(TOP), formed.cells(TOP)
    view.surface(points, cells, paint(shear, colours), lift=OVER_TOOL)
    view.lines(scene3d.grid_lines(points, cells), (0.2, 0.2, 0.2), 0.7, lift=OVER_TOOL + 0.002, share=0.25)
    figure, axes = style.canvas(*size)
    style.put(axes, view.picture())
    style.colour_bar(figure, (60, 705, 420, 22), colours, "shear angle (deg)", ticks=[-20, -10, 0, 10, 20])
    style.scale_bar(axes, 1130, 775, 0.1, size[0] / view.camera.width)
    return style.save_png(figure, "shear-angle", [colours])


def forming_stages():
    """The coarse run at the ends of its phases: the upper ply, and the half of the lower film that lies behind."""
    formed = coarse()
    process = json.loads(formed.file["plyflow"].attrs["provenance"])["parameters"]["scene"]["process"]["double_diaphragm"]
    spent = [float(process[k].split()[0]) for k in ("bagging_time", "lowering_time", "drawing_time", "settling_time")]
    ends = np.cumsum(spent)
    stages = [
        (ends[0], "the bag is evacuated"), (ends[1], "the frame is lowered"),
        (ends[1] + 0.75 * spent[2], "the air under the films is drawn off"), (ends[3], "formed"),
    ]
    width, height, gap = 700, 420, 46
    figure, axes = style.canvas(2 * width, 2 * (height + gap) + 40)
    for k, (time, what) in enumerate(stages):
        frame = int(np.argmin(np.abs(formed.times - time)))
        camera = scene3d.Camera(-66, 30, (0.01, 0.0, 0.10), 0.84)
        view = scene3d.View((width, height), camera)
        show_tool(view, formed)
        film, film_cells = formed.points("lower_film", frame), formed.cells("lower_film")
        middles = formed.reference("lower_film")[film_cells].mean(axis=1)
        shown = (middles[:, 1] > 0) & (np.abs(middles[:, 0]) < 0.33) & (middles[:, 1] < 0.30)
        view.surface(film, film_cells[shown], (0.75, 0.87, 0.95), lift=0.0015)
        points, cells = formed.points(TOP, frame), formed.cells(TOP)
        view.surface(points, cells, style.CLOTH, lift=OVER_TOOL)
        view.lines(scene3d.grid_lines(points, cells), COARSE_LINE, 0.7, lift=OVER_TOOL + 0.002, share=0.45)
        view.lines(points[scene3d.rim(cells)], COARSE_LINE, 1.6, lift=OVER_TOOL + 0.004)
        x, y = (k % 2) * width, (k // 2) * (height + gap)
        style.put(axes, view.picture(), x, y + gap)
        axes.text(x + 24, y + 34, f"{formed.times[frame]:.2f} s: {what}", fontsize=10, va="center")
    style.scale_bar(axes, 1180, 2 * (height + gap) + 20, 0.1, width / 0.84)
    return style.save_png(figure, "forming-stages")


def crests(zone: str) -> list[np.ndarray]:
    """Crests of the wrinkles of a zone's upper ply, paths [k][3] in m."""
    found = runs.artifact(demo(), f"crests[{zone}]").attributes["defects"]
    return [np.array(d["ridge"]) for d in found if d["on"] == TOP and d["type"] == "wrinkle"]


def local_wrinkle():
    """The fine shells of the zone with the largest wrinkle: upper ply, height over the tool, crests."""
    compared, name = runs.artifact(demo(), "comparison"), "B"
    body, size = f"local_{name}_{TOP}", (1400, 800)
    view = scene3d.View(size, scene3d.Camera(-58, 38, (-0.118, -0.030, 0.092), 0.262))
    show_tool(view, coarse())
    points, cells = compared.points(body), compared.cells(body)
    colours = ScalarMappable(Normalize(0, 5), HEIGHTS)
    view.surface(points, cells, paint(compared.field(body, "nodal_distance") * MM, colours), lift=0.001)
    view.lines(scene3d.grid_lines(points, cells), FINE_LINE, 0.8, lift=0.0018, share=0.3)
    view.lines(points[scene3d.rim(cells)], FINE_LINE, 2.0, lift=0.002)
    view.lines(crests(name), (0.84, 0.37, 0.0), 5.0, lift=0.004)
    figure, axes = style.canvas(size[0], size[1] + 115)
    style.put(axes, view.picture())
    style.colour_bar(figure, (60, size[1] + 20, 420, 22), colours, "height over the tool (mm)")
    axes.plot([640, 700], [size[1] + 31] * 2, color=RED, linewidth=2.5)
    axes.text(715, size[1] + 31, "crest of a wrinkle", va="center")
    style.scale_bar(axes, 1180, size[1] + 60, 0.02, size[0] / view.camera.width)
    return style.save_png(figure, "local-wrinkle", [colours])


def cross_section():
    """The section through the largest wrinkle that the demo's workflow asks for: plies of the coarse run and of the zone, over the tool."""
    measured = runs.artifact(demo(), "shape")
    cut = next(s for s in measured.attributes["sections"] if "wrinkle" in s["label"])
    sizes = {m["name"]: m["element_size"] * MM for m in runs.artifact(demo(), "comparison").attributes["models"]}
    figure, axes = plt.subplots(figsize=(7, 4.6), layout="constrained")
    for line in cut["lines"]:
        x, z = measured.array(line["x"]) * MM, measured.array(line["y"]) * MM
        if line["label"] == "tool":
            axes.fill_between(x, z, 0, color="#d5d7da", linewidth=0)
            axes.plot(x, z, color=GREY, linewidth=1.0)
            continue
        fine = "zone" in line["label"]
        axes.plot(x, z, color=BLUE if fine else ORANGE, linewidth=1.7, linestyle="-" if fine else (0, (4, 1.5)), label=(
            f"zone: shells of {sizes['local.B']:g} mm" if fine else f"coarse run: membranes of {sizes['global']:g} mm"))
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles))
    axes.legend(once.values(), once.keys(), loc="lower right")
    axes.set(aspect="equal", xlabel="along the section (mm)", ylabel="height over the bed (mm)", xlim=(0, 30), ylim=(95, 114),
             xticks=range(0, 31, 5), yticks=range(95, 115, 5))
    axes.text(25, 105, "tool", ha="center", color="#555555")
    return style.save_svg(figure, "cross-section")


PHASES = (("bagging_time", "bag"), ("lowering_time", "frame lowered"), ("drawing_time", "air drawn"), ("settling_time", ""))


def energy_ledger():
    """Where the work of the coarse run goes."""
    formed = coarse()
    process = json.loads(formed.file["plyflow"].attrs["provenance"])["parameters"]["scene"]["process"]["double_diaphragm"]
    time = formed.array("history/time")
    energy = {name: formed.array(f"history/{name}") for name in
              ("external", "membrane", "friction", "damping", "contact", "hourglass", "kinetic", "drift")}
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 5.2), sharex=True, layout="constrained", height_ratios=(3, 2))
    large = (("external", "work of the pressures", INK, "-"), ("membrane", "strain of plies and films", BLUE, "-"),
             ("friction", "friction", ORANGE, "-"), ("damping", "damping", GREEN, "-"))
    small = (("kinetic", "kinetic", RED, "-"), ("hourglass", "hourglass control", style.PURPLE, "-"),
             ("contact", "in the contacts", style.SKY, "-"), ("drift", "drift (unaccounted)", INK, (0, (3, 1.5))))
    for axes, lines in ((upper, large), (lower, small)):
        for name, label, colour, dashes in lines:
            axes.plot(time, energy[name], color=colour, linestyle=dashes, label=label, linewidth=1.4)
        axes.set(ylabel="energy (J)")
        axes.legend(loc="upper left" if axes is upper else "lower left", frameon=True, facecolor="white", edgecolor="none", framealpha=1)
        start = 0.0
        for key, label in PHASES:
            end = start + float(process[key].split()[0])
            axes.axvline(end, color=GREY, linewidth=0.6, linestyle=(0, (2, 2)))
            if axes is upper:
                axes.text((start + end) / 2, 1.02, label, transform=axes.get_xaxis_transform(), ha="center", va="bottom", fontsize=8)
            start = end
    lower.set(xlabel="time (s)", xlim=(0, time[-1]))
    return style.save_svg(figure, "energy-ledger")


def kinematic():
    """Shear of the upper ply by geometry alone and by the coarse run."""
    width, height = 700, 400
    figure, axes = style.canvas(2 * width, height + 180)
    colours = ScalarMappable(Normalize(-40, 40), "RdBu_r")
    for k, (step, what) in enumerate((("drape", "kinematic drape"), ("coarse", "explicit run, membranes"))):
        formed = runs.artifact(demo(), step)
        view = scene3d.View((width, height), scene3d.Camera(-66, 42, (0.0, -0.004, 0.047), 0.67))
        show_tool(view, formed)
        points, cells = formed.points(TOP), formed.cells(TOP)
        view.surface(points, cells, paint(np.degrees(formed.at_points(TOP, "shear_angle")), colours), lift=OVER_TOOL)
        view.lines(scene3d.grid_lines(points, cells), (0.2, 0.2, 0.2), 0.6, lift=OVER_TOOL + 0.002, share=0.25)
        style.put(axes, view.picture(), k * width, 45)
        axes.text(k * width + 30, 34, what, fontsize=10, va="center")
    style.colour_bar(figure, (60, height + 75, 420, 22), colours, "shear angle (deg)", ticks=[-40, -20, 0, 20, 40])
    style.scale_bar(axes, 1220, height + 110, 0.1, width / 0.67)
    return style.save_png(figure, "kinematic", [colours])


def dimension(axes, start, end, text: str, aside=(0, 0), gap: float = 0):
    """A dimension line between two pixels, moved aside, with its text in it, or `gap` pixels beside its end."""
    (x0, y0), (x1, y1) = np.add(start, aside), np.add(end, aside)
    for at, to in ((start, (x0, y0)), (end, (x1, y1))):
        axes.plot([at[0], to[0]], [at[1], to[1]], color=GREY, linewidth=0.6)
    axes.annotate("", (x1, y1), (x0, y0), annotation_clip=False,
                  arrowprops={"arrowstyle": "<|-|>", "color": INK, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 6})
    upright = abs(x1 - x0) < abs(y1 - y0)
    if gap:
        axes.text(max(x0, x1) + gap, (y0 + y1) / 2, text, ha="left", va="center", fontsize=8)
    else:
        axes.text((x0 + x1) / 2, (y0 + y1) / 2, text, ha="center", va="center", rotation=90 if upright else 0, fontsize=8,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})


def note(axes, at, text: str, to):
    """A text with a thin line to a pixel."""
    axes.annotate(text, at, to, ha="center", va="center", fontsize=8,
                  arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.7, "shrinkA": 1, "shrinkB": 0})


def tool_spar():
    """The tool from above, from the side and in section, at one scale, with the dimensions of the scene in mm."""
    formed = coarse()
    tool = json.loads(formed.file["plyflow"].attrs["provenance"])["parameters"]["scene"]["tool"]["joggle_spar"]
    mm = lambda text: float(text.split()[0]) * MM
    degrees = lambda text: np.degrees(float(text.split()[0]))
    points, cells = formed.points("tool"), formed.cells("tool")
    scale, size = 1.45, (1400, 800)  # pixels for each mm
    figure, axes = style.canvas(*size)
    views = {}
    for name, elevation, box, middle, y in (("plan", 90, (960, 280), 0.0, 105), ("side", 0, (960, 190), 0.06, 570)):
        view = scene3d.View(box, scene3d.Camera(-90, elevation, (0, 0, middle), box[0] / scale / MM))
        view.surface(points, cells, style.TOOL)
        style.put(axes, view.picture(), 30, y)
        views[name] = lambda x, across, v=view, y=y, plan=elevation == 90: v.project(
            [[x / MM, across / MM if plan else 0, 0.12 if plan else across / MM]])[0, :2] + (30, y)
    plan, side = views["plan"], views["side"]
    length, height = mm(tool["length"]), mm(tool["height"])
    axes.text(30, 34, "From above (mm)", fontsize=9.5, fontweight="bold")
    axes.text(30, 482, "From the side", fontsize=9.5, fontweight="bold")
    axes.text(1050, 482, "Sections", fontsize=9.5, fontweight="bold")
    dimension(axes, plan(-length / 2, -93), plan(length / 2, -93), f"{length:g}", (0, 48))
    note(axes, plan(-length / 2 + 12, 68), f"R {mm(tool['corner']):g}", plan(-length / 2 + 14, 108))
    top = height
    for joggle in tool["joggles"]:
        start, long, rise = (mm(joggle[key]) for key in ("start", "length", "rise"))
        slope = np.tan(np.radians(degrees(joggle["skew"])))
        at = lambda y, s=start, t=slope: plan(s + y * t, y)
        axes.plot(*np.transpose([at(-62), at(62)]), color=INK, linewidth=0.9)
        axes.plot(*np.transpose([plan(start, -62), plan(start, 62)]), color=INK, linewidth=0.7, linestyle=(0, (5, 4)))
        note(axes, at(58), f"slant {degrees(joggle['skew']):.0f}°", plan(start + 12, 110))
        dimension(axes, plan(0, 0), plan(start, 0), f"{abs(start):g}")
        outwards = [mm(s) for s in joggle["side_step"]]
        wall = 0 if outwards[0] else 1
        foot = -84 if wall == 0 else 84
        note(axes, plan(start + slope * foot + long / 2, foot), f"wall steps out by {max(outwards):g}",
             plan(start + slope * foot + (-80 if wall == 0 else 118), -103 if wall == 0 else 112))
        crown = max(top, top + rise)
        ends = (side(start - 62 * slope, crown), side(start - 62 * slope + long, crown))
        dimension(axes, *ends, f"{long:g}", (0, -26))
        top += rise
    axes.plot(*np.transpose([plan(0, -98), plan(0, 98)]), color=INK, linewidth=0.7, linestyle=(0, (8, 3, 1, 3)))
    dimension(axes, side(-length / 2 + 60, 0), side(-length / 2 + 60, height), f"{height:g}")
    raised = height + mm(tool["joggles"][0]["rise"])
    dimension(axes, side(-40, 0), side(-40, raised), f"{raised:g}")
    sections_of_tool(axes, tool, points, cells, scale)
    return style.save_png(figure, "tool-spar")


def sections_of_tool(axes, tool: dict, points, cells, scale: float):
    """Sections on both sides of the first joggle, over each other, on the bed."""
    mm = lambda text: float(text.split()[0]) * MM
    place = lambda y, z: (1195 + scale * y, 752 - scale * z)
    for x, colour, label, row in ((-0.2, BLUE, "x = −200", 0), (0.0, ORANGE, "x = 0", 1)):
        for segment in scene3d.section(points, cells, x):
            if segment[:, 1].max() > 1e-6:
                axes.plot(*np.transpose([place(y * MM, z * MM) for y, z in segment]), color=colour, linewidth=1.5, solid_capstyle="round")
        axes.text(1195, 622 + 32 * row, label, color=colour, ha="center", fontsize=8.5)
    axes.plot([1040, 1360], [752, 752], color=GREY, linewidth=0.8)
    wide, height = mm(tool["top_width"]), mm(tool["height"])
    dimension(axes, place(-wide / 2, height), place(wide / 2, height), f"{wide:g}", (0, -52))
    draft = np.degrees(float(tool["draft"].split()[0]))
    axes.text(*place(0, 12), f"draft {draft:.0f}°\nfillets R {mm(tool['fillet']):g}", ha="center", va="bottom", fontsize=8, linespacing=1.3)
