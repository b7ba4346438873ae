"""Simulation of runs of the nonlinear equations (4), and the entry point to this code for XLA and for Python.

Runs are simulated one by one. In a vectorised batch every run would wait for the one with the most events. A
Taylor series carries a run until its error would be too large, or to the first event, which is a root of the
series.

State, forcing and coefficients are the same as in the exact model. `tpd.compiled.contact_kernel` has the
rules at events, and `tpd.compiled.repetition` the rules of repetition.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from tpd.compiled import nonlinear_series as series
from tpd.compiled import repetition
from tpd.compiled.arcs import forcing_at, load_at, span_of, steady
from tpd.compiled.columns import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    NOT_SETTLED,
    OVERTURNED,
    REST,
    ROCKED,
    ROCKING,
    RUN,
    SLIP,
    STEADY,
    STICK,
    STICKING,
    STOOD,
    SWING,
    SWING_RATE,
    SYMMETRIC,
    TILT,
    TILT_RATE,
)
from tpd.compiled.compiling import checksum
from tpd.compiled.contact_kernel import bob_change, mode_of, sign, velocity_ratio
from tpd.compiled.custom_call import (
    BEGIN,
    RAMP,
    SETTINGS,
    addresses_in,
    entered,
    inputs_of,
    on_host,
    pieces,
    view,
)
from tpd.compiled.follow import ARRIVED, BEYOND, EXHAUSTED, forcing_now, store_results
from tpd.compiled.motion import (
    FIRST_PIECE,
    MOTION,
    NO,
    YES,
    copy_to,
    is_finite,
    larger_side,
    largest,
    reset_angles,
    reset_counts,
    update_angle,
    update_angles,
)
from tpd.compiled.period_map import set_motion
from tpd.compiled.plant import PLANT, compiled
from tpd.compiled.repetition import LONGEST, NEWEST
from tpd.compiled.trajectory import ROUNDING
from tpd.core.machine_code import stored

__all__ = ["CALL", "SETTINGS", "run"]

SETTLE, GROUND, STEADY_STATE, TRAJECTORY = range(4)
"""Tasks, which are the first number of every row of settings. Operands and results are those of
`linear_entry`, without derivatives."""
STILL = 1e-3
"""Largest change of the bob's state in a period, in shares of its scale, at which the motion to which the bob
settles is solved for."""
_STEPS, _CLOSED, _DIFFERENCE = 12, 1e-9, 1e-4
"""Bound on the steps of this solution; its largest residual, and the step of its differences, in shares of
the scales."""
MAX_STEPS = 20_000
"""Bound on the number of series for one piece of the forcing."""
_UNDECIDED = 64
"""Bound on the periods after the free motion of a run in which the block can overturn. A motion without
losses can rock permanently with enough energy to overturn."""
NOT_FINITE = 3
"""Outcome of a part of a run whose series is not finite, besides the outcomes of `tpd.compiled.follow`."""
_NONE, _LANDING, _TURN, _UP, _DOWN = -1, 0, 1, 2, 3
"""Events: none; landing and turning point of a slipping block; releases of a held block to either side."""


@compiled
def _excess(q, y, side, eta):
    """Return the moment on a held block minus the moment of its weight."""
    phi, psi, rate, pull, weight = y[TILT], y[SWING], y[SWING_RATE], -q.m12 / q.kappa, side * q.weight
    sp, cp, relative = math.sin(phi), math.cos(phi), phi - psi
    big_s = side * q.nu * math.sin(relative) + q.kappa * math.cos(relative)
    big_c = side * q.nu * math.cos(relative) - q.kappa * math.sin(relative)
    # Acceleration of the bob under a held block, from row 2 of (4).
    swing = (q.f * math.cos(psi) * eta - math.sin(psi) - q.c2 * rate) / q.m22
    on_block = q.up * sp - weight * cp - q.f * eta * (weight * sp + q.up * cp)
    bob = q.c1 * rate - pull * big_c * rate * rate + pull * big_s * swing
    return on_block + bob


@compiled
def decide(q, y, tilt, direction, eta, m):
    """Determine the mode of a state and write it into `m`.

    `tilt` and `direction` are the signs of phi and phi', and may be zero. `eta` is the forcing.
    """
    up = _excess(q, y, 1.0 if tilt == 0.0 else tilt, eta)
    down = _excess(q, y, -1.0, eta) if tilt == 0.0 else up
    m.kind, m.tilt, m.direction = mode_of(up, down, q.k + q.slack, tilt, direction)


@compiled
def _first_event(q, m, order, h, c):
    """Return the first event within the time h, and its time.

    Without an event, return the time until which this is proved.
    """
    if m.kind != SLIP:
        # A held block: the first of both releases counts.
        event, until = _NONE, h
        for release in (_UP, _DOWN):
            row = series.UP if release == _UP else series.DOWN
            t, vanishes = series.positive_until(c, row, 1.0, order, q.k + q.weight, until)
            if vanishes or t < until:
                event, until = (release if vanishes else _NONE), t
        return event, until
    # The acceleration is a difference of moments, and less accurate than the moments that release the block.
    until, turns = series.positive_until(c, series.V, m.direction, order, 10.0 * (q.k + q.weight) * h, h)
    # Until its turning point the block moves in one direction. It has landed if its tilt has changed its sign
    # by then.
    if m.tilt != m.direction and m.tilt * series.value_at(c, series.PHI, order, until) <= 0.0:
        landing, vanishes = series.positive_until(c, series.PHI, m.tilt, order, 0.0, until)
        # If the landing almost grazes the base, the proof may end before the landing. The next series
        # continues from there.
        return (_LANDING if vanishes or landing == until else _NONE), landing
    return (_TURN if turns else _NONE), until


@compiled
def _land(q, m, capture, eta):
    """Change the rates and the mode at the impact of a block that lands."""
    # A plant has no rho. The row of the bob has it as a factor.
    y, rho, before, side = m.y, -q.m21 / q.kappa, m.y[TILT_RATE], m.tilt
    sine, cosine = math.sin(y[SWING]), math.cos(y[SWING])
    ratio = velocity_ratio(q.e, q.nu, q.mu, q.lam, rho, q.kappa, side, sine, cosine)
    # A slow impact on a block that can be held is the end of a rattle: no rate remains.
    if abs(ratio * before) <= capture:
        decide(q, y, 0.0, 0.0, eta, m)
        if m.kind == REST:
            ratio = 0.0
    y[SWING_RATE] += bob_change(ratio, q.e, q.nu, q.lam, q.kappa, side, sine, cosine) * before
    y[TILT_RATE] = after = ratio * before
    decide(q, y, 0.0, math.copysign(1.0, after) if after != 0.0 else 0.0, eta, m)


@compiled
def _handle_event(q, m, event, at_once, capture, eta):
    """Change the state and the mode at an event. `at_once` is true if the series started with the event."""
    if event == _LANDING:
        m.impacts += 1
        _land(q, m, capture, eta)
    elif event == _TURN:
        decide(q, m.y, m.tilt, 0.0, eta, m)
        if at_once and m.kind == SLIP:
            # The block was released at a moment that only touched the limit. It does not move.
            m.kind = STICK if m.y[TILT] != 0.0 else REST
    else:
        # Release of a held block.
        side = 1.0 if event == _UP else -1.0
        m.tilt = side if m.kind == REST else m.tilt
        m.kind, m.direction = SLIP, side


@compiled
def _update_at_turns(m, k, c, order, h, tau):
    """Update the largest angle k where the angle turns within the time h from `tau` on.

    `k` is an index of angles in both `MOTION` and the series. Of both sides only the larger one is valid.
    """
    angle, t = series.largest_turn(c, k, order, h, m.peaks[larger_side(m, k // 2)])
    update_angle(m, k if angle > 0.0 else k + 1, abs(angle), tau + t)


@compiled
def advance(q, f, m, w, i, s, end):
    """Follow a motion through piece i of its forcing from the local time `s` to `end`, event by event.

    This updates the state, the mode and the counters of `m`. Returns one of `ARRIVED`, `BEYOND`, `EXHAUSTED`
    and `NOT_FINITE`.
    """
    y, c, origin = m.y, w.series, i * span_of(q, f)
    for _ in range(MAX_STEPS):
        remaining, tau = end - s, origin + s
        if remaining <= 1e-14 * w.period:
            return ARRIVED
        order, h = series.expand(q, m, load_at(q, f, i, s), remaining, w)
        # A step that is too short, or NaN, means that the series does not converge.
        if not h >= min(remaining, 1e-13 * w.period):
            return NOT_FINITE
        # No step is ever repeated, because the length of a step follows from its series.
        event, h = _first_event(q, m, order, h, c)
        series.store_state(c, order, h, y)
        overturned = not abs(y[TILT]) < 0.5 * math.pi
        if overturned:
            # Steps end at turning points of the block, so that the tilt has increased up to the end of this
            # step. Locate the time at which it reaches a right angle.
            event, h = _NONE, series.time_at_limit(c, series.PHI, order, 0.5 * math.pi, h)
            series.store_state(c, order, h, y)
        # The tilt is largest at events, which are ends of steps. The bob may turn within a step.
        update_angles(m, y[TILT], y[SWING], tau + h)
        _update_at_turns(m, series.PSI, c, order, h, tau)
        if w.relative:
            _update_at_turns(m, series.APART, c, order, h, tau)
        # Set the variable that vanishes at the event to exactly zero.
        if event == _LANDING:
            y[TILT] = 0.0
        elif event == _TURN:
            y[TILT_RATE] = 0.0
        s = end if h == remaining else s + h
        if overturned:
            m.overturn_time = origin + s
            return BEYOND
        if event != _NONE:
            m.events -= 1
            eta, _ = forcing_at(load_at(q, f, i, s), 0.0)
            _handle_event(q, m, event, h == 0.0, w.capture, eta)
            m.hold_level = 1.0 if m.hold_level > 0.0 or m.kind != SLIP else 0.0
            if m.kind == SLIP:
                m.uplift_time = min(m.uplift_time, origin + s)
            if m.events <= 0:
                return EXHAUSTED
    return EXHAUSTED


@compiled
def _one_period(q, f, m, w, s, ramp_end, events):
    """Follow a motion from the local time `s` to the end of the forcing period.

    Returns the outcome, see `advance`. The excitation has its full size from the local time `ramp_end` on.
    """
    reset_angles(m)
    m.hold_level, m.events = (2.0 if m.kind != SLIP else 0.0), events
    if 0.0 < ramp_end < w.period:
        # The forcing has a kink at the end of the ramp, and no series may cross it.
        ended = advance(q, f, m, w, FIRST_PIECE, s, ramp_end)
        if ended != ARRIVED:
            return ended
        f, s, m.events = steady(f.cubics), ramp_end, events
    return advance(q, f, m, w, FIRST_PIECE, s, w.period)


@compiled
def _scaled(q, w):
    """Set the period and the usual rates of a run under a harmonic. Return the scales of its state."""
    scales = repetition.scales_of(q)
    w.period, w.relative, w.rate, w.swing = 2.0 * math.pi / q.xi, NO, scales[TILT_RATE], scales[SWING_RATE]
    return scales


@compiled
def _is_still(q, m, before):
    """Whether the block was at rest, or held at a tilt, for a whole period with an almost steady bob.

    `before` is the state one period earlier.
    """
    y = m.y
    is_resting = m.kind == REST and largest(m, TILT) == 0.0
    is_sticking = m.kind == STICK and y[TILT] == before[TILT]
    angles = max(abs(y[TILT] - before[TILT]), abs(y[SWING] - before[SWING]))
    rates = max(abs(y[TILT_RATE] - before[TILT_RATE]), abs(y[SWING_RATE] - before[SWING_RATE]))
    change = max(angles, rates / q.xi) / (q.nu + q.f)
    return (is_resting or is_sticking) and (change < STILL or q.mu == 0.0)


@compiled
def _stays_held(q, m, w, psi, rate, trial):
    """Simulate a period from a state of the bob at tau = 0. Return whether the block stays held."""
    set_motion(m.y, m, trial)
    trial.y[SWING], trial.y[SWING_RATE] = psi, rate
    # A release would be an event, and only one event is allowed.
    return _one_period(q, steady(np.empty((0, 4))), trial, w, 0.0, 0.0, 1) == ARRIVED


@compiled
def _change_of_bob(q, m, w, psi, rate, trial):
    """Return the change of the bob's state in a period from tau = 0 on; NaN unless the block stays held."""
    is_held = _stays_held(q, m, w, psi, rate, trial)
    return (trial.y[SWING] - psi, trial.y[SWING_RATE] - rate) if is_held else (math.nan, math.nan)


@compiled
def _settled_swing(q, m, w, scales, remaining, trial, peaks):
    """Return the largest |psi| of the settled bob, or NaN unless the block is certainly held permanently.

    If it is held, this replaces the state of `m` by the settled one and updates `peaks`, for which the motion
    is followed for at most the number of `remaining` periods. An undamped bob is followed for all of them.
    `trial` is another motion.
    """
    psi, rate, span, n = m.y[SWING], m.y[SWING_RATE], math.sqrt(q.m22), 0
    step, error = _DIFFERENCE * scales[SWING], math.inf
    # Newton's method on the map of a period, which changes the state by (f, g), with the derivatives at its
    # start.
    f_rate, g_rate = _change_of_bob(q, m, w, psi, rate + step / span, trial)
    f_psi, g_psi = _change_of_bob(q, m, w, psi + step, rate, trial)
    f, g = _change_of_bob(q, m, w, psi, rate, trial)
    a, b = (f_psi - f) / step, (f_rate - f) * span / step
    c, d = (g_psi - g) / step, (g_rate - g) * span / step
    while error > _CLOSED and n < _STEPS:
        if n > 0:
            f, g = _change_of_bob(q, m, w, psi, rate, trial)
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
    # While the bob settles, its own swing adds to the moment on the block. Small angles give this share, and
    # twice of it includes the rest.
    own, slack = math.hypot(m.y[SWING] - psi, span * (m.y[SWING_RATE] - rate)), q.slack
    q.slack -= 2.0 * own * (q.up - 1.0 + abs(q.bias) / span)
    is_held = error <= _CLOSED and attracts and _stays_held(q, m, w, psi, rate, trial)
    q.slack, swing, u, v = slack, largest(trial, SWING), m.y[SWING], m.y[SWING_RATE]
    while is_held and remaining > 0 and (q.zeta == 0.0 or swing + own > peaks[SWING]):
        is_held = _stays_held(q, m, w, u, v, trial)
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
def _settle(q, m, w, s, since, ramp, trial, out):
    """Simulate a run until it repeats, rests or overturns, see `tpd.compiled.settle.settle`.

    The run starts from its state at tau = `since`. `trial` is another motion.
    """
    y, cubics, scales, events = m.y, np.empty((0, 4)), _scaled(q, w), int(s.events)
    past, peaks = np.zeros(LONGEST + 1, repetition.PERIOD), np.zeros(2)
    copy_to(y, past[NEWEST].y)
    reset_counts(m)
    f, ramp_end = repetition.excitation_in(ramp, w.period, 0.0, since, cubics)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, since), m)
    # A start within a period has another phase than the ends of periods, so that the two cannot be compared.
    count, status, repeats, elapsed = (1 if since == 0.0 else 0), NOT_SETTLED, 0, 0
    wait, rest_swing = 0, math.nan
    while elapsed < s.periods and status == NOT_SETTLED:
        if elapsed > 0:
            f, ramp_end = repetition.excitation_in(ramp, w.period, float(elapsed), 0.0, cubics)
        ended = _one_period(q, f, m, w, since if elapsed == 0 else 0.0, ramp_end, events)
        elapsed += 1
        peak, swing = largest(m, TILT), largest(m, SWING)
        peaks[TILT], peaks[SWING] = max(peaks[TILT], peak), max(peaks[SWING], swing)
        # States before the excitation became steady do not count for a repetition or for rest.
        is_steady = f.rate == 0.0 and ended == ARRIVED
        repeats = repetition.repeats_after(q, y, past, count, scales, s.tolerance) if is_steady else 0
        is_still = is_steady and count > 0 and _is_still(q, m, past[NEWEST].y)
        count = repetition.store_period(past, count if is_steady else 0, y, peak, swing, m.hold_level)
        was_held = repeats > 0 and repetition.was_held(past, repeats)
        if (is_still or was_held) and elapsed >= wait:
            rest_swing = _settled_swing(q, m, w, scales, int(s.periods) - elapsed, trial, peaks)
            wait = elapsed + _STEPS
        if ended == NOT_FINITE or not is_finite(y):
            status = FAILED
        elif ended != ARRIVED:
            status = OVERTURNED if ended == BEYOND else EVENT_BOUND
        elif repeats > 0 and not was_held:
            status = ROCKING
        elif was_held and q.zeta == 0.0 and q.mu > 0.0:
            # An undamped bob may repeat only after several periods.
            status, rest_swing = AT_REST, 0.0
            for j in range(repeats):
                rest_swing = max(rest_swing, past[j].swing)
        elif math.isfinite(rest_swing) or (is_still and q.mu == 0.0):
            # The block is at rest under a massless bob whether or not its swing is known.
            status, peaks[SWING] = AT_REST, peaks[SWING] + 0.0 * rest_swing
    if status == AT_REST:
        past[NEWEST].swing = rest_swing
    repetition.store_settled(status, repeats, elapsed, m, past, peaks, out)


@compiled
def _is_symmetric(q, m, w, s, y):
    """Whether a periodic motion with the state `y` at tau = 0 is its own mirror image half a period later."""
    f, half = steady(np.empty((0, 4))), math.pi / q.xi
    # The mirror image of a motion, half a period later, is a motion too. Both are equal if they reach the
    # same state.
    for i in range(4):
        m.y[i] = -y[i]
    reset_counts(m)
    decide(q, m.y, sign(m.y[TILT]), sign(m.y[TILT_RATE]), forcing_now(q, f, half), m)
    arrived = _one_period(q, f, m, w, half, 0.0, int(s.events)) == ARRIVED
    reach = max(s.tolerance, SYMMETRIC)
    return arrived and repetition.distance(q, m.y, y, repetition.scales_of(q)) < reach


@compiled
def _steady_state(q, m, w, s, trial, settled, out):
    """Simulate a run from its state at tau = 0 until it settles, and write its steady state into `out`.

    The largest multiplier, the Lyapunov exponent and the derivatives are NaN, because this model does not
    compute them. The fields `fold` and `multipliers` are not written.
    """
    _settle(q, m, w, s, 0.0, 0.0, trial, settled)
    status = int(settled.status)
    copy_to(m.y, out.state)
    out.amplitude, out.swing = settled.settled_tilt, settled.settled_swing
    out.multiplier = out.lyapunov = math.nan
    out.status, out.periods, out.elapsed = status, settled.periods, settled.elapsed
    out.by[:] = math.nan
    rocks = status in (ROCKING, STICKING) and int(settled.periods) % 2 == 1
    out.symmetric = 1.0 if rocks and _is_symmetric(q, m, w, s, out.state) else 0.0


@compiled
def _trajectory(q, m, w, s, times, out):
    """Simulate a run from its state at times[0], and return its status.

    The states at all times are written into `out`. They are NaN after the end of the run.
    """
    y, f, status = m.y, steady(np.empty((0, 4))), ROCKING
    _scaled(q, w)
    reset_counts(m)
    reset_angles(m)
    # Times are measured from the start of their forcing period, see `tpd.compiled.trajectory`.
    period = math.floor(times[0] / w.period + ROUNDING)
    t = times[0] - period * w.period
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, t), m)
    m.events = int(s.events)
    for n in range(len(times)):
        last = math.floor(times[n] / w.period + ROUNDING)
        while status == ROCKING and (period < last or t < times[n] - last * w.period):
            end = w.period if period < last else times[n] - last * w.period
            ended = advance(q, f, m, w, FIRST_PIECE, t, end)
            t = end
            if period < last:
                period, t, m.events = period + 1, 0.0, int(s.events)
            if ended == NOT_FINITE or not is_finite(y):
                status = FAILED
            elif ended != ARRIVED:
                status = OVERTURNED if ended == BEYOND else EVENT_BOUND
        for i in range(4):
            out[n, i] = y[i] if status == ROCKING else math.nan
    return status


@compiled
def _cannot_overturn(q, y):
    """Whether the energy of a free motion is too small to carry the block over its unstable equilibrium."""
    tilt, rate, swing = abs(y[TILT]), y[TILT_RATE], y[SWING_RATE]
    sine, cosine, relative = math.sin(tilt), math.cos(tilt), y[TILT] - y[SWING]
    lever = math.copysign(q.nu, y[TILT]) * math.sin(relative) + q.kappa * math.cos(relative)
    # Both potentials are relative to the equilibrium, where the bob hangs vertically.
    height = q.weight * sine + q.up * cosine - math.hypot(q.weight, q.up)
    bob = q.mu * q.lam * (1.0 - math.cos(y[SWING]) + 0.5 * q.m22 * swing * swing)
    energy = height + bob + rate * (0.5 * q.m11 * rate + q.m12 / q.kappa * lever * swing)
    return energy < 0.0 and q.up * sine < q.weight * cosine


@compiled
def _follow_once(q, f, m, w, s, trial):
    """Simulate a run through all pieces of a ground motion and then freely, and return its status.

    The free motion lasts for the time in the settings `s`. If the block can still overturn after it, `trial`
    continues the run until the outcome is certain.
    """
    y, i, ended = m.y, FIRST_PIECE, ARRIVED
    # There is no forcing period. The shorter time scale of bob and block defines which times are rounding
    # errors.
    w.period, w.relative = 2.0 * math.pi * min(1.0, math.sqrt(q.m22)), YES
    w.rate, w.swing = q.nu, (q.nu + q.f) * max(1.0, 1.0 / math.sqrt(q.m22))
    reset_counts(m)
    reset_angles(m)
    m.events = int(s.events)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, 0.0), m)
    if m.kind == SLIP or y[TILT] != 0.0:
        m.uplift_time = 0.0
    # The forcing has a kink at every sample, and no series may cross it.
    while i <= f.pieces and ended == ARRIVED:
        if m.kind != SLIP:
            # The base acceleration may jump at the start of a piece, and the jump may release the block.
            decide(q, y, 0.0 if m.kind == REST else m.tilt, 0.0, load_at(q, f, i, 0.0).e0, m)
            if m.kind == SLIP:
                m.uplift_time = min(m.uplift_time, i * span_of(q, f))
        ended = advance(q, f, m, w, i, 0.0, span_of(q, f) if i < f.pieces else s.free)
        i += 1
    set_motion(y, m, trial)
    trial.events, n = m.events, 0
    while ended == ARRIVED and n < _UNDECIDED and not _cannot_overturn(q, trial.y):
        begin = s.free + n * w.period
        if advance(q, f, trial, w, f.pieces, begin, begin + w.period) == BEYOND:
            ended, m.overturn_time = BEYOND, trial.overturn_time
        n += 1
    if ended == NOT_FINITE or not is_finite(y):
        return FAILED
    if ended != ARRIVED:
        return OVERTURNED if ended == BEYOND else EVENT_BOUND
    return STOOD if m.uplift_time == math.inf else ROCKED


@compiled
def _run(a, first, last):
    """Compute rows of a task. Each row has its settings, parameters and initial state.

    The other buffers, operands first, are: for SETTLE begin and ramp, and records `RUN`; for STEADY_STATE
    records `STEADY`; for TRAJECTORY times, states and statuses; for GROUND pieces and records `RUN`.
    Numbers that this model does not compute are NaN.
    """
    (s, x, start), (_, _, _, extra, results, ends, _, _) = inputs_of(a, last), addresses_in(a)
    plants, motions, works = np.empty(1, PLANT), np.zeros(2, MOTION), np.zeros(1, series.WORK)
    spare, count = np.empty(1, RUN), int(s[first].periods)
    q, m, trial, w = plants[0], motions[0], motions[1], works[0]
    for n in range(first, last):
        series.prepare(x[n], s[n], q, w)
        copy_to(start[n], m.y)
        if s[n].task == SETTLE:
            t, settled = view(extra, (last, 2), np.float64), view(results, (last,), RUN)
            _settle(q, m, w, s[n], t[n, BEGIN], t[n, RAMP], trial, settled[n])
        elif s[n].task == STEADY_STATE:
            _steady_state(q, m, w, s[n], trial, spare[FIRST_PIECE], view(extra, (last,), STEADY)[n])
        elif s[n].task == TRAJECTORY:
            times = view(extra, (last, count), np.float64)
            states = view(results, (last, count, 4), np.float64)
            view(ends, (last,), np.float64)[n] = _trajectory(q, m, w, s[n], times[n], states[n])
        else:
            out = view(results, (last,), RUN)[n]
            store_results(m, _follow_once(q, pieces(extra, s[n], n), m, w, s[n], trial), out)
            out.growing = out.transversality = math.nan
    # A record does not keep its array alive, and Numba frees an array after its last use.
    return len(plants) + len(motions) + len(works) + len(spare)


_enter = entered(_run, __name__)


def _entrance(version: int) -> Any:
    """Return the entry point to the compiled code. `version` is the checksum of the sources."""

    def call(address):
        """Compute the rows that a frame describes."""
        return _enter(address, version)

    # The values of variables from outside the function are part of the key of Numba's cache, see
    # `linear_entry`.
    return stored(call, numba.cfunc, "int64(int64)")


CALL = _entrance(checksum())
"""The entry point, an FFI handler for XLA."""
run = on_host(CALL)
"""Function for calls from Python. The arguments are the first row, the row after the last, then operands and
results."""
