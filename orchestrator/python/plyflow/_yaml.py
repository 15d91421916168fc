"""Writes plain values as YAML that people can read and edit."""

from __future__ import annotations

import json
import math
import re
from typing import Any, Mapping

__all__ = ["dump"]

# Texts that need no quotes: nothing that YAML could take for a number, a boolean, null, a date or a mark of its own.
_BARE = re.compile(r"(?:[A-Za-z_/]|\.{1,2}/)[A-Za-z0-9_./ %+*()-]*[A-Za-z0-9_./%)*]|[A-Za-z_]")
# With a unit, a number is a text: `5 mm`, `-45 deg`, `1e5 Pa`.
_QUANTITY = re.compile(r"[+-]?[0-9][0-9.]*(e[+-]?[0-9]+)? [A-Za-z%][A-Za-z0-9/*%^]*")
_TAKEN = re.compile(r"(?i:y|n|yes|no|on|off|true|false|null|~|nan|inf|\.nan|[+-]?\.inf)")
_WIDTH = 110


def dump(value: Any) -> str:
    """A plain value (mappings, lists, texts, numbers, booleans, ``None``) as YAML.

    Raises:
        ValueError: a number is not finite.

    >>> print(dump({"name": "a", "sheets": [{"length": "5 mm", "fibres": [-45, 45]}]}), end="")
    name: a
    sheets:
      - {length: 5 mm, fibres: [-45, 45]}
    """
    return "\n".join(_block(value, 0)) + "\n"


def scalar(value: Any) -> str:
    """A text, number, boolean or ``None`` as it stands in YAML.

    >>> scalar("no"), scalar("1 mm"), scalar("1.0"), scalar(1e-05), scalar("a: b")
    ('"no"', '1 mm', '"1.0"', '1.0e-05', '"a: b"')
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} cannot be written: numbers of a file are finite")
        text = repr(value)
        # In YAML a number with an exponent has a point.
        return text.replace("e", ".0e") if "e" in text and "." not in text else text
    plain = not _TAKEN.fullmatch(value) and (_BARE.fullmatch(value) or _QUANTITY.fullmatch(value))
    return value if plain else "".join(c if c.isprintable() else _escaped(c) for c in json.dumps(value, ensure_ascii=False))


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{scalar(str(k))}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    return scalar(value)


def _is_flat(value: Any) -> bool:
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return not any(isinstance(v, Mapping) or (isinstance(v, list) and any(isinstance(w, (Mapping, list)) for w in v)) for v in inner)


def _block(value: Any, depth: int) -> list[str]:
    """Lines of a value that begins on a line of its own."""
    pad = "  " * depth
    if isinstance(value, list) and value:
        out = []
        for entry in value:
            flow = _flow(entry)
            if not isinstance(entry, (Mapping, list)) or not entry or (_is_flat(entry) and len(flow) + len(pad) < _WIDTH):
                out.append(f"{pad}- {flow}")
                continue
            lines = _block(entry, depth + 1)
            out += [f"{pad}- {lines[0][len(pad) + 2 :]}", *lines[1:]]
        return out
    if isinstance(value, Mapping) and value:
        out = []
        for key, entry in value.items():
            name, flow = scalar(str(key)), _flow(entry)
            simple = not isinstance(entry, (Mapping, list)) or not entry
            numbers = isinstance(entry, list) and not any(isinstance(e, (Mapping, list)) for e in entry)
            if simple or (numbers and len(flow) + len(pad) < _WIDTH):
                out.append(f"{pad}{name}: {flow}")
            else:
                out += [f"{pad}{name}:", *_block(entry, depth + 1)]
        return out
    return [pad + _flow(value)]
