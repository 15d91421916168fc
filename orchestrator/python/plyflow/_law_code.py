"""Compiles the functions of a law, in a process of its own, with the words SOURCE LAW LEVEL FOLDER.

The process is new for each level of processor, as numba takes its settings from the environment when it is imported, and counts what it compiles:
so the same source gives the same bytes. Object code and ``answer.json`` go to FOLDER.
"""

from __future__ import annotations

import dataclasses
import json
import platform
import re
import sys
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy

from . import _law_rules as rules
from ._law_source import ENTRY, source_of
from .errors import Finding, InvalidInput
from .laws import RETURNS, Law, Value, _tuple, load


def main() -> None:
    """What the process does."""
    source, name, level, folder = sys.argv[1:5]
    place = Path(folder)
    answer: dict[str, Any] = {"findings": []}
    import numba  # noqa: F401

    before = list(sys.path)
    try:
        law = load(source, name)
        # A file beside the law may have the name of a module that numba imports later.
        sys.path[:] = before
        rules.check(law, source)
        answer["code"] = {kind: str(_piece(law, kind, level, place, source)) for kind in ("membrane", "bending") if kind in law.functions}
        answer["watch"] = _watch(source)
        answer["made"] = _made()
    except InvalidInput as error:
        answer["findings"] = [dataclasses.asdict(finding) for finding in error.findings]
    (place / "answer.json").write_text(json.dumps(answer))


def _made() -> dict[str, str]:
    """The versions that have a part in the code."""
    import llvmlite
    import numba

    return {"python": ".".join(platform.python_version_tuple()[:2]), "numba": numba.__version__, "llvmlite": llvmlite.__version__}


def _watch(source: str) -> list[str]:
    """The file, the modules beside and below it that it has imported, and what tells the version of numba and of LLVM."""
    from importlib import metadata

    folder = Path(source).parent
    places = [getattr(metadata.distribution(name), "_path", None) for name in ("numba", "llvmlite")]
    found = {source, *(str(place) for place in places if place)}
    for module in list(sys.modules.values()):
        file = getattr(module, "__file__", None)
        if not file:
            continue
        place = Path(file).resolve()
        if folder in place.parents and "site-packages" not in place.parts:
            found.add(str(place))
    return sorted(found)


class _Compiler:
    """Compiles functions of the law's file, and what they call of their own."""

    def __init__(self) -> None:
        self.made: dict[FunctionType, Any] = {}

    def dispatcher(self, function: Any) -> Any:
        """numba's form of a function. Plain functions that it names are compiled too, so that a law's file need not import numba."""
        import numba

        if function in self.made:
            return self.made[function]
        names = _names(function.__code__)
        around = dict(function.__globals__)
        copy = FunctionType(function.__code__, around, function.__name__, function.__defaults__, function.__closure__)
        copy.__kwdefaults__ = function.__kwdefaults__
        # Division by zero gives an infinity, as in C, and no exception. Nothing is fused, and no sum is done in another order.
        made = numba.njit(error_model="numpy", fastmath=False, boundscheck=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)(copy)
        self.made[function] = made
        for name in names & set(around):
            value = around[name]
            if isinstance(value, Law):
                value = value.functions["membrane"]
            if isinstance(value, FunctionType):
                around[name] = self.dispatcher(value)
        return made


def _names(code: CodeType) -> set[str]:
    """The global names in a piece of code and in those within it."""
    inner = [_names(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_names).union(*inner)


def _piece(law: Law, kind: str, level: str, folder: Path, source: str) -> Path:
    """The object code of the membrane or the bending law, with its stiffness or tangent."""
    compiler = _Compiler()
    kinds = [k for k in (kind, {"membrane": "stiffness", "bending": "tangent"}[kind]) if k in law.functions]
    history = {"membrane": law.membrane_history, "bending": law.bending_history}[kind]
    examples = {"p": _example(law.values), "history": numpy.zeros((max(history, 1), 2))[:, 0]}
    around: dict[str, Any] = {}
    for one in kinds:
        function = law.functions[one]
        around[f"law_{one}"] = compiler.dispatcher(function)
        _alone(around[f"law_{one}"], function, one, examples, source)
    text = source_of(law, kind, around, history)
    exec(compile(text, f"<{kind} of {law.name}>", "exec"), around)
    module = _module(around, law.functions[kind], source)
    path = folder / f"{kind}.o"
    path.write_bytes(_object(module, f"plyflow_{kind}", level, law.functions[kind], source))
    return path


def _example(values: list[Value]) -> Any:
    """Parameters of the types that the law's have."""
    given: dict[str, Any] = {}
    for value in values:
        at = given
        for name in value.path[:-1]:
            at = at.setdefault(name, {})
        at[value.path[-1]] = {"list": [0.0], "boolean": True, "choice": (value.words or [""])[0]}.get(value.form, 1)
    return _tuple(values, (), given, "")


def _alone(dispatcher: Any, function: Any, kind: str, examples: dict[str, Any], source: str) -> None:
    """Compiles a function of the user by itself, so that what is wrong is told with its own lines; and looks at what it returns."""
    import numba

    types = tuple(numba.typeof(examples[name]) if name in examples else numba.float64 for name in rules.taken(function))
    try:
        dispatcher.compile(types)
    except Exception as error:
        raise InvalidInput([_finding(error, function, source)]) from error
    returned = dispatcher.overloads[types].signature.return_type
    parts = list(getattr(returned, "types", [returned]))
    wanted = RETURNS[kind]
    numbers = all(isinstance(part, (numba.types.Float, numba.types.Integer, numba.types.Boolean)) for part in parts)
    if not isinstance(returned, numba.types.BaseTuple) or len(parts) != len(wanted) or not numbers:
        several = isinstance(returned, numba.types.BaseTuple) and len(parts) != len(wanted)
        message = f"{function.__name__} returns {f'{len(parts)} values' if several else returned}"
        expected = f"{len(wanted)} numbers: {', '.join(wanted)}"
        raise InvalidInput([rules.finding(function, rules.line_of_return(function), message, expected=expected)])


def _finding(error: Exception, function: Any, source: str) -> Finding:
    """What numba says, with the first line of the user's own files that it names."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    line, file = function.__code__.co_firstlineno, function.__code__.co_filename
    name = Path(source).name
    for pattern in (rf'File "(?:[^"]*/)?{re.escape(name)}", line (\d+)', rf"at (?:\S*/)?{re.escape(name)} \((\d+)\)"):
        found = re.search(pattern, text)
        if found:
            line, file = int(found[1]), source
            break
    else:
        missing = re.search(r"name '(\w+)' is not defined|has no attribute '(\w+)'", text)
        if missing:
            line = rules.line_of_name(function, missing[1] or missing[2])
    said = [part.strip() for part in text.splitlines()]
    boring = (
        "",
        "Failed in nopython mode pipeline",
        "During:",
        "- During",
        "There are",
        "- Of which",
        "Overload",
        "With argument",
        "Rejected",
        "File ",
    )
    useful = [part for part in said if not any(part == b or (b and part.startswith(b)) for b in boring)]
    reason = re.sub(r"type Module\(<module '([^']+)'.*?>\)", r"module \1", useful[0]) if useful else type(error).__name__
    message = f"numba cannot compile {function.__name__}: {reason}"
    return Finding(file, line, 1, "error", message, None, rules.WHAT_A_LAW_MAY, rules.hint_for(text))


def _module(around: dict[str, Any], function: Any, source: str) -> tuple[str, str]:
    """LLVM's text of the batch function, and its name in there."""
    import numba
    from numba import types

    double = types.CPointer(types.float64)
    signature = types.int64(double, types.int64, types.int64, types.float64, *[double] * 6, types.int64, double)
    batch = numba.njit(error_model="numpy", fastmath=False, boundscheck=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)(around[ENTRY])
    try:
        batch.compile(signature)
    except Exception as error:
        raise InvalidInput([_finding(error, function, source)]) from error
    compiled = batch.overloads[signature.args]
    return compiled.library.get_llvm_str(), compiled.fndesc.llvm_func_name


def _object(module: tuple[str, str], entry: str, level: str, function: Any, source: str) -> bytes:
    """Object code of one function alone, under the name `entry`."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    text, name = module
    parsed = llvm.parse_assembly(text)
    # Everything else may go, where it is not called: numba's means to raise and to count references.
    for one in parsed.functions:
        if one.name == name:
            one.name = entry
        elif not one.is_declaration:
            one.linkage = "internal"
    for variable in parsed.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    target = llvm.Target.from_triple("x86_64-unknown-linux-gnu")
    machine = target.create_target_machine(cpu=level, features="", opt=3, reloc="pic", codemodel="default")
    _drop_unused(llvm, parsed, machine)
    outside = [one.name for one in parsed.functions if one.is_declaration and not one.name.startswith("llvm.")]
    outside += [variable.name for variable in parsed.global_variables if variable.is_declaration]
    rules.refuse_outside(outside, function, source)
    return bytes(machine.emit_object(parsed))


def _drop_unused(llvm: Any, parsed: Any, machine: Any) -> None:
    if hasattr(llvm, "create_new_module_pass_manager"):
        passes = llvm.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.add_strip_dead_prototype_pass()
        passes.run(parsed, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
        return
    # llvmlite before 0.44, which is what Python 3.9 has.
    passes = llvm.create_module_pass_manager()
    passes.add_global_dce_pass()
    passes.add_strip_dead_prototypes_pass()
    passes.run(parsed)
