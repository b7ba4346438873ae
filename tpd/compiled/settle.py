"""Simulation of a run under a harmonic until it repeats, rests or overturns.

The rules are those of `tpd.models.smoothed_orbit`. If a motion approaches its orbit slowly, Newton's method
computes the orbit (`tpd.compiled.near_orbits`).
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import repetition, series
from tpd.compiled.columns import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    NOT_SETTLED,
    OVERTURNED,
    REST,
    ROCKING,
    STICK,
    SWING,
    SWING_RATE,
    TILT,
    TILT_RATE,
)
from tpd.compiled.contact import start_mode
from tpd.compiled.follow import ARRIVED, BEYOND, NOT_FINITE, one_period, set_scales
from tpd.compiled.forcing import FIRST_PIECE, forcing_now, harmonic
from tpd.compiled.legs import INPUTS, STATE, fill_plants
from tpd.compiled.motion import LEG, copy_to, is_finite, largest, reset_counts, set_motion
from tpd.compiled.near_orbits import CONVERGED, NEARBY, Past, orbit_near
from tpd.compiled.period_map import BEST, TRIAL, Limits, records_of
from tpd.compiled.plant import NONE, ONE, compiled
from tpd.compiled.repetition import LONGEST, NEWEST

_SEARCH, _LINEAR_SEARCH = 150.0, 24.0
"""Number of forcing periods that can be simulated in the time of one search for an orbit of period one, under
(4) and under (25)."""
_STEPS, _CLOSED, _DIFFERENCE = 12, 1e-9, 1e-4
"""Bound on the steps of this solution; its largest residual, and the step of its differences, in shares of
the scales."""


@compiled
def _stays_held(q, m, legs, w, psi, rate, trial):
    """Simulate a period from a state of the bob at tau = 0. Return whether the block stays held."""
    set_motion(m.y, m, trial)
    reset_counts(trial)
    trial.y[SWING], trial.y[SWING_RATE] = psi, rate
    # A release would be an event, and only one event is allowed.
    return one_period(q, harmonic(), trial, legs, w, 0.0, 0.0, ONE) == ARRIVED


@compiled
def _change_of_bob(q, m, legs, w, psi, rate, trial):
    """Return the change of the bob's state in a period from tau = 0 on; NaN unless the block stays held."""
    is_held = _stays_held(q, m, legs, w, psi, rate, trial)
    return (trial.y[SWING] - psi, trial.y[SWING_RATE] - rate) if is_held else (math.nan, math.nan)


@compiled
def _settled_swing(q, m, legs, w, scales, remaining, trial, peaks):
    """Return the largest |psi| of the settled bob, or NaN unless the block is certainly held permanently.

    If it is held, this replaces the state of `m` by the settled one and updates `peaks`, for which the motion
    is followed for at most the number of `remaining` periods. An undamped bob is followed for all of them.
    `trial` is another motion.
    """
    psi, rate, span, n = m.y[SWING], m.y[SWING_RATE], math.sqrt(q.m22), 0
    step, error = _DIFFERENCE * scales[SWING], math.inf
    # Newton's method on the map of a period, which changes the state by (f, g), with the derivatives at its
    # start.
    f_rate, g_rate = _change_of_bob(q, m, legs, w, psi, rate + step / span, trial)
    f_psi, g_psi = _change_of_bob(q, m, legs, w, psi + step, rate, trial)
    f, g = _change_of_bob(q, m, legs, w, psi, rate, trial)
    a, b = (f_psi - f) / step, (f_rate - f) * span / step
    c, d = (g_psi - g) / step, (g_rate - g) * span / step
    while error > _CLOSED and n < _STEPS:
        if n > 0:
            f, g = _change_of_bob(q, m, legs, w, psi, rate, trial)
        if not math.isfinite(a + b + c + d + f + g):
            return math.nan
        error = max(abs(f) / scales[SWING], abs(g) / scales[SWING_RATE])
        regular = a * d - b * c
        psi -= (d * f - b * g) / regular
        rate -= (a * g - c * f) / regular
        n += 1
    # A motion that attracts, or that of an undamped bob, has no real multiplier beyond 1 or -1. Damping gives
    # the product of both.
    attracts = abs(2.0 + a + d) < 1.0 + math.exp(-q.c2 / q.m22 * w.period)
    # While the bob settles, its own swing adds to the moment on the block. Its energy never grows, which
    # bounds this share under (25). Under (4) twice of it includes the rest.
    own, slack = math.hypot(m.y[SWING] - psi, span * (m.y[SWING_RATE] - rate)), q.slack
    q.slack -= (1.0 if q.linear != 0.0 else 2.0) * own * (q.up - 1.0 + abs(q.bias) / span)
    is_held = error <= _CLOSED and attracts and _stays_held(q, m, legs, w, psi, rate, trial)
    q.slack, swing, u, v = slack, largest(trial, SWING), m.y[SWING], m.y[SWING_RATE]
    while is_held and remaining > 0 and (q.zeta == 0.0 or swing + own > peaks[SWING]):
        is_held = _stays_held(q, m, legs, w, u, v, trial)
        u, v, remaining = trial.y[SWING], trial.y[SWING_RATE], remaining - 1
        own = math.hypot(u - psi, span * (v - rate))
        peaks[SWING] = max(peaks[SWING], largest(trial, SWING))
        # An undamped bob keeps its own swing.
        swing = max(swing, largest(trial, SWING)) if q.zeta == 0.0 else swing
    if q.zeta > 0.0 and is_held:
        m.y[SWING], m.y[SWING_RATE] = psi, rate
    peaks[SWING] = max(peaks[SWING], swing)
    return swing if is_held else math.nan


@compiled
def _slow_repetition(q, past, count, tolerance, gap, gap_periods):
    """Return the number of periods after which a slowly converging motion almost repeats, or 0.

    Slow means that the motion would take longer to repeat than a search for its orbit. The function also
    returns the distance between the motion and its repetition, and the number of periods for it. `gap` and
    `gap_periods` are these two values of the period before.
    """
    closest, periods, scales = NEARBY, 0, repetition.scales_of(q)
    for n in range(1, count // 2):
        error = repetition.distance(q, past[NEWEST].y, past[n].y, scales)
        # A larger number of periods must be much closer than a smaller one.
        if error < 0.1 * closest or (n == 1 and error < closest):
            closest, periods = error, n
    # The decay in one period follows from the last two distances, if both belong to the same number of
    # periods.
    decay = closest / gap if gap_periods == periods and gap > 0.0 else 0.0
    if periods == 0 or decay == 0.0:
        return 0, closest, periods
    # The sum of all further changes must be small, see `repeats_after`.
    remaining = closest / (1.0 - decay) / tolerance if decay < 1.0 else math.inf
    remaining = math.log(remaining) / -math.log(decay) if decay < 1.0 else math.inf
    search = _LINEAR_SEARCH if q.linear != 0.0 else _SEARCH
    return (periods if remaining > search * periods else 0), closest, periods


@compiled
def _may_rest(q, m, before, peak, tolerance):
    """Whether the block may be held permanently: at rest, or at the tilt of one period earlier.

    `before` is the state one period earlier, and `peak` the largest tilt since then. If the hops of a block
    are so low that they no longer matter, put the block on its base.
    """
    # A rattle with e < 1 comes to rest within finite time, and a slow impact ends it at once. Hops under
    # strong friction do not end like this: friction holds the block a little above its base until the moment
    # has changed its sign. One hop then takes a large part of a period, and each hop is smaller than the
    # last.
    if m.kind == STICK and 0.0 < max(peak, abs(m.y[TILT])) < tolerance * q.nu:
        m.kind, m.tilt, m.direction, m.y[TILT], m.y[TILT_RATE] = REST, 0.0, 0.0, 0.0, 0.0
    return m.kind == REST or (m.kind == STICK and m.y[TILT] == before[TILT])


@compiled
def settle(x, buffers, s, since, ramp, out):
    """Simulate a run until it repeats, rests or overturns, and write the result to `out`.

    The run starts from its state at tau = `since`. It also ends after the number of periods in the settings
    `s`. The excitation grows linearly over `ramp` periods. `out` is a record `tpd.compiled.columns.RUN`.
    """
    (q, m, w, r), trial, legs = records_of(buffers), buffers.motions[TRIAL], np.empty(0, LEG)
    series.prepare(x, s, q, w)
    fill_plants(x, NONE, s.linear, r)
    # No legs are recorded before an orbit is searched for, and linear runs take strides.
    scales, y, tolerance, events = set_scales(q, w), m.y, s.tolerance, int(s.events)
    limits = Limits(events, (STATE, INPUTS), NEARBY)
    past = Past(np.zeros(LONGEST + 1, repetition.PERIOD), np.zeros(2))
    last, peaks, gap, gap_periods = past.periods, past.peaks, 0.0, NONE
    copy_to(y, last[NEWEST].y)
    reset_counts(m)
    buffers.cycles[BEST].periods = 0.0
    f, ramp_end = repetition.excitation_in(ramp, w.period, 0.0, since)
    start_mode(q, y, forcing_now(q, f, FIRST_PIECE, since), m)
    peaks[TILT], peaks[SWING] = abs(y[TILT]), abs(y[SWING])
    # A start within a period has another phase than the ends of periods, so that the two cannot be compared.
    count, status, repeats, elapsed = (1 if since == 0.0 else 0), NOT_SETTLED, 0, 0
    wait, trials, rest_swing = 0, 0, math.nan
    # A run of (4) is simulated for the time of a search before the first one.
    search = 0 if q.linear != 0.0 else int(_SEARCH)
    while elapsed < s.periods and status == NOT_SETTLED:
        if elapsed > 0:
            f, ramp_end = repetition.excitation_in(ramp, w.period, float(elapsed), 0.0)
        # The first period may start late.
        ended = one_period(q, f, m, legs, w, since if elapsed == 0 else 0.0, ramp_end, events)
        elapsed += 1
        # Largest angles of this period, and of the whole run.
        peak, swing = max(largest(m, TILT), abs(y[TILT])), largest(m, SWING)
        peaks[TILT], peaks[SWING] = max(peaks[TILT], peak), max(peaks[SWING], swing)
        # States before the excitation became steady do not count for a repetition or for rest. A run that has
        # ended is judged by its outcome.
        is_steady = f.rate == 0.0 and ended == ARRIVED
        repeats = repetition.repeats_after(q, y, last, count, scales, tolerance) if is_steady else 0
        # A block that is held at the end of a period may be held permanently.
        is_held = is_steady and _may_rest(q, m, last[NEWEST].y, peak, tolerance)
        count = repetition.store_period(last, count if is_steady else 0, y, peak, swing, m.hold_level)
        was_held = repeats > 0 and repetition.was_held(last, repeats)
        if is_held and elapsed >= wait:
            rest_swing = _settled_swing(q, m, legs, w, scales, int(s.periods) - elapsed, trial, peaks)
            # The next trials wait longer and longer: in most runs the block lifts again.
            trials += 1
            wait = elapsed + trials
        if ended == NOT_FINITE or not is_finite(y):
            status = FAILED
        elif ended != ARRIVED:
            status = OVERTURNED if ended == BEYOND else EVENT_BOUND
        elif was_held and q.zeta == 0.0 and q.mu > 0.0:
            # An undamped bob may repeat only after several periods.
            status, rest_swing = AT_REST, 0.0
            for j in range(repeats):
                rest_swing = max(rest_swing, last[j].swing)
        elif math.isfinite(rest_swing) or (was_held and q.mu == 0.0):
            # The block is at rest under a massless bob whether or not its swing is known. Under (25) the
            # swing of an undamped bob in resonance grows without limit.
            is_unknown = q.linear != 0.0 and q.zeta == 0.0 and not math.isfinite(rest_swing)
            status, peaks[SWING] = (FAILED if is_unknown else AT_REST), peaks[SWING] + 0.0 * rest_swing
        elif repeats > 0 and not was_held:
            status = ROCKING
        elif is_steady and tolerance >= CONVERGED and elapsed >= search:
            # The run converges slowly: search for its orbit. If that fails, wait until the run is twice as
            # long.
            candidate, gap, gap_periods = _slow_repetition(q, last, count, tolerance, gap, gap_periods)
            if candidate > 0:
                search = 2 * elapsed
                if orbit_near(q, m, buffers, past, count, limits, candidate):
                    status, repeats = ROCKING, candidate
    if status == AT_REST:
        last[NEWEST].swing = rest_swing
        # A damped bob under a block at rest repeats after one period, whatever the number was before.
        repeats = 0 if q.zeta > 0.0 else repeats
    repetition.store_settled(status, repeats, elapsed, m, last, peaks, out)
