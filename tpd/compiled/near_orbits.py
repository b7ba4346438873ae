"""Search for the orbit that a run approaches slowly, by Newton's method."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from tpd.compiled.legs import ANGLES, STATE
from tpd.compiled.motion import copy_to, set_motion
from tpd.compiled.period_map import APPROACHING, BEST, find_orbit, multipliers
from tpd.compiled.plant import ONLY, compiled
from tpd.compiled.repetition import scales_of

NEARBY, _NEGLIGIBLE = 0.05, 1e-4
"""Largest distances, in shares of the scales, at which a run is moved to the orbit that it approaches: if its
largest angles lie behind it, and in any case."""
_LINEAR = 0.1
"""Largest deviation of the last states from the linearised motion near the orbit, as a share of their
distance."""
CONVERGED = 1e-10
"""Largest residual of such an orbit."""
_ATTRACTING, _LONG = 1.0 - 4e-5, 1000
"""Largest multiplier of an orbit that certainly attracts; and the largest number of periods that are added
up."""
Past = namedtuple("Past", "periods peaks")
"""The last periods of a run (the newest first), and its largest tilt and swing so far."""


@compiled
def _is_approaching(by, past, count, periods, orbit_state, scales, distance):
    """Whether a run approaches an orbit as the orbit's derivative predicts.

    The last states and the states one period of the orbit before must differ from the orbit by amounts that
    the linearised map relates.
    """
    if count <= 2 * periods:
        return False
    for n in range(2):
        for i in range(4):
            # Difference between the run and its linear prediction from `periods` earlier.
            error = past[n * periods].y[i] - orbit_state[i]
            for j in range(4):
                error -= by[i, STATE + j] * (past[(n + 1) * periods].y[j] - orbit_state[j])
            if not abs(error) < _LINEAR * distance * scales[i]:
                return False
    return True


@compiled
def _peaks_are_past(by, best, scales, gap, distance, peaks):
    """Whether the largest angles of a run lie behind it when it approaches an orbit.

    `gap` is the difference between the run's state and the orbit. If the gap is negligible, raise the peaks
    to the angles that the run reaches to first order, and return True.
    """
    next_gap, worst = np.empty(4), np.zeros(2)
    for _ in range(_LONG):
        for k in range(4):
            size = best[k]
            for i in range(4):
                size += by[ANGLES + k, STATE + i] * gap[i]
            # Largest angles of the next period, to first order in the gap.
            worst[k // 2] = max(worst[k // 2], size)
        error = 0.0
        for i in range(4):
            next_gap[i] = 0.0
            for j in range(4):
                next_gap[i] += by[i, STATE + j] * gap[j]
            error = max(error, abs(next_gap[i]) / scales[i])
        copy_to(next_gap, gap)
        # A gap that grows is no convergence.
        if error > 3.0 * distance:
            return False
        if error < 1e-8:
            break
    else:
        return False
    # The error of the first order is of the square of the distance.
    margin = distance * distance if distance > _NEGLIGIBLE else 0.0
    for k in range(2):
        if margin > 0.0 and worst[k] + margin * scales[k] > peaks[k]:
            return False
        peaks[k] = max(peaks[k], worst[k])
    return True


@compiled
def orbit_near(q, m, buffers, past, count, limits, periods):
    """Search for the orbit that a run approaches, and move the run to it. Return whether this succeeds.

    The orbit must attract, and the run must be near it and move as the orbit's derivative predicts. Then this
    changes the state of the motion `m`, writes the sizes of the orbit into `past`, and returns True.
    Otherwise nothing changes.
    """
    c, answer, gap, scales = buffers.cycles[BEST], buffers.answers[ONLY], np.empty(4), scales_of(q)
    y, distance = answer.state, 0.0
    copy_to(m.y, y)
    # Use a copy of the motion. If there is no orbit, the run continues unchanged.
    set_motion(y, m, buffers.motions[APPROACHING])
    residual = find_orbit(q, buffers.motions[APPROACHING], buffers, limits, periods, y)
    # The derivative of a motion at rest does not show whether the decaying bob can still lift the block. Such
    # a run is simulated until that is excluded.
    if not residual < CONVERGED or c.closed == 0.0 or c.amplitude == 0.0:
        return False
    for i in range(4):
        gap[i] = m.y[i] - y[i]
        distance = max(distance, abs(gap[i]) / scales[i])
    # With a multiplier near 1 the run would need thousands of periods, and small differences decide whether
    # it arrives. Such a run is simulated.
    largest, _, _ = multipliers(q, c.by, answer.multipliers)
    if not (distance < NEARBY and largest < _ATTRACTING):
        return False
    if not _is_approaching(c.by, past.periods, count, periods, y, scales, distance):
        return False
    if not _peaks_are_past(c.by, c.peaks, scales, gap, distance, past.peaks):
        return False
    for n in range(periods):
        past.periods[n].tilt, past.periods[n].swing = c.amplitude, c.swing
    c.periods, c.residual = periods, residual
    copy_to(y, m.y)
    return True
