"""The one entrance to the compiled code of the linear equations, for XLA and for the host.

XLA calls a function by a pointer to a frame that names the buffers (its foreign function interface, FFI). The
host calls the same function with a frame of its own, whose first number is 0, so that the code is compiled
once. Both release Python's lock. A row of each buffer belongs to one motion.
"""

from __future__ import annotations

import ctypes
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jaxlib
import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from tpd.exact.arc_kernel import COMPLEX_PLANT, PLANT, compiled
from tpd.models.compiling import checksum
from tpd.models.linear_derivatives import INPUTS
from tpd.models.linear_orbit import cycle
from tpd.models.linear_settling import settle
from tpd.models.linear_trajectory import trajectory
from tpd.models.period_kernel import FLOATS, WHOLES

SETTLE, CYCLE, TRAJECTORY = range(3)
"""Tasks; the first number of every row of settings."""
SETTINGS = 6
"""Numbers in a row of settings."""
CYCLE_OUT = 12
_FRAME = 16


def _api_version() -> tuple[int, int]:
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


_pointer: Any = intrinsic(_cast)


@compiled
def _wholes(address, count):
    """Whole numbers at an address."""
    return carray(_pointer(address), (count,), np.int64)


@compiled
def _table(address, rows, columns):
    """A table of floats at an address."""
    return carray(_pointer(address), (rows, columns), np.float64)


@compiled
def _cube(address, rows, columns, depth):
    """Tables of floats at an address."""
    return carray(_pointer(address), (rows, columns, depth), np.float64)


@compiled
def _settle(a, first, last):
    """Rows of `settle`: settings (what, periods, max_events, tolerance, rest_rate), parameters, starts,
    beginnings and ramps; results of numbers and of counts."""
    s, x, y, t = (
        _table(a[0], last, SETTINGS),
        _table(a[1], last, 9),
        _table(a[2], last, 4),
        _table(a[3], last, 2),
    )
    out, wholes = _table(a[4], last, FLOATS), _table(a[5], last, WHOLES)
    plants, others = np.empty(1, PLANT), np.empty(1, COMPLEX_PLANT)
    for n in range(first, last):
        status, own, elapsed = settle(
            x[n], plants, others, y[n], t[n, 0], t[n, 1], int(s[n, 1]), int(s[n, 2]), s[n, 3], s[n, 4], out[n]
        )
        wholes[n, 0], wholes[n, 1], wholes[n, 2] = status, own, elapsed


@compiled
def _cycle(a, first, last):
    """Rows of `cycle`: settings (what, periods, max_events, -, rest_rate, first direction), parameters,
    starts and modes; results and derivatives."""
    s, x, y, mode = (
        _table(a[0], last, SETTINGS),
        _table(a[1], last, 9),
        _table(a[2], last, 4),
        _table(a[3], last, 3),
    )
    out, by = _table(a[4], last, CYCLE_OUT), _cube(a[5], last, 6, INPUTS)
    plants, others = np.empty(1, PLANT), np.empty(1, COMPLEX_PLANT)
    for n in range(first, last):
        cycle(
            x[n],
            plants,
            others,
            y[n],
            mode[n],
            int(s[n, 1]),
            s[n, 4],
            int(s[n, 2]),
            int(s[n, 5]),
            out[n],
            by[n],
        )


@compiled
def _trajectory(a, first, last):
    """Rows of `trajectory`: settings (what, number of times, max_events, -, rest_rate, slopes), parameters,
    starts and times; states with their rates, statuses, and derivatives."""
    s, x, y = _table(a[0], last, SETTINGS), _table(a[1], last, 9), _table(a[2], last, 4)
    count = int(s[0, 1])
    times, out = _table(a[3], last, count), _cube(a[4], last, count, 8)
    statuses = _table(a[5], last, 1)
    # Ten complex plants: one for each parameter, and one for directions in which none changes.
    plants, others = np.empty(1, PLANT), np.empty(10, COMPLEX_PLANT)
    for n in range(first, last):
        slopes = s[n, 5] != 0.0
        by = carray(_pointer(a[6]), (last, count if slopes else 1, 4, INPUTS + 1), np.float64)
        statuses[n, 0] = trajectory(
            x[n], plants, others, y[n], times[n], s[n, 4], int(s[n, 2]), slopes, out[n], by[n]
        )


@compiled
def _run(a, first, last):
    """Rows of whatever the settings ask for."""
    what = _table(a[0], 1, 1)[0, 0]
    if what == SETTLE:
        _settle(a, first, last)
    elif what == CYCLE:
        _cycle(a, first, last)
    else:
        _trajectory(a, first, last)


@compiled
def _buffers(frame, a):
    """Put the addresses of a frame's buffers into `a`, and return how many rows they have."""
    operands, results, rows = frame[7], frame[12], 1
    for i in range(operands):
        a[i] = _wholes(_wholes(frame[9], operands)[i], 6)[3]
    for i in range(results):
        a[operands + i] = _wholes(_wholes(frame[14], results)[i], 6)[3]
    settings = _wholes(_wholes(frame[9], 1)[0], 6)
    shape = _wholes(settings[5], settings[4])
    for i in range(settings[4] - 1):
        rows *= shape[i]
    return rows


def _entrance(version: int, api: int) -> Any:
    """Compiled entrance, stored on disk for later processes where a folder can be written to."""

    def call(address):
        """Answer a frame: 0 for success. XLA's have 16 numbers of 8 bytes: the second is an extension, the
        fifth a stage, the tenth and the last but one the lists of buffers."""
        frame, a = _wholes(address, _FRAME), np.zeros(8, np.int64)
        first, last, by_host = 0, 1, frame[0] == 0
        if by_host:
            first, last = frame[1], frame[2]
            for i in range(8):
                a[i] = frame[3 + i]
        elif frame[1] != 0:
            # XLA asks for the version.
            _wholes(_wholes(frame[1], 4)[3], 5)[3] = api
            last = 0
        elif (frame[4] & 0xFFFFFFFF) != 3:
            last = 0
        else:
            last = _buffers(frame, a)
        # One call: Numba compiles all that is called once more for each other kind of argument.
        if last > first:
            _run(a, first, last)
        return version if by_host else 0

    plain = inspect.unwrap(call)
    try:
        return numba.cfunc("int64(int64)", cache=True)(plain)
    except RuntimeError:
        # Neither the package's folder nor the user's cache nor NUMBA_CACHE_DIR can be written to.
        return numba.cfunc("int64(int64)")(plain)


_MAJOR, _MINOR = _api_version()
# Numba's store looks at the file of the function alone, and would go on with machine code of another version
# of the kernel. Numbers from outside the function are part of its key.
_CALL = _entrance(checksum(), _MAJOR | (_MINOR << 32))
_ON_HOST: Callable[[int], int] = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(_CALL.address)


def capsule() -> Any:
    """The entrance as an XLA FFI handler."""
    import jax

    return jax.ffi.pycapsule(_CALL.address)


def run(first: int, last: int, *buffers: np.ndarray) -> None:
    """Compute rows `first` to before `last` of contiguous buffers: operands, then results."""
    addresses = [b.ctypes.data for b in buffers]
    frame = np.array([0, first, last, *addresses, *[0] * (_FRAME - 3 - len(buffers))], dtype=np.int64)
    _ON_HOST(frame.ctypes.data)
