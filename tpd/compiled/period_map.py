"""Newton's method on the map of a number of forcing periods.

This module computes the periodic orbits of both equations: the orbits of runs that converge slowly
(`tpd.compiled.near_orbits`), the orbits of runs that have settled, and orbits near a given state
(`tpd.compiled.steady`).

Let P be the map from the state at tau = 0 to the state some periods later. A periodic orbit is y* = P(y*),
and Newton's step solves (I - DP) dy = P(y) - y. With the parameters p the orbit changes by dy*/dp = (I -
DP)^-1 dP/dp. `tpd.models.smoothed_orbit` has the same rules in JAX, for models that are JAX programs.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.compiled import repetition, series
from tpd.compiled.columns import (
    LAST_STEP,
    NEWTON_STEPS,
    RESIDUAL,
    REST,
    RUN,
    SLIP,
    STEADY,
    SWING,
    TILT,
)
from tpd.compiled.follow import ARRIVED, advance
from tpd.compiled.forcing import FIRST_PIECE, NO, harmonic
from tpd.compiled.half_map_kernel import characteristic, determinants, store_roots
from tpd.compiled.legs import INPUTS, READER, ROWS, STATE, read_derivatives, store_state_at
from tpd.compiled.motion import (
    END,
    LEG,
    LEGS,
    MOTION,
    copy_to,
    is_finite,
    largest,
    reset_angles,
    reset_counts,
    set_motion,
)
from tpd.compiled.plant import ONLY, PLANT, compiled, part

_CLOSE = 1e-9
"""Share of a period by which an event may be late, next to an orbit on which it lies within the period."""
_ROUND_OFF = 1e-13
"""Residual of the map from which the last Newton step leads to an orbit that is exact to rounding."""
Limits = namedtuple("Limits", "events directions reach")
"""Options of the search: `events`, the bound on the events of a forcing period; `directions`, the first
direction that needs derivatives and the one after the last; `reach`, the largest residual from which Newton's
method continues."""
CYCLE = np.dtype(
    [
        ("end", np.float64, (4,)),
        *((name, np.float64) for name in ("amplitude", "swing", "transversality", "asymmetry")),
        *((name, np.float64) for name in ("closed", "hold_level", "step", "periods", "residual")),
        *((name, np.float64) for name in ("kind", "tilt", "direction")),
        ("peaks", np.float64, (6,)),
        ("ending", np.int64),
        ("by", np.float64, (ROWS, INPUTS)),
    ],
    align=True,
)
"""A number of periods of a motion: the state `end` (NaN if the motion did not arrive); the largest |phi| and
|psi|; the smallest `transversality` of all events, which is 0 if the motion grazes one; the `asymmetry` of
the tilts; whether the mode at the end is that of the start (`closed`); the hold level; the `step` of Newton's
method from its start, in shares of the scales; the `periods` and the `residual` of an orbit to
which a run was moved; the mode at the start (`kind`, `tilt`, `direction`); the largest angles to either side
(`peaks`), see `MOTION`; the outcome (`ending`); and `by`, the derivatives of the end and of these angles, see
`tpd.compiled.legs`."""
Buffers = namedtuple("Buffers", "plants motions workspaces readers cycles settled answers legs")
"""Arrays of records: one plant; four motions (the one that is simulated, an approaching one, the start of a
cycle, and a trial); one workspace; one reader; two cycles; one record `RUN`; one record `STEADY` for an orbit
to which a run may be moved; and the usual number of legs. A record does not keep its array alive, so that
these arrays must live as long as the records are used."""
BEST, LATEST = 0, 1
"""Indices of the best cycle so far and of the latest one."""
SIMULATED, APPROACHING, CYCLE_START, TRIAL = range(4)
"""Indices of the motions: the simulated one, one that approaches an orbit, the start of a cycle, and one for
attempts that may be dropped."""
_RIGHT, _LEFT = range(2)
"""Indices of the largest tilts to either side in `peaks`."""


@compiled
def new_buffers():
    """Allocate the buffers."""
    records = np.empty(1, PLANT), np.zeros(4, MOTION), np.zeros(1, series.WORK), np.zeros(1, READER)
    return Buffers(*records, np.empty(2, CYCLE), np.empty(1, RUN), np.empty(1, STEADY), np.empty(LEGS, LEG))


@part
def records_of(buffers):
    """Return the plant, the simulated motion, the workspace and the reader."""
    return buffers.plants[ONLY], buffers.motions[SIMULATED], buffers.workspaces[ONLY], buffers.readers[ONLY]


@compiled
def _is_same_mode(a, b):
    """Whether two modes are equal. Signs that have no meaning in a mode are not compared."""
    same_side, same_rate = a.kind == REST or a.tilt == b.tilt, a.kind != SLIP or a.direction == b.direction
    return a.kind == b.kind and same_side and same_rate


@compiled
def _follow_periods(q, m, legs, w, limits, periods):
    """Simulate a number of periods under the steady excitation, and return the outcome."""
    reset_counts(m)
    reset_angles(m)
    ended, n = ARRIVED, 0
    while n < periods and ended == ARRIVED:
        m.events = limits.events
        ended = advance(q, harmonic(), m, legs, w, FIRST_PIECE, 0.0, w.period)
        n += 1
    return ended


@compiled
def _include_event_at_end(q, m, legs, w, mode0, again, limits):
    """Add an event that follows at once after the end of the periods, if the motion started after that event.

    Such a motion ends just before the event by rounding. Without the event, start and end would have
    different modes. `again` is another motion.
    """
    n, period = m.n_legs - 1, w.period
    if n < 0 or n + 2 >= len(legs) or _is_same_mode(m, mode0):
        return
    # Simulate the last leg again, a little beyond the end.
    last, start = legs[n : n + 1].copy(), legs[n].start
    set_motion(legs[n].y, legs[n], again)
    reset_counts(again)
    reset_angles(again)
    again.n_legs, again.events = n, limits.events
    advance(q, harmonic(), again, legs, w, FIRST_PIECE, start, (1.0 + _CLOSE) * period)
    # Keep the new legs only if they restore the mode of the start.
    k = min(again.n_legs, len(legs)) - 1
    if not (_is_same_mode(again, mode0) and k > n and legs[k].event == END):
        legs[n] = last[ONLY]
        return
    # Return to the end of the period along the new arc.
    legs[k].duration = period - legs[k].start
    m.transversality, m.n_legs = min(m.transversality, again.transversality), k + 1
    set_motion(again.y, again, m)
    now = np.empty(6)
    store_state_at(q, harmonic(), legs[k], legs[k].duration, w, now)
    for i in range(4):
        m.y[i] = now[i]


@compiled
def follow_cycle(q, m, buffers, limits, periods, c):
    """Simulate a number of periods, and write them into the cycle `c`.

    The simulation starts from the state and the mode of the motion `m`.
    """
    legs, start, (_, _, w, r) = buffers.legs, buffers.motions[CYCLE_START], records_of(buffers)
    set_motion(m.y, m, start)
    c.kind, c.tilt, c.direction = m.kind, m.tilt, m.direction
    ended = _follow_periods(q, m, legs, w, limits, periods)
    # Most motions have a few legs per period. A motion with a rattle is repeated with memory for all of its
    # legs.
    if m.n_legs > len(legs) and ended == ARRIVED:
        legs = np.empty(m.n_legs, LEG)
        set_motion(start.y, start, m)
        ended = _follow_periods(q, m, legs, w, limits, periods)
    # A motion that ends early is no orbit, even if it ends in its initial state.
    sound = ended == ARRIVED
    if sound:
        _include_event_at_end(q, m, legs, w, start, buffers.motions[TRIAL], limits)
        # An angle that the motion never takes has no derivative, and none is used.
        r.by[:] = 0.0
        read_derivatives(q, harmonic(), m, legs, r, limits.directions, NO)
        first, last = limits.directions
        for i in range(ROWS):
            for j in range(first, last):
                c.by[i, j] = r.by[i, j]
    for i in range(4):
        c.end[i] = m.y[i] if sound else math.nan
    copy_to(m.peaks, c.peaks)
    c.amplitude, c.swing, c.transversality = largest(m, TILT), largest(m, SWING), m.transversality
    apart = abs(max(m.peaks[_RIGHT], 0.0) - max(m.peaks[_LEFT], 0.0))
    c.asymmetry = apart / (c.amplitude if c.amplitude > 0.0 else 1.0)
    c.closed = 1.0 if _is_same_mode(m, start) else 0.0
    c.hold_level, c.step, c.periods, c.ending = m.hold_level, 0.0, 0.0, ended
    # Without an end the record still holds the derivatives of the cycle before.
    if not sound:
        c.by[:] = math.nan


@compiled
def eliminate(a, b):
    """Solve a x = b in place, by elimination with pivots.

    The matrix is 4 x 4, and b has shape (4, n).

    Returns the absolute value of the smallest pivot, or 0 if the matrix is singular or a result is not
    finite.
    """
    # Numba's own solver takes seconds to compile, and raises an exception for a singular matrix. Here this
    # case is common: I - DP has no inverse at a fold.
    smallest, n = math.inf, b.shape[1]
    for c in range(4):
        pivot = c
        for r in range(c + 1, 4):
            if abs(a[r, c]) > abs(a[pivot, c]):
                pivot = r
        if not abs(a[pivot, c]) > 0.0:
            return 0.0
        smallest = min(smallest, abs(a[pivot, c]))
        for k in range(4):
            a[c, k], a[pivot, k] = a[pivot, k], a[c, k]
        for k in range(n):
            b[c, k], b[pivot, k] = b[pivot, k], b[c, k]
        for r in range(c + 1, 4):
            # Subtract the pivot row from the rows below.
            share = a[r, c] / a[c, c]
            for k in range(c, 4):
                a[r, k] -= share * a[c, k]
            for k in range(n):
                b[r, k] -= share * b[c, k]
    for j in range(n):
        # Back substitution.
        for c in range(3, -1, -1):
            for k in range(c + 1, 4):
                b[c, j] -= a[c, k] * b[k, j]
            b[c, j] /= a[c, c]
    return smallest if math.isfinite(b[0, 0] + b[1, 0] + b[2, 0] + b[3, 0]) else 0.0


@compiled
def solve_linearised(by, right):
    """Solve (I - DP) x = right, and write x into `right`, shape (4, n). Return whether the matrix is regular.

    `by` holds DP in its columns from `STATE` on.
    """
    matrix = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            matrix[i, j] = (1.0 if i == j else 0.0) - by[i, STATE + j]
    return eliminate(matrix, right) > 0.0


@compiled
def residual_of(q, y, end):
    """Return the largest difference between both ends of a cycle, in shares of the scales.

    The result is NaN if the motion has not arrived at the end.
    """
    scales, worst = repetition.scales_of(q), 0.0
    for i in range(4):
        # The state of a massless undamped bob never settles, and does not matter for the block.
        if i % 2 == 0 or q.mu > 0.0 or q.zeta > 0.0:
            worst = max(worst, abs(end[i] - y[i]) / scales[i])
    return worst if is_finite(end) else math.nan


@compiled
def find_orbit(q, m, buffers, limits, periods, y):
    """Solve for an orbit by Newton's method, and return the residual.

    The iteration starts from the state `y` and the mode of the motion `m`.

    The start of the best orbit is written into `y`, and its cycle is the best one of the buffers.
    """
    c, now, move, scales = buffers.cycles[LATEST], np.empty(4), np.empty((4, 1)), repetition.scales_of(q)
    error, residual, steps = math.inf, math.inf, 0
    copy_to(y, now)
    while steps < NEWTON_STEPS and error > _ROUND_OFF:
        kind, tilt, direction = m.kind, m.tilt, m.direction
        copy_to(now, m.y)
        follow_cycle(q, m, buffers, limits, periods, c)
        new_residual = residual_of(q, now, c.end)
        # Only a motion that ends in the mode of its start is an orbit.
        raised = new_residual + (0.0 if c.closed != 0.0 else 0.5 * RESIDUAL)
        steps += 1
        # Far from an orbit Newton's method would use up all steps, and converge to another orbit.
        if not new_residual < limits.reach:
            break
        if raised < error:
            error, residual = raised, new_residual
            copy_to(now, y)
            # An orbit may have an event at tau = 0, as every conservative orbit does. By rounding it starts
            # and ends on either side of the event. If it starts before the event and ends after it, the
            # simulation counts the event twice, and in the opposite case not at all. Both leave the state
            # right and its derivative wrong. A simulation that starts in the mode in which the last one ended
            # counts the event once.
            for i in range(4):
                move[i, ONLY] = c.end[i] - now[i]
            if solve_linearised(c.by, move):
                for i in range(4):
                    now[i] += move[i, ONLY]
                    c.step = max(c.step, abs(move[i, ONLY]) / scales[i])
            buffers.cycles[BEST] = c
        elif error < math.inf and buffers.cycles[BEST].step > LAST_STEP:
            # The last step did not improve the residual. By rounding a map may miss an event that reverts
            # soon, and next to a fold a step may be too long. Try half of the step once more, in the mode in
            # which the last simulation started.
            m.kind, m.tilt, m.direction = kind, tilt, direction
            for i in range(4):
                now[i] = 0.5 * (now[i] + y[i])
        else:
            break
    return residual


@compiled
def multipliers(q, by, roots):
    """Compute the Floquet multipliers that matter for the block, and write them into `roots`.

    These are all of them unless mu = 0.

    Returns the largest modulus, the smallest distance of a multiplier from +1, and the product of all 1 -
    multiplier.
    """
    felt, largest, nearest = np.empty((4, 4)), 0.0, math.inf
    for i in range(4):
        for j in range(4):
            # A massless bob does not act on the block.
            unfelt = q.mu == 0.0 and (i % 2 == 1 or j % 2 == 1)
            felt[i, j] = 0.0 if unfelt else by[i, STATE + j]
            if not math.isfinite(felt[i, j]):
                return math.inf, 1.0, math.nan
    polynomial = characteristic(felt)
    store_roots(polynomial, roots)
    for i in range(4):
        largest, nearest = max(largest, abs(roots[i])), min(nearest, abs(1.0 - roots[i]))
    fold, _, _ = determinants(polynomial)
    return largest, nearest, fold
