"""Artifacts: what a step has written, as numpy arrays with their units.

An artifact is one HDF5 file of `the data model`_. All numbers are in SI units. Arrays are row-major with the last index fastest, frames are
counted from 0, and -1 is the last.

.. _the data model: schemas/data-model.md
"""

from __future__ import annotations

import json
import operator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Iterator, Mapping

import h5py
import numpy as np
import numpy.typing as npt

from ._ask import PathLike, ask, needed
from .errors import Damaged, NotFound, PlyflowError

__all__ = ["Artifact", "Body", "FieldInfo", "Number", "Values"]

Floats = npt.NDArray[np.float64]
# The one version of the data model that there is.
_DATA_MODEL = 1


class Values(np.ndarray):
    """A numpy array that knows its unit.

    What is cut out of it keeps the unit. What is computed from it is a plain array: nobody but you knows the unit of that.

    Attributes:
        unit: SI unit, ``"1"`` where there is none.

    >>> angles = Values.of(np.array([0.1, 0.2]), "rad")
    >>> angles[1:].unit
    'rad'
    >>> np.degrees(angles).round(1)
    array([ 5.7, 11.5])
    """

    unit: str

    @classmethod
    def of(cls, values: npt.ArrayLike, unit: str) -> Values:
        """The same values with a unit."""
        out = np.asarray(values).view(cls)
        out.unit = unit
        return out

    def __array_finalize__(self, source: Any) -> None:
        self.unit = getattr(source, "unit", "1")

    def __array_ufunc__(self, ufunc: Any, method: Any, *inputs: Any, **kwargs: Any) -> Any:
        bare = [np.asarray(i) if isinstance(i, Values) else i for i in inputs]
        if "out" in kwargs:
            kwargs["out"] = tuple(np.asarray(o) if isinstance(o, Values) else o for o in kwargs["out"])
        return getattr(ufunc, method)(*bare, **kwargs)

    def __reduce__(self) -> Any:
        return Values.of, (np.asarray(self), self.unit)


class Number(float):
    """A number that knows its unit. What is computed from it is a plain ``float``.

    Attributes:
        unit: SI unit, ``"1"`` where there is none.

    >>> Number(0.5, "rad").unit
    'rad'
    """

    unit: str

    def __new__(cls, value: float, unit: str) -> Number:
        out = super().__new__(cls, value)
        out.unit = unit
        return out

    def __getnewargs__(self) -> Any:
        return float(self), self.unit


@dataclass(frozen=True)
class FieldInfo:
    """What is known of a field without reading it.

    Attributes:
        name: in full, such as ``shear_angle``.
        on: ``points`` or ``cells``.
        components: numbers at each point or cell.
        unit: SI unit.
    """

    name: str
    on: str
    components: int
    unit: str


class Artifact:
    """One artifact, open for reading. Use it in a ``with`` block, or call :meth:`close`.

    Args:
        path: the file.
        verify: whether the program looks first whether the bytes are those that were written. It reads the whole file once.

    Attributes:
        path: the file.
        kind: such as ``forming``, ``defects``, ``comparison``.
        verified: whether the file was found to be as it was written. False: no record lies beside it, or ``verify=False`` was said, so
            nobody knows.
        attributes: what the step tells besides numbers (`schemas/data-model.md` lists it by kind).
        provenance: step, item, parameters in SI units, plugin with version and hash, keys of inputs, content key.
        times: [frames], s.

    Raises:
        NotFound: there is no such file.
        Damaged: the file is not as it was written.
        PlyflowError: it is no artifact, or of another version of the data model.
    """

    def __init__(self, path: PathLike, verify: bool = True) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise NotFound(f"there is no file {self.path}")
        self.verified = bool(verify and ask(["inspect", "--format", "json", "--", self.path])["verified"])
        try:
            self._file = h5py.File(self.path, "r")
        except OSError as error:
            raise PlyflowError(f"{self.path}: no HDF5 file that can be read: {error}") from error
        try:
            head = self._file["plyflow"].attrs
            version = int(head["data_model"])
            self.kind = _text(head["kind"])
            self.attributes: dict[str, Any] = json.loads(_text(head["attributes"]))
            self.provenance: dict[str, Any] = json.loads(_text(head["provenance"]) or "{}")
            self._results: list[dict[str, Any]] = json.loads(_text(head["results"]))
            self._contents: dict[str, Any] = json.loads(_text(head["contents"]))
            self.times: Floats = np.asarray(self._file["plyflow/times"], dtype=np.float64) if "times" in self._file["plyflow"] else np.empty(0)
        except KeyError as error:
            self._file.close()
            raise PlyflowError(f"{self.path}: no artifact of Plyflow: {error.args[0]}") from error
        if version != _DATA_MODEL:
            self._file.close()
            raise PlyflowError(f"{self.path}: data model {version}; this package reads {_DATA_MODEL}: install the Plyflow that wrote it")

    def close(self) -> None:
        """Closes the file. Arrays that were read stay."""
        self._file.close()

    def __enter__(self) -> Artifact:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        step = self.provenance.get("step")
        return f"<Artifact {self.kind}{f' of {step}' if step else ''}: {', '.join(self.bodies) or 'no bodies'}, {self.frames} frames>"

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self._contents["frames"])

    @property
    def bodies(self) -> list[str]:
        """Names of the bodies, in the order of the file: those of plies and films are names of the scene."""
        return [b["name"] for b in self._contents["bodies"]]

    def __getitem__(self, body: str) -> Body:
        """A body by its name.

        Raises:
            NotFound: there is none of this name; lists all.
        """
        for told in self._contents["bodies"]:
            if told["name"] == body:
                return Body(self, told)
        raise NotFound(f"{self.path.name}: no body '{body}'; there are: {', '.join(self.bodies) or 'none'}")

    def __iter__(self) -> Iterator[Body]:
        return (self[name] for name in self.bodies)

    def __len__(self) -> int:
        return len(self.bodies)

    @property
    def results(self) -> dict[str, Number]:
        """The named numbers that the step reported, each with its unit (SI)."""
        return {r["name"]: Number(r["value"], r["unit"]) for r in self._results}

    @property
    def files(self) -> dict[str, str | bytes]:
        """The files that the artifact carries, such as a material file or a mesh for another program: contents by name. A file of bytes is ``bytes``."""
        return {f["name"]: f["text"] if f.get("array") is None else self.array(f["array"]).tobytes() for f in self.attributes.get("files", ())}

    def write_files(self, folder: PathLike) -> list[Path]:
        """Writes the files into a folder, which is made if need be. A file that is there with another content is left alone.

        Raises:
            NotFound: the artifact carries none.
            PlyflowError: a file is there with another content, and nothing was written, or a name leads out of the folder.
        """
        files = self.files
        if not files:
            raise NotFound(f"{self!r} carries no files")
        to = Path(folder)
        to.mkdir(parents=True, exist_ok=True)
        contents = {name: content.encode() if isinstance(content, str) else content for name, content in files.items()}
        for name, content in contents.items():
            if name in (".", "..") or "/" in name or "\\" in name or "\0" in name:
                raise PlyflowError(f"{self.path.name}: the file name {name!r} leads out of the folder; nothing was written")
            if (to / name).exists() and (to / name).read_bytes() != content:
                raise PlyflowError(f"{to / name} is there with another content, and nothing was written: name another folder, or remove it")
        for name, content in contents.items():
            (to / name).write_bytes(content)
        return [to / name for name in contents]

    @property
    def fields(self) -> dict[str, list[FieldInfo]]:
        """By body, which fields there are."""
        return {body.name: list(body.fields.values()) for body in self}

    @property
    def arrays(self) -> list[str]:
        """Paths of the free arrays, such as ``history/kinetic``."""
        return [a["path"] for a in self._contents["arrays"]]

    def array(self, path: str) -> Values:
        """A free array whole, in the shape and unit that the data model tells of its kind.

        Raises:
            NotFound: there is none of this path; lists all.
        """
        told = next((a for a in self._contents["arrays"] if a["path"] == path), None)
        if told is None:
            raise NotFound(f"{self.path.name}: no array '{path}'; there are: {', '.join(self.arrays) or 'none'}")
        return Values.of(self._open(f"data/{path}")[()], told["unit"])

    def tables(self) -> dict[str, Any]:
        """The tables of the artifact by name, each as a pandas DataFrame whose ``attrs["units"]`` has the units (SI) of its columns.

        Numbers that are measured of the machine are in the record beside the artifact, and missing here.

        Raises:
            MissingPackage: pandas is not installed.
        """
        pandas = needed("pandas", "a table as a frame")
        out = {}
        for table in self.attributes.get("tables", ()):
            labels = [c["label"] for c in table["columns"]]
            frame = pandas.DataFrame(table["rows"], columns=labels)
            frame.attrs.update(title=table.get("title", table["name"]), units={c["label"]: c.get("unit", "1") for c in table["columns"]})
            out[table["name"]] = frame
        return out

    def _open(self, path: str) -> Any:
        if not self._file:
            raise PlyflowError(f"{self.path.name} was closed: read what you need inside of the `with` block, or open it again")
        return self._file[path]

    def _frame(self, frame: int) -> int:
        """A frame counted from 0, whatever end it was counted from."""
        count = max(self.frames, 1)
        try:
            frame = operator.index(frame)
        except TypeError:
            raise TypeError(f"a frame is a whole number, 0 to {count - 1}, or -1 for the last; given {frame!r}") from None
        if not -count <= frame < count:
            raise NotFound(f"{self.path.name}: no frame {frame}; there are {count}: 0 to {count - 1}, or -1 for the last")
        return frame % count


class Body:
    """A mesh with its fields. It reads from its artifact, which must be open still.

    Attributes:
        name: its name.
        attributes: what the step tells of it.
    """

    def __init__(self, artifact: Artifact, told: Mapping[str, Any]) -> None:
        self._artifact = artifact
        self._told = told
        self.name = str(told["name"])
        self.attributes: dict[str, Any] = dict(told.get("attributes") or {})

    def __repr__(self) -> str:
        return f"<Body {self.name}: {self._told['points']} points, {self._told['cells']} cells, {', '.join(self.fields) or 'no fields'}>"

    @property
    def is_moving(self) -> bool:
        """Whether its points are elsewhere in other frames."""
        return bool(self._told["moving"])

    @property
    def points(self) -> Values:
        """[n][3], m: its points in the last frame."""
        return self.points_at(-1)

    def points_at(self, frame: int) -> Values:
        """[n][3], m: its points in a frame.

        Raises:
            NotFound: there is no such frame.
        """
        count, at = int(self._told["points"]), self._artifact._frame(frame)
        start = at * count if self.is_moving else 0
        return Values.of(self._read("Points", start, count), "m")

    @property
    def reference(self) -> Values:
        """[n][3], m: its points before anything moved. For a ply: flat, in the stack."""
        if not self.is_moving:
            return self.points
        return Values.of(self._artifact._open(f"plyflow/reference/{self.name}")[()], "m")

    @property
    def cells(self) -> npt.NDArray[np.int64]:
        """[m][3] or [m][4]: indices of the points of each triangle or quad, counter-clockwise seen from the side of the normal."""
        nodes = int(self._told["nodes_per_cell"])
        total = int(self._told["cells"]) * nodes
        return np.asarray(self._read("Connectivity", 0, total), dtype=np.int64).reshape(-1, nodes)

    @property
    def fields(self) -> dict[str, FieldInfo]:
        """Its fields by name."""
        return {f["name"]: FieldInfo(f["name"], f["on"], int(f["components"]), f["unit"]) for f in self._told["fields"]}

    def field(self, name: str, frame: int = -1) -> Values:
        """[n] or [n][components], single precision: a field in a frame, by point or by cell (:attr:`fields` says which).

        Raises:
            NotFound: there is no such field, with a list of all, or no such frame.
        """
        fields = self.fields
        if name not in fields:
            raise NotFound(f"{self.name}: no field '{name}'; there are: {', '.join(fields) or 'none'}")
        info = fields[name]
        count = int(self._told[info.on])
        group = "PointData" if info.on == "points" else "CellData"
        values = self._read(f"{group}/{name}", self._artifact._frame(frame) * count, count)
        return Values.of(values, info.unit)

    def __getitem__(self, name: str) -> Values:
        """A field in the last frame."""
        return self.field(name)

    def triangles(self) -> npt.NDArray[np.int64]:
        """[k][3]: its cells as triangles, quads cut along their first diagonal: for matplotlib's ``tripcolor``."""
        cells = self.cells
        if cells.shape[1] == 3:
            return cells
        return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])

    def on_triangles(self, values: npt.ArrayLike) -> npt.NDArray[Any]:
        """[k]: values by cell, one for each of :meth:`triangles`."""
        values = np.asarray(values)
        return values if self._told["nodes_per_cell"] == 3 else np.concatenate([values, values])

    def to_pyvista(self, frame: int = -1) -> Any:
        """The body in a frame as a ``pyvista.UnstructuredGrid`` with all its fields. Units stand in ``field_data["units"]`` as ``name=unit``.

        Raises:
            MissingPackage: pyvista is not installed.
            NotFound: there is no such frame.
        """
        pyvista = needed("pyvista", "a mesh of pyvista")
        cells = self.cells
        nodes = cells.shape[1]
        table = np.hstack([np.full((len(cells), 1), nodes, dtype=np.int64), cells]).ravel()
        kind = pyvista.CellType.TRIANGLE if nodes == 3 else pyvista.CellType.QUAD
        kinds = np.full(len(cells), int(kind), dtype=np.uint8)
        grid = pyvista.UnstructuredGrid(table, kinds, np.asarray(self.points_at(frame)))
        for info in self.fields.values():
            data = grid.point_data if info.on == "points" else grid.cell_data
            data[info.name] = np.asarray(self.field(info.name, frame))
        grid.field_data["units"] = [f"{f.name}={f.unit}" for f in self.fields.values()] or [""]
        return grid

    def _read(self, name: str, start: int, count: int) -> Any:
        data = self._artifact._open(f"VTKHDF/{self.name}/{name}")
        if len(data) < start + count:
            raise Damaged(f"{self._artifact.path}: {self.name}/{name} has {len(data)} rows, and {start + count} were expected")
        return data[start : start + count]


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)
