"""Taylor series of a motion of the linear equations (25) or of the nonlinear equations (4), and their events.

The coefficients of order n + 1 follow from those of order n. Under (25) they are a linear function of them.
Each function in (4) is a product, a quotient, a sine or a cosine of others, so that its coefficient of order
n follows from lower coefficients of its factors (Jorba and Zou, Experimental Mathematics 14 (2005) 99). The
series gives the motion at all times of a step, to within the tolerance. A bound on its second derivative
proves where a signal has no event.

The series hold for real and for complex numbers. Complex numbers give derivatives: an input with the
imaginary part `STEP` gives results whose imaginary parts are `STEP` times their derivatives.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.columns import REST, SLIP, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.motion import MOTION
from tpd.compiled.plant import NONE, coefficients, compiled, places

ORDERS = 32
"""Largest number of coefficients of a series."""
PHI, V, PSI, R, APART, APART_RATE, FORCE = places(7)
"""Rows of the coefficients of phi, phi', psi, psi', psi - phi, psi' - phi', and of the forcing times f."""
_A, _B, _SIN, _COS, _S, _C, _CV, _CR, _ACC, _SWING = places(17, 7)
"""Rows of the terms of (4): moments of weight and of forcing, sine and cosine of psi, S and C of the lever
arms, C phi' and C psi', and both accelerations."""
VALUE, SLOPE = places(2)
"""Columns of the coefficients of orders zero and one, which are value and slope at the start of the
series."""
_OF_BLOCK, _OF_BOB, _OF_HELD = places(3)
"""Indices of the allowed errors: those of the rates of block and bob, and that of the moment on a held
block."""
UP, DOWN, ACCELERATION = places(20, 17)
"""Rows of the signals that release a held block, and of phi'' for `tpd.compiled.symmetric_orbit_kernel`."""
ROWS = 20
"""Number of rows."""
_STRIDE = np.dtype([("map", np.float64, (4, 8)), ("bends", np.float64, (4, 8)), ("ready", np.int64)])
WORK = np.dtype(
    [
        ("series", np.float64, (ROWS, ORDERS)),
        ("inverse", np.float64, (3,)),
        ("order", np.int64),
        *((name, np.float64) for name in ("rtol", "tiny", "capture", "rate", "swing", "period")),
        ("relative", np.bool_),
        ("of_strides", _STRIDE, (2,)),
        ("stride", np.float64),
        *((name, np.float64, (8,)) for name in ("z", "now")),
        ("trial", MOTION),
    ],
    align=True,
)
"""Workspace and options of a run: the coefficients of the `series`; the `inverse` of the allowed errors of
both rates and of the moment on a held block; the largest `order`; the relative tolerance `rtol` of a step;
the share of its size at which a signal counts as zero (`tiny`); the largest speed |phi'| of an impact that
may end in rest (`capture`); the usual rates of block and bob (`rate`, `swing`); `period`, the time scale for
rounding errors of times; and whether the largest |psi - phi| is computed (`relative`).

For `tpd.compiled.strides`: the strides of the slipping and of the held block (`of_strides`: the map of a
stride, the bounds of second derivatives, and whether both are known); the length of a `stride`; the state `z`
with the forcing at its start; the state with the bounds at its end (`now`); and another motion (`trial`)."""
_HALVED = 60
"""Number of halvings of an interval that contains a zero, after which only rounding errors are left."""
_STRETCHES = 64
"""Bound on the stretches of a step between the turns of an angle."""
_PROVED, _TINY, _TINY_LINEAR = 60, 1e-15, 1e-16
"""Number of steps of a proof, and the share of its size at which a signal counts as zero, under (4) and under
(25)."""
_SLACK = 150.0
"""Relative excess over the holding moment at which a held block is released, in units of this share.

Otherwise an excitation that just balances the weight would release the block again and again.
"""
_OVER = 1.0 / np.arange(1.0, ORDERS + 2.0)
"""1/(n + 1) for n = 0, 1, 2, ..."""


@compiled
def prepare(x, s, q, w):
    """Prepare plant and workspace for the parameters `x` and the settings `s`."""
    coefficients(x, s.linear, q)
    w.capture, w.of_strides[0].ready, w.of_strides[1].ready = s.rest_rate * q.nu, 0, 0
    set_accuracy(q, s.rtol, w)
    q.slack = _SLACK * w.tiny * (q.k + q.weight)


@compiled
def set_accuracy(q, rtol, w):
    """Set the relative tolerance of a step, and the largest order of a series."""
    w.tiny = _TINY_LINEAR if q.linear != 0.0 else _TINY
    w.rtol, w.inverse[_OF_HELD] = rtol, 1.0 / (rtol * (q.weight + q.k))
    # A step is cheapest if the series has half as many orders as the tolerance has digits in base e, and a
    # few more for the work of a step apart from its series. A held block needs two more columns.
    w.order = max(4, min(ORDERS - 3, 7 + int(-0.5 * math.log(rtol))))


@compiled
def _expand_forcing(q, e, order, w):
    """Write the coefficients of f times the forcing `e` into the series, see `tpd.compiled.forcing.Load`."""
    force = w.series[FORCE]
    if e.xi.real == 0.0:
        for n in range(4, order + 1):
            force[n] = 0.0
        for n, coefficient in enumerate((e.e0, e.e1, e.e2, e.e3)):
            force[n] = q.f * coefficient
        return
    # The series of a sine times a linear function: each pass differentiates sine and cosine, and divides by n
    # + 1.
    sine, cosine, before = q.f * np.sin(e.phase), q.f * np.cos(e.phase), 0.0 * e.phase
    for n in range(order + 1):
        force[n] = e.e0 * sine + e.e1 * before
        before, by = sine, e.xi * _OVER[n]
        sine, cosine = by * cosine, -by * sine


@compiled
def _term(c, n, inverse):
    """Return the largest coefficient of order n, divided by its allowed error.

    The coefficients are those of both rates, and of the signals of a held block.
    """
    rates = max(abs(c[V, n].real) * inverse[_OF_BLOCK], abs(c[R, n].real) * inverse[_OF_BOB])
    return max(rates, max(abs(c[UP, n].real), abs(c[DOWN, n].real)) * inverse[_OF_HELD])


@compiled
def _is_converged(c, n, power, former, inverse):
    """Whether the terms of orders n and n - 1 are within the allowed errors, at a time with these powers."""
    return _term(c, n, inverse) * power <= 1.0 and _term(c, n - 1, inverse) * former <= 1.0


@compiled
def expand_linear(q, m, e, remaining, most, w):
    """Compute the series of a moving block under (25), see `_expand_slipping`."""
    c, inverse = w.series, w.inverse
    # Weight and friction are constants, so that the tilt is measured from their equilibrium.
    centre, by_det = (m.tilt * q.weight + m.direction * q.k) / q.up, 1.0 / (q.m11 * q.m22 - q.m12 * q.m21)
    a11, a12, a21, a22 = by_det * q.m22, -by_det * q.m12, -by_det * q.m21, by_det * q.m11
    up, c1, c2 = q.up, q.c1, q.c2
    phi, psi, v, r = c[PHI, VALUE] - centre, c[PSI, VALUE], c[V, VALUE], c[R, VALUE]
    of_block, of_bob, power, former = inverse[_OF_BLOCK], inverse[_OF_BOB], 1.0, math.inf
    # The coefficients of the forcing, see `_expand_forcing`.
    e0, e1, e2, e3 = e.e0, e.e1, e.e2, e.e3
    sine, cosine, before = q.f * np.sin(e.phase), q.f * np.cos(e.phase), 0.0 * e.phase
    # The coefficients of order n are kept in local variables: each pass depends on the last one alone.
    for n in range(most):
        slip, by = v - r, _OVER[n]
        if e.xi.real != 0.0:
            force, before = e0 * sine + e1 * before, sine
            sine, cosine = e.xi * by * cosine, -e.xi * by * sine
        else:
            force, e0, e1, e2, e3 = q.f * e0, e1, e2, e3, 0.0 * e3
        # Both rows of (25) without the inertia, and their solution for the accelerations of order n.
        r1, r2 = up * (phi - force) - c1 * slip, force - psi + c2 * slip
        phi, psi = by * v, by * r
        v, r = by * (a11 * r1 + a12 * r2), by * (a21 * r1 + a22 * r2)
        c[PHI, n + 1], c[PSI, n + 1], c[V, n + 1], c[R, n + 1] = phi, psi, v, r
        power *= remaining
        # Two small terms in a row are needed, because a single one may vanish by chance.
        if n >= 3:
            term = max(abs(v.real) * of_block, abs(r.real) * of_bob) * power
            if term <= 1.0 and former <= 1.0:
                return n + 1
            former = term
    # The signals of a held block, of which the last orders are read.
    for n in range(most - 1, most + 1):
        c[UP, n] = c[DOWN, n] = 0.0
    return most


@compiled
def _expand_slipping(q, m, remaining, most, w):
    """Compute the series of a moving block under (4), and return its order.

    This is `most`, or a smaller one that is sufficient for the time `remaining`.
    """
    c, inverse = w.series, w.inverse
    pull, rho, weight, lever, high = q.pull, q.rho, m.tilt * q.weight, m.tilt * q.nu, q.kappa
    phi, psi = c[PHI, VALUE], c[PSI, VALUE]
    sp, cp, sq, cq = np.sin(phi), np.cos(phi), np.sin(psi), np.cos(psi)
    # Sine and cosine of phi - psi.
    sine, cosine = sp * cq - cp * sq, cp * cq + sp * sq
    c[_A, VALUE], c[_B, VALUE] = q.up * sp - weight * cp, weight * sp + q.up * cp
    c[_SIN, VALUE], c[_COS, VALUE] = sq, cq
    c[_S, VALUE], c[_C, VALUE] = lever * sine + high * cosine, lever * cosine - high * sine
    # The mass matrix contains S, of which only order zero multiplies the highest order of an acceleration.
    lever = c[_S, VALUE]
    # Friction is a constant, so that only order zero has it.
    friction, by_det = -m.direction * q.k + 0.0 * lever, 1.0 / (q.m11 * q.m22 - pull * rho * lever * lever)
    # Each pass adds one order to all rows. The sums are products of series (Cauchy products).
    power, former = 1.0, 1.0
    for n in range(most):
        a1 = b1 = s1 = c1 = cv = cr = c_sum = gb = gc = crr = cvv = on_bob = on_block = 0.0 * lever
        c[APART_RATE, n] = c[V, n] - c[R, n]
        # The sums of these four rows need terms of this order, which are added below.
        c[_CV, n] = c[_CR, n] = c[_ACC, n] = c[_SWING, n] = 0.0
        for j in range(n + 1):
            i = n - j
            v, r, force, s, cos = c[V, i], c[R, i], c[FORCE, i], c[_S, j], c[_C, j]
            # A' = B phi', B' = -A phi', (sin psi)' = cos psi psi', (cos psi)' = -sin psi psi', and with the
            # rate phi' - psi' also S' and C'.
            a1 += c[_B, j] * v
            b1 -= c[_A, j] * v
            s1 += c[_COS, j] * r
            c1 -= c[_SIN, j] * r
            cv += cos * v
            cr += cos * r
            c_sum -= s * c[APART_RATE, i]
            gb += c[_B, j] * force
            gc += c[_COS, j] * force
            cvv += c[_CV, j] * v
            crr += c[_CR, j] * r
            on_bob += s * c[_ACC, i]
            on_block += s * c[_SWING, i]
        c[_CV, n], c[_CR, n] = cv, cr
        # The centrifugal terms C phi'^2 and C psi'^2.
        cvv += cv * c[V, VALUE]
        crr += cr * c[R, VALUE]
        # Order n of the equations, which are solved for the accelerations of this order.
        r1 = c[_A, n] - gb - pull * (crr - on_block) - q.c1 * c[APART_RATE, n] + friction
        r2 = gc - c[_SIN, n] + rho * (cvv + on_bob) + q.c2 * c[APART_RATE, n]
        friction = 0.0 * lever
        c[_ACC, n] = by_det * (q.m22 * r1 + pull * lever * r2)
        c[_SWING, n] = by_det * (q.m11 * r2 + rho * lever * r1)
        # Integrate: order n of a rate gives order n + 1 of the function.
        by = 1.0 / (n + 1.0)
        c[PHI, n + 1], c[PSI, n + 1] = by * c[V, n], by * c[R, n]
        c[V, n + 1], c[R, n + 1] = by * c[_ACC, n], by * c[_SWING, n]
        c[_A, n + 1], c[_B, n + 1], c[_SIN, n + 1], c[_COS, n + 1] = by * a1, by * b1, by * s1, by * c1
        c[_S, n + 1], c[_C, n + 1] = by * (cv - cr), by * c_sum
        c[UP, n + 1] = c[DOWN, n + 1] = 0.0
        former, power = power, power * remaining
        if n >= 3 and _is_converged(c, n + 1, power, former, inverse):
            return n + 1
    return most


@compiled
def _expand_held_linear(q, m, remaining, most, w):
    """Compute the series of the bob under a held block under (25), see `_expand_held`."""
    c, inverse = w.series, w.inverse
    up, down = (1.0, -1.0) if m.kind == REST else (m.tilt, m.tilt)
    hold, power, former, still = q.k + q.slack, 1.0, 1.0, q.up * c[PHI, VALUE]
    # The moment on the block contains no derivative of the bob's rate, so that its order n follows at once.
    for n in range(most + 1):
        by, moment = _OVER[n], still - c[FORCE, n] - (q.up - 1.0) * c[PSI, n] + q.bias * c[R, n]
        c[PHI, n + 1], c[V, n], c[PSI, n + 1] = 0.0, 0.0, by * c[R, n]
        c[R, n + 1] = by * (c[FORCE, n] - c[PSI, n] - q.c2 * c[R, n]) / q.m22
        c[UP, n], c[DOWN, n] = hold + up * q.weight - moment, hold - down * q.weight + moment
        # Weight, friction and the tilt are constants, which only order zero has.
        up, down, hold, still = 0.0, 0.0, 0.0 * hold, 0.0 * still
        if n > 4 and _is_converged(c, n, power, former, inverse):
            return n
        former, power = power, power * remaining
    return most


@compiled
def _expand_held(q, m, remaining, most, w):
    """Compute the series of the bob under a held block under (4), and return its order.

    This includes the signals that are positive until the block is released.
    """
    c, inverse = w.series, w.inverse
    sp, cp = np.sin(c[PHI, VALUE]), np.cos(c[PHI, VALUE])
    up, down = (1.0, -1.0) if m.kind == REST else (m.tilt, m.tilt)
    c[_SIN, VALUE], c[_COS, VALUE] = np.sin(c[PSI, VALUE]), np.cos(c[PSI, VALUE])
    hold, pull, power, former = q.k + q.slack, q.pull, 1.0, 1.0
    for n in range(most + 2):
        gc = s1 = c1 = 0.0 * sp
        # The forcing of the bob, and the rates of sine and cosine of its angle.
        for j in range(n + 1):
            i = n - j
            gc += c[FORCE, j] * c[_COS, i]
            s1 += c[_COS, j] * c[R, i]
            c1 -= c[_SIN, j] * c[R, i]
        by = _OVER[n]
        c[PHI, n + 1] = c[V, n] = 0.0
        c[PSI, n + 1] = by * c[R, n]
        c[R, n + 1] = by * (gc - c[_SIN, n] - q.c2 * c[R, n]) / q.m22
        c[_SIN, n + 1], c[_COS, n + 1] = by * s1, by * c1
        if n > 0:
            # The signals of order n - 1. They contain the second derivative of the bob's direction (sin psi,
            # cos psi), of which s1 and c1 are the first one.
            before, weight = n - 1, 1.0 if n == 1 else 0.0
            along, across, force = n * (sp * s1 + cp * c1), n * (cp * s1 - sp * c1), c[FORCE, before]
            bob = q.c1 * c[R, before] + q.kappa * pull * across
            on_block = q.up * (weight * sp - force * cp) + bob
            of_side = pull * q.nu * along - q.weight * (weight * cp + force * sp)
            c[UP, before] = weight * hold - on_block - up * of_side
            c[DOWN, before] = weight * hold + on_block + down * of_side
            if n > 4 and _is_converged(c, before, power, former, inverse):
                return before
            former, power = power, power * remaining
    return most


@compiled
def terms(q, m, e, remaining, most, w):
    """Compute the series of a motion under the forcing `e`, and return its order.

    The series of `w` has the state in the column `VALUE`. `w` is a record `WORK`, or a reader of derivatives
    with a complex series. If the time `remaining` is infinite, the order is `most`.
    """
    if q.linear.real != 0.0 and m.kind == SLIP:
        return expand_linear(q, m, e, remaining, most, w)
    _expand_forcing(q, e, most + 1, w)
    if q.linear.real != 0.0:
        return _expand_held_linear(q, m, remaining, most, w)
    if m.kind == SLIP:
        return _expand_slipping(q, m, remaining, most, w)
    return _expand_held(q, m, remaining, most, w)


@compiled
def load_state(y, w):
    """Write a state into the column `VALUE` of a series."""
    c = w.series
    c[PHI, VALUE], c[PSI, VALUE], c[V, VALUE], c[R, VALUE] = y[TILT], y[SWING], y[TILT_RATE], y[SWING_RATE]


@compiled
def expand(q, m, y, e, remaining, w):
    """Compute the series of a motion from the state `y` on under the forcing `e`.

    Returns the order, and the time (at most `remaining`) for which the error is allowed. This time is NaN if
    the series is not finite.
    """
    set_errors(q, y, w)
    return step_of(terms(q, m, e, remaining, w.order, w), remaining, w)


@compiled
def set_errors(q, y, w):
    """Write the state `y` into the series, and set the allowed errors of a step from there."""
    load_state(y, w)
    # The equations (25) are solved to rounding, also for small motions.
    least = 1e-4 if q.linear != 0.0 else 0.1
    w.inverse[_OF_BLOCK] = 1.0 / (w.rtol * max(least * w.rate, abs(y[TILT_RATE])))
    w.inverse[_OF_BOB] = 1.0 / (w.rtol * max(least * w.swing, abs(y[SWING_RATE])))


@compiled
def step_of(order, remaining, w):
    """Return the order of a series, and the time for which its error is allowed, see `expand`."""
    c, smallest = w.series, math.inf
    # Under a ground motion the angle between rod and block is another result.
    for n in range(order + 1 if w.relative else 0):
        c[APART, n], c[APART_RATE, n] = c[PSI, n] - c[PHI, n], c[R, n] - c[V, n]
    if order < w.order:
        return order, remaining
    # The last two terms give the length of the step.
    for n in range(order - 1, order + 1):
        term = _term(c, n, w.inverse)
        if not term < math.inf:
            return order, math.nan
        if term > 0.0:
            smallest = min(smallest, -math.log(term) / n)
    return order, min(remaining, math.exp(smallest))


@compiled
def value_and_slope(w, row, order, t):
    """Return the value of a series and its rate at the time `t`."""
    c = w.series
    value = c[row, order]
    slope = 0.0 * value
    for n in range(order - 1, -1, -1):
        slope = slope * t + value
        value = value * t + c[row, n]
    return value, slope


@compiled
def value_at(w, row, order, t):
    """Return the value of a series at the time `t`."""
    c = w.series
    value = c[row, order]
    for n in range(order - 1, -1, -1):
        value = value * t + c[row, n]
    return value


@compiled
def time_at_limit(w, row, order, limit, h):
    """Return the time at which an angle reaches a limit that it has passed at the time h.

    The angle must not turn before h.
    """
    # This happens once, at the end of a run. Bisection is fast enough, and cannot fail.
    lo, hi = 0.0, h
    for _ in range(_HALVED):
        t = 0.5 * (lo + hi)
        if abs(value_at(w, row, order, t)) < limit:
            lo = t
        else:
            hi = t
    return hi


@compiled
def store_state(w, order, t, y):
    """Write the values of both angles and of their rates at the time `t` into `y`."""
    c = w.series
    # All four are evaluated together, so that the processor computes one while another one waits for its
    # product.
    phi, psi, v, r = c[PHI, order], c[PSI, order], c[V, order], c[R, order]
    for n in range(order - 1, -1, -1):
        phi, psi = phi * t + c[PHI, n], psi * t + c[PSI, n]
        v, r = v * t + c[V, n], r * t + c[R, n]
    y[TILT], y[SWING], y[TILT_RATE], y[SWING_RATE] = phi, psi, v, r


@compiled
def first_zero(w, row, sign, order, first, t, h):
    """Return the first time from t on at which a signal vanishes, and whether it does so before h.

    The signal is `sign` times the series, divided by the power `first` of the time. Without a zero the
    function returns the time until which the signal is proved to be positive.
    """
    c = w.series
    # Until h the second derivative is bounded from below by the sum of its negative terms.
    bend, tiny, power = 0.0, 0.0, 1.0
    for n in range(first + 2, order + 1):
        m = float(n - first)
        bend -= m * (m - 1.0) * min(sign * c[row, n], 0.0) * power
        power *= h
    # Near a root the steps get short like those of Newton's method. They come from one side, so that no root
    # is passed.
    for done in range(_PROVED):
        value, slope = sign * c[row, order], 0.0
        for n in range(order - 1, first - 1, -1):
            slope = slope * t + value
            value = value * t + sign * c[row, n]
        if done == 0:
            # At a former root the value is zero except for rounding.
            value, tiny = max(value, 0.0), _TINY * abs(value)
        elif value <= tiny:
            return t, True
        root = math.sqrt(slope * slope + 2.0 * bend * value)
        # Next zero of the parabola that bounds the signal from below, in a form without cancellation.
        if slope < 0.0:
            t += 2.0 * value / (root - slope)
        elif bend > 0.0:
            t += (slope + root) / bend
        else:
            return h, False
        if t >= h:
            return h, False
    return t, False


@compiled
def positive_until(w, row, sign, order, floor, h):
    """Return the time until which a signal is proved to be positive, and whether it vanishes then.

    The signal is `sign` times a series, and the time is at most h.

    From a time t on the signal is above the parabola through its value and slope that bends down as much as
    any term of the series can until h. The root of the parabola is the next t. `floor` is the size of the
    numbers of which the signal is a difference. A signal that starts at zero counts from there on.
    """
    c = w.series
    size, lowest, power = floor, 0.0, 1.0
    for n in range(order + 1):
        size += abs(c[row, n]) * power
        lowest += (min(sign * c[row, n], 0.0) if n > 0 else sign * c[row, n]) * power
        power *= h
    # The sum of the negative terms is too small for a zero. This is the usual case.
    if lowest > 10.0 * w.tiny * size:
        return h, False
    # If the signal starts at zero except for rounding, its sign is that of the next order. A state has no
    # rounding error: after an event it is zero.
    first, power = NONE, 1.0
    if row <= R and c[row, VALUE] != 0.0:
        size = 0.0
    while first < 3 and abs(c[row, first]) * power <= 10.0 * w.tiny * size:
        first, power = first + 1, power * h
    if not sign * c[row, first] > 0.0:
        return 0.0, True
    return first_zero(w, row, sign, order, first, 0.0, h)


@compiled
def largest_turn(w, row, order, h, threshold):
    """Return the largest angle, with its sign, at which an angle turns within the time h, and its time.

    Both are 0 if a bound shows that no such angle is larger than `threshold`. The row after that of the angle
    must hold its rate.
    """
    c = w.series
    bound, power = 0.0, 1.0
    for n in range(order + 1):
        bound += abs(c[row, n]) * power
        power *= h
    best, at, t, rate = 0.0, 0.0, 0.0, row + 1
    # In most steps the angle is far from its largest value.
    if bound <= threshold:
        return best, at
    sign = math.copysign(1.0, c[rate, VALUE] if c[rate, VALUE] != 0.0 else c[rate, SLOPE])
    # The proof of a stretch without a turn may end early, and then goes on from there.
    for _ in range(_STRETCHES):
        t, turns = first_zero(w, rate, sign, order, NONE, t, h)
        if t >= h:
            break
        value = value_at(w, row, order, t) if turns else 0.0
        sign = -sign if turns else sign
        if abs(value) > abs(best):
            best, at = value, t
    return best, at
