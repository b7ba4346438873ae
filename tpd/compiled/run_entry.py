"""Entry point to the compiled code of runs, for XLA and for Python.

Runs are simulated one by one. In a vectorised batch every run would wait for the one with the most events.
"""

from __future__ import annotations

import numpy as np

from tpd.compiled import series
from tpd.compiled.columns import RUN, STEADY, SWING_PULL, TILT_PULL
from tpd.compiled.custom_call import (
    BEGIN,
    RAMP,
    SETTINGS,
    addresses_in,
    entrance,
    inputs_of,
    on_host,
    pieces,
    view,
)
from tpd.compiled.follow import follow_ground_motion, store_results
from tpd.compiled.legs import (
    ANGLES,
    GROWING,
    INPUTS,
    OF_END,
    OF_GROWING,
    OF_TIMES,
    OF_UPLIFT,
    OUTPUTS,
    STATE,
    STATES,
    TIMES,
    UPLIFT,
    fill_plants,
    read_derivatives,
    store_impacts,
    store_state_at,
    store_states,
)
from tpd.compiled.motion import END, LEG, copy_to, larger_side, record_leg
from tpd.compiled.period_map import SIMULATED, TRIAL, new_buffers, records_of
from tpd.compiled.plant import NONE, ONLY, compiled
from tpd.compiled.settle import settle
from tpd.compiled.steady import steady_state
from tpd.compiled.trajectory import trajectory

SETTLE, TRAJECTORY, GROUND, HISTORY, STEADY_STATE, ORBIT = range(6)
"""Tasks, which are the first number of every row of settings. Histories are only for calls from Python."""
_USUAL_EVENTS = 20_000
"""Number of events for which memory is allocated at first."""


@compiled
def _settle(a, first, last, buffers):
    """Compute rows of the task SETTLE, see `settle`.

    Operands: settings, parameters, initial states, and begin and ramp of each run. Results: records
    `RUN`.
    """
    (s, x, y), (_, _, _, times, results, _, _, _) = inputs_of(a, last), addresses_in(a)
    t, out, m = view(times, (last, 2), np.float64), view(results, (last,), RUN), buffers.motions[SIMULATED]
    for n in range(first, last):
        copy_to(y[n], m.y)
        settle(x[n], buffers, s[n], t[n, BEGIN], t[n, RAMP], out[n])


@compiled
def _steady(a, first, last, near, buffers):
    """Compute rows of the tasks STEADY_STATE and ORBIT (`near`), see `steady_state`.

    Operands: settings, parameters and initial states. Results: records `STEADY`.
    """
    (s, x, y), (_, _, _, results, _, _, _, _) = inputs_of(a, last), addresses_in(a)
    out = view(results, (last,), STEADY)
    for n in range(first, last):
        steady_state(x[n], y[n], s[n], near, buffers, out[n])


@compiled
def _trajectory(a, first, last, buffers):
    """Compute rows of the task TRAJECTORY, see `trajectory`.

    Operands: settings, parameters, initial states and times. Results: states with their time derivatives,
    statuses, and derivatives.
    """
    (s, x, y), (_, _, _, clock, states, ends, slopes, _) = inputs_of(a, last), addresses_in(a)
    count, (q, m, w, r) = int(s[first].periods), records_of(buffers)
    times, out = view(clock, (last, count), np.float64), view(states, (last, count, 8), np.float64)
    statuses = view(ends, (last,), np.float64)
    for n in range(first, last):
        by = view(slopes, (last, count if s[n].slopes != 0.0 else 1, 4, INPUTS + 1), np.float64)
        copy_to(y[n], m.y)
        statuses[n] = trajectory(x[n], q, m, w, r, s[n], times[n], out[n], by[n])


@compiled
def _store_slopes(m, table, inputs, by):
    """Select the derivatives of a run's results from the derivatives of its legs, and write them into `by`.

    The directions from `inputs` on stay zero. The derivative of a time that has none is NaN.
    """
    by[:] = 0.0
    for j in range(inputs):
        for k in range(3):
            # Of the two sides of each angle only the larger one is a result.
            best = larger_side(m, k)
            by[k, j], by[OF_TIMES + k, j] = table[ANGLES + best, j], table[TIMES + best, j]
        for i in range(4):
            by[OF_END + i, j] = table[i, j]
        by[OF_GROWING, j], by[OF_UPLIFT, j] = table[GROWING, j], table[UPLIFT, j]


@compiled
def _follow_ground(a, first, last, history, buffers):
    """Compute rows of the tasks GROUND and HISTORY (`history`), see `follow_ground_motion`.

    Operands: settings, parameters, initial states and pieces, for a history also times. Results: records
    `RUN` and derivatives; for a history states, impacts and statuses.
    """
    (s, x, y), (_, _, _, forcing, results, by, arrivals, ends) = inputs_of(a, last), addresses_in(a)
    no_legs, slopes = np.empty(0, LEG), s[first].slopes != 0.0
    (q, m, w, r), now, here = records_of(buffers), np.empty(6), np.empty(1, LEG)
    for n in range(first, last):
        f = pieces(forcing, s[n], n)
        # Every run may have other parameters and settings.
        series.prepare(x[n], s[n], q, w)
        # Few runs have more legs than this, and such runs are repeated with enough memory. The operating
        # system assigns memory only when it is written, so that a large array costs nothing.
        capacity = 2 * (int(s[n].pieces) + min(int(s[n].events), _USUAL_EVENTS)) + 64
        legs = np.empty(capacity, LEG) if slopes or history else no_legs
        while True:
            copy_to(y[n], m.y)
            status = follow_ground_motion(q, f, m, legs, w, s[n], buffers.motions[TRIAL])
            # Without derivatives no legs are needed.
            if m.n_legs <= len(legs) or not (slopes or history):
                break
            legs = np.empty(m.n_legs, LEG)
        if history:
            count, n_impacts = int(s[n].periods), int(s[n].impacts)
            times, size = view(results, (last, count), np.float64), (last, count, STATES)
            store_states(q, f, legs, m.n_legs, times[n], w, view(by, size, np.float64)[n])
            store_impacts(q, legs, m.n_legs, view(arrivals, (last, n_impacts, 2), np.float64)[n])
            view(ends, (last,), np.float64)[n] = status
            continue
        # The results without derivatives.
        out = view(results, (last,), RUN)[n]
        store_results(m, status, out)
        if not slopes:
            continue
        inputs, count = int(s[n].slopes), m.n_legs
        fill_plants(x[n], min(inputs, STATE), s[n].linear, r)
        # Derivatives that do not exist are never written, and must be NaN.
        r.by[:] = np.nan
        out.growing = read_derivatives(q, f, m, legs, r, (NONE, inputs), s[n].angles != 0.0)
        _store_slopes(m, r.by, inputs, view(by, (last, OUTPUTS, INPUTS), np.float64)[n])
        # The accelerations at the end, where no forcing acts.
        m.n_legs = 0
        record_leg(m, here, f.pieces, s[n].free, 0.0, 4, END)
        store_state_at(q, f, here[ONLY], 0.0, w, now)
        out.state[TILT_PULL], out.state[SWING_PULL], m.n_legs = now[TILT_PULL], now[SWING_PULL], count


def _run(a, first, last):
    """Compute rows of the task that the settings name."""
    settings, _, _, _, _, _, _, _ = addresses_in(a)
    task, buffers = view(settings, (last,), SETTINGS)[first].task, new_buffers()
    if task == SETTLE:
        _settle(a, first, last, buffers)
    elif task in (STEADY_STATE, ORBIT):
        _steady(a, first, last, task == ORBIT, buffers)
    elif task == TRAJECTORY:
        _trajectory(a, first, last, buffers)
    else:
        _follow_ground(a, first, last, task == HISTORY, buffers)
    # A record does not keep its array alive, and Numba frees an array after its last use.
    return len(buffers.motions)


CALL = entrance(_run)
"""The entry point, an FFI handler for XLA."""
run = on_host(CALL)
"""Function for calls from Python. The arguments are the first row, the row after the last, then operands and
results."""
