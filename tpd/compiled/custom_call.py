"""Calls of compiled code by XLA and by Python through one entry point.

XLA calls a function with a pointer to a frame that describes the buffers (its foreign function interface,
FFI). Python calls the same function with a frame of its own, whose first number is 0, so that the code is
compiled only once. Both release Python's lock. Each run has one row in every buffer.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

from tpd.compiled.columns import WIDTH
from tpd.compiled.compiling import checksum
from tpd.compiled.forcing import NO, Forcing
from tpd.compiled.plant import compiled, part, shared
from tpd.core.machine_code import stored

carray: Any = numba.carray  # type: ignore[attr-defined]
FRAME = 16
"""Number of 8-byte integers in a frame of XLA."""
_MAJOR, _MINOR = 0, 3
API_VERSION = _MAJOR | _MINOR << 32
"""Version of the interface whose columns are below, as one integer. XLA refuses code of a version that it no
longer supports. Check the columns in `xla/ffi/api/c_api.h` before this changes."""
_SIZE, _EXTENSION, _STAGE, _OPERANDS, _OPERAND_LIST, _RESULTS, _RESULT_LIST = 0, 1, 4, 7, 9, 12, 14
"""Columns of such a frame: its size, an extension, the stage, the number of operands and the list of them,
and the same for the results."""
_TYPE, _NEXT, _METADATA = 1, 2, 1
"""Columns of an extension: its type and the next extension; the type of a request for the version."""
_FIRST, _DATA, _RANK, _SHAPE, _EXECUTE = 0, 3, 4, 5, 3
"""Index of the first item of a list; columns of a buffer: data, number of axes, their lengths; the stage that
computes."""
_FROM, _TO, _BUFFERS = 1, 2, 3
"""Columns of a frame from Python, whose size is 0: the first row, the row after the last, and the first
buffer."""
_NAMES = (
    "task periods events rest_rate tolerance rtol lyapunov_periods impacts slopes pieces record free brief "
    "angles linear"
)
SETTINGS: Any = np.dtype([(name, np.float64) for name in _NAMES.split()])
"""A row of settings. A task ignores the settings that it does not need.

- `task`: number of the task.
- `periods`: number of periods, or number of times of a trajectory or history.
- `events`: bound on the number of events.
- `rest_rate`: largest speed |phi'|/nu of an impact that may end in rest.
- `tolerance`: difference between two periods that counts as settled.
- `rtol`: relative tolerance of a step.
- `lyapunov_periods`: number of periods over which the separation of neighbouring runs is measured.
- `impacts`: number of impacts for which there is memory.
- `slopes`: number of directions that have derivatives. A steady state has all of them or none.
- `pieces`: number of pieces of the forcing.
- `record`: row of the first piece, or -1 if every run has pieces of its own.
- `free`: duration of the free motion (tau).
- `brief`: whether the free motion may end early, and turning points of the bob do not count.
- `angles`: whether the derivatives of the largest angles are enough.
- `linear`: 1 for the linear equations (25), 0 for the nonlinear equations (4).
"""


BEGIN, RAMP = 0, 1
"""Columns of the times of a run under a harmonic: the start, and the duration of the ramp in periods."""


@intrinsic
def _pointer(context: Any, address: Any) -> Any:
    """Convert an integer to a pointer."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.int64), generate


pointer: Any = _pointer


@compiled
def integers_at(address):
    """Return the integers at an address, at most 16. Only those that exist may be read."""
    return carray(pointer(address), (FRAME,), np.int64)


@compiled
def view(address, shape, dtype):
    """Return the array at an address, without a copy."""
    return carray(pointer(address), shape, dtype)


@compiled
def addresses_in(a):
    """Return the addresses of all buffers."""
    return a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7]


@part
def inputs_of(a, rows):
    """Return the first three operands of runs: settings, parameters and initial states."""
    s, x, y, _, _, _, _, _ = addresses_in(a)
    return (view(s, (rows,), SETTINGS), view(x, (rows, WIDTH), np.float64), view(y, (rows, 4), np.float64))


@compiled
def pieces(address, s, n):
    """Return the forcing of row n, from the table of all pieces at an address."""
    count, begin = int(s.pieces), int(s.record)
    # XLA gives every run a copy of its record. Python stores each record once for all runs.
    begin = n * count if begin < 0 else begin
    return Forcing(NO, 0.0, 0.0, count, view(address, (begin + count, 4), np.float64)[begin:])


@compiled
def _buffers(frame, a):
    """Write the addresses of a frame's buffers into `a`, and return their number of rows."""
    operands, results, rows = frame[_OPERANDS], frame[_RESULTS], 1
    operand_list, result_list = integers_at(frame[_OPERAND_LIST]), integers_at(frame[_RESULT_LIST])
    for i in range(operands):
        a[i] = integers_at(operand_list[i])[_DATA]
    for i in range(results):
        a[operands + i] = integers_at(result_list[i])[_DATA]
    settings = integers_at(operand_list[_FIRST])
    shape = integers_at(settings[_SHAPE])
    # All axes of the settings except the last are batch axes.
    for i in range(settings[_RANK] - 1):
        rows *= shape[i]
    return rows


@compiled
def rows_of(address, a, api):
    """Write the addresses of a frame's buffers into `a`.

    Returns the first row to compute, the row after the last, and whether the call comes from Python.
    """
    frame = integers_at(address)
    if frame[_SIZE] == 0:
        for i in range(8):
            a[i] = frame[_BUFFERS + i]
        return frame[_FROM], frame[_TO], True
    extension = frame[_EXTENSION]
    while extension != 0:
        # Types and stages have 32 bits. The code needs no extension of another type.
        of = integers_at(extension)
        if (of[_TYPE] & 0xFFFFFFFF) == _METADATA:
            integers_at(of[_DATA])[_DATA] = api
            return 0, 0, False
        extension = of[_NEXT]
    # In the stages before the execution there is nothing to do.
    if (frame[_STAGE] & 0xFFFFFFFF) != _EXECUTE:
        return 0, 0, False
    return 0, _buffers(frame, a), False


def entrance(run: Any) -> Any:
    """Return the entry point that computes the rows of a frame by the function `run(a, first, last)`.

    It returns 0 to XLA, which takes this for success, and the checksum of the sources to Python.
    """
    # Numba's cache checks only this file, and would keep machine code of an older kernel. But the values of
    # variables from outside the function are part of the key of the cache, so that `version` makes it safe.
    # A function of Numba would have another key in each process. Therefore `run` is a plain function, which
    # `shared` lets compiled code call.
    run, version = shared(run), checksum()

    def enter(address):
        """Compute the rows that a frame describes."""
        a = np.zeros(8, np.int64)
        first, last, by_host = rows_of(address, a, API_VERSION)
        # There is only one call of `run`: Numba would compile all functions below it again for each other
        # kind of argument.
        if last > first:
            run(a, first, last)
        return version if by_host else 0

    # Numba names machine code and its file in the cache after the function. Code of several modules is loaded
    # into one process, where two functions of the same name would be taken for one.
    enter.__qualname__ = f"{run.__module__}.enter"
    return stored(enter, numba.cfunc, "int64(int64)")


def _address_of(buffer: Any) -> int:
    """Return the address of an array, which must be contiguous and have 64-bit floats or records of them.

    Raises:
        TypeError: the array is of another kind, which is an error in the package.
    """
    if not (buffer.flags.c_contiguous and buffer.dtype.isnative and buffer.dtype.char in "dDV"):
        raise TypeError(
            f"compiled code needs contiguous arrays of 64-bit floats, but an operand has {buffer.dtype}"
        )
    # The attribute `ctypes` of NumPy takes five times as long, but works for all arrays.
    if buffer.size and buffer.flags.writeable:
        return ctypes.addressof(ctypes.c_char.from_buffer(buffer))
    return buffer.ctypes.data


def on_host(entrance: Any) -> Callable[..., None]:
    """Return a function that calls the compiled code from Python.

    It computes the rows from `first` to before `last` of contiguous buffers, operands before results.
    """
    call: Callable[[int], int] = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(entrance.address)
    numbers: Any = ctypes.c_int64 * FRAME

    def run(first: int, last: int, *buffers: np.ndarray) -> None:
        frame = numbers(0, first, last, *map(_address_of, buffers))
        call(ctypes.addressof(frame))

    return run
