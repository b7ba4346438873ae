"""States of a motion of the linear equations at given times, and their derivatives."""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import compiled, instant, launch, plant, plant_along, state_at
from tpd.exact.event_kernel import ARRIVED, LEG, LOST, advance, begin, decide, sign
from tpd.models.linear_derivatives import INPUTS, moved_on
from tpd.models.linear_orbit import LEGS
from tpd.models.period_kernel import EVENT_BOUND, OVERTURNED, ROCKING

_ROUNDING = 1e-10
"""Share of a period by which a time may lie before the period that it counts to."""


@compiled
def _put_rates(q, mode, y, t, out):
    """Put a state and its derivative in time into `out`."""
    arc = launch(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], q.xi * t, 1.0, 0.0)
    now = state_at(arc, instant(arc, 0.0), 0.0)
    for i in range(4):
        out[i], out[4 + i] = y[i], now[i + 2]


@compiled
def trajectory(x, plants, complex_plants, y0, times, rest_rate, max_events, slopes, out, by):
    """Follow a motion from `y0` at times[0]: put the states at all times, and their derivatives in time,
    into `out`, shape (times, 8), and if `slopes` those in parameters, start and times[0] into `by`, shape
    (times, 4, 14). Return its status; what lies beyond the end of a motion is NaN. `complex_plants` has ten
    places."""
    q = plants[0]
    plant(x, q)
    for j in range(10 if slopes else 0):
        plant_along(x, j, complex_plants[j])
    period, mode, y, start = 2.0 * math.pi / q.xi, np.zeros(4), np.empty(4), np.empty(4)
    growth, sizes, now, late = np.zeros(2), np.zeros(6), np.zeros((4, INPUTS + 1)), np.zeros(3)
    legs, count = np.empty((max_events + LEGS if slopes else 0, LEG)), np.zeros(1, np.int64)
    # Times count from the beginning of their forcing period, as in `tpd.models.clock`.
    whole = math.floor(times[0] / period + _ROUNDING)
    t, status, growth[0], late[0], late[2] = times[0] - whole * period, ROCKING, 1.0, -whole, 1.0
    for i in range(4):
        y[i], now[i, 9 + i] = y0[i], 1.0
    decide(q, y, sign(y[0]), sign(y[2]), math.sin(q.xi * t), mode)
    for n in range(len(times)):
        last = math.floor(times[n] / period + _ROUNDING)
        arrived = n == 0
        while not arrived and status == ROCKING:
            arrived = whole >= last
            end = times[n] - last * period if arrived else period
            late[1] = -last if arrived else 1.0
            for i in range(4):
                start[i] = y[i]
            count[0] = 0
            begin(q, growth, mode, y, t, sizes)
            ended = advance(q, growth, mode, y, t, end, sizes, legs, count, rest_rate * q.nu, max_events)
            if slopes and ended == ARRIVED:
                moved_on(complex_plants, legs, min(count[0], len(legs)), start, t, end, q.xi, late, now)
            if ended != ARRIVED:
                status = OVERTURNED if ended == LOST else EVENT_BOUND
            t, whole = (end, whole) if arrived else (0.0, whole + 1)
            late[0], late[2] = (late[1] if arrived else 0.0), 0.0
        _put_rates(q, mode, y, t, out[n])
        for i in range(4):
            for j in range(INPUTS + 1 if slopes else 0):
                # Zeros beyond the end, where the states have none: NaN times zero would spoil sums.
                by[n, i, j] = now[i, j] if status == ROCKING else 0.0
        for i in range(8 if status != ROCKING else 0):
            out[n, i] = math.nan
    return status
