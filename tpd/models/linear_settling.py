"""Compiled loops over forcing periods of the linear equations (25): settling, orbits and trajectories.

The rules are those of `tpd.models.settling` and `tpd.models.piecewise`. Derivatives follow the recorded legs of
a motion once more, in complex numbers (see `tpd.exact.arc_kernel`): between events by the closed form of the
arc, and at an event by one Newton step on its time, which carries the saltation matrix.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.arc_kernel import (
    REST,
    SLIP,
    STEP,
    STICK,
    compiled,
    instant,
    launch,
    plant,
    plant_along,
    state_at,
    struck,
)
from tpd.exact.event_kernel import (
    ARRIVED,
    BOB,
    END,
    FIRST,
    LEG,
    LOST,
    advance,
    begin,
    decide,
    reserve,
    share_at,
    sign,
)
from tpd.models.period_kernel import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    LONGEST,
    NOT_SETTLED,
    OVERTURNED,
    ROCKING,
    growth_in,
    remember,
    repeats_after,
    scales_of,
    settled,
)

_NEARBY, _NEXT_TO_NOTHING = 0.02, 1e-4
"""Largest distances, in shares of the scales, from which a motion is taken to the orbit that it approaches: with
its peaks behind it, and always."""
_LINEAR = 0.1
"""Share of its distance by which the last states of such a motion may differ from what the orbit's derivative
says."""
_CONVERGED, _NEWTON = 1e-10, 6
"""Residual of an orbit, and bound on the steps of Newton's method."""
_WORTH = 24
"""Forcing periods that may be followed in the time in which an orbit of one period is found."""
_SQUARES, _LONG = 16, 1000
"""Squares of the derivative after which a contraction must have shown, and periods that are summed up."""
_ROUNDING = 1e-10
"""Share of a period by which a time may lie before the period that it counts to."""
_LEGS = 256
"""Legs of a motion for which room is made at first."""
INPUTS = 13
"""Directions of derivatives: nine parameters and four components of a state."""


@compiled
def _leg(q, legs, n, y, t, end):
    """Follow a recorded leg: change the state `y` to that after it, and return the time of its end. `t` is the
    time of its beginning and `end` its horizon, for a leg that ends there."""
    kind, tilt, way, lasted, which = legs[n, 0], legs[n, 1], legs[n, 2], legs[n, 4], legs[n, 5]
    one, zero = complex(1.0, 0.0), complex(0.0, 0.0)
    arc = launch(q, kind, complex(tilt, 0.0), complex(way, 0.0), y[0], y[1], y[2], y[3], q.xi * t, one, zero)
    now = instant(arc, complex(lasted, 0.0))
    a = state_at(arc, now, complex(lasted, 0.0))
    # How late the event is, to first order: what is left of its signal, over its slope.
    if which == END:
        late = (end - t).imag
    elif which == BOB:
        late = 0.0
    elif kind != SLIP:
        value = reserve(q, kind, complex(tilt, 0.0), which, a[0], a[1], a[3], now.sine)
        side = 1.0 if which == FIRST else -1.0
        pull = (1.0 - q.up.real) * a[3].real + q.bias.real * a[5].real
        slope = -side * (pull - q.f.real * q.xi.real * now.cosine.real)
        late = -value.imag / slope if slope != 0.0 else 0.0
    elif which == FIRST:
        late = -a[2].imag / a[4].real if a[4].real != 0.0 else 0.0
    else:
        late = -a[0].imag / a[2].real if a[2].real != 0.0 else 0.0
    for i in range(4):
        y[i] = complex(a[i].real, a[i].imag + a[i + 2].real * late)
    return complex(t.real + lasted, t.imag + late)


@compiled
def _after(q, legs, n, y):
    """Change the state at the end of a recorded leg to that after its event."""
    kind, which, rests = legs[n, 0], legs[n, 5], legs[n, 6] != 0.0
    if kind != SLIP or which == END or which == BOB:
        return
    if which == FIRST:
        y[0], y[2] = (complex(0.0, 0.0) if rests else y[0]), complex(0.0, 0.0)
    else:
        y[0] = complex(0.0, 0.0)
        y[2], y[3] = struck(q, rests, y[2], y[3])


@compiled
def _extremes(legs, count, y0, where):
    """Put the indices of the legs at whose ends tilt and swing are largest to either side into `where`; -1 is
    the beginning."""
    for k in range(4):
        column, side = 11 + k // 2, 1.0 if k % 2 == 0 else -1.0
        best, where[k] = side * y0[k // 2], -1
        for n in range(count):
            if side * legs[n, column] > best:
                best, where[k] = side * legs[n, column], n


@compiled
def _differentiate(x, complex_plants, y0, legs, count, first, by):
    """Put the derivatives of the end of the recorded periods, and of their largest tilts and swings to either
    side, into `by`, shape (8, 13), from direction `first` on."""
    y, where = np.empty(4, np.complex128), np.empty(4, np.int64)
    _extremes(legs, count, y0, where)
    q = complex_plants[0]
    for j in range(first, INPUTS):
        if j < 9 or j == first or j == 9:
            plant_along(x, j, q)
        for i in range(4):
            y[i] = complex(y0[i], STEP if 9 + i == j else 0.0)
        t, period = complex(0.0, 0.0), 2.0 * math.pi / q.xi
        for k in range(4):
            by[4 + k, j] = (1.0 if k % 2 == 0 else -1.0) * y[k // 2].imag / STEP
        for n in range(count):
            # The real part of a state begins anew with every leg, as it did when the motion was followed.
            for i in range(4):
                y[i] = complex(legs[n, 7 + i], y[i].imag)
            t = _leg(q, legs, n, y, complex(legs[n, 3], t.imag), period)
            for k in range(4):
                if where[k] == n:
                    by[4 + k, j] = (1.0 if k % 2 == 0 else -1.0) * y[k // 2].imag / STEP
            _after(q, legs, n, y)
            if legs[n, 5] == END:
                t = complex(0.0, 0.0)
        for i in range(4):
            by[i, j] = y[i].imag / STEP


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
def cycle(x, plants, complex_plants, y0, mode0, periods, rest_rate, max_events, first, out, by):
    """Follow so many periods from `y0` in `mode0`. Put (end, amplitude, stroke, mode, transversality,
    asymmetry, closed) into `out`, and the derivatives in the directions from `first` on into `by`, shape
    (6, 13): those of (end, amplitude, stroke)."""
    q, mode, sizes, y = plants[0], np.zeros(4), np.zeros(6), np.empty(4)
    plant(x, q)
    legs, count, many = np.empty((_LEGS, LEG)), np.zeros(1, np.int64), np.empty((8, INPUTS))
    for i in range(4):
        y[i], mode[i] = y0[i], (mode0[i] if i < 3 else 0.0)
    ended = follow(q, y, mode, periods, rest_rate, max_events, legs, count, sizes)
    if count[0] > len(legs) and first < INPUTS and ended == ARRIVED:
        legs = np.empty((count[0], LEG))
        for i in range(4):
            y[i], mode[i] = y0[i], (mode0[i] if i < 3 else 0.0)
        ended = follow(q, y, mode, periods, rest_rate, max_events, legs, count, sizes)
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
            _differentiate(x, complex_plants, y0, legs, count[0], first, many)
        for j in range(INPUTS):
            for i in range(4):
                by[i, j] = many[i, j]
            by[4, j] = many[4 if sizes[0] >= sizes[1] else 5, j]
            by[5, j] = many[6 if sizes[2] >= sizes[3] else 7, j]


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
def _contracts(by, scales, unfelt):
    """Whether the derivative of the map of a period, in rows and columns 0 to 3 and 9 to 12, has no multiplier
    of size 1 or more that the block feels."""
    m, square = np.empty((4, 4)), np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            felt = not unfelt or (i % 2 == 0 and j % 2 == 0)
            m[i, j] = by[i, 9 + j] * scales[j] / scales[i] if felt else 0.0
    for _ in range(_SQUARES):
        largest = 0.0
        for i in range(4):
            for j in range(4):
                square[i, j] = 0.0
                for k in range(4):
                    square[i, j] += m[i, k] * m[k, j]
                largest = max(largest, abs(square[i, j]))
        for i in range(4):
            for j in range(4):
                m[i, j] = square[i, j]
        if not largest < 1e100:
            return False
        if largest < 0.1:
            return True
    return False


@compiled
def _approaches(by, past, known, periods, found, scales, apart):
    """Whether the last states of a motion, and those before, differ from an orbit's as its derivative says."""
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
    """Whether the motion has its peaks behind it, on its way to an orbit from which its state differs by `gap`;
    or else, where that is next to nothing, raise the peaks by what it reaches, to first order."""
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
    margin = apart * apart if apart > _NEXT_TO_NOTHING else 0.0
    for k in range(2):
        if margin > 0.0 and worst[k] + margin * scales[k] > peaks[k]:
            return False
        peaks[k] = max(peaks[k], worst[k])
    return True


@compiled
def _newton(x, q, complex_plants, y, mode, periods, rest_rate, max_events, scales, found, sizes, by):
    """Find the orbit near a state by Newton's method on the map of so many periods; False if none is found
    whose sequence of events is that of the motion from the state."""
    legs, count = np.empty((_LEGS, LEG)), np.zeros(1, np.int64)
    matrix, move, now, state, events = np.empty((4, 4)), np.empty(4), np.zeros(4), np.empty(4), 0
    for i in range(4):
        state[i] = y[i]
    for step in range(_NEWTON):
        for i in range(4):
            found[i], now[i] = state[i], mode[i]
        ended = follow(q, state, now, periods, rest_rate, max_events, legs, count, sizes)
        if ended != ARRIVED or count[0] > _LEGS or not _same_mode(mode, now):
            return False
        # A number that stands for the sequence of events.
        sequence = 0
        for n in range(count[0]):
            if legs[n, 5] != BOB:
                sequence = 31 * sequence + 5 * int(legs[n, 0]) + int(legs[n, 5]) + 7
        if step > 0 and sequence != events:
            return False
        events, residual = sequence, 0.0
        _differentiate(x, complex_plants, found, legs, count[0], 9, by)
        for i in range(4):
            move[i] = state[i] - found[i]
            if q.mu > 0.0 or i % 2 == 0:
                residual = max(residual, abs(move[i]) / scales[i])
            for j in range(4):
                matrix[i, j] = (1.0 if i == j else 0.0) - by[i, 9 + j]
        if residual < _CONVERGED:
            return True
        if not residual < _NEARBY or not _solve(matrix, move):
            return False
        for i in range(4):
            state[i] = found[i] + move[i]
    return False


@compiled
def _orbit_near(x, q, complex_plants, mode, periods, rest_rate, max_events, scales, past, known, peaks, found, last):
    """Look for the orbit that a motion approaches. If it attracts, and the motion is near and moves as the
    orbit's derivative says, put its state into `found` and its sizes into `last`, and return True."""
    sizes, by, gap = np.zeros(6), np.empty((8, INPUTS)), np.empty(4)
    if not _newton(x, q, complex_plants, past[0], mode, periods, rest_rate, max_events, scales, found, sizes, by):
        return False
    apart = 0.0
    for i in range(4):
        gap[i] = past[0, i] - found[i]
        apart = max(apart, abs(gap[i]) / scales[i])
    if not apart < _NEARBY or not _contracts(by, scales, q.mu == 0.0):
        return False
    if not _approaches(by, past, known, periods, found, scales, apart):
        return False
    if not _passed(by, sizes, scales, gap, apart, peaks):
        return False
    for n in range(periods):
        last[n, 0], last[n, 1] = max(sizes[0], sizes[1]), max(sizes[2], sizes[3])
    return True


@compiled
def _slow_repetition(q, past, known, scales, tolerance, before):
    """Forcing periods after which a motion all but repeats itself, if it would take longer to repeat itself
    than its orbit takes to find; 0 if not. `before` holds the last distance and its periods."""
    step, closest, periods = (1 if q.mu > 0.0 else 2), _NEARBY, 0
    for n in range(1, known // 2):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(past[0, i] - past[n, i]) / scales[i])
        if error < 0.1 * closest or (n == 1 and error < closest):
            closest, periods = error, n
    share = closest / before[0] if before[1] == periods and before[0] > 0.0 else 0.0
    before[0], before[1] = closest, periods
    if periods == 0 or share == 0.0:
        return 0
    left = math.log(closest / tolerance) / -math.log(share) if share < 1.0 else math.inf
    return periods if left > _WORTH * periods else 0


@compiled
def _bob_under_held(q, y, phase):
    """Largest moment of forcing, decaying and steady swing on a held block, and the bob's reach (rad), from the
    state at a phase of steady forcing; see `tpd.exact.flow.held_at_rest`."""
    s, c, sine, cosine = q.swing_sin, q.swing_cos, math.sin(phase), math.cos(phase)
    two_mu = q.up - 1.0
    along, across = -q.f - two_mu * s - q.bias * q.xi * c, -two_mu * c + q.bias * q.xi * s
    psi = y[1] - s * sine - c * cosine
    rate = y[3] - q.xi * (s * cosine - c * sine)
    swing = math.sqrt(psi * psi + rate * rate / q.held_q)
    decaying = two_mu * swing + abs(q.bias) * swing * math.sqrt(q.held_q)
    return math.hypot(along, across) + decaying, math.hypot(s, c) + swing


@compiled
def _come_to_rest(q, y):
    """Change a state at tau = 0 to that which a block at rest, or held leaning, comes to; an undamped bob keeps
    its own swing."""
    if q.zeta > 0.0:
        y[1], y[2], y[3] = q.swing_cos, 0.0, q.xi * q.swing_sin


@compiled
def _rests(q, y, mode, sizes, phase, tolerance):
    """Whether the block rests, or is held leaning, for good under steady shaking, and the bob's reach; it
    changes the mode and the state of one that rattles out. See `tpd.models.piecewise`."""
    pull, reach = _bob_under_held(q, y, phase)
    left = 1.0 - pull / (q.weight + q.k)
    if mode[0] == REST:
        return left >= 0.0, reach
    if mode[0] != STICK:
        return False, reach
    low = max(max(sizes[0], sizes[1]), abs(y[0])) < tolerance * q.nu
    if low and (q.k > 0.0 or q.e < 1.0) and left > 0.0:
        mode[0], y[0] = REST, 0.0
        return True, reach
    lever = abs(q.up * y[0] - mode[1] * q.weight)
    if y[0] != 0.0 and pull + lever < q.k:
        return True, (math.hypot(q.swing_sin, q.swing_cos) if q.held_p > 0.0 else reach)
    return False, reach


@compiled
def _finite(y):
    """Whether a state has only finite numbers."""
    return math.isfinite(y[0] + y[1] + y[2] + y[3])


@compiled
def settle(x, plants, complex_plants, y0, since, ramp, periods, max_events, tolerance, rest_rate, out):
    """Follow one motion from `y0` at tau = `since` until it repeats, rests, is lost, or `periods` have elapsed:
    status, its periods and the periods elapsed. The shaking grows over `ramp` periods."""
    q = plants[0]
    plant(x, q)
    period, capture, scales = 2.0 * math.pi / q.xi, rest_rate * q.nu, scales_of(q)
    past, last, peaks, y = np.zeros((LONGEST, 4)), np.zeros((LONGEST, 3)), np.zeros(2), np.empty(4)
    growth, mode, sizes, t = np.zeros(2), np.zeros(4), np.zeros(6), since
    legs, count = np.empty((0, LEG)), np.zeros(1, np.int64)
    for i in range(4):
        y[i] = past[0, i] = y0[i]
    grown = growth_in(growth, ramp, period, 0.0)
    if grown <= t:
        growth[0], growth[1] = 1.0, 0.0
    decide(q, y, sign(y[0]), sign(y[2]), share_at(growth, t) * math.sin(q.xi * t), mode)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    known, status, repeats, elapsed = (1 if t == 0.0 else 0), NOT_SETTLED, 0, 0
    before, found, wait = np.zeros(2), np.empty(4), 0
    peaks[0], peaks[1] = abs(y[0]), abs(y[1])
    if mode[0] == REST and growth[1] == 0.0:
        rests, reach = _rests(q, y, mode, sizes, q.xi * t, tolerance)
        if rests:
            status, last[0, 1], peaks[1] = AT_REST, reach, max(peaks[1], reach)
            _come_to_rest(q, y)
    while elapsed < periods and status == NOT_SETTLED and _finite(y):
        if elapsed > 0:
            grown = growth_in(growth, ramp, period, float(elapsed))
        grew = growth[1] > 0.0
        begin(q, growth, mode, y, t, sizes)
        ended = ARRIVED
        if grew and grown < (1.0 - 1e-12) * period:
            # The forcing has a kink where its growth ends.
            ended = advance(q, growth, mode, y, t, grown, sizes, legs, count, capture, max_events)
            growth[0], growth[1], t = 1.0, 0.0, grown
        if ended == ARRIVED:
            ended = advance(q, growth, mode, y, t, period, sizes, legs, count, capture, max_events)
        elapsed, t = elapsed + 1, 0.0
        peak, stroke = max(max(sizes[0], sizes[1]), abs(y[0])), max(sizes[2], sizes[3])
        rests, reach = False, 0.0
        if growth[1] == 0.0 and ended == ARRIVED and _finite(y):
            rests, reach = _rests(q, y, mode, sizes, 0.0, tolerance)
        if rests:
            _come_to_rest(q, y)
            peaks[1] = max(peaks[1], reach)
        repeats = repeats_after(q, y, past, known, scales, tolerance) if not grew and ended == ARRIVED else 0
        known = remember(past, 0 if grew else known, last, y, peak, reach if rests else stroke, mode[3])
        peaks[0], peaks[1] = max(peaks[0], peak), max(peaks[1], stroke)
        if ended == LOST:
            status = OVERTURNED
        elif rests:
            status = AT_REST
        elif ended != ARRIVED:
            status = EVENT_BOUND
        elif repeats > 0:
            status = ROCKING
        elif growth[1] == 0.0 and tolerance >= _CONVERGED and elapsed >= wait:
            tried = _slow_repetition(q, past, known, scales, tolerance, before)
            if tried > 0:
                wait = 2 * elapsed
                if _orbit_near(x, q, complex_plants, mode, tried, rest_rate, max_events, scales, past, known, peaks, found, last):
                    status, repeats = ROCKING, tried
                    for i in range(4):
                        y[i] = found[i]
    if status != OVERTURNED and not _finite(y):
        status = FAILED
    status, own = settled(status, repeats, y, last, peaks, mode, out)
    return status, own, elapsed


@compiled
def _moved_on(complex_plants, legs, count, start, t, end, xi, late, by):
    """Take the derivatives `by`, shape (4, 14), along the recorded legs of a piece of a motion from `t` to
    `end`, in times from the beginning of a forcing period. `late` holds, for both, what the derivative of the
    period is multiplied with; 0 for `t` at the first piece, whose beginning is the direction of the last
    column."""
    z = np.empty(4, np.complex128)
    for j in range(INPUTS + 1):
        q = complex_plants[min(j, 9)]
        period = -2.0 * math.pi / (xi * xi) * STEP if j == 6 else 0.0
        now = complex(t, late[0] * period + (late[2] * STEP if j == INPUTS else 0.0))
        goal = complex(end, late[1] * period)
        for i in range(4):
            z[i] = complex(start[i], by[i, j] * STEP)
        for n in range(count):
            for i in range(4):
                z[i] = complex(legs[n, 7 + i], z[i].imag)
            now = _leg(q, legs, n, z, complex(legs[n, 3], now.imag), goal)
            _after(q, legs, n, z)
        for i in range(4):
            by[i, j] = z[i].imag / STEP


@compiled
def _put_rates(q, mode, y, t, out):
    """Put a state and its derivative in time into `out`."""
    arc = launch(q, mode[0], mode[1], mode[2], y[0], y[1], y[2], y[3], q.xi * t, 1.0, 0.0)
    now = state_at(arc, instant(arc, 0.0), 0.0)
    for i in range(4):
        out[i], out[4 + i] = y[i], now[i + 2]


@compiled
def trajectory(x, plants, complex_plants, y0, times, rest_rate, max_events, slopes, out, by):
    """Follow a motion from `y0` at times[0]: put the states at all times, and their derivatives in time, into
    `out`, shape (times, 8), and if `slopes` those in parameters, start and times[0] into `by`, shape (times, 4,
    14). Return its status; what lies beyond the end of a motion is NaN. `complex_plants` has ten places."""
    q = plants[0]
    plant(x, q)
    for j in range(10):
        plant_along(x, j, complex_plants[j])
    period, mode, y, start = 2.0 * math.pi / q.xi, np.zeros(4), np.empty(4), np.empty(4)
    growth, sizes, now, late = np.zeros(2), np.zeros(6), np.zeros((4, INPUTS + 1)), np.zeros(3)
    legs, count = np.empty((max_events + _LEGS if slopes else 0, LEG)), np.zeros(1, np.int64)
    whole = math.floor(times[0] / period + _ROUNDING)
    t, status, growth[0], late[0], late[2] = times[0] - whole * period, ROCKING, 1.0, -whole, 1.0
    for i in range(4):
        y[i], now[i, 9 + i] = y0[i], 1.0
    decide(q, y, sign(y[0]), sign(y[2]), math.sin(q.xi * t), mode)
    for n in range(len(times)):
        last = math.floor(times[n] / period + _ROUNDING)
        arrived = n == 0
        while not arrived and status == ROCKING:
            arrived = whole >= last
            end = times[n] - last * period if arrived else period
            late[1] = -last if arrived else 1.0
            for i in range(4):
                start[i] = y[i]
            count[0] = 0
            begin(q, growth, mode, y, t, sizes)
            ended = advance(q, growth, mode, y, t, end, sizes, legs, count, rest_rate * q.nu, max_events)
            if slopes and ended == ARRIVED:
                _moved_on(complex_plants, legs, min(count[0], len(legs)), start, t, end, q.xi, late, now)
            if ended != ARRIVED:
                status = OVERTURNED if ended == LOST else EVENT_BOUND
            t, whole = (end, whole) if arrived else (0.0, whole + 1)
            late[0], late[2] = (late[1] if arrived else 0.0), 0.0
        _put_rates(q, mode, y, t, out[n])
        for i in range(4):
            for j in range(INPUTS + 1 if slopes else 0):
                by[n, i, j] = now[i, j] if status == ROCKING else math.nan
        for i in range(8 if status != ROCKING else 0):
            out[n, i] = math.nan
    return status
