"""Asks the program, by its outputs for programs alone."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
from pathlib import Path
from typing import Any, Mapping, Sequence, Union

from ._installation import environment, program
from .errors import Damaged, Finding, InvalidInput, Locked, MissingPackage, NotFound, PlyflowError, Stopped

Settings = Mapping[str, Any]
PathLike = Union[str, Path]


def words_of(settings: Settings | None) -> list[str]:
    """``--set`` for each value: texts as they are (``"2 mm"``), everything else as JSON, which is YAML too."""
    words: list[str] = []
    for name, value in (settings or {}).items():
        text = value if isinstance(value, str) else json.dumps(plain(value), allow_nan=False)
        words += ["--set", f"{name}={text}"]
    return words


def trusted(trust: bool | Sequence[PathLike]) -> list[str]:
    """``--trust`` for all libraries of the workflow, or for each that is named."""
    if isinstance(trust, (str, os.PathLike)):
        raise TypeError(f"trust={trust!r}: expected True, False or a list of paths; a single path is a list of one")
    return (["--trust"] if trust else []) if isinstance(trust, bool) else [f"--trust={os.fspath(path)}" for path in trust]


def plain(value: Any) -> Any:
    """A value of plain Python: paths as text, tuples as lists, numbers of numpy as numbers.

    Raises:
        TypeError: a value has no form in YAML; says of what type it is.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    raise TypeError(f"{value!r} is a {type(value).__name__}, which a file cannot hold: give text, a number, a list or a mapping")


def ask(words: Sequence[PathLike], allowed: Sequence[int] = (0,), silent: bool = False) -> Any:
    """The JSON with which a command answers; ``None`` with `silent`, for commands that answer in words.

    Raises:
        PlyflowError: of the class that the exit code stands for, with what the program said.
    """
    command = [str(program()), *map(str, words)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False, env={**os.environ, **environment()})
    said = done.stderr.decode("utf-8", "replace").strip()
    if done.returncode not in allowed:
        raise error_of(done.returncode, said)
    return None if silent else json.loads(done.stdout)


def error_of(code: int, said: str) -> PlyflowError:
    """The error that an exit code stands for. `said` is shown as it is, and nothing is read out of it."""
    classes: dict[int, type[PlyflowError]] = {2: NotFound, 6: Locked, 8: Damaged, 130: Stopped}
    text = said[len("plyflow: ") :] if said.startswith("plyflow: ") else said
    return classes.get(code, PlyflowError)(text or f"the program ended with code {code} and said nothing", code)


def findings(file: PathLike, words: Sequence[PathLike] = ()) -> list[Finding]:
    """All that ``plyflow validate`` finds wrong with a file."""
    told = ask(["validate", "--format", "json", *words, "--", file], allowed=(0, 3))
    return [Finding.of(f) for f in told or []]


def refuse(found: Sequence[Finding]) -> None:
    """Raises what was found, if an error is among it.

    Raises:
        InvalidInput: with all findings.
    """
    if any(f.severity == "error" for f in found):
        raise InvalidInput(found)


def needed(module: str, what: str) -> Any:
    """A package that a single call needs.

    Raises:
        MissingPackage: it is not installed; says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        raise MissingPackage(f"{what} needs the package {package}, which cannot be imported ({error}): pip install {package}") from error
