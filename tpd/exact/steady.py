"""The steady state of a motion that has been followed: Newton's method on the map of its periods, what the
multipliers say, and the derivatives of an isolated orbit.

The rules are those of `tpd.answers.steady_state` and `tpd.answers.period_map`, which every other model
goes by; only here is an orbit told with the fewest periods after which it closes."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact import repetition
from tpd.exact.half_map_kernel import characteristic, is_neutral, put_roots
from tpd.exact.legs import INPUTS, READER, STATE
from tpd.exact.motion import LEG, LEGS, MOTION, ROOM, finite, put
from tpd.exact.near_orbits import CYCLE, STEP_OF_NEWTON, Limits, cycle, eliminate
from tpd.exact.plant import PLANT, compiled, part, places, put_plants
from tpd.exact.settle import settle
from tpd.exact.terms import APERIODIC, GRAZING, MANY, NEAR_FOLD, RESIDUAL, SYMMETRIC

WANDERS, UNSTABLE, NEUTRAL, FOLD, GRAZED = range(8, 13)
"""Numbers of statuses after those of `tpd.exact.repetition`, see `tpd.exact.terms.STEADY_STATUSES`."""
STEADY = np.dtype(
    [
        *((name, np.float64) for name in ("amplitude", "stroke")),
        ("y", np.float64, (4,)),
        *((name, np.float64) for name in ("multiplier", "lyapunov")),
        *((name, np.float64) for name in ("status", "periods", "symmetric", "elapsed")),
        ("by", np.float64, (6, MANY)),
    ],
    align=True,
)
"""A steady state, see `tpd.answers.steady_state.Steady`, and the derivatives of its first six numbers in the
parameters, NaN where there are none."""
Own = namedtuple("Own", "plants motions rooms readers cycles settled legs")
"""Memory of records: a plant, a motion and its start, two rooms, a reader, two cycles, what a motion settles
to, and the usual legs. A record does not keep its memory: it is alive as long as these arrays are."""
_BEST, SPARE = 0, 1
"""Places of the best cycle so far and of the last one, and of the start of that."""
_RESIDUAL = np.int64(MANY)
"""Column of the residual of an orbit's map, after those of the parameters."""
_AMPLITUDE, _STROKE = places(2)
"""Rows of the derivatives of a steady state: of its sizes, before those of the state."""
_NEWTON_STEPS, _ROUND_OFF = 8, 1e-14
"""Bound on the steps of Newton's method, and residual of the map that counts as round-off."""


@compiled
def memory():
    """New memory."""
    plants, motions, rooms = np.empty(1, PLANT), np.zeros(2, MOTION), np.zeros(2, ROOM)
    cycles, settled, legs = np.empty(2, CYCLE), np.empty(1, repetition.SETTLED), np.empty(LEGS, LEG)
    return Own(plants, motions, rooms, np.zeros(1, READER), cycles, settled, legs)


@part
def first_of(own):
    """Plant, motion, room and reader."""
    return own.plants[0], own.motions[0], own.rooms[0], own.readers[0]


@compiled
def _solved(by, right):
    """Whether (I - DP) x = right, shape (4, n), has a solution, which is put into `right`; DP is in `by`."""
    matrix = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            matrix[i, j] = (1.0 if i == j else 0.0) - by[i, STATE + j]
    return eliminate(matrix, right) > 0.0


@compiled
def _residual(q, y, end):
    """Largest difference between the ends of a cycle, over the scales; no number if the motion was lost."""
    scales, worst = repetition.scales_of(q), 0.0
    for i in range(4):
        # Of a bob that does nothing the swing decides nothing.
        if i % 2 == 0 or q.mu > 0.0 or q.zeta > 0.0:
            worst = max(worst, abs(end[i] - y[i]) / scales[i])
    return worst if finite(end) else math.nan


@compiled
def _find_orbit(q, m, own, limits, y):
    """Newton's method from the state `y` with the mode of the motion `m`. Leave the start of the best orbit
    in `y` and its cycle in the first of two, and return its residual."""
    (_, _, room, r), start, c = first_of(own), own.motions[SPARE], own.cycles[SPARE]
    now, move = np.empty(4), np.empty((4, 1))
    error, residual, steps = math.inf, math.inf, 0
    put(y, now)
    while steps < _NEWTON_STEPS and error > _ROUND_OFF:
        kind, tilt, way = m.kind, m.tilt, m.way
        put(now, m.y)
        cycle(q, m, own.legs, room, r, limits, start, c)
        found = _residual(q, now, c.end)
        # Only a motion that ends in the mode in which it began is an orbit.
        raised = found + (0.0 if c.closed != 0.0 else 0.5 * RESIDUAL)
        steps += 1
        if raised < error:
            error, residual = raised, found
            put(now, y)
            own.cycles[_BEST] = c
            # An orbit that meets an event at tau = 0, such as every conservative one, comes out on either
            # side of it by rounding. Begun before the event and ended after it, the run counts the event
            # twice, the other way round not at all: both leave the state right and its derivative wrong. A
            # run that begins in the mode in which the last one ended meets it once.
            for i in range(4):
                move[i, STEP_OF_NEWTON] = c.end[i] - now[i]
            if _solved(c.by, move):
                for i in range(4):
                    now[i] += move[i, STEP_OF_NEWTON]
        elif RESIDUAL < error < math.inf:
            # By rounding a map may miss an event that undoes itself soon: half of a step that led away tries
            # once more, in the mode in which the last one began.
            m.kind, m.tilt, m.way = kind, tilt, way
            for i in range(4):
                now[i] = 0.5 * (now[i] + y[i])
        else:
            break
    return residual


@compiled
def _separation(q, m, own, limits, periods, y):
    """Follow a motion that did not repeat from the state `y`: its largest Lyapunov exponent, no number if it
    ends at once. Leave the start of its last cycle in `y`, and that cycle in the first of two, with the
    largest sizes of all."""
    (_, _, room, r), best, scales = first_of(own), own.cycles[_BEST], repetition.scales_of(q)
    c, start = own.cycles[SPARE], own.motions[SPARE]
    direction, onward, parted, steps = np.empty(4), np.empty(4), 0.0, 0
    for i in range(4):
        # Of a bob without mass nothing is felt.
        scales[i] = scales[i] if i % 2 == 0 or q.mu > 0.0 else 1e300
        direction[i] = 0.5 * scales[i]
    while steps < periods:
        cycle(q, m, own.legs, room, r, limits, start, c)
        if not finite(c.end):
            break
        c.amplitude, c.stroke = max(c.amplitude, best.amplitude), max(c.stroke, best.stroke)
        size = 0.0
        for i in range(4):
            onward[i] = 0.0
            for j in range(4):
                onward[i] += c.by[i, STATE + j] * direction[j]
            size += (onward[i] / scales[i]) ** 2
        size = math.sqrt(size) + 1e-300
        for i in range(4):
            direction[i] = onward[i] / size
        parted, steps = parted + math.log(size), steps + 1
        put(start.y, y)
        own.cycles[_BEST] = c
    return parted / (steps * 2.0 * math.pi / q.xi) if steps > 1 else math.nan


@compiled
def _multipliers(q, by):
    """Largest modulus of the Floquet multipliers that the block can feel (all, unless mu = 0), and the least
    distance of one from +1."""
    felt, roots, largest, apart = np.empty((4, 4)), np.empty(4, np.complex128), 0.0, math.inf
    for i in range(4):
        for j in range(4):
            unfelt = q.mu == 0.0 and (i % 2 == 1 or j % 2 == 1)
            felt[i, j] = 0.0 if unfelt else by[i, STATE + j]
            if not math.isfinite(felt[i, j]):
                return math.inf, 1.0
    put_roots(characteristic(felt), roots)
    for i in range(4):
        largest, apart = max(largest, abs(roots[i])), min(apart, abs(1.0 - roots[i]))
    return largest, apart


@compiled
def verdict(begun, residual, separation, multiplier, to_fold, crossing, neutral):
    """Number of the status of a motion, from that with which following it has ended, and from what Newton's
    method on its period map has found."""
    # From the weakest statement to the strongest: each line overrules those above it. Stability comes first,
    # because its numbers mean nothing if an event was grazed, next to a fold, or off an orbit.
    moving = begun in (repetition.ROCKING, repetition.STICKING)
    status = UNSTABLE if moving and multiplier > 1.0 else begun
    status = NEUTRAL if moving and neutral else status
    status = GRAZED if moving and crossing < GRAZING else status
    status = FOLD if moving and to_fold < 2.0 * NEAR_FOLD else status
    status = repetition.NOT_SETTLED if moving and not residual < RESIDUAL else status
    return WANDERS if separation > APERIODIC else status


@compiled
def _put_isolated(c, y, out):
    """Put the sizes of an isolated orbit after one more Newton step into `out`, and all slopes."""
    # y*(p) = P(y*(p), p), hence dy*/dp = (I - DP)^-1 dP/dp, however long the transient was; both sizes are
    # functions of (y*, p) along the period. The residual is one more right-hand side, so that they gain the
    # last Newton step for nothing. I - DP is singular at a fold: there the caller refuses slopes.
    right, sizes = np.empty((4, _RESIDUAL + 1)), np.empty((2, _RESIDUAL + 1))
    for i in range(4):
        right[i, _RESIDUAL] = c.end[i] - y[i]
        for j in range(MANY):
            right[i, j] = c.by[i, j]
    solved = _solved(c.by, right)
    for k in range(2):
        for j in range(_RESIDUAL + 1):
            sizes[k, j] = c.by[4 + k, j] if j < _RESIDUAL else (c.amplitude if k == 0 else c.stroke)
            for i in range(4):
                sizes[k, j] += c.by[4 + k, STATE + i] * right[i, j]
            if not solved:
                sizes[k, j] = math.nan
    out.amplitude, out.stroke = sizes[_AMPLITUDE, _RESIDUAL], sizes[_STROKE, _RESIDUAL]
    for k in range(6):
        for j in range(MANY):
            out.by[k, j] = sizes[k, j] if k < 2 else right[k - 2, j]


@compiled
def steady_state(x, y0, s, own, out):
    """Follow a motion from `y0` at tau = 0 until it settles, within the bounds of the settings `s`, and put
    its steady state into the record `out`."""
    (q, m, room, r), c, found, y, total = first_of(own), own.cycles[_BEST], own.settled[0], out.y, 0.0
    out.amplitude = out.stroke = out.multiplier = out.lyapunov = math.nan
    out.symmetric, out.elapsed, out.periods, out.status = 0.0, 0.0, 1.0, repetition.FAILED
    for j in range(MANY):
        total += abs(x[j])
        for i in range(6):
            out.by[i, j] = math.nan
    for i in range(4):
        total += abs(y0[i])
    put(y0, m.y)
    put(y0, y)
    # What is fed with numbers that are none would be followed until its bound.
    if not math.isfinite(total):
        return
    settle(x, q, m, room, r, s, 0.0, 0.0, found)
    begun, periods, out.elapsed = int(found.status), int(found.periods), found.elapsed
    put(m.y, y)
    residual, separation, multiplier, to_fold = math.inf, math.nan, math.inf, 1.0
    c.amplitude, c.stroke, c.crossing, c.asymmetry = found.amplitude, found.stroke, math.inf, math.inf
    limits = Limits(s.rest_rate * q.nu, int(s.events), periods)
    # There is nothing to be said of a motion that is lost.
    if begun in (repetition.ROCKING, repetition.STICKING, repetition.AT_REST, repetition.NOT_SETTLED):
        put_plants(x, r.plants)
        for i in range(6):
            for j in range(INPUTS):
                c.by[i, j] = math.inf
        if begun == repetition.NOT_SETTLED:
            separation = _separation(q, m, own, limits, int(s.lyapunov), y)
        else:
            residual = _find_orbit(q, m, own, limits, y)
            # A motion that comes to its orbit from both sides in turn repeats after two periods first: an
            # orbit that closes after fewer is of that many.
            for fewer in range(1, periods):
                if periods % fewer == 0 and residual < RESIDUAL:
                    bounds, other = Limits(limits.capture, limits.events, fewer), own.cycles[SPARE]
                    put(y, m.y)
                    cycle(q, m, own.legs, room, r, bounds, own.motions[SPARE], other)
                    apart = _residual(q, y, other.end)
                    if other.closed != 0.0 and apart < RESIDUAL:
                        own.cycles[_BEST], residual, periods = other, apart, fewer
                        break
        multiplier, to_fold = _multipliers(q, c.by)
    neutral = is_neutral(q.k, q.e, q.mu, q.zeta, multiplier)
    status = verdict(begun, residual, separation, multiplier, to_fold, c.crossing, neutral)
    # A bob that swings for ever is on no orbit; of any other under a resting block a period was followed,
    # unless it has more steps than that may take.
    endless = q.zeta > 0.0 and not math.isfinite(residual)
    status = repetition.EVENT_BOUND if begun == repetition.AT_REST and endless else status
    # Without a finite derivative of the period map nothing can be said about stability.
    unsaid = status == UNSTABLE and not math.isfinite(multiplier)
    status = repetition.FAILED if unsaid or not (finite(y) or status == repetition.OVERTURNED) else status
    # The tilt at which friction holds a block is a state next to which it is held as well.
    multiplier = 1.0 if status == repetition.HELD else multiplier
    rests, rocks = status == repetition.AT_REST, status in (repetition.ROCKING, repetition.STICKING)
    marginal, singular = status in (UNSTABLE, NEUTRAL), status in (FOLD, GRAZED)
    periodic, span = rocks or rests or marginal, periods * 2.0 * math.pi / q.xi
    # A bob that swings for ever under a resting block is on no orbit, but its reach is known.
    ringing = rests and not (q.zeta > 0.0 and multiplier < 1.0)
    isolated = (not ringing) & (rocks | rests)
    if isolated:
        _put_isolated(c, y, out)
    elif marginal or singular or status == WANDERS:
        # I - DP may be singular: the sizes are those of the orbit as it was found, or, of a motion that did
        # not repeat, the largest met.
        out.amplitude, out.stroke = c.amplitude, c.stroke
    elif status == repetition.OVERTURNED:
        out.amplitude = out.stroke = math.inf
    elif status != repetition.FAILED:
        out.amplitude, out.stroke = found.amplitude, found.stroke
    if rests:
        # A block at rest has no amplitude, whatever moves. The stroke of a bob that hangs still is at the
        # corner of |psi|.
        out.amplitude = 0.0
        for j in range(MANY):
            out.by[_AMPLITUDE, j] = 0.0
            if out.stroke == 0.0:
                out.by[_STROKE, j] = math.nan
    out.lyapunov = separation
    if periodic:
        out.lyapunov = math.log(multiplier) / span if multiplier > 0.0 else -math.inf
    symmetric = periodic & (periods % 2 == 1) & (c.asymmetry < SYMMETRIC)
    out.symmetric = 1.0 if symmetric else 0.0
    if periodic or status == repetition.HELD or singular:
        out.multiplier = multiplier
    out.status, out.periods = status, periods
