"""A step: the sheets of a formed part as files of other programs."""

import numpy as np
import plyflow
from plyflow import declare

import mesh_writing


@plyflow.step(
    "mesh-export",
    vendor="Plyflow examples",
    output="export",
    inputs={"formed": declare.port("any", doc="An artifact with bodies.")},
    parameters={
        "format": declare.choice(list(mesh_writing.FORMATS), default="vtu", doc="What is written: `vtu` has the fields too, `abaqus` the mesh alone."),
        "bodies": declare.list_of(declare.string(doc="Name of a body."), minimum_items=1, doc="Which bodies; left out, all."),
        "frame": declare.integer(doc="Which frame, from 0; left out, the last."),
        "unit": declare.quantity(
            "length", default="1 m", exclusive_minimum="0 mm", doc="In what the file has lengths of points: `1 mm` for most models of Abaqus. Fields are in SI."
        ),
    },
    results={
        "points": declare.result("1", doc="Of each body: points.BODY."),
        "cells": declare.result("1", doc="Of each body: cells.BODY."),
    },
)
def run(step):
    """Writes the bodies of a part in one frame as files of other programs."""
    p = step.parameters
    formed = step.input("formed")
    bodies = [formed.body(name) for name in p["bodies"]] if p.get("bodies") else formed.bodies
    frame = p.get("frame", -1)
    files = []
    for k, body in enumerate(bodies):
        step.progress(k / len(bodies), phase=body.name)
        on = {"points": {}, "cells": {}}
        for field in body.fields:
            on[field["on"]][field["name"]] = body.field(field["name"], frame)
        points = body.points(frame) if formed.times else body.reference
        mesh = mesh_writing.Mesh(points, body.cells, on["points"], on["cells"])
        gone = mesh_writing.left_out(mesh, p["format"])
        if gone:
            step.log(f"{body.name}: {p['format']} holds no fields; left out: {', '.join(gone)}")
        name = mesh_writing.file_name(body.name, p["format"])
        content = mesh_writing.write(mesh, p["format"], p["unit"])
        step.write_array(f"files/{name}", np.frombuffer(content, dtype=np.uint8), unit="1")
        files.append({"name": name, "array": f"files/{name}"})
        step.report(f"points.{body.name}", len(points))
        step.report(f"cells.{body.name}", len(body.cells))
    step.write_attributes({"files": files})
