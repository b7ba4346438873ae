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

Short flights, of which a rattle has dozens, are Taylor polynomials about their beginnings. Let S bound tilt
from its center, swing, their rates and the forcing, and k the sums of the absolute coefficients in each
equation: then the n-th derivatives are at most k^n exp(k t) S after the time t. Flights are so short that what follows a few
terms is rounding.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.arcs import pair, span_of, turned
from tpd.exact.contact_kernel import beyond_return, decide
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
    judged,
)
from tpd.exact.motion import GRID, HOPS, MOST, NO, TERMS, at_end, note, pass_event, record
from tpd.exact.plant import fused, places
from tpd.exact.terms import REST, SLIP, STICK, SWING, SWING_RATE, TILT, TILT_RATE

_OVER = 1.0 / (np.arange(1.0, MOST) * np.arange(2.0, MOST + 1.0))
"""1/((n + 1)(n + 2))."""
_LONG, _SHORT, _TINY = 0.125, 1.0 / 32.0, 1e-3
"""Longest flight, times k, and lengths from which on more terms are needed."""
_FEWER = np.int64(5)
"""Terms of a flight that is shorter than both; they are `TERMS` and `MOST` beyond. The others add less than
k^(terms) S t^(terms - 2) to phi'', and only rounding to the state."""
_E1, _E2, _U, _V, _HELD_U, _HELD_V, _SINE, _COSINE = range(8)
"""Columns of the table: both exponentials; the pair's solutions for the slipping block and the held one; sine
and cosine of the forcing's phase."""
_FALLEN, _FORCED, _GROWTH, _GROWN = range(2, 6)
"""Columns of what multiplies the parts of an angle in bounds on its fourth and fifth derivatives, after those
of the pair for the slipping block and the held one."""
_FOURTH, _FIFTH = places(2)
"""Rows of those: the derivatives that are bounded."""
_SOON, _ALIKE = 5e-3, 1e-13
"""Time until a rattle ends, times k, from which on its end is looked for; and the difference between two
polynomials that agree about it."""
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
def put_flow(q, a):
    """Prepare the march of a plant: its table, and what bounds derivatives and short flights."""
    # The longest windows of the careful search.
    a.step, a.jump = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), GRID
    for n in range(GRID + 1):
        t, row = a.step * n / GRID, a.flow[n]
        row[_E1], row[_E2] = math.exp(q.s1 * t), math.exp(q.s2 * t)
        row[_U], row[_V] = pair(q.p, q.q, t)
        row[_HELD_U], row[_HELD_V] = pair(q.held_p, q.held_q, t)
        row[_SINE], row[_COSINE] = turned(q.xi * t)
    by, push = 1.0 / (q.m11 * q.m22 - q.m12 * q.m21), a.push
    push[0, 0], push[0, 1] = by * q.m22 * q.up, by * q.m12
    push[0, 2], push[0, 3] = -by * (q.m22 * q.c1 + q.m12 * q.c2), -by * (q.m22 * q.up + q.m12) * q.f
    push[1, 0], push[1, 1] = -by * q.m21 * q.up, -by * q.m11
    push[1, 2], push[1, 3] = by * (q.m11 * q.c2 + q.m21 * q.c1), by * (q.m11 + q.m21 * q.up) * q.f
    first, second = abs(push[0, 0]) + abs(push[0, 1]), abs(push[1, 0]) + abs(push[1, 1])
    # Rates count in shares of this weight, so that k is about it.
    a.weight = math.sqrt(max(1.0, max(first + abs(push[0, 3]), second + abs(push[1, 3]))))
    a.quickest = 1.0 + max(q.xi, a.weight + 2.0 * max(abs(push[0, 2]), abs(push[1, 2])))
    a.brief = _LONG / a.quickest
    a.over_w[0], a.over_w[1] = 1.0 / math.sqrt(q.q), 1.0 / math.sqrt(q.held_q)
    for n in range(2):
        c, x = a.orders[n], (q.xi if n == 1 else 1.0)
        c[0] = _power(0.5 * (q.p + math.sqrt(q.p * q.p + 4.0 * q.q)), n)
        c[1] = _power(0.5 * (q.held_p + math.sqrt(q.held_p * q.held_p + 4.0 * q.held_q)), n)
        c[_FALLEN], c[_FORCED], c[_GROWN] = _power(-q.s2, n), _power(q.xi, n), _power(q.s1, n)
        c[_GROWTH] = (4.0 + n) * q.xi * q.xi * q.xi * x


@fused
def _power(x, n):
    """The fourth power for n = 0, the fifth for n = 1."""
    return x * x * x * x * (x if n == 1 else 1.0)


@fused
def _onward(q, a, n, held, x, grows):
    """The parts of an angle after n points of the grid."""
    row, t = a.flow[n], a.step * n / GRID
    p, square, pu, pv = q.p, q.q, row[_U], row[_V]
    if held:
        p, square, pu, pv = q.held_p, q.held_q, row[_HELD_U], row[_HELD_V]
    sine, cosine = row[_SINE], row[_COSINE]
    u, v = pu * x.u + pv * x.v, (pu - p * pv) * x.v - square * pv * x.u
    h, k = cosine * x.h + sine * x.k, cosine * x.k - sine * x.h
    if not grows:
        return Parts(x.level, row[_E1] * x.grown, row[_E2] * x.fallen, u, v, h, k, 0.0, 0.0)
    r, w = cosine * x.r + sine * x.w, cosine * x.w - sine * x.r
    return Parts(x.level, row[_E1] * x.grown, row[_E2] * x.fallen, u, v, h + t * r, k + t * w, r, w)


@fused
def _value(x):
    """The value of an angle."""
    return x.level + x.grown + x.fallen + x.u + x.h


@fused
def _rate(q, x):
    """Its rate."""
    return q.s1 * x.grown + q.s2 * x.fallen + x.v + q.xi * x.k + x.r


@fused
def _pull(q, held, x):
    """Its acceleration, where the block is held or not."""
    pair = -q.held_q * x.u - q.held_p * x.v if held else -q.q * x.u - q.p * x.v
    free = q.s1 * q.s1 * x.grown + q.s2 * q.s2 * x.fallen + pair
    return free - q.xi * q.xi * x.h + 2.0 * q.xi * x.w


@fused
def _put_series(q, held, x, c):
    """Put the Taylor polynomial of an angle into `c`."""
    p, square = (q.held_p, q.held_q) if held else (q.p, q.q)
    grown, fallen, u, v, h, k, r, w, last, over = *x[1:], 0.0, 1.0
    for n in range(TERMS):
        c[n] = (grown + fallen + u + h + n * last) * over
        over /= n + 1.0
        grown, fallen, u, v, last = q.s1 * grown, q.s2 * fallen, v, -square * u - p * v, r
        h, k, r, w = q.xi * k, -q.xi * h, q.xi * w, -q.xi * r
    c[0] += x.level


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
        if abs(step) <= 1e-5 * unit:
            return t
    return math.nan


@fused
def _put_reserve(q, m, which, tilt, swing, c):
    """Put the Taylor polynomial of the signal of a held block into `c`, from those of forcing and bob."""
    way = -1.0 if which == FIRST else 1.0
    for n in range(TERMS):
        rate = (n + 1.0) * swing[n + 1] if n < TERMS - 1 else 0.0
        c[n] = way * ((1.0 - q.up) * swing[n] + q.bias * rate - q.f * tilt[n])
    c[0] += _hold(q, m, which)


@fused
def _hold(q, m, which):
    """Distance of what holds a block from the limit of a signal, without the moment of bob and forcing."""
    stuck = m.kind == STICK
    level = q.up * m.y[TILT] - (m.tilt * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight) + q.slack
    return hold - level if which == FIRST else hold + level


@fused
def _forced(along, across, lag_along, lag_across, share, growth, sine, cosine):
    """The answer to the forcing and its growth, see `Parts`."""
    a, b = share * along + growth * lag_along, share * across + growth * lag_across
    c, d = growth * along, growth * across
    return a * sine + b * cosine, a * cosine - b * sine, c * sine + d * cosine, c * cosine - d * sine


@fused
def _parts_of(q, m, sine, cosine, share, growth):
    """Tilt, or the forcing of a held block, and swing of a motion; the forcing has the share `share` of its
    size, which grows at the rate `growth`."""
    y, now = m.y, (share, growth, sine, cosine)
    if m.kind != SLIP:
        h, k, r, w = _forced(q.swing_sin, q.swing_cos, q.swing_lag_sin, q.swing_lag_cos, *now)
        base = Parts(0.0, 0.0, 0.0, 0.0, 0.0, share * sine, share * cosine, growth * sine, growth * cosine)
        return base, Parts(0.0, 0.0, 0.0, y[SWING] - h, y[SWING_RATE] - (q.xi * k + r), h, k, r, w)
    level = (m.tilt * q.weight + m.way * q.k) / q.up
    h, k, r, w = _forced(q.tilt_sin, q.tilt_cos, q.tilt_lag_sin, q.tilt_lag_cos, *now)
    bh, bk, br, bw = _forced(q.bob_sin, q.bob_cos, q.bob_lag_sin, q.bob_lag_cos, *now)
    f0, f1 = y[TILT] - (level + h), y[SWING] - bh
    f2, f3 = y[TILT_RATE] - (q.xi * k + r), y[SWING_RATE] - (q.xi * bk + br)
    one = q.al0 * f0 + q.al1 * f1 + q.al2 * f2 + q.al3 * f3
    two = q.bl0 * f0 + q.bl1 * f1 + q.bl2 * f2 + q.bl3 * f3
    u0, u1 = f0 - one * q.a0 - two * q.b0, f1 - one * q.a1 - two * q.b1
    v0, v1 = f2 - one * q.a2 - two * q.b2, f3 - one * q.a3 - two * q.b3
    tilt = Parts(level, one * q.a0, two * q.b0, u0, v0, h, k, r, w)
    return tilt, Parts(0.0, one * q.a1, two * q.b1, u1, v1, bh, bk, br, bw)


@fused
def _bound(a, held, x, left, order):
    """Bound on a derivative of an angle for the time `left`, without that of its growing part."""
    c = a.orders[order]
    # The answer to the forcing is an oscillation whose size may grow.
    growth = abs(x.r) + abs(x.w)
    forced = c[_FORCED] * (abs(x.h) + abs(x.k) + left * growth) + c[_GROWTH] * growth
    side = 1 if held else 0
    return c[side] * (abs(x.u) + a.over_w[side] * abs(x.v)) + c[_FALLEN] * abs(x.fallen) + forced


@fused
def _flight(q, m, a, sine, cosine, share, growth):
    """The first event of a slipping block, if it comes so soon that its arc is a short flight, and its time,
    with the Taylor polynomials of both angles; END if it does not."""
    y, out, tilt, swing = m.y, m.tilt * m.way > 0.0, a.series[TILT], a.series[SWING]
    x0, z0, x1, z1 = y[TILT] - (m.tilt * q.weight + m.way * q.k) / q.up, y[SWING], y[TILT_RATE], y[SWING_RATE]
    largest = max(max(max(abs(x0), abs(z0)), max(abs(x1), abs(z1)) / a.weight), share + growth)
    push, e, before, s0, s1, terms = a.push, share * sine, 0.0, sine, q.xi * cosine, TERMS
    slip = x1 - z1
    x2 = push[0, 0] * x0 + push[0, 1] * z0 + push[0, 2] * slip + push[0, 3] * e
    # The time, about, at a constant acceleration: to the turn, or from a turn to the landing.
    speed, bend, height = abs(x1), abs(x2), abs(y[TILT])
    if (m.way * x2 >= 0.0) == out or m.way * x1 < 0.0:
        return END, 0.0, terms
    t = speed / bend if out else 2.0 * height / (speed + math.sqrt(speed * speed + 2.0 * bend * height))
    if not 0.0 < t < a.brief:
        return END, 0.0, terms
    k = a.quickest
    terms = _FEWER if k * t < _TINY else (TERMS if k * t < _SHORT else MOST)
    tilt[0], tilt[1], swing[0], swing[1] = y[TILT], x1, z0, z1
    for n in range(terms - 2):
        over, slip = _OVER[n], (n + 1.0) * (x1 - z1)
        e = share * s0 + growth * before
        x2 = over * (push[0, 0] * x0 + push[0, 1] * z0 + push[0, 2] * slip + push[0, 3] * e)
        z2 = over * (push[1, 0] * x0 + push[1, 1] * z0 + push[1, 2] * slip + push[1, 3] * e)
        tilt[n + 2], swing[n + 2] = x2, z2
        before, s0, s1 = s0, s1, -q.xi * q.xi * over * s0
        x0, x1, z0, z1 = x1, x2, z1, z2
    t = _crossing(tilt, out, t, t, terms)
    if not 0.0 < t < a.brief:
        return END, 0.0, terms
    # Until then phi'' and psi' keep their signs: so no other event is passed, and the bob does not turn.
    bends, turns, power, part = 0.0, 2.0 * t * abs(swing[2]), t, k * t
    for n in range(3, terms):
        bends += n * (n - 1.0) * power * abs(tilt[n])
        power *= t
        turns += n * power * abs(swing[n])
        part *= k * t
    bends, turns = bends + k * k * largest * part, turns + k * k * largest * part * t
    if bends >= 2.0 * abs(tilt[2]) or turns >= m.bob_way * swing[1]:
        return END, 0.0, terms
    # For how long both are sure to keep them.
    a.firm[1 if out else 0] = min(2.0 * abs(tilt[2]) / k, abs(swing[1])) / (2.0 * k * k * largest)
    return (FIRST if out else SECOND), t, terms


@fused
def _rattles_out(q, f, m, a, s, end):
    """Take account of a hop that has just ended. If hops get shorter and are known to end in rest, put the
    motion where it is then, and return in how much time; a negative time if they are not.

    State and time after hops from one side are analytic functions of the speed, as is the map from hop to
    hop, and at the speed zero they are what the rattle leads to. The polynomial through the last ones says
    what that is."""
    hops, y, side = a.hops[0 if m.tilt > 0.0 else 1], m.y, 0 if m.tilt > 0.0 else 1
    for i in range(HOPS - 1, 0, -1):
        for j in range(4):
            hops[i, j] = hops[i - 1, j]
    hops[0, 0], hops[0, 1], hops[0, 2], hops[0, 3] = abs(y[TILT_RATE]), s, y[SWING], y[SWING_RATE]
    a.known[side] += 1
    share = hops[0, 0] / hops[1, 0]
    if a.known[side] < HOPS or not (hops[0, 1] - hops[1, 1]) * share * a.quickest < _SOON * (1.0 - share):
        return -1.0
    known, w = True, a.series[_SIGNAL]
    for j in range(1, 4):
        before = 0.0
        for i in range(HOPS):
            w[i] = hops[i, j] - hops[0, j]
        for d in range(1, HOPS):
            before = w[0]
            for i in range(HOPS - d):
                w[i] = (hops[i, 0] * w[i + 1] - hops[i + d, 0] * w[i]) / (hops[i, 0] - hops[i + d, 0])
        known = known and abs(w[0] - before) < _ALIKE
        a.limit[j] = w[0]
    left, turned_by = a.limit[1], a.limit[3]
    firm = min(a.firm[0], a.firm[1])
    if not (known and 0.0 < left < firm and s + left < end and abs(turned_by) < 0.5 * abs(y[SWING_RATE])):
        return -1.0
    kind, tilt, way, rate, psi, swinging = m.kind, m.tilt, m.way, y[TILT_RATE], y[SWING], y[SWING_RATE]
    y[SWING], y[TILT_RATE], y[SWING_RATE] = psi + a.limit[2], 0.0, swinging + turned_by
    eta = (f.share + f.rate * (s + left)) * math.sin(q.xi * (s + left))
    decide(q, y, 0.0, 0.0, eta, m)
    if m.kind == REST:
        m.held = 1.0
        return left
    m.kind, m.tilt, m.way = kind, tilt, way
    y[SWING], y[TILT_RATE], y[SWING_RATE] = psi, rate, swinging
    return -1.0


@fused
def _put_near(q, a, held, tilt, swing, near, grows):
    """Put the Taylor polynomials of both angles about the point of the grid nearest to a time into their
    rows, and return the time of that point."""
    n = min(GRID, int(near / a.step * GRID + 0.5))
    _put_series(q, held, _onward(q, a, n, held, swing, grows), a.series[SWING])
    _put_series(q, held, _onward(q, a, n, held, tilt, grows), a.series[TILT])
    return a.step * n / GRID


@fused
def _place(q, m, a, held, tilt, swing, which, near, far, grows):
    """When an event is met that the step of length `far` from these angles has at about the time `near`: a
    point of the grid, about which the Taylor polynomials are, and the time after it. The first is negative
    where the search leads elsewhere."""
    for _ in range(_FEW):
        at = _put_near(q, a, held, tilt, swing, near, grows)
        row = SWING if which == BOB else (_SIGNAL if held else TILT)
        if row == _SIGNAL:
            _put_reserve(q, m, which, a.series[TILT], a.series[SWING], a.series[_SIGNAL])
        by_rate = row == SWING or (row == TILT and which == FIRST)
        more = _crossing(a.series[row], by_rate, near - at, a.step / GRID, TERMS)
        near = at + more
        if not 0.0 <= near <= far:
            break
        if abs(more) * GRID <= a.step:
            return at, more
    return -1.0, 0.0


@fused
def _signals_of(q, m, held, back, up, down, tilt, swing):
    """Values and slopes of the signals of the careful search: both of the block, and the bob's rate."""
    z1, z2 = _rate(q, swing), _pull(q, held, swing)
    if held:
        pull = (1.0 - q.up) * _value(swing) + q.bias * z1 - q.f * tilt.h
        slope = (1.0 - q.up) * z1 + q.bias * z2 - q.f * (q.xi * tilt.k + tilt.r)
        return up - pull, -slope, down + pull, slope, m.bob_way * z1, m.bob_way * z2
    x1 = _rate(q, tilt)
    g2, v2 = (m.tilt * _value(tilt), m.tilt * x1) if back else (0.0, 0.0)
    return m.way * x1, m.way * _pull(q, held, tilt), g2, v2, m.bob_way * z1, m.bob_way * z2


@fused
def _starts(g, v):
    """Whether a signal is positive at the start of an arc, or rises from zero."""
    return g >= _AT_ZERO or v > 0.0


@fused
def _now(m, held, a, t, terms):
    """The state with its accelerations after the time `t`, by the Taylor polynomials."""
    z0, z1, z2, _ = _sums(a.series[SWING], t, terms)
    if held:
        return m.y[TILT], z0, 0.0, z1, 0.0, z2
    x0, x1, x2, _ = _sums(a.series[TILT], t, terms)
    return x0, z0, x1, z1, x2, z2


@fused
def _finish(m, legs, i, begun, lasted, which, now, tau):
    """Record a leg, take account of the angles at its end, and put the state there into the motion."""
    note(m, now[TILT], now[SWING], tau)
    record(m, legs, i, begun, lasted, which, m.y)
    for j in range(4):
        m.y[j] = now[j]


@fused
def _arc(q, f, m, a, legs, i, s, end, sine, cosine, released):
    """Follow an arc through piece i from its local time `s`, and record the legs before the last. Return its
    end: the first event of the block, or END at the time `end`, or CUT where a proof fails; the time of the
    start of the last leg; and that of the end, as two times that are about those of a point of the grid and
    the time after it."""
    held, share, left, grows = m.kind != SLIP, f.share + f.rate * s, end - s, f.rate != 0.0
    y, back, limit = m.y, not held and m.tilt * m.way < 0.0, beyond_return(q)
    tilt, swing = _parts_of(q, m, sine, cosine, share, f.rate)
    swing4, swing5 = _bound(a, held, swing, left, _FOURTH), _bound(a, held, swing, left, _FIFTH)
    tilt4, tilt5 = _bound(a, held, tilt, left, _FOURTH), _bound(a, held, tilt, left, _FIFTH)
    if held:
        tilt4 = tilt5 = abs(1.0 - q.up) * swing4 + abs(q.bias) * swing5 + q.f * tilt4
    up, down = (_hold(q, m, FIRST), _hold(q, m, SECOND)) if held else (0.0, 0.0)
    g1, v1, g2, v2, g3, v3 = _signals_of(q, m, held, back, up, down, tilt, swing)
    # What began at zero is exact in the state. Where a block is let go, its acceleration is zero as well.
    if not held:
        g1, g2, v1 = m.way * y[TILT_RATE], m.tilt * y[TILT], (0.0 if released else v1)
    g3 = m.bob_way * y[SWING_RATE]
    sound = (_starts(g1, v1) or released) and _starts(g3, v3) and (_starts(g2, v2) or not (held or back))
    g1, g2, g3 = max(g1, 0.0), max(g2, 0.0), max(g3, 0.0)
    at, begun, n = 0.0, s, (int(a.jump) if sound else 0)
    while n > 0:
        far = a.step * n / GRID
        new_tilt, new_swing = _onward(q, a, n, held, tilt, grows), _onward(q, a, n, held, swing, grows)
        h1, u1, h2, u2, h3, u3 = _signals_of(q, m, held, back, up, down, new_tilt, new_swing)
        grown = abs(new_tilt.grown)
        one = judged(g1, v1, h1, u1, far, tilt5 + a.orders[_FIFTH, _GROWN] * grown)
        two = CLEAR
        if held or back:
            two = judged(g2, v2, h2, u2, far, tilt4 + a.orders[_FOURTH, _GROWN] * grown)
        three = judged(g3, v3, h3, u3, far, swing5 + a.orders[_FIFTH, _GROWN] * abs(new_swing.grown))
        if max(one, max(two, three)) == UNKNOWN or one + two + three > ONE:
            # Two events in one step are told apart by shorter ones.
            n //= 2
            continue
        if one + two + three == ONE:
            which, near = BOB, estimate(g3, v3, h3, u3, far)
            if one == ONE:
                which, near = FIRST, estimate(g1, v1, h1, u1, far)
            elif two == ONE:
                which, near = SECOND, estimate(g2, v2, h2, u2, far)
            place, more = _place(q, m, a, held, tilt, swing, which, far * near, far, grows)
            if place < 0.0:
                break
            to = at + place + more
            if to < left:
                a.jump = n
                if which != BOB:
                    return which, begun, s + at + place, more
                # The bob turns, which changes nothing: the same arc goes on.
                _finish(m, legs, i, begun, s + to - begun, BOB, _now(m, held, a, more, TERMS), i * span_of(q, f) + s + to)
                m.bob_way, begun, h3, u3 = -m.bob_way, s + to, -h3, -u3
        if not held and abs(_value(new_tilt)) >= limit:
            break
        if at + far >= left:
            place = _put_near(q, a, held, tilt, swing, left - at, grows)
            return END, begun, s + at + place, left - at - place
        tilt, swing, at, n = new_tilt, new_swing, at + far, min(2 * n, GRID)
        g1, v1, g2, v2, g3, v3 = h1, u1, h2, u2, h3, u3
    return CUT, begun, begun, 0.0


@fused
def march(q, f, m, legs, room, i, s, end, capture):
    """Follow a motion under a harmonic through piece i from its local time `s`, as
    `tpd.exact.follow.piece` does, as long as everything is proved. Return whether the motion has reached the
    time `end`, and else from which time on the careful search has to follow its next arc."""
    a, origin, released = room.march, i * span_of(q, f), NO
    sine, cosine = turned(q.xi * s)
    a.known[0] = a.known[1] = 0
    while m.events > 0:
        held, begun, at = m.kind != SLIP, s, s
        which, more, terms = END, 0.0, TERMS
        if not held:
            which, more, terms = _flight(q, m, a, sine, cosine, f.share + f.rate * s, f.rate)
        brief = which != END and s + more < end
        if not brief:
            terms = TERMS
            which, begun, at, more = _arc(q, f, m, a, legs, i, s, end, sine, cosine, released)
            if which == CUT:
                return False, begun
        s = at + more
        now = _now(m, held, a, more, terms)
        _finish(m, legs, i, begun, s - begun, which, now, origin + s)
        if which == END:
            return True, end
        if brief:
            sine, cosine = _turned_further(sine, cosine, q.xi * more)
        else:
            sine, cosine = turned(q.xi * s)
            # Hops get shorter one after the other.
            a.jump = min(GRID, 1 + int(2.0 * GRID * (s - begun) / a.step))
        m.events -= 1
        pass_event(q, m, legs, which, capture, q.xi, now, (f.share + f.rate * s) * sine, origin + s)
        released = held
        if not brief:
            a.known[0] = a.known[1] = 0
        elif which == SECOND and m.kind == SLIP and len(legs) == 0:
            # Derivatives are read from legs: where they are recorded, each hop is followed.
            rest = _rattles_out(q, f, m, a, s, end)
            if rest > 0.0:
                s += rest
                sine, cosine = turned(q.xi * s)
                note(m, 0.0, m.y[SWING], origin + s)
        if at_end(m, legs, i, s, end):
            return True, end
    return False, s


@fused
def _turned_further(sine, cosine, x):
    """Sine and cosine of a phase that goes on by a small angle."""
    x2 = x * x
    s = x * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0)))
    c = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0))
    # The sum of the squares stays at 1.
    sine, cosine = c * sine + s * cosine, c * cosine - s * sine
    size = 1.5 - 0.5 * (sine * sine + cosine * cosine)
    return size * sine, size * cosine
