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
equation: then the n-th derivatives are at most k^n exp(k t) S after the time t. Flights last 1/(32 k) at
most, so that what follows the eighth term is rounding.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.arcs import pair, span_of, turned
from tpd.exact.contact_kernel import beyond_return
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
from tpd.exact.motion import GRID, TERMS, at_end, note, pass_event, record
from tpd.exact.plant import compiled
from tpd.exact.terms import SLIP, STICK, SWING, SWING_RATE, TILT, TILT_RATE

_OVER = 1.0 / (np.arange(1.0, TERMS) * np.arange(2.0, TERMS + 1.0))
"""1/((n + 1)(n + 2))."""
_SHORT = 1.0 / 32.0
"""Longest flight, over the shortest time in which the equations can change a state by itself."""
_TAIL = 1.0 / 720.0
"""What the terms after the eighth add to phi'' is at most this times k^8 S t^6 exp(k t)."""
_E1, _E2, _U, _V, _HELD_U, _HELD_V, _SINE, _COSINE = range(8)
"""Columns of the table: both exponentials; the pair's solutions for the slipping block and the held one; sine
and cosine of the forcing's phase."""
_FALLEN, _FORCED, _GROWTH, _GROWN = range(2, 6)
"""Columns of what multiplies the parts of an angle in bounds on its fourth and fifth derivatives, after those
of the pair for the slipping block and the held one."""
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


@compiled
def put_flow(q, a):
    """Prepare the march of a plant: its table, and what bounds a short flight."""
    # The longest windows of the careful search.
    a.step, a.jump = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), GRID
    for column in range(8):
        a.flow[0, column] = 1.0 if column in (_E1, _E2, _U, _HELD_U, _COSINE) else 0.0
    half = 1
    while half <= GRID:
        # Powers of two are computed, and the rows above one from it and from those below: so that no row
        # is a product of more than six others.
        t, new = a.step * half / GRID, a.flow[half]
        new[_E1], new[_E2], new[_SINE], new[_COSINE] = (
            math.exp(q.s1 * t),
            math.exp(q.s2 * t),
            *turned(q.xi * t),
        )
        new[_U], new[_V] = pair(q.p, q.q, t)
        new[_HELD_U], new[_HELD_V] = pair(q.held_p, q.held_q, t)
        for n in range(1, half if half < GRID else 1):
            x, out = a.flow[n], a.flow[half + n]
            out[_E1], out[_E2] = new[_E1] * x[_E1], new[_E2] * x[_E2]
            out[_U], out[_V] = _pair_after(q.p, q.q, new[_U], new[_V], x[_U], x[_V])
            u, v = _pair_after(q.held_p, q.held_q, new[_HELD_U], new[_HELD_V], x[_HELD_U], x[_HELD_V])
            out[_HELD_U], out[_HELD_V] = u, v
            out[_SINE] = new[_SINE] * x[_COSINE] + new[_COSINE] * x[_SINE]
            out[_COSINE] = new[_COSINE] * x[_COSINE] - new[_SINE] * x[_SINE]
        half *= 2
    by, push = 1.0 / (q.m11 * q.m22 - q.m12 * q.m21), a.push
    push[0, 0], push[0, 1] = by * q.m22 * q.up, by * q.m12
    push[0, 2], push[0, 3] = -by * (q.m22 * q.c1 + q.m12 * q.c2), -by * (q.m22 * q.up + q.m12) * q.f
    push[1, 0], push[1, 1] = -by * q.m21 * q.up, -by * q.m11
    push[1, 2], push[1, 3] = by * (q.m11 * q.c2 + q.m21 * q.c1), by * (q.m11 + q.m21 * q.up) * q.f
    a.quickest = 1.0 + q.xi
    for i in range(2):
        size = abs(push[i, 0]) + abs(push[i, 1]) + 2.0 * abs(push[i, 2]) + abs(push[i, 3])
        a.quickest = max(a.quickest, size)
    a.brief = _SHORT / a.quickest
    for held in range(2):
        p, square = (q.held_p, q.held_q) if held else (q.p, q.q)
        a.over_w[held] = 1.0 / math.sqrt(square)
        for n in range(2):
            order, c = 4.0 + n, a.orders[n]
            c[held] = (0.5 * (p + math.sqrt(p * p + 4.0 * square))) ** order
            c[_FALLEN], c[_FORCED], c[_GROWN] = abs(q.s2) ** order, q.xi**order, q.s1**order
            c[_GROWTH] = order * q.xi ** (order - 1.0)


@compiled
def _pair_after(p, q, u, v, x, y):
    """The pair's solutions after two times, from those after each."""
    return u * x - q * v * y, u * y + v * (x - p * y)


@compiled
def _onward(x, p, q, e1, e2, pu, pv, sine, cosine, t):
    """The parts of an angle after the time `t`, from a row of the table."""
    u, v = pu * x.u + pv * x.v, (pu - p * pv) * x.v - q * pv * x.u
    h, k = cosine * x.h + sine * x.k, cosine * x.k - sine * x.h
    r, w = cosine * x.r + sine * x.w, cosine * x.w - sine * x.r
    return Parts(x.level, e1 * x.grown, e2 * x.fallen, u, v, h + t * r, k + t * w, r, w)


@compiled
def _value(x):
    """The value of an angle."""
    return x.level + x.grown + x.fallen + x.u + x.h


@compiled
def _rate(q, x):
    """Its rate."""
    return q.s1 * x.grown + q.s2 * x.fallen + x.v + q.xi * x.k + x.r


@compiled
def _pull(q, x, p, square):
    """Its acceleration; `p` and `square` are those of the pair."""
    free = q.s1 * q.s1 * x.grown + q.s2 * q.s2 * x.fallen - square * x.u - p * x.v
    return free - q.xi * q.xi * x.h + 2.0 * q.xi * x.w


@compiled
def _put_series(q, x, p, square, c):
    """Put the Taylor polynomial of an angle into `c`."""
    grown, fallen, u, v, h, k, r, w, last, over = *x[1:], 0.0, 1.0
    for n in range(TERMS):
        c[n] = (grown + fallen + u + h + n * last) * over
        over /= n + 1.0
        grown, fallen, u, v, last = q.s1 * grown, q.s2 * fallen, v, -square * u - p * v, r
        h, k, r, w = q.xi * k, -q.xi * h, q.xi * w, -q.xi * r
    c[0] += x.level


@compiled
def _sums(c, t):
    """Value, slope and curvature of a Taylor polynomial."""
    value, slope, bend = 0.0, 0.0, 0.0
    for n in range(TERMS - 1, -1, -1):
        bend, slope, value = bend * t + slope, slope * t + value, value * t + c[n]
    return value, slope, 2.0 * bend


@compiled
def _crossing(c, t, unit):
    """Where the Taylor polynomial of a signal vanishes, near `t`, to a share of `unit` that is rounding."""
    for _ in range(8):
        value, slope, _ = _sums(c, t)
        step = value / slope
        t -= step
        # The error of Newton's method is of the square of its step.
        if abs(step) <= 1e-8 * unit:
            return t
    return math.nan


@compiled
def _put_signal(q, m, which, tilt, swing, c):
    """Put the Taylor polynomial of a signal of the careful search into `c`, from those of both angles."""
    for n in range(TERMS - 1):
        rate = (n + 1.0) * swing[n + 1]
        if which == BOB:
            c[n] = m.bob_way * rate
        elif m.kind == SLIP:
            c[n] = m.way * (n + 1.0) * tilt[n + 1] if which == FIRST else m.tilt * tilt[n]
        else:
            pull = (1.0 - q.up) * swing[n] + q.bias * rate - q.f * tilt[n]
            c[n] = -pull if which == FIRST else pull
    c[TERMS - 1] = 0.0
    if which != BOB and m.kind != SLIP:
        c[0] += _hold(q, m, which)


@compiled
def _hold(q, m, which):
    """Distance of what holds a block from the limit of a signal, without the moment of bob and forcing."""
    stuck = m.kind == STICK
    level = q.up * m.y[TILT] - (m.tilt * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight) + q.slack
    return hold - level if which == FIRST else hold + level


@compiled
def _parts_of(q, m, sine, cosine, share, growth):
    """Tilt, or the forcing of a held block, and swing of a motion; the forcing has the share `share` of its
    size, which grows at the rate `growth`."""
    y, held = m.y, m.kind != SLIP
    if held:
        a, b, c, d = share * q.swing_sin, share * q.swing_cos, growth * q.swing_sin, growth * q.swing_cos
        a, b = a + growth * q.swing_lag_sin, b + growth * q.swing_lag_cos
        h, k, r, w = (
            a * sine + b * cosine,
            a * cosine - b * sine,
            c * sine + d * cosine,
            c * cosine - d * sine,
        )
        base = Parts(0.0, 0.0, 0.0, 0.0, 0.0, share * sine, share * cosine, growth * sine, growth * cosine)
        return base, Parts(0.0, 0.0, 0.0, y[SWING] - h, y[SWING_RATE] - (q.xi * k + r), h, k, r, w)
    level = (m.tilt * q.weight + m.way * q.k) / q.up
    a, b = share * q.tilt_sin + growth * q.tilt_lag_sin, share * q.tilt_cos + growth * q.tilt_lag_cos
    c, d = growth * q.tilt_sin, growth * q.tilt_cos
    h, k, r, w = a * sine + b * cosine, a * cosine - b * sine, c * sine + d * cosine, c * cosine - d * sine
    f0, f2 = y[TILT] - (level + h), y[TILT_RATE] - (q.xi * k + r)
    a, b = share * q.bob_sin + growth * q.bob_lag_sin, share * q.bob_cos + growth * q.bob_lag_cos
    c, d = growth * q.bob_sin, growth * q.bob_cos
    bh, bk, br, bw = (
        a * sine + b * cosine,
        a * cosine - b * sine,
        c * sine + d * cosine,
        c * cosine - d * sine,
    )
    f1, f3 = y[SWING] - bh, y[SWING_RATE] - (q.xi * bk + br)
    one = q.al0 * f0 + q.al1 * f1 + q.al2 * f2 + q.al3 * f3
    two = q.bl0 * f0 + q.bl1 * f1 + q.bl2 * f2 + q.bl3 * f3
    u, v = f0 - one * q.a0 - two * q.b0, f2 - one * q.a2 - two * q.b2
    tilt = Parts(level, one * q.a0, two * q.b0, u, v, h, k, r, w)
    u, v = f1 - one * q.a1 - two * q.b1, f3 - one * q.a3 - two * q.b3
    return tilt, Parts(0.0, one * q.a1, two * q.b1, u, v, bh, bk, br, bw)


@compiled
def _bound(a, held, x, left, order):
    """Bound on a derivative of an angle for the time `left`, without that of its growing part."""
    c = a.orders[order]
    # The answer to the forcing is an oscillation whose size may grow.
    growth = abs(x.r) + abs(x.w)
    forced = c[_FORCED] * (abs(x.h) + abs(x.k) + left * growth) + c[_GROWTH] * growth
    return c[held] * (abs(x.u) + a.over_w[held] * abs(x.v)) + c[_FALLEN] * abs(x.fallen) + forced


@compiled
def _flight(q, m, a, sine, cosine, share, growth):
    """The first event of a slipping block, if it comes so soon that its arc is a short flight, and its time,
    with the Taylor polynomials of both angles; END if it does not."""
    y, out, tilt, swing = m.y, m.tilt * m.way > 0.0, a.series[TILT], a.series[SWING]
    x0, z0, x1, z1 = y[TILT] - (m.tilt * q.weight + m.way * q.k) / q.up, y[SWING], y[TILT_RATE], y[SWING_RATE]
    largest = max(max(max(abs(x0), abs(z0)), max(abs(x1), abs(z1))), share + growth)
    push, e, before, s0, s1 = a.push, share * sine, 0.0, sine, q.xi * cosine
    tilt[0], tilt[1], swing[0], swing[1], t = y[TILT], x1, z0, z1, 0.0
    for n in range(TERMS - 2):
        over, slip = _OVER[n], (n + 1.0) * (x1 - z1)
        e = share * s0 + growth * before
        x2 = over * (push[0, 0] * x0 + push[0, 1] * z0 + push[0, 2] * slip + push[0, 3] * e)
        z2 = over * (push[1, 0] * x0 + push[1, 1] * z0 + push[1, 2] * slip + push[1, 3] * e)
        tilt[n + 2], swing[n + 2] = x2, z2
        before, s0, s1 = s0, s1, -q.xi * q.xi * over * s0
        x0, x1, z0, z1 = x1, x2, z1, z2
        if n == 0:
            # The time, about, at a constant acceleration: to the turn, or from a turn to the landing.
            speed, bend = abs(y[TILT_RATE]), 2.0 * abs(x2)
            if (m.way * x2 >= 0.0) == out or m.way * y[TILT_RATE] < 0.0:
                return END, 0.0
            root = math.sqrt(speed * speed + 2.0 * bend * abs(y[TILT]))
            t = speed / bend if out else 2.0 * abs(y[TILT]) / (speed + root)
            if not 0.0 < t < a.brief:
                return END, 0.0
    which = FIRST if out else SECOND
    _put_signal(q, m, which, tilt, swing, a.series[_SIGNAL])
    t = _crossing(a.series[_SIGNAL], t, t)
    if not 0.0 < t < a.brief:
        return END, 0.0
    # Until then phi'' and psi' keep their signs: so no other event is passed, and the bob does not turn.
    k = a.quickest
    tail = _TAIL * k * k * (k * t) ** 6 * largest * math.exp(k * t)
    bends, turns, power = tail, tail * t, 1.0
    for n in range(3, TERMS):
        power *= t
        bends += n * (n - 1.0) * power * abs(tilt[n])
        turns += n * t * power * abs(swing[n])
    turns += 2.0 * t * abs(swing[2])
    if bends >= 2.0 * abs(tilt[2]) or turns >= m.bob_way * swing[1]:
        return END, 0.0
    return which, t


@compiled
def _stride(q, m, a, sine, cosine, share, growth, left, limit):
    """The first event of an arc before the time `left`, with END for that, the time of a point of the grid
    near it, and the time after that point, about which the Taylor polynomials of both angles are. CUT where a
    proof fails, or where the tilt exceeds the limit."""
    held, y, series = (1 if m.kind != SLIP else 0), m.y, a.series
    tilt, swing = _parts_of(q, m, sine, cosine, share, growth)
    p, square = (q.held_p, q.held_q) if held else (q.p, q.q)
    tilt4, tilt5 = _bound(a, held, tilt, left, 0), _bound(a, held, tilt, left, 1)
    swing4, swing5 = _bound(a, held, swing, left, 0), _bound(a, held, swing, left, 1)
    back, c, d = not held and m.tilt * m.way < 0.0, 1.0 - q.up, q.bias
    hold_up, hold_down = (_hold(q, m, FIRST), _hold(q, m, SECOND)) if held else (0.0, 0.0)
    g2 = v2 = h2 = u2 = 0.0
    # The signals at the start, from the state: what began at zero is exact there.
    if held:
        z1, z2 = y[SWING_RATE], _pull(q, swing, p, square)
        pull = c * y[SWING] + d * z1 - q.f * tilt.h
        slope = c * z1 + d * z2 - q.f * (q.xi * tilt.k + tilt.r)
        g1, v1, g2, v2 = hold_up - pull, -slope, hold_down + pull, slope
    else:
        z1, z2 = y[SWING_RATE], _pull(q, swing, p, square)
        g1, v1 = m.way * y[TILT_RATE], m.way * _pull(q, tilt, p, square)
        if back:
            g2, v2 = m.tilt * y[TILT], m.tilt * y[TILT_RATE]
    g3, v3 = m.bob_way * z1, m.bob_way * z2
    if (g1 < _AT_ZERO and v1 <= 0.0) or (g3 < _AT_ZERO and v3 <= 0.0):
        return CUT, 0.0, 0.0
    if (held or back) and g2 < _AT_ZERO and v2 <= 0.0:
        return CUT, 0.0, 0.0
    g1, g2, g3 = max(g1, 0.0), max(g2, 0.0), max(g3, 0.0)
    at, n = 0.0, int(a.jump)
    while True:
        row, far = a.flow[n], a.step * n / GRID
        pu, pv = (row[_HELD_U], row[_HELD_V]) if held else (row[_U], row[_V])
        new_swing = _onward(swing, p, square, row[_E1], row[_E2], pu, pv, row[_SINE], row[_COSINE], far)
        new_tilt = _onward(tilt, p, square, row[_E1], row[_E2], pu, pv, row[_SINE], row[_COSINE], far)
        z1, z2, grown = _rate(q, new_swing), _pull(q, new_swing, p, square), abs(new_swing.grown)
        h3, u3 = m.bob_way * z1, m.bob_way * z2
        third = judged(g3, v3, h3, u3, far, swing5 + a.orders[1, _GROWN] * grown)
        second = CLEAR
        if held:
            pull = c * _value(new_swing) + d * z1 - q.f * new_tilt.h
            slope = c * z1 + d * z2 - q.f * (q.xi * new_tilt.k + new_tilt.r)
            h1, u1, h2, u2 = hold_up - pull, -slope, hold_down + pull, slope
            bound = abs(c) * swing4 + abs(d) * swing5 + q.f * tilt4
            first, second = judged(g1, v1, h1, u1, far, bound), judged(g2, v2, h2, u2, far, bound)
        else:
            grown, x1 = abs(new_tilt.grown), _rate(q, new_tilt)
            h1, u1 = m.way * x1, m.way * _pull(q, new_tilt, p, square)
            first = judged(g1, v1, h1, u1, far, tilt5 + a.orders[1, _GROWN] * grown)
            if back:
                h2, u2 = m.tilt * _value(new_tilt), m.tilt * x1
                second = judged(g2, v2, h2, u2, far, tilt4 + a.orders[0, _GROWN] * grown)
        if first == CLEAR and second == CLEAR and third == CLEAR:
            if at + far < left:
                if not held and abs(_value(new_tilt)) >= limit:
                    return CUT, 0.0, 0.0
                tilt, swing, at = new_tilt, new_swing, at + far
                g1, v1, g2, v2, g3, v3 = h1, u1, h2, u2, h3, u3
                n = min(2 * n, GRID)
                continue
            which, near = END, left - at
        elif max(first, max(second, third)) == UNKNOWN or first + second + third > ONE:
            # Two events in one step are told apart by shorter ones.
            n //= 2
            if n == 0:
                return CUT, 0.0, 0.0
            continue
        elif first == ONE:
            which, near = FIRST, far * estimate(g1, v1, h1, u1, far)
        elif second == ONE:
            which, near = SECOND, far * estimate(g2, v2, h2, u2, far)
        else:
            which, near = BOB, far * estimate(g3, v3, h3, u3, far)
        a.jump = n
        for _ in range(_FEW):
            near = min(near, left - at)
            k = min(GRID, int(near / a.step * GRID + 0.5))
            row, far = a.flow[k], a.step * k / GRID
            pu, pv = (row[_HELD_U], row[_HELD_V]) if held else (row[_U], row[_V])
            there = _onward(swing, p, square, row[_E1], row[_E2], pu, pv, row[_SINE], row[_COSINE], far)
            _put_series(q, there, p, square, series[SWING])
            there = _onward(tilt, p, square, row[_E1], row[_E2], pu, pv, row[_SINE], row[_COSINE], far)
            _put_series(q, there, p, square, series[TILT])
            more = near - far
            if which == END:
                return which, at + far, more
            _put_signal(q, m, which, series[TILT], series[SWING], series[_SIGNAL])
            more = _crossing(series[_SIGNAL], more, a.step / GRID)
            if at + far + more >= left:
                which, near = END, left - at
            elif abs(more) * GRID <= a.step:
                return which, at + far, more
            else:
                near = far + more
        return CUT, 0.0, 0.0


@compiled
def march(q, f, m, legs, room, i, s, end, capture):
    """Follow a motion under a harmonic through piece i from its local time `s`, as
    `tpd.exact.follow.piece` does, as long as everything is proved. Return whether the motion has reached the
    time `end`, and else from which time on the careful search has to follow its next arc."""
    y, a, origin = m.y, room.march, i * span_of(q, f)
    limit, growth = beyond_return(q), f.rate
    sine, cosine = turned(q.xi * s)
    tilt, swing = a.series[TILT], a.series[SWING]
    while m.events > 0:
        share, which, at, more = f.share + growth * s, END, 0.0, 0.0
        if m.kind == SLIP:
            which, more = _flight(q, m, a, sine, cosine, share, growth)
        brief = which != END and s + more < end
        if not brief:
            which, at, more = _stride(q, m, a, sine, cosine, share, growth, end - s, limit)
            if which == CUT:
                return False, s
        z0, z1, z2 = _sums(swing, more)
        now = y[TILT], z0, 0.0, z1, 0.0, z2
        if m.kind == SLIP:
            x0, x1, x2 = _sums(tilt, more)
            now = x0, z0, x1, z1, x2, z2
        lasted = at + more
        note(m, now[TILT], now[SWING], origin + s + lasted)
        record(m, legs, i, s, lasted, which, y)
        for j in range(4):
            y[j] = now[j]
        if which == END:
            return True, end
        s += lasted
        if brief:
            sine, cosine = _turned_further(sine, cosine, q.xi * lasted)
        else:
            sine, cosine = turned(q.xi * s)
            # Hops get shorter one after the other.
            a.jump = min(GRID, 1 + int(2.0 * GRID * lasted / a.step))
        if which == BOB:
            m.bob_way = -m.bob_way
            continue
        m.events -= 1
        pass_event(q, m, legs, which, capture, q.xi, now, (f.share + growth * s) * sine, origin + s)
        if at_end(m, legs, i, s, end):
            return True, end
    return False, s


@compiled
def _turned_further(sine, cosine, x):
    """Sine and cosine of a phase that goes on by a small angle."""
    x2 = x * x
    s = x * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0)))
    c = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0))
    # The sum of the squares stays at 1.
    sine, cosine = c * sine + s * cosine, c * cosine - s * sine
    size = 1.5 - 0.5 * (sine * sine + cosine * cosine)
    return size * sine, size * cosine
