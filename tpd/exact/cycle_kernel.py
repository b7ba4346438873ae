"""Arcs of a periodic orbit in compiled scalar code: where each ends, and what its signals do on the way."""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arcs import (
    Load,
    arc_from,
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
    watched,
)
from tpd.exact.plant import compiled
from tpd.exact.terms import (
    LANDING,
    LASTS,
    PHASE,
    REST,
    SLIP,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
    TURN,
)

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
    e = Load(q.xi + zero, z[PHASE] + zero, complex(1.0, 0.0), zero, zero, zero)
    arc = launch(q, link.kind, tilt, way, z[TILT], z[SWING], z[TILT_RATE], z[SWING_RATE], e)
    y = state_at(arc, instant(arc, z[LASTS]), z[LASTS])
    for i in range(4):
        out[i] = y[i]
    out[PHASE], out[LASTS] = z[PHASE] + q.xi * z[LASTS], zero
    if link.kind != SLIP:
        which = FIRST if link.ahead > 0.0 else SECOND
        eta, _ = forcing_at(e, z[LASTS])
        out[LASTS] = reserve(q, link.kind, tilt, which, y[TILT], y[SWING], y[SWING_RATE], eta)
    elif link.ending == TURN:
        out[TILT_RATE], out[LASTS] = zero, y[TILT_RATE]
    elif link.ending == LANDING:
        out[TILT], out[LASTS] = zero, y[TILT]
        out[TILT_RATE], out[SWING_RATE] = struck(q, link.onward == REST, y[TILT_RATE], y[SWING_RATE])


@compiled
def survey(q, link, z, w, turns, out):
    """Follow an arc, given as for `traverse` in real numbers, see `SURVEY`; `w` and `turns` are working
    memory."""
    lasted, e = z[LASTS], Load(q.xi + 0.0, z[PHASE] + 0.0, 1.0, 0.0, 0.0, 0.0)
    arc = arc_from(q, link, z, e)
    turns.second, turns.count = watch_block(q, arc, link, forcing_signal(e), w), BOB + 1
    signals = watched(w, FIRST), watched(w, SECOND if turns.second else FIRST), arc.bob
    turns.longest, turns.least = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q))), SMALL * lasted
    turns.window, turns.limit, turns.looks = turns.longest, math.inf, _LOOKS
    sides, low, largest, dent = np.empty(3), np.empty(3), np.zeros(3), np.empty(3)
    now, t, which = beginning(arc), 0.0, BOB
    for i in range(3):
        sides[i] = -1.0 if value_of(rate_of(arc, signals[i]), now, t) < 0.0 else 1.0
        watch_turns(turns, i, sides[i], signals[i], arc)
        low[i] = dent[i] = math.inf
    y = state_at(arc, now, t)
    out.v0, out.v1, out.v2, out.v3, out.at = y[TILT_RATE], y[SWING_RATE], y[TILT_PULL], y[SWING_PULL], 0.0
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
        inside = inside and abs(y[TILT]) <= least * least
        inside = inside and (link.ending != LANDING or abs(ratio(q) * y[TILT_RATE]) <= least)
    out.dip, out.reach, out.sticking = math.inf, largest[BOB], math.inf
    for i in range(2):
        size = max(largest[i], 1e-300)
        inside = inside and low[i] > -(_ROUNDING * size + _NOISE)
        out.dip = min(out.dip, dent[i] / size)
    out.inside = 1.0 if inside else 0.0
    if link.kind == SLIP and link.ending == TURN:
        eta, _ = forcing_at(e, lasted)
        excess = abs(moment(q, y[TILT], y[SWING], y[SWING_RATE], eta) - link.tilt * q.weight)
        out.sticking = abs(excess - q.k) / max(excess + q.k, 1e-300)
