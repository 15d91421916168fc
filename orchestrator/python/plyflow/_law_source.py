"""The loop over a batch, as text: what numba compiles around the functions of a law."""

from __future__ import annotations

from collections import namedtuple
from typing import Any, Sequence

from ._law_rules import taken
from .laws import Law, Value, tuple_names

ENTRY = "batch"

# numba's calling convention makes of these what `Batch` in solver-plugins/door/python-law/src/law.rs says.
_ARGUMENTS = "values, count, lanes, dt, metric, curvature, history, stress, energy, tangent, wanted, scratch"

# The strain is moved by this, in the tensor's own norm (shear with a factor of root 2).
_STEP = 1e-6
# What is added to a measured bound: the state moves on before the next is asked for, and differences have errors of their own.
_MARGIN = 1.01


def source_of(law: Law, kind: str, around: dict[str, Any], history: int) -> str:
    """The text of the function :data:`ENTRY` for one function of a law.
    `around` has the compiled functions of the law, as ``law_membrane`` and so on, and gets the other names that the text uses.
    """
    import math

    import numba

    around["math"] = math
    around["carray"] = numba.carray
    second = {"membrane": "stiffness", "bending": "tangent"}[kind]
    rows = {"membrane": 2, "bending": 3}[kind]
    given = "law_" + second in around
    if not given:
        exec(_measured(law, kind, history), around)
        around["measured"] = numba.njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(around["measured"])
        for name in ("at", "steeper"):
            if name in around:
                around[name] = numba.njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(around[name])
    point = {"p": "p", "dt": "dt", "history": "h[:, l]"}
    point.update({f"c{name}": f"c[{row}, l]" for row, name in enumerate(("11", "22", "12"))})
    point.update({f"k{name}": f"k[{row}, l]" for row, name in enumerate(("11", "22", "12"))})

    def call(name: str) -> str:
        return ", ".join(point[a] for a in taken(law.functions[name]))

    everything = ", ".join(point[a] for a in _all(kind))
    answers = ", ".join(f"t[{row}, l]" for row in range(rows))
    lines = [
        f"def {ENTRY}({_ARGUMENTS}):",
        "    v = carray(values, (count,))",
        f"    p = {_parameters(law.values, (), around)}",
        "    c = carray(metric, (3, lanes))",
        *(["    k = carray(curvature, (3, lanes))"] if kind == "bending" else []),
        f"    h = carray(history, ({history}, lanes))",
        "    s = carray(stress, (3, lanes))",
        "    w = carray(energy, (lanes,))",
        "    for l in range(lanes):",
        f"        s[0, l], s[1, l], s[2, l], w[l] = law_{kind}({call(kind)})",
        "    if wanted != 0:",
        f"        t = carray(tangent, ({rows}, lanes))",
        *([] if given else [f"        copy = carray(scratch, ({history},))"]),
        "        for l in range(lanes):",
        f"            {answers} = " + (f"law_{second}({call(second)})" if given else f"measured({everything}, copy)"),
        "    return 0",
    ]
    return "\n".join(lines) + "\n"


def _all(kind: str) -> Sequence[str]:
    bent = ["k11", "k22", "k12"] if kind == "bending" else []
    return ["p", "dt", "c11", "c22", "c12", *bent, "history"]


def _parameters(values: Sequence[Value], at: tuple[str, ...], around: dict[str, Any]) -> str:
    """The named tuple of the parameters out of the row `v`, as the carrier fills it: a list has two places, which say where its values are."""
    places: dict[tuple[str, ...], int] = {}
    place = 0
    for value in values:
        places[value.path] = place
        place += 2 if value.form == "list" else 1
    return _tuple(values, places, at, around)


def _tuple(values: Sequence[Value], places: dict[tuple[str, ...], int], at: tuple[str, ...], around: dict[str, Any]) -> str:
    names = tuple_names(values, at)
    title = "_".join(("Parameters", *at))
    # Of the same type as that of Law.sheet, for which the functions were compiled alone.
    around[title] = namedtuple("Parameters", names)
    forms = {value.path: value.form for value in values}
    parts = []
    for name in names:
        path = (*at, name)
        if path not in forms:
            parts.append(_tuple(values, places, path, around))
            continue
        one = places[path]
        text = {
            "integer": f"int(v[{one}])",
            "choice": f"int(v[{one}])",
            "boolean": f"v[{one}] != 0.0",
            "list": f"v[int(v[{one}]):int(v[{one + 1}])]",
        }
        parts.append(text.get(forms[path], f"v[{one}]"))
    return f"{title}({', '.join(parts)})"


def _at(law: Law, kind: str, history: int) -> list[str]:
    """`at(state, copy)`: the law's answer without a trace in the history."""
    arguments = ", ".join("copy" if a == "history" else a for a in taken(law.functions[kind]))
    return [
        f"def at({', '.join(_all(kind))}, copy):",
        f"    for i in range({history}):",
        "        copy[i] = history[i]",
        f"    return law_{kind}({arguments})",
    ]


def _measured(law: Law, kind: str, history: int) -> str:
    body = _bounds() if kind == "membrane" else _tangents(history)
    return "\n".join([*_at(law, kind, history), *body]) + "\n"


def _bounds() -> list[str]:
    """Bounds of the tangents of the membrane law.

    To either side on its own, as a state may lie where something slips or fails. Of both slopes the matrix takes the larger magnitude, entry by
    entry: its norm is no smaller than that of any combination of sides. Two bounds of that norm are cheap; the smaller one counts. The first is
    exact for families that do not know of each other, the second is near where they do.
    """
    root = 2**0.5
    lines = [
        "def steeper(f, s, b):",
        f"    return max(abs(f - s), abs(s - b)) / {_STEP!r}",
        "def measured(p, dt, c11, c22, c12, history, copy):",
        "    s1, s2, s3, _ = at(p, dt, c11, c22, c12, history, copy)",
    ]
    for axis, moved in enumerate(((2 * _STEP, 0.0, 0.0), (0.0, 2 * _STEP, 0.0), (0.0, 0.0, root * _STEP)), 1):
        for side, sign in (("f", "+"), ("b", "-")):
            there = ", ".join(f"{name} {sign} {by!r}" if by else name for name, by in zip(("c11", "c22", "c12"), moved))
            lines.append(f"    {side}1, {side}2, {side}3, _ = at(p, dt, {there}, history, copy)")
        lines += [f"    a{row}{axis} = {'' if row < 3 else f'{root!r} * '}steeper(f{row}, s{row}, b{row})" for row in (1, 2, 3)]
    # After the third axis f3 and b3 are those of shear: dS12 / dC12, with its sign.
    lines.append(f"    shear = max(f3 - s3, s3 - b3) / {root * _STEP!r}")
    three = (1, 2, 3)
    rows = ", ".join("+".join(f"a{i}{j}" for j in three) for i in three)
    columns = ", ".join("+".join(f"a{i}{j}" for i in three) for j in three)
    lines.append(f"    bound = math.sqrt(max({rows}) * max({columns}))")
    for i in three:
        lines += [f"    m{i}{j} = " + " + ".join(f"a{k}{i} * a{k}{j}" for k in three) for j in three if j >= i]
    product = {(i, j): " + ".join(f"m{min(i, k)}{max(i, k)} * m{min(k, j)}{max(k, j)}" for k in three) for i in three for j in three if j >= i}
    lines += [f"    n{i}{j} = {text}" for (i, j), text in product.items()]
    squares = " + ".join(f"{'' if i == j else '2.0 * '}n{i}{j} * n{i}{j}" for i, j in product)
    return lines + [
        f"    near = math.sqrt(math.sqrt(math.sqrt({squares})))",
        "    if near < bound:",
        "        bound = near",
        # A bound is above 0, and noise of differences must not make a tangent of shear out of none.
        f"    bound = max({_MARGIN!r} * bound, 1e-6)",
        f"    return bound, max({_MARGIN!r} * shear, 1e-6 * bound)",
    ]


def _tangents(history: int) -> list[str]:
    """Diagonal tangents of the bending law, by central differences; where it remembers, those of the stiffer side."""
    names = ("k11", "k22", "k12")
    lines = ["def measured(p, dt, c11, c22, c12, k11, k22, k12, history, copy):"]
    if history:
        lines.append("    m1, m2, m3, _ = at(p, dt, c11, c22, c12, k11, k22, k12, history, copy)")
    for row, name in enumerate(names, 1):
        lines.append(f"    step = 1e-6 * (50.0 + abs({name}))")
        for side, sign in (("f", "+"), ("b", "-")):
            there = ", ".join(f"{n} {sign} step" if n == name else n for n in names)
            lines.append(f"    {side}1, {side}2, {side}3, _ = at(p, dt, c11, c22, c12, {there}, history, copy)")
        if history:
            lines.append(f"    t{row} = max(f{row} - m{row}, m{row} - b{row}) / step")
        else:
            lines.append(f"    t{row} = (f{row} - b{row}) / (2.0 * step)")
    return [*lines, "    return t1, t2, t3"]
