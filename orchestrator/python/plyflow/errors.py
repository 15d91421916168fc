"""What can go wrong, by class. Every error is a :class:`PlyflowError`, and says where, what was given, what was expected and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping, Sequence

__all__ = [
    "Damaged",
    "Finding",
    "InvalidInput",
    "Locked",
    "MissingPackage",
    "NotFound",
    "PlyflowError",
    "RunFailed",
    "Stopped",
]


class PlyflowError(Exception):
    """What the program, or this package, could not do.

    Attributes:
        code: exit code of the program (docs/exit-codes.md), or ``None`` where the program was not asked.
    """

    def __init__(self, message: str, code: int | None = None) -> None:
        super().__init__(message)
        self.code = code


class NotFound(PlyflowError, LookupError):
    """A file, step, body, field or result that is not there. The message lists what is."""

    def __str__(self) -> str:
        # A LookupError of its own would be shown in quotes.
        return str(self.args[0]) if self.args else ""


class Damaged(PlyflowError):
    """A file of the store is not as it was written. A run of its workflow makes it again."""


class Locked(PlyflowError):
    """Another process is running the workflow."""


class Stopped(PlyflowError):
    """A run was stopped. The same call goes on with it."""


class MissingPackage(PlyflowError, ImportError):
    """A call needs a package that is not installed."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a workflow, a scene or a material.

    Attributes:
        file: the file, as it was named.
        line: from 1; 0 where the file could not be read.
        column: in characters, from 1; 0 where the file could not be read.
        severity: ``error`` or ``warning``.
        message: what is wrong.
        given: what was given, where there is such.
        expected: what was expected.
        hint: what to do.
        points: points of a study at which it was found; empty: at all.
    """

    file: str
    line: int
    column: int
    severity: str
    message: str
    given: str | None = None
    expected: str | None = None
    hint: str | None = None
    points: tuple[str, ...] = ()

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Finding:
        """From the JSON of ``plyflow validate --format json``."""
        return cls(
            file=str(told["file"]),
            line=int(told["line"]),
            column=int(told["column"]),
            severity=str(told["severity"]),
            message=str(told["message"]),
            given=told.get("given"),
            expected=told.get("expected"),
            hint=told.get("help"),
            points=tuple(told.get("points", ())),
        )

    def __str__(self) -> str:
        parts = [f"{self.file}:{self.line}:{self.column}: {self.message}"]
        if self.given is not None:
            parts.append(f"given: {self.given}")
        if self.expected is not None:
            parts.append(f"expected: {self.expected}")
        if self.hint is not None:
            parts.append(self.hint)
        return "; ".join(parts)


class InvalidInput(PlyflowError):
    """A workflow, scene or material has errors. Nothing was run.

    Attributes:
        findings: all of them, in the order of the files.
    """

    def __init__(self, findings: Sequence[Finding]) -> None:
        self.findings = list(findings)
        count = len(self.findings)
        head = f"{count} finding{'' if count == 1 else 's'}"
        super().__init__("\n".join([head, *(f"  {f}" for f in self.findings)]), 3)


class RunFailed(PlyflowError):
    """At least one step of a run failed, or an expectation was missed.

    Attributes:
        failures: the events of the steps that failed, each with ``step``, ``item`` and ``reason``.
    """

    def __init__(self, message: str, code: int, failures: Sequence[Mapping[str, Any]]) -> None:
        super().__init__(message, code)
        self.failures = [dict(f) for f in failures]
