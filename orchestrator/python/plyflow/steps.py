"""Steps in Python: a file with one decorated function is a plugin.

>>> import plyflow
>>> from plyflow import declare
>>> @plyflow.step("last-time", output="example", inputs={"formed": declare.port("forming", doc="A run.")},
...               results={"last": declare.result("s", doc="The last time.")})
... def run(step):
...     '''Tells the last time of a run.'''
...     step.report("last", step.input("formed").array("history/time")[-1])
>>> run.__plyflow__.manifest["summary"]
'Tells the last time of a run.'

A workflow names the file: ``plugin: ./last_time.py``. All numbers are in SI units.
"""

from __future__ import annotations

import json
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from . import declare
from .errors import NotFound, PlyflowError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

__all__ = ["Cancelled", "Definition", "Frame", "Input", "InputBody", "Refused", "StepRun", "defined", "step"]

_TYPES = {"float64": "f64", "float32": "f32", "int64": "i64", "uint32": "u32", "uint8": "u8"}
_NUMPY = {ours: numpy for numpy, ours in _TYPES.items()}
_WHY = {4: "not found", 5: "the sizes do not match", 6: "a value, name or unit is refused"}


class Cancelled(BaseException):
    """The run is being stopped. Every call of the step's run raises it; let it pass, after a clean-up of your own."""


class Refused(PlyflowError):
    """The program refused what the step asked for or wanted to write."""


@dataclass(frozen=True)
class Definition:
    """A function with what it declares."""

    kind: str
    manifest: Dict[str, Any]
    function: Callable[..., Any]
    #: Packages that the function imports only while it runs.
    requires: Tuple[str, ...] = ()
    #: What the kind needs besides.
    more: Mapping[str, Any] = field(default_factory=dict)


_DEFINED: List[Definition] = []


def defined() -> List[Definition]:
    """All that this process has decorated so far, in order."""
    return list(_DEFINED)


def step(
    name: str,
    *,
    output: Union[str, declare.Declaration],
    version: str = "0.1.0",
    vendor: str = "",
    role: Optional[str] = None,
    summary: Optional[str] = None,
    parameters: Optional[Mapping[str, declare.Declaration]] = None,
    inputs: Optional[Mapping[str, declare.Declaration]] = None,
    results: Optional[Mapping[str, declare.Declaration]] = None,
    requires: Sequence[str] = (),
) -> Callable[[Callable[[StepRun], Any]], Callable[[StepRun], Any]]:
    """Makes a step plugin of a function that takes a :class:`StepRun`.

    Args:
        name: of the plugin, in words with hyphens.
        output: kind of the artifact that it writes, or :func:`declare.collection`.
        version: of the plugin.
        vendor: who made it.
        role: what it does; plugins of one role fit in the same place of a workflow. As ``name`` when not given.
        summary: one sentence; else the first line of the function's docstring.
        parameters: by name, from :mod:`plyflow.declare`.
        inputs: by port.
        results: by name.
        requires: packages that are imported while the step runs and not when its file is. Their versions are part of the key.

    Raises:
        ValueError: there is no summary.
    """

    def decorate(function: Callable[[StepRun], Any]) -> Callable[[StepRun], Any]:
        first = (summary or function.__doc__ or "").strip().split("\n")[0].strip()
        if not first:
            raise ValueError(f"the step '{name}' says nowhere what it does: give its function a docstring, or `summary`")
        manifest = {
            "name": name, "version": version, "vendor": vendor or "unnamed", "kind": "step", "role": role or name, "summary": first,
            "parameters": dict(parameters or {}), "inputs": dict(inputs or {}), "output": declare._output(output), "results": dict(results or {}),
        }  # fmt: skip
        made = Definition("step", manifest, function, tuple(requires))
        _DEFINED.append(made)
        function.__plyflow__ = made  # type: ignore[attr-defined]
        return function

    return decorate


class StepRun:
    """What a running step may ask of the program: parameters, inputs, and the artifact that it writes.

    Args:
        ask: sends a request with bytes, and returns the answer with its bytes.
        job: what the step was told at its beginning.
    """

    def __init__(self, ask: Callable[[Dict[str, Any], bytes], Tuple[Dict[str, Any], bytearray]], job: Mapping[str, Any]) -> None:
        self._send = ask
        self._manifest: Dict[str, Any] = json.loads(job["manifest"])
        #: The ``with`` block as the workflow gives it, with defaults, in SI units.
        self.parameters: Dict[str, Any] = json.loads(job["parameters"])
        #: Index path of this instance where the step is fanned out, else empty.
        self.item: List[int] = json.loads(job["item"])
        #: Threads that the step may use.
        self.threads: int = job["threads"]
        self._inputs = [Input(self, given) for given in json.loads(job["inputs"])]

    def _ask(self, what: str, op: str, payload: bytes = b"", **words: Any) -> Tuple[Dict[str, Any], bytearray]:
        answer, back = self._send({"op": op, **words}, payload)
        if answer["cancelled"]:
            raise Cancelled
        if answer["code"]:
            raise Refused(f"{what}: {_WHY.get(answer['code'], 'refused')}")
        return answer, back

    # -- the run

    @property
    def cancelled(self) -> bool:
        """Whether the run is being stopped. Asking raises nothing, so that what is begun can be brought to its end."""
        return bool(self._send({"op": "cancelled"}, b"")[0]["cancelled"])

    @property
    def scratch(self) -> str:
        """A private folder, removed after the step."""
        return str(self._ask("scratch", "scratch")[0]["text"])

    def log(self, text: str) -> None:
        """Writes a line into the step's log."""
        self._ask("log", "log", level=3, text=str(text))

    def warn(self, text: str) -> None:
        """Warns: the line is kept with the artifact and shown with the run."""
        self._ask("log", "log", level=2, text=str(text))

    def progress(self, fraction: float, phase: str = "") -> None:
        """Tells how far the step is, from 0 to 1, and what it does just now."""
        self._ask("progress", "progress", fraction=float(fraction), phase=phase)

    def checkpoint(self) -> Optional[str]:
        """A folder that outlives a killed attempt of this very step; ``None`` where none is kept. ``docs/plugins/overview.md`` has the rules."""
        return self._ask("checkpoint", "checkpoint")[0]["text"] or None

    @property
    def checkpoint_due(self) -> bool:
        """Whether enough time has passed since the last checkpoint."""
        return bool(self._ask("checkpoint", "checkpoint_due")[0]["due"])

    def checkpoint_saved(self) -> None:
        """Tells that a checkpoint is on the disk."""
        self._ask("checkpoint", "checkpoint_saved")

    # -- inputs

    def inputs(self, port: Optional[str] = None) -> List[Input]:
        """What arrives, in the order of the workflow; of one port if one is named."""
        if port is not None and port not in self._manifest["inputs"]:
            raise NotFound(f"the step declares no input '{port}'; there are: {', '.join(self._manifest['inputs']) or 'none'}")
        return [i for i in self._inputs if port in (None, i.port)]

    def input(self, port: str) -> Input:
        """The one artifact that arrives at a port.

        Raises:
            NotFound: there is none, or more than one.
        """
        found = self.inputs(port)
        if len(found) != 1:
            raise NotFound(f"the input '{port}' needs one artifact and has {len(found)}")
        return found[0]

    # -- the artifact

    def write_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Writes the artifact's attributes, once."""
        self._ask("attributes", "attributes_write", text=_json(attributes))

    def write_array(self, path: str, values: ArrayLike, unit: str) -> None:
        """Writes an array of at most four dimensions.

        Args:
            path: such as ``history/time``.
            values: numbers. Whole numbers other than ``uint32`` and ``uint8`` are written as ``int64``.
            unit: a plain one of SI.
        """
        array = _plain(values, f"array '{path}'")
        words = {"path": path, "unit": unit, "dtype": _TYPES[array.dtype.name], "shape": list(array.shape)}
        self._ask(f"array '{path}'", "array_write", array.tobytes(), **words)

    def define_mesh(self, body: str, points: ArrayLike, cells: ArrayLike, attributes: Optional[Mapping[str, Any]] = None) -> None:
        """Defines a body, before the first frame.

        Args:
            body: its name.
            points: ``[n][3]``, m, at the reference position.
            cells: ``[m][3]`` or ``[m][4]``, numbers of points.
            attributes: what readers should know of it.
        """
        import numpy as np

        places = _doubles(points, f"points of '{body}'", 2)
        given = np.asarray(cells)
        if given.ndim != 2 or given.dtype.kind not in "iu" or (given.size and not 0 <= given.min() <= given.max() < len(places)):
            raise ValueError(f"cells of '{body}': expected whole numbers [m][3] or [m][4] of points from 0 to {len(places) - 1}")
        numbers = np.ascontiguousarray(given, dtype=np.uint32)
        words = {"points": len(places), "cells": len(numbers), "nodes_per_cell": numbers.shape[1], "attributes": _json(attributes or {})}
        self._ask(f"body '{body}'", "mesh_define", places.tobytes() + numbers.tobytes(), body=body, **words)

    @contextmanager
    def frame(self, time: float) -> Iterator[Frame]:
        """A state of all bodies at a time (s), inside of ``with``."""
        import numpy as np

        self._ask("frame", "frame_begin", np.float64(time).tobytes())
        yield Frame(self)
        self._ask("frame", "frame_end")

    def report(self, name: str, value: float, unit: Optional[str] = None) -> None:
        """Reports a result, in the unit that is declared for it.

        Raises:
            NotFound: no result of this name is declared.
        """
        import numpy as np

        declared = self._manifest["results"]
        known = next((n for n in declared if name == n or name.startswith(n + ".")), None)
        if known is None:
            raise NotFound(f"the step declares no result '{name}'; there are: {', '.join(declared) or 'none'}")
        words = {"name": name, "unit": unit or declared[known]["unit"]}
        self._ask(f"result '{name}'", "result", np.float64(value).tobytes(), **words)

    def collection(self, names: Sequence[str]) -> None:
        """Says that the artifact has these items, over which later steps may fan out."""
        self._ask("collection", "collection", count=len(names), text=json.dumps([str(n) for n in names]))


class Frame:
    """A state that is being written."""

    def __init__(self, run: StepRun) -> None:
        self._run = run

    def points(self, body: str, points: ArrayLike) -> None:
        """Where a body's points are: ``[n][3]``, m. What is not given stays at the reference position."""
        places = _doubles(points, f"points of '{body}'", 2)
        self._run._ask(f"points of '{body}'", "frame_points", places.tobytes(), body=body, points=len(places))

    def field(self, body: str, on: str, name: str, values: ArrayLike, unit: str) -> None:
        """Values of a field: ``[rows]`` or ``[rows][components]``.

        Args:
            body: name of the body.
            on: ``"points"`` or ``"cells"``.
            name: of the field. Every frame has the same ones.
            values: a row for each point or cell.
            unit: a plain one of SI.
        """
        if on not in ("points", "cells"):
            raise ValueError(f"field '{name}': `on` is {on!r}; expected 'points' or 'cells'")
        array = _doubles(values, f"field '{name}'")
        components = array.shape[1] if array.ndim == 2 else 1
        words = {"on": on, "name": name, "components": components, "unit": unit}
        self._run._ask(f"field '{name}' of '{body}'", "frame_field", array.tobytes(), body=body, **words)


class Input:
    """An artifact that arrives."""

    def __init__(self, run: StepRun, given: Mapping[str, Any]) -> None:
        self._run, self._handle = run, given["handle"]
        #: Where it arrives.
        self.port: str = given["port"]
        #: The step that made it.
        self.step: str = given["step"]
        #: What kind of artifact it is.
        self.kind: str = given["kind"]
        #: Its index path where its step is fanned out.
        self.item: List[int] = given["item"]
        #: What it cost: ``wall_seconds``, ``cpu_seconds``, ``peak_memory`` (bytes), ``threads``.
        self.cost: Dict[str, float] = given["cost"]
        self._meshes: Optional[Dict[str, Any]] = None

    def __repr__(self) -> str:
        return f"<input {self.port!r}: {self.kind} of {self.step!r}>"

    @property
    def attributes(self) -> Dict[str, Any]:
        """What its step wrote of it."""
        return dict(json.loads(self._run._ask(f"attributes of '{self.step}'", "attributes", handle=self._handle)[0]["text"] or "{}"))

    def has(self, path: str) -> bool:
        """Whether there is an array of this path."""
        return bool(self._run._send({"op": "array_info", "handle": self._handle, "path": path}, b"")[0]["code"] == 0)

    def array(self, path: str, dtype: Optional[str] = None) -> np.ndarray[Any, Any]:
        """An array, in the type in which it is stored or, with ``dtype``, in another one of the five.

        Raises:
            NotFound: there is no array of this path.
        """
        import numpy as np

        if not self.has(path):
            raise NotFound(f"'{self.step}' has no array '{path}'")
        what = f"array '{path}' of '{self.step}'"
        stored = self._run._ask(what, "array_info", handle=self._handle, path=path)[0]["dtype"]
        wanted = _TYPES.get(str(np.dtype(dtype)), "") if dtype else stored
        if not wanted:
            raise ValueError(f"{what}: no type {dtype}; expected one of {', '.join(_TYPES)}")
        answer, values = self._run._ask(what, "array_read", handle=self._handle, path=path, dtype=wanted)
        array: np.ndarray[Any, Any] = np.frombuffer(values, dtype=_NUMPY[wanted])
        shaped: np.ndarray[Any, Any] = array.reshape(answer["shape"])
        return shaped

    @property
    def meshes(self) -> Dict[str, Any]:
        """Times of all frames, and what there is of bodies and fields."""
        if self._meshes is None:
            self._meshes = json.loads(self._run._ask(f"meshes of '{self.step}'", "meshes", handle=self._handle)[0]["text"] or "{}")
        return dict(self._meshes or {})

    @property
    def times(self) -> List[float]:
        """Time of each frame (s)."""
        return list(self.meshes.get("times", []))

    @property
    def bodies(self) -> List[InputBody]:
        """All bodies, in order."""
        return [InputBody(self, described) for described in self.meshes.get("bodies", [])]

    def body(self, name: str) -> InputBody:
        """The body of a name.

        Raises:
            NotFound: there is none; lists all.
        """
        for body in self.bodies:
            if body.name == name:
                return body
        raise NotFound(f"'{self.step}' has no body '{name}'; there are: {', '.join(b.name for b in self.bodies) or 'none'}")


class InputBody:
    """A body of an artifact that arrives."""

    def __init__(self, given: Input, described: Mapping[str, Any]) -> None:
        self._input, self._described = given, described
        #: Its name.
        self.name: str = described["name"]
        #: What its step wrote of it.
        self.attributes: Dict[str, Any] = described.get("attributes") or {}
        #: Its fields: name, on, components, unit.
        self.fields: List[Dict[str, Any]] = described.get("fields", [])

    def _read(self, op: str, **words: Any) -> bytearray:
        given = self._input
        return given._run._ask(f"body '{self.name}' of '{given.step}'", op, handle=given._handle, body=self.name, **words)[1]

    def _mesh(self) -> Tuple[Any, Any]:
        import numpy as np

        both, count = self._read("mesh_read"), self._described["points"]
        points = np.frombuffer(both, dtype=np.float64, count=3 * count).reshape(count, 3)
        cells = np.frombuffer(both, dtype=np.uint32, offset=24 * count).reshape(self._described["cells"], -1)
        return points, cells

    @property
    def reference(self) -> np.ndarray[Any, Any]:
        """Points ``[n][3]`` at the reference position (m)."""
        return self._mesh()[0]  # type: ignore[no-any-return]

    @property
    def cells(self) -> np.ndarray[Any, Any]:
        """Numbers of points, ``[m][3]`` or ``[m][4]``."""
        return self._mesh()[1]  # type: ignore[no-any-return]

    def points(self, frame: int = -1) -> np.ndarray[Any, Any]:
        """Points ``[n][3]`` of a frame (m); the last one by default."""
        import numpy as np

        return np.frombuffer(self._read("points_read", frame=self._frame(frame)), dtype=np.float64).reshape(-1, 3)

    def field(self, name: str, frame: int = -1) -> np.ndarray[Any, Any]:
        """A field of a frame: ``[rows]``, or ``[rows][components]`` where it has several.

        Raises:
            NotFound: there is no such field or frame; lists all.
        """
        import numpy as np

        for known in self.fields:
            if known["name"] == name:
                words = {"name": name, "on": known["on"], "components": known["components"], "frame": self._frame(frame)}
                values = np.frombuffer(self._read("field_read", **words), dtype=np.float64)
                return values if known["components"] == 1 else values.reshape(-1, known["components"])
        names = ", ".join(f["name"] for f in self.fields) or "none"
        raise NotFound(f"body '{self.name}' of '{self._input.step}' has no field '{name}'; there are: {names}")

    def _frame(self, frame: int) -> int:
        count = len(self._input.times)
        if not -count <= frame < count:
            raise NotFound(f"'{self._input.step}' has no frame {frame}; it has {count}")
        return frame % count


def _json(value: Mapping[str, Any]) -> str:
    return json.dumps(value, allow_nan=False, default=_number)


def _number(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"an attribute is a {type(value).__name__}; expected texts, numbers, lists and mappings")


def _plain(values: ArrayLike, what: str) -> np.ndarray[Any, Any]:
    import numpy as np

    array = np.asarray(values)
    if array.dtype.kind == "b":
        array = array.astype(np.uint8)
    elif array.dtype.kind in "iu" and array.dtype.name not in _TYPES:
        if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
            raise ValueError(f"{what}: {array.max()} is more than a whole number of 64 bits holds")
        array = array.astype(np.int64)
    if array.dtype.name not in _TYPES or array.ndim > 4:
        raise ValueError(f"{what}: it has the type {array.dtype} and {array.ndim} dimensions; expected numbers ({', '.join(_TYPES)}), up to 4")
    # `ascontiguousarray` would make a list of a single value.
    return array if array.flags.c_contiguous else array.copy(order="C")


def _doubles(values: ArrayLike, what: str, dimensions: int = 0) -> np.ndarray[Any, Any]:
    import numpy as np

    array = np.asarray(values, dtype=np.float64)
    if dimensions == 2 and (array.ndim != 2 or array.shape[1] != 3):
        raise ValueError(f"{what}: the shape is {array.shape}; expected (n, 3)")
    if array.ndim not in (1, 2):
        raise ValueError(f"{what}: the shape is {array.shape}; expected (rows,) or (rows, components)")
    return np.ascontiguousarray(array)
