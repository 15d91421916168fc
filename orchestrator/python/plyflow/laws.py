"""Fabric laws in Python: a function for one point becomes a plugin library.

The function is compiled by numba (``pip install numba``) once, when the library is made. The library is a plugin as one in C or Rust:
`plyflow check-plugin` judges it, it runs in the workers without Python, and its bytes are part of the keys of steps.

>>> import math
>>> from plyflow import declare, law
>>> @law("my-fabric", parameters={"shear_modulus": declare.quantity("force_per_length", required=True, doc="Shear stiffness G.")})
... def membrane(p, c11, c22, c12):
...     "A sheet with constant stiffnesses."
...     e11, e22 = 0.5 * (c11 - 1), 0.5 * (c22 - 1)
...     s11, s22, s12 = 1e5 * e11, 2e5 * e22, p.shear_modulus * c12
...     return s11, s22, s12, 0.5 * (s11 * e11 + s22 * e22 + s12 * c12)
>>> p = membrane.sheet(shear_modulus=2000.0, thickness=0.3e-3, areal_mass=0.3)
>>> round(membrane(p, 1.0, 1.0, math.sin(0.3))[2], 3)          # plain Python, to plot and to fit
591.04

A material file names the law's file by its path: ``plugin: ./my_fabric.py``. The program makes the library when it is first needed.
``python -m plyflow.laws my_fabric.py -o libmy_fabric.so`` makes one to keep or to give away. The page "From an idea to a law in an hour" of the book
(`docs/plugins/law-in-python.md`) goes from here to a formed part.
"""

from __future__ import annotations

import inspect
import keyword
import os
import sys
from collections import namedtuple
from pathlib import Path
from typing import Any, Callable, Mapping, NoReturn, Sequence, Union

from .errors import Finding, InvalidInput, PlyflowError

__all__ = ["Law", "law"]

Function = Callable[..., Any]

# What each function may take, by name, and what it returns.
STATE = ("p", "dt", "c11", "c22", "c12", "history")
BENT = ("p", "dt", "c11", "c22", "c12", "k11", "k22", "k12", "history")
TAKES: dict[str, tuple[str, ...]] = {"membrane": STATE, "stiffness": STATE, "bending": BENT, "tangent": BENT}
RETURNS: dict[str, tuple[str, ...]] = {
    "membrane": ("s11", "s22", "s12", "energy"),
    "stiffness": ("largest tangent", "shear tangent"),
    "bending": ("m11", "m22", "m12", "energy"),
    "tangent": ("dm11/dk11", "dm22/dk22", "dm12/dk12"),
}
# The two that every sheet has.
OF_SHEET = ("thickness", "areal_mass")
# As the carrier has it (solver-plugins/door/python-law/src/law.rs).
MOST_HISTORY = 256

_NUMBERS = ("number", "quantity", "integer")


def law(
    name: str,
    *,
    version: str = "0.1.0",
    vendor: str = "unnamed",
    parameters: Mapping[str, Any] | None = None,
    history: int = 0,
) -> Callable[[Function], Law]:
    """Makes a fabric law of a function that gives the stress of one point.

    The function takes any of these by name, and returns ``(s11, s22, s12, energy)``:

    - ``p``: the parameters of the sheet in SI units, such as ``p.shear_modulus``, ``p.thickness`` (m) and ``p.areal_mass`` (kg/m2). A choice is
      the index of its word, a list is an array.
    - ``c11, c22, c12``: the metric in the fibre directions. ``c11`` is the squared stretch of family 1; at unit stretches ``c12`` is the sine of the
      shear angle.
    - ``history``: ``[history]`` numbers of this point, zeros at the start. What the function writes there, the next call finds.
    - ``dt``: time since the previous call (s).

    ``s11, s22, s12`` are second Piola-Kirchhoff resultants (N/m, with ``s12`` = dW/dc12), ``energy`` is per undeformed area (J/m2). The first line
    of the function's documentation is the summary of the plugin.

    Args:
        name: of the plugin, as a material file names it.
        version: of the law.
        vendor: who made it.
        parameters: name -> declaration (:mod:`plyflow.declare`): numbers, quantities, integers, booleans, choices, lists of numbers, and objects
            of these.
        history: how many numbers a point remembers.

    Raises:
        InvalidInput: a declaration or the function does not fit; with file and line.
    """

    def of(function: Function) -> Law:
        from . import steps

        made = Law(function, name, version, vendor, dict(parameters or {}), history)
        # By this the program finds what a file defines.
        steps._DEFINED.append(steps.Definition("law", made.manifest, function, more={"law": made}))
        return made

    return of


class Law:
    """A fabric law. Calling it calls the function that was given, in plain Python.

    Attributes:
        name, version, vendor, summary: as in the manifest.
        parameters: the declarations, as in `schemas/manifest.md`.
        functions: ``membrane``, and of ``bending``, ``stiffness`` and ``tangent`` those that were given.
        membrane_history, bending_history: numbers that a point remembers.
    """

    def __init__(self, function: Function, name: str, version: str, vendor: str, parameters: Mapping[str, Any], history: int) -> None:
        self.name = name
        self.version = version
        self.vendor = vendor
        self.functions: dict[str, Function] = {}
        self.membrane_history = 0
        self.bending_history = 0
        self._add("membrane", function, history)
        documentation = inspect.getdoc(function)
        if not documentation:
            _refuse(function, f"{function.__name__} has no documentation", hint="write one sentence below `def`: it is the summary of the plugin")
        self.summary = documentation.splitlines()[0].strip()
        self.parameters = {key: _declared(value, function, key) for key, value in parameters.items()}
        self.values = _values(self.parameters, function)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.functions["membrane"](*arguments, **named)

    def __repr__(self) -> str:
        return f"<law {self.name} {self.version}: {', '.join(self.functions)}>"

    def bending(self, function: Function | None = None, *, history: int = 0) -> Any:
        """Adds the bending law: ``@membrane.bending``, or ``@membrane.bending(history=2)``.

        The function takes any of ``p, dt, c11, c22, c12, k11, k22, k12, history``, with the curvatures ``k11, k22, k12`` (1/m), and returns
        ``(m11, m22, m12, energy)``: moments per width (N) and energy (J/m2), dW = m11 dk11 + m22 dk22 + 2 m12 dk12.
        """
        if function is None:
            return lambda given: self._add("bending", given, history)
        return self._add("bending", function, history)

    def stiffness(self, function: Function) -> Function:
        """Gives the bounds on which the time step rests, in place of those that are measured.

        The function takes what the law takes, with the history as the law has left it. It returns the largest eigenvalue of dS/dE (with a factor of
        root 2 on both shear components) and dS12/d(2 E12), both in N/m, or upper bounds of them.

        Without it both are measured at every state that is asked for, by steps of 1e-6 of the strain to either side, with 1 % added.
        """
        return self._add("stiffness", function)

    def tangent(self, function: Function) -> Function:
        """Gives the tangents ``(dm11/dk11, dm22/dk22, dm12/dk12)`` of the bending law (N m), in place of those that are measured.

        The function takes what the bending law takes, with the history as the law has left it.
        """
        return self._add("tangent", function)

    def _add(self, kind: str, function: Function, history: int = 0) -> Function:
        if not inspect.isfunction(function):
            raise PlyflowError(f"the law '{self.name}': {kind} is a {type(function).__name__}; give a function")
        allowed = TAKES[kind]
        for given in inspect.signature(function).parameters.values():
            if given.name not in allowed or given.kind is not given.POSITIONAL_OR_KEYWORD:
                _refuse(function, f"{function.__name__} takes '{given}'", expected=f"any of {', '.join(allowed)}, by these names")
        if not 0 <= history <= MOST_HISTORY:
            _refuse(function, f"{history} numbers of history", expected=f"0 to {MOST_HISTORY}")
        if kind == "tangent" and "bending" not in self.functions:
            _refuse(function, f"the law '{self.name}' has a tangent and no bending", hint="give the bending law first: @law.bending")
        self.functions[kind] = function
        if kind == "membrane":
            self.membrane_history = history
        elif kind == "bending":
            self.bending_history = history
        return function

    @property
    def manifest(self) -> dict[str, Any]:
        """The manifest, as in `schemas/manifest.md`."""
        head = {"name": self.name, "version": self.version, "vendor": self.vendor, "kind": "material", "role": "material"}
        return {**head, "summary": self.summary, "parameters": self.parameters, "inputs": {}, "results": {}, "fields": []}

    def sheet(self, **values: Any) -> Any:
        """The parameters of a sheet, to call the law with in plain Python: all in SI units, with ``thickness`` (m) and ``areal_mass`` (kg/m2).

        What is left out takes its default, where that is no text with a unit. Words of choices and mappings of objects are given as in a file.

        Raises:
            PlyflowError: a value is missing or unknown; says which.
        """
        return _tuple(self.values, (), values, self.name)


class Value:
    """One parameter as compiled code takes it: its path of names, its form, and its declaration."""

    def __init__(self, path: tuple[str, ...], form: str, declaration: Mapping[str, Any]) -> None:
        self.path = path
        self.form = form
        self.words = [str(word) for word in declaration.get("values", [])]
        self.default = declaration.get("default")

    def header(self) -> dict[str, Any]:
        """What the carrier is told of it."""
        form = "number" if self.form == "integer" else self.form
        return {"path": list(self.path), "form": form, "words": self.words}


def _refuse(function: Function, message: str, given: Any = None, expected: str | None = None, hint: str | None = None) -> NoReturn:
    code = function.__code__
    text = None if given is None else repr(given)
    raise InvalidInput([Finding(code.co_filename, code.co_firstlineno, 1, "error", message, text, expected, hint)])


def _declared(declaration: Any, function: Function, name: str) -> dict[str, Any]:
    if not isinstance(declaration, Mapping):
        _refuse(function, f"parameter '{name}'", declaration, "a declaration", "use plyflow.declare, as in declare.number(default=1.0, doc='..')")
    return dict(declaration)


def _values(parameters: Mapping[str, Mapping[str, Any]], function: Function, path: tuple[str, ...] = ()) -> list[Value]:
    """All parameters that are numbers, with those of objects, and at the end those that every sheet has."""
    found: list[Value] = []
    for name, declaration in parameters.items():
        said = ".".join((*path, name))
        if not name.isidentifier() or keyword.iskeyword(name) or name.startswith("_"):
            _refuse(
                function, f"parameter '{said}'", expected="a name of letters, digits and _, as the law writes p." + (name.replace("-", "_") or "name")
            )
        if not path and name in OF_SHEET:
            _refuse(function, f"parameter '{said}'", hint=f"every sheet has it already: p.{name}")
        kind = declaration.get("type")
        there = declaration.get("required") is True or "default" in declaration
        if kind == "object":
            there = declaration.get("required") is True
        if not there:
            expected = "required=True" if kind == "object" else "required=True or a default"
            _refuse(function, f"parameter '{said}' may be absent", expected=expected, hint="compiled code has a value for every parameter")
        here = (*path, name)
        if kind == "object":
            found += _values(declaration.get("fields", {}), function, here)
        elif kind in _NUMBERS:
            found.append(Value(here, "integer" if kind == "integer" else "number", declaration))
        elif kind in ("boolean", "choice"):
            found.append(Value(here, kind, declaration))
        elif kind == "list" and declaration.get("of", {}).get("type") in _NUMBERS:
            found.append(Value(here, "list", declaration))
        else:
            expected = "number, quantity, integer, boolean, choice, a list of numbers, or an object of these"
            _refuse(function, f"parameter '{said}' of type {kind}", expected=expected, hint="compiled code takes numbers")
    return found if path else found + [Value((name,), "number", {}) for name in OF_SHEET]


def tuple_names(values: Sequence[Value], at: tuple[str, ...]) -> list[str]:
    """The names below `at`, in their order."""
    return list(dict.fromkeys(v.path[len(at)] for v in values if v.path[: len(at)] == at))


def _tuple(values: Sequence[Value], at: tuple[str, ...], given: Mapping[str, Any], law_name: str) -> Any:
    names = tuple_names(values, at)
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise PlyflowError(f"the law '{law_name}' has no parameter {', '.join(unknown)}; it has {', '.join(names)}")
    made = []
    for name in names:
        value = next((v for v in values if v.path == (*at, name)), None)
        if value is None:
            made.append(_tuple(values, (*at, name), given.get(name, {}), law_name))
            continue
        one = given.get(name, value.default)
        if one is None or (value.form in ("number", "list") and isinstance(one, str)):
            raise PlyflowError(f"the law '{law_name}': no value of '{'.'.join(value.path)}'; give a number in SI units")
        made.append(_one(value, one))
    return namedtuple("Parameters", names)(*made)


def _one(value: Value, given: Any) -> Any:
    if value.form == "choice":
        if given not in value.words:
            raise PlyflowError(f"'{'.'.join(value.path)}': given {given!r}; expected one of {', '.join(value.words)}")
        return value.words.index(given)
    if value.form == "list":
        import numpy

        return numpy.asarray(given, dtype=float)
    return {"number": float, "integer": int, "boolean": bool}[value.form](given)


def load(path: Union[str, Path], name: str | None = None) -> Law:
    """The law in a file of Python. The file's code runs.

    Args:
        path: of the file.
        name: of the law, where the file has several.

    Raises:
        InvalidInput: there is none, or which of several is meant is not said.
        PlyflowError: the file cannot be read, or its code fails.
    """
    from importlib import util

    place = Path(path).resolve()
    if not place.is_file():
        raise PlyflowError(f"there is no file {path}; give the file of a law in Python")
    if str(place.parent) not in sys.path:
        sys.path.insert(0, str(place.parent))
    # One name for all: it is part of the names in the code that numba makes.
    spec = util.spec_from_file_location("plyflow_law", place)
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    sys.modules["plyflow_law"] = module
    try:
        spec.loader.exec_module(module)
    except PlyflowError:
        raise
    except SyntaxError as error:
        found = Finding(str(error.filename), error.lineno or 0, error.offset or 0, "error", f"this is no Python: {error.msg}")
        raise InvalidInput([found]) from error
    except Exception as error:
        line = next((at for file, at in reversed(_frames(error)) if file == str(place)), 0)
        raise InvalidInput([Finding(str(place), line, 1, "error", f"the file stops with {type(error).__name__}: {error}")]) from error
    laws = {value.name: value for value in vars(module).values() if isinstance(value, Law)}
    if name is not None and name in laws:
        return laws[name]
    if name is None and len(laws) == 1:
        return next(iter(laws.values()))
    message = f"the file has {len(laws)} laws{': ' if laws else ''}{', '.join(sorted(laws))}"
    expected = "one law" if name is None else f"the law '{name}'"
    hint = "write @plyflow.law(..) before the function of one point" if not laws else "say which: --law NAME"
    raise InvalidInput([Finding(str(place), 1, 1, "error", message, None, expected, hint)])


def _frames(error: BaseException) -> list[tuple[str, int]]:
    import traceback

    return [(frame.filename, frame.lineno or 0) for frame in traceback.extract_tb(error.__traceback__)]


def _make(definition: Any, source: Path, into: Path, bare: Path) -> dict[str, Any]:
    """Makes the library of a law for the program, in a folder that is named for its bytes.

    Args:
        definition: of :func:`plyflow.law`, as :func:`plyflow.steps.defined` lists it.
        source: the file.
        into: the folder for what is made.
        bare: the carrier of laws, of which the library is a copy.

    Returns:
        ``library``: its path; ``watch``: the files and folders whose change means to make it anew.

    Raises:
        InvalidInput: the law cannot be compiled; with file, line, reason and what to do.
        MissingPackage: numba is not there.
        PlyflowError: the carrier is not there.
    """
    import tempfile
    from hashlib import sha256

    from ._law_library import make

    with tempfile.TemporaryDirectory(dir=into) as scratch:
        told = make(definition.more["law"], source, Path(scratch) / f"{source.stem}.so", bare=bare)
        made = Path(told["library"])
        folder = into / sha256(made.read_bytes()).hexdigest()[:24]
        folder.mkdir(exist_ok=True)
        library = folder / made.name
        # A library of these bytes that is there already may be in use, and stays.
        if not library.is_file() or library.read_bytes() != made.read_bytes():
            made.replace(library)
    return {**told, "library": str(library)}


def main(words: Sequence[str] | None = None) -> int:
    """The command ``python -m plyflow.laws FILE [-o LIBRARY] [--law NAME]``."""
    import argparse

    parser = argparse.ArgumentParser("python -m plyflow.laws", description="Makes a plugin library of a fabric law in Python.")
    parser.add_argument("file", metavar="FILE", help="the file of the law")
    parser.add_argument("-o", "--output", metavar="LIBRARY", help="the library [default: lib<name of the law>.so, here]")
    parser.add_argument("--law", metavar="NAME", help="which law, where the file has several")
    given = parser.parse_args(words)
    try:
        found = load(given.file, given.law)
        from ._law_library import make

        stem = "".join(c if c.isalnum() else "_" for c in found.name)
        library = make(found, Path(given.file).resolve(), Path(given.output or f"lib{stem}.so"))["library"]
    except PlyflowError as error:
        print(f"plyflow.laws: {error}", file=sys.stderr)
        return error.code or 1
    print(f"{library}: the law {found.name} {found.version}. Next: plyflow check-plugin {_shown(library)}")
    return 0


def _shown(library: str) -> str:
    near = os.path.relpath(library)
    return library if near.startswith("..") else f"./{near}"


if __name__ == "__main__":
    # This file is `__main__` here, and its classes would be others than those that the law's file imports.
    from plyflow.laws import main as _main

    sys.exit(_main())
