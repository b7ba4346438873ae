"""States of a run under a harmonic at requested times, and their derivatives."""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.arcs import arc_from, beginning, load_at, span_of, state_at, steady
from tpd.compiled.columns import (
    EVENT_BOUND,
    OVERTURNED,
    ROCKING,
    TILT,
    TILT_RATE,
)
from tpd.compiled.contact_kernel import decide, sign
from tpd.compiled.events import STOP
from tpd.compiled.follow import ARRIVED, BEYOND, Rules, allow_events, follow_piece, forcing_now, start_angles
from tpd.compiled.legs import INPUTS, STATE, carry_past_event, carry_through_leg
from tpd.compiled.march import prepare_march
from tpd.compiled.motion import FIRST_PIECE, LEG, LEGS, NO, YES, reset_counts
from tpd.compiled.plant import STEP, compiled, fill_plants, plant

ROUNDING = 1e-10
"""Share of a period by which a time may lie before the end of its period. A time that rounding has moved just
before the end then needs no leg of its own."""
BEGINNING, _INPUTS, _NONE = INPUTS, INPUTS + 1, np.int64(0)
"""Direction of the start time, after those of the parameters and of the initial state; the number of
directions; and zero as a NumPy scalar."""


@compiled
def trajectory(x, q, m, w, r, s, times, out, by):
    """Simulate a run from its state at times[0], and return its status.

    Args:
        out: array (n, 8) for the states at all n times and their time derivatives.
        by: array (n, 4, 15) for the derivatives in the parameters, the initial state and times[0], if the
            settings `s` request slopes.

    After the end of the run the states are NaN.
    """
    plant(x, q)
    prepare_march(q, w.march)
    slopes, y, f = s.slopes != 0.0, m.y, steady(np.empty((0, 4)))
    period, rules, events = span_of(q, f), Rules(s.rest_rate * q.nu, YES, NO, NO), int(s.events)
    # Times are measured from the start of their forcing period, because the forcing repeats. A late time then
    # has the phase of an early one to the last digit.
    whole = math.floor(times[0] / period + ROUNDING)
    t, status = times[0] - whole * period, ROCKING
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, t), m)
    legs = np.empty(events + LEGS if slopes else 0, LEG)
    if slopes:
        fill_plants(x, STATE, r.plants)
        for j in range(_INPUTS):
            r.shift[j] = -whole * span_of(r.plants[min(j, STATE)], f).imag / STEP
            for i in range(4):
                r.dy[i, j] = 1.0 if j == STATE + i else 0.0
        # A later start shifts the whole run.
        r.shift[BEGINNING] += 1.0
    for n in range(len(times)):
        last, arrived = math.floor(times[n] / period + ROUNDING), n == 0
        while not arrived and status == ROCKING:
            # Simulate to the end of the forcing period, or to the requested time in the last one.
            arrived = whole >= last
            end = times[n] - last * period if arrived else period
            reset_counts(m)
            start_angles(q, f, m, FIRST_PIECE, t)
            allow_events(m, w, events)
            ended = follow_piece(q, f, m, legs, w, whole, t, end, rules)
            count = min(m.n_legs, len(legs))
            if slopes and ended == ARRIVED:
                # This leg ends at a requested time, which does not change with the parameters.
                if arrived:
                    legs[count - 1].event = STOP
                for k in range(count):
                    carry_through_leg(q, r, f, legs[k], _NONE, _INPUTS)
                    carry_past_event(q, r, legs[k], _NONE, _INPUTS)
            if ended != ARRIVED:
                status = OVERTURNED if ended == BEYOND else EVENT_BOUND
            t, whole = (end, whole) if arrived else (0.0, whole + 1)
        arc = arc_from(q, m, y, load_at(q, f, whole, t))
        now = state_at(arc, beginning(arc), 0.0)
        for i in range(4):
            out[n, i], out[n, 4 + i] = y[i], now[i + 2]
            for j in range(_INPUTS if slopes else 0):
                # Beyond the end the derivatives are zero and the states NaN: NaN times zero would spoil sums
                # in reverse mode.
                by[n, i, j] = r.dy[i, j] if status == ROCKING else 0.0
            if status != ROCKING:
                out[n, i] = out[n, 4 + i] = math.nan
    return status
