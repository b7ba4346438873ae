"""The entrance to the compiled code of the linear equations under a harmonic, for XLA and for the host."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba.np.numpy_support import carray

from tpd.exact.arc_kernel import COMPLEX_PLANT, PLANT, part, plant, stored
from tpd.exact.cycle_kernel import LINK, SURVEY, survey, traverse
from tpd.exact.event_kernel import LEG, decide, sign
from tpd.models.compiling import checksum
from tpd.models.custom_call import api_version, cube, on_host, pointer, rows_of, table
from tpd.models.linear_derivatives import INPUTS
from tpd.models.linear_orbit import cycle, follow
from tpd.models.linear_settling import settle
from tpd.models.linear_trajectory import trajectory
from tpd.models.period_kernel import FLOATS, WHOLES

SETTLE, CYCLE, TRAJECTORY, LEGS, ARCS = range(5)
"""Tasks; the first number of every row of settings. The last two are for the host alone."""
SETTINGS, CYCLE_OUT, CYCLE_SIZES = np.int64(6), np.int64(12), np.int64(6)
"""Numbers in a row of settings and in the results of a cycle, and quantities of a cycle with derivatives: its
end, amplitude and stroke."""
_ONE, _BEGINNING, _MODE, _STATE, _RATES, _PARAMETERS = map(np.int64, (1, 2, 3, 4, 8, 9))
"""Columns of further tables: beginnings are with ramps, rates with the states that they are of."""
_INPUTS, _LEG = np.int64(INPUTS), np.int64(LEG)


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
def _legs(a, first, last):
    """Rows of `follow`: settings (what, periods, max_events, room, rest_rate), parameters and starts; legs,
    how many there are, for which there may not be room, and how the motion ended."""
    s, x, start = table(a[0], last, SETTINGS), table(a[1], last, _PARAMETERS), table(a[2], last, _STATE)
    legs, ends = cube(a[3], last, int(s[0, 3]), _LEG), table(a[4], last, _BEGINNING)
    plants, mode, sizes, count = np.empty(1, PLANT), np.zeros(4), np.zeros(6), np.zeros(1, np.int64)
    for n in range(first, last):
        y = start[n].copy()
        plant(x[n], plants[0])
        decide(plants[0], y, sign(y[0]), sign(y[2]), 0.0, mode)
        ends[n, 1] = follow(plants[0], y, mode, int(s[n, 1]), s[n, 4], int(s[n, 2]), legs[n], count, sizes)
        ends[n, 0] = count[0]


@part
def _arcs(a, first, last):
    """Rows of `traverse` over so many arcs: settings (what, arcs, whether to survey), complex parameters,
    links, and complex arcs; ends, and findings about the arcs of the first row."""
    s, x = table(a[0], _ONE, SETTINGS), carray(pointer(a[1]), (last, 9), np.complex128)
    many = int(s[0, 1])
    links, z = carray(pointer(a[2]), (many,), LINK), carray(pointer(a[3]), (last, many, 6), np.complex128)
    out, found = carray(pointer(a[4]), (last, many, 5), np.complex128), carray(pointer(a[5]), (many,), SURVEY)
    plants, others, numbers, arc = np.empty(1, PLANT), np.empty(1, COMPLEX_PLANT), np.empty(9), np.empty(6)
    for n in range(first, last):
        plant(x[n], others[0])
        for i in range(many):
            traverse(others[0], links[i], z[n, i], out[n, i])
    for j in range(9):
        numbers[j] = x[first, j].real
    plant(numbers, plants[0])
    for i in range(many if s[0, 2] != 0.0 else 0):
        for j in range(6):
            arc[j] = z[first, i, j].real
        survey(plants[0], links[i], arc, found[i])


@part
def _run(a, first, last):
    """Rows of whatever the settings ask for."""
    what = table(a[0], _ONE, _ONE)[0, 0]
    if what == SETTLE:
        _settle(a, first, last)
    elif what == CYCLE:
        _cycle(a, first, last)
    elif what == LEGS:
        _legs(a, first, last)
    elif what == ARCS:
        _arcs(a, first, last)
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
