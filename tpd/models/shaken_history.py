"""States of a motion under a ground motion at given times, in compiled scalar code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from tpd.exact.arc_kernel import PLANT, compiled, instant, state_at, stored
from tpd.exact.cubic_kernel import cubic_at, forcing_of, launch_cubic
from tpd.exact.event_kernel import NO
from tpd.exact.event_search import SECOND
from tpd.exact.mode_kinds import SLIP
from tpd.models.compiling import checksum
from tpd.models.shaken_kernel import GONE, LEG, LEGS, TALLY, WHOLE, follow, room_for

COLUMNS = 9
"""Numbers at a time: the state with the accelerations (6), the forcing, the kind of the mode and the sign of
the tilt."""
_TABLE, _COLUMN = numba.float64[:, ::1], numba.float64[::1]
_MOTION = (_COLUMN, _COLUMN, _TABLE, numba.float64, _COLUMN, numba.int64)
_SIGNATURE = numba.int64(*_MOTION, _TABLE, _TABLE)


@compiled
def _put(q, c, n, leg, piece, local, y, out):
    """Put what a leg is at a local time of one of its pieces into `out`; `y` is the state where it began."""
    whole = leg[6] == WHOLE
    start = 0.0 if whole else leg[4]
    e = cubic_at(c, n, piece, q.xi, start)
    arc = launch_cubic(q, leg[0], leg[1], leg[2], y[0], y[1], y[2], y[3], e)
    a = state_at(arc, instant(arc, local - start), local - start)
    for i in range(6):
        out[i] = a[i]
    out[6], out[7], out[8] = q.f * forcing_of(e, local - start)[0], leg[0], leg[1]


@compiled
def _through(q, c, n, leg, times, at, out):
    """Put the states at all times within a leg into rows of `out` from `at` on; return the next row."""
    h, piece, whole = q.xi, int(leg[3]), leg[6] == WHOLE
    y = np.empty(4)
    for i in range(4):
        y[i] = leg[8 + i]
    # Whole pieces are gone through one by one, since a time may lie in any of them.
    count = int(leg[5]) if whole else 1
    for k in range(count):
        begin = (piece + k) * h + (0.0 if whole else leg[4])
        end = begin + (h if whole else leg[5])
        while at < len(times) and times[at] <= end:
            _put(q, c, n, leg, piece + k, times[at] - (piece + k) * h, y, out[at])
            at += 1
        if whole:
            e = cubic_at(c, n, piece + k, h, 0.0)
            arc = launch_cubic(q, leg[0], leg[1], leg[2], y[0], y[1], y[2], y[3], e)
            a = state_at(arc, instant(arc, h), h)
            for i in range(4):
                y[i] = a[i]
    return at


@compiled
def _put_impacts(q, legs, count, impacts):
    """Put times and rates after them of all impacts into `impacts`, NaN where there are fewer."""
    k = 0
    for m in range(count):
        if legs[m, 0] == SLIP and legs[m, 6] == SECOND and k < len(impacts):
            impacts[k, 0] = legs[m, 3] * q.xi + legs[m, 4] + legs[m, 5]
            # The next leg begins with the state after the impact; after the last one the block rests.
            impacts[k, 1] = legs[m + 1, 10] if m + 1 < count else 0.0
            k += 1
    for i in range(k, len(impacts)):
        impacts[i, 0] = impacts[i, 1] = np.nan


def _entry(version: int) -> Callable[..., Any]:
    def history(x, y0, c, free, times, max_events, out, impacts):
        """Put the states at increasing `times` into `out`, NaN beyond the end, and times and rates phi' of
        impacts, after them, into `impacts`, shape (most, 2). Return the status."""
        n, q, y, mode, tally = len(c), np.empty(1, PLANT), np.empty(4), np.zeros(4), np.empty(TALLY)
        legs = np.empty((room_for(n, max_events), LEG))
        while True:
            for i in range(4):
                y[i] = y0[i]
            status = follow(x, q[0], c, n, y, free, 2e-7, max_events, NO, tally, legs, mode)
            if tally[LEGS] <= len(legs):
                break
            legs = np.empty((int(tally[LEGS]), LEG))
        # Times increase, as the legs do: one pass through both.
        at = 0
        for m in range(min(int(tally[LEGS]), len(legs))):
            if legs[m, 6] == GONE:
                # To the last time: the arc goes on.
                legs[m, 5] = max(legs[m, 5], times[-1])
            at = _through(q[0], c, n, legs[m], times, at, out)
        _put_impacts(q[0], legs, min(int(tally[LEGS]), len(legs)), impacts)
        for i in range(at, len(times)):
            for j in range(out.shape[1]):
                out[i, j] = np.nan
        return status + 0 * version

    return stored(history, numba.njit, _SIGNATURE, nogil=True)


# See `tpd.models.nonlinear_settling`.
history = _entry(checksum("shaken_"))
