"""Runs workflows with Plyflow and reads their artifacts.

Workflows are copied into the store first, so that no report and no store lands in the repository's `workflows/`.
"""

import functools
import json
import os
import pathlib
import shutil
import subprocess

import h5py
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[3]
PICTURES = ROOT / "docs" / "pictures"
PLYFLOW = os.environ.get("PLYFLOW") or str(ROOT / "target" / "release" / "plyflow")
STORE = pathlib.Path(os.environ.get("PICTURE_STORE") or PICTURES / ".store").resolve()

# Appended to the steps of the demo: the comparison tells how long the crests of the zones are, this tells where they run.
CRESTS = """\
  crests:
    plugin: defect-measurement
    for_each: {zone: zones}
    from: {formed: local}
"""
# The study of the guide has too few points for a map.
MORE_POINTS = (("by: 45 deg", "by: 15 deg"), ("size: [80 mm, 96 mm]", "size: [64 mm, 72 mm, 80 mm, 88 mm, 96 mm]"))


@functools.cache
def workflows() -> pathlib.Path:
    """The copy of the repository's workflows in the store."""
    copy = STORE / "workflows"
    if copy.exists():
        shutil.rmtree(copy)
    shutil.copytree(ROOT / "workflows", copy, ignore=shutil.ignore_patterns(".plyflow", "*report*.html"))
    demo = copy / "joggle-spar" / "workflow.yaml"
    text = demo.read_text()
    if text.count("\nexpect:") != 1:
        raise SystemExit(f"make-pictures: {demo} has no `expect:` before which a step can be put")
    (demo.parent / "with-crests.yaml").write_text(text.replace("\nexpect:", f"{CRESTS}\nexpect:"))
    angles = copy / "kinematic" / "workflow-angles.yaml"
    text = angles.read_text()
    for few, more in MORE_POINTS:
        if text.count(few) != 1:
            raise SystemExit(f"make-pictures: {angles} has no `{few}`")
        text = text.replace(few, more)
    (angles.parent / "angles-with-map.yaml").write_text(text)
    return copy


def plyflow(*arguments: str) -> str:
    """Standard output of Plyflow."""
    result = subprocess.run([PLYFLOW, *arguments], stdout=subprocess.PIPE, text=True)
    if result.returncode != 0:
        raise SystemExit(f"make-pictures: plyflow {' '.join(arguments)} ended with code {result.returncode}")
    return result.stdout


@functools.cache
def run(name: str, *until: str) -> tuple[str, ...]:
    """Runs a workflow, such as `joggle-spar/workflow`, up to some steps; the arguments that find its results."""
    file = workflows() / f"{name}.yaml"
    place = (str(file), "--store", str(STORE / name))
    steps = [word for step in until for word in ("--until", step)]
    plyflow("run", *place, *steps, "--no-report", "--quiet")
    return place


class Artifact:
    """What a step made, see schemas/data-model.md."""

    def __init__(self, path: str):
        self.file = h5py.File(path)
        about = self.file["plyflow"].attrs
        self.attributes = json.loads(about["attributes"])
        self.bodies = {b["name"]: b for b in json.loads(about["contents"])["bodies"]}
        self.times = self.file["plyflow/times"][:] if "times" in self.file["plyflow"] else None

    def array(self, path: str) -> np.ndarray:
        return self.file["data"][path][:]

    def points(self, body: str, frame: int = -1) -> np.ndarray:
        """Points [n][3] of a body in a frame, in m."""
        n = self.bodies[body]["points"]
        points = self.file[f"VTKHDF/{body}/Points"]
        frame %= len(points) // n
        return points[frame * n : (frame + 1) * n]

    def reference(self, body: str) -> np.ndarray:
        """Undeformed points [n][3] of a body that moves, in m."""
        return self.file[f"plyflow/reference/{body}"][:]

    def cells(self, body: str) -> np.ndarray:
        """Nodes of the cells, [m][3] or [m][4]."""
        return self.file[f"VTKHDF/{body}/Connectivity"][:].reshape(-1, self.bodies[body]["nodes_per_cell"])

    def field(self, body: str, name: str, frame: int = -1) -> np.ndarray:
        """A field of a body in a frame, on points or on cells, in SI units."""
        about = next(f for f in self.bodies[body]["fields"] if f["name"] == name)
        on_points = about["on"] == "points"
        n = self.bodies[body]["points" if on_points else "cells"]
        values = self.file[f"VTKHDF/{body}/{'PointData' if on_points else 'CellData'}/{name}"]
        frame %= len(values) // n
        return values[frame * n : (frame + 1) * n].astype(float)

    def at_points(self, body: str, name: str, frame: int = -1) -> np.ndarray:
        """A field of cells, averaged at the points."""
        cells, values = self.cells(body), self.field(body, name, frame)
        n, width = self.bodies[body]["points"], self.cells(body).shape[1]
        nodes = cells.ravel()
        return np.bincount(nodes, np.repeat(values, width), n) / np.maximum(np.bincount(nodes, minlength=n), 1)


@functools.cache
def artifact(place: tuple[str, ...], step: str) -> Artifact:
    """The artifact of a step, or of one of its items such as `local[A]`."""
    file, *store = place
    return Artifact(json.loads(plyflow("inspect", step, "--workflow", file, *store, "--format", "json"))["path"])
