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
from tpd.exact.follow import ARRIVED, LOST, Rules, allow, begin, forcing_now, piece
from tpd.exact.legs import STATE
from tpd.exact.march import put_flow
from tpd.exact.motion import FIRST_PIECE, LEG, NO, YES, clear, finite, largest, put
from tpd.exact.near_orbits import CONVERGED, NEARBY, Past, orbit_near
from tpd.exact.period_map import Limits, first_of
from tpd.exact.plant import compiled, plant, plant_along
from tpd.exact.terms import REST, STICK, SWING, SWING_RATE, TILT, TILT_RATE

_NONE = np.int64(0)
"""No periods."""
_WORTH = 24
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
def _rests(q, m, peak, phase, tolerance):
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
    rests, reach = _rests(q, m, 0.0, 0.0, tolerance)
    if rests:
        past[0].swing = reach
    else:
        m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE] = psi, tilting, swinging
    return rests


@compiled
def _slow_repetition(q, past, known, tolerance, before, of):
    """Forcing periods after which a motion all but repeats itself, if it would take longer to repeat itself
    than its orbit takes to find, 0 if not; the distance at which it does so, and after how many periods.
    These two were `before` and `of` a period ago."""
    step, closest, periods, scales = (1 if q.mu > 0.0 else 2), NEARBY, 0, repetition.scales_of(q)
    for n in range(1, known // 2):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(past[0].y[i] - past[n].y[i]) / scales[i])
        if error < 0.1 * closest or (n == 1 and error < closest):
            closest, periods = error, n
    # Decay in one period, from the last two distances if they belong to one number of periods.
    share = closest / before if of == periods and before > 0.0 else 0.0
    if periods == 0 or share == 0.0:
        return 0, closest, periods
    left = math.log(closest / tolerance) / -math.log(share) if share < 1.0 else math.inf
    return (periods if left > _WORTH * periods else 0), closest, periods


@compiled
def _one_period(q, f, m, legs, room, s, grown, limits):
    """Follow a motion from the local time `s` to the end of the forcing period; the shaking has its full size
    `grown` from the beginning of the period on. Return how the motion ended."""
    period, rules = span_of(q, f), Rules(limits.capture, YES, NO, NO)
    begin(q, f, m, FIRST_PIECE, s)
    if f.rate > 0.0 and grown < (1.0 - 1e-12) * period:
        # The forcing has a kink where its growth ends.
        allow(m, room, limits.events)
        ended = piece(q, f, m, legs, room, FIRST_PIECE, s, grown, rules)
        f, s = steady(f.cubics), grown
        if ended != ARRIVED:
            return ended
    allow(m, room, limits.events)
    return piece(q, f, m, legs, room, FIRST_PIECE, s, period, rules)


@compiled
def settle(x, own, s, since, ramp, out):
    """Follow one motion from its state at tau = `since` until it repeats, rests, is lost, or the periods of
    the settings `s` have elapsed. The shaking grows over `ramp` periods. Put what the motion settles to into
    `out`."""
    q, m, room, r = first_of(own)
    plant(x, q)
    put_flow(q, room.march)
    y, period, tolerance, capture = m.y, 2.0 * math.pi / q.xi, s.tolerance, s.rest_rate * q.nu
    events, scales, cubics, legs = int(s.events), repetition.scales_of(q), np.empty((0, 4)), np.empty(0, LEG)
    limits = Limits(capture, events, STATE, NEARBY)
    past, before, of = Past(np.zeros(repetition.LONGEST, repetition.PERIOD), np.zeros(2)), 0.0, _NONE
    last, peaks = past.periods, past.peaks
    put(y, last[0].y)
    clear(m)
    f, grown = repetition.excitation_in(ramp, period, 0.0, since, cubics)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, since), m)
    peaks[TILT], peaks[SWING] = abs(y[TILT]), abs(y[SWING])
    rests = False
    if m.kind == REST and f.rate == 0.0:
        rests, reach = _rests(q, m, peaks[TILT], q.xi * since, tolerance)
        if rests:
            last[0].swing, peaks[SWING] = reach, max(peaks[SWING], reach)
            _come_to_rest(q, y)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    known, repeats, elapsed, wait = (1 if since == 0.0 else 0), 0, 0, 0
    status = repetition.AT_REST if rests else repetition.NOT_SETTLED
    # Squares of the angles that are no numbers prove nothing about events.
    if not math.isfinite(q.tilt_sin * q.tilt_sin + q.bob_sin * q.bob_sin):
        y[TILT] = math.nan
    while elapsed < s.periods and status == repetition.NOT_SETTLED and finite(y):
        if elapsed > 0:
            f, grown = repetition.excitation_in(ramp, period, float(elapsed), 0.0, cubics)
        ended = _one_period(q, f, m, legs, room, since if elapsed == 0 else 0.0, grown, limits)
        sound, elapsed = ended == ARRIVED and finite(y), elapsed + 1
        # Whether the shaking grew in this period, and whether it goes on growing in the next one.
        grew, grows = f.rate > 0.0, f.rate > 0.0 and grown >= (1.0 - 1e-12) * period
        peak, swing = max(largest(m, TILT), abs(y[TILT])), largest(m, SWING)
        peaks[TILT], peaks[SWING] = max(peaks[TILT], peak), max(peaks[SWING], swing)
        rests = False
        if sound and not grows:
            rests, reach = _rests(q, m, peak, 0.0, tolerance)
            if rests:
                _come_to_rest(q, y)
                peaks[SWING], swing = max(peaks[SWING], reach), reach
        # Nothing that was met before the shaking became steady counts as a repetition.
        repeats = repetition.repeats_after(q, y, last, known, scales, tolerance) if sound and not grew else 0
        known = repetition.remember(last, 0 if grew else known, y, peak, swing, m.held)
        if not sound:
            status = repetition.OVERTURNED if ended == LOST else repetition.EVENT_BOUND
        elif rests:
            status = repetition.AT_REST
        elif repeats > 0 and not repetition.stayed(last, repeats):
            status = repetition.ROCKING
        elif repeats > 0:
            rests = _repeats_at_rest(q, m, last, repeats, tolerance)
            status = repetition.AT_REST if rests else repetition.NOT_SETTLED
            # A damped bob under a block at rest repeats itself after one period, whatever came first.
            repeats = 0 if q.zeta > 0.0 or status == repetition.NOT_SETTLED else repeats
        elif not grows and tolerance >= CONVERGED and elapsed >= wait:
            tried, before, of = _slow_repetition(q, last, known, tolerance, before, of)
            if tried > 0:
                wait = 2 * elapsed
                plant_along(x, STATE, r.plants[STATE])
                if orbit_near(q, m, own, past, known, limits, tried):
                    status, repeats = repetition.ROCKING, tried
                    # A block that leans and is held all the time does not rock.
                    rests, reach = _rests(q, m, last[0].tilt, 0.0, tolerance)
                    if rests:
                        _come_to_rest(q, y)
                        status, repeats, last[0].swing = repetition.AT_REST, 0, reach
                        peaks[SWING] = max(reach, peaks[SWING])
    if status != repetition.OVERTURNED and not finite(y):
        status = repetition.FAILED
    repetition.put_settled(status, repeats, elapsed, m, last, peaks, out)
