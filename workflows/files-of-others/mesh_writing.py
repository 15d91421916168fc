"""Meshes with fields as files of other programs, written by meshio."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List

import meshio
import numpy as np

# What the program calls a format -> ending of its files and meshio's name for it.
FORMATS = {
    "vtu": ("vtu", "vtu"),
    "abaqus": ("inp", "abaqus"),
}
# Formats that hold meshes alone. meshio writes Nastran too, but fails on some numbers.
WITHOUT_FIELDS = ("abaqus",)


class ExportError(ValueError):
    """A mesh that the format cannot hold: says why, and what to do."""


@dataclass
class Mesh:
    """One body in one state."""

    points: np.ndarray
    """`[n][3]` (m)."""
    cells: np.ndarray
    """`[m][3]` or `[m][4]`, indices into `points`."""
    on_points: Dict[str, np.ndarray] = field(default_factory=dict)
    """Name -> `[n]` or `[n][c]`."""
    on_cells: Dict[str, np.ndarray] = field(default_factory=dict)
    """Name -> `[m]` or `[m][c]`."""


def write(mesh: Mesh, form: str, unit: float = 1.0) -> bytes:
    """The bytes of a file with this mesh; lengths of the points are divided by `unit` (m). Fields keep their SI units.

    Raises ExportError.
    """
    if form not in FORMATS:
        raise ExportError(f"there is no format {form!r}; expected one of {', '.join(FORMATS)}")
    kind = {3: "triangle", 4: "quad"}.get(mesh.cells.shape[1] if mesh.cells.ndim == 2 else 0)
    if kind is None:
        raise ExportError(f"the cells have the shape {mesh.cells.shape}; expected [m][3] or [m][4]")
    ending, name = FORMATS[form]
    fields = form not in WITHOUT_FIELDS
    told = meshio.Mesh(
        mesh.points / unit,
        [(kind, mesh.cells.astype(np.int64))],
        point_data=dict(sorted(mesh.on_points.items())) if fields else {},
        cell_data={n: [v] for n, v in sorted(mesh.on_cells.items())} if fields else {},
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"mesh.{ending}"
        try:
            meshio.write(path, told, file_format=name)
        except Exception as error:
            raise ExportError(f"meshio cannot write {form}: {str(error) or type(error).__name__}") from None
        return path.read_bytes()


def left_out(mesh: Mesh, form: str) -> List[str]:
    """Names of the fields that a format does not hold."""
    return sorted([*mesh.on_points, *mesh.on_cells]) if form in WITHOUT_FIELDS else []


def file_name(body: str, form: str) -> str:
    """Name of the file of a body."""
    return f"{body}.{FORMATS[form][0]}"
