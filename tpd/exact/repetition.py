"""Compiled record of the last forcing periods of a motion: when it repeats itself, and what it settles to.

The rules are those of `tpd.models.settling`.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arcs import Forcing, steady
from tpd.exact.motion import FIRST_PIECE, YES
from tpd.exact.plant import compiled

LONGEST = 8
"""Longest motion recognised as periodic, in forcing periods."""
STATUSES = ("rocking", "sticking", "rest", "held", "overturned", "not_settled", "event_bound", "failed")
"""Names of statuses in the order of their numbers."""
ROCKING, STICKING, AT_REST, HELD, OVERTURNED, NOT_SETTLED, EVENT_BOUND, FAILED = range(8)
FLOATS, WHOLES = np.int64(11), np.int64(3)
"""Columns of results: y, amplitude, stroke, peak, peak stroke, kind and signs of the mode; and status,
periods of the motion, periods elapsed."""


@compiled
def scales_of(q):
    """Sizes of (phi, psi, phi', psi') against which a repetition is judged."""
    scales, rate, swing = np.zeros(4), max(q.xi, 1.0), q.nu + q.f
    scales[0], scales[1], scales[2], scales[3] = q.nu, swing, q.nu * rate, swing * rate
    return scales


@compiled
def repeats_after(q, y, past, known, scales, tolerance):
    """Periods after which a motion repeats itself; 0 if it does not."""
    # A massless bob cannot move the block, so that its state does not count.
    step = 1 if q.mu > 0.0 else 2
    close, shortest = False, 0
    for j in range(known):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(y[i] - past[j, i]) / scales[i])
        close = close or error < tolerance
        # On its way to period one a motion may alternate: the shortest period that is close as well counts.
        if shortest == 0 and error < 100.0 * tolerance:
            shortest = j + 1
    return shortest if close else 0


@compiled
def shaking_in(ramp, period, elapsed, since, cubics):
    """The forcing of a period after so many others, followed from the time `since` in it on, and the time at
    which it has its full size, 0 if it has; it grows over `ramp` periods. `cubics` has no rows."""
    grown = (ramp - elapsed) * period
    if grown <= max(since, 1e-12 * period):
        return steady(cubics), 0.0
    return Forcing(YES, elapsed / ramp, 1.0 / (ramp * period), FIRST_PIECE, cubics), grown


@compiled
def remember(past, known, last, y, amplitude, stroke, held):
    """Put a period in front of the last ones; return how many states are known."""
    for j in range(LONGEST - 1, 0, -1):
        for i in range(4):
            past[j, i] = past[j - 1, i]
        for i in range(3):
            last[j, i] = last[j - 1, i]
    for i in range(4):
        past[0, i] = y[i]
    last[0, 0], last[0, 1], last[0, 2] = amplitude, stroke, held
    return min(known + 1, LONGEST)


@compiled
def stayed(last, periods):
    """Whether the block was held throughout so many last periods, on its base or leaning."""
    held = True
    for j in range(periods):
        held = held and last[j, 2] == 2.0
    return held


@compiled
def settled(status, repeats, m, last, peaks, out):
    """Put the results of a motion into `out`; return its status and its periods."""
    own = repeats if repeats > 0 else LONGEST
    amplitude, stroke, stuck = 0.0, 0.0, 0.0
    for j in range(own):
        amplitude, stroke = max(amplitude, last[j, 0]), max(stroke, last[j, 1])
        stuck = max(stuck, last[j, 2])
    if status == ROCKING and stuck > 0.0:
        status = STICKING
    if status == AT_REST:
        amplitude, stroke = abs(m.y[0]), last[0, 1]
        status = HELD if m.y[0] != 0.0 else AT_REST
    if status == OVERTURNED:
        peaks[0] = peaks[1] = math.inf
    for i in range(4):
        out[i] = m.y[i]
    out[4], out[5], out[6], out[7] = amplitude, stroke, peaks[0], peaks[1]
    out[8], out[9], out[10] = m.kind, m.tilt, m.way
    return status, max(repeats, 1)
