"""A step: closed contours of a DXF drawing become outlines of plies."""

from pathlib import Path

import plyflow
from plyflow import declare

import dxf_reading


@plyflow.step(
    "dxf-outline",
    vendor="Plyflow examples",
    output="geometry",
    parameters={
        "file": declare.file(required=True, doc="The DXF drawing."),
        "layers": declare.map_of(
            declare.string(doc="A layer."),
            doc="By name of an outline, the layer that it is drawn on; left out where one layer alone has curves: that is the outline `outline`.",
        ),
        "tolerance": declare.quantity(
            "length", default="0.01 mm", exclusive_minimum="0 mm", doc="How far apart the ends of two curves may lie that go on in each other."
        ),
        "chord": declare.quantity("length", default="0.05 mm", exclusive_minimum="0 mm", doc="How far the line between two corners may lie off a round curve."),
        "unit": declare.quantity("length", exclusive_minimum="0 mm", doc="One unit of the file, where it does not say ($INSUNITS) or says it wrongly."),
        "centred": declare.boolean(default=False, doc="Whether the middle of the box around each outline is moved to (0, 0)."),
    },
    results={
        "area": declare.result("m2", doc="Of each outline without its holes: area.NAME."),
        "corners": declare.result("1", doc="Of each outline and its holes: corners.NAME."),
        "holes": declare.result("1", doc="Of each outline: holes.NAME."),
        "unit": declare.result("m", doc="One unit of the file."),
    },
)
def run(step):
    """Reads outlines of plies, with their holes, from a DXF drawing."""
    p = step.parameters
    path = Path(p["file"])
    drawing = dxf_reading.read(
        path, p.get("layers"), tolerance=p["tolerance"], chord=p["chord"], unit=p.get("unit"), centred=p["centred"]
    )
    for note in drawing.notes:
        step.warn(note)
    for name, found in drawing.outlines.items():
        step.write_array(f"outlines/{name}/outline", found.outline, unit="m")
        for k, hole in enumerate(found.holes):
            step.write_array(f"outlines/{name}/hole_{k}", hole, unit="m")
        step.report(f"area.{name}", found.area)
        step.report(f"corners.{name}", len(found.outline) + sum(map(len, found.holes)))
        step.report(f"holes.{name}", len(found.holes))
    step.report("unit", drawing.unit)
    step.write_attributes({"outlines": list(drawing.outlines), "source": path.name})
