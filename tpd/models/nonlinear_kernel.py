"""Compiled event loop of the nonlinear equations (4), for one motion after another in scalar code.

In a batch that is vectorised every motion waits for the one with the most events. Here each goes its own
way: a Taylor series carries it until its error would be too large, or to the first event, which is a root of
the series. The rules at events are those of `tpd.exact.contact` and `tpd.models.segmented`. Numba takes 0.3 s
to load: no module imports this one before it is needed.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.contact_kernel import mode_of
from tpd.exact.mode_kinds import REST, SLIP, STICK
from tpd.exact.plant import compiled, places
from tpd.models.nonlinear_series import (
    APART,
    DOWN,
    LEAN,
    PHI,
    PSI,
    SLACK,
    UP,
    R,
    V,
    free_until,
    held_series,
    largest_within,
    length_of,
    order_for,
    put_forcing,
    put_state,
    slipping_series,
    value_at,
)

REST_RATE = 1e-4
"""An impact slower than this (phi' in units of nu) that the block can be held after is rest."""
MAX_STEPS = 20_000
"""Bound on the series of one forcing period."""
_NONE, _LANDING, _TURN, _UP, _DOWN = -1, 0, 1, 2, 3
"""Events: of a slipping block the first two, of a held one its releases to either side."""
ARRIVED, LOST, EXHAUSTED, BROKEN = range(4)
"""Ends of a period."""

SIZES = 3
"""Numbers of a tally: largest phi, its opposite, and largest |psi|. A long tally has more."""
HIGH, LOW, SWUNG, RELATIVE, TIMES = places(5)
"""Places of a tally: largest phi, its opposite, largest |psi|; in a long one also largest |psi - phi|, and
the first of the times of all four."""
IMPACTS, LIFTED, ORIGIN, EVENTS, TALLY = 8, 9, 10, 11, 12
"""Further places of a long tally: impacts, time of the first uplift, time at which the clock was at zero, and
events; and how many numbers it has."""

Plant = namedtuple("Plant", "nu mu lam k f xi rho e m11 m22 c1 c2 tilt weight pull period rest")
"""Coefficients of (4) for one motion; `pull` is mu rho lam, and `rest` the largest rate of an impact that may
end in rest."""


@compiled
def plant(x, xi, period, rest_rate):
    """Coefficients from (nu, mu, lam, zeta, k, f, -, rho, e)."""
    nu, mu, lam, zeta, k, f, _, rho, e = x
    hinge = 2.0 * zeta * math.sqrt(lam * rho)
    m11, m22 = 1.0 + mu * rho * (4.0 + nu * nu), lam * rho
    coefficients = (m11, m22, mu * lam * hinge, hinge, 1.0 + 2.0 * mu, (1.0 + mu) * nu, mu * rho * lam)
    return Plant(nu, mu, lam, k, f, xi, rho, e, *coefficients, period, rest_rate * nu)


@compiled
def sine_at(q, growth, t):
    """sin(xi t) times the share of its full size that the shaking has; t from the start of a period. Where xi
    is 0, `growth` has the four coefficients of a cubic in its place."""
    if q.xi == 0.0:
        return growth[0] + t * (growth[1] + t * (growth[2] + t * growth[3]))
    return min(1.0, growth[0] + growth[1] * t) * math.sin(q.xi * t)


@compiled
def _swing(q, psi, rate, sine):
    """Acceleration of the bob under a block that is held."""
    return (q.f * math.cos(psi) * sine - math.sin(psi) - q.c2 * rate) / q.m22


@compiled
def _excess(q, phi, psi, rate, side, sine):
    """Moment on a held block minus the moment of its weight."""
    sp, cp, lean = math.sin(phi), math.cos(phi), phi - psi
    big_s = side * q.nu * math.sin(lean) + 2.0 * math.cos(lean)
    big_c = side * q.nu * math.cos(lean) - 2.0 * math.sin(lean)
    weight = side * q.weight
    on_block = q.tilt * sp - weight * cp - q.f * sine * (weight * sp + q.tilt * cp)
    bob = q.c1 * rate - q.pull * big_c * rate * rate + q.pull * big_s * _swing(q, psi, rate, sine)
    return on_block + bob


@compiled
def decide(q, phi, psi, rate, tilt, way, sine, mode):
    """Put the mode of a state into `mode`: `tilt` and `way` are the signs of phi and phi', zero included."""
    up = _excess(q, phi, psi, rate, 1.0 if tilt == 0.0 else tilt, sine)
    down = _excess(q, phi, psi, rate, -1.0, sine) if tilt == 0.0 else up
    mode[0], mode[1], mode[2] = mode_of(up, down, q.k + SLACK * (q.k + q.weight), tilt, way)


@compiled
def _series(q, growth, mode, t, left, order, inverse, c):
    """Put the series about the time t into `c`: its order, and the time for which it holds."""
    put_forcing(q, growth, t, order, c)
    if mode[0] == SLIP:
        used = slipping_series(q, mode[1], mode[2], order, left, inverse, c)
    else:
        side = 0.0 if mode[0] == REST else mode[1]
        used = held_series(q, side, order, left, inverse, c)
    return used, length_of(c, used, left, inverse)


@compiled
def _first_event(q, mode, order, h, c):
    """First event within the time h, and its time; without one, how far it is proved that there is none."""
    if mode[0] != SLIP:
        which, until = _NONE, h
        for release in (_UP, _DOWN):
            t, met = free_until(c, UP if release == _UP else DOWN, 1.0, order, q.k + q.weight, until)
            if met or t < until:
                which, until = (release if met else _NONE), t
        return which, until
    # Its acceleration is a difference of moments, and more uncertain than those that let it go.
    until, turns = free_until(c, V, mode[2], order, 10.0 * (q.k + q.weight) * h, h)
    # Until it turns, the block comes down monotonously: it lands where its tilt has another sign by then.
    if mode[1] != mode[2] and mode[1] * value_at(c, PHI, order, until) <= 0.0:
        landing, met = free_until(c, PHI, mode[1], order, 0.0, until)
        # Next to a graze the proof may end before the landing: the next series goes on from there.
        return (_LANDING if met or landing == until else _NONE), landing
    return (_TURN if turns else _NONE), until


@compiled
def _land(q, y, tilt, sine, mode):
    """Impact of a block that has come down from the side `tilt`: change the rates in `y`, and the mode."""
    # The impulse acts through the new corner. Block and bob together keep their angular momentum about it
    # but for the loss, and the bob keeps its velocity across the rod, which pulls along itself only.
    sq, cq, before = math.sin(y[1]), math.cos(y[1]), y[2]
    corner = tilt * q.nu
    old, new = 2.0 * sq + corner * cq, 2.0 * sq - corner * cq
    bob = q.mu * q.rho
    loss = q.e * (1.0 + bob * q.nu * q.nu) + bob * q.nu * q.nu
    inertia = 1.0 + bob * new * new
    # At most what conserves energy, as in `contact.impact_ratio`.
    ratio = min((loss + bob * new * old) / inertia, math.sqrt((1.0 + bob * old * old) / inertia))
    after = before if q.e == 1.0 else before * ratio
    if abs(after) <= q.rest:
        decide(q, 0.0, y[1], y[3], 0.0, 0.0, sine, mode)
        if mode[0] == REST:
            after = 0.0
    if after != before:
        y[3] += (2.0 * cq * (after - before) + corner * sq * (after + before)) / q.lam
    y[2] = after
    decide(q, 0.0, y[1], y[3], 0.0, math.copysign(1.0, after) if after != 0.0 else 0.0, sine, mode)


@compiled
def _meet(q, y, which, x, sine, mode):
    """Change the state and the mode at an event at the share x of a step."""
    if which == _LANDING:
        _land(q, y, mode[1], sine, mode)
    elif which == _TURN:
        decide(q, y[0], y[1], y[3], mode[1], 0.0, sine, mode)
        if x == 0.0 and mode[0] == SLIP:
            # It was let go at a moment that only touched the limit: it does not move.
            mode[0] = STICK if y[0] != 0.0 else REST
    else:
        side = 1.0 if which == _UP else -1.0
        mode[1] = side if mode[0] == REST else mode[1]
        mode[0], mode[2] = SLIP, side


@compiled
def _larger(sizes, k, angle, tau):
    """Put an angle into the tally if it is the largest so far, with its time where there is room."""
    if angle > sizes[k]:
        sizes[k] = angle
        if len(sizes) > SIZES:
            sizes[TIMES + k] = tau


@compiled
def _note_angle(c, row, rate, k, order, h, sizes, tau, last):
    """Put the largest size of an angle within the time h, which begins at `tau`, into place k of a tally;
    `last` is its value at the end."""
    bound, power = 0.0, 1.0
    for n in range(order + 1):
        bound += abs(c[row, n]) * power
        power *= h
    # Most steps are away from the largest angle, as a bound shows.
    if bound <= sizes[k]:
        return
    size, t = largest_within(c, row, rate, order, h, last)
    _larger(sizes, k, size, tau + t)


@compiled
def _note(c, order, h, sizes, tau, y):
    """Put the largest angles within the time h, which begins at `tau` and ends in the state `y`, into the
    tally."""
    _larger(sizes, HIGH, y[0], tau + h)
    _larger(sizes, LOW, -y[0], tau + h)
    _note_angle(c, PSI, R, SWUNG, order, h, sizes, tau, y[1])
    if len(sizes) > SIZES:
        for n in range(order + 1):
            c[APART, n], c[LEAN, n] = c[PSI, n] - c[PHI, n], c[R, n] - c[V, n]
        _note_angle(c, APART, LEAN, RELATIVE, order, h, sizes, tau, value_at(c, APART, order, h))


@compiled
def _count(sizes, which, mode, tau):
    """Put an event into a long tally."""
    sizes[EVENTS] += 1.0
    if which == _LANDING:
        sizes[IMPACTS] += 1.0
    if mode[0] == SLIP:
        sizes[LIFTED] = min(sizes[LIFTED], tau)


@compiled
def advance(q, growth, mode, clock, y, c, sizes, scales, end, rtol, max_events):
    """Follow the motion in `y` up to `end`; `clock` holds its time, mode[3] whether the block was held, and
    `c` has room for a series."""
    events, origin = 0, sizes[ORIGIN] if len(sizes) > SIZES else 0.0
    order, inverse = order_for(rtol), np.empty(3)
    inverse[2] = 1.0 / (rtol * (q.weight + q.k))
    for _ in range(MAX_STEPS):
        t, left = clock[0], end - clock[0]
        if left <= 1e-14 * q.period:
            return ARRIVED
        c[PHI, 0], c[PSI, 0], c[V, 0], c[R, 0] = y[0], y[1], y[2], y[3]
        for i in range(2):
            inverse[i] = 1.0 / (rtol * max(0.1 * scales[i + 2], abs(y[i + 2])))
        used, h = _series(q, growth, mode, t, left, order, inverse, c)
        if not h >= min(left, 1e-13 * q.period):
            return BROKEN
        # No step is repeated: the length of a step follows from its series.
        which, h = _first_event(q, mode, used, h, c)
        put_state(c, used, h, y)
        _note(c, used, h, sizes, origin + t, y)
        # Exactly on the event.
        if which == _LANDING:
            y[0] = 0.0
        elif which == _TURN:
            y[2] = 0.0
        clock[0] = end if h == left else t + h
        if not abs(y[0]) < 0.5 * math.pi:
            return LOST
        if which != _NONE:
            events += 1
            _meet(q, y, which, h, sine_at(q, growth, clock[0]), mode)
            mode[3] = 1.0 if mode[3] > 0.0 or mode[0] != SLIP else 0.0
            if len(sizes) > SIZES:
                _count(sizes, which, mode, origin + clock[0])
            if events >= max_events:
                return EXHAUSTED
    return EXHAUSTED
