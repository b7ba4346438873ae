"""The event-driven flow under a harmonic in compiled scalar code: arc after arc, with no event missed.

`tpd.exact.event_search` finds the events. `tpd.exact.flow` follows the same motions by the same rules in JAX,
with another proof.
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
from tpd.exact.event_search import (
    BOB,
    END,
    FIRST,
    GONE,
    LONGEST,
    LOOKS,
    SMALL,
    next_event,
    room,
    turn_over,
    watch_block,
    watch_turns,
)
from tpd.exact.mode_kinds import REST, SLIP, STICK

ARRIVED, LOST, EXHAUSTED = range(3)
"""Ends of a run."""
LEG = 13
"""Numbers of a recorded leg: kind and signs of its mode, its beginning and duration, what ended it, whether
that ended in rest, the state at its start, and that of the angles at its end."""
NO = np.bool_(False)
"""False as a Boolean of NumPy. Numba would compile a function once more for a plain False."""
_ROUNDING = 1e-15
"""Share of a period below which a remaining time is rounding."""


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
    put_mode(held - side * q.weight, held - other * q.weight, q.k + q.slack, tilt, way, mode)


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
def transversality(q, rate, which, before, after, now, sine):
    """See `tpd.exact.contact.transversality_of`; `rate` is the usual one of the motion, and `now` a state
    with its accelerations."""
    if before != SLIP or after != SLIP:
        return math.inf
    usual = rate * q.weight
    if which == FIRST:
        return abs(now[4]) / (rate * usual)
    return math.inf if held_on_base(q, now[1], now[3], sine) else abs(now[2]) / usual


@compiled
def begin(q, growth, mode, y, t, sizes):
    """Put what is counted along a motion into `sizes` as it begins: the largest tilts and swings of the bob
    to either side, the sign of its rate, and the least transversality."""
    sizes[0], sizes[1], sizes[2], sizes[3] = max(y[0], 0.0), max(-y[0], 0.0), max(y[1], 0.0), max(-y[1], 0.0)
    mode[3], rate = (2.0 if mode[0] != SLIP else 0.0), y[3]
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
    change state, mode and sizes. mode[3] says for how long the block was held: 0 never, 1 for a part of the
    motion since `begin`, 2 throughout. Return how it ended."""
    w, was, start = room(), np.empty(3), np.empty(4)
    least, limit = SMALL * end, beyond_return(q)
    longest = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q)))
    looks, window = LOOKS * max_events, longest
    for _ in range(max_events):
        share, rate = share_at(growth, t), growth[1]
        arc = launch(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], q.xi * t, share, rate)
        forcing = Signal(0.0, 0.0, 0.0, 0.0, 0.0, share, 0.0, rate, 0.0)
        second = watch_block(q, arc, mode, forcing, w)
        watch_turns(w, BOB, sizes[4], arc.bob, arc)
        left, at, began = end - t, 0.0, 0.0
        for i in range(4):
            start[i] = y[i]
        here = Instant(1.0, 1.0, 1.0, 0.0, math.sin(arc.phase), math.cos(arc.phase))
        while True:
            which, at, looks = next_event(
                arc, w, BOB + 1, second, here, at, left, least, longest, window, limit, looks
            )
            here = instant(arc, at)
            now = state_at(arc, here, at)
            # Hops get shorter one after the other.
            window = min(longest, 4.0 * (at - began) + least)
            if which != BOB:
                break
            _note(sizes, now[0], now[1])
            _record(legs, count, mode, start, t + began, at - began, BOB, NO, now[0], now[1])
            began, sizes[4] = at, -sizes[4]
            for i in range(4):
                start[i] = now[i]
            turn_over(w, BOB)
        for i in range(4):
            y[i] = now[i]
        if which == GONE:
            return LOST
        if which == END:
            _note(sizes, y[0], 0.0)
            _record(legs, count, mode, start, t + began, at - began, END, NO, y[0], y[1])
            return ARRIVED if looks > 0 else EXHAUSTED
        _note(sizes, y[0], y[1])
        for i in range(3):
            was[i] = mode[i]
        sine = share_at(growth, t + at) * math.sin(q.xi * (t + at))
        rests = meet(q, which, capture, sine, y, mode)
        sizes[5] = min(sizes[5], transversality(q, q.xi, which, was[0], mode[0], now, sine))
        sizes[4] = -sizes[4] if y[3] * now[3] < 0.0 else sizes[4]
        mode[3] = 1.0 if mode[3] > 0.0 or mode[0] != SLIP else 0.0
        _record(legs, count, was, start, t + began, at - began, which, rests, now[0], now[1])
        t += at
        if end - t <= _ROUNDING * end:
            # With the event earlier or later, the motion is a little further or not as far at the end: the
            # derivatives need a last leg, though it has no length.
            _record(legs, count, mode, y, t, 0.0, END, NO, y[0], y[1])
            return ARRIVED
    return EXHAUSTED
