"""Calls the library of a fabric law as a host does (`schemas/abi/plyflow.h`), for tests."""

from __future__ import annotations

import ctypes
import json
from pathlib import Path
from typing import Any, Mapping

import numpy as np

Array = Any
_INT, _WIDE, _POINTER, _DOUBLE = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_void_p, ctypes.c_double


class _Text(ctypes.Structure):
    _fields_ = [("data", _POINTER), ("length", _WIDE)]


class _Plugin(ctypes.Structure):
    _fields_ = [("magic", _WIDE), ("major", _INT), ("minor", _INT), ("size", _WIDE), ("kind", _INT), ("reserved", _INT)]
    _fields_ += [("manifest", _Text), ("functions", _POINTER)]


class _Functions(ctypes.Structure):
    _fields_ = [("size", _WIDE), *((name, _POINTER) for name in ("create", "destroy", "sizes", "membrane", "bending"))]


class _Sizes(ctypes.Structure):
    _fields_ = [
        ("size", _WIDE),
        ("membrane", _INT),
        ("bending", _INT),
        ("bends", _INT),
        ("reserved", _INT),
        ("thickness", _DOUBLE),
        ("areal_mass", _DOUBLE),
    ]


class _Membrane(ctypes.Structure):
    _fields_ = [("size", _WIDE), ("lanes", _INT), ("reserved", _INT), ("dt", _DOUBLE)]
    _fields_ += [(name, _POINTER) for name in ("metric", "history", "stress", "energy", "tangent")]


class _Bending(ctypes.Structure):
    _fields_ = [("size", _WIDE), ("lanes", _INT), ("reserved", _INT), ("dt", _DOUBLE)]
    _fields_ += [(name, _POINTER) for name in ("metric", "curvature", "history", "stress", "energy", "tangent")]


_call = ctypes.CFUNCTYPE(ctypes.c_int32, _POINTER, _POINTER)


def _rows(values: Array) -> Array:
    """A copy that begins at a multiple of 64 bytes."""
    room = np.zeros(values.size + 8)
    first = (-room.ctypes.data % 64) // 8
    made = room[first : first + values.size].reshape(values.shape)
    made[...] = values
    return made


class Sheet:
    """A sheet of the law in a library. Arrays are [rows][lanes], as in the header."""

    def __init__(self, library: Path, parameters: Mapping[str, Any]) -> None:
        loaded = ctypes.CDLL(str(library))
        loaded.plyflow_plugin.restype = ctypes.POINTER(_Plugin)
        plugin = loaded.plyflow_plugin().contents
        self.manifest = json.loads(ctypes.string_at(plugin.manifest.data, plugin.manifest.length))
        self._functions = ctypes.cast(plugin.functions, ctypes.POINTER(_Functions)).contents
        text = json.dumps(dict(parameters)).encode()
        said = ctypes.create_string_buffer(512)
        self._instance = _POINTER()
        create = ctypes.CFUNCTYPE(ctypes.c_int32, _Text, _POINTER, _POINTER)(self._functions.create)
        given = _Text(ctypes.cast(ctypes.c_char_p(text), _POINTER), len(text))
        if create(given, ctypes.addressof(self._instance), ctypes.addressof(said)) != 0:
            raise ValueError(said.value.decode())
        self.sizes = _Sizes(ctypes.sizeof(_Sizes))
        assert _call(self._functions.sizes)(self._instance, ctypes.addressof(self.sizes)) == 0

    def membrane(self, metric: Array, history: Array | None = None, dt: float = 1e-6) -> tuple[Array, Array, Array, Array]:
        """Stress, energy, stiffness, and the history afterwards."""
        lanes = metric.shape[1]
        c, s, w, t = _rows(metric), _rows(np.zeros((3, lanes))), _rows(np.zeros(lanes)), _rows(np.zeros((2, lanes)))
        h = _rows(np.zeros((self.sizes.membrane, lanes)) if history is None else history)
        batch = _Membrane(ctypes.sizeof(_Membrane), lanes, 0, dt, *(a.ctypes.data for a in (c, h, s, w, t)))
        assert _call(self._functions.membrane)(self._instance, ctypes.addressof(batch)) == 0
        return s, w, t, h

    def bending(self, metric: Array, curvature: Array) -> tuple[Array, Array, Array]:
        """Moment, energy and tangent from flat."""
        lanes = metric.shape[1]
        c, k, s, w, t = _rows(metric), _rows(curvature), _rows(np.zeros((3, lanes))), _rows(np.zeros(lanes)), _rows(np.zeros((3, lanes)))
        h = _rows(np.zeros((self.sizes.bending, lanes)))
        batch = _Bending(ctypes.sizeof(_Bending), lanes, 0, 1e-6, *(a.ctypes.data for a in (c, k, h, s, w, t)))
        assert _call(self._functions.bending)(self._instance, ctypes.addressof(batch)) == 0
        return s, w, t
