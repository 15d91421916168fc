"""The surface of a STEP file as triangles in metres, meshed by gmsh."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np

try:
    import gmsh
except OSError as error:
    raise ImportError(
        f"gmsh is installed and cannot be loaded: {error}. It needs libraries of a desktop, although it opens no window; on Debian: apt-get install "
        "libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1 libxfixes3 libxext6 libgomp1"
    ) from None

MILLIMETRE = 1e-3


class StepFileError(ValueError):
    """A file that gives no tool: says what is wrong and what to do."""


@dataclass(frozen=True)
class Surface:
    """Triangles of a tool, counter-clockwise seen from outside."""

    points: np.ndarray
    """`[n][3]` (m)."""
    triangles: np.ndarray
    """`[m][3]`, indices into `points`."""
    unit: float
    """One unit of the file (m)."""
    solids: int
    """How many solids they are the skin of; 0 where the file has faces alone."""
    faces: int
    """How many faces of the file they are of."""
    chord_error: float
    """How far (m) the middle of a triangle or of a side lies off the file's surface at most."""
    shortest_edge: float
    """(m)."""
    smallest_height: float
    """Least height of a triangle (m)."""
    notes: List[str] = field(default_factory=list)
    """What the user should know."""


def read(path: Path, size: float, *, per_turn: int = 24, solids: Optional[Sequence[int]] = None) -> Surface:
    """Reads and meshes a STEP file.

    `size`: longest side of a triangle (m), about. `per_turn`: how many triangles a full turn of a round face has at least. `solids`: which solids of the
    file count, by their number from 1; left out, all. Solids that touch become one.

    Raises StepFileError.
    """
    if not (size > 0.0 and math.isfinite(size)):
        raise StepFileError(f"size is {size} m; expected more than 0 m")
    if per_turn < 4:
        raise StepFileError(f"per_turn is {per_turn}; expected 4 or more")
    unit = _unit(path)
    gmsh.initialize(interruptible=False)
    try:
        for name, value in (
            ("General.Terminal", 0),
            ("General.AbortOnError", 0),
            # One thread and one seed, so that the same file gives the same bytes.
            ("General.NumThreads", 1),
            ("Mesh.RandomSeed", 1),
            ("Mesh.Algorithm", 6),
            ("Mesh.ElementOrder", 1),
            ("Mesh.MeshSizeMax", size / MILLIMETRE),
            ("Mesh.MeshSizeFromCurvature", per_turn),
            ("Mesh.MeshSizeExtendFromBoundary", 1),
            ("Geometry.OCCSewFaces", 0),
        ):
            gmsh.option.setNumber(name, value)
        # Millimetres inside, whatever the file's unit: what is the same place is told by 1e-7 of these.
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        return _meshed(path, unit, solids)
    finally:
        gmsh.finalize()


_LENGTH = re.compile(r"#\d+\s*=\s*\(([^;]*?\bLENGTH_UNIT\b[^;]*?)\)\s*;", re.S)
_SI = re.compile(r"SI_UNIT\s*\(\s*(\.\w+\.|\$)\s*,\s*\.METRE\.\s*\)")
_NAMED = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'")
_PREFIX = {"$": 1.0, ".MILLI.": 1e-3, ".CENTI.": 1e-2, ".DECI.": 0.1, ".KILO.": 1e3, ".MICRO.": 1e-6}
_NAMES = {"INCH": 0.0254, "INCHES": 0.0254, "IN": 0.0254, "FOOT": 0.3048, "FEET": 0.3048, "FT": 0.3048, "MIL": 2.54e-5, "YARD": 0.9144}


def _unit(path: Path) -> float:
    """What the file says its lengths are in (m)."""
    try:
        with open(path, "rb") as file:
            text = file.read().decode("latin-1")
    except FileNotFoundError:
        raise StepFileError(f"{path}: there is no such file; expected a STEP file") from None
    except OSError as error:
        raise StepFileError(f"{path}: cannot be read: {error.strerror}") from None
    if not text.lstrip().startswith("ISO-10303-21"):
        raise StepFileError(f"{path}: this is no STEP file, which begins with ISO-10303-21; export the part as STEP (AP203, AP214 or AP242)")
    if "END-ISO-10303-21" not in text:
        raise StepFileError(f"{path}: the file ends before END-ISO-10303-21; it was cut off: copy or export it again")
    found = set()
    for statement in _LENGTH.findall(text):
        named, si = _NAMED.search(statement), _SI.search(statement)
        if named:
            name = named.group(1).strip().upper()
            if name not in _NAMES:
                raise StepFileError(f"{path}: its lengths are in {named.group(1)!r}, which is not known; expected one of mm, cm, m, inch or foot: export it in mm")
            found.add(_NAMES[name])
        elif si and si.group(1) in _PREFIX:
            found.add(_PREFIX[si.group(1)])
    # The metre or millimetre by which an inch is explained is a unit too, of nothing.
    imperial = found & set(_NAMES.values())
    if imperial:
        found = imperial
    if not found:
        raise StepFileError(f"{path}: the file does not say what its lengths are in (LENGTH_UNIT); export it again, in mm")
    if len(found) > 1:
        units = ", ".join(f"{unit:g} m" for unit in sorted(found))
        raise StepFileError(f"{path}: its parts have lengths in different units ({units}); export it again in one")
    return found.pop()


def _meshed(path: Path, unit: float, wanted: Optional[Sequence[int]]) -> Surface:
    occ = gmsh.model.occ
    try:
        occ.importShapes(str(path), highestDimOnly=True)
        occ.synchronize()
    except Exception as error:
        raise StepFileError(f"{path}: gmsh cannot read it: {_said(error)}; export it again, or check it in the CAD program") from None
    notes: List[str] = []
    solids = gmsh.model.getEntities(3)
    if not solids and gmsh.model.getEntities(2):
        # Faces that close are a solid that the file does not call one.
        occ.healShapes(sewFaces=True, makeSolids=True)
        occ.synchronize()
        solids = gmsh.model.getEntities(3)
        if solids:
            notes.append(f"{path.name}: it has faces and no solid; they close, and were sewn to {_count(len(solids), 'solid')}")
    if not gmsh.model.getEntities(2):
        raise StepFileError(f"{path}: it holds no face; expected a solid, or the faces of a tool")
    solids = _wanted(path, solids, wanted)
    if len(solids) > 1:
        try:
            solids, _ = occ.fuse(solids[:1], solids[1:])
            occ.synchronize()
        except Exception as error:
            raise StepFileError(f"{path}: its solids cannot be made one: {_said(error)}; unite them in the CAD program, or name some by `solids`") from None
        solids = [s for s in solids if s[0] == 3]
    faces = sorted({abs(tag) for _, tag in gmsh.model.getBoundary(solids, combined=False)} if solids else {tag for _, tag in gmsh.model.getEntities(2)})
    try:
        gmsh.model.mesh.generate(2)
    except Exception as error:
        raise StepFileError(f"{path}: gmsh cannot mesh it: {_said(error)}; take another `size`, or repair the part in the CAD program") from None
    points, triangles, chord = _triangles(path, faces)
    triangles, skins = _outwards(points, triangles)
    if solids and skins > len(solids):
        raise StepFileError(f"{path}: {_count(len(solids), 'solid')} with {skins} skins: a cavity lies inside of one; fill it in the CAD program, as no sheet gets there")
    if not solids:
        notes.append(f"{path.name}: it has faces and no solid; their outside was taken to be that away from the middle of their foot")
    edges, heights = _measures(points, triangles)
    return Surface(
        points * MILLIMETRE, triangles, unit, len(solids), len(faces), chord * MILLIMETRE, float(edges.min()) * MILLIMETRE, float(heights.min()) * MILLIMETRE, notes
    )


def _said(error: Exception) -> str:
    text = str(error).strip() or gmsh.logger.getLastError().strip()
    return text.splitlines()[0] if text else type(error).__name__


def _count(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")


def _wanted(path: Path, solids: List[Tuple[int, int]], wanted: Optional[Sequence[int]]) -> List[Tuple[int, int]]:
    if wanted is None:
        return solids
    chosen = []
    for number in wanted:
        if not 1 <= number <= len(solids):
            raise StepFileError(f"{path}: `solids` names number {number}; the file has {_count(len(solids), 'solid')}, counted from 1")
        chosen.append(solids[number - 1])
    rest = [s for s in solids if s not in chosen]
    if rest:
        gmsh.model.occ.remove(rest, recursive=True)
        gmsh.model.occ.synchronize()
    return chosen


def _triangles(path: Path, faces: List[int]) -> Tuple[np.ndarray, np.ndarray, float]:
    """Points (mm), triangles, and how far these lie off their faces (mm)."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1 if len(tags) else 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)
    parts, chord = [], 0.0
    for face in faces:
        _, nodes = gmsh.model.mesh.getElementsByType(2, tag=face)
        if len(nodes) == 0:
            raise StepFileError(f"{path}: gmsh made no triangle on face {face}; take a smaller `size`, or repair the face in the CAD program")
        cells = place[nodes.astype(np.int64)].reshape(-1, 3)
        chord = max(chord, _off(points[cells], face))
        parts.append(cells)
    triangles = np.concatenate(parts)
    used, inverse = np.unique(triangles, return_inverse=True)
    return points[used], inverse.reshape(-1, 3).astype(np.uint32), chord


def _off(corners: np.ndarray, face: int) -> float:
    """How far (mm) the middles of triangles `[m][3][3]` and of their sides lie off a face, at most."""
    middles = np.concatenate([corners.mean(axis=1)] + [0.5 * (corners[:, k] + corners[:, (k + 1) % 3]) for k in range(3)])
    nearest, _ = gmsh.model.getClosestPoint(2, face, middles.ravel())
    return float(np.linalg.norm(np.asarray(nearest).reshape(-1, 3) - middles, axis=1).max())


def _measures(points: np.ndarray, triangles: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Lengths of all sides `[m][3]` and least heights `[m]`."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    edges = np.stack([np.linalg.norm(v, axis=1) for v in (b - a, c - b, a - c)], axis=1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return edges, area / edges.max(axis=1)


def _outwards(points: np.ndarray, triangles: np.ndarray) -> Tuple[np.ndarray, int]:
    """Triangles that are wound alike, with the outside outside, and how many skins they are: triangles that share sides. How a face is wound is left to
    chance by the files of some programs."""
    triangles = triangles.astype(np.int64)
    by_side: Dict[Tuple[int, int], List[int]] = {}
    for t, corners in enumerate(triangles.tolist()):
        for k in range(3):
            a, b = corners[k], corners[(k + 1) % 3]
            by_side.setdefault((min(a, b), max(a, b)), []).append(t)
    group = np.full(len(triangles), -1)
    count = 0
    for first in range(len(triangles)):
        if group[first] >= 0:
            continue
        group[first], waiting = count, [first]
        while waiting:
            t = waiting.pop()
            corners = triangles[t].tolist()
            for k in range(3):
                a, b = corners[k], corners[(k + 1) % 3]
                for other in by_side[(min(a, b), max(a, b))]:
                    if group[other] < 0:
                        theirs = triangles[other].tolist()
                        same = any(theirs[j] == a and theirs[(j + 1) % 3] == b for j in range(3))
                        if same:
                            triangles[other] = triangles[other][::-1]
                        group[other] = count
                        waiting.append(other)
        count += 1
    low, high = points.min(axis=0), points.max(axis=0)
    foot = np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    corners = points[triangles] - foot
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    for one in range(count):
        if volumes[group == one].sum() < 0.0:
            triangles[group == one] = triangles[group == one][:, ::-1]
    return triangles.astype(np.uint32), count
