"""Runs a workflow and follows its events."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Sequence

from ._ask import PathLike, Settings, error_of, trusted, words_of
from ._installation import environment, program
from .build import Workflow
from .errors import Finding, InvalidInput, PlyflowError, RunFailed
from .runs import Run

__all__ = ["Event", "run"]

_STEP_FAILED, _EXPECTATION = 4, 5


@dataclass(frozen=True)
class Event:
    """Something that happened in a run.

    Attributes:
        kind: ``cached`` (the store has it), ``started``, ``progress``, ``log``, ``finished``, ``failed``, ``stopped``, ``skipped``, ``damaged``
            (what the store has is not as it was written, and is made again), ``end``, or ``text`` (what the program said besides).
        step: name of the step, or ``None`` where the event is about the whole run.
        item: labels of its item.
        data: what else is told: of ``progress`` ``fraction`` (0 to 1), ``simulated_time`` (s), ``phase``; of ``finished`` ``cost``; of ``failed``
            ``reason``; of ``end`` ``executed``, ``cached``, ``failed``, ``seconds``.
    """

    kind: str
    step: str | None = None
    item: tuple[str, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, line: str) -> Event:
        """From a line of ``plyflow run --log-format json``."""
        try:
            told = json.loads(line)
            kind = str(told.pop("event"))
        except (ValueError, KeyError, AttributeError):
            return cls("text", data={"text": line})
        return cls(kind, told.pop("step", None), tuple(told.pop("item", ())), told)

    @property
    def label(self) -> str:
        """``coarse``, or ``local[A]``."""
        return f"{self.step}[{','.join(self.item)}]" if self.item else self.step or ""


def run(
    workflow: PathLike | Workflow,
    *,
    set: Settings | None = None,
    on_event: Callable[[Event], None] | None = None,
    until: Sequence[str] = (),
    force: Sequence[str] = (),
    jobs: int | None = None,
    store: PathLike | None = None,
    check: bool = False,
    report: bool = True,
    confirm: bool = False,
    path: PathLike | None = None,
    trust: bool | Sequence[PathLike] = False,
) -> Run:
    """Runs what the store does not have yet of a workflow, and returns the run.

    Args:
        workflow: the file, or a :class:`Workflow`, which is first written to `path`.
        set: other values of parameters: ``{"coarse.element_size": "12 mm", "coarse.scene.friction.fabric_fabric": 0.2}``.
        on_event: is called with every :class:`Event`, as it happens. If it raises, the run is stopped.
        until: only these steps and what they need.
        force: steps to run again even if the store has them.
        jobs: cores that the steps share [default: all].
        store: folder for artifacts [default: ``.plyflow`` beside the workflow].
        check: whether a missed expectation is an error.
        report: whether the HTML report is written beside the workflow.
        confirm: whether zones are also run in other ways, to say which defects stay.
        path: where a :class:`Workflow` is written [default: ``workflow.yaml`` in the current folder].
        trust: whether libraries and files in Python that the workflow names may be loaded, or which of them. They can do all that you can do.

    Raises:
        InvalidInput: the workflow has errors; nothing was run.
        RunFailed: a step failed, or an expectation was missed. What is finished is kept.
        Locked: another process is running it.
        Stopped: it was stopped from elsewhere. The same call goes on.
        KeyboardInterrupt: it was stopped here; what is finished is kept.
    """
    if isinstance(workflow, Workflow):
        workflow = workflow.write(path or "workflow.yaml")
    elif path is not None:
        raise PlyflowError("`path` says where a Workflow is written; a file stays where it is")
    file = Path(workflow)
    words = ["run", "--log-format", "json", *words_of(set), *trusted(trust)]
    words += [w for step in until for w in ("--until", step)] + [w for step in force for w in ("--force", step)]
    words += [] if jobs is None else ["--jobs", str(jobs)]
    words += [] if store is None else ["--store", str(store)]
    words += [w for w, given in (("--check", check), ("--no-report", not report), ("--confirm", confirm)) if given]
    code, events = _follow([*words, "--", str(file)], on_event)
    if code != 0:
        raise _error(code, events)
    return Run(file, store=store, set=set, trust=trust)


def _follow(words: Sequence[str], on_event: Callable[[Event], None] | None) -> tuple[int, list[Event]]:
    """Runs the program to its end; gives its exit code, and the events that tell why it ended so."""
    kept: list[Event] = []
    # A session of its own: Ctrl-C on a terminal reaches this process alone, which passes it on once. Twice would stop the steps at once.
    with subprocess.Popen(
        [str(program()), *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        env={**os.environ, **environment()},
        text=True,
        encoding="utf-8",
        errors="replace",
    ) as process:
        assert process.stderr is not None
        try:
            for line in process.stderr:
                event = Event.of(line.rstrip("\n"))
                if event.kind in ("invalid", "error", "failed", "text"):
                    kept.append(event)
                if on_event is not None and event.kind not in ("invalid", "error"):
                    on_event(event)
        except BaseException:
            process.send_signal(signal.SIGINT)
            for _ in process.stderr:
                pass
            raise
    return process.returncode, kept


def _error(code: int, events: Sequence[Event]) -> PlyflowError:
    findings = [Finding.of(f) for e in events if e.kind == "invalid" for f in e.data["findings"]]
    if findings:
        return InvalidInput(findings)
    said = [str(e.data["text"]) for e in events if e.kind == "error"] or [str(e.data["text"]) for e in events if e.kind == "text"]
    failures = [{"step": e.step, "item": e.item, **e.data} for e in events if e.kind == "failed" and not e.data.get("again")]
    if code in (_STEP_FAILED, _EXPECTATION):
        lines = [f"{e.label}: {e.data['reason']}" for e in events if e.kind == "failed" and not e.data.get("again")]
        return RunFailed("\n".join(lines or said), code, failures)
    return error_of(code, "\n".join(said))
