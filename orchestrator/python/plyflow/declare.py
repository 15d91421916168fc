"""Declarations of parameters, as `schemas/manifest.md` has them."""

from __future__ import annotations

from typing import Any, Mapping


def _of(kind: str, **keys: Any) -> dict[str, Any]:
    return {"type": kind, **{key: value for key, value in keys.items() if value is not None}}


def number(**keys: Any) -> dict[str, Any]:
    """A number without a unit."""
    return _of("number", **keys)


def integer(**keys: Any) -> dict[str, Any]:
    """A whole number."""
    return _of("integer", **keys)


def boolean(**keys: Any) -> dict[str, Any]:
    """True or false."""
    return _of("boolean", **keys)


def choice(values: Any, **keys: Any) -> dict[str, Any]:
    """One of some words."""
    return _of("choice", values=list(values), **keys)


def quantity(dimension: str, **keys: Any) -> dict[str, Any]:
    """A number with a unit."""
    return _of("quantity", dimension=dimension, **keys)


def list_of(of: Mapping[str, Any], **keys: Any) -> dict[str, Any]:
    """Several of a kind."""
    return _of("list", of=dict(of), **keys)


def object_of(fields: Mapping[str, Any], **keys: Any) -> dict[str, Any]:
    """Named parts."""
    return _of("object", fields=dict(fields), **keys)
