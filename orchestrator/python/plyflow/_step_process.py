"""The process in which a step runs: it gets the step's sources over a socket, runs its function, and asks the program for all else.

A message is the length of a header (4 bytes, little-endian), the header (JSON) and as many bytes as its ``bytes`` says.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import json
import linecache
import signal
import socket
import struct
import sys
import traceback
from types import ModuleType
from typing import Any, Dict, Mapping, NoReturn, Optional, Sequence, Tuple

from . import _environment as environment


class Wire:
    """The conversation with the program."""

    def __init__(self, number: int) -> None:
        self._socket = socket.socket(fileno=number)
        self._in = self._socket.makefile("rb")

    def send(self, header: Dict[str, Any], payload: bytes = b"") -> None:
        text = json.dumps({**header, "bytes": len(payload)}).encode()
        self._socket.sendall(struct.pack("<I", len(text)) + text)
        if payload:
            self._socket.sendall(payload)

    def receive(self) -> Tuple[Dict[str, Any], bytearray]:
        (length,) = struct.unpack("<I", self._read(4))
        header = json.loads(bytes(self._read(length)))
        return header, self._read(header["bytes"])

    def _read(self, count: int) -> bytearray:
        data = bytearray(count)
        view, done = memoryview(data), 0
        while done < count:
            got = self._in.readinto(view[done:])
            if not got:
                # The worker is gone, and with it everybody who would hear of it.
                sys.exit(3)
            done += got
        return data

    def ask(self, request: Dict[str, Any], payload: bytes) -> Tuple[Dict[str, Any], bytearray]:
        self.send(request, payload)
        return self.receive()


class Sources(importlib.abc.MetaPathFinder, importlib.abc.InspectLoader):
    """Imports the step's own modules from their texts, before all others. Their file names are those beside the step's file."""

    def __init__(self, sources: Mapping[str, str]) -> None:
        self.modules: Dict[str, Tuple[str, str]] = {}
        for path, text in sources.items():
            name = path[: -len(".py")].replace("/", ".")
            if name.endswith(".__init__"):
                name = name[: -len(".__init__")]
            self.modules[name] = (path, text)
            # For tracebacks: no file of this name is where the process stands.
            linecache.cache[path] = (len(text), None, text.splitlines(True), path)

    def find_spec(self, fullname: str, path: Optional[Sequence[str]], target: Optional[ModuleType] = None) -> Any:
        if fullname in self.modules:
            return importlib.util.spec_from_loader(fullname, self, origin=self.modules[fullname][0])
        # A folder of modules without an `__init__.py`.
        if any(name.startswith(fullname + ".") for name in self.modules):
            spec = importlib.util.spec_from_loader(fullname, None, is_package=True)
            return spec
        return None

    def is_package(self, fullname: str) -> bool:
        return self.modules[fullname][0].endswith("__init__.py")

    def get_source(self, fullname: str) -> str:
        return self.modules[fullname][1]

    def get_code(self, fullname: str) -> Any:
        path, text = self.modules[fullname]
        return compile(text, path, "exec")

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = self.modules[module.__name__][0]
        exec(self.get_code(module.__name__), module.__dict__)


def _differs(job: Mapping[str, Any]) -> Optional[str]:
    """What differs from the environment for which the step's library was made."""
    from importlib import metadata

    if environment.python() != job["python"]:
        return f"the step was made with {job['python']}, and {sys.executable} is {environment.python()}"
    for name, version in job["packages"].items():
        try:
            now = metadata.version(name)
        except metadata.PackageNotFoundError:
            now = "not there"
        if now != version:
            return f"the step was made with {name} {version}, which is {now} for {sys.executable}"
    return None


def _undeclared(job: Mapping[str, Any], before: set[str]) -> Optional[str]:
    """A package that was imported while the step ran, and whose version is not in the key."""
    new = {name for name in set(sys.modules) - before if name.partition(".")[0] not in job["modules"]}
    found = environment.packages(new)
    for name in sorted(set(found.versions) - set(job["packages"])):
        return (
            f"{job['main']} imports the package {name} only while it runs, so its version is not part of the step's key; "
            f'import it at the top of the file, or give requires=["{name}"] to `plyflow.step`'
        )
    for name, path in sorted(found.others.items()):
        if sys.modules[name].__file__ not in job["sources"]:
            return f"{job['main']} imports {name} from {path} while it runs, which is of no installed package, so nobody would see a change of it"
    return None


def _told(job: Mapping[str, Any], error: BaseException) -> str:
    """What went wrong and where in the step's own files, in a line."""
    places = [f for f in traceback.extract_tb(error.__traceback__) if f.filename in job["sources"]]
    where = f"{places[-1].filename}:{places[-1].lineno}: " if places else ""
    if isinstance(error, SyntaxError) and error.filename in job["sources"]:
        where = f"{error.filename}:{error.lineno}: "
    text = str(error) if not isinstance(error, KeyError) else f"there is no {error}"
    name = type(error).__name__
    told = f"{where}{name}: {text}" if text else f"{where}{name}"
    if isinstance(error, ModuleNotFoundError):
        told += ". A step imports the modules beside its file at the top of the file, not while it runs"
    return told


def _run(wire: Wire, job: Mapping[str, Any]) -> Dict[str, Any]:
    from .steps import Cancelled, StepRun, defined

    other = _differs(job)
    if other:
        return {"op": "failed", "text": f"{other}; run again, so that the step is made anew"}
    before = set(sys.modules)
    try:
        sys.meta_path.insert(0, Sources(job["sources"]))
        stem = job["main"][: -len(".py")]
        importlib.import_module(stem)
        steps = [d for d in defined() if d.kind == "step"]
        steps[0].function(StepRun(wire.ask, job))
    except Cancelled:
        return {"op": "cancelled"}
    except SystemExit as error:
        return {"op": "failed", "text": f"the step called sys.exit({error.code!r}); to fail, raise an error that says why"}
    except BaseException as error:
        traceback.print_exc()
        return {"op": "failed", "text": _told(job, error)}
    undeclared = _undeclared(job, before)
    return {"op": "failed", "text": undeclared} if undeclared else {"op": "done"}


def main() -> NoReturn:
    """Runs the step that the program tells over the socket with the number in ``sys.argv[1]``, and ends the process."""
    # The program asks for the end over the socket; a signal of the terminal or the group is not for this process.
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    wire = Wire(int(sys.argv[1]))
    job, _ = wire.receive()
    end = _run(wire, job)
    sys.stdout.flush()
    sys.stderr.flush()
    wire.send(end)
    sys.exit(0)
