"""A quick march through arcs under a harmonic: each of its steps is proved, and it stops where a proof fails.

The flow of the equations over a step is the same wherever the step begins, so that a table of it replaces
exponentials and sines. An angle is a sum of parts that the flow takes onward by themselves: its level, a
growing and a falling exponential, the pair's x with its rate, and the answer to the forcing.

Proof. The cubic with a signal's values and slopes at both ends of a step shows what happens between them, if
the signal's fourth derivative is bounded (`tpd.exact.events`). The parts bound it. For the pair, let
|x| = sqrt(x^2 + x'^2/q). As p >= 0 this norm never grows along the motion, whatever the phase: over a step of
any length the growth factor is 1. A derivative in time multiplies it by the norm of the matrix
[[0, w], [-w, -p]], w = sqrt(q), at most, which is (p + sqrt(p^2 + 4 q))/2 = K. So the n-th derivative of x is
at most K^n |x| until the arc ends, and |x| <= |x(0)| + |x'(0)|/w.

Short flights, of which a rattle has dozens, are Taylor polynomials about their beginnings. Let S bound the
forcing, the swing, the tilt from its centre, and the rates of both over a weight. Let k be the largest sum of
the sizes of the coefficients with which these quantities change each other. Then n-th derivatives are at most
k^n exp(k t) S after the time t. Flights are so short that what follows a few terms is rounding.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.arcs import pair, sincos, span_of
from tpd.exact.contact_kernel import beyond_return, decide, held_on_base
from tpd.exact.events import (
    BOB,
    CLEAR,
    CUT,
    END,
    FIRST,
    LONGEST,
    ONE,
    SECOND,
    UNKNOWN,
    estimate,
    prove_window,
)
from tpd.exact.motion import GRID, HOPS, MOST, NO, TERMS, is_at_end, pass_event, record_leg, update_angles
from tpd.exact.plant import fused, places
from tpd.exact.terms import SLIP, STICK, SWING, SWING_RATE, TILT, TILT_RATE

_OVER = 1.0 / (np.arange(1.0, MOST) * np.arange(2.0, MOST + 1.0))
"""1/((n + 1)(n + 2))."""
_LONG, _SHORT, _TINY = 0.125, 1.0 / 32.0, 1e-3
"""Longest flight, times k, and lengths from which on more terms are needed."""
_FEWER = np.int64(5)
"""Terms of a flight that is shorter than all of these; beyond they are `TERMS` and `MOST`. The others add
less than k^(terms) S t^(terms - 2) to phi'', and only rounding to the state."""
_SOON, _AGREEMENT = 5e-3, 1e-13
"""Time until a rattle ends, times k, below which its end is looked for; and the difference between two
polynomials that agree about it."""
_FOURTH, _FIFTH = places(2)
"""Rows of what multiplies the parts of an angle in bounds: the derivatives that are bounded."""
_VALUE, _SLOPE, _BEND, _JERK = range(4)
"""First terms of a Taylor polynomial."""
_SPEED, _TIME, _SWING, _SWING_RATE = range(4)
"""Columns of hops."""
_LAST, _PREVIOUS = range(2)
"""Rows of hops."""
_SIGNAL = 2
"""Row of the Taylor polynomials with that of a signal, after those of tilt and swing."""
_AT_ZERO = 1e-12
"""A signal below this at the start of an arc began at zero."""
_FEW = 4
"""Points of the grid that are tried for one root."""
Parts = namedtuple("Parts", "level grown fallen u v h k r w")
"""An angle: a constant; both exponentials; the pair's x and x'; the answer to the forcing
h = (a + b t) sin + (c + d t) cos with its quadrature k = (a + b t) cos - (c + d t) sin; and its growth
r = b sin + d cos, w = b cos - d sin. Of a held block the tilt does not move: in its place is the forcing."""


@fused
def prepare_march(q, a):
    """Prepare the march of a plant: its table, and what bounds derivatives and short flights."""
    # The longest windows of the careful search.
    a.step, a.jump = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), GRID
    for n in range(GRID + 1):
        t, row = a.step * n / GRID, a.flow[n]
        row.rising, row.decaying = math.exp(q.s1 * t), math.exp(q.s2 * t)
        row.u, row.v = pair(q.p, q.q, t)
        row.held_u, row.held_v = pair(q.held_p, q.held_q, t)
        row.sine, row.cosine = sincos(q.xi * t)
    by = 1.0 / (q.m11 * q.m22 - q.m12 * q.m21)
    tilt, swing = a.tilt, a.swing
    tilt.by_tilt, tilt.by_swing = by * q.m22 * q.up, by * q.m12
    tilt.by_slip, tilt.by_forcing = -by * (q.m22 * q.c1 + q.m12 * q.c2), -by * (q.m22 * q.up + q.m12) * q.f
    swing.by_tilt, swing.by_swing = -by * q.m21 * q.up, -by * q.m11
    swing.by_slip, swing.by_forcing = by * (q.m11 * q.c2 + q.m21 * q.c1), by * (q.m11 + q.m21 * q.up) * q.f
    # With the root of the largest sum as the weight of rates, k is about as large.
    first = abs(tilt.by_tilt) + abs(tilt.by_swing) + abs(tilt.by_forcing)
    second = abs(swing.by_tilt) + abs(swing.by_swing) + abs(swing.by_forcing)
    a.weight = math.sqrt(max(1.0, max(first, second)))
    a.quickest = 1.0 + max(q.xi, a.weight + 2.0 * max(abs(tilt.by_slip), abs(swing.by_slip)))
    for n in range(2):
        order, p, square = a.orders[n], (q.held_p if n == 1 else q.p), (q.held_q if n == 1 else q.q)
        a.scale[n], a.over_w[n] = 0.5 * (p + math.sqrt(p * p + 4.0 * square)), 1.0 / math.sqrt(square)
        # The fourth derivatives, and then the fifth ones.
        order.forced, order.decaying, order.rising = _power(q.xi, n), _power(-q.s2, n), _power(q.s1, n)
        order.growth = (4.0 + n) * order.forced / q.xi


@fused
def _power(x, n):
    """The fourth power, or the fifth."""
    return x * x * x * x * (x if n == _FIFTH else 1.0)


@fused
def _onward(q, a, n, is_held, x):
    """The parts of an angle after n points of the grid."""
    row, t = a.flow[n], a.step * n / GRID
    p, square, pu, pv = q.p, q.q, row.u, row.v
    if is_held:
        p, square, pu, pv = q.held_p, q.held_q, row.held_u, row.held_v
    u, v = pu * x.u + pv * x.v, (pu - p * pv) * x.v - square * pv * x.u
    h, k = row.cosine * x.h + row.sine * x.k, row.cosine * x.k - row.sine * x.h
    if a.growth == 0.0:
        return Parts(x.level, row.rising * x.rising, row.decaying * x.decaying, u, v, h, k, 0.0, 0.0)
    r, w = row.cosine * x.r + row.sine * x.w, row.cosine * x.w - row.sine * x.r
    return Parts(x.level, row.rising * x.rising, row.decaying * x.decaying, u, v, h + t * r, k + t * w, r, w)


@fused
def _value(x):
    """The value of an angle."""
    return x.level + x.rising + x.decaying + x.u + x.h


@fused
def _rate(q, x):
    """Its rate."""
    return q.s1 * x.rising + q.s2 * x.decaying + x.v + q.xi * x.k + x.r


@fused
def _pull(q, is_held, x):
    """Its acceleration, where the block is held or not."""
    pair = -q.held_q * x.u - q.held_p * x.v if is_held else -q.q * x.u - q.p * x.v
    free = q.s1 * q.s1 * x.rising + q.s2 * q.s2 * x.decaying + pair
    return free - q.xi * q.xi * x.h + 2.0 * q.xi * x.w


@fused
def _store_series(q, is_held, x, c):
    """Put the Taylor polynomial of an angle into `c`."""
    p, square = (q.held_p, q.held_q) if is_held else (q.p, q.q)
    rising, decaying, u, v, h, k, r, w, last, over = *x[1:], 0.0, 1.0
    for n in range(TERMS):
        c[n] = (rising + decaying + u + h + n * last) * over
        over /= n + 1.0
        rising, decaying, u, v, last = q.s1 * rising, q.s2 * decaying, v, -square * u - p * v, r
        h, k, r, w = q.xi * k, -q.xi * h, q.xi * w, -q.xi * r
    c[_VALUE] += x.level


@fused
def _sums(c, t, terms):
    """A Taylor polynomial and its first three derivatives."""
    x0, x1, x2, x3 = c[terms - 1], 0.0, 0.0, 0.0
    for n in range(terms - 2, -1, -1):
        x3, x2, x1, x0 = x3 * t + x2, x2 * t + x1, x1 * t + x0, x0 * t + c[n]
    return x0, x1, 2.0 * x2, 6.0 * x3


@fused
def _crossing(c, by_rate, t, unit, terms):
    """Where a Taylor polynomial, or its rate, vanishes near `t`, to a share of `unit` that is rounding."""
    for _ in range(8):
        x0, x1, x2, x3 = _sums(c, t, terms)
        value, slope, bend = (x1, x2, x3) if by_rate else (x0, x1, x2)
        # Halley's method: the error is of the third power of its step.
        step = value * slope / (slope * slope - 0.5 * value * bend)
        t -= step
        if abs(step) <= 3e-5 * unit:
            return t
    return math.nan


@fused
def _hold_margin(q, m, event):
    """Distance of what holds a block from the limit of a signal, without the moment of bob and forcing."""
    stuck = m.kind == STICK
    level = q.up * m.y[TILT] - (m.tilt * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight) + q.slack
    return hold - level if event == FIRST else hold + level


@fused
def _forced(a, along, across, lag_along, lag_across):
    """The answer to the forcing and its growth, see `Parts`."""
    b, d = a.growth * along, a.growth * across
    along, across = a.share * along + a.growth * lag_along, a.share * across + a.growth * lag_across
    h, k = along * a.sine + across * a.cosine, along * a.cosine - across * a.sine
    return h, k, b * a.sine + d * a.cosine, b * a.cosine - d * a.sine


@fused
def _parts_of(q, m, a):
    """Tilt, or the forcing of a held block, and swing of a motion."""
    y = m.y
    if m.kind != SLIP:
        h, k, r, w = _forced(a, 1.0, 0.0, 0.0, 0.0)
        base = Parts(0.0, 0.0, 0.0, 0.0, 0.0, h, k, r, w)
        h, k, r, w = _forced(a, q.swing_sin, q.swing_cos, q.swing_lag_sin, q.swing_lag_cos)
        return base, Parts(0.0, 0.0, 0.0, y[SWING] - h, y[SWING_RATE] - (q.xi * k + r), h, k, r, w)
    level = (m.tilt * q.weight + m.direction * q.k) / q.up
    h, k, r, w = _forced(a, q.tilt_sin, q.tilt_cos, q.tilt_lag_sin, q.tilt_lag_cos)
    bh, bk, br, bw = _forced(a, q.bob_sin, q.bob_cos, q.bob_lag_sin, q.bob_lag_cos)
    # What is left of the state: its parts along the real modes, and the rest of the pair.
    f0, f1 = y[TILT] - (level + h), y[SWING] - bh
    f2, f3 = y[TILT_RATE] - (q.xi * k + r), y[SWING_RATE] - (q.xi * bk + br)
    one = q.al0 * f0 + q.al1 * f1 + q.al2 * f2 + q.al3 * f3
    two = q.bl0 * f0 + q.bl1 * f1 + q.bl2 * f2 + q.bl3 * f3
    u0, u1 = f0 - one * q.a0 - two * q.b0, f1 - one * q.a1 - two * q.b1
    v0, v1 = f2 - one * q.a2 - two * q.b2, f3 - one * q.a3 - two * q.b3
    tilt = Parts(level, one * q.a0, two * q.b0, u0, v0, h, k, r, w)
    return tilt, Parts(0.0, one * q.a1, two * q.b1, u1, v1, bh, bk, br, bw)


@fused
def bounds_of(a, is_held, x, remaining):
    """Bounds on the fourth and on the fifth derivative of an angle for the time `left`, without those of its
    growing exponential."""
    side = 1 if is_held else 0
    scale, size = a.scale[side], abs(x.u) + a.over_w[side] * abs(x.v)
    # The answer to the forcing is an oscillation whose size may grow.
    growth, decaying = abs(x.r) + abs(x.w), abs(x.decaying)
    forced, four, five = abs(x.h) + abs(x.k) + remaining * growth, a.orders[_FOURTH], a.orders[_FIFTH]
    fourth = four.decaying * decaying + four.forced * forced + four.growth * growth
    fifth = five.decaying * decaying + five.forced * forced + five.growth * growth
    return fourth + _power(scale, _FOURTH) * size, fifth + _power(scale, _FIFTH) * size


@fused
def _flight(q, m, a):
    """The first event of a slipping block, if it comes so soon that its arc is a short flight, its time, and
    the terms of the Taylor polynomials of both angles, which are left in their rows; END if it does not."""
    y = m.y
    out, tilt, swing, c, d = m.tilt * m.direction > 0.0, a.series[TILT], a.series[SWING], a.tilt, a.swing
    x0 = y[TILT] - (m.tilt * q.weight + m.direction * q.k) / q.up
    z0, x1, z1 = y[SWING], y[TILT_RATE], y[SWING_RATE]
    before, s0, s1, k, terms = 0.0, a.sine, q.xi * a.cosine, a.quickest, TERMS
    x2 = c.by_tilt * x0 + c.by_swing * z0 + c.by_slip * (x1 - z1) + c.by_forcing * a.share * s0
    # The time, about, at a constant acceleration: to the turn, or from a turn to the landing.
    speed, bend, height = abs(x1), abs(x2), abs(y[TILT])
    t = speed / bend if out else 2.0 * height / (speed + math.sqrt(speed * speed + 2.0 * bend * height))
    if (m.direction * x2 >= 0.0) == out or m.direction * x1 < 0.0 or not 0.0 < t * k < _LONG:
        return END, 0.0, terms
    terms = _FEWER if k * t < _TINY else (TERMS if k * t < _SHORT else MOST)
    size = max(max(max(abs(x0), abs(z0)), max(speed, abs(z1)) / a.weight), a.share + a.growth)
    tilt[_VALUE], tilt[_SLOPE], swing[_VALUE], swing[_SLOPE] = y[TILT], x1, z0, z1
    for n in range(terms - 2):
        over, slip, e = _OVER[n], (n + 1.0) * (x1 - z1), a.share * s0 + a.growth * before
        x2 = c.by_tilt * x0 + c.by_swing * z0 + c.by_slip * slip + c.by_forcing * e
        z2 = d.by_tilt * x0 + d.by_swing * z0 + d.by_slip * slip + d.by_forcing * e
        tilt[n + 2], swing[n + 2] = over * x2, over * z2
        before, s0, s1 = s0, s1, -q.xi * q.xi * over * s0
        x0, x1, z0, z1 = x1, over * x2, z1, over * z2
    # Corrected by the third derivative, so that one step to the root is often enough.
    rise = 2.0 * tilt[_BEND] if out else tilt[_SLOPE] + 2.0 * tilt[_BEND] * t
    t -= tilt[_JERK] * t * t * (3.0 if out else t) / rise
    t = _crossing(tilt, out, t, t, terms)
    if not 0.0 < t * k < _LONG:
        return END, 0.0, terms
    # Until then phi'' and psi' keep their signs: so no other event is passed, and the bob does not turn.
    bends, turns, power, part = 0.0, 2.0 * t * abs(swing[_BEND]), t, k * t
    for n in range(3, terms):
        bends += n * (n - 1.0) * power * abs(tilt[n])
        power *= t
        turns += n * power * abs(swing[n])
        part *= k * t
    rest = k * k * size * part
    if bends + rest >= 2.0 * abs(tilt[_BEND]) or turns + rest * t >= m.bob_direction * swing[_SLOPE]:
        return END, 0.0, terms
    # For how long both are sure to keep them.
    a.sure_time[1 if out else 0] = min(2.0 * abs(tilt[_BEND]) / k, abs(swing[_SLOPE])) / (2.0 * k * k * size)
    return (FIRST if out else SECOND), t, terms


@fused
def _end_rattle(q, f, m, a, s, end):
    """Take account of a hop that has just ended. If the hops are known to end in rest soon, put the motion
    where it is then, and return in how much time; 0 if they are not.

    State and time after hops from one side are analytic functions of the speed, as is the map from hop to
    hop, and at the speed zero they are what the rattle leads to. The polynomial through the last ones says
    what that is."""
    y, side = m.y, (0 if m.tilt > 0.0 else 1)
    hops, w, limit = a.hops[side], a.series[_SIGNAL], a.limit
    for i in range(HOPS - 1, 0, -1):
        for j in range(4):
            hops[i, j] = hops[i - 1, j]
    last, previous = hops[_LAST], hops[_PREVIOUS]
    last[_SPEED], last[_TIME], last[_SWING], last[_SWING_RATE] = abs(y[TILT_RATE]), s, y[SWING], y[SWING_RATE]
    a.hop_count[side] += 1
    share = last[_SPEED] / previous[_SPEED]
    soon = (last[_TIME] - previous[_TIME]) * share * a.quickest < _SOON * (1.0 - share)
    if a.hop_count[side] < HOPS or not soon:
        return 0.0
    for j in range(_TIME, 4):
        # Neville's scheme, from differences, so that small ones keep their digits.
        before = 0.0
        for i in range(HOPS):
            w[i] = hops[i, j] - last[j]
        for d in range(1, HOPS):
            before = w[_LAST]
            for i in range(HOPS - d):
                v0, v1 = hops[i, _SPEED], hops[i + d, _SPEED]
                w[i] = (v0 * w[i + 1] - v1 * w[i]) / (v0 - v1)
        limit[j], soon = w[_LAST], soon and abs(w[_LAST] - before) < _AGREEMENT
    remaining, firm = limit[_TIME], min(min(a.sure_time[_LAST], a.sure_time[_PREVIOUS]), end - s)
    if not (soon and 0.0 < remaining < firm and abs(limit[_SWING_RATE]) < 0.5 * abs(y[SWING_RATE])):
        return 0.0
    eta = (f.share + f.rate * (s + remaining)) * math.sin(q.xi * (s + remaining))
    psi = y[SWING] + limit[_SWING]
    rate = y[SWING_RATE] + limit[_SWING_RATE]
    if not held_on_base(q, psi, rate, eta):
        return 0.0
    y[SWING], y[TILT_RATE], y[SWING_RATE], m.hold_level = psi, 0.0, rate, 1.0
    decide(q, y, 0.0, 0.0, eta, m)
    return remaining


@fused
def _expand_near(q, a, is_held, tilt, swing, near):
    """Put the Taylor polynomials of both angles about the point of the grid nearest to a time into their
    rows, and return the time of that point."""
    n = min(GRID, int(near / a.step * GRID + 0.5))
    _store_series(q, is_held, _onward(q, a, n, is_held, swing), a.series[SWING])
    _store_series(q, is_held, _onward(q, a, n, is_held, tilt), a.series[TILT])
    return a.step * n / GRID


@fused
def _locate_event(q, m, a, tilt, swing, event, near, far):
    """When an event is met that the step of length `far` from these angles has at about the time `near`: a
    point of the grid, about which the Taylor polynomials are, and the time after it. The first is negative
    where the search leads elsewhere."""
    is_held, x, z, c = m.kind != SLIP, a.series[TILT], a.series[SWING], a.series[_SIGNAL]
    for _ in range(_FEW):
        at, row = _expand_near(q, a, is_held, tilt, swing, near), (SWING if event == BOB else TILT)
        if is_held and event != BOB:
            # The moment on the block, as the careful search has it.
            row, way = _SIGNAL, (-1.0 if event == FIRST else 1.0)
            for n in range(TERMS):
                rate = (n + 1.0) * z[n + 1] if n < TERMS - 1 else 0.0
                c[n] = way * ((1.0 - q.up) * z[n] + q.bias * rate - q.f * x[n])
            c[_VALUE] += _hold_margin(q, m, event)
        by_rate = row == SWING or (row == TILT and event == FIRST)
        more = _crossing(a.series[row], by_rate, near - at, a.step / GRID, TERMS)
        near = at + more
        if not 0.0 <= near <= far:
            break
        if abs(more) * GRID <= a.step:
            return at, more
    return -1.0, 0.0


@fused
def _signals_of(q, m, back, up, down, tilt, swing):
    """Values and slopes of the signals of the careful search: both of the block, and the bob's rate."""
    is_held = m.kind != SLIP
    z1, z2 = _rate(q, swing), _pull(q, is_held, swing)
    if is_held:
        pull = (1.0 - q.up) * _value(swing) + q.bias * z1 - q.f * tilt.h
        slope = (1.0 - q.up) * z1 + q.bias * z2 - q.f * (q.xi * tilt.k + tilt.r)
        return up - pull, -slope, down + pull, slope, m.bob_direction * z1, m.bob_direction * z2
    x1 = _rate(q, tilt)
    g2, v2 = (m.tilt * _value(tilt), m.tilt * x1) if back else (0.0, 0.0)
    turn, turn_slope = m.bob_direction * z1, m.bob_direction * z2
    return m.direction * x1, m.direction * _pull(q, is_held, tilt), g2, v2, turn, turn_slope


@fused
def _is_sound_start(g, v):
    """Whether a signal is positive at the start of an arc, or rises from zero."""
    return g >= _AT_ZERO or v > 0.0


@fused
def _end_leg(q, m, a, legs, i, leg_start, at, more, event):
    """Put the state at the end of a leg through piece i into the motion, take account of the angles there,
    and record the leg. Return the state with its accelerations; the Taylor polynomials are those about the
    time `at`."""
    (z0, z1, z2, _), y = _sums(a.series[SWING], more, a.terms), m.y
    now = y[TILT], z0, 0.0, z1, 0.0, z2
    if m.kind == SLIP:
        x0, x1, x2, _ = _sums(a.series[TILT], more, a.terms)
        now = x0, z0, x1, z1, x2, z2
    update_angles(m, now[TILT], now[SWING], i * 2.0 * np.pi / q.xi + at + more)
    record_leg(m, legs, i, leg_start, at + more - leg_start, event, y)
    for j in range(4):
        y[j] = now[j]
    return now


@fused
def _arc(q, m, legs, w, i, s, end, released):
    """Follow an arc through piece i from its local time `s`, and record the legs before the last. Return its
    end: the first event of the block, or END at the time `end`, or CUT where a proof fails; the time of the
    start of the last leg; and that of the end, as the time of a point of the grid and the time after it."""
    a, y, is_held, remaining, limit = w.march, m.y, m.kind != SLIP, end - s, beyond_return(q)
    back, (tilt, swing) = not is_held and m.tilt * m.direction < 0.0, _parts_of(q, m, a)
    tilt4, tilt5 = bounds_of(a, is_held, tilt, remaining)
    swing4, swing5 = bounds_of(a, is_held, swing, remaining)
    if is_held:
        tilt4 = tilt5 = abs(1.0 - q.up) * swing4 + abs(q.bias) * swing5 + q.f * tilt4
    up, down = (_hold_margin(q, m, FIRST), _hold_margin(q, m, SECOND)) if is_held else (0.0, 0.0)
    g1, v1, g2, v2, g3, v3 = _signals_of(q, m, back, up, down, tilt, swing)
    # What began at zero is exact in the state. Where a block is let go, its acceleration is zero as well.
    if not is_held:
        g1, g2, v1 = m.direction * y[TILT_RATE], m.tilt * y[TILT], (0.0 if released else v1)
    g3 = m.bob_direction * y[SWING_RATE]
    sound = (
        (_is_sound_start(g1, v1) or released)
        and _is_sound_start(g3, v3)
        and (_is_sound_start(g2, v2) or not (is_held or back))
    )
    g1, g2, g3 = max(g1, 0.0), max(g2, 0.0), max(g3, 0.0)
    at, leg_start, n = 0.0, s, (int(a.jump) if sound else 0)
    while n > 0 and w.budget > 0:
        w.budget -= 1
        far = a.step * n / GRID
        new_tilt, new_swing = _onward(q, a, n, is_held, tilt), _onward(q, a, n, is_held, swing)
        h1, u1, h2, u2, h3, u3 = _signals_of(q, m, back, up, down, new_tilt, new_swing)
        # The growing exponential is largest at the end of the step.
        four, five, rising = a.orders[_FOURTH].rising, a.orders[_FIFTH].rising, abs(new_tilt.rising)
        one, two = prove_window(g1, v1, h1, u1, far, tilt5 + five * rising), CLEAR
        if is_held or back:
            two = prove_window(g2, v2, h2, u2, far, tilt4 + four * rising)
        three = prove_window(g3, v3, h3, u3, far, swing5 + five * abs(new_swing.rising))
        if max(one, max(two, three)) == UNKNOWN or one + two + three > ONE:
            # Two events in one step are told apart by shorter ones.
            n //= 2
            continue
        if one + two + three == ONE:
            event, near = BOB, estimate(g3, v3, h3, u3, far)
            if one == ONE:
                event, near = FIRST, estimate(g1, v1, h1, u1, far)
            elif two == ONE:
                event, near = SECOND, estimate(g2, v2, h2, u2, far)
            place, more = _locate_event(q, m, a, tilt, swing, event, far * near, far)
            if place < 0.0:
                break
            if at + place + more < remaining:
                a.jump = n
                if event != BOB:
                    return event, leg_start, s + at + place, more
                # The bob turns, which changes nothing: the same arc goes on.
                _end_leg(q, m, a, legs, i, leg_start, s + at + place, more, BOB)
                m.bob_direction, leg_start, h3, u3 = -m.bob_direction, s + at + place + more, -h3, -u3
        if not is_held and abs(_value(new_tilt)) >= limit:
            break
        if at + far >= remaining:
            place = _expand_near(q, a, is_held, tilt, swing, remaining - at)
            return END, leg_start, s + at + place, remaining - at - place
        tilt, swing, at, n = new_tilt, new_swing, at + far, min(2 * n, GRID)
        g1, v1, g2, v2, g3, v3 = h1, u1, h2, u2, h3, u3
    return CUT, leg_start, leg_start, 0.0


@fused
def _advance_phase(a, x):
    """Take the forcing's phase on by a small angle."""
    x2 = x * x
    s = x * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0)))
    c = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0))
    sine, cosine = c * a.sine + s * a.cosine, c * a.cosine - s * a.sine
    # The sum of the squares stays at 1.
    size = 1.5 - 0.5 * (sine * sine + cosine * cosine)
    a.sine, a.cosine = size * sine, size * cosine


@fused
def march(q, f, m, legs, w, i, s, end, capture):
    """Follow a motion under a harmonic through piece i from its local time `s`, as
    `tpd.exact.follow.piece` does, as long as everything is proved. Return whether the motion has reached the
    time `end`, and else from which time on the careful search has to follow its next arc."""
    a, origin, released, is_flight = w.march, i * span_of(q, f), NO, NO
    a.growth, (a.sine, a.cosine) = f.rate, sincos(q.xi * s)
    while m.events > 0:
        if not is_flight:
            for side in range(2):
                a.hop_count[side] = 0
        is_held, leg_start, at, event, more = m.kind != SLIP, s, s, END, 0.0
        a.share, a.terms = f.share + f.rate * s, TERMS
        if not is_held:
            event, more, a.terms = _flight(q, m, a)
        is_flight = event != END and s + more < end
        if not is_flight:
            a.terms = TERMS
            event, leg_start, at, more = _arc(q, m, legs, w, i, s, end, released)
            if event == CUT:
                return False, leg_start
            # Hops get shorter one after the other.
            a.jump = min(GRID, 1 + int(2.0 * GRID * (at + more - leg_start) / a.step))
        s, now = at + more, _end_leg(q, m, a, legs, i, leg_start, at, more, event)
        if event == END:
            return True, end
        if is_flight:
            _advance_phase(a, q.xi * more)
        else:
            a.sine, a.cosine = sincos(q.xi * s)
        m.events -= 1
        pass_event(q, m, legs, event, capture, q.xi, now, (f.share + f.rate * s) * a.sine, origin + s)
        released = is_held
        if is_flight and event == SECOND and m.kind == SLIP and len(legs) == 0:
            # Derivatives are read from legs: where they are recorded, each hop is followed.
            rest = _end_rattle(q, f, m, a, s, end)
            if rest > 0.0:
                s, is_flight = s + rest, NO
                a.sine, a.cosine = sincos(q.xi * s)
                update_angles(m, 0.0, m.y[SWING], origin + s)
        if is_at_end(m, legs, i, s, end):
            return True, end
    return False, s
