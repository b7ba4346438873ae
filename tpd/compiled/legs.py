"""Derivatives, states at requested times and impacts of a motion, computed from its legs.

Complex numbers carry the derivatives through the series of each leg (see `tpd.compiled.plant.STEP`). At an
event, one Newton step on the event's time gives the saltation matrix. This holds for the linear equations
(25) and for the nonlinear equations (4).
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import series
from tpd.compiled.columns import (
    REST,
    SLIP,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
    WIDTH,
)
from tpd.compiled.contact import excess, impact
from tpd.compiled.forcing import YES, Load, forcing_now, harmonic, load_at, span_of
from tpd.compiled.motion import (
    CONTINUES,
    END,
    LANDING,
    RELEASE_UP,
    STOP,
    TURN,
    angle_of,
    larger_side,
)
from tpd.compiled.plant import COMPLEX_PLANT, STEP, coefficients, compiled, growing_mode, part
from tpd.compiled.series import SLOPE, VALUE

INPUTS = np.int64(WIDTH + 4)
"""Number of directions of the derivatives: the parameters and four components of the initial state."""
STATE, _BEGINNING = np.int64(WIDTH), np.int64(-1)
"""Index of the first direction of the initial state; and the index that stands for the start of the run in
`peak_legs`."""
OF_END, OF_GROWING, OF_TIMES, OF_UPLIFT, OUTPUTS = map(np.int64, (3, 7, 8, 11, 12))
"""Rows of the derivatives of a run under a ground motion, after those of the three angles: the state at the
end, the growing coordinate, the three times, and the time of the first uplift. The last number is the number
of rows."""
_FORCING, _KIND, _SIDE, STATES = map(np.int64, (6, 7, 8, 9))
"""Columns of a history after those of the state with its accelerations (forcing, kind of the mode, sign of
the tilt), and the number of columns."""
_WHEN, _RATE = 0, 1
"""Columns of the table of impacts: time, and rate after the impact."""
_NEGLIGIBLE, _MOST = 1e-15, 24
"""Share of a derivative that its series may omit, and the largest order of such a series."""
_ROUNDING = 1e-12
"""Relative amount by which a requested time may exceed the end of the motion because of rounding."""
END_STATE, ANGLES, GROWING, TIMES, UPLIFT, ROWS = map(np.int64, (0, 4, 10, 11, 17, 18))
"""First rows of the derivatives, and the number of rows.

The rows are the state at the end (4), the six largest angles (6), and under a ground motion also the growing
coordinate at the end (1), the times of the six angles (6), and that of the first uplift (1). The row of a
time that has no derivative is not written.
"""
READER = np.dtype(
    [
        ("plants", COMPLEX_PLANT, (WIDTH + 1,)),
        ("row", np.complex128, (WIDTH,)),
        ("series", np.complex128, (series.ROWS, series.ORDERS)),
        ("dy", np.float64, (4, int(INPUTS) + 1)),
        ("shift", np.float64, (int(INPUTS) + 1,)),
        ("inverse", np.float64, (3,)),
        ("by", np.float64, (int(ROWS), int(INPUTS))),
        ("work", series.WORK),
    ],
    align=True,
)
"""A reader, which computes derivatives from legs: complex `plants`, one for each parameter and one for all
other directions, from a `row` of parameters; a complex `series`; the derivatives `dy` of the state and
`shift` of the local time, in all directions and in that of the start time; `inverse`, which is not used
because these series have a given order; `by`, the derivatives of a motion by rows and directions; and a
workspace (`work`) for real series."""


@part
def _plant(r, j):
    """Return the complex plant of direction j. All directions that change no parameter share the last one."""
    return r.plants[min(j, STATE)]


@compiled
def fill_plants(x, count, linear, r):
    """Fill the complex plants of a reader: one for each of the first parameters, and the last for all other
    directions.

    The imaginary parts of a plant are `STEP` times the derivatives in its parameter.
    """
    for n in range(count + 1):
        j = n if n < count else STATE
        for i in range(WIDTH):
            r.row[i] = complex(x[i], STEP if i == j else 0.0)
        coefficients(r.row, complex(linear, 0.0), r.plants[j])


@compiled
def start_reading(r, directions):
    """Set the derivatives at the start of a run: only the initial state itself changes."""
    for j in range(directions):
        r.shift[j] = 0.0
        for i in range(4):
            r.dy[i, j] = 1.0 if j == STATE + i else 0.0


@part
def _signal(event):
    """Return the row of the series that vanishes at an event."""
    if event == TURN:
        return series.V
    return series.PHI if event == LANDING else (series.UP if event == RELEASE_UP else series.DOWN)


@compiled
def _order_of(q, leg):
    """Return the order of the series that carry derivatives through a leg.

    The series of a small motion has few orders, which may be too few for its derivatives.
    """
    # Each order of a motion is at most x/n times the last one.
    # The terms up to the order of the leg exist anyway; more are added while the last one counts.
    x, n, term = leg.duration * q.quick.real, leg.order, 1.0
    for k in range(1, leg.order + 1):
        term *= x / k
    while term > _NEGLIGIBLE and n < _MOST:
        n += 1
        term *= x / n
    return n


@compiled
def _store_angles(r, f, m, leg, order, n, j, before):
    """Write the derivatives of the angles that are largest in leg n, and of their times, in direction j.

    The series of the reader is that of the leg, and its derivatives are those at the end of the leg. `before`
    is the derivative of the local time at the start.
    """
    for k in range(6):
        if m.peak_legs[k] != n:
            continue
        t, shift = m.peak_offsets[k], r.shift[j]
        if t == leg.duration:
            r.by[ANGLES + k, j] = angle_of(r.dy[TILT, j], r.dy[SWING, j], k)
        else:
            # Within a leg the angle turns, so that its value does not change with its time.
            phi, psi = series.value_at(r, series.PHI, order, t), series.value_at(r, series.PSI, order, t)
            r.by[ANGLES + k, j] = angle_of(phi.imag, psi.imag, k) / STEP
            v, a = series.value_and_slope(r, series.V, order, t)
            rate, pull = series.value_and_slope(r, series.R, order, t)
            apart = 1.0 if k > 3 else 0.0
            shift = before - (rate - apart * v).imag / STEP / (pull - apart * a).real
        if not f.harmonic:
            r.by[TIMES + k, j] = leg.piece * _plant(r, j).xi.imag / STEP + shift


@compiled
def _terms(q, leg, e, order, w):
    """Compute the series of a leg. Its mode is copied: another kind of record would be compiled again."""
    w.trial.kind, w.trial.tilt, w.trial.direction = leg.kind, leg.tilt, leg.direction
    series.load_state(leg.y, w)
    series.terms(q, w.trial, e, math.inf, order, w)


@compiled
def _carry_complex(r, f, leg, directions, angles, m, n):
    """Carry the derivatives of a reader through leg n of a motion and past its event.

    If `angles`, this also stores the derivatives of the angles that are largest in the leg. The directions
    are those from the first to before the last of `directions`.
    """
    c, event, t, (first, last) = r.series, leg.event, leg.duration, directions
    order = _order_of(r.plants[STATE], leg)
    for j in range(first, last):
        q, before, y = _plant(r, j), r.shift[j], leg.y
        # A block on its base, or held at a tilt, forgets how it came there.
        if leg.kind != SLIP:
            r.dy[TILT, j], r.dy[TILT_RATE, j] = (0.0 if leg.kind == REST else r.dy[TILT, j]), 0.0
        c[series.PHI, VALUE] = complex(y[TILT], r.dy[TILT, j] * STEP)
        c[series.PSI, VALUE] = complex(y[SWING], r.dy[SWING, j] * STEP)
        c[series.V, VALUE] = complex(y[TILT_RATE], r.dy[TILT_RATE, j] * STEP)
        c[series.R, VALUE] = complex(y[SWING_RATE], r.dy[SWING_RATE, j] * STEP)
        # A later start of the leg meets the forcing at a later phase.
        e = load_at(q, f, leg.piece, complex(leg.start, before * STEP))
        series.terms(q, leg, e, math.inf, order, r)
        phi, psi = series.value_at(r, series.PHI, order, t), series.value_at(r, series.PSI, order, t)
        v, pull = series.value_and_slope(r, series.V, order, t)
        rate, swing_pull = series.value_and_slope(r, series.R, order, t)
        # The leg ends later by the delay, during which the state moves with its rates. To first order the
        # delay is the value of the signal that vanishes at the event, divided by its slope.
        delay = 0.0
        if event == END:
            # The end of a piece depends on its duration alone, and that of a free motion on nothing.
            delay = (span_of(q, f).imag / STEP if f.harmonic or leg.piece < f.pieces else 0.0) - before
        elif event == STOP:
            delay = -(leg.piece * span_of(q, f).imag / STEP + before)
        elif event != CONTINUES:
            value, slope = series.value_and_slope(r, _signal(event), order, t)
            delay = -value.imag / STEP / slope.real if slope.real != 0.0 else 0.0
        r.dy[TILT, j], r.dy[SWING, j] = phi.imag / STEP + v.real * delay, psi.imag / STEP + rate.real * delay
        r.dy[TILT_RATE, j] = v.imag / STEP + pull.real * delay
        r.dy[SWING_RATE, j] = rate.imag / STEP + swing_pull.real * delay
        r.shift[j] = before + delay
        if angles:
            _store_angles(r, f, m, leg, order, n, j, before)
        # Past the event: the variable that vanishes there vanishes for all parameters.
        if event == TURN:
            r.dy[TILT_RATE, j] = 0.0
        elif event == LANDING:
            block, bob = impact(q, leg.rests, leg.tilt, complex(psi.real, r.dy[SWING, j] * STEP))
            speed = complex(v.real, r.dy[TILT_RATE, j] * STEP)
            r.dy[TILT, j], r.dy[TILT_RATE, j] = 0.0, ((1.0 + block) * speed).imag / STEP
            r.dy[SWING_RATE, j] += (bob * speed).imag / STEP
        elif event == END:
            # The local time starts again at zero in the next piece.
            r.shift[j] = 0.0


@compiled
def _carry_states(q, r, leg, directions, angles, m, n):
    """Carry derivatives in initial states through leg n under a harmonic, for the linear equations (25).

    See `carry_through_leg`. A change of the state is a motion without forcing, weight and friction, so that
    real numbers are enough.
    """
    (first, last), t, event, w = directions, leg.duration, leg.event, r.work
    order, y = _order_of(q, leg), w.trial.y
    e, c = load_at(q, harmonic(), leg.piece, leg.start), w.series
    _terms(q, leg, e, order, w)
    v0, a0, r0, b0 = c[series.V, VALUE], c[series.V, SLOPE], c[series.R, VALUE], c[series.R, SLOPE]
    (v, a), (rate, b) = (
        series.value_and_slope(w, series.V, order, t),
        series.value_and_slope(w, series.R, order, t),
    )
    # The slope of the signal that vanishes at the end of the leg.
    slope = 0.0
    if event != CONTINUES and event < END:
        _, slope = series.value_and_slope(w, _signal(event), order, t)
    # In (25) the impact does not depend on the bob's angle.
    block, bob = impact(q, leg.rests, leg.tilt, 0.0)
    w.trial.tilt, w.trial.direction = 0.0, 0.0
    free, d = Load(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), r.dy
    for j in range(first, last):
        before = r.shift[j]
        # Changes at fixed times: first at the start of the leg, then at its end.
        y[TILT] = 0.0 if leg.kind == REST else d[TILT, j] - v0 * before
        y[TILT_RATE] = d[TILT_RATE, j] - a0 * before if leg.kind == SLIP else 0.0
        y[SWING], y[SWING_RATE] = d[SWING, j] - r0 * before, d[SWING_RATE, j] - b0 * before
        series.load_state(y, w)
        series.terms(q, w.trial, free, math.inf, order, w)
        for k in range(6 if angles else 0):
            if m.peak_legs[k] == n and m.peak_offsets[k] != t:
                # Within a leg the angle turns, so that its value does not change with its time.
                at = m.peak_offsets[k]
                phi = series.value_at(w, series.PHI, order, at)
                r.by[ANGLES + k, j] = angle_of(phi, series.value_at(w, series.PSI, order, at), k)
        series.store_state(w, order, t, y)
        # The change of the time at which the leg ends: that of its event, or none.
        shift = before if event == CONTINUES else 0.0
        if event != CONTINUES and event < END and slope != 0.0:
            value = y[TILT_RATE] if event == TURN else y[TILT]
            # A held block is released by the moment on it.
            if event > TURN:
                value = excess(q, y[TILT], y[SWING], y[SWING_RATE], 0.0, 0.0)
                value = -value if event == RELEASE_UP else value
            shift = -value / slope
        # Changes at the shifted time.
        d[TILT, j], d[SWING, j] = y[TILT] + v * shift, y[SWING] + rate * shift
        d[TILT_RATE, j], d[SWING_RATE, j] = y[TILT_RATE] + a * shift, y[SWING_RATE] + b * shift
        for k in range(6 if angles else 0):
            if m.peak_legs[k] == n and m.peak_offsets[k] == t:
                r.by[ANGLES + k, j] = angle_of(d[TILT, j], d[SWING, j], k)
        if event == LANDING:
            d[TILT, j], d[SWING_RATE, j] = 0.0, d[SWING_RATE, j] + bob * d[TILT_RATE, j]
            d[TILT_RATE, j] *= 1.0 + block
        elif event == TURN:
            d[TILT_RATE, j] = 0.0
        r.shift[j] = 0.0 if event == END else shift


@compiled
def carry_through_leg(q, r, f, leg, directions, angles, m, n):
    """Carry the derivatives of a reader through leg n of a motion and past its event.

    If `angles`, this also stores the derivatives of the angles that are largest in the leg. The directions
    are those from the first to before the last of `directions`. `q` is the real plant.
    """
    first, last = directions
    if q.linear != 0.0 and f.harmonic:
        _carry_complex(r, f, leg, (first, min(last, STATE)), angles, m, n)
        if last > STATE:
            _carry_states(q, r, leg, (max(first, STATE), last), angles, m, n)
    else:
        _carry_complex(r, f, leg, directions, angles, m, n)


@compiled
def _uplift_leg(legs, count):
    """Return the index of the leg with which the block leaves its base for the first time.

    The result is -1 if the block never leaves its base, or if it does not start at rest.
    """
    if count > 0 and legs[0].kind != SLIP and legs[0].y[TILT] == 0.0:
        for n in range(1, count):
            if legs[n].kind == SLIP:
                return n
    return -1


@compiled
def _nearest_leg(q, f, legs, count):
    """Return the index of the leg of the free motion that starts nearest to the unstable equilibrium, or -1.

    On the border between overturning and falling back a motion stays there for a long time.
    """
    nearest, best = -1, math.inf
    for n in range(count - 1, -1, -1):
        leg = legs[n]
        if leg.piece < f.pieces:
            break
        # At rest in the unstable equilibrium the bob hangs still.
        tilt, y = unstable_tilt(q, leg.tilt, leg.direction), leg.y
        distance = abs(y[TILT] - tilt) + abs(y[SWING]) + abs(y[TILT_RATE]) + abs(y[SWING_RATE])
        if leg.kind == SLIP and distance < best:
            nearest, best = n, distance
    return nearest


@compiled
def read_derivatives(q, f, m, legs, r, directions, angles_only):
    """Write the derivatives of a motion into `r.by`, and return its growing coordinate, see
    `growing_coordinate`.

    They get the columns from the first to before the last of `directions`. What does not exist is not
    written. The reader must have its plants. If `angles_only`, the legs after the last of the largest angles
    and after the first uplift are not used.
    """
    count, (first, inputs), by = min(m.n_legs, len(legs)), directions, r.by
    start_reading(r, inputs)
    for k in range(6):
        if m.peak_legs[k] == _BEGINNING:
            for j in range(first, inputs):
                by[ANGLES + k, j] = angle_of(r.dy[TILT, j], r.dy[SWING, j], k)
    # Under a harmonic there is neither a first uplift nor a free motion.
    growing, uplift_leg, nearest, last = 0.0, -1, -1, count
    if not f.harmonic:
        uplift_leg, nearest = _uplift_leg(legs, count), _nearest_leg(q, f, legs, count)
    if angles_only:
        last = uplift_leg
        for k in range(3):
            last = max(last, m.peak_legs[larger_side(m, k)])
        last = min(count, 1 + last)
    for n in range(last):
        leg = legs[n]
        for j in range(first, inputs if n == uplift_leg else first):
            by[UPLIFT, j] = leg.piece * _plant(r, j).xi.imag / STEP + r.shift[j]
        for j in range(first, inputs if n == nearest else first):
            # This leg decides whether the block overturns or falls back.
            coordinate = growing_coordinate(_plant(r, j), leg.tilt, leg.direction, leg.y, r.dy, j)
            by[GROWING, j], growing = coordinate.imag / STEP, coordinate.real
        carry_through_leg(q, r, f, leg, directions, YES, m, n)
    for i in range(4):
        for j in range(first, inputs):
            by[END_STATE + i, j] = r.dy[i, j]
    return growing


@compiled
def unstable_tilt(q, tilt, direction):
    """Return the tilt at which a slipping block is in unstable equilibrium with a hanging bob, as a real
    number.

    `tilt` and `direction` are the signs of phi and phi'.
    """
    weight, up, k = q.weight.real, q.up.real, q.k.real
    if q.linear.real != 0.0:
        return (tilt * weight + direction * k) / up
    return tilt * np.arctan(weight / up) + direction * np.arcsin(k / np.sqrt(weight * weight + up * up))


@compiled
def growing_coordinate(q, tilt, direction, y, dy, j):
    """Return the coordinate of a state along the growing mode of the unstable equilibrium.

    It is zero on the border between overturning and falling back, under (4) near the equilibrium.
    """
    # The equations are linearised about the equilibrium. Only two coefficients differ from those of (25).
    phi, lever, up = unstable_tilt(q, tilt, direction), q.kappa, q.up
    # One Newton step gives the tilt its derivative. The inverse functions of complex numbers would take
    # Numba half a second.
    step = (tilt * q.weight + direction * q.k) / up - phi
    if q.linear.real == 0.0:
        sine, cosine = np.sin(phi), np.cos(phi)
        moment = up * sine - tilt * q.weight * cosine - direction * q.k
        step = -moment / (up * cosine + tilt * q.weight * sine)
        sine, cosine = sine + step * cosine, cosine - step * sine
        lever, up = tilt * q.nu * sine + q.kappa * cosine, q.up * cosine + tilt * q.weight * sine
    l0, l1, l2, l3 = growing_mode(q.m11, -q.pull * lever, -q.rho * lever, q.m22, q.c1, q.c2, up)
    y0, y1 = complex(y[TILT], dy[TILT, j] * STEP), complex(y[SWING], dy[SWING, j] * STEP)
    y2, y3 = complex(y[TILT_RATE], dy[TILT_RATE, j] * STEP), complex(y[SWING_RATE], dy[SWING_RATE, j] * STEP)
    return l0 * (y0 - phi - step) + l1 * y1 + l2 * y2 + l3 * y3


@compiled
def store_impacts(q, legs, count, impacts):
    """Write the times of all impacts and the rates after them into `impacts`, shape (n, 2).

    Unused rows are NaN.
    """
    k = 0
    for n in range(count):
        leg = legs[n]
        if leg.event == LANDING and k < len(impacts):
            impacts[k, _WHEN] = leg.piece * q.xi + leg.start + leg.duration
            # The next leg starts with the state after the impact. After the last impact the block rests.
            impacts[k, _RATE] = legs[n + 1].y[TILT_RATE] if n + 1 < count else 0.0
            k += 1
    impacts[k:] = np.nan


@compiled
def store_state_at(q, f, leg, t, w, out):
    """Write the state at the time `t` after the start of a leg into `out`.

    It has the columns of a history, of which `out` may have the first ones.
    """
    _terms(q, leg, load_at(q, f, leg.piece, leg.start), leg.order, w)
    out[TILT] = series.value_at(w, series.PHI, leg.order, t)
    out[SWING] = series.value_at(w, series.PSI, leg.order, t)
    out[TILT_RATE], out[TILT_PULL] = series.value_and_slope(w, series.V, leg.order, t)
    out[SWING_RATE], out[SWING_PULL] = series.value_and_slope(w, series.R, leg.order, t)
    if len(out) > _FORCING:
        out[_FORCING], out[_KIND], out[_SIDE] = (
            q.f * forcing_now(q, f, leg.piece, leg.start + t),
            leg.kind,
            leg.tilt,
        )


@compiled
def store_states(q, f, legs, count, times, w, out):
    """Write the states of a motion at increasing `times` into rows of `out`.

    A row is NaN for times after the end of the motion.
    """
    at, h = 0, span_of(q, f)
    for n in range(count):
        leg = legs[n]
        begin = leg.piece * h + leg.start
        delay = _ROUNDING * times[-1] if n == count - 1 else 0.0
        while at < len(times) and times[at] <= begin + leg.duration + delay:
            store_state_at(q, f, leg, times[at] - begin, w, out[at])
            at += 1
    out[at:] = np.nan
