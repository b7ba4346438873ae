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
from tpd.exact.terms import MANY

carray: Any = _carray
FRAME = 16
"""Numbers of 8 bytes in a frame of XLA's."""
_SIZE, _EXTENSION, _STAGE, _OPERANDS, _OPERAND_LIST, _RESULTS, _RESULT_LIST = 0, 1, 4, 7, 9, 12, 14
"""Columns of such a frame: its size, an extension, the stage, how many operands there are and the list of
them, and the same of results."""
_FIRST, _DATA, _RANK, _SHAPE, _EXECUTE = 0, 3, 4, 5, 3
"""The first of a list; columns of a buffer: data, number of axes, their lengths; the stage to compute."""
_FROM, _TO, _BUFFERS = 1, 2, 3
"""Columns of a frame of the host's, whose size is 0: the first and the last row, and the first buffer."""
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


def api_version() -> int:
    """The version of the interface that the installed XLA declares, as one number."""
    header = Path(str(jaxlib.__file__)).parent / "include" / "xla" / "ffi" / "api" / "c_api.h"
    text = header.read_text(encoding="utf-8")
    major, minor = (re.search(rf"#define XLA_FFI_API_{name} (\d+)", text) for name in ("MAJOR", "MINOR"))
    if major is None or minor is None:
        raise ValueError(f"{header} does not declare the version of the interface")
    return int(major[1]) | (int(minor[1]) << 32)


@intrinsic
def _pointer(context: Any, address: Any) -> Any:
    """A number as a pointer."""
    generate = lambda context, builder, signature, args: builder.inttoptr(args[0], cgutils.voidptr_t)  # noqa: E731
    return types.voidptr(types.int64), generate


pointer: Any = _pointer


@compiled
def integers_at(address):
    """Whole numbers at an address, at most 16; only those that are there may be read."""
    return carray(pointer(address), (FRAME,), np.int64)


@compiled
def view(address, shape, dtype):
    """The array at an address."""
    return carray(pointer(address), shape, dtype)


@compiled
def addresses_in(a):
    """Addresses of all buffers."""
    return a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7]


@part
def inputs_of(a, rows):
    """The first three operands of motions: settings, parameters and starts."""
    s, x, y, _, _, _, _, _ = addresses_in(a)
    return view(s, (rows,), SETTINGS), view(x, (rows, MANY), np.float64), view(y, (rows, 4), np.float64)


@compiled
def pieces(address, s, n):
    """Forcing of row n with the settings `s`, from the table of all pieces at an address."""
    count, begin = int(s.pieces), int(s.record)
    # XLA gives every motion a copy of its record, the host one place for all.
    begin = n * count if begin < 0 else begin
    return Forcing(NO, 0.0, 0.0, count, view(address, (begin + count, 4), np.float64)[begin:])


@compiled
def _buffers(frame, a):
    """Put the addresses of a frame's buffers into `a`, and return how many rows they have."""
    operands, results, rows = frame[_OPERANDS], frame[_RESULTS], 1
    operand_list, result_list = integers_at(frame[_OPERAND_LIST]), integers_at(frame[_RESULT_LIST])
    for i in range(operands):
        a[i] = integers_at(operand_list[i])[_DATA]
    for i in range(results):
        a[operands + i] = integers_at(result_list[i])[_DATA]
    settings = integers_at(operand_list[_FIRST])
    shape = integers_at(settings[_SHAPE])
    for i in range(settings[_RANK] - 1):
        rows *= shape[i]
    return rows


@compiled
def rows_of(address, a, api):
    """Put the addresses of a frame's buffers into `a`; return the first and last of the rows to compute, and
    whether the host asks."""
    frame = integers_at(address)
    if frame[_SIZE] == 0:
        for i in range(8):
            a[i] = frame[_BUFFERS + i]
        return frame[_FROM], frame[_TO], True
    if frame[_EXTENSION] != 0:
        # XLA asks for the version.
        integers_at(integers_at(frame[_EXTENSION])[_DATA])[_DATA] = api
        return 0, 0, False
    if (frame[_STAGE] & 0xFFFFFFFF) != _EXECUTE:
        return 0, 0, False
    return 0, _buffers(frame, a), False


def _locate_event(buffer: Any) -> int:
    """The address of an array, which compiled code reads as contiguous floats of 64 bits, or records of them.

    Raises:
        TypeError: an array of another kind, which is an error of the package.
    """
    if not (buffer.flags.c_contiguous and buffer.dtype.isnative and buffer.dtype.char in "dDV"):
        raise TypeError(
            f"compiled code takes contiguous arrays of 64-bit floats, not {buffer.dtype} as given"
        )
    # NumPy's own attribute takes five times as long, but knows all arrays.
    if buffer.size and buffer.flags.writeable:
        return ctypes.addressof(ctypes.c_char.from_buffer(buffer))
    return buffer.ctypes.data


def on_host(entrance: Any) -> Callable[..., None]:
    """Function that computes rows `first` to before `last` of contiguous buffers: operands, then results."""
    call: Callable[[int], int] = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(entrance.address)
    numbers: Any = ctypes.c_int64 * FRAME

    def run(first: int, last: int, *buffers: np.ndarray) -> None:
        frame = numbers(0, first, last, *map(_locate_event, buffers))
        call(ctypes.addressof(frame))

    return run
