"""Derivatives of motions of the linear equations along their recorded legs, in complex numbers.

Between events a leg has the closed form of its arc (see `tpd.exact.arc_kernel`). At an event one Newton step
on its time carries the saltation matrix.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import STEP, compiled, instant, launch, plant_along, state_at, struck
from tpd.exact.event_kernel import reserve
from tpd.exact.event_search import BOB, END, FIRST
from tpd.exact.mode_kinds import SLIP

INPUTS = 13
"""Directions of derivatives: nine parameters and four components of a state."""
STATE = np.int64(9)
"""First direction of a state."""


@compiled
def _late(q, kind, tilt, which, a, now, t, end):
    """How much later a leg ends, in the direction of the derivative; `a` and `now` are its last state and
    instant."""
    # To first order: what is left of the event's signal, over its slope.
    if which == END:
        return (end - t).imag
    if which == BOB:
        return 0.0
    if kind != SLIP:
        value = reserve(q, kind, complex(tilt, 0.0), which, a[0], a[1], a[3], now.sine)
        side = 1.0 if which == FIRST else -1.0
        pull = (1.0 - q.up.real) * a[3].real + q.bias.real * a[5].real
        slope = -side * (pull - q.f.real * q.xi.real * now.cosine.real)
        return -value.imag / slope if slope != 0.0 else 0.0
    if which == FIRST:
        return -a[2].imag / a[4].real if a[4].real != 0.0 else 0.0
    return -a[0].imag / a[2].real if a[2].real != 0.0 else 0.0


@compiled
def _leg(q, legs, n, y, t, end):
    """Follow a recorded leg: change the state `y` to that at its end, and return the time of its end. `t` is
    the time of its beginning and `end` its horizon, for a leg that ends there."""
    kind, tilt, way, lasted, which = legs[n, 0], legs[n, 1], legs[n, 2], legs[n, 4], legs[n, 5]
    one, zero = complex(1.0, 0.0), complex(0.0, 0.0)
    arc = launch(q, kind, complex(tilt, 0.0), complex(way, 0.0), y[0], y[1], y[2], y[3], q.xi * t, one, zero)
    now = instant(arc, complex(lasted, 0.0))
    a = state_at(arc, now, complex(lasted, 0.0))
    late = _late(q, kind, tilt, which, a, now, t, end)
    for i in range(4):
        y[i] = complex(a[i].real, a[i].imag + a[i + 2].real * late)
    return complex(t.real + lasted, t.imag + late)


@compiled
def _after(q, legs, n, y):
    """Change the state at the end of a recorded leg to that after its event."""
    kind, which, rests = legs[n, 0], legs[n, 5], legs[n, 6] != 0.0
    if kind != SLIP or which in (END, BOB):
        return
    if which == FIRST:
        y[0], y[2] = (complex(0.0, 0.0) if rests else y[0]), complex(0.0, 0.0)
    else:
        y[0] = complex(0.0, 0.0)
        y[2], y[3] = struck(q, rests, y[2], y[3])


@compiled
def _extremes(legs, count, y0, where):
    """Put the indices of the legs at whose ends tilt and swing are largest to either side into `where`; -1 is
    the beginning."""
    for k in range(4):
        column, side = 11 + k // 2, 1.0 if k % 2 == 0 else -1.0
        best, where[k] = side * y0[k // 2], -1
        for n in range(count):
            if side * legs[n, column] > best:
                best, where[k] = side * legs[n, column], n


@compiled
def differentiate(x, complex_plants, y0, legs, count, first, by):
    """Put the derivatives of the end of the recorded periods, and of their largest tilts and swings to either
    side, into `by`, shape (8, 13), from direction `first` on."""
    y, where = np.empty(4, np.complex128), np.empty(4, np.int64)
    _extremes(legs, count, y0, where)
    q = complex_plants[0]
    for j in range(first, INPUTS):
        if j < 9 or j == first or j == 9:
            plant_along(x, j, q)
        for i in range(4):
            y[i] = complex(y0[i], STEP if 9 + i == j else 0.0)
        t, period = complex(0.0, 0.0), 2.0 * math.pi / q.xi
        for k in range(4):
            by[4 + k, j] = (1.0 if k % 2 == 0 else -1.0) * y[k // 2].imag / STEP
        for n in range(count):
            # The real part of a state begins anew with every leg, as it did when the motion was followed.
            for i in range(4):
                y[i] = complex(legs[n, 7 + i], y[i].imag)
            t = _leg(q, legs, n, y, complex(legs[n, 3], t.imag), period)
            for k in range(4):
                if where[k] == n:
                    by[4 + k, j] = (1.0 if k % 2 == 0 else -1.0) * y[k // 2].imag / STEP
            _after(q, legs, n, y)
            if legs[n, 5] == END:
                t = complex(0.0, 0.0)
        for i in range(4):
            by[i, j] = y[i].imag / STEP


@compiled
def moved_on(complex_plants, legs, count, start, t, end, xi, late, by):
    """Take the derivatives `by`, shape (4, 14), along the recorded legs of a piece of a motion from `t` to
    `end`, in times from the beginning of a forcing period. `late` holds, for both, what the derivative of the
    period is multiplied with; 0 for `t` at the first piece, whose beginning is the direction of the last
    column."""
    z = np.empty(4, np.complex128)
    for j in range(INPUTS + 1):
        q = complex_plants[min(j, 9)]
        period = -2.0 * math.pi / (xi * xi) * STEP if j == 6 else 0.0
        now = complex(t, late[0] * period + (late[2] * STEP if j == INPUTS else 0.0))
        goal = complex(end, late[1] * period)
        for i in range(4):
            z[i] = complex(start[i], by[i, j] * STEP)
        for n in range(count):
            for i in range(4):
                z[i] = complex(legs[n, 7 + i], z[i].imag)
            now = _leg(q, legs, n, z, complex(legs[n, 3], now.imag), goal)
            _after(q, legs, n, z)
        for i in range(4):
            by[i, j] = z[i].imag / STEP
