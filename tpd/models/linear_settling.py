"""Compiled loop over forcing periods of the linear equations: when a motion repeats, rests or is lost.

The rules are those of `tpd.models.settling`. A motion that approaches its orbit slowly is taken there by
Newton's method.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import compiled, plant
from tpd.exact.event_kernel import ARRIVED, LEG, LOST, advance, begin, decide, share_at, sign
from tpd.exact.mode_kinds import REST, STICK
from tpd.models.linear_orbit import CONVERGED, NEARBY, finite, orbit_near
from tpd.models.period_kernel import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    LONGEST,
    NOT_SETTLED,
    OVERTURNED,
    ROCKING,
    growth_in,
    remember,
    repeats_after,
    scales_of,
    settled,
    stayed,
)

_WORTH = 24
"""Forcing periods that may be followed in the time in which an orbit of one period is found."""


@compiled
def _bob_under_held(q, y, phase):
    """Largest moment of forcing, decaying and steady swing on a held block, and the bob's reach (rad), from
    the state at a phase of steady forcing."""
    # R = -f sin - 2 mu psi + bias psi' for the steady swing, whose rate is xi (s cos - c sin).
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
def _rests(q, y, mode, sizes, phase, tolerance):
    """Whether the block rests, or is held leaning, for good under steady shaking, and the bob's reach; it
    changes the mode and the state of one that rattles out."""
    pull, reach = _bob_under_held(q, y, phase)
    left = 1.0 - pull / (q.weight + q.k)
    if mode[0] == REST:
        return left >= 0.0, reach
    if mode[0] != STICK:
        return False, reach
    # A rattle with e < 1 comes to rest within finite time, and each impact below `rest_rate` is captured at
    # once. Hops under strong friction lack that limit: friction holds the block a little above its base
    # until the moment has turned, so that one hop takes a good part of a period. Below the tolerance of a
    # repetition they change nothing any more, and the block is at rest if the bob cannot lift it from there.
    low = max(max(sizes[0], sizes[1]), abs(y[0])) < tolerance * q.nu
    if low and (q.k > 0.0 or q.e < 1.0) and left > 0.0:
        mode[0], y[0] = REST, 0.0
        return True, reach
    lever = abs(q.up * y[0] - mode[1] * q.weight)
    if y[0] != 0.0 and pull + lever < q.k:
        return True, (math.hypot(q.swing_sin, q.swing_cos) if q.held_p > 0.0 else reach)
    return False, reach


@compiled
def _repeats_at_rest(q, y, mode, last, repeats, tolerance):
    """Whether a motion that repeats itself after so many periods, with the block held throughout, goes on
    like that for good. If so, change the state to that which it comes to, and put the bob's reach into
    `last`."""
    # What is left of the decay of a damped bob is less than the tolerance, but under its steady swing the
    # block may lift, if by as little. An undamped bob goes on as in these periods.
    if q.zeta == 0.0:
        for j in range(1, repeats):
            last[0, 1] = max(last[0, 1], last[j, 1])
        return True
    before = y.copy()
    _come_to_rest(q, y)
    rests, reach = _rests(q, y, mode, np.zeros(2), 0.0, tolerance)
    if rests:
        last[0, 1] = reach
    else:
        for i in range(4):
            y[i] = before[i]
    return rests


@compiled
def _slow_repetition(q, past, known, scales, tolerance, before):
    """Forcing periods after which a motion all but repeats itself, if it would take longer to repeat itself
    than its orbit takes to find; 0 if not. `before` holds the last distance and its periods."""
    step, closest, periods = (1 if q.mu > 0.0 else 2), NEARBY, 0
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
def _one_period(q, growth, grown, mode, y, t, sizes, legs, count, capture, max_events):
    """Follow a motion to the end of the forcing period: how it ended. `growth` tells that of the end."""
    period = 2.0 * math.pi / q.xi
    begin(q, growth, mode, y, t, sizes)
    if growth[1] > 0.0 and grown < (1.0 - 1e-12) * period:
        # The forcing has a kink where its growth ends.
        ended = advance(q, growth, mode, y, t, grown, sizes, legs, count, capture, max_events)
        growth[0], growth[1], t = 1.0, 0.0, grown
        if ended != ARRIVED:
            return ended
    return advance(q, growth, mode, y, t, period, sizes, legs, count, capture, max_events)


@compiled
def _started(q, growth, ramp, mode, y, since, tolerance, last, peaks):
    """Prepare a motion that begins: whether it rests for good, and when the shaking has its full size."""
    grown = growth_in(growth, ramp, 2.0 * math.pi / q.xi, 0.0)
    if grown <= since:
        growth[0], growth[1] = 1.0, 0.0
    phase = q.xi * since
    decide(q, y, sign(y[0]), sign(y[2]), share_at(growth, since) * math.sin(phase), mode)
    peaks[0], peaks[1] = abs(y[0]), abs(y[1])
    if mode[0] != REST or growth[1] > 0.0:
        return False, grown
    rests, reach = _rests(q, y, mode, peaks, phase, tolerance)
    if rests:
        last[0, 1], peaks[1] = reach, max(peaks[1], reach)
        _come_to_rest(q, y)
    return rests, grown


@compiled
def settle(x, plants, complex_plants, y0, since, ramp, periods, max_events, tolerance, rest_rate, out):
    """Follow one motion from `y0` at tau = `since` until it repeats, rests, is lost, or `periods` have
    elapsed: status, its periods and the periods elapsed. The shaking grows over `ramp` periods."""
    q = plants[0]
    plant(x, q)
    period, capture, scales = 2.0 * math.pi / q.xi, rest_rate * q.nu, scales_of(q)
    past, last, peaks, y = np.zeros((LONGEST, 4)), np.zeros((LONGEST, 3)), np.zeros(2), np.empty(4)
    growth, mode, sizes, before = np.zeros(2), np.zeros(4), np.zeros(6), np.zeros(2)
    legs, count = np.empty((0, LEG)), np.zeros(1, np.int64)
    for i in range(4):
        y[i] = past[0, i] = y0[i]
    rests, grown = _started(q, growth, ramp, mode, y, since, tolerance, last, peaks)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    known, repeats, elapsed, wait = (1 if since == 0.0 else 0), 0, 0, 0
    status = AT_REST if rests else NOT_SETTLED
    # Squares of the angles that are no numbers prove nothing about events.
    if not math.isfinite(q.tilt_sin * q.tilt_sin + q.bob_sin * q.bob_sin):
        y[0] = math.nan
    while elapsed < periods and status == NOT_SETTLED and finite(y):
        if elapsed > 0:
            grown = growth_in(growth, ramp, period, float(elapsed))
        grew, t = growth[1] > 0.0, (since if elapsed == 0 else 0.0)
        ended = _one_period(q, growth, grown, mode, y, t, sizes, legs, count, capture, max_events)
        sound, elapsed = ended == ARRIVED and finite(y), elapsed + 1
        peak, stroke = max(max(sizes[0], sizes[1]), abs(y[0])), max(sizes[2], sizes[3])
        peaks[0], peaks[1] = max(peaks[0], peak), max(peaks[1], stroke)
        if sound and growth[1] == 0.0:
            rests, reach = _rests(q, y, mode, sizes, 0.0, tolerance)
            if rests:
                _come_to_rest(q, y)
                peaks[1], stroke = max(peaks[1], reach), reach
        # Nothing that was met before the shaking became steady counts as a repetition.
        repeats = repeats_after(q, y, past, known, scales, tolerance) if sound and not grew else 0
        known = remember(past, 0 if grew else known, last, y, peak, stroke, mode[3])
        if not sound:
            status = OVERTURNED if ended == LOST else EVENT_BOUND
        elif rests:
            status = AT_REST
        elif repeats > 0 and not stayed(last, repeats):
            status = ROCKING
        elif repeats > 0:
            status = AT_REST if _repeats_at_rest(q, y, mode, last, repeats, tolerance) else NOT_SETTLED
            # A damped bob under a block at rest repeats itself after one period, whatever came first.
            repeats = 0 if q.zeta > 0.0 or status == NOT_SETTLED else repeats
        elif growth[1] == 0.0 and tolerance >= CONVERGED and elapsed >= wait:
            tried = _slow_repetition(q, past, known, scales, tolerance, before)
            if tried > 0:
                wait, limits = 2 * elapsed, (rest_rate, max_events)
                if orbit_near(x, q, complex_plants, mode, tried, limits, scales, past, known, peaks, y, last):
                    status, repeats = ROCKING, tried
                    # A block that leans and is held all the time does not rock.
                    sizes[0], sizes[1] = last[0, 0], 0.0
                    rests, reach = _rests(q, y, mode, sizes, 0.0, tolerance)
                    if rests:
                        _come_to_rest(q, y)
                        status, repeats, last[0, 1], peaks[1] = AT_REST, 0, reach, max(peaks[1], reach)
    if status != OVERTURNED and not finite(y):
        status = FAILED
    status, own = settled(status, repeats, y, last, peaks, mode, out)
    return status, own, elapsed
