"""The path of a symmetric orbit from turn to turn by the proved search for events, in compiled scalar code.

A solution of the two conditions is an orbit only if the tilt falls all the way from turn to turn. Where the
bob turns, |psi| may be largest; where the falling rate has a dent, the block may be about to turn back."""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arcs import Signal, instant, rate_of, state_at
from tpd.exact.events import (
    BOB,
    FIRST,
    LONGEST,
    RELATIVE,
    SECOND,
    SMALL,
    next_event,
    turn_over,
    watch_block,
    watch_turns,
)
from tpd.exact.half_period_kernel import motion
from tpd.exact.mode_kinds import SLIP
from tpd.exact.plant import compiled

BROKEN, WHOLE, UNPROVED = range(3)
"""Outcomes: no orbit; an orbit; or more events than `_LOOKS` looks at the motion can prove."""
_LOOKS = 8192
_ON_TIME = 1e-6
"""Share of h by which an event may differ from that of the conditions."""
PATH = np.dtype(
    [
        (name, np.float64)
        for name in ["t", "gamma", "height", "stroke", "late", "corner", "time", "least_fall", "leaving"]
    ]
)
"""A solution with its height, and on its path: the largest |psi|, whether it is on the second arc or at the
crossing, and its time since its arc began; the least of -phi' at a dent, infinite without one; and phi'' just
after the turn."""
_DENTS = RELATIVE
"""Row of the signal phi'', whose changes of sign are extremes of the falling rate."""


@compiled
def _larger(path, psi, late, corner, time):
    """Take account of an angle of the bob."""
    if abs(psi) > path.stroke:
        path.stroke, path.late, path.corner, path.time = abs(psi), late, corner, time


@compiled
def _follow(q, m, arc, late, duration, w, path):
    """Follow an arc to its end, past all turns of the bob and of the falling rate; return whether it ends
    with the event it should end with, and where."""
    start = state_at(arc, instant(arc, 0.0), 0.0)
    mode = w.other
    mode.kind, mode.tilt, mode.way = SLIP, (-1.0 if late else 1.0), -1.0
    forcing = Signal(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    w.second, w.count = watch_block(q, arc, mode, forcing, w), _DENTS + 1
    # A bob that turns with the block has no rate but rounding there.
    swings = 1.0 if (start[3] if abs(start[3]) > 1e-12 else start[5]) > 0.0 else -1.0
    slows = 1.0 if start[4] > 0.0 else -1.0
    watch_turns(w, BOB, swings, arc.bob, arc)
    watch_turns(w, _DENTS, slows, rate_of(arc, arc.tilt), arc)
    w.longest, w.least, w.limit = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), SMALL * m.span, math.inf
    w.window, w.looks, horizon = w.longest, _LOOKS, duration + 2.0 * _ON_TIME * m.span
    time, here = 0.0, instant(arc, 0.0)
    while True:
        which, time = next_event(arc, w, here, time, horizon)
        here = instant(arc, time)
        now = state_at(arc, here, time)
        if which == BOB:
            _larger(path, now[1], late, 0.0, time)
        elif which == _DENTS:
            # From less to more: where it fell faster before, this is its quickest moment and no dent.
            if slows > 0.0:
                path.least_fall = min(path.least_fall, -now[2])
            slows = -slows
        else:
            break
        turn_over(w, which)
    if w.looks <= 0:
        return UNPROVED
    on_time = abs(time - duration) < _ON_TIME * m.span
    return WHOLE if which == (FIRST if late else SECOND) and on_time else BROKEN


@compiled
def put_path(q, m, t, gamma, w, path):
    """Follow a solution from turn to turn, put what it meets into `path`, and return whether it is an
    orbit."""
    way = motion(q, m, t, gamma)
    start = state_at(way.first, way.start, 0.0)
    path.t, path.gamma, path.height, path.leaving = t, gamma, start[0], start[4]
    path.stroke, path.late, path.corner, path.time, path.least_fall = abs(start[1]), 0.0, 0.0, 0.0, math.inf
    if not (start[0] > 0.0 and start[4] < 0.0):
        return BROKEN
    outcome = _follow(q, m, way.first, 0.0, t, w, path)
    if outcome != WHOLE:
        return outcome
    # The impact may turn the bob.
    _larger(path, state_at(way.first, way.before, t)[1], 0.0, 1.0, t)
    return _follow(q, m, way.second, 1.0, m.span - t, w, path)
