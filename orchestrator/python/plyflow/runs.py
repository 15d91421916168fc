"""Runs: the steps of a workflow with what the store has of each, their numbers, defects and studies."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Iterator, Mapping, Sequence

from ._ask import PathLike, Settings, ask, findings, needed, refuse, trusted, words_of
from .artifact import Artifact, Body, FieldInfo, Number, Values
from .errors import NotFound, PlyflowError
from .study import Study

__all__ = ["Run", "Step", "Store"]

# Columns of defects, with SI units where there are such, in the words of the kind `comparison`. `schemas/data-model.md` says what they are; a
# test holds this against the schema of artifacts.
_DEFECTS = {
    "id": "", "model": "", "zone": "", "ply": "", "type": "", "cause": "", "length": "m", "area": "m2", "amplitude": "m", "radius": "m",
    "direction": "rad", "curvature_max": "1/m", "crest_sharpness": "rad", "ridge_shear": "rad", "ridge_shear_min": "rad",
    "ridge_shear_max": "rad", "shear_min": "rad", "shear_max": "rad", "touches_cut": "",
}  # fmt: skip


def _in_common_words(kind: str, defect: Mapping[str, Any]) -> dict[str, Any]:
    """A defect by the names of `comparison`, whichever of the two kinds tells of it."""
    out = dict(defect)
    if kind == "measurement":
        least, most = defect.get("shear") or (None, None)
        out.update(id=str(defect["number"]), ply=defect["on"], shear_min=least, shear_max=most)
    return {**{name: out.get(name) for name in _DEFECTS}, "centre_x": defect["centre"][0], "centre_y": defect["centre"][1]}


@dataclass
class Step:
    """A step of a run, or one item of it, with what the store has.

    Attributes:
        name: as in the workflow. At a point of a study it ends with the name of the point.
        item: labels of the item of a step that is fanned out, such as ``("A",)``; empty otherwise.
        state: ``done`` (the store has its artifact), ``to run``, ``failed`` (when it ran last), or ``unknown`` (its number is not known yet).
        reason: why it would run, or its key.
        key: content key, once it is done.
        kind: of its artifact, such as ``forming``.
        path: of its artifact.
        bytes: size of its artifact.
        cost: ``wall_seconds``, ``cpu_seconds``, ``peak_memory`` (bytes), ``threads``.
        host: machine on which it ran.
        warnings: what the user should know.
    """

    name: str
    item: tuple[str, ...] = ()
    state: str = "done"
    reason: str = ""
    key: str | None = None
    kind: str | None = None
    path: Path | None = None
    bytes: int | None = None
    cost: dict[str, Any] = field(default_factory=dict)
    host: str | None = None
    warnings: list[str] = field(default_factory=list)
    _artifact: Artifact | None = field(default=None, repr=False, compare=False)
    _verify: bool = field(default=True, repr=False, compare=False)

    @property
    def label(self) -> str:
        """``coarse``, or ``local[A]``."""
        return f"{self.name}[{','.join(self.item)}]" if self.item else self.name

    @property
    def artifact(self) -> Artifact:
        """Its artifact, opened at first use, when the program looks whether the bytes are those that were written.

        Raises:
            NotFound: it has none yet; says why.
            Damaged: the file is not as it was written.
        """
        if self._artifact is None:
            if self.path is None:
                raise NotFound(f"{self.label} has no artifact yet ({self.state}: {self.reason}); plyflow.run() makes it")
            self._artifact = Artifact(self.path, verify=self._verify)
        return self._artifact

    @property
    def provenance(self) -> dict[str, Any]:
        """What made its artifact: parameters in SI units, plugin with version and hash, keys of the inputs, content key."""
        return self.artifact.provenance

    @property
    def results(self) -> dict[str, Number]:
        """The named numbers that it reported, without those that are measured of the machine."""
        return self.artifact.results

    @property
    def bodies(self) -> list[str]:
        """Names of the bodies of its artifact."""
        return self.artifact.bodies

    @property
    def fields(self) -> dict[str, list[FieldInfo]]:
        """By body, which fields there are."""
        return self.artifact.fields

    def __getitem__(self, body: str) -> Body:
        """A body of its artifact: ``step["ply_1"].field("shear_angle")``."""
        return self.artifact[body]

    def array(self, path: str) -> Values:
        """A free array of its artifact, such as ``history/kinetic``."""
        return self.artifact.array(path)

    def close(self) -> None:
        """Closes its artifact, if it is open. It is opened again when it is needed."""
        if self._artifact is not None:
            self._artifact.close()
            self._artifact = None


class _Steps:
    """What has steps that are found by their labels."""

    @property
    def steps(self) -> list[Step]:
        raise NotImplementedError

    def __getitem__(self, label: str) -> Step:
        """A step by its name or label: ``run["coarse"]``, ``run["local[A]"]``.

        Raises:
            NotFound: there is none, or there are several; lists them.
        """
        steps = self.steps
        found = [s for s in steps if s.label == label] or [s for s in steps if s.name == label]
        if len(found) == 1:
            return found[0]
        if found:
            raise NotFound(f"'{label}' has several items: {', '.join(s.label for s in found)}")
        raise NotFound(f"there is no step '{label}'; there are: {', '.join(s.label for s in steps) or 'none'}")

    def __iter__(self) -> Iterator[Step]:
        return iter(self.steps)

    def __contains__(self, label: object) -> bool:
        return any(label in (s.label, s.name) for s in self.steps)


class Run(_Steps):
    """What the store has of a workflow, as the file is now. A step that does not run again counts, whoever ran it and when.

    Args:
        workflow: the workflow file.
        store: its store [default: ``.plyflow`` beside it].
        set: other values of parameters, as for :func:`plyflow.run`: ``{"coarse.element_size": "12 mm"}``.
        verify: whether artifacts are looked at by the program before they are read.
        trust: as for :func:`plyflow.run`.

    Raises:
        NotFound: there is no such file.
        InvalidInput: it has errors.
    """

    def __init__(
        self,
        workflow: PathLike,
        store: PathLike | None = None,
        set: Settings | None = None,
        verify: bool = True,
        trust: bool | Sequence[PathLike] = False,
    ) -> None:
        self.workflow = Path(workflow)
        self._options: list[str] = [*words_of(set), *trusted(trust)]
        if store is not None:
            self._options += ["--store", str(store)]
        self._store = store
        self._verify = verify
        self._steps: list[Step] | None = None
        self._told: dict[str, Any] | None = None
        if not self.workflow.is_file():
            raise NotFound(f"there is no workflow file {self.workflow}")
        self.refresh()

    def __repr__(self) -> str:
        done = sum(s.state == "done" for s in self.steps)
        return f"<Run of {self.workflow}: {done} of {len(self.steps)} steps done>"

    def refresh(self) -> Run:
        """Looks again at the workflow file and the store, and returns itself."""
        for step in self._steps or ():
            step.close()
        try:
            self._told = self._ask("results")
            planned = self._ask("plan")
        except PlyflowError as error:
            if error.code == 3:
                refuse(findings(self.workflow, self._options))
            raise
        self._steps = self._read(planned)
        return self

    @property
    def name(self) -> str:
        """Name of the workflow."""
        return str(self._results["workflow"])

    @property
    def steps(self) -> list[Step]:
        """All steps and items that are known, in the order of the workflow."""
        return list(self._steps or ())

    def results(self, step: str | None = None) -> Any:
        """The named numbers of all steps, or of one, as a pandas DataFrame.

        Columns: ``step``, ``item``, ``result``, ``value`` (SI; NaN where an expectation has no number), ``unit``, ``measured`` (whether it depends
        on the machine), ``expected``, ``tolerance``, ``minimum``, ``maximum``, ``verdict``, ``source``. ``attrs["units"]`` has the unit of each
        result by name.

        Raises:
            MissingPackage: pandas is not installed.
            NotFound: there is no such step.
        """
        pandas = needed("pandas", "results as a frame")
        rows = []
        for row in self._results["results"]:
            expected = row["expected"] or {}
            bounds = {k: expected.get(k) for k in ("value", "tolerance", "minimum", "maximum", "source")}
            bounds["expected"] = bounds.pop("value")
            rows.append({**row, "item": "/".join(row["item"]), **bounds})
        columns = ["step", "item", "result", "value", "unit", "measured", "expected", "tolerance", "minimum", "maximum", "verdict", "source"]
        frame = pandas.DataFrame(rows, columns=columns)
        for column in ("value", "expected", "tolerance", "minimum", "maximum"):
            frame[column] = pandas.to_numeric(frame[column])
        if step is not None:
            if step not in self:
                self[step]
            frame = frame[frame["step"] == step].reset_index(drop=True)
        frame.attrs["units"] = dict(zip(frame["result"], frame["unit"]))
        return frame

    def result(self, name: str, step: str, item: Sequence[str] = ()) -> Number:
        """One number with its unit, those that are measured of the machine too.

        Raises:
            NotFound: the step has not reported it; lists what it has.
        """
        rows = [r for r in self._results["results"] if r["step"] == step and tuple(r["item"]) == tuple(item) and r["value"] is not None]
        for row in rows:
            if row["result"] == name:
                return Number(row["value"], row["unit"])
        raise NotFound(f"{step} has no result '{name}'; there are: {', '.join(sorted({r['result'] for r in rows})) or 'none'}")

    def costs(self) -> Any:
        """What each step cost when it ran, as a pandas DataFrame: wall and CPU seconds, peak memory (bytes), threads, size (bytes).

        Raises:
            MissingPackage: pandas is not installed.
        """
        pandas = needed("pandas", "costs as a frame")
        columns = ["wall_seconds", "cpu_seconds", "peak_memory", "threads", "bytes"]
        done = [s for s in self.steps if s.state == "done"]
        frame = pandas.DataFrame([{**s.cost, "bytes": s.bytes} for s in done], columns=columns, index=[s.label for s in done])
        frame.attrs["units"] = {"wall_seconds": "s", "cpu_seconds": "s", "peak_memory": "B", "threads": "1", "bytes": "B"}
        return frame

    def defects(self, step: str | None = None) -> Any:
        """Wrinkles and bridging that steps found, one row each, as a pandas DataFrame with units (SI) in ``attrs["units"]``.

        They come from artifacts of the kinds ``comparison`` and ``measurement``; the column ``step`` says from which, and names are those of
        ``comparison`` (`schemas/data-model.md`). What a kind does not tell is missing in its rows. ``centre_x`` and ``centre_y`` lie in the undeformed plane.

        Raises:
            MissingPackage: pandas is not installed.
            NotFound: no step tells of defects; says which do not.
        """
        pandas = needed("pandas", "defects as a frame")
        kinds = ("comparison", "measurement")
        chosen = [s for s in self.steps if s.kind in kinds and step in (None, s.name, s.label)]
        if not chosen:
            what = f"'{step}'" if step else "this workflow"
            raise NotFound(f"{what} has no step with a table of defects that is done: `comparison` and `defect-measurement` make one")
        rows = [{"step": s.label, **_in_common_words(str(s.kind), d)} for s in chosen for d in s.artifact.attributes["defects"]]
        frame = pandas.DataFrame(rows, columns=["step", *_DEFECTS, "centre_x", "centre_y"])
        units = {**{name: unit for name, unit in _DEFECTS.items() if unit}, "centre_x": "m", "centre_y": "m"}
        for column in units:
            frame[column] = pandas.to_numeric(frame[column])
        frame.attrs["units"] = units
        return frame

    def study(self) -> Study:
        """The points of the workflow's study or optimisation.

        Raises:
            NotFound: the workflow is no study.
        """
        return Study(self._ask("results", "--study"))

    def report(self, output: PathLike) -> Path:
        """Writes the HTML report of what the store has to a file, and returns its path."""
        ask(["report", *self._options, "--output", output, "--", self.workflow], silent=True)
        return Path(output)

    def verify(self) -> list[str]:
        """Has the program read the whole store against its seals. Moves nothing. Returns what is damaged, in words; empty: all is well."""
        store = [] if self._store is None else ["--store", str(self._store)]
        told = ask(["verify", "--dry-run", "--format", "json", *store, "--", self.workflow], allowed=(0, 8))
        return [str(text) for text in told["damaged"]]

    @property
    def _results(self) -> dict[str, Any]:
        assert self._told is not None
        return self._told

    def _ask(self, command: str, *more: str) -> Any:
        return ask([command, "--format", "json", *more, *self._options, "--", self.workflow])

    def _read(self, planned: Any) -> list[Step]:
        done = {(s["step"], tuple(s["item"])): s for s in self._results["steps"]}
        steps = []
        for plan in planned["steps"] if isinstance(planned, dict) else planned:
            item = tuple(plan["item"] or ())
            state = {"cached": "done", "run": "to run"}.get(plan["state"], plan["state"])
            step = Step(plan["name"], item, "failed" if plan["failed"] else state, plan["reason"], _verify=self._verify)
            told = done.get((step.name, item)) if plan["item"] is not None else None
            if told and step.state == "done":
                step.key, step.kind, step.path, step.bytes = told["key"], told["kind"], Path(told["artifact"]), told["bytes"]
                step.cost, step.host, step.warnings = told["cost"], told["host"], told["warnings"]
            if plan["item"] is not None or step.state == "unknown":
                steps.append(step)
        return steps


class Store(_Steps):
    """All that a store has, whichever workflow made it: a folder such as ``.plyflow``.

    The list is read from the records beside the artifacts as they are. An artifact is looked at by the program when it is opened. Items have
    numbers, counted from 0, in the place of labels, which only a run knows: ``local[0]``.

    Args:
        folder: the store, or the folder in which it lies as ``.plyflow``.
        verify: whether artifacts are looked at by the program before they are read.

    Raises:
        NotFound: there is no store.
    """

    def __init__(self, folder: PathLike, verify: bool = True) -> None:
        given = Path(folder)
        found = [f for f in (given, given / ".plyflow") if (f / "artifacts").is_dir()]
        if not found:
            raise NotFound(f"{given} is no store: there is no folder `artifacts` in it, nor in {given / '.plyflow'}; a workflow file opens its own store")
        self.folder = found[0]
        self._verify = verify

    def __repr__(self) -> str:
        return f"<Store {self.folder}: {len(self.steps)} artifacts>"

    @property
    def steps(self) -> list[Step]:
        """A step for each artifact, by name, item and key. Several of one name differ in their key."""
        found = []
        for record in (self.folder / "artifacts").glob("*/*.record.json"):
            path = record.with_name(record.name[: -len(".record.json")] + ".vtkhdf")
            try:
                told: Mapping[str, Any] = json.loads(record.read_bytes())
                step = Step(told["step"], tuple(map(str, told["item"])), key=told["key"], kind=told["kind"], bytes=told["bytes"], _verify=self._verify)
                step.reason, step.cost, step.host = f"key {step.key}", told["cost"], told.get("host")
                step.warnings = list(told.get("warnings", ()))
            except (ValueError, KeyError, OSError) as error:
                raise PlyflowError(f"{record}: no record that can be read ({error}): `plyflow verify --store {self.folder}` says what is damaged") from error
            if path.is_file():
                step.path = path
                found.append(step)
        return sorted(found, key=lambda s: (s.name, s.item, s.key or ""))

    def verify(self) -> list[str]:
        """Has the program read the whole store against its seals. Moves nothing. Returns what is damaged, in words; empty: all is well."""
        told = ask(["verify", "--dry-run", "--format", "json", "--store", self.folder], allowed=(0, 8))
        return [str(text) for text in told["damaged"]]
