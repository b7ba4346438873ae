"""Forcing periods of the linear equations until a motion repeats itself, rests or is lost.

The rules are those of `tpd.models.settling`. A motion that approaches its orbit slowly is taken there by
Newton's method.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arcs import span_of, steady
from tpd.exact.contact_kernel import decide, sign
from tpd.exact.follow import ARRIVED, LOST, Rules, allow, begin, forcing_now, piece
from tpd.exact.legs import STATE
from tpd.exact.mode_kinds import REST, STICK
from tpd.exact.motion import FIRST_PIECE, LEG, NO, YES, clear
from tpd.exact.near_orbits import CONVERGED, NEARBY, Limits, Past, finite, largest, orbit_near
from tpd.exact.plant import compiled, plant, plant_along
from tpd.exact.repetition import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    LONGEST,
    NOT_SETTLED,
    OVERTURNED,
    ROCKING,
    remember,
    repeats_after,
    scales_of,
    settled,
    shaking_in,
    stayed,
)

_WORTH = 24
"""Forcing periods that may be followed in the time in which an orbit of one period is found."""


@compiled
def _bob_under_held(q, y, phase):
    """Largest moment of forcing, decaying and steady swing on a held block, and the bob's reach (rad), from
    the state at a phase of steady forcing; a bob under a block that does not move is a damped oscillator."""
    s, c, sine, cosine = q.swing_sin, q.swing_cos, math.sin(phase), math.cos(phase)
    two_mu = q.up - 1.0
    along, across = -q.f - two_mu * s - q.bias * q.xi * c, -two_mu * c + q.bias * q.xi * s
    psi = y[1] - s * sine - c * cosine
    rate = y[3] - q.xi * (s * cosine - c * sine)
    swing = math.sqrt(psi * psi + rate * rate / q.held_q)
    decaying = two_mu * swing + abs(q.bias) * swing * math.sqrt(q.held_q)
    return math.hypot(along, across) + decaying, math.hypot(s, c) + swing


@compiled
def _come_to_rest(q, y):
    """Change a state at tau = 0 to that which a block at rest, or held leaning, comes to; an undamped bob
    keeps its own swing."""
    if q.zeta > 0.0:
        y[1], y[2], y[3] = q.swing_cos, 0.0, q.xi * q.swing_sin


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
    low = max(peak, abs(y[0])) < tolerance * q.nu
    if low and (q.k > 0.0 or q.e < 1.0) and left > 0.0:
        mode.kind, y[0] = REST, 0.0
        return True, reach
    lever = abs(q.up * y[0] - mode.tilt * q.weight)
    if y[0] != 0.0 and pull + lever < q.k:
        return True, (math.hypot(q.swing_sin, q.swing_cos) if q.held_p > 0.0 else reach)
    return False, reach


@compiled
def _repeats_at_rest(q, m, last, repeats, tolerance):
    """Whether a motion that repeats itself after so many periods, with the block held throughout, goes on
    like that for good. If so, change the state to that which it comes to, and put the bob's reach into
    `last`."""
    # What is left of the decay of a damped bob is less than the tolerance, but under its steady swing the
    # block may lift, if by as little. An undamped bob goes on as in these periods.
    if q.zeta == 0.0:
        for j in range(1, repeats):
            last[0, 1] = max(last[0, 1], last[j, 1])
        return True
    psi, tilting, swinging = m.y[1], m.y[2], m.y[3]
    _come_to_rest(q, m.y)
    rests, reach = _rests(q, m, 0.0, 0.0, tolerance)
    if rests:
        last[0, 1] = reach
    else:
        m.y[1], m.y[2], m.y[3] = psi, tilting, swinging
    return rests


@compiled
def _slow_repetition(q, past, known, tolerance, before):
    """Forcing periods after which a motion all but repeats itself, if it would take longer to repeat itself
    than its orbit takes to find; 0 if not. `before` holds the last distance and its periods."""
    step, closest, periods, scales = (1 if q.mu > 0.0 else 2), NEARBY, 0, scales_of(q)
    for n in range(1, known // 2):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(past[0, i] - past[n, i]) / scales[i])
        if error < 0.1 * closest or (n == 1 and error < closest):
            closest, periods = error, n
    # Decay in one period, from the last two distances if they belong to one number of periods.
    share = closest / before[0] if before[1] == periods and before[0] > 0.0 else 0.0
    before[0], before[1] = closest, periods
    if periods == 0 or share == 0.0:
        return 0
    left = math.log(closest / tolerance) / -math.log(share) if share < 1.0 else math.inf
    return periods if left > _WORTH * periods else 0


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
def settle(x, q, m, room, r, s, since, ramp, out):
    """Follow one motion from its state at tau = `since` until it repeats, rests, is lost, or the periods of
    the settings `s` have elapsed. The shaking grows over `ramp` periods. Put the results into `out`, and
    return status, periods of the motion and periods elapsed."""
    plant(x, q)
    y, period, tolerance, capture, events = (
        m.y,
        2.0 * math.pi / q.xi,
        s.tolerance,
        s.rest_rate * q.nu,
        int(s.events),
    )
    limits, scales, cubics, legs = (
        Limits(capture, events, 1),
        scales_of(q),
        np.empty((0, 4)),
        np.empty(0, LEG),
    )
    past = Past(np.zeros((LONGEST, 4)), np.zeros((LONGEST, 3)), np.zeros(2))
    before, last = np.zeros(2), past.sizes
    for i in range(4):
        past.states[0, i] = y[i]
    clear(m)
    f, grown = shaking_in(ramp, period, 0.0, since, cubics)
    decide(q, y, sign(y[0]), sign(y[2]), forcing_now(q, f, since), m)
    past.peaks[0], past.peaks[1] = abs(y[0]), abs(y[1])
    rests = False
    if m.kind == REST and f.rate == 0.0:
        rests, reach = _rests(q, m, past.peaks[0], q.xi * since, tolerance)
        if rests:
            last[0, 1], past.peaks[1] = reach, max(past.peaks[1], reach)
            _come_to_rest(q, y)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    known, repeats, elapsed, wait = (1 if since == 0.0 else 0), 0, 0, 0
    status = AT_REST if rests else NOT_SETTLED
    # Squares of the angles that are no numbers prove nothing about events.
    if not math.isfinite(q.tilt_sin * q.tilt_sin + q.bob_sin * q.bob_sin):
        y[0] = math.nan
    while elapsed < s.periods and status == NOT_SETTLED and finite(y):
        if elapsed > 0:
            f, grown = shaking_in(ramp, period, float(elapsed), 0.0, cubics)
        ended = _one_period(q, f, m, legs, room, since if elapsed == 0 else 0.0, grown, limits)
        sound, elapsed = ended == ARRIVED and finite(y), elapsed + 1
        # Whether the shaking grew in this period, and whether it goes on growing in the next one.
        grew, grows = f.rate > 0.0, f.rate > 0.0 and grown >= (1.0 - 1e-12) * period
        peak, stroke = max(largest(m, 0), abs(y[0])), largest(m, 1)
        past.peaks[0], past.peaks[1] = max(past.peaks[0], peak), max(past.peaks[1], stroke)
        rests = False
        if sound and not grows:
            rests, reach = _rests(q, m, peak, 0.0, tolerance)
            if rests:
                _come_to_rest(q, y)
                past.peaks[1], stroke = max(past.peaks[1], reach), reach
        # Nothing that was met before the shaking became steady counts as a repetition.
        repeats = repeats_after(q, y, past.states, known, scales, tolerance) if sound and not grew else 0
        known = remember(past.states, 0 if grew else known, last, y, peak, stroke, m.held)
        if not sound:
            status = OVERTURNED if ended == LOST else EVENT_BOUND
        elif rests:
            status = AT_REST
        elif repeats > 0 and not stayed(last, repeats):
            status = ROCKING
        elif repeats > 0:
            status = AT_REST if _repeats_at_rest(q, m, last, repeats, tolerance) else NOT_SETTLED
            # A damped bob under a block at rest repeats itself after one period, whatever came first.
            repeats = 0 if q.zeta > 0.0 or status == NOT_SETTLED else repeats
        elif not grows and tolerance >= CONVERGED and elapsed >= wait:
            tried = _slow_repetition(q, past.states, known, tolerance, before)
            if tried > 0:
                wait = 2 * elapsed
                plant_along(x, STATE, r.plants[STATE])
                if orbit_near(q, steady(cubics), m, room, r, past, known, Limits(capture, events, tried)):
                    status, repeats = ROCKING, tried
                    # A block that leans and is held all the time does not rock.
                    rests, reach = _rests(q, m, last[0, 0], 0.0, tolerance)
                    if rests:
                        _come_to_rest(q, y)
                        status, repeats, last[0, 1] = AT_REST, 0, reach
                        past.peaks[1] = max(reach, past.peaks[1])
    if status != OVERTURNED and not finite(y):
        status = FAILED
    status, own = settled(status, repeats, m, last, past.peaks, out)
    return status, own, elapsed
