"""Drawings whose areas and places are known, and drawings that are wrong in one thing."""

import math
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely

import dxf_reading
from dxf_reading import DrawingError, read

HERE = Path(__file__).resolve().parent.parent
# Area of blank.dxf (m2): a rectangle without three round corners, one corner that is cut off and a round hole.
BLANK = (236 * 160 - 3 * (1 - math.pi / 4) * 20**2 - 0.5 * 30**2 - math.pi * 12**2) * 1e-6


def drawing(tmp_path, draw, units=4):
    """A file with what `draw` puts into the model space."""
    document = ezdxf.new("R2010", units=units)
    draw(document.modelspace(), document)
    path = tmp_path / "drawing.dxf"
    document.saveas(path)
    return path


def told(path, *args, **more):
    with pytest.raises(DrawingError) as refused:
        read(path, *args, **more)
    return str(refused.value)


def square(space, side, at=(0.0, 0.0), layer="0"):
    x, y = at
    space.add_lwpolyline([(x, y), (x + side, y), (x + side, y + side), (x, y + side)], close=True, dxfattribs={"layer": layer})


def test_the_blank_of_the_example_has_the_area_and_the_hole_that_were_drawn():
    found = read(HERE / "blank.dxf", {"blank": "PLY"}, chord=1e-6)
    blank = found.outlines["blank"]
    assert found.unit == 1e-3
    # A chord of 1 um along 100 mm of arcs and the hole's 75 mm.
    assert blank.area == pytest.approx(BLANK, abs=2e-7)
    (hole,) = blank.holes
    assert 0.5 * (hole.min(axis=0) + hole.max(axis=0)) == pytest.approx([0.040, 0.020], abs=1e-6)
    assert np.hypot(*(hole - [0.040, 0.020]).T) == pytest.approx(np.full(len(hole), 0.012), abs=1e-9)
    assert blank.outline.min(axis=0) == pytest.approx([-0.118, -0.08]) and blank.outline.max(axis=0) == pytest.approx([0.118, 0.08])
    assert shapely.Polygon(blank.outline).exterior.is_ccw and shapely.Polygon(hole).exterior.is_ccw
    assert found.notes == ["blank.dxf: passed over what is no curve: 1 TEXT"]


@pytest.mark.parametrize("chord", [1e-5, 1e-4, 1e-3])
def test_corners_lie_on_round_curves_and_lines_between_them_no_farther_off_than_the_chord(chord):
    (hole,) = read(HERE / "blank.dxf", {"blank": "PLY"}, chord=chord).outlines["blank"].holes
    middles = 0.5 * (hole + np.roll(hole, -1, axis=0))
    off = 0.012 - np.hypot(*(middles - [0.040, 0.020]).T)
    assert 0.2 * chord < off.max() <= chord * (1 + 1e-9)


def test_the_same_file_gives_the_same_bits():
    one, other = (read(HERE / "blank.dxf", {"blank": "PLY"}).outlines["blank"] for _ in range(2))
    assert one.outline.tobytes() == other.outline.tobytes()
    assert [h.tobytes() for h in one.holes] == [h.tobytes() for h in other.holes]


@pytest.mark.parametrize(("units", "metres"), [(1, 0.0254), (2, 0.3048), (4, 1e-3), (5, 1e-2), (6, 1.0)])
def test_lengths_are_in_the_unit_that_the_file_tells(tmp_path, units, metres):
    path = drawing(tmp_path, lambda space, _: square(space, 2.0), units)
    found = read(path)
    assert found.unit == pytest.approx(metres, rel=1e-12)
    assert found.outlines["outline"].area == pytest.approx((2.0 * metres) ** 2, rel=1e-12)


def test_a_file_without_a_unit_needs_one_and_one_that_lies_is_overruled_and_told(tmp_path):
    silent = drawing(tmp_path, lambda space, _: square(space, 100.0), 0)
    assert "does not say what its unit is ($INSUNITS" in told(silent) and "`unit: 1 mm`" in told(silent)
    assert read(silent, unit=1e-3).outlines["outline"].area == pytest.approx(0.01)
    inches = drawing(tmp_path, lambda space, _: square(space, 100.0), 1)
    found = read(inches, unit=1e-3)
    assert found.outlines["outline"].area == pytest.approx(0.01)
    assert "says that one unit is 0.0254 m" in found.notes[0]


def test_ends_within_the_tolerance_are_one_corner_and_others_are_an_open_contour(tmp_path):
    def draw(gap):
        def lines(space, _):
            space.add_line((0, 0), (100, 0))
            space.add_line((100 + gap, 0), (100, 50))
            # Drawn the other way round.
            space.add_line((0, 0), (100, 50))

        return lines

    near = read(drawing(tmp_path, draw(0.005)))
    assert len(near.outlines["outline"].outline) == 3
    assert near.outlines["outline"].area == pytest.approx(0.5 * 0.1 * 0.05, rel=1e-4)
    text = told(drawing(tmp_path, draw(0.4)))
    assert "an open contour: LINE #" in text and "ends at (100.0000, 0.0000) mm" in text and "is 0.4 mm away" in text
    assert "take a larger `tolerance` (0.01 mm)" in text
    assert read(drawing(tmp_path, draw(0.4)), tolerance=5e-4).outlines["outline"].area == pytest.approx(2.5e-3, rel=1e-2)


def test_three_curves_at_a_corner_are_told_with_the_place(tmp_path):
    def draw(space, _):
        for a, b in (((0, 0), (10, 0)), ((10, 0), (10, 10)), ((10, 10), (0, 0)), ((10, 10), (30, 10))):
            space.add_line(a, b)

    text = told(drawing(tmp_path, draw))
    assert "3 curves meet at (10.0000, 10.0000) mm" in text and "remove what is drawn twice" in text


def test_polylines_with_arcs_both_ways_round_have_their_area(tmp_path):
    # A square of 20 mm with half a circle outside on one side and one taken out on another.
    def draw(space, _):
        space.add_lwpolyline([(0, 0, 0), (20, 0, 1), (20, 20, -1), (0, 20, 0)], format="xyb", close=True)

    found = read(drawing(tmp_path, draw), chord=1e-6).outlines["outline"]
    assert found.area == pytest.approx(400e-6, rel=1e-4)
    assert found.outline[:, 0].max() == pytest.approx(0.030, abs=1e-6)
    assert found.outline[:, 1].max() == pytest.approx(0.020, abs=1e-6)


def test_splines_and_ellipses_are_followed(tmp_path):
    ellipse = drawing(tmp_path, lambda space, _: space.add_ellipse((0, 0), major_axis=(50, 0), ratio=0.4))
    found = read(ellipse, chord=1e-6).outlines["outline"]
    assert found.area == pytest.approx(math.pi * 0.05 * 0.02, rel=1e-4)
    turns = [2 * math.pi * k / 12 for k in range(13)]
    through = [(40 * math.cos(t), 40 * math.sin(t)) for t in turns]
    spline = drawing(tmp_path, lambda space, _: space.add_spline(through))
    found = read(spline, chord=1e-6).outlines["outline"]
    # A spline through 12 points of a circle is one to some per mille.
    assert found.area == pytest.approx(math.pi * 0.04**2, rel=5e-3)


def test_blocks_are_drawn_where_they_are_inserted(tmp_path):
    def draw(space, document):
        block = document.blocks.new("PART")
        square(block, 10.0)
        block.add_circle((5, 5), 2)
        space.add_blockref("PART", (100, 0), dxfattribs={"xscale": 2, "yscale": 2, "rotation": 90, "layer": "CUT"})

    found = read(drawing(tmp_path, draw), {"part": "cut"}, chord=1e-6).outlines["part"]
    assert found.area == pytest.approx((400 - math.pi * 16) * 1e-6, rel=1e-4)
    assert found.outline.min(axis=0) == pytest.approx([0.08, 0.0]) and found.outline.max(axis=0) == pytest.approx([0.1, 0.02])
    moved = read(drawing(tmp_path, draw), {"part": "cut"}, centred=True).outlines["part"]
    assert moved.outline.min(axis=0) == pytest.approx([-0.01, -0.01]) and moved.holes[0].mean(axis=0) == pytest.approx([0, 0], abs=1e-9)


def test_layers_are_asked_for_where_there_are_several_and_told_where_one_is_not_there(tmp_path):
    def draw(space, document):
        square(space, 10.0, layer="A")
        square(space, 20.0, (100, 0), layer="B")

    path = drawing(tmp_path, draw)
    assert "curves lie on 2 layers: 'A', 'B'" in told(path) and "`layers: {blank: A}`" in told(path)
    assert "no curve on a layer 'C', which `layers.blank` names; curves lie on 'A', 'B'" in told(path, {"blank": "C"})
    both = read(path, {"small": "A", "large": "B"}).outlines
    assert [both[n].area for n in ("small", "large")] == pytest.approx([1e-4, 4e-4])


def test_contours_that_bound_no_region_are_refused_with_the_place(tmp_path):
    bow = told(drawing(tmp_path, lambda space, _: space.add_lwpolyline([(0, 0), (100, 100), (100, 0), (0, 100)], close=True)))
    assert "crosses or touches itself at (50.0000, 50.0000) mm" in bow and "LWPOLYLINE #" in bow

    def two(space, _):
        square(space, 20.0)
        square(space, 10.0, (50, 0))

    beside = told(drawing(tmp_path, two))
    assert "at (50.0000, 0.0000) mm does not lie inside of the largest one" in beside

    def holes(space, _):
        square(space, 100.0)
        square(space, 20.0, (10, 10))
        square(space, 20.0, (20, 20))

    crossing = told(drawing(tmp_path, holes))
    assert "cross, touch or lie in each other at (25.0000, 25.0000) mm" in crossing
    assert "has no area" in told(drawing(tmp_path, lambda space, _: space.add_lwpolyline([(0, 0), (10, 0), (5, 0)], close=True)))
    upright = told(drawing(tmp_path, lambda space, _: space.add_line((0, 0, 0), (10, 0, 5))))
    assert "is not flat: its z spans 5 mm" in upright


def test_too_many_corners_are_refused_with_the_way_out(tmp_path):
    path = drawing(tmp_path, lambda space, _: space.add_circle((0, 0), 1000))
    text = told(path, chord=1e-8)
    assert f"expected at most {dxf_reading.MOST_CORNERS}" in text and "take a larger `chord`" in text


def test_what_is_no_drawing_is_called_so(tmp_path):
    other = tmp_path / "photo.dxf"
    other.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(200))
    assert "this is no DXF drawing that can be read" in told(other)
    assert "there is no such file" in told(tmp_path / "none.dxf")
    assert "has no curve" in told(drawing(tmp_path, lambda space, _: space.add_text("a")))
    cut = tmp_path / "cut.dxf"
    cut.write_bytes((HERE / "blank.dxf").read_bytes()[:9000])
    assert "drawing" in told(cut, {"blank": "PLY"}) or "no curve" in told(cut, {"blank": "PLY"})
