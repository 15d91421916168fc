"""Where the program is, and what came along with it."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Dict, NoReturn

from .errors import NotFound, PlyflowError

__all__ = ["include_folder", "main", "material", "program", "templates_folder", "workflows_folder"]

_PACKAGE = Path(__file__).resolve().parent
_INSTALLED = _PACKAGE / "_prefix"
# In the source tree this package lies at orchestrator/python/plyflow.
_SOURCE = _PACKAGE.parents[2]


def program() -> Path:
    """The program: that of ``PLYFLOW_PROGRAM``, or of the wheel, or the one that was built in the source tree.

    Raises:
        NotFound: there is none; says where it was looked for.

    >>> program().name
    'plyflow'
    """
    given = os.environ.get("PLYFLOW_PROGRAM")
    if given:
        if not os.access(given, os.X_OK) or os.path.isdir(given):
            raise NotFound(f"PLYFLOW_PROGRAM={given}: this is no program that can be run; give the path of `plyflow`")
        return Path(given).absolute()
    built = Path(os.environ.get("CARGO_TARGET_DIR", _SOURCE / "target")) / "release" / "plyflow"
    candidates = [_INSTALLED / "bin" / "plyflow", built]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    looked = ", ".join(str(c) for c in candidates)
    raise NotFound(f"there is no program `plyflow`: looked for {looked}; install the wheel, or set PLYFLOW_PROGRAM")


def carrier(name: str) -> Path:
    """A library of which copies are made that hold what was written in Python. It lies beside the plugins of the program.

    Raises:
        NotFound: it is not there; says where it was looked for.

    >>> carrier("python_law").name
    'libplyflow_python_law.so'
    """
    folder = program().resolve().parent
    candidates = [place / f"libplyflow_{name}.so" for place in (folder.parent / "lib" / "plyflow", folder)]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    looked = ", ".join(str(c) for c in candidates)
    raise NotFound(f"there is no library libplyflow_{name}.so: looked for {looked}; install the wheel, or `make build`")


def environment() -> Dict[str, str]:
    """What the program is told of this interpreter: plugins in Python are made and run by it, unless ``PLYFLOW_PYTHON`` names another."""
    return {"PLYFLOW_PYTHON": os.environ.get("PLYFLOW_PYTHON") or sys.executable}


def _folder(installed: str, source: str, what: str) -> Path:
    for candidate in (_INSTALLED / installed, _SOURCE / source):
        if candidate.is_dir():
            return candidate
    raise NotFound(f"there are no {what} beside this package: looked for {_INSTALLED / installed}; install the wheel")


def workflows_folder() -> Path:
    """The folder of the workflows that come along, with their scenes, materials and raw tests. It may not be writable: copy from it.

    >>> (workflows_folder() / "joggle-spar" / "workflow.yaml").is_file()
    True
    """
    return _folder("share/plyflow/workflows", "workflows", "workflows")


def templates_folder() -> Path:
    """The folder of the templates in C, Rust and Python, as they lie in the source. ``plyflow new`` makes a folder of one that builds where it is.

    >>> {"element-c", "material-c", "step-c"} <= {p.name for p in templates_folder().iterdir()}
    True
    """
    return _folder("share/plyflow/templates", "solver-plugins/door/templates", "templates")


def include_folder() -> Path:
    """The folder of ``plyflow.h``, the interface of plugins: ``make PLYFLOW_H=$(python -c 'import plyflow; print(plyflow.include_folder())')``.

    >>> (include_folder() / "plyflow.h").is_file()
    True
    """
    return _folder("include", "schemas/abi", "headers")


def material(name: str) -> Path:
    """The file of a material that comes along, for a scene.

    Raises:
        NotFound: there is none of this name; lists all.

    >>> material("ncf-fcim359").name
    'ncf-fcim359.yaml'
    """
    folder = workflows_folder() / "materials"
    path = folder / f"{name}.yaml"
    if not path.is_file():
        names = ", ".join(sorted(p.stem for p in folder.glob("*.yaml")))
        raise NotFound(f"no material '{name}' comes along; there are: {names}")
    return path


def main() -> NoReturn:
    """The command ``plyflow``: becomes the program, with the words of this process."""
    try:
        path = program()
        os.environ.update(environment())
        os.execv(path, [str(path), *sys.argv[1:]])
    except PlyflowError as error:
        sys.exit(f"plyflow: {error}")
    except OSError as error:
        sys.exit(f"plyflow: {path} cannot be run: {error.strerror}. The wheel is for 64-bit Linux on x86-64")
