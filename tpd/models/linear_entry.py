"""The entrance to the compiled code of the linear equations under a harmonic, for XLA and for the host."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba.np.numpy_support import carray

from tpd.exact.arc_kernel import COMPLEX_PLANT, PLANT, part, stored
from tpd.models.compiling import checksum
from tpd.models.custom_call import api_version, cube, on_host, pointer, rows_of, table
from tpd.models.linear_derivatives import INPUTS
from tpd.models.linear_orbit import cycle
from tpd.models.linear_settling import settle
from tpd.models.linear_trajectory import trajectory
from tpd.models.period_kernel import FLOATS, WHOLES

SETTLE, CYCLE, TRAJECTORY = range(3)
"""Tasks; the first number of every row of settings."""
SETTINGS, CYCLE_OUT, CYCLE_SIZES = np.int64(6), np.int64(12), np.int64(6)
"""Numbers in a row of settings and in the results of a cycle, and quantities of a cycle with derivatives: its
end, amplitude and stroke."""
_ONE, _BEGINNING, _MODE, _STATE, _RATES, _PARAMETERS = map(np.int64, (1, 2, 3, 4, 8, 9))
"""Columns of further tables: beginnings are with ramps, rates with the states that they are of."""
_INPUTS = np.int64(INPUTS)


@part
def _settle(a, first, last):
    """Rows of `settle`: settings (what, periods, max_events, tolerance, rest_rate), parameters, starts,
    beginnings and ramps; results of numbers and of counts."""
    s, x, y, t = (
        table(a[0], last, SETTINGS),
        table(a[1], last, _PARAMETERS),
        table(a[2], last, _STATE),
        table(a[3], last, _BEGINNING),
    )
    out, wholes = table(a[4], last, FLOATS), table(a[5], last, WHOLES)
    plants, others = np.empty(1, PLANT), np.empty(1, COMPLEX_PLANT)
    for n in range(first, last):
        status, own, elapsed = settle(
            x[n], plants, others, y[n], t[n, 0], t[n, 1], int(s[n, 1]), int(s[n, 2]), s[n, 3], s[n, 4], out[n]
        )
        wholes[n, 0], wholes[n, 1], wholes[n, 2] = status, own, elapsed


@part
def _cycle(a, first, last):
    """Rows of `cycle`: settings (what, periods, max_events, -, rest_rate, first direction), parameters,
    starts and modes; results and derivatives."""
    s, x, y, mode = (
        table(a[0], last, SETTINGS),
        table(a[1], last, _PARAMETERS),
        table(a[2], last, _STATE),
        table(a[3], last, _MODE),
    )
    out, by = table(a[4], last, CYCLE_OUT), cube(a[5], last, CYCLE_SIZES, _INPUTS)
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


@part
def _trajectory(a, first, last):
    """Rows of `trajectory`: settings (what, number of times, max_events, -, rest_rate, slopes), parameters,
    starts and times; states with their rates, statuses, and derivatives."""
    s, x, y = table(a[0], last, SETTINGS), table(a[1], last, _PARAMETERS), table(a[2], last, _STATE)
    count = int(s[0, 1])
    times, out = table(a[3], last, count), cube(a[4], last, count, _RATES)
    statuses = table(a[5], last, _ONE)
    # Ten complex plants: one for each parameter, and one for directions in which none changes.
    plants, others = np.empty(1, PLANT), np.empty(10, COMPLEX_PLANT)
    for n in range(first, last):
        slopes = s[n, 5] != 0.0
        by = carray(pointer(a[6]), (last, count if slopes else 1, 4, INPUTS + 1), np.float64)
        statuses[n, 0] = trajectory(
            x[n], plants, others, y[n], times[n], s[n, 4], int(s[n, 2]), slopes, out[n], by[n]
        )


@part
def _run(a, first, last):
    """Rows of whatever the settings ask for."""
    what = table(a[0], _ONE, _ONE)[0, 0]
    if what == SETTLE:
        _settle(a, first, last)
    elif what == CYCLE:
        _cycle(a, first, last)
    else:
        _trajectory(a, first, last)


def _entrance(version: int, api: int) -> Any:
    def call(address):
        """Answer a frame: 0 for success."""
        a = np.zeros(8, np.int64)
        first, last, by_host = rows_of(address, a, api)
        # One call: Numba compiles all that is called once more for each other kind of argument.
        if last > first:
            _run(a, first, last)
        return version if by_host else 0

    # Numba's store looks at the file of the function alone, and would go on with machine code of another
    # version of the kernel. Numbers from outside the function are part of its key.
    return stored(call, numba.cfunc, "int64(int64)")


CALL = _entrance(checksum("linear_"), api_version())
"""The entrance, an FFI handler of XLA's."""
run = on_host(CALL)
