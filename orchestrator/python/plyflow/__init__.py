"""Plyflow from Python: read runs into arrays and frames, run workflows, and write scenes and workflows.

>>> import plyflow
>>> run = plyflow.open("plyflow-demo/joggle-spar/workflow-coarse.yaml")
>>> shear = run["coarse"]["ply_1"].field("shear_angle")
>>> shear.shape == (len(run["coarse"]["ply_1"].cells),), shear.unit
(True, 'rad')
>>> run.result("flagged_area", "defects").unit
'm2'

All numbers are in SI units. Only numpy and h5py are needed; pandas, xarray, pyvista and matplotlib when a call says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Sequence, Union

if TYPE_CHECKING:
    from . import declare
    from ._ask import PathLike
    from ._installation import include_folder, material, program, templates_folder, workflows_folder
    from .artifact import Artifact, Body, FieldInfo, Number, Values
    from .build import Material, Scene, Workflow, diaphragm, ply, schema
    from .errors import Damaged, Finding, InvalidInput, Locked, MissingPackage, NotFound, PlyflowError, RunFailed, Stopped
    from .exporting import Exported, export
    from .laws import Law, law
    from .running import Event, run
    from .runs import Run, Step, Store
    from .steps import Cancelled, Refused, StepRun, step
    from .study import Study

    __version__: str

__all__ = [
    "Artifact", "Body", "Cancelled", "Damaged", "Event", "Exported", "FieldInfo", "Finding", "InvalidInput", "Law", "Locked", "Material",
    "MissingPackage", "NotFound", "Number", "PlyflowError", "Refused", "Run", "RunFailed", "Scene", "Step", "StepRun", "Stopped", "Store", "Study",
    "Values", "Workflow", "__version__", "declare", "diaphragm", "export", "include_folder", "law", "material", "open", "ply", "program", "run",
    "schema", "step", "templates_folder", "workflows_folder",
]  # fmt: skip

# In which module each name is. It is imported when the name is used: the command `plyflow` must not wait for numpy.
_MODULES = {
    "_installation": ("include_folder", "material", "program", "templates_folder", "workflows_folder"),
    "artifact": ("Artifact", "Body", "FieldInfo", "Number", "Values"),
    "build": ("Material", "Scene", "Workflow", "diaphragm", "ply", "schema"),
    "errors": ("Damaged", "Finding", "InvalidInput", "Locked", "MissingPackage", "NotFound", "PlyflowError", "RunFailed", "Stopped"),
    "exporting": ("Exported", "export"),
    "laws": ("Law", "law"),
    "running": ("Event", "run"),
    "runs": ("Run", "Step", "Store"),
    "steps": ("Cancelled", "Refused", "StepRun", "step"),
    "study": ("Study",),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version()
    if name == "declare":
        from importlib import import_module

        return import_module(f"{__name__}.declare")
    for module, names in _MODULES.items():
        if name in names:
            from importlib import import_module

            value = getattr(import_module(f"{__name__}.{module}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    from importlib import metadata

    try:
        return metadata.version("plyflow")
    except metadata.PackageNotFoundError:  # from the source tree
        return "0+source"


def open(path: PathLike, verify: bool = True, trust: Union[bool, Sequence[PathLike]] = False) -> Union[Run, Store, Artifact]:
    """Opens a workflow file (what the store has of it), a store (a folder), or an artifact (an HDF5 file).

    Args:
        path: of either.
        verify: whether the program looks at an artifact before it is read, whether its bytes are those that were written.
        trust: of a workflow: as for :func:`plyflow.run`.

    Raises:
        NotFound: there is no such file or folder, or no store in it.
        InvalidInput: the workflow has errors.
        Damaged: the artifact is not as it was written.
    """
    import h5py

    from .artifact import Artifact
    from .errors import NotFound
    from .runs import Run, Store

    place = Path(path)
    if place.is_dir():
        return Store(place, verify=verify)
    if not place.is_file():
        raise NotFound(f"there is no file or folder {place}; give a workflow file, a store or an artifact")
    if h5py.is_hdf5(place):
        return Artifact(place, verify=verify)
    return Run(place, verify=verify, trust=trust)
