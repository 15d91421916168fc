"""What of an environment decides what a file does: the interpreter, the packages, and the modules beside the file."""

from __future__ import annotations

import platform
import sys
import sysconfig
from importlib import metadata
from pathlib import Path
from typing import Dict, Iterable, List, NamedTuple, Optional

_PACKAGE = Path(__file__).resolve().parent


class Packages(NamedTuple):
    """What a set of modules needs."""

    #: Version of each package, by name.
    versions: Dict[str, str]
    #: Modules that are of no package, with their files.
    others: Dict[str, Path]
    #: Files whose change means that a version may be another.
    files: List[Path]


def python() -> str:
    """The interpreter: ``cpython 3.11.7``."""
    return f"{sys.implementation.name} {platform.python_version()}"


def _standard() -> List[Path]:
    paths = sysconfig.get_paths()
    return [Path(paths[name]).resolve() for name in ("stdlib", "platstdlib")]


def _owners() -> Dict[str, List[metadata.Distribution]]:
    """The packages that have a top-level module, by its name."""
    owners: Dict[str, List[metadata.Distribution]] = {}
    for distribution in metadata.distributions():
        names = set((distribution.read_text("top_level.txt") or "").split())
        if not names:
            for file in distribution.files or []:
                first = file.parts[0]
                names.add(first[: first.index(".")] if "." in first else first)
        for name in names:
            owners.setdefault(name, []).append(distribution)
    return owners


def place_of(distribution: metadata.Distribution) -> List[Path]:
    """The folder that describes an installed package. Its name has the version, so another version is another folder."""
    described = getattr(distribution, "_path", None)
    return [] if described is None else [Path(described)]


def packages(modules: Iterable[str]) -> Packages:
    """What these modules, which are loaded, belong to. Plyflow itself, the standard library and what is built in are left out."""
    owners: Optional[Dict[str, List[metadata.Distribution]]] = None
    standard = _standard()
    found = Packages({}, {}, [])
    seen = set()
    for name in sorted(modules):
        top = name.partition(".")[0]
        file = getattr(sys.modules.get(name), "__file__", None)
        if not file or top == "plyflow":
            continue
        path = Path(file).resolve()
        installed = {"site-packages", "dist-packages"} & set(path.parts)
        if not installed and any(folder in path.parents for folder in standard):
            continue
        if not installed:
            # Also of `pip install -e`, which leaves a version and takes the files where they lie: they change, and the version does not.
            found.others[name] = path
            continue
        if top in seen:
            continue
        owners = _owners() if owners is None else owners
        for distribution in owners.get(top, []):
            called = distribution.metadata["Name"]
            found.versions[called] = distribution.version
            found.files.extend(place_of(distribution))
        if owners.get(top):
            seen.add(top)
        else:
            found.others[name] = path
    return found
