"""Compiled record of the last forcing periods of a motion: when it repeats itself, and what it settles to.

`tpd.models.settling` has the rules of smoothed motions, which know no modes.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arcs import Forcing, steady
from tpd.exact.motion import FIRST_PIECE, YES, copy_to
from tpd.exact.plant import compiled
from tpd.exact.terms import SWING, SWING_RATE, TILT, TILT_RATE

NEWEST = np.int64(0)
"""Place of the last period among those that are remembered."""
LONGEST = 8
"""Longest motion recognised as periodic, in forcing periods."""
ROCKING, STICKING, AT_REST, HELD, OVERTURNED, NOT_SETTLED, EVENT_BOUND, FAILED = range(8)
"""Numbers of statuses, see `tpd.exact.terms.ENDS`."""
PERIOD = np.dtype([("y", np.float64, (4,)), *((n, np.float64) for n in ("tilt", "swing", "hold_level"))])
"""A forcing period: the state at its end, the largest |phi| and |psi|, and how long the block was held."""
_NAMES = "amplitude swing peak peak_swing kind tilt direction status periods elapsed".split()
SETTLED = np.dtype([("y", np.float64, (4,)), *((name, np.float64) for name in _NAMES)])
"""Motion that is settled on, see `tpd.exact.runs.Settled`: its state, sizes and peaks, kind and signs of its
mode, and the number of its status."""


@compiled
def scales_of(q):
    """Sizes of (phi, psi, phi', psi') against which a repetition is judged."""
    scales, rate, swing = np.zeros(4), max(q.xi, 1.0), q.nu + q.f
    scales[TILT], scales[SWING] = q.nu, swing
    scales[TILT_RATE], scales[SWING_RATE] = q.nu * rate, swing * rate
    return scales


@compiled
def repeats_after(q, y, past, count, scales, tolerance):
    """Periods after which a motion repeats itself; 0 if it does not."""
    # A massless bob cannot move the block, so that its state does not count.
    step = 1 if q.mu > 0.0 else 2
    close, shortest = False, 0
    for j in range(count):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(y[i] - past[j].y[i]) / scales[i])
        close = close or error < tolerance
        # On its way to period one a motion may alternate: the shortest period that is close as well counts.
        if shortest == 0 and error < 100.0 * tolerance:
            shortest = j + 1
    return shortest if close else 0


@compiled
def excitation_in(ramp, period, elapsed, since, cubics):
    """The forcing of a period after so many others, followed from the time `since` in it on, and the time at
    which it has its full size, 0 if it has; it grows over `ramp` periods. `cubics` has no rows."""
    rising = (ramp - elapsed) * period
    if rising <= max(since, 1e-12 * period):
        return steady(cubics), 0.0
    return Forcing(YES, elapsed / ramp, 1.0 / (ramp * period), FIRST_PIECE, cubics), rising


@compiled
def store_period(past, count, y, amplitude, swing, hold_level):
    """Put a period in front of the last ones; return how many states are known."""
    for j in range(LONGEST - 1, 0, -1):
        past[j] = past[j - 1]
    new = past[NEWEST]
    copy_to(y, new.y)
    new.tilt, new.swing, new.hold_level = amplitude, swing, hold_level
    return min(count + 1, LONGEST)


@compiled
def was_held(past, periods):
    """Whether the block was held throughout so many last periods, on its base or leaning."""
    hold_level = True
    for j in range(periods):
        hold_level = hold_level and past[j].hold_level == 2.0
    return hold_level


@compiled
def store_settled(status, repeats, elapsed, m, past, peaks, out):
    """Put what a motion has settled to into the record `out`."""
    # Of a motion that repeats itself only its own periods count: those before them belong to the transient.
    n_periods = repeats if repeats > 0 else LONGEST
    amplitude, swing, stuck = 0.0, 0.0, 0.0
    for j in range(n_periods):
        amplitude, swing = max(amplitude, past[j].tilt), max(swing, past[j].swing)
        stuck = max(stuck, past[j].hold_level)
    if status == ROCKING and stuck > 0.0:
        status = STICKING
    if status == AT_REST:
        amplitude, swing = abs(m.y[TILT]), past[NEWEST].swing
        status = HELD if m.y[TILT] != 0.0 else AT_REST
    if status == OVERTURNED:
        peaks[TILT] = peaks[SWING] = math.inf
    copy_to(m.y, out.y)
    out.amplitude, out.swing, out.peak, out.peak_swing = amplitude, swing, peaks[TILT], peaks[SWING]
    out.kind, out.tilt, out.direction = m.kind, m.tilt, m.direction
    out.status, out.periods, out.elapsed = status, max(repeats, 1), elapsed
