"""Arcs of a periodic orbit in compiled scalar code: where each ends, and what its signals do on the way."""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arcs import (
    Load,
    Signal,
    beginning,
    forcing_at,
    forcing_signal,
    instant,
    launch,
    rate_of,
    state_at,
    value_of,
)
from tpd.exact.contact_kernel import moment, ratio, reserve, struck
from tpd.exact.events import (
    BOB,
    END,
    FIRST,
    LONGEST,
    SECOND,
    SMALL,
    next_event,
    turn_over,
    watch_block,
    watch_turns,
)
from tpd.exact.mode_kinds import LANDING, REST, SLIP, TURN
from tpd.exact.plant import compiled

LINK = np.dtype([(name, np.float64) for name in ("kind", "tilt", "way", "ending", "onward", "ahead")])
"""Mode of an arc, the event at its end (-1 for none), and kind and sign of phi' of the next arc."""
_NAMES = "inside", "dip", "reach", "at", "sticking", "v0", "v1", "v2", "v3"
SURVEY = np.dtype([(name, np.float64) for name in _NAMES])
"""Findings about an arc: whether both signals stay positive, and what is said to end in rest is slow and low;
the least dent of a signal over its largest value; the largest |psi| and its time; the margin of sticking of a
turn at the end; the derivative of the state in time at the start."""
_LOOKS = 10_000
"""Most looks at the signals of an arc."""
_AT_END = 1e-6
"""Share of an arc, at either end, in which rounding may dent a signal that begins or ends there at zero."""
_ROUNDING, _NOISE = 1e-9, 1e-14
"""Negative value of a signal, as a share of its largest and by itself, that rounding alone may give it."""
_RATTLED = 1e-5
"""Fastest impact that may end a rattle, in units of nu."""


@compiled
def traverse(q, link, z, out):
    """Put the state after an arc and its event, the forcing's phase there, and the value of the event's
    signal into `out`. Six complex numbers, from six in `z`: the state, the phase, and the duration."""
    tilt, way, zero = complex(link.tilt, 0.0), complex(link.way, 0.0), complex(0.0, 0.0)
    e = Load(q.xi + zero, z[4] + zero, complex(1.0, 0.0), zero, zero, zero)
    arc = launch(q, link.kind, tilt, way, z[0], z[1], z[2], z[3], e)
    y = state_at(arc, instant(arc, z[5]), z[5])
    out[0], out[1], out[2], out[3], out[4], out[5] = y[0], y[1], y[2], y[3], z[4] + q.xi * z[5], zero
    if link.kind != SLIP:
        which = FIRST if link.ahead > 0.0 else SECOND
        out[5] = reserve(q, link.kind, tilt, which, y[0], y[1], y[3], forcing_at(e, z[5])[0])
    elif link.ending == TURN:
        out[2], out[5] = zero, y[2]
    elif link.ending == LANDING:
        out[0], out[5] = zero, y[0]
        out[2], out[3] = struck(q, link.onward == REST, y[2], y[3])


@compiled
def _watched(w, i):
    """The signal in row i of what a search looks at."""
    x = w.signals
    free = x[i, 0, 0], x[i, 0, 1], x[i, 0, 2], x[i, 0, 3], x[i, 0, 4]
    return Signal(*free, x[i, 0, 5], x[i, 0, 6], x[i, 0, 7], x[i, 0, 8])


@compiled
def survey(q, link, z, w, turns, out):
    """Follow an arc, given as for `traverse` in real numbers, see `SURVEY`; `w` and `turns` are working
    memory."""
    lasted, e = z[5], Load(q.xi + 0.0, z[4] + 0.0, 1.0, 0.0, 0.0, 0.0)
    arc = launch(q, link.kind, link.tilt, link.way, z[0], z[1], z[2], z[3], e)
    turns.second, turns.count = watch_block(q, arc, link, forcing_signal(e), w), BOB + 1
    signals = _watched(w, FIRST), _watched(w, SECOND if turns.second else FIRST), arc.bob
    turns.longest, turns.least = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), SMALL * lasted
    turns.window, turns.limit, turns.looks = turns.longest, math.inf, _LOOKS
    sides, low, largest, dent = np.empty(3), np.empty(3), np.zeros(3), np.empty(3)
    now, t, which = beginning(arc), 0.0, BOB
    for i in range(3):
        sides[i] = -1.0 if value_of(rate_of(arc, signals[i]), now, t) < 0.0 else 1.0
        watch_turns(turns, i, sides[i], signals[i], arc)
        low[i] = dent[i] = math.inf
    y = state_at(arc, now, t)
    out.v0, out.v1, out.v2, out.v3, out.at = y[2], y[3], y[4], y[5], 0.0
    # Where all turns of a signal are known, so are its extremes: nothing peaks unseen between two looks.
    while True:
        for i in range(3):
            value = value_of(signals[i], now, t)
            if i == BOB and abs(value) > largest[i]:
                out.at = t
            low[i], largest[i] = min(low[i], value), max(largest[i], abs(value))
            if i == which and sides[i] > 0.0 and _AT_END * lasted < t < (1.0 - _AT_END) * lasted:
                dent[i] = min(dent[i], value)
        if which < FIRST:
            break
        turns.looks -= 1
        which, t = next_event(arc, turns, now, t, lasted)
        now = instant(arc, t)
        if which >= FIRST:
            sides[which] = -sides[which]
            turn_over(turns, which)
    y = state_at(arc, now, t)
    inside, least = which == END and turns.looks > 0 and lasted > 0.0, _RATTLED * q.nu
    if link.onward == REST:
        inside = inside and abs(y[0]) <= least * least
        inside = inside and (link.ending != LANDING or abs(ratio(q) * y[2]) <= least)
    out.dip, out.reach, out.sticking = math.inf, largest[BOB], math.inf
    for i in range(2):
        size = max(largest[i], 1e-300)
        inside = inside and low[i] > -(_ROUNDING * size + _NOISE)
        out.dip = min(out.dip, dent[i] / size)
    out.inside = 1.0 if inside else 0.0
    if link.kind == SLIP and link.ending == TURN:
        excess = abs(moment(q, y[0], y[1], y[3], forcing_at(e, lasted)[0]) - link.tilt * q.weight)
        out.sticking = abs(excess - q.k) / max(excess + q.k, 1e-300)
