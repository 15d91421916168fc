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

from importlib import metadata
from pathlib import Path
from typing import Union

import h5py

from ._ask import PathLike
from ._installation import include_folder, material, program, templates_folder, workflows_folder
from .artifact import Artifact, Body, FieldInfo, Number, Values
from .build import Material, Scene, Workflow, diaphragm, ply, schema
from .errors import Damaged, Finding, InvalidInput, Locked, MissingPackage, NotFound, PlyflowError, RunFailed, Stopped
from .running import Event, run
from .runs import Run, Step, Store
from .study import Study

try:
    __version__ = metadata.version("plyflow")
except metadata.PackageNotFoundError:  # from the source tree
    __version__ = "0+source"

__all__ = [
    "Artifact", "Body", "Damaged", "Event", "FieldInfo", "Finding", "InvalidInput", "Locked", "Material", "MissingPackage", "NotFound", "Number",
    "PlyflowError", "Run", "RunFailed", "Scene", "Step", "Stopped", "Store", "Study", "Values", "Workflow", "diaphragm", "include_folder",
    "material", "open", "ply", "program", "run", "schema", "templates_folder", "workflows_folder",
]  # fmt: skip


def open(path: PathLike, verify: bool = True) -> Union[Run, Store, Artifact]:
    """Opens a workflow file (what the store has of it), a store (a folder), or an artifact (an HDF5 file).

    Args:
        path: of either.
        verify: whether the program looks at an artifact before it is read, whether its bytes are those that were written.

    Raises:
        NotFound: there is no such file or folder, or no store in it.
        InvalidInput: the workflow has errors.
        Damaged: the artifact is not as it was written.
    """
    place = Path(path)
    if place.is_dir():
        return Store(place, verify=verify)
    if not place.is_file():
        raise NotFound(f"there is no file or folder {place}; give a workflow file, a store or an artifact")
    if h5py.is_hdf5(place):
        return Artifact(place, verify=verify)
    return Run(place, verify=verify)
