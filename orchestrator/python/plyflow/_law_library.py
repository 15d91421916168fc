"""Makes the library of a law: compiled code behind a copy of the carrier (solver-plugins/door/python-law)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from importlib import util
from pathlib import Path
from typing import TYPE_CHECKING, Any, Sequence

from ._installation import carrier
from .errors import Finding, InvalidInput, MissingPackage, NotFound, PlyflowError

if TYPE_CHECKING:
    from .laws import Law

# As the carrier has them (solver-plugins/door/python-law/src/payload.rs).
MAGIC = b"PLYFLOW-PY-LAW-1"
LAYOUT = 1

# Levels of the x86-64 ABI for which code is made. The carrier takes the best that the processor has. Both give the same bits, as nothing is fused
# or summed in another order; the second only does four points at a time. The processor of this machine has no part in it, so that the same
# source and the same numba give the same library everywhere.
LEVELS = ("x86-64", "x86-64-v3")

# Asks a library, in a process of its own, why it is no plugin.
_ASK = """
import ctypes, sys
class Text(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("length", ctypes.c_uint64)]
library = ctypes.CDLL(sys.argv[1])
library.plyflow_python_law_fault.restype = Text
fault = library.plyflow_python_law_fault()
sys.stdout.buffer.write(ctypes.string_at(fault.data, fault.length))
"""


def make(law: Law, source: Path, library: Path, levels: Sequence[str] = LEVELS, bare: Path | None = None) -> dict[str, Any]:
    """Compiles a law and writes its library.

    Args:
        law: as it was found in the file.
        source: the file.
        library: where it goes.
        levels: for which processors.
        bare: the carrier; that of this installation where it is left out.

    Returns:
        ``library``: its path; ``watch``: the files and folders whose change means to make it anew.
    """
    if util.find_spec("numba") is None:
        raise MissingPackage(f"a law in Python needs the package numba, which {sys.executable} does not have: {sys.executable} -m pip install numba")
    place = bare or carrier("python_law")
    if not place.is_file():
        raise NotFound(f"there is no library {place} for laws in Python: build or install Plyflow again")
    with tempfile.TemporaryDirectory() as scratch:
        told = _compiled(law, source, levels, Path(scratch))
        code = bytearray()
        pieces = []
        for level, answer in told.items():
            for function, file in answer["code"].items():
                piece = Path(file).read_bytes()
                pieces.append({"function": function, "level": level, "at": len(code), "length": len(piece)})
                code += piece
    first = told[levels[0]]
    header = {
        "layout": LAYOUT,
        "manifest": json.dumps(law.manifest, sort_keys=False, allow_nan=False),
        "membrane_history": law.membrane_history,
        "bending_history": law.bending_history,
        "values": [value.header() for value in law.values],
        "code": pieces,
        "made": first["made"],
    }
    text = json.dumps(header, allow_nan=False).encode()
    payload = len(text).to_bytes(8, "little") + text + bytes(code)
    _write(library, place.read_bytes() + payload + len(payload).to_bytes(8, "little") + MAGIC, source)
    return {"library": str(library.absolute()), "watch": sorted({*first["watch"], str(place)})}


def _write(library: Path, content: bytes, source: Path) -> None:
    """Writes a library that has been loaded once. A file that is in use keeps its bytes: the new one takes its name."""
    try:
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=library.parent, prefix=f".{library.name}.", delete=False) as file:
            file.write(content)
    except OSError as error:
        raise PlyflowError(f"{library} cannot be written: {error.strerror or error}") from error
    try:
        os.chmod(file.name, 0o755)
        asked = subprocess.run([sys.executable, "-c", _ASK, file.name], stdin=subprocess.DEVNULL, capture_output=True, check=False)
        if asked.returncode != 0:
            said = asked.stderr.decode("utf-8", "replace").strip().splitlines()
            raise PlyflowError(f"the library that was made of {source} cannot be loaded: {said[-1] if said else asked.returncode}")
        fault = asked.stdout.decode("utf-8", "replace")
        if fault:
            hint = "a law may use numbers, tuples, if, for and the functions of math"
            raise InvalidInput([Finding(str(source), 1, 1, "error", f"the law cannot run as a plugin: {fault}", hint=hint)])
        os.replace(file.name, library)
    finally:
        Path(file.name).unlink(missing_ok=True)


# The package `plyflow` alone is taken from where it lies, which may be the `site-packages` of another interpreter than this one.
_BEGIN = """
import sys, importlib.util as util
sys.path[:] = [path for path in sys.path if path]
folder = sys.argv.pop(1)
found = util.spec_from_file_location("plyflow", folder + "/__init__.py", submodule_search_locations=[folder])
sys.modules["plyflow"] = package = util.module_from_spec(found)
found.loader.exec_module(package)
from plyflow._law_code import main
main()
"""


def _environment(level: str) -> dict[str, str]:
    """That of a process that compiles for `level`. No setting of numba's that the user has made reaches the code."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    set_here = {
        "NUMBA_CPU_NAME": level,
        "NUMBA_CPU_FEATURES": "",
        # Functions of Intel's library, which would give bits of its own, and are not there where the law runs.
        "NUMBA_DISABLE_INTEL_SVML": "1",
        "NUMBA_DISABLE_JIT": "0",
        "PYTHONHASHSEED": "0",
    }
    return {**kept, **set_here}


def _compiled(law: Law, source: Path, levels: Sequence[str], scratch: Path) -> dict[str, Any]:
    """What the processes answer that compile for each level, which run at the same time."""
    running = {}
    for level in levels:
        folder = scratch / level
        folder.mkdir()
        package = str(Path(__file__).resolve().parent)
        words = [sys.executable, "-B", "-c", _BEGIN, package, str(source), law.name, level, str(folder)]
        # numba reads settings also from a file in the folder where it runs: this one is empty.
        process = subprocess.Popen(
            words, cwd=folder, env=_environment(level), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        running[level] = process
    told: dict[str, Any] = {}
    try:
        for level, process in running.items():
            _, said = process.communicate()
            answer = scratch / level / "answer.json"
            if process.returncode != 0 or not answer.is_file():
                text = said.decode("utf-8", "replace").strip()
                raise PlyflowError(
                    f"numba could not compile the law '{law.name}' of {source} for {level} (code {process.returncode}): {text[-2000:]}"
                )
            told[level] = json.loads(answer.read_text())
            if told[level]["findings"]:
                raise InvalidInput([Finding(**finding) for finding in told[level]["findings"]])
    finally:
        for process in running.values():
            if process.poll() is None:
                process.kill()
                process.communicate()
    return told
