"""How compiled code is called by XLA and by the host through one entrance.

XLA calls a function by a pointer to a frame that names the buffers (its foreign function interface, FFI). The
host calls the same function with a frame of its own, whose first number is 0, so that the code is compiled
once. Both release Python's lock. A row of each buffer belongs to one motion.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jaxlib
import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.numpy_support import carray as _carray

from tpd.exact.arcs import Forcing
from tpd.exact.motion import NO
from tpd.exact.plant import compiled, part

carray: Any = _carray
FRAME = 16
"""Numbers of 8 bytes in a frame of XLA's."""
FIELDS = (
    *("task", "periods", "events", "rest_rate", "tolerance", "rtol", "lyapunov", "impacts", "slopes"),
    *("pieces", "record", "free", "brief", "angles"),
)
SETTINGS = np.dtype([(name, np.float64) for name in FIELDS])
"""A row of settings of the linear and of the nonlinear equations: the task; periods to follow, or times;
events allowed; largest speed, over nu, of an impact that may end in rest; repetition error that counts as
settled; relative tolerance of a step; periods over which the separation of neighbours is measured; impacts
for which there is room; how many directions have derivatives; pieces of the forcing, and the row of the
first, or -1 if every motion has its own; time of free motion; whether it may end early and the bob does not
count; and whether the derivatives of the largest angles are enough. The others do not count for a task."""


BEGIN, RAMP = 0, 1
"""Columns of the times of a motion that settles: when it begins, and how long the shaking grows."""


def settings(**values: Any) -> list[Any]:
    """A row of settings in the order of `FIELDS`; those that are not named are zero."""
    row = [values.pop(name, 0.0) for name in FIELDS]
    if values:
        raise TypeError(f"there are no settings {', '.join(values)}")
    return row


def _declared_version() -> tuple[int, int]:
    """Version of the interface that the installed XLA declares."""
    header = Path(str(jaxlib.__file__)).parent / "include" / "xla" / "ffi" / "api" / "c_api.h"
    text = header.read_text()
    major, minor = (re.search(rf"#define XLA_FFI_API_{name} (\d+)", text) for name in ("MAJOR", "MINOR"))
    if major is None or minor is None:
        raise ValueError(f"{header} does not declare the version of the interface")
    return int(major[1]), int(minor[1])


def _cast(context: Any, address: Any) -> Any:
    """A number as a pointer to floats."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), generate


pointer: Any = intrinsic(_cast)


@compiled
def wholes(address):
    """Whole numbers at an address, at most 16; only those that are there may be read."""
    return carray(pointer(address), (FRAME,), np.int64)


@compiled
def table(address, rows, columns):
    """A table of floats at an address."""
    return carray(pointer(address), (rows, columns), np.float64)


@compiled
def cube(address, rows, columns, depth):
    """Tables of floats at an address."""
    return carray(pointer(address), (rows, columns, depth), np.float64)


@compiled
def settings_at(address, rows):
    """Rows of settings at an address."""
    return carray(pointer(address), (rows,), SETTINGS)


@part
def usual(a, rows):
    """The first three operands of motions: settings, parameters and starts."""
    return settings_at(a[0], rows), table(a[1], rows, 9), table(a[2], rows, 4)


@compiled
def pieces(address, s, n):
    """Forcing of row n with the settings `s`, from the table of all pieces at an address."""
    count, begin = int(s.pieces), int(s.record)
    # XLA gives every motion a copy of its record, the host one place for all.
    begin = n * count if begin < 0 else begin
    return Forcing(NO, 0.0, 0.0, count, table(address, begin + count, 4)[begin:])


@compiled
def _buffers(frame, a):
    """Put the addresses of a frame's buffers into `a`, and return how many rows they have."""
    operands, results, rows = frame[7], frame[12], 1
    for i in range(operands):
        a[i] = wholes(wholes(frame[9])[i])[3]
    for i in range(results):
        a[operands + i] = wholes(wholes(frame[14])[i])[3]
    settings = wholes(wholes(frame[9])[0])
    shape = wholes(settings[5])
    for i in range(settings[4] - 1):
        rows *= shape[i]
    return rows


@compiled
def rows_of(address, a, api):
    """Put the addresses of a frame's buffers into `a`; return the first and last of the rows to compute, and
    whether the host asks. XLA's frames have 16 numbers of 8 bytes: the second is an extension, the fifth a
    stage, the tenth and the last but one the lists of buffers."""
    frame = wholes(address)
    if frame[0] == 0:
        for i in range(8):
            a[i] = frame[3 + i]
        return frame[1], frame[2], True
    if frame[1] != 0:
        # XLA asks for the version.
        wholes(wholes(frame[1])[3])[3] = api
        return 0, 0, False
    if (frame[4] & 0xFFFFFFFF) != 3:
        return 0, 0, False
    return 0, _buffers(frame, a), False


def api_version() -> int:
    """The version of the interface that the installed XLA declares, as one number."""
    major, minor = _declared_version()
    return major | (minor << 32)


def on_host(entrance: Any) -> Callable[..., None]:
    """Function that computes rows `first` to before `last` of contiguous buffers: operands, then results."""
    call: Callable[[int], int] = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(entrance.address)
    numbers: Any = ctypes.c_int64 * FRAME

    def run(first: int, last: int, *buffers: np.ndarray) -> None:
        frame = numbers(0, first, last, *map(_address, buffers))
        call(ctypes.addressof(frame))

    return run


def _address(buffer: Any) -> int:
    """Where the numbers of a contiguous array begin."""
    # NumPy's own attribute takes five times as long, but knows all arrays.
    if buffer.size and buffer.flags.writeable:
        return ctypes.addressof(ctypes.c_char.from_buffer(buffer))
    return buffer.ctypes.data
