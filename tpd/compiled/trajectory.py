"""States of a run under a harmonic at requested times, and their derivatives."""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import series
from tpd.compiled.columns import EVENT_BOUND, FAILED, OVERTURNED, ROCKING
from tpd.compiled.contact import start_mode
from tpd.compiled.follow import ARRIVED, BEYOND, NOT_FINITE, advance, set_scales
from tpd.compiled.forcing import FIRST_PIECE, NO, forcing_now, harmonic, span_of
from tpd.compiled.legs import INPUTS, STATE, carry_through_leg, fill_plants, start_reading, store_state_at
from tpd.compiled.motion import LEG, LEGS, STOP, is_finite, record_leg, reset_angles, reset_counts
from tpd.compiled.plant import NONE, ONLY, STEP, compiled

ROUNDING = 1e-10
"""Share of a period by which a time may lie before the end of its period. A time that rounding has moved just
before the end then needs no leg of its own."""
BEGINNING, _INPUTS = INPUTS, INPUTS + 1
"""Direction of the start time, after those of the parameters and of the initial state; and the number of
directions."""


@compiled
def trajectory(x, q, m, w, r, s, times, out, by):
    """Simulate a run from its state at times[0], and return its status.

    Args:
        out: array (n, 8) for the states at all n times and their time derivatives.
        by: array (n, 4, 15) for the derivatives in the parameters, the initial state and times[0], if the
            settings `s` request slopes.

    After the end of the run the states are NaN.
    """
    # The times are those of a run under the steady harmonic, without a growing excitation.
    series.prepare(x, s, q, w)
    set_scales(q, w)
    slopes, y, f, period, now = s.slopes != 0.0, m.y, harmonic(), w.period, np.empty(6)
    # Times are measured from the start of their forcing period, because the forcing repeats. A late time then
    # has the phase of an early one to the last digit.
    whole = math.floor(times[0] / period + ROUNDING)
    t, status, here = times[0] - whole * period, ROCKING, np.empty(1, LEG)
    start_mode(q, y, forcing_now(q, f, FIRST_PIECE, t), m)
    reset_counts(m)
    legs = np.empty(int(s.events) + LEGS if slopes else 0, LEG)
    if slopes:
        fill_plants(x, STATE, s.linear, r)
        start_reading(r, _INPUTS)
        for j in range(_INPUTS):
            r.shift[j] = -whole * span_of(r.plants[min(j, STATE)], f).imag / STEP
        # A later start shifts the whole run.
        r.shift[BEGINNING] += 1.0
    for n in range(len(times)):
        last, arrived = math.floor(times[n] / period + ROUNDING), n == 0
        while not arrived and status == ROCKING:
            # Simulate to the end of the forcing period, or to the requested time in the last one.
            arrived = whole >= last
            end = times[n] - last * period if arrived else period
            reset_counts(m)
            reset_angles(m)
            m.events = int(s.events)
            ended = advance(q, f, m, legs, w, whole, t, end)
            count = min(m.n_legs, len(legs))
            if slopes and ended == ARRIVED:
                # This leg ends at a requested time, which does not change with the parameters.
                if arrived:
                    legs[count - 1].event = STOP
                for k in range(count):
                    carry_through_leg(q, r, f, legs[k], (NONE, _INPUTS), NO, m, k)
            if ended == NOT_FINITE or not is_finite(y):
                status = FAILED
            elif ended != ARRIVED:
                status = OVERTURNED if ended == BEYOND else EVENT_BOUND
            t, whole = (end, whole) if arrived else (0.0, whole + 1)
        # A leg of zero length has the accelerations of the present state.
        m.n_legs = 0
        record_leg(m, here, whole, t, 0.0, 4, STOP)
        store_state_at(q, f, here[ONLY], 0.0, w, now)
        for i in range(4):
            out[n, i], out[n, 4 + i] = y[i], now[i + 2]
            for j in range(_INPUTS if slopes else 0):
                # Beyond the end the derivatives are zero and the states NaN: NaN times zero would spoil sums
                # in reverse mode.
                by[n, i, j] = r.dy[i, j] if status == ROCKING else 0.0
            if status != ROCKING:
                out[n, i] = out[n, 4 + i] = math.nan
    return status
