"""What a plugin declares of itself: parameters, inputs, results. Each call makes an entry of the manifest.

>>> from plyflow import declare
>>> declare.quantity("length", default="5 mm", exclusive_minimum="0 mm", doc="Edge of an element.")["type"]
'quantity'

The keys and their meaning are those of ``schemas/manifest.md``; the program checks them when it looks at the plugin. In ``parameters`` of a
running step numbers are in SI units.
"""

from __future__ import annotations

from typing import Any, Mapping, Optional, Sequence, Union

__all__ = [
    "Declaration", "boolean", "choice", "collection", "element", "file", "integer", "list_of", "map_of", "material", "number", "object_of",
    "port", "quantity", "result", "scene", "sheet_material", "string",
]  # fmt: skip

Declaration = Mapping[str, Any]


def _declared(kind: str, doc: str, required: bool, **more: Any) -> Declaration:
    made = {"type": kind, "doc": doc, **{key: value for key, value in more.items() if value is not None}}
    if required:
        made["required"] = True
    return made


def boolean(*, doc: str, default: Optional[bool] = None, required: bool = False) -> Declaration:
    """True or false. Without ``default`` and ``required`` the parameter may be absent; so it is with all of these."""
    return _declared("boolean", doc, required, default=default)


def integer(
    *, doc: str, default: Optional[int] = None, minimum: Optional[int] = None, maximum: Optional[int] = None, required: bool = False
) -> Declaration:
    """A whole number."""
    return _declared("integer", doc, required, default=default, minimum=minimum, maximum=maximum)


def number(
    *,
    doc: str,
    default: Optional[float] = None,
    minimum: Optional[float] = None,
    maximum: Optional[float] = None,
    exclusive_minimum: Optional[float] = None,
    required: bool = False,
) -> Declaration:
    """A number without dimension."""
    return _declared("number", doc, required, default=default, minimum=minimum, maximum=maximum, exclusive_minimum=exclusive_minimum)


def string(*, doc: str, default: Optional[str] = None, required: bool = False) -> Declaration:
    """A text."""
    return _declared("string", doc, required, default=default)


def choice(values: Sequence[str], *, doc: str, default: Optional[str] = None, required: bool = False) -> Declaration:
    """One of some words."""
    return _declared("choice", doc, required, values=list(values), default=default)


def quantity(
    dimension: str,
    *,
    doc: str,
    default: Optional[str] = None,
    minimum: Optional[str] = None,
    maximum: Optional[str] = None,
    exclusive_minimum: Optional[str] = None,
    required: bool = False,
) -> Declaration:
    """A number with a unit, such as ``"5 mm"``; the step gets it in SI units.

    Args:
        dimension: such as ``length``, ``angle``, ``pressure``; ``schemas/manifest.md`` lists all.
        doc: what it is for.
        default: as in YAML, with its unit; so are the bounds.
        minimum: least value.
        maximum: largest value.
        exclusive_minimum: what the value must be above.
        required: whether it must be given.
    """
    more = {"dimension": dimension, "default": default, "minimum": minimum, "maximum": maximum, "exclusive_minimum": exclusive_minimum}
    return _declared("quantity", doc, required, **more)


def list_of(
    of: Declaration,
    *,
    doc: str,
    default: Optional[Sequence[Any]] = None,
    minimum_items: Optional[int] = None,
    maximum_items: Optional[int] = None,
    order: Optional[str] = None,
    required: bool = False,
) -> Declaration:
    """A sequence of values of one declaration. ``order``: ``"increasing"`` or ``"not-falling"``, of numbers."""
    more = {"default": default, "minimum_items": minimum_items, "maximum_items": maximum_items, "order": order}
    return _declared("list", doc, required, of=dict(of), **more)


def map_of(of: Declaration, *, doc: str, required: bool = False) -> Declaration:
    """Values of one declaration under free names."""
    return _declared("map", doc, required, of=dict(of))


def object_of(fields: Mapping[str, Declaration], *, doc: str, required: bool = False) -> Declaration:
    """A mapping with these fields."""
    return _declared("object", doc, required, fields={name: dict(field) for name, field in fields.items()})


def file(*, doc: str, required: bool = False) -> Declaration:
    """A file: the step gets its absolute path, and its bytes are part of the step's key. So a step reads files in no other way."""
    return _declared("file", doc, required)


def scene(*, doc: str, required: bool = False) -> Declaration:
    """A scene, as a file or a mapping."""
    return _declared("scene", doc, required)


def sheet_material(*, doc: str, required: bool = False) -> Declaration:
    """A material, as a file or a mapping."""
    return _declared("sheet_material", doc, required)


def element(*, doc: str, default: Optional[str] = None, required: bool = False) -> Declaration:
    """An element by name or path. A step in Python gets what was written, and cannot call it."""
    return _declared("element", doc, required, default=default)


def material(*, doc: str, default: Optional[str] = None, required: bool = False) -> Declaration:
    """A material's plugin by name or path. A step in Python gets what was written, and cannot call it."""
    return _declared("material", doc, required, default=default)


def port(kind: str, *, doc: str, required: bool = True, many: bool = False) -> Declaration:
    """An input: what arrives from other steps.

    Args:
        kind: of the artifacts that it takes, such as ``forming``; ``any`` takes all.
        doc: what it is for.
        required: whether it must be wired.
        many: whether several artifacts may arrive.
    """
    return {"kind": kind, "required": required, "many": many, "doc": doc}


def result(unit: str, *, doc: str, measured: bool = False, by_step: bool = False) -> Declaration:
    """A named number that the step reports.

    Args:
        unit: a plain one of SI: ``m``, ``N/m``, ``1``.
        doc: what it means.
        measured: whether it depends on the machine, as seconds do.
        by_step: whether its name goes on with that of a step that is wired to this one.
    """
    made: dict[str, Any] = {"unit": unit, "doc": doc}
    made.update({key: True for key, given in (("measured", measured), ("by_step", by_step)) if given})
    return made


def collection(kind: str, *, doc: Optional[str] = None) -> Declaration:
    """An output over whose items later steps may fan out (``for_each``)."""
    return {"kind": kind, "collection": True, **({"doc": doc} if doc else {})}


def _output(given: Union[str, Declaration]) -> Declaration:
    return {"kind": given} if isinstance(given, str) else dict(given)
