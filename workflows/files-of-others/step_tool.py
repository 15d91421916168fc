"""A step: the skin of a STEP file becomes a tool."""

from pathlib import Path

import plyflow
from plyflow import declare

import step_reading


@plyflow.step(
    "step-tool",
    vendor="Plyflow examples",
    output="geometry",
    parameters={
        "file": declare.file(required=True, doc="The STEP file; its unit is read from it."),
        "size": declare.quantity("length", required=True, exclusive_minimum="0 mm", doc="Longest side of a triangle, about."),
        "per_turn": declare.integer(default=24, minimum=4, doc="How many triangles a full turn of a round face has at least."),
        "body": declare.string(default="tool", doc="Name of the body, by which the scene asks for it."),
        "solids": declare.list_of(
            declare.integer(minimum=1, doc="Number of a solid, from 1."),
            minimum_items=1,
            doc="Which solids of the file count; left out, all. Those that touch become one.",
        ),
    },
    results={
        "triangles": declare.result("1", doc="How many triangles."),
        "solids": declare.result("1", doc="Of how many solids they are the skin; 0: of faces alone."),
        "unit": declare.result("m", doc="One unit of the file."),
        "chord_error": declare.result("m", doc="How far the middle of a triangle or of a side lies off the file's surface at most."),
        "shortest_edge": declare.result("m", doc="Shortest side of a triangle."),
        "smallest_height": declare.result("m", doc="Least height of a triangle."),
    },
)
def run(step):
    """Meshes the skin of a STEP file with triangles, as a tool."""
    p = step.parameters
    path = Path(p["file"])
    step.progress(0.1, phase="meshing")
    found = step_reading.read(path, p["size"], per_turn=p["per_turn"], solids=p.get("solids"))
    for note in found.notes:
        step.warn(note)
    step.define_mesh(p["body"], found.points, found.triangles)
    step.write_attributes({"source": path.name})
    step.report("triangles", len(found.triangles))
    for name in ("solids", "unit", "chord_error", "shortest_edge", "smallest_height"):
        step.report(name, getattr(found, name))
