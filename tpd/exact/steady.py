"""The steady state of a motion that has been followed: Newton's method on the map of its periods, what the
multipliers say, and the derivatives of an isolated orbit.

The rules are those of `tpd.analysis.steady_state` and `tpd.analysis.period_map`, which every other model
goes by."""

from __future__ import annotations

import math

import numpy as np

from tpd.core.orbit_terms import APERIODIC, CONSERVED, GRAZING, NEAR_FOLD, RESIDUAL, SYMMETRIC, UNDECIDED
from tpd.exact.half_map_kernel import characteristic, put_roots
from tpd.exact.legs import INPUTS, STATE
from tpd.exact.near_orbits import Limits, cycle, eliminate, finite
from tpd.exact.plant import compiled, put_plants
from tpd.exact.repetition import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    FLOATS,
    HELD,
    NOT_SETTLED,
    OVERTURNED,
    ROCKING,
    STICKING,
    scales_of,
)
from tpd.exact.repetition import STATUSES as SETTLED
from tpd.exact.settle import settle

STATUSES = (*SETTLED, "aperiodic", "unstable", "neutral", "near_fold", "grazing")
"""Names of statuses in the order of their numbers."""
APERIODIC_MOTION, UNSTABLE, NEUTRAL, FOLD, GRAZED = range(8, 13)
STEADY = np.dtype(
    [
        *((name, np.float64) for name in ("amplitude", "stroke")),
        ("y", np.float64, (4,)),
        *((name, np.float64) for name in ("multiplier", "lyapunov")),
        *((name, np.float64) for name in ("status", "periods", "symmetric", "elapsed")),
    ]
)
"""A steady state, as `tpd.analysis.steady_state.Steady`; the numbers but for the last four may depend on
parameters."""
CYCLE_OUT, CYCLE_SIZES = np.int64(12), np.int64(6)
"""Numbers in the results of `near_orbits.cycle`, and quantities of it with derivatives."""
_SIZES, _MODE, _CROSSING, _ASYMMETRY, _CLOSED = 4, 6, 9, 10, 11
"""Places in the results of `near_orbits.cycle` behind the state at the end."""
_NEWTON_STEPS, _ROUND_OFF = 8, 1e-14
"""Bound on the steps of Newton's method, and residual of the map that counts as round-off."""


@compiled
def _put(new, old):
    """Put numbers in place of others."""
    for i in range(len(new)):
        old[i] = new[i]


@compiled
def _residual(q, y, out):
    """Largest difference between the ends of a cycle, over the scales; no number if the motion was lost."""
    scales, worst = scales_of(q), 0.0
    for i in range(4):
        # Of a bob that does nothing the swing decides nothing.
        if i % 2 == 0 or q.mu > 0.0 or q.zeta > 0.0:
            worst = max(worst, abs(out[i] - y[i]) / scales[i])
    return worst if finite(out) else math.nan


@compiled
def _moved(by, right):
    """Put the solution of (I - DP) x = right into `right`, shape (4, n); False if there is none. `by` has DP
    in its first four rows."""
    matrix = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            matrix[i, j] = (1.0 if i == j else 0.0) - by[i, STATE + j]
    return eliminate(matrix, right) > 0.0


@compiled
def _orbit(q, m, own, limits, y, best, by):
    """Newton's method from the state `y` with the mode of the motion `m`: leave the state of the best orbit
    in `y`, what was found about it in `best` and `by`. Return its residual."""
    legs, room, r, mode0 = own.legs, own.rooms[0], own.readers[0], own.motions[1]
    out, trial, now, move = (
        np.empty(CYCLE_OUT),
        np.empty((CYCLE_SIZES, INPUTS)),
        np.empty(4),
        np.empty((4, 1)),
    )
    error, residual, steps = math.inf, math.inf, 0
    _put(y, now)
    while steps < _NEWTON_STEPS and error > _ROUND_OFF:
        kind, tilt, way = m.kind, m.tilt, m.way
        _put(now, m.y)
        cycle(q, m, legs, room, r, limits, mode0, out, trial)
        found = _residual(q, now, out)
        # Only a motion that ends in the mode in which it began is an orbit.
        raised = found + (0.0 if out[_CLOSED] != 0.0 else 0.5 * RESIDUAL)
        steps += 1
        if not raised < error:
            if not RESIDUAL < error < math.inf:
                break
            # By rounding a map may miss an event that undoes itself soon: half of a step that led away tries
            # once more, in the mode in which the last one began.
            m.kind, m.tilt, m.way = kind, tilt, way
            for i in range(4):
                now[i] = 0.5 * (now[i] + y[i])
            continue
        error, residual = raised, found
        _put(now, y)
        _put(out, best)
        for i in range(CYCLE_SIZES):
            _put(trial[i], by[i])
        for i in range(4):
            move[i, 0] = out[i] - now[i]
        # An orbit that meets an event at tau = 0, such as every conservative one, comes out on either side of
        # it by rounding. Begun before the event and ended after it, the run counts the event twice, the other
        # way round not at all: both leave the state right and its derivative wrong. A run that begins in the
        # mode in which the last one ended meets it once.
        if _moved(trial, move):
            for i in range(4):
                now[i] += move[i, 0]
    return residual


@compiled
def _separation(q, m, own, limits, periods, best, by):
    """Follow a motion that did not repeat: its largest Lyapunov exponent, no number if it ends at once. Leave
    its state in `m`, the last results in `best` and `by`, and the largest sizes among them."""
    legs, room, r, mode0, scales = own.legs, own.rooms[0], own.readers[0], own.motions[1], scales_of(q)
    out, trial, begun = np.empty(CYCLE_OUT), np.empty((CYCLE_SIZES, INPUTS)), np.empty(4)
    direction, onward, parted, steps = np.empty(4), np.empty(4), 0.0, 0
    if not q.mu > 0.0:
        # Of a bob without mass nothing is felt.
        scales[1], scales[3] = 1e300, 1e300
    for i in range(4):
        begun[i], direction[i] = m.y[i], 0.5 * scales[i]
    while steps < periods:
        cycle(q, m, legs, room, r, limits, mode0, out, trial)
        if not finite(out):
            break
        for k in range(2):
            out[_SIZES + k] = max(out[_SIZES + k], best[_SIZES + k])
        size = 0.0
        for i in range(4):
            onward[i] = 0.0
            for j in range(4):
                onward[i] += trial[i, STATE + j] * direction[j]
            size += (onward[i] / scales[i]) ** 2
        size = math.sqrt(size) + 1e-300
        for i in range(4):
            direction[i] = onward[i] / size
        parted, steps = parted + math.log(size), steps + 1
        _put(mode0.y, begun)
        _put(out, best)
        for i in range(CYCLE_SIZES):
            _put(trial[i], by[i])
    _put(begun, m.y)
    return parted / (steps * 2.0 * math.pi / q.xi) if steps > 1 else math.nan


@compiled
def _multipliers(q, by):
    """Largest modulus of the Floquet multipliers that the block can feel (all, unless mu = 0), and the least
    distance of one from +1."""
    felt, re, im, largest, apart = np.empty((4, 4)), np.empty(4), np.empty(4), 0.0, math.inf
    for i in range(4):
        for j in range(4):
            unfelt = q.mu == 0.0 and (i % 2 == 1 or j % 2 == 1)
            felt[i, j] = 0.0 if unfelt else by[i, STATE + j]
            if not math.isfinite(felt[i, j]):
                return math.inf, 1.0
    put_roots(characteristic(felt), re, im)
    for i in range(4):
        largest, apart = max(largest, math.hypot(re[i], im[i])), min(apart, math.hypot(1.0 - re[i], im[i]))
    return largest, apart


@compiled
def _is_neutral(q, largest):
    """Whether an orbit whose multiplier is `largest` in size neither attracts nor repels; see
    `tpd.core.eigenvalues.is_neutral`."""
    conserves = q.k == 0.0 and q.e == 1.0 and (q.mu == 0.0 or q.zeta == 0.0)
    return (conserves and largest < 1.0 + CONSERVED) or abs(largest - 1.0) < UNDECIDED


@compiled
def steady_state(x, y0, s, own, out, by):
    """Follow a motion from rest or from `y0` at tau = 0 until it settles, within the bounds of the settings
    `s`, and put its steady state into the record `out`, and the derivatives of (amplitude, stroke, state) in
    the nine parameters into `by`, shape (6, 9): NaN where there are none."""
    q, m = own.plants[0], own.motions[0]
    out.amplitude = out.stroke = out.multiplier = out.lyapunov = math.nan
    out.symmetric, out.elapsed, out.periods, out.status = 0.0, 0.0, 1.0, FAILED
    floats, best, run = np.empty(FLOATS), np.zeros(CYCLE_OUT), np.empty((CYCLE_SIZES, INPUTS))
    y, sum_of_all = floats[:4], 0.0
    for j in range(9):
        sum_of_all += abs(x[j])
        for i in range(CYCLE_SIZES):
            by[i, j], run[i, j] = math.nan, math.inf
    for i in range(4):
        sum_of_all += abs(y0[i])
        m.y[i], out.y[i] = y0[i], y0[i]
        for k in range(CYCLE_SIZES):
            run[k, STATE + i] = math.inf
    # What is fed with numbers that are none would be followed until its bound.
    if not math.isfinite(sum_of_all):
        return
    status, periods, out.elapsed = settle(x, q, m, own.rooms[0], own.readers[0], s, 0.0, 0.0, floats)
    begun, residual, separation = status, math.inf, math.nan
    moving = status in (ROCKING, STICKING)
    best[_SIZES], best[_SIZES + 1], best[_CROSSING], best[_ASYMMETRY] = floats[4], floats[5], math.inf, 1.0
    limits = Limits(s.rest_rate * q.nu, int(s.events), periods)
    # There is nothing to be said of a motion that is lost.
    if moving or status in (AT_REST, NOT_SETTLED):
        put_plants(x, 0, own.readers[0].plants)
        m.kind, m.tilt, m.way = floats[8], floats[9], floats[10]
        if status == NOT_SETTLED:
            separation = _separation(q, m, own, limits, int(s.lyapunov), best, run)
            _put(m.y, y)
        else:
            residual = _orbit(q, m, own, limits, y, best, run)
    multiplier, to_fold = _multipliers(q, run)
    # From the weakest statement to the strongest: each line overrules those above it. Stability comes first,
    # because its numbers mean nothing if an event was grazed, next to a fold, or off an orbit.
    if moving:
        if multiplier > 1.0:
            status = UNSTABLE if math.isfinite(multiplier) else FAILED
        if _is_neutral(q, multiplier):
            status = NEUTRAL
        if best[_CROSSING] < GRAZING:
            status = GRAZED
        if to_fold < 2.0 * NEAR_FOLD:
            status = FOLD
        if not residual < RESIDUAL:
            status = NOT_SETTLED
    if separation > APERIODIC:
        status = APERIODIC_MOTION
    # A bob that swings for ever is on no orbit; of any other under a resting block a period was followed,
    # unless it has more steps than that may take.
    if begun == AT_REST and q.zeta > 0.0 and not math.isfinite(residual):
        status = EVENT_BOUND
    if not (finite(y) or status == OVERTURNED):
        status = FAILED
    # The tilt at which friction holds a block is a state next to which it is held as well.
    multiplier = 1.0 if status == HELD else multiplier
    rests, rocks = status == AT_REST, status in (ROCKING, STICKING)
    marginal, singular = status in (UNSTABLE, NEUTRAL), status in (FOLD, GRAZED)
    out.amplitude, out.stroke = floats[4], floats[5]
    if (rocks or rests) and multiplier < 1.0 and not (rests and q.zeta == 0.0):
        # On an isolated orbit the sizes gain one more Newton step.
        out.amplitude, out.stroke = _implicit(best, run, y, by)
    elif marginal or singular or status == APERIODIC_MOTION:
        # I - DP may be singular: the sizes are those of the orbit as it was found, or, of a motion that did
        # not repeat, the largest met.
        out.amplitude, out.stroke = best[_SIZES], best[_SIZES + 1]
    elif status == OVERTURNED:
        out.amplitude = out.stroke = math.inf
    elif status == FAILED:
        out.amplitude = out.stroke = math.nan
    if rests:
        # A block at rest has no amplitude, whatever moves. The stroke of a bob that hangs still is at the
        # corner of |psi|.
        out.amplitude = 0.0
        for j in range(9):
            by[0, j], by[1, j] = 0.0, (by[1, j] if out.stroke != 0.0 else math.nan)
    periodic = rocks or rests or marginal
    out.lyapunov = separation
    if periodic:
        span = periods * 2.0 * math.pi / q.xi
        out.lyapunov = math.log(multiplier) / span if multiplier > 0.0 else -math.inf
    if periodic and periods % 2 == 1 and best[_ASYMMETRY] < SYMMETRIC:
        out.symmetric = 1.0
    if periodic or status == HELD or singular:
        out.multiplier = multiplier
    out.status, out.periods = status, periods
    _put(y, out.y)


@compiled
def _implicit(best, run, y, by):
    """Amplitude and stroke after one more Newton step, and the derivatives of both and of the state with the
    orbit following its parameters."""
    # y*(p) = P(y*(p), p), hence dy*/dp = (I - DP)^-1 dP/dp, however long the transient was; both sizes are
    # functions of (y*, p) along the period. The residual is one more right-hand side, so that they gain the
    # last Newton step for nothing. I - DP is singular at a fold: there the caller refuses slopes.
    right, sizes = np.empty((4, 10)), np.empty(2)
    for i in range(4):
        right[i, 0] = best[i] - y[i]
        for j in range(9):
            right[i, 1 + j] = run[i, j]
    solved = _moved(run, right)
    for k in range(2):
        sizes[k] = best[_SIZES + k]
        for i in range(4):
            sizes[k] += run[4 + k, STATE + i] * right[i, 0]
        for j in range(9):
            by[k, j] = run[4 + k, j]
            for i in range(4):
                by[k, j] += run[4 + k, STATE + i] * right[i, 1 + j]
    for i in range(4):
        for j in range(9):
            by[2 + i, j] = right[i, 1 + j]
    return (sizes[0], sizes[1]) if solved else (math.nan, math.nan)
