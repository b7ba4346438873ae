"""The orbit that a motion approaches slowly: Newton's method takes it there."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from tpd.exact.legs import ANGLES, STATE
from tpd.exact.motion import copy_to
from tpd.exact.period_map import APPROACHING, BEST, find_orbit, multipliers, set_motion
from tpd.exact.plant import compiled
from tpd.exact.repetition import scales_of

NEARBY, _NEGLIGIBLE = 0.05, 1e-4
"""Largest distances, in shares of the scales, from which a motion is taken to the orbit that it approaches:
with its peaks behind it, and always."""
_LINEAR = 0.1
"""Share of its distance by which the last states of such a motion may differ from what the orbit's derivative
says."""
CONVERGED = 1e-10
"""Residual of such an orbit."""
_ATTRACTING, _LONG = 1.0 - 4e-5, 1000
"""Largest multiplier of an orbit that is known to attract, and periods that are summed up."""
Past = namedtuple("Past", "periods peaks")
"""The last periods of a motion, newest first, and the largest tilt and swing of all."""


@compiled
def _is_approaching(by, past, count, periods, orbit_state, scales, distance):
    """Whether a motion's last states, and those before, differ from an orbit's as its derivative says."""
    if count <= 2 * periods:
        return False
    for n in range(2):
        for i in range(4):
            error = past[n * periods].y[i] - orbit_state[i]
            for j in range(4):
                error -= by[i, STATE + j] * (past[(n + 1) * periods].y[j] - orbit_state[j])
            if not abs(error) < _LINEAR * distance * scales[i]:
                return False
    return True


@compiled
def _peaks_are_past(by, best, scales, gap, distance, peaks):
    """Whether the motion has its peaks behind it, on its way to an orbit from which its state differs by
    `gap`; or else, where that is next to nothing, raise the peaks by what it reaches, to first order."""
    next_gap, worst = np.empty(4), np.zeros(2)
    for _ in range(_LONG):
        for k in range(4):
            size = best[k]
            for i in range(4):
                size += by[ANGLES + k, STATE + i] * gap[i]
            worst[k // 2] = max(worst[k // 2], size)
        error = 0.0
        for i in range(4):
            next_gap[i] = 0.0
            for j in range(4):
                next_gap[i] += by[i, STATE + j] * gap[j]
            error = max(error, abs(next_gap[i]) / scales[i])
        copy_to(next_gap, gap)
        if error > 3.0 * distance:
            return False
        if error < 1e-8:
            break
    else:
        return False
    # What the first order leaves out is of the square of the distance.
    margin = distance * distance if distance > _NEGLIGIBLE else 0.0
    for k in range(2):
        if margin > 0.0 and worst[k] + margin * scales[k] > peaks[k]:
            return False
        peaks[k] = max(peaks[k], worst[k])
    return True


@compiled
def orbit_near(q, m, buffers, past, count, limits, periods):
    """Look for the orbit of so many periods that a motion approaches, whose last states are `past`. If it
    attracts, and the motion is near and moves as the orbit's derivative says, change the motion's state, put
    the orbit's sizes into `past`, and return True."""
    c, y, gap, scales, distance = buffers.cycles[BEST], np.empty(4), np.empty(4), scales_of(q), 0.0
    copy_to(m.y, y)
    # If no orbit is found, the motion goes on as if nobody had looked.
    set_motion(y, m, buffers.motions[APPROACHING])
    residual = find_orbit(q, buffers.motions[APPROACHING], buffers, limits, periods, y)
    # The derivative of an orbit at rest does not tell whether the decay of the bob lifts the block yet: there
    # the motion is followed until that is proved away.
    if not residual < CONVERGED or c.closed == 0.0 or c.amplitude == 0.0:
        return False
    for i in range(4):
        gap[i] = m.y[i] - y[i]
        distance = max(distance, abs(gap[i]) / scales[i])
    # With a multiplier next to 1 a motion would be on its way for thousands of periods, and small differences
    # decide whether it arrives: such a motion is followed.
    largest, _, _ = multipliers(q, c.by, np.empty(4, np.complex128))
    if not (distance < NEARBY and largest < _ATTRACTING):
        return False
    if not _is_approaching(c.by, past.periods, count, periods, y, scales, distance):
        return False
    if not _peaks_are_past(c.by, c.extremes, scales, gap, distance, past.peaks):
        return False
    for n in range(periods):
        past.periods[n].tilt, past.periods[n].swing = c.amplitude, c.swing
    copy_to(y, m.y)
    return True
