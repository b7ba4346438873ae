"""The event-driven flow in compiled scalar code: arc after arc, with no event missed.

Over a window of length d the cubic with the values and slopes of a signal g at both ends differs from g by at
most B s^2 (1 - s)^2 d^4/24 at the share s, where B bounds |g''''| and is known in closed form. A cubic lies
above the least of its Bernstein coefficients. Hence a window without an event is proved to have none by two
looks at the signal, and one whose slope is proved to keep its sign has at most one, which Newton's method
finds. Windows about which nothing is proved are halved.

`tpd.exact.flow` follows the same motions by the same rules in JAX, with another proof.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import (
    Instant,
    Signal,
    compiled,
    instant,
    launch,
    moment,
    rate_of,
    state_at,
    struck,
    value_of,
)
from tpd.exact.contact import REST, SLIP, STICK

ARRIVED, LOST, EXHAUSTED = range(3)
"""Ends of a run."""
GONE, END, FIRST, SECOND, BOB = -2, -1, 0, 1, 2
"""Ends of a leg: its horizon; the first signal (a turn, or a release upwards), the second (a landing, or a
release downwards); a turn of the bob, which changes nothing; or a tilt beyond return."""
LEG = 13
"""Numbers of a recorded leg: kind and signs of its mode, its beginning and duration, what ended it, whether
that ended in rest, the state at its start, and that of the angles at its end."""
_SMALL = 1e-10
"""Share of a period that a motion goes on after an event before it may meet one that was there already, and
below which a window is not divided any more."""
_AT_ZERO = 1e-12
"""A signal below this at the start of an arc began at zero."""
_ROUNDING = 1e-15
"""Share of a period below which a remaining time is rounding."""
_LONGEST = 1.0
"""Longest window, over the quickest time scale of the motion."""
_LOOKS = 16
"""Looks at the signals allowed for each event that is."""
_NEAR, _CLOSE = 1e-7, 1e-4
"""Steps to a root, over the time, after which there is none to come, or one."""
_THIRD, _AWAY, _FROM_ZERO = 1.0 / 3.0, 1.0 / 384.0, 1.0 / 162.0
"""The cubic differs from the signal by at most _AWAY B d^4, and by _FROM_ZERO B d^4 s at the share s."""
_CURVED = math.sqrt(3.0) / 216.0
"""The slope of the cubic differs from that of the signal by at most this times B d^3."""


@compiled
def sign(x):
    """Sign of a number, 0 of zero."""
    return 0.0 if x == 0.0 else math.copysign(1.0, x)


@compiled
def beyond_return(q):
    """Tilt (rad) from which the block does not return; see `tpd.core.equations.Linear`."""
    return 10.0 * (q.weight + q.k + q.f * q.up) / q.up


@compiled
def share_at(growth, t):
    """Share of its full size that the shaking has at `t`, counted from the start of the period."""
    return min(1.0, growth[0] + growth[1] * t)


@compiled
def put_mode(up, down, friction, tilt, way, mode):
    """Put the mode of a state into `mode`; see `tpd.exact.contact.decide` for the arguments."""
    lifts = 1.0 if up > friction else (-1.0 if down < -friction else 0.0)
    goes = way if way != 0.0 else lifts
    if goes != 0.0:
        mode[0] = SLIP
    else:
        mode[0] = STICK if tilt != 0.0 else REST
    mode[1], mode[2] = (tilt if tilt != 0.0 else goes), goes


@compiled
def decide(q, y, tilt, way, sine, mode):
    """Put the mode of a state into `mode`; `tilt` and `way` are the signs of phi and phi', zero included, and
    `sine` is the forcing over its full size. See `tpd.exact.arc.classify`."""
    held, side = moment(q, y[0], y[1], y[3], sine), (1.0 if tilt == 0.0 else tilt)
    other = -1.0 if tilt == 0.0 else tilt
    put_mode(held - side * q.weight, held - other * q.weight, q.k, tilt, way, mode)


@compiled
def held_on_base(q, psi, rate, sine):
    """Whether weight and friction would hold the block at phi = 0 if it did not move."""
    return abs(moment(q, 0.0 * psi, psi, rate, sine)) <= q.weight + q.k


@compiled
def reserve(q, kind, tilt, which, y0, y1, y3, sine):
    """Distance of the moment on a held block from the limit at which it is released upwards, or downwards."""
    way = 1.0 if which == FIRST else -1.0
    # Off its base the block has one weight to overcome, on its base one to either side.
    level = tilt * q.weight if kind == STICK else way * q.weight
    return q.k - way * (moment(q, y0, y1, y3, sine) - level)


@compiled
def _scaled(c, x):
    """Product of a number and a signal."""
    free = c * x.constant, c * x.on_s1, c * x.on_s2, c * x.on_u, c * x.on_v
    return Signal(*free, c * x.along, c * x.across, c * x.gain_along, c * x.gain_across)


@compiled
def _excess(q, arc, share, rate):
    """Moment on a held block as a signal, without its constant."""
    a, b, c = arc.bob, rate_of(arc, arc.bob), 1.0 - q.up
    u, v = c * a.on_u + q.bias * b.on_u, c * a.on_v + q.bias * b.on_v
    along, across = c * a.along + q.bias * b.along - q.f * share, c * a.across + q.bias * b.across
    more = c * a.gain_along + q.bias * b.gain_along - q.f * rate
    return Signal(0.0, 0.0, 0.0, u, v, along, across, more, c * a.gain_across + q.bias * b.gain_across)


@compiled
def _watch(w, i, x, arc):
    """Put a signal, its slope and curvature, and a bound on its fourth derivative into row i of `w`."""
    slope = rate_of(arc, x)
    second = rate_of(arc, slope)
    fourth = rate_of(arc, rate_of(arc, second))
    for j in range(9):
        w[i, 0, j], w[i, 1, j], w[i, 2, j], w[i, 3, j] = x[j], slope[j], second[j], fourth[j]
    # The energy x^2 + x'^2/q of the pair only decreases.
    w[i, 3, 3] = math.sqrt(fourth.on_u * fourth.on_u + fourth.on_v * fourth.on_v / arc.q)
    w[i, 3, 4] = math.sqrt(fourth.along * fourth.along + fourth.across * fourth.across)


@compiled
def _watch_all(q, arc, mode, bob, share, rate, w):
    """Prepare the signals of an arc; see `tpd.exact.arc.ending`. Return whether the second is watched."""
    turning = rate_of(arc, arc.bob)
    size = abs(turning.on_u) + abs(turning.on_v) + abs(turning.along) + abs(turning.across)
    size += abs(turning.on_s1) + abs(turning.on_s2) + abs(turning.gain_along) + abs(turning.gain_across)
    # A bob that does not move at all does not turn.
    still = Signal(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    _watch(w, BOB, _scaled(bob, turning) if size > 1e-100 else still, arc)
    if mode[0] == SLIP:
        _watch(w, FIRST, _scaled(mode[2], rate_of(arc, arc.tilt)), arc)
        if mode[1] * mode[2] >= 0.0:
            return False
        _watch(w, SECOND, _scaled(mode[1], arc.tilt), arc)
        return True
    pull, stuck = _excess(q, arc, share, rate), mode[0] == STICK
    level = q.up * arc.tilt.constant - (mode[1] * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight)
    above, below = pull, _scaled(-1.0, pull)
    _watch(w, FIRST, Signal(hold - level, *below[1:]), arc)
    _watch(w, SECOND, Signal(hold + level, *above[1:]), arc)
    return True


@compiled
def _look(w, i, now, t, j):
    """Value (j = 0), slope (1) or curvature (2) of a watched signal."""
    # No view of a row: Numba would count its references, which takes longer than the arithmetic.
    free = w[i, j, 1] * now.e1 + w[i, j, 2] * now.e2 + w[i, j, 3] * now.u + w[i, j, 4] * now.v
    along, across = w[i, j, 5] + w[i, j, 7] * t, w[i, j, 6] + w[i, j, 8] * t
    return w[i, j, 0] + free + along * now.sine + across * now.cosine


@compiled
def _bound(w, i, e1, e2, t):
    """Bound on the fourth derivative of a signal over a window that ends at `t`, with the larger exponentials
    in it."""
    forced = w[i, 3, 4]
    if w[i, 3, 7] != 0.0 or w[i, 3, 8] != 0.0:
        # The amplitude is a convex function of time, so that it is largest at an end.
        forced = max(forced, math.hypot(w[i, 3, 5] + w[i, 3, 7] * t, w[i, 3, 6] + w[i, 3, 8] * t))
    return abs(w[i, 3, 1]) * e1 + abs(w[i, 3, 2]) * e2 + w[i, 3, 3] + forced


_CLEAR, _ONE, _UNKNOWN = range(3)


@compiled
def _judged(g0, v0, g1, v1, d, bound):
    """Proof about a signal over a window: that it stays positive after its start; that it is positive,
    falls all the way and is not at the end; or nothing."""
    # Bernstein coefficients of the cubic; those of its slope are their differences.
    b1, b2, left = g0 + d * v0 * _THIRD, g1 - d * v1 * _THIRD, bound * d * d * d * d
    if min(min(g0, g1), min(b1, b2)) > left * _AWAY:
        return _CLEAR
    # Divided by s, what is left of the cubic without its first term, g0 (1 - s)^3 >= 0.
    if g0 >= 0.0 and min(min(3.0 * b1, 1.5 * b2), g1) > left * _FROM_ZERO:
        return _CLEAR
    steepest = max(max(b1 - g0, b2 - b1), g1 - b2)
    if g1 <= 0.0 < g0 and 3.0 * steepest < -_CURVED * left:
        return _ONE
    return _UNKNOWN


@compiled
def _guess(g0, v0, g1, v1, d):
    """Share of the window at which the cubic with these values and slopes at its ends vanishes, about."""
    a, b = d * v0, d * v1
    c2, c3 = 3.0 * (g1 - g0) - 2.0 * a - b, 2.0 * (g0 - g1) + a + b
    s = g0 / (g0 - g1)
    for _ in range(3):
        slope = a + s * (2.0 * c2 + 3.0 * s * c3)
        if slope >= 0.0:
            break
        s = min(1.0, max(0.0, s - (g0 + s * (a + s * (c2 + s * c3))) / slope))
    return s


@compiled
def _root(arc, w, i, lo, hi, guess):
    """The root of a signal that is positive at `lo` and is not at `hi`."""
    t, last = lo + guess * (hi - lo), False
    for _ in range(60):
        now = instant(arc, t)
        value, slope = _look(w, i, now, t, 0), _look(w, i, now, t, 1)
        if value > 0.0:
            lo = t
        else:
            hi = t
        # Halley's method: the error is of the third power of its step.
        by = slope - 0.5 * value * _look(w, i, now, t, 2) / slope if slope != 0.0 else 0.0
        onward = t - value / by if by < 0.0 else 0.5 * (lo + hi)
        if not lo <= onward <= hi:
            onward = 0.5 * (lo + hi)
        moved, t = abs(onward - t), onward
        if last or moved <= _NEAR * hi:
            break
        last = moved <= _CLOSE * hi
    return t


@compiled
def _begun(arc, w, second, now, t, end, least, g, v):
    """Put values and slopes of the signals at the start of an arc into `g` and `v`. A signal that begins at
    zero has just vanished: the motion goes on a little before it may vanish again. Return the time."""
    again = False
    for i in range(3):
        if i != SECOND or second:
            g[i], v[i] = _look(w, i, now, t, 0), _look(w, i, now, t, 1)
            again = again or (g[i] < _AT_ZERO and v[i] <= 0.0)
            if g[i] < _AT_ZERO and v[i] > 0.0:
                g[i] = max(g[i], 0.0)
    if again:
        t = min(t + least, end)
        now = instant(arc, t)
        for i in range(3):
            if i != SECOND or second:
                rose = g[i] < _AT_ZERO and v[i] > 0.0
                g[i], v[i] = _look(w, i, now, t, 0), _look(w, i, now, t, 1)
                g[i] = max(g[i], 0.0) if rose else g[i]
    return t


@compiled
def _at_once(second, t, g, v):
    """The event that a motion is past already, and its time; END if there is none."""
    for i in range(3):
        if (i != SECOND or second) and g[i] <= 0.0:
            if v[i] < 0.0:
                back = -g[i] / v[i]
                return i, (t + back if -t <= back else t)
            # It rises: less than zero it is by rounding only.
            g[i] = 0.0
    return END, t


@compiled
def _next_event(arc, w, second, now, t, end, least, longest, window, limit, looks):
    """The first event of an arc after `t`, the instant `now`, and until `end`, its time, and how many looks
    at the signals are left. No event is END; a tilt beyond `limit` is GONE. The first window is `window`, the
    others are at most `longest`."""
    g, v, h, z = w[3, 0], w[3, 1], w[3, 2], w[3, 3]
    t = _begun(arc, w, second, now, t, end, least, g, v)
    which, at = _at_once(second, t, g, v)
    if which != END:
        return which, at, looks
    d, e2 = window, 1.0
    while t < end and looks > 0:
        d = min(d, end - t)
        to = end if d == end - t else t + d
        now, looks = instant(arc, to), looks - 1
        first, soonest, proved = END, to, True
        for i in range(3):
            if i == SECOND and not second:
                continue
            h[i], z[i] = _look(w, i, now, to, 0), _look(w, i, now, to, 1)
            found = _judged(g[i], v[i], h[i], z[i], d, _bound(w, i, now.e1, e2, to))
            if found == _UNKNOWN and d <= least:
                # Rounding decides.
                found = _ONE if h[i] <= 0.0 < g[i] else _CLEAR
            if found == _UNKNOWN:
                proved = False
                break
            if found == _ONE and (first == END or _look(w, i, instant(arc, soonest), soonest, 0) <= 0.0):
                # Its only root in the window comes before that of the other signal.
                root = _root(arc, w, i, t, to, _guess(g[i], v[i], h[i], z[i], d))
                if first == END or root < soonest:
                    first, soonest = i, root
        if not proved:
            d *= 0.5
            continue
        if first != END:
            return first, soonest, looks
        if not abs(value_of(arc.tilt, now, to)) < limit:
            return GONE, to, looks
        t, e2, d = to, now.e2, min(2.0 * d, longest)
        for i in range(3):
            g[i], v[i] = h[i], z[i]
    return END, end, looks


@compiled
def meet(q, which, capture, sine, y, mode):
    """Change the state and the mode at an event of the block; see `tpd.exact.arc.ends`. Return whether the
    block came to rest there out of hops slower than `capture`."""
    if mode[0] != SLIP:
        side = 1.0 if which == FIRST else -1.0
        mode[1] = side if mode[0] == REST else mode[1]
        mode[0], mode[2] = SLIP, side
        return False
    if which == FIRST:
        # A turn this low belongs to hops slower than the capture speed, whose height is of its square.
        low = abs(y[0]) <= capture * capture
        y[0], y[2] = 0.0 if low else y[0], 0.0
        decide(q, y, 0.0 if low else mode[1], 0.0, sine, mode)
        return low
    rests = abs(y[2]) <= capture and held_on_base(q, y[1], y[3], sine)
    y[0] = 0.0
    y[2], y[3] = struck(q, rests, y[2], y[3])
    if y[2] == 0.0:
        decide(q, y, 0.0, 0.0, sine, mode)
    else:
        mode[0], mode[1] = SLIP, mode[2]
    return rests


@compiled
def _transversality(q, which, before, after, now, sine):
    """See `tpd.exact.contact.transversality_of`; `now` is a state with its accelerations."""
    if before != SLIP or after != SLIP:
        return math.inf
    usual = q.xi * q.weight
    if which == FIRST:
        return abs(now[4]) / (q.xi * usual)
    return math.inf if held_on_base(q, now[1], now[3], sine) else abs(now[2]) / usual


@compiled
def begin(q, growth, mode, y, t, sizes):
    """Put what is counted along a motion into `sizes` as it begins: the largest tilts and swings of the bob
    to either side, the sign of its rate, and the least transversality."""
    sizes[0], sizes[1], sizes[2], sizes[3] = max(y[0], 0.0), max(-y[0], 0.0), max(y[1], 0.0), max(-y[1], 0.0)
    mode[3], rate = (1.0 if mode[0] != SLIP else 0.0), y[3]
    if abs(rate) <= 1e-12:
        # From rest the bob's first and second derivatives vanish: look a little ahead instead.
        ahead = 1e-3 / q.xi
        arc = launch(
            q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], q.xi * t, share_at(growth, t), growth[1]
        )
        rate = value_of(rate_of(arc, arc.bob), instant(arc, ahead), ahead)
    sizes[4], sizes[5] = (-1.0 if rate < 0.0 else 1.0), math.inf


@compiled
def _note(sizes, phi, psi):
    """Take account of the angles at an event."""
    sizes[0], sizes[1] = max(sizes[0], phi), max(sizes[1], -phi)
    sizes[2], sizes[3] = max(sizes[2], psi), max(sizes[3], -psi)


@compiled
def _record(legs, count, mode, y, t, lasted, which, rests, phi, psi):
    """Write a leg down where there is room for it."""
    n = count[0]
    if n < len(legs):
        legs[n, 0], legs[n, 1], legs[n, 2], legs[n, 3], legs[n, 4] = mode[0], mode[1], mode[2], t, lasted
        legs[n, 5], legs[n, 6] = which, 1.0 if rests else 0.0
        for i in range(4):
            legs[n, 7 + i] = y[i]
        legs[n, 11], legs[n, 12] = phi, psi
    count[0] = n + 1


@compiled
def advance(q, growth, mode, y, t, end, sizes, legs, count, capture, max_events):
    """Follow the motion of state `y` from `t` to `end`, both counted from the start of a forcing period, and
    change state, mode and sizes. mode[3] says whether the block was held. Return how it ended."""
    w, was, start = np.empty((4, 4, 9)), np.empty(3), np.empty(4)
    least, limit = _SMALL * end, beyond_return(q)
    longest = _LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q)))
    looks, window = _LOOKS * max_events, longest
    for _ in range(max_events):
        share, rate = share_at(growth, t), growth[1]
        arc = launch(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], q.xi * t, share, rate)
        second = _watch_all(q, arc, mode, sizes[4], share, rate, w)
        left, at, began = end - t, 0.0, 0.0
        for i in range(4):
            start[i] = y[i]
        here = Instant(1.0, 1.0, 1.0, 0.0, math.sin(arc.phase), math.cos(arc.phase))
        while True:
            which, at, looks = _next_event(
                arc, w, second, here, at, left, least, longest, window, limit, looks
            )
            here = instant(arc, at)
            now = state_at(arc, here, at)
            # Hops get shorter one after the other.
            window = min(longest, 4.0 * (at - began) + least)
            if which != BOB:
                break
            _note(sizes, now[0], now[1])
            _record(legs, count, mode, start, t + began, at - began, BOB, False, now[0], now[1])
            began, sizes[4] = at, -sizes[4]
            for i in range(4):
                start[i] = now[i]
            for j in range(3):
                for k in range(9):
                    w[BOB, j, k] = -w[BOB, j, k]
        for i in range(4):
            y[i] = now[i]
        if which == GONE:
            return LOST
        if which == END:
            _note(sizes, y[0], 0.0)
            _record(legs, count, mode, start, t + began, at - began, END, False, y[0], y[1])
            return ARRIVED if looks > 0 else EXHAUSTED
        _note(sizes, y[0], y[1])
        for i in range(3):
            was[i] = mode[i]
        sine = share_at(growth, t + at) * math.sin(q.xi * (t + at))
        rests = meet(q, which, capture, sine, y, mode)
        sizes[5] = min(sizes[5], _transversality(q, which, was[0], mode[0], now, sine))
        sizes[4] = -sizes[4] if y[3] * now[3] < 0.0 else sizes[4]
        mode[3] = max(mode[3], 1.0 if mode[0] != SLIP else 0.0)
        _record(legs, count, was, start, t + began, at - began, which, rests, now[0], now[1])
        t += at
        if end - t <= _ROUNDING * end:
            return ARRIVED
    return EXHAUSTED
