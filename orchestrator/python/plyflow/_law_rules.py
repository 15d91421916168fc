"""What a law may be written with: found in its text before it is compiled, and in its code afterwards."""

from __future__ import annotations

import ast
import inspect
import textwrap
from types import FunctionType
from typing import Any, Callable, Iterator, NoReturn, Sequence

from .errors import Finding, InvalidInput
from .laws import Law

WHAT_A_LAW_MAY = "numbers, tuples, if, for, while, the functions of math, and functions of your own that keep to the same"

_NO_RAISE = "return math.nan for a state that must not be: check-plugin finds it, and a run stops there"
_NO_ARRAY = "use numbers and tuples; what a point remembers is in history"
_REFUSED: dict[type, tuple[str, str]] = {
    ast.Raise: ("a law cannot raise", _NO_RAISE),
    ast.Assert: ("a law cannot assert", _NO_RAISE),
    ast.Try: ("a law cannot catch what is raised, as nothing is", "test the numbers with if"),
    ast.With: ("a law has no 'with': object mode would run Python for every point", f"use {WHAT_A_LAW_MAY}"),
    ast.Yield: ("a law cannot yield", "return the numbers"),
    ast.YieldFrom: ("a law cannot yield", "return the numbers"),
    ast.Global: ("a law keeps nothing in global names: points are computed in any order, by several threads", "use history"),
    ast.Nonlocal: ("a law keeps nothing outside of a point: points are computed in any order, by several threads", "use history"),
    ast.Import: ("a law cannot import while it runs", "import at the head of the file"),
    ast.ImportFrom: ("a law cannot import while it runs", "import at the head of the file"),
    ast.JoinedStr: ("a law makes no texts", f"use {WHAT_A_LAW_MAY}"),
    ast.List: ("a law makes no lists: nothing is allocated for a point", "use a tuple, or history"),
    ast.ListComp: ("a law makes no lists: nothing is allocated for a point", "use a tuple, or a loop"),
    ast.Dict: ("a law makes no mappings: nothing is allocated for a point", "use a tuple, or names"),
    ast.Set: ("a law makes no sets: nothing is allocated for a point", "use a tuple, or names"),
}
# What of numpy makes an array, by its last name.
_ARRAYS = frozenset(
    "zeros ones empty full array asarray zeros_like ones_like empty_like linspace arange eye identity dot matmul stack append".split()
)
_CALLED = {
    "print": ("a law cannot print: it runs millions of times, in many threads", "call the law in plain Python to look at its numbers"),
    "open": ("a law reads no files", "read them at the head of the file, or make parameters of what they say"),
}


def taken(function: Any) -> list[str]:
    """The names of what a function takes, in its order."""
    return list(inspect.signature(function).parameters)


def finding(function: Any, line: int, message: str, expected: str | None = None, hint: str | None = None, column: int = 1) -> Finding:
    return Finding(function.__code__.co_filename, line, column, "error", message, None, expected, hint)


def check(law: Law, source: str) -> None:
    """Refuses what cannot be compiled, or must not be, where the text of the law says so.

    Raises:
        InvalidInput: with all that was found.
    """
    found: list[Finding] = []
    seen: set[FunctionType] = set()
    sizes = {"membrane": law.membrane_history, "stiffness": law.membrane_history, "bending": law.bending_history, "tangent": law.bending_history}
    for kind, function in law.functions.items():
        for one in _with_helpers(function, source, seen):
            found += _in_text(one, sizes[kind] if one is function else None)
    if found:
        raise InvalidInput(sorted(found, key=lambda f: f.line))


def _with_helpers(function: Any, source: str, seen: set[FunctionType]) -> Iterator[FunctionType]:
    """A function, and those of its file that it calls."""
    if function in seen:
        return
    seen.add(function)
    yield function
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType) and value.__code__.co_filename == source:
            yield from _with_helpers(value, source, seen)


def _tree(function: Any) -> tuple[ast.AST, int]:
    """The text of a function as a tree, and what to add to its line numbers."""
    lines, first = inspect.getsourcelines(function)
    return ast.parse(textwrap.dedent("".join(lines))), first - 1


def _in_text(function: Any, history: int | None) -> list[Finding]:
    try:
        tree, above = _tree(function)
    except (OSError, SyntaxError):
        # No text to look at: numba says what it thinks of the code.
        return []
    body = getattr(tree, "body", [tree])[0]
    found = []
    nodes = [node for part in getattr(body, "body", [body]) for node in ast.walk(part)]
    # Texts that stand alone are documentation.
    spoken = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        told = _REFUSED.get(type(node))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            told = _CALLED.get(node.func.id)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _ARRAYS:
            told = (f"'{node.func.attr}' makes an array, and nothing is allocated for a point", _NO_ARRAY)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in spoken:
            told = ("a law has no texts", "a parameter that is a choice is the index of its word: if p.kind == 0")
        if told:
            line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0)
            found.append(finding(function, above + line, f"{function.__name__}: {told[0]}", hint=told[1], column=column + 1))
        if history is not None and isinstance(node, ast.Subscript):
            found += _beyond(function, node, above, history)
    return found


def _beyond(function: Any, node: ast.Subscript, above: int, history: int) -> list[Finding]:
    """A place in the history that is not there: compiled code would read and write the next point's, or another's memory."""
    # Before Python 3.9 the index stood in a node of its own.
    index = node.slice
    sign = 1
    if isinstance(index, ast.UnaryOp) and isinstance(index.op, ast.USub):
        index, sign = index.operand, -1
    if not (isinstance(node.value, ast.Name) and node.value.id == "history" and isinstance(index, ast.Constant) and isinstance(index.value, int)):
        return []
    place = sign * index.value
    if -history <= place < history:
        return []
    last = "" if history == 1 else f" to history[{history - 1}]"
    there = "it remembers nothing" if history == 0 else f"it remembers history[0]{last}"
    hint = f"declare them: history={place + 1}" if place >= 0 else None
    return [finding(function, above + node.lineno, f"{function.__name__}: history[{place}], but {there}", hint=hint, column=node.col_offset + 1)]


def line_of_return(function: Any) -> int:
    """The line of the first return of a function."""
    return _line(function, lambda node: isinstance(node, ast.Return))


def line_of_name(function: Any, name: str) -> int:
    """The line where a function first says a name."""
    return _line(function, lambda node: name in (getattr(node, "id", None), getattr(node, "attr", None)))


def _line(function: Any, wanted: Callable[[ast.AST], bool]) -> int:
    first = int(function.__code__.co_firstlineno)
    try:
        tree, above = _tree(function)
    except (OSError, SyntaxError):
        return first
    return min((above + int(getattr(node, "lineno", 1)) for node in ast.walk(tree) if wanted(node)), default=first)


def hint_for(text: str) -> str:
    """What to do, by what numba says."""
    if "is not defined" in text:
        return "define it in the file, or declare it as a parameter and write p. before it"
    if "Untyped global name" in text or "Cannot determine Numba type" in text:
        return "a global name must be a number, a tuple of numbers or a function; take functions out of a module by name (from module import name)"
    if "of type Module" in text:
        return "numba does not know this function of the module: write it with others"
    if "Unknown attribute" in text:
        return "p has the declared parameters, thickness and areal_mass"
    if "unify" in text:
        return "a name must hold the same kind of number on every way: write 0.0 where the other is no integer"
    return "write it with these; the law in plain Python stays the same"


def refuse_outside(names: Sequence[str], function: Any, source: str) -> None:
    """Refuses code that calls what is not there where a law runs: Python, or memory that is allocated.

    Raises:
        InvalidInput: with the reason.
    """

    def refuse(message: str, hint: str) -> NoReturn:
        raise InvalidInput([finding(function, function.__code__.co_firstlineno, f"{function.__name__}: {message}", hint=hint)])

    for name in names:
        # Lists of parameters are arrays, whose references numba counts where they are its own. These are not, so that it is never called.
        if name == "NRT_MemInfo_call_dtor":
            continue
        if name.startswith("NRT_"):
            refuse(
                "it makes an array or another object, and nothing may be allocated for a point",
                _NO_ARRAY,
            )
        # Whatever else is no function of mathematics the carrier refuses by name.
        if name.startswith(("Py", "_Py", "numba_gil", "numba_unpickle")):
            refuse(f"its code would call Python ({name})", f"use {WHAT_A_LAW_MAY}; it must raise nothing and print nothing")
