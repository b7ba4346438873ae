"""Forcing periods of the linear equations until a motion repeats itself, rests or is lost.

The rules are those of `tpd.models.settling`. A motion that approaches its orbit slowly is taken there by
Newton's method.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact import repetition
from tpd.exact.arcs import span_of, steady
from tpd.exact.contact_kernel import decide, sign
from tpd.exact.follow import ARRIVED, BEYOND, Rules, allow_events, follow_piece, forcing_now, start_angles
from tpd.exact.legs import STATE
from tpd.exact.march import prepare_march
from tpd.exact.motion import FIRST_PIECE, LEG, NO, YES, copy_to, is_finite, largest, reset_counts
from tpd.exact.near_orbits import CONVERGED, NEARBY, Past, orbit_near
from tpd.exact.period_map import Limits, records_of
from tpd.exact.plant import compiled, plant, plant_along
from tpd.exact.terms import REST, STICK, SWING, SWING_RATE, TILT, TILT_RATE

_NONE = np.int64(0)
"""No periods."""
_PERIODS_PER_SEARCH = 24
"""Forcing periods that may be followed in the time in which an orbit of one period is found."""


@compiled
def _bob_under_held(q, y, phase):
    """Largest moment of forcing, decaying and steady swing on a held block, and the bob's reach (rad), from
    the state at a phase of steady forcing; a bob under a block that does not move is a damped oscillator."""
    s, c, sine, cosine = q.swing_sin, q.swing_cos, math.sin(phase), math.cos(phase)
    two_mu = q.up - 1.0
    along, across = -q.f - two_mu * s - q.bias * q.xi * c, -two_mu * c + q.bias * q.xi * s
    psi = y[SWING] - s * sine - c * cosine
    rate = y[SWING_RATE] - q.xi * (s * cosine - c * sine)
    swing = math.sqrt(psi * psi + rate * rate / q.held_q)
    decaying = two_mu * swing + abs(q.bias) * swing * math.sqrt(q.held_q)
    return math.hypot(along, across) + decaying, math.hypot(s, c) + swing


@compiled
def _come_to_rest(q, y):
    """Change a state at tau = 0 to that which a block at rest, or held leaning, comes to; an undamped bob
    keeps its own swing."""
    if q.zeta > 0.0:
        y[SWING], y[TILT_RATE], y[SWING_RATE] = q.swing_cos, 0.0, q.xi * q.swing_sin


@compiled
def _is_at_rest(q, m, peak, phase, tolerance):
    """Whether the block rests, or is held leaning, for good under steady shaking, and the bob's reach; it
    changes the mode and the state of one that rattles out, below the height `peak`."""
    y, mode = m.y, m
    pull, reach = _bob_under_held(q, y, phase)
    left = 1.0 - pull / (q.weight + q.k)
    if mode.kind == REST:
        return left >= 0.0, reach
    if mode.kind != STICK:
        return False, reach
    # A rattle with e < 1 comes to rest within finite time, and each slow impact is captured at once. Hops
    # under strong friction lack that limit: friction holds the block a little above its base until the moment
    # has turned, so that one hop takes a good part of a period, each smaller than the last. Below the
    # tolerance of a repetition they change nothing any more: the block counts as at rest if the bob cannot
    # lift it.
    low = max(peak, abs(y[TILT])) < tolerance * q.nu
    if low and (q.k > 0.0 or q.e < 1.0) and left > 0.0:
        mode.kind, y[TILT] = REST, 0.0
        return True, reach
    lever = abs(q.up * y[TILT] - mode.tilt * q.weight)
    if y[TILT] != 0.0 and pull + lever < q.k:
        return True, (math.hypot(q.swing_sin, q.swing_cos) if q.held_p > 0.0 else reach)
    return False, reach


@compiled
def _repeats_at_rest(q, m, past, repeats, tolerance):
    """Whether a motion that repeats itself after so many periods, with the block held throughout, goes on
    like that for good. If so, change the state to that which it comes to, and put the bob's reach into
    the last period."""
    # What is left of the decay of a damped bob is less than the tolerance, but under its steady swing the
    # block may lift, if by as little. An undamped bob goes on as in these periods.
    if q.zeta == 0.0:
        for j in range(1, repeats):
            past[0].swing = max(past[0].swing, past[j].swing)
        return True
    psi, tilting, swinging = m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE]
    _come_to_rest(q, m.y)
    is_resting, reach = _is_at_rest(q, m, 0.0, 0.0, tolerance)
    if is_resting:
        past[0].swing = reach
    else:
        m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE] = psi, tilting, swinging
    return is_resting


@compiled
def _slow_repetition(q, past, count, tolerance, gap, gap_periods):
    """Forcing periods after which a motion all but repeats itself, if it would take longer to repeat itself
    than its orbit takes to find, 0 if not; the distance at which it does so, and after how many periods.
    These two were `before` and `of` a period ago."""
    step, closest, periods, scales = (1 if q.mu > 0.0 else 2), NEARBY, 0, repetition.scales_of(q)
    for n in range(1, count // 2):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(past[0].y[i] - past[n].y[i]) / scales[i])
        if error < 0.1 * closest or (n == 1 and error < closest):
            closest, periods = error, n
    # Decay in one period, from the last two distances if they belong to one number of periods.
    decay = closest / gap if gap_periods == periods and gap > 0.0 else 0.0
    if periods == 0 or decay == 0.0:
        return 0, closest, periods
    left = math.log(closest / tolerance) / -math.log(decay) if decay < 1.0 else math.inf
    return (periods if left > _PERIODS_PER_SEARCH * periods else 0), closest, periods


@compiled
def _one_period(q, f, m, legs, w, s, rising, limits):
    """Follow a motion from the local time `s` to the end of the forcing period; the shaking has its full size
    `grown` from the beginning of the period on. Return how the motion ended."""
    period, rules = span_of(q, f), Rules(limits.capture, YES, NO, NO)
    start_angles(q, f, m, FIRST_PIECE, s)
    if f.rate > 0.0 and rising < (1.0 - 1e-12) * period:
        # The forcing has a kink where its growth ends.
        allow_events(m, w, limits.events)
        ended = follow_piece(q, f, m, legs, w, FIRST_PIECE, s, rising, rules)
        f, s = steady(f.cubics), rising
        if ended != ARRIVED:
            return ended
    allow_events(m, w, limits.events)
    return follow_piece(q, f, m, legs, w, FIRST_PIECE, s, period, rules)


@compiled
def settle(x, buffers, s, since, ramp, out):
    """Follow one motion from its state at tau = `since` until it repeats, rests, is lost, or the periods of
    the settings `s` have elapsed. The shaking grows over `ramp` periods. Put what the motion settles to into
    `out`."""
    q, m, w, r = records_of(buffers)
    plant(x, q)
    prepare_march(q, w.march)
    y, period, tolerance, capture = m.y, 2.0 * math.pi / q.xi, s.tolerance, s.rest_rate * q.nu
    events, scales, cubics, legs = int(s.events), repetition.scales_of(q), np.empty((0, 4)), np.empty(0, LEG)
    limits = Limits(capture, events, STATE, NEARBY)
    past, gap, gap_periods = Past(np.zeros(repetition.LONGEST, repetition.PERIOD), np.zeros(2)), 0.0, _NONE
    last, peaks = past.periods, past.peaks
    copy_to(y, last[0].y)
    reset_counts(m)
    f, rising = repetition.excitation_in(ramp, period, 0.0, since, cubics)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, since), m)
    peaks[TILT], peaks[SWING] = abs(y[TILT]), abs(y[SWING])
    is_resting = False
    if m.kind == REST and f.rate == 0.0:
        is_resting, reach = _is_at_rest(q, m, peaks[TILT], q.xi * since, tolerance)
        if is_resting:
            last[0].swing, peaks[SWING] = reach, max(peaks[SWING], reach)
            _come_to_rest(q, y)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    count, repeats, elapsed, wait = (1 if since == 0.0 else 0), 0, 0, 0
    status = repetition.AT_REST if is_resting else repetition.NOT_SETTLED
    # Squares of the angles that are no numbers prove nothing about events.
    if not math.isfinite(q.tilt_sin * q.tilt_sin + q.bob_sin * q.bob_sin):
        y[TILT] = math.nan
    while elapsed < s.periods and status == repetition.NOT_SETTLED and is_finite(y):
        if elapsed > 0:
            f, rising = repetition.excitation_in(ramp, period, float(elapsed), 0.0, cubics)
        ended = _one_period(q, f, m, legs, w, since if elapsed == 0 else 0.0, rising, limits)
        sound, elapsed = ended == ARRIVED and is_finite(y), elapsed + 1
        # Whether the shaking grew in this period, and whether it goes on growing in the next one.
        grew, grows = f.rate > 0.0, f.rate > 0.0 and rising >= (1.0 - 1e-12) * period
        peak, swing = max(largest(m, TILT), abs(y[TILT])), largest(m, SWING)
        peaks[TILT], peaks[SWING] = max(peaks[TILT], peak), max(peaks[SWING], swing)
        is_resting = False
        if sound and not grows:
            is_resting, reach = _is_at_rest(q, m, peak, 0.0, tolerance)
            if is_resting:
                _come_to_rest(q, y)
                peaks[SWING], swing = max(peaks[SWING], reach), reach
        # Nothing that was met before the shaking became steady counts as a repetition.
        repeats = repetition.repeats_after(q, y, last, count, scales, tolerance) if sound and not grew else 0
        count = repetition.store_period(last, 0 if grew else count, y, peak, swing, m.hold_level)
        if not sound:
            status = repetition.OVERTURNED if ended == BEYOND else repetition.EVENT_BOUND
        elif is_resting:
            status = repetition.AT_REST
        elif repeats > 0 and not repetition.was_held(last, repeats):
            status = repetition.ROCKING
        elif repeats > 0:
            is_resting = _repeats_at_rest(q, m, last, repeats, tolerance)
            status = repetition.AT_REST if is_resting else repetition.NOT_SETTLED
            # A damped bob under a block at rest repeats itself after one period, whatever came first.
            repeats = 0 if q.zeta > 0.0 or status == repetition.NOT_SETTLED else repeats
        elif not grows and tolerance >= CONVERGED and elapsed >= wait:
            candidate, gap, gap_periods = _slow_repetition(q, last, count, tolerance, gap, gap_periods)
            if candidate > 0:
                wait = 2 * elapsed
                plant_along(x, STATE, r.plants[STATE])
                if orbit_near(q, m, buffers, past, count, limits, candidate):
                    status, repeats = repetition.ROCKING, candidate
                    # A block that leans and is held all the time does not rock.
                    is_resting, reach = _is_at_rest(q, m, last[0].tilt, 0.0, tolerance)
                    if is_resting:
                        _come_to_rest(q, y)
                        status, repeats, last[0].swing = repetition.AT_REST, 0, reach
                        peaks[SWING] = max(reach, peaks[SWING])
    if status != repetition.OVERTURNED and not is_finite(y):
        status = repetition.FAILED
    repetition.store_settled(status, repeats, elapsed, m, last, peaks, out)
