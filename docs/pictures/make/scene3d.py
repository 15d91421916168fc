"""Draws triangles into a picture with a depth buffer: no display, no graphics driver, the same bytes on every machine.

The projection is parallel, so that one scale bar holds for lengths across the line of sight.
"""

import dataclasses

import numpy as np

# How many times finer than the picture is drawn, for smooth edges.
FINER = 2
# Candidate pixels that are judged at once.
BATCH = 3_000_000


def triangles(cells: np.ndarray) -> np.ndarray:
    """Triangles of cells: quads are cut along their first diagonal."""
    if cells.shape[1] == 3:
        return cells
    return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])


def normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals at the points, means of those of the triangles around by their areas."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    of_faces = np.cross(b - a, c - a)
    sums = np.stack([np.bincount(faces.ravel(), np.repeat(of_faces[:, k], 3), len(points)) for k in range(3)], axis=1)
    return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-30)


@dataclasses.dataclass
class Camera:
    """Looks at `target` from a direction; `width` metres fill the picture's width."""

    azimuth: float
    elevation: float
    target: tuple[float, float, float]
    width: float

    def axes(self) -> np.ndarray:
        """Unit vectors to the right, upwards and towards the eye, as rows."""
        a, e = np.radians(self.azimuth), np.radians(self.elevation)
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, np.cross(towards, right), towards])


class View:
    """A picture of bodies, `size` = (width, height) in pixels."""

    def __init__(self, size: tuple[int, int], camera: Camera):
        self.size, self.camera = size, camera
        self.columns, self.rows = size[0] * FINER, size[1] * FINER
        n = self.columns * self.rows
        self.depth = np.full(n, -np.inf)
        self.colour = np.ones((n, 3))
        self.normal = np.zeros((n, 3))
        self.lit = np.zeros(n, bool)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Column and row in pixels of the picture, and depth towards the eye in m."""
        p = (np.atleast_2d(points) - np.asarray(self.camera.target)) @ self.camera.axes().T
        scale = self.size[0] / self.camera.width
        return np.stack([self.size[0] / 2 + scale * p[:, 0], self.size[1] / 2 - scale * p[:, 1], p[:, 2]], axis=1)

    def surface(self, points, cells, colours, lift: float = 0.0):
        """A lit surface with a colour [3] or colours by point [n][3]; `lift` m are added to its depth."""
        faces = triangles(np.asarray(cells))
        shade = normals(points, faces)
        at = self.project(points)
        at[:, :2] *= FINER
        at[:, 2] += lift
        colours = np.broadcast_to(np.asarray(colours, float), (len(points), 3))
        corners = at[faces]
        low = np.floor(corners[:, :, :2].min(axis=1)).astype(int)
        high = np.ceil(corners[:, :, :2].max(axis=1)).astype(int) + 1
        low = np.maximum(low, 0)
        high = np.minimum(high, [self.columns, self.rows])
        extent = np.maximum(high - low, 0)
        counts = extent[:, 0] * extent[:, 1]
        ends = np.cumsum(counts)
        start = 0
        while start < len(faces):
            stop = max(start + 1, int(np.searchsorted(ends, (ends[start - 1] if start else 0) + BATCH)))
            self._batch(faces[start:stop], corners[start:stop], low[start:stop], extent[start:stop], shade, colours)
            start = stop

    def _batch(self, faces, corners, low, extent, shade, colours):
        counts = extent[:, 0] * extent[:, 1]
        which = np.repeat(np.arange(len(faces)), counts)
        within = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        column = low[which, 0] + within % np.maximum(extent[which, 0], 1)
        row = low[which, 1] + within // np.maximum(extent[which, 0], 1)
        a, b, c = (corners[which, k] for k in range(3))
        x, y = column + 0.5, row + 0.5
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        area = np.where(np.abs(area) < 1e-12, np.inf, area)
        u = ((b[:, 0] - x) * (c[:, 1] - y) - (b[:, 1] - y) * (c[:, 0] - x)) / area
        v = ((c[:, 0] - x) * (a[:, 1] - y) - (c[:, 1] - y) * (a[:, 0] - x)) / area
        w = 1 - u - v
        inside = (u >= 0) & (v >= 0) & (w >= 0) & np.isfinite(area)
        which, u, v, w = which[inside], u[inside], v[inside], w[inside]
        pixel = row[inside] * self.columns + column[inside]
        depth = u * corners[which, 0, 2] + v * corners[which, 1, 2] + w * corners[which, 2, 2]
        np.maximum.at(self.depth, pixel, depth)
        top = depth >= self.depth[pixel]
        which, u, v, w, pixel = which[top], u[top], v[top], w[top], pixel[top]
        weights = np.stack([u, v, w], axis=1)[:, :, None]
        nodes = faces[which]
        self.colour[pixel] = (weights * colours[nodes]).sum(axis=1)
        self.normal[pixel] = (weights * shade[nodes]).sum(axis=1)
        self.lit[pixel] = True

    def lines(self, paths, colour, width: float, lift: float = 0.002, share: float = 1.0):
        """Lines along paths [k][3] in m, `width` pixels wide, hidden by what is more than `lift` m nearer to the eye.

        `share` is how much of the colour covers what is below.
        """
        radius = width * FINER / 2
        reach = int(np.ceil(radius))
        stamp = [(i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1) if i * i + j * j <= radius * radius]
        places = []
        for path in paths:
            at = self.project(path)
            at[:, :2] *= FINER
            for p, q in zip(at[:-1], at[1:]):
                steps = int(np.ceil(2 * np.hypot(*(q - p)[:2]))) + 1
                places.append(p + np.linspace(0, 1, steps)[:, None] * (q - p))
        if not places:
            return
        places = np.concatenate(places)
        covered = []
        for i, j in stamp:
            column, row = np.floor(places[:, 0]).astype(int) + i, np.floor(places[:, 1]).astype(int) + j
            ok = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
            pixel = row[ok] * self.columns + column[ok]
            covered.append(pixel[places[ok, 2] + lift >= self.depth[pixel]])
        covered = np.unique(np.concatenate(covered))
        self.colour[covered] = (1 - share) * self.colour[covered] + share * np.asarray(colour)

    def picture(self) -> np.ndarray:
        """The picture [height][width][3], 0 to 1, on white."""
        normal = self.normal @ self.camera.axes().T
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        # Sheets are seen from both sides.
        normal *= np.where(normal[:, 2:] < 0, -1, 1)
        key = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
        light = 0.58 + 0.42 * np.clip(normal @ key, 0, None) + 0.06 * normal[:, 2]
        light = np.where(self.lit, light * self._hollows(), 1.0)
        shown = np.clip(self.colour * light[:, None], 0, 1)
        shown = np.where(self.lit[:, None], shown, self.colour)
        shown = shown.reshape(self.size[1], FINER, self.size[0], FINER, 3)
        return shown.mean(axis=(1, 3))

    def _hollows(self) -> np.ndarray:
        """Darkens what lies deeper than its surroundings, which shows folds and steps."""
        depth = self.depth.reshape(self.rows, self.columns)
        known = np.isfinite(depth)
        if not known.any():
            return np.ones(self.depth.size)
        floor = depth[known].min()
        filled = np.where(known, depth, floor)
        reach = max(2, self.columns // 90)
        around = filled
        for _ in range(2):
            around = _mean(_mean(around, reach, 0), reach, 1)
        # Compared over a length of one hundredth of what the picture shows.
        step = np.clip((around - filled) / (self.camera.width / 60), 0, 1)
        return (1 - 0.45 * step).ravel()


def _mean(values: np.ndarray, reach: int, axis: int) -> np.ndarray:
    """Mean over 2 reach + 1 neighbours along an axis."""
    pad = [(0, 0), (0, 0)]
    pad[axis] = (reach + 1, reach)
    sums = np.cumsum(np.pad(values, pad, mode="edge"), axis=axis)
    n = values.shape[axis]
    width = 2 * reach + 1
    high = np.take(sums, np.arange(width, width + n), axis=axis)
    low = np.take(sums, np.arange(n), axis=axis)
    return (high - low) / width


def grid_lines(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The edges of quads as paths [k][2][3], each once."""
    edges = np.concatenate([cells[:, [k, (k + 1) % cells.shape[1]]] for k in range(cells.shape[1])])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    return points[edges]


def rim(cells: np.ndarray) -> np.ndarray:
    """Edges [k][2] that one cell has alone."""
    edges = np.concatenate([cells[:, [k, (k + 1) % cells.shape[1]]] for k in range(cells.shape[1])])
    ordered, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return ordered[counts == 1]


def section(points: np.ndarray, faces: np.ndarray, x: float) -> np.ndarray:
    """Where triangles meet the plane at x: segments [k][2][2] of (y, z) in m."""
    # A plane just beside the nodes, so that no edge lies in it.
    side = points[:, 0] - (x + 1e-7)
    found = []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        # The corner i lies alone on its side.
        a, b, c = faces[:, i], faces[:, j], faces[:, k]
        cut = (side[a] * side[b] < 0) & (side[a] * side[c] < 0)
        ends = []
        for other in (b, c):
            share = side[a[cut]] / (side[a[cut]] - side[other[cut]])
            ends.append(points[a[cut]] + share[:, None] * (points[other[cut]] - points[a[cut]]))
        found.append(np.stack(ends, axis=1)[:, :, 1:])
    return np.concatenate(found)
