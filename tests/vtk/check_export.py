#!/usr/bin/env python3
"""Opens exported VTU files with VTK's own reader and holds the deviations of their fibres against numpy.

usage: check_export.py ARTIFACT FOLDER

FOLDER has what `plyflow export ARTIFACT --format vtu` wrote, in metres, of the last frame. Of every ply the angle from the direction as laid to
each family is computed again from the flat and the formed points alone: by the deformation gradient at the middle of each cell, and the x axis
projected onto it. Needs the packages vtk (9.4 or later), h5py and numpy. Exit code 0: all agree, and at least one fibre has turned.
"""

import json
import pathlib
import sys

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# Where the projected axis is shorter than this, no deviation is told.
LEAST_OF_AXIS = 0.5


def opened(path):
    """Points, cells and fields of a file."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() > 0, f"{path}: no cells"
    points = vtk_to_numpy(grid.GetPoints().GetData())
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(grid.GetNumberOfCells(), -1)

    def fields(data):
        return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}

    return points, cells, fields(grid.GetPointData()), fields(grid.GetCellData())


def turned(flat, formed, laid):
    """Deviations (rad) of a family, from flat and formed corners `[cells][4][3]`; not a number where none is told."""
    # Derivatives of the shape functions of a quadrilateral at its middle.
    xi, eta = np.array([-1, 1, 1, -1]) / 4, np.array([-1, -1, 1, 1]) / 4
    big = np.stack([np.einsum("k,cki->ci", d, flat[..., :2]) for d in (xi, eta)], axis=-1)
    small = np.stack([np.einsum("k,cki->ci", d, formed) for d in (xi, eta)], axis=-1)
    gradient = small @ np.linalg.inv(big)
    fibre = gradient @ np.array([np.cos(laid), np.sin(laid)])
    normal = np.cross(small[..., 0], small[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    axis = np.array([1.0, 0, 0]) - normal[:, :1] * normal
    angle = np.arctan2(np.einsum("ci,ci->c", fibre, np.cross(normal, axis)), np.einsum("ci,ci->c", fibre, axis)) - laid
    angle -= np.round(angle / np.pi) * np.pi
    return np.where(np.linalg.norm(axis, axis=1) < LEAST_OF_AXIS, np.nan, angle)


def main():
    artifact, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    with h5py.File(artifact) as f:
        attributes = json.loads(f["plyflow"].attrs["attributes"])
    plies = [s for s in attributes["sheets"] if s["kind"] == "ply"]
    assert plies, f"{artifact}: no ply"
    largest, told, untold = 0.0, 0, 0
    for ply in plies:
        files = list(folder.glob(f"*-{ply['name']}.vtu"))
        assert len(files) == 1, f"{ply['name']}: {files}"
        points, cells, on_points, on_cells = opened(files[0])
        flat = on_points["undeformed"][cells]
        for family in (1, 2):
            found = on_cells[f"fibre_deviation_{family}"]
            expected = turned(flat, points[cells], ply[f"fibre_{family}"])
            shaped = on_cells.get("draped", np.ones(len(cells))) == 1
            expected = np.where(shaped, expected, np.nan)
            assert np.array_equal(np.isnan(found), np.isnan(expected)), f"{ply['name']}, family {family}: told where it should not be, or not where it should"
            worst = np.nanmax(np.abs(found - expected), initial=0.0)
            assert worst < 1e-9, f"{ply['name']}, family {family}: off by {worst} rad"
            largest = max(largest, np.nanmax(np.abs(found), initial=0.0))
            told, untold = told + np.sum(~np.isnan(found)), untold + np.sum(np.isnan(found))
    assert largest > 1e-3, "no fibre has turned: nothing was checked"
    print(f"{folder}: {told} deviations agree, {untold} are not told, the largest is {np.degrees(largest):.3f} deg")


if __name__ == "__main__":
    main()
