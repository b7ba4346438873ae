"""The last forcing periods of a run: whether it repeats, and the record of the motion to which it settles.

`tpd.models.smoothed_orbit` has the rules for the smoothed models, which have no contact modes.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.columns import (
    AT_REST,
    FAILED,
    HELD,
    OVERTURNED,
    ROCKING,
    STICKING,
    SWING,
    SWING_RATE,
    TILT,
    TILT_RATE,
)
from tpd.compiled.forcing import FIRST_PIECE, YES, Forcing, harmonic
from tpd.compiled.motion import copy_to
from tpd.compiled.plant import compiled

NEWEST = np.int64(0)
"""Index of the last period among the stored ones."""
LONGEST = 8
"""Longest period of a motion that is recognised, in forcing periods. One more period is stored, because the
decay of a change follows from two changes."""
_EXACT = 1e-3
"""Largest change in a period for which its decay does not matter, as a share of the tolerance."""
PERIOD = np.dtype([("y", np.float64, (4,)), *((n, np.float64) for n in ("tilt", "swing", "hold_level"))])
"""A forcing period: the state `y` at its end, the largest |phi| and |psi|, and the hold level, see
`tpd.compiled.motion.MOTION`."""


@compiled
def scales_of(q):
    """Return the scales of (phi, psi, phi', psi') for the comparison of states."""
    scales, xi, swing = np.zeros(4), max(q.xi, 1.0), q.nu + q.f
    scales[TILT], scales[SWING], scales[TILT_RATE], scales[SWING_RATE] = q.nu, swing, q.nu * xi, swing * xi
    return scales


@compiled
def distance(q, y, other, scales):
    """Return the largest difference of two states, in shares of the scales."""
    # A massless bob does not act on the block, so that its state does not count.
    error = 0.0
    for i in range(0, 4, 1 if q.mu > 0.0 else 2):
        error = max(error, abs(y[i] - other[i]) / scales[i])
    return error


@compiled
def repeats_after(q, y, past, count, scales, tolerance):
    """Return the number of periods after which a motion repeats, or 0 if it does not repeat.

    `y` is the present state, and `past` holds `count` periods, the last one first.
    """
    close, shortest, decays = False, 0, q.zeta > 0.0 or past[NEWEST].hold_level < 2.0
    for j in range(min(count, LONGEST)):
        error = distance(q, y, past[j].y, scales)
        if error < tolerance and not close:
            # The sum of all further changes must be small as well, if they decay as in the last period. A
            # motion that decays slowly is not close to its limit yet, or returns by chance.
            before = distance(q, past[NEWEST].y, past[j + 1].y, scales) if j + 1 < count else 0.0
            exact = error < _EXACT * tolerance or not decays
            close = exact or error * error < tolerance * (before - error)
        # A motion that converges to period one may alternate, and be closer to the state two periods ago. So
        # the shortest period counts that is almost as close.
        if shortest == 0 and error < 100.0 * tolerance:
            shortest = j + 1
    return shortest if close else 0


@compiled
def excitation_in(ramp, period, elapsed, since):
    """Return the forcing of a period, and the local time at which it has its full size.

    The time is 0 if the forcing has its full size already.

    The excitation grows over `ramp` periods. `elapsed` is the number of periods before this one, and the run
    starts at the local time `since` in it.
    """
    ramp_end = (ramp - elapsed) * period
    if ramp_end <= max(since, 1e-12 * period):
        return harmonic(), 0.0
    return Forcing(YES, elapsed / ramp, 1.0 / (ramp * period), FIRST_PIECE, np.empty((0, 4))), ramp_end


@compiled
def store_period(past, count, y, amplitude, swing, hold_level):
    """Store a period in front of the last ones. Return the number of stored states."""
    # Move the older periods back by one place.
    for j in range(LONGEST, 0, -1):
        past[j] = past[j - 1]
    new = past[NEWEST]
    copy_to(y, new.y)
    new.tilt, new.swing, new.hold_level = amplitude, swing, hold_level
    return min(count + 1, LONGEST + 1)


@compiled
def was_held(past, periods):
    """Whether the block was held throughout a number of last periods, on its base or at a tilt."""
    hold_level = True
    for j in range(periods):
        hold_level = hold_level and past[j].hold_level == 2.0
    return hold_level


@compiled
def store_settled(status, repeats, elapsed, m, past, peaks, out):
    """Write the results of a run under a harmonic into the record `out` (`tpd.compiled.columns.RUN`)."""
    # If the motion repeats, only the periods of one repetition count. Earlier periods belong to the
    # transient.
    n_periods = repeats if repeats > 0 else LONGEST
    amplitude, swing, stuck = 0.0, 0.0, 0.0
    for j in range(n_periods):
        amplitude, swing = max(amplitude, past[j].tilt), max(swing, past[j].swing)
        stuck = max(stuck, past[j].hold_level)
    # A block that sticks for a part of the period is reported as sticking.
    if status == ROCKING and stuck > 0.0:
        status = STICKING
    if status == AT_REST:
        amplitude, swing = abs(m.y[TILT]), past[NEWEST].swing
        status = HELD if m.y[TILT] != 0.0 else AT_REST
    if status == OVERTURNED:
        amplitude = swing = peaks[TILT] = peaks[SWING] = math.inf
    if status == FAILED:
        amplitude = swing = peaks[TILT] = peaks[SWING] = math.nan
    out.times[:] = out.state[:] = math.nan
    copy_to(m.y, out.state)
    out.tilt, out.settled_tilt, out.swing, out.settled_swing = peaks[TILT], amplitude, peaks[SWING], swing
    # The rod angle is not recorded under a harmonic. The sum of tilt and swing is an upper bound.
    out.rod_angle, out.settled_rod_angle = peaks[SWING] + peaks[TILT], swing + amplitude
    out.status, out.periods, out.elapsed = status, max(repeats, 1), elapsed
    out.growing = out.impacts = out.uplift_time = out.overturning_time = out.transversality = math.nan
