#!/usr/bin/env python3
"""Opens artifacts with VTK's own reader and compares what it gives with what h5py reads.

usage: check_vtk.py ARTIFACT...

For every body: cells, and at the first, middle and last frame points and fields, bit by bit. The reader
is driven in the ways programs drive it (ParaView asks for information first, scripts often do not).
Needs the packages vtk (9.4 or later), h5py and numpy. Exit code 0: all equal.
"""

import json
import sys

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

GROUPS = {"points": "PointData", "cells": "CellData"}


def plain(path):
    """The artifact as h5py sees it: times, and per body its description and arrays."""
    with h5py.File(path, "r") as f:
        contents = json.loads(f["plyflow"].attrs["contents"])
        frames = contents["frames"]
        times = f["plyflow/times"][:] if frames else np.zeros(0)
        bodies = []
        for body in contents["bodies"]:
            g = f["VTKHDF"][body["name"]]
            steps = max(frames, 1)
            n, m = body["points"], body["cells"]
            points = g["Points"][:].reshape(-1, n, 3)
            assert len(points) == (frames if body["moving"] else 1), "rows of points"
            fields = {}
            for field in body["fields"]:
                rows = n if field["on"] == "points" else m
                values = g[GROUPS[field["on"]]][field["name"]][:]
                fields[field["on"], field["name"]] = values.reshape(
                    (steps, rows) + values.shape[1:]
                )
            bodies.append((body, points, g["Connectivity"][:], fields))
        return times, bodies


def compare(path, block, frame, body, points, cells, fields):
    """Raises when a block differs from the plain arrays."""
    where = f"{path}: body {body['name']}, frame {frame}"
    k = body["nodes_per_cell"]
    got = vtk_to_numpy(block.GetPoints().GetData())
    want = points[frame if body["moving"] else 0]
    assert got.dtype == np.float64 and np.array_equal(got, want), f"{where}: points differ"
    assert block.GetNumberOfCells() == body["cells"], f"{where}: number of cells"
    got = vtk_to_numpy(block.GetCells().GetConnectivityArray())
    assert np.array_equal(got, cells), f"{where}: cells differ"
    kind = {3: vtk.VTK_TRIANGLE, 4: vtk.VTK_QUAD}[k]
    assert all(block.GetCellType(i) == kind for i in range(block.GetNumberOfCells())), where
    for (on, name), values in fields.items():
        data = block.GetPointData() if on == "points" else block.GetCellData()
        array = data.GetArray(name)
        assert array is not None, f"{where}: VTK sees no field {name} on {on}"
        assert np.array_equal(vtk_to_numpy(array), values[frame]), f"{where}: field {name} differs"
    arrays = block.GetPointData().GetNumberOfArrays() + block.GetCellData().GetNumberOfArrays()
    assert arrays == len(fields), f"{where}: VTK sees {arrays} fields, there are {len(fields)}"


def check(path, prepare):
    """One way of driving the reader over one artifact."""
    times, bodies = plain(path)
    if not bodies:
        return "no bodies"
    reader = vtk.vtkHDFReader()
    assert reader.CanReadFile(path), f"{path}: VTK does not take it for a VTKHDF file"
    reader.SetFileName(path)
    prepare(reader)
    steps = sorted({0, len(times) // 2, max(len(times) - 1, 0)})
    for frame in [*steps, *reversed(steps)]:
        if len(times) > 1:
            reader.UpdateTimeStep(times[frame])
        else:
            reader.Update()
        output = reader.GetOutputDataObject(0)
        assert output.GetNumberOfBlocks() == len(bodies), f"{path}: number of blocks"
        for i, (body, points, cells, fields) in enumerate(bodies):
            name = output.GetMetaData(i).Get(vtk.vtkCompositeDataSet.NAME())
            assert name == body["name"], f"{path}: block {i} is {name}, not {body['name']}"
            compare(path, output.GetBlock(i), frame, body, points, cells, fields)
    if len(times) > 1:
        key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        info = reader.GetOutputInformation(0)
        seen = [info.Get(key, i) for i in range(info.Length(key))]
        assert np.array_equal(seen, times), f"{path}: times {seen} are not {times}"
    return f"{len(bodies)} bodies, {len(times)} frames"


def main(paths):
    if not paths:
        print(__doc__)
        return 2
    ways = {
        "updated at once": lambda r: None,
        "asked for information first": lambda r: r.UpdateInformation(),
        "updated before": lambda r: (r.UpdateInformation(), r.Update()),
    }
    for path in paths:
        said = [check(path, prepare) for prepare in ways.values()]
        print(f"VTK {vtk.vtkVersion().GetVTKVersion()}: {path}: {said[0]}: equal in {len(ways)} ways")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
