"""The linear equations under a ground motion, followed exactly from event to event in compiled scalar code.

A ground motion consists of pieces of equal duration, each with a cubic in time (`tpd.exact.cubic_kernel`).
Most pieces of a record have no event. Such a piece is taken in one step, if bounds on its two ends prove it
(see `tpd.exact.event_search`); elsewhere the search for the next event decides. After the last piece the
block moves freely for a stated time, and then along its last arc until it meets an event or is beyond return:
an overturning that has begun is never missed.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import Signal, compiled, instant, plant, rate_of, state_at
from tpd.exact.cubic_kernel import START, Cubic, accelerations, cubic_at, forcing_of, launch_cubic, put_map
from tpd.exact.event_kernel import (
    ARRIVED,
    EXHAUSTED,
    LOST,
    NO,
    beyond_return,
    decide,
    meet,
    sign,
    transversality,
)
from tpd.exact.event_search import (
    BOB,
    END,
    GONE,
    LONGEST,
    LOOKS,
    RELATIVE,
    SECOND,
    SMALL,
    next_event,
    room,
    side_of,
    turn_over,
    watch_block,
    watch_turns,
)
from tpd.exact.mode_kinds import REST, SLIP, STICK
from tpd.models.shaken_proof import put_bounds, without_event
from tpd.models.shaken_tally import (
    BEST,
    CROSSING,
    EVENTS,
    FELL,
    IMPACTS,
    LEGS,
    LIFTED,
    LOOKS_LEFT,
    TALLY,
    WHEN,
    WHERE,
    note,
)

STATUSES = ("stood", "rocked", "overturned", "event_bound", "failed")
"""Names of statuses in the order of their numbers."""
STOOD, ROCKED, OVERTURNED, EVENT_BOUND, FAILED = range(5)
WHOLE = np.int64(4)
"""End of a leg that consists of whole pieces without an event."""
LEG = 12
"""Numbers of a recorded leg: kind and signs of its mode; its piece, its beginning there and its duration (the
number of pieces if they are whole); what ended it, whether that ended in rest; the state at its start."""

OUT = 19
"""Numbers of a result: largest |phi|, |psi| and |psi - phi| with their times; the state at the end; the
growing coordinate of the last leg (with derivatives only); status; impacts; times of the first uplift and of
the overturning; transversality; legs; and the accelerations at the end."""
_ROUNDING = 1e-15
_REACH = 8.0
"""Longest arc, over the quickest time scale of the motion."""
_FOREVER = 1e6
_SLACK = 4e-15
"""Share of what holds a block by which the moment on it must exceed that: less is rounding, and records often
balance a block to the last digit, so that it would be let go and held again and again."""
_LOSSLESS = 1.0 - 1e-4
"""Velocity ratio from which on a rattle takes so many impacts that it may exhaust the bound on events."""
_LAST = 10
"""Times the bound on events that the last try may take."""
_USUAL = 20_000
"""Events for which there is room at first."""
_COARSER, _QUICKEST = 20.0, 1e-4
"""Factor of the speed that counts as rest from one try to the next, and its largest value over nu."""
_START = np.int64(0)
_KINDS = (float(SLIP), float(REST))
"""Modes for which whole pieces have a map."""


@compiled
def room_for(n, max_events):
    """Legs to make room for at first: few motions have so many, and those are followed once more."""
    return 2 * (n + min(max_events, _USUAL)) + 64


@compiled
def _record(legs, tally, mode, piece, start, lasted, which, rests, y):
    """Write a leg down where there is room for it."""
    n = int(tally[LEGS])
    if n < len(legs):
        legs[n, 0], legs[n, 1], legs[n, 2], legs[n, 3] = mode[0], mode[1], mode[2], piece
        legs[n, 4], legs[n, 5], legs[n, 6], legs[n, 7] = start, lasted, which, 1.0 if rests else 0.0
        for i in range(4):
            legs[n, 8 + i] = y[i]
    tally[LEGS] = n + 1.0


@compiled
def _over(m, c, i, centre, y, end):
    """Put the state after piece i into `end`, by the map of a piece."""
    x0, x1, x2, x3 = y[0] - centre, y[1], y[2], y[3]
    for k in range(4):
        change = m[k, 0] * x0 + m[k, 1] * x1 + m[k, 2] * x2 + m[k, 3] * x3
        change += m[k, 4] * c[i, 0] + m[k, 5] * c[i, 1] + m[k, 6] * c[i, 2] + m[k, 7] * c[i, 3]
        end[k] = y[k] + change


@compiled
def _whole_pieces(q, c, n, i, mode, y, maps, bounds, tally, legs):
    """Follow a motion from the start of piece i as long as whole pieces are proved to have no event. Return
    the piece at whose start it is then."""
    h, first, limit, kind = q.xi, i, beyond_return(q), mode[0]
    start, end, held = y.copy(), np.empty(4), 0 if kind == SLIP else 1
    # A held block stays where it is: its tilt needs no centre.
    centre = 0.0 if held else (mode[1] * q.weight + mode[2] * q.k) / q.up
    growth = math.exp(q.s1 * h)
    while i < n:
        # The arc serves the bounds alone; the state goes on by the map, which loses fewer digits.
        e = cubic_at(c, n, i, h, 0.0)
        arc = launch_cubic(q, kind, mode[1], mode[2], y[0], y[1], y[2], y[3], e)
        _over(maps[held], c, i, centre, y, end)
        last = c[i, 0] + c[i, 1] + c[i, 2] + c[i, 3]
        up, swing = accelerations(q, kind, centre, y[0], y[1], y[2], y[3], e.e0)
        a = y[0], y[1], y[2], y[3], up, swing
        up, swing = accelerations(q, kind, centre, end[0], end[1], end[2], end[3], last)
        b = end[0], end[1], end[2], end[3], up, swing
        if not (abs(b[0]) < limit and without_event(q, arc, mode, e, h, a, b, growth, tally, bounds)):
            break
        y[0], y[1], y[2], y[3] = b[0], b[1], b[2], b[3]
        i += 1
    if i > first:
        note(tally, y[0], y[1], i * h, tally[LEGS])
        _record(legs, tally, mode, first, 0.0, float(i - first), WHOLE, NO, start)
    return i


@compiled
def _difference(a, b):
    """Difference of two signals."""
    free = a.constant - b.constant, a.on_s1 - b.on_s1, a.on_s2 - b.on_s2, a.on_u - b.on_u, a.on_v - b.on_v
    forced = a.along - b.along, a.across - b.across
    return Signal(*free, *forced, a.gain_along - b.gain_along, a.gain_across - b.gain_across)


@compiled
def _watch(q, arc, mode, e, w):
    """Prepare all signals of an arc. Return how many there are, and whether the second is one of them."""
    forcing = Signal(e.e0, 0.0, 0.0, 0.0, 0.0, e.e1, e.e2, 0.0, e.e3)
    second, count = watch_block(q, arc, mode, forcing, w), BOB
    if q.mu > 0.0:
        # Whatever was before, a bob goes where the arc takes it: one that stood still has no way of its own.
        watch_turns(w, BOB, side_of(rate_of(arc, arc.bob)), arc.bob, arc)
        count = RELATIVE
        # Under a held block both angles of the bob turn at once.
        if mode[0] == SLIP:
            relative = _difference(arc.bob, arc.tilt)
            watch_turns(w, RELATIVE, side_of(rate_of(arc, relative)), relative, arc)
            count = RELATIVE + 1
    return count, second


@compiled
def _met(q, which, capture, eta, now, y, mode, tau, tally):
    """Change state, mode and tally at an event of the block; `now` is the state before it with its
    accelerations. Return whether the block came to rest."""
    was = mode[0]
    rests = meet(q, which, capture, eta, y, mode)
    if was == SLIP and which == SECOND:
        tally[IMPACTS] += 1.0
    if was == REST and tally[LIFTED] == math.inf:
        tally[LIFTED] = tau
    # The block's own time scale is 1 in tau: the usual rate of a motion without a frequency.
    tally[CROSSING] = min(tally[CROSSING], transversality(q, 1.0, which, was, mode[0], now, eta))
    return rests


@compiled
def _settles(q, y, tally):
    """Whether a block that moves freely has too little energy to tilt further than it has. The energy

        [m11 phi'^2 + 2 m12 phi' psi' + mu lam m22 psi'^2]/2 + weight |phi| - up phi^2/2 + mu lam psi^2/2

    of block and bob never grows without a forcing."""
    share = q.mu * q.lam
    moving = q.m11 * y[2] * y[2] + 2.0 * q.m12 * y[2] * y[3] + share * q.m22 * y[3] * y[3]
    level = q.weight - q.up * abs(y[0])
    # Distance from the energy of the unstable equilibrium, times 2 up; the weight cancels where phi is small.
    left = level * level - q.up * (moving + share * y[1] * y[1])
    if level <= 0.0 or left <= 0.0:
        return False
    return (q.weight - math.sqrt(left)) / q.up <= max(tally[BEST], tally[BEST + 1]) * (1.0 + 1e-12)


@compiled
def _dies_away(q, y, tally):
    """Whether the bob of a resting block, left to itself, neither lifts it nor swings as far as before: the
    energy psi^2 + psi'^2/q never grows."""
    # Angle and rate are bounded at once, whatever their phase.
    most = math.sqrt(y[1] * y[1] + y[3] * y[3] / q.held_q)
    pull = abs(q.up - 1.0) * most + abs(q.bias) * most * math.sqrt(q.held_q)
    swing, relative = max(tally[BEST + 2], tally[BEST + 3]), max(tally[BEST + 4], tally[BEST + 5])
    return pull < q.k + q.weight and most < min(swing, relative)


@compiled
def _past_turns(q, arc, mode, i, n, s, left, start, w, count, second, longest, window, tally, legs):
    """Follow an arc from its state `start`, at the local time `s` of piece i, past all turns of the bob for
    `left` at most. Return the event that ends it, its time, that of the last turn, the last window, and the
    state there with its accelerations; change `start` to the state at the last turn."""
    at, began, here, h, limit = 0.0, 0.0, START, q.xi, beyond_return(q)
    while True:
        most = int(tally[LOOKS_LEFT])
        if i >= n and mode[0] == REST and _dies_away(q, start, tally):
            # Damping that dies out needs no look at every turn down to the smallest number.
            which, at, looks = END, left, most
        else:
            which, at, looks = next_event(
                arc, w, count, second, here, at, left, SMALL, longest, window, limit, most
            )
        tally[LOOKS_LEFT], here = looks, instant(arc, at)
        now = state_at(arc, here, at)
        # Hops get shorter one after the other.
        window = min(longest, 4.0 * (at - began) + SMALL)
        if which < BOB:
            return which, at, began, window, now
        note(tally, now[0], now[1], i * h + s + at, tally[LEGS])
        _record(legs, tally, mode, i, s + began, at - began, which, NO, start)
        turn_over(w, which)
        began = at
        for j in range(4):
            start[j] = now[j]


@compiled
def _piece(q, c, n, i, s, end, mode, y, w, tally, legs, capture, brief):
    """Follow a motion through piece i from its local time `s` to `end`, event by event. Return its end."""
    h, start = q.xi, np.empty(4)
    longest = LONGEST / max(q.s1, math.sqrt(q.q))
    # The Taylor polynomial of an arc grows with the third power of time, and its rounding with it.
    reach = _REACH / max(max(q.s1, -q.s2), max(max(q.p, q.held_p), math.sqrt(max(q.q, q.held_q))))
    window = longest
    e = cubic_at(c, n, i, h, s)
    if mode[0] != SLIP:
        # The base acceleration may jump where a piece begins.
        decide(q, y, mode[1] if mode[0] == STICK else 0.0, 0.0, e.e0, mode)
        if mode[0] == SLIP and tally[LIFTED] == math.inf:
            tally[LIFTED] = i * h + s
    while tally[EVENTS] > 0.0 and tally[LOOKS_LEFT] > 0.0:
        tally[EVENTS] -= 1.0
        e = cubic_at(c, n, i, h, s)
        arc = launch_cubic(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], e)
        count, second = _watch(q, arc, mode, e, w)
        for j in range(4):
            start[j] = y[j]
        whole = end - s <= reach
        left = end - s if whole else reach
        which, at, began, window, now = _past_turns(
            q, arc, mode, i, n, s, left, start, w, count, second, longest, window, tally, legs
        )
        for j in range(4):
            y[j] = now[j]
        tau = i * h + s + at
        if which == GONE:
            tally[FELL] = tau
            _record(legs, tally, mode, i, s + began, at - began, which, NO, start)
            return LOST
        note(tally, y[0], y[1], tau, tally[LEGS])
        if which == END:
            _record(legs, tally, mode, i, s + began, at - began, which, NO, start)
            if whole:
                return ARRIVED
            s += at
            tally[EVENTS] += 1.0
            continue
        # Whether the block rests is known after the event only.
        n_legs = int(tally[LEGS])
        _record(legs, tally, mode, i, s + began, at - began, which, NO, start)
        eta, _ = forcing_of(e, at)
        if _met(q, which, capture, eta, now, y, mode, tau, tally) and n_legs < len(legs):
            legs[n_legs, 7] = 1.0
        s += at
        # Only the free motion may end early: a forcing brings energy.
        if brief and _settles(q, y, tally):
            return ARRIVED
        if end - s <= _ROUNDING * end:
            # The derivatives need a last leg, though it has no length: compare `event_kernel.advance`.
            _record(legs, tally, mode, i, s, 0.0, END, NO, y)
            return ARRIVED
    return EXHAUSTED


@compiled
def _falls(q, c, n, mode, y, w, tally, legs):
    """Whether the arc that a motion ends on leads beyond return without another event; record it if so."""
    if mode[0] != SLIP:
        return False
    e = cubic_at(c, n, n, q.xi, 0.0)
    arc = launch_cubic(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], e)
    forcing = Signal(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    second = watch_block(q, arc, mode, forcing, w)
    longest, limit = LONGEST / max(q.s1, math.sqrt(q.q)), beyond_return(q)
    which, at, _ = next_event(
        arc, w, BOB, second, START, 0.0, _FOREVER, SMALL, longest, longest, limit, 64 * LOOKS
    )
    if which == GONE:
        tally[FELL] = at
        _record(legs, tally, mode, n, 0.0, at, which, NO, y)
    return which == GONE


@compiled
def _begin(q, c, n, y, mode, tally, max_events):
    """Prepare mode and tally of a motion."""
    for k in range(TALLY):
        tally[k] = 0.0
    for k in range(6):
        angle = y[0] if k < 2 else (y[1] if k < 4 else y[1] - y[0])
        tally[BEST + k], tally[WHERE + k] = (angle if k % 2 == 0 else -angle), -1.0
    tally[LIFTED] = tally[FELL] = tally[CROSSING] = math.inf
    # One event for each piece is none of the block's: its end.
    tally[EVENTS], tally[LOOKS_LEFT] = n + 1.0 + max_events, LOOKS * (n + 1.0 + max_events)
    e = cubic_at(c, n, _START, q.xi, 0.0)
    decide(q, y, sign(y[0]), sign(y[2]), e.e0, mode)
    if mode[0] == SLIP or y[0] != 0.0:
        tally[LIFTED] = 0.0


@compiled
def follow(x, q, c, n, y, free, rest_rate, max_events, brief, tally, legs, mode):
    """Follow a motion from the state `y` through n pieces, the rows of `c`, and freely for `free`; change
    state, mode and tally, and record the legs. `x` is (nu, mu, lam, zeta, k, f, h, rho, e) with f the size of
    the base acceleration over that of gravity and h the duration of a piece. If `brief`, the free motion ends
    as soon as it cannot tilt the block further. Return the status."""
    plant(x, q)
    q.slack = _SLACK * (q.k + q.weight)
    start, quick, most = y.copy(), rest_rate, max_events
    while True:
        status = _follow(q, c, n, y, free, quick, most, brief, tally, legs, mode)
        # Hops that lose nothing never end. Where there are too many of them, quicker ones count as rest: they
        # tilt the block by about the square of their speed. The last try has the events that it may take.
        if status != EVENT_BOUND or q.e < _LOSSLESS or quick * _COARSER > _QUICKEST:
            return status
        quick *= _COARSER
        most = max_events if quick * _COARSER <= _QUICKEST else _LAST * max_events
        for j in range(4):
            y[j] = start[j]


@compiled
def _follow(q, c, n, y, free, rest_rate, max_events, brief, tally, legs, mode):
    """Follow a motion as `follow` does; hops slower than `rest_rate` end in rest."""
    bounds, maps, w = np.empty((2, 2, 2)), np.empty((2, 4, 8)), room()
    put_bounds(q, bounds)
    # Two maps serve the whole motion, because all pieces have the same duration.
    for held in range(2):
        put_map(q, _KINDS[held], q.xi, maps[held])
    capture, i = rest_rate * q.nu, _START
    _begin(q, c, n, y, mode, tally, max_events)
    ended = ARRIVED
    while i < n and ended == ARRIVED:
        i = _whole_pieces(q, c, n, i, mode, y, maps, bounds, tally, legs)
        if i < n:
            ended = _piece(q, c, n, i, 0.0, q.xi, mode, y, w, tally, legs, capture, NO)
            i += 1
    # A motion that cannot tilt the block further overturns it neither.
    quiet = brief and _settles(q, y, tally)
    if ended == ARRIVED and free > 0.0 and not quiet:
        ended = _piece(q, c, n, n, 0.0, free, mode, y, w, tally, legs, capture, brief)
    if ended == ARRIVED and not quiet and _falls(q, c, n, mode, y, w, tally, legs):
        tally[FELL] += n * q.xi + free
        ended = LOST
    for j in range(4):
        if not math.isfinite(y[j]):
            return FAILED
    if ended != ARRIVED:
        return OVERTURNED if ended == LOST else EVENT_BOUND
    return STOOD if tally[LIFTED] == math.inf else ROCKED


@compiled
def put_results(q, n, free, y, mode, tally, status, out):
    """Put the results of a followed motion into `out`."""
    for k in range(3):
        right, left = BEST + 2 * k, BEST + 2 * k + 1
        best = right if tally[right] >= tally[left] else left
        out[2 * k], out[2 * k + 1] = tally[best], tally[best + WHEN]
    if status == OVERTURNED:
        out[0] = out[2] = out[4] = math.inf
    for i in range(4):
        out[6 + i] = y[i]
    out[10], out[11], out[12], out[13], out[14] = 0.0, status, tally[IMPACTS], tally[LIFTED], tally[FELL]
    out[15], out[16] = tally[CROSSING], tally[LEGS]
    zero = Cubic(0.0, 0.0, 0.0, 0.0)
    arc = launch_cubic(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], zero)
    end = state_at(arc, START, 0.0)
    out[17], out[18] = end[4], end[5]
