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
from tpd.exact.follow import ARRIVED, Rules, allow, begin, piece
from tpd.exact.half_map_kernel import characteristic, determinants, put_roots
from tpd.exact.legs import INPUTS, READER, ROWS, STATE, read
from tpd.exact.motion import (
    FIRST_PIECE,
    LEG,
    LEGS,
    MOTION,
    NO,
    ROOM,
    YES,
    clear,
    finite,
    largest,
    put,
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
        *((name, np.float64) for name in ("amplitude", "swing", "crossing", "asymmetry")),
        *((name, np.float64) for name in ("closed", "held", "step")),
        ("best", np.float64, (6,)),
        ("how", np.int64),
        ("by", np.float64, (ROWS, INPUTS)),
    ],
    align=True,
)
"""Some periods of a motion, see `tpd.models.base.Cycle`: the state at the end, no numbers if the motion was
lost; the largest |phi| and |psi|; the least transversality, the asymmetry, whether the mode at the end is
that of the start, for how long the block was held, and the step of Newton's method from its start, in shares
of the scales; the largest angles to either side, see `MOTION`; how
the motion ended; and the derivatives of the end and of these angles, see `tpd.exact.legs`."""
Own = namedtuple("Own", "plants motions rooms readers cycles settled legs")
"""Memory of records: a plant, three motions (one that is followed, one on its way to an orbit, and the start
of a cycle), a room, a reader, two cycles, what a motion settles to, and the usual legs. A record does not
keep its memory: it is alive as long as these arrays are."""
BEST, SPARE = 0, 1
"""Places of the best cycle so far and of the last one."""
ON_ITS_WAY, BEGUN = 1, 2
"""Places of a motion on its way to an orbit and of the start of a cycle, after that of a followed motion."""
ONLY = np.int64(0)
"""Column of the only right-hand side of a step."""


@compiled
def memory():
    """New memory."""
    plants, motions, rooms = np.empty(1, PLANT), np.zeros(3, MOTION), np.zeros(1, ROOM)
    cycles, settled, legs = np.empty(2, CYCLE), np.empty(1, repetition.SETTLED), np.empty(LEGS, LEG)
    return Own(plants, motions, rooms, np.zeros(1, READER), cycles, settled, legs)


@part
def first_of(own):
    """Plant, motion, room and reader."""
    return own.plants[0], own.motions[0], own.rooms[0], own.readers[0]


@compiled
def put_motion(y, mode, m):
    """Put a state and a mode into a motion."""
    put(y, m.y)
    m.kind, m.tilt, m.way = mode.kind, mode.tilt, mode.way


@compiled
def _same_mode(a, b):
    """Whether two modes are the same, signs without meaning left aside."""
    tilts, goes = a.kind == REST or a.tilt == b.tilt, a.kind != SLIP or a.way == b.way
    return a.kind == b.kind and tilts and goes


@compiled
def follow_periods(q, f, m, legs, room, limits, periods):
    """Follow so many periods of steady shaking, and return how the motion ended."""
    clear(m)
    begin(q, f, m, FIRST_PIECE, 0.0)
    rules, ended, n = Rules(limits.capture, YES, NO, NO), ARRIVED, 0
    while n < periods and ended == ARRIVED:
        allow(m, room, limits.events)
        ended = piece(q, f, m, legs, room, FIRST_PIECE, 0.0, span_of(q, f), rules)
        n += 1
    return ended


@compiled
def _meet_at_end(q, f, m, legs, room, mode0, limits):
    """If a motion has followed its periods short of an event that comes at once, and began after that
    event: take the event as well."""
    n, period, again = m.recorded - 1, span_of(q, f), room.other
    if n < 0 or n + 2 >= len(legs) or _same_mode(m, mode0):
        return
    # The last leg once more, a little further.
    last, begun = legs[n : n + 1].copy(), legs[n].begun
    put_motion(legs[n].y, legs[n], again)
    clear(again)
    begin(q, f, again, FIRST_PIECE, begun)
    again.recorded = n
    allow(again, room, limits.events)
    rules = Rules(limits.capture, YES, NO, NO)
    piece(q, f, again, legs, room, FIRST_PIECE, begun, (1.0 + _CLOSE) * period, rules)
    k = min(again.recorded, len(legs)) - 1
    if not (_same_mode(again, mode0) and k > n and legs[k].which == END):
        legs[n] = last[0]
        return
    # Back to the end of the period along the new arc.
    at = legs[k]
    at.lasted, e = period - at.begun, load_at(q, f, FIRST_PIECE, at.begun)
    arc = arc_from(q, at, at.y, e)
    m.crossing, m.recorded = min(m.crossing, again.crossing), k + 1
    put_motion(state_at(arc, instant(arc, at.lasted), at.lasted), again, m)


@compiled
def forget(c):
    """Forget the derivatives of a cycle."""
    for i in range(ROWS):
        for j in range(INPUTS):
            c.by[i, j] = math.nan


@compiled
def cycle(q, m, own, limits, periods, c):
    """Follow so many periods from the state and mode of a motion into the cycle `c`."""
    f, legs, start, (_, _, room, r) = steady(np.empty((0, 4))), own.legs, own.motions[BEGUN], first_of(own)
    put_motion(m.y, m, start)
    ended = follow_periods(q, f, m, legs, room, limits, periods)
    # Most motions have a few legs a period; one that rattles is followed once more with room for all.
    if m.recorded > len(legs) and ended == ARRIVED:
        legs = np.empty(m.recorded, LEG)
        put_motion(start.y, start, m)
        ended = follow_periods(q, f, m, legs, room, limits, periods)
    # What ended before its period is no orbit, though it may end where it began.
    sound = ended == ARRIVED
    if sound:
        _meet_at_end(q, f, m, legs, room, start, limits)
        read(q, f, m, legs, r, (limits.first, INPUTS), NO, c.by)
    for i in range(4):
        c.end[i] = m.y[i] if sound else math.nan
    put(m.best, c.best)
    c.amplitude, c.swing, c.crossing = largest(m, TILT), largest(m, SWING), m.crossing
    c.asymmetry = abs(max(m.best[0], 0.0) - max(m.best[1], 0.0)) / (c.amplitude if c.amplitude > 0.0 else 1.0)
    c.closed, c.held, c.step, c.how = (1.0 if _same_mode(m, start) else 0.0), m.held, 0.0, ended
    # What stands there is of the cycle before.
    if not sound:
        forget(c)


@compiled
def eliminate(a, b):
    """Solve a x = b in place for a 4 x 4 matrix and several right-hand sides, shape (4, n), by elimination
    with pivots; return the size of the smallest pivot, 0 if there is none or no number."""
    # Numba's own solver takes seconds to compile, and a singular matrix is an error there. Here it is usual:
    # I - DP has no inverse at a fold.
    least, n = math.inf, b.shape[1]
    for c in range(4):
        pivot = c
        for r in range(c + 1, 4):
            if abs(a[r, c]) > abs(a[pivot, c]):
                pivot = r
        if not abs(a[pivot, c]) > 0.0:
            return 0.0
        least = min(least, abs(a[pivot, c]))
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
    return least if math.isfinite(b[0, 0] + b[1, 0] + b[2, 0] + b[3, 0]) else 0.0


@compiled
def solved(by, right):
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
    return worst if finite(end) else math.nan


@compiled
def find_orbit(q, m, own, limits, periods, y):
    """Newton's method from the state `y` with the mode of the motion `m`. Leave the start of the best orbit
    in `y` and its cycle in the first of two, and return its residual."""
    c, now, move, scales = own.cycles[SPARE], np.empty(4), np.empty((4, 1)), repetition.scales_of(q)
    error, residual, steps = math.inf, math.inf, 0
    put(y, now)
    while steps < NEWTON_STEPS and error > _ROUND_OFF:
        kind, tilt, way = m.kind, m.tilt, m.way
        put(now, m.y)
        cycle(q, m, own, limits, periods, c)
        found = residual_of(q, now, c.end)
        # Only a motion that ends in the mode in which it began is an orbit.
        raised = found + (0.0 if c.closed != 0.0 else 0.5 * RESIDUAL)
        steps += 1
        # A motion that is far from an orbit would spend all steps and come to another one.
        if not found < limits.reach:
            break
        if raised < error:
            error, residual = raised, found
            put(now, y)
            # An orbit that meets an event at tau = 0, such as every conservative one, comes out on either
            # side of it by rounding. Begun before the event and ended after it, the run counts the event
            # twice, the other way round not at all: both leave the state right and its derivative wrong. A
            # run that begins in the mode in which the last one ended meets it once.
            for i in range(4):
                move[i, ONLY] = c.end[i] - now[i]
            if solved(c.by, move):
                for i in range(4):
                    now[i] += move[i, ONLY]
                    c.step = max(c.step, abs(move[i, ONLY]) / scales[i])
            own.cycles[BEST] = c
        elif error < math.inf and own.cycles[BEST].step > LAST_STEP:
            # By rounding a map may miss an event that undoes itself soon, and next to a fold a step may be
            # too long: half of a step that led away tries once more, in the mode in which the last one began.
            m.kind, m.tilt, m.way = kind, tilt, way
            for i in range(4):
                now[i] = 0.5 * (now[i] + y[i])
        else:
            break
    return residual


@compiled
def multipliers(q, by, roots):
    """Put the Floquet multipliers that the block can feel (all, unless mu = 0) into `roots`; return the
    largest modulus, the least distance of one from +1, and the product of all 1 - multiplier."""
    felt, largest, apart = np.empty((4, 4)), 0.0, math.inf
    for i in range(4):
        for j in range(4):
            unfelt = q.mu == 0.0 and (i % 2 == 1 or j % 2 == 1)
            felt[i, j] = 0.0 if unfelt else by[i, STATE + j]
            if not math.isfinite(felt[i, j]):
                return math.inf, 1.0, math.nan
    polynomial = characteristic(felt)
    put_roots(polynomial, roots)
    for i in range(4):
        largest, apart = max(largest, abs(roots[i])), min(apart, abs(1.0 - roots[i]))
    fold, _, _ = determinants(polynomial)
    return largest, apart, fold
