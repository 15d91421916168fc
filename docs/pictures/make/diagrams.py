"""Pictures without a forming result: the record's table, the section of the bag, the steps of the demo, the floors of the code."""

import csv
import itertools
import json
import re
import subprocess

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

import runs
import scene3d
import spar
import style
from style import BLUE, GREEN, GREY, INK, MM, ORANGE, RED, SKY


def table(name: str) -> list[dict]:
    lines = (runs.PICTURES / "data" / name).read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def speed_error():
    """What each way to model the spar saves, and how wrong it is."""
    rows = table("speed-error.csv")
    figure, panels = plt.subplots(1, 2, figsize=(7, 4.9), sharex=True)
    figure.subplots_adjust(left=0.085, right=0.985, top=0.97, bottom=0.43, wspace=0.22)
    for axes, column, what, bound in zip(panels, ("length error [%]", "area error [%]"),
                                         ("error of wrinkle lengths (%)", "error of bridging areas (%)"), (7.2, 6.4)):
        axes.axhspan(0, bound, color="#eef5ee", zorder=0)
        axes.axvline(87, color=GREEN, linewidth=1, linestyle=(0, (4, 2)))
        axes.axhline(bound, color=GREEN, linewidth=1, linestyle=(0, (4, 2)))
        numbers = {}
        for k, row in enumerate(rows, 1):
            x, y, misses = float(row["saved [%]"]), float(row[column]), int(row["misses"])
            axes.plot(x, y, "o", markersize=5.5, color=RED if misses else BLUE, markerfacecolor="white" if misses else BLUE)
            numbers.setdefault((x, y), []).append(str(k))
        for at, those in numbers.items():
            label = ", ".join(those)
            axes.annotate(label, at, AWAY.get((column[0], label), (6, 3)), textcoords="offset points", fontsize=8)
        axes.set(xlabel="CPU time saved (%)", ylabel=what, xlim=(53, 89), ylim=(0, None))
    half = (len(rows) + 1) // 2
    for k, row in enumerate(rows):
        figure.text(0.06 + 0.48 * (k // half), 0.30 - 0.042 * (k % half), f"{k + 1}  {row['way']}", fontsize=8)
    marks = [plt.Line2D([], [], marker="o", linestyle="none", color=BLUE, label="finds every wrinkle and place of bridging"),
             plt.Line2D([], [], marker="o", linestyle="none", color=RED, markerfacecolor="white", label="misses or invents some"),
             plt.Line2D([], [], color=GREEN, linewidth=1, linestyle=(0, (4, 2)), label="bound")]
    figure.legend(handles=marks, loc="lower center", ncols=3, fontsize=8, handletextpad=0.4, columnspacing=1.4)
    return style.save_svg(figure, "speed-error")


# Places of numbers that would lie on each other, by the first letter of the column.
AWAY = {("l", "1"): (-12, -3), ("l", "2, 4"): (-13, -15), ("l", "6"): (6, -9), ("l", "7"): (4, 6), ("l", "9"): (6, 1), ("l", "11"): (7, -6),
        ("a", "2"): (-13, -5), ("a", "1"): (-13, -2), ("a", "8"): (7, -7)}


def along(y: np.ndarray, z: np.ndarray, away: float) -> tuple[np.ndarray, np.ndarray]:
    """A curve moved to its left side by a distance."""
    tangent = np.stack([np.gradient(y), np.gradient(z)])
    tangent /= np.linalg.norm(tangent, axis=0)
    return y - away * tangent[1], z + away * tangent[0]


def half_section(formed: runs.Artifact, body: str, frame: int, x: float) -> np.ndarray:
    """The section of a sheet at x from its middle outwards, [k][2] of (y, z) in mm."""
    cut = scene3d.section(formed.points(body, frame), scene3d.triangles(formed.cells(body)), x).reshape(-1, 2) * MM
    cut = cut[np.argsort(cut[:, 0])]
    return cut[cut[:, 0] >= -40]


def bag_layers():
    """Half a section of the demo's coarse run while the air is drawn: shapes to scale, sheets far too thick and too far apart."""
    formed = spar.coarse()
    frame, x = int(np.argmin(np.abs(formed.times - 0.64))), 0.0
    film = half_section(formed, "lower_film", frame, x)
    ply = half_section(formed, "ply_1", frame, x)[:, 0].max()
    # Evenly along the curve, so that it can be moved aside smoothly.
    way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(film, axis=0).T))])
    even = np.arange(0, way[-1], 2.0)
    y, z = (np.interp(even, way, film[:, k]) for k in (0, 1))
    smooth = lambda v: np.convolve(np.pad(v, 6, mode="edge"), np.ones(13) / 13, mode="valid")
    y, z = smooth(y), smooth(z)
    figure, axes = plt.subplots(figsize=(7, 3.7), layout="constrained")
    tool = scene3d.section(formed.points("tool"), formed.cells("tool"), x) * MM
    outline = tool.reshape(-1, 2)
    outline = outline[(outline[:, 0] >= 0) & (outline[:, 1] > 0.1)]
    # From the top outwards and down the wall.
    outline = outline[np.argsort(outline[:, 0] - outline[:, 1])]
    axes.fill([0, *outline[:, 0], outline[-1, 0], 0], [outline[0, 1], *outline[:, 1], 0, 0], color="#c9ccd1", linewidth=0)
    axes.axhline(0, color=INK, linewidth=2.2)
    in_plies = y <= ply
    reach = np.clip((ply + 22 - y) / 22, 0, 1)
    gap = 3.6
    lower, upper = along(y, z, 3), along(y, z, 3 + 1.0 + (3 * gap - 1.0) * (3 * reach**2 - 2 * reach**3))
    axes.plot(*lower, color=SKY, linewidth=2.2)
    for k, colour in ((1, ORANGE), (2, "#b97a00")):
        axes.plot(*(v[in_plies] for v in along(y, z, 3 + k * gap)), color=colour, linewidth=3, solid_capstyle="butt")
    axes.plot(*upper, color=BLUE, linewidth=2.2)
    name_parts(axes, y, z, upper)
    axes.set(aspect="equal", xlim=(0, 330), ylim=(-20, 172), xlabel="y from the middle (mm)", ylabel="z over the bed (mm)")
    axes.grid(False)
    return style.save_svg(figure, "bag-layers")


def name_parts(axes, y, z, upper):
    """Names of the sheets and rooms, and the pressures on them."""
    height = lambda place: float(np.interp(place, y, z))
    text = dict(fontsize=8.5, va="center")
    line = dict(arrowstyle="-", color=GREY, linewidth=0.7, shrinkA=1, shrinkB=0)
    aside = dict(line, relpos=(0, 0.5))
    # Names stand in the order of the sheets, so that their lines do not cross.
    for k, (label, colour) in enumerate((("lower film", "#2a86bd"), ("ply 1", "#c98a00"), ("ply 2", "#8a5a00"), ("upper film", BLUE))):
        at = along(y, z, 3 + 3.6 * k)
        place = int(np.argmin(np.abs(y - 98)))
        axes.annotate(label, (at[0][place], at[1][place]), (160, 116 + 13 * k), color=colour, arrowprops=aside, **text)
    axes.text(36, 60, "tool", ha="center", color="#444444", **text)
    axes.text(300, -10, "bed", ha="center", **text)
    axes.text(4, -11, "sheets are drawn far too thick", fontsize=7.5, color=GREY, va="center")
    axes.text(125, 22, "cavity", ha="center", **text)
    axes.annotate("films joined to one sheet,\nheld by the frame at y = 750 mm", (296, height(296) + 5), (262, 92), ha="center", arrowprops=line, **text)
    force = dict(arrowstyle="-|>", color=RED, linewidth=1.3, mutation_scale=9, shrinkA=0, shrinkB=0)
    for place, below in ((30, False), (195, True), (225, True)):
        top = float(np.interp(place, upper[0], upper[1]))
        lean = 0 if place < 50 else 9
        axes.annotate("", (place, top + 2), (place + lean, top + 25), arrowprops=force)
        if below:
            axes.annotate("", (place, top - 5), (place - lean, top - 28), arrowprops=force)
    axes.text(40, 158, "$p_b$", color=RED, ha="center", **text)
    axes.text(219, float(np.interp(219, *upper)) + 22, "$p_b$", color=RED, ha="center", **text)
    axes.text(203, float(np.interp(203, *upper)) - 22, "$p_c$", color=RED, ha="center", **text)


def box(axes, x, y, width, height, text: str, face: str, bold: str = ""):
    axes.add_patch(FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0,rounding_size=0.06", facecolor=face, edgecolor=GREY, linewidth=0.8))
    if bold:
        axes.text(x + width / 2, y + height * 0.64, bold, ha="center", va="center", fontsize=8.5, fontweight="bold")
        axes.text(x + width / 2, y + height * 0.30, text, ha="center", va="center", fontsize=6.6)
    else:
        axes.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=7.5)


def blank(width: float, height: float):
    figure = plt.figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    return figure, axes


# Column and row of the demo's steps.
PLACES = {"coarse": (0, 1), "defects": (1, 1), "zones": (2, 1), "boundary": (3, 1), "local": (4, 1), "comparison": (5, 1),
          "shape": (4, 0), "drape": (5, 0)}
# Connections that pass over other steps: where they leave and arrive (share of the box's width), and how far they are bent.
BENDS = {("coarse", "boundary"): (0.65, 0.5, -0.32), ("coarse", "comparison"): (0.35, 0.5, -0.27), ("zones", "comparison"): (0.6, 0.25, 0.24)}


def workflow_graph():
    """Steps of the demo and what each one reads, from `plyflow graph`."""
    file = runs.ROOT / "workflows" / "joggle-spar" / "workflow.yaml"
    dot = runs.plyflow("graph", str(file), "--store", str(runs.STORE / "graph"))
    steps = {name: label.split("\\n") for name, label in re.findall(r'^  "(\w+)" \[label="([^"]*)"\];', dot, re.M)}
    edges = re.findall(r'^  "(\w+)" -> "(\w+)" \[label', dot, re.M)
    unknown = set(steps) - set(PLACES)
    if unknown:
        raise SystemExit(f"make-pictures: the demo has the steps {sorted(unknown)}, which have no place in workflow_graph")
    figure, axes = blank(7, 2.75)
    width, height = 0.99, 0.52
    corner = lambda step: (0.06 + 1.172 * PLACES[step][0], 0.30 + 0.98 * PLACES[step][1])
    for source, target in edges:
        (x0, y0), (x1, y1) = corner(source), corner(target)
        leave, arrive, bend = BENDS.get((source, target), (0.5, 0.5, 0.0))
        if bend < 0:
            start, end = (x0 + width * leave, y0 + height), (x1 + width * arrive, y1 + height + (0.05 if " x N" in steps[target][0] else 0))
        elif bend > 0:
            start, end = (x0 + width * leave, y0), (x1 + width * arrive, y1)
        elif x0 == x1:
            start, end = (x0 + width / 2, max(y0, y1) if y0 > y1 else y0 + height), (x1 + width / 2, y1 + height if y0 > y1 else y1)
        elif y0 == y1:
            start, end = (x0 + width, y0 + height / 2), (x1, y1 + height / 2)
        else:
            start, end, bend = (x0 + width / 2, y0), (x1, y1 + height / 2), 0.12
        axes.add_patch(FancyArrowPatch(start, end, connectionstyle=f"arc3,rad={bend}", arrowstyle="-|>", mutation_scale=8, linewidth=1.0,
                                       color=INK, shrinkA=0, shrinkB=0))
    for step, (title, plugin) in steps.items():
        repeated = " x N" in title
        x, y = corner(step)
        if repeated:
            box(axes, x + 0.05, y + 0.05, width, height, "", "#fbe9c8")
        box(axes, x, y, width, height, plugin.replace("interpolation", "interp."), "#fbe9c8" if repeated else "#dcebf7", bold=step)
    axes.text(0.06, 0.12, "Blue: runs once. Yellow: runs once for each zone. An arrow leads to the step that reads.", fontsize=7.5, va="center")
    return style.save_svg(figure, "workflow-graph")


FLOORS = {"schemas": 1, "orchestrator": 2, "solver-plugins/door": 2, "solver-plugins/lib": 3, "solver-plugins/components": 4, "solver-plugins/steps": 4}


def crates() -> dict[str, tuple[str, str, set[str]]]:
    """Crates by name: the group and the folder in it, and the crates of this workspace that they use when built."""
    told = json.loads(subprocess.check_output(["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"], cwd=runs.ROOT))
    found = {}
    for package in told["packages"]:
        folder = str(runs.pathlib.Path(package["manifest_path"]).parent.relative_to(runs.ROOT))
        group = next((g for g in FLOORS if folder == g or folder.startswith(g + "/")), None)
        if group:
            uses = {d["name"] for d in package["dependencies"] if d.get("path") and d["kind"] is None}
            found[package["name"]] = (group, folder.removeprefix(group).strip("/") or group, uses)
    return found


def floors():
    """The floors of the code with the crates on them, and which group uses which."""
    found = crates()
    members = {g: sorted(folder for group, folder, _ in found.values() if group == g) for g in FLOORS}
    for group, mark in (("solver-plugins/steps", "/"), ("solver-plugins/components", "-")):
        kinds = itertools.groupby(members[group], lambda f, mark=mark: f.split(mark)[0])
        members[group] = [f"{kind} ({len(list(those))})" for kind, those in kinds]
    uses = {(group, found[name][0]) for group, _, names in found.values() for name in names if name in found and found[name][0] != group}
    figure, axes = blank(7, 4.7)
    places = {"solver-plugins/components": (0.62, 2.75), "solver-plugins/steps": (3.6, 3.25), "solver-plugins/lib": (1.4, 4.8),
              "orchestrator": (0.62, 1.85), "solver-plugins/door": (2.7, 4.15), "schemas": (0.62, 6.23)}
    colours = {1: "#e9e9e9", 2: "#dcebf7", 3: "#e0f0e6", 4: "#fbe9c8"}
    height, at = 0.72, lambda group: 0.15 + 1.17 * (FLOORS[group] - 1)
    for group, (x, width) in places.items():
        y = at(group)
        axes.add_patch(FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0,rounding_size=0.05", facecolor=colours[FLOORS[group]],
                                      edgecolor=GREY, linewidth=0.8, zorder=3))
        axes.text(x + width / 2, y + height - 0.17, group, ha="center", va="center", fontsize=8.5, fontweight="bold", zorder=4)
        axes.text(x + width / 2, y + 0.27, wrapped(members[group], int(width / 0.062)), ha="center", va="center", fontsize=7, linespacing=1.25, zorder=4)
    for source, target in sorted(uses):
        up = FLOORS[target] > FLOORS[source]
        x = LANES[source, target]
        ends = (at(source) + height, at(target)) if up else (at(source), at(target) + height)
        axes.add_patch(FancyArrowPatch((x, ends[0]), (x, ends[1]), arrowstyle="-|>", mutation_scale=9, linewidth=1.2, color=RED if up else INK,
                                       shrinkA=0, shrinkB=0, zorder=1))
        if up:
            axes.text(x + 0.06, sum(ends) / 2, "against the order", fontsize=7, color=RED, va="center")
    for floor in range(1, 5):
        axes.text(0.28, 0.15 + 1.17 * (floor - 1) + height / 2, str(floor), fontsize=14, color=GREY, ha="center", va="center", fontweight="bold")
    axes.text(0.62, 4.56, "An arrow leads to what is used; some pass behind a floor.", fontsize=7.5, va="center")
    return style.save_svg(figure, "floors")


def wrapped(words: list[str], width: int) -> str:
    lines = [""]
    for word in words:
        joined = f"{lines[-1]}, {word}" if lines[-1] else word
        if len(joined) > width:
            lines[-1] += ","
            lines.append(word)
        else:
            lines[-1] = joined
    return "\n".join(lines)


# Where the arrows stand: x in inches. Another pair of groups that use each other is an error, and worth a thought.
LANES = {
    ("solver-plugins/components", "solver-plugins/lib"): 2.0, ("solver-plugins/components", "solver-plugins/door"): 3.0,
    ("solver-plugins/steps", "solver-plugins/lib"): 4.1, ("solver-plugins/steps", "solver-plugins/door"): 4.7,
    ("solver-plugins/steps", "schemas"): 6.0, ("solver-plugins/components", "schemas"): 1.2,
    ("solver-plugins/lib", "solver-plugins/door"): 4.1, ("solver-plugins/lib", "schemas"): 3.4,
    ("orchestrator", "schemas"): 1.55, ("solver-plugins/door", "schemas"): 4.7, ("solver-plugins/door", "solver-plugins/lib"): 5.05,
}
