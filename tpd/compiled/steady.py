"""The steady state of a run: its periodic orbit, the stability of the orbit, and its derivatives.

Newton's method solves for the orbit on the map of the motion's periods (`tpd.compiled.period_map`). The rules
are those of `tpd.answers.steady_state` and `tpd.models.smoothed_orbit`, which all other models use. Only this
module also reduces the period of an orbit to the smallest number of forcing periods after which it closes.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import columns, repetition, series
from tpd.compiled.columns import (
    APERIODIC,
    APERIODIC_STATUS,
    AT_REST,
    EVENT_BOUND,
    FAILED,
    GRAZING_STATUS,
    HELD,
    LAST_STEP,
    NEAR_FOLD_STATUS,
    NEUTRAL,
    NOT_SETTLED,
    OVERTURNED,
    RESIDUAL,
    ROCKING,
    STICKING,
    SYMMETRIC,
    TILT,
    UNSTABLE,
    WIDTH,
)
from tpd.compiled.contact import start_mode
from tpd.compiled.follow import BEYOND, EXHAUSTED, set_scales
from tpd.compiled.forcing import NO
from tpd.compiled.half_map_kernel import is_neutral
from tpd.compiled.legs import ANGLES, INPUTS, STATE, fill_plants
from tpd.compiled.motion import copy_to, is_finite, larger_side, set_motion
from tpd.compiled.period_map import (
    APPROACHING,
    BEST,
    CYCLE_START,
    LATEST,
    Limits,
    find_orbit,
    follow_cycle,
    multipliers,
    records_of,
    residual_of,
    solve_linearised,
)
from tpd.compiled.plant import NONE, ONE, ONLY, compiled, places
from tpd.compiled.settle import settle

_RESIDUAL = np.int64(0)
"""Column of the residual of the orbit's map, before those of the parameters."""
_AMPLITUDE, _STROKE = places(2)
"""First rows of the derivatives of a steady state. The rows of the state follow."""


@compiled
def _measure_lyapunov(q, m, buffers, limits, periods, y):
    """Return the largest Lyapunov exponent of a run that did not repeat.

    The run is continued from its present state.

    The result is NaN if the run ends at once. This writes the start of the last cycle into `y`, and that
    cycle with the largest angles of all cycles into the first place of the buffers.
    """
    best, c, scales = buffers.cycles[BEST], buffers.cycles[LATEST], repetition.scales_of(q)
    direction, onward, log_growth, steps = np.empty(4), np.empty(4), 0.0, 0
    for i in range(4):
        # A massless bob does not act on the block, so that its angle and rate get no weight.
        scales[i] = scales[i] if i % 2 == 0 or q.mu > 0.0 else 1e300
        direction[i] = 0.5 * scales[i]
    while steps < periods:
        follow_cycle(q, m, buffers, limits, ONE, c)
        if not is_finite(c.end):
            break
        c.amplitude, c.swing = max(c.amplitude, best.amplitude), max(c.swing, best.swing)
        # Push the direction through the linearised map of one period. The growth of its length gives the
        # exponent.
        size = 0.0
        for i in range(4):
            onward[i] = 0.0
            for j in range(4):
                onward[i] += c.by[i, STATE + j] * direction[j]
            size += (onward[i] / scales[i]) ** 2
        size = math.sqrt(size) + 1e-300
        for i in range(4):
            direction[i] = onward[i] / size
        log_growth, steps = log_growth + math.log(size), steps + 1
        copy_to(buffers.motions[CYCLE_START].y, y)
        buffers.cycles[BEST] = c
    return log_growth / (steps * 2.0 * math.pi / q.xi) if steps > 1 else math.nan


verdict = compiled(columns.verdict)
"""The verdict on a steady state in compiled code."""


@compiled
def _store_isolated(c, y, count, out):
    """Write the sizes of an isolated orbit after one more Newton step into `out`.

    The derivatives in the first `count` parameters follow.
    """
    # From y*(p) = P(y*(p), p) follows dy*/dp = (I - DP)^-1 dP/dp, however long the transient was. Amplitude
    # and swing are functions of (y*, p) along the period. The residual is one more right-hand side, which
    # gives the last Newton step at no cost. I - DP is singular at a fold, where the caller does not use the
    # derivatives.
    right, sizes = np.empty((4, count + 1)), np.empty((2, count + 1))
    for i in range(4):
        right[i, _RESIDUAL] = c.end[i] - y[i]
        for j in range(count):
            right[i, j + 1] = c.by[i, j]
    regular = solve_linearised(c.by, right)
    # The largest angles: direct derivatives, and those through the orbit's state.
    for k in range(2):
        row = ANGLES + larger_side(c, k)
        for j in range(count + 1):
            sizes[k, j] = c.by[row, j - 1] if j > 0 else (c.amplitude if k == 0 else c.swing)
            for i in range(4):
                sizes[k, j] += c.by[row, STATE + i] * right[i, j]
            if not regular:
                sizes[k, j] = math.nan
    out.amplitude, out.swing = sizes[_AMPLITUDE, _RESIDUAL], sizes[_STROKE, _RESIDUAL]
    for k in range(6):
        for j in range(count):
            out.by[k, j] = sizes[k, j + 1] if k < 2 else right[k - 2, j + 1]


@compiled
def _status_of(buffers, residual, y):
    """Return the number of the status of a motion that started near an orbit and is on it now."""
    c = buffers.cycles[BEST]
    # Without a residual the first cycle did not reach its end, and its record is still in the second place.
    if not math.isfinite(residual):
        ending = buffers.cycles[LATEST].ending
        failure = EVENT_BOUND if ending == EXHAUSTED else FAILED
        return OVERTURNED if ending == BEYOND else failure
    if not (residual < RESIDUAL and c.step < LAST_STEP):
        return NOT_SETTLED
    # A block that is held all the time keeps its tilt.
    if c.hold_level == 2.0:
        return HELD if y[TILT] != 0.0 else AT_REST
    return STICKING if c.hold_level > 0.0 else ROCKING


@compiled
def steady_state(x, y0, s, near, buffers, out):
    """Compute the steady state of a run from `y0` at tau = 0, and write it into the record `out` (`STEADY`).

    The run is simulated until it settles, within the bounds of the settings `s`. If `near`, nothing is
    simulated: the function computes the orbit near `y0` with the number of periods in the settings. That
    orbit need not be stable, and it has derivatives in that case as well.
    """
    q, m, w, r = records_of(buffers)
    c, settled, y, total = buffers.cycles[BEST], buffers.settled[ONLY], out.state, 0.0
    roots = out.multipliers
    # All numbers stay NaN, and the status failed, until they get a value.
    out.amplitude = out.swing = out.multiplier = out.lyapunov = out.fold = math.nan
    out.symmetric, out.elapsed, out.periods, out.status = 0.0, 0.0, 1.0, FAILED
    roots[:] = math.nan
    out.by[:] = math.nan
    for j in range(WIDTH):
        total += abs(x[j])
    for i in range(4):
        total += abs(y0[i])
    copy_to(y0, m.y)
    copy_to(y0, y)
    # A run with NaN or infinite inputs would be simulated until its bound.
    if not math.isfinite(total):
        return
    if near:
        # Without a simulation the motion counts as rocking at first. Its first period gives the real status.
        series.prepare(x, s, q, w)
        set_scales(q, w)
        fill_plants(x, NONE, s.linear, r)
        start_mode(q, y, 0.0, m)
        settled.status, settled.periods, settled.elapsed = ROCKING, s.periods, 0.0
        settled.settled_tilt = settled.settled_swing = math.nan
    else:
        settle(x, buffers, s, 0.0, 0.0, settled)
    outcome, periods, out.elapsed = int(settled.status), int(settled.periods), settled.elapsed
    copy_to(m.y, y)
    residual, separation, multiplier, to_fold, fold = math.inf, math.nan, math.inf, 1.0, math.nan
    # If the run was moved to its orbit, the best cycle is that orbit.
    moved = not near and outcome in (ROCKING, STICKING) and c.periods == periods
    if not moved:
        c.amplitude, c.swing = settled.settled_tilt, settled.settled_swing
        c.transversality = c.asymmetry = math.inf
        c.by[:] = math.nan
    limits = Limits(int(s.events), (STATE, INPUTS), math.inf)
    # A run that has overturned or failed has no orbit.
    if outcome in (ROCKING, STICKING, AT_REST, NOT_SETTLED):
        if outcome == NOT_SETTLED:
            separation = _measure_lyapunov(q, m, buffers, limits, int(s.lyapunov_periods), y)
        else:
            residual = c.residual if moved else find_orbit(q, m, buffers, limits, periods, y)
            # A motion that approaches its orbit alternately from both sides first repeats after two periods.
            # If the orbit closes after fewer periods, it gets that smaller number.
            other, begin = buffers.cycles[LATEST], buffers.motions[APPROACHING]
            set_motion(y, m, begin)
            for fewer in range(1, periods):
                if periods % fewer == 0 and residual < RESIDUAL:
                    set_motion(y, begin, m)
                    follow_cycle(q, m, buffers, limits, fewer, other)
                    distance = residual_of(q, y, other.end)
                    if other.closed != 0.0 and distance < RESIDUAL:
                        buffers.cycles[BEST], residual, periods = other, distance, fewer
                        break
        # Stability of the orbit, or of the last cycle of a run that did not repeat.
        multiplier, to_fold, fold = multipliers(q, c.by, roots)
    if near:
        # Without an orbit the sizes stay NaN.
        outcome = _status_of(buffers, residual, y)
        if outcome != NOT_SETTLED:
            settled.settled_tilt, settled.settled_swing = c.amplitude, c.swing
    neutral = is_neutral(q.k, q.e, q.mu, q.zeta, multiplier)
    # A run that did not repeat may separate from its neighbours.
    outcome = APERIODIC_STATUS if separation > APERIODIC else outcome
    state = NO, q.zeta > 0.0, is_finite(y)
    status = verdict(outcome, residual, multiplier, to_fold, c.transversality, neutral, *state)
    # Friction also holds the block at slightly different tilts, so that the multiplier is 1.
    multiplier = 1.0 if status == HELD else multiplier
    rests, rocks = status == AT_REST, status in (ROCKING, STICKING)
    marginal, singular = status in (UNSTABLE, NEUTRAL), status in (NEAR_FOLD_STATUS, GRAZING_STATUS)
    periodic, span = rocks or rests or marginal, periods * 2.0 * math.pi / q.xi
    # An undamped bob that swings under a resting block has no orbit, but its largest angle is valid.
    ringing = rests and not (q.zeta > 0.0 and multiplier < 1.0)
    # Only an isolated orbit has derivatives.
    isolated = (not ringing) & (rocks | rests | (near & marginal))
    if isolated:
        # The height of the hinge is the last parameter. Its derivative costs time and is rarely needed.
        count = int(s.slopes)
        if count > 0:
            # Newton's method needs no derivatives in the parameters. Follow the orbit once more for them.
            fill_plants(x, count, s.linear, r)
            set_motion(y, c, m)
            limits = Limits(limits.events, (NONE, count), math.inf)
            follow_cycle(q, m, buffers, limits, periods, buffers.cycles[LATEST])
            for i in range(ANGLES + 6):
                for j in range(count):
                    c.by[i, j] = buffers.cycles[LATEST].by[i, j]
        _store_isolated(c, y, count, out)
    elif marginal or singular or status == APERIODIC_STATUS:
        # I - DP may be singular. The sizes are those of the orbit without a further Newton step, or the
        # largest ones of a run that did not repeat.
        out.amplitude, out.swing = c.amplitude, c.swing
    elif status == OVERTURNED:
        out.amplitude = out.swing = math.inf
    elif status != FAILED:
        out.amplitude, out.swing = settled.settled_tilt, settled.settled_swing
    if rests:
        # The amplitude of a block at rest stays zero when the parameters change a little. Where the bob hangs
        # still, its largest |psi| has a corner and no derivative.
        out.amplitude = 0.0
        for j in range(WIDTH):
            out.by[_AMPLITUDE, j] = 0.0
            if out.swing == 0.0:
                out.by[_STROKE, j] = math.nan
    out.lyapunov = separation
    if periodic:
        out.lyapunov = math.log(multiplier) / span if multiplier > 0.0 else -math.inf
    symmetric = periodic & (periods % 2 == 1) & (c.asymmetry < SYMMETRIC)
    out.symmetric = 1.0 if symmetric else 0.0
    if periodic or status == HELD or singular:
        out.multiplier, out.fold = multiplier, fold
    else:
        roots[:] = math.nan
        # If there is no orbit near a state, the last state of Newton's method is not a result.
        if near:
            y[:] = math.nan
    out.status, out.periods = status, periods
