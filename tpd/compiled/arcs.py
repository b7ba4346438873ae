"""Closed-form arcs of the linear equations (25), for real and for complex numbers.

The motion of the base consists of pieces. A piece of a harmonic is one forcing period; all of them are equal,
and their number is unlimited. A piece of a pulse or a record is a cubic in time. A record is linear between
its samples, so that its pieces are exact. An arc starts from a state within a piece, in one mode of the
contact. With M u'' + C u' + K u = b eta it is the sum of the free motion and of a particular solution. The
particular solution is the response to a sine, or a cubic in time, because K = diag(-(1 + 2 mu), 1) is never
singular. The coefficients of the cubic are

    K u_j = b e_j - (j + 1) C u_{j+1} - (j + 2)(j + 1) M u_{j+2}    for eta = sum e_j t^j.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from tpd.compiled.columns import REST, SLIP, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.plant import compiled

_SERIES = 1e-3
"""Value of |w t|^2 below which the solutions of the pair are summed as power series."""
_EARLY = 0.5
"""Time, divided by the time scale of a free solution, below which the remainder of its series is summed."""
_TERMS = 1.0 / (np.arange(1.0, 17.0) * np.arange(2.0, 18.0))
"""1/((k + 1)(k + 2)) for k = 0, 1, 2, ..."""
_YES, _NONE = np.bool_(True), np.int64(0)
"""NumPy scalars, for which Numba compiles a function only once."""

Forcing = namedtuple("Forcing", "harmonic share rate pieces cubics")
"""The forcing eta (minus the base acceleration over g), divided by its size f in the plant.

If `harmonic`, eta is (share + rate t) sin(xi t) in every piece, with t from the start of the piece. Otherwise
there are `pieces` cubics, and no forcing after the last one. Row i of `cubics` has the coefficients of piece
i, for powers of the time divided by the duration of the piece, which is xi of the plant.
"""
Load = namedtuple("Load", "xi phase e0 e1 e2 e3")
"""The forcing from an instant on: (e0 + e1 t) sin(phase + xi t), or e0 + e1 t + e2 t^2 + e3 t^3 if xi
is 0."""
Signal = namedtuple("Signal", "constant on_s1 on_s2 on_u on_v along across gain_along gain_across")
"""A quantity along an arc: a constant, the factors of the four free solutions, and the response to the
forcing (along + gain_along t) sin + (across + gain_across t) cos."""
Arc = namedtuple("Arc", "tilt bob s1 s2 p q xi phase")
"""An arc: tilt and bob angle as signals, the time scales, and the phase of the forcing at the start.

If xi is 0, the forcing is a cubic. A signal then consists of its Taylor polynomial of degree 3 at the start
of the arc, with the coefficients (constant, along, across, gain_across), and of the remainders of the free
solutions beyond degree 3: t and t^2 replace sine and cosine, and the remainders replace the free solutions.
The polynomial follows from the state, so that nothing cancels soon after the start: a tilt of 1e-12 is as
accurate as one of 0.1.
"""
Instant = namedtuple("Instant", "e1 e2 u v sine cosine")
"""The functions of time at an instant of an arc, from which signals are evaluated."""


@compiled
def steady(cubics):
    """Return a harmonic forcing of full size. `cubics` has no rows."""
    return Forcing(_YES, 1.0, 0.0, _NONE, cubics)


@compiled
def span_of(q, f):
    """Return the duration of a piece (tau)."""
    return 2.0 * np.pi / q.xi if f.harmonic else q.xi + 0.0


@compiled
def cubic_load(c0, c1, c2, c3, h, s):
    """Return a cubic forcing from the local time `s` on, from its coefficients over a piece of duration h."""
    zero, a, b, g = 0.0 * (h * s), c1 / h, c2 / (h * h), c3 / (h * h * h)
    e0, e1 = c0 + s * (a + s * (b + s * g)), a + s * (2.0 * b + 3.0 * s * g)
    return Load(zero, zero, e0, e1, b + 3.0 * s * g, g + zero)


@compiled
def load_at(q, f, i, s):
    """Return the forcing from the local time `s` of piece i on."""
    zero, h = 0.0 * (q.xi * s), q.xi
    if f.harmonic:
        return Load(h + zero, h * s, f.share + f.rate * s + zero, f.rate + zero, zero, zero)
    if i >= f.pieces:
        return Load(zero, zero, zero, zero, zero, zero)
    c = f.cubics
    return cubic_load(c[i, 0], c[i, 1], c[i, 2], c[i, 3], h, s)


@compiled
def forcing_at(e, t):
    """Return eta and its slope at the time `t`."""
    if e.xi.real != 0.0:
        size, (sine, cosine) = e.e0 + e.e1 * t, sincos(e.phase + e.xi * t)
        return size * sine, e.e1 * sine + size * e.xi * cosine
    return e.e0 + t * (e.e1 + t * (e.e2 + t * e.e3)), e.e1 + t * (2.0 * e.e2 + 3.0 * t * e.e3)


@compiled
def forcing_signal(e):
    """Return eta as a signal along an arc."""
    if e.xi != 0.0:
        return Signal(0.0, 0.0, 0.0, 0.0, 0.0, e.e0, 0.0, e.e1, 0.0)
    return Signal(e.e0, 0.0, 0.0, 0.0, 0.0, e.e1, e.e2, 0.0, e.e3)


@compiled
def _forced(sine, cosine, lag_sine, lag_cosine, share, rate):
    """Return the amplitudes of the response to (share + rate t) sin, and their growth rates."""
    along, across = share * sine + rate * lag_sine, share * cosine + rate * lag_cosine
    return along, across, rate * sine, rate * cosine


@compiled
def _initial_answer(answer, e):
    """Return the value and the slope of the response to a sine at the start of an arc."""
    along, across, more, less = answer
    sine, cosine = sincos(e.phase)
    value = along * sine + across * cosine
    return value, (more - e.xi * across) * sine + (less + e.xi * along) * cosine


@compiled
def _onward(q, e, j, a1, b1, a2, b2):
    """Return the coefficients of the particular solution for tilt and bob at the power j of time.

    They follow from those at the two higher powers (a1, b1 and a2, b2). The static response to eta is eta for
    both angles.
    """
    r, m = q.f * e, (j + 1.0) * (j + 2.0)
    turn = (j + 1.0) * (a1 - b1)
    tilt = r + (q.c1 * turn + m * (q.m11 * a2 + q.m12 * b2)) / q.up
    return tilt, r + q.c2 * turn - m * (q.m21 * a2 + q.m22 * b2)


@compiled
def accelerations(q, kind, centre, y0, y1, y2, y3, eta):
    """Return phi'' and psi'' of a state whose tilt is measured from `centre`.

    `eta` is the forcing divided by its full size.
    """
    slip = y2 - y3
    r2 = q.f * eta - y1 + q.c2 * slip
    if kind != SLIP:
        return 0.0 * r2, (q.f * eta - y1 - q.c2 * y3) / q.m22
    r1 = q.up * (y0 - centre - q.f * eta) - q.c1 * slip
    # Cramer's rule for the two accelerations.
    by = 1.0 / (q.m11 * q.m22 - q.m12 * q.m21)
    return by * (q.m22 * r1 - q.m12 * r2), by * (q.m11 * r2 - q.m21 * r1)


@compiled
def launch(q, kind, tilt, direction, y0, y1, y2, y3, e):
    """Return the arc that starts from the state (y0, y1, y2, y3) under the forcing `e`.

    The mode of the contact consists of its `kind` and the signs of phi (`tilt`) and phi' (`direction`).
    """
    # A zero of the common type: Numba must see real or complex numbers in all branches.
    zero = 0.0 * (q.f + e.phase + e.e0 + y0)
    balance = (tilt * q.weight + direction * q.k) / q.up
    if e.xi.real != 0.0:
        # The particular solution oscillates about the equilibrium of weight and friction.
        if kind == SLIP:
            tf = _forced(q.tilt_sin, q.tilt_cos, q.tilt_lag_sin, q.tilt_lag_cos, e.e0, e.e1)
            bf = _forced(q.bob_sin, q.bob_cos, q.bob_lag_sin, q.bob_lag_cos, e.e0, e.e1)
        else:
            tf = zero, zero, zero, zero
            bf = _forced(q.swing_sin, q.swing_cos, q.swing_lag_sin, q.swing_lag_cos, e.e0, e.e1)
        (tv, ts), (bv, bs) = _initial_answer(tf, e), _initial_answer(bf, e)
        tilt_now, tilt_rate, bob_now, bob_rate = balance + tv, ts + zero, bv + zero, bs + zero
        (t1, t2, t3, t4), (b1, b2, b3, b4) = tf, bf
        t0, t1, t2, t3, t4 = balance + zero, t1 + zero, t2 + zero, t3 + zero, t4 + zero
        b0, b1, b2, b3, b4 = zero, b1 + zero, b2 + zero, b3 + zero, b4 + zero
    else:
        # Taylor polynomials: the equations give the accelerations, and their time derivative gives the slopes
        # of these.
        up, swing = accelerations(q, kind, balance, y0, y1, y2, y3, e.e0)
        faster, swinging = accelerations(q, kind, 0.0 * balance, y2, y3, up, swing, e.e1)
        t0, t1, t2, t3, t4 = y0 + zero, y2 + zero, up / 2.0 + zero, zero, faster / 6.0 + zero
        b0, b1, b2, b3, b4 = y1 + zero, y3 + zero, swing / 2.0 + zero, zero, swinging / 6.0 + zero
        if kind == SLIP:
            # The particular solution: the coefficients of both cubics, from the highest power down.
            a3, c3 = _onward(q, e.e3, 3.0, zero, zero, zero, zero)
            a2, c2 = _onward(q, e.e2, 2.0, a3, c3, zero, zero)
            a1, c1 = _onward(q, e.e1, 1.0, a2, c2, a3, c3)
            a0, c0 = _onward(q, e.e0, 0.0, a1, c1, a2, c2)
            tilt_now, tilt_rate, bob_now, bob_rate = balance + a0, a1, c0, c1
        else:
            # The particular solution of the bob under a held block, from the highest power down.
            p3 = q.f * e.e3
            p2 = q.f * e.e2 - 3.0 * q.c2 * p3
            p1 = q.f * e.e1 - 2.0 * q.c2 * p2 - 6.0 * q.m22 * p3
            tilt_now, tilt_rate, bob_rate = zero, zero, p1 + zero
            bob_now = q.f * e.e0 - q.c2 * p1 - 2.0 * q.m22 * p2 + zero
    # The free motion is the state minus the particular solution.
    f0, f1, f2, f3 = y0 - tilt_now, y1 - bob_now, y2 - tilt_rate, y3 - bob_rate
    if kind != SLIP:
        still = zero if kind == REST else y0 + zero
        signal = Signal(still, zero, zero, zero, zero, zero, zero, zero, zero)
        bob = Signal(b0, zero, zero, f1, f3, b1, b2, b3, b4)
        return Arc(signal, bob, zero, zero, q.held_p + zero, q.held_q + zero, e.xi + zero, e.phase + zero)
    # Project the free motion onto both real modes. The pair has the remainder.
    a = q.al0 * f0 + q.al1 * f1 + q.al2 * f2 + q.al3 * f3
    b = q.bl0 * f0 + q.bl1 * f1 + q.bl2 * f2 + q.bl3 * f3
    u0, u1 = f0 - a * q.a0 - b * q.b0, f1 - a * q.a1 - b * q.b1
    v0, v1 = f2 - a * q.a2 - b * q.b2, f3 - a * q.a3 - b * q.b3
    signal = Signal(t0, a * q.a0, b * q.b0, u0, v0, t1, t2, t3, t4)
    bob = Signal(b0, a * q.a1, b * q.b1, u1, v1, b1, b2, b3, b4)
    return Arc(signal, bob, q.s1 + zero, q.s2 + zero, q.p + zero, q.q + zero, e.xi + zero, e.phase + zero)


@compiled
def arc_from(q, mode, y, e):
    """Return the arc that starts from the state `y` in a mode under the forcing `e`."""
    return launch(q, mode.kind, mode.tilt, mode.direction, y[TILT], y[SWING], y[TILT_RATE], y[SWING_RATE], e)


@compiled
def exponential(x):
    """Return e^x. The imaginary part is so small that its square vanishes."""
    return np.exp(x.real) * (1.0 + (x - x.real))


@compiled
def sincos(x):
    """Return sine and cosine of x. The imaginary part is so small that its square vanishes."""
    sine, cosine, rest = np.sin(x.real), np.cos(x.real), x - x.real
    return sine + cosine * rest, cosine - sine * rest


@compiled
def pair(p, q, t):
    """Return the solutions u and v of x'' + p x' + q x = 0.

    The initial values are (u, u') = (1, 0) and (v, v') = (0, 1) at t = 0.

    With w^2 = q - p^2/4, v = exp(-pt/2) sin(wt)/w and u = exp(-pt/2) cos(wt) + p/2 v.
    """
    # Where w^2 changes its sign, cos and sin become cosh and sinh. Near zero both formulas divide by a small
    # w, and their derivatives by its square. There the power series in w^2 is one function for both signs.
    w2 = q - 0.25 * p * p
    x2 = w2 * t * t
    half = 0.5 * p
    if abs(x2.real) < _SERIES:
        decay = exponential(-half * t)
        c = decay * (1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0 * (1.0 - x2 / 56.0))))
        v = decay * t * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0 * (1.0 - x2 / 72.0))))
    elif w2.real < 0.0:
        w = np.sqrt(-w2)
        slow, fast = exponential((w - half) * t), exponential((-w - half) * t)
        c, v = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
    else:
        w, decay = np.sqrt(w2), np.exp(-half * t)
        c, v = decay * np.cos(w * t), decay * np.sin(w * t) / w
    return c + half * v, v


@compiled
def _beyond_cubic(x):
    """Return e^x - 1 - x - x^2/2 - x^3/6."""
    if abs(x.real) > _EARLY:
        return np.exp(x) - (1.0 + x * (1.0 + x * (0.5 + x / 6.0)))
    # For small x the difference would cancel. Sum the series from its smallest term.
    total = 1.0 + x / 16.0
    for k in range(15, 4, -1):
        total = 1.0 + x / k * total
    x2 = x * x
    return x2 * x2 / 24.0 * total


@compiled
def _pair_beyond_cubic(p, q, t):
    """Return the solutions u and v of the pair without the terms of their power series up to t^3."""
    pt, qt = p * t, q * t
    v2 = -0.5 * pt * t
    v3 = -(qt * t * t + 2.0 * pt * v2) / 6.0
    if max(abs(pt.real), np.sqrt(abs(qt.real * t.real))) > _EARLY:
        u, v = pair(p, q, t)
        return u - (1.0 - 0.5 * qt * t - qt * v2 / 3.0), v - (t + v2 + v3)
    u_rest, v_rest, before, last = -0.25 * qt * v3, 0.0 * v3, v2, v3
    # From u' = -q v and v' = u - p v: each term of v follows from the two before it, and each term of u from
    # one of v.
    for k in range(2, 15):
        before, last = last, -_TERMS[k] * (qt * t * before + (k + 1.0) * pt * last)
        v_rest += last
        u_rest -= qt * last / (k + 3.0)
    return u_rest, v_rest


@compiled
def exponentials(arc, now, t):
    """Return e^(s1 t) and e^(s2 t) at an instant."""
    if arc.xi != 0.0:
        return now.e1, now.e2
    # Under a cubic forcing an instant holds the remainders beyond degree 3. Add the polynomials again.
    x, y = arc.s1 * t, arc.s2 * t
    return now.e1 + 1.0 + x * (1.0 + x * (0.5 + x / 6.0)), now.e2 + 1.0 + y * (1.0 + y * (0.5 + y / 6.0))


@compiled
def instant(arc, t):
    """Return the functions of time at the local time `t` of an arc."""
    if arc.xi.real == 0.0:
        u, v = _pair_beyond_cubic(arc.p, arc.q, t)
        e1, e2 = _beyond_cubic(arc.s1 * t), _beyond_cubic(arc.s2 * t)
        return Instant(e1, e2, u, v, t + 0.0 * arc.xi, t * t + 0.0 * arc.xi)
    u, v = pair(arc.p, arc.q, t)
    sine, cosine = sincos(arc.phase + arc.xi * t)
    return Instant(exponential(arc.s1 * t), exponential(arc.s2 * t), u, v, sine, cosine)


@compiled
def beginning(arc):
    """Return the functions of time at the start of an arc."""
    if arc.xi == 0.0:
        return Instant(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Instant(1.0, 1.0, 1.0, 0.0, np.sin(arc.phase), np.cos(arc.phase))


@compiled
def rate_of(arc, x):
    """Return the time derivative of a signal."""
    zero, xi = 0.0 * arc.xi, arc.xi
    onward = -arc.q * x.on_u - arc.p * x.on_v
    if xi.real == 0.0:
        free = arc.s1 * x.on_s1, arc.s2 * x.on_s2, x.on_v, onward
        # The fourth derivative at the start, to which the forcing does not contribute.
        next_onward = -arc.q * x.on_v - arc.p * onward
        r1, r2 = arc.s1 * arc.s1, arc.s2 * arc.s2
        fourth = r1 * r1 * x.on_s1 + r2 * r2 * x.on_s2 - arc.q * onward - arc.p * next_onward
        return Signal(x.along, *free, 2.0 * x.across, 3.0 * x.gain_across, zero, fourth / 6.0)
    along, across = x.gain_along - xi * x.across, x.gain_across + xi * x.along
    harmonic = along, across, -xi * x.gain_across, xi * x.gain_along
    return Signal(zero, arc.s1 * x.on_s1, arc.s2 * x.on_s2, x.on_v, onward, *harmonic)


@compiled
def value_of(x, now, t):
    """Return the value of a signal."""
    free = x.on_s1 * now.e1 + x.on_s2 * now.e2 + x.on_u * now.u + x.on_v * now.v
    forced = (x.along + x.gain_along * t) * now.sine + (x.across + x.gain_across * t) * now.cosine
    return x.constant + free + forced


@compiled
def state_at(arc, now, t):
    """Return (phi, psi, phi', psi', phi'', psi'') at an instant."""
    tilt, bob = rate_of(arc, arc.tilt), rate_of(arc, arc.bob)
    angles = value_of(arc.tilt, now, t), value_of(arc.bob, now, t)
    rates = value_of(tilt, now, t), value_of(bob, now, t)
    pulls = value_of(rate_of(arc, tilt), now, t), value_of(rate_of(arc, bob), now, t)
    return *angles, *rates, *pulls
