"""Parts whose volumes are known, and files that are wrong in one thing."""

from collections import Counter
from pathlib import Path

import gmsh
import numpy as np
import pytest

from step_reading import StepFileError, read

HERE = Path(__file__).resolve().parent.parent


def volume(surface):
    corners = surface.points[surface.triangles]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)


def is_closed(surface):
    """Whether each side is passed once in each sense."""
    sides = Counter()
    for a, b, c in surface.triangles.tolist():
        sides.update([(a, b), (b, c), (c, a)])
    return all(n == 1 and sides[(b, a)] == 1 for (a, b), n in sides.items())


def part(tmp_path, draw, change=lambda text: text, name="part.step"):
    """A STEP file of what `draw` makes with gmsh, in mm."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        path = tmp_path / name
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    path.write_text(change(path.read_text()))
    return path


def box(occ):
    occ.addBox(-10, -20, 0, 20, 40, 30)


def told(path, *args, **more):
    with pytest.raises(StepFileError) as refused:
        read(path, *args, **more)
    return str(refused.value)


def mass(path):
    """Volume (m3) by the integrals of the CAD kernel."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        return sum(gmsh.model.occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3)) * 1e-9
    finally:
        gmsh.finalize()


def test_the_hat_of_the_example_is_closed_stands_on_the_bed_and_has_its_volume():
    hat = read(HERE / "hat.step", 0.02)
    assert is_closed(hat) and hat.solids == 1 and hat.unit == 1e-3
    # Off by no more than the chord all over the walls and the edge, whose area is less than 400 x 60 mm; the flat faces are exact.
    assert volume(hat) == pytest.approx(mass(HERE / "hat.step"), abs=hat.chord_error * 0.8 * 0.06)
    assert hat.points.min(axis=0) == pytest.approx([-0.12, -0.08, 0.0], abs=1e-9)
    assert hat.points.max(axis=0) == pytest.approx([0.12, 0.08, 0.025], abs=1e-9)
    assert 0.0 < hat.smallest_height <= hat.shortest_edge < 0.02


def test_twice_as_many_triangles_a_turn_lie_a_quarter_as_far_off():
    coarse, fine = (read(HERE / "hat.step", 0.02, per_turn=n).chord_error for n in (24, 48))
    assert 3.0 < coarse / fine < 5.0


def test_the_same_file_gives_the_same_bits():
    one, other = (read(HERE / "hat.step", 0.02) for _ in range(2))
    assert one.points.tobytes() == other.points.tobytes() and one.triangles.tobytes() == other.triangles.tobytes()


def in_inches(text):
    """The same numbers, called inches."""
    number = max(int(n) for n in __import__("re").findall(r"^#(\d+)\s*=", text, __import__("re").M))
    a, b, c = number + 1, number + 2, number + 3
    inch = f"( CONVERSION_BASED_UNIT('INCH',#{b}) LENGTH_UNIT() NAMED_UNIT(#{c}) );"
    text = text.replace("( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );", inch)
    more = (
        f"#{a} = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );\n"
        f"#{b} = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#{a});\n"
        f"#{c} = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n"
    )
    at = text.rindex("ENDSEC;")
    return text[:at] + more + text[at:]


@pytest.mark.parametrize(
    ("change", "metres"),
    [
        (lambda t: t, 1e-3),
        (lambda t: t.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT(.CENTI.,.METRE.)"), 1e-2),
        (lambda t: t.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)"), 1.0),
        (in_inches, 0.0254),
    ],
)
def test_lengths_are_in_the_unit_that_the_file_tells(tmp_path, change, metres):
    found = read(part(tmp_path, box, change), 50 * metres)
    assert found.unit == metres
    assert volume(found) == pytest.approx(20 * 40 * 30 * metres**3, rel=1e-9)
    assert found.chord_error < 1e-9 * metres * 1e3


def test_solids_that_reach_into_each_other_are_one_and_others_stay_apart(tmp_path):
    def both(occ):
        box(occ)
        occ.addBox(0, -10, 0, 30, 20, 10)

    found = read(part(tmp_path, both), 0.05)
    assert is_closed(found) and found.solids == 1
    assert volume(found) == pytest.approx((20 * 40 * 30 + 20 * 20 * 10) * 1e-9, rel=1e-9)

    def apart(occ):
        box(occ)
        occ.addBox(50, -10, 0, 30, 20, 10)

    path = part(tmp_path, apart)
    found = read(path, 0.05)
    assert is_closed(found) and found.solids == 2
    assert volume(found) == pytest.approx((20 * 40 * 30 + 30 * 20 * 10) * 1e-9, rel=1e-9)
    assert volume(read(path, 0.05, solids=[2])) == pytest.approx(30 * 20 * 10e-9, rel=1e-9)
    assert "names number 3; the file has 2 solids, counted from 1" in told(path, 0.05, solids=[3])


def test_faces_without_a_solid_are_sewn_where_they_close_and_turned_outwards_where_they_do_not(tmp_path):
    def faces(keep):
        def draw(occ):
            solid = occ.addBox(-10, -20, 0, 20, 40, 30)
            occ.synchronize()
            occ.remove([(3, solid)])
            occ.synchronize()
            low = [t for _, t in gmsh.model.getEntities(2) if gmsh.model.getBoundingBox(2, t)[5] < 1.0]
            assert len(low) == 1
            if not keep:
                occ.remove([(2, low[0])], recursive=False)

        return draw

    closed = read(part(tmp_path, faces(True)), 0.05)
    assert is_closed(closed) and volume(closed) == pytest.approx(24e-6, rel=1e-9)
    assert "were sewn to 1 solid" in closed.notes[0]
    opened = read(part(tmp_path, faces(False)), 0.05)
    # About a point of the foot, where it is open, the missing face has no part in the volume.
    assert opened.solids == 0 and opened.faces == 5 and volume(opened) == pytest.approx(24e-6, rel=1e-9)
    assert "it has faces and no solid" in opened.notes[0]


def test_what_is_no_part_is_called_so(tmp_path):
    path = tmp_path / "a.step"
    path.write_bytes(b"solid cube\nendsolid\n")
    assert "this is no STEP file, which begins with ISO-10303-21" in told(path, 0.01)
    path.write_bytes((HERE / "hat.step").read_bytes()[:20000])
    assert "it was cut off" in told(path, 0.01)
    assert "there is no such file" in told(tmp_path / "none.step", 0.01)
    curve = part(tmp_path, lambda occ: occ.addLine(occ.addPoint(0, 0, 0), occ.addPoint(10, 0, 0)))
    assert "it holds no face" in told(curve, 0.01)
    silent = part(tmp_path, box, lambda t: t.replace("LENGTH_UNIT()", "AREA_UNIT()"))
    assert "does not say what its lengths are in" in told(silent, 0.01)
    odd = part(tmp_path, box, lambda t: in_inches(t).replace("'INCH'", "'CUBIT'"))
    assert "its lengths are in 'CUBIT'" in told(odd, 0.01)
    assert "expected more than 0 m" in told(HERE / "hat.step", 0.0)
    # The geometry itself is broken: every reference leads nowhere.
    empty = part(tmp_path, box, lambda t: t.replace("MANIFOLD_SOLID_BREP('',#", "MANIFOLD_SOLID_BREP('',#9"))
    assert "part.step" in told(empty, 0.01)
