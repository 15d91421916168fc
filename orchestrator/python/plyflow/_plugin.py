"""Makes a library of a file in Python. The program calls it: ``python -c .. FILE --into FOLDER --bridge LIBRARY``.

What is made depends on the file, on the modules beside it that it imports, and on the versions of the interpreter and of the packages that it
imports; nothing of it depends on where any of them lies. Prints one line of JSON: ``library``, ``watch``, or ``error``.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import re
import sys
import traceback
from pathlib import Path
from typing import Any, Dict, List, NoReturn, Sequence, Tuple

from . import _environment as environment
from .errors import InvalidInput, PlyflowError

_PACKAGE = Path(__file__).resolve().parent
_MAGIC = b"PLYFLOW-PYTHON-1"


class Unusable(PlyflowError):
    """The file is no plugin."""


def _module_name(file: Path) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", file.stem):
        raise Unusable(f"{file.name} cannot be imported under this name; expected letters, digits and underscores, such as double_time.py")
    if importlib.util.find_spec(file.stem) is not None:
        raise Unusable(f"{file.name} has the name of a module that this interpreter has already ({file.stem}); give the file another name")
    return file.stem


def _imported(file: Path) -> Tuple[Dict[str, Path], environment.Packages, List[str]]:
    """Imports the file, with its folder before all others.

    Returns:
        The modules beside it that it needs, with itself, by path from the folder; the packages; and the names of all modules.
    """
    name, folder = _module_name(file), file.parent
    before = set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        importlib.import_module(name)
    except PlyflowError:
        raise
    except BaseException as error:
        traceback.print_exc()
        places = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).resolve().parent == folder]
        line = f":{places[-1].lineno}" if places else f":{error.lineno}" if isinstance(error, SyntaxError) else ""
        raise Unusable(f"{file.name}{line}: {type(error).__name__}: {error}") from None
    new = set(sys.modules) - before
    found = environment.packages(new)
    sources: Dict[str, Path] = {}
    for module, path in found.others.items():
        if folder not in path.parents:
            raise Unusable(
                f"{file.name} imports {module} from {path}, which is neither beside it nor of an installed package, so nobody would see "
                "a change of it; put it beside the file, or install it"
            )
        if path.suffix != ".py":
            raise Unusable(f"{file.name} imports {module} from {path.name}; expected modules in Python beside it, or installed packages")
        sources[path.relative_to(folder).as_posix()] = path
    return sources, found, sorted({module.partition(".")[0] for module in new})


def _versions(packages: environment.Packages, requires: Sequence[str]) -> Dict[str, str]:
    from importlib import metadata

    found = dict(packages.versions)
    for name in requires:
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            raise Unusable(f"it requires the package {name}, which {sys.executable} does not have: pip install {name}") from None
        found[distribution.metadata["Name"]] = distribution.version
        packages.files.extend(environment.place_of(distribution))
    return dict(sorted(found.items()))


def _put(into: Path, name: str, content: bytes) -> Path:
    """A file in a folder that is named for its content: whoever makes the same one at the same time does no harm."""
    folder = into / hashlib.sha256(content).hexdigest()[:24]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    beside = {"interpreter": sys.executable, "package": str(_PACKAGE.parent)}
    for target, written in ((folder / "python.json", json.dumps(beside).encode()), (path, content)):
        if not target.is_file() or target.read_bytes() != written:
            half = folder / f".{target.name}-{os.getpid()}"
            half.write_bytes(written)
            half.replace(target)
    return path


def make(file: Path, into: Path, bridge: Path) -> Dict[str, Any]:
    """Makes the library of a file.

    Args:
        file: with one function that :func:`plyflow.step` or ``plyflow.law`` decorates.
        into: the folder for what is made.
        bridge: the library of which that of a step is a copy.

    Returns:
        ``library``: its path; ``watch``: files and folders whose change means that it has to be made anew.

    Raises:
        Unusable: the file is no plugin, or nobody could tell when it changes.
    """
    from .steps import defined

    sources, packages, modules = _imported(file)
    found = defined()
    if len(found) != 1:
        names = ", ".join(d.manifest["name"] for d in found) or "none"
        raise Unusable(f"{file.name} must have one function that is decorated with `plyflow.step` or `plyflow.law`; it has: {names}")
    # It also finds the places of packages that only the run imports.
    versions = _versions(packages, found[0].requires)
    watch: List[Path] = [*sources.values(), *packages.files, Path(sys.executable)]
    if found[0].kind == "step":
        carried = {
            "manifest": json.dumps(found[0].manifest, sort_keys=True),
            "main": file.name,
            "sources": {name: path.read_text(encoding="utf-8") for name, path in sorted(sources.items())},
            "python": environment.python(),
            "packages": versions,
            "modules": modules,
        }
        payload = json.dumps(carried, sort_keys=True).encode()
        # The bridge, then what it is to run.
        library = _put(into, f"{file.stem}.so", bridge.read_bytes() + payload + len(payload).to_bytes(8, "little") + _MAGIC)
        watch.append(bridge)
    else:
        from . import laws

        # It lies where that of steps does.
        made = laws._make(found[0], file, into, bridge.with_name("libplyflow_python_law.so"))
        library = Path(made["library"])
        watch += [Path(p) for p in made["watch"]]
    return {"library": str(library), "watch": sorted({str(path) for path in watch})}


def main() -> NoReturn:
    """The command: see the module."""
    parser = argparse.ArgumentParser(prog="plyflow._plugin", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--bridge", type=Path, required=True)
    given = parser.parse_args()
    # What the file prints when it is imported is no answer, from whatever language it prints.
    out = os.dup(1)
    os.dup2(2, 1)
    try:
        answer = make(given.file.resolve(), given.into, given.bridge)
    except InvalidInput as error:
        answer = {"error": "; ".join(map(str, error.findings))}
    except PlyflowError as error:
        answer = {"error": str(error)}
    except OSError as error:
        answer = {"error": f"{error.filename}: {error.strerror}"}
    with open(out, "w") as answers:
        print(json.dumps(answer), file=answers)
    sys.exit(0)
