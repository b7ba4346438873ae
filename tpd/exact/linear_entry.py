"""The entrance to the compiled code of the linear equations (25), for XLA and for the host."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from tpd.core.machine_code import stored
from tpd.exact.arcs import Load, arc_from, beginning, state_at
from tpd.exact.compiling import checksum
from tpd.exact.custom_call import (
    BEGIN,
    RAMP,
    SETTINGS,
    addresses_in,
    api_version,
    inputs_of,
    on_host,
    pieces,
    rows_of,
    view,
)
from tpd.exact.custom_call import FIELDS as FIELDS
from tpd.exact.follow import FOLLOWED, follow_ground_motion, store_results
from tpd.exact.legs import (
    ANGLES,
    GROWING,
    INPUTS,
    ROWS,
    STATES,
    TIMES,
    UPLIFT,
    read_derivatives,
    store_impacts,
    store_states,
)
from tpd.exact.motion import FIRST_PIECE, LEG, copy_to, larger_side
from tpd.exact.period_map import new_buffers, records_of
from tpd.exact.plant import compiled, fill_plants
from tpd.exact.repetition import SETTLED
from tpd.exact.settle import settle
from tpd.exact.steady import STEADY, steady_state
from tpd.exact.terms import FAILED, SWING_PULL, TILT_PULL
from tpd.exact.trajectory import trajectory

SETTLE, TRAJECTORY, GROUND, HISTORY, STEADY_STATE, ORBIT = range(6)
"""Tasks; the first number of every row of settings. Histories are for the host alone."""
_END, _GROWN, _AT, _LIFTED, QUANTITIES = map(np.int64, (3, 7, 8, 11, 12))
"""Places of the quantities with derivatives of a motion through all pieces, after the three angles: the end,
the growing coordinate, the three times, that of the uplift; and how many there are."""
_USUAL_EVENTS = 20_000
"""Events for which there is room at first."""


@compiled
def _keep_alive(buffers):
    """Keep the memory of records until here: Numba frees an array after its last use."""
    return len(buffers.motions)


@compiled
def _settle(a, first, last):
    """Rows of `settle`: settings, parameters, starts, beginnings and ramps; what the motions settle to."""
    s, x, y = inputs_of(a, last)
    buffers, (_, _, _, times, results, _, _, _) = new_buffers(), addresses_in(a)
    t = view(times, (last, 2), np.float64)
    out, (_, m, _, _) = view(results, (last,), SETTLED), records_of(buffers)
    for n in range(first, last):
        copy_to(y[n], m.y)
        settle(x[n], buffers, s[n], t[n, BEGIN], t[n, RAMP], out[n])
    _keep_alive(buffers)


@compiled
def _steady(a, first, last, near):
    """Rows of `steady_state`: settings, parameters and starts; steady states, or orbits `near` the starts."""
    (s, x, y), buffers, (_, _, _, results, _, _, _, _) = inputs_of(a, last), new_buffers(), addresses_in(a)
    out = view(results, (last,), STEADY)
    for n in range(first, last):
        steady_state(x[n], y[n], s[n], near, buffers, out[n])
    _keep_alive(buffers)


@compiled
def _trajectory(a, first, last):
    """Rows of `trajectory`: settings, parameters, starts and times; states with their rates, statuses, and
    derivatives."""
    s, x, y = inputs_of(a, last)
    buffers, (_, _, _, clock, states, ends, slopes, _) = new_buffers(), addresses_in(a)
    count, (q, m, w, r) = int(s[first].periods), records_of(buffers)
    times, out = view(clock, (last, count), np.float64), view(states, (last, count, 8), np.float64)
    statuses = view(ends, (last,), np.float64)
    for n in range(first, last):
        by = view(slopes, (last, count if s[n].slopes != 0.0 else 1, 4, INPUTS + 1), np.float64)
        copy_to(y[n], m.y)
        statuses[n] = trajectory(x[n], q, m, w, r, s[n], times[n], out[n], by[n])
    _keep_alive(buffers)


@compiled
def _store_slopes(m, derivatives, inputs, by):
    """Put the derivatives `many` of a motion through all pieces into `by`. Directions that are not asked for
    stay zero, and times without a derivative no numbers."""
    for j in range(INPUTS):
        for i in range(QUANTITIES):
            by[i, j] = 0.0
        if j < inputs:
            for k in range(3):
                best = larger_side(m, k)
                by[k, j], by[_AT + k, j] = derivatives[ANGLES + best, j], derivatives[TIMES + best, j]
            for i in range(4):
                by[_END + i, j] = derivatives[i, j]
            by[_GROWN, j], by[_LIFTED, j] = derivatives[GROWING, j], derivatives[UPLIFT, j]


@compiled
def _follow_ground(a, first, last, history):
    """Rows of `through`: settings, parameters, starts and pieces. If it is a `history`, also times; states,
    impacts and statuses. If not, results and derivatives."""
    s, x, y = inputs_of(a, last)
    buffers, (_, _, _, forcing, results, by, arrivals, ends) = new_buffers(), addresses_in(a)
    no_legs, derivatives, slopes = np.empty(0, LEG), np.empty((ROWS, INPUTS)), s[first].slopes != 0.0
    q, m, w, r = records_of(buffers)
    for n in range(first, last):
        f, status = pieces(forcing, s[n], n), FAILED
        # Few motions have so many legs, and those are followed once more. Of memory that nothing is written
        # to the system gives none.
        capacity = 2 * (int(s[n].pieces) + min(int(s[n].events), _USUAL_EVENTS)) + 64
        legs = np.empty(capacity, LEG) if slopes or history else no_legs
        m.leg_count = len(legs) + 1
        while m.leg_count > len(legs):
            copy_to(y[n], m.y)
            status = follow_ground_motion(x[n], q, f, m, legs, w, s[n])
            if not (slopes or history):
                break
            if m.leg_count > len(legs):
                legs = np.empty(m.leg_count, LEG)
                m.leg_count += 1
        if history:
            count, most = int(s[n].periods), int(s[n].impacts)
            times = view(results, (last, count), np.float64)
            states = view(by, (last, count, STATES), np.float64)
            store_states(q, f, legs, m.leg_count, times[n], states[n])
            store_impacts(q, legs, m.leg_count, view(arrivals, (last, most, 2), np.float64)[n])
            view(ends, (last,), np.float64)[n] = status
            continue
        out = view(results, (last,), FOLLOWED)[n]
        store_results(m, status, out)
        arc = arc_from(q, m, m.y, Load(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        end = state_at(arc, beginning(arc), 0.0)
        out.state[TILT_PULL], out.state[SWING_PULL] = end[TILT_PULL], end[SWING_PULL]
        if slopes:
            inputs = int(s[n].slopes)
            for i in range(ROWS):
                for j in range(INPUTS):
                    derivatives[i, j] = math.nan
            fill_plants(x[n], r.plants)
            out.growing = read_derivatives(
                q, f, m, legs, r, (FIRST_PIECE, inputs), s[n].angles != 0.0, derivatives
            )
            _store_slopes(m, derivatives, inputs, view(by, (last, QUANTITIES, INPUTS), np.float64)[n])
    _keep_alive(buffers)


@compiled
def _run(a, first, last):
    """Rows of whatever the settings ask for."""
    settings, _, _, _, _, _, _, _ = addresses_in(a)
    task = view(settings, (last,), SETTINGS)[first].task
    if task == SETTLE:
        _settle(a, first, last)
    elif task in (STEADY_STATE, ORBIT):
        _steady(a, first, last, task == ORBIT)
    elif task == TRAJECTORY:
        _trajectory(a, first, last)
    else:
        _follow_ground(a, first, last, task == HISTORY)


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


CALL = _entrance(checksum(), api_version())
"""The entrance, an FFI handler of XLA's."""
run = on_host(CALL)
"""Function that answers the host: first and last row, then the operands and results of a task."""
