"""The entrance to the compiled code of the linear equations (25), for XLA and for the host."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from tpd.exact.arcs import Load, arc_from, beginning, state_at, steady
from tpd.exact.contact_kernel import decide, sign
from tpd.exact.cycle_kernel import LINK, SURVEY, survey, traverse
from tpd.exact.follow import FAILED, FOLLOWED, STATUSES, put_results, through
from tpd.exact.legs import (
    ANGLES,
    GROWING,
    INPUTS,
    ROWS,
    STATES,
    TIMES,
    UPLIFT,
    put_impacts,
    put_states,
    read,
)
from tpd.exact.motion import FIRST_PIECE, LEG, larger, put
from tpd.exact.near_orbits import CYCLE, Limits, cycle, follow_periods
from tpd.exact.plant import compiled, part, plant, put_plants, stored
from tpd.exact.repetition import SETTLED
from tpd.exact.settle import settle
from tpd.exact.steady import STEADY, first_of, memory, steady_state
from tpd.exact.terms import SWING_PULL, TILT, TILT_PULL, TILT_RATE
from tpd.exact.trajectory import trajectory
from tpd.models.compiling import checksum
from tpd.models.custom_call import (
    BEGIN,
    FIELDS,
    RAMP,
    SETTINGS,
    api_version,
    carray,
    cube,
    on_host,
    pieces,
    pointer,
    rows_of,
    settings,
    settings_at,
    table,
    usual,
)

__all__ = [
    "CALL",
    "CYCLE",
    "FIELDS",
    "FOLLOWED",
    "INPUTS",
    "SETTINGS",
    "SETTLED",
    "STATES",
    "STATUSES",
    "STEADY",
    "settings",
]

SETTLE, PERIODS, TRAJECTORY, SHAKE, HISTORY, LEGS_OF, ARCS, STEADY_STATE = range(8)
"""Tasks; the first number of every row of settings. Histories, legs and arcs are for the host alone."""
_END, _GROWN, _AT, _LIFTED, SHAKEN = map(np.int64, (3, 7, 8, 11, 12))
"""Places of the quantities with derivatives of a motion through all pieces, after the three angles: the end,
the growing coordinate, the three times, that of the uplift; and how many there are."""
ENDED = np.dtype([("legs", np.float64), ("how", np.float64)])
"""Legs of a motion, for which there may not be room, and how it ended."""
_USUAL = 20_000
"""Events for which there is room at first."""


@compiled
def _keep(own):
    """Keep the memory of records until here: Numba frees an array after its last use."""
    return len(own.motions)


@part
def _settle(a, first, last):
    """Rows of `settle`: settings, parameters, starts, beginnings and ramps; what the motions settle to."""
    (s, x, y), t, own = usual(a, last), table(a[3], last, 2), memory()
    out, (q, m, room, r) = carray(pointer(a[4]), (last,), SETTLED), first_of(own)
    for n in range(first, last):
        put(y[n], m.y)
        settle(x[n], q, m, room, r, s[n], t[n, BEGIN], t[n, RAMP], out[n])
    _keep(own)


@part
def _cycle(a, first, last):
    """Rows of `cycle`: settings, parameters, starts and modes; cycles."""
    (s, x, y), modes, own = usual(a, last), table(a[3], last, 3), memory()
    out, (q, m, room, r) = carray(pointer(a[4]), (last,), CYCLE), first_of(own)
    for n in range(first, last):
        plant(x[n], q)
        put_plants(x[n], r.plants)
        put(y[n], m.y)
        m.kind, m.tilt, m.way = modes[n, 0], modes[n, 1], modes[n, 2]
        limits = Limits(s[n].rest_rate * q.nu, int(s[n].events), int(s[n].periods))
        cycle(q, m, own.legs, room, r, limits, own.motions[1], out[n])
    _keep(own)


@part
def _steady(a, first, last):
    """Rows of `steady_state`: settings, parameters and starts; steady states."""
    (s, x, y), own = usual(a, last), memory()
    out = carray(pointer(a[3]), (last,), STEADY)
    for n in range(first, last):
        steady_state(x[n], y[n], s[n], own, out[n])
    _keep(own)


@part
def _trajectory(a, first, last):
    """Rows of `trajectory`: settings, parameters, starts and times; states with their rates, statuses, and
    derivatives."""
    (s, x, y), own = usual(a, last), memory()
    count, (q, m, room, r) = int(s[0].periods), first_of(own)
    times, out, statuses = table(a[3], last, count), cube(a[4], last, count, 8), table(a[5], last, 1)
    for n in range(first, last):
        by = carray(pointer(a[6]), (last, count if s[n].slopes != 0.0 else 1, 4, INPUTS + 1), np.float64)
        put(y[n], m.y)
        statuses[n, 0] = trajectory(x[n], q, m, room, r, s[n], times[n], out[n], by[n])
    _keep(own)


@compiled
def _put_accelerations(q, m, out):
    """Put the accelerations at the end of a motion into its results."""
    arc = arc_from(q, m, m.y, Load(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    end = state_at(arc, beginning(arc), 0.0)
    out.state[TILT_PULL], out.state[SWING_PULL] = end[TILT_PULL], end[SWING_PULL]


@compiled
def _put_slopes(m, many, inputs, by):
    """Put the derivatives `many` of a motion through all pieces into `by`. Directions that are not asked for
    stay zero, and times without a derivative no numbers."""
    for j in range(INPUTS):
        for i in range(SHAKEN):
            by[i, j] = 0.0
        if j < inputs:
            for k in range(3):
                best = larger(m, k)
                by[k, j], by[_AT + k, j] = many[ANGLES + best, j], many[TIMES + best, j]
            for i in range(4):
                by[_END + i, j] = many[i, j]
            by[_GROWN, j], by[_LIFTED, j] = many[GROWING, j], many[UPLIFT, j]


@compiled
def _usual_legs(s):
    """Legs to make room for at first: few motions have so many, and those are followed once more."""
    return 2 * (int(s.pieces) + min(int(s.events), _USUAL)) + 64


@part
def _shake(a, first, last, history):
    """Rows of `through`: settings, parameters, starts and pieces. If it is a `history`, also times; states,
    impacts and statuses. If not, results and derivatives."""
    (s, x, y), own = usual(a, last), memory()
    none, many, slopes = np.empty(0, LEG), np.empty((ROWS, INPUTS)), s[first].slopes != 0.0
    q, m, room, r = first_of(own)
    for n in range(first, last):
        f, status = pieces(a[3], s[n], n), FAILED
        # Of memory that nothing is written to the system gives none.
        legs = np.empty(_usual_legs(s[n]), LEG) if slopes or history else none
        m.recorded = len(legs) + 1
        while m.recorded > len(legs):
            put(y[n], m.y)
            status = through(x[n], q, f, m, legs, room, s[n])
            if not (slopes or history):
                break
            if m.recorded > len(legs):
                legs = np.empty(m.recorded, LEG)
                m.recorded += 1
        if history:
            count, most = int(s[n].periods), int(s[n].impacts)
            put_states(
                q, f, legs, m.recorded, table(a[4], last, count)[n], cube(a[5], last, count, STATES)[n]
            )
            put_impacts(q, legs, m.recorded, cube(a[6], last, most, 2)[n])
            table(a[7], last, 1)[n, 0] = status
            continue
        out = carray(pointer(a[4]), (last,), FOLLOWED)[n]
        put_results(m, status, out)
        _put_accelerations(q, m, out)
        if slopes:
            inputs = int(s[n].slopes)
            for i in range(ROWS):
                for j in range(INPUTS):
                    many[i, j] = math.nan
            put_plants(x[n], r.plants)
            out.growing = read(q, f, m, legs, r, (FIRST_PIECE, inputs), s[n].angles != 0.0, many)
            _put_slopes(m, many, inputs, cube(a[5], last, SHAKEN, INPUTS)[n])
    _keep(own)


@part
def _legs(a, first, last):
    """Rows of `follow_periods` from states at tau = 0: settings, parameters and starts; legs, how many there
    are, for which there may not be room, and how the motion ended."""
    (s, x, start), own = usual(a, last), memory()
    legs, ends = carray(pointer(a[3]), (last, int(s[0].pieces)), LEG), carray(pointer(a[4]), (last,), ENDED)
    (q, m, room, _), f = first_of(own), steady(np.empty((0, 4)))
    for n in range(first, last):
        plant(x[n], q)
        put(start[n], m.y)
        decide(q, m.y, sign(m.y[TILT]), sign(m.y[TILT_RATE]), 0.0, m)
        limits = Limits(s[n].rest_rate * q.nu, int(s[n].events), int(s[n].periods))
        ends[n].how, ends[n].legs = follow_periods(q, f, m, legs[n], room, limits), m.recorded
    _keep(own)


@part
def _arcs(a, first, last):
    """Rows of `traverse` over so many arcs: settings, complex parameters, links, and complex arcs; ends, and
    if the settings ask for slopes, findings about the arcs of the first row."""
    s, x, own = settings_at(a[0], 1), carray(pointer(a[1]), (last, 9), np.complex128), memory()
    many = int(s[0].pieces)
    links, z = carray(pointer(a[2]), (many,), LINK), carray(pointer(a[3]), (last, many, 6), np.complex128)
    out, found = carray(pointer(a[4]), (last, many, 6), np.complex128), carray(pointer(a[5]), (many,), SURVEY)
    (q, _, room, r), numbers, arc = first_of(own), np.empty(9), np.empty(6)
    other = r.plants[0]
    for n in range(first, last):
        plant(x[n], other)
        for i in range(many):
            traverse(other, links[i], z[n, i], out[n, i])
    for j in range(9):
        numbers[j] = x[first, j].real
    plant(numbers, q)
    for i in range(many if s[0].slopes != 0.0 else 0):
        for j in range(6):
            arc[j] = z[first, i, j].real
        survey(q, links[i], arc, room, own.rooms[1], found[i])
    _keep(own)


@part
def _run(a, first, last):
    """Rows of whatever the settings ask for."""
    task = table(a[0], 1, 1)[0, 0]
    if task == SETTLE:
        _settle(a, first, last)
    elif task == PERIODS:
        _cycle(a, first, last)
    elif task == STEADY_STATE:
        _steady(a, first, last)
    elif task == TRAJECTORY:
        _trajectory(a, first, last)
    elif task == LEGS_OF:
        _legs(a, first, last)
    elif task == ARCS:
        _arcs(a, first, last)
    else:
        _shake(a, first, last, task == HISTORY)


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


CALL = _entrance(checksum("exact_"), api_version())
"""The entrance, an FFI handler of XLA's."""
run = on_host(CALL)
"""Function that answers the host: first and last row, then the operands and results of a task."""
