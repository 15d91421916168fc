"""Makes the files of this folder that stand for those of a design office: `python make_files.py` writes hat.stl, layup/plies.dxf and layup/doubler.csv.

They are kept in the repository, so that nobody has to run this. It needs numpy.
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
LENGTH, WIDTH, HEIGHT, DRAFT, RADIUS, CORNER = 300.0, 101.0, 40.0, 8.0, 8.0, 22.0
"""The hat in mm (RADIUS: of its upper edge, CORNER: of its foot), and its draft in degrees."""

PLACE = np.array([12_450.0, 1_980.0, -310.0])
"""Where the middle of its foot lies in the aircraft (mm): x aft, y outboard, z up. The hat points outboard."""


def ring(inset: float, height: float, shrunk: float = 1.0) -> np.ndarray:
    """A rounded rectangle `[n][3]`, counter-clockwise from above, that lies inside of the foot by `inset`; `shrunk` draws it together across."""
    half = np.array([0.5 * LENGTH - inset, 0.5 * WIDTH - inset])
    radius = CORNER - inset
    corners = []
    for quarter, sign in enumerate(([1, 1], [-1, 1], [-1, -1], [1, -1])):
        angles = np.radians(np.linspace(90 * quarter, 90 * quarter + 90, 8))
        corners.append(np.array(sign) * (half - radius) + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
    points = []
    for quarter, corner in enumerate(corners):
        # Points along the straight side that follows, no farther apart than the facets of a coarse export.
        begin, end = corner[-1], corners[(quarter + 1) % 4][0]
        count = (24, 8)[quarter % 2]
        points += [corner, begin + (end - begin) * np.linspace(0.0, 1.0, count + 1)[1:-1, None]]
    flat = np.concatenate(points)
    # Towards the line along the middle of the top.
    ridge = np.column_stack([np.clip(flat[:, 0], -0.5 * (LENGTH - WIDTH), 0.5 * (LENGTH - WIDTH)), np.zeros(len(flat))])
    return np.column_stack([ridge + shrunk * (flat - ridge), np.full(len(flat), height)])


def hat() -> None:
    """Walls that lean inwards, a round upper edge and a flat top; open at the foot."""
    draft = np.radians(DRAFT)
    # Where the round edge begins on the wall: it touches wall and top.
    rise = RADIUS * (1.0 - np.sin(draft))
    begin = (HEIGHT - rise) * np.tan(draft)
    rings = [ring(share * begin, share * (HEIGHT - rise)) for share in np.linspace(0.0, 1.0, 4)]
    for turn in np.linspace(draft, 0.5 * np.pi, 8)[1:]:
        inset = begin + RADIUS * (np.cos(draft) - np.cos(turn))
        rings.append(ring(inset, HEIGHT - RADIUS * (1.0 - np.sin(turn))))
    rings += [ring(inset, HEIGHT, shrunk) for shrunk in (0.75, 0.5, 0.25)]
    facets = []
    for low, high in zip(rings, rings[1:]):
        for k in range(len(low)):
            n = (k + 1) % len(low)
            facets += [(low[k], low[n], high[n]), (low[k], high[n], high[k])]
    top, ridge = rings[-1], ring(inset, HEIGHT, 0.0)
    for k in range(len(top)):
        n = (k + 1) % len(top)
        facets.append((top[k], top[n], ridge[n]))
        # The ridge has one point for all of an end.
        if np.linalg.norm(ridge[k] - ridge[n]) > 1e-9:
            facets.append((top[k], ridge[n], ridge[k]))
    corners = np.array(facets)
    # Of the hat: x along, y across, z up; of the aircraft: x along, y up, -z across.
    turned = np.stack([corners[..., 0], corners[..., 2], -corners[..., 1]], axis=-1) + PLACE
    record = np.zeros(len(turned), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    record["corners"] = turned
    (HERE / "hat.stl").write_bytes(b"hat stringer".ljust(80) + np.uint32(len(record)).tobytes() + record.tobytes())


def drawing() -> None:
    """The flat patterns of two plies on a layer each, in mm, as lines, arcs and a circle."""
    words: list[str] = []

    def add(*pairs: object) -> None:
        words.extend(str(p) for p in pairs)

    add(0, "SECTION", 2, "HEADER", 9, "$INSUNITS", 70, 4, 0, "ENDSEC", 0, "SECTION", 2, "ENTITIES")
    # The skin: a rectangle with round corners, of lines and arcs.
    x, y, r = 165.0, 85.0, 20.0
    for a, b in [((-x + r, -y), (x - r, -y)), ((x, -y + r), (x, y - r)), ((x - r, y), (-x + r, y)), ((-x, y - r), (-x, -y + r))]:
        add(0, "LINE", 8, "SKIN", 10, a[0], 20, a[1], 11, b[0], 21, b[1])
    for cx, cy, begin in [(x - r, -y + r, 270), (x - r, y - r, 0), (-x + r, y - r, 90), (-x + r, -y + r, 180)]:
        add(0, "ARC", 8, "SKIN", 10, cx, 20, cy, 40, r, 50, begin, 51, (begin + 90) % 360)
    # The cap of the crown: a strip with round ends, its corners and bulges in one polyline, and a drain hole.
    add(0, "POLYLINE", 8, "CAP", 66, 1, 70, 1)
    for px, py, bulge in [(-100, -25, 0), (100, -25, 1), (100, 25, 0), (-100, 25, 1)]:
        add(0, "VERTEX", 8, "CAP", 10, px, 20, py, 42, bulge)
    add(0, "SEQEND", 8, "CAP")
    add(0, "CIRCLE", 8, "CAP", 10, 80, 20, 0, 40, 8)
    add(0, "TEXT", 8, "NOTES", 10, -60, 20, 100, 40, 6, 1, "HAT STRINGER, FLAT PATTERNS")
    add(0, "ENDSEC", 0, "EOF")
    lines = [f"{code:>3}\n{value}" for code, value in zip(words[::2], words[1::2])]
    (HERE / "layup" / "plies.dxf").write_text("\n".join(lines) + "\n", encoding="ascii")


def doubler() -> None:
    """A trapezoid as a table of corners: the doubler of one end, drawn across, so that it is turned into its place."""
    corners = [(-70, -60), (70, -60), (55, 40), (-55, 40)]
    (HERE / "layup" / "doubler.csv").write_text("x [mm],y [mm]\n" + "".join(f"{x},{y}\n" for x, y in corners), encoding="ascii")


if __name__ == "__main__":
    hat()
    drawing()
    doubler()
