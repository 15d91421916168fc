"""Scenes, materials and workflows from Python objects. They hold plain values, and the program says what is wrong with them.

>>> tool = {"flat": {"length": "90 mm", "width": "70 mm", "height": "20 mm", "fillet": "10 mm"}}
>>> part = Scene("block", tool=tool, sheets=[ply("ply_1", "ncf-fcim359", "120 mm", "100 mm", (-45, 45))])
>>> part["tool"]["flat"]["height"] = "lots"
>>> for finding in part.findings():
...     if "lots" in str(finding.given):
...         print(finding.severity, finding.line > 0, finding.column > 0)
error True True
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any, Mapping, Sequence, Union

from . import _yaml
from ._ask import PathLike, ask, findings, plain, refuse
from ._installation import material
from .errors import Finding, NotFound, PlyflowError

__all__ = ["Material", "Scene", "Workflow", "diaphragm", "ply", "schema"]

Angle = Union[str, float]


def schema(which: str = "workflow") -> dict[str, Any]:
    """The JSON Schema of a format: ``workflow`` (with the parameters of all plugins), ``scene``, ``material``, ``expected``, ``artifacts``.

    >>> sorted(schema("scene")["properties"])[:3]
    ['description', 'friction', 'name']
    """
    told: dict[str, Any] = ask(["schema", which])
    return told


class _Document(dict):  # type: ignore[type-arg]
    """A mapping that is written as a YAML file. Change it as any other: ``scene["friction"]["fabric_fabric"] = 0.3``."""

    _FORMAT: str

    def __init__(self, name: str, entries: Mapping[str, Any]) -> None:
        super().__init__({self._FORMAT: 1, "name": name, **{k: v for k, v in entries.items() if v is not None}})

    def to_yaml(self) -> str:
        """The text of the file.

        Raises:
            TypeError: a value has no form in YAML.
            ValueError: a number is not finite.
        """
        return _yaml.dump(plain(self))

    def write(self, path: PathLike) -> Path:
        """Writes the file, in the place of one that is there, and returns its path. Its folder must exist."""
        to = Path(path)
        text = self.to_yaml()
        if not to.parent.is_dir():
            raise NotFound(f"there is no folder {to.parent}: make it first")
        # Whole or not at all.
        begun = to.with_name(f".{to.name}.{os.getpid()}")
        begun.write_text(text, encoding="utf-8")
        os.replace(begun, to)
        return to

    def findings(self, folder: PathLike = ".") -> list[Finding]:
        """All that the program finds wrong, with line and column of :meth:`to_yaml`. Nothing is left behind.

        Args:
            folder: where the file would lie: relative paths in it begin there.
        """
        name = f"<{type(self).__name__} {self['name']}>"
        try:
            handle, path = tempfile.mkstemp(prefix=".plyflow-", suffix=".yaml", dir=folder)
        except OSError as error:
            raise PlyflowError(f"{folder}: no file can be written there to be checked: {error.strerror}; name another folder") from error
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(self.to_yaml())
            found = findings(path)
        finally:
            os.unlink(path)
        here = {path, os.path.basename(path)}
        return [Finding(**{**vars(f), "file": name}) if f.file in here or os.path.abspath(f.file) == path else f for f in found]

    def validate(self, folder: PathLike = ".") -> None:
        """Has the program check it, and all that it names.

        Args:
            folder: as for :meth:`findings`.

        Raises:
            InvalidInput: it has errors, each with line, column, what was expected and a hint.
        """
        refuse(self.findings(folder))


class Scene(_Document):
    """A scene: the tool, the sheets from the tool upwards, friction and the process. ``plyflow schema scene --format text`` lists all keys.

    Lengths and the like are texts with a unit, such as ``"480 mm"``.
    """

    _FORMAT = "plyflow_scene"

    def __init__(
        self,
        name: str,
        *,
        tool: Mapping[str, Any] | None = None,
        sheets: Sequence[Mapping[str, Any]] = (),
        friction: Mapping[str, Any] | None = None,
        process: Mapping[str, Any] | None = None,
        **more: Any,
    ) -> None:
        sheets = [dict(s) for s in sheets]
        super().__init__(name, {"tool": tool, "sheets": sheets, "friction": friction, "process": process, **more})


class Material(_Document):
    """A material. ``plyflow schema material --format text`` lists all keys, ``plyflow plugins NAME`` the parameters of a material plugin."""

    _FORMAT = "plyflow_material"

    def __init__(self, name: str, *, plugin: str, thickness: str, areal_mass: str, parameters: Mapping[str, Any] | None = None, **more: Any) -> None:
        entries = {"plugin": plugin, "thickness": thickness, "areal_mass": areal_mass, **more, "with": parameters}
        super().__init__(name, entries)


class Workflow(_Document):
    """A workflow: steps by name. ``plyflow plugins`` lists what a step can be, ``plyflow plugins NAME`` its parameters.

    >>> forms = Workflow("example")
    >>> drape = forms.step("drape", "forming-kinematic", scene="scene.yaml", element_size="16 mm")
    >>> found = forms.step("defects", "defect-detection", inputs={"formed": drape})
    >>> print(forms.to_yaml(), end="")
    plyflow: 1
    name: example
    steps:
      drape:
        plugin: forming-kinematic
        with:
          scene: scene.yaml
          element_size: 16 mm
      defects:
        plugin: defect-detection
        from:
          formed: drape
    """

    _FORMAT = "plyflow"

    def __init__(self, name: str, **entries: Any) -> None:
        super().__init__(name, entries)
        self.setdefault("steps", {})

    def step(
        self,
        name: str,
        plugin: str,
        *,
        inputs: Mapping[str, Any] | str | None = None,
        for_each: Mapping[str, str] | None = None,
        more: Mapping[str, Any] | None = None,
        **parameters: Any,
    ) -> str:
        """Adds a step, or replaces the one of this name, and returns its name, by which later steps read it.

        Args:
            name: of the step.
            plugin: name of the plugin, or path of its library.
            inputs: which steps it reads, by port (``from`` in the file).
            for_each: over which collection it is fanned out.
            more: further keys of the step, such as ``resources``.
            parameters: of the plugin (``with`` in the file). A :class:`Scene` or a :class:`Material` stands in the file as it is.
        """
        entries = {"plugin": plugin, "for_each": for_each, "from": inputs, "with": parameters or None, **(more or {})}
        self["steps"][name] = {k: v for k, v in entries.items() if v is not None}
        return name

    def vary(self, **values: Any) -> None:
        """Makes it a study over these variables: each a list of values, or a mapping such as ``{"from": 0.1, "to": 0.4, "count": 4}``.

        ``${name}`` in a parameter stands for the value.
        """
        self.setdefault("study", {}).setdefault("vary", {}).update(values)

    def response(self, name: str, step: str, result: str) -> None:
        """Puts a result of a step into the study's table."""
        self.setdefault("responses", {})[name] = {"step": step, "result": result}


def ply(name: str, of: PathLike, length: str, width: str, fibres: tuple[Angle, Angle] | PathLike | Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """A ply of a scene, a rectangle unless ``outline`` is given.

    Args:
        name: its name, that of its body in artifacts too.
        of: path of a material file, or the name of a material that comes along (:func:`plyflow.material`).
        length: along x, such as ``"480 mm"``.
        width: along y.
        fibres: directions of both families from x: texts with a unit, or numbers in degrees. Of steered fibres the path of a table of directions, or
            what stands in the file: ``{"points": [{"x": "0 mm", "y": "0 mm", "angle": "10 deg"}, ..]}``.
        more: further keys of a sheet.

    >>> ply("ply_1", "mine.yaml", "480 mm", "300 mm", (-45, "45 deg"))["fibre_1"]
    '-45 deg'
    >>> ply("ply_1", "mine.yaml", "480 mm", "300 mm", "steered.csv")["fibre_1"]
    {'table': {'file': 'steered.csv'}}
    """
    sheet: dict[str, Any] = {"name": name, "kind": "ply", "material": _material(of), "length": length, "width": width}
    if isinstance(fibres, Mapping):
        sheet["fibre_1"] = dict(fibres)
    elif isinstance(fibres, (str, os.PathLike)):
        sheet["fibre_1"] = {"table": {"file": os.fspath(fibres)}}
    else:
        sheet["fibre_1"], sheet["fibre_2"] = (a if isinstance(a, str) else f"{a:g} deg" for a in fibres)
    return {**sheet, **more}


def diaphragm(name: str, of: PathLike = "stretchlon-ht350", **more: Any) -> dict[str, Any]:
    """A diaphragm of a scene, of a material file or one that comes along."""
    return {"name": name, "kind": "diaphragm", "material": _material(of), **more}


def _material(of: PathLike) -> str:
    text = str(of)
    return text if text.endswith((".yaml", ".yml")) or "/" in text else str(material(text))
