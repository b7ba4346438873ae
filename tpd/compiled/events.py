"""Search for the next event of an arc. No event is missed.

A signal is a quantity that is positive until its event. Over a window of length d, consider the cubic with
the values and slopes of the signal g at both ends. At the share s of the window it differs from g by at most
B s^2 (1 - s)^2 d^4/24, where B bounds |g''''| and is known in closed form. A cubic is nowhere less than the
smallest of its Bernstein coefficients. So two evaluations of the signal prove that a window has no event. If
the slope is proved to keep its sign, a window has at most one event, and Newton's method computes it. A
window without a proof is halved.
"""

from __future__ import annotations

import math

from tpd.compiled.arcs import Signal, exponentials, instant, rate_of, value_of
from tpd.compiled.columns import SLIP, STICK
from tpd.compiled.plant import compiled, places

CUT, STOP, OVERTURN, END, FIRST, SECOND, BOB, RELATIVE = places(4, -4)
"""Events at the end of a leg. The first four are negative and no events of the block.

- CUT: the arc is cut, because it would be too long.
- STOP: a state is requested at this time.
- OVERTURN: the tilt is beyond return.
- END: the end of the arc's time span.
- FIRST: the first signal vanishes, which is a turning point, or a release upwards.
- SECOND: the second signal vanishes, which is a landing, or a release downwards.
- BOB, RELATIVE: turning points of psi and of psi - phi, which do not change the motion.
"""
SIGNALS = 4
"""Number of signals that may be watched. The table of signals has one more row, for numbers of the search."""
_VALUE, _SLOPE, _BEND, _FOURTH = places(4)
"""Rows of a watched signal: its value, its first two derivatives, and the bound on its fourth derivative."""
_CONSTANT, _ON_S1, _ON_S2, _ON_U, _ON_V, _ALONG, _ACROSS, _GAIN_ALONG, _GAIN_ACROSS = range(9)
"""Columns of a watched signal, see `tpd.compiled.arcs.Signal`."""
_PAIR, _FORCED = _ON_U, _ON_V
"""Columns of the bound: amplitudes of the pair and of the response to the forcing."""
SMALL = 1e-10
"""Time that a motion continues after an event before the same signal is checked again, as a share of the
forcing period, or in tau under a ground motion. Windows that are shorter are not divided."""
_AT_ZERO = 1e-12
"""Value below which a signal counts as zero at the start of an arc."""
LONGEST = 1.0
"""Longest window, divided by the shortest time scale of the motion."""
WINDOWS = 16
"""Number of windows that the search may examine for each event."""
_NEAR, _CLOSE = 1e-7, 1e-6
"""Relative step of the root search after which it stops, and the one after which it takes only one
more step."""
_THIRD, AWAY, _FROM_ZERO = 1.0 / 3.0, 1.0 / 384.0, 1.0 / 162.0
"""Constants of the proofs. The cubic differs from the signal by at most AWAY B d^4, and by at most _FROM_ZERO
B d^4 s at the share s."""
_TWICE = 1.0 / 24.0
"""The difference is also at most _TWICE B d^4 s^2."""
_CURVED = math.sqrt(3.0) / 216.0
"""The slopes of the cubic and of the signal differ by at most _CURVED B d^3."""
_BENT = 1.0 / 12.0
"""The curvatures differ by at most _BENT B d^2, and so the slopes by at most _BENT B d^3 s."""
HALVED = 60
"""Number of bisections after which a window is as short as rounding allows."""


@compiled
def _scaled(c, x):
    """Return the product of a number and a signal."""
    free = c * x.constant, c * x.on_s1, c * x.on_s2, c * x.on_u, c * x.on_v
    return Signal(*free, c * x.along, c * x.across, c * x.gain_along, c * x.gain_across)


@compiled
def _excess(q, arc, forcing):
    """Return the moment on a held block as a signal, without the share of the block's own weight."""
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
    """Write a signal and its derivatives into row i of the signals.

    These are the slope, the curvature and the bound on the fourth derivative.
    """
    slope, table = rate_of(arc, x), w.signals
    second = rate_of(arc, slope)
    fourth = rate_of(arc, rate_of(arc, second))
    for j in range(9):
        table[i, _VALUE, j], table[i, _SLOPE, j] = x[j], slope[j]
        table[i, _BEND, j], table[i, _FOURTH, j] = second[j], fourth[j]
    # The energy x^2 + x'^2/q of the pair never grows. Its root bounds the pair for all times.
    table[i, _FOURTH, _PAIR] = math.sqrt(fourth.on_u * fourth.on_u + fourth.on_v * fourth.on_v / arc.q)
    table[i, _FOURTH, _FORCED] = math.sqrt(fourth.along * fourth.along + fourth.across * fourth.across)
    if arc.xi == 0.0:
        # Under a cubic forcing the columns of the forcing hold the Taylor polynomial, whose fourth derivative
        # is zero.
        table[i, _FOURTH, _FORCED] = table[i, _FOURTH, _GAIN_ALONG] = table[i, _FOURTH, _GAIN_ACROSS] = 0.0


@compiled
def side_of(x):
    """Return the sign that a signal takes after the start of an arc under a cubic.

    It is the sign of the first nonzero coefficient.
    """
    first = x.constant if x.constant != 0.0 else x.along
    first = first if first != 0.0 else x.across
    first = first if first != 0.0 else x.gain_across
    return -1.0 if first < 0.0 else 1.0


@compiled
def watch_turns(w, i, side, x, arc):
    """Watch the turning point of an angle that moves to the given side."""
    turning = rate_of(arc, x)
    size = abs(turning.on_u) + abs(turning.on_v) + abs(turning.along) + abs(turning.across)
    size += abs(turning.on_s1) + abs(turning.on_s2) + abs(turning.gain_along) + abs(turning.gain_across)
    # A bob that does not move at all has no turning point. Watch a positive constant instead.
    still = Signal(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    moves = size + abs(turning.constant) > 1e-100
    _watch(w, i, _scaled(side, turning) if moves else still, arc)


@compiled
def turn_over(w, i):
    """Continue to watch a signal after its zero, with the opposite sign."""
    w.first_zero = i
    for j in range(3):
        for k in range(9):
            w.signals[i, j, k] = -w.signals[i, j, k]


@compiled
def watch_block(q, arc, mode, forcing, w):
    """Watch the signals of the block. Return whether there is a second one.

    Both signals are positive within an arc. For a slipping block they are the rate, and the tilt on the way
    back to the base. For a held block they are the differences between the moment and both limits. `forcing`
    is the forcing as a signal, divided by its full size.
    """
    # While the block moves away from its base, phi cannot vanish before phi' does. So phi is watched on the
    # return only, and a tilt that starts at zero is not mistaken for an event.
    w.first_zero = FIRST
    if mode.kind == SLIP:
        _watch(w, FIRST, _scaled(mode.direction, rate_of(arc, arc.tilt)), arc)
        if mode.tilt * mode.direction >= 0.0:
            return False
        _watch(w, SECOND, _scaled(mode.tilt, arc.tilt), arc)
        return True
    # A held block is released when the moment exceeds friction, on the base also the weight.
    pull, stuck = _excess(q, arc, forcing), mode.kind == STICK
    level = q.up * arc.tilt.constant - (mode.tilt * q.weight if stuck else 0.0)
    hold = q.k + (0.0 if stuck else q.weight) + q.slack
    below = _scaled(-1.0, pull)
    _watch(w, FIRST, Signal(hold - level + below.constant, *below[1:]), arc)
    _watch(w, SECOND, Signal(hold + level + pull.constant, *pull[1:]), arc)
    return True


@compiled
def _eval(w, i, now, t, j):
    """Return the value (j = 0), the slope (1) or the curvature (2) of watched signal i."""
    x = w.signals
    modes = x[i, j, _ON_S1] * now.e1 + x[i, j, _ON_S2] * now.e2
    free = modes + x[i, j, _ON_U] * now.u + x[i, j, _ON_V] * now.v
    along, across = x[i, j, _ALONG] + x[i, j, _GAIN_ALONG] * t, x[i, j, _ACROSS] + x[i, j, _GAIN_ACROSS] * t
    return x[i, j, _CONSTANT] + free + along * now.sine + across * now.cosine


@compiled
def _bound(w, i, e1, e2, t):
    """Return the bound on the fourth derivative of signal i over a window that ends at `t`.

    `e1` and `e2` are the largest values of both exponentials in the window.
    """
    x = w.signals[i, _FOURTH]
    forced, more, less = x[_FORCED], x[_GAIN_ALONG], x[_GAIN_ACROSS]
    if more != 0.0 or less != 0.0:
        # The amplitude is a convex function of time, so that it is largest at the start of the arc or at the
        # end of the window.
        forced = max(forced, math.hypot(x[_ALONG] + more * t, x[_ACROSS] + less * t))
    return abs(x[_ON_S1]) * e1 + abs(x[_ON_S2]) * e2 + x[_PAIR] + forced


CLEAR, ONE, UNKNOWN = range(3)


@compiled
def prove_window(g0, v0, g1, v1, d, bound):
    """Return the proof about a signal over a window of length d: CLEAR, ONE or UNKNOWN.

    The arguments are the values (g0, g1) and slopes (v0, v1) at both ends, and the bound on the fourth
    derivative. The result is CLEAR if the signal stays positive after the start of the window; ONE if the
    signal starts positive, decreases all the way and has vanished at the end; UNKNOWN otherwise.
    """
    # Bernstein coefficients of the cubic. The coefficients of its slope are three times their differences.
    b1, b2, uncertainty = g0 + d * v0 * _THIRD, g1 - d * v1 * _THIRD, bound * d * d * d * d
    if min(min(g0, g1), min(b1, b2)) > uncertainty * AWAY:
        return CLEAR
    # The first term g0 (1 - s)^3 is not negative. Compare the other terms with the uncertainty after a
    # division by s.
    if g0 >= 0.0 and min(min(3.0 * b1, 1.5 * b2), g1) > uncertainty * _FROM_ZERO:
        return CLEAR
    # The same for a signal that starts with zero rate: leave the first two terms out, and divide by s^2.
    if g0 >= 0.0 and b1 >= 0.0 and min(3.0 * b2, g1) > uncertainty * _TWICE:
        return CLEAR
    steepest = max(max(b1 - g0, b2 - b1), g1 - b2)
    if g1 <= 0.0 < g0 and 3.0 * steepest < -_CURVED * uncertainty:
        return ONE
    # The same for the slope, whose first term is not positive here: the rate may start at zero.
    if g1 <= 0.0 < g0 and b1 <= g0 and 3.0 * max(2.0 * (b2 - b1), g1 - b2) < -_BENT * uncertainty:
        return ONE
    return UNKNOWN


@compiled
def estimate(g0, v0, g1, v1, d):
    """Return the approximate share of a window at which a signal vanishes.

    The signal is replaced by the cubic with the same values and slopes at both ends.

    The result is one Newton step from the zero of the straight line through both ends.
    """
    a, b, s = d * v0, d * v1, g0 / (g0 - g1)
    c2, c3 = 3.0 * (g1 - g0) - 2.0 * a - b, 2.0 * (g0 - g1) + a + b
    slope = a + s * (2.0 * c2 + 3.0 * s * c3)
    s = s - (g0 + s * (a + s * (c2 + s * c3))) / slope if slope < 0.0 else s
    return min(1.0, max(0.0, s))


@compiled
def _root(arc, w, i, lo, hi, guess):
    """Return the root of a signal that is positive at `lo` and not positive at `hi`.

    `guess` is the first guess, as a share of this interval.
    """
    t, last = lo + guess * (hi - lo), False
    for _ in range(60):
        now = instant(arc, t)
        value, slope = _eval(w, i, now, t, _VALUE), _eval(w, i, now, t, _SLOPE)
        if value > 0.0:
            lo = t
        else:
            hi = t
        # Halley's method: the new error is of the third power of the step.
        by = slope - 0.5 * value * _eval(w, i, now, t, _BEND) / slope if slope != 0.0 else 0.0
        onward = t - value / by if by < 0.0 else 0.5 * (lo + hi)
        # A step out of the bracket is replaced by bisection.
        if not lo <= onward <= hi:
            onward = 0.5 * (lo + hi)
        moved, t = abs(onward - t), onward
        if last or moved <= _NEAR * hi:
            break
        last = moved <= _CLOSE * hi
    return t


@compiled
def _initial_values(arc, w, now, t, end, g, v):
    """Evaluate all signals at the start of an arc, and return the time at which the search starts.

    The values go to `g` and the slopes to `v`. If the last event has set a signal to zero, the motion
    continues for a short time before this signal may vanish again. Under a cubic forcing signals are exact at
    the start, and this is not needed.
    """
    goes_on = False
    for i in range(w.count):
        if i != SECOND or w.has_second:
            g[i], v[i] = _eval(w, i, now, t, _VALUE), _eval(w, i, now, t, _SLOPE)
            # This signal is zero but for rounding and decreases: it has vanished at the last event.
            goes_on = goes_on or (g[i] < _AT_ZERO and v[i] <= 0.0 and arc.xi != 0.0 and i >= w.first_zero)
            if g[i] < _AT_ZERO and v[i] > 0.0:
                g[i] = max(g[i], 0.0)
    if goes_on:
        t = min(t + w.shortest, end)
        now = instant(arc, t)
        for i in range(w.count):
            if i != SECOND or w.has_second:
                # A signal that rises from zero is positive, whatever its rounding error.
                rose = g[i] < _AT_ZERO and v[i] > 0.0
                g[i], v[i] = _eval(w, i, now, t, _VALUE), _eval(w, i, now, t, _SLOPE)
                g[i] = max(g[i], 0.0) if rose else g[i]
    return t


@compiled
def _immediate_event(w, since, t, g, v):
    """Return an event that lies before the start of the search, and its time, which is at least `since`.

    The event is END if there is none.
    """
    for i in range(w.count):
        if (i != SECOND or w.has_second) and g[i] <= 0.0:
            if v[i] < 0.0:
                at = t - g[i] / v[i]
                return i, (at if at >= since else t)
            # The signal rises. It is negative only because of rounding.
            g[i] = 0.0
    return END, t


@compiled
def _time_at_limit(arc, limit, lo, hi):
    """Return the time at which a tilt reaches a limit that it has not reached at `lo` and has passed at `hi`.

    The tilt must not turn between these times. Bisection is fast enough, because this ends a run.
    """
    for _ in range(HALVED):
        t = 0.5 * (lo + hi)
        if abs(value_of(arc.tilt, instant(arc, t), t)) < limit:
            lo = t
        else:
            hi = t
    return hi


@compiled
def next_event(arc, w, now, t, end):
    """Return the first event of an arc after `t` and until `end`, and its time.

    `now` is the instant at `t`. The result is END if there is no event, and OVERTURN if the tilt reaches the
    limit. The workspace `w` holds the signals, see `tpd.compiled.motion.WORKSPACE`.
    """
    # The last row of the table holds values and slopes at both ends of the present window.
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
                # In such a short window rounding decides. A signal that was exact and positive at the start
                # has passed zero.
                proof = ONE if h[i] <= 0.0 and (g[i] > 0.0 or arc.xi == 0.0) else CLEAR
            if proof == UNKNOWN:
                proved = False
                break
            if proof == ONE and (first == END or _eval(w, i, instant(arc, soonest), soonest, _VALUE) <= 0.0):
                # The signal has one root in the window, which is an event only if it comes before the root of
                # the other signal. A signal that starts at zero has a root there. Newton's method from the
                # right end leads to the other root.
                guess = estimate(g[i], v[i], h[i], z[i], d) if g[i] > 0.0 else 1.0
                root = _root(arc, w, i, t, to, guess)
                if first == END or root < soonest:
                    first, soonest = i, root
        if not proved:
            d *= 0.5
            continue
        if first != END:
            return first, soonest
        # No event, but the block may be beyond return. The comparison is also false for NaN.
        if not abs(value_of(arc.tilt, now, to)) < w.limit:
            return OVERTURN, _time_at_limit(arc, w.limit, t, to)
        # Next window: it starts where this one ended, and may be twice as long.
        t, e2, d = to, down, min(2.0 * d, w.longest)
        for i in range(w.count):
            g[i], v[i] = h[i], z[i]
    return END, end
