"""Search for the next event of an arc in compiled scalar code, with no event missed.

Over a window of length d the cubic with the values and slopes of a signal g at both ends differs from g by at
most B s^2 (1 - s)^2 d^4/24 at the share s, where B bounds |g''''| and is known in closed form. A cubic lies
above the least of its Bernstein coefficients. Hence a window without an event is proved to have none by two
looks at the signal, and one whose slope is proved to keep its sign has at most one, which Newton's method
finds. Windows about which nothing is proved are halved.
"""

from __future__ import annotations

import math

from tpd.exact.arcs import Signal, exponentials, instant, rate_of, value_of
from tpd.exact.plant import compiled, places
from tpd.exact.terms import SLIP, STICK

CUT, STOP, OVERTURN, END, FIRST, SECOND, BOB, RELATIVE = places(4, -4)
"""Ends of a leg: a part of a long arc; a time at which a state is asked for; a tilt beyond return; its
horizon; the first signal (a turn, or a release upwards), the second (a landing, or a release downwards); a
turn of the bob, or of the bob against the block, which change nothing."""
SIGNALS = 4
"""Signals that may be watched: a table of them has one more row, for numbers of the search."""
_VALUE, _SLOPE, _BEND, _FOURTH = places(4)
"""A watched signal, its derivatives, and the bound on the fourth."""
_CONSTANT, _ON_S1, _ON_S2, _ON_U, _ON_V, _ALONG, _ACROSS, _GAIN_ALONG, _GAIN_ACROSS = range(9)
"""Columns of a watched signal, see `tpd.exact.arcs.Signal`."""
_PAIR, _FORCED = _ON_U, _ON_V
"""Columns of a bound: sizes of the pair and of the answer to the forcing."""
SMALL = 1e-10
"""Time, over that of the shaking, that a motion goes on after an event before it may meet one that was there
already, and below which a window is not divided any more."""
_AT_ZERO = 1e-12
"""A signal below this at the start of an arc began at zero."""
LONGEST = 1.0
"""Longest window, over the quickest time scale of the motion."""
WINDOWS = 16
"""Looks at the signals allowed for each event that is."""
_NEAR, _CLOSE = 1e-7, 1e-6
"""Steps to a root, over the time, after which there is none to come, or one."""
_THIRD, AWAY, _FROM_ZERO = 1.0 / 3.0, 1.0 / 384.0, 1.0 / 162.0
"""The cubic differs from the signal by at most AWAY B d^4, and by _FROM_ZERO B d^4 s at the share s."""
_TWICE = 1.0 / 24.0
"""It differs by at most _TWICE B d^4 s^2."""
_CURVED = math.sqrt(3.0) / 216.0
"""The slope of the cubic differs from that of the signal by at most this times B d^3."""
_BENT = 1.0 / 12.0
"""The curvature of both differs by at most this times B d^2, and so their slopes by as much times B d^3 s."""
HALVED = 60
"""Bisections of a window that leave no more than rounding."""


@compiled
def _scaled(c, x):
    """Product of a number and a signal."""
    free = c * x.constant, c * x.on_s1, c * x.on_s2, c * x.on_u, c * x.on_v
    return Signal(*free, c * x.along, c * x.across, c * x.gain_along, c * x.gain_across)


@compiled
def _excess(q, arc, forcing):
    """Moment on a held block as a signal, without what its own weight adds."""
    a, b, c = arc.bob, rate_of(arc, arc.bob), 1.0 - q.up
    u, v = c * a.on_u + q.bias * b.on_u, c * a.on_v + q.bias * b.on_v
    still = c * a.constant + q.bias * b.constant - q.f * forcing.constant
    along = c * a.along + q.bias * b.along - q.f * forcing.along
    across = c * a.across + q.bias * b.across - q.f * forcing.across
    more = c * a.gain_along + q.bias * b.gain_along - q.f * forcing.gain_along
    less = c * a.gain_across + q.bias * b.gain_across - q.f * forcing.gain_across
    return Signal(still, 0.0, 0.0, u, v, along, across, more, less)


@compiled
def _watch(w, i, x, arc):
    """Put a signal, its slope and curvature, and a bound on its fourth derivative into row i of `w`."""
    slope, table = rate_of(arc, x), w.signals
    second = rate_of(arc, slope)
    fourth = rate_of(arc, rate_of(arc, second))
    for j in range(9):
        table[i, _VALUE, j], table[i, _SLOPE, j] = x[j], slope[j]
        table[i, _BEND, j], table[i, _FOURTH, j] = second[j], fourth[j]
    # The energy x^2 + x'^2/q of the pair only decreases.
    table[i, _FOURTH, _PAIR] = math.sqrt(fourth.on_u * fourth.on_u + fourth.on_v * fourth.on_v / arc.q)
    table[i, _FOURTH, _FORCED] = math.sqrt(fourth.along * fourth.along + fourth.across * fourth.across)
    if arc.xi == 0.0:
        # The fourth derivative of a cubic is zero, and its polynomial is that of the free solutions.
        table[i, _FOURTH, _FORCED] = table[i, _FOURTH, _GAIN_ALONG] = table[i, _FOURTH, _GAIN_ACROSS] = 0.0


@compiled
def side_of(x):
    """Sign that a signal of a cubic takes at its start: that of the first coefficient that is not zero."""
    first = x.constant if x.constant != 0.0 else x.along
    first = first if first != 0.0 else x.across
    first = first if first != 0.0 else x.gain_across
    return -1.0 if first < 0.0 else 1.0


@compiled
def watch_turns(w, i, side, x, arc):
    """Prepare to look for turns of an angle that goes to `side`."""
    turning = rate_of(arc, x)
    size = abs(turning.on_u) + abs(turning.on_v) + abs(turning.along) + abs(turning.across)
    size += abs(turning.on_s1) + abs(turning.on_s2) + abs(turning.gain_along) + abs(turning.gain_across)
    # A bob that does not move at all does not turn.
    still = Signal(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    moves = size + abs(turning.constant) > 1e-100
    _watch(w, i, _scaled(side, turning) if moves else still, arc)


@compiled
def turn_over(w, i):
    """Watch a signal that has just vanished with the other sign."""
    w.first_zero = i
    for j in range(3):
        for k in range(9):
            w.signals[i, j, k] = -w.signals[i, j, k]


@compiled
def watch_block(q, arc, mode, forcing, w):
    """Prepare the signals of the block, with the forcing over its full size as a signal. Return whether the
    second is watched. Both are positive within an arc. Slip: the rate, and the tilt on the way back to the
    base. Held: the distances of the moment from both limits."""
    # Moving outward phi cannot vanish before phi' does. So phi is watched on the way back only, and a tilt
    # that begins at zero is not taken for an event.
    w.first_zero = FIRST
    if mode.kind == SLIP:
        _watch(w, FIRST, _scaled(mode.direction, rate_of(arc, arc.tilt)), arc)
        if mode.tilt * mode.direction >= 0.0:
            return False
        _watch(w, SECOND, _scaled(mode.tilt, arc.tilt), arc)
        return True
    pull, stuck = _excess(q, arc, forcing), mode.kind == STICK
    level = q.up * arc.tilt.constant - (mode.tilt * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight) + q.slack
    below = _scaled(-1.0, pull)
    _watch(w, FIRST, Signal(hold - level + below.constant, *below[1:]), arc)
    _watch(w, SECOND, Signal(hold + level + pull.constant, *pull[1:]), arc)
    return True


@compiled
def _eval(w, i, now, t, j):
    """Value (j = 0), slope (1) or curvature (2) of a watched signal."""
    x = w.signals
    modes = x[i, j, _ON_S1] * now.e1 + x[i, j, _ON_S2] * now.e2
    free = modes + x[i, j, _ON_U] * now.u + x[i, j, _ON_V] * now.v
    along, across = x[i, j, _ALONG] + x[i, j, _GAIN_ALONG] * t, x[i, j, _ACROSS] + x[i, j, _GAIN_ACROSS] * t
    return x[i, j, _CONSTANT] + free + along * now.sine + across * now.cosine


@compiled
def _bound(w, i, e1, e2, t):
    """Bound on the fourth derivative of a signal over a window that ends at `t`, with the larger exponentials
    in it."""
    x = w.signals[i, _FOURTH]
    forced, more, less = x[_FORCED], x[_GAIN_ALONG], x[_GAIN_ACROSS]
    if more != 0.0 or less != 0.0:
        # The amplitude is a convex function of time, so that it is largest at an end.
        forced = max(forced, math.hypot(x[_ALONG] + more * t, x[_ACROSS] + less * t))
    return abs(x[_ON_S1]) * e1 + abs(x[_ON_S2]) * e2 + x[_PAIR] + forced


CLEAR, ONE, UNKNOWN = range(3)


@compiled
def prove_window(g0, v0, g1, v1, d, bound):
    """Proof about a signal over a window: that it stays positive after its start; that it is positive,
    falls all the way and is not at the end; or nothing."""
    # Bernstein coefficients of the cubic; those of its slope are their differences.
    b1, b2, uncertainty = g0 + d * v0 * _THIRD, g1 - d * v1 * _THIRD, bound * d * d * d * d
    if min(min(g0, g1), min(b1, b2)) > uncertainty * AWAY:
        return CLEAR
    # Divided by s, what is left of the cubic without its first term, g0 (1 - s)^3 >= 0.
    if g0 >= 0.0 and min(min(3.0 * b1, 1.5 * b2), g1) > uncertainty * _FROM_ZERO:
        return CLEAR
    # Divided by s^2, what is left without the first two terms: the signal began with a rate of zero.
    if g0 >= 0.0 and b1 >= 0.0 and min(3.0 * b2, g1) > uncertainty * _TWICE:
        return CLEAR
    steepest = max(max(b1 - g0, b2 - b1), g1 - b2)
    if g1 <= 0.0 < g0 and 3.0 * steepest < -_CURVED * uncertainty:
        return ONE
    # Divided by s, what is left of the cubic's slope without its first term: the rate may begin at zero.
    if g1 <= 0.0 < g0 and b1 <= g0 and 3.0 * max(2.0 * (b2 - b1), g1 - b2) < -_BENT * uncertainty:
        return ONE
    return UNKNOWN


@compiled
def estimate(g0, v0, g1, v1, d):
    """Share of the window at which the cubic with these values and slopes at its ends vanishes, about: a step
    of Newton's method from where the line through its ends does."""
    a, b, s = d * v0, d * v1, g0 / (g0 - g1)
    c2, c3 = 3.0 * (g1 - g0) - 2.0 * a - b, 2.0 * (g0 - g1) + a + b
    slope = a + s * (2.0 * c2 + 3.0 * s * c3)
    s = s - (g0 + s * (a + s * (c2 + s * c3))) / slope if slope < 0.0 else s
    return min(1.0, max(0.0, s))


@compiled
def _root(arc, w, i, lo, hi, guess):
    """The root of a signal that is positive at `lo` and is not at `hi`."""
    t, last = lo + guess * (hi - lo), False
    for _ in range(60):
        now = instant(arc, t)
        value, slope = _eval(w, i, now, t, _VALUE), _eval(w, i, now, t, _SLOPE)
        if value > 0.0:
            lo = t
        else:
            hi = t
        # Halley's method: the error is of the third power of its step.
        by = slope - 0.5 * value * _eval(w, i, now, t, _BEND) / slope if slope != 0.0 else 0.0
        onward = t - value / by if by < 0.0 else 0.5 * (lo + hi)
        if not lo <= onward <= hi:
            onward = 0.5 * (lo + hi)
        moved, t = abs(onward - t), onward
        if last or moved <= _NEAR * hi:
            break
        last = moved <= _CLOSE * hi
    return t


@compiled
def _initial_values(arc, w, now, t, end, g, v):
    """Put values and slopes of the signals at the start of an arc into `g` and `v`. Where the last event made
    a signal zero, the motion goes on a little before that signal may vanish again, unless the forcing is a
    cubic, whose signals are exact there. Return the time."""
    goes_on = False
    for i in range(w.count):
        if i != SECOND or w.has_second:
            g[i], v[i] = _eval(w, i, now, t, _VALUE), _eval(w, i, now, t, _SLOPE)
            goes_on = goes_on or (g[i] < _AT_ZERO and v[i] <= 0.0 and arc.xi != 0.0 and i >= w.first_zero)
            if g[i] < _AT_ZERO and v[i] > 0.0:
                g[i] = max(g[i], 0.0)
    if goes_on:
        t = min(t + w.shortest, end)
        now = instant(arc, t)
        for i in range(w.count):
            if i != SECOND or w.has_second:
                rose = g[i] < _AT_ZERO and v[i] > 0.0
                g[i], v[i] = _eval(w, i, now, t, _VALUE), _eval(w, i, now, t, _SLOPE)
                g[i] = max(g[i], 0.0) if rose else g[i]
    return t


@compiled
def _immediate_event(w, since, t, g, v):
    """The event that a motion is past already, and its time, not before `since`; END if there is none."""
    for i in range(w.count):
        if (i != SECOND or w.has_second) and g[i] <= 0.0:
            if v[i] < 0.0:
                at = t - g[i] / v[i]
                return i, (at if at >= since else t)
            # It rises: less than zero it is by rounding only.
            g[i] = 0.0
    return END, t


@compiled
def _time_at_limit(arc, limit, lo, hi):
    """Time at which a tilt that is below a limit at `lo`, beyond it at `hi`, and does not turn between them,
    reaches it."""
    for _ in range(HALVED):
        t = 0.5 * (lo + hi)
        if abs(value_of(arc.tilt, instant(arc, t), t)) < limit:
            lo = t
        else:
            hi = t
    return hi


@compiled
def next_event(arc, w, now, t, end):
    """The first event of an arc after `t`, the instant `now`, and until `end`, and its time. No event is END;
    the tilt that reaches the limit is GONE. The working memory `w` has the signals, see
    `tpd.exact.motion.ROOM`."""
    g, v, h, z = w.signals[SIGNALS, 0], w.signals[SIGNALS, 1], w.signals[SIGNALS, 2], w.signals[SIGNALS, 3]
    since = t
    t = _initial_values(arc, w, now, t, end, g, v)
    event, at = _immediate_event(w, since, t, g, v)
    if event != END:
        return event, at
    d, e2 = w.window, 1.0
    while t < end and w.budget > 0:
        d = min(d, end - t)
        to = end if d == end - t else t + d
        now = instant(arc, to)
        w.budget -= 1
        first, soonest, proved = END, to, True
        up, down = exponentials(arc, now, to)
        for i in range(w.count):
            if i == SECOND and not w.has_second:
                continue
            h[i], z[i] = _eval(w, i, now, to, _VALUE), _eval(w, i, now, to, _SLOPE)
            proof = prove_window(g[i], v[i], h[i], z[i], d, _bound(w, i, up, e2, to))
            if proof == UNKNOWN and d <= w.shortest:
                # Rounding decides, but a signal that is exact where it began has left to the wrong side.
                proof = ONE if h[i] <= 0.0 and (g[i] > 0.0 or arc.xi == 0.0) else CLEAR
            if proof == UNKNOWN:
                proved = False
                break
            if proof == ONE and (first == END or _eval(w, i, instant(arc, soonest), soonest, _VALUE) <= 0.0):
                # Its only root in the window comes before that of the other signal. A signal that began at
                # zero has a root there: from the right, Newton's method comes to the other one.
                guess = estimate(g[i], v[i], h[i], z[i], d) if g[i] > 0.0 else 1.0
                root = _root(arc, w, i, t, to, guess)
                if first == END or root < soonest:
                    first, soonest = i, root
        if not proved:
            d *= 0.5
            continue
        if first != END:
            return first, soonest
        if not abs(value_of(arc.tilt, now, to)) < w.limit:
            return OVERTURN, _time_at_limit(arc, w.limit, t, to)
        t, e2, d = to, down, min(2.0 * d, w.longest)
        for i in range(w.count):
            g[i], v[i] = h[i], z[i]
    return END, end
