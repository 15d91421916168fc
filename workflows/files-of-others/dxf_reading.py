"""Closed contours of a DXF drawing as outlines with holes, in metres.

Curves are read by ezdxf and judged by shapely. Lines, arcs, circles, ellipses, splines and polylines count, also those inside of blocks. Text,
dimensions, hatches and points are passed over and counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Iterable, List, Optional, Sequence, Tuple

import ezdxf
import numpy as np
import shapely
from ezdxf import units as dxf_units
from ezdxf.entities import DXFEntity
from ezdxf.lldxf.const import DXFError
from shapely.geometry.polygon import orient
from shapely.validation import explain_validity

CURVES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE")
# Most corners of a contour that a scene takes.
MOST_CORNERS = 5000
# Points nearer to each other than this (m) are one.
SAME = 1e-9
# $INSUNITS -> one unit (m), exactly; what is not here is asked of ezdxf, whose factors are rounded.
UNITS = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0, 8: 2.54e-8, 9: 2.54e-5, 10: 0.9144, 13: 1e-6, 14: 0.1}
# Blocks may hold blocks; one that holds itself would never end.
DEEPEST = 32


class DrawingError(ValueError):
    """A drawing that gives no outline: says what is wrong, where, and what to do."""


@dataclass(frozen=True)
class Outline:
    """A closed contour with its holes, all counter-clockwise, the first corner not repeated: `outline` `[n][2]` and `holes`, a list of `[m][2]` (m)."""

    outline: np.ndarray
    holes: List[np.ndarray]

    @property
    def area(self) -> float:
        """Area without the holes (m2)."""
        return float(shapely.Polygon(self.outline, self.holes).area)


@dataclass
class Drawing:
    """What was read of a file."""

    outlines: Dict[str, Outline]
    unit: float
    """One unit of the file (m)."""
    notes: List[str]
    """What the user should know."""


@dataclass
class _Curve:
    points: np.ndarray
    closed: bool
    name: str


def read(
    path: Path,
    layers: Optional[Dict[str, str]] = None,
    *,
    tolerance: float = 1e-5,
    chord: float = 5e-5,
    unit: Optional[float] = None,
    centred: bool = False,
) -> Drawing:
    """Reads the outlines of a drawing.

    `layers`: the layer of each outline, by the outline's name; left out, the one layer that has curves gives the outline `outline`. `tolerance`: how far
    apart (m) the ends of two curves may lie that go on in each other. `chord`: how far (m) a corner-to-corner line may lie off a round curve. `unit`: one
    unit of the file (m), where the file does not say or says it wrongly. `centred`: moves the middle of the box around each outline to (0, 0).

    Raises DrawingError.
    """
    if not tolerance > 0.0 or not chord > 0.0:
        raise DrawingError(f"tolerance is {tolerance} m and chord {chord} m; expected more than 0 m")
    document = _open(path)
    notes: List[str] = []
    metres = _unit(path, document, unit, notes)
    curves, passed_over = _curves(path, document, metres, chord)
    if passed_over:
        counted = ", ".join(f"{n} {kind}" for kind, n in sorted(passed_over.items()))
        notes.append(f"{path.name}: passed over what is no curve: {counted}")
    if not curves:
        raise DrawingError(f"{path}: the model space has no curve; expected some of {', '.join(CURVES)}")
    outlines = {}
    for name, layer in _chosen(path, curves, layers).items():
        contours = _join(path, layer, curves[layer], tolerance)
        found = _nested(path, layer, contours)
        outlines[name] = _moved(found) if centred else found
    return Drawing(outlines, metres, notes)


def _open(path: Path) -> "ezdxf.document.Drawing":
    try:
        return ezdxf.readfile(path)
    except FileNotFoundError:
        raise DrawingError(f"{path}: there is no such file; expected a DXF drawing") from None
    except (OSError, DXFError, UnicodeDecodeError) as error:
        what = str(error).strip() or type(error).__name__
        raise DrawingError(f"{path}: this is no DXF drawing that can be read: {what}; export it again as DXF R12 or later (a DWG file is none)") from None


def _unit(path: Path, document: "ezdxf.document.Drawing", given: Optional[float], notes: List[str]) -> float:
    code = int(document.header.get("$INSUNITS", 0))
    told = None if code == 0 else UNITS.get(code) or float(dxf_units.conversion_factor(code, dxf_units.M))
    if given is not None:
        if told is not None and abs(told - given) > 1e-9 * given:
            notes.append(f"{path.name}: its $INSUNITS ({code}) says that one unit is {told:g} m; `unit` says {given:g} m, which counts")
        return given
    if told is None:
        raise DrawingError(f"{path}: the file does not say what its unit is ($INSUNITS is 0 or missing); expected `unit`, the length of one unit: `unit: 1 mm`, say")
    return told


def _name(entity: DXFEntity) -> str:
    handle = entity.dxf.get("handle")
    return entity.dxftype() + (f" #{handle}" if handle else " of a block")


def _leaves(entities: Iterable[DXFEntity], path: Path, depth: int = 0) -> Iterable[DXFEntity]:
    """The entities with those of blocks in the place of the blocks."""
    for entity in entities:
        if entity.dxftype() != "INSERT":
            yield entity
            continue
        if depth >= DEEPEST:
            raise DrawingError(f"{path}: blocks lie in each other more than {DEEPEST} deep, at {_name(entity)}; explode them")
        for one in entity.multi_insert() if entity.mcount > 1 else [entity]:
            for inner in _leaves(one.virtual_entities(), path, depth + 1):
                # What lies on layer 0 of a block is on the layer of the block.
                if inner.dxf.layer == "0":
                    inner.dxf.layer = entity.dxf.layer
                yield inner


def _curves(path: Path, document: "ezdxf.document.Drawing", metres: float, chord: float) -> Tuple[Dict[str, List[_Curve]], Dict[str, int]]:
    by_layer: Dict[str, List[_Curve]] = {}
    passed_over: Dict[str, int] = {}
    for entity in _leaves(document.modelspace(), path):
        kind = entity.dxftype()
        if kind not in CURVES or (kind == "POLYLINE" and entity.get_mode() not in ("AcDb2dPolyline", "AcDb3dPolyline")):
            passed_over[kind] = passed_over.get(kind, 0) + 1
            continue
        points, closed = _flattened(entity, chord / metres)
        if not np.isfinite(points).all():
            raise DrawingError(f"{path}: {_name(entity)} on layer {entity.dxf.layer!r} has a coordinate that is no finite number; draw it again")
        height = metres * float(np.ptp(points[:, 2]))
        if height > chord:
            raise DrawingError(
                f"{path}: {_name(entity)} on layer {entity.dxf.layer!r} is not flat: its z spans {1e3 * height:.4g} mm; expected a drawing in the x-y plane"
            )
        flat = _distinct(metres * points[:, :2])
        if closed and len(flat) > 1 and np.linalg.norm(flat[0] - flat[-1]) <= SAME:
            flat = flat[:-1]
        if len(flat) > 1:
            by_layer.setdefault(entity.dxf.layer, []).append(_Curve(flat, closed, _name(entity)))
        else:
            passed_over["curves without a length"] = passed_over.get("curves without a length", 0) + 1
    return by_layer, passed_over


def _flattened(entity: DXFEntity, chord: float) -> Tuple[np.ndarray, bool]:
    """Points `[n][3]` of a curve in the file's units, and whether it is closed."""
    kind = entity.dxftype()
    if kind == "LINE":
        return _array([entity.dxf.start, entity.dxf.end]), False
    if kind in ("ARC", "CIRCLE", "ELLIPSE"):
        # A chord longer than the diameter would leave no polygon.
        radius = entity.dxf.major_axis.magnitude * entity.dxf.ratio if kind == "ELLIPSE" else entity.dxf.radius
        points = _array(entity.flattening(min(chord, 0.1 * radius)))
        turn = entity.dxf.end_param - entity.dxf.start_param if kind == "ELLIPSE" else 0.0
        return points, kind == "CIRCLE" or (kind == "ELLIPSE" and abs(abs(turn) - 2.0 * np.pi) < 1e-9)
    if kind == "SPLINE":
        return _array(entity.flattening(chord, segments=8)), bool(entity.closed)
    parts = [_flattened(part, chord)[0] for part in entity.virtual_entities()]
    if not parts:
        return np.zeros((0, 3)), False
    return np.concatenate(_in_line(parts)), bool(entity.is_closed)


def _in_line(parts: List[np.ndarray]) -> List[np.ndarray]:
    """Parts that follow each other, each turned so that it begins where the one before ends: ezdxf gives an arc counter-clockwise, however it is passed."""
    best: Tuple[float, List[np.ndarray]] = (np.inf, [])
    for first in (parts[0], parts[0][::-1]):
        line, gaps = [first], 0.0
        for part in parts[1:]:
            end = line[-1][-1]
            there, turned = np.linalg.norm(part[0] - end), np.linalg.norm(part[-1] - end)
            line.append(part if there <= turned else part[::-1])
            gaps += float(min(there, turned))
        if gaps < best[0]:
            best = (gaps, line)
    return best[1]


def _array(points: Iterable) -> np.ndarray:
    rows = [(float(p[0]), float(p[1]), float(p[2]) if len(p) > 2 else 0.0) for p in points]
    return np.array(rows, dtype=float).reshape(-1, 3)


def _distinct(points: np.ndarray) -> np.ndarray:
    """Without points that repeat the one before."""
    if len(points) < 2:
        return points
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > SAME
    return points[np.concatenate([[True], apart])]


def _chosen(path: Path, curves: Dict[str, List[_Curve]], layers: Optional[Dict[str, str]]) -> Dict[str, str]:
    if not layers:
        if len(curves) == 1:
            return {"outline": next(iter(curves))}
        there = ", ".join(repr(name) for name in sorted(curves))
        raise DrawingError(f"{path}: curves lie on {len(curves)} layers: {there}; expected `layers`, a name of an outline and its layer for each: `layers: {{blank: {sorted(curves)[0]}}}`")
    # Names of layers are the same in capitals and small letters.
    spelt = {name.lower(): name for name in curves}
    chosen = {}
    for name, layer in layers.items():
        if layer.lower() not in spelt:
            there = ", ".join(repr(known) for known in sorted(curves))
            raise DrawingError(f"{path}: there is no curve on a layer {layer!r}, which `layers.{name}` names; curves lie on {there}")
        chosen[name] = spelt[layer.lower()]
    return chosen


def _at(point: Sequence[float]) -> str:
    return f"({1e3 * point[0]:.4f}, {1e3 * point[1]:.4f}) mm"


def _join(path: Path, layer: str, curves: List[_Curve], tolerance: float) -> List[_Curve]:
    """Closed contours: curves that are closed, and open ones whose ends meet within the tolerance."""
    contours: List[_Curve] = []
    rest: List[_Curve] = []
    for curve in curves:
        ends = float(np.linalg.norm(curve.points[0] - curve.points[-1]))
        if curve.closed:
            contours.append(curve)
        elif ends <= tolerance and len(curve.points) > 3:
            contours.append(_Curve(_closed([curve.points]), True, curve.name))
        else:
            rest.append(curve)
    where = f"{path}: layer {layer!r}"
    ends = np.array([p for c in rest for p in (c.points[0], c.points[-1])]).reshape(-1, 2)
    partner = _partners(where, rest, ends, tolerance)
    used = [False] * len(rest)
    for begin in range(len(rest)):
        if used[begin]:
            continue
        parts, end = [], 2 * begin + 1
        while True:
            curve = end // 2
            used[curve] = True
            points = rest[curve].points
            # Left at its last point, a curve is passed as it was drawn.
            parts.append(points if end % 2 == 1 else points[::-1])
            entered = partner[end]
            if entered // 2 == begin:
                break
            end = entered ^ 1
        name = " and others".join([rest[begin].name, ""]) if len(parts) > 1 else rest[begin].name
        contours.append(_Curve(_closed(parts), True, name))
    for contour in contours:
        if len(contour.points) > MOST_CORNERS:
            raise DrawingError(
                f"{where}: the contour with {contour.name} has {len(contour.points)} corners; expected at most {MOST_CORNERS}: take a larger `chord`"
            )
    return contours


def _closed(parts: List[np.ndarray]) -> np.ndarray:
    """One contour of parts that follow each other, the first corner not repeated; where two meet, their middle."""
    rows: List[np.ndarray] = []
    for k, part in enumerate(parts):
        before = parts[k - 1]
        own = part[:-1].copy()
        own[0] = 0.5 * (before[-1] + part[0])
        rows.append(own)
    return _distinct(np.concatenate(rows))


def _partners(where: str, curves: List[_Curve], ends: np.ndarray, tolerance: float) -> List[int]:
    """For each end (2 k: the first point of curve k, 2 k + 1: its last) the one that it meets."""
    partner = []
    for k, end in enumerate(ends):
        apart = np.linalg.norm(ends - end, axis=1)
        apart[k] = np.inf
        near = np.flatnonzero(apart <= tolerance)
        name = curves[k // 2].name
        if len(near) == 0:
            nearest = int(np.argmin(apart)) if len(ends) > 1 else None
            other = "" if nearest is None else f"; the nearest end of another, of {curves[nearest // 2].name}, is {1e3 * apart[nearest]:.4g} mm away"
            raise DrawingError(
                f"{where}: an open contour: {name} ends at {_at(end)}{other}. Expected closed contours: close it, or take a larger `tolerance` "
                f"({1e3 * tolerance:g} mm)"
            )
        if len(near) > 1:
            others = ", ".join(curves[n // 2].name for n in near)
            raise DrawingError(
                f"{where}: {len(near) + 1} curves meet at {_at(end)}: {name}, {others}. Expected two at each corner: remove what is drawn twice, put it on a "
                f"layer of its own, or take a smaller `tolerance` ({1e3 * tolerance:g} mm)"
            )
        partner.append(int(near[0]))
    return partner


def _nested(path: Path, layer: str, contours: List[_Curve]) -> Outline:
    """The contour around all others, with those as its holes."""
    where = f"{path}: layer {layer!r}"
    polygons = []
    for contour in contours:
        polygon = shapely.Polygon(contour.points) if len(contour.points) > 2 else None
        if polygon is None or polygon.convex_hull.area <= 0.0:
            raise DrawingError(f"{where}: the contour with {contour.name} at {_at(contour.points[0])} has no area; remove it or draw it again")
        if not polygon.is_valid:
            raise DrawingError(f"{where}: the contour with {contour.name} crosses or touches itself {_reason(polygon)}; draw it again without")
        polygons.append(orient(polygon))
    order = sorted(range(len(polygons)), key=lambda k: -polygons[k].area)
    outer, inner = order[0], order[1:]
    for k in inner:
        if not polygons[outer].contains_properly(polygons[k]):
            at = _at(polygons[k].exterior.coords[0])
            raise DrawingError(
                f"{where}: the contour with {contours[k].name} at {at} does not lie inside of the largest one, with {contours[outer].name}; expected one outline "
                "with its holes on a layer: put others on layers of their own"
            )
    for i, k in enumerate(inner):
        for other in inner[:i]:
            if polygons[k].intersects(polygons[other]):
                at = polygons[k].intersection(polygons[other]).representative_point()
                raise DrawingError(
                    f"{where}: the holes with {contours[k].name} and {contours[other].name} cross, touch or lie in each other at {_at((at.x, at.y))}; expected holes "
                    "apart from each other"
                )
    # In the order of the file, so that a hole keeps its number.
    corners = [np.asarray(p.exterior.coords)[:-1] for p in polygons]
    return Outline(corners[outer], [corners[k] for k in sorted(inner)])


def _reason(polygon: shapely.Polygon) -> str:
    text = explain_validity(polygon)
    inside = text[text.find("[") + 1 : text.find("]")].split()
    try:
        return "at " + _at([float(inside[0]), float(inside[1])])
    except (IndexError, ValueError):
        return f"({text})"


def _moved(outline: Outline) -> Outline:
    low, high = outline.outline.min(axis=0), outline.outline.max(axis=0)
    middle = 0.5 * (low + high)
    return Outline(outline.outline - middle, [hole - middle for hole in outline.holes])
