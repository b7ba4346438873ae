"""Newton's method on the map of some forcing periods, in compiled code.

It is the one way to a periodic orbit of the exact model: while a motion settles (`tpd.exact.near_orbits`),
when it has settled, and from any state near an orbit (`tpd.exact.steady`).

With P the map from the state at tau = 0 to that some periods later, a periodic orbit is y* = P(y*), and
Newton's step solves (I - DP) dy = P(y) - y. As the parameters move, so does the orbit, dy*/dp = (I - DP)^-1
dP/dp. `tpd.answers.period_map` has the same rules in JAX, for models that are programs of JAX.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact import repetition
from tpd.exact.arcs import arc_from, instant, load_at, span_of, state_at, steady
from tpd.exact.events import END
from tpd.exact.follow import ARRIVED, Rules, allow_events, follow_piece, start_angles
from tpd.exact.half_map_kernel import characteristic, determinants, store_roots
from tpd.exact.legs import INPUTS, READER, ROWS, STATE, read_derivatives
from tpd.exact.motion import (
    FIRST_PIECE,
    LEG,
    LEGS,
    MOTION,
    NO,
    WORKSPACE,
    YES,
    copy_to,
    is_finite,
    largest,
    reset_counts,
)
from tpd.exact.plant import PLANT, compiled, part
from tpd.exact.terms import LAST_STEP, NEWTON_STEPS, RESIDUAL, REST, SLIP, SWING, TILT

_CLOSE = 1e-9
"""Share of a period by which an event may come too late, near an orbit on which it is within the period."""
_ROUND_OFF = 1e-14
"""Residual of the map that counts as round-off."""
Limits = namedtuple("Limits", "capture events first reach")
"""Largest speed of an impact that may end in rest, events allowed in a forcing period, the first of the
directions that have derivatives, and the largest residual from which Newton's method goes on."""
CYCLE = np.dtype(
    [
        ("end", np.float64, (4,)),
        *((name, np.float64) for name in ("amplitude", "swing", "transversality", "asymmetry")),
        *((name, np.float64) for name in ("closed", "hold_level", "step")),
        ("extremes", np.float64, (6,)),
        ("ending", np.int64),
        ("by", np.float64, (ROWS, INPUTS)),
    ],
    align=True,
)
"""Some periods of a motion, see `tpd.models.base.Cycle`: the state at the end, no numbers if the motion was
lost; the largest |phi| and |psi|; the least transversality, the asymmetry, whether the mode at the end is
that of the start, for how long the block was held, and the step of Newton's method from its start, in shares
of the scales; the largest angles to either side, see `MOTION`; how
the motion ended; and the derivatives of the end and of these angles, see `tpd.exact.legs`."""
Buffers = namedtuple("Buffers", "plants motions workspaces readers cycles settled legs")
"""Memory of records: a plant, three motions (one that is followed, one on its way to an orbit, and the start
of a cycle), a room, a reader, two cycles, what a motion settles to, and the usual legs. A record does not
keep its memory: it is alive as long as these arrays are."""
BEST, LATEST = 0, 1
"""Places of the best cycle so far and of the last one."""
APPROACHING, CYCLE_START = 1, 2
"""Places of a motion on its way to an orbit and of the start of a cycle, after that of a followed motion."""
ONLY = np.int64(0)
"""Column of the only right-hand side of a step."""


@compiled
def new_buffers():
    """New memory."""
    plants, motions, workspaces = np.empty(1, PLANT), np.zeros(3, MOTION), np.zeros(1, WORKSPACE)
    cycles, settled, legs = np.empty(2, CYCLE), np.empty(1, repetition.SETTLED), np.empty(LEGS, LEG)
    return Buffers(plants, motions, workspaces, np.zeros(1, READER), cycles, settled, legs)


@part
def records_of(buffers):
    """Plant, motion, room and reader."""
    return buffers.plants[0], buffers.motions[0], buffers.workspaces[0], buffers.readers[0]


@compiled
def set_motion(y, mode, m):
    """Put a state and a mode into a motion."""
    copy_to(y, m.y)
    m.kind, m.tilt, m.direction = mode.kind, mode.tilt, mode.direction


@compiled
def _is_same_mode(a, b):
    """Whether two modes are the same, signs without meaning left aside."""
    same_side, same_rate = a.kind == REST or a.tilt == b.tilt, a.kind != SLIP or a.direction == b.direction
    return a.kind == b.kind and same_side and same_rate


@compiled
def follow_periods(q, f, m, legs, w, limits, periods):
    """Follow so many periods of steady shaking, and return how the motion ended."""
    reset_counts(m)
    start_angles(q, f, m, FIRST_PIECE, 0.0)
    rules, ended, n = Rules(limits.capture, YES, NO, NO), ARRIVED, 0
    while n < periods and ended == ARRIVED:
        allow_events(m, w, limits.events)
        ended = follow_piece(q, f, m, legs, w, FIRST_PIECE, 0.0, span_of(q, f), rules)
        n += 1
    return ended


@compiled
def _include_event_at_end(q, f, m, legs, w, mode0, limits):
    """If a motion has followed its periods short of an event that comes at once, and began after that
    event: take the event as well."""
    n, period, again = m.leg_count - 1, span_of(q, f), w.trial
    if n < 0 or n + 2 >= len(legs) or _is_same_mode(m, mode0):
        return
    # The last leg once more, a little further.
    last, begun = legs[n : n + 1].copy(), legs[n].start
    set_motion(legs[n].y, legs[n], again)
    reset_counts(again)
    start_angles(q, f, again, FIRST_PIECE, begun)
    again.leg_count = n
    allow_events(again, w, limits.events)
    rules = Rules(limits.capture, YES, NO, NO)
    follow_piece(q, f, again, legs, w, FIRST_PIECE, begun, (1.0 + _CLOSE) * period, rules)
    k = min(again.leg_count, len(legs)) - 1
    if not (_is_same_mode(again, mode0) and k > n and legs[k].event == END):
        legs[n] = last[0]
        return
    # Back to the end of the period along the new arc.
    at = legs[k]
    at.duration, e = period - at.start, load_at(q, f, FIRST_PIECE, at.start)
    arc = arc_from(q, at, at.y, e)
    m.transversality, m.leg_count = min(m.transversality, again.transversality), k + 1
    set_motion(state_at(arc, instant(arc, at.duration), at.duration), again, m)


@compiled
def clear_derivatives(c):
    """Forget the derivatives of a cycle."""
    for i in range(ROWS):
        for j in range(INPUTS):
            c.by[i, j] = math.nan


@compiled
def follow_cycle(q, m, buffers, limits, periods, c):
    """Follow so many periods from the state and mode of a motion into the cycle `c`."""
    f = steady(np.empty((0, 4)))
    legs, start, (_, _, w, r) = buffers.legs, buffers.motions[CYCLE_START], records_of(buffers)
    set_motion(m.y, m, start)
    ended = follow_periods(q, f, m, legs, w, limits, periods)
    # Most motions have a few legs a period; one that rattles is followed once more with room for all.
    if m.leg_count > len(legs) and ended == ARRIVED:
        legs = np.empty(m.leg_count, LEG)
        set_motion(start.y, start, m)
        ended = follow_periods(q, f, m, legs, w, limits, periods)
    # What ended before its period is no orbit, though it may end where it began.
    sound = ended == ARRIVED
    if sound:
        _include_event_at_end(q, f, m, legs, w, start, limits)
        read_derivatives(q, f, m, legs, r, (limits.first, INPUTS), NO, c.by)
    for i in range(4):
        c.end[i] = m.y[i] if sound else math.nan
    copy_to(m.extremes, c.extremes)
    c.amplitude, c.swing, c.transversality = largest(m, TILT), largest(m, SWING), m.transversality
    c.asymmetry = abs(max(m.extremes[0], 0.0) - max(m.extremes[1], 0.0)) / (
        c.amplitude if c.amplitude > 0.0 else 1.0
    )
    c.closed = 1.0 if _is_same_mode(m, start) else 0.0
    c.hold_level, c.step, c.ending = m.hold_level, 0.0, ended
    # What stands there is of the cycle before.
    if not sound:
        clear_derivatives(c)


@compiled
def eliminate(a, b):
    """Solve a x = b in place for a 4 x 4 matrix and several right-hand sides, shape (4, n), by elimination
    with pivots; return the size of the smallest pivot, 0 if there is none or no number."""
    # Numba's own solver takes seconds to compile, and a singular matrix is an error there. Here it is usual:
    # I - DP has no inverse at a fold.
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
            share = a[r, c] / a[c, c]
            for k in range(c, 4):
                a[r, k] -= share * a[c, k]
            for k in range(n):
                b[r, k] -= share * b[c, k]
    for j in range(n):
        for c in range(3, -1, -1):
            for k in range(c + 1, 4):
                b[c, j] -= a[c, k] * b[k, j]
            b[c, j] /= a[c, c]
    return smallest if math.isfinite(b[0, 0] + b[1, 0] + b[2, 0] + b[3, 0]) else 0.0


@compiled
def solve_linearised(by, right):
    """Whether (I - DP) x = right, shape (4, n), has a solution, which is put into `right`; DP is in `by`."""
    matrix = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            matrix[i, j] = (1.0 if i == j else 0.0) - by[i, STATE + j]
    return eliminate(matrix, right) > 0.0


@compiled
def residual_of(q, y, end):
    """Largest difference between the ends of a cycle, over the scales; no number if the motion was lost."""
    scales, worst = repetition.scales_of(q), 0.0
    for i in range(4):
        # Of a bob that does nothing the swing decides nothing.
        if i % 2 == 0 or q.mu > 0.0 or q.zeta > 0.0:
            worst = max(worst, abs(end[i] - y[i]) / scales[i])
    return worst if is_finite(end) else math.nan


@compiled
def find_orbit(q, m, buffers, limits, periods, y):
    """Newton's method from the state `y` with the mode of the motion `m`. Leave the start of the best orbit
    in `y` and its cycle in the first of two, and return its residual."""
    c, now, move, scales = buffers.cycles[LATEST], np.empty(4), np.empty((4, 1)), repetition.scales_of(q)
    error, residual, steps = math.inf, math.inf, 0
    copy_to(y, now)
    while steps < NEWTON_STEPS and error > _ROUND_OFF:
        kind, tilt, direction = m.kind, m.tilt, m.direction
        copy_to(now, m.y)
        follow_cycle(q, m, buffers, limits, periods, c)
        new_residual = residual_of(q, now, c.end)
        # Only a motion that ends in the mode in which it began is an orbit.
        raised = new_residual + (0.0 if c.closed != 0.0 else 0.5 * RESIDUAL)
        steps += 1
        # A motion that is far from an orbit would spend all steps and come to another one.
        if not new_residual < limits.reach:
            break
        if raised < error:
            error, residual = raised, new_residual
            copy_to(now, y)
            # An orbit that meets an event at tau = 0, such as every conservative one, comes out on either
            # side of it by rounding. Begun before the event and ended after it, the run counts the event
            # twice, the other way round not at all: both leave the state right and its derivative wrong. A
            # run that begins in the mode in which the last one ended meets it once.
            for i in range(4):
                move[i, ONLY] = c.end[i] - now[i]
            if solve_linearised(c.by, move):
                for i in range(4):
                    now[i] += move[i, ONLY]
                    c.step = max(c.step, abs(move[i, ONLY]) / scales[i])
            buffers.cycles[BEST] = c
        elif error < math.inf and buffers.cycles[BEST].step > LAST_STEP:
            # By rounding a map may miss an event that undoes itself soon, and next to a fold a step may be
            # too long: half of a step that led away tries once more, in the mode in which the last one began.
            m.kind, m.tilt, m.direction = kind, tilt, direction
            for i in range(4):
                now[i] = 0.5 * (now[i] + y[i])
        else:
            break
    return residual


@compiled
def multipliers(q, by, roots):
    """Put the Floquet multipliers that the block can feel (all, unless mu = 0) into `roots`; return the
    largest modulus, the least distance of one from +1, and the product of all 1 - multiplier."""
    felt, largest, nearest = np.empty((4, 4)), 0.0, math.inf
    for i in range(4):
        for j in range(4):
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
