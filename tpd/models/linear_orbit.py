"""Periods of a motion of the linear equations, with derivatives, and the orbit that a motion approaches."""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import compiled, instant, launch, plant, state_at
from tpd.exact.event_kernel import ARRIVED, LEG, advance, begin
from tpd.exact.event_search import BOB, END
from tpd.exact.mode_kinds import REST, SLIP
from tpd.models.linear_derivatives import INPUTS, STATE, differentiate

NEARBY, _NEXT_TO_NOTHING = 0.05, 1e-4
"""Largest distances, in shares of the scales, from which a motion is taken to the orbit that it approaches:
with its peaks behind it, and always."""
_LINEAR = 0.1
"""Share of its distance by which the last states of such a motion may differ from what the orbit's derivative
says."""
CONVERGED, _NEWTON = 1e-10, 6
"""Residual of an orbit, and bound on the steps of Newton's method."""
_SQUARES, _LONG = 16, 1000
"""Squares of the derivative after which a contraction must have shown, and periods that are summed up."""
_CLOSE = 1e-9
"""Share of a period by which an event may come too late, near an orbit on which it is within the period."""
LEGS = 256
"""Legs of a motion for which room is made at first."""


@compiled
def _same_mode(a, b):
    """Whether two modes are the same, signs without meaning left aside."""
    return a[0] == b[0] and (a[0] == REST or a[1] == b[1]) and (a[0] != SLIP or a[2] == b[2])


@compiled
def follow(q, y, mode, periods, rest_rate, max_events, legs, count, sizes):
    """Follow so many periods of steady shaking: change state and mode, put what is counted into `sizes`, and
    return how it ended."""
    growth, now = np.zeros(2), np.zeros(6)
    growth[0] = 1.0
    period, ended = 2.0 * math.pi / q.xi, ARRIVED
    for k in range(5):
        sizes[k] = 0.0
    sizes[5], count[0] = math.inf, 0
    for _ in range(periods):
        begin(q, growth, mode, y, 0.0, now)
        ended = advance(q, growth, mode, y, 0.0, period, now, legs, count, rest_rate * q.nu, max_events)
        for k in range(4):
            sizes[k] = max(sizes[k], now[k])
        sizes[5] = min(sizes[5], now[5])
        if ended != ARRIVED:
            break
    return ended


@compiled
def _meet_at_end(q, y, mode, mode0, legs, count, capture, max_events):
    """If a motion has followed its periods short of an event that comes at once, and began after that
    event: take the event as well, change state, mode and legs, and return the transversality there."""
    n = count[0] - 1
    if n < 0 or n + 2 >= len(legs) or _same_mode(mode, mode0):
        return math.inf
    # The last leg once more, a little further.
    last, growth, sizes, period = legs[n].copy(), np.array((1.0, 0.0)), np.zeros(6), 2.0 * math.pi / q.xi
    z, m = last[7:11].copy(), np.array((last[0], last[1], last[2], 0.0))
    begin(q, growth, m, z, last[3], sizes)
    count[0] = n
    advance(q, growth, m, z, last[3], (1.0 + _CLOSE) * period, sizes, legs, count, capture, max_events)
    k = min(count[0], len(legs)) - 1
    if not (_same_mode(m, mode0) and k > n and legs[k, 5] == END):
        for i in range(LEG):
            legs[n, i] = last[i]
        count[0] = n + 1
        return math.inf
    # Back to the end of the period along the new arc.
    legs[k, 4] = period - legs[k, 3]
    at = legs[k]
    arc = launch(q, m[0], m[1], m[2], at[7], at[8], at[9], at[10], q.xi * at[3], 1.0, 0.0)
    now = state_at(arc, instant(arc, legs[k, 4]), legs[k, 4])
    for i in range(4):
        y[i], mode[i] = now[i], m[i]
    return sizes[5]


@compiled
def cycle(x, plants, complex_plants, y0, mode0, periods, rest_rate, max_events, first, out, by):
    """Follow so many periods from `y0` in `mode0`. Put (end, amplitude, stroke, mode, transversality,
    asymmetry, closed) into `out`, and the derivatives in the directions from `first` on into `by`, shape
    (6, 13): those of (end, amplitude, stroke)."""
    q, mode, sizes, y = plants[0], np.zeros(4), np.zeros(6), np.empty(4)
    plant(x, q)
    legs, count, many = np.empty((LEGS, LEG)), np.zeros(1, np.int64), np.empty((8, INPUTS))
    for i in range(4):
        y[i], mode[i] = y0[i], (mode0[i] if i < 3 else 0.0)
    ended = follow(q, y, mode, periods, rest_rate, max_events, legs, count, sizes)
    # Most motions have a few legs a period; one that rattles is followed once more with room for all.
    if count[0] > len(legs) and first < INPUTS and ended == ARRIVED:
        legs = np.empty((count[0], LEG))
        for i in range(4):
            y[i], mode[i] = y0[i], (mode0[i] if i < 3 else 0.0)
        ended = follow(q, y, mode, periods, rest_rate, max_events, legs, count, sizes)
    if ended == ARRIVED and first < INPUTS:
        met = _meet_at_end(q, y, mode, mode0, legs, count, rest_rate * q.nu, max_events)
        sizes[5] = min(sizes[5], met)
    # What ended before its period is no orbit, though it may end where it began.
    sound = ended == ARRIVED
    for i in range(4):
        out[i] = y[i] if sound else math.nan
    out[4], out[5] = max(sizes[0], sizes[1]), max(sizes[2], sizes[3])
    out[6], out[7], out[8] = mode[0], mode[1], mode[2]
    out[9], out[10] = sizes[5], abs(sizes[0] - sizes[1]) / (out[4] if out[4] > 0.0 else 1.0)
    out[11] = 1.0 if _same_mode(mode, mode0) else 0.0
    if first < INPUTS:
        for i in range(8):
            for j in range(INPUTS):
                many[i, j] = math.nan
        if sound:
            differentiate(x, complex_plants, y0, legs, count[0], first, many)
        for j in range(INPUTS):
            for i in range(4):
                by[i, j] = many[i, j]
            by[4, j] = many[4 if sizes[0] >= sizes[1] else 5, j]
            by[5, j] = many[6 if sizes[2] >= sizes[3] else 7, j]


@compiled
def finite(y):
    """Whether a state has only finite numbers."""
    return math.isfinite(y[0] + y[1] + y[2] + y[3])


@compiled
def _solve(a, b):
    """Solve a x = b for a 4 x 4 matrix, in place, by elimination with pivots; False if it is singular."""
    for c in range(4):
        pivot = c
        for r in range(c + 1, 4):
            if abs(a[r, c]) > abs(a[pivot, c]):
                pivot = r
        if not abs(a[pivot, c]) > 1e-12:
            return False
        for k in range(4):
            a[c, k], a[pivot, k] = a[pivot, k], a[c, k]
        b[c], b[pivot] = b[pivot], b[c]
        for r in range(c + 1, 4):
            share = a[r, c] / a[c, c]
            for k in range(c, 4):
                a[r, k] -= share * a[c, k]
            b[r] -= share * b[c]
    for c in range(3, -1, -1):
        for k in range(c + 1, 4):
            b[c] -= a[c, k] * b[k]
        b[c] /= a[c, c]
    return True


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
            m[i, j] = by[i, 9 + j] * scales[j] / scales[i] if felt else 0.0
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
            left = past[n * periods, i] - found[i]
            for j in range(4):
                left -= by[i, 9 + j] * (past[(n + 1) * periods, j] - found[j])
            if not abs(left) < _LINEAR * apart * scales[i]:
                return False
    return True


@compiled
def _passed(by, sizes, scales, gap, apart, peaks):
    """Whether the motion has its peaks behind it, on its way to an orbit from which its state differs by
    `gap`; or else, where that is next to nothing, raise the peaks by what it reaches, to first order."""
    onward, worst = np.empty(4), np.zeros(2)
    for _ in range(_LONG):
        for k in range(4):
            size = sizes[k]
            for i in range(4):
                size += by[4 + k, 9 + i] * gap[i]
            worst[k // 2] = max(worst[k // 2], size)
        left = 0.0
        for i in range(4):
            onward[i] = 0.0
            for j in range(4):
                onward[i] += by[i, 9 + j] * gap[j]
            left = max(left, abs(onward[i]) / scales[i])
        for i in range(4):
            gap[i] = onward[i]
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
def _newton(x, q, complex_plants, past, mode, periods, limits, scales, found, sizes, by):
    """Find the orbit near the last state by Newton's method on the map of so many periods; False if none is
    found whose sequence of events is that of the motion from the state."""
    legs, count = np.empty((LEGS, LEG)), np.zeros(1, np.int64)
    matrix, move, now, state, events = np.empty((4, 4)), np.empty(4), np.zeros(4), np.empty(4), 0
    for i in range(4):
        state[i] = past[0, i]
    for step in range(_NEWTON):
        for i in range(4):
            found[i], now[i] = state[i], mode[i]
        ended = follow(q, state, now, periods, limits[0], limits[1], legs, count, sizes)
        if ended != ARRIVED or count[0] > LEGS or not _same_mode(mode, now):
            return False
        # A number that stands for the sequence of events.
        sequence = 0
        for n in range(count[0]):
            if legs[n, 5] != BOB:
                sequence = 31 * sequence + 5 * int(legs[n, 0]) + int(legs[n, 5]) + 7
        if step > 0 and sequence != events:
            return False
        events, residual = sequence, 0.0
        differentiate(x, complex_plants, found, legs, count[0], STATE, by)
        for i in range(4):
            move[i] = state[i] - found[i]
            if q.mu > 0.0 or i % 2 == 0:
                residual = max(residual, abs(move[i]) / scales[i])
            for j in range(4):
                matrix[i, j] = (1.0 if i == j else 0.0) - by[i, 9 + j]
        if residual < CONVERGED:
            return True
        if not residual < NEARBY or not _solve(matrix, move):
            return False
        for i in range(4):
            state[i] = found[i] + move[i]
    return False


@compiled
def orbit_near(x, q, complex_plants, mode, periods, limits, scales, past, known, peaks, y, last):
    """Look for the orbit that a motion approaches. If it attracts, and the motion is near and moves as the
    orbit's derivative says, put its state into `y` and its sizes into `last`, and return True. `limits` are
    the rate of rest and the bound on events."""
    sizes, by, gap, found = np.zeros(6), np.empty((8, INPUTS)), np.empty(4), np.empty(4)
    if not _newton(x, q, complex_plants, past, mode, periods, limits, scales, found, sizes, by):
        return False
    # The derivative of an orbit at rest does not tell whether the decay of the bob lifts the block yet: there
    # the motion is followed until that is proved away.
    if max(sizes[0], sizes[1]) == 0.0:
        return False
    apart = 0.0
    for i in range(4):
        gap[i] = past[0, i] - found[i]
        apart = max(apart, abs(gap[i]) / scales[i])
    if not apart < NEARBY or not _contracts(by, scales, q.mu == 0.0):
        return False
    if not _approaches(by, past, known, periods, found, scales, apart):
        return False
    if not _passed(by, sizes, scales, gap, apart, peaks):
        return False
    for n in range(periods):
        last[n, 0], last[n, 1] = max(sizes[0], sizes[1]), max(sizes[2], sizes[3])
    for i in range(4):
        y[i] = found[i]
    return True
