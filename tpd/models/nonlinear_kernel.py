"""Compiled event loop of the nonlinear equations (4), for one motion after another in scalar code.

In a batch that is vectorised every motion waits for the one with the most events. Here each goes its own
way: steps of Dormand and Prince's pair of orders 5 and 4, events located on the quintic through angle, rate
and acceleration at both ends of a step, and one more step that ends there. The rules at events are those of
`tpd.exact.contact` and `tpd.models.segmented`. Numba takes 0.3 s to load: no module imports this one before
it is needed.
"""

from __future__ import annotations

import math
from collections import namedtuple

from tpd.exact.arc_kernel import compiled
from tpd.exact.contact import REST, SLIP, STICK
from tpd.exact.event_kernel import put_mode

REST_RATE = 1e-4
"""An impact slower than this (phi' in units of nu) that the block can be held after is rest."""
MAX_STEPS = 20_000
"""Bound on the steps of one forcing period, refused ones included."""
_NONE, _LANDING, _TURN, _UP, _DOWN = -1, 0, 1, 2, 3
"""Events: of a slipping block the first two, of a held one its releases to either side."""
ARRIVED, LOST, EXHAUSTED, BROKEN = range(4)
"""Ends of a period."""

SIZES = 3
"""Numbers of a tally: largest phi, its opposite, and largest |psi|. A long tally has more."""
RELATIVE, TIMES, IMPACTS, LIFTED, ORIGIN, EVENTS, TALLY = 3, 4, 8, 9, 10, 11, 12
"""Places of a long tally: largest |psi - phi|, the times of all four, impacts, time of the first uplift, time
at which the clock was at zero, and events."""

Plant = namedtuple("Plant", "nu mu lam k f xi rho e m11 m22 c1 c2 tilt weight pull period rest")
"""Coefficients of (4) for one motion; `pull` is mu rho lam, and `rest` the largest rate of an impact that may
end in rest."""


@compiled
def plant(x, xi, period, rest_rate):
    """Coefficients from (nu, mu, lam, zeta, k, f, -, rho, e)."""
    nu, mu, lam, zeta, k, f, _, rho, e = x
    hinge = 2.0 * zeta * math.sqrt(lam * rho)
    m11, m22 = 1.0 + mu * rho * (4.0 + nu * nu), lam * rho
    coefficients = (m11, m22, mu * lam * hinge, hinge, 1.0 + 2.0 * mu, (1.0 + mu) * nu, mu * rho * lam)
    return Plant(nu, mu, lam, k, f, xi, rho, e, *coefficients, period, rest_rate * nu)


@compiled
def sine_at(q, growth, t):
    """sin(xi t) times the share of its full size that the shaking has; t from the start of a period. Where xi
    is 0, `growth` has the four coefficients of a cubic in its place."""
    if q.xi == 0.0:
        return growth[0] + t * (growth[1] + t * (growth[2] + t * growth[3]))
    return min(1.0, growth[0] + growth[1] * t) * math.sin(q.xi * t)


@compiled
def _slipping(q, y, tilt, drag, sine, out):
    """Derivative of the state of a block that moves; see `tpd.core.equations`."""
    sp, cp, sq, cq = math.sin(y[0]), math.cos(y[0]), math.sin(y[1]), math.cos(y[1])
    sine_lean, cosine_lean = sp * cq - cp * sq, cp * cq + sp * sq
    big_s = tilt * q.nu * sine_lean + 2.0 * cosine_lean
    big_c = tilt * q.nu * cosine_lean - 2.0 * sine_lean
    weight, push, slip = tilt * q.weight, q.f * sine, y[2] - y[3]
    r1 = q.tilt * sp - weight * cp - push * (weight * sp + q.tilt * cp) - q.pull * big_c * y[3] * y[3]
    r1 -= drag * q.k + q.c1 * slip
    r2 = push * cq - sq + q.rho * big_c * y[2] * y[2] + q.c2 * slip
    coupling, back = q.pull * big_s, q.rho * big_s
    by = 1.0 / (q.m11 * q.m22 - coupling * back)
    out[0], out[1] = y[2], y[3]
    out[2], out[3] = by * (q.m22 * r1 + coupling * r2), by * (q.m11 * r2 + back * r1)


@compiled
def _swing(q, psi, rate, sine):
    """Acceleration of the bob under a block that is held."""
    return (q.f * math.cos(psi) * sine - math.sin(psi) - q.c2 * rate) / q.m22


@compiled
def _field(q, mode, y, sine, out):
    """Derivative of the state."""
    if mode[0] == SLIP:
        _slipping(q, y, mode[1], mode[2], sine, out)
    else:
        out[0], out[1], out[2], out[3] = 0.0, y[3], 0.0, _swing(q, y[1], y[3], sine)


@compiled
def _excess(q, phi, psi, rate, side, sine):
    """Moment on a held block minus the moment of its weight."""
    sp, cp, lean = math.sin(phi), math.cos(phi), phi - psi
    big_s = side * q.nu * math.sin(lean) + 2.0 * math.cos(lean)
    big_c = side * q.nu * math.cos(lean) - 2.0 * math.sin(lean)
    weight = side * q.weight
    on_block = q.tilt * sp - weight * cp - q.f * sine * (weight * sp + q.tilt * cp)
    bob = q.c1 * rate - q.pull * big_c * rate * rate + q.pull * big_s * _swing(q, psi, rate, sine)
    return on_block + bob


@compiled
def decide(q, phi, psi, rate, tilt, way, sine, mode):
    """Put the mode of a state into `mode`: `tilt` and `way` are the signs of phi and phi', zero included."""
    up = _excess(q, phi, psi, rate, 1.0 if tilt == 0.0 else tilt, sine)
    down = _excess(q, phi, psi, rate, -1.0, sine) if tilt == 0.0 else up
    put_mode(up, down, q.k, tilt, way, mode)


@compiled
def _stage(w, h, to, a1, a2, a3, a4, a5, a6):
    """Put the state of a stage into row `to` of `w`; the derivatives are in rows 1 to 6."""
    for i in range(4):
        slope = a1 * w[1, i] + a2 * w[2, i] + a3 * w[3, i] + a4 * w[4, i] + a5 * w[5, i] + a6 * w[6, i]
        w[to, i] = w[0, i] + h * slope


@compiled
def _step(q, growth, mode, t, h, w):
    """One step of Dormand and Prince: from row 0 of `w` with the derivative in row 1 to row 8 with the
    derivative in row 7."""
    for j in range(2, 7):
        for i in range(4):
            w[j, i] = 0.0
    _stage(w, h, 8, 1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    _field(q, mode, w[8], sine_at(q, growth, t + 0.2 * h), w[2])
    _stage(w, h, 8, 3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0)
    _field(q, mode, w[8], sine_at(q, growth, t + 0.3 * h), w[3])
    _stage(w, h, 8, 44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0)
    _field(q, mode, w[8], sine_at(q, growth, t + 0.8 * h), w[4])
    a1, a2, a3, a4 = 19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0
    _stage(w, h, 8, a1, a2, a3, a4, 0.0, 0.0)
    _field(q, mode, w[8], sine_at(q, growth, t + 8.0 / 9.0 * h), w[5])
    end = sine_at(q, growth, t + h)
    a1, a2, a3, a4 = 9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0
    _stage(w, h, 8, a1, a2, a3, a4, -5103.0 / 18656.0, 0.0)
    _field(q, mode, w[8], end, w[6])
    b1, b3, b4, b5, b6 = 35.0 / 384.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0
    _stage(w, h, 8, b1, 0.0, b3, b4, b5, b6)
    _field(q, mode, w[8], end, w[7])


@compiled
def _error(w, h, scales, rtol):
    """Estimated error of a step over what is allowed; NaN where the step has no finite numbers."""
    worst = 0.0
    e1, e3, e4 = 71.0 / 57600.0, -71.0 / 16695.0, 71.0 / 1920.0
    e5, e6, e7 = -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0
    for i in range(4):
        slope = e1 * w[1, i] + e3 * w[3, i] + e4 * w[4, i] + e5 * w[5, i] + e6 * w[6, i] + e7 * w[7, i]
        size = max(0.1 * scales[i], max(abs(w[0, i]), abs(w[8, i])))
        ratio = abs(h * slope) / (rtol * size)
        # A comparison with NaN is false, which would let it pass.
        if not ratio <= worst:
            worst = ratio
    return worst


@compiled
def _angle(w, h, i, x):
    """Angle i and its rate at the share x of a step, on the quintic through both ends."""
    v0, v1, a0, a1 = h * w[0, i + 2], h * w[8, i + 2], h * h * w[1, i + 2], h * h * w[7, i + 2]
    d, e, c = w[8, i] - w[0, i] - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    c3, c4, c5 = 10.0 * d - 4.0 * e + 0.5 * c, -15.0 * d + 7.0 * e - c, 6.0 * d - 3.0 * e + 0.5 * c
    angle = w[0, i] + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
    rate = v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    return angle, rate / h


@compiled
def _signal(q, growth, mode, t, h, w, which, x):
    """Signal that is positive until the event `which`, at the share x of a step."""
    if which == _LANDING:
        return mode[1] * _angle(w, h, 0, x)[0]
    if which == _TURN:
        return mode[2] * _angle(w, h, 0, x)[1]
    psi, rate = _angle(w, h, 1, x)
    way = 1.0 if which == _UP else -1.0
    side = way if mode[0] == REST else mode[1]
    return q.k - way * _excess(q, w[0, 0], psi, rate, side, sine_at(q, growth, t + x * h))


@compiled
def _root(q, growth, mode, t, h, w, which, hi):
    """Share of the step, at most `hi`, at which a signal that is not positive at `hi` vanishes."""
    top = _signal(q, growth, mode, t, h, w, which, hi)
    lo, low = 0.0, _signal(q, growth, mode, t, h, w, which, 0.0)
    if low <= 0.0:
        # The signal begins at zero and ends within the step: look for where it is positive.
        lo = hi
        for _ in range(40):
            lo *= 0.5
            low = _signal(q, growth, mode, t, h, w, which, lo)
            if low > 0.0:
                break
        else:
            return 0.0
    side = 0
    for _ in range(60):
        # Illinois: the false position, where an end that stays counts half.
        x = hi - top * (hi - lo) / (top - low)
        value = _signal(q, growth, mode, t, h, w, which, x)
        if value > 0.0:
            lo, low = x, value
            top, side = (0.5 * top if side == 1 else top), 1
        else:
            hi, top = x, value
            low, side = (0.5 * low if side == -1 else low), -1
        if hi - lo < 1e-14 or abs(value) < 1e-15:
            return x
    return hi


@compiled
def _dip(q, growth, mode, t, h, w, which, first, last):
    """Share of the step at which a signal, positive at both ends, is not positive between; 0 if it is."""
    if first <= 0.0:
        # It has only just begun, at zero but for the rounding of the last event.
        return 0.0
    if which == _TURN:
        a0, a1 = mode[2] * w[1, 2], mode[2] * w[7, 2]
        if a0 >= 0.0 or a1 <= 0.0:
            return 0.0
        x = a0 / (a0 - a1)
    else:
        middle = _signal(q, growth, mode, t, h, w, which, 0.5)
        bend = 2.0 * (first + last - 2.0 * middle)
        slope = last - first - bend
        if bend <= 0.0 or not 0.0 < -slope < 2.0 * bend:
            return 0.0
        # The parabola through three values errs by little within a sixteenth of a period.
        x = -0.5 * slope / bend
    return x if _signal(q, growth, mode, t, h, w, which, x) <= 0.0 else 0.0


@compiled
def _met(q, growth, mode, t, h, w, which):
    """Share of the step at which an event is met; 2 if it is not."""
    first = _signal(q, growth, mode, t, h, w, which, 0.0)
    last = _signal(q, growth, mode, t, h, w, which, 1.0)
    hi = 1.0 if last <= 0.0 else _dip(q, growth, mode, t, h, w, which, first, last)
    return _root(q, growth, mode, t, h, w, which, hi) if hi > 0.0 else 2.0


@compiled
def _first_event(q, growth, mode, t, h, w):
    """First event within a step and its share of the step."""
    if mode[0] != SLIP:
        which, x = _NONE, 1.0
        # A number that is no constant: for each of those Numba compiles all that is called anew.
        for release in (_UP, _DOWN):
            share = _met(q, growth, mode, t, h, w, release)
            if share < x or (share == 1.0 and which == _NONE):
                which, x = release, share
        return which, x
    turn = _met(q, growth, mode, t, h, w, _TURN)
    until = min(turn, 1.0)
    # Until it turns, the block comes down monotonously: it lands where its tilt has another sign by then.
    if mode[1] != mode[2] and _signal(q, growth, mode, t, h, w, _LANDING, until) <= 0.0:
        return _LANDING, _root(q, growth, mode, t, h, w, _LANDING, until)
    return (_TURN, turn) if turn <= 1.0 else (_NONE, 1.0)


@compiled
def _polish(which, h, w):
    """Move the end of a step, which lies next to an event, onto it: return the time that this takes."""
    if which != _LANDING and which != _TURN:
        return 0.0
    i = 0 if which == _LANDING else 2
    late = -w[8, i] / w[7, i] if w[7, i] != 0.0 else 0.0
    # Where the motion all but grazes, the slope says little about where the event is.
    if not abs(late) < 1e-4 * h:
        late = 0.0
    for j in range(4):
        w[8, j] += late * w[7, j]
    w[8, i] = 0.0
    return late


@compiled
def _land(q, y, tilt, sine, mode):
    """Impact of a block that has come down from the side `tilt`: change the rates in `y`, and the mode."""
    # The impulse acts through the new corner. Block and bob together keep their angular momentum about it
    # but for the loss, and the bob keeps its velocity across the rod, which pulls along itself only.
    sq, cq, before = math.sin(y[1]), math.cos(y[1]), y[2]
    corner = tilt * q.nu
    old, new = 2.0 * sq + corner * cq, 2.0 * sq - corner * cq
    bob = q.mu * q.rho
    loss = q.e * (1.0 + bob * q.nu * q.nu) + bob * q.nu * q.nu
    inertia = 1.0 + bob * new * new
    # At most what conserves energy, as in `contact.impact_ratio`.
    ratio = min((loss + bob * new * old) / inertia, math.sqrt((1.0 + bob * old * old) / inertia))
    after = before if q.e == 1.0 else before * ratio
    if abs(after) <= q.rest:
        decide(q, 0.0, y[1], y[3], 0.0, 0.0, sine, mode)
        if mode[0] == REST:
            after = 0.0
    if after != before:
        y[3] += (2.0 * cq * (after - before) + corner * sq * (after + before)) / q.lam
    y[2] = after
    decide(q, 0.0, y[1], y[3], 0.0, math.copysign(1.0, after) if after != 0.0 else 0.0, sine, mode)


@compiled
def _meet(q, y, which, x, sine, mode):
    """Change the state and the mode at an event at the share x of a step."""
    if which == _LANDING:
        _land(q, y, mode[1], sine, mode)
    elif which == _TURN:
        decide(q, y[0], y[1], y[3], mode[1], 0.0, sine, mode)
        if x == 0.0 and mode[0] == SLIP:
            # It was let go at a moment that only touched the limit: it does not move.
            mode[0] = STICK if y[0] != 0.0 else REST
    else:
        side = 1.0 if which == _UP else -1.0
        mode[1] = side if mode[0] == REST else mode[1]
        mode[0], mode[2] = SLIP, side


@compiled
def _turned(w, h, less, way):
    """Angle psi, less `less` times phi, where its rate, of sign `way` at the start of a step, vanishes, and
    the share of the step."""
    lo, hi = 0.0, 1.0
    # The angle errs by the square of this bisection's error.
    for _ in range(20):
        x = 0.5 * (lo + hi)
        if (_angle(w, h, 1, x)[1] - less * _angle(w, h, 0, x)[1]) * way > 0.0:
            lo = x
        else:
            hi = x
    return abs(_angle(w, h, 1, hi)[0] - less * _angle(w, h, 0, hi)[0]), hi


@compiled
def _larger(sizes, k, angle, tau):
    """Put an angle into the tally if it is the largest so far, with its time where there is room."""
    if angle > sizes[k]:
        sizes[k] = angle
        if len(sizes) > SIZES:
            sizes[TIMES + k] = tau


@compiled
def _note(w, h, sizes, tau):
    """Largest angles with those within a step of length h that ends at `tau`."""
    _larger(sizes, 0, w[8, 0], tau)
    _larger(sizes, 1, -w[8, 0], tau)
    _larger(sizes, 2, abs(w[8, 1]), tau)
    if w[0, 3] * w[8, 3] < 0.0:
        angle, x = _turned(w, h, 0.0, w[0, 3])
        _larger(sizes, 2, angle, tau - (1.0 - x) * h)
    if len(sizes) > SIZES:
        _larger(sizes, RELATIVE, abs(w[8, 1] - w[8, 0]), tau)
        way = w[0, 3] - w[0, 2]
        if way * (w[8, 3] - w[8, 2]) < 0.0:
            angle, x = _turned(w, h, 1.0, way)
            _larger(sizes, RELATIVE, angle, tau - (1.0 - x) * h)


@compiled
def _count(sizes, which, mode, tau):
    """Put an event into a long tally."""
    sizes[EVENTS] += 1.0
    if which == _LANDING:
        sizes[IMPACTS] += 1.0
    if mode[0] == SLIP:
        sizes[LIFTED] = min(sizes[LIFTED], tau)


@compiled
def _length(h, error):
    """Length of the next step after one whose error is this share of what is allowed."""
    if not error < math.inf:
        return 0.2 * h
    return h * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))


@compiled
def advance(q, growth, mode, clock, w, sizes, scales, end, rtol, max_events):
    """Follow the motion in row 0 of `w` up to `end`; `clock` holds its time and the next step's length, and
    mode[3] whether the block was held."""
    events, origin = 0, sizes[ORIGIN] if len(sizes) > SIZES else 0.0
    _field(q, mode, w[0], sine_at(q, growth, clock[0]), w[1])
    for _ in range(MAX_STEPS):
        t, left = clock[0], end - clock[0]
        if left <= 1e-14 * q.period:
            return ARRIVED
        wanted = min(clock[1], q.period / 16.0)
        h = left if left <= 1.000001 * wanted else wanted
        _step(q, growth, mode, t, h, w)
        error = _error(w, h, scales, rtol)
        if not error <= 1.0:
            clock[1] = _length(h, error)
            if clock[1] < 1e-13 * q.period:
                return BROKEN
            continue
        clock[1] = max(wanted if h < wanted else 0.0, _length(h, error))
        which, x = _first_event(q, growth, mode, t, h, w)
        if which == _NONE:
            clock[0] = end if h == left else t + h
        else:
            _step(q, growth, mode, t, x * h, w)
            clock[0] = min(t + x * h + _polish(which, h, w), end)
        _note(w, max(x * h, 1e-300), sizes, origin + clock[0])
        for i in range(4):
            w[0, i], w[1, i] = w[8, i], w[7, i]
        if not abs(w[0, 0]) < 0.5 * math.pi:
            return LOST
        if which != _NONE:
            events += 1
            sine = sine_at(q, growth, clock[0])
            _meet(q, w[0], which, x, sine, mode)
            _field(q, mode, w[0], sine, w[1])
            mode[3] = max(mode[3], 1.0 if mode[0] != SLIP else 0.0)
            if len(sizes) > SIZES:
                _count(sizes, which, mode, origin + clock[0])
            if events >= max_events:
                return EXHAUSTED
    return EXHAUSTED
