"""Makes the two files of this folder that stand for those of others: `python make_files.py` writes hat.step and blank.dxf.

They are kept in the repository, so that nobody has to run this. It needs gmsh and ezdxf.
"""

from pathlib import Path

import ezdxf
import gmsh

HERE = Path(__file__).resolve().parent
LENGTH, WIDTH, HEIGHT, DRAFT, RADIUS = 240.0, 160.0, 25.0, 15.0, 12.0


def hat() -> None:
    """A hat with walls that lean outwards and a round edge along its top, in mm, standing on z = 0."""
    import math

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        low, high = [], []
        back = HEIGHT * math.tan(math.radians(DRAFT))
        for z, off, into in ((0.0, 0.0, low), (HEIGHT, back, high)):
            x, y = 0.5 * LENGTH - off, 0.5 * WIDTH - off
            corner = 30.0 - off
            into.append(_rounded(occ, x, y, z, corner))
        occ.addThruSections([low[0], high[0]], tag=1, makeSolid=True, makeRuled=True)
        occ.synchronize()
        top = [tag for _, tag in gmsh.model.getBoundary(_faces_at(HEIGHT), oriented=False)]
        occ.fillet([1], top, [RADIUS])
        occ.synchronize()
        # The wires that it was made of are no part of it.
        for dim in (1, 0):
            loose = [e for e in gmsh.model.getEntities(dim) if not len(gmsh.model.getAdjacencies(*e)[0])]
            occ.remove(loose)
            occ.synchronize()
        gmsh.write(str(HERE / "hat.step"))
    finally:
        gmsh.finalize()


def _rounded(occ, x: float, y: float, z: float, r: float) -> int:
    """A wire around a rectangle with round corners."""
    middles = [(x - r, -y + r), (x - r, y - r), (-x + r, y - r), (-x + r, -y + r)]
    starts = [(x - r, -y), (x, y - r), (-x + r, y), (-x, -y + r)]
    ends = [(x, -y + r), (x - r, y), (-x, y - r), (-x + r, -y)]
    point = {p: occ.addPoint(p[0], p[1], z) for p in starts + ends}
    curves = []
    for k in range(4):
        curves.append(occ.addCircleArc(point[starts[k]], occ.addPoint(*middles[k], z), point[ends[k]]))
        curves.append(occ.addLine(point[ends[k]], point[starts[(k + 1) % 4]]))
    return occ.addWire(curves)


def _faces_at(z: float):
    found = []
    for dim, tag in gmsh.model.getEntities(2):
        box = gmsh.model.getBoundingBox(dim, tag)
        if abs(box[2] - z) < 1e-3 and abs(box[5] - z) < 1e-3:
            found.append((dim, tag))
    return found


def blank() -> None:
    """A ply with three round corners and one that is cut off, and a round hole, in mm: lines and arcs on a layer PLY, a note beside them on another."""
    document = ezdxf.new("R2010", units=4)
    document.header["$TDCREATE"] = document.header["$TDUPDATE"] = 2461000.0
    space = document.modelspace()
    for name in ("PLY", "NOTES"):
        document.layers.add(name)
    ply = {"layer": "PLY"}
    x, y, r, cut = 118.0, 80.0, 20.0, 30.0
    space.add_line((-x + r, -y), (x - r, -y), ply)
    space.add_arc((x - r, -y + r), r, 270, 0, dxfattribs=ply)
    space.add_line((x, -y + r), (x, y - cut), ply)
    space.add_line((x, y - cut), (x - cut, y), ply)
    space.add_line((x - cut, y), (-x + r, y), ply)
    space.add_arc((-x + r, y - r), r, 90, 180, dxfattribs=ply)
    space.add_line((-x, y - r), (-x, -y + r), ply)
    space.add_arc((-x + r, -y + r), r, 180, 270, dxfattribs=ply)
    space.add_circle((40.0, 20.0), 12.0, dxfattribs=ply)
    space.add_text("PLY 1, 0 deg along x", dxfattribs={"layer": "NOTES", "insert": (-x, y + 10.0), "height": 5.0})
    document.saveas(HERE / "blank.dxf")


if __name__ == "__main__":
    hat()
    blank()
