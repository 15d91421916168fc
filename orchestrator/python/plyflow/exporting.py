"""Writes formed plies as files of other programs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Sequence, Union

from ._ask import PathLike, Settings, ask, findings, refuse, trusted, words_of
from .errors import NotFound, PlyflowError
from .runs import Step

__all__ = ["Exported", "export"]


@dataclass(frozen=True)
class Exported:
    """What an export has written.

    Attributes:
        files: paths of the files, in their order; those too that were there before with the same content.
        notes: what the user should know of them, such as which fields the artifact does not tell.
    """

    files: list[Path] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def export(
    of: PathLike | Step,
    format: str | Sequence[str],
    *,
    step: str | None = None,
    to: PathLike = ".",
    frame: Union[int, str, None] = None,
    bodies: Sequence[str] = (),
    unit: str = "m",
    net: str = "20 mm",
    force: bool = False,
    set: Settings | None = None,
    store: PathLike | None = None,
    trust: bool | Sequence[PathLike] = False,
) -> Exported:
    """Writes the plies of an artifact for another program, as the command ``plyflow export`` does. Nothing is run.

    >>> import plyflow
    >>> made = plyflow.export("plyflow-demo/joggle-spar/workflow-coarse.yaml", "csv", step="coarse", to="exported", bodies=["ply_1"])
    >>> [file.name for file in made.files]
    ['coarse-ply_1-points.csv', 'coarse-ply_1-cells.csv']

    Args:
        of: a workflow file, with `step`; an artifact; or a :class:`Step` of a run.
        format: ``vtu``, ``csv``, ``abaqus``, ``calculix``, ``nastran`` or ``dxf``; or several of them.
        step: of a workflow file: the step, or one of its items (``"local[A]"``).
        to: folder to write into; it is made if need be.
        frame: which frame, from 0, or ``"all"`` (``vtu`` alone) [default: the last one].
        bodies: only these bodies [default: all bodies for ``vtu``, all plies for the others].
        unit: in what lengths are written: ``m``, ``mm`` or ``in``.
        net: distance of the fibre lines of ``dxf`` in the flat ply, with its unit.
        force: whether files that are there with another content are replaced.
        set: of a workflow file: other values of parameters, as for :func:`plyflow.run`.
        store: of a workflow file: its store [default: ``.plyflow`` beside it].
        trust: of a workflow file: as for :func:`plyflow.run`.

    Raises:
        NotFound: there is no such file, step, body or frame, the step has not run, or a file with another content is in the way.
        InvalidInput: the workflow has errors.
        Damaged: the artifact is not as it was written.
        PlyflowError: `step`, `set`, `store` or `trust` with an artifact or a :class:`Step`, or a word that is no format or unit.
    """
    if isinstance(of, Step):
        if step is not None or set or store is not None or trust:
            raise PlyflowError("`step`, `set`, `store` and `trust` are for a workflow file; a Step knows its artifact")
        file = of.artifact.path
    else:
        file = Path(of)
        if not file.is_file():
            raise NotFound(f"there is no file {file}; give a workflow file with `step`, an artifact, or a Step of a run")
    formats = [format] if isinstance(format, str) else list(format)
    if not formats:
        raise PlyflowError("`format` is empty; give one or more of vtu, csv, abaqus, calculix, nastran, dxf")
    options: list[str] = [*words_of(set), *trusted(trust)] + ([] if store is None else ["--store", str(store)])
    words = ["export", "--print", "json", f"--format={','.join(formats)}", f"--to={Path(to)}", f"--unit={unit}", f"--net={net}", *options]
    words += [] if frame is None else [f"--frame={frame}"]
    words += [f"--body={body}" for body in ([bodies] if isinstance(bodies, str) else bodies)]
    words += ["--force"] if force else []
    try:
        told = ask([*words, "--", file, *([] if step is None else [step])])
    except PlyflowError as error:
        if error.code == 3:
            refuse(findings(file, options))
        raise
    return Exported([Path(f["path"]) for f in told["files"]], list(told["notes"]))
