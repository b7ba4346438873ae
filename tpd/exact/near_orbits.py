"""Motions of the linear equations under a harmonic with derivatives: periods, states at given times, and the
orbit that a motion approaches."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.arcs import arc_from, instant, load_at, span_of, state_at, steady
from tpd.exact.events import BOB, END
from tpd.exact.follow import ARRIVED, Rules, allow, begin, piece
from tpd.exact.legs import ANGLES, INPUTS, ROWS, STATE, read
from tpd.exact.motion import FIRST_PIECE, LEG, LEGS, NO, YES, clear, larger, largest, put
from tpd.exact.plant import compiled
from tpd.exact.repetition import scales_of
from tpd.exact.terms import REST, SLIP, SWING, TILT

NEARBY, _NEXT_TO_NOTHING = 0.05, 1e-4
"""Largest distances, in shares of the scales, from which a motion is taken to the orbit that it approaches:
with its peaks behind it, and always."""
_LINEAR = 0.1
"""Share of its distance by which the last states of such a motion may differ from what the orbit's derivative
says."""
CONVERGED, _NEWTON = 1e-10, 6
"""Residual of an orbit, and bound on the steps of Newton's method."""
STEP_OF_NEWTON = np.int64(0)
"""Column of the only right-hand side of a step."""
_SQUARES, _LONG = 16, 1000
"""Squares of the derivative after which a contraction must have shown, and periods that are summed up."""
_CLOSE = 1e-9
"""Share of a period by which an event may come too late, near an orbit on which it is within the period."""
_ROUNDING = 1e-10
"""Share of a period by which a time may lie before the period that it counts to, so that a time that rounding
has put just before a period's end needs no leg of its own."""
BEGINNING, _INPUTS, _NONE = np.int64(13), np.int64(14), np.int64(0)
"""Direction of the time at which a motion begins, after those of the parameters and of the start; and how
many directions there are."""
Limits = namedtuple("Limits", "capture events periods")
"""Largest speed of an impact that may end in rest, events allowed in a forcing period, and periods to
follow."""
CYCLE = np.dtype(
    [
        ("end", np.float64, (4,)),
        *((name, np.float64) for name in ("amplitude", "stroke", "kind", "tilt", "way")),
        *((name, np.float64) for name in ("crossing", "asymmetry", "closed")),
        ("by", np.float64, (6, 13)),
    ],
    align=True,
)
"""Some periods of a motion, see `tpd.models.base.Cycle`: the state at the end, no numbers if the motion was
lost; the largest |phi| and |psi|; the mode at the end; the least transversality, the asymmetry, and whether
the mode is that of the start; and the derivatives of (end, amplitude, stroke) in the parameters and the
start."""
Past = namedtuple("Past", "periods peaks")
"""The last periods of a motion, newest first, and the largest tilt and swing of all."""


@compiled
def put_motion(y, mode, m):
    """Put a state and a mode into a motion."""
    put(y, m.y)
    m.kind, m.tilt, m.way = mode.kind, mode.tilt, mode.way


@compiled
def _same_mode(a, b):
    """Whether two modes are the same, signs without meaning left aside."""
    tilts, goes = a.kind == REST or a.tilt == b.tilt, a.kind != SLIP or a.way == b.way
    return a.kind == b.kind and tilts and goes


@compiled
def follow_periods(q, f, m, legs, room, limits):
    """Follow the periods of steady shaking that the limits say, and return how the motion ended."""
    clear(m)
    begin(q, f, m, FIRST_PIECE, 0.0)
    rules, ended, n = Rules(limits.capture, YES, NO, NO), ARRIVED, 0
    while n < limits.periods and ended == ARRIVED:
        allow(m, room, limits.events)
        ended = piece(q, f, m, legs, room, FIRST_PIECE, 0.0, span_of(q, f), rules)
        n += 1
    return ended


@compiled
def _meet_at_end(q, f, m, legs, room, mode0, limits):
    """If a motion has followed its periods short of an event that comes at once, and began after that
    event: take the event as well."""
    n, period, again = m.recorded - 1, span_of(q, f), room.other
    if n < 0 or n + 2 >= len(legs) or _same_mode(m, mode0):
        return
    # The last leg once more, a little further.
    last, begun = legs[n : n + 1].copy(), legs[n].begun
    put_motion(legs[n].y, legs[n], again)
    clear(again)
    begin(q, f, again, FIRST_PIECE, begun)
    again.recorded = n
    allow(again, room, limits.events)
    rules = Rules(limits.capture, YES, NO, NO)
    piece(q, f, again, legs, room, FIRST_PIECE, begun, (1.0 + _CLOSE) * period, rules)
    k = min(again.recorded, len(legs)) - 1
    if not (_same_mode(again, mode0) and k > n and legs[k].which == END):
        legs[n] = last[0]
        return
    # Back to the end of the period along the new arc.
    at = legs[k]
    at.lasted, e = period - at.begun, load_at(q, f, FIRST_PIECE, at.begun)
    arc = arc_from(q, at, at.y, e)
    m.crossing, m.recorded = min(m.crossing, again.crossing), k + 1
    put_motion(state_at(arc, instant(arc, at.lasted), at.lasted), again, m)


@compiled
def cycle(q, m, legs, room, r, limits, start, c):
    """Follow periods from the state and mode of a motion, of which `start` gets a copy, into the cycle
    `c`."""
    f, many = steady(np.empty((0, 4))), np.empty((ROWS, INPUTS))
    put_motion(m.y, m, start)
    ended = follow_periods(q, f, m, legs, room, limits)
    # Most motions have a few legs a period; one that rattles is followed once more with room for all.
    if m.recorded > len(legs) and ended == ARRIVED:
        legs = np.empty(m.recorded, LEG)
        put_motion(start.y, start, m)
        ended = follow_periods(q, f, m, legs, room, limits)
    # What ended before its period is no orbit, though it may end where it began.
    sound = ended == ARRIVED
    if sound:
        _meet_at_end(q, f, m, legs, room, start, limits)
        read(q, f, m, legs, r, (FIRST_PIECE, INPUTS), NO, many)
    for i in range(4):
        c.end[i] = m.y[i] if sound else math.nan
    c.amplitude, c.stroke, c.crossing = largest(m, TILT), largest(m, SWING), m.crossing
    c.kind, c.tilt, c.way = m.kind, m.tilt, m.way
    c.asymmetry = abs(max(m.best[0], 0.0) - max(m.best[1], 0.0)) / (c.amplitude if c.amplitude > 0.0 else 1.0)
    c.closed = 1.0 if _same_mode(m, start) else 0.0
    for k in range(6):
        row = k if k < 4 else ANGLES + larger(m, k - 4)
        for j in range(INPUTS):
            c.by[k, j] = many[row, j] if sound else math.nan


@compiled
def eliminate(a, b):
    """Solve a x = b in place for a 4 x 4 matrix and several right-hand sides, shape (4, n), by elimination
    with pivots; return the size of the smallest pivot, 0 if there is none or no number."""
    least, n = math.inf, b.shape[1]
    for c in range(4):
        pivot = c
        for r in range(c + 1, 4):
            if abs(a[r, c]) > abs(a[pivot, c]):
                pivot = r
        if not abs(a[pivot, c]) > 0.0:
            return 0.0
        least = min(least, abs(a[pivot, c]))
        for k in range(4):
            a[c, k], a[pivot, k] = a[pivot, k], a[c, k]
        for k in range(n):
            b[c, k], b[pivot, k] = b[pivot, k], b[c, k]
        for r in range(c + 1, 4):
            share = a[r, c] / a[c, c]
            for k in range(c, 4):
                a[r, k] -= share * a[c, k]
            for k in range(n):
                b[r, k] -= share * b[c, k]
    for j in range(n):
        for c in range(3, -1, -1):
            for k in range(c + 1, 4):
                b[c, j] -= a[c, k] * b[k, j]
            b[c, j] /= a[c, c]
    return least if math.isfinite(b[0, 0] + b[1, 0] + b[2, 0] + b[3, 0]) else 0.0


@compiled
def _square(m):
    """Square a 4 x 4 matrix in place; return its largest entry in size."""
    old, largest = m.copy(), 0.0
    for i in range(4):
        for j in range(4):
            m[i, j] = 0.0
            for k in range(4):
                m[i, j] += old[i, k] * old[k, j]
            largest = max(largest, abs(m[i, j]))
    return largest


@compiled
def _contracts(by, scales, unfelt):
    """Whether the derivative of the map of a period, in rows 0 to 3 and columns 9 to 12, has no multiplier of
    size 1 or more that the block feels."""
    # Powers tell it without eigenvalues: those of a contraction vanish, however large the first ones are.
    m = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            felt = not unfelt or (i % 2 == 0 and j % 2 == 0)
            m[i, j] = by[i, STATE + j] * scales[j] / scales[i] if felt else 0.0
    for _ in range(_SQUARES):
        largest = _square(m)
        if not largest < 1e100:
            return False
        if largest < 0.1:
            return True
    return False


@compiled
def _approaches(by, past, known, periods, found, scales, apart):
    """Whether a motion's last states, and those before, differ from an orbit's as its derivative says."""
    if known <= 2 * periods:
        return False
    for n in range(2):
        for i in range(4):
            left = past[n * periods].y[i] - found[i]
            for j in range(4):
                left -= by[i, STATE + j] * (past[(n + 1) * periods].y[j] - found[j])
            if not abs(left) < _LINEAR * apart * scales[i]:
                return False
    return True


@compiled
def _passed(by, best, scales, gap, apart, peaks):
    """Whether the motion has its peaks behind it, on its way to an orbit from which its state differs by
    `gap`; or else, where that is next to nothing, raise the peaks by what it reaches, to first order."""
    onward, worst = np.empty(4), np.zeros(2)
    for _ in range(_LONG):
        for k in range(4):
            size = best[k]
            for i in range(4):
                size += by[ANGLES + k, STATE + i] * gap[i]
            worst[k // 2] = max(worst[k // 2], size)
        left = 0.0
        for i in range(4):
            onward[i] = 0.0
            for j in range(4):
                onward[i] += by[i, STATE + j] * gap[j]
            left = max(left, abs(onward[i]) / scales[i])
        put(onward, gap)
        if left > 3.0 * apart:
            return False
        if left < 1e-8:
            break
    else:
        return False
    # What the first order leaves out is of the square of the distance.
    margin = apart * apart if apart > _NEXT_TO_NOTHING else 0.0
    for k in range(2):
        if margin > 0.0 and worst[k] + margin * scales[k] > peaks[k]:
            return False
        peaks[k] = max(peaks[k], worst[k])
    return True


@compiled
def _newton(q, f, m, legs, room, r, mode, limits, by):
    """Find the orbit near the state of a motion by Newton's method on the map of so many periods, and leave
    the motion at its start; False if none is found whose sequence of events is that of the motion from the
    state."""
    scales, matrix, move, found, events = scales_of(q), np.empty((4, 4)), np.empty((4, 1)), np.empty(4), 0
    for step in range(_NEWTON):
        put(m.y, found)
        put_motion(found, mode, m)
        ended = follow_periods(q, f, m, legs, room, limits)
        if ended != ARRIVED or m.recorded > len(legs) or not _same_mode(mode, m):
            return False
        # A number that stands for the sequence of events.
        sequence = 0
        for n in range(m.recorded):
            if legs[n].which != BOB:
                sequence = 31 * sequence + 5 * int(legs[n].kind) + legs[n].which + 7
        if step > 0 and sequence != events:
            return False
        events, residual = sequence, 0.0
        read(q, f, m, legs, r, (STATE, INPUTS), NO, by)
        for i in range(4):
            move[i, STEP_OF_NEWTON] = m.y[i] - found[i]
            if q.mu > 0.0 or i % 2 == 0:
                residual = max(residual, abs(move[i, STEP_OF_NEWTON]) / scales[i])
            for j in range(4):
                matrix[i, j] = (1.0 if i == j else 0.0) - by[i, STATE + j]
        if residual < CONVERGED:
            put_motion(found, mode, m)
            return True
        if not residual < NEARBY or not eliminate(matrix, move) > 1e-12:
            return False
        for i in range(4):
            m.y[i] = found[i] + move[i, STEP_OF_NEWTON]
    return False


@compiled
def orbit_near(q, f, m, room, r, past, known, limits):
    """Look for the orbit that a motion approaches, whose last states are `past`. If it attracts, and the
    motion is near and moves as the orbit's derivative says, change the motion's state, put the orbit's sizes
    into `past`, and return True."""
    orbit, by, scales, gap = room.other, np.empty((ROWS, INPUTS)), scales_of(q), np.empty(4)
    put_motion(m.y, m, orbit)
    if not _newton(q, f, orbit, np.empty(LEGS, LEG), room, r, m, limits, by):
        return False
    # The derivative of an orbit at rest does not tell whether the decay of the bob lifts the block yet: there
    # the motion is followed until that is proved away.
    best = orbit.best
    if largest(orbit, TILT) == 0.0:
        return False
    apart = 0.0
    for i in range(4):
        gap[i] = m.y[i] - orbit.y[i]
        apart = max(apart, abs(gap[i]) / scales[i])
    if not apart < NEARBY or not _contracts(by, scales, q.mu == 0.0):
        return False
    if not _approaches(by, past.periods, known, limits.periods, orbit.y, scales, apart):
        return False
    if not _passed(by, best, scales, gap, apart, past.peaks):
        return False
    for n in range(limits.periods):
        past.periods[n].tilt, past.periods[n].swing = largest(orbit, TILT), largest(orbit, SWING)
    put(orbit.y, m.y)
    return True
