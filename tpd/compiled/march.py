"""The march: a fast simulation of arcs under a harmonic in proved steps.

The march stops where a proof fails, and the careful search of `tpd.compiled.follow` takes over.

The flow of the equations over a step does not depend on the start of the step. A table of the flow therefore
replaces exponentials, sines and cosines. An angle is a sum of parts that evolve independently: its constant
level, a rising and a decaying exponential, the displacement x of the oscillating pair with its rate, and the
response to the forcing.

Proof of a step. The cubic with the values and slopes of a signal at both ends of a step shows what happens
between them, if the fourth derivative of the signal is bounded (`tpd.compiled.events`). The parts give this
bound. For the pair, let |x| = sqrt(x^2 + x'^2/q). As p >= 0, this norm never grows along the motion, whatever
the phase: over a step of any length its growth factor is 1. A time derivative multiplies it at most by the
norm of the matrix [[0, w], [-w, -p]], w = sqrt(q), which is at most K = (p + sqrt(p^2 + 4 q))/2. So the n-th
derivative of x is at most K^n |x| until the arc ends, and |x| <= |x(0)| + |x'(0)|/w.

Short flights, of which a rattle has dozens, are Taylor polynomials about their starts. Let S bound the
forcing, the swing, the tilt from its centre, and the rates of both angles divided by a weight. Let k be the
largest sum of the absolute values of the coefficients with which these quantities change each other. Then
after the time t the n-th derivatives are at most k^n exp(k t) S. Flights are so short that the terms after
the first few are rounding errors.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.compiled.arcs import pair, sincos, span_of
from tpd.compiled.columns import SLIP, STICK, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.contact_kernel import beyond_return, decide, held_on_base
from tpd.compiled.events import (
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
from tpd.compiled.motion import GRID, HOPS, MOST, NO, TERMS, is_at_end, pass_event, record_leg, update_angles
from tpd.compiled.plant import fused, places

_OVER = 1.0 / (np.arange(1.0, MOST) * np.arange(2.0, MOST + 1.0))
"""1/((n + 1)(n + 2))."""
_LONG, _SHORT, _TINY = 0.125, 1.0 / 32.0, 1e-3
"""Longest flight (k t), and the lengths above which more terms are needed."""
_FEWER = np.int64(5)
"""Number of terms of the shortest flights (k t below `_TINY`).

Longer ones take `TERMS` and `MOST` terms. The omitted terms add less than k^(terms) S t^(terms - 2) to phi'',
and only rounding errors to the state.
"""
_SOON, _AGREEMENT = 5e-3, 1e-13
"""Time until a rattle ends (k t) below which its end is computed; and the largest difference between two
polynomials that agree about the end."""
_FOURTH, _FIFTH = places(2)
"""Rows of `MARCH.orders`: the fourth and the fifth derivative."""
_VALUE, _SLOPE, _BEND, _JERK = range(4)
"""Coefficients of a Taylor polynomial."""
_SPEED, _TIME, _SWING, _SWING_RATE = range(4)
"""Columns of the table of hops."""
_LAST, _PREVIOUS = range(2)
"""Rows of the table of hops."""
_SIGNAL = 2
"""Row of the Taylor polynomial of a signal, after those of tilt and swing."""
_AT_ZERO = 1e-12
"""Value below which a signal counts as zero at the start of an arc."""
_FEW = 4
"""Largest number of grid points that are used for one root."""
Parts = namedtuple("Parts", "level rising decaying u v h k r w")
"""An angle by its parts: a constant `level`; the `rising` and the `decaying` exponential; x and x' of the
pair (`u`, `v`); the response to the forcing h = (a + b t) sin + (c + d t) cos with its quadrature k = (a + b
t) cos - (c + d t) sin; and the growth r = b sin + d cos and w = b cos - d sin. The tilt of a held block does
not change, so that its place holds the forcing."""


@fused
def prepare_march(q, a):
    """Fill the march's workspace for a plant: the table of the flow, and the constants of all bounds."""
    # The longest step is the longest window of the careful search.
    a.step, a.jump = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), GRID
    for n in range(GRID + 1):
        t, row = a.step * n / GRID, a.flow[n]
        row.rising, row.decaying = math.exp(q.s1 * t), math.exp(q.s2 * t)
        row.u, row.v = pair(q.p, q.q, t)
        row.held_u, row.held_v = pair(q.held_p, q.held_q, t)
        row.sine, row.cosine = sincos(q.xi * t)
    # Solve the equations for both accelerations, which then are linear in four quantities.
    by = 1.0 / (q.m11 * q.m22 - q.m12 * q.m21)
    tilt, swing = a.tilt, a.swing
    tilt.by_tilt, tilt.by_swing = by * q.m22 * q.up, by * q.m12
    tilt.by_slip, tilt.by_forcing = -by * (q.m22 * q.c1 + q.m12 * q.c2), -by * (q.m22 * q.up + q.m12) * q.f
    swing.by_tilt, swing.by_swing = -by * q.m21 * q.up, -by * q.m11
    swing.by_slip, swing.by_forcing = by * (q.m11 * q.c2 + q.m21 * q.c1), by * (q.m11 + q.m21 * q.up) * q.f
    # With this weight of rates the two kinds of sums are about equal, so that k is about as small as
    # possible.
    first = abs(tilt.by_tilt) + abs(tilt.by_swing) + abs(tilt.by_forcing)
    second = abs(swing.by_tilt) + abs(swing.by_swing) + abs(swing.by_forcing)
    a.weight = math.sqrt(max(1.0, max(first, second)))
    a.quickest = 1.0 + max(q.xi, a.weight + 2.0 * max(abs(tilt.by_slip), abs(swing.by_slip)))
    for n in range(2):
        order, p, square = a.orders[n], (q.held_p if n == 1 else q.p), (q.held_q if n == 1 else q.q)
        a.scale[n], a.over_w[n] = 0.5 * (p + math.sqrt(p * p + 4.0 * square)), 1.0 / math.sqrt(square)
        # Row 0 is for the fourth derivatives, row 1 for the fifth.
        order.forced, order.decaying, order.rising = _power(q.xi, n), _power(-q.s2, n), _power(q.s1, n)
        order.growth = (4.0 + n) * order.forced / q.xi


@fused
def _power(x, n):
    """Return the fourth power (n = 0) or the fifth power (n = 1) of x."""
    return x * x * x * x * (x if n == _FIFTH else 1.0)


@fused
def _onward(q, a, n, is_held, x):
    """Return the parts of an angle n grid points later."""
    row, t = a.flow[n], a.step * n / GRID
    p, square, pu, pv = q.p, q.q, row.u, row.v
    if is_held:
        p, square, pu, pv = q.held_p, q.held_q, row.held_u, row.held_v
    # The matrix of the pair's flow, applied to (x, x').
    u, v = pu * x.u + pv * x.v, (pu - p * pv) * x.v - square * pv * x.u
    h, k = row.cosine * x.h + row.sine * x.k, row.cosine * x.k - row.sine * x.h
    # Forcing of constant size needs no growth terms, and this is the usual case.
    if a.growth == 0.0:
        return Parts(x.level, row.rising * x.rising, row.decaying * x.decaying, u, v, h, k, 0.0, 0.0)
    r, w = row.cosine * x.r + row.sine * x.w, row.cosine * x.w - row.sine * x.r
    return Parts(x.level, row.rising * x.rising, row.decaying * x.decaying, u, v, h + t * r, k + t * w, r, w)


@fused
def _value(x):
    """Return the value of an angle."""
    return x.level + x.rising + x.decaying + x.u + x.h


@fused
def _rate(q, x):
    """Return the rate of an angle."""
    return q.s1 * x.rising + q.s2 * x.decaying + x.v + q.xi * x.k + x.r


@fused
def _pull(q, is_held, x):
    """Return the acceleration of an angle, for a held block or a slipping one."""
    pair = -q.held_q * x.u - q.held_p * x.v if is_held else -q.q * x.u - q.p * x.v
    free = q.s1 * q.s1 * x.rising + q.s2 * q.s2 * x.decaying + pair
    return free - q.xi * q.xi * x.h + 2.0 * q.xi * x.w


@fused
def _store_series(q, is_held, x, c):
    """Write the Taylor polynomial of an angle into `c`."""
    p, square = (q.held_p, q.held_q) if is_held else (q.p, q.q)
    rising, decaying, u, v, h, k, r, w, last, over = *x[1:], 0.0, 1.0
    for n in range(TERMS):
        c[n] = (rising + decaying + u + h + n * last) * over
        over /= n + 1.0
        # Each pass replaces all parts by their time derivatives.
        rising, decaying, u, v, last = q.s1 * rising, q.s2 * decaying, v, -square * u - p * v, r
        h, k, r, w = q.xi * k, -q.xi * h, q.xi * w, -q.xi * r
    c[_VALUE] += x.level


@fused
def _sums(c, t, terms):
    """Return a Taylor polynomial and its first three derivatives at the time `t`, by Horner's scheme."""
    x0, x1, x2, x3 = c[terms - 1], 0.0, 0.0, 0.0
    for n in range(terms - 2, -1, -1):
        x3, x2, x1, x0 = x3 * t + x2, x2 * t + x1, x1 * t + x0, x0 * t + c[n]
    return x0, x1, 2.0 * x2, 6.0 * x3


@fused
def _crossing(c, by_rate, t, unit, terms):
    """Return the zero of a Taylor polynomial near `t`, or of its rate if `by_rate`.

    The result is exact to rounding for steps below a small share of `unit`. It is NaN without convergence.
    """
    for _ in range(8):
        x0, x1, x2, x3 = _sums(c, t, terms)
        value, slope, bend = (x1, x2, x3) if by_rate else (x0, x1, x2)
        # Halley's method: the new error is of the third power of the step.
        step = value * slope / (slope * slope - 0.5 * value * bend)
        t -= step
        if abs(step) <= 3e-5 * unit:
            return t
    return math.nan


@fused
def _hold_margin(q, m, event):
    """Return the holding moment of a held block minus the constant part of the moment on it, for a signal."""
    stuck = m.kind == STICK
    level = q.up * m.y[TILT] - (m.tilt * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight) + q.slack
    return hold - level if event == FIRST else hold + level


@fused
def _forced(a, along, across, lag_along, lag_across):
    """Return the response to the forcing and its growth (h, k, r, w), see `Parts`."""
    b, d = a.growth * along, a.growth * across
    along, across = a.share * along + a.growth * lag_along, a.share * across + a.growth * lag_across
    h, k = along * a.sine + across * a.cosine, along * a.cosine - across * a.sine
    return h, k, b * a.sine + d * a.cosine, b * a.cosine - d * a.sine


@fused
def _parts_of(q, m, a):
    """Return the parts of tilt and swing of a motion. For a held block the forcing replaces the tilt."""
    y = m.y
    if m.kind != SLIP:
        h, k, r, w = _forced(a, 1.0, 0.0, 0.0, 0.0)
        base = Parts(0.0, 0.0, 0.0, 0.0, 0.0, h, k, r, w)
        h, k, r, w = _forced(a, q.swing_sin, q.swing_cos, q.swing_lag_sin, q.swing_lag_cos)
        return base, Parts(0.0, 0.0, 0.0, y[SWING] - h, y[SWING_RATE] - (q.xi * k + r), h, k, r, w)
    level = (m.tilt * q.weight + m.direction * q.k) / q.up
    h, k, r, w = _forced(a, q.tilt_sin, q.tilt_cos, q.tilt_lag_sin, q.tilt_lag_cos)
    bh, bk, br, bw = _forced(a, q.bob_sin, q.bob_cos, q.bob_lag_sin, q.bob_lag_cos)
    # The free motion is the rest of the state: its components along the real modes, and the remainder in the
    # pair.
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
    """Return bounds on the fourth and the fifth derivative of an angle over the time `remaining`.

    The share of the rising exponential is not included: it depends on the end of the step.
    """
    side = 1 if is_held else 0
    scale, size = a.scale[side], abs(x.u) + a.over_w[side] * abs(x.v)
    # The response to the forcing is an oscillation whose amplitude may grow.
    growth, decaying = abs(x.r) + abs(x.w), abs(x.decaying)
    forced, four, five = abs(x.h) + abs(x.k) + remaining * growth, a.orders[_FOURTH], a.orders[_FIFTH]
    fourth = four.decaying * decaying + four.forced * forced + four.growth * growth
    fifth = five.decaying * decaying + five.forced * forced + five.growth * growth
    return fourth + _power(scale, _FOURTH) * size, fifth + _power(scale, _FIFTH) * size


@fused
def _flight(q, m, a):
    """Return the first event of a slipping block if its arc is a short flight.

    Returns the event, its time and the number of Taylor terms.

    The Taylor polynomials of both angles are left in the workspace. The event is END if the arc is not such a
    flight.
    """
    y = m.y
    out, tilt, swing, c, d = m.tilt * m.direction > 0.0, a.series[TILT], a.series[SWING], a.tilt, a.swing
    x0 = y[TILT] - (m.tilt * q.weight + m.direction * q.k) / q.up
    z0, x1, z1 = y[SWING], y[TILT_RATE], y[SWING_RATE]
    before, s0, s1, k, terms = 0.0, a.sine, q.xi * a.cosine, a.quickest, TERMS
    x2 = c.by_tilt * x0 + c.by_swing * z0 + c.by_slip * (x1 - z1) + c.by_forcing * a.share * s0
    # Estimate the time with a constant acceleration: from the base to the turning point, or from there to the
    # landing.
    speed, bend, height = abs(x1), abs(x2), abs(y[TILT])
    t = speed / bend if out else 2.0 * height / (speed + math.sqrt(speed * speed + 2.0 * bend * height))
    # Before a turning point the block must decelerate, and after it accelerate. The flight must also be
    # short.
    if (m.direction * x2 >= 0.0) == out or m.direction * x1 < 0.0 or not 0.0 < t * k < _LONG:
        return END, 0.0, terms
    terms = _FEWER if k * t < _TINY else (TERMS if k * t < _SHORT else MOST)
    # The bound S in the docstring of this module.
    size = max(max(max(abs(x0), abs(z0)), max(speed, abs(z1)) / a.weight), a.share + a.growth)
    tilt[_VALUE], tilt[_SLOPE], swing[_VALUE], swing[_SLOPE] = y[TILT], x1, z0, z1
    # Each pass computes the next coefficients from the equations of motion.
    for n in range(terms - 2):
        over, slip, e = _OVER[n], (n + 1.0) * (x1 - z1), a.share * s0 + a.growth * before
        x2 = c.by_tilt * x0 + c.by_swing * z0 + c.by_slip * slip + c.by_forcing * e
        z2 = d.by_tilt * x0 + d.by_swing * z0 + d.by_slip * slip + d.by_forcing * e
        tilt[n + 2], swing[n + 2] = over * x2, over * z2
        before, s0, s1 = s0, s1, -q.xi * q.xi * over * s0
        x0, x1, z0, z1 = x1, over * x2, z1, over * z2
    # Correct the estimate by the third derivative. One step to the root is then often enough.
    rise = 2.0 * tilt[_BEND] if out else tilt[_SLOPE] + 2.0 * tilt[_BEND] * t
    t -= tilt[_JERK] * t * t * (3.0 if out else t) / rise
    t = _crossing(tilt, out, t, t, terms)
    if not 0.0 < t * k < _LONG:
        return END, 0.0, terms
    # Prove that phi'' and psi' keep their signs until then. No other event can be skipped then, and the bob
    # does not turn.
    bends, turns, power, part = 0.0, 2.0 * t * abs(swing[_BEND]), t, k * t
    for n in range(3, terms):
        bends += n * (n - 1.0) * power * abs(tilt[n])
        power *= t
        turns += n * power * abs(swing[n])
        part *= k * t
    rest = k * k * size * part
    if bends + rest >= 2.0 * abs(tilt[_BEND]) or turns + rest * t >= m.bob_direction * swing[_SLOPE]:
        return END, 0.0, terms
    # Store for how long both are sure to keep their signs.
    a.sure_time[1 if out else 0] = min(2.0 * abs(tilt[_BEND]) / k, abs(swing[_SLOPE])) / (2.0 * k * k * size)
    return (FIRST if out else SECOND), t, terms


@fused
def _end_rattle(q, f, m, a, s, end):
    """Record a hop that has just ended, and skip the rest of the rattle if it ends soon.

    If the hops are sure to end in rest soon, this moves the motion to that state.

    Returns the time until rest, or 0 if the rattle does not end soon.

    The state and the time after the hops from one side are analytic functions of the speed, as is the map
    from hop to hop. Their values at zero speed are the state and the time at which the rattle ends. The
    polynomial through the last hops extrapolates to it.
    """
    y, side = m.y, (0 if m.tilt > 0.0 else 1)
    hops, w, limit = a.hops[side], a.series[_SIGNAL], a.limit
    for i in range(HOPS - 1, 0, -1):
        for j in range(4):
            hops[i, j] = hops[i - 1, j]
    last, previous = hops[_LAST], hops[_PREVIOUS]
    last[_SPEED], last[_TIME], last[_SWING], last[_SWING_RATE] = abs(y[TILT_RATE]), s, y[SWING], y[SWING_RATE]
    a.hop_count[side] += 1
    # Successive hops shrink by nearly the same factor, so that a geometric series estimates the time until
    # the rattle ends.
    share = last[_SPEED] / previous[_SPEED]
    soon = (last[_TIME] - previous[_TIME]) * share * a.quickest < _SOON * (1.0 - share)
    if a.hop_count[side] < HOPS or not soon:
        return 0.0
    for j in range(_TIME, 4):
        # Neville's scheme for the polynomial at zero speed. It uses differences, so that small values keep
        # their digits.
        before = 0.0
        for i in range(HOPS):
            w[i] = hops[i, j] - last[j]
        for d in range(1, HOPS):
            before = w[_LAST]
            for i in range(HOPS - d):
                v0, v1 = hops[i, _SPEED], hops[i + d, _SPEED]
                w[i] = (v0 * w[i + 1] - v1 * w[i]) / (v0 - v1)
        limit[j], soon = w[_LAST], soon and abs(w[_LAST] - before) < _AGREEMENT
    wait, firm = limit[_TIME], min(min(a.sure_time[_LAST], a.sure_time[_PREVIOUS]), end - s)
    if not (soon and 0.0 < wait < firm and abs(limit[_SWING_RATE]) < 0.5 * abs(y[SWING_RATE])):
        return 0.0
    # Check that weight and friction can hold the block at that time.
    eta, psi = (f.share + f.rate * (s + wait)) * math.sin(q.xi * (s + wait)), y[SWING] + limit[_SWING]
    rate = y[SWING_RATE] + limit[_SWING_RATE]
    if not held_on_base(q, psi, rate, eta):
        return 0.0
    y[SWING], y[TILT_RATE], y[SWING_RATE], m.hold_level = psi, 0.0, rate, 1.0
    decide(q, y, 0.0, 0.0, eta, m)
    return wait


@fused
def _expand_near(q, a, is_held, tilt, swing, near):
    """Write the Taylor polynomials of both angles about the grid point nearest to `near`.

    Returns the time of that point.
    """
    n = min(GRID, int(near / a.step * GRID + 0.5))
    _store_series(q, is_held, _onward(q, a, n, is_held, swing), a.series[SWING])
    _store_series(q, is_held, _onward(q, a, n, is_held, tilt), a.series[TILT])
    return a.step * n / GRID


@fused
def _locate_event(q, m, a, tilt, swing, event, near, far):
    """Return the time of an event that occurs at about `near` within a step of length `far`.

    The result is the time of a grid point, about which the Taylor polynomials are valid, and the time after
    it. The first number is negative if the iteration leaves the step.
    """
    is_held, x, z, c = m.kind != SLIP, a.series[TILT], a.series[SWING], a.series[_SIGNAL]
    for _ in range(_FEW):
        at, row = _expand_near(q, a, is_held, tilt, swing, near), (SWING if event == BOB else TILT)
        if is_held and event != BOB:
            # The signal is the moment on the held block, as in the careful search.
            row, sign = _SIGNAL, (-1.0 if event == FIRST else 1.0)
            for n in range(TERMS):
                rate = (n + 1.0) * z[n + 1] if n < TERMS - 1 else 0.0
                c[n] = sign * ((1.0 - q.up) * z[n] + q.bias * rate - q.f * x[n])
            c[_VALUE] += _hold_margin(q, m, event)
        by_rate = row == SWING or (row == TILT and event == FIRST)
        more = _crossing(a.series[row], by_rate, near - at, a.step / GRID, TERMS)
        near = at + more
        if not 0.0 <= near <= far:
            break
        # The root is close enough to its grid point for the Taylor polynomials to be exact to rounding.
        if abs(more) * GRID <= a.step:
            return at, more
    return -1.0, 0.0


@fused
def _signals_of(q, m, back, up, down, tilt, swing):
    """Return values and slopes of the signals of the careful search.

    There are two signals of the block, and the rate of the bob.
    """
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
def _rises(g, v):
    """Whether a signal is positive at the start of an arc, or rises from zero."""
    return g >= _AT_ZERO or v > 0.0


@fused
def _end_leg(q, m, a, legs, i, leg_start, at, more, event):
    """Move a motion to the end of its leg in piece i, and record the leg and its angles.

    The Taylor polynomials are about the time `at`, and the leg ends `more` later. Returns the state there
    with its accelerations.
    """
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
    """Follow an arc through piece i from its local time `s`, and record all of its legs except the last.

    Returns the first event of the block, END at the time `end`, or CUT where a proof fails; the start of the
    last leg; and its end, as the time of a grid point and the time after it.
    """
    a, y, is_held, span, limit = w.march, m.y, m.kind != SLIP, end - s, beyond_return(q)
    back, (tilt, swing) = not is_held and m.tilt * m.direction < 0.0, _parts_of(q, m, a)
    (tilt4, tilt5), (swing4, swing5) = bounds_of(a, is_held, tilt, span), bounds_of(a, is_held, swing, span)
    if is_held:
        tilt4 = tilt5 = abs(1.0 - q.up) * swing4 + abs(q.bias) * swing5 + q.f * tilt4
    up, down = (_hold_margin(q, m, FIRST), _hold_margin(q, m, SECOND)) if is_held else (0.0, 0.0)
    g1, v1, g2, v2, g3, v3 = _signals_of(q, m, back, up, down, tilt, swing)
    # Signals that are zero at the start are exact in the state, while their parts have rounding errors. Where
    # a block was just released, its acceleration is zero as well.
    if not is_held:
        g1, g2, v1 = m.direction * y[TILT_RATE], m.tilt * y[TILT], (0.0 if released else v1)
    g3 = m.bob_direction * y[SWING_RATE]
    # A signal that starts below zero, or falls from zero, is a case for the careful search.
    sound = (_rises(g1, v1) or released) and _rises(g3, v3) and (_rises(g2, v2) or not (is_held or back))
    g1, g2, g3 = max(g1, 0.0), max(g2, 0.0), max(g3, 0.0)
    at, leg_start, n = 0.0, s, (int(a.jump) if sound else 0)
    while n > 0 and w.budget > 0:
        w.budget -= 1
        far = a.step * n / GRID
        new_tilt, new_swing = _onward(q, a, n, is_held, tilt), _onward(q, a, n, is_held, swing)
        h1, u1, h2, u2, h3, u3 = _signals_of(q, m, back, up, down, new_tilt, new_swing)
        # The rising exponential is largest at the end of the step.
        four, five, rising = a.orders[_FOURTH].rising, a.orders[_FIFTH].rising, abs(new_tilt.rising)
        one, two = prove_window(g1, v1, h1, u1, far, tilt5 + five * rising), CLEAR
        if is_held or back:
            two = prove_window(g2, v2, h2, u2, far, tilt4 + four * rising)
        three = prove_window(g3, v3, h3, u3, far, swing5 + five * abs(new_swing.rising))
        if max(one, max(two, three)) == UNKNOWN or one + two + three > ONE:
            # Shorter steps separate two events, and give sharper bounds where nothing is proved.
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
            # An event beyond the end of the piece does not count.
            if at + place + more < span:
                a.jump = n
                if event != BOB:
                    return event, leg_start, s + at + place, more
                # A turning point of the bob changes nothing for the block: the same arc continues.
                _end_leg(q, m, a, legs, i, leg_start, s + at + place, more, BOB)
                m.bob_direction, leg_start, h3, u3 = -m.bob_direction, s + at + place + more, -h3, -u3
        # The careful search computes the time at which the block is beyond return.
        if not is_held and abs(_value(new_tilt)) >= limit:
            break
        if at + far >= span:
            place = _expand_near(q, a, is_held, tilt, swing, span - at)
            return END, leg_start, s + at + place, span - at - place
        # Steps get longer again after a success.
        tilt, swing, at, n = new_tilt, new_swing, at + far, min(2 * n, GRID)
        g1, v1, g2, v2, g3, v3 = h1, u1, h2, u2, h3, u3
    return CUT, leg_start, leg_start, 0.0


@fused
def _advance_phase(a, x):
    """Advance the forcing's phase by a small angle x."""
    x2 = x * x
    # Taylor polynomials of sine and cosine are exact to rounding for such angles.
    s = x * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0)))
    c = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0))
    sine, cosine = c * a.sine + s * a.cosine, c * a.cosine - s * a.sine
    # Keep the sum of the squares at 1, so that rounding errors do not add up.
    size = 1.5 - 0.5 * (sine * sine + cosine * cosine)
    a.sine, a.cosine = size * sine, size * cosine


@fused
def march(q, f, m, legs, w, i, s, end, capture):
    """Follow a motion under a harmonic through piece i from its local time `s`, by proved steps.

    The result is that of `tpd.compiled.follow.follow_piece`.

    Returns whether the motion has reached the time `end`, and the local time. If it has not, the careful
    search must follow the next arc from there.
    """
    a, origin, released, is_flight = w.march, i * span_of(q, f), NO, NO
    a.growth, (a.sine, a.cosine) = f.rate, sincos(q.xi * s)
    while m.events > 0:
        if not is_flight:
            # A longer arc between the hops ends the rattle: forget its hops.
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
            # The hops of a rattle get shorter one after the other, so that the next first step is short after
            # a short arc.
            a.jump = min(GRID, 1 + int(2.0 * GRID * (at + more - leg_start) / a.step))
        s, now = at + more, _end_leg(q, m, a, legs, i, leg_start, at, more, event)
        if event == END:
            return True, end
        if is_flight:
            # After a short flight the phase changes by a small angle. Otherwise sine and cosine are evaluated
            # anew.
            _advance_phase(a, q.xi * more)
        else:
            a.sine, a.cosine = sincos(q.xi * s)
        m.events -= 1
        pass_event(q, m, legs, event, capture, q.xi, now, (f.share + f.rate * s) * a.sine, origin + s)
        released = is_held
        if is_flight and event == SECOND and m.kind == SLIP and len(legs) == 0:
            # Derivatives are computed from legs. Where legs are recorded, every hop must be simulated.
            rest = _end_rattle(q, f, m, a, s, end)
            if rest > 0.0:
                s, is_flight = s + rest, NO
                a.sine, a.cosine = sincos(q.xi * s)
                update_angles(m, 0.0, m.y[SWING], origin + s)
        if is_at_end(m, legs, i, s, end):
            return True, end
    return False, s
